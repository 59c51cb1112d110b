"""The resolvers ``priority``, eq. (15), and ``additive``, compiled."""

from __future__ import annotations

import math

from ..formulas.row import EQUAL, PUSH
from ..qp.lexicographic import ZERO_GRADIENT
from ..rows import ROUNDING, Array, BoolArray
from .compiler import compiled, in_place, inner, numba
from .laws import MATRIX, RESOLVER, SCRATCH, VECTOR, write_rates
from .least_squares import bring, resolve
from .linear import START, dot, finite, in_range
from .parts import INT, ask
from .scratch import matrix
from .structures import ASK, DONE, Answer, LawArrays, RowArrays, Scratch, TaskArrays


@in_place
def valid(law: LawArrays, rows: RowArrays, task: TaskArrays, answer: Answer) -> bool:
    """Whether :func:`vsconstraints.rows.check` has nothing to say, squares are in range, and outputs fit."""
    phi, Lf, gain, scale = rows.phi, rows.Lf, rows.switching_gain, rows.scale
    m, n = law.asked.size, answer.qdd.size
    if (
        phi.size != m
        or rows.Lg.shape[0] != m
        or Lf.size != m
        or gain.size != m
        or scale.size != m
        or answer.acted.size != m
    ):
        return False
    if n <= 0 or task.J.shape[1] != n or rows.Lg.shape[1] != n or task.b.size != task.J.shape[0]:
        return False
    wrong = 0
    for i in range(m):
        wrong |= not ((abs(phi[i]) < math.inf) & (abs(Lf[i]) < math.inf))
        wrong |= not ((gain[i] > 0.0) & (gain[i] < math.inf) & (scale[i] > 0.0) & (scale[i] < math.inf))
    return wrong == 0 and in_range(rows.Lg) and in_range(task.J) and finite(task.b)


@inner
def rates(law: LawArrays, rows: RowArrays, qdd: Array) -> Array:
    """L_gφ q̈ (m,) of the command that tracks if the law's demand depends on it, or (0,); its ‖q̈‖ is kept."""
    tracked = law.tracked[: rows.phi.size if law.tracks else 0]
    squared = 0.0
    for j in range(qdd.size):
        squared += qdd[j] * qdd[j]
    law.effort[0] = math.sqrt(squared) if law.tracks else math.nan
    write_rates(rows.Lg, qdd, tracked)
    return tracked


@in_place
def remember(law: LawArrays, rows: RowArrays, qdd: Array) -> None:
    """Keep what the demand gave back, and L_gφ q̈ of the answer."""
    write_rates(rows.Lg, qdd, law.last_rates)
    for i in range(law.after.shape[0]):
        for j in range(law.after.shape[1]):
            law.memory[i, j] = law.after[i, j]


@in_place
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


@in_place
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


@compiled(RESOLVER)
def priority(law: LawArrays, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """See :class:`vsconstraints.controllers.resolvers.Priority`; its option is the rank tolerance.

    Returns
    -------
    int
        ``DONE``, or ``ASK`` where rows with φ ≥ 0 have lost full row rank, where input is refused, and where numbers
        leave the range.
    """
    if not valid(law, rows, task, answer):
        return ASK
    tolerance, qdd, acted, J, b = law.options[0], answer.qdd, answer.acted, task.J, task.b
    phi, Lg, scale = rows.phi, rows.Lg, rows.scale
    m, n, scratch = phi.size, qdd.size, law.scratch
    scratch.taken[0] = 0
    A: Array = matrix(scratch, m, n + 1)
    F, S, least = A, A, 0.0
    # a task of full column rank is tracked first, and corrected for the rows that act
    tracked = law.tracks != 0 or J.shape[0] >= n
    if tracked:
        _, F, S, least = resolve(A[:0], J, b, tolerance, qdd, scratch)
    c = law.asked
    if ask(law.demand, (law, rows, rates(law, rows, qdd), EQUAL, law.after, c)):
        return ASK
    for i in range(m):
        acted[i] = c[i] != math.inf
    acting = gather(Lg, c, scale, phi, acted, -math.inf, A)
    if (
        not (tracked and (acting == 0 or bring(F, S, least, A[:acting], tolerance, qdd, scratch)))
        and resolve(A[:acting], J, b, tolerance, qdd, scratch)[0] < acting
    ):
        # a dependence among rows that act before their boundary is reached is met in the least-squares sense
        reached = gather(Lg, c, scale, phi, acted, 0.0, A)
        if reached == acting or resolve(A[:reached], J, b, tolerance, matrix(scratch, 1, n)[0], scratch)[0] < reached:
            return ASK
    if not checkable(Lg, rows.switching_gain, qdd):
        return ASK
    remember(law, rows, qdd)
    return DONE


@compiled(INT(SCRATCH, MATRIX, VECTOR, numba.types.float64, VECTOR))
def track(scratch: Scratch, J: Array, b: Array, tolerance: float, qdd: Array) -> int:
    """q̈ ← J†b of :func:`vsconstraints.controllers.least_norm.least_norm`; returns 0.

    Called by its address, so that it is compiled once for all that need no more of it.
    """
    taken = scratch.taken[0]
    resolve(J[:0], J, b, tolerance, qdd, scratch)
    scratch.taken[0] = taken
    return 0


@in_place
def pushed(rows: RowArrays, push: Array, acted: BoolArray, z: Array) -> bool:
    """Add Σ pushᵢ L_gφᵢ† to z (n,) and mark the rows that push in ``acted`` (m,); whether any does."""
    Lg, n = rows.Lg, z.size
    some = False
    for i in range(push.size):
        acted[i] = push[i] != math.inf
        some |= acted[i]
        squared = dot(Lg, i, Lg, i, START, n)
        # a row whose gradient vanishes cannot be pushed: its pseudoinverse is zero
        if acted[i] and squared > 0.0:
            share = push[i] / squared
            for j in range(n):
                z[j] += share * Lg[i, j]
    return some


@compiled(RESOLVER)
def additive(law: LawArrays, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """See :class:`vsconstraints.controllers.resolvers.Additive`; its option is the rank tolerance.

    Returns
    -------
    int
        ``DONE``, or ``ASK`` where input is refused, and where numbers leave the range.
    """
    if not valid(law, rows, task, answer):
        return ASK
    qdd = answer.qdd
    ask(law.track, (law.scratch, task.J, task.b, law.options[0], qdd))
    push = law.asked
    if ask(law.demand, (law, rows, rates(law, rows, qdd), PUSH, law.after, push)):
        return ASK
    pushed(rows, push, answer.acted, qdd)
    if not checkable(rows.Lg, rows.switching_gain, qdd):
        return ASK
    remember(law, rows, qdd)
    return DONE
