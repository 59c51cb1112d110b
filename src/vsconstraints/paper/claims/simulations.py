"""Claims 1 to 5 and 12 (sections 8 and 9): planar arm, case study, and computation time."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from ...comparisons.run import MERGE, Run
from ...comparisons.runs.spec import BASELINE, ControllerSpec, RunSpec
from ...rows import Array, BoolArray
from ...simulation import intervals
from ..verdicts import Finding, NotMeasured, claim, finding, register_formulas
from . import boundary
from .boundary import VANISHED

FOV = RunSpec("example-2d-fov")
FAST = RunSpec("example-2d-fast")
HIGH_GAIN = RunSpec("example-2d-fast-high-gain")
SAMPLED_FASTER = RunSpec("example-2d-fast-high-gain", overrides={"sampling_time": 0.001})
HALVED = RunSpec("example-2d-fov", overrides={"sampling_time": 0.0025})
BOWL = RunSpec("example-2d-bowl")
CONVEX = RunSpec("example-2d-heart-convex")
CONCAVE = RunSpec("example-2d-heart-concave")

FIRST = "fov[marker 1]"
SECOND = "fov[marker 2]"
HEART = "occlusion[heart, marker 1]"
BOWL_ROW = "occlusion[bowl, marker 1]"
OTHER_ROW = "occlusion[bowl, marker 2]"
#: Concave corner of the heart in Fig. 8, and convex corner in Fig. 7, where the heart is turned
#: [px].
NOTCH = (-102.0, 35.0)
TIP = (-137.0, 0.0)

CASE = RunSpec("case-study-6r")
#: Case study from a start at which the camera turns about another axis than the one to the goal.
TRACKING = RunSpec(
    "case-study-6r", ControllerSpec(BASELINE), {"qd0": [0.2, -0.2, 0.2, 0.6, -0.6, 0.6]}
)

CASE_HALVED = RunSpec("case-study-6r", overrides={"sampling_time": 0.001})

SPHERE = "sphere[tip]"
RANGE = "range[joint 6]"
SPEED = "speed[joint 2]"
BORDERS = tuple(f"fov[marker {i}]" for i in (1, 2, 3, 4))
#: Events with a line in Fig. 11; a range or a speed is one line for both of its sides.
EVENTS = (*BORDERS, RANGE, SPEED, SPHERE)

Q6_RANGE = 1.2
QD2_LIMIT = 0.4
#: Limits printed in 9.1: joint 6, its middle and its range [rad]; joint 2, its speed [rad/s].
Q6_LIMIT = -0.5 + 0.5 * Q6_RANGE

PARAMETERS = (0.1, 0.2, 0.4)
APPROACHES = tuple(RunSpec("example-2d-fov", overrides={"constraints.0.K": K}) for K in PARAMETERS)
PRINTED_TIME = 20e-6  #: Time of one iteration according to the paper [s].


def position(run: Run) -> Array:
    """Distance (N,) between camera and goal [m]."""
    return run.trajectory.camera_error[:, 0]


def angle(run: Run) -> Array:
    """Angle (N,) between camera and goal [rad]."""
    return run.trajectory.camera_error[:, 1]


def first_marker(run: Run) -> Array:
    """Position (N, 2) of the first marker in the image [px]."""
    return run.trajectory.features_px[:, 0]


def greatest_step(values: Array) -> float:
    """Greatest change of signals (N, k) from one sample to the next."""
    return float(np.abs(np.diff(values, axis=0)).max())


def band(run: Run) -> float:
    """Peak-to-peak φ while the second feature's row is active."""
    return float(np.ptp(run.while_sliding(SECOND)))


