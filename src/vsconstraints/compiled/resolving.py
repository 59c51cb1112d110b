"""Shared parts of compiled resolvers: input checks, unconstrained baseline, bounds, memory."""

from __future__ import annotations

import math

import numpy as np

from ..rows import Array
from ..rows.checks import FARTHEST, ROUNDING
from .codes import NEEDS_PYTHON, TOLERANCE
from .compiler import in_place, inner
from .laws import write_rates
from .linear import START, copy_vector, dot, finite, in_range, out_of_range
from .parts import call_int_pointer
from .workspace import Answer, LawArrays, RowArrays, TaskArrays


@in_place
def valid(law: LawArrays, rows: RowArrays, task: TaskArrays, answer: Answer) -> bool:
    """True if :func:`vsconstraints.rows.checks.check` accepts rows and task, and the outputs fit.

    Squares must be in range. Writes the squared norms of the row gradients.
    """
    phi = rows.phi
    Lf = rows.Lf
    gain = rows.switching_gain
    scale = rows.scale
    m = law.asked.size
    n = answer.qdd.size
    if phi.size != m or Lf.size != m or gain.size != m or scale.size != m:
        return False
    if rows.Lg.shape[0] != m or rows.Lg.shape[1] != n:
        return False
    if n <= 0 or task.J.shape[1] != n or task.b.size != task.J.shape[0]:
        return False
    wrong = answer.acted.size != m
    for i in range(m):
        law.squared[i] = dot(rows.Lg, i, rows.Lg, i, START, n)
        wrong |= out_of_range(law.squared[i])
        wrong |= not abs(phi[i]) < math.inf
        wrong |= not abs(Lf[i]) < math.inf
        wrong |= phi[i] / FARTHEST > scale[i]
        wrong |= not 0.0 < gain[i] < math.inf
        wrong |= not 0.0 < scale[i] < math.inf
    return not wrong and in_range(task.J) and finite(task.b)


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
    tracked = law.tracked[: rows.phi.size if law.tracks else 0]
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
    code: int = call_int_pointer(
        law.demand, (address, rows, rates(law, rows, qdd), purpose, law.after, law.asked)
    )
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
    call_int_pointer(
        law.track, (law.scratch, task.J, task.b, law.options[TOLERANCE], task.rest, answer.qdd)
    )
    tell_alone(answer)


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
