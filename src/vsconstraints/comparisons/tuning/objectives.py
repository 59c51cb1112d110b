"""How settings are judged: three objectives and one constraint, as means over training runs, and the front of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np


class Objective(NamedTuple):
    """A quantity to be minimized, by its name in files and in reports.

    ``worst`` bounds it from above and is that of a run that does not converge: the reference point of hypervolumes.
    ``unit`` weighs as much as one unit of another objective where one setting is chosen.
    """

    column: str
    title: str
    worst: float
    unit: float


#: A tenth of the space, a decade of variation and a tenth of the settling time weigh the same.
OBJECTIVES = (
    Objective("unused", "unused space", 1.0, 0.1),
    Objective("log_variation", "log₁₀ of acceleration variation", 4.0, 1.0),
    Objective("settling", "settling time by that of tracking", 2.0, 0.1),
)

REFERENCE = tuple(objective.worst for objective in OBJECTIVES)

STILL_MOVING = ("slow", "unfinished")  #: statuses of runs that are still moving when time is up
ROUNDING = 1e-12  #: distances that differ by less, relatively, are the same

Point = tuple[float, ...]  #: a value of each objective


class Outcome(NamedTuple):
    """Status of one run, whether a constraint was violated, and the objectives; NaN where the run has none."""

    status: str
    violated: bool
    point: Point


FAILED = Outcome("failed", False, REFERENCE)


class Judged(NamedTuple):
    """Means of a setting's objectives, share of runs with a violation, and how many runs there are and converge."""

    point: Point
    violations: float
    runs: int
    converged: int


def outcome(result: Mapping[str, Any], baseline: Mapping[str, Any]) -> Outcome:
    """The outcome of a run, from its line of results and that of the unconstrained baseline in the same scene.

    A run that does not converge has the worst value of every objective. If it is still moving when time is up and the
    baseline is too, its goal is out of reach for every law, because of wrong images, say: it counts by its variation
    alone. Of one that converges, the unused space is left out where nothing was challenged, and the settling time where
    the baseline does not settle.
    """
    status, violated = str(result["status"]), bool(result["violated"])
    if status != "converged" and not {status, str(baseline["status"])}.issubset(STILL_MOVING):
        return Outcome(status, violated, REFERENCE)
    variation, tracking = float(result["acceleration_variation"]), float(baseline["settling_time_s"])
    values = (
        1.0 - float(result["utilization"]),
        math.log10(variation) if variation > 0.0 else -math.inf,
        float(result["settling_time_s"]) / tracking if tracking > 0.0 else math.nan,
    )
    # log10 of a command that never changes has no lower bound
    bounded = (
        value if math.isnan(value) else min(max(value, -worst), worst)
        for value, worst in zip(values, REFERENCE, strict=True)
    )
    return Outcome(status, violated, tuple(bounded))


def judged(outcomes: Sequence[Outcome]) -> Judged:
    """All outcomes of one setting; an objective that no run has is at its worst. The order of runs does not matter."""
    point = []
    for i, worst in enumerate(REFERENCE):
        values = [each.point[i] for each in outcomes if not math.isnan(each.point[i])]
        point.append(math.fsum(values) / len(values) if values else worst)
    violated = sum(each.violated for each in outcomes)
    converged = sum(each.status == "converged" for each in outcomes)
    return Judged(tuple(point), violated / len(outcomes), len(outcomes), converged)


def front(points: Sequence[Point]) -> list[int]:
    """Positions of the points that no other dominates; of equal ones the first."""
    import moocore

    if not points:
        return []
    # which of equal points moocore leaves out differs from version to version
    best = np.flatnonzero(moocore.is_nondominated(np.array(points), keep_weakly=True))
    return sorted({points[i]: int(i) for i in best[::-1]}.values())


def hypervolume(points: Sequence[Point], reference: Point = REFERENCE) -> float:
    """Volume that the points dominate up to the reference point; 0 if none is better than it in every objective."""
    import moocore

    inside = [point for point in points if all(a < b for a, b in zip(point, reference, strict=True))]
    return float(moocore.hypervolume(np.array(inside), ref=np.array(reference))) if inside else 0.0


def choose(points: Sequence[Point]) -> int:
    """Position of the point nearest to the ideal one, which has the least value of each objective on the front.

    Distances are Euclidean, in the objectives' units, which are the same for all laws. Of points as near as each other,
    to rounding, the one with the least first objective is taken, then second, third; of equal ones the first.
    ("Compromise programming": Zeleny 1973.)
    """
    best = front(points)
    on_front = np.array([points[i] for i in best]) / [objective.unit for objective in OBJECTIVES]
    distance = np.linalg.norm(on_front - on_front.min(axis=0), axis=1)
    nearest = np.flatnonzero(distance <= distance.min() * (1.0 + ROUNDING))
    return min((best[i] for i in nearest), key=lambda i: (points[i], i))
