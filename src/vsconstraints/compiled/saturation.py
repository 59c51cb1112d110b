"""Resolver ``saturation``, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..formulas.row import BOUND
from ..rows import Array, BoolArray
from ..rows.tolerances import MET, STRICT, ZERO_GRADIENT
from .codes import LIMIT, NEEDS_PYTHON, SCALES, SOLVED, TOLERANCE
from .compiler import compiled, in_place, inner
from .laws import RESOLVER, load_law, within
from .least_squares import resolve
from .linear import ONE, START, away, constant, copy, copy_vector, length, squares
from .parts import call_int_pointer
from .resolving import demanded, finished, follow_alone, measurable, resolve_otherwise
from .scratch import blank, emptied, flags, matrix
from .workspace import Answer, LawArrays, RowArrays, Scratch, TaskArrays

#: Rows of the workspace: the best q̈ so far, q̈ at s = 0, the unconstrained q̈, and q̈ at s = 1;
#: number of rows.
BEST = START
NONE = ONE
TRACKING = constant(2)
WHOLE = constant(3)
ROWS_OF_X = constant(4)
NO_BOUND = constant(-1)  #: Index of a bound that does not exist.


class Critical(NamedTuple):
    """Critical bound, the share s of the task that it allows, and the least share of all others.

    The critical bound allows the least share. All other bounds allow every share from ``least`` on.
    """

    bound: int
    most: float
    least: float


@in_place
def left(W: Array, i: int, X: Array, row: int, size: float) -> float:
    """Return the distance side − w q̈ to a bound, 0 within rounding of its terms.

    W (w, n + 1) is [W | sides].
    """
    n = X.shape[1]
    rest: float = W[i, n]
    for j in range(n):
        rest -= W[i, j] * X[row, j]
    rounding = MET * (size + abs(W[i, n]))
    if abs(rest) <= rounding:
        return 0.0
    return rest


@in_place
def critical(W: Array, held: BoolArray, X: Array) -> Critical:
    """Find the critical bound between the accelerations at s = 1 and at s = 0.

    ``bound`` is ``NO_BOUND``, and ``most`` infinite, if none is exceeded at s = 1.
    """
    of_whole = length(X, WHOLE, X.shape[1])
    of_none = length(X, NONE, X.shape[1])
    chosen = NO_BOUND
    most = math.inf
    least = 0.0
    for i in range(W.shape[0]):
        if held[i]:
            continue
        at_one = left(W, i, X, WHOLE, of_whole)
        at_zero = left(W, i, X, NONE, of_none)
        if at_one < 0.0:
            # s at which the distance, linear between s = 0 and s = 1, is zero
            lasting = at_zero / (at_zero - at_one) if at_zero > at_one else -math.inf
            if chosen == NO_BOUND or lasting < most:
                chosen = i
                most = lasting
        elif at_zero < 0.0:
            least = max(least, at_zero / (at_zero - at_one))
    return Critical(chosen, most, least)


@inner
def missed(J: Array, X: Array) -> bool:
    """True if the command at s = 1 misses the task by more than rounding.

    It is compared with the unconstrained command.
    """
    n = X.shape[1]
    residual = 0.0
    far = 0.0
    for j in range(n):
        change = X[WHOLE, j] - X[TRACKING, j]
        far += change**2
    for i in range(J.shape[0]):
        along = away(J, i, X, WHOLE, X, TRACKING)
        residual += along * along
    norm = np.sqrt(squares(J, n))
    increased: bool = np.sqrt(residual) > STRICT * norm * np.sqrt(far)
    return increased


@inner
def bounds(law: LawArrays, rows: RowArrays, acted: BoolArray, scratch: Scratch) -> Array:
    """Return [W | sides] of the rows with a finite bound and of the box, with unit norms.

    The rows are marked in ``acted``. A row that no acceleration influences is omitted, or zero if
    its bound is negative.
    """
    c = law.asked
    bound = law.options[LIMIT]
    m, n = rows.Lg.shape
    side = n  # column of the sides
    at = START
    W = blank(scratch, m + 2 * n, n + 1)
    for i in range(m):
        size = np.sqrt(law.squared[i])
        influenced = size > ZERO_GRADIENT * rows.scale[i]
        acted[i] = c[i] != math.inf and (influenced or c[i] < 0.0)
        if acted[i]:
            for j in range(n):
                W[at, j] = rows.Lg[i, j] / size if influenced else 0.0
            W[at, side] = c[i] / size if influenced else c[i]
            at += 1
    for j in range(n):
        greatest = within(rows, j, bound)
        if greatest < math.inf:
            W[at, j] = 1.0
            W[at, side] = greatest
            at += 1
    for j in range(n):
        least = within(rows, j, -bound)
        if least > -math.inf:
            W[at, j] = -1.0
            W[at, side] = -least
            at += 1
    return W[:at]


@inner
def resolve_saturated(
    saturated: Array,
    J: Array,
    b: Array,
    tolerance: float,
    rest: Array,
    qdd: Array,
    A: Array,
    scratch: Scratch,
) -> int:
    """Write the q̈ that meets the saturated bounds with equality, and then the task.

    Return the rank of the bounds. A is overwritten, and the scratch that the computation takes is
    released.
    """
    taken = scratch.taken[0]
    count = len(saturated)
    for i in range(count):
        copy(A, i, saturated, i, A.shape[1])
    rank, _, _ = resolve(A[:count], J, b, tolerance, rest, qdd, scratch)
    scratch.taken[0] = taken
    return rank


@in_place
def write_best(X: Array, share: float) -> None:
    """Write the acceleration at a share of the task to X[BEST]."""
    for j in range(X.shape[1]):
        change = X[WHOLE, j] - X[NONE, j]
        X[BEST, j] = X[NONE, j] + share * change


@in_place
def report(held: BoolArray, answer: Answer) -> None:
    """Mark the rows whose bounds are held, among those that have a bound; all rows are met.

    ``held`` begins with the bounds of these rows, in order.
    """
    at = 0
    for i in range(answer.acted.size):
        answer.slack[i] = 0.0
        if answer.acted[i]:
            answer.acted[i] = held[at]
            at += 1
    answer.iterations[0] = 0


@compiled(RESOLVER, from_python=False)
def saturation(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """Compute the command of :class:`vsconstraints.controllers.resolvers.Saturation`.

    The options are those of the hierarchy, and 1 if it scales. Return ``SOLVED``; ``NEEDS_PYTHON``
    if the input is refused or numbers leave the range; or the code of the hierarchy if it has to
    answer.
    """
    law = load_law(address)
    if not measurable(law, rows, task, answer):
        return NEEDS_PYTHON
    tolerance = law.options[TOLERANCE]
    J = task.J
    b = task.b
    rest = task.rest
    acted = answer.acted
    n = answer.qdd.size
    scratch = emptied(law)
    follow_alone(law, task, answer)
    if not demanded(address, law, rows, answer.qdd, BOUND):
        return NEEDS_PYTHON
    W = bounds(law, rows, acted, scratch)
    held = flags(scratch, W.shape[0])
    kept = flags(scratch, W.shape[0])
    saturated = matrix(scratch, n + 1, n + 1)
    A = matrix(scratch, n + 1, n + 1)
    X = blank(scratch, ROWS_OF_X, n)
    nothing = blank(scratch, 1, b.size)[0]
    copy_vector(X[TRACKING], answer.qdd)
    copy_vector(X[WHOLE], answer.qdd)
    count = 0
    largest = -1.0
    if rest.size > 0:
        call_int_pointer(law.track, (scratch, J, nothing, tolerance, rest, X[NONE]))
    while True:
        bound, most, least = critical(W, held, X)
        if bound == NO_BOUND:
            break
        is_feasible = least <= most
        if is_feasible and most > largest:
            largest = most
            write_best(X, most)
            for i in range(held.size):
                kept[i] = held[i]
        held[bound] = True
        copy(saturated, count, W, bound, n + 1)
        count += 1
        rank = resolve_saturated(saturated[:count], J, b, tolerance, rest, X[WHOLE], A, scratch)
        is_missed = law.options[SCALES] != 0.0 and missed(J, X)
        if rank < count or is_missed:
            if largest < 0.0:
                return resolve_otherwise(address, law, rows, task, answer)
            copy(X, WHOLE, X, BEST, n)
            held = kept
            break
        resolve_saturated(saturated[:count], J, nothing, tolerance, rest, X[NONE], A, scratch)
    copy_vector(answer.qdd, X[WHOLE])
    report(held, answer)
    return finished(law, rows, answer.qdd, SOLVED)
