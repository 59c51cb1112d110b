"""Resolvers ``priority``, eq. (15), and ``additive``, compiled."""

from __future__ import annotations

import math

import numpy as np

from ..formulas.row import EQUAL, PUSH
from ..rows import Array, BoolArray
from ..rows.tolerances import ZERO_GRADIENT
from .codes import NEEDS_PYTHON, RANK_LOSS, SOLVED, TOLERANCE
from .compiler import compiled, in_place
from .laws import RESOLVER, SCRATCH, load_law
from .least_squares import bring, resolve
from .linear import QR, START
from .resolving import checkable, demanded, finished, follow_alone, tell_alone, valid
from .scratch import emptied, matrix
from .signatures import FLOAT, INT, MATRIX, VECTOR, signature
from .workspace import Answer, LawArrays, RowArrays, Scratch, TaskArrays


@in_place
def gather(law: LawArrays, rows: RowArrays, acted: BoolArray, least: float, A: Array) -> int:
    """Copy the active rows with φ ≥ least, with their bounds, divided by the norms of the rows.

    Return their number.
    """
    n = rows.Lg.shape[1]
    at = START
    for i in range(rows.phi.size):
        if acted[i] and rows.phi[i] >= least:
            norm = np.sqrt(law.squared[i])
            inverse = 0.0
            if norm > ZERO_GRADIENT * rows.scale[i]:
                inverse = 1.0 / norm
            for j in range(n):
                A[at, j] = inverse * rows.Lg[i, j]
            A[at, n] = inverse * law.asked[i]
            at += 1
    return at


@compiled(RESOLVER, from_python=False)
def priority(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """Compute the command of :class:`vsconstraints.controllers.resolvers.Priority`.

    The option is the rank tolerance. Return ``SOLVED``; ``RANK_LOSS`` if rows with φ ≥ 0 have lost
    full row rank, with the answer in the least-squares sense; or ``NEEDS_PYTHON`` if the input is
    refused or numbers leave the range.
    """
    law = load_law(address)
    if not valid(law, rows, task, answer):
        return NEEDS_PYTHON
    tolerance = law.options[TOLERANCE]
    qdd = answer.qdd
    acted = answer.acted
    J = task.J
    b = task.b
    rest = task.rest
    m = rows.phi.size
    n = qdd.size
    scratch = emptied(law)
    A: Array = matrix(scratch, m, n + 1)
    qr = QR(A, A)  # unused unless the task is tracked first
    least = 0.0
    # a task of full column rank is tracked first, and corrected for the active rows
    tracked = law.tracks != 0 or J.shape[0] >= n
    if tracked:
        _, qr, least = resolve(A[:0], J, b, tolerance, rest, qdd, scratch)
        tell_alone(answer)
    if not demanded(address, law, rows, qdd, EQUAL):
        return NEEDS_PYTHON
    for i in range(m):
        acted[i] = law.asked[i] != math.inf
    acting = gather(law, rows, acted, -math.inf, A)
    active = A[:acting]
    is_resolved = tracked
    if tracked and acting > 0:
        is_resolved = bring(qr, least, active, tolerance, qdd, scratch)
    if is_resolved:
        return finished(law, rows, qdd, SOLVED)
    rank, _, _ = resolve(active, J, b, tolerance, rest, qdd, scratch)
    if rank == acting:
        return finished(law, rows, qdd, SOLVED)
    # dependent rows that are active before they reach their boundary are met in the least-squares
    # sense
    reached = gather(law, rows, acted, 0.0, A)
    if reached < acting:
        unused = matrix(scratch, 1, n)[0]
        rank, _, _ = resolve(A[:reached], J, b, tolerance, rest, unused, scratch)
        if rank == reached:
            return finished(law, rows, qdd, SOLVED)
    return RANK_LOSS if checkable(law, rows, qdd) else NEEDS_PYTHON


@compiled(signature(INT, SCRATCH, MATRIX, VECTOR, FLOAT, VECTOR, VECTOR), from_python=False)
def track(scratch: Scratch, J: Array, b: Array, tolerance: float, rest: Array, qdd: Array) -> int:
    """Set q̈ ← q̈₀ + J†(b − J q̈₀), the q̈ nearest to q̈₀ of those that track best; return 0.

    It is called by its address, so that it is compiled only once for all callers.
    """
    taken = scratch.taken[0]
    resolve(J[:0], J, b, tolerance, rest, qdd, scratch)
    scratch.taken[0] = taken
    return 0


@in_place
def pushed(law: LawArrays, rows: RowArrays, acted: BoolArray, z: Array) -> bool:
    """Add Σ cᵢ L_gφᵢ† to z (n,), with cᵢ the pushes that the demand requires.

    Mark the rows that push in ``acted`` (m,); return True if there is one.
    """
    push = law.asked
    some = False
    for i in range(push.size):
        acted[i] = push[i] != math.inf
        some |= acted[i]
        # a row whose gradient vanishes cannot be pushed: its pseudoinverse is zero
        if acted[i] and law.squared[i] > 0.0:
            multiple = push[i] / law.squared[i]
            for j in range(z.size):
                z[j] += multiple * rows.Lg[i, j]
    return some


@compiled(RESOLVER, from_python=False)
def additive(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """Compute the command of :class:`vsconstraints.controllers.resolvers.Additive`.

    The option is the rank tolerance. Return ``SOLVED``, or ``NEEDS_PYTHON`` if the input is refused
    or numbers leave the range.
    """
    law = load_law(address)
    if not valid(law, rows, task, answer):
        return NEEDS_PYTHON
    follow_alone(law, task, answer)
    if not demanded(address, law, rows, answer.qdd, PUSH):
        return NEEDS_PYTHON
    pushed(law, rows, answer.acted, answer.qdd)
    return finished(law, rows, answer.qdd, SOLVED)
