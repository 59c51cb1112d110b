"""Calibration files of cameras: OpenCV's (``cv::FileStorage``) and ROS's (camera_info), both YAML.

OpenCV is not needed to read them. Both count pixels by their centres; :class:`.Camera` counts their edges, half a pixel
more. Files come from anywhere: of YAML only tables, lists and texts are read, whatever their tags say, and within
bounds. Messages name file and place, and show none of what another file than a calibration may hold.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ConfigurationError, InvalidInput, shown, unknown_name
from ..robots.geometry import Vector2
from ..rows import Array
from .distortion import Distortion

#: Values of ``distortion_model``, and what they are called here.
ROS_MODELS = {"plumb_bob": "brown-conrady", "rational_polynomial": "brown-conrady", "equidistant": "fisheye"}
#: Values of ``fisheye_model``, likewise.
FISHEYE = {"0": "brown-conrady", "false": "brown-conrady", "1": "fisheye", "true": "fisheye"}
#: What is read, by its keys in files of OpenCV and ROS, and in a message of ROS as ``topic echo`` prints it.
NAMES = {
    "width": ("image_width", "width"),
    "height": ("image_height", "height"),
    "K": ("camera_matrix", "K", "k"),
    "D": ("distortion_coefficients", "D", "d"),
}
#: How large a file may be, and how deep it may be nested: a calibration with all its views is far below.
MAX_BYTES, MAX_DEPTH = 250_000, 10
MAX_SIDE = 1e5  #: Longest side of an image [px].
EMPTY = ("", "~", "null")  #: Texts that stand for nothing.
MAX_SHOWN = 30  #: Characters of a value that a message shows.
Calibrated = Mapping[str, Any]  #: The table of a file.


def read_calibration(path: str | Path, model: str | None = None, size: Vector2 | None = None) -> dict[str, Any]:
    """What a file of OpenCV or ROS says, as arguments of :class:`.Camera`; without distortion if that is zero.

    ``size`` (2,) [px] and ``model`` of :class:`.Distortion` are what holds where a file does not say how large images
    were, as those of OpenCV's stereo sample do not, nor ``distortion_model`` (ROS) or ``fisheye_model`` (OpenCV's
    sample); Brown and Conrady's if None, as ROS has it. ROS's rectification and projection matrices are not used: they
    are about images that have been rectified.

    Raises
    ------
    ConfigurationError
        if the file cannot be read, lacks a key, has values that do not fit, is of another image size than it says, or
        of images of which the camera delivers a part, or fewer pixels.
    """
    where = os.fspath(path)
    table = _table(Path(path), where)
    if size is not None and not any(key in table for what in ("width", "height") for key in NAMES[what]):
        side = float(size[0]), float(size[1])
    else:
        side = _number(table, "width", where), _number(table, "height", where)
    _demand_whole(table, side, where)
    K = _matrix(table, "K", where)
    if K.shape != (9,) or K[[1, 3, 6, 7]].any() or K[8] != 1.0 or (K[[0, 4]] <= 0.0).any():
        given = shown(K.tolist()) if K.shape == (9,) else f"{len(K)} numbers"
        raise ConfigurationError(
            f"{where}: {_key(table, 'K', where)} must be [F_u, 0, c_x, 0, F_v, c_y, 0, 0, 1], not {given}"
        )
    principal_point = float(K[2]) + 0.5, float(K[5]) + 0.5
    if not all(0.0 < c < length for c, length in zip(principal_point, side, strict=True)):
        raise ConfigurationError(
            f"{where}: the principal point ({K[2]:g}, {K[5]:g}) lies outside an image of {side[0]:g} × {side[1]:g} px: "
            "is the matrix one for another image size?"
        )
    distortion, focal = _distortion(table, where, model), (float(K[0]), float(K[4]))
    return {"size_px": side, "focal_px": focal, "principal_point_px": principal_point, "distortion": distortion}


def _table(path: Path, where: str) -> Calibrated:
    import yaml  # only where there is such a file

    loader = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
    try:
        text = _text(path)
        _demand_plain(yaml, yaml.parse(text, Loader=loader))
        # a message that was printed ends with "---", after which comes nothing
        table = next((document for document in yaml.load_all(text, Loader=loader) if document), None)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f", line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise ConfigurationError(f"cannot read the calibration {where}{place}: it is no YAML") from None
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"cannot read the calibration {where}: {error}") from error
    if not isinstance(table, Mapping):
        raise ConfigurationError(f"{where} is no calibration: it must be a table")
    return table


def _text(path: Path) -> str:
    """A file without the line that begins those of OpenCV 3 and 4, ``%YAML:1.0``, which no other reader takes."""
    if path.exists() and not path.is_file():
        raise ValueError("it is no file")
    with path.open("rb") as file:
        data = file.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        raise ValueError(f"it is larger than {MAX_BYTES} bytes")
    return re.sub(r"(?m)^%YAML.*$", "", data.decode("utf-8"))


def _demand_plain(yaml: Any, events: Iterator[Any]) -> None:
    """Raise ValueError for deep nesting, a key that is there twice, and aliases, by which a small file can be huge."""
    depth, nodes, keys = 0, 0, set[str]()
    for event in events:
        place = f"line {event.start_mark.line + 1}"
        if isinstance(event, yaml.DocumentStartEvent):
            nodes, keys = 0, set()
        elif isinstance(event, yaml.AliasEvent):
            raise ValueError(f"{place} has an alias (*), which no calibration needs")
        elif isinstance(event, yaml.NodeEvent) and depth == 1:
            nodes += 1  # keys and values in turn
            if nodes % 2 and isinstance(event, yaml.ScalarEvent):
                if event.value in keys:
                    raise ValueError(f"{place} has a key that is there already")
                keys.add(event.value)
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > MAX_DEPTH:
            raise ValueError(f"{place} is nested deeper than {MAX_DEPTH} levels")


def _said(value: object) -> str:
    """A value in a message: a short text, or what it is."""
    if isinstance(value, str):
        return shown(value) if len(value) <= MAX_SHOWN else "a long text"
    return "a table" if isinstance(value, Mapping) else "a list" if isinstance(value, list) else "empty"


def _key(table: Calibrated, what: str, where: str) -> str:
    """The key by which a file has something; raises ConfigurationError that names those it could have."""
    key = next((name for name in NAMES[what] if name in table), None)
    if key is None:
        first, *others = NAMES[what]
        raise ConfigurationError(
            f"{where}: the key {first!r} is missing; {' or '.join(others)} would be taken too"
            + (". Or say size_px = [WIDTH, HEIGHT] beside it" if what in ("width", "height") else "")
        )
    return key


def _demand_whole(table: Calibrated, size: tuple[float, float], where: str) -> None:
    """Raise ConfigurationError where ROS's camera delivers other images than it was calibrated with."""
    whole = {"binning_x": 1.0, "binning_y": 1.0}
    part = {"x_offset": 0.0, "y_offset": 0.0, "width": size[0], "height": size[1]}
    roi = table.get("roi")
    said = [
        f"{name}{key} = {_said(values[key])}"
        for name, values, usual in (("", table, whole), ("roi.", roi if isinstance(roi, Mapping) else {}, part))
        for key in usual
        if key in values and values[key] not in EMPTY and _float(values[key]) not in (0.0, usual[key])
    ]
    if said:
        raise ConfigurationError(
            f"{where}: the camera delivers a part of the image that it was calibrated with, or fewer pixels "
            f"({', '.join(said)}): calibrate it as it is used"
        )


