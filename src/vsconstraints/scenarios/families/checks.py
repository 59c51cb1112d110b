"""What an attempt must pass once it is built: ends that are allowed and seen, and something to compare."""

from __future__ import annotations

import numpy as np

from ...controllers import Tracking
from ...errors import SceneError, VsconstraintsError
from ...rows import Array
from ...simulation import RunScores, Setup, score_run
from ...simulation.image_sensor import ImageSensor
from ...simulation.occluders import LinesOfSight
from .ends import last
from .placements import Ends
from .reasons import Reason, Rejected

CLEAR = 1e-3
"""Least σ, or φ of speeds, relative to its range, from which on tracking alone has left a row: ten times what scores
neglect, so that what is challenged here is challenged there."""


def check_ends(setup: Setup, ends: Ends) -> None:
    """Raise Rejected if a row is violated at the start or the last goal, or the robot hides a marker there."""
    start, duration = setup.q0, (setup.samples - 1) * setup.Ts
    _allowed(setup, start, 0.0, Reason.START_FORBIDDEN)
    goal, end = setup.task.goals[-1].camera, None
    if goal is not None:
        end = last(ends, goal, duration)
        _allowed(setup, end, duration, Reason.GOAL_FORBIDDEN)
    lines = LinesOfSight(setup.scene)
    for q, t, reason in ((start, 0.0, Reason.START_HIDDEN), (end, duration, Reason.GOAL_HIDDEN)):
        hidden = [] if q is None else lines.hidden(q, t)
        if hidden and setup.on_hidden_markers == "refuse":
            raise Rejected(reason, f"marker {hidden[0][0]} by {hidden[0][1]}")


def left_by_tracking(setup: Setup) -> tuple[str, ...]:
    """Labels of the rows that tracking alone leaves; raises Rejected if there is none, or it cannot start."""
    scores = _track(setup)
    left = scores.sigma_max > CLEAR * setup.constraints.scale
    challenged = tuple(label for label, row in zip(scores.labels, left, strict=True) if row)
    if not challenged:
        raise Rejected(Reason.NOT_CHALLENGED)
    return challenged


def check_first_image(setup: Setup) -> None:
    """Raise Rejected if the control sees images, and none of its tags in the first one."""
    sensor = setup.sensor() if setup.images is not None else None
    if isinstance(sensor, ImageSensor):
        try:
            sensor.measured(0, setup.q0, setup.qd0)
        except SceneError as error:
            raise Rejected(Reason.START_UNDETECTED, str(error)) from error


def share_to_hold(setup: Setup) -> float:
    """The greatest share of all that the actuators can do that it takes to hold a row where tracking alone meets it.

    NaN without limits, or where no row is met; see :class:`vsconstraints.simulation.Trajectory`.
    """
    shares = _track(setup).share_to_hold if setup.limits.any else np.empty(0)
    return float(np.nanmax(shares)) if np.isfinite(shares).any() else np.nan


def _track(setup: Setup) -> RunScores:
    try:
        return score_run(setup, Tracking())
    except VsconstraintsError as error:
        raise Rejected(Reason.START_REFUSED, str(error)) from error


def _allowed(setup: Setup, q: Array, t: float, reason: Reason) -> None:
    try:
        _, sigma = setup.constraints.rows(setup.scene.evaluate(t, q, np.zeros_like(q)))
    except SceneError as error:
        raise Rejected(reason, str(error)) from error
    violated = np.flatnonzero(sigma > 0.0)
    if len(violated):
        raise Rejected(reason, setup.constraints.labels[violated[0]])
