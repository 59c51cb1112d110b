"""Compiled laws, i.e. demand and resolver: the function of a demand, and calls from Python."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from ..formulas.row import Row, asked_for, one_period_ahead
from ..rows import Array, BoolArray, IntArray
from .codes import NEEDS_PYTHON, RELAXED_ROWS, SOLVED
from .compiler import IN_PLACE, compiled, in_place
from .linear import clip
from .memory import zeros
from .parts import (
    call_int_pointer,
    checked,
    make_part,
    set_fields,
    struct_loader,
    to_fixed_tuple,
    warn_refused,
)
from .signatures import CONSTANT, FLAGS, INT, INTEGERS, MATRIX, VECTOR, Reference, signature
from .workspace import Answer, LawArrays, RowArrays, Scratch, TaskArrays

ROWS = Reference(zeros(RowArrays))
TASK = Reference(zeros(TaskArrays))
ANSWER = Reference(zeros(Answer))
SCRATCH = Reference(zeros(Scratch))

#: Signature of a resolver, and therefore of a law: see :class:`.LawArrays`.
RESOLVER = signature(INT, INT, ROWS, TASK, ANSWER)
#: Signature of a demand: see :func:`require_part`.
DEMAND = signature(INT, INT, ROWS, VECTOR, INT, MATRIX, VECTOR)
load_law = struct_loader(zeros(LawArrays))  #: Loaders of the law and of the answer at an address.
load_answer = struct_loader(zeros(Answer))


@in_place
def or_nan(x: Array, i: int) -> float:
    """Return x[i], or NaN if x has no such entry."""
    return x[i] if i < x.size else math.nan


def require_part(
    formula: Callable[..., Any], count: int, memory: int, relative: int, everywhere: int, ahead: int
) -> Any:
    """Make the function that :func:`demand` compiles.

    The function takes the address of a law, its rows, L_gφ q̈ (m,) of the unconstrained command (or
    (0,) if the law does not need it), and a purpose (``BOUND``, ``EQUAL`` or ``PUSH``). It writes
    the next memory (m, f) and the bounds (m,). It returns 0, or 1 if a bound is not a number. The
    margin follows the ``count`` parameters.
    """

    def demands(
        address: int, rows: RowArrays, tracked: Array, purpose: int, after: Array, c: Array
    ) -> int:
        law = load_law(address)
        wrong = 0
        for i in range(c.size):
            total = 0.0
            for j in range(rows.Lg.shape[1]):
                total += abs(rows.Lg[i, j])
            # branches on constants are decided at compilation
            inside = law.parameters[count] * rows.scale[i]
            phi = rows.phi[i] + inside
            if ahead == 1:
                phi = one_period_ahead(phi, rows.K[i], tracked[i], law.period)
            row = Row(
                phi,
                rows.Lf[i],
                or_nan(rows.sigma, i) + inside,
                or_nan(rows.sigma_dot, i),
                or_nan(rows.K, i),
                rows.switching_gain[i],
                rows.scale[i],
                or_nan(tracked, i),
                np.sqrt(law.squared[i]),
                total,
                law.effort[0],
                or_nan(law.last_rates, i),
                law.period,
                law.memory[i] if memory else law.parameters,
            )
            asked = formula(row, *to_fixed_tuple(law.parameters, count))
            if memory == 0:
                value = 1.0 * asked
            else:
                value = 1.0 * asked[0]
                for j in range(memory):
                    after[i, j] = asked[1 + j]
            c[i] = asked_for(value, row.tracked, purpose, relative, everywhere)
            wrong |= c[i] != c[i]
        return wrong

    return demands


@cache
def demand(
    formula: Callable[..., Any],
    count: int,
    memory: int,
    relative: bool,
    everywhere: bool,
    ahead: bool,
) -> Any:
    """Return the compiled function that computes the bounds of all rows, or None if numba refuses.

    ``formula`` is a function of a :class:`.Row` and ``count`` parameters. A RuntimeWarning gives
    the reason of a refusal. With ``memory``, the formula returns a tuple of c and that many floats.
    ``relative``, ``everywhere`` and ``ahead`` are those of
    :class:`vsconstraints.controllers.demands.Demand`.
    """
    try:
        return make_part(
            require_part,
            (formula,),
            (count, memory, int(relative), int(everywhere), int(ahead)),
            DEMAND,
        )
    except Exception as error:  # numba raises any exception for code that it does not support
        warn_refused((formula,), error)
        return None


@in_place
def is_answer(code: int) -> bool:
    """True if a law that returns this code has written an answer that is used."""
    return code == SOLVED or code >= RELAXED_ROWS


@in_place
def within(rows: RowArrays, j: int, x: float) -> float:
    """Return the acceleration of joint j nearest to x within the limits of the rows."""
    if rows.qdd_max.size == 0:
        return x
    return clip(x, rows.qdd_min[j], rows.qdd_max[j])


@in_place
def write_rates(Lg: Array, qdd: Array, out: Array) -> None:
    """Write L_gφ q̈ of as many rows as ``out`` has entries."""
    for i in range(out.size):
        total = 0.0
        for j in range(qdd.size):
            total += Lg[i, j] * qdd[j]
        out[i] = total


@in_place
def answer_without_baseline(inner: Answer, answer: Answer) -> None:
    """Let an inner law write to the arrays of an answer, except its unconstrained command."""
    outputs = answer.qdd, answer.acted, answer.slack, answer.iterations
    set_fields(inner, (*outputs, answer.alone[:0]))


@in_place
def apply_law(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """Call the resolver of the law at an address, and clip its answer to the box of the rows.

    Joint speeds are not clipped: the arm that follows them keeps its own limits. Return the
    resolver's code.
    """
    law = load_law(address)
    code: int = call_int_pointer(law.resolver, (address, rows, task, answer))
    is_clipped = rows.qdd_max.size > 0 and law.speeds.size == 0
    if is_clipped and is_answer(code):
        for j in range(answer.qdd.size):
            answer.qdd[j] = within(rows, j, answer.qdd[j])
        write_rates(rows.Lg, answer.qdd, law.last_rates)
    return code


@in_place
def bounds(least: Array, greatest: Array, n: int) -> bool:
    """True if these are nonempty bounds of q̈ (n,), or if none are given."""
    if least.size != greatest.size:
        return False
    if least.size != n and least.size != 0:
        return False
    wrong = False
    for j in range(least.size):
        is_interval = least[j] <= greatest[j]
        has_finite_numbers = least[j] < math.inf and greatest[j] > -math.inf
        wrong |= not (is_interval and has_finite_numbers)
    return not wrong


@in_place
def fits(x: Array, size: int) -> bool:
    """True if the vector has the given size, or is empty, and its numbers are finite."""
    wrong = x.size != size and x.size != 0
    for i in range(x.size):
        wrong |= not abs(x[i]) < math.inf
    return not wrong


#: Types of q̈, active rows, slack and iterations, which laws write.
OUTPUTS = VECTOR, FLAGS, VECTOR, INTEGERS
#: Types of φ, L_gφ, L_fφ, switching gain and scale, and of all fields of rows and of a task.
MAIN_ROWS = VECTOR, MATRIX, VECTOR, CONSTANT, CONSTANT
ALL_ROWS = VECTOR, MATRIX, VECTOR, *(CONSTANT,) * 7
WHOLE_TASK = MATRIX, VECTOR, *(CONSTANT,) * 4


@checked(LawArrays)
@compiled(signature(INT, INT, MAIN_ROWS, MATRIX, VECTOR, *OUTPUTS), IN_PLACE)
def follow(
    law: int,
    of_rows: tuple[Array, ...],
    J: Array,
    b: Array,
    qdd: Array,
    acted: BoolArray,
    slack: Array,
    iterations: IntArray,
) -> int:
    """Apply the law at an address to a task and rows, and return its code.

    ``of_rows`` are φ, L_gφ, L_fφ, switching gain and scale. They are a plain tuple: numba takes
    four times as long to find the types of a named one.
    """
    phi, Lg, Lf, gain, scale = of_rows
    arrays = load_law(law)
    m = arrays.asked.size
    none = phi[:0]
    if phi.size != m or acted.size != m:
        return NEEDS_PYTHON
    set_fields(arrays.rows, (phi, Lg, Lf, none, none, none, gain, scale, none, none))
    set_fields(arrays.task, (J, b, none, none, none, none))
    set_fields(arrays.answer, (qdd, acted, slack, iterations, none))
    code: int = call_int_pointer(arrays.resolver, (law, arrays.rows, arrays.task, arrays.answer))
    return code


@checked(LawArrays)
@compiled(signature(INT, INT, ALL_ROWS, WHOLE_TASK, *OUTPUTS), IN_PLACE)
def follow_whole(
    law: int,
    of_rows: tuple[Array, ...],
    of_task: tuple[Array, ...],
    qdd: Array,
    acted: BoolArray,
    slack: Array,
    iterations: IntArray,
) -> int:
    """Apply a law to all fields of rows and task; see :func:`follow`.

    The fields are those of :class:`.RowArrays` and :class:`.TaskArrays`.
    """
    arrays = load_law(law)
    rows = arrays.rows
    task = arrays.task
    set_fields(rows, of_rows)
    set_fields(task, of_task)
    set_fields(arrays.answer, (qdd, acted, slack, iterations, of_rows[0][:0]))
    m = arrays.asked.size
    if rows.phi.size != m or acted.size != m:
        return NEEDS_PYTHON
    if not (fits(rows.sigma, m) and fits(rows.sigma_dot, m) and fits(rows.K, m)):
        return NEEDS_PYTHON
    k = task.b.size
    if not (fits(task.error, k) and fits(task.error_rate, k)):
        return NEEDS_PYTHON
    n = qdd.size
    if not (fits(task.rest, n) and fits(task.qd, n)):
        return NEEDS_PYTHON
    if not bounds(rows.qdd_min, rows.qdd_max, n):
        return NEEDS_PYTHON
    code: int = apply_law(law, rows, task, arrays.answer)
    return code
