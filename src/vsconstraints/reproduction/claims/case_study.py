"""Claim 5: section 9, the 6R arm."""

from __future__ import annotations

import numpy as np

from ...rows import Array
from ...simulation import intervals
from ..runs import MERGE, Run, RunSpec
from ..verdicts import Finding, claim, judged, rounds_to, shown_intervals
from .boundary import FULFILLED_RULE, VANISHED, fully_used, phi_never_positive, plural, signed, smoothly

CASE = RunSpec("case-study-6r")
TRACKING = RunSpec("case-study-6r", "tracking", overrides=(("qd0", (0.2, -0.2, 0.2, 0.6, -0.6, 0.6)),))
"""From a start at which the camera turns about another axis than the one that leads to the goal."""

CASE_HALVED = RunSpec("case-study-6r", overrides=(("sampling_time", 0.001),))

SPHERE, RANGE, SPEED = "sphere[tip]", "range[joint 6]", "speed[joint 2]"
BORDERS = tuple(f"fov[marker {i}]" for i in (1, 2, 3, 4))
EVENTS = (*BORDERS, RANGE, SPEED, SPHERE)
"""What Fig. 11 draws a line for; a range or a speed is one line for both of its sides."""

Q6_RANGE, QD2_LIMIT = 1.2, 0.4
Q6_LIMIT = -0.5 + 0.5 * Q6_RANGE
"""What 9.1 prints of joint 6, its middle and its range [rad], and of joint 2, its speed [rad/s]."""

Interval = tuple[float, float]


def switch_time(run: Run) -> float:
    """When the second goal holds [s]."""
    return run.setup.task.goals[1].from_time


def switch_sample(run: Run) -> int:
    """The first sample of the second phase."""
    return int(np.searchsorted(run.t, switch_time(run) - 1e-9))


def phases(run: Run, event: str) -> tuple[list[Interval], list[Interval]]:
    """When the rows of an event act in the first and in the second phase."""
    k, active = switch_sample(run), active_of(run, event)
    return intervals(run.t[:k], active[:k], MERGE), intervals(run.t[k:], active[k:], MERGE)


def active_of(run: Run, event: str) -> np.ndarray:
    """(N,) whether φ of any row of an event is at or above zero."""
    rows = [run.index(label) for label in run.labels(event)]
    return np.asarray((run.trajectory.phi[:, rows] >= 0.0).any(axis=1))


def at_once(run: Run) -> np.ndarray:
    """(N,) how many events act at a time, as intervals."""
    count = np.zeros(len(run.t), dtype=np.int64)
    for event in EVENTS:
        for first, last in (span for phase in phases(run, event) for span in phase):
            count += (run.t >= first) & (run.t <= last)
    return count


@claim(
    "5a",
    "9.2, Fig. 10",
    "the position and orientation error is made zero for both phases",
    "at the end of each phase less than 1 % of what it began with, in position and orientation; partly if in one",
    "fig-10.png",
    CASE,
)
def errors_vanish_in_both_phases(case: Run) -> Finding:
    """Distance and angle at the first and last sample of each phase."""
    k = switch_sample(case)
    error = case.trajectory.camera_error
    values, texts = {}, []
    for phase, (first, last) in enumerate(((error[0], error[k - 1]), (error[k], error[-1])), start=1):
        values[f"position_left_{phase}"], values[f"orientation_left_{phase}"] = (float(v) for v in last / first)
        texts.append(
            f"phase {phase}: {1e3 * first[0]:.0f} → {1e3 * last[0]:.1f} mm, {first[1]:.2f} → {last[1]:.4f} rad"
        )
    left = np.array(list(values.values()))
    return Finding(judged(bool((left < VANISHED).all()), bool((left < VANISHED).any())), "; ".join(texts), values)


@claim(
    "5b",
    "9.2, Fig. 10",
    "the second and third features remain in the FOV fully utilizing the allowed space",
    "clearance never negative and unused margin of at most 1 % of half the allowed image, for both",
    "fig-10.png",
    CASE,
)
def borders_fully_used(case: Run) -> Finding:
    """Least clearance of both markers."""
    return fully_used(case, BORDERS[1], BORDERS[2])


@claim(
    "5c",
    "9.2, Fig. 10",
    "reaching smoothly the boundary of the hyperellipse constraint",
    "the speed normal to the boundary never rises once the row acts, and at most 10 % of it is left 3 K later",
    "fig-10.png",
    CASE,
)
def borders_reached_smoothly(case: Run) -> Finding:
    """Normal speeds of both markers."""
    return smoothly(case, BORDERS[1], BORDERS[2])


@claim(
    "5d",
    "9.2, Fig. 11",
    "all the constraints are fulfilled, i.e., max(φ_i) ≤ 0",
    f"over all rows, {FULFILLED_RULE}",
    "fig-11.png",
    CASE,
    CASE_HALVED,
)
def all_constraints_fulfilled(case: Run, halved: Run) -> Finding:
    """φ and σ of all rows; how long φ ≥ 0 with half the sampling time tells sampling from too small a gain."""
    found = phi_never_positive(case, list(case.trajectory.labels))
    speed = max(float(case.phi(label).max()) for label in case.labels("speed"))
    longest = max(halved.positive_samples(label) for label in halved.trajectory.labels)
    broken = float(case.needed_share().max()) >= 1.0
    why = "the printed gains break (12): this is not sampling" if broken else "the printed gains keep (12)"
    text = (
        f"{found.text}; {why}: with half the period φ ≥ 0 for {plural(longest)} in a row; the speed of joint 2 is at "
        f"most {100.0 * speed:.2f} % above its limit"
    )
    return Finding(found.verdict, text, {**found.values, "speed_excess": speed, "longest_halved": float(longest)})


