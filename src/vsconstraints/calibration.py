"""Calibration files of cameras: OpenCV's (``cv::FileStorage``) and ROS's (camera_info), both YAML.

OpenCV is not needed to read them. Both count pixels by their centres; :class:`vsconstraints.camera.Camera` counts their
edges, half a pixel more.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .distortion import Distortion
from .errors import ConfigurationError, InvalidInput, shown, unknown_name
from .geometry import Vector2
from .rows import Array

ROS_MODELS = {"plumb_bob": "brown-conrady", "rational_polynomial": "brown-conrady", "equidistant": "fisheye"}
"""Values of ``distortion_model``, and what they are called here."""

NAMES = {
    "width": ("image_width", "width"),
    "height": ("image_height", "height"),
    "K": ("camera_matrix", "K", "k"),
    "D": ("distortion_coefficients", "D", "d"),
}
"""What is read, by its keys in files of OpenCV and ROS, and in a message of ROS as ``topic echo`` prints it."""


@dataclass(frozen=True)
class Calibration:
    """What a calibration file says of a camera.

    Attributes
    ----------
    size_px
        (W, H) of the images that it was calibrated with.
    focal_px
        (F_u, F_v).
    principal_point_px
        From the top left corner, counted by pixels' edges.
    distortion
        None if the file has no coefficients, or only zeros.
    """

    size_px: tuple[float, float]
    focal_px: tuple[float, float]
    principal_point_px: tuple[float, float]
    distortion: Distortion | None


def read_calibration(path: str | Path, model: str | None = None, size: Vector2 | None = None) -> Calibration:
    """What a file of OpenCV or ROS says.

    Where a file does not say how large images were, as those of OpenCV's stereo sample do not, they are of this
    ``size`` (2,) [px].

    Where a file says neither ``distortion_model``, as ROS's do, nor ``fisheye_model``, as those of OpenCV's sample
    do, its lens is of this ``model`` of :class:`vsconstraints.distortion.Distortion`: Brown and Conrady's if it is
    None, as ROS has it.

    ROS's rectification and projection matrices are not used: they are about images that have been rectified.

    Raises
    ------
    ConfigurationError
        if the file cannot be read, lacks a key, has values that do not fit, is of another image size than it says, or
        of images of which the camera delivers a part, or fewer pixels.
    """
    where = os.fspath(path)
    table = _table(Path(path), where)
    size = _size(table, where, size)
    _demand_whole(table, size, where)
    K = _matrix(table, "K", where)
    if K.shape != (9,) or K[[1, 3, 6, 7]].any() or K[8] != 1.0 or (K[[0, 4]] <= 0.0).any():
        raise ConfigurationError(
            f"{where}: {_key(table, 'K', where)} must be [F_u, 0, c_x, 0, F_v, c_y, 0, 0, 1], not {shown(K.tolist())}"
        )
    principal_point = float(K[2]) + 0.5, float(K[5]) + 0.5
    if not all(0.0 < c < side for c, side in zip(principal_point, size, strict=True)):
        raise ConfigurationError(
            f"{where}: the principal point ({K[2]:g}, {K[5]:g}) lies outside an image of {size[0]:g} × {size[1]:g} px: "
            "is the matrix one for another image size?"
        )
    return Calibration(size, (float(K[0]), float(K[4])), principal_point, _distortion(table, where, model))


def _table(path: Path, where: str) -> Mapping[str, Any]:
    import yaml  # only where there is such a file

    try:
        text = path.read_text(encoding="utf-8")
        # OpenCV 3 and 4 begin with "%YAML:1.0", which no other reader takes; its matrices are tables
        lines = (line.replace("!!opencv-matrix", "") for line in text.splitlines() if not line.startswith("%YAML"))
        # a message that was printed ends with "---", after which comes nothing
        table = next((one for one in yaml.safe_load_all("\n".join(lines)) if one is not None), None)
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ConfigurationError(f"cannot read the calibration {where}: {error}") from error
    if not isinstance(table, Mapping):
        raise ConfigurationError(f"{where} is no calibration: it must be a table, not {shown(table)}")
    return table


def _key(table: Mapping[str, Any], what: str, where: str) -> str:
    """The key by which a file has something; raises ConfigurationError that names those it could have."""
    found = next((key for key in NAMES[what] if key in table), None)
    if found is None:
        raise ConfigurationError(
            f"{where}: the key {NAMES[what][0]!r} is missing; there are {', '.join(map(str, table))}"
            + (". Or say size_px = [WIDTH, HEIGHT] beside it" if what in ("width", "height") else "")
        )
    return found


def _size(table: Mapping[str, Any], where: str, told: Vector2 | None) -> tuple[float, float]:
    """(W, H) as the file has it, or else as it was told."""
    if told is not None and not any(key in table for what in ("width", "height") for key in NAMES[what]):
        return float(told[0]), float(told[1])
    return _number(table, "width", where), _number(table, "height", where)


def _demand_whole(table: Mapping[str, Any], size: tuple[float, float], where: str) -> None:
    """Raise ConfigurationError where ROS's camera delivers other images than it was calibrated with."""
    said = [f"{key} = {table[key]}" for key in ("binning_x", "binning_y") if table.get(key) not in (None, 0, 1)]
    part = table.get("roi")
    if isinstance(part, Mapping):
        whole = {"x_offset": 0, "y_offset": 0, "width": size[0], "height": size[1]}
        said += [f"roi.{key} = {part[key]}" for key in whole if part.get(key) not in (None, 0, whole[key])]
    if said:
        raise ConfigurationError(
            f"{where}: the camera delivers a part of the image that it was calibrated with, or fewer pixels "
            f"({', '.join(said)}): calibrate it as it is used"
        )


