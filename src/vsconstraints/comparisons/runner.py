"""Runs a suite on all cores; every result is stored as soon as it is there."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import chdir, contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from .. import __version__
from ..errors import StorageError, described
from ..kernels import prepare
from ..provenance import Files, digests, imported, noted
from ..runs.files import replaced
from ..runs.pool import Failure, Pool
from ..runs.resources import process_count, run_limit
from ..runs.signals import INTERRUPTS, signal_of
from ..simulation import simulate
from .folder import demand_nothing_lost, held
from .job import Job
from .machine import git_commit, machine, package_versions
from .metrics import CONSTRAINT_COLUMNS, RESULT_COLUMNS, Score, score
from .record import RunRecord, run_file
from .suite import BASELINE, Suite
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

    @property
    def all_failed(self) -> bool:
        """Whether no run of a controller that is compared came to anything."""
        compared = [key for key in self.scores if key[1] != BASELINE] or list(self.scores)
        return all(self.scores[key].result["status"] == "failed" for key in compared)


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

    Runs stored there before with the same scenario, controller, trial, seed and code, and made from the same files, are
    kept. Tracking alone is always run, since it tells which rows a scenario challenges. A run that fails in any way,
    even by ending its process or by never coming to an end, becomes a row with its reason.

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
        Whether to run again what is stored, and to replace another comparison.
    command
        What the user typed, for the manifest.
    on_finished
        Told of every finished job.

    Raises
    ------
    ConfigurationError
        if the folder cannot be made, is held by another process, or holds something else that would be lost.
    StorageError
        if the tables cannot be written; what could be stored stays.
    """
    with held(folder):
        started = time.perf_counter()
        prepare()
        suite, folder = suite.with_baseline(), folder.absolute()  # a law may change the working directory
        jobs = suite.jobs()
        if not fresh:
            demand_nothing_lost(folder, suite)
        tables = folder / "results.csv", folder / "constraints.csv"
        manifest = _manifest(suite, command)
        with _storing(folder):
            (folder / "trajectories").mkdir(exist_ok=True)
            _write_json(folder / "manifest.json", manifest)
            for table in tables if fresh else ():
                table.unlink(missing_ok=True)
        scores: dict[tuple[str, str, int], Score] = {}
        stored_before = 0

        def done(job: Job, result: Score, stored: bool) -> None:
            nonlocal stored_before
            # what an earlier comparison left stays until there is something to replace it
            first = not scores
            scores[job.key] = result
            stored_before += stored
            with suppress(OSError):  # a full disk: the tables are written once more at the end
                append_lines(tables[0], RESULT_COLUMNS, _result_lines(suite, [job], scores), first)
                append_lines(tables[1], CONSTRAINT_COLUMNS, _constraint_lines(suite, [job], scores), first)
            on_finished(job, result, stored)

        interrupted = 0
        try:
            _run_all(jobs, folder, process_count(workers), limit, fresh, done)
        except INTERRUPTS as interrupt:
            interrupted = signal_of(interrupt)
        # in the jobs' order, whatever order they finished in
        finished = [job for job in jobs if job.key in scores]
        wall_time = time.perf_counter() - started
        compiled = Counter(bool(scores[job.key].result["compiled"]) for job in finished)
        manifest.update(wall_time_s=wall_time, runs=len(jobs), finished=len(finished), stored_before=stored_before)
        manifest.update(compiled={"compiled": compiled[True], "NumPy": compiled[False]})
        with _storing(folder):
            if finished or not tables[0].exists():
                write_table(tables[0], RESULT_COLUMNS, _result_lines(suite, finished, scores))
                write_table(tables[1], CONSTRAINT_COLUMNS, _constraint_lines(suite, finished, scores))
            _write_json(folder / "manifest.json", manifest)
        return Finished(folder, scores, stored_before, wall_time, interrupted)


@contextmanager
def _storing(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise StorageError(
            f"results cannot be stored in {folder}: {error}; what is there stays, and the same command goes on"
        ) from error


def run_job(job: Job, folder: Path, fresh: bool) -> tuple[Score, bool]:
    """Run one job, or take it from the folder, and score it against its baseline, which has been run.

    Whatever goes wrong, while it is simulated, scored or stored, becomes a failed run with its reason.
    """
    with suppress(Exception):  # what cannot be read or scored is damaged, and run again
        record = None if fresh else job.stored(folder)
        if record is not None:
            return _scored(job, record, folder), True
    path = run_file(folder, *job.key)
    try:
        # nothing older is left for this run, however it ends
        path.unlink(missing_ok=True)
        record = _simulated(job)
        result = _scored(job, record, folder)
        record.save(path)
    except Exception as error:  # this is where one run ends and the others begin
        result = score(RunRecord.failed(f"the run cannot be stored: {described(error)}", ""), None)
    return result, False


def _scored(job: Job, record: RunRecord, folder: Path) -> Score:
    if job.baseline is None or job.entry == job.baseline:
        return score(record, record if job.entry == job.baseline else None)
    # one of an earlier comparison tells nothing
    return score(record, replace(job, entry=job.baseline).stored(folder))


def _simulated(job: Job) -> RunRecord:
    """Run one job; whatever goes wrong becomes a failed run with its reason."""
    files: Files = {}
    # own parts may change the working directory
    with chdir("."), noted() if job.has_own_parts else nullcontext(files) as read:
        try:
            files = digests(job.files)
            setup = job.scenario.setup(job.trial, job.seed)
            trajectory = simulate(setup, job.entry.controller(), by_public_call=True)
            record = RunRecord.of(setup, trajectory, job.fingerprint)
        except BaseException as error:  # even SystemExit
            record = RunRecord.failed(described(error), job.fingerprint)
    # of several readings the first: what was there before an edit is never taken for what is there after it
    return replace(record, files={**read, **files, **(imported() if job.has_own_parts else {})})


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
        "packages": package_versions(),
    }


def _write_json(path: Path, data: object) -> None:
    text = json.dumps(data, indent=1, ensure_ascii=False, default=str) + "\n"
    with replaced(path) as part:
        part.write_text(text, encoding="utf-8", errors="backslashreplace")
