"""What settings are judged by: three objectives and one constraint, as means over training runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np


class Objective(NamedTuple):
    """What is to be small.

    Attributes
    ----------
    column
        Its name in files.
    title
        Its name in reports.
    worst
        What a run counts as that does not converge, and at most: the reference point of hypervolumes.
    unit
        What weighs as much as one unit of another objective where one setting is chosen.
    """

    column: str
    title: str
    worst: float
    unit: float


OBJECTIVES = (
    Objective("unused", "unused space", 1.0, 0.1),
    Objective("log_variation", "log₁₀ of acceleration variation", 4.0, 1.0),
    Objective("settling", "settling time by that of tracking", 2.0, 0.1),
)
"""A tenth of the space, a decade of variation and a tenth of the settling time weigh the same."""

REFERENCE = tuple(objective.worst for objective in OBJECTIVES)

STILL_MOVING = ("slow", "unfinished")
"""Statuses of runs that are still moving when time is up."""

Point = tuple[float, ...]
"""A value of each objective."""


class Outcome(NamedTuple):
    """What one run says of a setting.

    Attributes
    ----------
    status
        Of the run.
    violated
        Whether a row was.
    point
        The objectives; NaN where the run says nothing of one.
    """

    status: str
    violated: bool
    point: Point


FAILED = Outcome("failed", False, REFERENCE)
"""A run that came to nothing."""


class Judged(NamedTuple):
    """A setting's outcomes, taken together.

    Attributes
    ----------
    point
        Mean of each objective over the runs that say something of it; its worst value if none does.
    violations
        Share of runs with a violated row.
    runs, converged
        How many there are, and how many of them converge.
    """

    point: Point
    violations: float
    runs: int
    converged: int


def outcome(result: Mapping[str, Any], baseline: Mapping[str, Any]) -> Outcome:
    """What a run says, by its line of results and that of tracking alone in the same scene.

    A run that does not converge has the worst value of every objective, unless it is still moving when time is up and
    tracking alone is too: a goal that wrong images keep everyone from says nothing of a law, and what is left of such a
    run is its variation. Of one that converges, the unused space is left out where nothing was challenged, and the
    settling time where tracking alone does not settle.
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
    # log10 of a command that never changes has no bound from below
    bounded = (
        value if math.isnan(value) else min(max(value, -objective.worst), objective.worst)
        for value, objective in zip(values, OBJECTIVES, strict=True)
    )
    return Outcome(status, violated, tuple(bounded))


def judged(outcomes: Sequence[Outcome]) -> Judged:
    """All outcomes of one setting, in an order that is always the same."""
    columns = zip(*(one.point for one in outcomes), strict=True)
    point = tuple(
        _mean([value for value in column if not math.isnan(value)], objective.worst)
        for column, objective in zip(columns, OBJECTIVES, strict=True)
    )
    violated = sum(one.violated for one in outcomes)
    converged = sum(one.status == "converged" for one in outcomes)
    return Judged(point, violated / len(outcomes), len(outcomes), converged)


def _mean(values: Sequence[float], otherwise: float) -> float:
    return math.fsum(values) / len(values) if values else otherwise


def scaled(points: Sequence[Point]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(p, 3) points in units of the objectives."""
    return np.array(points, dtype=np.float64) / [objective.unit for objective in OBJECTIVES]


ROUNDING = 1e-12
"""Distances that differ by less, relatively, are the same."""


def front(points: Sequence[Point]) -> list[int]:
    """Where the points are that no other dominates; of equal ones the first."""
    import moocore

    if not points:
        return []
    # which of equal points moocore leaves out differs from version to version
    best = np.flatnonzero(moocore.is_nondominated(np.array(points), keep_weakly=True))
    return sorted({points[i]: int(i) for i in best[::-1]}.values())


def hypervolume(points: Sequence[Point], reference: Point = REFERENCE) -> float:
    """Volume of what the points dominate, as far as the reference point; 0 if none is better than it in everything."""
    import moocore

    inside = [point for point in points if all(a < b for a, b in zip(point, reference, strict=True))]
    return float(moocore.hypervolume(np.array(inside), ref=np.array(reference))) if inside else 0.0


def choose(points: Sequence[Point]) -> int:
    """Which point is nearest to the ideal one: that with the least value of each objective on the front.

    Distances are Euclidean, in the objectives' units, which are the same for all laws. Of points as near as each other,
    to rounding, the one with the least first objective is taken, then second, third; of equal ones the first.
    ("Compromise programming": Zeleny 1973.)
    """
    best = front(points)
    on_front = scaled([points[i] for i in best])
    distance = np.linalg.norm(on_front - on_front.min(axis=0), axis=1)
    nearest = np.flatnonzero(distance <= distance.min() * (1.0 + ROUNDING))
    return min((best[i] for i in nearest), key=lambda i: (points[i], i))
