"""Level 2 of the hierarchy by itself, compiled: a primal active-set method."""

from __future__ import annotations

import math

import numpy as np

from ..rows import Array, BoolArray
from ..rows.tolerances import WELL_CONDITIONED
from .compiler import inner
from .least_distance import DEPENDENT
from .least_squares import CERTAIN, orthogonalise, pseudoinverse
from .levels import CENTER
from .linear import ONE, S_ROWS, START, WORK, apply, apply_transposed, constant, dot, make_reflection, solve_upper
from .scratch import no_scratch

REACHED = 1e-12
"""A step that changes the residual by less than this fraction of its terms is none."""

PUSHING = 1e-9
"""A row holds the task back if its multiplier exceeds this fraction of the terms of the gradient."""

ROW = constant(0)
"""The row of X with the point."""


@inner
def take(F: Array, T: Array, q: int, A: Array, i: int) -> int:
    """Add the row A[i] to the q rows that F and T are the QR of; 1, or 0 if it depends on them."""
    n = F.shape[1]
    length = math.sqrt(dot(A, i, A, i, START, n))
    if q == n or length == 0.0:
        return 0
    for j in range(n):
        F[q, j] = A[i, j] / length
    apply_transposed(F, T, q, F, q)
    if math.sqrt(dot(F, q, F, q, q, n)) <= DEPENDENT:
        return 0
    make_reflection(F, T, q)
    return 1


@inner
def least_residual(
    G: Array, C: Array, E: Array, walls: Array, sides: Array, X: Array, active: BoolArray, tolerance: float
) -> bool:
    """Minimise ‖G (x − C)‖ subject to walls x ≤ sides, with E x staying as it is, from X, which becomes the answer.

    A primal active-set method. It starts at a point that meets every row, and never leaves these points. On the rows
    that are active it takes the step of eq. (15): the task's step of least norm within their null space. The first row
    in the way becomes active, and where no step is left the one that pulls most the wrong way is let go.

    Parameters
    ----------
    G
        (k, n) or more columns: the task.
    C
        Its minimiser without rows is the row ``CENTER`` of this.
    E
        (e, n) or more columns: what stays as it is.
    walls, sides
        (w, n) and (w,).
    X
        (1, n): the point.
    active
        (w,) rows that are active at first; then those that hold the task back.
    tolerance
        Singular values of G within the null space of the active rows below this fraction of ‖G‖ count as zero: the
        task does not ask for directions that the rows nearly take from it.

    Returns
    -------
    bool
        Whether no point has a smaller residual.
    """
    k, n, w = G.shape[0], X.shape[1], walls.shape[0]
    F, T, Y, order = np.empty((n, n)), np.empty((S_ROWS, n)), np.zeros((S_ROWS, n)), np.empty(n, np.int64)
    W = np.empty((k, n + 1))
    count = 0
    for i in range(w):
        if active[i] and count < n:
            order[count] = i
            count += 1
        active[i] = False
    size = 0.0
    for i in range(k):
        size += dot(G, i, G, i, START, n)
    size = math.sqrt(size)
    for _ in range(2 * (w + n)):
        q = START
        for i in range(E.shape[0]):
            q += take(F, T, q, E, i)
        first, left = q, 0
        for at in range(count):
            if take(F, T, q, walls, order[at]) == 1:
                order[left] = order[at]
                left += 1
                q += 1
        count = left
        # the step of least norm within the null space of the active rows, and the force of the task
        reach = (
            REACHED * size * (math.sqrt(dot(X, ROW, X, ROW, START, n)) + math.sqrt(dot(C, CENTER, C, CENTER, START, n)))
        )
        for j in range(n):
            Y[ONE, j] = Y[WORK, j] = 0.0
        for i in range(k):
            rest = dot(G, i, C, CENTER, START, n) - dot(G, i, X, ROW, START, n)
            for j in range(n):
                W[i, j] = G[i, j]
                Y[WORK, j] += rest * G[i, j]
            W[i, n] = rest
            apply_transposed(F, T, q, W, i)
        moved = 0.0
        if q < n:
            pseudoinverse(W, q, CERTAIN * tolerance, tolerance, G, Y, ONE, no_scratch())
            apply(F, T, q, Y, ONE)
            for i in range(k):
                moved += dot(G, i, Y, ONE, START, n) ** 2
        if math.sqrt(moved) <= reach:
            noise = PUSHING * math.sqrt(dot(Y, WORK, Y, WORK, START, n)) + size * reach
            apply_transposed(F, T, q, Y, WORK)
            solve_upper(F, T, q, Y, WORK)
            worst, weakest = -1, -noise
            for at in range(count):
                if Y[WORK, first + at] < weakest:
                    worst, weakest = at, Y[WORK, first + at]
            if worst < 0:
                for at in range(count):
                    active[order[at]] = Y[WORK, first + at] > noise
                return True
            count -= 1
            for at in range(worst, count):
                order[at] = order[at + 1]
            continue
        length, blocking = 1.0, -1
        stride = math.sqrt(dot(Y, ONE, Y, ONE, START, n))
        for i in range(w):
            change = dot(walls, i, Y, ONE, START, n)
            taken = False
            for at in range(count):
                taken = taken or order[at] == i
            if not taken and change > REACHED * stride * math.sqrt(dot(walls, i, walls, i, START, n)):
                reached = max(0.0, sides[i] - dot(walls, i, X, ROW, START, n)) / change
                if reached < length:
                    length, blocking = reached, i
        for j in range(n):
            X[ROW, j] += length * Y[ONE, j]
        if blocking >= 0 and count < n:
            order[count] = blocking
            count += 1
    return False


@inner
def cut(G: Array, n: int, damping: float, tolerance: float) -> float:
    """Relative gain below which level 2 by itself leaves directions within the rows alone."""
    k = G.shape[0]
    W = np.empty((k, n))
    for i in range(k):
        for j in range(n):
            W[i, j] = G[i, j]
    largest = orthogonalise(W, k, START, n)
    for i in range(k):
        gain = math.sqrt(dot(W, i, W, i, START, n))
        if tolerance * largest < gain < WELL_CONDITIONED * largest:
            return max(tolerance, math.sqrt(damping))
    return tolerance
