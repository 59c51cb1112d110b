"""Camera and goals from the tables of a scenario.

The camera is described by its keys or by a calibration file.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, make_dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np

from ..errors import CalibrationWarning, ConfigurationError, InvalidInput, SceneError, format_value
from ..robots.geometry import Pose, Vector2, Vector3
from ..simulation.sensing import shown_to
from ..simulation.units import unit_warnings_at
from ..vision.camera import Camera
from ..vision.features import Goal, MinimumJerk
from ..vision.scene import MINIMUM_DEPTH, Scene
from .reading import Table, from_table, parameters, require_known, require_table
from .toml import PLACES

Vector4 = Annotated[Sequence[float], msgspec.Meta(min_length=4, max_length=4)]
#: A 4 × 4 matrix as four rows.
Matrix4 = Annotated[Sequence[Vector4], msgspec.Meta(min_length=4, max_length=4)]
#: Keys that a calibration file replaces; the image size may be given in addition, as a check.
CALIBRATED = ("focal_px", "principal_point_px", "distortion")
#: Arguments of :meth:`.mounted` that the short names of a camera's place stand for.
SHORT = {"mount": "tip_in_camera", "fixed": "camera_in_base"}
#: Keys of a camera's table that state its place; one of them is allowed: see :meth:`.mounted`.
Places = make_dataclass("Places", [(key, Table | None, None) for key in PLACES])


def pose_from(
    xyz: Vector3 = (0.0, 0.0, 0.0),
    rpy: Vector3 | None = None,
    quaternion_wxyz: Vector4 | None = None,
    quaternion_xyzw: Vector4 | None = None,
    rotation_vector: Vector3 | None = None,
    matrix: Matrix4 | None = None,
    file: Path | None = None,
) -> Pose | Path:
    """Return a pose, or the path of a hand–eye calibration file that holds it.

    The default is the identity. Raises InvalidInput if the rotation is given twice, if a
    translation is given beside a file or matrix, or if ``rpy`` is too large to be in radians.
    """
    turns = [
        turn
        for turn in (rpy, quaternion_wxyz, quaternion_xyzw, rotation_vector, matrix, file)
        if turn is not None
    ]
    if len(turns) > 1:
        raise InvalidInput(
            "a pose needs exactly one of rpy, quaternion_wxyz, quaternion_xyzw, "
            "rotation_vector, matrix and file"
        )
    for name, whole in (("file", file), ("matrix", matrix)):
        if whole is not None and any(xyz):
            raise InvalidInput(
                f"a pose with {name} must not have xyz: the {name} contains the translation"
            )
    if file is not None:
        return file
    if matrix is not None:
        return Pose.from_matrix(matrix)
    if quaternion_wxyz is not None or quaternion_xyzw is not None:
        return Pose.from_quaternion(xyz, wxyz=quaternion_wxyz, xyzw=quaternion_xyzw)
    if rotation_vector is not None:
        return Pose.from_rotation_vector(xyz, rotation_vector)
    if rpy is not None and max(map(abs, rpy)) > 2.0 * math.pi:
        raise InvalidInput(
            f"rpy are radians, up to a turn (6.283), not {format_value(list(rpy))}: are these "
            f"degrees?"
        )
    return Pose.from_xyz_rpy(xyz, rpy or (0.0, 0.0, 0.0))


def without_replaced(under: Table, over: Table) -> Table:
    """Return a camera's table without the keys that ``over`` replaces by equivalent ones."""
    replaced: set[str] = set()
    if over.keys() & set(PLACES):
        replaced.update(PLACES)
    if "calibration" in over:
        replaced |= {*CALIBRATED, "size_px"}
    if over.keys() & set(CALIBRATED):
        replaced |= {"calibration", "distortion_model"}
    return {key: value for key, value in under.items() if key not in replaced or key in over}


