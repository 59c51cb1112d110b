"""The camera of a scenario: from its keys or a calibration file, where it is mounted or fixed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec

from ..errors import ConfigurationError, InvalidInput, shown
from ..robots.geometry import Pose, Vector3
from ..vision.camera import Camera
from .reading import Table, demand_known, demand_table, made, parameters

Vector4 = Annotated[Sequence[float], msgspec.Meta(min_length=4, max_length=4)]
Matrix4 = Annotated[Sequence[Vector4], msgspec.Meta(min_length=4, max_length=4)]
"""Four numbers, and four rows of them."""

SAID = ("focal_px", "principal_point_px", "distortion")
"""Keys that a calibration file stands for; it says the size, too, which may be given to be checked."""


@dataclass(frozen=True)
class Places:
    """Keys of a camera's table of which one says where it is: see :meth:`.mounted`."""

    camera_in_tip: Table | None = None
    tip_in_camera: Table | None = None
    camera_in_base: Table | None = None
    base_in_camera: Table | None = None
    mount: Table | None = None
    fixed: Table | None = None


SAME = {"mount": "tip_in_camera", "fixed": "camera_in_base"}
"""Shorter words for two of them."""


def measured(
    xyz: Vector3 = (0.0, 0.0, 0.0),
    rpy: Vector3 | None = None,
    quaternion_wxyz: Vector4 | None = None,
    quaternion_xyzw: Vector4 | None = None,
    matrix: Matrix4 | None = None,
) -> Pose:
    """A pose; it says nothing where it changes nothing."""
    turns = [turn for turn in (rpy, quaternion_wxyz, quaternion_xyzw, matrix) if turn is not None]
    if len(turns) > 1:
        raise InvalidInput("a pose takes one of rpy, quaternion_wxyz, quaternion_xyzw and matrix")
    if matrix is not None:
        if any(xyz):
            raise InvalidInput("a pose takes xyz or matrix, which says the translation, too")
        return Pose.from_matrix(matrix)
    if quaternion_wxyz is not None or quaternion_xyzw is not None:
        return Pose.from_quaternion(xyz, wxyz=quaternion_wxyz, xyzw=quaternion_xyzw)
    if rpy is not None and max(map(abs, rpy)) > 2.0 * math.pi:
        raise InvalidInput(
            f"rpy are angles in radians, up to a turn (6.283), not {shown(list(rpy))}: are these degrees?"
        )
    return Pose.from_xyz_rpy(xyz, rpy or (0.0, 0.0, 0.0))


def not_said_again(under: Table, over: Table) -> Table:
    """A camera's table less what another one, which is laid over it, says in other words."""
    words: set[str] = set()
    if over.keys() & parameters(Places).keys():
        words |= parameters(Places).keys()
    if "calibration" in over:
        words |= {*SAID, "size_px"}
    if over.keys() & set(SAID):
        words |= {"calibration", "distortion_model"}
    return {key: value for key, value in under.items() if key not in words or key in over}


def make_camera(table: Table, where: str, folder: Path) -> Camera:
    """The camera that a table describes; paths in it are relative to ``folder``.

    Raises
    ------
    ConfigurationError, InvalidInput
        for unknown keys and unusable values; the message names them.
    """
    values = demand_table(table, where)
    places = parameters(Places)
    demand_known(values, {**parameters(Camera), **parameters(Camera.from_calibration), **places}, where)
    given: dict[str, Any] = {key: values.pop(key) for key in places if key in values}
    if given.keys() == {"mount", "fixed"}:
        raise ConfigurationError(
            f"{where}: a camera is mounted on the robot or fixed in space: give mount or fixed, not both"
        )
    if len(given) > 1:
        raise ConfigurationError(f"{where}: one key says where a camera is, not {' and '.join(given)}")
    if "calibration" in values:
        twice = [key for key in SAID if key in values]
        if twice:
            raise ConfigurationError(f"{where}: the calibration says {' and '.join(twice)}: give one of the two")
        camera: Camera = made(Camera.from_calibration, values, where, {"folder": folder})
    else:
        camera = made(Camera, values, where)
    for key, pose in given.items():
        try:
            place = made(measured, pose, f"{where}.{key}")
        except InvalidInput as error:
            raise ConfigurationError(f"{where}.{key}: {error}") from error
        camera = camera.mounted(**{SAME.get(key, key): place})
    return camera
