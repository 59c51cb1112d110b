"""Stored outcomes made again: whether a table's runs are what its laws do on the scenes that it names."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from random import Random
from typing import Any

from ..plugins.classes import untrusted
from ..scenarios.families import Drawn, Family
from .evidence.work import Batch, scored
from .runs.spec import BASELINE, ControllerSpec
from .study import OUTCOME, Study

TOLERANCE = 1e-9  #: Relative difference of numbers that are the same on another machine.
NUDGE = 1e-13  #: Relative change of the start by which it is found whether rounding decides a run.


@dataclass(frozen=True)
class _Nudged:
    """A family whose scenes start a little off."""

    family: Family
    by: float

    def __getattr__(self, name: str) -> Any:
        return getattr(self.family, name)

    def set_up(self, number: int, half: str, seed: int) -> tuple[Drawn, Mapping[str, Any]]:
        """As that of the family."""
        scene = self.family.scene(number, half, seed)
        moved = [(1.0 + self.by) * x for x in scene.scenario().tables["q0"]]
        return replace(scene, tables={name: {**tables, "q0": moved} for name, tables in scene.tables.items()}), {}


def differing(
    study: Study, families: Mapping[str, Family], share: float, seed: int = 0, trust: bool = False
) -> Iterator[tuple[str, bool]]:
    """Make a share of a study's runs again, chosen by ``seed``; what of each differs, and whether rounding decides it.

    Numbers differ by more than :data:`TOLERANCE`. Rounding decides a run that ends as differently when its start is
    moved by :data:`NUDGE`. Nothing is yielded of a run that is the same. Raises ConfigurationError for laws that do not
    come with the package, unless they are trusted.
    """
    if own := [law.law for law in study.laws.values() if ":" in law.law and not trust]:
        raise untrusted("a table of runs", own)
    lines = study.runs.to_dict("records")
    for stored in Random(seed).sample(lines, math.ceil(share * len(lines))):
        family, law = families[stored["family"]], study.laws[stored["controller"]]
        made = _made(stored, family, law, study)
        if differences := _differences(stored, made):
            decided = bool(_differences(made, _made(stored, _Nudged(family, NUDGE), law, study)))
            where = f"{stored['family']} {stored['scene']}, {stored['condition']}, {stored['controller']}"
            yield f"{where}: {'; '.join(differences)}", decided


def _made(stored: Mapping[str, Any], family: Any, law: ControllerSpec, study: Study) -> dict[str, Any]:
    seed = study.frozen[stored["family"]]["seed"]
    laws = ControllerSpec(BASELINE), law
    task = Batch(family, (stored["scene"],), (stored["condition"],), laws, stored["half"], seed)
    return next(line for line in scored(task).runs.to_pylist() if line["controller"] == law.name)


def _differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """What is another value."""
    found = []
    for column in OUTCOME:
        a, b = (each[column.name] for each in (one, other))
        if column.kind == "number":
            a, b = (math.nan if x is None else x for x in (a, b))
            same = math.isclose(a, b, rel_tol=TOLERANCE, abs_tol=TOLERANCE) or (math.isnan(a) and math.isnan(b))
        else:
            same = a == b
        found += [] if same else [f"{column.name} is {a!r} and was made {b!r}"]
    return found
