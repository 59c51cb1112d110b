"""Shared parts of compiled resolvers: input checks, unconstrained baseline, bounds, memory."""

from __future__ import annotations

import math

import numpy as np

from ..rows import Array
from ..rows.checks import FARTHEST, ROUNDING
from .codes import INCOMPATIBLE, NEEDS_PYTHON, TOLERANCE
from .compiler import in_place, inner
from .laws import within, write_rates
from .least_violation import GREATEST, LEAST
from .linear import START, copy_vector, finite, in_range, out_of_range, squared_length
from .parts import call_int_pointer
from .scratch import matrix
from .workspace import Answer, LawArrays, RowArrays, Scratch, TaskArrays


@in_place
def valid(law: LawArrays, rows: RowArrays, task: TaskArrays, answer: Answer) -> bool:
    """True if :func:`vsconstraints.rows.checks.check` accepts rows and task, and the outputs fit.

    Squares must be in range. Writes the squared norms of the row gradients.
    """
    if not fit_together(law, rows, task, answer):
        return False
    phi = rows.phi
    Lf = rows.Lf
    gain = rows.switching_gain
    scale = rows.scale
    n = answer.qdd.size
    wrong = False
    for i in range(phi.size):
        law.squared[i] = squared_length(rows.Lg, i, START, n)
        wrong |= out_of_range(law.squared[i])
        wrong |= not abs(phi[i]) < math.inf
        wrong |= not abs(Lf[i]) < math.inf
        wrong |= phi[i] / FARTHEST > scale[i]
        wrong |= not 0.0 < gain[i] < math.inf
        wrong |= not 0.0 < scale[i] < math.inf
    return not wrong and in_range(task.J) and finite(task.b)


@in_place
def fit_together(law: LawArrays, rows: RowArrays, task: TaskArrays, answer: Answer) -> bool:
    """True if rows, task and outputs have the sizes of the law."""
    m = law.asked.size
    n = answer.qdd.size
    if rows.phi.size != m or rows.Lf.size != m or answer.acted.size != m:
        return False
    if rows.switching_gain.size != m or rows.scale.size != m:
        return False
    if rows.Lg.shape[0] != m or rows.Lg.shape[1] != n:
        return False
    k = task.b.size
    return bool(n > 0 and task.J.shape[0] == k and task.J.shape[1] == n)


@in_place
def measurable(law: LawArrays, rows: RowArrays, task: TaskArrays, answer: Answer) -> bool:
    """True if the input is :func:`valid` and the outputs have room for slack and iterations."""
    return (
        answer.slack.size == rows.phi.size
        and answer.iterations.size > 0
        and valid(law, rows, task, answer)
    )


@inner
def rates(law: LawArrays, rows: RowArrays, qdd: Array) -> Array:
    """Return L_gφ q̈ (m,) of the unconstrained command, or (0,) if the demand does not use it.

    The ‖q̈‖ of that command is stored for the demand.
    """
    count = rows.phi.size if law.tracks else 0
    tracked = law.tracked[:count]
    squared = 0.0
    for j in range(qdd.size):
        squared += qdd[j] * qdd[j]
    law.effort[0] = np.sqrt(squared) if law.tracks else math.nan
    write_rates(rows.Lg, qdd, tracked)
    return tracked


@inner
def demanded(address: int, law: LawArrays, rows: RowArrays, qdd: Array, purpose: int) -> bool:
    """Write the bounds of the rows to ``law.asked``. Return False if one is not a number.

    q̈ is the unconstrained command, if the demand uses it.
    """
    tracked = rates(law, rows, qdd)
    arguments = (address, rows, tracked, purpose, law.after, law.asked)
    code: int = call_int_pointer(law.demand, arguments)
    return code == 0


@in_place
def tell_alone(answer: Answer) -> None:
    """Report the current q̈ as the command of the unconstrained baseline."""
    copy_vector(answer.alone, answer.qdd)


@in_place
def follow_alone(law: LawArrays, task: TaskArrays, answer: Answer) -> None:
    """Set q̈ ← q̈₀ + J†(b − J q̈₀), with the law's rank tolerance.

    q̈ is also reported as the command of the unconstrained baseline.
    """
    tolerance = law.options[TOLERANCE]
    call_int_pointer(law.track, (law.scratch, task.J, task.b, tolerance, task.rest, answer.qdd))
    tell_alone(answer)


@inner
def acceleration_box(rows: RowArrays, bound: float, n: int, scratch: Scratch) -> Array:
    """Return the least and the greatest q̈ (2, n) within ±bound and the limits of the rows."""
    box = matrix(scratch, 2, n)
    for j in range(n):
        box[LEAST, j] = within(rows, j, -bound)
        box[GREATEST, j] = within(rows, j, bound)
    return box


@inner
def resolve_otherwise(
    address: int, law: LawArrays, rows: RowArrays, task: TaskArrays, answer: Answer
) -> int:
    """Let the resolver answer that a law names in case its own has no answer.

    Return its code, or ``INCOMPATIBLE`` if there is none.
    """
    if law.otherwise == 0:
        return INCOMPATIBLE
    code: int = call_int_pointer(law.otherwise, (address, rows, task, answer))
    return code


@in_place
def finished(law: LawArrays, rows: RowArrays, qdd: Array, code: int) -> int:
    """Store the memory of the demand and L_gφ q̈, and return the code of the answer.

    Return ``NEEDS_PYTHON``, with nothing stored, if the answer is not :func:`checkable`.
    """
    if not checkable(law, rows, qdd):
        return NEEDS_PYTHON
    write_rates(rows.Lg, qdd, law.last_rates)
    for i in range(law.after.shape[0]):
        for j in range(law.after.shape[1]):
            law.memory[i, j] = law.after[i, j]
    return code


@in_place
def checkable(law: LawArrays, rows: RowArrays, qdd: Array) -> bool:
    """True if the accelerations are finite and :func:`.beyond_rounding` accepts them."""
    size = 0.0
    wrong = 0
    for j in range(qdd.size):
        size += qdd[j] * qdd[j]
    size *= ROUNDING * ROUNDING
    for i in range(rows.phi.size):
        wrong |= not (law.squared[i] * size <= rows.switching_gain[i] * rows.switching_gain[i])
    return wrong == 0 and size < math.inf
