"""Resolver ``saturation-exact``, compiled.

It is the hierarchy in the coordinates of the task's scale and null space.
"""

from __future__ import annotations

import math

import numpy as np

from ..formulas.row import BOUND
from ..rows import Array
from .codes import DAMPING, INCOMPATIBLE, LIMIT, NEEDS_PYTHON, SHORT, SOLVED, TOLERANCE
from .compiler import compiled, inner
from .hierarchy import Aim, Priorities, aim_at, aim_at_task, hierarchy
from .laws import RESOLVER, load_law, within
from .least_squares import CERTAIN, pseudoinverse
from .least_violation import GREATEST, LEAST
from .linear import ONE, START, add, apply, copy, dot, length
from .parts import call_int_pointer
from .resolving import demanded, finished, follow_alone, measurable
from .scratch import blank, emptied, filled, flags, matrix, vector
from .walls import ALL_MET, Demands, Resolved, count_resisting
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
    qr, rank, _ = pseudoinverse(W, START, CERTAIN * tolerance, tolerance, W, X, START, scratch)
    T = blank(scratch, ONE + n - rank, n)
    size = length(X, START, n)
    add(T, START, 1.0 / size if size > 0.0 else 0.0, X, START, START, n)
    for d in range(n - rank):
        T[1 + d, rank + d] = 1.0
        apply(qr, rank, T, 1 + d)
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
    A = matrix(scratch, m + 2 * n, p)
    c = vector(scratch, m + 2 * n)
    scale = filled(scratch, m + 2 * n, 1.0)
    for d in range(p):
        for i in range(m):
            A[i, d] = dot(demands.A, i, T, d, START, n)
            c[i] = demands.c[i]
            scale[i] = max(demands.scale[i], np.sqrt(law.squared[i]))
        for j in range(n):
            A[upper + j, d] = T[d, j]
            c[upper + j] = box[GREATEST, j]
            A[lower + j, d] = -T[d, j]
            c[lower + j] = -box[LEAST, j]
    return Demands(A, c, scale, filled(scratch, m + 2 * n, 1.0))


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
    bound = law.options[LIMIT]
    damping = law.options[DAMPING]
    m, n = rows.Lg.shape
    qdd = answer.qdd
    scratch = emptied(law)
    follow_alone(law, task, answer)
    if not demanded(address, law, rows, qdd, BOUND):
        return NEEDS_PYTHON
    X = aim_at(qdd, scratch).X
    box = matrix(scratch, 2, n)
    acted = flags(scratch, m + 2 * n)
    for j in range(n):
        box[LEAST, j] = within(rows, j, -bound)
        box[GREATEST, j] = within(rows, j, bound)
    own = Demands(rows.Lg, law.asked, rows.scale, law.asked)
    unscaled = Resolved(qdd, answer.slack, answer.acted)
    if count_resisting(own, box, X, acted, unscaled) == ALL_MET:
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
        if law.otherwise == 0:
            return INCOMPATIBLE
        answered: int = call_int_pointer(law.otherwise, (address, rows, task, answer))
        return answered
    for j in range(n):
        qdd[j] = 0.0
        for d in range(p):
            qdd[j] += found.qdd[d] * T[d, j]
        qdd[j] = min(max(qdd[j], box[LEAST, j]), box[GREATEST, j])
    for i in range(m):
        answer.acted[i] = acted[i]
    answer.iterations[0] = 0
    return finished(law, rows, qdd, code)
