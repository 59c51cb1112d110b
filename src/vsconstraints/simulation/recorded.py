"""Runs in two parts: a law's commands, recorded in one process, and their motion in another.

A law cannot affect the process in which its motion is simulated, judged and scored, whatever it
does to its own process.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..controllers import Controller, Tracking
from ..rows import Array, Rows, Task
from .loop import Run
from .outcome import EarlyEnd
from .prepared import RunWorkspace
from .runs import trajectory_of
from .setup import Setup
from .trajectory import Trajectory

MAX_TEXT = 10_000  #: Maximum number of characters that are taken from a recorded reason or remark.


@dataclass(frozen=True)
class Recorded:
    """Commands of a law in a run of N samples on n joints, and the remarks of its process.

    The law's process is not trusted: only ``qdd`` affects motion and scores.
    """

    qdd: Array  #: (N, n) the commands.
    ended: EarlyEnd  #: Early end of the run; empty if all its samples were run.
    reason: str  #: Reason for an early end.
    remarks: tuple[str, ...]  #: Remarks on the law in this run.
    rows_time: Array  #: (N,) wall time of rows and task [s].
    step_time: Array  #: (N,) wall time of the law's call [s].
    fallbacks: int  #: Number of samples in which another QP solver had to answer.
    compiled: bool  #: True if rows, task and law all ran compiled.
    speeds: bool = False  #: True if the law commands speeds or positions.

    @classmethod
    def of(cls, setup: Setup, controller: Controller, *, by_public_call: bool = False) -> Recorded:
        """Run a law and record its commands.

        See :func:`.simulate` for the parameters and the errors raised.
        """
        run = Run(
            RunWorkspace(setup, controller.factors),
            controller,
            whole=True,
            by_public_call=by_public_call,
        )
        run.to_the_end()
        kept = run.loop.kept
        N = run.samples
        return cls(
            qdd=np.ascontiguousarray(kept.states[:N, -2]),
            ended=run.ended,
            reason=run.reason,
            remarks=tuple(run.law_remarks()),
            rows_time=kept.rows_time[:N],
            step_time=kept.step_time[:N],
            fallbacks=run.fallbacks,
            compiled=run.compiled,
            speeds=run.speeds,
        )

    def plain(self) -> dict[str, Any]:
        """Return the recording as text, numbers and bytes only, for another process."""
        values = dict(vars(self))
        for name in ("qdd", "rows_time", "step_time"):
            values[name] = np.asarray(values[name], dtype=np.float64).tobytes()
        return values

    @classmethod
    def from_plain(cls, values: object, joints: int) -> Recorded:
        """Invert :meth:`plain`.

        Raises ValueError, TypeError or KeyError if ``values`` is not a recording.
        """
        if not isinstance(values, dict):
            raise TypeError("it is not a table")
        ended = values["ended"]
        if ended not in ("", "failed", "aborted"):
            raise ValueError("it does not say how the run ended")
        qdd = _numbers(values["qdd"]).reshape(-1, joints)
        rows_time = _numbers(values["rows_time"])
        step_time = _numbers(values["step_time"])
        if not len(rows_time) == len(step_time) == len(qdd):
            raise ValueError("it has not exactly one time for each command")
        if not np.isfinite(qdd).all():
            raise ValueError("its commands are not finite")
        return cls(
            qdd=qdd,
            ended=ended,
            reason=str(values["reason"])[:MAX_TEXT],
            remarks=tuple(str(remark)[:MAX_TEXT] for remark in values["remarks"]),
            rows_time=rows_time,
            step_time=step_time,
            fallbacks=int(values["fallbacks"]),
            compiled=bool(values["compiled"]),
            speeds=bool(values["speeds"]),
        )


def _numbers(data: object) -> Array:
    if not isinstance(data, bytes):
        raise TypeError("its numbers are not bytes")
    return np.frombuffer(data, dtype=np.float64).copy()


def replay(
    setup: Setup,
    recorded: Recorded,
    *,
    remarks: Sequence[str] | None = None,
    prepared: RunWorkspace | None = None,
) -> Trajectory:
    """Simulate the motion that follows from recorded commands.

    It is judged as in :func:`.simulate`. Motion, rows and status follow from the commands alone.
    The recording only contributes its computing times, its early end and its remarks on the law.
    """
    if remarks is None:
        remarks = setup.check_start()
    run = _Replay(RunWorkspace(setup) if prepared is None else prepared, recorded)
    run.to_the_end()
    trajectory = trajectory_of(run, remarks)
    N = len(trajectory.t)
    return replace(
        trajectory,
        rows_time=recorded.rows_time[:N],
        step_time=recorded.step_time[:N],
        fallbacks=recorded.fallbacks,
        compiled=recorded.compiled,
    )


class _NoCommandError(Exception):
    """A recording has no command for a sample."""


class _Replay(Run):
    """A run with recorded commands."""

    def __init__(self, prepared: RunWorkspace, recorded: Recorded) -> None:
        self._recorded = recorded
        # the unconstrained baseline is never called: each sample reaches _ask_law
        super().__init__(prepared, Tracking(), whole=True, by_public_call=True)
        if recorded.speeds:
            self.plant.take_speeds()

    def to_the_end(self) -> None:
        """Run all samples, or until something ends the run."""
        recorded = self._recorded
        super().to_the_end()
        if self.ended and self.samples == len(recorded.qdd) and recorded.ended:
            self.ended = recorded.ended
            self.reason = recorded.reason

    def _ask_law(self, k: int, rows: Rows, task: Task) -> None:
        if k >= len(self._recorded.qdd):
            raise _NoCommandError(
                "the law's process gave no further commands, though the run is not over"
            )
        if self.sensor.blind:
            self.loop.answer.qdd[:] = self.sensor.braking(self.plant.qd)
        else:
            self.loop.answer.qdd[:] = self._recorded.qdd[k]

    def law_remarks(self) -> list[str]:
        """Return the recorded remarks; see :class:`.Run`."""
        return list(self._recorded.remarks)
