"""Level 2 of the hierarchy as a separate problem, compiled: a primal active-set method."""

from __future__ import annotations

import numpy as np

from ..rows import Array, BoolArray, IntArray
from ..rows.tolerances import WELL_CONDITIONED
from . import linear as la
from .compiler import inner
from .least_distance import DEPENDENT, NONE
from .least_squares import CERTAIN, orthogonalise, pseudoinverse
from .linear import ONE, QR, START, constant
from .scratch import blank, empty_qr, integers, matrix
from .workspace import Scratch

#: A step that changes the residual by less than this fraction of its terms counts as zero.
REACHED = 1e-12
#: A row holds the task back if its multiplier exceeds this fraction of the terms of the gradient.
PUSHING = 1e-9
#: The rows of X: the point, and the task's minimiser without rows; their number.
ROW = constant(0)
AIM = constant(1)
ROWS_OF_POINT = constant(2)
#: The rows of Y: the task's step, and its force; their number.
STEP = START
FORCE = ONE
ROWS_OF_STEP = constant(2)


@inner
def take(qr: QR, q: int, A: Array, i: int) -> int:
    """Add row A[i] to the QR of q rows. Return 1, or 0 if it depends on them."""
    columns = qr.columns
    n = columns.shape[1]
    size = la.length(A, i, n)
    if q == n or size == 0.0:
        return 0
    for j in range(n):
        columns[q, j] = A[i, j] / size
    la.apply_transposed(qr, q, columns, q)
    outside = np.sqrt(la.squared_length(columns, q, q, n))
    if outside <= DEPENDENT:
        return 0
    la.make_reflection(qr, q)
    return 1


@inner
def task_step(
    G: Array, X: Array, qr: QR, q: int, tolerance: float, Y: Array, scratch: Scratch
) -> float:
    """Write the task's step of least norm in the null space of q rows, and the task's force.

    Return ‖G step‖.
    """
    k = G.shape[0]
    n = X.shape[1]
    taken = scratch.taken[0]
    W = matrix(scratch, k, n + 1)
    moved = 0.0
    for j in range(n):
        Y[STEP, j] = Y[FORCE, j] = 0.0
    for i in range(k):
        at_aim = la.dot(G, i, X, AIM, START, n)
        at_point = la.dot(G, i, X, ROW, START, n)
        missing = at_aim - at_point
        la.copy(W, i, G, i, n)
        W[i, n] = missing
        la.add(Y, FORCE, missing, G, i, START, n)
        la.apply_transposed(qr, q, W, i)
    if q < n:
        pseudoinverse(W, q, CERTAIN * tolerance, tolerance, G, Y, STEP, scratch)
        la.apply(qr, q, Y, STEP)
        for i in range(k):
            change = la.dot(G, i, Y, STEP, START, n)
            moved += change**2
    scratch.taken[0] = taken
    distance: float = np.sqrt(moved)
    return distance


@inner
def first_in_the_way(
    walls: Array, sides: Array, X: Array, Y: Array, order: IntArray, count: int
) -> tuple[float, int]:
    """Return the feasible share of the step and the inactive row that blocks it, or ``NONE``.

    The share is at most 1.
    """
    n = X.shape[1]
    step = 1.0
    blocking = NONE
    stride = la.length(Y, STEP, n)
    for i in range(walls.shape[0]):
        change = la.dot(walls, i, Y, STEP, START, n)
        taken = False
        for at in range(count):
            taken = taken or order[at] == i
        negligible = REACHED * stride * la.length(walls, i, n)
        if not taken and change > negligible:
            room = sides[i] - la.dot(walls, i, X, ROW, START, n)
            reached = max(0.0, room) / change
            if reached < step:
                step = reached
                blocking = i
    return step, blocking


@inner
def least_residual(
    G: Array,
    E: Array,
    walls: Array,
    sides: Array,
    X: Array,
    active: BoolArray,
    tolerance: float,
    scratch: Scratch,
) -> bool:
    """Minimise ‖G (x − c)‖ subject to walls x ≤ sides, with constant E x.

    This is a primal active-set method. It starts at the given x, which has to meet every row. All
    iterates meet every row as well, and x becomes the answer. Each iteration takes the step of eq.
    (15) on the active rows: the task's step of least norm within their null space. The first row
    that blocks the step becomes active. If no step is left, the active row with the most negative
    multiplier is released.

    ``G`` (k, n) or wider is the task. ``X`` (2, n) contains x and c, the task's minimiser without
    rows. ``E`` is (e, n) or wider, ``walls`` (w, n), ``sides`` (w,). ``active`` (w,) marks the rows
    that are active at first, and on return those that hold the task back. Singular values of G
    within the null space of the active rows below the tolerance times ‖G‖ count as zero: directions
    that the rows nearly remove from the task are not used. Return True if no point has a smaller
    residual.
    """
    n = X.shape[1]
    w = walls.shape[0]
    qr = empty_qr(scratch, n, n)
    Y = blank(scratch, ROWS_OF_STEP, n)
    order = integers(scratch, n)
    count = 0
    size = np.sqrt(la.squares(G, n))
    for i in range(w):
        if active[i] and count < n:
            order[count] = i
            count += 1
        active[i] = False
    for _ in range(2 * (w + n)):
        q = START
        for i in range(E.shape[0]):
            q += take(qr, q, E, i)
        first = q
        left = 0
        for at in range(count):
            if take(qr, q, walls, order[at]) == 1:
                order[left] = order[at]
                left += 1
                q += 1
        count = left
        lengths = la.length(X, ROW, n) + la.length(X, AIM, n)
        reach = REACHED * size * lengths
        if task_step(G, X, qr, q, tolerance, Y, scratch) <= reach:
            noise = PUSHING * la.length(Y, FORCE, n) + size * reach
            la.apply_transposed(qr, q, Y, FORCE)
            la.solve_upper(qr, q, Y, FORCE)
            worst = NONE
            weakest = -noise
            for at in range(count):
                force = Y[FORCE, first + at]
                if force < weakest:
                    worst = at
                    weakest = force
            if worst == NONE:
                for at in range(count):
                    active[order[at]] = Y[FORCE, first + at] > noise
                return True
            count -= 1
            for at in range(worst, count):
                order[at] = order[at + 1]
            continue
        step, blocking = first_in_the_way(walls, sides, X, Y, order, count)
        la.add(X, ROW, step, Y, STEP, START, n)
        if blocking != NONE and count < n:
            order[count] = blocking
            count += 1
    return False


@inner
def cut(G: Array, n: int, damping: float, tolerance: float, scratch: Scratch) -> float:
    """Return the relative gain below which :func:`least_residual` does not use a direction."""
    k = G.shape[0]
    W = matrix(scratch, k, n)
    for i in range(k):
        la.copy(W, i, G, i, n)
    largest = orthogonalise(W, k, START, n)
    for i in range(k):
        gain = la.length(W, i, n)
        if tolerance * largest < gain < WELL_CONDITIONED * largest:
            cut: float = max(tolerance, np.sqrt(damping))
            return cut
    return tolerance
