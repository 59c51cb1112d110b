"""Claims 5 and 12: section 9, the 6R arm, and computation time."""

from __future__ import annotations

import numpy as np

from ...comparisons.run import MERGE, Run
from ...comparisons.runs.spec import BASELINE, ControllerSpec, RunSpec
from ...rows import Array, BoolArray
from ...simulation import intervals
from ..texts import shown_intervals
from ..verdicts import Finding, claim, finding, register_formulas
from . import boundary
from .boundary import VANISHED

CASE = RunSpec("case-study-6r")
#: From a start at which the camera turns about another axis than the one that leads to the goal.
TRACKING = RunSpec("case-study-6r", ControllerSpec(BASELINE), {"qd0": [0.2, -0.2, 0.2, 0.6, -0.6, 0.6]})

CASE_HALVED = RunSpec("case-study-6r", overrides={"sampling_time": 0.001})

SPHERE, RANGE, SPEED = "sphere[tip]", "range[joint 6]", "speed[joint 2]"
BORDERS = tuple(f"fov[marker {i}]" for i in (1, 2, 3, 4))
#: What Fig. 11 draws a line for; a range or a speed is one line for both of its sides.
EVENTS = (*BORDERS, RANGE, SPEED, SPHERE)

Q6_RANGE, QD2_LIMIT = 1.2, 0.4
#: What 9.1 prints of joint 6, its middle and its range [rad], and of joint 2, its speed [rad/s].
Q6_LIMIT = -0.5 + 0.5 * Q6_RANGE

PRINTED_TIME = 20e-6  #: Time of one iteration that the paper gives [s].

Phases = tuple[list[tuple[float, float]], list[tuple[float, float]]]


def switch_sample(run: Run) -> int:
    """The first sample of the second phase, in which the second goal holds."""
    return int(np.searchsorted(run.t, run.setup.task.goals[1].from_time - 1e-9))


def active_of(run: Run, event: str) -> BoolArray:
    """(N,) whether φ of any row of an event is at or above zero."""
    rows = [run.index(label) for label in run.labels(event)]
    return np.asarray((run.trajectory.phi[:, rows] >= 0.0).any(axis=1))


def phases(run: Run, event: str) -> Phases:
    """When the rows of an event act in the first and in the second phase."""
    k, active = switch_sample(run), active_of(run, event)
    return intervals(run.t[:k], active[:k], MERGE), intervals(run.t[k:], active[k:], MERGE)


def at_once(run: Run) -> np.ndarray:
    """(N,) how many events act at a time, as intervals."""
    count = np.zeros(len(run.t), dtype=np.int64)
    for first, last in (span for event in EVENTS for phase in phases(run, event) for span in phase):
        count += (run.t >= first) & (run.t <= last)
    return count


@claim("5a", CASE)
def _errors_vanish_in_both_phases(case: Run) -> Finding:
    """Distances and angles at the beginning and the end of each phase."""
    k, error = switch_sample(case), case.trajectory.camera_error
    ends = error[[0, k - 1]], error[[k, -1]]
    values = {
        f"{part}_left_{phase}": last / first
        for phase, (begin, end) in enumerate(ends, start=1)
        for part, first, last in zip(("position", "orientation"), begin, end, strict=True)
    }
    vanished = [left < VANISHED for left in values.values()]
    return finding("5a", all(vanished), any(vanished), {"phases": ends}, **values)


@claim("5e", CASE)
def _range_and_speed_act_first(case: Run) -> Finding:
    acts = {event: phases(case, event) for event in (RANGE, SPEED)}
    first = all(one for one, _ in acts.values()) and not any(two for _, two in acts.values())
    place, speed = case.trajectory.q[:, 5].max(), np.abs(case.trajectory.qd[:, 1]).max()
    near = 0.0 <= Q6_LIMIT - place <= 0.01 * Q6_RANGE and abs(speed - QD2_LIMIT) <= 0.01 * QD2_LIMIT
    shown = {"events": events_text(acts), "q6_limit": Q6_LIMIT, "qd2_limit": QD2_LIMIT}
    return finding("5e", first and near, first, shown, q6=place, qd2=speed)


@claim("5g", CASE)
def _borders_act(case: Run) -> Finding:
    acts = {label: phases(case, label) for label in BORDERS}
    first, second = ({label for label in BORDERS if acts[label][phase]} for phase in (0, 1))
    both, later = {BORDERS[1], BORDERS[2]}, {BORDERS[1]}
    good, part = (first, second) == (both, later), both <= first and later <= second
    return finding("5g", good, part, {"events": events_text(acts) or "no border ever acts"})


def events_text(acts: dict[str, Phases]) -> str:
    """When events act, in either phase; those that never do are left out."""
    return "; ".join(f"{event} at {shown_intervals(a + b)}" for event, (a, b) in acts.items() if a or b)


@claim("5h", CASE)
def _three_at_a_time(case: Run) -> Finding:
    count = at_once(case)
    most = int(count.max())
    same = int(np.sum([active_of(case, event) for event in EVENTS], axis=0)[count == most].max())
    return finding("5h", most == 3, most > 1, {"when": case.t[count == most]}, most=most, same_sample=same)


@claim("5j", TRACKING)
def _error_follows_its_polynomial(tracking: Run) -> Finding:
    """The six numbers of the error, and what (42) with the printed gains makes of them."""
    k = switch_sample(tracking)
    error = tracking.trajectory.error[:k]
    # to second order in T_s, and from nothing but the error itself
    rate = (4.0 * error[1] - 3.0 * error[0] - error[2]) / (2.0 * tracking.sampling_time)
    wanted = ideal_error(error[0], rate, tracking.t[:k])
    share = np.linalg.norm(error - wanted, axis=1).max() / np.linalg.norm(wanted[0])
    return finding("5j", share <= VANISHED, False, {"samples": k}, share=share)


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


register_formulas(vars(boundary) | globals())
