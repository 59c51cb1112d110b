"""The hierarchical quadratic program, compiled: its demands, given to the resolver ``hierarchy``."""

from __future__ import annotations

import math

import numpy as np

from ..rows import Array, BoolArray
from .compiler import compiled
from .hierarchy import Demands, Priorities, Resolved, hierarchy
from .layout import RELAXED_ROWS, RELAXED_SHORT, SHORT  # noqa: F401 - codes of its answers
from .least_distance import FAILED
from .linear import ASK, DONE, finite  # noqa: F401
from .task_priority import OUTPUT_SIGNATURE, ROWS_SIGNATURE, TASK_SIGNATURE, checkable, valid

INPUT_SIGNATURE = f"{ROWS_SIGNATURE}, {TASK_SIGNATURE}, float64, boolean, float64, float64[::1], float64, float64"
"""Signature of the tolerance, the form of the rows, α, weights, box and damping."""


@compiled(f"UniTuple(int64, 2)({INPUT_SIGNATURE}, float64[::1], {OUTPUT_SIGNATURE})")
def descend(
    m: int,
    phi: Array,
    Lg: Array,
    Lf: Array,
    gain: Array,
    scale: Array,
    J: Array,
    b: Array,
    tolerance: float,
    barrier: bool,
    alpha: float,
    weights: Array,
    bound: float,
    damping: float,
    slack: Array,
    acted: BoolArray,
    qdd: Array,
) -> tuple[int, int]:
    """The three levels, as :class:`vsconstraints.controllers.HierarchicalQP` defines them, after a check of the input.

    Parameters
    ----------
    m
        The number of labels.
    phi, Lg, Lf, gain, scale
        (m,), (m, n), (m,), (m,) and (m,) of the rows.
    J, b
        (k, n) and (k,) of the task.
    tolerance, alpha, damping
        Options of the controller.
    barrier
        Whether the rows demand decay of φ; if not, the active ones demand −u⁺.
    weights
        (m,) of level 1.
    bound
        Half the width of the box, or infinity.
    slack, acted, qdd
        (m,), (m,) and (n,) outputs.

    Returns
    -------
    tuple
        The code and the iterations of :func:`vsconstraints.kernels.hierarchy.hierarchy`, or ``ASK``.
    """
    if not valid(m, phi, Lg, Lf, gain, scale, J, b, qdd.size) or acted.size != m or slack.size != m:
        return ASK, 0
    c = np.empty(m)
    for i in range(m):
        if barrier:
            c[i] = -alpha * phi[i] - Lf[i]
        else:
            c[i] = -gain[i] if phi[i] >= 0.0 else math.inf
    demands, priorities = Demands(Lg, c, scale, weights), Priorities(bound, damping, tolerance)
    code, iterations = hierarchy(demands, J, b, priorities, Resolved(qdd, slack, acted))
    if code == FAILED or (checkable(Lg, gain, qdd) and finite(slack)):
        return code, iterations
    return ASK, iterations
