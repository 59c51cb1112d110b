"""What the parts of the report of evidence are written from: runs with their outcome, paired by scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ...comparisons.runs.spec import BASELINE
from ...comparisons.statistics.judged import OUTCOMES
from ..groups import required_information
from ..plots import PNG, Formats
from ..plots.style import TUNED

if TYPE_CHECKING:
    import pandas as pd

    from ...comparisons.evidence import Evidence

Worked = TypeVar("Worked")

SCENE = ["family", "scene"]
"""Columns that say which scene it is: laws are compared on the same ones."""


@dataclass(eq=False)
class Material:
    """Evidence as the report's parts need it.

    Attributes
    ----------
    evidence
        What a campaign left.
    tuning
        The folder of the tuning, if there is one to show.
    figures
        Whether figures are drawn.
    formats
        In which they are written.
    """

    evidence: Evidence
    tuning: Path | None = None
    figures: bool = True
    formats: Formats = PNG
    _worked_out: dict[Any, Any] = field(default_factory=dict, repr=False)

    def once(self, key: Hashable, work_out: Callable[[], Worked]) -> Worked:
        """What several parts ask for, worked out for the first of them, by what it is of."""
        if key not in self._worked_out:
            self._worked_out[key] = work_out()
        found: Worked = self._worked_out[key]
        return found

    @property
    def folder(self) -> Path:
        """Where the evidence is, and where the report goes."""
        return self.evidence.folder

    @property
    def manifest(self) -> Mapping[str, Any]:
        """What was run, when, where and by which command."""
        return self.evidence.manifest

    @property
    def configuration(self) -> Mapping[str, Any]:
        """The campaign, resolved."""
        return dict(self.manifest["configuration"])

    @cached_property
    def runs(self) -> pd.DataFrame:
        """Runs of the laws that are compared, with what came of each.

        ``kept`` is whether no row was violated, ``success`` whether the goal was reached besides; both by the strict
        standard, and as ``tolerant kept`` and ``tolerant success`` by the tolerant one. ``tolerance`` is the least
        one at which a run is a success; infinite if at none.
        """
        every = self.evidence.runs
        runs = every[every["controller"] != BASELINE].copy()
        for standard in ("", "tolerant "):
            runs[f"{standard}kept"] = ~OUTCOMES[f"{standard}violation"].flag(runs)
            runs[f"{standard}success"] = OUTCOMES[f"{standard}success"].flag(runs)
        runs["tolerance"] = runs["violation_fraction"].astype(float).where(runs["status"] == "converged", math.inf)
        plain: pd.DataFrame = runs.astype(dict.fromkeys(("family", "condition", "controller", "status"), str))
        return plain

    @cached_property
    def laws(self) -> tuple[str, ...]:
        """Laws that have runs, without tracking alone, in the campaign's order."""
        return _ordered(self.evidence.controllers, self.runs["controller"])

    @cached_property
    def conditions(self) -> tuple[str, ...]:
        """Conditions that have runs, in the campaign's order, the one without disturbances first."""
        return _ordered(("nominal", *self.evidence.conditions), self.runs["condition"])

    @cached_property
    def families(self) -> tuple[str, ...]:
        """Families that have runs, in the campaign's order."""
        return _ordered(tuple(self.configuration["families"]), self.runs["family"])

    @cached_property
    def uses(self) -> dict[str, tuple[str, ...] | None]:
        """What each law uses beside rows and task; None for an own law, whose code says it."""
        entries = self.configuration["controllers"]
        return {name: required_information(name, entries.get(name, {})) for name in self.laws}

    def among(self, condition: str, families: Sequence[str] | None = None) -> pd.DataFrame:
        """Runs in a condition, of some families or of all."""
        runs = self.runs[self.runs["condition"] == condition]
        return runs if families is None else runs[runs["family"].isin(list(families))]

    def paired(self, condition: str, column: str, families: Sequence[str] | None = None) -> pd.DataFrame:
        """A column's values with one line per scene and one column per law, of scenes that every law ran."""
        runs = self.among(condition, families)
        wide = runs.pivot_table(index=SCENE, columns="controller", values=column, aggfunc="first", dropna=False)
        ran = runs.pivot_table(index=SCENE, columns="controller", values="success", aggfunc="count", fill_value=0)
        wide = wide.reindex(index=ran.index)[(ran > 0).all(axis=1)]
        return wide[[name for name in self.laws if name in wide.columns]]

    def going(self, condition: str) -> tuple[str, ...]:
        """Laws that came to anything in a condition: standing still violates nothing. All, if none did."""
        runs = self.among(condition)
        came = set(runs[~runs["status"].isin(["failed", "aborted"])]["controller"])
        return tuple(law for law in self.laws if law in came) or self.laws

    def families_of(self, condition: str) -> tuple[str, ...]:
        """Families that have runs in a condition."""
        there = set(self.among(condition)["family"])
        return tuple(name for name in self.families if name in there)

    @property
    def tuned(self) -> dict[str, str]:
        """Names of tuned laws, by those of the laws they were tuned from, where both have runs."""
        return {name: name + TUNED for name in self.laws if name + TUNED in self.laws}


def _ordered(planned: Sequence[str], found: pd.Series) -> tuple[str, ...]:
    """Names that were found: those that were planned in that order, then the others."""
    there = list(dict.fromkeys(found))
    names = dict.fromkeys([*(name for name in planned if name in there), *sorted(there)])
    return tuple(names)
