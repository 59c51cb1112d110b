"""Values that follow from the rest of a scene: configurations, path points and joint limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ...errors import ConfigurationError
from ...robots.geometry import Pose, Vector2, Vector3
from ...rows import Array
from ...scenarios.inverse_kinematics import inverse_kinematics, tip_of
from ...scenarios.reading import Table, checked, from_table
from ...vision.motion import Motion
from ...vision.scene import Scene


class Ends(NamedTuple):
    """A scene without task and constraints, with the configurations at its start and goals.

    Each entry of ``q`` is (n,), or None for a goal that is given by its image only.
    """

    scene: Scene
    q: Sequence[Array | None]

    def pair(self, goal: int, where: str) -> tuple[Array, Array]:
        """Return the configurations at the start and at a goal, counted from 1.

        Raises ConfigurationError if either is unknown.
        """
        if not 1 <= goal < len(self.q):
            raise ConfigurationError(
                f"{where}: there is no goal {goal}; there are {len(self.q) - 1}"
            )
        start = self.q[0]
        end = self.q[goal]
        if start is None or end is None:
            raise ConfigurationError(
                f"{where}: goal {goal} is not a pose, so the path to it is unknown"
            )
        return start, end


class Place(NamedTuple):
    """Context of a placement.

    It holds the ends that are placed already, the table that contains the value, and the dotted
    key.
    """

    ends: Ends
    beside: Table
    where: str

    def begun(self, point: Array, after: float) -> list[float]:
        """Return the initial position of an object that is at a point after a time.

        The object moves as its table states.
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
    """Return a configuration (n,) at which the camera looks at the target; None if out of reach.

    ``distance`` is the depth of the markers' mean [m], which is seen at ``image_px`` from the image
    centre [px]. The optical axis is tilted by ``tilt`` from the ``normal``, which points to the
    camera in the target's frame. ``azimuth`` is the direction of the tilt about the normal;
    ``roll`` is about the optical axis [rad]. Inverse kinematics starts at ``near`` (n,); by default
    it starts at the configuration of the start for goals, and in the middle of the ranges
    otherwise.
    """
    ends = place.ends
    scene = ends.scene
    robot = scene.robot
    if not (distance > 0.0 and np.any(normal)):
        raise ConfigurationError(
            f"{place.where}: distance must be positive and normal must not be zero"
        )
    start = ends.q[0] if ends.q else None
    if near is not None:
        begin = robot.configuration(near, f"{place.where}: near")
    elif start is not None:
        begin = start
    else:
        bounded = np.isfinite(robot.q_min) & np.isfinite(robot.q_max)
        least = np.where(bounded, robot.q_min, 0.0)
        greatest = np.where(bounded, robot.q_max, 0.0)
        begin = 0.5 * (least + greatest)
    z = np.asarray(normal, dtype=np.float64)
    along_normal = _turn_of_z(z / np.linalg.norm(z))
    tilting = _about("z", azimuth) @ _about("y", tilt) @ _about("z", -azimuth)
    # the optical axis points to the target, against the normal
    rotation = along_normal @ tilting @ _about("x", np.pi) @ _about("z", roll)
    pixel = np.asarray(image_px, dtype=np.float64)
    x, y = scene.camera.normalised(pixel)
    from_camera = distance * np.array([x, y, 1.0])
    target = scene.markers.mean(axis=0)
    camera = Pose(rotation, target - rotation @ from_camera)
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
    """Return a point (3,) in the base frame [m] beside the straight path of the tip to a goal.

    The line runs from the tip's position at the start to that at the goal. The point lies at
    ``share`` of the line, plus ``aside`` [m]. An object that moves as its table states is there
    ``after`` a time [s]; the returned value is its initial position. Goals are counted from 1. A
    ``link`` may replace the tip.
    """
    robot = place.ends.scene.robot
    start, end = place.ends.pair(goal, place.where)
    first = robot.pose(start, link).t
    last = robot.pose(end, link).t
    return place.begun(first + share * (last - first) + aside, after)


def marker_path(
    place: Place,
    share: float,
    marker: int = 1,
    aside: Vector2 = (0.0, 0.0),
    after: float = 0.0,
    goal: int = 1,
) -> list[float]:
    """Return a point (2,) in the image [px] beside the straight path of a marker to a goal.

    The line runs from the marker's pixel at the start to that at the goal. Markers are counted from
    1. The other arguments are those of :func:`tip_path`, with ``aside`` in px.
    """
    scene = place.ends.scene
    count = len(scene.markers)
    if not 1 <= marker <= count:
        raise ConfigurationError(f"{place.where}: there is no marker {marker}; there are {count}")
    start, end = place.ends.pair(goal, place.where)
    first = scene.project(scene.camera_pose(start))[marker - 1]
    last = scene.project(scene.camera_pose(end))[marker - 1]
    return place.begun(first + share * (last - first) + aside, after)


def joint_path(place: Place, beyond: float | Sequence[float], goal: int = 1) -> list[float]:
    """Return joint limits [rad or m] that lie beyond the positions at the start and at a goal.

    There is one limit for each of the ``joints`` in the same table, or for all joints. A positive
    ``beyond`` is added to the larger position, a negative one to the smaller position; it is one
    number, or one per joint.
    """
    robot = place.ends.scene.robot
    both = np.stack(place.ends.pair(goal, place.where))
    all_joints = list(range(1, robot.n + 1))
    stated = place.beside.get("joints", all_joints)
    joints = checked(stated, list[int], place.where, "joints")
    if not set(joints) <= set(all_joints):
        raise ConfigurationError(
            f"{place.where}: joints are numbers from 1 to {robot.n}, not {joints}"
        )
    if np.size(beyond) not in (1, len(joints)):
        raise ConfigurationError(
            f"{place.where}: beyond is one number, or one for each of {len(joints)} joints"
        )
    positions = both[:, np.array(joints) - 1]
    distance = np.asarray(beyond)
    above = positions.max(axis=0) + distance
    below = positions.min(axis=0) + distance
    limits: list[float] = np.where(distance > 0.0, above, below).tolist()
    return limits


#: Placements by the key of their tables; they return None if no value is possible.
PLACEMENTS: Mapping[str, Callable[..., list[float] | None]] = {
    "look-at": look_at,
    "tip-path": tip_path,
    "marker-path": marker_path,
    "joint-path": joint_path,
}


def _about(axis: str, angle: float) -> Array:
    return np.asarray(pin.utils.rotate(axis, angle))


def _turn_of_z(direction: Array) -> Array:
    """Return the shortest rotation of the z axis into a direction (3,); about x if opposite."""
    z = np.array([0.0, 0.0, 1.0])
    if direction[2] < -1.0 + 1e-12:
        return _about("x", np.pi)
    return np.asarray(pin.Quaternion.FromTwoVectors(z, direction).matrix())
