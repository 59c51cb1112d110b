"""Values that follow from the rest of a scene: where a camera looks at the target, and what lies in
the way there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ...errors import ConfigurationError
from ...robots.geometry import Pose, Vector2, Vector3
from ...robots.robot import Robot
from ...rows import Array
from ...vision.motion import Motion
from ...vision.scene import Scene
from ..reading import Table, checked, from_table

POSE_TOLERANCE = 1e-9  #: error of a pose, ‖(m, rad)‖, that counts as none
MAX_STEPS = 60
#: of any joint [rad or m], so that the steps stay near where the linearisation holds
MAX_STEP = 0.5
#: share of the squared error by which singular directions are damped: none is left at the solution
DAMPING = 0.02


class Ends(NamedTuple):
    """A scene without task and constraints, and (n,) ``q`` at its start and goals; None of what is
    an image only.
    """

    scene: Scene
    q: Sequence[Array | None]

    def pair(self, goal: int, where: str) -> tuple[Array, Array]:
        """At the start and at a goal, counted from 1; raises ConfigurationError if that is not
        known.
        """
        if not 1 <= goal < len(self.q):
            raise ConfigurationError(
                f"{where}: there is no goal {goal}; there are {len(self.q) - 1}"
            )
        start = self.q[0]
        end = self.q[goal]
        if start is None or end is None:
            raise ConfigurationError(
                f"{where}: goal {goal} is no pose, so there is no way to it that is known"
            )
        return start, end


class Place(NamedTuple):
    """Where a value is placed: what is placed already, the table in which it stands, and its dotted
    key.
    """

    ends: Ends
    beside: Table
    where: str

    def begun(self, point: Array, after: float) -> list[float]:
        """Where a thing with the motion that its table states must begin so as to be at a point
        after a time.
        """
        motion = self.beside.get("motion")
        if after and motion is not None:
            point = point - from_table(Motion, motion, "motion").displacement(after)
        return [float(x) for x in point]


def look_at(
    place: Place,
    distance: float,
    tilt: float = 0.0,
    azimuth: float = 0.0,
    roll: float = 0.0,
    image_px: Vector2 = (0.0, 0.0),
    normal: Vector3 = (0.0, 0.0, 1.0),
    near: Sequence[float] | None = None,
) -> list[float] | None:
    """Joint coordinates (n,) at which the camera looks at the target, by inverse kinematics; None
    if out of reach.

    ``distance`` is the depth of the markers' middle [m], which is seen at ``image_px`` from the
    image's centre [px]. The optical axis is tilted by ``tilt`` from the ``normal``, which points to
    the camera in the target's frame; ``azimuth`` is where to, about the normal; ``roll`` is about
    the optical axis [rad]. Inverse kinematics begin ``near`` (n,); for goals at the start, if not
    said; else in the middle of the ranges.
    """
    scene = place.ends.scene
    robot = place.ends.scene.robot
    if not (distance > 0.0 and np.any(normal)):
        raise ConfigurationError(
            f"{place.where}: distance must be positive and normal no zero vector"
        )
    start = place.ends.q[0] if place.ends.q else None
    if near is not None:
        begin = robot.configuration(near, f"{place.where}: near")
    elif start is not None:
        begin = start
    else:
        bounded = np.isfinite(robot.q_min) & np.isfinite(robot.q_max)
        begin = 0.5 * (np.where(bounded, robot.q_min, 0.0) + np.where(bounded, robot.q_max, 0.0))
    x, y = scene.camera.normalised(np.asarray(image_px, dtype=np.float64))
    z = np.asarray(normal, dtype=np.float64)
    tilting = _about("z", azimuth) @ _about("y", tilt) @ _about("z", -azimuth)
    R = _turn_of_z(z / np.linalg.norm(z)) @ tilting @ _about("x", np.pi) @ _about("z", roll)
    camera = Pose(R, scene.markers.mean(axis=0) - R @ (distance * np.array([x, y, 1.0])))
    q = inverse_kinematics(robot, tip_of(scene, camera), begin)
    return None if q is None else q.tolist()


def tip_path(
    place: Place,
    share: float,
    aside: Vector3 = (0.0, 0.0, 0.0),
    after: float = 0.0,
    goal: int = 1,
    link: str = "tip",
) -> list[float]:
    """A point (3,) in the base frame [m] beside the straight line from where the tip starts to
    where it is at a goal.

    ``share`` of the line lies before it; ``aside`` [m] is added. What moves as the table says is
    there ``after`` a time [s]: the value is where it begins. Goals are counted from 1. A ``link``
    may stand for the tip.
    """
    first, last = (
        place.ends.scene.robot.pose(q, link).t for q in place.ends.pair(goal, place.where)
    )
    return place.begun(first + share * (last - first) + aside, after)


def marker_path(
    place: Place,
    share: float,
    marker: int = 1,
    aside: Vector2 = (0.0, 0.0),
    after: float = 0.0,
    goal: int = 1,
) -> list[float]:
    """A point (2,) in the image [px] beside the straight line from where a marker is first to where
    it is at a goal.

    Markers are counted from 1; the rest is as of :func:`tip_path`, with ``aside`` in px.
    """
    scene = place.ends.scene
    count = len(place.ends.scene.markers)
    if not 1 <= marker <= count:
        raise ConfigurationError(f"{place.where}: there is no marker {marker}; there are {count}")
    pair = place.ends.pair(goal, place.where)
    first, last = (scene.project(scene.camera_pose(q))[marker - 1] for q in pair)
    return place.begun(first + share * (last - first) + aside, after)


def joint_path(place: Place, beyond: float | Sequence[float], goal: int = 1) -> list[float]:
    """Limits [rad or m], one for each of the ``joints`` that stand beside, or of all, beyond the
    start and a goal.

    ``beyond`` is how far above the greatest where positive, below the least where negative: one, or
    one per joint.
    """
    robot = place.ends.scene.robot
    both = np.stack(place.ends.pair(goal, place.where))
    numbers = checked(
        place.beside.get("joints", list(range(1, robot.n + 1))), list[int], place.where, "joints"
    )
    if not set(numbers) <= set(range(1, robot.n + 1)):
        raise ConfigurationError(
            f"{place.where}: joints are numbers from 1 to {robot.n}, not {numbers}"
        )
    if np.size(beyond) not in (1, len(numbers)):
        raise ConfigurationError(
            f"{place.where}: beyond is one number, or one for each of {len(numbers)} joints"
        )
    at = both[:, np.array(numbers) - 1]
    far = np.asarray(beyond)
    values: list[float] = np.where(far > 0.0, at.max(axis=0) + far, at.min(axis=0) + far).tolist()
    return values


#: Values that follow from the rest of the scene, None where none is possible, by the key of their
#: tables.
PLACEMENTS: Mapping[str, Callable[..., list[float] | None]] = {
    "look-at": look_at,
    "tip-path": tip_path,
    "marker-path": marker_path,
    "joint-path": joint_path,
}


def inverse_kinematics(robot: Robot, tip: Pose, near: Array) -> Array | None:
    """Joint coordinates (n,) at which the tip is there, found from ``near`` (n,); None if that
    finds none in range.

    Steps of Levenberg and Marquardt on the logarithm of the pose's error, each clipped to the
    joints' ranges: δq = (JᵀJ + μ I)⁻¹ Jᵀ e with μ falling to zero with ‖e‖² (Sugihara, IEEE Trans.
    Robotics 27, 2011).
    """
    model = robot.model
    frame = robot.frame_id("tip")
    data = model.createData()
    wanted = pin.SE3(tip.R, tip.t)
    eye = np.eye(robot.n)
    q = np.clip(near, robot.q_min, robot.q_max)
    for _ in range(MAX_STEPS):
        pin.computeJointJacobians(model, data, q)
        there = pin.updateFramePlacement(model, data, frame).actInv(wanted)
        error = pin.log6(there).vector
        squared = float(error @ error)
        if squared <= POSE_TOLERANCE**2:
            return np.asarray(q)
        J = pin.Jlog6(there.inverse()) @ pin.getFrameJacobian(
            model, data, frame, pin.ReferenceFrame.LOCAL
        )
        step = np.linalg.solve(J.T @ J + (DAMPING * squared + 1e-12) * eye, J.T @ error)
        q = np.clip(q + step / max(1.0, np.abs(step).max() / MAX_STEP), robot.q_min, robot.q_max)
    return None


def tip_of(scene: Scene, camera: Pose) -> Pose:
    """Pose of the tip in the base frame at which the camera has a pose in the target's frame, at t
    = 0.
    """
    fixed = scene.camera.fixed
    return camera @ scene.camera.mount if fixed is None else fixed @ camera.inverse


def _about(axis: str, angle: float) -> Array:
    return np.asarray(pin.utils.rotate(axis, angle))


def _turn_of_z(direction: Array) -> Array:
    """The shortest rotation of the z axis into a direction (3,); about x where that is opposite."""
    z = np.array([0.0, 0.0, 1.0])
    if direction[2] < -1.0 + 1e-12:
        return _about("x", np.pi)
    return np.asarray(pin.Quaternion.FromTwoVectors(z, direction).matrix())
