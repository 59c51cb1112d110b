"""What a study is: runs that differ in what is varied, numbers and sentences about them, and one
figure.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import namedtuple
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any

from ...comparisons.runs.spec import RunSpec
from ...reports.plots import Figure, Sheet
from ..verdicts import filled
from .drawing import sweep_figure
from .summary import RunSummary
from .tables import TABLES, Numbers, Points, about

#: Identifies a run of a study: a NamedTuple of what is varied, None where something does not apply.
Case = Hashable
Results = Mapping[Any, RunSummary]  #: Of a study's runs, by their cases.
#: From what numbers are about to these numbers by name.
Found = Mapping[tuple[Any, ...], Mapping[Any, float]]


@dataclass(frozen=True)
class StudyResult:
    """Numbers that verdicts are based on, sentences, the figure's data (failed runs included), and
    failures.
    """

    study: str
    numbers: Numbers = field(default_factory=dict)
    sentences: tuple[str, ...] = ()
    points: tuple[dict[str, Any], ...] = ()
    failures: tuple[str, ...] = ()


class Study(ABC):
    """A question, the runs that answer it, and one figure; listed in
    :data:`vsconstraints.paper.studies.STUDIES`.
    """

    name: str  #: As files, headings and readers know it.
    title: str
    question: str
    #: Which of the paper's claims it answers, as the reproduction numbers them.
    claims: tuple[int, ...]
    figure_caption: str  #: What the figure shows.
    #: Whether summaries include what moved φ, which takes about as long as the runs do.
    drift_noted: bool = False

    @abstractmethod
    def runs(self, *, small: bool = False) -> Mapping[Any, RunSpec]:
        """Every run by its case, in the order of the figure's data; ``small`` asks for a few short
        ones.
        """

    @abstractmethod
    def measure(self, results: Results) -> tuple[Points, Numbers, list[str]]:
        """Points, numbers and sentences of :class:`StudyResult`; ``results`` may lack runs, and has
        failed ones.
        """

    def figure(self, result: StudyResult) -> Sheet:
        """The figure, drawn from the result's points."""
        raise NotImplementedError(f"{type(self).__name__} has neither figure nor draw")

    def draw(self, result: StudyResult, path: Path) -> None:
        """Draw the figure and write it in the format given by the path's suffix."""
        Figure(self.name, self.title, self.figure_caption, self.figure).write(path, result)

    def evaluate(self, results: Results) -> StudyResult:
        """The result, with the runs that ended early as failures."""
        points, numbers, sentences = self.measure(results)
        failures = [
            f"{_text(case)}: {run.status}, {run.reason}"
            for case, run in results.items()
            if run.ended_early
        ]
        return StudyResult(self.name, numbers, tuple(sentences), tuple(points), tuple(failures))


class Sweep(Study):
    """A study whose texts, varied values and columns are the table of its name in ``studies.toml``.

    ``varied`` names the fields of a case, None where one does not apply. Each table of ``runs``
    (``small`` for the small form) is a product: it gives values, or a list of them, for these
    fields, the last one varied first, and may set keys of the scenario (``overrides``). ``columns``
    are those of the data, behind the case; ``sentences`` is a template, a sentence a line, of the
    points, the table, the numbers :func:`.tables.about` something, and the helpers. The figure is
    that of :func:`.drawing.sweep_figure`.

    Parameters
    ----------
    spec
        The run of a case, without the table's overrides.
    lines
        The study's own columns of a case's run, given the others too, in one line of data or
        several.
    numbers
        Numbers of :class:`StudyResult`.
    completed
        Points with columns that depend on all points.
    """

    def __init__(
        self,
        name: str,
        spec: Callable[[Any], RunSpec],
        lines: Callable[[Any, RunSummary, Results], list[dict[str, Any]]],
        numbers: Callable[[Points], Found],
        completed: Callable[[Points], Points] = lambda points: points,
        helpers: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        self.name = name
        self.spec = spec
        self.lines = lines
        self.numbers = numbers
        self.completed = completed
        self.table = table = TABLES[name]
        self.helpers = helpers
        self.Case: Any = namedtuple("Case", table["varied"], defaults=[None] * len(table["varied"]))  # type: ignore[misc]
        self.title = table["title"]
        self.question = table["question"]
        self.figure_caption = table["caption"]
        self.claims = tuple(table["claims"])
        self.drift_noted = table.get("drift", False)

    def runs(self, *, small: bool = False) -> dict[Any, RunSpec]:
        """See :class:`Study`."""
        runs = {}
        for table in self.table["small" if small else "runs"]:
            values = {
                name: value if isinstance(value, list) else [value] for name, value in table.items()
            }
            (overrides,) = values.pop("overrides", [{}])
            for chosen in product(*values.values()):
                case = self.Case(**dict(zip(values, chosen, strict=True)))
                spec = self.spec(case)
                runs[case] = replace(spec, overrides={**spec.overrides, **overrides})
        return runs

    def point(self, case: Any, run: RunSummary, own: Mapping[str, Any]) -> dict[str, Any]:
        """A line of data: the case, and the columns of the table; where they are not the study's
        own, of the summary.

        ``violation`` is in % of L; what is neither known here nor a score of the run is NaN.
        """
        known = {
            **{
                name: math.nan if varied is None else varied
                for name, varied in case._asdict().items()
            },
            "status": run.status,
            "reason": run.reason,
            "violated": run.result.get("violated", ""),
            "violation": 100.0 * run.value("violation_depth"),
            "switching_rate": run.value("switching_rate_hz"),
            "phi_max": run.phi_max,
            "longest_run": float(run.longest_run),
            "bound_12": run.needed_gain,
            **own,
        }
        names = (*case._fields, *self.table["columns"])
        return {name: known[name] if name in known else run.value(name) for name in names}

    def measure(self, results: Results) -> tuple[Points, Numbers, list[str]]:
        """See :class:`Study`."""
        lines = (
            (case, run, own)
            for case, run in results.items()
            for own in self.lines(case, run, results)
        )
        points = self.completed([self.point(*line) for line in lines])
        found = self.numbers(points)
        numbers = {
            (*key, name): float(value) for key, own in found.items() for name, value in own.items()
        }
        context = {
            "points": points,
            "table": self.table,
            "about": partial(about, numbers),
            **self.helpers,
        }
        return (
            points,
            numbers,
            list(filter(None, filled(self.table["sentences"], **context).splitlines())),
        )

    def figure(self, result: StudyResult) -> Sheet:
        """See :class:`Study`."""
        return sweep_figure(self.table, list(result.points), result.numbers)


def _text(case: Case) -> str:
    parts = case if isinstance(case, tuple) else (case,)
    return " ".join(
        f"{part:g}" if isinstance(part, float) else str(part) for part in parts if part is not None
    )
