"""Laws of eq. (15), compiled: tracking, the sliding mode, and both potential fields."""

from __future__ import annotations

import numpy as np

from ..rows import Array, BoolArray
from .compiler import compiled, inner
from .linear import ASK, DONE, finite, positive, rank_of, resolve

TRACKING, SLIDING, PRIORITY, ADDITIVE = 0, 1, 2, 3
"""The laws; the last two are the blends of the potential field."""


@inner
def valid(m: int, phi: Array, Lg: Array, Lf: Array, gain: Array, scale: Array, J: Array, b: Array, n: int) -> bool:
    """Whether :func:`vsconstraints.rows.check` has nothing to say, and outputs of n joints fit."""
    return (
        phi.size == m
        and Lg.shape[0] == m
        and Lf.size == m
        and gain.size == m
        and scale.size == m
        and n > 0
        and J.shape[1] == n
        and Lg.shape[1] == n
        and b.size == J.shape[0]
        and finite(phi)
        and finite(Lg)
        and finite(Lf)
        and positive(gain)
        and positive(scale)
        and finite(J)
        and finite(b)
    )


@inner
def gather(Lg: Array, demand: Array, acted: BoolArray, A: Array, target: Array) -> None:
    """Copy the rows that act."""
    m, n = Lg.shape
    at = 0
    for i in range(m):
        if acted[i]:
            target[at] = demand[i]
            for j in range(n):
                A[at, j] = Lg[i, j]
            at += 1


CONSTANT = "Array(float64, 1, 'C', readonly=True)"
"""Signature of a vector that may be read-only, as those of a set of constraints are."""

ROWS = f"int64, float64[::1], float64[:, ::1], float64[::1], {CONSTANT}, {CONSTANT}"
"""Signature of the number of labels, φ, L_gφ, L_fφ, u⁺ and scale."""

TASK = "float64[:, ::1], float64[::1]"
"""Signature of J and b."""

OUTPUT = "boolean[::1], float64[::1]"
"""Signature of the rows that acted, and q̈."""


@compiled(f"int64({ROWS}, {TASK}, float64, int64, float64, float64, float64, {OUTPUT})")
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
        Singular values below this fraction of the largest one count as zero.
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
    if law != SLIDING:
        resolve(Lg[:0], demand[:0], J, b, tolerance, qdd)
    acting = reached = 0
    for i in range(m):
        demand[i] = -gain[i]
        acted[i] = law == SLIDING and phi[i] >= 0.0
        if law >= PRIORITY:
            psi = max(1.0 + phi[i] / (region * scale[i]), 0.0)
            if exponent != 1.0:
                psi = psi**exponent
            acted[i] = psi > 0.0
            rate = squared = 0.0
            for j in range(n):
                rate += Lg[i, j] * qdd[j]
                squared += Lg[i, j] * Lg[i, j]
            if law == PRIORITY:
                psi = min(psi, 1.0)
                demand[i] = (1.0 - psi) * rate - psi * strength * gain[i]
            else:
                # a row whose gradient vanishes cannot be pushed: its pseudoinverse is zero
                demand[i] = psi * strength * gain[i] / squared if acted[i] and squared > 0.0 else 0.0
        acting += acted[i]
        reached += acted[i] and phi[i] >= 0.0
    if law == ADDITIVE:
        for i in range(m):
            for j in range(n):
                qdd[j] -= demand[i] * Lg[i, j]
    elif law == SLIDING or acting > 0:
        A, target = np.empty((acting, n)), np.empty(acting)
        gather(Lg, demand, acted, A, target)
        if resolve(A, target, J, b, tolerance, qdd) < acting:
            # a dependence among rows that act before their boundary is reached is met in the least-squares sense
            at_boundary = acted.copy()
            for i in range(m):
                at_boundary[i] = acted[i] and phi[i] >= 0.0
            gather(Lg, demand, at_boundary, A, target)
            if reached == acting or rank_of(A[:reached], tolerance) < reached:
                return ASK
    return DONE if finite(qdd) else ASK
