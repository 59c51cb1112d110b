"""Distortion and undistortion of pixels by a lens, compiled.

See :class:`vsconstraints.vision.distortion.Distortion`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np

from ..formulas.lenses import ACCURACY, INSIDE, ITERATIONS, MODELS, TOLERANCE, extended, newton
from ..rows import Array
from .compiler import IN_PLACE, compiled, in_place
from .parts import address, call_int_pointer, checked, make_part, to_fixed_tuple
from .signatures import FLAG, INT, MATRIX, VECTOR, signature

#: Entries of an eye: focal lengths, principal point and reach of the lens; then its coefficients.
F_U, F_V, CENTER_U, CENTER_V, REACH, FIXED = range(6)


@in_place
def undistorted(
    lens: Callable[..., Any], image: tuple[float, float], reach: float, coefficients: Any
) -> tuple[float, float, bool]:
    """Return the point that a lens maps to an image, both normalised, and True if it is found.

    The method is Newton's. Steps that do not reduce the error are halved.
    """
    X, Y = image
    largest_radius = INSIDE * reach
    squared_radius = X * X + Y * Y
    radius = np.sqrt(squared_radius)
    share = min(1.0, largest_radius / max(radius, largest_radius))
    x = share * X
    y = share * Y
    dx, dy, error = newton(lens, (x, y), image, reach, coefficients)
    for _ in range(ITERATIONS):
        if not error > TOLERANCE:
            break
        ahead = x + dx, y + dy
        next_dx, next_dy, next_error = newton(lens, ahead, image, reach, coefficients)
        if next_error < error:
            x, y = ahead
            dx = next_dx
            dy = next_dy
            error = next_error
        else:
            dx = 0.5 * dx
            dy = 0.5 * dy
    is_accurate = error <= ACCURACY
    is_within_reach = np.sqrt(x * x + y * y) <= reach
    return x, y, is_accurate and is_within_reach


def template(lens: Callable[..., Any], count: int) -> Callable[[Array, Array, Array, bool], int]:
    """Make the function that distorts pixels (M, 2) by a lens, or undistorts them if ``back``.

    ``count`` is the number of coefficients of the lens. The function writes the pixels to ``out``
    (M, 2), and returns the number of those that cannot be undistorted. NaN remains NaN.
    """

    def through(eye: Array, pixels: Array, out: Array, back: bool) -> int:
        f_u = eye[F_U]
        f_v = eye[F_V]
        center_u = eye[CENTER_U]
        center_v = eye[CENTER_V]
        reach = eye[REACH]
        coefficients = to_fixed_tuple(eye[FIXED:], count)
        refused = 0
        for i in range(len(pixels)):
            x = (pixels[i, 0] - center_u) / f_u
            y = (pixels[i, 1] - center_v) / f_v
            if not back:
                x, y, _, _, _, _ = extended(lens, x, y, reach, coefficients)
            elif not math.isnan(x + y):
                x, y, is_found = undistorted(lens, (x, y), reach, coefficients)
                refused += not is_found
            out[i, 0] = f_u * x + center_u
            out[i, 1] = f_v * y + center_v
        return refused

    return through


@checked()
@compiled(signature(INT, INT, VECTOR, MATRIX, MATRIX, FLAG), IN_PLACE)
def call_lens(lens: int, eye: Array, pixels: Array, out: Array, back: bool) -> int:
    """Call the function of a lens at an address; see :func:`template`."""
    code: int = call_int_pointer(lens, (eye, pixels, out, back))
    return code


@cache
def _compile_lens(model: str) -> Any:
    """Return the compiled function of a kind of lens, kept for the lifetime of the process."""
    kind = MODELS[model]
    count = max(kind.counts)
    arguments = signature(INT, VECTOR, MATRIX, MATRIX, FLAG)
    return make_part(template, (kind.lens,), (count,), arguments)


def address_of(model: str) -> int:
    """Return the address of the compiled function of a kind of lens."""
    return address(_compile_lens(model))


def through(model: str) -> Callable[[Array, Array, Array, bool], int]:
    """Return the function of a kind of lens that Python calls; see :func:`template`."""
    return partial(call_lens, address_of(model))
