"""A scenario as data for a stack, as the controller of a robot knows it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from ..constraints import Constraint, JointRange, JointSpeed
from ..robots.geometry import Pose
from ..rows import Array
from ..simulation.setup import Setup
from ..vision.camera import Camera
from ..vision.scene import Scene
from .urdf import TIP, urdf_text

#: Names of the lens models in OpenCV and ROS.
LENSES = {"brown-conrady": "plumb_bob", "fisheye": "equidistant"}


def describe(setup: Setup, uses: Iterable[str]) -> dict[str, Any]:
    """Return the data before a run that a stack has declared, as lists, numbers and texts.

    Camera and target are those that the controller believes in. Limits that do not exist, and
    actuator limits that the controller does not know, are None.
    """
    scene = setup.sensor().believed
    data: dict[str, Any] = {"period": setup.Ts, "joints": list(scene.robot.joint_names)}
    for name in uses:
        if name in SECTIONS:
            data |= SECTIONS[name](setup, scene)
    return data


def joint_limits(setup: Setup) -> tuple[Array, Array, Array]:
    """Return the lower and upper ends (n,) of the joints' ranges, and their greatest speeds (n,).

    They are those of the robot, and those of the rows of ranges and speeds where these are
    narrower, with their margins.
    """
    lower, upper, speed = setup.scene.robot.ranges
    for constraint in setup.constraints.constraints:
        if isinstance(constraint, JointRange):
            at = np.array(constraint.joints) - 1
            inwards = 0.5 * constraint.margin * (constraint.upper - constraint.lower)
            lower[at] = np.maximum(lower[at], constraint.lower + inwards)
            upper[at] = np.minimum(upper[at], constraint.upper - inwards)
        elif isinstance(constraint, JointSpeed):
            at = np.array(constraint.joints) - 1
            slower = np.minimum(constraint.upper, -constraint.lower)
            speed[at] = np.minimum(speed[at], (1.0 - constraint.margin) * slower)
    return lower, upper, speed


def _urdf(setup: Setup, scene: Scene) -> dict[str, Any]:
    return {"urdf": urdf_text(scene.robot, joint_limits(setup)), "tip": TIP}


def _limits(setup: Setup, scene: Scene) -> dict[str, Any]:
    lower, upper, speed = joint_limits(setup)
    known: dict[str, Any] = {"acceleration": None, "jerk": None}
    if setup.limits.known:
        for name in known:
            limit = setup.limits.of_joint(name, len(speed))
            known[name] = None if np.isinf(limit).all() else plain(limit)
    return {
        "limits": {
            "lower": plain(lower),
            "upper": plain(upper),
            "velocity": plain(speed),
            **known,
        }
    }


def _camera(setup: Setup, scene: Scene) -> dict[str, Any]:
    camera = scene.camera
    centre = camera.to_corner(camera.offset, "centres")
    lens = camera.distortion
    distortion = {
        "model": "none" if lens is None else LENSES[lens.model],
        "coefficients": [] if lens is None else list(map(float, lens.coefficients)),
    }
    place = (
        {"camera_in_tip": matrix(camera.mount.inverse)}
        if camera.fixed is None
        else {"camera_in_base": matrix(camera.fixed)}
    )
    intrinsics = [*map(float, camera.focal), *map(float, centre)]
    size = list(map(float, camera.size))
    return {"camera": {"size": size, "intrinsics": intrinsics, "distortion": distortion, **place}}


def _target(setup: Setup, scene: Scene) -> dict[str, Any]:
    frame = "base" if scene.camera.fixed is None else TIP
    moves = scene.motion is not None
    return {"target": {"markers": scene.markers.tolist(), "frame": frame, "moves": moves}}


def _goals(setup: Setup, scene: Scene) -> dict[str, Any]:
    goals = [
        {
            "from": float(goal.from_time),
            "pixels": sensor_pixels(scene.camera, goal.pixels).tolist(),
            "camera_in_target": None if goal.camera is None else matrix(goal.camera),
        }
        for goal in setup.task.goals
    ]
    return {"feature": setup.task.feature.name, "goals": goals}


def _constraints(setup: Setup, scene: Scene) -> dict[str, Any]:
    constraints = setup.constraints.constraints
    return {"constraints": [_constraint(constraint, setup.scene) for constraint in constraints]}


def _constraint(constraint: Constraint, scene: Scene) -> dict[str, Any]:
    """Return kind, labels, unit and all public numbers, texts and arrays of a constraint."""
    data = {name: plain(value) for name, value in vars(constraint).items() if name[0] != "_"}
    known = {name: value for name, value in data.items() if value is not None}
    labels = list(constraint.labels(scene))
    return {"kind": constraint.kind, "labels": labels, "unit": constraint.unit, **known}


SECTIONS: dict[str, Callable[[Setup, Scene], dict[str, Any]]] = {
    "urdf": _urdf,
    "limits": _limits,
    "camera": _camera,
    "target": _target,
    "goals": _goals,
    "constraints": _constraints,
}


def sensor_pixels(camera: Camera, ideal: Array) -> Array:
    """Return pixels as OpenCV counts them of ideal pixels from the image centre, (M, 2) each."""
    return camera.to_corner(camera.distort(ideal), "centres")


def matrix(pose: Pose) -> list[list[float]]:
    """Return the homogeneous matrix (4, 4) of a pose as nested lists."""
    homogeneous = np.eye(4)
    homogeneous[:3, :3] = pose.R
    homogeneous[:3, 3] = pose.t
    listed: list[list[float]] = homogeneous.tolist()
    return listed


def plain(value: object) -> Any:
    """Return a number, text, array or sequence as plain data; None for others and infinity."""
    if isinstance(value, np.ndarray | tuple | list):
        return [plain(each) for each in np.asarray(value, dtype=object).tolist()]
    if isinstance(value, bool | str | int):
        return value
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return None
