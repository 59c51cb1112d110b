"""Claims 1 to 5 and 12: sections 8 and 9, the planar arm and the case study, and computation time."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from ...comparisons.run import MERGE, Run
from ...comparisons.runs.spec import BASELINE, ControllerSpec, RunSpec
from ...rows import Array, BoolArray
from ...simulation import intervals
from ..texts import shown_intervals
from ..verdicts import Finding, claim, finding, register_formulas
from . import boundary
from .boundary import VANISHED, clear, excess, phi_never_positive

FOV = RunSpec("example-2d-fov")
FAST = RunSpec("example-2d-fast")
HIGH_GAIN = RunSpec("example-2d-fast-high-gain")
SAMPLED_FASTER = RunSpec("example-2d-fast-high-gain", overrides={"sampling_time": 0.001})
HALVED = RunSpec("example-2d-fov", overrides={"sampling_time": 0.0025})
BOWL = RunSpec("example-2d-bowl")
CONVEX = RunSpec("example-2d-heart-convex")
CONCAVE = RunSpec("example-2d-heart-concave")

FIRST, SECOND = "fov[marker 1]", "fov[marker 2]"
HEART, BOWL_ROW, OTHER_ROW = "occlusion[heart, marker 1]", "occlusion[bowl, marker 1]", "occlusion[bowl, marker 2]"
#: The heart's concave corner in Fig. 8, and its convex one in Fig. 7, where the heart is turned [px].
NOTCH, TIP = (-102.0, 35.0), (-137.0, 0.0)

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


def position(run: Run) -> Array:
    """(N,) distance between camera and goal [m]."""
    return run.trajectory.camera_error[:, 0]


def angle(run: Run) -> Array:
    """(N,) angle between camera and goal [rad]."""
    return run.trajectory.camera_error[:, 1]


def first_marker(run: Run) -> Array:
    """(N, 2) where it is in the image [px]."""
    return run.trajectory.features_px[:, 0]


def greatest_step(values: Array) -> float:
    """Of signals (N, k), from one sample to the next."""
    return float(np.abs(np.diff(values, axis=0)).max())


def band(run: Run) -> float:
    """Peak-to-peak φ while the second feature's row acts."""
    return float(np.ptp(run.while_sliding(SECOND)))


@claim("1e", FOV)
def _position_error_arises_and_vanishes(fov: Run) -> Finding:
    error, acts = position(fov), fov.active_intervals(SECOND)
    if not acts:
        return Finding("does not hold", "the constraint never becomes active")
    start, end = acts[0][0], acts[-1][1]
    peak, when = error.max(), float(fov.t[error.argmax()])
    before, last = error[fov.t < start].max(initial=0.0), error[-1]
    arises, vanishes = before < VANISHED * peak and start <= when <= end, last < VANISHED * peak
    values = {"before": before, "peak": peak, "peak_at": when, "last": last}
    return finding("1e", arises and vanishes, arises or vanishes, {"start": start}, **values)


@claim("3e", BOWL)
def _both_features_stay_out(bowl: Run) -> Finding:
    labels = BOWL_ROW, OTHER_ROW
    both, needed = phi_never_positive(bowl, labels), bowl.drift[:, bowl.index(OTHER_ROW)].max()
    rows = [
        (row, bowl.phi(row).max(), excess(bowl, row), bowl.positive_samples(row), clear(bowl, row)) for row in labels
    ]
    shown = {"rows": rows, "needed": needed}
    return finding("3e", both.verdict == "holds", both.verdict == "holds partly", shown, **both.values)


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

    def rate(_: float, x: Array) -> Array:
        e, e_dot = x.reshape(2, -1)
        Kp = 20.0 * np.exp(-60.0 / 20.0 * np.linalg.norm(e))
        return np.concatenate((e_dot, -Kp * e - 3.0 * np.sqrt(Kp) * e_dot))

    ends = (float(t[0]), float(t[-1]))
    found = solve_ivp(rate, ends, np.concatenate((start, start_rate)), t_eval=t, rtol=1e-9, atol=1e-12)
    return np.asarray(found.y[: len(start)].T)


register_formulas(vars(boundary) | globals())
