"""Resolver ``saturation-exact``, compiled.

It is the hierarchy in the coordinates of the task's scale and null space.
"""

from __future__ import annotations

import math

import numpy as np

from ..formulas.row import BOUND
from ..rows import Array
from .codes import DAMPING, LIMIT, NEEDS_PYTHON, SHORT, SOLVED, TOLERANCE
from .compiler import compiled, in_place, inner
from .hierarchy import Aim, Priorities, aim_at, aim_at_task, hierarchy
from .laws import RESOLVER, load_law
from .least_squares import CERTAIN, pseudoinverse
from .least_violation import GREATEST, LEAST
from .linear import ONE, START, add, apply, clip, copy, dot, length
from .resolving import (
    acceleration_box,
    demanded,
    finished,
    follow_alone,
    measurable,
    resolve_otherwise,
)
from .scratch import blank, emptied, filled, flags, matrix, vector
from .walls import Demands, Resolved, try_unconstrained
from .workspace import Answer, LawArrays, RowArrays, Scratch, TaskArrays

#: Damping relative to that of the hierarchy. The only gain of the task is 1, so that less damping
#: suffices.
LESS = 1e-4


@inner
def directions(J: Array, b: Array, tolerance: float, X: Array, scratch: Scratch) -> Array:
    """Return orthogonal unit rows (1 + p, n): the direction of J†b, and the null space of J.

    J†b is written to X[START].
    """
    k, n = J.shape
    W = matrix(scratch, k, n + 1)
    for i in range(k):
        copy(W, i, J, i, n)
        W[i, n] = b[i]
    certain = CERTAIN * tolerance
    qr, rank, _ = pseudoinverse(W, START, certain, tolerance, W, X, START, scratch)
    T = blank(scratch, ONE + n - rank, n)
    size = length(X, START, n)
    if size > 0.0:
        add(T, START, 1.0 / size, X, START, START, n)
    for d in range(n - rank):
        row = 1 + d
        T[row, rank + d] = 1.0
        apply(qr, rank, T, row)
    return T


@inner
def to_coordinates(
    demands: Demands, law: LawArrays, box: Array, T: Array, scratch: Scratch
) -> Demands:
    """Return rows and box of q̈ as rows of y, with q̈ = Σ y_d T_d.

    They are the m rows, then the upper and the lower bounds of the n joints.
    """
    m, n = demands.A.shape
    p = T.shape[0]
    upper = m
    lower = m + n
    count = m + 2 * n
    A = matrix(scratch, count, p)
    c = vector(scratch, count)
    scale = filled(scratch, count, 1.0)
    weights = filled(scratch, count, 1.0)
    for i in range(m):
        for d in range(p):
            A[i, d] = dot(demands.A, i, T, d, START, n)
        c[i] = demands.c[i]
        scale[i] = max(demands.scale[i], np.sqrt(law.squared[i]))
    for j in range(n):
        for d in range(p):
            A[upper + j, d] = T[d, j]
            A[lower + j, d] = -T[d, j]
        c[upper + j] = box[GREATEST, j]
        c[lower + j] = -box[LEAST, j]
    return Demands(A, c, scale, weights)


@in_place
def write_acceleration(y: Array, T: Array, box: Array, qdd: Array) -> None:
    """Write q̈ = Σ y_d T_d (n,), clipped to the box."""
    for j in range(qdd.size):
        total = 0.0
        for d in range(y.size):
            total += y[d] * T[d, j]
        qdd[j] = clip(total, box[LEAST, j], box[GREATEST, j])


@inner
def scale_bounds(size: float, p: int, scratch: Scratch) -> Array:
    """Return the bounds (2, p) 0 ≤ y₀ ≤ ‖J†b‖ of the task's coordinate; the others are free."""
    bounds = matrix(scratch, 2, p)
    for d in range(p):
        bounds[LEAST, d] = -math.inf
        bounds[GREATEST, d] = math.inf
    bounds[LEAST, 0] = 0.0
    bounds[GREATEST, 0] = size
    return bounds


@inner
def task_aim(size: float, T: Array, rest: Array, tolerance: float, scratch: Scratch) -> Aim:
    """Return the objective y₀ = ‖J†b‖, i.e. the unscaled task, with the rest acceleration T q̈₀."""
    p = T.shape[0]
    J = blank(scratch, ONE, p)
    J[0, 0] = 1.0
    b = vector(scratch, 1)
    b[0] = size
    free = blank(scratch, ONE, p)[0]
    for d in range(p):
        for j in range(rest.size):
            free[d] += T[d, j] * rest[j]
    return aim_at_task(J, b, free, tolerance, scratch)


@compiled(RESOLVER, from_python=False)
def saturation_exact(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """Compute the command of :class:`vsconstraints.controllers.resolvers.SaturationExact`.

    In q̈ = Σ y_d T_d the first T is the direction of J†b, and the others span the null space of J.
    The task is scaled by s = y₀ / ‖J†b‖, 0 ≤ s ≤ 1. The hierarchy finds the largest s.

    The options are those of the hierarchy. Return ``SOLVED`` or ``SHORT``; ``NEEDS_PYTHON`` if the
    input is refused or numbers leave the range; or the code of the hierarchy if it has to answer.
    """
    law = load_law(address)
    if not measurable(law, rows, task, answer):
        return NEEDS_PYTHON
    tolerance = law.options[TOLERANCE]
    damping = law.options[DAMPING]
    m, n = rows.Lg.shape
    qdd = answer.qdd
    scratch = emptied(law)
    follow_alone(law, task, answer)
    if not demanded(address, law, rows, qdd, BOUND):
        return NEEDS_PYTHON
    X = aim_at(qdd, scratch).X
    box = acceleration_box(rows, law.options[LIMIT], n, scratch)
    acted = flags(scratch, m + 2 * n)
    own = Demands(rows.Lg, law.asked, rows.scale, law.asked)
    unscaled = Resolved(qdd, answer.slack, answer.acted)
    if try_unconstrained(own, box, X, acted, unscaled):
        answer.iterations[0] = 0
        return finished(law, rows, qdd, SOLVED)
    T = directions(task.J, task.b, tolerance, X, scratch)
    p = T.shape[0]
    size = length(X, START, n)
    demands = to_coordinates(own, law, box, T, scratch)
    bounds = scale_bounds(size, p, scratch)
    aim = task_aim(size, T, task.rest, tolerance, scratch)
    priorities = Priorities(bounds, LESS * damping, tolerance, True)
    found = Resolved(vector(scratch, p), vector(scratch, m + 2 * n), acted)
    code, _ = hierarchy(demands, aim, priorities, found, scratch)
    if code not in (SOLVED, SHORT):
        return resolve_otherwise(address, law, rows, task, answer)
    write_acceleration(found.qdd, T, box, qdd)
    for i in range(m):
        answer.acted[i] = acted[i]
    answer.iterations[0] = 0
    return finished(law, rows, qdd, code)
