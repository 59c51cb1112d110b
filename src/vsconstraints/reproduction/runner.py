"""Runs everything the claims need, measures them, draws the figures and writes the report."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

from ..comparisons.runner import THREAD_VARIABLES
from ..errors import ConfigurationError
from ..kernels import prepare
from . import claims as _claims  # registers every claim
from .figures.catalogue import FIGURES, FigureSpec
from .runs import Run, RunSpec
from .verdicts import VERDICTS, Finding, all_claims

__all__ = ["Reproduction", "reproduce"]

Progress = Callable[[str, int, int], None]
"""Told what is being done, how much of it is done, and how much there is."""

Key = TypeVar("Key")
DIED = "the process that ran it died"


@dataclass(frozen=True)
class Reproduction:
    """What came of it.

    Attributes
    ----------
    report
        Where the report is.
    findings
        By the claims' keys, in the report's order.
    problems
        What could not be run or drawn, by name, with the reason.
    wall_time
        [s].
    """

    report: Path
    findings: Mapping[str, Finding]
    problems: Mapping[str, str] = field(default_factory=dict)
    wall_time: float = 0.0

    @property
    def counts(self) -> dict[str, int]:
        """How many claims have each verdict."""
        verdicts = [finding.verdict for finding in self.findings.values()]
        return {verdict: verdicts.count(verdict) for verdict in VERDICTS}

    def summary(self) -> str:
        """One line for the command line."""
        counts = ", ".join(f"{count} {verdict}" for verdict, count in self.counts.items() if count)
        return f"{len(self.findings)} claims: {counts}. {self.wall_time:.0f} s. Report: {self.report}"


def reproduce(
    folder: Path,
    *,
    workers: int | None = None,
    on_progress: Progress = lambda what, done, total: None,
    command: Sequence[str] = (),
) -> Reproduction:
    """Check every claim of the paper and redraw its figures.

    Everything is simulated anew. Whatever fails, a scenario, a run, a study or a figure, costs only what rests on it:
    those claims become ``not measured``, with the reason.

    Parameters
    ----------
    folder
        Where report.md, claims.csv and figures go; made if it is not there.
    workers
        Number of processes; as many as there are cores if None.
    on_progress
        Told of what is done.
    command
        What the user typed, for the report.

    Raises
    ------
    ConfigurationError
        if the folder cannot be made.
    """
    from .report import write_report

    started = time.perf_counter()
    figures = folder / "figures"
    try:
        figures.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(f"the report cannot be written to {folder}: {error}") from error
    count = workers or os.cpu_count() or 1
    asked = wanted_runs()
    available: dict[RunSpec | str, Any] = dict(
        _parallel({spec: (perform, spec) for spec in asked}, count, on_progress, "simulating")
    )
    studies = study_results(folder, count, on_progress)
    available.update(studies)
    findings = {claim.key: claim.check(available) for claim in all_claims()}
    drawn = _draw(available, figures, count, on_progress)
    problems = {str(spec): found for spec, found in available.items() if isinstance(found, str)}
    problems |= {f"figure {number}": why for number, why in drawn.items() if why}
    result = Reproduction(folder / "report.md", findings, problems, time.perf_counter() - started)
    write_report(result, drawn, studies, command)
    return result


def wanted_runs() -> list[RunSpec]:
    """Every simulation that a claim or a figure needs, once; long ones first, so that none is left at the end."""
    assert _claims.__all__
    needs = [need for claim in all_claims() for need in claim.needs]
    needs += [need for figure in FIGURES.values() for need in figure.needs]
    runs = dict.fromkeys(need for need in needs if isinstance(need, RunSpec))
    return sorted(runs, key=lambda spec: ("case" in spec.scenario, "bowl" in spec.scenario), reverse=True)


def perform(spec: RunSpec) -> Run | str:
    """The run, or why there is none: the first sentence of what was raised."""
    try:
        return spec.perform()
    except BaseException as error:  # even SystemExit of an own part: one run must not cost the others
        return f"{type(error).__name__}: {error}".split(". ")[0]


def _draw_one(figure: FigureSpec, runs: Sequence[Run], path: Path) -> str:
    """Draw a figure; why it could not be drawn, or nothing."""
    try:
        figure.draw(runs, path)
    except Exception as error:  # one figure must not cost the others
        path.unlink(missing_ok=True)
        return f"{type(error).__name__}: {error}"
    return ""


def _draw(available: Mapping[RunSpec | str, Any], folder: Path, workers: int, on_progress: Progress) -> dict[int, str]:
    """Of each figure why it is not there; an empty text if it is."""
    jobs: dict[int, tuple[Any, ...]] = {}
    drawn: dict[int, str] = {}
    for number, figure in FIGURES.items():
        missing = [f"{need}: {available[need]}" for need in figure.needs if not isinstance(available[need], Run)]
        if missing:
            drawn[number] = missing[0]
            (folder / figure.file).unlink(missing_ok=True)
        else:
            jobs[number] = (_draw_one, figure, [available[need] for need in figure.needs], folder / figure.file)
    drawn |= dict(_parallel(jobs, workers, on_progress, "drawing"))
    return {number: drawn[number] for number in FIGURES}


def study_results(folder: Path, workers: int, on_progress: Progress) -> dict[str, Any]:
    """Results of all studies by name; a text instead of a result where there is none."""
    try:
        from ..studies import run_studies
    except ImportError as error:
        return {"studies": f"{type(error).__name__}: {error}"}
    try:
        return dict(run_studies(None, folder, workers, lambda done, total: on_progress("studying", done, total)))
    except Exception as error:  # claims and figures of the paper do not depend on it
        return {"studies": f"{type(error).__name__}: {error}"}


def _parallel(
    jobs: Mapping[Key, tuple[Any, ...]], workers: int, on_progress: Progress, what: str
) -> Iterable[tuple[Key, Any]]:
    """What each job (function, arguments …) returned; the reason where its process died."""
    for variable in THREAD_VARIABLES:
        os.environ.setdefault(variable, "1")
    done: dict[Key, Any] = {}
    on_progress(what, 0, len(jobs))
    _batch(jobs, list(jobs), workers, done, on_progress, what)
    # where a process died the others' jobs were lost with it: again, each in a process of its own
    for key in [key for key in jobs if key not in done]:
        _batch(jobs, [key], 1, done, on_progress, what)
        done.setdefault(key, DIED)
    return done.items()


def _batch(
    jobs: Mapping[Key, tuple[Any, ...]],
    keys: Sequence[Key],
    workers: int,
    done: dict[Key, Any],
    on_progress: Progress,
    what: str,
) -> None:
    if not keys:
        return
    prepare()
    with ProcessPoolExecutor(min(workers, len(keys)), mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(*jobs[key]): key for key in keys}
        try:
            for future in as_completed(waiting):
                done[waiting[future]] = future.result()
                on_progress(what, len(done), len(jobs))
        except BrokenProcessPool:
            return
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
