"""Scenarios as a suite names them: as they are, or changed in some keys."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from ..errors import ConfigurationError, shown
from ..scenarios import Scenario
from ..scenarios.section import Section

MOST_VARIANTS = 10_000
"""Variants that one entry of a suite may stand for."""


def scenarios_of(value: object, where: str, folder: Path) -> list[Scenario]:
    """The scenarios that one entry of a suite's ``scenarios`` stands for.

    Parameters
    ----------
    value
        A name, a path, or a table that describes variants (see :meth:`Suite.load`).
    where
        Suite and entry, for messages.
    folder
        What a path is relative to.

    Raises
    ------
    ConfigurationError
        if there is no such scenario, or the table has a wrong key or value.
    """
    if isinstance(value, str):
        return [Scenario.load(value, folder)]
    if not isinstance(value, dict):
        raise ConfigurationError(
            f"{where} must be a name, a path, or a table with the key 'scenario', not {shown(value)}"
        )
    section = Section(value, where)
    base = Scenario.load(section.take("scenario", str), folder)
    name = section.take("name", str)
    title = section.take("title", str, name)
    changes: dict[str, Any] = section.take("set", dict, {})
    each: dict[str, Any] = section.take("each", dict, {})
    section.finish()
    for key, candidates in each.items():
        if not isinstance(candidates, list) or not candidates:
            raise ConfigurationError(f"{where}.each: {key} must be a list of values, not {shown(candidates)}")
    count = prod(map(len, each.values()))
    if count > MOST_VARIANTS:
        raise ConfigurationError(f"{where}.each makes {count:.3g} variants; an entry may make {MOST_VARIANTS}")
    return [
        _variant(
            base,
            folder,
            (name, *map(str, values)),
            (title, *map(str, values)),
            changes,
            dict(zip(each, values, strict=True)),
        )
        for values in product(*each.values())
    ]


def _variant(
    base: Scenario,
    folder: Path,
    name: tuple[str, ...],
    title: tuple[str, ...],
    changes: dict[str, Any],
    chosen: dict[str, Any],
) -> Scenario:
    variant = replace(base, name="-".join(name))
    for key, value in {"title": ", ".join(title), **changes, **chosen}.items():
        variant = variant.with_override(key, value, folder)
    return variant
