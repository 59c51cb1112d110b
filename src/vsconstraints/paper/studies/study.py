"""Base class of studies: runs that differ in varied values, numbers, sentences, one figure."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...comparisons.runs.spec import RunSpec
from ...reports.plots import Figure, Sheet
from .summary import RunSummary
from .tables import Numbers, Point, Points

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
    points: tuple[Point, ...] = ()
    failures: tuple[str, ...] = ()


class Study(ABC):
    """A question, the runs that answer it, and one figure.

    Studies are listed in :data:`vsconstraints.paper.studies.STUDIES`. A case identifies a run: a
    NamedTuple of varied values, None if one does not apply. The data of the figure have one or
    several points, lines of data, for each run. A point begins with the case and continues with
    ``columns``.
    """

    name: str  #: Name in files, headings and texts.
    title: str
    question: str
    #: Numbers of the paper's claims that it answers, as in the reproduction.
    claims: tuple[int, ...]
    columns: tuple[str, ...]  #: Columns of the data that follow the case.
    figure_caption: str  #: Description of the figure.
    #: True if summaries include the drift of φ, which takes about as long as the runs.
    drift_noted: bool = False

    @abstractmethod
    def runs(self, *, small: bool = False) -> Mapping[Any, RunSpec]:
        """Return runs by case, in order of the figure's data; if ``small``, a few short ones."""

    @abstractmethod
    def figure(self, result: StudyResult) -> Sheet:
        """Draw the figure from the result's points."""

    def draw(self, result: StudyResult, path: Path) -> None:
        """Draw the figure and write it in the format given by the path's suffix."""
        Figure(self.name, self.title, self.figure_caption, self.figure).write(path, result)

    @abstractmethod
    def lines(self, case: Any, run: RunSummary, results: Results) -> Points:
        """Return the study's own columns for the run of a case, for one or several points.

        ``results`` holds all runs.
        """

    @abstractmethod
    def numbers(self, points: Points) -> Found:
        """Return the numbers of :class:`StudyResult`."""

    @abstractmethod
    def sentences(self, points: Points, numbers: Numbers) -> list[str]:
        """Return the sentences of :class:`StudyResult`."""

    def completed(self, points: Points) -> Points:
        """Return the points with columns that depend on all points."""
        return points

    def point(self, case: Any, run: RunSummary, columns: Mapping[str, Any]) -> Point:
        """Return a point, one line of data: the case, and the columns.

        Columns that are not the study's own are taken from the summary. ``violation`` is in % of L.
        A column that is neither known here nor a score of the run is NaN.
        """
        varied = {
            name: math.nan if value is None else value for name, value in case._asdict().items()
        }
        known = {
            **varied,
            "status": run.status,
            "reason": run.reason,
            "violated": run.result.get("violated", ""),
            "violation": 100.0 * run.value("violation_depth"),
            "switching_rate": run.value("switching_rate_hz"),
            "phi_max": run.phi_max,
            "longest_run": float(run.longest_run),
            "bound_12": run.needed_gain,
            **columns,
        }
        names = (*varied, *self.columns)
        return {name: known[name] if name in known else run.value(name) for name in names}

    def evaluate(self, results: Results) -> StudyResult:
        """Return the result of runs, which may have failed or be missing.

        Runs that ended early are listed as failures.
        """
        points: Points = []
        failures = []
        for case, run in results.items():
            points += [self.point(case, run, line) for line in self.lines(case, run, results)]
            if run.ended_early:
                failures.append(f"{_text(case)}: {run.status}, {run.reason}")
        points = self.completed(points)
        numbers = {}
        for subject, found in self.numbers(points).items():
            for name, value in found.items():
                numbers[*subject, name] = float(value)
        sentences = tuple(self.sentences(points, numbers))
        return StudyResult(self.name, numbers, sentences, tuple(points), tuple(failures))


def _text(case: tuple[Any, ...]) -> str:
    return " ".join(
        f"{part:g}" if isinstance(part, float) else str(part) for part in case if part is not None
    )
