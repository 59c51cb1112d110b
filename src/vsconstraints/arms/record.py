"""A run on an arm as results that reports, comparisons and differences read as any other run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..comparisons import Finished, RunSpec, Suite
from ..comparisons import compare as compare_runs
from ..comparisons.folder import ARM_LOG
from ..comparisons.record import RunRecord, run_file
from ..comparisons.runs.folder import MANIFEST
from ..controllers import Controller
from ..errors import ConfigurationError
from ..plugins.provenance import digests
from ..rows import Array, Command, Rows, Task
from ..simulation import Setup, Trajectory, simulate
from ..simulation.disturbances import Disturbances
from ..simulation.plant import Plant
from .log import ArmLog
from .timing import LATENESS, Punctuality

ARM = ARM_LOG.parent.name
"""Folder of what only a run on an arm has: the log of all periods, and how late they began."""


class _Recorded(Plant):
    """A robot that is where it was measured to be."""

    follows = True

    def __init__(self, states: Array, Ts: float) -> None:
        super().__init__(states[0, 0], states[0, 1], Ts, "acceleration", Disturbances())
        self._states, self._at = states, 0

    def follow(self) -> None:
        """Go to the next measurement."""
        self._at = min(self._at + 1, len(self._states) - 1)
        self.x[:2] = self._states[self._at]

    step = follow


class _Repeated(Controller):
    """What was commanded, again."""

    name = "recorded"

    def __init__(self, qdd: Array) -> None:
        self._qdd, self._at = qdd, 0

    def command(self, rows: Rows, task: Task) -> Command:
        """The next command."""
        return self.define(rows, task)

    def define(self, rows: Rows, task: Task) -> Command:
        """The next command, as it was."""
        return self.solve(rows, task)

    def solve(self, rows: Rows, task: Task) -> Command:
        """The next command."""
        self._at += 1
        return Command(self._qdd[self._at - 1].copy(), "ok", np.zeros(len(rows.labels), dtype=np.bool_), rows.labels)


@dataclass(frozen=True)
class _RecordedSetup(Setup):
    """A setup whose robot was measured.

    Attributes
    ----------
    states
        (N, 2, n) q and q̇.
    """

    states: Array = ()  # type: ignore[assignment]

    def plant(self) -> Plant:
        """The robot, where it was."""
        return _Recorded(self.states, self.Ts)


def trajectory_of(setup: Setup, log: ArmLog, where: str) -> Trajectory:
    """What a simulation would leave of this motion: the same bookkeeping, with the robot where it was measured.

    Rows, markers and camera are those of the model at the measured joints. A run that was ended holds the periods of
    its stop, too. Status and reason say that it was on an arm.

    Parameters
    ----------
    setup
        What was run, with the start that the arm had.
    log
        What it left: at least two periods.
    where
        The arm, in words.
    """
    kept = np.ones(len(log.periods), dtype=np.bool_) if log.ended != "done" else ~log.braking
    states = np.stack([log.column("q")[kept], log.column("qd")[kept]], axis=1)
    made = _RecordedSetup(
        **{
            **{name: getattr(setup, name) for name in setup.__dataclass_fields__},
            "states": states,
            "duration": (len(states) - 1) * setup.Ts,
            "disturbances": Disturbances(),
            "dynamics": None,
            "images": None,
            "actuation": "acceleration",
        }
    )
    found = simulate(made, _Repeated(log.column("qdd")[kept]), remarks=())
    status = {"aborted": "aborted", "failed": "failed", "stopped": "unfinished"}.get(log.ended, found.status)
    reason = found.reason if log.ended == "done" else log.cause
    said = f"on {where}", reason, log.stop if log.ended != "done" else "", *log.remarks
    return replace(
        found,
        status=status,  # type: ignore[arg-type]
        reason="; ".join(filter(None, said)),
        rows_time=log.column("rows_time")[kept],
        step_time=log.column("step_time")[kept],
        compiled=log.compiled,
    )


def demand_own_folder(folder: Path) -> None:
    """Raise ConfigurationError if a folder holds results: what an arm has done cannot be made again."""
    if (folder / MANIFEST).exists() or (folder / ARM).exists():
        raise ConfigurationError(
            f"{folder} holds results: what an arm has done cannot be done again, so each run needs its own --out"
        )


def store(
    folder: Path, suite: Suite, setup: Setup, log: ArmLog, where: str, command: Sequence[str] = ()
) -> tuple[Trajectory | None, Finished]:
    """Write the log, then the run as a comparison's, with tracking alone simulated beside it.

    Parameters
    ----------
    folder
        Where to.
    suite
        One scenario and one controller.
    setup, log, where
        See :func:`trajectory_of`.
    command
        What the user typed.

    Returns
    -------
    tuple
        The run's trajectory, None if there are less than two periods, and the comparison.
    """
    (folder / ARM).mkdir(parents=True, exist_ok=True)
    (folder / "trajectories").mkdir(exist_ok=True)
    punctual = punctuality(log)
    log.save(folder / ARM_LOG, where=where, **punctual.numbers())
    LATENESS.write(folder / ARM / LATENESS.file, {where: punctual})
    spec: RunSpec = next(run for run in suite.runs())
    trajectory = None
    if len(log.periods) < 2:
        record = RunRecord.failed(f"on {where}; {log.cause}; {log.stop}", spec.fingerprint)
    else:
        trajectory = trajectory_of(setup, log, where)
        record = RunRecord.of(setup, trajectory, spec.fingerprint)
    # as a run that is there, which a comparison takes as it is
    replace(record, files=digests(spec.files), missed=log.missed if log.real_time else None).save(
        run_file(folder, *spec.key)
    )
    return trajectory, compare_runs(suite, folder, workers=1, command=command)


def punctuality(log: ArmLog) -> Punctuality:
    """How punctual the periods of the law were."""
    own = ~log.braking if len(log.periods) else np.empty(0, dtype=np.bool_)
    late, busy = (log.column(name)[own] for name in ("late", "busy"))
    return Punctuality(late, busy, log.missed, log.Ts)