def make_camera(table: Table, where: str, folder: Path) -> Camera:
    """Return the camera that a table describes; paths in it are relative to ``folder``.

    Raises ConfigurationError or InvalidInput, which name the key or value, for unknown keys and
    unusable values.
    """
    values = require_table(table, where)
    keys = {**parameters(Camera), **parameters(Camera.from_calibration), **parameters(Places)}
    require_known(values, keys, where)
    poses: dict[str, Any] = {key: values.pop(key) for key in PLACES if key in values}
    if len(poses) > 1:
        raise ConfigurationError(
            f"{where}: give only one key for the camera's pose, not {' and '.join(poses)}"
        )
    if "calibration" in values:
        twice = [key for key in CALIBRATED if key in values]
        if twice:
            raise ConfigurationError(
                f"{where}: the calibration already states {' and '.join(twice)}: give it in one "
                "place"
            )
        # these warnings are shown at the start of every run
        with warnings.catch_warnings(action="ignore", category=CalibrationWarning):
            camera = from_table(Camera.from_calibration, values, where, {"folder": folder})
    else:
        camera = from_table(Camera, values, where)
    for key, pose in poses.items():
        try:
            place = from_table(pose_from, pose, f"{where}.{key}", {"folder": folder})
            with warnings.catch_warnings(action="ignore", category=CalibrationWarning):
                camera = camera.mounted(**{SHORT.get(key, key): place})
        except InvalidInput as error:
            raise ConfigurationError(f"{where}.{key}: {error}") from error
    return camera


@dataclass(frozen=True)
class GoalTable:
    """Keys of a goal; one of ``camera_at_q``, ``camera_pose`` and ``markers_px`` is required."""

    from_time: float = 0.0
    reach_in: float | None = None
    camera_at_q: Sequence[float] | None = None
    camera_pose: Table | None = None
    markers_px: Sequence[Vector2] | None = None
    depth_m: Sequence[float] | None = None
    tolerance_factor: float = 1.0


def make_goal(table: object, where: str, scene: Scene, believed: Camera) -> Goal:
    """Return a goal as the controller knows it.

    The pixels are those of the real camera; they are normalised with the believed camera.
    """
    goal = from_table(GoalTable, table, where)
    factor = goal.tolerance_factor
    q = None
    camera = None
    depth = None
    if not (np.isfinite(factor) and factor > 0.0):
        raise ConfigurationError(f"{where}: tolerance_factor must be positive, not {factor}")
    kinds = [
        key
        for key in ("camera_at_q", "camera_pose", "markers_px")
        if getattr(goal, key) is not None
    ]
    if len(kinds) != 1:
        raise ConfigurationError(
            f"{where} needs one of camera_at_q, camera_pose and markers_px; it has "
            f"{kinds or 'none'}"
        )
    reference = None if goal.reach_in is None else MinimumJerk(goal.reach_in)
    if goal.markers_px is not None:
        m = len(scene.markers)
        depth = None if goal.depth_m is None else np.array(goal.depth_m)
        if len(goal.markers_px) != m:
            raise ConfigurationError(
                f"{where}: markers_px must be {m} × 2 numbers, not {format_value(goal.markers_px)}"
            )
        if depth is not None and len(depth) != m:
            raise ConfigurationError(
                f"{where}: depth_m must be {m} numbers, not {format_value(goal.depth_m)}"
            )
        if depth is not None and (depth < MINIMUM_DEPTH).any():
            raise ConfigurationError(
                f"{where}: depth_m must be at least {MINIMUM_DEPTH} m, not {depth}"
            )
        try:
            pixels = scene.camera.undistort(np.array(goal.markers_px))
        except InvalidInput as error:
            raise ConfigurationError(f"{where}: markers_px: {error}") from error
    elif goal.depth_m is not None:
        raise ConfigurationError(f"{where}: depth_m needs markers_px, but {kinds[0]} is given")
    else:
        if goal.camera_pose is not None:
            camera = from_table(Pose.from_xyz_rpy, goal.camera_pose, f"{where}.camera_pose")
        else:
            q = scene.robot.configuration(goal.camera_at_q, f"{where}: camera_at_q")
            camera = scene.camera_pose(q)
        try:
            pixels = scene.project(camera)
            depth = scene.depth(camera)
        except SceneError as error:
            configuration = np.zeros(scene.robot.n) if q is None else q
            doubts = "".join(
                f"; {doubt}" for doubt in unit_warnings_at(scene, "camera_at_q", configuration)
            )
            raise ConfigurationError(f"{where}: at the goal, {error}{doubts}") from error
    return Goal(
        goal.from_time,
        pixels,
        shown_to(scene.camera, believed, pixels),
        camera,
        depth,
        reference,
        q,
        factor,
    )
