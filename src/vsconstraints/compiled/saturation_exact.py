"""Resolver ``saturation-exact``, compiled.

It is the hierarchy in the coordinates of the task's scale and null space.
"""

from __future__ import annotations

import math

import numpy as np

from ..formulas.row import BOUND
from ..rows import Array
from .compiler import compiled, inner
from .hierarchy import Priorities, aim_at, aim_at_task, hierarchy
from .laws import RESOLVER, load_law, within
from .least_squares import CERTAIN, pseudoinverse
from .least_violation import GREATEST, LEAST
from .linear import ONE, START, add, apply, copy, dot, length
from .parts import call_int_pointer
from .resolving import demanded, finished, follow_alone, measurable
from .scratch import blank, emptied, filled, flags, matrix, vector
from .walls import Demands, Resolved, count_resisting
from .workspace import (
    DAMPING,
    INCOMPATIBLE,
    LIMIT,
    NEEDS_PYTHON,
    SHORT,
    SOLVED,
    TOLERANCE,
    Answer,
    RowArrays,
    Scratch,
    TaskArrays,
)

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
    F, S, rank, _ = pseudoinverse(W, START, CERTAIN * tolerance, tolerance, W, X, START, scratch)
    T = blank(scratch, ONE + n - rank, n)
    size = length(X, START, n)
    add(T, START, 1.0 / size if size > 0.0 else 0.0, X, START, START, n)
    for d in range(n - rank):
        T[1 + d, rank + d] = 1.0
        apply(F, S, rank, T, 1 + d)
    return T


@compiled(RESOLVER, from_python=False)
def saturation_exact(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """Compute the command of :class:`vsconstraints.controllers.resolvers.SaturationExact`.

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
    rest = task.rest
    scratch = emptied(law)
    follow_alone(law, task, answer)
    if not demanded(address, law, rows, qdd, BOUND):
        return NEEDS_PYTHON
    X = aim_at(qdd, scratch).X
    box = matrix(scratch, 2, n)
    fixed = flags(scratch, m + 2 * n)
    for j in range(n):
        box[LEAST, j] = within(rows, j, -bound)
        box[GREATEST, j] = within(rows, j, bound)
    own = Demands(rows.Lg, law.asked, rows.scale, law.asked)
    if count_resisting(own, box, X, fixed, Resolved(qdd, answer.slack, answer.acted)) < 0:
        answer.iterations[0] = 0
        return finished(law, rows, qdd, SOLVED)
    T = directions(task.J, task.b, tolerance, X, scratch)
    p = T.shape[0]
    whole = length(X, START, n)
    # rows and box of q̈ as rows of y, with q̈ = Σ yᵢ Tᵢ and s = y₀ / ‖J†b‖
    A = matrix(scratch, m + 2 * n, p)
    c = vector(scratch, m + 2 * n)
    scale = filled(scratch, m + 2 * n, 1.0)
    for d in range(p):
        for i in range(m):
            A[i, d] = dot(rows.Lg, i, T, d, START, n)
            c[i] = law.asked[i]
            scale[i] = max(rows.scale[i], np.sqrt(law.squared[i]))
        for j in range(n):
            A[m + j, d] = T[d, j]
            c[m + j] = box[GREATEST, j]
            A[m + n + j, d] = -T[d, j]
            c[m + n + j] = -box[LEAST, j]
    bounds = matrix(scratch, 2, p)
    J = blank(scratch, ONE, p)
    free = blank(scratch, ONE, p)[0]
    for d in range(p):
        bounds[LEAST, d] = 0.0 if d == 0 else -math.inf
        bounds[GREATEST, d] = whole if d == 0 else math.inf
        for j in range(rest.size):
            free[d] += T[d, j] * rest[j]
    J[0, 0] = 1.0
    b = vector(scratch, 1)
    b[0] = whole
    found = Resolved(vector(scratch, p), vector(scratch, c.size), fixed)
    priorities = Priorities(bounds, LESS * damping, tolerance, True)
    demands = Demands(A, c, scale, filled(scratch, c.size, 1.0))
    code, _ = hierarchy(
        demands, aim_at_task(J, b, free, tolerance, scratch), priorities, found, scratch
    )
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
        answer.acted[i] = fixed[i]
    answer.iterations[0] = 0
    return finished(law, rows, qdd, code)
