"""How long a run may take beyond its duration: a multiple of the time that tracking alone needs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..constraints import ConstraintSet
from ..controllers import Tracking
from ..vision.scene import Scene
from .disturbances import Disturbances
from .loop import score_run
from .setup import Setup

PATIENCE = 3.0
"""A run may take so many times as long to settle at the last goal as tracking alone does, undisturbed."""


def until_settled(setup: Setup) -> Setup:
    """The same setup, whose runs go on beyond its duration until they are at rest, at the last goal or elsewhere.

    Where a run is cut then does not decide which law arrives. Its time limit is :data:`PATIENCE` times as long as
    tracking alone takes to settle at the last goal, without constraints and disturbances: the same for every law. There
    is none, so that a run ends with its duration, where the target moves, since who follows it is judged at the end of
    the motion that the scenario states; and where even tracking alone is still on its way at the end of the duration.
    Where tracking alone fails, it is the multiple of the duration.

    Raises
    ------
    ConfigurationError
        if the robot cannot start (see :meth:`Setup.check_start`).
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
        dynamics=None,
        images=None,
        on_hidden_markers="continue",
        time_limit=None,
    )
    tracking = score_run(ideal, Tracking())
    if tracking.status in ("slow", "unfinished"):
        return setup
    begin, needed = setup.task.goals[-1].from_time, tracking.settling_times_s[-1]
    limit = begin + PATIENCE * (needed if np.isfinite(needed) else setup.duration - begin)
    return replace(setup, time_limit=limit) if limit > setup.duration else setup
