"""Lines of a study's data: what they have in common, and numbers made of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import takewhile
from math import nan
from typing import Any

from ...reports.numbers import largest

Points = list[dict[str, Any]]
"""Lines of a study's data, by column."""

Numbers = dict[tuple[str | float, ...], float]
"""By what they are of (a scenario, a law, a gain …) and, last, what they say of it."""

Measured = tuple[Points, Numbers, list[str]]
"""Lines of the figure's data, numbers, and sentences."""


def grouped(points: Iterable[dict[str, Any]], *columns: str) -> dict[Any, Points]:
    """Points by their value in a column, or the tuple of their values in several, in the order in which they come."""
    found: dict[Any, Points] = {}
    for point in points:
        values = tuple(point[column] for column in columns)
        found.setdefault(values if len(columns) > 1 else values[0], []).append(point)
    return found


def where(points: Iterable[dict[str, Any]], **values: Any) -> Points:
    """Points whose columns have these values."""
    return [point for point in points if all(point[column] == value for column, value in values.items())]


def through(points: Iterable[dict[str, Any]]) -> Points:
    """Points of runs that went on to their end."""
    return [point for point in points if not ended_early(point)]


def under(found: Mapping[str, float], *of: str | float) -> Numbers:
    """Numbers by name as those of something."""
    return {(*of, name): float(value) for name, value in found.items()}


def ended_early(point: Mapping[str, Any]) -> bool:
    """Whether a point's run failed or was aborted."""
    return point["status"] in ("failed", "aborted")


def greatest(points: Iterable[Mapping[str, Any]], column: str) -> float:
    """Greatest value of a column among those that there are; NaN if there is none."""
    return largest([point[column] for point in points])


def smallest_enough(points: Iterable[Mapping[str, Any]], column: str, good: Callable[[Any], bool]) -> float:
    """Smallest value of a column from which on every point is good; NaN if that of the greatest value is not."""
    downwards = sorted(points, key=lambda point: point[column], reverse=True)
    return min((float(point[column]) for point in takewhile(good, downwards)), default=nan)
