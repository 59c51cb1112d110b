"""Data of the report of evidence: runs and outcomes, paired by scene, and repeated single runs."""

from __future__ import annotations

import math
import os
import shlex
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from ...comparisons import RunRecord
from ...comparisons.runs.spec import BASELINE, ControllerSpec, stack_law
from ...errors import unknown_name
from ...plugins.classes import untrusted
from ...reports.drawing import picture
from ...reports.groups import implementation_text, required_information
from ...reports.plots import PNG, Figure, Formats
from ...reports.plots.style import TUNED
from ...simulation import Setup, simulate, until_settled
from ...simulation.programs import uses_by_controller
from ..evidence import Evidence
from ..families.family import NOMINAL, TOGETHER
from ..statistics.judged import OUTCOMES, endings

if TYPE_CHECKING:
    import pandas as pd

Value = TypeVar("Value")
MIN_LEVELS = 3  #: Least number of levels of the first factor, over which curves are drawn.
#: Columns that identify a scene: controllers are compared on the same scenes.
SCENE = ["family", "scene"]


class Factorial(NamedTuple):
    """Conditions that form a full factorial of levels, such as speed × latency × noise.

    Only conditions that were run are included. ``factors`` are the levels of each factor, the
    nominal one first, and the factor with most levels first. ``conditions`` are keyed by levels.
    """

    factors: tuple[tuple[str, ...], ...]
    conditions: Mapping[tuple[str, ...], str]

    @classmethod
    def of(cls, table: Mapping[str, Mapping[str, Any]], run: Collection[str]) -> Factorial | None:
        """Find the factorial in a family's table of conditions, of which some were run.

        Return None without a full factorial, or if its first factor has fewer than
        :data:`MIN_LEVELS` levels. Conditions that combine others are combinations of levels.
        Levels that are never combined belong to one factor.
        """
        #: Conditions that combine levels, by these levels.
        combined: dict[frozenset[str], str] = {}
        for name, changes in table.items():
            if list(changes) == [TOGETHER]:
                combined[frozenset(changes[TOGETHER])] = name
        factors = _factors_of(table, combined)
        #: Condition of each set of levels that differ from the nominal one.
        names: dict[frozenset[str], str] = {frozenset(): NOMINAL}
        for factor in factors:
            for level in factor:
                if level != NOMINAL:
                    names[frozenset([level])] = level
        names |= combined
        conditions = {}
        for levels in product(*factors):
            condition = names.get(frozenset(levels) - {NOMINAL})
            if condition is None:
                return None
            if condition in run:
                conditions[levels] = condition
        used = []
        for position, factor in enumerate(factors):
            used_levels = {levels[position] for levels in conditions}
            used.append(tuple(level for level in factor if level in used_levels))
        if not used or len(used[0]) < MIN_LEVELS:
            return None
        return cls(tuple(used), conditions)


def _factors_of(
    names: Iterable[str], combined: Collection[Collection[str]]
) -> list[tuple[str, ...]]:
    """Return the levels of each factor, nominal first; the factor with most levels is the first.

    ``names`` are conditions, of which ``combined`` occur together. Levels that never occur together
    belong to one factor.
    """
    factors: list[list[str]] = []
    for level in names:
        partners: set[str] = set()
        for levels in combined:
            if level in levels:
                partners.update(levels)
        if not partners:
            continue
        without_partners = [factor for factor in factors if partners.isdisjoint(factor)]
        if without_partners:
            without_partners[0].append(level)
        else:
            factors.append([NOMINAL, level])
    factors.sort(key=len, reverse=True)
    return [tuple(factor) for factor in factors]


