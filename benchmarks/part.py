"""What a part of the benchmark is given and what it gives back."""

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
    """How much is measured.

    Attributes
    ----------
    turns
        Of each subject, one call each: see :mod:`benchmarks.timing`.
    scenarios
        Names of those in the table of step times.
    duration
        Longest simulated time of a run [s].
    repeats
        Of whole runs and processes.
    trials
        Simulated at a time, on each number of cores.
    markers, rows, joints
        Sizes in the growth curves.
    long
        Whether the first compilation and the default comparison are run too.
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
    """What a part came to.

    Attributes
    ----------
    title
        Its heading.
    text
        How it is measured.
    tables
        Its tables.
    numbers
        What verdicts and later readers need, by name; times in seconds unless the name says
        otherwise.
    figure
        File name of its figure; empty if it has none.
    """

    title: str
    text: str
    tables: list[Table] = field(default_factory=list)
    numbers: dict[str, float] = field(default_factory=dict)
    figure: str = ""

    def keep(self, name: str, times: Times) -> None:
        """Keep what is worth keeping of some times."""
        self.numbers[f"{name}: median"] = times.median
        self.numbers[f"{name}: ratio"] = times.ratio
        self.numbers[f"{name}: p99/median"] = times.spread


OTHER_FORMS = {
    "potential-field-priority": ("potential-field", {"blend": "priority"}),
    "hierarchical-qp-active": ("hierarchical-qp", {"rows": "active"}),
    "robust-predictive": ("robust-predictive", {}),
    "goal-governor": ("goal-governor", {}),
    "barrier-governor": ("barrier-governor", {}),
}
"""Laws and options that are timed beside those of the default comparison."""

LONG_PLANS = {f"predictive-{horizon}": ("predictive", {"horizon": horizon}) for horizon in (30, 50)}
"""The same, on the case study alone."""


def controllers(scenario: str = "") -> dict[str, Controller]:
    """New controllers of the default comparison, and other forms of them that are timed on a
    scenario, by name.
    """
    forms = {**OTHER_FORMS, **(LONG_PLANS if scenario == CASE_STUDY else {})}
    others = {name: make_controller(law, options) for name, (law, options) in forms.items()}
    return {entry.name: entry.make() for entry in _default_suite().controllers} | others


@cache
def _default_suite() -> Suite:
    return Suite.load()


def hierarchical_qp(solver: str) -> Controller:
    """The hierarchy with a QP solver by its name."""
    return make_controller("hierarchical-qp", {"solver": solver})


def microseconds(*seconds: float) -> str:
    """Times to three digits, as ``4.21 / 5.02 / 31.0`` µs."""
    return " / ".join(digits(1e6 * value) for value in seconds)


def digits(value: float) -> str:
    """Three significant digits without an exponent."""
    if not np.isfinite(value):
        return "–"
    return f"{value:.0f}" if abs(value) >= 99.95 else f"{value:#.3g}"


def median_p99_max(times: Times) -> str:
    """Of times, in µs."""
    return microseconds(times.median, times.p99, times.max)


def ratios(times: Times) -> str:
    """The same in units."""
    return " / ".join(digits(value / times.unit) for value in (times.median, times.p99, times.max))
