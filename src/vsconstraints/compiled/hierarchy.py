"""Resolver ``hierarchy``, compiled: bounds, task and least acceleration with strict priorities.

Its counterpart is :mod:`vsconstraints.controllers.cascade`: ``test_the_two_descents_agree``
compares them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..rows import Array
from ..rows.tolerances import MET
from . import levels
from .codes import FAILED, RELAXED_ROWS, RELAXED_SHORT, SHORT, SOLVED
from .compiler import inner
from .least_distance import nearest
from .least_residual import AIM, ROWS_OF_POINT, cut, least_residual
from .least_squares import CERTAIN, pseudoinverse
from .least_violation import least_violation
from .linear import (
    ONE,
    QR,
    START,
    apply_transposed,
    constant,
    copy,
    copy_vector,
    dot,
    length,
    squared_length,
    squares,
)
from .scratch import blank, empty_qr, flags, matrix
from .walls import (
    Demands,
    Inequalities,
    Resolved,
    gather_walls,
    hold,
    report,
    restate,
    try_unconstrained,
)
from .workspace import Scratch

#: Codes of a stage after which no other one follows: there is no answer, since the side of a row is
#: not a number or level 1 fails; or the rows leave no choice.
NO_ANSWER = constant(-1)
NO_CHOICE = constant(-2)


class Priorities(NamedTuple):
    """Options of the levels.

    ``box`` (2, n) contains the least and greatest q̈, level 0. ``damping`` weighs level 3 within
    the QP, relative to ‖J‖². Singular values of J below the ``tolerance`` times the largest one
    count as zero. If ``strict``, level 2 is solved separately where the damping has increased its
    residual.
    """

    box: Array
    damping: float
    tolerance: float
    strict: bool


class Aim(NamedTuple):
    """Objective of the levels below the rows: least ‖G (x − center)‖, then least distance to q̈₀.

    ``G`` (k, n + 1) is the task without its null space. X[levels.CENTER] of the workspace ``X`` is
    the optimum without rows. The first columns of Q of ``qr``, as many as the ``rank``, span the
    rows of G. ``gain`` is a lower bound of the gain of G there.
    """

    G: Array
    X: Array
    qr: QR
    rank: int
    gain: float


@inner
def aim_at_task(J: Array, b: Array, rest: Array, tolerance: float, scratch: Scratch) -> Aim:
    """Return the objective J q̈ = b, whose center is J†b nearest to q̈₀.

    J is (k, n) and b (k,); ``rest`` is q̈₀ (n,), or (0,) for zero.
    """
    n = J.shape[1]
    G = matrix(scratch, J.shape[0], n + 1)
    X = blank(scratch, levels.ROWS_OF_X, n)
    for i in range(J.shape[0]):
        missing = b[i]
        for j in range(rest.size):
            missing -= J[i, j] * rest[j]
        copy(G, i, J, i, n)
        G[i, n] = missing
    qr, rank, least = pseudoinverse(
        G, START, CERTAIN * tolerance, tolerance, G, X, levels.CENTER, scratch
    )
    for j in range(rest.size):
        X[levels.CENTER, j] += rest[j]
    return Aim(G, X, qr, rank, abs(least))


@inner
def aim_at(center: Array, scratch: Scratch) -> Aim:
    """Return the objective of an acceleration (n,), in the metric of the joints."""
    n = center.size
    G = blank(scratch, n, n + 1)
    X = blank(scratch, levels.ROWS_OF_X, n)
    for j in range(n):
        X[levels.CENTER, j] = center[j]
        G[j, j] = 1.0
    return Aim(G, X, QR(G, G), n, 1.0)  # the QR of a full rank is not used


@inner
def solve_stage(
    walls: Inequalities,
    G: Array,
    Z: Array,
    p: int,
    priorities: Priorities,
    X: Array,
    point: Array,
    scratch: Scratch,
) -> tuple[int, int]:
    """Find the point origin + Z y of levels 2 and 3 within the rows, and mark the active rows.

    Return ``SOLVED``, ``FAILED`` if the point fails the check, or ``NO_ANSWER`` if a side is not a
    number; and the number of rows that were added.
    """
    w = walls.sides.size
    H = matrix(scratch, p, w)
    metric = empty_qr(scratch, p + 1, p)
    if not restate(walls, Z, X, H):
        return NO_ANSWER, 0
    levels.write_metric(G, priorities.damping, Z, X, metric, scratch)
    code, steps = nearest(H, walls.rows, metric, X, scratch)
    if code != SOLVED:
        return FAILED, steps
    levels.place(Z, p, priorities.box, X, point)
    if not levels.meets(walls.normals, walls.sides, walls.violation, point):
        return FAILED, steps
    is_optimal = levels.optimal(
        G, priorities.damping, Z, walls.normals, walls.limits, walls.rows, X, point
    )
    if not is_optimal:
        return FAILED, steps
    hold(walls)
    return SOLVED, steps


@inner
def moves(normals: Array, i: int, aim: Aim, row: Array) -> bool:
    """True if the null space of the task moves row i of ``normals``; ``row`` (1, n) is scratch."""
    n = row.shape[1]
    copy(row, START, normals, i, n)
    apply_transposed(aim.qr, aim.rank, row, START)
    moved = np.sqrt(squared_length(row, START, aim.rank, n))
    return not moved <= MET * length(row, START, n)


@inner
def solve_in_span(
    walls: Inequalities, aim: Aim, priorities: Priorities, point: Array, scratch: Scratch
) -> tuple[bool, int]:
    """Solve levels 2 and 3 of a redundant arm within the span of the task.

    This works if the active rows, like the task, depend on the motion of the hand alone. Within the
    span of the task, level 2 has a single minimiser without damping. It is optimal among all q̈,
    and level 3 prefers it among the optimal ones, if the null space of the task moves no active
    row.

    Return False, with the walls unchanged, if the null space moves an active row or one that J†b
    violates, or if the task is nearly singular. Also return the number of rows that were added.
    """
    box, damping, tolerance, _ = priorities
    G, X, qr, rank, gain = aim
    n = X.shape[1]
    w = walls.held.size
    least_relative_gain = 2.0 * max(tolerance, np.sqrt(damping))
    if not gain > least_relative_gain * np.sqrt(squares(G, n)):
        return False, 0
    row = matrix(scratch, ONE, n)
    for i in range(w):
        at_center = dot(walls.normals, i, X, levels.CENTER, START, n)
        is_violated = at_center > walls.sides[i]
        if is_violated and moves(walls.normals, i, aim, row):
            return False, 0
    Q = levels.columns_of_q(qr, rank, START, rank, scratch)
    undamped = Priorities(box, 0.0, tolerance, True)
    code, steps = solve_stage(walls, G, Q, rank, undamped, X, point, scratch)
    found = code == SOLVED
    for i in range(w):
        if found and walls.held[i] and moves(walls.normals, i, aim, row):
            found = False
    if not found:
        copy_vector(walls.limits, walls.sides)
        for i in range(w):
            walls.held[i] = False
    return found, steps


@inner
def attempt(
    walls: Inequalities,
    aim: Aim,
    Z: Array,
    p: int,
    priorities: Priorities,
    point: Array,
    qdd: Array,
    scratch: Scratch,
) -> tuple[int, int]:
    """Solve a stage, and make its point the command q̈ if it passes its check.

    Otherwise the command stays as it is. Return the same as :func:`solve_stage`.
    """
    code, steps = solve_stage(walls, aim.G, Z, p, priorities, aim.X, point, scratch)
    if code == SOLVED:
        copy_vector(qdd, point[0])
    return code, steps


@inner
def relax(
    walls: Inequalities,
    aim: Aim,
    priorities: Priorities,
    point: Array,
    qdd: Array,
    scratch: Scratch,
) -> tuple[int, Array]:
    """Minimise the violations of level 1, and settle the rows that they determine.

    The point of least violation becomes the command q̈ and the origin of x = origin + Z y. Return
    the code, and the equalities [A | 0] that all points of least violation share.
    """
    count = walls.violation.size
    box = priorities.box
    demanded = walls.normals[:count]
    bounds = walls.sides[:count]
    equal: Array = matrix(scratch, START, qdd.size)
    code = least_violation(demanded, bounds, walls.weights, box, qdd, scratch)
    if code == SOLVED:
        copy_vector(point[0], qdd)
        levels.start_from(aim.X, point, box, qdd)
        equal = levels.settle(
            walls.normals,
            walls.sides,
            walls.weights,
            box,
            aim.X,
            walls.limits,
            walls.violation,
            scratch,
        )
    return code, equal


@inner
def solve_task_separately(
    walls: Inequalities,
    aim: Aim,
    priorities: Priorities,
    equal: Array,
    point: Array,
    qdd: Array,
    scratch: Scratch,
) -> tuple[bool, int]:
    """Solve level 2 without damping, then level 3 among its minimisers.

    The search begins at the command q̈ and keeps the equalities [A | 0] of level 1. If level 3 has
    no answer, the command is that of level 2. Return True if levels 2 and 3 may be improved, and
    the number of rows that were added.
    """
    G = aim.G
    X = aim.X
    n = qdd.size
    copy_vector(point[0], qdd)
    levels.with_room(walls.normals, walls.limits, point)
    cutoff = cut(G, n, priorities.damping, priorities.tolerance, scratch)
    proved = least_residual(
        G, equal, walls.normals, walls.limits, point, walls.held, cutoff, scratch
    )
    levels.start_from(X, point, priorities.box, qdd)
    if not proved:
        return True, 0
    equal = levels.join(equal, walls.normals, walls.held, G, scratch)
    Z, p = levels.find_freedom(equal, X, False, scratch)
    if p == 0:
        return False, 0
    code, steps = attempt(walls, aim, Z, p, priorities, point, qdd, scratch)
    return code != SOLVED, steps


@inner
def solve_with_rows(
    walls: Inequalities,
    aim: Aim,
    priorities: Priorities,
    point: Array,
    qdd: Array,
    scratch: Scratch,
) -> tuple[int, Array, int]:
    """Solve levels 2 and 3 among all directions, with every row as a constraint.

    Return the code of :func:`solve_stage`, no equalities (0, n), and the number of added rows.
    """
    n = qdd.size
    # without equalities Z is the identity, which an empty matrix stands for
    empty: Array = matrix(scratch, START, n)
    code, steps = attempt(walls, aim, empty, n, priorities, point, qdd, scratch)
    return code, empty, steps


@inner
def solve_relaxed(
    walls: Inequalities,
    aim: Aim,
    priorities: Priorities,
    point: Array,
    qdd: Array,
    scratch: Scratch,
) -> tuple[int, Array, int]:
    """Solve level 1, then levels 2 and 3 in the directions that keep its violations least.

    Return the code of :func:`solve_stage`, ``NO_ANSWER`` also if level 1 fails, or ``NO_CHOICE`` if
    it leaves no direction; the equalities [A | 0] of level 1; and the number of added rows.
    """
    n = qdd.size
    relaxed, equal = relax(walls, aim, priorities, point, qdd, scratch)
    if relaxed != SOLVED:
        return NO_ANSWER, equal, 0
    # find_freedom overwrites the equalities
    kept: Array = matrix(scratch, equal.shape[0], n)
    for i in range(equal.shape[0]):
        copy(kept, i, equal, i, n)
    Z, p = levels.find_freedom(equal, aim.X, True, scratch)
    if p == 0:
        return NO_CHOICE, kept, 0
    code, steps = attempt(walls, aim, Z, p, priorities, point, qdd, scratch)
    return code, kept, steps


@inner
def descend_levels(
    walls: Inequalities, aim: Aim, priorities: Priorities, qdd: Array, scratch: Scratch
) -> tuple[int, bool, int]:
    """Solve the levels in turn where the unconstrained command violates rows or box.

    Return the code, True if levels 2 and 3 may be improved, and the number of rows that all stages
    added; 0 if the rows leave no choice.

    In x = origin + Z y, Z first spans the directions of the task of a redundant arm, then all
    directions. If these fail, some rows cannot be met: Z spans the directions that keep the
    violations at their minimum. If the damping has increased the residual of level 2, or no answer
    has passed the check, Z finally spans the directions that keep level 2 at its minimum.
    """
    n = qdd.size
    is_redundant = priorities.strict and aim.rank < n
    point = matrix(scratch, ROWS_OF_POINT, n)
    copy(point, AIM, aim.X, levels.CENTER, n)
    total = 0
    if is_redundant:
        found, steps = solve_in_span(walls, aim, priorities, point, scratch)
        total += steps
        if found:
            copy_vector(qdd, point[0])
            return SOLVED, False, total
    code, kept, steps = solve_with_rows(walls, aim, priorities, point, qdd, scratch)
    total += steps
    if code == FAILED:
        code, kept, steps = solve_relaxed(walls, aim, priorities, point, qdd, scratch)
        total += steps
    if code == NO_ANSWER:
        return FAILED, False, total
    if code == NO_CHOICE:
        return SOLVED, False, 0
    # whether the damping matters is asked only of a solution
    if code == SOLVED and not (is_redundant and levels.damped(aim.G, aim.X, point)):
        return SOLVED, False, total
    may_improve, steps = solve_task_separately(walls, aim, priorities, kept, point, qdd, scratch)
    return SOLVED, may_improve, total + steps


@inner
def hierarchy(
    demands: Demands, aim: Aim, priorities: Priorities, resolved: Resolved, scratch: Scratch
) -> tuple[int, int]:
    """Find the q̈ in the box that violates the bounds least and then is nearest to the objective.

    Level 1 minimises ‖W max(0, A q̈ − c)‖; see :class:`vsconstraints.controllers.HierarchicalQP`
    for how strict level 2 is. The caller checks shapes, signs and finite numbers before, and
    afterwards that ``resolved`` is finite.

    Return ``SOLVED``; ``RELAXED_ROWS`` if bounds are violated; ``SHORT`` if levels 2 and 3 may be
    improved; ``RELAXED_SHORT`` for both; or ``FAILED``. Also return the number of iterations of the
    active-set method in all stages: at least 1 if it was needed, 0 if the rows leave no choice.
    """
    fixed = flags(scratch, demands.c.size)
    if try_unconstrained(demands, priorities.box, aim.X, fixed, resolved):
        return SOLVED, 0
    walls = gather_walls(demands, priorities.box, fixed, resolved, scratch)
    code, short, steps = descend_levels(walls, aim, priorities, resolved.qdd, scratch)
    if code != SOLVED:
        return code, steps
    unmet = report(walls, resolved)
    if short and unmet:
        return RELAXED_SHORT, steps
    if short:
        return SHORT, steps
    if unmet:
        return RELAXED_ROWS, steps
    return SOLVED, steps
