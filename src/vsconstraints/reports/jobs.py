"""What is to be drawn, and what came of it: passed between processes."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from ..scenarios import Scenario
from .style import Look


@dataclass(frozen=True)
class ScenarioJob:
    """The figures of one scenario.

    Attributes
    ----------
    folder
        The comparison's.
    scenario
        As it was run.
    controllers
        All, in order.
    finished
        Those that have a line in results.csv for this trial.
    trial, seed
        Which run is shown.
    looks
        How controllers are drawn.
    phi_rows, lane_rows
        Labels of the rows whose φ, and whose activity, is drawn.
    """

    folder: Path
    scenario: Scenario
    controllers: tuple[str, ...]
    finished: tuple[str, ...]
    trial: int
    seed: int
    looks: dict[str, Look]
    phi_rows: tuple[str, ...]
    lane_rows: tuple[str, ...]


@dataclass
class Drawn:
    """What came of it.

    Attributes
    ----------
    scenario
        Its name.
    files
        File names below ``figures``, by kind of figure.
    problems
        Sentences on what is missing.
    first_outside
        When a controller's run is first outside a row [s], for rows it violates.
    """

    scenario: str
    files: dict[str, str] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    first_outside: dict[tuple[str, str], float] = field(default_factory=dict)
