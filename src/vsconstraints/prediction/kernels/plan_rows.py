"""Rows along a plan, compiled: their numbers, values and gradients.

Every row is evaluated at every point of the search, but only the added rows are differentiated, by
an adjoint recursion.
"""

from __future__ import annotations

from ...compiled.compiler import in_place
from ...compiled.least_distance import NEW, NONE
from ...compiled.linear import START, dot
from ...rows import Array
from .plan_arrays import BY_Q, BY_QD, BY_QDD, QD, Cost, Factor, Limits, Q, Space
from .plan_cost import roll_out


@in_place
def move(limits: Limits, u: Array, x: Array, moved: Array) -> None:
    """Write q and q̇ at every instant."""
    n = moved.shape[2]
    for t in range(limits.instants):
        k = limits.block[t]
        tau = limits.since[t]
        brakes = k == len(u)
        for j in range(n):
            q = x[k, j]
            qd = x[k, n + j]
            if brakes:
                moved[Q, t, j] = q + 0.5 * limits.stop * qd
                moved[QD, t, j] = 0.0
            else:
                qdd = u[k, j]
                mean_speed = qd + 0.5 * tau * qdd
                moved[Q, t, j] = q + tau * mean_speed
                moved[QD, t, j] = qd + tau * qdd


@in_place
def predict(cost: Cost, factor: Factor, limits: Limits, space: Space) -> None:
    """Write the plan that follows from w, and the motion of the joints by it."""
    roll_out(cost, factor, space)
    move(limits, space.u, space.x, space.moved)


@in_place
def is_constraint(limits: Limits, row: int) -> bool:
    """True if a row is one of the constraints, not a bound of the box or of a slack."""
    return bool(row < limits.left.size)


@in_place
def constraint_of(limits: Limits, row: int) -> tuple[int, int]:
    """Return the instant t and the constraint i of a row from instant t to the next."""
    m = limits.gradient.shape[1]
    return row // m, row % m


@in_place
def bound_of(limits: Limits, row: int) -> tuple[int, int, bool]:
    """Return block and joint of a bound of the box, and True if it is the upper bound."""
    n = limits.gradient.shape[2]
    bounds_per_side = limits.low.size
    bound = row - limits.left.size
    is_upper = bound < bounds_per_side
    entry = bound % bounds_per_side
    return entry // n, entry % n, is_upper


@in_place
def row_of_bound(limits: Limits, k: int, j: int, is_upper: bool) -> int:
    """Return the row of a bound of joint j in block k: the inverse of :func:`bound_of`."""
    n = limits.gradient.shape[2]
    first = limits.left.size
    if not is_upper:
        first += limits.low.size
    row: int = first + k * n + j
    return row


@in_place
def first_slack_row(limits: Limits) -> int:
    """Return the number of the row z₀ ≥ 0."""
    first: int = limits.left.size + 2 * limits.low.size
    return first


@in_place
def at(limits: Limits, moved: Array, t: int, i: int) -> float:
    """Return the value of constraint i at an instant."""
    part = QD if limits.by_speed[i] else Q
    change = dot(limits.gradient[t], i, moved[part], t, START, moved.shape[2])
    value: float = limits.value[t, i] + change
    return value


@in_place
def constraint_excess(limits: Limits, t: int, i: int, value: float, next_value: float) -> float:
    """Return the excess of constraint i, which has these values at instant t and the next."""
    over = next_value - limits.falls[t] * value - limits.left[t, i]
    multiplied: float = limits.row_factor[t, i] * over
    return multiplied


@in_place
def excess(limits: Limits, space: Space, row: int) -> float:
    """Return the excess of a row of the constraints or of the box."""
    if is_constraint(limits, row):
        t, i = constraint_of(limits, row)
        value = at(limits, space.moved, t, i)
        next_value = at(limits, space.moved, t + 1, i)
        return constraint_excess(limits, t, i, value, next_value)
    k, j, is_upper = bound_of(limits, row)
    qdd = space.u[k, j]
    if is_upper:
        return float(qdd - limits.high[k, j])
    return float(limits.low[k, j] - qdd)


@in_place
def most_exceeded(limits: Limits, space: Space, met: float) -> int:
    """Return the row with the greatest excess relative to its scale; ``NONE`` if all are met.

    A row is met if its relative excess is at most ``met``. The scale of a bound is the width of the
    box.
    """
    constraint, most = most_exceeded_constraint(limits, space, met)
    bound = most_exceeded_bound(limits, space, most)
    return constraint if bound == NONE else bound


