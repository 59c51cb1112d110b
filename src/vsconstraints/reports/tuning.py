"""The short report of a tuning: default and chosen setting of each law, on the scenes that it was tuned on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ..comparisons.runs.files import storing
from ..comparisons.tuning.problem import ALL, OBJECTIVES, REFERENCE
from ..comparisons.tuning.tune import Evaluation, Tuned, Tuning
from .markdown import Table
from .numbers import over_trials, percent
from .page import render, write_pages

REPORT = "report.md"

HEAD = ("law", "setting", "success", *(objective.title for objective in OBJECTIVES), "violated runs")

BUDGETS = (0, 20, 100)  #: evaluations by whose number successes are shown, beside all there are


def write_report(tuning: Tuning, folder: Path) -> None:
    """Write it into a folder as Markdown and HTML; raises StorageError."""
    families, evaluations = tuning.families, tuning.problem.budget.evaluations
    of, budgets = (ALL, *families), [*(budget for budget in BUDGETS if budget < evaluations), evaluations]
    text = render(
        "tuning.md",
        tuning=tuning,
        table=Table(HEAD, [cells for law in tuning.laws for cells in _lines(law)], 2),
        successes=Table(
            ("law, evaluations", "all families", *families),
            [
                (f"{law.law.name}, {budget}", *(over_trials(law.success(family, budget), percent) for family in of))
                for law in tuning.laws
                for budget in (budgets if law.law.ranges else budgets[:1])
            ],
        ),
        worst=", ".join(f"{value:g}" for value in REFERENCE),
        units=", ".join(f"{objective.unit:g} of {objective.title}" for objective in OBJECTIVES),
    )
    with storing("the report", folder):
        write_pages(folder / REPORT, text)


def _lines(law: Tuned) -> Iterator[tuple[str, ...]]:
    yield law.law.name, "default", *_cells(law.default)
    options = ", ".join(f"{key} = {_short(value)}" for key, value in law.chosen.options.items())
    chosen = "default is best" if law.chosen.number == 0 else options
    yield "", chosen if options else "nothing is searched", *_cells(law.chosen)


def _cells(evaluation: Evaluation) -> tuple[str, ...]:
    point = (f"{value:.3f}" for value in evaluation.judged.point)
    return evaluation.judged.success, *point, f"{100 * evaluation.judged.violations:.0f} %"


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value).lower() if isinstance(value, bool) else str(value)