def _float(value: object) -> float:
    """The number that a text is, also as YAML has it (``.inf``); NaN if it is none."""
    try:
        return float(re.sub(r"(?i)\.(?=inf|nan)", "", value)) if isinstance(value, str) else math.nan
    except ValueError:
        return math.nan


def _number(table: Calibrated, what: str, where: str) -> float:
    key = _key(table, what, where)
    value = _float(table[key])
    if not 0.0 < value <= MAX_SIDE:
        raise ConfigurationError(f"{where}: {key} must be a positive number of pixels, not {_said(table[key])}")
    return value


def _matrix(table: Calibrated, what: str, where: str) -> Array:
    """(rows × columns,) the numbers of a matrix, or of a list."""
    key = _key(table, what, where)
    value = table[key]
    is_table = isinstance(value, Mapping)
    if is_table and not {"rows", "cols", "data"} <= value.keys():
        raise ConfigurationError(f"{where}: {key} must have rows, cols and data")
    numbers = np.array([_float(text) for text in _flat(value["data"] if is_table else value)])
    rows, columns = (_float(value["rows"]), _float(value["cols"])) if is_table else (len(numbers), 1)
    if len(numbers) != rows * columns or not np.isfinite(numbers).all():
        finite = np.isfinite(numbers).sum()
        raise ConfigurationError(
            f"{where}: {key} must have rows × cols = {rows:g} × {columns:g} finite numbers as data; it has {finite}"
        )
    return numbers


def _flat(data: object) -> Iterator[object]:
    """What a list, or a list of lists, holds; nothing where there is nothing."""
    if isinstance(data, list):
        for entry in data:
            yield from _flat(entry)
    elif data not in EMPTY:
        yield data


def _distortion(table: Calibrated, where: str, wanted: str | None) -> Distortion | None:
    values, model = _matrix(table, "D", where), wanted or "brown-conrady"
    for key, names in (("distortion_model", ROS_MODELS), ("fisheye_model", FISHEYE)):
        value = table.get(key)
        if key == "distortion_model" and key in table:
            if not isinstance(value, str) or len(value) > MAX_SHOWN:
                raise ConfigurationError(f"{where}: distortion_model must be a name, not {_said(value)}")
            if value not in names:
                raise unknown_name(f"distortion_model in {where}", value, names)
        elif key in table and (not isinstance(value, str) or value.lower() not in names):
            raise ConfigurationError(f"{where}: fisheye_model must be 0 or 1, not {_said(value)}")
        if isinstance(value, str):
            model = names.get(value) or names[value.lower()]
            break
    if wanted not in (None, model):
        raise ConfigurationError(f"{where} is of the distortion model {model}, not {wanted}")
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
