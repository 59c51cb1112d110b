"""Claim 5: section 9, the 6R arm."""

from __future__ import annotations

import numpy as np

from ...comparisons.run import MERGE, Run
from ...comparisons.runs.spec import BASELINE, ControllerSpec, RunSpec
from ...rows import Array, BoolArray
from ...rows.readable import amount
from ...simulation import intervals
from ..verdicts import Finding, claim, ends_of, finding, plural, rounds_to, shown_intervals
from .boundary import VANISHED, clear, fully_used, greatest_phi, phi_never_positive, smoothly

CASE = RunSpec("case-study-6r")
TRACKING = RunSpec("case-study-6r", ControllerSpec(BASELINE), {"qd0": [0.2, -0.2, 0.2, 0.6, -0.6, 0.6]})
"""From a start at which the camera turns about another axis than the one that leads to the goal."""

CASE_HALVED = RunSpec("case-study-6r", overrides={"sampling_time": 0.001})

SPHERE, RANGE, SPEED = "sphere[tip]", "range[joint 6]", "speed[joint 2]"
BORDERS = tuple(f"fov[marker {i}]" for i in (1, 2, 3, 4))
EVENTS = (*BORDERS, RANGE, SPEED, SPHERE)
"""What Fig. 11 draws a line for; a range or a speed is one line for both of its sides."""

Q6_RANGE, QD2_LIMIT = 1.2, 0.4
Q6_LIMIT = -0.5 + 0.5 * Q6_RANGE
"""What 9.1 prints of joint 6, its middle and its range [rad], and of joint 2, its speed [rad/s]."""

Interval = tuple[float, float]


def switch_sample(run: Run) -> int:
    """The first sample of the second phase, in which the second goal holds."""
    return int(np.searchsorted(run.t, run.setup.task.goals[1].from_time - 1e-9))


def phases(run: Run, event: str) -> tuple[list[Interval], list[Interval]]:
    """When the rows of an event act in the first and in the second phase."""
    k, active = switch_sample(run), active_of(run, event)
    return intervals(run.t[:k], active[:k], MERGE), intervals(run.t[k:], active[k:], MERGE)


def active_of(run: Run, event: str) -> BoolArray:
    """(N,) whether φ of any row of an event is at or above zero."""
    rows = [run.index(label) for label in run.labels(event)]
    return np.asarray((run.trajectory.phi[:, rows] >= 0.0).any(axis=1))


def at_once(run: Run) -> np.ndarray:
    """(N,) how many events act at a time, as intervals."""
    count = np.zeros(len(run.t), dtype=np.int64)
    for first, last in (span for event in EVENTS for phase in phases(run, event) for span in phase):
        count += (run.t >= first) & (run.t <= last)
    return count


claim("5b", CASE)(lambda case: fully_used(case, BORDERS[1], BORDERS[2]))
claim("5c", CASE)(lambda case: smoothly(case, BORDERS[1], BORDERS[2]))


@claim("5a", CASE)
def _errors_vanish_in_both_phases(case: Run) -> Finding:
    k, error = switch_sample(case), case.trajectory.camera_error
    values, texts = {}, []
    for phase, (first, last) in enumerate(((error[0], error[k - 1]), (error[k], error[-1])), start=1):
        values[f"position_left_{phase}"], values[f"orientation_left_{phase}"] = last / first
        texts.append(
            f"phase {phase}: {1e3 * first[0]:.0f} → {1e3 * last[0]:.1f} mm, {first[1]:.2f} → {last[1]:.4f} rad"
        )
    vanished = [left < VANISHED for left in values.values()]
    return finding("; ".join(texts), all(vanished), any(vanished), **values)


@claim("5d", CASE, CASE_HALVED)
def _all_constraints_fulfilled(case: Run, halved: Run) -> Finding:
    """How long φ ≥ 0 with half the sampling time tells sampling from too small a gain."""
    found = phi_never_positive(case, case.trajectory.labels)
    speed = max(greatest_phi(case, label) for label in case.labels("speed"))
    longest = max(map(halved.positive_samples, halved.trajectory.labels))
    broken = case.needed_share().max() >= 1.0
    why = "the printed gains break (12): this is not sampling" if broken else "the printed gains keep (12)"
    text = (
        f"{found.text}; {why}: with half the period φ ≥ 0 for {plural(longest)} in a row; the speed of joint 2 is at "
        f"most {100.0 * speed:.2f} % above its limit"
    )
    return Finding(found.verdict, text, {**found.values, "speed_excess": speed, "longest_halved": longest})


