"""Short report of a tuning: default and tuned setting of each law, on the tuning scenes."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from ...comparisons.runs.files import storing
from ...reports.numbers import over_trials, percent
from ...reports.page import render, write_pages
from ..tuning.problem import ALL, OBJECTIVES, REFERENCE
from ..tuning.tune import Tuning

REPORT = "report.md"
BUDGETS = (0, 20, 100)  #: Evaluations after which successes are shown, beside the whole budget.


def write_report(tuning: Tuning, folder: Path) -> None:
    """Write the report of a tuning into a folder as Markdown and HTML; raises StorageError."""
    evaluations = tuning.problem.budget.evaluations
    budgets = [budget for budget in BUDGETS if budget < evaluations]
    text = render(
        Path(__file__).with_name("tuning.md"),
        tuning=tuning,
        families=(ALL, *tuning.families),
        budgets=[*budgets, evaluations],
        objectives=OBJECTIVES,
        short=_short,
        success=partial(over_trials, show=percent),
        worst=REFERENCE,
    )
    with storing("the report", folder):
        write_pages(folder / REPORT, text)


def _short(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    text = str(value)
    return text.lower() if isinstance(value, bool) else text