class Dataset:
    """Evidence in the form that the parts of the report need.

    ``tuning`` is the folder of the tuning, None if none is shown. ``figures`` is True if figures
    are drawn, in ``formats``. ``folder`` is that of the report, by default the evidence's.
    ``laws``, ``families`` and ``situations`` (families in conditions) are those that have runs, in
    the campaign's order. ``conditions`` have the same order and omit those that are only levels of
    ``factorials`` of families.
    """

    def __init__(
        self,
        evidence: Evidence,
        tuning: Path | None = None,
        figures: bool = True,
        formats: Formats = PNG,
        folder: Path | None = None,
    ) -> None:
        self.evidence = evidence
        self.tuning = tuning
        self.figures = figures
        self.formats = formats
        self.folder = folder or evidence.folder
        self.manifest = evidence.manifest
        self.configuration: dict[str, Any] = dict(evidence.manifest["configuration"])
        self._cache: dict[Hashable, Any] = {}
        families: dict[str, Any] = self.configuration["families"]
        self.laws = _ordered(evidence.controllers, self.runs["controller"])
        self.families = _ordered(tuple(families), self.runs["family"])
        conditions = _ordered((NOMINAL, *evidence.conditions), self.runs["condition"])
        of_runs = self.runs[["family", "condition"]].drop_duplicates()
        pairs = set(of_runs.itertuples(index=False, name=None))
        self.situations: list[tuple[str, str]] = []
        self.factorials: dict[str, Factorial] = {}
        shown = {NOMINAL}
        for family in self.families:
            run = [condition for condition in conditions if (family, condition) in pairs]
            self.situations += [(family, condition) for condition in run]
            tables = families.get(family, {}).get("tables", {})
            factorial = Factorial.of(tables.get("conditions", {}), run)
            if factorial is None:
                shown.update(run)
            else:
                self.factorials[family] = factorial
                shown.update(set(run).difference(factorial.conditions.values()))
        self.conditions = tuple(name for name in conditions if name in shown) or conditions
        self.tuned = {}
        for law in self.laws:
            tuned = law + TUNED
            if tuned in self.laws:
                self.tuned[law] = tuned

    def replayed_from(self, family: str, scene: int) -> str:
        """Return the campaign's folder for a command that is given in the report's folder.

        It is relative, and quoted for a shell if necessary.
        """
        folder = self.evidence.folder_of(family, scene).resolve()
        try:
            shown = os.path.relpath(folder, self.folder.resolve())
        except ValueError:  # on another drive of Windows
            shown = str(folder)
        return shlex.quote(shown)

    def once(self, key: Hashable, compute: Callable[[], Value]) -> Value:
        """Return a value that several parts need; compute it once and cache it by its key."""
        if key not in self._cache:
            self._cache[key] = compute()
        value: Value = self._cache[key]
        return value

    def picture(self, figure: Figure, *needed: object) -> str:
        """Draw a figure and return it with its caption; empty without figures."""
        if not self.figures:
            return ""
        return picture(figure, self.folder / "figures", self.formats, *needed)

    @cached_property
    def runs(self) -> pd.DataFrame:
        """Runs of the compared controllers, with their outcomes.

        ``kept`` is True if no row was violated, ``success`` if the goal was also reached.
        ``tolerant kept`` and ``tolerant success`` apply the tolerant standard. ``tolerance`` is
        the least tolerance at which a run is a success.
        """
        every = self.evidence.runs
        runs = every[every["controller"] != BASELINE].copy()
        for standard in ("", "tolerant "):
            violated = OUTCOMES[f"{standard}violation"].flag(runs)
            runs[f"{standard}kept"] = ~violated
            runs[f"{standard}success"] = OUTCOMES[f"{standard}success"].flag(runs)
        runs["ending"] = endings(runs)
        depth = runs["violation_fraction"].astype(float)
        has_converged = runs["status"] == "converged"
        runs["tolerance"] = depth.where(has_converged, math.inf)
        texts = ("family", "condition", "controller", "status")
        plain: pd.DataFrame = runs.astype(dict.fromkeys(texts, str))
        return plain

    @cached_property
    def uses_of_laws(self) -> dict[str, tuple[str, ...] | None]:
        """Information that each controller requires beyond rows and task.

        It is known for controllers of the package. It is None for a custom controller, whose code
        defines it, and for a stack.
        """
        entries = self.configuration["controllers"]
        uses = {}
        for name in self.laws:
            uses[name] = required_information(name, entries.get(name, {}))
        return uses

    @cached_property
    def declared_by_stacks(self) -> dict[str, tuple[str, ...]]:
        """Data that each stack declared as used in its runs, by controller."""
        reasons = {}
        for name in self.laws:
            reasons[name] = self.of_law(name)["reason"].dropna().unique()
        return uses_by_controller(reasons)

    def uses_of(self, law: str) -> tuple[str, ...] | None:
        """Return the required information of a controller or stack; None if it is unknown."""
        return self.declared_by_stacks.get(law, self.uses_of_laws[law])

    def implementation(self, law: str) -> str:
        """Return how a controller runs, see :func:`.implementation_text`."""
        entry = self.configuration["controllers"].get(law, {})
        were_compiled = self.of_law(law)["compiled"].astype(bool).to_list()
        return implementation_text(were_compiled, entry.get("type") == stack_law())

    def of_law(self, law: str) -> pd.DataFrame:
        """Return all runs of a controller."""
        return self.runs[self.runs["controller"] == law]

    def among(self, condition: str, families: Sequence[str] | None = None) -> pd.DataFrame:
        """Return the runs in a condition, of some families or of all."""
        runs = self.runs[self.runs["condition"] == condition]
        if families is None:
            return runs
        return runs[runs["family"].isin(list(families))]

    def paired(
        self, condition: str, column: str, families: Sequence[str] | None = None
    ) -> pd.DataFrame:
        """Return a column with one line per scene and one column per controller.

        Only scenes that all controllers ran are included.
        """
        runs = self.among(condition, families)
        # a run always has a success, while its value may be missing
        success = runs.pivot(index=SCENE, columns="controller", values="success")
        ran_all = success.notna().all(axis=1)
        values = runs.pivot(index=SCENE, columns="controller", values=column)
        laws = [name for name in self.laws if name in values.columns]
        return values.loc[ran_all, laws]

    def working(self, condition: str) -> tuple[str, ...]:
        """Return the controllers of which at least one run in a condition did not fail.

        A controller that stands still violates nothing and is therefore left out. If all runs of
        all controllers failed, all are returned.
        """
        runs = self.among(condition)
        has_failed = runs["status"].isin(["failed", "aborted"])
        working = set(runs.loc[~has_failed, "controller"])
        return tuple(law for law in self.laws if law in working) or self.laws

    def families_of(self, *conditions: str) -> list[str]:
        """Return the families that have runs in all of these conditions."""
        common = set(self.families)
        for condition in conditions:
            common &= set(self.among(condition)["family"])
        return [name for name in self.families if name in common]


