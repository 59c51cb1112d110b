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
#: Another reading of pixels is meant if its deviation is below :data:`NEAR`, and below this share
#: of the present one. Errors of calibration are no such change of all markers at once.
BETTER = 0.2
#: Another reading is also meant if its deviation is below this share, however large it is.
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


def require_pixels(where: str, camera: Camera, recorded: Array, model: Array) -> None:
    """Raise ConfigurationError if recorded pixels are clearly of another origin, unit or order.

    ``recorded`` (N, M, 2) are the pixels on the sensor from the image's centre, NaN where a marker
    is not seen, and ``model`` (N, M, 2) those of the scenario at the recorded positions. The
    deviation is the distance from the model that a marker exceeds in half of its samples, for the
    worst marker.
    """
    seen: BoolArray = np.isfinite((recorded - model).sum(axis=2))
    known = np.flatnonzero(np.count_nonzero(seen, axis=1))
    if not len(known):
        return
    count = min(len(known), SAMPLES)
    positions = np.linspace(0, len(known) - 1, count).astype(int)
    chosen = known[positions]
    values = recorded[chosen]
    expected = model[chosen]
    ever_seen = np.flatnonzero(np.count_nonzero(seen[chosen], axis=0))
    present = _deviation(values[:, ever_seen], expected[:, ever_seen])
    shown = expected[:, ever_seen]
    greatest = np.nanmax(shown, axis=(0, 1))
    least = np.nanmin(shown, axis=(0, 1))
    spread = (greatest - least).max()
    # pixels at one place differ by an offset alone, whatever they mean: the camera may be turned
    unquestioned = NEAR if spread > 2.0 * NEAR else QUESTIONABLE * max(camera.size)
    if present <= unquestioned:
        return
    best = present
    meant = None
    with np.errstate(all="ignore"):  # pixels that are no normalised coordinates may overflow
        for reading in _readings(camera, values):
            for order in _orders(reading.pixels, expected, ever_seen):
                deviation = _deviation(reading.pixels[:, ever_seen], expected[:, order])
                if deviation < best:
                    best = deviation
                    meant = _in_order(reading, ever_seen, order)
    is_much_better = best < FAR_BETTER * present or best < min(NEAR, BETTER * present)
    if meant is not None and is_much_better:
        raise ConfigurationError(
            f"{where}: measured pixels deviate by {present:.3g} px from those of the model at the "
            f"recorded positions, and by {best:.2g} px if {' and '.join(meant.meanings)}. Pixels "
            "are counted from the image's centre, u to the right and v down, with markers in the "
            f"scenario's order: {', then '.join(meant.remedies)}"
        )


def remark_on_deviation(deviation: Array, camera: Camera) -> str:
    """Return a remark on the distances (N, M) of measured pixels from those of the model.

    They are NaN where a marker is not seen. If they are large, the remark questions the image.
    """
    hidden = np.isnan(deviation)
    seen = deviation[:, ~hidden.all(axis=0)]
    if not seen.size:
        return "no marker is seen in the measured pixels: those of the model replace them"
    remark = f"measured pixels deviate by up to {np.nanmax(seen):.3g} px from those of the model"
    replaced = np.count_nonzero(hidden)
    if replaced:
        remark += f", which replace {replaced} of a marker that is not seen"
    half = _medians(seen).max()
    if half > QUESTIONABLE * max(camera.size):
        remark += (
            f"; those of a marker by more than {half:.3g} px in half of the samples: "
            "violations of rows in the image are those of the measured pixels, and wrong if these "
            "have another origin, unit or order, or another camera or target than the scenario"
        )
    return remark


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
    centre = camera.to_corner(np.zeros(2), "centres")
    centred = camera.from_corner(values, "centres")
    yield Reading(
        ("they were counted from the first pixel, as OpenCV does",),
        (f"subtract {_pair(centre)} px from (u, v)",),
        centred,
    )
    yield Reading(("v were upwards",), ("change the sign of v",), values * (1.0, -1.0))
    yield Reading(
        ("they were counted from the lower left corner",),
        (f"subtract {centre[0]:g} px from u, and v from {centre[1]:g} px",),
        centred * (1.0, -1.0),
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
    as_they_are = costs[np.arange(len(seen)), seen]
    if np.isfinite(as_they_are).all():  # otherwise there may be no order of finite costs
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
    """Return medians over the first axis; NaN is left out, and infinite without numbers."""
    missing = np.isnan(distances).all(axis=0)
    medians: Array = np.nanmedian(np.where(missing, np.inf, distances), axis=0)
    return medians


def _pair(values: Array | tuple[float, float]) -> str:
    return f"({values[0]:g}, {values[1]:g})"
