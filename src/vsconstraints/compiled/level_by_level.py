"""Levels 1 and 2 of the hierarchy by themselves, for a hierarchy whose QPs a solver with a name answers."""

from __future__ import annotations

import numpy as np

from ..rows import Array, BoolArray
from .compiler import compiled
from .least_residual import least_residual
from .least_violation import least_violation
from .levels import CENTER, ORIGIN
from .linear import copy_vector

VECTOR, MATRIX = "float64[::1]", "float64[:, ::1]"


@compiled(f"int64({MATRIX}, {VECTOR}, {VECTOR}, {MATRIX}, {VECTOR})")
def violate_least(A: Array, c: Array, weights: Array, box: Array, x: Array) -> int:
    """See :func:`.least_violation`."""
    code: int = least_violation(A, c, weights, box, x)
    return code


@compiled(f"boolean({MATRIX}, {VECTOR}, {MATRIX}, {MATRIX}, {VECTOR}, {VECTOR}, boolean[::1], float64)")
def track_best(
    G: Array, center: Array, E: Array, walls: Array, sides: Array, x: Array, active: BoolArray, tolerance: float
) -> bool:
    """See :func:`.least_residual`: from x (n,), with the task's minimiser ``center`` (n,)."""
    C, X = np.zeros((int(ORIGIN), x.size)), np.empty((1, x.size))
    copy_vector(C[CENTER], center)
    copy_vector(X[0], x)
    proved: bool = least_residual(G, C, E, walls, sides, X, active, tolerance)
    copy_vector(x, X[0])
    return proved
