"""One instant of a preview: where the robot and its markers are, the robot at a goal, and distances to boundaries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ...constraints import ImageConstraint
from ...errors import ConfigurationError, SceneError, VsconstraintsError, described
from ...robots.geometry import Pose, distance
from ...rows import Array, BoolArray
from ...scenarios.families.placements import inverse_kinematics, tip_of
from ...simulation import Setup
from ...simulation.occluders import LinesOfSight
from ...vision.features import Goal
from ...vision.pose_estimate import estimated_pose
from ...vision.scene import MINIMUM_DEPTH, Scene

ROUNDING = 1e-9
"""Of σ relative to the row's scale, that counts as none."""


@dataclass(frozen=True)
class Moment:
    """The start, or a goal.

    Attributes
    ----------
    name
        ``"start"``, ``"goal"`` or ``"goal 2"``.
    t
        When [s].
    q
        (n,) where the robot is; None if no configuration was found.
    pixels
        (M, 2) of the markers, from the image's centre [px]; NaN for those that are not in front of the camera.
    phi, clearance
        (m,) of each row, the latter in its natural unit; NaN where they cannot be said.
    limits
        (2n,) distance to the robot's own lower and upper joint limits [rad or m]; infinite where there is none.
    problems
        What is wrong, one sentence each.
    """

    name: str
    t: float
    q: Array | None
    pixels: Array
    phi: Array
    clearance: Array
    limits: Array
    problems: tuple[str, ...]


def moment_at(setup: Setup, name: str, t: float, q: Array, qd: Array) -> Moment:
    """The robot at ``q`` and ``qd`` (n,) at time ``t`` [s]."""
    scene = setup.scene
    robot, camera = scene.robot, scene.camera
    P = scene.camera_pose(q, t).inverse.act(scene.markers)
    seen = P[:, 2] >= MINIMUM_DEPTH
    pixels = np.full((len(P), 2), np.nan)
    pixels[seen] = camera.pixels(P[seen, :2] / P[seen, 2:])
    problems = robot.outside_ranges(q)
    problems += [f"marker {i + 1} is behind the camera (depth {P[i, 2]:.3g} m)" for i in np.flatnonzero(~seen)]
    problems += [
        f"marker {i + 1} is outside the image, at ({u:.0f}, {v:.0f}) px from its centre"
        for i, (u, v) in enumerate(pixels)
        if seen[i] and not camera.sees(pixels[i])
    ]
    problems += hidden(setup, q, t) if seen.all() else []
    phi, clearance, wrong = _rows(setup, t, q, qd, seen)
    limits = np.concatenate((q - robot.q_min, robot.q_max - q))
    return Moment(name, t, q, pixels, phi, clearance, limits, (*problems, *wrong))


def nowhere(setup: Setup, name: str, t: float, pixels: Array, problem: str) -> Moment:
    """A goal of which no more is known than its image (M, 2) [px]."""
    m, n = len(setup.constraints.labels), setup.scene.robot.n
    unknown = np.full(m, np.nan)
    forbidden = []
    for constraint in setup.constraints.constraints:
        if isinstance(constraint, ImageConstraint) and constraint.motion is None:
            outside = constraint.sigma(constraint.of_markers(pixels)) > 0.0
            forbidden += [constraint.labels(setup.scene)[i] for i in np.flatnonzero(outside)]
    problems = (problem, *(f"{label} is violated" for label in forbidden))
    return Moment(name, t, None, pixels, unknown, unknown, np.full(2 * n, np.nan), problems)


def hidden(setup: Setup, q: Array, t: float) -> list[str]:
    """Which markers the robot's own links hide; or why nobody knows."""
    try:
        lines = LinesOfSight(setup.scene)
    except ConfigurationError as error:
        return [f"lines of sight are not checked: {error}"]
    return [f"marker {number} is hidden by the robot's own {link}" for number, link in lines.hidden(q, t)]


def _rows(setup: Setup, t: float, q: Array, qd: Array, seen: BoolArray) -> tuple[Array, Array, list[str]]:
    """φ and the clearance of each row, and which are violated; NaN where a marker is behind the camera."""
    unknown = np.full(len(setup.constraints.labels), np.nan)
    if not seen.all():
        return unknown, unknown, []
    try:
        now = setup.world().evaluate(t, q, qd)
        rows, sigma = now.rows, now.sigma
        clearance = setup.clearance(np.array([t]), q[None], qd[None], now.pixels[None], now.points[None])[0]
    except VsconstraintsError as error:
        return unknown, unknown, [f"its rows cannot be evaluated: {error}"]
    except Exception as error:  # own constraints may raise anything
        return unknown, unknown, [f"its rows cannot be evaluated: {described(error)}"]
    units = setup.constraints.units
    violated = np.flatnonzero(sigma > ROUNDING * rows.scale)
    return (
        rows.phi,
        clearance,
        [f"{rows.labels[i]} is violated: {abs(clearance[i]):.4g} {units[i]} outside" for i in violated],
    )


# --- distances to boundaries ---

NEAR = 0.9
"""Usage 1 − clearance/L from which a row counts as near: 1 is on its boundary."""


