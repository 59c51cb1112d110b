"""The short report of a tuning: default and chosen setting of each law, on the scenes that it was tuned on."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from statistics import median

from ..comparisons.runs.files import storing
from ..comparisons.tuning.objectives import OBJECTIVES, REFERENCE
from ..comparisons.tuning.problem import Problem
from ..comparisons.tuning.tune import Evaluation, Tuned, Tuning
from .markdown import table
from .page import write_pages

REPORT = "report.md"

HEAD = ("law", "setting", *(objective.title for objective in OBJECTIVES), "violated runs", "hypervolume")


def write_report(tuning: Tuning, folder: Path) -> None:
    """Write it into a folder as Markdown and HTML; raises StorageError."""
    with storing("the report", folder):
        write_pages(folder / REPORT, report(tuning))


def report(tuning: Tuning) -> str:
    """The report as Markdown."""
    lines = [f"# Tuning: {tuning.problem.campaign.title}", "", *_how(tuning.problem), ""]
    lines.append(table(HEAD, [cells for law in tuning.laws for cells in _lines(law)], text_columns=2))
    return "\n".join([*lines, "", *_remarks(tuning), ""])


def _how(problem: Problem) -> Iterator[str]:
    budget, families = problem.budget, problem.campaign.families
    names = ", ".join(family.name for family in families)
    yield (
        f"{budget.evaluations} evaluations of each law by the same tuner, {budget.seeds} times; "
        f"{budget.scenes} training scenes of each family ({names}) in all their conditions. These are the numbers that "
        "were tuned: how settings do on scenes that tuning has not seen is in the report of evidence."
    )


def _lines(law: Tuned) -> Iterator[tuple[str, ...]]:
    name = law.law.name
    volumes = law.hypervolumes
    several = f" ({min(volumes):.3f}–{max(volumes):.3f})" if len(volumes) > 1 else ""
    spread = f"{median(volumes):.3f}{several}"
    yield name, "default", *_cells(law.default), spread
    if law.chosen is not None:
        options = ", ".join(f"{key} = {_short(value)}" for key, value in law.chosen.options.items())
        chosen = "default is best" if law.chosen.number == 0 else options
        said = "" if law.chosen.feasible else f"none of {len(law.evaluations)} is feasible, least: "
        yield "", said + chosen, *_cells(law.chosen), ""
    else:
        yield "", "nothing is searched", *("" for _ in OBJECTIVES), "", ""


def _cells(one: Evaluation) -> tuple[str, ...]:
    return *(f"{value:.3f}" for value in one.judged.point), f"{100 * one.judged.violations:.0f} %"


def _remarks(tuning: Tuning) -> Iterator[str]:
    budget = tuning.problem.budget
    worst = ", ".join(f"{value:g}" for value in REFERENCE)
    runs = tuning.laws[0].default.judged.runs
    yield (
        f"Objectives are means over {runs} runs, less is better; a run that does not converge counts as ({worst}), "
        "which is the reference point of hypervolumes too. A setting is feasible if at most "
        f"{100 * budget.violations:g} % of its runs violate a row."
    )
    if budget.seeds > 1:
        held = 100.0 * (1.0 - math.ldexp(1.0, 1 - budget.seeds))
        yield (
            f"Hypervolumes: median and range of {budget.seeds} tuner seeds; the range holds the true median with a "
            f"confidence of {held:.3g} %."
        )
    units = ", ".join(f"{objective.unit:g} of {objective.title}" for objective in OBJECTIVES)
    yield (
        "Chosen is, of the feasible settings of all tuner seeds, the one nearest to the ideal point, which has the "
        "least value of each objective on the front, and where none is feasible, of those that violate least; "
        f"distances are in units of {units}, for all laws alike."
    )


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value).lower() if isinstance(value, bool) else str(value)
