"""Runner: executes a suite on all cores and stores every result as soon as it is available."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import chdir, nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import described
from ..plugins.provenance import Files, digests, imported, noted
from .metrics import RUN, Score, load_metrics, score
from .record import RunRecord, run_file, stored_reason, stored_run
from .run import failed_record, failed_score, perform
from .runs.files import SUMS, TRAJECTORIES, add_sums, plain, remove_changed
from .runs.folder import locked
from .runs.law_process import LawProcessLostError
from .runs.machine import loaded_versions, new_manifest
from .runs.pool import Failure, run_all
from .runs.spec import BASELINE, RunSpec, prepare_laws
from .runs.store import Store
from .stored import TABLES, require_arm_kept, require_nothing_lost, stored_files
from .suite import Suite
from .tables import append_lines, write_table

#: Called for each finished run with its score, and True if it was stored before.
Report = Callable[[RunSpec, Score, bool], None]

Key = tuple[str, str, int]  # scenario, controller and trial
NOT_STORED = ""  #: Fingerprint of a run that must be repeated because its process was lost.


@dataclass(frozen=True)
class Finished:
    """Result of a comparison: one score per run, fewer if the signal ``interrupted`` ended it.

    ``stored_before`` runs were not repeated. ``wall_time`` is the duration of the comparison [s].
    """

    folder: Path
    scores: Mapping[Key, Score]
    stored_before: int
    wall_time: float
    interrupted: int

    @property
    def all_failed(self) -> bool:
        """True if all runs of the compared controllers failed."""
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

    Stored runs with the same scenario, controller, trial, seed, code and files are kept. ``fresh``
    repeats them, and also replaces another comparison. The unconstrained baseline is always run. A
    run that fails in any way, even by ending its process or by never ending, becomes a row with its
    reason.

    ``workers`` is the maximum number of processes; 0 runs everything in this process, which also
    executes the runs that no other process can. Custom laws run in further processes, one for each,
    or in this one if ``workers`` is 0. ``limit`` is the time limit of a run [s]; if None, it
    follows from the number of samples. ``warnings`` of scenarios are stored for the report; if
    None, those of :meth:`.Suite.warnings`. ``on_finished`` is called with every finished run.

    Raises ConfigurationError if the folder cannot be created, is locked by another process, or
    contains other data that would be lost. Raises StorageError if the tables cannot be written;
    everything already stored is kept.
    """
    with locked(folder, "a comparison"):
        # a law may change the working directory
        folder = folder.absolute()
        store = Store(folder, "results", stored_files)
        load_metrics()  # a metric that cannot be used ends the command before any run
        prepare_laws(suite.controllers)
        warned = plain(suite.warnings() if warnings is None else warnings)
        suite = suite.with_baseline()
        runs = {run.key: run for run in suite.runs()}
        if not fresh:
            require_nothing_lost(folder, suite)
        require_arm_kept(folder, runs.values(), fresh)
        trajectories = folder / TRAJECTORIES
        with store.storing():
            trajectories.mkdir(exist_ok=True)
            for name in (SUMS, *TABLES) if fresh else ():
                (folder / name).unlink(missing_ok=True)
            remove_changed(folder, trajectories.glob("*.npz"))
        manifest = {**new_manifest(command, suite.resolved()), "warnings": warned}
        store.begin(manifest, trajectories.glob("*.npz"))
        scores: dict[Key, Score] = {}
        stored_before = 0

        def done(key: Key, answer: tuple[Score, bool] | Failure) -> None:
            nonlocal stored_before
            if isinstance(answer, Failure):
                # the failure is not stored, because the run may succeed next time, for example with
                # more memory; a trajectory that is not of this run does not belong to it; arrays
                # are not read, because reading or scoring them may have ended the process
                earlier = stored_reason(runs[key], folder)
                if earlier is None:
                    run_file(folder, *key).unlink(missing_ok=True)
                answer = _failed_score(earlier, answer.reason), False
            # earlier results are kept until the first new one replaces them
            first = not scores
            scores[key], stored = answer
            stored_before += stored
            with suppress(OSError):  # disk full: the tables are written again at the end
                for name, lines in _lines(suite, {key: scores[key]}).items():
                    append_lines(folder / name, TABLES[name](), lines, first)
                if not stored:
                    add_sums(folder, [run_file(folder, *key)])
            on_finished(runs[key], *answer)

        # baselines come first, since the others are scored against them; they run in other
        # processes where possible
        baselines = {}
        for run in runs.values():
            if run.controller.name == BASELINE:
                baselines[run.name, run.trial] = run
        in_main = {key for key, run in runs.items() if workers == 0 or run.main_process_only}
        calls = {
            key: (run, folder, fresh, baselines[run.name, run.trial], key not in in_main)
            for key, run in runs.items()
        }
        first_batch = {key: call for key, call in calls.items() if key[1] == BASELINE}
        second_batch = {key: call for key, call in calls.items() if key[1] != BASELINE}
        limits = {}
        for key, run in runs.items():
            limits[key] = limit or run.controller.run_limit(run.load().tables)
        with store.interruptible():
            run_all(
                run_stored,
                first_batch,
                second_batch,
                workers=workers,
                limits=limits,
                here=in_main,
                on_answer=done,
            )
        # in the order of the suite, not in the order of completion
        scores = {key: scores[key] for key in runs if key in scores}
        wall_time = store.seconds
        with store.storing():
            for name, lines in _lines(suite, scores).items():
                if scores or not (folder / name).exists():
                    write_table(folder / name, TABLES[name](), lines)
        compiled = Counter(bool(each.result["compiled"]) for each in scores.values())
        store.finish(
            wall_time_s=wall_time,
            runs=len(runs),
            finished=len(scores),
            stored_before=stored_before,
            # runs that are not compiled are stored as "NumPy", whatever the reason
            compiled={"compiled": compiled[True], "NumPy": compiled[False]},
            loaded=loaded_versions(),
        )
        return Finished(folder, scores, stored_before, wall_time, store.interrupted)


