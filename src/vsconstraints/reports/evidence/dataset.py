"""The data of the report of evidence: runs with their outcome, paired by scene, and single runs
made again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from ...comparisons import RunRecord
from ...comparisons.evidence import Evidence
from ...comparisons.runs.spec import BASELINE, ControllerSpec
from ...comparisons.statistics.judged import OUTCOMES, endings
from ...errors import unknown_name
from ...plugins.classes import untrusted
from ...scenarios.families.family import NOMINAL, TOGETHER
from ...simulation import Setup, simulate, until_settled
from ..drawing import picture
from ..groups import required_information
from ..plots import PNG, Figure, Formats
from ..plots.style import TUNED
from ..replay.runs import ReplayRun, campaign_run

if TYPE_CHECKING:
    import pandas as pd

Value = TypeVar("Value")
MIN_LEVELS = 3  #: Of the first factor of a factorial, over which curves are drawn.
#: Columns that identify a scene: controllers are compared on the same ones.
SCENE = ["family", "scene"]


class Factorial(NamedTuple):
    """Conditions that are a full factorial of levels, such as speed × latency × noise, as far as
    they were run.

    Levels of each factor, the nominal one first and the factor with most levels first; and
    conditions by their levels.
    """

    factors: tuple[tuple[str, ...], ...]
    conditions: Mapping[tuple[str, ...], str]

    @classmethod
    def of(cls, table: Mapping[str, Mapping[str, Any]], run: Collection[str]) -> Factorial | None:
        """That of a family's table of conditions, of which some were run; None if there is none to
        draw curves of.

        Conditions that name others together are combinations. Levels that never come together are
        of one factor.
        """
        combined = {
            frozenset(said[TOGETHER]): name for name, said in table.items() if [*said] == [TOGETHER]
        }
        factors: list[list[str]] = []
        for level in (name for name in table if any(name in levels for levels in combined)):
            apart = (
                own
                for own in factors
                if not any({level, other} <= one for one in combined for other in own)
            )
            own = next(apart, None)
            if own is None:
                factors.append(own := [NOMINAL])
            own.append(level)
        factors.sort(key=len, reverse=True)
        names = {
            frozenset(): NOMINAL,
            **{frozenset([name]): name for own in factors for name in own[1:]},
            **combined,
        }
        cells = {levels: names.get(frozenset(levels) - {NOMINAL}) for levels in product(*factors)}
        there = {levels: name for levels, name in cells.items() if name is not None and name in run}
        kept = tuple(
            tuple(own for own in one if any(c[k] == own for c in there))
            for k, one in enumerate(factors)
        )
        full = None not in cells.values() and kept and len(kept[0]) >= MIN_LEVELS
        return cls(kept, there) if full else None


class Dataset:
    """Evidence as the parts of the report need it.

    ``tuning`` is the folder of the tuning, if there is one to show; ``figures`` whether figures are
    drawn, in ``formats``. ``laws``, ``families`` and ``situations``, families in conditions, are
    those that have runs, in the campaign's order; so are ``conditions``, without those that are
    nothing but levels of ``factorials`` of families.
    """

    def __init__(
        self,
        evidence: Evidence,
        tuning: Path | None = None,
        figures: bool = True,
        formats: Formats = PNG,
    ) -> None:
        self.evidence = evidence
        self.tuning = tuning
        self.figures = figures
        self.formats = formats
        self.folder = evidence.folder
        self.manifest = evidence.manifest
        self.configuration: dict[str, Any] = dict(evidence.manifest["configuration"])
        self._cache: dict[Hashable, Any] = {}
        self.laws = _ordered(evidence.controllers, self.runs["controller"])
        self.families = _ordered(tuple(self.configuration["families"]), self.runs["family"])
        every = _ordered((NOMINAL, *evidence.conditions), self.runs["condition"])
        pairs = set(self.runs[["family", "condition"]].itertuples(index=False, name=None))
        self.situations = [pair for pair in product(self.families, every) if pair in pairs]
        self.factorials: dict[str, Factorial] = {}
        for family in self.families:
            table = (
                self.configuration["families"]
                .get(family, {})
                .get("tables", {})
                .get("conditions", {})
            )
            own = Factorial.of(
                table, [condition for name, condition in self.situations if name == family]
            )
            self.factorials |= {family: own} if own is not None else {}
        levels = {
            (family, name)
            for family, own in self.factorials.items()
            for name in own.conditions.values()
        }
        outside = {
            NOMINAL,
            *(
                condition
                for family, condition in self.situations
                if (family, condition) not in levels
            ),
        }
        self.conditions = tuple(name for name in every if name in outside) or every
        self.tuned = {name: name + TUNED for name in self.laws if name + TUNED in self.laws}

    def once(self, key: Hashable, compute: Callable[[], Value]) -> Value:
        """What several parts need, computed for the first of them and kept by its key."""
        if key not in self._cache:
            self._cache[key] = compute()
        value: Value = self._cache[key]
        return value

    def picture(self, figure: Figure, *needed: object) -> str:
        """A figure with its caption; empty where no figures are wanted."""
        return (
            picture(figure, self.folder / "figures", self.formats, *needed) if self.figures else ""
        )

    @cached_property
    def runs(self) -> pd.DataFrame:
        """Runs of the controllers that are compared, with their outcomes.

        ``kept`` is whether no row was violated, ``success`` whether the goal was reached besides,
        ``tolerant kept`` and ``tolerant success`` the same by the tolerant standard; ``tolerance``
        the least one at which a run is a success.
        """
        every = self.evidence.runs
        runs = every[every["controller"] != BASELINE].copy()
        for standard in ("", "tolerant "):
            runs[f"{standard}kept"] = ~OUTCOMES[f"{standard}violation"].flag(runs)
            runs[f"{standard}success"] = OUTCOMES[f"{standard}success"].flag(runs)
        runs["ending"] = endings(runs)
        runs["tolerance"] = (
            runs["violation_fraction"].astype(float).where(runs["status"] == "converged", math.inf)
        )
        plain: pd.DataFrame = runs.astype(
            dict.fromkeys(("family", "condition", "controller", "status"), str)
        )
        return plain

    @cached_property
    def required(self) -> dict[str, tuple[str, ...] | None]:
        """What each controller requires beside rows and task; None for an own one, whose code says
        it.
        """
        entries = self.configuration["controllers"]
        return {name: required_information(name, entries.get(name, {})) for name in self.laws}

    def of_law(self, law: str) -> pd.DataFrame:
        """All runs of a controller."""
        return self.runs[self.runs["controller"] == law]

    def among(self, condition: str, families: Sequence[str] | None = None) -> pd.DataFrame:
        """Runs in a condition, of some families or of all."""
        runs = self.runs[self.runs["condition"] == condition]
        return runs if families is None else runs[runs["family"].isin(list(families))]

    def paired(
        self, condition: str, column: str, families: Sequence[str] | None = None
    ) -> pd.DataFrame:
        """A column's values with one line per scene and one column per controller, of scenes that
        all of them ran.
        """
        runs = self.among(condition, families)
        wide = runs.pivot_table(
            index=SCENE, columns="controller", values=column, aggfunc="first", dropna=False
        )
        ran = runs.pivot_table(
            index=SCENE, columns="controller", values="success", aggfunc="count", fill_value=0
        )
        wide = wide.reindex(index=ran.index)[(ran > 0).all(axis=1)]
        return wide[[name for name in self.laws if name in wide.columns]]

    def working(self, condition: str) -> tuple[str, ...]:
        """Controllers not all of whose runs failed in a condition: standing still violates nothing.
        All, if none.
        """
        runs = self.among(condition)
        working = set(runs[~runs["status"].isin(["failed", "aborted"])]["controller"])
        return tuple(law for law in self.laws if law in working) or self.laws

    def families_of(self, *conditions: str) -> list[str]:
        """Families that have runs in all of these conditions."""
        there = [set(self.among(condition)["family"]) for condition in conditions]
        return [name for name in self.families if all(name in one for one in there)]


def _ordered(planned: Sequence[str], present: pd.Series) -> tuple[str, ...]:
    """Names that are present: those that were planned in that order, then the others."""
    there = set(present)
    return tuple(dict.fromkeys([*(name for name in planned if name in there), *sorted(there)]))


def replay(
    folder: Path | str,
    family: str,
    scene: int,
    condition: str,
    controller: str,
    *,
    trust: bool = False,
) -> RunRecord:
    """Draw a scene of a campaign again and run a controller on it: the same run, with its whole
    trajectory.

    With ``trust``, code that the campaign names as ``module:Class`` may run. Raises
    ConfigurationError if there is no evidence in the folder, it has no such run, or the run needs
    code that is not trusted.
    """
    evidence = Evidence.load(Path(folder), trust)
    return rerun(evidence, setup_of(evidence, family, scene, condition), controller)


def replayed(
    run: str, trust: bool = False, on_remark: Callable[[str], None] = lambda remark: None
) -> ReplayRun:
    """The run of ``FOLDER:FAMILY:SCENE:CONDITION:CONTROLLER``, simulated again to be seen; raises
    as :func:`replay`.
    """
    folder, family, scene, condition, controller = campaign_run(run)
    evidence = Evidence.load(Path(folder), trust)
    for remark in evidence.remarks:
        on_remark(remark)
    setup = setup_of(evidence, family, int(scene), condition)
    trajectory = rerun(evidence, setup, controller).trajectory
    return ReplayRun(controller, setup, trajectory, f"{family} {scene}, {condition}")


def setup_of(evidence: Evidence, family: str, scene: int, condition: str) -> Setup:
    """The setup of a scene, with its own noise."""
    if family not in evidence.families:
        raise unknown_name("family", family, evidence.families)
    return until_settled(evidence.drawn(family, scene).setup(condition))


def rerun(evidence: Evidence, setup: Setup, controller: str) -> RunRecord:
    """A controller run on a setup, with the options of the campaign."""
    entries = evidence.manifest["configuration"]["controllers"]
    if controller not in entries:
        raise unknown_name("controller", controller, entries)
    entry = ControllerSpec.from_table(controller, entries[controller])
    if ":" in entry.law and not evidence.trusted:
        raise untrusted(f"controller {controller}", [entry.law])
    setup = entry.run.of(setup)
    return RunRecord.of(setup, simulate(setup, entry.make()), "")
