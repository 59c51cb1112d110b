"""Data points of studies, numbers about them, and names of scenarios."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from itertools import takewhile
from typing import Any

from ...reports.numbers import largest

Point = dict[str, Any]  #: Line of a study's data: its values by column.
Points = list[Point]
#: Keyed by subject (a scenario, a law, a gain …) and, last, by name; NaN if not measured.
Numbers = dict[tuple[str | float, ...], float]

#: Names of scenarios in figures and sentences.
TITLES = {
    "example-2d-fov": "first example",
    "example-2d-fast-high-gain": "first example, fast",
    "case-study-6r": "case study",
    "experiment-1-pbvs": "experiment 1 (PBVS)",
    "experiment-2-ibvs": "experiment 2 (IBVS)",
    "moving-sphere": "moving sphere",
    "moving-occluder": "moving occluder",
}


def scenario_title(scenario: str) -> str:
    """Name of a scenario in figures, and inside sentences."""
    return TITLES.get(scenario, scenario)


def sentence_start(scenario: str) -> str:
    """Name of a scenario at the start of a sentence."""
    title = scenario_title(scenario)
    return title[:1].upper() + title[1:]


def grouped(points: Iterable[Point], *columns: str) -> dict[Any, Points]:
    """Group points by their value in a column, or in several, in order of first occurrence."""
    groups: dict[Any, Points] = {}
    for point in points:
        key = tuple(point[column] for column in columns)
        groups.setdefault(key if len(key) > 1 else key[0], []).append(point)
    return groups


def where(points: Iterable[Point], **values: Any) -> Points:
    """Return points whose columns have these values, or one of them if a list is given."""
    lists = {
        column: value if isinstance(value, list) else [value] for column, value in values.items()
    }
    return [
        point for point in points if all(point[column] in some for column, some in lists.items())
    ]


def ended_early(point: Point) -> bool:
    """True if a point's run failed or was aborted."""
    return point["status"] in ("failed", "aborted")


def about(numbers: Numbers, *key: str | float) -> dict[str | float, float]:
    """Return the numbers about a subject by name."""
    return {name: value for (*first, name), value in numbers.items() if tuple(first) == key}


def numbers_by(numbers: Numbers, column: str, *subject: str | float) -> Points:
    """Return the numbers about a subject as points, one for each value of a further column."""
    size = len(subject)
    values = [key[size] for key in numbers if key[:size] == subject and len(key) == size + 2]
    points = []
    for value in dict.fromkeys(values):
        found = {str(name): number for name, number in about(numbers, *subject, value).items()}
        points.append({column: value, "status": "", **found})
    return points


def greatest(points: Iterable[Mapping[str, Any]], column: str) -> float:
    """Greatest finite value of a column; NaN if there is none."""
    return largest([point[column] for point in points])


def smallest_gain(points: Points, outcomes: Collection[str]) -> float:
    """Smallest switching gain from which on all runs have one of these outcomes.

    NaN if the greatest gain has another outcome.
    """
    downwards = sorted(points, key=lambda point: -float(point["switching_gain"]))
    enough = takewhile(lambda point: point["outcome"] in outcomes, downwards)
    return min((float(point["switching_gain"]) for point in enough), default=math.nan)
