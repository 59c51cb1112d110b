"""Stored outcomes made again: whether a table's runs are what its laws do on the scenes that it names."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from random import Random
from typing import Any

from ..plugins.classes import untrusted
from ..scenarios.families import Family
from .evidence.work import Batch, scored
from .runs.spec import BASELINE, ControllerSpec
from .study import OUTCOME, Study

TOLERANCE = 1e-9  #: Relative difference of numbers that are the same on another machine.
NUDGE = 1e-13  #: Relative change of the start by which it is found whether rounding decides a run.


def differing(
    study: Study, families: Mapping[str, Family], share: float, seed: int = 0, trust: bool = False
) -> Iterator[tuple[str, bool]]:
    """Make a share of a study's runs again, chosen by ``seed``; what of each differs, and whether rounding decides it.

    Numbers differ by more than :data:`TOLERANCE`. Rounding decides a run that ends as differently when its start is
    moved by :data:`NUDGE`. Raises ConfigurationError for laws that do not come with the package, unless they are
    trusted.
    """
    if own := [law.law for law in study.laws.values() if ":" in law.law and not trust]:
        raise untrusted("a table of runs", own)
    lines = study.runs.to_dict("records")
    for stored in Random(seed).sample(lines, math.ceil(share * len(lines))):
        family, law = families[stored["family"]], study.laws[stored["controller"]]
        made = _made(stored, family, law, study)
        if differences := _differences(stored, made):
            decided = bool(_differences(made, _made(stored, family, law, study, NUDGE)))
            where = f"{stored['family']} {stored['scene']}, {stored['condition']}, {stored['controller']}"
            yield f"{where}: {'; '.join(differences)}", decided


def _made(
    stored: Mapping[str, Any], family: Family, law: ControllerSpec, study: Study, nudge: float = 0.0
) -> dict[str, Any]:
    laws, seed = (ControllerSpec(BASELINE), law), study.frozen[stored["family"]]["seed"]
    task = Batch(family, (stored["scene"],), (stored["condition"],), laws, stored["half"], seed)
    if nudge:
        scene = family.scene(stored["scene"], stored["half"], seed)
        moved = [(1.0 + nudge) * x for x in scene.scenario().tables["q0"]]
        tables = {name: {**tables, "q0": moved} for name, tables in scene.tables.items()}
        task = replace(task, drawn=replace(scene, tables=tables))
    return next(line for line in scored(task).runs.to_pylist() if line["controller"] == law.name)


def _differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
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
