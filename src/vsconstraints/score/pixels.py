"""Pixels of a recording: another origin, unit or order of markers than the scenario's."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from ..errors import ConfigurationError
from ..rows import Array, BoolArray, IntArray
from ..vision.camera import Camera

#: Deviation from the model up to which pixels are not questioned [px]: noise, a camera that moves
#: during a delay, or an origin half a pixel beside.
NEAR = 5.0
#: Another reading of pixels is meant if its deviation is below the second share of the present one,
#: or below the first and below :data:`NEAR`. Errors of calibration are no such change of all
#: markers at once.
BETTER = 0.2
FAR_BETTER = 0.1
#: Deviation from the model beyond which a remark questions the image, as a share of its larger
#: side: 32 px of 640 px. With a focal length of 600 px, a camera turned by 2° deviates by 21 px.
QUESTIONABLE = 0.05
#: Largest number of samples that are compared.
SAMPLES = 200


class Reading(NamedTuple):
    """A meaning of recorded numbers."""

    meanings: tuple[str, ...]  #: What the numbers are, in words.
    remedies: tuple[str, ...]  #: Conversions of the recording, in this order.
    pixels: Array  #: (N, M, 2) the numbers as pixels on the sensor, from the image's centre.


def require_pixels(where: str, camera: Camera, recorded: Array, model: Array) -> str:
    """Raise ConfigurationError if recorded pixels are clearly of another origin, unit or order.

    ``recorded`` (N, M, 2) are the pixels on the sensor from the image's centre, NaN where a marker
    is not seen, and ``model`` (N, M, 2) those of the scenario at the recorded positions. Return the
    question whether they are, if they deviate much and no other reading of them fits; otherwise an
    empty text. The deviation is the distance from the model that a marker exceeds in half of its
    samples, for the worst marker.
    """
    seen: BoolArray = np.isfinite(recorded.sum(axis=2))
    known = np.flatnonzero(np.count_nonzero(seen, axis=1))
    if not len(known):
        return ""
    chosen = known[np.linspace(0, len(known) - 1, min(len(known), SAMPLES)).astype(int)]
    values = recorded[chosen]
    expected = model[chosen]
    ever_seen = np.flatnonzero(np.count_nonzero(seen[chosen], axis=0))
    present = _deviation(values[:, ever_seen], expected[:, ever_seen])
    if present <= NEAR:
        return ""
    best = present
    meant = None
    with np.errstate(all="ignore"):  # pixels that are no normalised coordinates may overflow
        for reading in _readings(camera, values):
            for order in _orders(reading.pixels, expected, ever_seen):
                deviation = _deviation(reading.pixels[:, ever_seen], expected[:, order])
                if deviation < best:
                    best = deviation
                    meant = _in_order(reading, ever_seen, order)
    if meant is not None and (best < FAR_BETTER * present or best < min(NEAR, BETTER * present)):
        raise ConfigurationError(
            f"{where}: measured pixels deviate by {present:.3g} px from those of the model at the "
            f"recorded positions, and by {best:.2g} px if {' and '.join(meant.meanings)}. Pixels "
            "are counted from the image's centre, u to the right and v down, with markers in the "
            f"scenario's order: {', then '.join(meant.remedies)}"
        )
    if present > QUESTIONABLE * max(camera.size):
        return (
            f"a marker deviates by more than {present:.3g} px in half of the samples: violations "
            "of rows in the image are those of the measured pixels, and wrong if these have "
            "another origin, unit or order, or another camera or target than the scenario"
        )
    return ""


def _readings(camera: Camera, values: Array) -> Iterator[Reading]:
    """Yield other meanings of recorded numbers (N, M, 2), the simplest ones first."""
    yield Reading((), (), values)
    yield from _converted(camera, values)
    exchanged = Reading(("u and v were exchanged",), ("exchange u and v",), values[..., ::-1])
    yield exchanged
    for reading in _converted(camera, exchanged.pixels):
        yield Reading(
            exchanged.meanings + reading.meanings,
            exchanged.remedies + reading.remedies,
            reading.pixels,
        )


def _converted(camera: Camera, values: Array) -> Iterator[Reading]:
    """Yield meanings of numbers (N, M, 2) with another origin or unit."""
    size = np.asarray(camera.size)
    first = -camera.from_corner(np.zeros(2), "centres")
    yield Reading(
        ("they were counted from the first pixel, as OpenCV does",),
        (f"subtract {_pair(first)} px from (u, v)",),
        values - first,
    )
    yield Reading(("v were upwards",), ("change the sign of v",), values * (1.0, -1.0))
    yield Reading(
        ("they were counted from the lower left corner",),
        (f"subtract {first[0]:g} px from u, and v from {first[1]:g} px",),
        (values - first) * (1.0, -1.0),
    )
    offset = camera.offset
    if offset.any():
        yield Reading(
            ("they were counted from the principal point",),
            (f"add {_pair(offset)} px to (u, v)",),
            values + offset,
        )
    to_pixels = f"multiply (u, v) by {_pair(camera.focal)} px"
    if offset.any():
        to_pixels += f" and add {_pair(offset)} px"
    if camera.distortion is not None:
        to_pixels += " and distort them by the lens"
    yield Reading(
        ("they were normalised coordinates",),
        (to_pixels,),
        camera.distort(camera.pixels(values)),
    )
    yield Reading(
        ("they were shares of the image's size from its corner",),
        (f"multiply (u, v) by {_pair(size)} px and subtract {_pair(0.5 * size)} px",),
        camera.from_corner(values * size),
    )
    yield Reading(
        ("they were shares of half the image's size from its centre",),
        (f"multiply (u, v) by {_pair(0.5 * size)} px",),
        values * 0.5 * size,
    )


def _orders(pixels: Array, model: Array, seen: IntArray) -> Iterator[IntArray]:
    """Yield the markers of the columns that are ``seen``: as they are, and as they fit best."""
    yield seen
    distances = np.linalg.norm(pixels[:, seen, None] - model[:, None], axis=-1)
    costs = _medians(distances)
    if np.isfinite(costs).all():
        _, order = linear_sum_assignment(costs)
        if (order != seen).any():
            yield order


def _in_order(reading: Reading, seen: IntArray, order: IntArray) -> Reading:
    """Return a reading with the columns ``seen`` in another order of markers."""
    if np.array_equal(seen, order):
        return reading
    columns = ", ".join(str(number + 1) for number in seen)
    markers = ", ".join(str(number + 1) for number in order)
    return Reading(
        (*reading.meanings, f"columns {columns} were markers {markers}"),
        (*reading.remedies, "number the columns as the scenario's markers"),
        reading.pixels,
    )


def _deviation(pixels: Array, model: Array) -> float:
    """Return the median distance over the samples, for the worst of the markers."""
    return float(_medians(np.linalg.norm(pixels - model, axis=-1)).max())


def _medians(distances: Array) -> Array:
    """Return medians over the first axis; NaN is left out, and a marker without numbers is 0."""
    missing = np.count_nonzero(np.isnan(distances), axis=0) == len(distances)
    medians: Array = np.nanmedian(np.where(missing, 0.0, distances), axis=0)
    return medians


def _pair(values: Array | tuple[float, float]) -> str:
    return f"({values[0]:g}, {values[1]:g})"
