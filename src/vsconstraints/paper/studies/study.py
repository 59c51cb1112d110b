"""What a study is: runs that differ in one thing, and what their comparison answers."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from ...comparisons.runs.spec import RunSpec
from ...reports.plots import Figure, Sheet
from .points import Measured, Numbers
from .summary import RunSummary

Case = Hashable
"""What tells a run from the others of its study: a NamedTuple of what is varied, None where something is not."""


@dataclass(frozen=True)
class StudyResult:
    """What a study found.

    Attributes
    ----------
    study
        Its name.
    numbers
        What verdicts are made of, by name; NaN where it could not be measured.
    sentences
        The findings, with their numbers.
    points
        The data of the figure: one line of the study's CSV file each, failed runs included.
    failures
        Case and reason of every run that failed or was aborted, and of an evaluation or drawing that failed.
    """

    study: str
    numbers: Numbers = field(default_factory=dict)
    sentences: tuple[str, ...] = ()
    points: tuple[dict[str, Any], ...] = ()
    failures: tuple[str, ...] = ()


class Study(ABC):
    """A question, the runs that answer it, and one figure.

    A new study gives the attributes below, :meth:`runs`, :meth:`measure` and :meth:`figure`, and a line in
    :data:`vsconstraints.paper.studies.STUDIES`.

    Attributes
    ----------
    name, title, question
        As files, headings and readers know it.
    claims
        Which of the paper's claims it answers, as the reproduction numbers them.
    figure_caption
        What the figure shows.
    drift_noted
        Whether runs are asked what moved φ, which takes about as long as they do.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    question: ClassVar[str]
    claims: ClassVar[tuple[int, ...]]
    figure_caption: ClassVar[str]
    drift_noted: ClassVar[bool] = False

    @abstractmethod
    def runs(self, *, small: bool = False) -> Mapping[Any, RunSpec]:
        """Every run by its case, in the order of the figure's data; ``small`` asks for a few short ones."""

    @abstractmethod
    def measure(self, results: Mapping[Any, RunSummary]) -> Measured:
        """The points, numbers and sentences of :class:`StudyResult`; runs that failed are in ``results`` as such."""

    def figure(self, result: StudyResult) -> Sheet:
        """The figure, drawn from the result's points."""
        raise NotImplementedError(f"{type(self).__name__} has neither figure nor draw")

    def draw(self, result: StudyResult, path: Path) -> None:
        """Draw the figure and write it in the format that the path's suffix says."""
        Figure(self.name, self.title, self.figure_caption, self.figure).write(path, result)

    def evaluate(self, results: Mapping[Any, RunSummary]) -> StudyResult:
        """What the runs say.

        Parameters
        ----------
        results
            By the runs' cases. Runs may be missing; a run that failed or was aborted is listed with its reason.
        """
        points, numbers, sentences = self.measure(results)
        failures = [f"{_said(case)}: {run.status}, {run.reason}" for case, run in results.items() if run.ended_early]
        return StudyResult(self.name, numbers, tuple(sentences), tuple(points), tuple(failures))


def begun(case: Any, run: RunSummary) -> dict[str, Any]:
    """How a run's line of the figure's data begins: its case, a NamedTuple, and how it ended."""
    varied = {name: math.nan if value is None else value for name, value in case._asdict().items()}
    return {**varied, "status": run.status, "reason": run.reason}


def _said(case: Case) -> str:
    parts = case if isinstance(case, tuple) else (case,)
    return " ".join(f"{part:g}" if isinstance(part, float) else str(part) for part in parts if part is not None)
