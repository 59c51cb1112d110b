"""Start and goals of a setup: configuration, image, rows and problems."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from ..constraints import ImageConstraint
from ..errors import ConfigurationError, SceneError, described
from ..robots.geometry import Pose, distance
from ..rows import Array
from ..simulation import Setup
from ..simulation.occluders import LinesOfSight
from ..vision.features import Goal
from ..vision.measurement import estimated_pose
from ..vision.scene import MINIMUM_DEPTH, Scene
from .inverse_kinematics import inverse_kinematics, tip_of

ROUNDING = 1e-9  #: Largest σ, relative to the row's scale, that counts as zero.
#: Number of random configurations from which inverse kinematics starts, after the near ones.
TRIES = 20
#: Number of rotations about the optical axis from which the pose behind an image is estimated.
TURNS = 4
SAME = 1e-6  #: Largest distance of two poses [m, rad] that count as equal.
#: Largest distance of the markers from a goal image, relative to the image width, at the pose that
#: explains it best.
MAX_MISS = 0.1


@dataclass(frozen=True)
class Moment:
    """State of a setup at the ``start``, at a ``goal`` or at ``goal 2``, at time t [s].

    ``q`` (n,) is None if no configuration was found. ``pixels`` (M, 2) are relative to the image
    centre, NaN for markers that are not in front of the camera. ``phi`` and ``clearance`` (m,)
    belong to the rows, NaN where unknown. ``problems`` are sentences.
    """

    name: str
    t: float
    q: Array | None
    pixels: Array
    phi: Array
    clearance: Array
    problems: tuple[str, ...]


def moment_at(setup: Setup, name: str, t: float, q: Array, qd: Array) -> Moment:
    """Return the state with the robot at ``q`` and ``qd`` (n,) at time ``t`` [s]."""
    scene = setup.scene
    constraints = setup.constraints
    robot = scene.robot
    camera = scene.camera
    P = scene.camera_pose(q, t).inverse.act(scene.markers)
    seen = P[:, 2] >= MINIMUM_DEPTH
    pixels = np.full((len(P), 2), np.nan)
    pixels[seen] = camera.pixels(P[seen, :2] / P[seen, 2:])
    unknown = np.full(len(constraints.labels), np.nan)
    phi = unknown
    clearance = unknown
    problems = robot.outside_ranges(q)
    for i, (u, v) in enumerate(pixels, 1):
        if not seen[i - 1]:
            problems.append(f"marker {i} is behind the camera (depth {P[i - 1, 2]:.3g} m)")
        elif not camera.sees(pixels[i - 1]):
            problems.append(
                f"marker {i} is outside the image, at ({u:.0f}, {v:.0f}) px from its centre"
            )
    if seen.all():
        try:
            hidden = LinesOfSight(scene).hidden(q[None], [t])[0]
            problems += [
                f"marker {number} is hidden by the robot's own {link}" for number, link in hidden
            ]
        except ConfigurationError as error:
            problems.append(f"lines of sight are not checked: {error}")
        try:
            now = setup.world().evaluate(t, q, qd)
            rows = now.rows
            sigma = now.sigma
            places = (now.pixels[None], now.points[None])
            phi = rows.phi
            clearance = setup.clearance(np.array([t]), q[None], qd[None], *places)[0]
            for row in np.flatnonzero(sigma > ROUNDING * rows.scale):
                depth = f"{abs(clearance[row]):.4g} {constraints.units[row]}"
                problems.append(f"{rows.labels[row]} is violated: {depth} outside")
        except Exception as error:  # custom constraints may raise anything
            problems.append(f"its rows cannot be evaluated: {described(error)}")
    return Moment(name, t, q, pixels, phi, clearance, tuple(problems))


def moment_without_q(setup: Setup, name: str, t: float, pixels: Array, problem: str) -> Moment:
    """Return the state at a goal whose image (M, 2) [px] is known, and no configuration."""
    unknown = np.full(len(setup.constraints.labels), np.nan)
    problems = [problem]
    for constraint in setup.constraints.constraints:
        if isinstance(constraint, ImageConstraint) and constraint.motion is None:
            sigma = constraint.sigma(constraint.of_markers(pixels))
            labels = constraint.labels(setup.scene)
            for i in np.flatnonzero(sigma > 0.0):
                problems.append(f"{labels[i]} is violated")
    return Moment(name, t, None, pixels, unknown, unknown, tuple(problems))


def goal_configuration(scene: Scene, goal: Goal, q0: Array, t: float) -> tuple[Array, float]:
    """Return a configuration (n,) at a goal at time ``t`` [s], and the largest marker error [px].

    The configuration in the file is returned if the camera is at the goal there. Otherwise inverse
    kinematics starts from that configuration, then from ``q0``, then from :data:`TRIES` random
    ones, which are always the same. For a goal given as an image, the camera pose that explains it
    best is used. Raises SceneError if no configuration within the joint ranges is found.
    """
    robot = scene.robot
    missed = 0.0
    camera = goal.camera
    if camera is None:
        camera, missed = _pose_behind(scene, goal, q0)
    elif goal.q is not None:
        at_q = scene.camera_pose(goal.q, t)
        if max(distance(at_q, camera)) < SAME:
            return goal.q, 0.0
    tip = tip_of(scene, camera)
    if scene.motion is not None:
        tip = scene.motion.pose(t) @ tip
    low = np.where(np.isfinite(robot.q_min), robot.q_min, q0 - np.pi)
    high = np.where(np.isfinite(robot.q_max), robot.q_max, q0 + np.pi)
    others = np.random.default_rng(0).uniform(low, high, (TRIES, robot.n))
    starts = [q0, *others]
    if goal.q is not None:
        starts.insert(0, goal.q)
    for near in starts:
        q = inverse_kinematics(robot, tip, near)
        if q is not None:
            return q, missed
    raise SceneError(
        "no configuration within the joints' ranges was found that reaches it: it may be out of "
        "reach"
    )


def _pose_behind(scene: Scene, goal: Goal, q0: Array) -> tuple[Pose, float]:
    """Return the pose that explains a goal's image best, and the largest marker error [px]."""
    camera = scene.camera
    best = None
    least_miss = np.inf
    start = scene.camera_pose(q0)
    seen = camera.normalised(goal.pixels)
    for turn in np.arange(TURNS) * (2.0 * np.pi / TURNS):
        rotation = np.asarray(pin.utils.rotate("z", turn))
        turned = Pose(rotation, np.zeros(3))
        try:
            pose = estimated_pose(scene.markers, seen, start @ turned)
        except np.linalg.LinAlgError:  # the iteration diverged beyond the range of floats
            continue
        P = pose.inverse.act(scene.markers)
        depths = P[:, 2:]
        if (depths <= MINIMUM_DEPTH).any():
            continue
        pixels = camera.pixels(P[:, :2] / depths)
        miss = float(np.abs(pixels - goal.pixels).max())
        if miss < least_miss:
            best = pose
            least_miss = miss
    if best is None or not least_miss < MAX_MISS * camera.size[0]:
        raise SceneError("no camera pose was found from which the markers appear at these pixels")
    return best, least_miss


