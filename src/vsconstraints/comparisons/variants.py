"""Scenarios as a suite names them: as they are, or changed in some keys."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import product
from math import prod
from pathlib import Path

from ..errors import ConfigurationError, shown
from ..scenarios import Scenario
from ..scenarios.reading import Table, made

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
    variants: _Variants = made(_Variants, value, where)
    base = Scenario.load(variants.scenario, folder)
    for key, candidates in variants.each.items():
        if not isinstance(candidates, list) or not candidates:
            raise ConfigurationError(f"{where}.each: {key} must be a list of values, not {shown(candidates)}")
    count = prod(map(len, variants.each.values()))
    if count > MOST_VARIANTS:
        raise ConfigurationError(f"{where}.each makes {count:.3g} variants; an entry may make {MOST_VARIANTS}")
    found = []
    for values in product(*variants.each.values()):
        texts = [str(value) for value in values]
        variant = replace(base, name="-".join([variants.name, *texts]))
        title = ", ".join([variants.title or variants.name, *texts])
        changes = {"title": title, **variants.set, **dict(zip(variants.each, values, strict=True))}
        for key, changed in changes.items():
            variant = variant.with_override(key, changed, folder)
        found.append(variant)
    return found


@dataclass(frozen=True)
class _Variants:
    """Keys of an entry that stands for variants of a scenario."""

    scenario: str
    name: str
    title: str = ""
    set: Table = field(default_factory=dict)
    each: Table = field(default_factory=dict)