def _number(table: Mapping[str, Any], what: str, where: str) -> float:
    key = _key(table, what, where)
    value = table[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
        raise ConfigurationError(f"{where}: {key} must be a positive number, not {shown(value)}")
    return float(value)


def _matrix(table: Mapping[str, Any], what: str, where: str) -> Array:
    """(rows × columns,) the numbers of a matrix, or of a list."""
    key = _key(table, what, where)
    value = table[key]
    data = value.get("data") if isinstance(value, Mapping) else value
    try:
        numbers = np.array([] if data is None else data, dtype=np.float64).ravel()
        counts = [int(value[name]) for name in ("rows", "cols")] if isinstance(value, Mapping) else [len(numbers), 1]
    except (KeyError, TypeError, ValueError) as error:
        raise ConfigurationError(f"{where}: {key} must have rows, cols and data, not {shown(value)}") from error
    if len(numbers) != counts[0] * counts[1] or not np.isfinite(numbers).all():
        raise ConfigurationError(
            f"{where}: {key} must have {counts[0]} × {counts[1]} finite numbers, not {shown(numbers.tolist())}"
        )
    return numbers


def _distortion(table: Mapping[str, Any], where: str, told: str | None) -> Distortion | None:
    values = _matrix(table, "D", where)
    model = _model(table, where) or told or "brown-conrady"
    if told not in (None, model):
        raise ConfigurationError(f"{where} is of the distortion model {model}, not {told}")
    if model == "brown-conrady":
        if not values.any():
            return None
        # what follows is of thin prisms and tilted sensors
        if len(values) in (12, 14) and not values[8:].any():
            values = values[:8]
    try:
        return Distortion(model, values.tolist())  # type: ignore[arg-type]
    except InvalidInput as error:
        raise ConfigurationError(f"{where}: {error}") from error


def _model(table: Mapping[str, Any], where: str) -> str | None:
    """Which lens a file says that it is about; None if it does not say."""
    if "distortion_model" in table:
        name = table["distortion_model"]
        if name not in ROS_MODELS:
            raise unknown_name(f"distortion_model in {where}", str(name), ROS_MODELS)
        return ROS_MODELS[name]
    if "fisheye_model" in table:
        return "fisheye" if table["fisheye_model"] else "brown-conrady"
    return None