def named_goals(goals: Sequence[Any]) -> Iterator[tuple[str, Any]]:
    """Yield each goal with its name in messages."""
    for k, goal in enumerate(goals, start=1):
        name = f"goal {k}" if len(goals) > 1 else "goal"
        yield name, goal


def moments_at_goals(setup: Setup) -> Iterator[Moment]:
    """Yield the state at the end of each goal, when the next one begins or the run ends."""
    goals = setup.task.goals
    ends = [goal.from_time - setup.Ts for goal in goals[1:]]
    ends.append((setup.samples - 1) * setup.Ts)
    for (name, goal), t in zip(named_goals(goals), ends, strict=True):
        try:
            q, missed = goal_configuration(setup.scene, goal, setup.q0, t)
        except SceneError as error:
            yield moment_without_q(setup, name, t, goal.pixels, str(error))
            continue
        moment = moment_at(setup, name, t, q, np.zeros_like(q))
        if missed > setup.tolerances.feature_px:
            inexact = (
                "no camera pose shows the markers at exactly these pixels: the best one found "
                f"misses a marker by {missed:.3g} px"
            )
            moment = replace(moment, problems=(inexact, *moment.problems))
        yield moment


def problems_at_goals(setup: Setup) -> list[str]:
    """Return the problems at the goals of a setup that can start, each with the goal's name."""
    problems = []
    for moment in moments_at_goals(setup):
        problems += [f"{moment.name}: {problem}" for problem in moment.problems]
    return problems