@in_place
def most_exceeded_constraint(limits: Limits, space: Space, least: float) -> tuple[int, float]:
    """Return the row of a constraint with the greatest relative excess, and this excess.

    Return ``NONE`` and ``least`` if no relative excess is greater than ``least``. Slacks count as
    part of the rows.
    """
    m = limits.gradient.shape[1]
    chosen = NONE
    most = least
    for i in range(m):
        value = at(limits, space.moved, 0, i)
        for t in range(limits.instants - 1):
            next_value = at(limits, space.moved, t + 1, i)
            over = constraint_excess(limits, t, i, value, next_value)
            over = (over - space.slack[i]) / limits.scale[i]
            if over > most:
                chosen = t * m + i
                most = over
            value = next_value
    return chosen, most


@in_place
def most_exceeded_bound(limits: Limits, space: Space, least: float) -> int:
    """Return the bound of the box with the greatest relative excess, if it exceeds ``least``.

    Return ``NONE`` otherwise.
    """
    chosen = NONE
    most = least
    for k in range(len(limits.low)):
        for j in range(limits.low.shape[1]):
            qdd = space.u[k, j]
            low = limits.low[k, j]
            high = limits.high[k, j]
            above = qdd - high
            below = low - qdd
            over = max(above, below) / (high - low)
            if over > most:
                chosen = row_of_bound(limits, k, j, above > below)
                most = over
    return chosen


@in_place
def differentiate(
    cost: Cost, factor: Factor, limits: Limits, row: int, adjoint: Array, X: Array
) -> None:
    """Write the gradient of a row with respect to w to X[NEW], block after block backwards."""
    n = limits.gradient.shape[2]
    H = len(limits.low)
    T = cost.length
    X[NEW] = 0.0
    adjoint[:] = 0.0
    if is_constraint(limits, row):
        k = begin_at_constraint(limits, row, adjoint)
    else:
        k = begin_at_bound(limits, row, adjoint)
    if k == H:
        k -= 1
        step_back(T, adjoint)
    # from Lᵀ u = w + y − Y x: the gradient g with respect to w is L⁻¹ times that with respect to u,
    # and −Yᵀ g is added to that with respect to x
    while k >= 0:
        L = factor.L[k]
        Y = factor.Y[k]
        first = k * n
        for i in range(n):
            g = adjoint[BY_QDD, i]
            for c in range(i):
                g -= L[i, c] * X[NEW, first + c]
            g *= factor.inverse[k, i]
            X[NEW, first + i] = g
            for j in range(n):
                adjoint[BY_Q, j] -= Y[i, j] * g
                adjoint[BY_QD, j] -= Y[i, n + j] * g
        step_back(T, adjoint)
        k -= 1


@in_place
def begin_at_bound(limits: Limits, row: int, adjoint: Array) -> int:
    """Write the adjoint of a bound of the box at its block, and return the number of the block."""
    k, j, is_upper = bound_of(limits, row)
    adjoint[BY_QDD, j] = 1.0 if is_upper else -1.0
    return k


@in_place
def begin_at_constraint(limits: Limits, row: int, adjoint: Array) -> int:
    """Write the adjoint of a constraint at its last block, and return the number of this block.

    The block after the plan is that of the brake, of which the plan decides only the first state.
    """
    t, i = constraint_of(limits, row)
    k: int = limits.block[t + 1]
    factor_of_row = limits.row_factor[t, i]
    if k == len(limits.low):
        for j in range(limits.gradient.shape[2]):
            by_q = factor_of_row * limits.gradient[t + 1, i, j]
            adjoint[BY_Q, j] = by_q
            adjoint[BY_QD, j] = 0.5 * limits.stop * by_q
    else:
        pull_on(limits, adjoint, t + 1, i, factor_of_row, True)
    if t > 0:
        is_same_block = limits.block[t] == k
        factor_before = -factor_of_row * limits.falls[t]
        pull_on(limits, adjoint, t, i, factor_before, is_same_block)
    return k


@in_place
def pull_on(limits: Limits, adjoint: Array, t: int, i: int, factor: float, inside: bool) -> None:
    """Add the gradient of a row at an instant to the adjoint.

    Unless the instant is ``inside`` the row's block, it is the end of the previous block.
    """
    tau = limits.since[t] if inside else 0.0
    for j in range(adjoint.shape[1]):
        slope = factor * limits.gradient[t, i, j]
        if limits.by_speed[i]:
            adjoint[BY_QDD, j] += tau * slope
            adjoint[BY_QD, j] += slope
        else:
            adjoint[BY_QDD, j] += 0.5 * tau * tau * slope
            adjoint[BY_Q, j] += slope
            adjoint[BY_QD, j] += tau * slope


@in_place
def step_back(T: float, adjoint: Array) -> None:
    """Propagate the adjoint of the state after a block to its acceleration and its first state."""
    for j in range(adjoint.shape[1]):
        by_q = adjoint[BY_Q, j]
        by_qd = adjoint[BY_QD, j]
        adjoint[BY_QDD, j] = T * (0.5 * T * by_q + by_qd)
        adjoint[BY_QD, j] = by_qd + T * by_q