@claim("5e", CASE)
def _range_and_speed_act_first(case: Run) -> Finding:
    found = {event: phases(case, event) for event in (RANGE, SPEED)}
    text = "; ".join(f"{event} at {shown_intervals(first + second)}" for event, (first, second) in found.items())
    first = all(one for one, _ in found.values()) and not any(two for _, two in found.values())
    place, speed = case.trajectory.q[:, 5].max(), np.abs(case.trajectory.qd[:, 1]).max()
    near = 0.0 <= Q6_LIMIT - place <= 0.01 * Q6_RANGE and abs(speed - QD2_LIMIT) <= 0.01 * QD2_LIMIT
    text += f"; q₆ up to {place:.4f} rad of {Q6_LIMIT:g}, joint 2 up to {speed:.4f} rad/s of {QD2_LIMIT:g}"
    return finding(text, first and near, first, q6=place, qd2=speed)


@claim("5f", CASE)
def _sphere_acts(case: Run) -> Finding:
    first, second = phases(case, SPHERE)
    good = not first and rounds_to(second, [(6.0, 8.0)])
    return finding(f"active at {shown_intervals(first + second)}", good, bool(second), **ends_of(second))


@claim("5g", CASE)
def _borders_act(case: Run) -> Finding:
    found = {label: phases(case, label) for label in BORDERS}
    first, second = ({label for label in BORDERS if found[label][phase]} for phase in (0, 1))
    text = "; ".join(f"{label} at {shown_intervals(a + b)}" for label, (a, b) in found.items() if a or b)
    both, later = {BORDERS[1], BORDERS[2]}, {BORDERS[1]}
    good, part = (first, second) == (both, later), both <= first and later <= second
    return finding(text or "no border ever acts", good, part)


@claim("5h", CASE)
def _three_at_a_time(case: Run) -> Finding:
    count = at_once(case)
    most = int(count.max())
    when = case.t[count == most]
    same = int(np.sum([active_of(case, event) for event in EVENTS], axis=0)[count == most].max())
    text = (
        f"up to {most} intervals overlap ({when[0]:.2f}–{when[-1]:.2f} s); up to {same} rows have φ ≥ 0 in one sample"
    )
    return finding(text, most == 3, most > 1, most=most, same_sample=same)


@claim("5i", CASE)
def _sphere_fulfilled(case: Run) -> Finding:
    least, phi = clear(case, SPHERE), greatest_phi(case, SPHERE)
    text = f"the end-effector stays {1e3 * least:.3f} mm outside; max φ = {amount(phi)} m"
    return finding(text, least >= 0.0, clearance_min=least, phi_max=phi)


@claim("5j", TRACKING)
def _error_follows_its_polynomial(tracking: Run) -> Finding:
    """The six numbers of the error, and what (42) with the printed gains makes of them."""
    k = switch_sample(tracking)
    error = tracking.trajectory.error[:k]
    # to second order in T_s, and from nothing but the error itself
    rate = (4.0 * error[1] - 3.0 * error[0] - error[2]) / (2.0 * tracking.sampling_time)
    wanted = ideal_error(error[0], rate, tracking.t[:k])
    share = np.linalg.norm(error - wanted, axis=1).max() / np.linalg.norm(wanted[0])
    text = f"{100.0 * share:.2g} % of the error at the start, at most, in {k} samples"
    return finding(text, share <= VANISHED, share=share)


def ideal_error(start: Array, start_rate: Array, t: Array) -> Array:
    """(N, k) error at times (N,) from e and ė (k,), with K_T,p(0) = 20, slope 60 and K_T,v = 3 √K_T,p as in 9.1."""

    def rate(x: Array) -> Array:
        e, e_dot = x
        Kp = 20.0 * np.exp(-60.0 / 20.0 * np.sqrt((e**2).sum()))
        return np.array([e_dot, -Kp * e - 3.0 * np.sqrt(Kp) * e_dot])

    x, found = np.array([start, start_rate]), [start]
    for h in np.diff(t):  # Runge and Kutta
        a = rate(x)
        b = rate(x + 0.5 * h * a)
        c = rate(x + 0.5 * h * b)
        x = x + h / 6.0 * (a + 2.0 * b + 2.0 * c + rate(x + h * c))
        found.append(x[0])
    return np.array(found)
