"""Runs of custom laws, each law in a separate process that only returns the law's commands.

All settings of a law share its process. The calling process simulates, judges and scores the motion
that follows from these commands. It never loads the law's code. The law therefore cannot affect the
runs of other laws or its own scores by changing its process.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import re
from collections.abc import Sequence
from contextlib import chdir
from dataclasses import dataclass, replace
from multiprocessing.util import Finalize
from typing import Any

from ...errors import MAX_REASON_LENGTH, VsconstraintsError, described
from ...plugins.provenance import Files, add_to_notes, own_parts_noted
from ...simulation import RunWorkspace, Setup, Trajectory, simulate
from ...simulation.recorded import Recorded, replay
from .pool import Failure, Pool
from .spec import AS_THE_SCENE, RunSpec

#: Maximum number of law processes kept for further runs; the one unused for longest ends first.
#: They are not counted as workers: only one of them computes at a time, while its caller waits. The
#: others take memory alone.
MAX_PROCESSES = 8
EXIT_PRIORITY = 100  # before the interpreter waits for its children, which wait for it

#: Processes by law; the one used last comes last.
law_processes: dict[str, LawProcess] = {}
#: Maximum number of files that the process of a law may name.
MAX_FILES = 10_000

_finalizers: list[Finalize] = []


class LawProcess:
    """The process of one law, and the state of the files that its code has read.

    It has no time limit of its own. The limit of a run is that of the worker that waits for it, and
    the process ends with the worker. Without workers, a run waits for its law until it is
    interrupted, as for a law in the same process.
    """

    def __init__(self) -> None:
        self.pool: Pool[dict[str, Any]] = Pool(record, 1, plain=True)
        self._states: dict[str, tuple[int, int]] = {}

    def run(self, run: LawRun) -> dict[str, Any] | Failure:
        """Run the law once, and remember the files that it has read so far."""
        ((_, answer),) = self.pool.run({0: (run,)})
        files = answer.get("files") if isinstance(answer, dict) else None
        self._states = {}
        for path in files if isinstance(files, dict) else ():
            self._states[str(path)] = _state_of(str(path))
        return answer

    @property
    def is_current(self) -> bool:
        """True if no file has changed since the law's code read it."""
        return all(_state_of(path) == state for path, state in self._states.items())

    def end(self, at_once: bool = False) -> None:
        """End the process, with ``at_once`` even in the middle of a run."""
        self.pool.end(at_once)


def _state_of(path: str) -> tuple[int, int]:
    """Return time of modification [ns] and size [bytes] of a file; zeros if it cannot be found."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return 0, 0
    return status.st_mtime_ns, status.st_size


class LawFailedError(Exception):
    """The process of a law returned no run; the message is the reason."""


class LawProcessLostError(LawFailedError):
    """The process of a law died or could not receive the run; the run may succeed another time."""


@dataclass(frozen=True)
class LawRun:
    """A run and how it is simulated, which is sent to the process of its law if it has one.

    ``time_limit`` [s] is that of the setup, see :func:`.until_settled`. ``by_public_call`` is
    passed to :func:`.simulate`. With ``in_own_process`` the law has a separate process.
    """

    spec: RunSpec
    time_limit: float | None = None
    by_public_call: bool = False
    in_own_process: bool = False


def simulate_law(
    run: LawRun,
    setup: Setup,
    remarks: Sequence[str] | None = None,
    prepared: RunWorkspace | None = None,
) -> Trajectory:
    """Simulate a law as :func:`.simulate`, in a separate process if its run has one.

    ``setup`` is the setup on which the run is scored. Raises the errors of the law and of
    :func:`.simulate`, or LawFailedError if the law's process returns no run.
    """
    if not run.in_own_process:
        law = run.spec.controller.make()
        public = run.by_public_call
        return simulate(setup, law, by_public_call=public, remarks=remarks, prepared=prepared)
    answer: object = ask_law(run)
    if isinstance(answer, Failure):
        raise LawProcessLostError(str(answer.reason))
    try:
        if not isinstance(answer, dict):
            raise TypeError("it is not a table")
        add_to_notes(_files_from(answer["files"]))
        reason = answer.get("failed")
        recorded = None if reason else Recorded.from_plain(answer["recorded"], setup.scene.robot.n)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise LawFailedError(
            f"the answer of the law's process cannot be used: {described(error)}"
        ) from error
    if recorded is None:
        raise LawFailedError(str(reason)[:MAX_REASON_LENGTH])
    return replay(setup, recorded, remarks=remarks, prepared=prepared)


def _files_from(table: object) -> Files:
    """Return the files that the process of a law has named.

    Raises ValueError or TypeError if they are not absolute paths with hashes of contents.
    """
    if not isinstance(table, dict):
        raise TypeError("its files are not a table")
    if len(table) > MAX_FILES:
        raise ValueError(f"it names more than {MAX_FILES} files")
    for path, content in table.items():
        if not (isinstance(path, str) and isinstance(content, str)):
            raise TypeError("its files are not texts")
        if not os.path.isabs(path) or "\0" in path:
            raise ValueError("the path of a file is not absolute")
        if not re.fullmatch("[0-9a-f]{16}|", content):
            raise ValueError("a file has no hash")
    return table


def record(run: LawRun) -> dict[str, Any]:
    """Run a law in its process; return its commands or the reason of its failure.

    The files that it has read are returned too.
    """
    said: dict[str, Any] = {}
    with chdir("."), own_parts_noted() as files:
        try:
            spec = run.spec
            law = spec.controller
            scenario = spec.load()
            with law.importing_beside(scenario.folder):
                setup = replace(scenario.setup(spec.trial, spec.seed), time_limit=run.time_limit)
                recorded = Recorded.of(
                    law.run.of(setup), law.make(), by_public_call=run.by_public_call
                )
                said["recorded"] = recorded.plain()
        except BaseException as error:  # even SystemExit: a failure of the law ends its run only
            said["failed"] = described(error)
    said["files"] = files
    return said


def ask_law(run: LawRun) -> dict[str, Any] | Failure:
    """Run a law in its own process. Return a Failure if the process cannot be asked."""
    if not _finalizers:
        _finalizers.append(Finalize(None, end_law_processes, exitpriority=EXIT_PRIORITY))
    try:
        entry = run.spec.controller
        pickle.dumps(entry.options)
        # one process serves all settings of a law, such as those that a tuning tries
        law_alone = replace(entry, name="", options={}, run=AS_THE_SCENE)
        law = hashlib.sha256(pickle.dumps(law_alone)).hexdigest()
    # options and instances of custom laws can raise any error when they are pickled
    except Exception as error:
        return Failure.of(error, "it cannot be sent to a process: ")
    process = law_processes.pop(law, None)
    if process is not None and not process.is_current:
        # the process may hold what a file held before it was edited
        process.end()
        process = None
    if process is None:
        process = LawProcess()
    law_processes[law] = process
    while len(law_processes) > MAX_PROCESSES:
        oldest = next(iter(law_processes))
        law_processes.pop(oldest).end()
    try:
        return process.run(run)
    except BaseException as error:
        # its worker may still be busy with this run
        law_processes.pop(law).end(at_once=True)
        # processes that cannot be started say nothing about the law
        if isinstance(error, (VsconstraintsError, OSError)):
            return Failure.of(error)
        raise


def end_law_processes() -> None:
    """End the processes of all laws that this process has started."""
    while law_processes:
        law_processes.popitem()[1].end()