@claim(
    "5e",
    "9.2, Fig. 11",
    "the joint limit constraint for the sixth joint and the speed constraint for the second joint become active "
    "during the first phase",
    "both act in the first phase, neither in the second; then q₆ comes within 1 % of the printed range of its limit "
    "without exceeding it, and the speed of joint 2 within 1 % of its limit; partly if only the former",
    "fig-11.png",
    CASE,
)
def range_and_speed_act_first(case: Run) -> Finding:
    """When φ ≥ 0, and how near the joints come to the limits that the paper prints."""
    found = {event: phases(case, event) for event in (RANGE, SPEED)}
    text = "; ".join(f"{event} at {shown_intervals(first + second)}" for event, (first, second) in found.items())
    first, second = all(one for one, _ in found.values()), any(two for _, two in found.values())
    place, speed = float(case.trajectory.q[:, 5].max()), float(np.abs(case.trajectory.qd[:, 1]).max())
    near = 0.0 <= Q6_LIMIT - place <= 0.01 * Q6_RANGE and abs(speed - QD2_LIMIT) <= 0.01 * QD2_LIMIT
    text += f"; q₆ up to {place:.4f} rad of {Q6_LIMIT:g}, joint 2 up to {speed:.4f} rad/s of {QD2_LIMIT:g}"
    return Finding(judged(first and not second and near, first and not second), text, {"q6": place, "qd2": speed})


@claim(
    "5f",
    "9.2, Fig. 11",
    "the constraint for forbidden areas becomes active for the time interval 6-8 s during the second phase",
    "one interval, its ends within 0.5 s of those printed",
    "fig-11.png",
    CASE,
)
def sphere_acts(case: Run) -> Finding:
    """When φ ≥ 0."""
    first, second = phases(case, SPHERE)
    good = not first and rounds_to(second, [(6.0, 8.0)])
    values = {
        f"{side}_{k}": time for k, span in enumerate(second) for side, time in zip(("from", "to"), span, strict=True)
    }
    return Finding(judged(good, bool(second)), f"active at {shown_intervals(first + second)}", values)


@claim(
    "5g",
    "9.2, Fig. 11",
    "the FOV constraint becomes active for the second and third feature during the first phase and for the second "
    "feature during the second phase",
    "exactly these rows act in each phase",
    "fig-11.png",
    CASE,
)
def borders_act(case: Run) -> Finding:
    """Which markers' rows act when."""
    found = {label: phases(case, label) for label in BORDERS}
    acting = tuple([label for label in BORDERS if found[label][phase]] for phase in (0, 1))
    expected = ([BORDERS[1], BORDERS[2]], [BORDERS[1]])
    text = "; ".join(f"{label} at {shown_intervals(a + b)}" for label, (a, b) in found.items() if a or b)
    good = all(one == other for one, other in zip(acting, expected, strict=True))
    part = all(set(other) <= set(one) for one, other in zip(acting, expected, strict=True))
    return Finding(judged(good, part), text or "no border ever acts")


@claim(
    "5h",
    "9.2, Fig. 11",
    "in some phases of the simulation there are up to three active constraints at a time",
    "three at most, as overlapping intervals, at some time",
    "fig-11.png",
    CASE,
)
def three_at_a_time(case: Run) -> Finding:
    """How many intervals overlap, and how many rows have φ ≥ 0 in the same sample."""
    count = at_once(case)
    most = int(count.max())
    when = case.t[count == most]
    same = max(
        int(sum(active_of(case, event).astype(int)[k] for event in EVENTS)) for k in np.flatnonzero(count == most)
    )
    text = (
        f"up to {most} intervals overlap ({when[0]:.2f}–{when[-1]:.2f} s); up to {same} rows have φ ≥ 0 in one sample"
    )
    return Finding(judged(most == 3, most > 1), text, {"most": float(most), "same_sample": float(same)})


@claim(
    "5i",
    "9.2, Fig. 12",
    "this constraint [the spherical forbidden area] is fulfilled",
    "the end-effector never inside the sphere, between samples too",
    "fig-12.png",
    CASE,
)
def sphere_fulfilled(case: Run) -> Finding:
    """Least distance of the end-effector from the sphere."""
    least, phi = float(case.row(SPHERE)["clearance_min"]), float(case.phi(SPHERE).max())
    text = f"the end-effector stays {1e3 * least:.3f} mm outside; max φ = {signed(phi)} m"
    return Finding(judged(least >= 0.0), text, {"clearance_min": least, "phi_max": phi})


@claim(
    "5j",
    "4.4",
    "the dynamics (i.e., the poles) of this kinematic controller is given by the roots of the polynomial with "
    "coefficients [1 K_T,v K_T,p]",
    "with tracking alone, started in motion, the error of the first phase stays within 1 % of its norm at the start of "
    "the solution of ë = −K_T,p e − K_T,v ė, integrated apart from the simulation",
    "",
    TRACKING,
)
def error_follows_its_polynomial(tracking: Run) -> Finding:
    """The six numbers of the error, and what (42) with the printed gains makes of them."""
    k = switch_sample(tracking)
    error = tracking.trajectory.error[:k]
    # to second order in T_s, and from nothing but the error itself
    rate = (4.0 * error[1] - 3.0 * error[0] - error[2]) / (2.0 * tracking.sampling_time)
    wanted = ideal_error(error[0], rate, tracking.t[:k])
    apart = float(np.linalg.norm(error - wanted, axis=1).max())
    share = apart / float(np.linalg.norm(wanted[0]))
    text = f"{100.0 * share:.2g} % of the error at the start, at most, in {k} samples"
    return Finding(judged(share <= VANISHED), text, {"share": share})


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
