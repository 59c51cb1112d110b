"""Laws of eq. (15), compiled: tracking, the sliding mode, and both potential fields."""

from __future__ import annotations

import math

import numpy as np

from ..qp.lexicographic import ZERO_GRADIENT
from ..rows import ROUNDING, Array, BoolArray
from .compiler import compiled, inner
from .layout import ADDITIVE, PRIORITY, SLIDING, TRACKING
from .least_squares import bring, resolve
from .linear import ASK, DONE, START, dot, finite, in_range


@inner
def valid(m: int, phi: Array, Lg: Array, Lf: Array, gain: Array, scale: Array, J: Array, b: Array, n: int) -> bool:
    """Whether :func:`vsconstraints.rows.check` has nothing to say, squares are in range, and outputs fit."""
    if phi.size != m or Lg.shape[0] != m or Lf.size != m or gain.size != m or scale.size != m:
        return False
    if n <= 0 or J.shape[1] != n or Lg.shape[1] != n or b.size != J.shape[0]:
        return False
    wrong = 0
    for i in range(m):
        wrong |= not ((abs(phi[i]) < math.inf) & (abs(Lf[i]) < math.inf))
        wrong |= not ((gain[i] > 0.0) & (gain[i] < math.inf) & (scale[i] > 0.0) & (scale[i] < math.inf))
    return wrong == 0 and in_range(Lg) and in_range(J) and finite(b)


@inner
def checkable(Lg: Array, gain: Array, qdd: Array) -> bool:
    """Whether the accelerations are finite, and :func:`vsconstraints.rows.beyond_rounding` has nothing to say."""
    n = qdd.size
    size = 0.0
    for j in range(n):
        size += qdd[j] * qdd[j]
    size *= ROUNDING * ROUNDING
    wrong = 0
    for i in range(gain.size):
        wrong |= not (dot(Lg, i, Lg, i, START, n) * size <= gain[i] * gain[i])
    return wrong == 0 and size < math.inf


@inner
def gather(Lg: Array, demand: Array, scale: Array, phi: Array, acted: BoolArray, least: float, A: Array) -> int:
    """Copy the rows that act and have φ ≥ least, with their demands, divided by their lengths; their number."""
    n = Lg.shape[1]
    at = START
    for i in range(phi.size):
        if acted[i] and phi[i] >= least:
            length = math.sqrt(dot(Lg, i, Lg, i, START, n))
            inverse = 1.0 / length if length > ZERO_GRADIENT * scale[i] else 0.0
            for j in range(n):
                A[at, j] = inverse * Lg[i, j]
            A[at, n] = inverse * demand[i]
            at += 1
    return at


CONSTANT = "Array(float64, 1, 'C', readonly=True)"
"""Signature of a vector that may be read-only, as those of a set of constraints are."""

ROWS_SIGNATURE = f"int64, float64[::1], float64[:, ::1], float64[::1], {CONSTANT}, {CONSTANT}"
"""Signature of the number of labels, φ, L_gφ, L_fφ, u⁺ and scale."""

TASK_SIGNATURE = "float64[:, ::1], float64[::1]"
"""Signature of J and b."""

OUTPUT_SIGNATURE = "boolean[::1], float64[::1]"
"""Signature of the rows that acted, and q̈."""


@compiled(f"int64({ROWS_SIGNATURE}, {TASK_SIGNATURE}, float64, int64, float64, float64, float64, {OUTPUT_SIGNATURE})")
def follow(
    m: int,
    phi: Array,
    Lg: Array,
    Lf: Array,
    gain: Array,
    scale: Array,
    J: Array,
    b: Array,
    tolerance: float,
    law: int,
    region: float,
    exponent: float,
    strength: float,
    acted: BoolArray,
    qdd: Array,
) -> int:
    """One of the laws, after a check of the input.

    One function for all of it, since every level of calls is compiled anew.

    Parameters
    ----------
    m
        The number of labels.
    phi, Lg, Lf, gain, scale
        (m,), (m, n), (m,), (m,) and (m,) of the rows.
    J, b
        (k, n) and (k,) of the task.
    tolerance
        Singular values below this fraction of the largest one count as zero, among the acting rows once each is
        divided by its length.
    law
        ``TRACKING``, ``SLIDING``, or a potential field: ``PRIORITY`` or ``ADDITIVE``.
    region, exponent, strength
        Options of the potential field; not used by the others.
    acted, qdd
        (m,) and (n,) outputs.

    Returns
    -------
    int
        ``DONE``, or ``ASK`` where rows with φ ≥ 0 have lost full row rank, where input is refused, and where numbers
        leave the range.
    """
    if not valid(m, phi, Lg, Lf, gain, scale, J, b, qdd.size) or acted.size != m:
        return ASK
    n = qdd.size
    demand = np.empty(m)
    A: Array = np.empty((m, n + 1))
    F, S, least = A, A, 0.0
    # a task of full column rank is tracked first, and corrected for the rows that act
    tracked = law != SLIDING or J.shape[0] >= n
    if tracked:
        _, F, S, least = resolve(A[:0], J, b, tolerance, qdd)
    for i in range(m):
        demand[i] = -gain[i]
        acted[i] = law == SLIDING and phi[i] >= 0.0
    if law >= PRIORITY:
        for i in range(m):
            psi = max(1.0 + phi[i] / scale[i] / region, 0.0)
            if exponent != 1.0:
                psi = psi**exponent
            acted[i] = psi > 0.0
            if not acted[i]:
                continue
            rate = squared = 0.0
            for j in range(n):
                rate += Lg[i, j] * qdd[j]
                squared += Lg[i, j] * Lg[i, j]
            if law == PRIORITY:
                psi = min(psi, 1.0)
                demand[i] = (1.0 - psi) * rate - psi * strength * gain[i]
            else:
                # a row whose gradient vanishes cannot be pushed: its pseudoinverse is zero
                demand[i] = psi * strength * gain[i] / squared if squared > 0.0 else 0.0
    if law == ADDITIVE:
        for i in range(m):
            if acted[i]:
                for j in range(n):
                    qdd[j] -= demand[i] * Lg[i, j]
    elif law != TRACKING:
        acting = gather(Lg, demand, scale, phi, acted, -math.inf, A)
        if (
            not (tracked and (acting == 0 or bring(F, S, least, A[:acting], tolerance, qdd)))
            and resolve(A[:acting], J, b, tolerance, qdd)[0] < acting
        ):
            # a dependence among rows that act before their boundary is reached is met in the least-squares sense
            reached = gather(Lg, demand, scale, phi, acted, 0.0, A)
            if reached == acting or resolve(A[:reached], J, b, tolerance, np.empty(n))[0] < reached:
                return ASK
    return DONE if checkable(Lg, gain, qdd) else ASK
