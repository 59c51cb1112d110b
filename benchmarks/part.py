"""Settings and results of a part of the benchmark."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from vsconstraints.comparisons import Suite
from vsconstraints.controllers import Controller, make_controller
from vsconstraints.scenarios import shipped_scenarios

from .timing import Times


@dataclass(frozen=True)
class Effort:
    """Extent of the measurement.

    Attributes
    ----------
    turns
        Calls of each subject, one per turn: see :mod:`benchmarks.timing`.
    scenarios
        Names of the scenarios in the table of step times.
    duration
        Longest simulated time of a run [s].
    repeats
        Repetitions of whole runs and processes.
    trials
        Number of trials on each number of cores.
    markers, rows, joints
        Sizes in the growth curves.
    long
        True if the first compilation and the default comparison are run too.
    """

    turns: int
    scenarios: tuple[str, ...]
    duration: float
    repeats: int
    trials: int
    markers: tuple[int, ...]
    rows: tuple[int, ...]
    joints: tuple[int, ...]
    long: bool


FULL = Effort(
    turns=2000,
    scenarios=shipped_scenarios(),
    duration=60.0,
    repeats=9,
    trials=40,
    markers=(4, 10, 25, 63, 159, 400),
    rows=(10, 32, 100, 316, 1000),
    joints=(3, 6, 7, 12, 20, 30),
    long=True,
)
QUICK = Effort(
    turns=500,
    scenarios=("case-study-6r", "ur5-fov", "panda-fov", "example-2d-fov"),
    duration=60.0,
    repeats=3,
    trials=8,
    markers=(4, 40, 400),
    rows=(10, 100, 1000),
    joints=(3, 10, 30),
    long=False,
)
TINY = Effort(
    turns=10,
    scenarios=("case-study-6r", "ur5-fov", "panda-fov"),
    duration=0.2,
    repeats=1,
    trials=2,
    markers=(4, 8),
    rows=(10, 20),
    joints=(6, 7, 30),
    long=False,
)

CASE_STUDY = "case-study-6r"


@dataclass
class Table:
    """A table of a part; the first ``text_columns`` are text."""

    header: Sequence[str]
    lines: list[list[str]]
    text_columns: int = 1


@dataclass
class Part:
    """Result of a part.

    Attributes
    ----------
    title
        Heading.
    text
        Description of the measurement.
    tables
        Tables of results.
    numbers
        Numbers for verdicts and later readers, by name; times in seconds unless the name says
        otherwise.
    figure
        File name of the figure; empty if there is none.
    """

    title: str
    text: str
    tables: list[Table] = field(default_factory=list)
    numbers: dict[str, float] = field(default_factory=dict)
    figure: str = ""

    def keep(self, name: str, times: Times) -> None:
        """Keep median, ratio and spread of some times."""
        self.numbers[f"{name}: median"] = times.median
        self.numbers[f"{name}: ratio"] = times.ratio
        self.numbers[f"{name}: p99/median"] = times.spread


OTHER_FORMS = {
    "potential-field-priority": ("potential-field", {"blend": "priority"}),
    "hierarchical-qp-active": ("hierarchical-qp", {"rows": "active"}),
    "robust-predictive": ("robust-predictive", {}),
}
"""Laws and options that are timed besides those of the default comparison."""

LONG_PLANS = {f"predictive-{horizon}": ("predictive", {"horizon": horizon}) for horizon in (30, 50)}
"""Further laws that are timed on the case study only."""


def controllers(scenario: str = "") -> dict[str, Controller]:
    """Return new controllers of the default comparison and other timed forms, by name.

    The other forms depend on the scenario.
    """
    forms = {**OTHER_FORMS, **(LONG_PLANS if scenario == CASE_STUDY else {})}
    others = {name: make_controller(law, options) for name, (law, options) in forms.items()}
    return {entry.name: entry.make() for entry in _default_suite().controllers} | others


@cache
def _default_suite() -> Suite:
    return Suite.load()


def hierarchical_qp(solver: str) -> Controller:
    """Return the hierarchical QP with a QP solver given by name."""
    return make_controller("hierarchical-qp", {"solver": solver})


def microseconds(*seconds: float) -> str:
    """Format times to three digits, as ``4.21 / 5.02 / 31.0`` µs."""
    return " / ".join(digits(1e6 * value) for value in seconds)


def digits(value: float) -> str:
    """Format a number to three significant digits without an exponent."""
    if not np.isfinite(value):
        return "–"
    return f"{value:.0f}" if abs(value) >= 99.95 else f"{value:#.3g}"


def median_p99_max(times: Times) -> str:
    """Format median, p99 and maximum of times in µs."""
    return microseconds(times.median, times.p99, times.max)


def ratios(times: Times) -> str:
    """Format median, p99 and maximum of times in units."""
    return " / ".join(digits(value / times.unit) for value in (times.median, times.p99, times.max))
