"""Whole runs of a controller on a setup: their trajectory, or their scores alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..constraints import ConstraintSet
from ..controllers import Controller, Tracking
from ..vision.scene import Scene
from .disturbances import Disturbances
from .follower import ACCELERATIONS
from .loop import Run
from .occluders import hidden_markers
from .prepared import RunWorkspace
from .setup import Setup
from .trajectory import RunScores, Trajectory

#: Limit of the time that a run may take to settle at the last goal, as a multiple of the settling
#: time of the undisturbed, unconstrained baseline.
PATIENCE = 3.0


def simulate(
    setup: Setup,
    controller: Controller,
    *,
    by_public_call: bool = False,
    remarks: Sequence[str] | None = None,
    prepared: RunWorkspace | None = None,
) -> Trajectory:
    """Run a controller on a setup from t = 0 to its duration, or until the run cannot go on.

    If the setup has a time limit, a run that is not at rest at the end of its duration continues
    until it is; see :func:`.until_settled`. A run ends with the status ``failed`` if the scene can
    no longer be evaluated, if the controller fails, or if a custom part raises any exception. The
    samples simulated until then are kept. The command of the last sample is computed but not
    executed.

    The reason of the trajectory includes ``remarks`` (those of :meth:`Setup.check_start` by
    default) and the controller's remarks. It states how often another QP solver had to answer, and
    how often a law reported a loss of rank that its rows do not show; such a report never stops a
    run.

    With ``by_public_call`` every law is called as ``controller.command(rows, task)``, as in a
    user's loop, so that the times of different laws are those of the same call. Otherwise compiled
    laws run on the arrays of the compiled step, which is faster; their commands are the same.
    ``prepared`` is a workspace of this setup to be reused. Raises ConfigurationError if the robot
    cannot start.
    """
    if remarks is None:
        remarks = setup.check_start()
    if prepared is None or prepared.factors != controller.factors:
        prepared = RunWorkspace(setup, controller.factors)
    run = Run(prepared, controller, whole=True, by_public_call=by_public_call)
    run.to_the_end()
    return trajectory_of(run, remarks)


def trajectory_of(run: Run, remarks: Sequence[str]) -> Trajectory:
    """Return a run's trajectory, with these remarks and its own appended to the reason."""
    trajectory = run.trajectory()
    remarks = (
        *remarks,
        *hidden_markers(run.setup.scene, trajectory.t, trajectory.q),
        *run.remarks(),
    )
    return replace(trajectory, reason="; ".join(filter(None, (trajectory.reason, *remarks))))


def score_run(setup: Setup, controller: Controller) -> RunScores:
    """Run a controller as :func:`simulate` does, but keep only its scores.

    It is meant for thousands of trials: the whole loop is compiled if step and law are. Lines of
    sight are checked only at the start.
    """
    prepared = RunWorkspace(setup, controller.factors)
    remarks = setup.check_start(prepared.world)
    run = Run(prepared, controller, whole=False)
    run.to_the_end()
    scores = run.scores()
    return replace(
        scores, reason="; ".join(filter(None, (scores.reason, *remarks, *run.remarks())))
    )


def until_settled(setup: Setup) -> Setup:
    """Return the setup with a time limit, until which runs may continue until they are at rest.

    Runs come to rest at the last goal or elsewhere. The moment at which a run is cut off then does
    not decide which law arrives. The limit for the last goal is :data:`PATIENCE` times the settling
    time of the unconstrained baseline without disturbances, the same for every law. If the baseline
    does not settle, it is the same multiple of the time from the beginning of the last goal to the
    end of the duration.

    The setup is returned unchanged, so that a run ends with its duration, in three cases: the
    target moves, and a law that follows it is judged at the end of the motion that the scenario
    states; even the baseline is still moving at the end of the duration; or the limit does not
    exceed the duration. Raises as :func:`simulate` does.
    """
    if setup.scene.motion is not None:
        return setup
    scene = Scene(setup.scene.robot, setup.scene.camera, setup.scene.markers)
    ideal = replace(
        setup,
        scene=scene,
        constraints=ConstraintSet([], scene),
        disturbances=Disturbances(),
        actuation="acceleration",
        arm=ACCELERATIONS,
        dynamics=None,
        images=None,
        on_hidden_markers="continue",
        time_limit=None,
    )
    tracking = score_run(ideal, Tracking())
    if tracking.status in ("slow", "unfinished"):
        return setup
    begin = setup.task.goals[-1].from_time
    needed = tracking.settling_times_s[-1]
    limit = begin + PATIENCE * (needed if np.isfinite(needed) else setup.duration - begin)
    return replace(setup, time_limit=limit) if limit > setup.duration else setup
