"""What a study is: runs that differ in one thing, and what their comparison answers."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from .summary import RunSummary


@dataclass(frozen=True)
class StudyRun:
    """One simulation of a study.

    Attributes
    ----------
    key
        Its name, unique within the study.
    scenario
        Name of a shipped scenario.
    law, options
        Registered name of the controller, and what it is made with.
    controller
        What figures call the controller, and by which they choose its colour.
    overrides
        Dotted keys of the scenario that are set to other values.
    drift_noted
        Whether what moves φ is noted, which takes longer than the run itself.
    """

    key: str
    scenario: str
    law: str
    options: dict[str, Any] = field(default_factory=dict)
    controller: str = ""
    overrides: dict[str, Any] = field(default_factory=dict)
    drift_noted: bool = False

    def __post_init__(self) -> None:
        if not self.controller:
            object.__setattr__(self, "controller", self.law)

    @property
    def identity(self) -> str:
        """The same for runs that give the same result, whatever study they belong to."""
        parts = (self.scenario, self.law, self.options, self.overrides, self.drift_noted)
        return json.dumps(parts, sort_keys=True)


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
        ``key: reason`` of every run that failed or was aborted, and of an evaluation or drawing that failed.
    """

    study: str
    numbers: dict[str, float] = field(default_factory=dict)
    sentences: tuple[str, ...] = ()
    points: tuple[dict[str, Any], ...] = ()
    failures: tuple[str, ...] = ()


class Study(ABC):
    """A question, the runs that answer it, and one figure.

    A new study gives the attributes below, :meth:`runs`, :meth:`measure` and :meth:`draw`, and a line in
    :data:`vsconstraints.studies.STUDIES`.

    Attributes
    ----------
    name, title, question
        As files, headings and readers know it.
    claims
        Which of the paper's claims it answers, as the reproduction numbers them.
    figure_caption
        What the figure shows.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    question: ClassVar[str]
    claims: ClassVar[tuple[int, ...]]
    figure_caption: ClassVar[str]

    @abstractmethod
    def runs(self, *, small: bool = False) -> list[StudyRun]:
        """Every simulation, in the order of the figure's data; ``small`` asks for a few short ones."""

    @abstractmethod
    def measure(self, results: Mapping[str, RunSummary]) -> tuple[list[dict[str, Any]], dict[str, float], list[str]]:
        """The points, numbers and sentences of :class:`StudyResult`; runs that failed are in ``results`` as such."""

    @abstractmethod
    def draw(self, result: StudyResult, path: Path) -> None:
        """Draw the figure from the result's points and write it as PNG."""

    def evaluate(self, results: Mapping[str, RunSummary]) -> StudyResult:
        """What the runs say.

        Parameters
        ----------
        results
            By the runs' keys. Runs may be missing; a run that failed or was aborted is listed with its reason.
        """
        points, numbers, sentences = self.measure(results)
        failures = [f"{key}: {run.status}, {run.reason}" for key, run in results.items() if not run.carried_through]
        return StudyResult(self.name, numbers, tuple(sentences), tuple(points), tuple(failures))
