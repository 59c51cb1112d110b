"""Workspace for the runs of a setup: control steps, and the arrays of the closed loop."""

from __future__ import annotations

import math

import numpy as np

from ..compiled.memory import zeros
from ..compiled.records import LOOP_PARTS
from ..compiled.samples import Goals, Kept, Loop, Running
from ..compiled.workspace import Answer, Size, Step
from ..constraints import ConstraintSet
from ..controllers import Tracking
from ..controllers.compiled import BoundLaw
from ..robots.geometry import Pose
from ..rows.factors import AS_THEY_ARE, RowFactors
from ..vision.features import CameraPose
from .plant import Plant
from .setup import Setup


class RunWorkspace:
    """Control steps of a setup for laws with these factors, and the unconstrained baseline.

    Runs follow one another; each begins with :meth:`restart`. Custom constraints and laws may keep
    state that it does not reset.
    """

    def __init__(self, setup: Setup, factors: RowFactors = AS_THEY_ARE) -> None:
        self.setup = setup
        self.factors = factors
        self.control = setup.control(factors)
        self.gradient_error = setup.gradient_error(factors)
        # the true values are stored; without disturbances the controller's step computes them
        self.world = self.control
        if setup.sensor().disturbed or self.gradient_error.any or factors.options():
            self.world = setup.world()
        self.baseline = Tracking()
        #: Both steps on arrays with fixed addresses; None if any part runs in NumPy.
        self.bound = self.control.bound()
        self.true = self.world.bound()
        #: Unconstrained baseline on the arrays of the controller's step.
        self.alone: BoundLaw | None = None
        if self.bound is not None:
            size = self.bound.packed.size
            now = self.bound.now
            active = np.empty(size.m, dtype=np.bool_)
            self.alone = self.baseline.bind(now.rows, now.task, active, np.empty(size.n))

    def restart(self) -> None:
        """Begin a new run."""
        for step in (self.control, self.world):
            step.reset()


def blank_step(setup: Setup, constraints: ConstraintSet, features: int) -> Step:
    """Return arrays for a step whose rows and task are evaluated in Python."""
    scene = setup.scene
    size = Size(
        n=scene.robot.n,
        M=len(scene.markers),
        P=len(scene.points),
        m=len(constraints.labels),
        k=features,
    )
    step, _ = size.step()
    step.rows.switching_gain[:] = constraints.switching_gain
    step.rows.scale[:] = constraints.scale
    step.rows.K[:] = constraints.approach_time
    return step


def make_loop(setup: Setup, plant: Plant, believed: Step, true: Step, whole: bool) -> Loop:
    """Return a loop whose parts all run in Python, until compiled ones replace them.

    ``believed`` and ``true`` are the steps of control and world. Unless ``whole``, only the last
    poses and errors of the camera are stored.
    """
    N = setup.samples_at_most
    m, n = true.rows.Lg.shape
    states, _ = plant.x.shape
    samples = N
    poses = N
    if not whole:
        samples = 1
        poses = min(N, math.ceil(setup.rest_time / setup.Ts) + 2)
    lengths = {
        "m": m,
        "n": n,
        "k": len(believed.task.error),
        "M": len(true.pixels),
        "P": len(true.points),
        "s": states,
        "N": samples,
        "poses": poses,
        "goals": len(setup.task.goals),
    }
    none = np.empty(0)
    return Loop(
        parts=np.zeros(1, LOOP_PARTS),
        Ts=np.array([setup.Ts]),
        clock=np.zeros(2 if whole else 0, dtype=np.int64),
        rows=believed.rows,
        task=believed.task,
        answer=Answer(plant.x[-2], np.zeros(m, np.bool_), none, np.zeros(1, np.int64), none),
        alone=np.zeros(n),
        true=true.rows,
        pixels=true.pixels,
        points=true.points,
        camera_R=true.camera_R,
        camera_t=true.camera_t,
        own_error=np.full(1, np.nan),
        goals=_goals(setup),
        plant=plant.arrays(N, believed.last_command),
        kept=zeros(Kept, lengths),
        scores=_no_scores(setup, lengths),
    )


def _goals(setup: Setup) -> Goals:
    """Return the arrays of the goals; the pose of a goal without one is NaN."""
    nowhere = Pose(np.full((3, 3), np.nan), np.full(3, np.nan))
    pixels = []
    poses = []
    for goal in setup.task.goals:
        pixels.append(goal.pixels)
        poses.append(goal.camera or nowhere)
    return Goals(
        begins=setup.goal_begins,
        pixels=np.array(pixels, dtype=np.float64),
        R=np.array([pose.R for pose in poses]),
        t=np.array([pose.t for pose in poses]),
        tolerance=setup.goal_tolerances,
        by_pose=np.array([isinstance(setup.task.feature, CameraPose)]),
    )


def _no_scores(setup: Setup, lengths: dict[str, int]) -> Running:
    """Return the scores of a run before its first sample."""
    scores: Running = zeros(Running, lengths)
    scores.phi_max[:] = -np.inf
    scores.sigma_max[:] = -np.inf
    scores.first_active[:] = -1
    scores.last_active[:] = -1
    scores.unreached[:] = -1
    scores.common[:] = setup.samples
    scores.share_to_hold[:] = np.nan
    return scores
