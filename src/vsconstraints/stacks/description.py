"""A scenario as data for a stack, as the controller of a robot knows it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from ..constraints import Constraint, JointRange, JointSpeed
from ..robots.geometry import Pose
from ..robots.kinematics import RobotPoint
from ..rows import Array
from ..simulation.setup import Setup
from ..vision.scene import Scene
from .protocol import decode, encode
from .urdf import TIP, urdf_text

Data = dict[str, Any]  #: Part of the data that a stack gets before a run, by name.
#: Names of the lens models in OpenCV and ROS.
LENSES = {"brown-conrady": "plumb_bob", "fisheye": "equidistant"}
#: Types of the parameters of a constraint that a stack gets, and kinds of their arrays: flags,
#: real numbers and texts.
PLAIN = (bool, int, float, str, RobotPoint)
PLAIN_KINDS = "biufU"


def describe(setup: Setup, uses: Iterable[str]) -> Data:
    """Return the data before a run that a stack has declared, as JSON has them.

    ``uses`` are names of :data:`.USES`: :func:`.checked_declaration` refuses all others. Camera and
    target are those that the controller believes in. Limits that do not exist, and actuator limits
    that the controller does not know, are None.
    """
    scene = setup.sensor().believed
    data: Data = {"period": setup.Ts, "joints": scene.robot.joint_names}
    for name in uses:
        if name in SECTIONS:  # others are data in each period
            data |= SECTIONS[name](setup, scene)
    # a stack in this process gets the same lists and None as one in another process, and copies of
    # the scene's arrays
    plain: Data = decode(encode(data))
    return plain


def joint_limits(setup: Setup) -> tuple[Array, Array, Array]:
    """Return the lower and upper ends (n,) of the joints' ranges, and their greatest speeds (n,).

    They are those of the robot, and those of the rows of ranges and speeds where these are
    narrower, with their margins.
    """
    lower, upper, speed = setup.scene.robot.ranges
    for constraint in setup.constraints.constraints:
        if not isinstance(constraint, JointRange | JointSpeed):
            continue
        at = np.array(constraint.joints) - 1
        if isinstance(constraint, JointRange):
            inwards = 0.5 * constraint.margin * (constraint.upper - constraint.lower)
            from_below = constraint.lower + inwards
            from_above = constraint.upper - inwards
            lower[at] = np.maximum(lower[at], from_below)
            upper[at] = np.minimum(upper[at], from_above)
        else:
            slower = np.minimum(constraint.upper, -constraint.lower)
            speed[at] = np.minimum(speed[at], (1.0 - constraint.margin) * slower)
    return lower, upper, speed


def _urdf(setup: Setup, scene: Scene) -> Data:
    return {"urdf": urdf_text(scene.robot, joint_limits(setup)), "tip": TIP}


def _limits(setup: Setup, scene: Scene) -> Data:
    lower, upper, speed = joint_limits(setup)
    limits = {
        "lower": lower,
        "upper": upper,
        "velocity": speed,
        "acceleration": _known_limit(setup, "acceleration"),
        "jerk": _known_limit(setup, "jerk"),
    }
    return {"limits": limits}


def _known_limit(setup: Setup, name: str) -> Array | None:
    """Return an actuator limit (n,); None if the controller does not know it, or there is none."""
    limit = setup.known_limits.of_joint(name, setup.scene.robot.n)
    return limit if np.isfinite(limit).any() else None


def _camera(setup: Setup, scene: Scene) -> Data:
    camera = scene.camera
    centre = camera.to_corner(camera.offset, "centres")
    described = {
        "size": np.array(camera.size, dtype=np.float64),
        "intrinsics": np.concatenate((camera.focal, centre)),
        "distortion": {"model": "none", "coefficients": ()},
    }
    lens = camera.distortion
    if lens is not None:
        coefficients = np.array(lens.coefficients, dtype=np.float64)
        described["distortion"] = {"model": LENSES[lens.model], "coefficients": coefficients}
    if camera.fixed is None:
        described["camera_in_tip"] = matrix(camera.mount.inverse)
    else:
        described["camera_in_base"] = matrix(camera.fixed)
    return {"camera": described}


def _target(setup: Setup, scene: Scene) -> Data:
    frame = "base" if scene.camera.fixed is None else TIP
    moves = scene.motion is not None
    return {"target": {"markers": scene.markers, "frame": frame, "moves": moves}}


def _goals(setup: Setup, scene: Scene) -> Data:
    camera = scene.camera
    goals = []
    for goal in setup.task.goals:
        described = {
            "from": float(goal.from_time),
            "pixels": camera.to_corner(camera.distort(goal.pixels), "centres"),
            "camera_in_target": None if goal.camera is None else matrix(goal.camera),
        }
        goals.append(described)
    return {"feature": setup.task.feature.name, "goals": goals}


def _constraints(setup: Setup, scene: Scene) -> Data:
    constraints = setup.constraints.constraints
    return {"constraints": [_constraint(constraint, setup.scene) for constraint in constraints]}


def _constraint(constraint: Constraint, scene: Scene) -> Data:
    """Return kind, labels, unit and all public numbers, texts, arrays and lists of a constraint."""
    labels = constraint.labels(scene)
    described: Data = {
        "kind": constraint.kind,
        "labels": labels,
        "unit": constraint.unit,
    }
    for name, value in vars(constraint).items():
        if not name.startswith("_") and _is_plain(value):
            described[name] = value
    return described


def _is_plain(value: Any) -> bool:
    """Return True if a value is a number, text, array or point, or a list of these and None."""
    if isinstance(value, list | tuple):
        return all(entry is None or _is_plain(entry) for entry in value)
    if isinstance(value, np.ndarray | np.generic):
        return value.dtype.kind in PLAIN_KINDS
    return isinstance(value, PLAIN)


SECTIONS: dict[str, Callable[[Setup, Scene], Data]] = {
    "urdf": _urdf,
    "limits": _limits,
    "camera": _camera,
    "target": _target,
    "goals": _goals,
    "constraints": _constraints,
}


def matrix(pose: Pose) -> Array:
    """Return the homogeneous matrix (4, 4) of a pose."""
    homogeneous = np.eye(4)
    homogeneous[:3, :3] = pose.R
    homogeneous[:3, 3] = pose.t
    return homogeneous
