"""Runs a suite on all cores; every result is stored as soon as it is there."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from .. import __version__
from ..errors import ConfigurationError
from ..kernels import available, prepare
from ..runs.pool import Failure, Pool
from ..runs.resources import process_count, run_limit
from ..runs.signals import INTERRUPTS, signal_of
from ..simulation import simulate
from .machine import git_commit, machine, package_versions
from .metrics import CONSTRAINT_COLUMNS, RESULT_COLUMNS, Score, score
from .record import RunRecord, run_file
from .suite import BASELINE, Job, Suite
from .tables import append_lines, write_table

Report = Callable[[Job, Score, bool], None]
"""Called for each finished job with its score and whether it was stored before."""


@dataclass(frozen=True)
class Finished:
    """What a comparison came to.

    Attributes
    ----------
    folder
        Where it is stored.
    scores
        One per job, in the jobs' order; fewer if it was interrupted.
    stored_before
        How many were not run again.
    wall_time
        [s].
    interrupted
        Number of the signal that ended it; 0 if none did.
    """

    folder: Path
    scores: dict[tuple[str, str, int], Score]
    stored_before: int
    wall_time: float
    interrupted: int


def compare(
    suite: Suite,
    folder: Path,
    *,
    workers: int | None = None,
    limit: float | None = None,
    fresh: bool = False,
    command: Sequence[str] = (),
    on_finished: Report = lambda job, score, stored: None,
) -> Finished:
    """Run every scenario with every controller and store results below ``folder``.

    Runs stored there before with the same scenario, controller, trial, seed and code are kept. Tracking alone is
    always run, since it tells which rows a scenario challenges. A run that fails in any way, even by ending its
    process or by never coming to an end, becomes a row with its reason.

    Parameters
    ----------
    suite
        What is compared.
    folder
        Where to; made if it is not there.
    workers
        Number of processes at most; see :func:`vsconstraints.runs.resources.process_count`.
    limit
        How long a run may take [s]; by its number of samples if None
        (:func:`vsconstraints.runs.resources.run_limit`).
    fresh
        Whether to run again what is stored.
    command
        What the user typed, for the manifest.
    on_finished
        Told of every finished job.

    Raises
    ------
    ConfigurationError
        if the folder cannot be made.
    """
    started = time.perf_counter()
    prepare()
    suite = suite.with_baseline()
    jobs = suite.jobs()
    try:
        (folder / "trajectories").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(f"results cannot be stored in {folder}: {error}") from error
    manifest = _manifest(suite, command)
    _write_json(folder / "manifest.json", manifest)
    for name in ("results.csv", "constraints.csv"):
        (folder / name).unlink(missing_ok=True)
    scores: dict[tuple[str, str, int], Score] = {}
    stored_before = 0

    def done(job: Job, result: Score, stored: bool) -> None:
        nonlocal stored_before
        scores[job.key] = result
        stored_before += stored
        append_lines(folder / "results.csv", RESULT_COLUMNS, _result_lines(suite, [job], scores))
        append_lines(folder / "constraints.csv", CONSTRAINT_COLUMNS, _constraint_lines(suite, [job], scores))
        on_finished(job, result, stored)

    interrupted = 0
    try:
        _run_all(jobs, folder, process_count(workers), limit, fresh, done)
    except INTERRUPTS as interrupt:
        interrupted = signal_of(interrupt)
    # in the jobs' order, whatever order they finished in
    finished = [job for job in jobs if job.key in scores]
    write_table(folder / "results.csv", RESULT_COLUMNS, _result_lines(suite, finished, scores))
    write_table(folder / "constraints.csv", CONSTRAINT_COLUMNS, _constraint_lines(suite, finished, scores))
    wall_time = time.perf_counter() - started
    manifest.update(wall_time_s=wall_time, runs=len(jobs), finished=len(finished), stored_before=stored_before)
    _write_json(folder / "manifest.json", manifest)
    return Finished(folder, scores, stored_before, wall_time, interrupted)


def run_job(job: Job, folder: Path, fresh: bool) -> tuple[Score, bool]:
    """Run one job, or take it from the folder, and score it against its baseline, which has been run.

    Whatever goes wrong inside the simulation becomes a failed run with its reason.
    """
    path = run_file(folder, *job.key)
    record = None if fresh else RunRecord.load(path)
    stored = record is not None and record.fingerprint == job.fingerprint
    if record is None or not stored:
        try:
            setup = job.scenario.setup(job.trial, job.seed)
            record = RunRecord.of(setup, simulate(setup, job.entry.controller()), job.fingerprint)
        except BaseException as error:  # even SystemExit: this is where one run ends and the others begin
            record = RunRecord.failed(f"{type(error).__name__}: {error}", job.fingerprint)
        record.save(path)
    baseline = RunRecord.load(run_file(folder, job.scenario.name, BASELINE, job.trial))
    return score(record, baseline), stored


def _run_all(
    jobs: Sequence[Job],
    folder: Path,
    workers: int,
    limit: float | None,
    fresh: bool,
    done: Callable[[Job, Score, bool], None],
) -> None:
    """Baselines first, since the others are scored against them."""
    by_key = {job.key: job for job in jobs}
    with Pool(run_job, min(workers, len(jobs))) as pool:
        for baselines in (True, False):
            batch = [job for job in jobs if (job.entry.name == BASELINE) is baselines]
            calls = {job.key: (job, folder, fresh) for job in batch}
            limits = {job.key: limit or run_limit(job.scenario.tables) for job in batch}
            for key, answer in pool.run(calls, limits):
                if isinstance(answer, Failure):
                    # what was stored before is not this run; this is not stored: memory, say, may suffice next time
                    run_file(folder, *key).unlink(missing_ok=True)
                    answer = score(RunRecord.failed(answer.reason, ""), None), False
                done(by_key[key], *answer)


def _identity(suite: Suite, job: Job) -> dict[str, Any]:
    return {
        "suite": suite.name,
        "scenario": job.scenario.name,
        "controller": job.entry.name,
        "trial": job.trial,
    }


def _result_lines(suite: Suite, jobs: Sequence[Job], scores: dict[tuple[str, str, int], Score]) -> list[dict[str, Any]]:
    return [{**_identity(suite, job), **scores[job.key].result} for job in jobs]


def _constraint_lines(
    suite: Suite, jobs: Sequence[Job], scores: dict[tuple[str, str, int], Score]
) -> list[dict[str, Any]]:
    return [{**_identity(suite, job), **row} for job in jobs for row in scores[job.key].constraints]


def _manifest(suite: Suite, command: Sequence[str]) -> dict[str, Any]:
    return {
        "version": __version__,
        "git_commit": git_commit(),
        "command": list(command),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "seed": suite.seed,
        "configuration": suite.resolved(),
        "machine": machine(),
        "compiled": available(),
        "packages": package_versions(),
    }


def _write_json(path: Path, data: object) -> None:
    part = path.with_name(path.name + ".part")
    part.write_text(json.dumps(data, indent=1, ensure_ascii=False, default=str) + "\n", encoding="utf-8")
    os.replace(part, path)