def run_stored(
    spec: RunSpec,
    folder: Path,
    fresh: bool = False,
    baseline: RunSpec | None = None,
    in_own_process: bool = False,
) -> tuple[Score, bool]:
    """Execute a run, or load it from the folder, and score it against its baseline.

    Any error turns into a failed run. A run that cannot be scored stays stored. With
    ``in_own_process`` a custom law runs in a separate process.
    """

    def scored(record: RunRecord) -> Score:
        # a baseline of an earlier comparison is not used
        alone = None
        try:
            if baseline is not None:
                alone = record if spec == baseline else stored_run(baseline, folder)
            return score(record, alone)
        except Exception as error:  # the record can be scored once this is repaired
            reason = record.trajectory.reason
            return _failed_score(reason, f"the run cannot be scored: {described(error)}")

    record = None
    if not fresh:
        with suppress(Exception):  # a damaged record can raise any error
            record = stored_run(spec, folder)
    if record is not None:
        return scored(record), True
    path = run_file(folder, *spec.key)
    try:
        # an older trajectory is removed even if this run fails
        path.unlink(missing_ok=True)
        record = _simulated(spec, in_own_process and spec.controller.in_own_process)
        if record.fingerprint != NOT_STORED:
            record.save(path)
    except Exception as error:  # a failure of one run must not end the others
        return failed_score(f"the run cannot be stored: {described(error)}"), False
    return scored(record), False


def _failed_score(earlier: str | None, reason: str) -> Score:
    """Return the score of a run without scores; ``earlier`` is the reason of its record, if any.

    That of a run on an arm names the arm, which protects the run, see :func:`.require_arm_kept`.
    """
    return failed_score("; ".join(filter(None, (earlier, reason))))


def _simulated(spec: RunSpec, in_own_process: bool) -> RunRecord:
    files: Files = {}
    noting = noted() if spec.has_own_parts else nullcontext(files)
    # custom parts may change the working directory
    with chdir("."), noting as read:
        try:
            files = digests(spec.files)
            record = perform(
                spec, by_public_call=True, to_the_goal=True, in_own_process=in_own_process
            ).record
        except LawProcessLostError as lost:
            return replace(failed_record(lost), fingerprint=NOT_STORED)
        except BaseException as error:
            record = replace(failed_record(error), fingerprint=spec.fingerprint)
    # the first reading of a file counts: its content before an edit must not be mistaken for the
    # content after it; the process of a law may have read some files earlier
    found = {**files, **read} if in_own_process else {**read, **files}
    if spec.has_own_parts:
        found |= imported()
    return replace(record, files=found)


def _lines(suite: Suite, scores: Mapping[Key, Score]) -> dict[str, list[dict[str, Any]]]:
    """Return the lines of each table."""
    results = []
    constraints = []
    for key, scored in scores.items():
        columns = zip(RUN, (suite.name, *key), strict=True)
        run = dict(columns)
        results.append({**run, **scored.result})
        for row in scored.constraints:
            constraints.append({**run, **row})
    return dict(zip(TABLES, (results, constraints), strict=True))
