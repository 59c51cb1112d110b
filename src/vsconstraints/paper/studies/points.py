"""Lines of a study's data, numbers about them, and the tables that say how they are drawn and worded."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable, Mapping
from itertools import takewhile
from pathlib import Path
from typing import Any

from ...reports.numbers import largest
from ..texts import ENVIRONMENT

#: Texts and varied values of the shipped studies, by name; and what scenarios are called, under ``titles``.
TABLES: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_name("studies.toml").read_text(encoding="utf-8"))
Points = list[dict[str, Any]]  #: Lines of a study's data, by column.
#: Keyed by what they are about (a scenario, a law, a gain …) and, last, by their name; NaN if not measured.
Numbers = dict[tuple[str | float, ...], float]


def scenario_title(scenario: str) -> str:
    """What figures call a scenario, and sentences that do not begin with it."""
    return str(TABLES["titles"].get(scenario, scenario))


def sentence_start(scenario: str) -> str:
    """What sentences call a scenario that they begin with."""
    title = scenario_title(scenario)
    return title[:1].upper() + title[1:]


def grouped(points: Iterable[dict[str, Any]], column: str) -> dict[Any, Points]:
    """Points by their value in a column, in the order in which the values come."""
    groups: dict[Any, Points] = {}
    for point in points:
        groups.setdefault(point[column], []).append(point)
    return groups


def where(points: Iterable[dict[str, Any]], **values: Any) -> Points:
    """Points whose columns have these values, or one of them where a list is given."""
    lists = {column: value if isinstance(value, list) else [value] for column, value in values.items()}
    return [point for point in points if all(point[column] in some for column, some in lists.items())]


def ended_early(point: Mapping[str, Any]) -> bool:
    """Whether a point's run failed or was aborted."""
    return point["status"] in ("failed", "aborted")


def keyed(values: Mapping[str, float], *key: str | float) -> Numbers:
    """Numbers by name as numbers about something."""
    return {(*key, name): float(value) for name, value in values.items()}


def about(numbers: Numbers, *key: str | float) -> dict[str | float, float]:
    """Numbers about something by name: what :func:`keyed` made of them."""
    return {name: value for (*first, name), value in numbers.items() if tuple(first) == key}


def greatest(points: Iterable[Mapping[str, Any]], column: str) -> float:
    """Greatest finite value of a column; NaN if there is none."""
    return largest([point[column] for point in points])


def smallest_enough(points: Iterable[Mapping[str, Any]], column: str, good: Callable[[Any], bool]) -> float:
    """Smallest value of a column from which on every point is good; NaN if that of the greatest value is not."""
    downwards = sorted(points, key=lambda point: point[column], reverse=True)
    return min((float(point[column]) for point in takewhile(good, downwards)), default=math.nan)


ENVIRONMENT.filters |= {one.__name__: one for one in (grouped, where, greatest, scenario_title, sentence_start)}
