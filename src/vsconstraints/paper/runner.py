"""Runs everything the claims need, measures them, draws the figures and writes the report."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from ..comparisons.run import Run, kept_file, kept_run, unfinished
from ..comparisons.runs.pool import Failure, carry_out
from ..comparisons.runs.spec import RunSpec, longest_first
from ..compiled import prepare
from ..errors import ConfigurationError
from ..reports.plots import PNG, Figure, Formats
from . import claims as _claims  # noqa: F401 - registers every claim
from .figures import FIGURES
from .report import Reproduction, write_report
from .studies import run_studies
from .verdicts import all_claims

Progress = Callable[[str, int, int], None]
"""Told what is being done, how much of it is done, and how much there is."""

Amount = Callable[[int, int], None]
"""Told how much of something is done, and how much there is."""


def reproduce(
    folder: Path,
    *,
    workers: int | None = None,
    on_progress: Progress = lambda what, done, total: None,
    command: Sequence[str] = (),
    formats: Formats = PNG,
) -> Reproduction:
    """Check every claim of the paper and redraw its figures.

    Everything is simulated anew, but for what the same command has simulated before it was interrupted. Whatever
    fails, a scenario, a run, a study or a figure, costs only what rests on it: those claims become ``not measured``,
    with the reason.

    Parameters
    ----------
    folder
        Where report.md, claims.csv and figures go; made if it is not there.
    workers
        Number of processes at most; see :func:`vsconstraints.comparisons.runs.machine.process_count`.
    on_progress
        Told of what is done.
    command
        What the user typed, for the report.
    formats
        In which figures are written; the report shows the first.

    Raises
    ------
    ConfigurationError
        if the folder cannot be made.
    """
    started = time.perf_counter()
    figures = figures_folder(folder)
    with unfinished(folder) as kept:
        prepare()
        runs = made(wanted_runs(), kept, workers, partial(on_progress, "simulating"))
        studies = study_results(folder, workers, partial(on_progress, "studying"), kept, None, formats)
        available: dict[RunSpec | str, Any] = dict(chain(runs.items(), studies.items()))
        findings = {claim.key: claim.check(available) for claim in all_claims()}
        missing = drawn(FIGURES, available, figures, workers, partial(on_progress, "drawing"), formats)
        problems = {str(spec): found for spec, found in available.items() if isinstance(found, str)}
        problems |= {f"figure {number}": why for number, why in missing.items() if why}
        result = Reproduction(folder / "report.md", findings, problems, time.perf_counter() - started, formats)
        write_report(result, missing, studies, command)
    return result


def figures_folder(folder: Path) -> Path:
    """Where figures go, made if it is not there; raises ConfigurationError if it cannot be."""
    try:
        (folder / "figures").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(f"the report cannot be written to {folder}: {error}") from error
    return folder / "figures"


def wanted_runs() -> list[RunSpec]:
    """Every run that a claim or a figure needs, once."""
    needs = [need for claim in all_claims() for need in claim.needs]
    needs += [need for figure in FIGURES.values() for need in figure.needs]
    return list(dict.fromkeys(need for need in needs if isinstance(need, RunSpec)))


def made(specs: Sequence[RunSpec], kept: Path, workers: int | None, on_progress: Amount) -> dict[RunSpec, Run | str]:
    """Runs, or why there is none: the first sentence of what was raised."""
    limits = longest_first(specs)
    calls = {spec: (spec, kept_file(kept, spec)) for spec in limits}
    found = carry_out(kept_run, calls, workers=workers, limits=limits, on_progress=on_progress)
    return {spec: one.reason.split(". ")[0] if isinstance(one, Failure) else one for spec, one in found.items()}


def drawn(
    figures: Mapping[int, Figure],
    available: Mapping[Any, Any],
    folder: Path,
    workers: int | None,
    on_progress: Amount,
    formats: Formats = PNG,
) -> dict[int, str]:
    """Of each figure why it is not there; an empty text if it is."""
    why, calls = dict.fromkeys(figures, ""), {}
    for number, figure in figures.items():
        runs = [available[need] for need in figure.needs]
        missing = [f"{need}: {run}" for need, run in zip(figure.needs, runs, strict=True) if not isinstance(run, Run)]
        if missing:
            why[number] = missing[0]
        else:
            calls[number] = (figure, folder / figure.file_in(formats), *runs)
    write = partial(Figure.write, formats=formats)
    for number, answer in carry_out(write, calls, workers=workers, on_progress=on_progress).items():
        why[number] = answer.reason if isinstance(answer, Failure) else ""
    for number, reason in why.items():
        if reason:
            for one in formats:
                (folder / figures[number].file_in((one,))).unlink(missing_ok=True)
    return why


def study_results(
    folder: Path,
    workers: int | None,
    on_progress: Amount,
    kept: Path,
    names: Sequence[str] | None = None,
    formats: Formats = PNG,
) -> dict[str, Any]:
    """Results of studies by name, of all if none is named; a text instead of a result where there is none."""
    try:
        return dict(run_studies(names, folder, workers, on_progress, kept=kept, formats=formats))
    except Exception as error:  # claims and figures of the paper do not depend on it
        return {name: f"{type(error).__name__}: {error}" for name in names or ["studies"]}