def _ordered(planned: Sequence[str], present: pd.Series) -> tuple[str, ...]:
    """Return the names that are present: planned ones in their order, then the others."""
    names = set(present)
    in_order = [name for name in planned if name in names]
    return tuple(dict.fromkeys([*in_order, *sorted(names)]))


def replay(
    folder: Path | str,
    family: str,
    scene: int,
    condition: str,
    controller: str,
    *,
    trust: bool = False,
) -> RunRecord:
    """Draw a scene of a campaign again and repeat a controller's run with its whole trajectory.

    With ``trust``, code that the campaign names as ``module:Class`` may run. Raises
    ConfigurationError if the folder has no evidence or no such run, or if the run needs code that
    is not trusted.
    """
    evidence = Evidence.load(Path(folder), trust)
    return rerun(evidence, setup_of(evidence, family, scene, condition), controller)


def setup_of(evidence: Evidence, family: str, scene: int, condition: str) -> Setup:
    """Return the setup of a scene, with the noise of that scene."""
    if family not in evidence.families:
        raise unknown_name("family", family, evidence.families)
    return until_settled(evidence.drawn(family, scene).setup(condition))


def rerun(evidence: Evidence, setup: Setup, controller: str) -> RunRecord:
    """Run a controller on a setup with the options of the campaign."""
    entries = evidence.manifest["configuration"]["controllers"]
    if controller not in entries:
        raise unknown_name("controller", controller, entries)
    entry = ControllerSpec.from_table(controller, entries[controller])
    if ":" in entry.law and not evidence.trusted:
        raise untrusted(f"controller {controller}", [entry.law])
    setup = entry.run.of(setup)
    with entry.importing_beside():  # custom laws may import neighbours at any time
        return RunRecord.of(setup, simulate(setup, entry.make()), "")
