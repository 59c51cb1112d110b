"""Levels 1 and 2 of the hierarchy as separate functions.

They serve a hierarchy whose QPs are solved by a solver chosen by name.
"""

from __future__ import annotations

from ..rows import Array, BoolArray
from .compiler import compiled
from .least_residual import ROWS_OF_POINT, least_residual
from .least_violation import least_violation
from .linear import copy_vector
from .scratch import matrix, no_scratch
from .signatures import FLAG, FLAGS, FLOAT, INT, MATRIX, VECTOR, signature


@compiled(signature(INT, MATRIX, VECTOR, VECTOR, MATRIX, VECTOR))
def violate_least(A: Array, c: Array, weights: Array, box: Array, x: Array) -> int:
    """Minimise the violation from x (n,); see :func:`.least_violation`."""
    code: int = least_violation(A, c, weights, box, x, no_scratch())
    return code


@compiled(signature(FLAG, MATRIX, VECTOR, MATRIX, MATRIX, VECTOR, VECTOR, FLAGS, FLOAT))
def track_best(
    G: Array,
    center: Array,
    E: Array,
    walls: Array,
    sides: Array,
    x: Array,
    active: BoolArray,
    tolerance: float,
) -> bool:
    """Minimise the task's residual from x (n,); see :func:`.least_residual`.

    ``center`` (n,) is the task's minimiser without rows.
    """
    scratch = no_scratch()
    X = matrix(scratch, ROWS_OF_POINT, x.size)
    copy_vector(X[1], center)
    copy_vector(X[0], x)
    proved: bool = least_residual(G, E, walls, sides, X, active, tolerance, scratch)
    copy_vector(x, X[0])
    return proved
