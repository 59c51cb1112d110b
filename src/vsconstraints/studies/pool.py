"""Runs the simulations of studies in processes of their own; each failure stays one run's."""

from __future__ import annotations

import os
import signal
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from ..comparisons.record import RunRecord
from ..comparisons.runner import THREAD_VARIABLES
from ..comparisons.suite import BASELINE
from ..controllers import make_controller
from ..kernels import prepare
from ..scenarios import Scenario
from ..simulation import Setup, simulate
from .recorder import DriftRecorder
from .study import StudyRun
from .summary import RunSummary, summarise

Progress = Callable[[int, int], None]
"""Told how many runs are done, and how many there are in all."""


def run_all(runs: Sequence[StudyRun], workers: int | None, on_progress: Progress) -> dict[str, RunSummary]:
    """Run each different simulation once.

    Parameters
    ----------
    runs
        Runs of any number of studies; those that coincide are simulated once.
    workers
        Number of processes; as many as there are cores if None.
    on_progress
        Called after every simulation.

    Returns
    -------
    dict
        Summaries by :attr:`StudyRun.identity`. A run that raised, or whose process died, has the status ``failed``.
    """
    different = {run.identity: run for run in runs}
    # tracking on the scenario as it is shipped tells which rows are challenged
    baselines = {name: StudyRun(name, name, BASELINE) for name in dict.fromkeys(run.scenario for run in runs)}
    count = (workers or os.cpu_count() or 1, len(different) + len(baselines))
    summaries: dict[str, RunSummary] = {}
    done = 0

    def finished(run: StudyRun, summary: RunSummary) -> None:
        nonlocal done
        done += 1
        summaries[run.identity] = summary
        on_progress(done, count[1])

    with tempfile.TemporaryDirectory() as folder:
        for batch in (list(baselines.values()), sorted(different.values(), key=_length, reverse=True)):
            left = _batch(batch, Path(folder), count[0], finished)
            # what was under way or waiting when a process died: one process each tells whose fault it was
            for run in left:
                if _batch([run], Path(folder), 1, finished):
                    finished(run, RunSummary("failed", "the process that ran it died"))
    return {identity: summaries[identity] for identity in different}


def run_one(run: StudyRun, folder: Path) -> RunSummary:
    """Run one simulation; whatever goes wrong becomes a failed run with its reason.

    Parameters
    ----------
    run
        What to run.
    folder
        Where the baselines are kept; a baseline's own run is stored there.
    """
    baseline_file = folder / f"{run.scenario}.npz"
    try:
        # some studies are about runs that diverge
        with np.errstate(over="ignore", invalid="ignore"):
            setup = _setup(run)
            recorder = DriftRecorder(make_controller(run.law, run.options))
            record = RunRecord.of(setup, simulate(setup, recorder), run.identity)
            if run.law == BASELINE and not run.overrides:
                record.save(baseline_file)
            return summarise(record, RunRecord.load(baseline_file), recorder, setup.constraints.scale)
    except Exception as error:  # this is where one run ends and the others go on
        return RunSummary("failed", f"{type(error).__name__}: {error}")


def _setup(run: StudyRun) -> Setup:
    scenario = Scenario.load(run.scenario)
    for key, value in run.overrides.items():
        scenario = scenario.with_override(key, value)
    return scenario.setup()


def _length(run: StudyRun) -> float:
    """About how many samples a run has, so that the longest can be started first."""
    try:
        tables = {**Scenario.load(run.scenario).tables, **run.overrides}
        return float(tables["duration"]) / float(tables["sampling_time"])
    except Exception:  # what is wrong with it is said where it is run
        return 0.0


def _batch(
    runs: Sequence[StudyRun], folder: Path, workers: int, finished: Callable[[StudyRun, RunSummary], None]
) -> list[StudyRun]:
    """Run these in parallel; returns those without a result because a process died."""
    for variable in THREAD_VARIABLES:
        os.environ.setdefault(variable, "1")
    left = {run.identity: run for run in runs}
    # spawned, so that workers start alike on every system and inherit no threads
    prepare()
    with ProcessPoolExecutor(
        max(1, min(workers, len(runs))),
        mp_context=get_context("spawn"),
        initializer=signal.signal,
        initargs=(signal.SIGINT, signal.SIG_IGN),  # an interrupt is the parent's to handle
    ) as pool:
        futures: dict[Future[RunSummary], StudyRun] = {pool.submit(run_one, run, folder): run for run in runs}
        try:
            for future in as_completed(futures):
                run = futures[future]
                finished(run, future.result())
                del left[run.identity]
        except BrokenProcessPool:
            return list(left.values())
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return []
