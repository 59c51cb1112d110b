"""Values that follow from the rest of a scene: where a camera looks at the target, and what lies in the way there."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
import pinocchio as pin

from ...errors import ConfigurationError
from ...robots.geometry import Pose, Vector2, Vector3
from ...robots.robot import Robot
from ...rows import Array
from ...vision.motion import Motion
from ...vision.scene import Scene
from ..reading import Table, checked, made

POSE_TOLERANCE = 1e-9
"""Error of a pose, ‖(m, rad)‖, that counts as none."""

MAX_STEPS = 60
MAX_STEP = 0.5
"""Of any joint [rad or m], so that the steps stay near where the linearisation holds."""

DAMPING = 0.02
"""Share of the squared error by which singular directions are damped: none is left at the solution."""


class Ends(NamedTuple):
    """A scene without its task and constraints, and where the robot is at its ends, as far as that is known.

    Attributes
    ----------
    scene
        Robot, camera, markers and how they move.
    q
        (n,) at the start and at each goal; None at a goal that is given by its image alone.
    """

    scene: Scene
    q: Sequence[Array | None]

    def pair(self, goal: int, where: str) -> tuple[Array, Array]:
        """At the start and at a goal, counted from 1; raises ConfigurationError if that is not known."""
        if not 1 <= goal < len(self.q):
            raise ConfigurationError(f"{where}: there is no goal {goal}; there are {len(self.q) - 1}")
        start, end = self.q[0], self.q[goal]
        if start is None or end is None:
            raise ConfigurationError(f"{where}: goal {goal} is no pose, so there is no way to it that is known")
        return start, end


class Placement(ABC):
    """A value that follows from the rest of the scene; its attributes are the keys of its table."""

    name: ClassVar[str]

    @abstractmethod
    def value(self, ends: Ends, beside: Table, where: str) -> list[float] | None:
        """The value; None if there is none that is possible.

        Parameters
        ----------
        ends
            The scene, and what is placed already.
        beside
            The table in which the value stands.
        where
            Dotted key, for messages.
        """


@dataclass(frozen=True)
class LookAt(Placement):
    """Joint coordinates at which the camera looks at the target, by inverse kinematics.

    At zero angles it looks along −normal at the middle of the markers.

    Attributes
    ----------
    distance
        Depth of the markers' middle [m].
    tilt, azimuth
        Angle between the optical axis and the normal, and about the normal, where to the camera tilts away [rad].
    roll
        About the optical axis [rad].
    image_px
        Where the markers' middle is seen, from the image's centre [px].
    normal
        From the target to the camera, in the target's frame.
    near
        (n,) where inverse kinematics begin; for goals at the start, if not given; else in the middle of the ranges.
    """

    name: ClassVar[str] = "look-at"

    distance: float
    tilt: float = 0.0
    azimuth: float = 0.0
    roll: float = 0.0
    image_px: Vector2 = (0.0, 0.0)
    normal: Vector3 = (0.0, 0.0, 1.0)
    near: Sequence[float] | None = None

    def camera(self, scene: Scene) -> Pose:
        """Pose of the camera in the target's frame."""
        x, y = scene.camera.normalised(np.asarray(self.image_px, dtype=np.float64))
        z = np.asarray(self.normal, dtype=np.float64)
        to_normal = _turn_of_z(z / np.linalg.norm(z))
        tilting = _about("z", self.azimuth) @ _about("y", self.tilt) @ _about("z", -self.azimuth)
        R = to_normal @ tilting @ _about("x", np.pi) @ _about("z", self.roll)
        return Pose(R, scene.markers.mean(axis=0) - R @ (self.distance * np.array([x, y, 1.0])))

    def value(self, ends: Ends, beside: Table, where: str) -> list[float] | None:
        """Joint coordinates (n,); None where they are out of reach or range."""
        if not (self.distance > 0.0 and np.any(self.normal)):
            raise ConfigurationError(f"{where}: distance must be positive and normal no zero vector")
        robot = ends.scene.robot
        if self.near is not None:
            near = robot.configuration(self.near, f"{where}: near")
        elif ends.q and ends.q[0] is not None:
            near = ends.q[0]
        else:
            bounded = np.isfinite(robot.q_min) & np.isfinite(robot.q_max)
            near = 0.5 * (np.where(bounded, robot.q_min, 0.0) + np.where(bounded, robot.q_max, 0.0))
        q = inverse_kinematics(robot, tip_of(ends.scene, self.camera(ends.scene)), near)
        return None if q is None else q.tolist()


@dataclass(frozen=True)
class TipPath(Placement):
    """A point in space beside the straight line from where the tip starts to where it is at a goal.

    Attributes
    ----------
    share
        How much of the line lies before it, from 0 to 1.
    aside
        What is added in the base frame [m].
    after
        When what moves is there [s]; the value is where it begins.
    goal
        Number of the goal, counted from 1.
    link
        Link of the robot instead of the tip.
    """

    name: ClassVar[str] = "tip-path"

    share: float
    aside: Vector3 = (0.0, 0.0, 0.0)
    after: float = 0.0
    goal: int = 1
    link: str = "tip"

    def value(self, ends: Ends, beside: Table, where: str) -> list[float] | None:
        """The point (3,) in the base frame [m]."""
        first, last = (ends.scene.robot.pose(q, self.link).t for q in ends.pair(self.goal, where))
        return _begun(first + self.share * (last - first) + self.aside, self.after, beside)


