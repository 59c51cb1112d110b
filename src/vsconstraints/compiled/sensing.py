"""Camera pose estimated from an image, and measurements that a controller receives.

See :func:`vsconstraints.vision.measurement.estimated_pose` and
:mod:`vsconstraints.simulation.sensing`.
"""

from __future__ import annotations

import math

import numpy as np

from ..formulas.features import MINIMUM_DEPTH, image_row
from ..formulas.rotation import turn_by
from ..formulas.vectors import (
    Matrix,
    Vector,
    matrix,
    minus,
    plus,
    product,
    rotate,
    rotate_inverse,
    vector,
)
from ..rows import Array, IntArray
from . import images
from . import scratch as parts
from .compiler import IN_PLACE, OPTIONS, compiled, in_place, inner, register_formulas
from .images import Sensing
from .kinematics import put, put_matrix
from .least_squares import pseudoinverse
from .linear import START
from .memory import zeros
from .parts import address, call_int_pointer, checked, load_step, struct_loader
from .signatures import FLAG, FLOAT, INT, INTEGERS, MATRIX, VECTOR, signature
from .workspace import Scratch, Step

in_place(images.usable)
register_formulas()

ITERATIONS = 10  #: Maximum number of iterations of the pose estimation; three or four are usual.
CONVERGED = 1e-10  #: Step [m, rad] at which the pose estimation ends.
#: Directions of the camera's motion keep their initial values if the image is less sensitive to
#: them than this, relative to the most sensitive direction.
RANK_TOLERANCE = 1e-4
#: Full rank is certain if the bound of the least singular value exceeds the tolerance by this
#: factor. The search ends where a step is small, however accurate it is.
CERTAIN = 1.01


@inner
def pose_step(
    markers: Array, seen: Array, R: Matrix, t: Vector, step: Array, scratch: Scratch
) -> float:
    """Write the Gauss–Newton step (1, 6) from a pose, and return its length."""
    W = parts.matrix(scratch, 2 * len(markers), 7)
    for i in range(len(markers)):
        from_camera = minus(vector(markers[i]), t)
        X, Y, depth = rotate_inverse(R, from_camera)
        Z = max(depth, MINIMUM_DEPTH)
        x = X / Z
        y = Y / Z
        for c in range(2):
            row = 2 * i + c
            entries = image_row(c, x, y, Z)
            for j in range(6):
                W[row, j] = entries[j]
        W[2 * i, 6] = seen[i, 0] - x
        W[2 * i + 1, 6] = seen[i, 1] - y
    pseudoinverse(W, START, CERTAIN * RANK_TOLERANCE, RANK_TOLERANCE, W, step, START, scratch)
    squared = 0.0
    for j in range(6):
        squared += step[0, j] * step[0, j]
    length: float = np.sqrt(squared)
    return length


@inner
def explain(
    markers: Array, seen: Array, R: Matrix, t: Vector, scratch: Scratch
) -> tuple[bool, Matrix, Vector]:
    """Return the pose that explains normalised markers (m, 2) best, searched from R and t on.

    The first value is False if numbers are not finite.
    """
    step = parts.matrix(scratch, 1, 6)
    taken = scratch.taken[0]
    for _ in range(ITERATIONS):
        scratch.taken[0] = taken
        length = pose_step(markers, seen, R, t, step, scratch)
        if not length < math.inf:
            return False, R, t
        shift = (step[0, 0], step[0, 1], step[0, 2])
        turn = (step[0, 3], step[0, 4], step[0, 5])
        t = plus(rotate(R, shift), t)
        R = product(R, turn_by(turn))
        if length < CONVERGED:
            break
    return True, R, t


@compiled(signature(FLAG, MATRIX, MATRIX, MATRIX, VECTOR, VECTOR, INTEGERS), OPTIONS)
def estimate(
    markers: Array, seen: Array, R: Array, t: Array, numbers: Array, taken: IntArray
) -> bool:
    """Move a pose R (3, 3), t (3,) to where it explains normalised markers (m, 2) best.

    Return False if numbers are not finite. ``numbers`` and ``taken`` are those of a
    :class:`.Scratch`.
    """
    scratch = Scratch(numbers, taken)
    finite, turned_R, where = explain(markers, seen, matrix(R), vector(t), scratch)
    put_matrix(turned_R, R)
    put(where, t)
    return finite


load_sensing = struct_loader(zeros(Sensing))


@compiled(signature(INT, INT, INT, INT, FLOAT, INT), OPTIONS, from_python=False)
def observe_at(
    sensing_address: int, true_address: int, believed_address: int, t: float, k: int
) -> int:
    """Write the measurements of sample k, at t [s], to the believed step.

    They are taken from the true step. Return 0, or 1 if no pose with all markers in front of the
    camera explains the image.
    """
    sensing = load_sensing(sensing_address)
    true = load_step(true_address)
    believed = load_step(believed_address)
    lens = sensing.lenses
    pixels = true.pixels
    camera = believed.camera[0]
    scratch = sensing.scratch
    held = sensing.images
    if lens.address != 0:
        call_int_pointer(lens.address, (lens.true, pixels, lens.pixels, False))
        pixels = lens.pixels
    slot = images.usable(held, k, t, pixels)
    pixels = held.held[slot]
    if lens.address != 0:
        call_int_pointer(lens.address, (lens.believed, pixels, lens.pixels, True))
        pixels = lens.pixels
    scratch.taken[0] = 0
    seen = parts.matrix(scratch, len(pixels), 2)
    for i in range(len(seen)):
        for c in range(2):
            pixel = pixels[i, c]
            believed.measured[i, c] = pixel
            seen[i, c] = (pixel - camera.offset[c]) / camera.focal[c]
    true_R = matrix(true.camera_R)
    true_t = vector(true.camera_t)
    found, R, where = explain(believed.markers, seen, true_R, true_t, scratch)
    if not found:
        return 1
    for i in range(len(seen)):
        from_camera = minus(vector(believed.markers[i]), where)
        _, _, depth = rotate_inverse(R, from_camera)
        if not depth >= MINIMUM_DEPTH:
            return 1
        believed.measured[i, 2] = depth
    put_matrix(R, believed.camera_R)
    put(where, believed.camera_t)
    measurement = believed.measurement[0]
    measurement.given = measurement.pose_given = 1
    measurement.time = held.taken[slot] if held.dated else t
    return 0


OBSERVE = address(observe_at)  #: Its address.


@checked(Sensing, Step, Step, calls=OBSERVE)
@compiled(signature(INT, INT, INT, INT, INT, FLOAT, INT), IN_PLACE)
def observe(function: int, sensing: int, true: int, believed: int, t: float, k: int) -> int:
    """Call :func:`observe_at` from Python."""
    code: int = call_int_pointer(function, (sensing, true, believed, t, k))
    return code
