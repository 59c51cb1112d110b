"""Trajectory of a recorded run, and its results beside the unconstrained baseline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..comparisons import Finished, RunSpec, Suite
from ..comparisons import compare as compare_runs
from ..comparisons.record import RunRecord, run_file
from ..controllers import Controller
from ..errors import InvalidInput
from ..plugins.provenance import digests
from ..rows import Array, Command, Rows, Task
from ..simulation import Setup, Trajectory
from ..simulation.measured import follow_measured
from .recording import Recording

#: Law of a recorded run in results.
NAME_OF_LAW = "vsconstraints.score.scored:Recorded"
#: Largest distance of a joint from q0 [rad or m] at which a recording starts as the baseline does.
SAME_START = 0.01


class Recorded(Controller):
    """Place of the unknown law of a recorded run, which cannot be simulated."""

    name = "recorded"

    def solve(self, rows: Rows, task: Task) -> Command:
        """Raise InvalidInput: there is nothing to be solved."""
        raise InvalidInput("a recorded run cannot be simulated again: score its recording")


def recorded_trajectory(setup: Setup, recording: Recording, where: str) -> Trajectory:
    """Return the trajectory of a recording, scored as a simulation is.

    The robot takes its recorded positions; camera and rows are those of the model there. Where
    pixels are recorded, the clearances of rows in the image are those of the pixels. ``where``
    names the recording. Raises ConfigurationError if it is shorter than a sampling time.
    """
    motion = recording.on_grid(setup.Ts)
    assert motion.qd is not None
    states = np.stack([motion.q, motion.qd], axis=1)
    remarks = [f"recorded in {where}", *motion.remarks]
    apart = float(np.abs(motion.q[0] - setup.q0).max())
    if apart > SAME_START:
        remarks.append(f"the recording starts {apart:.3g} rad or m from that of the baseline, q0")
    qdd = motion.qdd
    if qdd is None:
        remarks.append("accelerations are differences of the speeds")
        change = np.diff(motion.qd, axis=0) / setup.Ts
        qdd = np.concatenate((change, change[-1:]))
    commanded = motion.qdd is not None
    run = follow_measured(setup, states, qdd, commanded=commanded, limited=commanded)
    if motion.pixels is not None:
        run, remark = _with_pixels(setup, run, motion.pixels[: len(run.t)])
        remarks.append(remark)
    unknown = np.full(len(run.t), np.nan)
    return replace(
        run,
        reason="; ".join(filter(None, (*remarks, run.reason))),
        rows_time=unknown,
        step_time=unknown,
    )


def _with_pixels(setup: Setup, run: Trajectory, pixels: Array) -> tuple[Trajectory, str]:
    """Return the trajectory with measured pixels (N, M, 2), and a remark on their deviation."""
    ideal = setup.scene.camera.undistort(pixels)
    deviation = np.linalg.norm(ideal - run.features_px, axis=2)
    # a marker that is not seen may have left the image: its last pixel would hide that
    hidden = np.isnan(deviation)
    seen = np.where(hidden[:, :, None], run.features_px, ideal)
    clearance = setup.clearance(run.t, run.q, run.qd, seen, run.points)
    of_image = np.array([unit == "px" for unit in setup.constraints.units], dtype=np.bool_)
    goals = np.array([setup.task.goal_at(t) for t in run.t])
    wanted = np.array([goal.pixels for goal in setup.task.goals])[goals]
    error = np.linalg.norm(seen - wanted, axis=2).max(axis=1)
    of_feature = setup.task.feature.reached_by == "feature"
    measured = replace(
        run,
        features_px=seen,
        feature_error_px=run.feature_error_px if of_feature else error,
        clearance=np.where(of_image, clearance, run.clearance),
        between_clearance=np.where(of_image, np.inf, run.between_clearance),
    )
    most = float(np.nanmax(deviation)) if np.isfinite(deviation).any() else np.nan
    remark = f"measured pixels deviate by up to {most:.3g} px from those of the model"
    if hidden.any():
        remark += f", which replace {np.count_nonzero(hidden)} of a marker that is not seen"
    return measured, remark


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
