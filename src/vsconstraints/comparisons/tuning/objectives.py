"""How settings are judged: by how many training runs succeed, then by three objectives, as means over these runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np


class Objective(NamedTuple):
    """A quantity to be minimized; ``worst`` bounds it and is that of a run that does not converge."""

    column: str
    title: str
    worst: float
    unit: float  #: Weighs as much as one unit of another objective.


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


class Judged(NamedTuple):
    """Means of a setting's objectives, share of runs with a violation, numbers of runs; successes violate nothing."""

    point: Point
    violations: float
    runs: int
    converged: int
    successes: int

    @property
    def success(self) -> str:
        """As reports show it."""
        return f"{100.0 * self.successes / self.runs:.1f} %"


def outcome(result: Mapping[str, Any], baseline: Mapping[str, Any]) -> Outcome:
    """The outcome of a run, from its line of results and that of the unconstrained baseline in the same scene.

    A run that does not converge has the worst value of every objective; but if it and the baseline are still moving
    when time is up, no law can reach the goal, and it counts by its variation alone. Of one that converges, the unused
    space is left out where nothing was challenged, and the settling time where the baseline does not settle.
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
    converged = [each for each in outcomes if each.status == "converged"]
    successes = sum(not each.violated for each in converged)
    return Judged(tuple(point), violated / len(outcomes), len(outcomes), len(converged), successes)


def loss(judged: Judged) -> float:
    """What the tuner minimizes: failed runs, and of as many the sum of the objectives in their units."""
    lengths = (value / objective.unit for value, objective in zip(judged.point, OBJECTIVES, strict=True))
    return 100.0 * (judged.runs - judged.successes) + math.fsum(lengths)


def choose(settings: Sequence[Judged]) -> int:
    """Position of the setting with the most successes; of as many, the one nearest to their ideal point.

    That has the least value of each objective; distances are Euclidean, in the objectives' units ("compromise
    programming": Zeleny 1973). Of points as near, to rounding, the one with the least first objective is taken, etc.
    """
    most = max(each.successes for each in settings)
    best = [i for i, each in enumerate(settings) if each.successes == most]
    points = np.array([settings[i].point for i in best]) / [objective.unit for objective in OBJECTIVES]
    distance = np.linalg.norm(points - points.min(axis=0), axis=1)
    nearest = np.flatnonzero(distance <= distance.min() * (1.0 + ROUNDING))
    return min((best[i] for i in nearest), key=lambda i: (settings[i].point, i))
