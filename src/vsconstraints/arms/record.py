"""Records of runs on an arm: the log, and results in the format of any other run."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..comparisons import Finished, RunSpec, Suite
from ..comparisons import compare as compare_runs
from ..comparisons.record import RunRecord, run_file
from ..comparisons.runs.files import write_arrays
from ..comparisons.runs.folder import MANIFEST
from ..comparisons.stored import ARM_LOG
from ..errors import ConfigurationError, StorageError, VsconstraintsError, described
from ..plugins.provenance import digests
from ..reports.plots import Figure, Sheet, decades, logarithmic
from ..rows import Array, BoolArray
from ..simulation import Setup, Trajectory
from ..simulation.measured import follow_measured
from .supervision import ArmEnd

LONG_STOP = 5.0  #: Length of a stop for which the log reserves room [s].
RESERVED = "arm-log.reserved"  #: File that reserves disk space for the log while the arm moves.
BLOCK = 1 << 20  #: Size of one write [bytes].
NOT_LOST = "The record of the arm's motion is kept in {}"
#: Folder for data that only a run on an arm has: the log of all periods and their delays.
ARM = ARM_LOG.parent.name


class Period(NamedTuple):
    """One period: times [s], and arrays (n,)."""

    scheduled: float  #: Scheduled start.
    late: float  #: Delay of the start.
    rows_time: float  #: Time for rows and task.
    step_time: float  #: Time for the law.
    busy: float  #: Time for all work of the period.
    q: Array  #: Measured.
    qd: Array
    qdd: Array
    sent_q: Array  #: Setpoint for the end of the period.
    sent_qd: Array
    pixels: Array  #: Measured image (M, 2), NaN without one.
    taken: float  #: Time of the image.
    #: Innovation (7,): :data:`vsconstraints.vision.measurement.INNOVATIONS`.
    innovation: Array
    guarded: bool  #: True if the command was clipped to the limits.
    braking: bool


@dataclass(frozen=True)
class ArmLog:
    """Log of a run on an arm."""

    ended: ArmEnd
    cause: str  #: Reason why it ended; empty if it is done.
    signal: int  #: Number of the signal that requested a stop; 0 if none did.
    stop: str  #: Description of the end of its motion, see :class:`.Stop`.
    #: True if setpoints braked the arm and it was measured at rest; false if it was halted, or
    #: could not be, without observation.
    at_rest: bool
    periods: Sequence[Period]  #: All periods, including those of the stop.
    missed: int  #: Number of periods that began later than the next one was due.
    Ts: float  #: Sampling time [s].
    compiled: bool = False  #: True if rows, task and law all ran compiled.
    remarks: tuple[str, ...] = ()  #: Further remarks for the reader.
    #: True if the system's clock was used; simulated time waits for the loop, so no period is
    #: missed.
    real_time: bool = False
    #: Bounds of :class:`.Supervision`, by name.
    bounds: Mapping[str, float] = field(default_factory=dict)

    def column(self, name: str) -> Array:
        """Return one field of all periods (N, …)."""
        return np.array([getattr(period, name) for period in self.periods])

    @property
    def braking(self) -> BoolArray:
        """Mask (N,) of the periods of the stop."""
        return np.array([period.braking for period in self.periods], dtype=np.bool_)

    def save(self, path: Path, **facts: Any) -> None:
        """Write all periods and the facts, as JSON, to an .npz file."""
        columns = {name: self.column(name) for name in Period._fields}
        properties = {
            each.name: getattr(self, each.name) for each in fields(self) if each.name != "periods"
        }
        write_arrays(path, {**columns, **properties, "remarks": list(self.remarks), **facts})


class Punctuality(NamedTuple):
    """Delays of periods and durations of their work."""

    late: Array  #: (N,) [s].
    busy: Array  #: (N,) [s].
    missed: int  #: Number of periods that began late by one period or more.
    Ts: float  #: [s].

    def numbers(self) -> dict[str, float]:
        """Numbers that are printed and stored: [s], except for counts."""
        found: dict[str, float] = {"periods": len(self.late), "missed": self.missed}
        for name, values in (("late", self.late), ("busy", self.busy)):
            for what, share in (("median", 50.0), ("p99", 99.0), ("max", 100.0)):
                found[f"{name}_{what}_s"] = float(
                    np.percentile(values if len(values) else 0.0, share)
                )
        return found

    def lines(self) -> list[str]:
        """Return lines for a terminal."""
        n = self.numbers()
        share = 100.0 * n["missed"] / max(n["periods"], 1.0)
        lines = [
            f"{n['periods']:.0f} periods of {1e3 * self.Ts:g} ms, {n['missed']:.0f} missed "
            f"({share:.2g} %)"
        ]
        for what, name in (("late by", "late"), ("work of a period", "busy")):
            median, p99, most = (
                _time(n[f"{name}_{which}_s"]) for which in ("median", "p99", "max")
            )
            lines.append(f"{what}: median {median}, p99 {p99}, maximum {most}")
        return lines


def punctuality(log: ArmLog) -> Punctuality:
    """Punctuality of the periods before the stop."""
    late, busy = (log.column(name)[~log.braking] for name in ("late", "busy"))
    return Punctuality(late, busy, log.missed, log.Ts)


def _time(seconds: float) -> str:
    if seconds >= 0.9995:
        return f"{seconds:.3g} s"
    return f"{1e3 * seconds:.3g} ms" if seconds >= 0.9995e-3 else f"{1e6 * seconds:.3g} µs"


def _draw(runs: dict[str, Punctuality]) -> Sheet | None:
    if not any(len(run.late) for run in runs.values()):
        return None
    sheet = Sheet()
    panels = sheet.panels(
        len(runs),
        height=1.5,
        above=0.3,
        labels=("delay [ms]; red: one period", "number of periods"),
    )
    least = 1e-3
    most = 1e3
    for ax, (name, run) in zip(panels, runs.items(), strict=True):
        ax.hist(
            np.clip(1e3 * run.late, least, most), bins=np.geomspace(least, most, 73), color="0.35"
        )
        ax.axvline(1e3 * run.Ts, color="tab:red", linewidth=1.0)
        ax.set_xlim(least, most)
        logarithmic(ax.xaxis, decades(least, most))
        logarithmic(ax.yaxis, decades(0.0, max(len(run.late), 1)), linear_below=1.0)
        p99 = _time(run.numbers()["late_p99_s"])
        ax.set_title(f"{name}: {run.missed} of {len(run.late)} missed, p99 {p99}", fontsize=8)
    return sheet


_LEGEND = "Delays of periods. The line marks a whole period; periods to its right were missed."
LATENESS = Figure("lateness", "How late periods began", _LEGEND, _draw)


def trajectory_of(setup: Setup, log: ArmLog, where: str) -> Trajectory:
    """Return the trajectory of a run on an arm of at least two periods, scored as a simulation is.

    ``where`` names the arm. The robot takes its measured positions; rows, markers and camera are
    those of the model there. A run that ended early includes the periods of its stop. Status and
    reason state that it was on an arm.
    """
    done = log.ended == "done"
    kept = ~log.braking if done else np.ones(len(log.periods), dtype=np.bool_)
    states = np.stack([log.column("q")[kept], log.column("qd")[kept]], axis=1)
    run = follow_measured(setup, states, log.column("qdd")[kept])
    status = {"aborted": "aborted", "failed": "failed", "stopped": "unfinished"}.get(
        log.ended, run.status
    )
    reason = (run.reason,) if done else (log.cause, log.stop)
    return replace(
        run,
        status=status,  # type: ignore[arg-type]
        reason="; ".join(filter(None, (f"on {where}", *reason, *log.remarks))),
        rows_time=log.column("rows_time")[kept],
        step_time=log.column("step_time")[kept],
        compiled=log.compiled,
    )


def require_own_folder(folder: Path) -> None:
    """Raise ConfigurationError if a folder holds results: a run on an arm cannot be repeated."""
    if (folder / MANIFEST).exists() or (folder / ARM).exists():
        raise ConfigurationError(
            f"{folder} already holds results, and the run of an arm cannot be repeated: give "
            "another folder with --out"
        )


@contextmanager
def room_for_log(folder: Path, setup: Setup) -> Iterator[None]:
    """Reserve disk space for the log of a run until it is written.

    Raises ConfigurationError, before anything moves, if the folder has not enough space.
    """
    n = setup.scene.robot.n
    markers = len(setup.scene.markers)
    numbers = 13 + 5 * n + 2 * markers  # numbers in a Period
    periods = setup.samples + round(LONG_STOP / setup.Ts)
    size = 8 * numbers * periods
    path = folder / RESERVED
    try:
        try:
            with path.open("wb", buffering=0) as file:
                for begin in range(0, size, BLOCK):
                    block = bytes(min(BLOCK, size - begin))
                    # a write to a full disk is incomplete
                    if file.write(block) < len(block):
                        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                os.fsync(file.fileno())
        except OSError as error:
            raise ConfigurationError(
                f"nothing has moved: {folder} has too little space for the record of the motion, "
                f"{size / 1e6:.3g} MB ({error}). Give a folder on another disk with --out"
            ) from error
        yield
    finally:
        with suppress(OSError):
            path.unlink(missing_ok=True)


def save_log(folder: Path, log: ArmLog, where: str) -> Path:
    """Write the log to the folder of a run or else to a temporary one; return its path.

    The motion cannot be repeated. The space that :func:`room_for_log` reserves is used. Raises
    StorageError if both fail.
    """
    with suppress(OSError):
        (folder / RESERVED).unlink(missing_ok=True)
    failures = []
    for temporary in (False, True):
        try:
            parent = (
                Path(tempfile.mkdtemp(prefix="vsconstraints-arm-")) if temporary else folder / ARM
            )
            parent.mkdir(parents=True, exist_ok=True)
            path = parent / ARM_LOG.name
            log.save(path, where=where, **punctuality(log).numbers())
            return path
        except Exception as error:  # after any error, the next folder is tried
            failures.append(described(error))
    raise StorageError(f"the record of the arm's motion is lost: {'; '.join(failures)}")


def store(
    folder: Path,
    suite: Suite,
    setup: Setup,
    log: ArmLog,
    where: str,
    command: Sequence[str] = (),
    saved: Path | None = None,
) -> tuple[Trajectory | None, Finished]:
    """Write the log, then the run in the format of a comparison with a simulated baseline.

    ``saved`` is the file of the log if :func:`save_log` has written it already. The unconstrained
    baseline is simulated in addition. The suite has one scenario and one controller. Returns the
    run's trajectory, None if there are less than two periods, and the comparison. Raises
    StorageError, which names the place of the log, if the log or the results cannot be stored, or
    if scoring fails.
    """
    log_file = saved or save_log(folder, log, where)
    if log_file != folder / ARM_LOG:
        raise StorageError(f"the results cannot be stored in {folder}. {NOT_LOST.format(log_file)}")
    try:
        return _store_results(folder, suite, setup, log, where, command)
    except Exception as error:  # scoring calls custom code, which can fail in any way
        why: object = error
        if isinstance(error, StorageError):
            why = error.__cause__ or error
        elif not isinstance(error, (OSError, VsconstraintsError)):
            why = described(error)
        raise StorageError(
            f"the results cannot be stored in {folder}: {why}. {NOT_LOST.format(log_file)}"
        ) from error


def _store_results(
    folder: Path, suite: Suite, setup: Setup, log: ArmLog, where: str, command: Sequence[str]
) -> tuple[Trajectory | None, Finished]:
    (folder / "trajectories").mkdir(exist_ok=True)
    LATENESS.write(folder / ARM / LATENESS.file_in(), {where: punctuality(log)})
    spec: RunSpec = next(run for run in suite.runs())
    trajectory = None
    if len(log.periods) < 2:
        record = RunRecord.failed(f"on {where}; {log.cause}; {log.stop}", spec.fingerprint)
    else:
        trajectory = trajectory_of(setup, log, where)
        record = RunRecord.of(setup, trajectory, spec.fingerprint)
    # stored like a finished run, which a comparison keeps
    replace(record, files=digests(spec.files), missed=log.missed if log.real_time else None).save(
        run_file(folder, *spec.key)
    )
    return trajectory, compare_runs(suite, folder, workers=1, command=command)
