"""Trajectory of a recorded run, and its results beside the unconstrained baseline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..comparisons import Finished, RunSpec, Suite
from ..comparisons import compare as compare_runs
from ..comparisons.record import RunRecord, run_file
from ..constraints import PerformanceFunnel
from ..control.control_step import ControlStep
from ..control.gradients import own_constraints
from ..controllers import Controller
from ..errors import ConfigurationError, InvalidInput, listed
from ..plugins.provenance import digests
from ..rows import Array, BoolArray, Command, Rows, Task
from ..simulation import Setup, Trajectory
from ..simulation.measured import follow_measured
from .pixels import remark_on_deviation, require_pixels
from .recording import Recording

#: Law of a recorded run in results.
NAME_OF_LAW = "vsconstraints.score.scored:Recorded"
#: Largest distance of a joint from q0 [rad or m] at which a recording starts as the baseline does.
SAME_START = 0.01
#: Largest distance of a joint from q0 [rad], after a change of unit, at which the start of a
#: recording in another unit is recognized.
NEAR_START = 0.05


class Recorded(Controller):
    """Place of the unknown law of a recorded run, which cannot be simulated."""

    name = "recorded"

    def solve(self, rows: Rows, task: Task) -> Command:
        """Raise InvalidInput: there is nothing to be solved."""
        raise InvalidInput("a recorded run cannot be simulated again: score its recording")


def recorded_trajectory(
    setup: Setup, recording: Recording, where: str, zero: float = 0.0, *, degrees: bool = False
) -> Trajectory:
    """Return the trajectory of a recording, scored as a simulation is.

    The robot takes its recorded positions; camera and rows are those of the model there. Where
    pixels are recorded, the clearances of rows in the image are those of the pixels. ``where``
    names the recording. The scenario begins, t = 0, at ``zero`` [s] after the first sample of the
    file. ``degrees`` is True if positions in degrees were converted to rad. Raises
    ConfigurationError if the recording is shorter than a sampling time, if it begins at another
    time than the scenario and the scenario depends on time, if it starts at q0 in another unit, or
    if its pixels clearly are of another origin, unit or order.
    """
    late = recording.begin - zero
    begins_elsewhere = abs(late) > setup.Ts
    if begins_elsewhere:
        change = _dependence_on_time(setup)
        if change:
            raise _at_another_time(late, change)
    _require_start_in_radians(setup, recording.q[0], degrees)
    motion = recording.on_grid(setup.Ts)
    assert motion.qd is not None
    remarks = [f"recorded in {where}", *motion.remarks]
    from_q0 = float(np.abs(motion.q[0] - setup.q0).max())
    if from_q0 > SAME_START:
        remarks.append(f"the recording starts {from_q0:.3g} rad or m from that of the baseline, q0")
    qdd = motion.qdd
    commanded = qdd is not None
    if qdd is None:
        remarks.append("accelerations are differences of the speeds")
        differences = np.diff(motion.qd, axis=0) / setup.Ts
        qdd = np.concatenate((differences, differences[-1:]))
    states = np.stack([motion.q, motion.qd], axis=1)
    run = follow_measured(setup, states, qdd, commanded=commanded, limited=commanded)
    if begins_elsewhere:
        remarks.append(_remark_on_custom_rows(setup, run, late, len(motion.t)))
    if motion.pixels is not None:
        pixels = motion.pixels[: len(run.t)]
        camera = setup.scene.camera
        require_pixels(where, camera, pixels, camera.distort(run.features_px))
        run, remark = _with_pixels(setup, run, pixels)
        remarks.append(remark)
    unknown = np.full(len(run.t), np.nan)
    return replace(
        run,
        reason="; ".join(filter(None, (*remarks, run.reason))),
        rows_time=unknown,
        step_time=unknown,
    )


def _at_another_time(late: float, what: str) -> ConfigurationError:
    """Return the error for a motion that begins ``late`` [s] after the scenario, or before it.

    Runs, and the baseline among them, begin at the scenario's t = 0. ``what`` has changed by then.
    """
    side = "after"
    remedy = (
        f"score from there on. If the scenario begins with this sample, add {late:.9g} to --zero"
    )
    if late < 0.0:
        side = "before"
        remedy = "score from there on with --start"
    return ConfigurationError(
        f"the first scored sample is {abs(late):.6g} s {side} t = 0 of the scenario, whose {what} "
        f"by then, and results begin at t = 0: {remedy}"
    )


def _remark_on_custom_rows(setup: Setup, run: Trajectory, late: float, samples: int) -> str:
    """Return a remark on the custom rows of a run that begins ``late`` [s] after the scenario.

    Only the values of a custom row show whether it depends on time. All rows are therefore
    evaluated twice at each sample: at its time in the run, which begins at t = 0, and ``late``
    later, at its time in the scenario. Scores are those of the former: raises ConfigurationError if
    a row differs. The run may have fewer than the recorded ``samples``, because it ends where rows
    cannot be evaluated. The remark is empty without custom rows.
    """
    custom = own_constraints(setup.constraints)
    if not custom:
        return ""
    changed = _rows_that_differ(setup, run, run.t + late) if len(run.t) else []
    if changed:
        raise _at_another_time(late, f"rows {', '.join(listed(changed, 'rows'))} have changed")
    kinds = ", ".join(dict.fromkeys(constraint.kind for constraint in custom))
    if len(run.t) == samples:
        return f"custom rows, {kinds}, were found not to depend on time in this motion"
    return (
        f"custom rows, {kinds}, could be evaluated at {len(run.t)} of {samples} samples: if they "
        "depend on time at the others is not known"
    )


def _rows_that_differ(setup: Setup, run: Trajectory, later: Array) -> list[str]:
    """Return the labels of the rows that differ if a run has its states at ``later`` times (N,)."""
    motion = run.q, run.qd, run.features_px, run.points
    clearance = setup.clearance(run.t, *motion)
    clearance_later = setup.clearance(later, *motion)
    is_changed = _differ(clearance, clearance_later).any(axis=0)
    step = setup.world()
    for t, t_later, q, qd in zip(run.t, later, run.q, run.qd, strict=True):
        rows = _rows_at(step, t, q, qd)
        rows_later = _rows_at(step, t_later, q, qd)
        is_changed |= _differ(rows, rows_later).any(axis=1)
    labels = setup.constraints.labels
    return [labels[i] for i in np.flatnonzero(is_changed)]


def _rows_at(step: ControlStep, t: float, q: Array, qd: Array) -> Array:
    """Return σ, φ, L_fφ and L_gφ of each row (m, 3 + n); NaN if they cannot be evaluated."""
    try:
        evaluation = step.evaluate(t, q, qd)
        rows = evaluation.rows
        return np.column_stack((evaluation.sigma, rows.phi, rows.Lf, rows.Lg))
    except Exception:  # a custom constraint may raise any error, which the run reports
        return np.full((len(step.constraints.labels), 3 + len(q)), np.nan)


def _differ(first: Array, second: Array) -> BoolArray:
    """Return flags of numbers that differ; NaN differs from every number, but not from NaN."""
    both_unknown = np.isnan(first) & np.isnan(second)
    return np.asarray((first != second) & ~both_unknown)


def _dependence_on_time(setup: Setup) -> str:
    """Describe what in a scenario depends on time; empty if nothing does."""
    constraints = setup.constraints.constraints
    goals = setup.task.goals
    if setup.scene.motion is not None:
        return "target has moved"
    if any(getattr(constraint, "motion", None) is not None for constraint in constraints):
        return "forbidden regions have moved"
    if any(isinstance(constraint, PerformanceFunnel) for constraint in constraints):
        return "funnel has narrowed"
    if len(goals) > 1 or goals[0].reference is not None:
        return "goal has changed"
    return ""


def _require_start_in_radians(setup: Setup, q: Array, degrees: bool) -> None:
    """Raise ConfigurationError if the first positions (n,) are q0 in another unit.

    That is so if they are in degrees, or if rad were converted as if they were ``degrees``.
    """
    turning = ~np.array(setup.scene.robot.prismatic, dtype=np.bool_)
    wanted = setup.q0[turning]
    given = q[turning]
    apart = np.abs(given - wanted).max(initial=0.0)
    if apart <= 2.0 * NEAR_START:
        return
    if degrees:
        converted = np.rad2deg(given)
        remedy = "were these rad before --degrees converted them? Leave it out"
    else:
        converted = np.deg2rad(given)
        remedy = "are these degrees, not rad? --degrees converts them"
    if np.abs(converted - wanted).max() < NEAR_START:
        raise ConfigurationError(
            f"the recording starts {apart:.3g} rad from q0, and would start there if "
            f"{given[0]:.4g} of its first joint were {converted[0]:.4g}: {remedy}"
        )


def _with_pixels(setup: Setup, run: Trajectory, pixels: Array) -> tuple[Trajectory, str]:
    """Return the trajectory with measured pixels (N, M, 2), and a remark on their deviation."""
    task = setup.task
    camera = setup.scene.camera
    ideal = camera.undistort(pixels)
    deviation = np.linalg.norm(ideal - run.features_px, axis=2)
    # a marker that is not seen may have left the image: its last pixel would hide that
    hidden = np.isnan(deviation)
    seen = np.where(hidden[:, :, None], run.features_px, ideal)
    clearance = setup.clearance(run.t, run.q, run.qd, seen, run.points)
    is_in_pixels = [unit == "px" for unit in setup.constraints.units]
    of_image = np.array(is_in_pixels, dtype=np.bool_)
    error = run.feature_error_px
    if task.feature.reached_by != "feature":
        wanted = np.array([task.goals[task.goal_at(t)].pixels for t in run.t])
        distances = np.linalg.norm(seen - wanted, axis=2)
        error = distances.max(axis=1)
    measured = replace(
        run,
        features_px=seen,
        feature_error_px=error,
        clearance=np.where(of_image, clearance, run.clearance),
        between_clearance=np.where(of_image, np.inf, run.between_clearance),
    )
    return measured, remark_on_deviation(deviation, camera)


def store(
    folder: Path, suite: Suite, trajectory: Trajectory, command: Sequence[str] = ()
) -> Finished:
    """Store a recorded run as a comparison with the simulated baseline.

    The suite has one scenario and the law :class:`Recorded`. Raises as :func:`.compare` does.
    """
    spec: RunSpec = next(run for run in suite.runs())
    setup = spec.load().setup()
    file = run_file(folder, *spec.key)
    file.parent.mkdir(parents=True, exist_ok=True)
    record = RunRecord.of(setup, trajectory, spec.fingerprint)
    replace(record, files=digests(spec.files)).save(file)
    return compare_runs(suite, folder, workers=1, command=command)
