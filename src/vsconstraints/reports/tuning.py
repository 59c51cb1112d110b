"""The short report of a tuning: default and chosen setting of each law, on the scenes that it was tuned on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from statistics import median

from ..comparisons.runs.files import storing
from ..comparisons.tuning.objectives import OBJECTIVES, REFERENCE
from ..comparisons.tuning.tune import Evaluation, Tuned, Tuning
from .markdown import Table
from .page import render, write_pages

REPORT = "report.md"

HEAD = ("law", "setting", *(objective.title for objective in OBJECTIVES), "violated runs", "hypervolume")


def write_report(tuning: Tuning, folder: Path) -> None:
    """Write it into a folder as Markdown and HTML; raises StorageError."""
    text = render(
        "tuning.md",
        tuning=tuning,
        table=Table(HEAD, [cells for law in tuning.laws for cells in _lines(law)], 2),
        worst=", ".join(f"{value:g}" for value in REFERENCE),
        units=", ".join(f"{objective.unit:g} of {objective.title}" for objective in OBJECTIVES),
    )
    with storing("the report", folder):
        write_pages(folder / REPORT, text)


def _lines(law: Tuned) -> Iterator[tuple[str, ...]]:
    volumes = law.hypervolumes
    several = f" ({min(volumes):.3f}–{max(volumes):.3f})" if len(volumes) > 1 else ""
    yield law.law.name, "default", *_cells(law.default), f"{median(volumes):.3f}{several}"
    if law.chosen is None:
        yield "", "nothing is searched", *("" for _ in OBJECTIVES), "", ""
        return
    options = ", ".join(f"{key} = {_short(value)}" for key, value in law.chosen.options.items())
    chosen = "default is best" if law.chosen.number == 0 else options
    infeasible = "" if law.chosen.feasible else f"none of {len(law.evaluations)} is feasible, least: "
    yield "", infeasible + chosen, *_cells(law.chosen), ""


def _cells(evaluation: Evaluation) -> tuple[str, ...]:
    point = (f"{value:.3f}" for value in evaluation.judged.point)
    return *point, f"{100 * evaluation.judged.violations:.0f} %"


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value).lower() if isinstance(value, bool) else str(value)
