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
from .compiler import IN_PLACE, compiled
from .parts import address, call_int_pointer, make_part, to_fixed_tuple
from .signatures import FLAG, INT, MATRIX, VECTOR, signature

#: Entries of an eye: focal lengths, principal point and reach of the lens; then its coefficients.
F_U, F_V, CENTER_U, CENTER_V, REACH, FIXED = range(6)


def template(lens: Callable[..., Any], count: int) -> Callable[[Array, Array, Array, bool], int]:
    """Make the function that distorts pixels (M, 2) by a lens, or undistorts them if ``back``.

    ``count`` is the number of coefficients of the lens. The function writes the pixels to ``out``
    (M, 2), and returns the number of those that cannot be undistorted. NaN remains NaN.
    """

    def through(eye: Array, pixels: Array, out: Array, back: bool) -> int:
        reach = eye[REACH]
        coefficients = to_fixed_tuple(eye[FIXED:], count)
        refused = 0
        for i in range(len(pixels)):
            x = (pixels[i, 0] - eye[CENTER_U]) / eye[F_U]
            y = (pixels[i, 1] - eye[CENTER_V]) / eye[F_V]
            image = x, y
            if not back:
                found = extended(lens, x, y, reach, coefficients)
                x = found[0]
                y = found[1]
            elif not math.isnan(x + y):
                share = min(1.0, INSIDE * reach / max(np.sqrt(x * x + y * y), INSIDE * reach))
                x = share * x
                y = share * y
                dx, dy, off = newton(lens, (x, y), image, reach, coefficients)
                for _ in range(ITERATIONS):
                    if not off > TOLERANCE:
                        break
                    then = newton(lens, (x + dx, y + dy), image, reach, coefficients)
                    if then[2] < off:
                        x = x + dx
                        y = y + dy
                        dx, dy, off = then
                    else:
                        dx = 0.5 * dx
                        dy = 0.5 * dy
                refused += not (off <= ACCURACY and np.sqrt(x * x + y * y) <= reach)
            out[i, 0] = eye[F_U] * x + eye[CENTER_U]
            out[i, 1] = eye[F_V] * y + eye[CENTER_V]
        return refused

    return through


@compiled(signature(INT, INT, VECTOR, MATRIX, MATRIX, FLAG), IN_PLACE)
def call_lens(lens: int, eye: Array, pixels: Array, out: Array, back: bool) -> int:
    """Call the function of a lens at an address; see :func:`template`."""
    code: int = call_int_pointer(lens, (eye, pixels, out, back))
    return code


@cache
def _compile_lens(model: str) -> Any:
    """Return the compiled function of a kind of lens, kept for the lifetime of the process."""
    kind = MODELS[model]
    arguments = signature(INT, VECTOR, MATRIX, MATRIX, FLAG)
    return make_part(template, (kind.lens,), (max(kind.counts),), arguments)


def address_of(model: str) -> int:
    """Return the address of the compiled function of a kind of lens."""
    return address(_compile_lens(model))


def through(model: str) -> Callable[[Array, Array, Array, bool], int]:
    """Return the function of a kind of lens that Python calls; see :func:`template`."""
    return partial(call_lens, address_of(model))
