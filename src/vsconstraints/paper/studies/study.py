"""Base classes of studies: runs that differ in varied values, numbers, sentences, one figure."""

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

#: Identifies a run of a study: a NamedTuple of varied values, None if one does not apply.
Case = Hashable
Results = Mapping[Any, RunSummary]  #: Summaries of a study's runs, by their cases.
#: Numbers by name, for each subject.
Found = Mapping[tuple[Any, ...], Mapping[Any, float]]


@dataclass(frozen=True)
class StudyResult:
    """Result of a study: numbers for verdicts, sentences, data of the figure, and failures.

    The data include failed runs.
    """

    study: str
    numbers: Numbers = field(default_factory=dict)
    sentences: tuple[str, ...] = ()
    points: tuple[dict[str, Any], ...] = ()
    failures: tuple[str, ...] = ()


class Study(ABC):
    """A question, the runs that answer it, and one figure.

    Studies are listed in :data:`vsconstraints.paper.studies.STUDIES`.
    """

    name: str  #: Name in files, headings and texts.
    title: str
    question: str
    #: Numbers of the paper's claims that it answers, as in the reproduction.
    claims: tuple[int, ...]
    figure_caption: str  #: Description of the figure.
    #: True if summaries include the drift of φ, which takes about as long as the runs.
    drift_noted: bool = False

    @abstractmethod
    def runs(self, *, small: bool = False) -> Mapping[Any, RunSpec]:
        """Return runs by case, in order of the figure's data; if ``small``, a few short ones."""

    @abstractmethod
    def measure(self, results: Results) -> tuple[Points, Numbers, list[str]]:
        """Return points, numbers and sentences of :class:`StudyResult`.

        ``results`` contains failed runs, and may lack runs.
        """

    def figure(self, result: StudyResult) -> Sheet:
        """Draw the figure from the result's points."""
        raise NotImplementedError(f"{type(self).__name__} has neither figure nor draw")

    def draw(self, result: StudyResult, path: Path) -> None:
        """Draw the figure and write it in the format given by the path's suffix."""
        Figure(self.name, self.title, self.figure_caption, self.figure).write(path, result)

    def evaluate(self, results: Results) -> StudyResult:
        """Return the result; runs that ended early are listed as failures."""
        points, numbers, sentences = self.measure(results)
        failures = [
            f"{_text(case)}: {run.status}, {run.reason}"
            for case, run in results.items()
            if run.ended_early
        ]
        return StudyResult(self.name, numbers, tuple(sentences), tuple(points), tuple(failures))


class Sweep(Study):
    """Study defined by the table of its name in ``studies.toml``: texts, varied values, columns.

    ``varied`` names the fields of a case, None if one does not apply. Each table of ``runs``
    (``small`` for the small form) is a product. It gives values, or a list of them, for these
    fields, the last one varied first, and may set keys of the scenario (``overrides``). ``columns``
    are the columns of the data that follow the case. ``sentences`` is a template with one sentence
    per line; its variables are the points, the table, the numbers :func:`.tables.about` a subject,
    and the helpers. The figure is that of :func:`.drawing.sweep_figure`.

    Parameters
    ----------
    spec
        Returns the run of a case, without the table's overrides.
    lines
        Returns the study's own columns for the run of a case, as one or several lines of data. Its
        last argument holds the other runs.
    numbers
        Returns the numbers of :class:`StudyResult`.
    completed
        Adds columns that depend on all points.
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
        """Return a line of data: the case, and the columns of the table.

        Columns that are not the study's own are taken from the summary. ``violation`` is in % of L.
        A column that is neither known here nor a score of the run is NaN.
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