@claim("1e", FOV)
def _position_error_arises_and_vanishes(fov: Run) -> Finding:
    error = position(fov)
    acts = fov.active_intervals(SECOND)
    if not acts:
        return Finding("does not hold", "the constraint never becomes active")
    start = acts[0][0]
    end = acts[-1][1]
    peak = error.max()
    when = float(fov.t[error.argmax()])
    before = error[fov.t < start].max(initial=0.0)
    last = error[-1]
    arises = before < VANISHED * peak and start <= when <= end
    vanishes = last < VANISHED * peak
    values = {"before": before, "peak": peak, "peak_at": when, "last": last}
    return finding("1e", arises and vanishes, arises or vanishes, {"start": start}, **values)


def switch_sample(run: Run) -> int:
    """Return the first sample of the second phase, in which the second goal holds."""
    return int(np.searchsorted(run.t, run.setup.task.goals[1].from_time - 1e-9))


def active_of(run: Run, event: str) -> BoolArray:
    """Mask (N,) of the samples in which φ of any row of an event is at or above zero."""
    rows = [run.index(label) for label in run.labels(event)]
    return np.asarray((run.trajectory.phi[:, rows] >= 0.0).any(axis=1))


def phases(run: Run, event: str) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Return the intervals of activity of an event's rows in the first and in the second phase."""
    k = switch_sample(run)
    active = active_of(run, event)
    return intervals(run.t[:k], active[:k], MERGE), intervals(run.t[k:], active[k:], MERGE)


def at_once(run: Run) -> np.ndarray:
    """Number (N,) of events that are active at a time, by their intervals."""
    count = np.zeros(len(run.t), dtype=np.int64)
    for first, last in (span for event in EVENTS for phase in phases(run, event) for span in phase):
        count += (run.t >= first) & (run.t <= last)
    return count


def acting_borders(run: Run, phase: int) -> list[str]:
    """Return the image borders that are active in the first (0) or the second phase."""
    return [label for label in BORDERS if phases(run, label)[phase]]


@claim("5h", CASE)
def _three_at_a_time(case: Run) -> Finding:
    count = at_once(case)
    most = int(count.max())
    same = int(np.sum([active_of(case, event) for event in EVENTS], axis=0)[count == most].max())
    return finding(
        "5h", most == 3, most > 1, {"when": case.t[count == most]}, most=most, same_sample=same
    )


def ideal_error(start: Array, start_rate: Array, t: Array) -> Array:
    """Error (N, k) at times (N,), integrated from e and ė (k,).

    The gains are K_T,p(0) = 20, slope 60 and K_T,v = 3 √K_T,p as in 9.1.
    """

    def rate(_: float, x: Array) -> Array:
        e, e_dot = x.reshape(2, -1)
        Kp = 20.0 * np.exp(-60.0 / 20.0 * np.linalg.norm(e))
        return np.concatenate((e_dot, -Kp * e - 3.0 * np.sqrt(Kp) * e_dot))

    ends = (float(t[0]), float(t[-1]))
    found = solve_ivp(
        rate, ends, np.concatenate((start, start_rate)), t_eval=t, rtol=1e-9, atol=1e-12
    )
    return np.asarray(found.y[: len(start)].T)


@claim("7b", *APPROACHES)
def _approach_follows_the_parameter(*runs: Run) -> Finding:
    constants = dict(zip(PARAMETERS, map(time_constant, runs), strict=True))
    good = all(abs(tau / K - 1.0) <= 0.25 for K, tau in constants.items())
    rising = bool((np.diff(list(constants.values())) > 0.0).all())
    return finding(
        "7b",
        good,
        rising,
        {"constants": constants},
        **{str(K): tau for K, tau in constants.items()},
    )


def time_constant(run: Run) -> float:
    """Time constant of the second marker's normal speed, over 2 K from its row's first activity."""
    acts = run.phi(SECOND) >= 0.0
    if not acts.any():
        raise NotMeasured("the row never acts")
    first = run.t[acts.argmax()]
    K = run.constraint(SECOND).K
    during = (run.t >= first) & (run.t <= first + 2.0 * K)
    speed = np.maximum(run.approach_speed(SECOND)[during], 1e-6)
    return -1.0 / float(np.polyfit(run.t[during], np.log(speed), 1)[0])


register_formulas(vars(boundary) | globals())