@dataclass(frozen=True)
class Row:
    """How near a row, or a joint's own limit, is to its boundary in each moment.

    Attributes
    ----------
    label, unit
        Its name, and that of its distances.
    phi, clearance
        (k,) in each moment; φ is NaN of a limit that is no row.
    usage
        (k,) 1 − clearance/L: 1 is on the boundary, more is outside.
    """

    label: str
    unit: str
    phi: Array
    clearance: Array
    usage: Array

    @property
    def limit(self) -> bool:
        """Whether it is no row, but a limit of a joint."""
        return bool(np.isnan(self.phi).all() and self.label.startswith("limit["))

    @property
    def greatest(self) -> float:
        """The usage where it is greatest; minus infinity where it is not known."""
        return float(np.nan_to_num(self.usage, nan=-np.inf).max())

    def text(self, k: int) -> str:
        """The distance to the boundary in a moment, and φ in brackets."""
        if np.isnan(self.clearance[k]):
            return "not known"
        phi = "" if np.isnan(self.phi[k]) else f" ({self.phi[k]:.2g})"
        return f"{self.clearance[k]:.3g} {self.unit}{phi}".replace("-", "−")


def rows_of(setup: Setup, moments: Sequence[Moment]) -> list[Row]:
    """All rows, and the limits of joints that no row is about."""
    constraints, robot = setup.constraints, setup.scene.robot
    phi, clearance = (np.array([getattr(moment, what) for moment in moments]) for what in ("phi", "clearance"))
    usage = 1.0 - clearance / constraints.characteristic_length
    rows = [
        Row(label, constraints.units[i], phi[:, i], clearance[:, i], usage[:, i])
        for i, label in enumerate(constraints.labels)
    ]
    limits = np.array([moment.limits for moment in moments])
    half = 0.5 * (robot.q_max - robot.q_min)
    for i, side in enumerate(("lower", "upper")):
        for j in np.flatnonzero(np.isfinite(half)):
            if f"range[joint {j + 1}].{side}" not in constraints.labels:
                away = limits[:, i * robot.n + j]
                unit = "m" if robot.prismatic[j] else "rad"
                label = f"limit[joint {j + 1}].{side}"
                rows.append(Row(label, unit, np.full(len(moments), np.nan), away, 1.0 - away / half[j]))
    return rows


# --- the robot at a goal ---

TRIES = 20
"""Configurations from which one at the goal is sought, besides those that are near."""

SAME = 1e-6
"""Distance of two poses [m, rad] that counts as none."""

TURNS = 4
"""Of the camera about its optical axis, from which the pose behind an image is sought."""

MAX_MISS = 0.1
"""How far markers may be from a goal given as an image, seen from the pose that explains it best, relative to its
width."""


class Reached(NamedTuple):
    """Joint coordinates (n,) at a goal, and by how much its markers are missed there at most [px]."""

    q: Array
    missed: float = 0.0


def goal_configuration(scene: Scene, goal: Goal, q0: Array, t: float) -> Reached:
    """Where the robot is when a goal is reached at time ``t`` [s].

    Where the file says it and the camera is right there, that; else what inverse kinematics finds from there, from the
    start, and then from :data:`TRIES` others. What is given as an image counts as the pose that explains it best.

    Raises
    ------
    SceneError
        if nothing is found within the joints' ranges.
    """
    if goal.q is not None and _there(scene, goal, goal.q, t):
        return Reached(goal.q)
    camera, missed = (goal.camera, 0.0) if goal.camera is not None else _seen_from(scene, goal, q0)
    tip = tip_of(scene, camera)
    if scene.motion is not None:
        tip = scene.motion.pose(t) @ tip
    for near in (*(() if goal.q is None else (goal.q,)), q0, *_others(scene, q0)):
        q = inverse_kinematics(scene.robot, tip, near)
        if q is not None:
            return Reached(q, missed)
    raise SceneError("no configuration within the joints' ranges was found that reaches it: it may be out of reach")


def _there(scene: Scene, goal: Goal, q: Array, t: float) -> bool:
    return goal.camera is not None and max(distance(scene.camera_pose(q, t), goal.camera)) < SAME


def _seen_from(scene: Scene, goal: Goal, q0: Array) -> tuple[Pose, float]:
    """The pose that explains a goal's image best, and by how much it misses the markers at most [px]."""
    camera, poses = scene.camera, []
    start, seen = scene.camera_pose(q0), camera.normalised(goal.pixels)
    for turn in np.arange(TURNS) * (2.0 * np.pi / TURNS):
        near = start @ Pose(np.asarray(pin.utils.rotate("z", turn)), np.zeros(3))
        try:
            pose = estimated_pose(scene.markers, seen, near)
        except np.linalg.LinAlgError:  # a search that has left the range of floats
            continue
        P = pose.inverse.act(scene.markers)
        if (P[:, 2] > MINIMUM_DEPTH).all():
            poses.append((pose, float(np.abs(camera.pixels(P[:, :2] / P[:, 2:]) - goal.pixels).max())))
    best = min(poses, key=lambda one: one[1], default=None)
    if best is None or not best[1] < MAX_MISS * camera.size[0]:
        raise SceneError("no pose of the camera was found from which the markers look like this")
    return best


def _others(scene: Scene, q0: Array) -> Array:
    """(TRIES, n) configurations in the joints' ranges, or within half a turn of the start; always the same."""
    robot = scene.robot
    low = np.where(np.isfinite(robot.q_min), robot.q_min, q0 - np.pi)
    high = np.where(np.isfinite(robot.q_max), robot.q_max, q0 + np.pi)
    return np.random.default_rng(0).uniform(low, high, (TRIES, robot.n))
