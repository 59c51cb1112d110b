"""Data points of studies, numbers about them, and the tables that define figures and wording."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Collection, Iterable, Mapping
from itertools import takewhile
from pathlib import Path
from typing import Any

from ...reports.numbers import largest
from ...scenarios.reading import require_known
from ..verdicts import ENVIRONMENT

Points = list[dict[str, Any]]  #: Lines of a study's data, by column.
#: Keyed by subject (a scenario, a law, a gain …) and, last, by name; NaN if not measured.
Numbers = dict[tuple[str | float, ...], float]

#: Permitted keys of a study's table, and of the tables in it: see :class:`.study.Sweep` and
#: :func:`.drawing.sweep_figure`.
KEYS = {
    "": "title question varied claims columns drift caption sentences runs small limits obstacles "
    "panels looks layout "
    "layers measures",
    "layout": "x below ticks names least limits margin columns left height gap above legend",
    "layers": "by kind on y where without look numbers reference palette widths shift",
    "limits": "samples excess depth",
    "measures": "label title ticks below linear linear_below level low top headroom margin same",
}


def read_tables(text: str) -> dict[str, dict[str, Any]]:
    """Parse the tables of studies, by name; raises ConfigurationError for an unknown key."""
    tables = tomllib.loads(text)
    for study, table in tables.items():
        if study in ("titles", "laws"):
            continue
        parts = [("", table), *((part, table.get(part, {})) for part in ("layout", "limits"))]
        parts += [("layers", layer) for layer in table.get("layers", ())]
        parts += [("measures", measure) for measure in table.get("measures", {}).values()]
        for part, keys in parts:
            require_known(keys, KEYS[part].split(), f"{study}.{part}".rstrip("."))
        for run in (*table.get("runs", ()), *table.get("small", ())):
            require_known(run, [*table["varied"], "overrides"], f"{study}.runs")
    return tables


#: Texts and varied values of the shipped studies, by name. ``titles`` holds names of scenarios, and
#: ``laws`` the laws.
TABLES = read_tables(Path(__file__).with_name("studies.toml").read_text(encoding="utf-8"))


def scenario_title(scenario: str) -> str:
    """Name of a scenario in figures, and inside sentences."""
    return str(TABLES["titles"].get(scenario, scenario))


def sentence_start(scenario: str) -> str:
    """Name of a scenario at the start of a sentence."""
    title = scenario_title(scenario)
    return title[:1].upper() + title[1:]


def grouped(points: Iterable[dict[str, Any]], *columns: str) -> dict[Any, Points]:
    """Group points by their value in a column, or in several, in order of first occurrence."""
    groups: dict[Any, Points] = {}
    for point in points:
        key = tuple(point[column] for column in columns)
        groups.setdefault(key if len(key) > 1 else key[0], []).append(point)
    return groups


def where(points: Iterable[dict[str, Any]], **values: Any) -> Points:
    """Return points whose columns have these values, or one of them if a list is given."""
    lists = {
        column: value if isinstance(value, list) else [value] for column, value in values.items()
    }
    return [
        point for point in points if all(point[column] in some for column, some in lists.items())
    ]


def ended_early(point: Mapping[str, Any]) -> bool:
    """True if a point's run failed or was aborted."""
    return point["status"] in ("failed", "aborted")


def about(numbers: Numbers, *key: str | float) -> dict[str | float, float]:
    """Return the numbers about a subject by name."""
    return {name: value for (*first, name), value in numbers.items() if tuple(first) == key}


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


ENVIRONMENT.filters |= {
    one.__name__: one for one in (grouped, where, greatest, scenario_title, sentence_start)
}