@dataclass(frozen=True)
class MarkerPath(Placement):
    """A point in the image beside the straight line from where a marker is first to where it is at a goal.

    Attributes
    ----------
    share, after, goal
        As of :class:`TipPath`.
    marker
        Number of the marker, counted from 1.
    aside
        What is added [px].
    """

    name: ClassVar[str] = "marker-path"

    share: float
    marker: int = 1
    aside: Vector2 = (0.0, 0.0)
    after: float = 0.0
    goal: int = 1

    def value(self, ends: Ends, beside: Table, where: str) -> list[float] | None:
        """The point (2,) in the image [px]."""
        scene, count = ends.scene, len(ends.scene.markers)
        if not 1 <= self.marker <= count:
            raise ConfigurationError(f"{where}: there is no marker {self.marker}; there are {count}")
        pair = ends.pair(self.goal, where)
        first, last = (scene.project(scene.camera_pose(q))[self.marker - 1] for q in pair)
        return _begun(first + self.share * (last - first) + self.aside, self.after, beside)


@dataclass(frozen=True)
class JointPath(Placement):
    """Joint coordinates beyond all those of the start and of a goal; of the ``joints`` that stand beside, or of all.

    Attributes
    ----------
    beyond
        How far above the greatest where positive, below the least where negative [rad or m]; one or one per joint.
    goal
        As of :class:`TipPath`.
    """

    name: ClassVar[str] = "joint-path"

    beyond: float | Sequence[float]
    goal: int = 1

    def value(self, ends: Ends, beside: Table, where: str) -> list[float] | None:
        """Limits, one for each of the joints [rad or m]."""
        robot, both = ends.scene.robot, np.stack(ends.pair(self.goal, where))
        numbers = checked(beside.get("joints", list(range(1, robot.n + 1))), list[int], where, "joints")
        if not set(numbers) <= set(range(1, robot.n + 1)):
            raise ConfigurationError(f"{where}: joints are numbers from 1 to {robot.n}, not {numbers}")
        if np.size(self.beyond) not in (1, len(numbers)):
            raise ConfigurationError(f"{where}: beyond is one number, or one for each of {len(numbers)} joints")
        at, beyond = both[:, np.array(numbers) - 1], np.asarray(self.beyond)
        values: list[float] = np.where(beyond > 0.0, at.max(axis=0) + beyond, at.min(axis=0) + beyond).tolist()
        return values


PLACEMENTS: Mapping[str, type[Placement]] = {kind.name: kind for kind in (LookAt, TipPath, MarkerPath, JointPath)}
"""All of them, by the key of their tables."""


def inverse_kinematics(robot: Robot, tip: Pose, near: Array) -> Array | None:
    """Joint coordinates (n,) at which the tip is there, found from ``near`` (n,); None if that finds none in range.

    Steps of Levenberg and Marquardt on the logarithm of the pose's error, each clipped to the joints' ranges:
    δq = (JᵀJ + μ I)⁻¹ Jᵀ e with μ falling to zero with ‖e‖² (Sugihara, IEEE Trans. Robotics 27, 2011).
    """
    model, frame = robot.model, robot.frame_id("tip")
    data, wanted, eye = model.createData(), pin.SE3(tip.R, tip.t), np.eye(robot.n)
    q = np.clip(near, robot.q_min, robot.q_max)
    for _ in range(MAX_STEPS):
        pin.computeJointJacobians(model, data, q)
        there = pin.updateFramePlacement(model, data, frame).actInv(wanted)
        error = pin.log6(there).vector
        squared = float(error @ error)
        if squared <= POSE_TOLERANCE**2:
            return np.asarray(q)
        J = pin.Jlog6(there.inverse()) @ pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL)
        step = np.linalg.solve(J.T @ J + (DAMPING * squared + 1e-12) * eye, J.T @ error)
        q = np.clip(q + step / max(1.0, np.abs(step).max() / MAX_STEP), robot.q_min, robot.q_max)
    return None


def tip_of(scene: Scene, camera: Pose) -> Pose:
    """Pose of the tip in the base frame at which the camera has a pose in the target's frame, at t = 0."""
    fixed = scene.camera.fixed
    return camera @ scene.camera.mount if fixed is None else fixed @ camera.inverse


def _begun(point: Array, after: float, beside: Table) -> list[float]:
    """Where a thing with the motion that its table states must begin so as to be at a point after a time."""
    motion = beside.get("motion")
    if after and motion is not None:
        point = point - made(Motion, motion, "motion").displacement(after)
    return [float(x) for x in point]


def _about(axis: str, angle: float) -> Array:
    """Rotation about an axis of coordinates."""
    return np.asarray(pin.utils.rotate(axis, angle))


def _turn_of_z(direction: Array) -> Array:
    """The shortest rotation of the z axis into a direction (3,); about x where that is opposite."""
    z = np.array([0.0, 0.0, 1.0])
    if direction[2] < -1.0 + 1e-12:
        return _about("x", np.pi)
    return np.asarray(pin.Quaternion.FromTwoVectors(z, direction).matrix())
