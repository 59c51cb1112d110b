"""The resolver ``saturation``, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..formulas.row import BOUND
from ..rows import Array, BoolArray
from ..rows.tolerances import MET, STRICT, ZERO_GRADIENT
from .compiler import compiled, in_place, inner
from .laws import RESOLVER, load_law, within
from .least_squares import resolve
from .linear import START, copy
from .parts import call_int_pointer
from .resolving import checkable, follow_alone, rates, remember, valid
from .scratch import blank, emptied, matrix
from .structures import INCOMPATIBLE, NEEDS_PYTHON, SOLVED, Answer, LawArrays, RowArrays, Scratch, TaskArrays


class Critical(NamedTuple):
    """The bound that allows the least share s of the task, that share, and from which one on all others allow it."""

    bound: int
    most: float
    least: float


@in_place
def left(W: Array, i: int, qdd: Array, length: float) -> float:
    """What a bound leaves, side − w q̈, 0 within rounding of its terms; W (w, n + 1) is [W | sides]."""
    n = qdd.size
    rest = W[i, n]
    for j in range(n):
        rest -= W[i, j] * qdd[j]
    return 0.0 if abs(rest) <= MET * (length + abs(W[i, n])) else rest


@in_place
def norm(x: Array) -> float:
    """‖x‖."""
    squared = 0.0
    for j in range(x.size):
        squared += x[j] * x[j]
    return math.sqrt(squared)


@in_place
def critical(W: Array, held: BoolArray, whole: Array, none: Array) -> Critical:
    """Which bound is, between the accelerations at s = 1 and at s = 0; ``most`` is infinite if none is exceeded."""
    of_whole, of_none = norm(whole), norm(none)
    chosen, most, least = -1, math.inf, 0.0
    for i in range(W.shape[0]):
        if held[i]:
            continue
        at_one, at_zero = left(W, i, whole, of_whole), left(W, i, none, of_none)
        if at_one < 0.0:
            lasting = at_zero / (at_zero - at_one) if at_zero > at_one else -math.inf
            if chosen < 0 or lasting < most:
                chosen, most = i, lasting
        elif at_zero < 0.0:
            least = max(least, at_zero / (at_zero - at_one))
    return Critical(chosen, most, least)


@inner
def missed(J: Array, qdd: Array, tracking: Array) -> bool:
    """Whether J has more than rounding of the way from the command that tracks."""
    residual = gains = away = 0.0
    for j in range(qdd.size):
        away += (qdd[j] - tracking[j]) ** 2
    for i in range(J.shape[0]):
        along = 0.0
        for j in range(qdd.size):
            along += J[i, j] * (qdd[j] - tracking[j])
            gains += J[i, j] * J[i, j]
        residual += along * along
    return math.sqrt(residual) > STRICT * math.sqrt(gains) * math.sqrt(away)


@inner
def bounds(law: LawArrays, rows: RowArrays, acted: BoolArray, scratch: Scratch) -> Array:
    """[W | sides] of the rows that ask for something, which are marked, with rows of unit norm, and of the box.

    A row that no acceleration influences is none, or zero.
    """
    c, bound, (m, n) = law.asked, law.options[1], rows.Lg.shape
    W = blank(scratch, m + 2 * n, n + 1)
    at = START
    for i in range(m):
        size = math.sqrt(law.squared[i])
        influenced = size > ZERO_GRADIENT * rows.scale[i]
        acted[i] = c[i] != math.inf and (influenced or c[i] < 0.0)
        if acted[i]:
            for j in range(n):
                W[at, j] = rows.Lg[i, j] / size if influenced else 0.0
            W[at, n] = c[i] / size if influenced else c[i]
            at += 1
    for j in range(2 * n):
        side = within(rows, j % n, bound) if j < n else -within(rows, j % n, -bound)
        if side < math.inf:
            W[at, j % n] = 1.0 if j < n else -1.0
            W[at, n] = side
            at += 1
    return W[:at]


@compiled(RESOLVER, from_python=False)
def saturation(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """See :class:`vsconstraints.controllers.resolvers.Saturation`.

    Its options are those of the hierarchy, and 1 if it scales.

    Returns
    -------
    int
        ``SOLVED``, or ``NEEDS_PYTHON`` where input is refused, or numbers leave the range; that of the hierarchy, where
        it has to answer.
    """
    law = load_law(address)
    if not valid(law, rows, task, answer) or answer.slack.size != rows.phi.size or answer.iterations.size == 0:
        return NEEDS_PYTHON
    tolerance, J, b, qdd, acted = law.options[0], task.J, task.b, answer.qdd, answer.acted
    m, n, scratch = rows.phi.size, qdd.size, emptied(law)
    follow_alone(law, task, answer)
    if call_int_pointer(law.demand, (address, rows, rates(law, rows, qdd), BOUND, law.after, law.asked)):
        return NEEDS_PYTHON
    W = bounds(law, rows, acted, scratch)
    held = np.zeros(W.shape[0], np.bool_)
    kept, saturated, A = held.copy(), matrix(scratch, n + 1, n + 1), matrix(scratch, n + 1, n + 1)
    X, nothing = blank(scratch, 3, n), blank(scratch, 1, b.size)[0]
    best, none, tracking = X[0], X[1], X[2]
    for j in range(n):
        tracking[j] = qdd[j]
    count, largest, taken = 0, -1.0, scratch.taken[0]
    if task.rest.size > 0:
        call_int_pointer(law.track, (scratch, J, nothing, tolerance, task.rest, none))
    while True:
        at, most, least = critical(W, held, qdd, none)
        if at < 0:
            break
        if max(least, largest) <= most and most > largest:
            largest = most
            for i in range(held.size):
                kept[i] = held[i]
            for j in range(n):
                best[j] = none[j] + most * (qdd[j] - none[j])
        held[at] = True
        copy(saturated, count, W, at, n + 1)
        count += 1
        # both use up what they are given
        for i in range(count):
            copy(A, i, saturated, i, n + 1)
        scratch.taken[0] = taken
        rank = resolve(A[:count], J, b, tolerance, task.rest, qdd, scratch)[0]
        if rank < count or (law.options[4] != 0.0 and missed(J, qdd, tracking)):
            if largest < 0.0:
                if law.otherwise == 0:
                    return INCOMPATIBLE
                code: int = call_int_pointer(law.otherwise, (address, rows, task, answer))
                return code
            for j in range(n):
                qdd[j] = best[j]
            held = kept
            break
        for i in range(count):
            copy(A, i, saturated, i, n + 1)
        scratch.taken[0] = taken
        resolve(A[:count], J, nothing, tolerance, task.rest, none, scratch)
    at = 0
    for i in range(m):
        answer.slack[i] = 0.0
        if acted[i]:
            acted[i] = held[at]
            at += 1
    if not checkable(law, rows, qdd):
        return NEEDS_PYTHON
    answer.iterations[0] = 0
    remember(law, rows, qdd)
    return SOLVED
