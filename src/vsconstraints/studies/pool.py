"""Runs the simulations of studies in processes of their own; each failure stays one run's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from ..comparisons.record import RunRecord
from ..comparisons.suite import BASELINE
from ..comparisons.unfinished import Unfinished
from ..controllers import make_controller
from ..errors import VsconstraintsError
from ..kernels import prepare
from ..runs.pool import Failure, Pool
from ..runs.resources import process_count, run_limit, samples
from ..scenarios import Scenario
from ..simulation import simulate
from .recorder import DriftRecorder
from .study import StudyRun
from .summary import RunSummary, summarise

Progress = Callable[[int, int], None]
"""Told how many runs are done, and how many there are in all."""


def run_all(
    runs: Sequence[StudyRun], kept: Unfinished, workers: int | None, on_progress: Progress
) -> dict[str, RunSummary]:
    """Run each different simulation once, but for those that are kept from before.

    Parameters
    ----------
    runs
        Runs of any number of studies; those that coincide are simulated once.
    kept
        Where runs are kept until all are finished.
    workers
        Number of processes at most; see :func:`vsconstraints.runs.resources.process_count`.
    on_progress
        Called after every simulation.

    Returns
    -------
    dict
        Summaries by :attr:`StudyRun.identity`. A run that raised, whose process died, or that took too long has the
        status ``failed``.
    """
    different = {run.identity: run for run in runs}
    # tracking on the scenario as it is shipped tells which rows are challenged
    shipped = {name: StudyRun(name, name, BASELINE) for name in dict.fromkeys(run.scenario for run in runs)}
    baselines = {name: _file(kept, run, "record") for name, run in shipped.items()}
    summaries: dict[str, RunSummary] = {}
    done, total = 0, len(shipped) + len(different)
    prepare()
    with Pool(run_one, min(process_count(workers), max(len(different), 1))) as pool:
        for batch in (list(shipped.values()), sorted(different.values(), key=_samples, reverse=True)):
            calls = {run.identity: (run, _file(kept, run, "summary"), baselines[run.scenario]) for run in batch}
            limits = {run.identity: run_limit(_tables(run)) for run in batch}
            for identity, answer in pool.run(calls, limits):
                summaries[identity] = RunSummary("failed", answer.reason) if isinstance(answer, Failure) else answer
                done += 1
                on_progress(done, total)
    return {identity: summaries[identity] for identity in different}


def run_one(run: StudyRun, file: Path, baseline_file: Path) -> RunSummary:
    """Run one simulation, or take it from its file; raises whatever goes wrong.

    Parameters
    ----------
    run
        What to run.
    file
        Where its summary is kept.
    baseline_file
        Where the record of its scenario's baseline is kept; a baseline's own run is stored there.
    """
    stored = RunSummary.load(file)
    if stored is not None:
        return stored
    # some studies are about runs that diverge
    with np.errstate(over="ignore", invalid="ignore"):
        setup = _scenario(run).setup()
        law = make_controller(run.law, run.options)
        recorder = DriftRecorder(law) if run.drift_noted else None
        record = RunRecord.of(setup, simulate(setup, recorder or law), run.identity)
        if run.law == BASELINE and not run.overrides:
            record.save(baseline_file)
        summary = summarise(record, RunRecord.load(baseline_file), recorder, setup.constraints.scale)
    with suppress(OSError):  # it is there: it can only not be taken up again
        summary.save(file)
    return summary


def _file(kept: Unfinished, run: StudyRun, what: str) -> Path:
    return kept.file("study", what, run.identity, _tables(run))


def _scenario(run: StudyRun) -> Scenario:
    scenario = Scenario.load(run.scenario)
    for key, value in run.overrides.items():
        scenario = scenario.with_override(key, value)
    return scenario


def _tables(run: StudyRun) -> dict[str, Any]:
    """What the scenario says; nothing if there is none: that is said where it is run."""
    try:
        return _scenario(run).tables
    except VsconstraintsError:
        return {}


def _samples(run: StudyRun) -> float:
    """So that the longest can be started first."""
    return samples(_tables(run))
