"""Camera measurements: pixels of markers, depths and camera pose, with plausibility checks."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import NamedTuple, Self

import numpy as np

from ..compiled import load
from ..errors import ConfigurationError, InvalidInput, format_value
from ..robots.geometry import Pose
from ..rows import Array
from .camera import Camera


@dataclass(frozen=True)
class Plausible:
    """Largest plausible innovations; infinity switches a check off.

    Measured on the families' noise, calibration errors and delays by ``python -m
    checks.plausible``, which prints how often correct measurements exceed these bounds.
    """

    #: Distance of a marker from its prediction, relative to the shorter side of the image.
    image_share: float = 0.1
    #: Difference of the markers' pattern from the predicted one, relative to its size.
    shape_share: float = 0.5
    #: Distance of a measured camera pose from that of the kinematics [m].
    pose_m: float = 0.2
    pose_rad: float = 0.4  #: Rotation of the same pose [rad].
    image_s: float = 0.2  #: Age of an image [s]: six periods of a camera of 30 Hz.
    #: Difference of joint speeds from the change of positions [rad/s or m/s].
    speed_rad_s: float = 1.0
    #: Difference of a marker's depth from the model's, relative to the smaller; 1 is a factor of 2.
    depth_share: float = 1.0

    def __post_init__(self) -> None:
        for field in fields(self):
            if not getattr(self, field.name) > 0.0:
                raise ConfigurationError(
                    f"{field.name} must be positive, not {getattr(self, field.name)}"
                )

    def bounds(self, camera: Camera) -> Array:
        """Return the upper bounds (7,) on the :data:`INNOVATIONS`."""
        image = self.image_share * min(camera.size)
        pose = self.pose_m, self.pose_rad
        return np.array(
            [image, self.shape_share, *pose, self.image_s, self.speed_rad_s, self.depth_share]
        )


#: Largest time [s] by which an image may be newer than the joint state; it then counts as taken
#: together with it.
AHEAD = 0.02
#: Differences between measurement and model, in the order of a control step's record.
INNOVATIONS = (
    "image [px]",
    "shape",
    "position [m]",
    "orientation [rad]",
    "age [s]",
    "speed [rad/s]",
    "depth",
)

#: Units in which depths may be given by mistake, as factors on metres.
DEPTH_UNITS = {
    "millimetres": 1000.0,
    "centimetres": 100.0,
    "inches": 1.0 / 0.0254,
    "feet": 1.0 / 0.3048,
}
#: Largest deviation from the factor of a unit, as a factor, at which the unit is named.
UNIT_TOLERANCE = 1.15


@dataclass(frozen=True, slots=True)
class Measurement:
    """Measurement that replaces the model's prediction in one step."""

    #: (M, 2) sensor pixels of the markers from the image centre [px]. A marker that was not seen is
    #: NaN, or masked in an array of ``numpy.ma``; it keeps its offset from the model when last
    #: seen.
    pixels: Array | None = None
    #: (M,) depth Z of the markers in that image [m]. The model's depth is used if it is not given,
    #: or is NaN, 0 or infinite, which depth cameras return for an unknown depth.
    depth: Array | None = None
    #: Time of the image [s] on the clock of the step's time; now if None. The measurement is
    #: extrapolated by the model's motion since then.
    taken: float | None = None
    #: Pose of the camera in the target's frame in that image, for position-based tasks; the model's
    #: pose if None.
    camera: Pose | None = None

    def checked(self, M: int, t: float) -> Self:
        """Return the measurement as plain arrays with depths and time, for M markers at t [s].

        Raises InvalidInput if a value is not valid.
        """
        pixels = (
            np.full((M, 2), np.nan)
            if self.pixels is None
            else numbers(self.pixels, (M, 2), "pixels")
        )
        depth = np.full(M, np.nan) if self.depth is None else _depths(self.depth, M)
        if self.depth is not None and self.pixels is None:
            raise InvalidInput("measured depth needs the pixels that it belongs to")
        if (depth < 0.0).any():
            raise InvalidInput(
                f"measured depth must be positive, or NaN where it is not known, not {depth}"
            )
        taken = t if self.taken is None else self.taken
        if not math.isfinite(taken) or taken > t + AHEAD:
            raise InvalidInput(
                f"an image must be taken before now, t = {t:g} s, not at {format_value(self.taken)}"
            )
        taken = min(taken, t)
        if self.camera is not None and not isinstance(self.camera, Pose):
            raise InvalidInput(
                f"the measured pose of the camera must be a Pose, not {format_value(self.camera)}"
            )
        return type(self)(None if self.pixels is None else pixels, depth, taken, self.camera)

    def undistorted(self, camera: Camera) -> Self:
        """Return the measurement with ideal pixels.

        Raises InvalidInput if a pixel lies where the distortion cannot be inverted.
        """
        return self if self.pixels is None else replace(self, pixels=camera.undistort(self.pixels))


class Deviations(NamedTuple):
    """Differences of the parts of a measurement from the model."""

    correction: Array  #: (M, 2) correction of the markers in normalised coordinates.
    slip: Array  #: (n,) slip of the joints: see :func:`vsconstraints.formulas.innovation.slip`.
    depth: Array  #: (M,) measured Z [m], NaN where none is measured.
    depth_ratio: Array  #: (M,) measured Z divided by the model's, NaN where none is measured.


