"""Camera calibration files of OpenCV (``cv::FileStorage``), ROS (camera_info) and Kalibr.

OpenCV is not needed to read them. All formats count pixels by their centres; :class:`.Camera`
counts their edges, half a pixel more. The lens model is stated by many keys and many names. An
unknown name raises an error; it is never ignored.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from ..errors import ConfigurationError, InvalidInput, format_value, unknown_name
from ..formulas.lenses import MODELS
from ..robots.geometry import Vector2
from ..rows import Array
from .calibration_files import EMPTY, MAX_SHOWN, Calibrated, number_of, numbers_of, read_table, said
from .distortion import Distortion

NONE = "none"  #: Model of a lens without distortion.
#: Lens models by their names in files, in lower case, with underscores.
LENSES = {
    "plumb_bob": "brown-conrady",
    "rational_polynomial": "brown-conrady",
    "radtan": "brown-conrady",
    "radial_tangential": "brown-conrady",
    "brown_conrady": "brown-conrady",
    "equidistant": "fisheye",
    "equi": "fisheye",
    "fisheye": "fisheye",
    "opencv_fisheye": "fisheye",
    "kannala_brandt": "fisheye",
    "kannala_brandt4": "fisheye",
    "none": NONE,
}
#: Names of projections, which do not state the distortion.
PROJECTIONS = ("pinhole", "perspective")
#: Lens model by the value of a key in :data:`ASKS_FISHEYE`.
FISHEYE = {"0": "brown-conrady", "false": "brown-conrady", "1": "fisheye", "true": "fisheye"}
ASKS_FISHEYE = ("fisheye_model", "fisheye", "is_fisheye")  #: Boolean keys: True for a fisheye.
#: Keys that state the lens model, in addition to :data:`ASKS_FISHEYE`.
SAYS_LENS = re.compile(
    r"model|fisheye|^lens([_-]?type)?$|(distortion|projection|camera)[_-]?type", re.IGNORECASE
)
#: Keys of each quantity in files of OpenCV and ROS, and in a ROS message as ``topic echo`` prints
#: it.
NAMES = {
    "width": ("image_width", "width"),
    "height": ("image_height", "height"),
    "K": ("camera_matrix", "K", "k", "M"),
    "D": ("distortion_coefficients", "D", "d"),
}
MAX_SIDE = 1e5  #: Longest side of an image [px].
LIKE = 0.85  #: Similarity above which a key counts as a misspelling of the missing one.


def read_calibration(
    path: str | Path, model: str | None = None, size: Vector2 | None = None
) -> dict[str, Any]:
    """Return the content of a calibration file as arguments of :class:`.Camera`.

    The distortion is None if all its coefficients are zero, except for a fisheye. ``size`` (2,)
    [px] is used if the file does not state the image size. ``model`` of :class:`.Distortion`
    overrides the lens model in the file, since labels may be wrong. The default is the
    Brown–Conrady model. ROS's rectification and projection matrices are ignored: they belong to
    rectified images.

    Raises
    ------
    ConfigurationError
        if the file cannot be read, has an unknown format or lens model, lacks a key or has
        invalid values, if its principal point does not fit its image size, or if the camera
        delivers a part of the calibrated image or a binned one.
    """
    where = os.fspath(path)
    table = _in_keys_of_ros(read_table(path), where)
    if size is not None and not any(
        key in table for what in ("width", "height") for key in NAMES[what]
    ):
        side = float(size[0]), float(size[1])
    else:
        side = _number(table, "width", where), _number(table, "height", where)
    _require_whole(table, side, where)
    key = _key(table, "K", where)
    K = numbers_of(table[key], key, where)
    _require_intrinsics(K, key, side, where)
    return {
        "size_px": side,
        "focal_px": (float(K[0]), float(K[4])),
        "principal_point_px": (float(K[2]) + 0.5, float(K[5]) + 0.5),
        "distortion": _distortion(table, where, model),
    }


def _in_keys_of_ros(table: Calibrated, where: str) -> Calibrated:
    """Return the table with the keys of OpenCV and ROS, also for one camera of Kalibr.

    Raises ConfigurationError, which names the format, for tables of other formats.
    """
    cameras = [
        key for key in table if re.fullmatch(r"cam\d+", key) and isinstance(table[key], Mapping)
    ]
    if len(cameras) > 1:
        raise ConfigurationError(
            f"{where}: this is a Kalibr camchain of {len(cameras)} cameras "
            f"({', '.join(cameras)}): copy the part of "
            "the one that is used into a file of its own"
        )
    if cameras:
        table = table[cameras[0]]
    if "intrinsics" in table:
        return _of_kalibr(table, where)
    if any(name in table for name in NAMES["K"]):
        return table
    formats = {
        "OpenCV's file of a stereo pair (M1, D1, M2, D2)": "M1",
        "a settings file of ORB-SLAM (Camera.fx …)": "Camera.fx",
        "a settings file of ORB-SLAM (Camera1.fx …)": "Camera1.fx",
        "a file of camodocal or VINS (projection_parameters)": "projection_parameters",
        "a file with a key for each number (fx, fy, cx, cy, k1 …)": "fx",
    }
    for name, key in formats.items():
        if key in table:
            raise ConfigurationError(
                f"{where}: this is {name}, which is not supported: write the numbers of one "
                "camera as image_width, image_height, camera_matrix, distortion_model and "
                "distortion_coefficients, as in ROS's files"
            )
    return table


def _of_kalibr(table: Calibrated, where: str) -> Calibrated:
    """Return the table of one Kalibr camera with the keys of ROS.

    EuRoC's ``sensor.yaml`` has the same form.
    """
    projection = table.get("camera_model", "pinhole")
    if projection not in PROJECTIONS:
        raise ConfigurationError(
            f"{where}: this is a Kalibr camchain of a camera that is not a pinhole (camera_model "
            f"is {said(projection)}): calibrate it as pinhole-radtan or pinhole-equi"
        )
    numbers = table["intrinsics"]
    resolution = table.get("resolution")
    if not isinstance(numbers, list) or len(numbers) != 4:
        raise ConfigurationError(
            f"{where}: intrinsics of a Kalibr camchain must be the four numbers f_u, f_v, c_u, c_v"
        )
    F_u, F_v, c_u, c_v = numbers
    translated = {
        key: value for key, value in table.items() if key not in ("intrinsics", "resolution")
    }
    translated["camera_matrix"] = [F_u, "0", c_u, "0", F_v, c_v, "0", "0", "1"]
    if isinstance(resolution, list) and len(resolution) == 2:
        translated["image_width"], translated["image_height"] = resolution
    if "distortion_coeffs" in table:
        translated["distortion_coefficients"] = translated.pop("distortion_coeffs")
    return translated


def _key(table: Calibrated, what: str, where: str) -> str:
    """Return the key under which a file stores a quantity.

    Raises ConfigurationError, which names the possible keys, if the quantity is missing.
    """
    key = next((name for name in NAMES[what] if name in table), None)
    if key is None:
        first, *others = NAMES[what]
        misspelt = get_close_matches(first, map(str, table), n=1, cutoff=LIKE)
        raise ConfigurationError(
            f"{where}: the key {first!r} is missing; {' or '.join(others)} would be taken too"
            + (f". Is {misspelt[0]!r} misspelt?" if misspelt else "")
            + (
                ". Or say size_px = [WIDTH, HEIGHT] beside it"
                if what in ("width", "height")
                else ""
            )
        )
    return key


def _require_whole(table: Calibrated, size: tuple[float, float], where: str) -> None:
    """Raise ConfigurationError if ROS's camera delivers other images than the calibrated ones.

    Such a camera delivers a region of interest, or binned pixels.
    """
    whole = {"binning_x": 1.0, "binning_y": 1.0}
    part = {"x_offset": 0.0, "y_offset": 0.0, "width": size[0], "height": size[1]}
    roi = table.get("roi")
    given = [
        f"{name}{key} = {said(values[key])}"
        for name, values, usual in (
            ("", table, whole),
            ("roi.", roi if isinstance(roi, Mapping) else {}, part),
        )
        for key in usual
        if key in values
        and values[key] not in EMPTY
        and number_of(values[key]) not in (0.0, usual[key])
    ]
    if given:
        raise ConfigurationError(
            f"{where}: the camera delivers a part of the image that it was calibrated with, or "
            f"fewer pixels "
            f"({', '.join(given)}): calibrate it as it is used"
        )


def _number(table: Calibrated, what: str, where: str) -> float:
    key = _key(table, what, where)
    value = number_of(table[key])
    if not 0.0 < value <= MAX_SIDE:
        raise ConfigurationError(
            f"{where}: {key} must be a positive number of pixels, not {said(table[key])}"
        )
    return value


def _require_intrinsics(K: Array, key: str, side: tuple[float, float], where: str) -> None:
    """Raise ConfigurationError unless K is a camera matrix without skew.

    Its principal point must lie inside the image.
    """
    if K.shape != (9,) or K[[3, 6, 7]].any() or K[8] != 1.0 or (K[[0, 4]] <= 0.0).any():
        given = format_value(K.tolist()) if K.shape == (9,) else f"{len(K)} numbers"
        raise ConfigurationError(
            f"{where}: {key} must be [F_u, 0, c_x, 0, F_v, c_y, 0, 0, 1], not {given}"
        )
    if not all(0.0 < c + 0.5 < length for c, length in zip(K[[2, 5]], side, strict=True)):
        raise ConfigurationError(
            f"{where}: the principal point ({K[2]:g}, {K[5]:g}) lies outside an image of "
            f"{side[0]:g} × {side[1]:g} px: "
            "is the matrix one for another image size?"
        )
    if K[1] != 0.0:
        farthest = max(K[5], side[1] - K[5]) / K[4]
        raise ConfigurationError(
            f"{where}: {key} has a skew of {K[1]:g} px as its second number, which moves pixels "
            f"by up to "
            f"{abs(K[1]) * farthest:.2g} px and is not modelled: calibrate without skew (in "
            f"OpenCV's fisheye with "
            "CALIB_FIX_SKEW), or write 0 if that is negligible"
        )


# --- the lens ---


def _distortion(table: Calibrated, where: str, wanted: str | None) -> Distortion | None:
    stated = wanted or _stated_lens(table, where)
    if stated == NONE and not any(name in table for name in NAMES["D"]):
        return None
    key = _key(table, "D", where)
    values = numbers_of(table[key], key, where)
    if stated == NONE and values.any():
        raise ConfigurationError(
            f"{where} says that the lens has no distortion, but {key} is not zero: say which lens "
            f"it is with "
            "distortion_model"
        )
    model = stated or "brown-conrady"
    if not values.any() and model != "fisheye":
        return None
    if model in MODELS:
        values = _without_trailing_zeros(values, MODELS[model].counts)
    try:
        if stated is None:
            return Distortion.of_unstated_model(values.tolist())
        return Distortion(model, values.tolist())  # type: ignore[arg-type]
    except InvalidInput as error:
        raise ConfigurationError(f"{where}: {error}") from error


def _without_trailing_zeros(values: Array, counts: tuple[int, ...]) -> Array:
    """Return the coefficients without zeros beyond the largest number that the model has.

    If the rest is not zero, all coefficients are returned. OpenCV's further coefficients describe
    thin prisms and tilted sensors; ROS's drivers pad a fisheye's four with zeros.
    """
    if len(values) in counts:
        return values
    for count in sorted(counts, reverse=True):
        if count < len(values) and not values[count:].any():
            return values[:count]
    return values


def _stated_lens(table: Calibrated, where: str) -> str | None:
    """Return the lens model that a file states under any key; None if it states none.

    Raises ConfigurationError for an unknown model, and for two models that contradict each other.
    """
    stated: dict[str, str] = {}
    for key, value in _says_lens(table):
        model = _lens_of(key, value, where)
        if model is not None:
            stated[key] = model
    if len(set(stated.values())) > 1:
        contradiction = " and ".join(f"{key} = {said(table[key])}" for key in stated)
        raise ConfigurationError(
            f"{where} contradicts itself about the lens: {contradiction}; say which lens it is "
            "with distortion_model"
        )
    return next(iter(stated.values()), None)


def _says_lens(table: Calibrated) -> Iterator[tuple[str, object]]:
    """Yield keys that state the lens model, with their values unless empty."""
    for key, value in table.items():
        if isinstance(key, str) and SAYS_LENS.search(key) and value not in EMPTY:
            yield key, value


def _lens_of(key: str, value: object, where: str) -> str | None:
    """Return the lens model that a key's value names; None if it does not state the distortion."""
    asks_fisheye = key.lower() in ASKS_FISHEYE
    if asks_fisheye and isinstance(value, str) and value.lower() in FISHEYE:
        return FISHEYE[value.lower()]
    if asks_fisheye:
        raise ConfigurationError(f"{where}: {key} must be 0 or 1, not {said(value)}")
    key = key[:MAX_SHOWN]
    if not isinstance(value, str) or len(value) > MAX_SHOWN:
        raise ConfigurationError(f"{where}: {key} must be a name, not {said(value)}")
    name = re.sub(r"[\s-]+", "_", value.strip().lower())
    if name in PROJECTIONS:
        return None
    if name not in LENSES:
        error = unknown_name(f"{key} in {where}", value, [*LENSES, *PROJECTIONS])
        raise ConfigurationError(
            f"{error}. Beside the file, distortion_model says which lens it is instead"
        )
    return LENSES[name]
