"""Runs a suite on all cores; every result is stored as soon as it is there."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import chdir, nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import described
from ..plugins.processes import INTERRUPTS, signal_of
from ..plugins.provenance import Files, digests, imported, noted
from .metrics import RUN, Score, score
from .record import RunRecord, run_file, stored_run
from .run import perform
from .runs.files import (
    SUMS,
    TRAJECTORIES,
    add_sums,
    plain,
    remove_changed,
    seal,
    storing,
    write_json,
)
from .runs.folder import MANIFEST, locked
from .runs.law_process import LawFailedError, LawProcessLostError
from .runs.machine import loaded_versions, provenance, run_limit, used_versions
from .runs.pool import Failure, run_all
from .runs.spec import BASELINE, RunSpec, prepare_laws
from .stored import TABLES, demand_arm_kept, demand_nothing_lost, stored_files
from .suite import Suite
from .tables import append_lines, write_table

#: Called for each finished run with its score and whether it was stored before.
Report = Callable[[RunSpec, Score, bool], None]

Key = tuple[str, str, int]  # scenario, controller and trial
NOT_STORED = ""  #: Fingerprint of a run that is made again next time, since its process was lost.


@dataclass(frozen=True)
class Finished:
    """The result of a comparison: a score per run, fewer if it was ended by the signal
    ``interrupted``.

    ``stored_before`` runs were not made again; it took ``wall_time`` [s].
    """

    folder: Path
    scores: Mapping[Key, Score]
    stored_before: int
    wall_time: float
    interrupted: int

    @property
    def all_failed(self) -> bool:
        """Whether all runs of the compared controllers failed."""
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
    warnings: Mapping[str, Sequence[str]] | None = None,
    on_finished: Report = lambda run, score, stored: None,
) -> Finished:
    """Run every scenario with every controller and store results below ``folder``.

    Runs stored there before with the same scenario, controller, trial, seed, code and files are
    kept, unless ``fresh``, which also replaces another comparison. The unconstrained baseline is
    always run. A run that fails in any way, even by ending its process or by never ending, becomes
    a row with its reason.

    ``workers`` is the maximum number of processes, 0 for this one, which also runs what no other
    can. Custom laws run in further processes, one for each, or in this one if ``workers`` is 0.
    ``limit`` is how long a run may take [s], by its number of samples if None. ``warnings`` of
    scenarios are kept for the report, those of :meth:`.Suite.warnings` if None. ``on_finished`` is
    called with every finished run. Raises ConfigurationError if the folder cannot be made, is held
    by another process, or holds something else that would be lost, and StorageError if the tables
    cannot be written; what could be stored stays.
    """
    with locked(folder, "a comparison"):
        started = time.perf_counter()
        prepare_laws(suite.controllers)
        warned = plain(suite.warnings() if warnings is None else warnings)
        # a law may change the working directory
        suite = suite.with_baseline()
        folder = folder.absolute()
        runs = {run.key: run for run in suite.runs()}
        if not fresh:
            demand_nothing_lost(folder, suite)
        demand_arm_kept(folder, runs.values(), fresh)
        resolved = suite.resolved()
        manifest = {
            **provenance(command, used_versions(resolved)),
            "seed": suite.seed,
            "configuration": resolved,
        }
        manifest["warnings"] = warned
        with storing("results", folder):
            (folder / TRAJECTORIES).mkdir(exist_ok=True)
            if fresh:
                (folder / SUMS).unlink(missing_ok=True)
            remove_changed(folder, (folder / TRAJECTORIES).glob("*.npz"))
            seal(folder, (folder / TRAJECTORIES).glob("*.npz"))
            write_json(folder / MANIFEST, manifest)
            for name in TABLES if fresh else ():
                (folder / name).unlink(missing_ok=True)
        scores: dict[Key, Score] = {}
        stored_before = 0

        def done(key: Key, answer: tuple[Score, bool] | Failure) -> None:
            nonlocal stored_before
            if isinstance(answer, Failure):
                # what was stored before is not this run; this is not stored: memory, say, may
                # suffice next time
                run_file(folder, *key).unlink(missing_ok=True)
                answer = score(RunRecord.failed(answer.reason, ""), None), False
            # earlier results stay until there is something to replace them
            first = not scores
            scores[key], stored = answer
            stored_before += stored
            with suppress(OSError):  # a full disk: the tables are written once more at the end
                for name, lines in _lines(suite, {key: scores[key]}).items():
                    append_lines(folder / name, TABLES[name], lines, first)
                if not stored:
                    add_sums(folder, [run_file(folder, *key)])
            on_finished(runs[key], *answer)

        interrupted = 0
        # baselines first, since the others are scored against them; in other processes, where those
        # can make the run
        baselines = {
            (run.name, run.trial): run for run in runs.values() if run.controller.name == BASELINE
        }
        here = {key for key, run in runs.items() if workers == 0 or run.here}
        calls = {
            key: (run, folder, fresh, baselines[run.name, run.trial], key not in here)
            for key, run in runs.items()
        }
        batches = (
            {key: calls[key] for key in runs if (key[1] == BASELINE) == first}
            for first in (True, False)
        )
        limits = {key: limit or run_limit(run.load().tables) for key, run in runs.items()}
        try:
            run_all(run_stored, *batches, workers=workers, limits=limits, here=here, on_answer=done)
        except INTERRUPTS as interrupt:
            interrupted = signal_of(interrupt)
        # in the suite's order, whatever order they finished in
        scores = {key: scores[key] for key in runs if key in scores}
        wall_time = time.perf_counter() - started
        compiled = Counter(bool(each.result["compiled"]) for each in scores.values())
        manifest.update(
            wall_time_s=wall_time, runs=len(runs), finished=len(scores), stored_before=stored_before
        )
        manifest.update(
            compiled={"compiled": compiled[True], "NumPy": compiled[False]},
            loaded=loaded_versions(),
        )
        with storing("results", folder):
            for name, lines in _lines(suite, scores).items():
                if scores or not (folder / name).exists():
                    write_table(folder / name, TABLES[name], lines)
            write_json(folder / MANIFEST, manifest)
            seal(folder, stored_files(folder))
        return Finished(folder, scores, stored_before, wall_time, interrupted)


def run_stored(
    spec: RunSpec,
    folder: Path,
    fresh: bool = False,
    baseline: RunSpec | None = None,
    apart: bool = False,
) -> tuple[Score, bool]:
    """Make a run, or take it from the folder, and score it against its baseline; what fails becomes
    a failed run.

    With ``apart`` a custom law runs in a process of its own.
    """

    def scored(record: RunRecord) -> Score:
        # the baseline of an earlier comparison does not count
        own = (
            record
            if spec == baseline
            else None
            if baseline is None
            else stored_run(baseline, folder)
        )
        return score(record, own)

    with suppress(Exception):  # what cannot be read or scored is damaged, and run again
        record = None if fresh else stored_run(spec, folder)
        if record is not None:
            return scored(record), True
    path = run_file(folder, *spec.key)
    try:
        # an older trajectory is removed, however this run ends
        path.unlink(missing_ok=True)
        record = _simulated(spec, apart and spec.controller.apart)
        result = scored(record)
        if record.fingerprint != NOT_STORED:
            record.save(path)
    except Exception as error:  # this is where one run ends and the others begin
        result = score(RunRecord.failed(f"the run cannot be stored: {described(error)}", ""), None)
    return result, False


def _simulated(spec: RunSpec, apart: bool) -> RunRecord:
    files: Files = {}
    # own parts may change the working directory
    with chdir("."), noted() if spec.has_own_parts else nullcontext(files) as read:
        try:
            files = digests(spec.files)
            record = perform(spec, by_public_call=True, to_the_goal=True, apart=apart).record
        except LawProcessLostError as lost:
            return RunRecord.failed(str(lost), NOT_STORED)
        except LawFailedError as failure:
            record = RunRecord.failed(str(failure), spec.fingerprint)
        except INTERRUPTS:  # of this process, where it runs here
            raise
        except BaseException as error:  # even SystemExit
            record = RunRecord.failed(described(error), spec.fingerprint)
    # of several readings the first: what was there before an edit is never taken for what is there
    # after it; a process of a law has read some files before
    found = {**files, **read} if apart else {**read, **files}
    return replace(record, files={**found, **(imported() if spec.has_own_parts else {})})


def _lines(suite: Suite, scores: Mapping[Key, Score]) -> dict[str, list[dict[str, Any]]]:
    runs = [
        (dict(zip(RUN, (suite.name, *key), strict=True)), score) for key, score in scores.items()
    ]
    results = [{**own, **score.result} for own, score in runs]
    return dict(
        zip(
            TABLES,
            (results, [{**own, **row} for own, each in runs for row in each.constraints]),
            strict=True,
        )
    )