def describe_implausible(
    innovation: Array, bounds: Array, camera: Camera, seen: Array, beside: Deviations
) -> str:
    """Return sentences on the implausible parts of a measurement, with possible causes.

    ``innovation`` is from ``formulas.innovation``; ``seen`` (M, 2) are the pixels [px].
    """
    image, shape, position, orientation, age, speed = innovation[:6]
    beyond = innovation[: len(INNOVATIONS)] > bounds
    remarks = []
    if beyond[0] or beyond[1]:
        off = beside.correction * camera.focal
        i = int(np.argmax((off * off).sum(axis=1)))
        bent = (
            f", and the pattern differs in shape by {100.0 * shape:.0f} % of its size"
            if beyond[1]
            else ""
        )
        remarks.append(
            f"marker {i + 1} is seen {image:.3g} px from where the model predicts it{bent} "
            f"(allowed are "
            f"{bounds[0]:.3g} px and {100.0 * bounds[1]:.0f} %): "
            f"{_explained(seen, seen - off, camera)}"
        )
    if beyond[2] or beyond[3]:
        remarks.append(
            f"the camera is measured {position:.3g} m and {orientation:.3g} rad from where the "
            f"joints have it (allowed "
            f"are {bounds[2]:.3g} m and {bounds[3]:.3g} rad)"
        )
    if beyond[4]:
        remarks.append(f"the image is {age:.3g} s old (allowed are {bounds[4]:.3g} s)")
    if beyond[5]:
        j = int(np.argmax(np.abs(beside.slip)))
        remarks.append(
            f"the speed of joint {j + 1} is {speed:.3g} rad/s from the change of its measured "
            f"positions (allowed are "
            f"{bounds[5]:.3g})"
        )
    if beyond[6]:
        remarks.append(_wrong_depth(beside, bounds[6]))
    return "; ".join(remarks)


def _wrong_depth(beside: Deviations, allowed: float) -> str:
    """Describe the depth that deviates most from the model, and name the unit that explains it."""
    is_unknown = np.isnan(beside.depth_ratio)
    ratios = np.where(is_unknown, 1.0, beside.depth_ratio)
    off = np.abs(np.log(ratios))
    i = int(np.argmax(off))
    ratio = float(beside.depth_ratio[i])
    predicted = beside.depth[i] / ratio
    # up to half of the markers may be measured on other surfaces: the median shows the unit
    usual = float(np.nanmedian(beside.depth_ratio))
    guess = f"that is {ratio:.3g} times the model's"
    for unit, factor in DEPTH_UNITS.items():
        if factor / UNIT_TOLERANCE < usual < factor * UNIT_TOLERANCE:
            guess = f"are depths in {unit}, not metres?"
    return (
        f"the depth of marker {i + 1} is measured {beside.depth[i]:.3g} m, and is {predicted:.3g} "
        f"m by the model "
        f"(allowed is a factor of {1.0 + allowed:.3g}): {guess}"
    )


def _explained(seen: Array, model: Array, camera: Camera) -> str:
    """Return a possible cause for seeing pixels (M, 2) of markers that the model has elsewhere."""
    shape_seen = seen - seen.mean(axis=0)
    shape = model - model.mean(axis=0)
    distances = np.linalg.norm(shape_seen[:, None] - shape, axis=2)
    order = distances.argmin(axis=1)
    guesses = {
        "a mirrored image": model * (-1.0, 1.0),
        "an image mirrored top to bottom": model * (1.0, -1.0),
        "an image upside down": -model,
        "pixels counted from the image's corner": model + 0.5 * np.asarray(camera.size),
        "coordinates in metres, or normalised, in place of pixels": camera.normalised(model),
        "another order of the markers": model[order],
    }
    off = {}
    for what, pixels in guesses.items():
        off[what] = float(np.abs(seen - pixels).max())
    likely = min(off, key=off.__getitem__)
    if off[likely] < 0.25 * np.abs(seen - model).max():
        return f"it fits {likely}"
    return "it fits a frozen image, a camera that was moved, or a target that is elsewhere"


def with_nan(value: object) -> Array:
    """Return ``value`` as a new array of floats, NaN where a masked array is masked."""
    if isinstance(value, np.ma.MaskedArray):
        value = np.ma.filled(value.astype(np.float64), np.nan)
    return np.array(value, dtype=np.float64, order="C")


def _depths(value: object, M: int) -> Array:
    """Return depths (M,), NaN where none is measured; raise InvalidInput for invalid values."""
    try:
        given = with_nan(value)
    except (TypeError, ValueError):
        given = np.empty(0)
    if given.shape != (M,):
        return numbers(value, (M,), "depth")
    return np.where((given == 0.0) | (given == np.inf), np.nan, given)


def numbers(value: object, shape: tuple[int, ...], what: str) -> Array:
    """Return ``value`` as an array of floats of the given shape; NaN is allowed.

    Raises InvalidInput, which names ``what``, for another shape or infinite numbers.
    """
    try:
        array = with_nan(value)
    except (TypeError, ValueError) as error:
        raise InvalidInput(
            f"measured {what} must be {shape} numbers, not {format_value(value)}"
        ) from error
    if array.shape != shape or np.isinf(array).any():
        raise InvalidInput(
            f"measured {what} must be {shape} numbers, NaN where there is none, not "
            f"{format_value(value)}"
        )
    return array


def estimated_pose(markers: Array, normalised: Array, near: Pose) -> Pose:
    """Return the camera pose in the target's frame that explains an image best.

    Gauss–Newton iteration starts at a nearby pose. Markers are (m, 3) in the target's frame [m],
    seen at normalised coordinates (m, 2). If they do not determine the pose, the result stays near
    the initial one. Raises LinAlgError if the numbers overflow.
    """
    R = np.array(near.R, order="C")
    t = np.array(near.t)
    seen = np.ascontiguousarray(normalised)
    scratch = np.empty(64 * len(markers) + 256), np.zeros(1, dtype=np.int64)
    if not load("sensing").estimate(np.ascontiguousarray(markers), seen, R, t, *scratch):
        raise np.linalg.LinAlgError("no pose explains the image within the range of floating point")
    return Pose(R, t)
