"""What compiled resolvers share: what they may be given, tracking alone, the demands, and what is
remembered.
"""

from __future__ import annotations

import math

from ..rows import Array
from ..rows.checks import FARTHEST, ROUNDING
from .compiler import in_place, inner
from .laws import write_rates
from .linear import START, copy_vector, dot, finite, in_range, out_of_range
from .parts import call_int_pointer
from .workspace import NEEDS_PYTHON, Answer, LawArrays, RowArrays, TaskArrays


@in_place
def valid(law: LawArrays, rows: RowArrays, task: TaskArrays, answer: Answer) -> bool:
    """Whether :func:`vsconstraints.rows.checks.check` has nothing to say, squares are in range, and
    outputs fit.

    Writes the squares of the rows' lengths.
    """
    phi = rows.phi
    Lf = rows.Lf
    gain = rows.switching_gain
    scale = rows.scale
    m = law.asked.size
    n = answer.qdd.size
    if phi.size != m or rows.Lg.shape[0] != m or Lf.size != m or gain.size != m or scale.size != m:
        return False
    if n <= 0 or task.J.shape[1] != n or rows.Lg.shape[1] != n or task.b.size != task.J.shape[0]:
        return False
    wrong = answer.acted.size != m
    for i in range(m):
        law.squared[i] = dot(rows.Lg, i, rows.Lg, i, START, n)
        wrong |= out_of_range(law.squared[i])
        wrong |= not ((abs(phi[i]) < math.inf) & (abs(Lf[i]) < math.inf))
        wrong |= phi[i] / FARTHEST > scale[i]
        wrong |= not (
            (gain[i] > 0.0) & (gain[i] < math.inf) & (scale[i] > 0.0) & (scale[i] < math.inf)
        )
    return not wrong and in_range(task.J) and finite(task.b)


@in_place
def measurable(law: LawArrays, rows: RowArrays, task: TaskArrays, answer: Answer) -> bool:
    """Likewise, with outputs for slack and iterations."""
    return (
        answer.slack.size == rows.phi.size
        and answer.iterations.size > 0
        and valid(law, rows, task, answer)
    )


@inner
def rates(law: LawArrays, rows: RowArrays, qdd: Array) -> Array:
    """L_gφ q̈ (m,) of the command that tracks if the law's demand depends on it, or (0,); its ‖q̈‖
    is kept.
    """
    tracked = law.tracked[: rows.phi.size if law.tracks else 0]
    squared = 0.0
    for j in range(qdd.size):
        squared += qdd[j] * qdd[j]
    law.effort[0] = math.sqrt(squared) if law.tracks else math.nan
    write_rates(rows.Lg, qdd, tracked)
    return tracked


@inner
def demanded(address: int, law: LawArrays, rows: RowArrays, qdd: Array, purpose: int) -> bool:
    """Write what rows ask for to ``law.asked``, with tracking alone in q̈ where used; False if one
    is no number.
    """
    code: int = call_int_pointer(
        law.demand, (address, rows, rates(law, rows, qdd), purpose, law.after, law.asked)
    )
    return code == 0


@in_place
def tell_alone(answer: Answer) -> None:
    """Say that q̈, as it is now, is what tracking alone commands."""
    copy_vector(answer.alone, answer.qdd)


@in_place
def follow_alone(law: LawArrays, task: TaskArrays, answer: Answer) -> None:
    """q̈ ← q̈₀ + J†(b − J q̈₀), with the law's rank tolerance."""
    call_int_pointer(
        law.track, (law.scratch, task.J, task.b, law.options[0], task.rest, answer.qdd)
    )
    tell_alone(answer)


@in_place
def finished(law: LawArrays, rows: RowArrays, qdd: Array, code: int) -> int:
    """The code of an answer, of which what the demand gave back and L_gφ q̈ are kept; or
    ``NEEDS_PYTHON``.
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
    """Whether the accelerations are finite, and :func:`.beyond_rounding` has nothing to say."""
    size = 0.0
    wrong = 0
    for j in range(qdd.size):
        size += qdd[j] * qdd[j]
    size *= ROUNDING * ROUNDING
    for i in range(rows.phi.size):
        wrong |= not (law.squared[i] * size <= rows.switching_gain[i] * rows.switching_gain[i])
    return wrong == 0 and size < math.inf
