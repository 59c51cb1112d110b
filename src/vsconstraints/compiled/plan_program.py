"""Plan of constant accelerations that tracks best among those that meet every row, compiled.

A plan u has H blocks for n joints. x = (q, q̇) is the motion of the joints by the plan, as double
integrators. The plan minimises

    ½ Σₖ ‖Jₖ (uₖ + K_p qₖ + K_v q̇ₖ) − bₖ‖² + λ ‖uₖ + s qₖ + d q̇ₖ − rₖ‖²

subject to rows σ(τ + Δτ) ≤ e^(−Δτ/κ) σ(τ), linear in x, at N instants, and to a box of u. A Riccati
recursion turns the cost into ½‖w‖² with Lₖᵀ uₖ = wₖ + yₖ − Yₖ xₖ, in a time linear in H. In w the
plan is the point nearest to the origin, which a dual active-set method finds (Goldfarb and Idnani
1983). Every row is evaluated at every point, but only the added rows are differentiated, by an
adjoint recursion.

If rows contradict each other, each has a slack zᵢ ≥ 0, common to all instants, with the cost ½zᵢ² +
π zᵢ = ½(zᵢ + π)² − ½π². Therefore zᵢ + π is stored, as one more coordinate behind those of w: the
plan is still the point nearest to the origin, a slack is zero where its coordinate is π, and the
side of a row that it relaxes increases by π times its coefficient.

Rows are numbered: first those of the constraints, t m + i for constraint i from instant t to the
next; then the upper bounds of the box, k n + j for joint j in block k, and its lower bounds; then
the bounds zᵢ ≥ 0 of the slacks.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from ..rows import Array, IntArray
from ..rows.tolerances import ZERO_GRADIENT
from . import least_distance
from .compiler import in_place
from .least_distance import FORCE, NEW, NO_POINT, NONE, POINT, advance, clip_forces
from .linear import (
    QR,
    START,
    add,
    apply_transposed,
    constant,
    copy,
    dot,
    make_reflection,
)
from .workspace import F8, FAILED, I8, INCOMPATIBLE, RANK_LOSS, RELAXED_ROWS, SOLVED

#: π relative to the greatest distance of a row from the plan without rows. The weaker one is used
#: if the stronger one fails.
STRONG = 1e6
WEAK = 1e4
NEGLIGIBLE = 1e-14  #: A slack below this share of π counts as zero.
#: The search starts with a row if the squared part of its unit normal outside the span of the
#: others exceeds this.
INDEPENDENT = 1e-12
#: A row exceeded by less than this fraction of its scale counts as met: if rows are compatible, and
#: with slacks.
MET = 1e-11
MET_SOFT = 1e-6
#: Rows that change by more than their scale over this distance [rad or m] are divided by the same
#: factor. Far outside the image a row may be 10¹² times its scale: rounding then exceeds any
#: fraction of it, and no other row would count beside it.
ROW_SCALE_DISTANCE = 1e-2
#: Rows of the workspace behind those of :mod:`.least_distance`, and the total number of rows.
TURNED = constant(5)
SIDE = constant(6)
VECTORS = 7


class Cost(NamedTuple):
    """Cost that a plan minimises."""

    #: Duration of a block [s], and λ.
    length: float
    damping: float
    #: (H, 2) K_p and K_v, s and d. These and the following fields are zero in blocks that cannot be
    #: predicted.
    gains: Array
    rest: Array
    #: (H, n, n) JᵀJ, (H, n) Jᵀb, and (H, n) r.
    square: Array
    pull: Array
    free: Array


class Factor(NamedTuple):
    """Riccati factors of the cost: Y, y, L and the inverses of its diagonal, P of the cost-to-go.

    The cost-to-go of a state x is ½ xᵀP x − pᵀx, where the last row of P is p, with this sign.
    """

    Y: Annotated[Array, F8, "H", "n", "2n"]
    y: Annotated[Array, F8, "H", "n"]
    L: Annotated[Array, F8, "H", "n", "n"]
    inverse: Annotated[Array, F8, "H", "n"]
    P: Annotated[Array, F8, "2n + 1", "2n"]


class Limits(NamedTuple):
    """Rows along a plan."""

    instants: int  #: N, number of instants that can be predicted.
    #: (N,) block of each instant, and the time since it began [s]; block H is that of the brake.
    block: IntArray
    since: Array
    stop: float  #: Duration of the brake [s].
    #: (N, m) values for the plan without any acceleration, and (N, m, n) gradients with respect to
    #: q, or to q̇ if ``by_speed`` (m,) is not 0.
    value: Array
    gradient: Array
    by_speed: IntArray
    #: (N − 1,) and (N − 1, m): rows are value(t + 1) − fall value(t) ≤ left, multiplied by their
    #: factors.
    falls: Array
    left: Array
    row_factor: Array
    scale: Array  #: (m,) scales of the rows.
    #: (H, n) bounds of the box.
    low: Array
    high: Array


class Space(NamedTuple):
    """Workspace of the search, with p unknowns.

    ``u`` is the plan, and ``x`` (q, q̇) between its blocks and at its ends. ``moved`` are q and q̇ at
    every instant. ``normals`` are those of the ``active`` rows, and ``qr`` is their QR. ``held`` is
    their number in the previous sample. ``slack`` contains the slacks, in the units of the rows,
    and ``slack_unit`` the excess that a slack z = 1 allows. See :func:`pull_on` for ``adjoint``.
    """

    p: int
    u: Annotated[Array, F8, "H", "n"]
    x: Annotated[Array, F8, "H + 1", "2n"]
    moved: Annotated[Array, F8, 2, "N", "n"]
    work: Annotated[Array, F8, VECTORS, "p"]
    normals: Annotated[Array, F8, "p", "p"]
    qr: QR
    active: Annotated[IntArray, I8, "p"]
    held: Annotated[IntArray, I8, 1]
    slack: Annotated[Array, F8, "m"]
    slack_unit: Annotated[Array, F8, "m"]
    adjoint: Annotated[Array, F8, 3, "n"]


def lengths_of(H: int, N: int, n: int, m: int) -> dict[str, int]:
    """Return the lengths of the letters in declarations.

    They are those of H blocks, up to N instants, n joints and m rows.
    """
    p = H * n + m  # a QR is of up to p active rows
    sums = {"H + 1": H + 1, "N - 1": N - 1, "2n": 2 * n, "2n + 1": 2 * n + 1}
    return {"H": H, "N": N, "n": n, "m": m, "p": p, "c": p, "r": p, **sums}


@in_place
def factorise(cost: Cost, factor: Factor) -> bool:
    """Run the Riccati recursion from the last block to the first.

    Return False if rounding exceeds the damping.
    """
    H, n = cost.pull.shape
    T = cost.length
    h = 0.5 * cost.length**2
    P = factor.P
    Y = factor.Y
    y = factor.y
    L = factor.L
    linear = 2 * n
    P[:] = 0.0
    for k in range(H - 1, -1, -1):
        Kp = cost.gains[k, 0]
        Kv = cost.gains[k, 1]
        s = cost.rest[k, 0]
        d = cost.rest[k, 1]
        for i in range(n):
            pull = cost.pull[k, i]
            free = cost.damping * cost.free[k, i]
            y[k, i] = pull + free + h * P[linear, i] + T * P[linear, n + i]
            for j in range(n):
                square = cost.square[k, i, j]
                unit = cost.damping if i == j else 0.0
                by_q = h * P[i, j] + T * P[n + i, j]
                by_qd = h * P[i, n + j] + T * P[n + i, n + j]
                L[k, i, j] = square + unit + h * by_q + T * by_qd
                Y[k, i, j] = Kp * square + s * unit + by_q
                Y[k, i, n + j] = Kv * square + d * unit + T * by_q + by_qd
        # after a block, q becomes q + T q̇
        for i in range(linear + 1):
            for j in range(n):
                P[i, n + j] += T * P[i, j]
        for i in range(n):
            for j in range(linear):
                P[n + i, j] += T * P[i, j]
        for i in range(n):
            pull = cost.pull[k, i]
            free = cost.damping * cost.free[k, i]
            P[linear, i] += Kp * pull + s * free
            P[linear, n + i] += Kv * pull + d * free
            for j in range(n):
                square = cost.square[k, i, j]
                unit = cost.damping if i == j else 0.0
                P[i, j] += Kp * Kp * square + s * s * unit
                P[i, n + j] += Kp * Kv * square + s * d * unit
                P[n + i, j] += Kp * Kv * square + s * d * unit
                P[n + i, n + j] += Kv * Kv * square + d * d * unit
        if not eliminate(k, factor):
            return False
    return True


@in_place
def eliminate(k: int, factor: Factor) -> bool:
    """Eliminate the acceleration of block k from the cost-to-go, by Cholesky factorization.

    Return False if the factorization fails.
    """
    P = factor.P
    Y = factor.Y[k]
    y = factor.y[k]
    L = factor.L[k]
    inverse = factor.inverse[k]
    n = len(y)
    for j in range(n):
        for i in range(j, n):
            L[i, j] -= dot(L, i, L, j, START, j)
            if i == j:
                if not L[j, j] > 0.0:
                    return False
                inverse[j] = 1.0 / np.sqrt(L[j, j])
            L[i, j] *= inverse[j]
    for i in range(n):
        for c in range(i):
            y[i] -= L[i, c] * y[c]
            add(Y, i, -L[i, c], Y, c, START, 2 * n)
        y[i] *= inverse[i]
        for j in range(2 * n):
            Y[i, j] *= inverse[i]
    for c in range(n):
        for i in range(2 * n):
            add(P, i, -Y[c, i], Y, c, START, 2 * n)
        add(P, 2 * n, -y[c], Y, c, START, 2 * n)
    return True


@in_place
def roll_out(cost: Cost, factor: Factor, space: Space) -> None:
    """Write the plan and the states that follow from w."""
    H, n = cost.pull.shape
    T = cost.length
    u = space.u
    x = space.x
    for k in range(H):
        # Lᵀ u = w + y − Y x
        for i in range(n):
            w = space.work[POINT, k * n + i]
            feedback = dot(factor.Y[k], i, x, k, START, 2 * n)
            u[k, i] = w + factor.y[k, i] - feedback
        for i in range(n - 1, -1, -1):
            u[k, i] *= factor.inverse[k, i]
            add(u, k, -u[k, i], factor.L[k], i, START, i)
        follow_block(T, u, x, k, n)


@in_place
def follow_block(T: float, u: Array, x: Array, k: int, n: int) -> None:
    """Write the state after block k."""
    for j in range(n):
        x[k + 1, j] = x[k, j] + T * (x[k, n + j] + 0.5 * T * u[k, j])
        x[k + 1, n + j] = x[k, n + j] + T * u[k, j]


@in_place
def move(limits: Limits, u: Array, x: Array, moved: Array) -> None:
    """Write q and q̇ at every instant."""
    n = moved.shape[2]
    for t in range(limits.instants):
        k = limits.block[t]
        tau = limits.since[t]
        for j in range(n):
            q = x[k, j]
            qd = x[k, n + j]
            if k == len(u):
                moved[0, t, j] = q + 0.5 * limits.stop * qd
                moved[1, t, j] = 0.0
            else:
                moved[0, t, j] = q + tau * (qd + 0.5 * tau * u[k, j])
                moved[1, t, j] = qd + tau * u[k, j]


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
def first_slack_row(limits: Limits) -> int:
    """Return the number of the row z₀ ≥ 0."""
    first: int = limits.left.size + 2 * limits.low.size
    return first


@in_place
def at(limits: Limits, moved: Array, t: int, i: int) -> float:
    """Return the value of constraint i at an instant."""
    order = 1 if limits.by_speed[i] else 0
    change = dot(limits.gradient[t], i, moved[order], t, START, moved.shape[2])
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
    m = limits.gradient.shape[1]
    n = limits.gradient.shape[2]
    if is_constraint(limits, row):
        t = row // m
        i = row % m
        value = at(limits, space.moved, t, i)
        next_value = at(limits, space.moved, t + 1, i)
        return constraint_excess(limits, t, i, value, next_value)
    entry = row - limits.left.size
    k = (entry % limits.low.size) // n
    j = entry % n
    over: float
    if entry < limits.low.size:
        over = space.u[k, j] - limits.high[k, j]
    else:
        over = limits.low[k, j] - space.u[k, j]
    return over


@in_place
def most_exceeded(limits: Limits, space: Space, met: float) -> int:
    """Return the row with the greatest excess relative to its scale; ``NONE`` if all are met.

    The scale of a bound is the width of the box.
    """
    N = limits.instants
    m = limits.gradient.shape[1]
    n = limits.gradient.shape[2]
    chosen = NONE
    most = met
    for i in range(m):
        value = at(limits, space.moved, 0, i)
        for t in range(N - 1):
            next_value = at(limits, space.moved, t + 1, i)
            over = constraint_excess(limits, t, i, value, next_value)
            over = (over - space.slack[i]) / limits.scale[i]
            if over > most:
                chosen = t * m + i
                most = over
            value = next_value
    size = limits.low.size
    for k in range(len(limits.low)):
        for j in range(n):
            above = space.u[k, j] - limits.high[k, j]
            below = limits.low[k, j] - space.u[k, j]
            over = max(above, below) / (limits.high[k, j] - limits.low[k, j])
            if over > most:
                chosen = limits.left.size + k * n + j + (0 if above > below else size)
                most = over
    return chosen


@in_place
def pull_on(limits: Limits, adjoint: Array, t: int, i: int, factor: float, inside: bool) -> None:
    """Add the gradient of a row at an instant to the adjoint.

    adjoint[0] is the gradient with respect to the acceleration of the row's block. adjoint[1] and
    adjoint[2] are those with respect to q and q̇ of the state before the block. Unless ``inside``,
    the instant is the end of the previous block.
    """
    tau = limits.since[t] if inside else 0.0
    for j in range(adjoint.shape[1]):
        c = factor * limits.gradient[t, i, j]
        if limits.by_speed[i]:
            adjoint[0, j] += tau * c
            adjoint[2, j] += c
        else:
            adjoint[0, j] += 0.5 * tau * tau * c
            adjoint[1, j] += c
            adjoint[2, j] += tau * c


@in_place
def differentiate(
    cost: Cost, factor: Factor, limits: Limits, row: int, adjoint: Array, X: Array
) -> None:
    """Write the gradient of a row with respect to w to X[NEW], block after block backwards."""
    m = limits.gradient.shape[1]
    n = limits.gradient.shape[2]
    H = len(limits.low)
    T = cost.length
    X[NEW] = 0.0
    adjoint[:] = 0.0
    if is_constraint(limits, row):
        t = row // m
        i = row % m
        k = limits.block[t + 1]
        factor_of_row = limits.row_factor[t, i]
        if k == H:
            for j in range(n):
                adjoint[1, j] = factor_of_row * limits.gradient[t + 1, i, j]
                adjoint[2, j] = 0.5 * limits.stop * adjoint[1, j]
        else:
            pull_on(limits, adjoint, t + 1, i, factor_of_row, True)
        if t > 0:
            is_same_block = limits.block[t] == k
            pull_on(limits, adjoint, t, i, -factor_of_row * limits.falls[t], is_same_block)
    else:
        entry = row - limits.left.size
        k = (entry % limits.low.size) // n
        adjoint[0, entry % n] = 1.0 if entry < limits.low.size else -1.0
    if k == H:
        k -= 1
        step_back(T, adjoint)
    # from Lᵀ u = w + y − Y x: the gradient g with respect to w is L⁻¹ times that with respect to u,
    # and −Yᵀ g is added to that with respect to x
    while k >= 0:
        for i in range(n):
            g = adjoint[0, i]
            for c in range(i):
                g -= factor.L[k, i, c] * X[NEW, k * n + c]
            g *= factor.inverse[k, i]
            X[NEW, k * n + i] = g
            for j in range(n):
                adjoint[1, j] -= factor.Y[k, i, j] * g
                adjoint[2, j] -= factor.Y[k, i, n + j] * g
        step_back(T, adjoint)
        k -= 1


@in_place
def step_back(T: float, adjoint: Array) -> None:
    """Propagate the adjoint of the state after a block to its acceleration and its first state.

    adjoint[0] becomes the gradient with respect to the acceleration. adjoint[1] and adjoint[2]
    become those with respect to q and q̇ of the state before the block.
    """
    for j in range(adjoint.shape[1]):
        adjoint[0, j] = T * (0.5 * T * adjoint[1, j] + adjoint[2, j])
        adjoint[2, j] += T * adjoint[1, j]


@in_place
def drop(space: Space, leaving: int, q: int) -> None:
    """Remove one active row, so that q are left, and refactor the rows behind it."""
    X = space.work
    qr = space.qr
    p = space.p
    for j in range(leaving, q):
        space.active[j] = space.active[j + 1]
        X[FORCE, j] = X[FORCE, j + 1]
        X[SIDE, j] = X[SIDE, j + 1]
        copy(space.normals, j, space.normals, j + 1, p)
        copy(qr.columns, j, space.normals, j, p)
        apply_transposed(qr, j, qr.columns, j)
        make_reflection(qr, j)


@in_place
def reach(space: Space, side: float, q: int) -> int:
    """Move the point until the row with the normal X[NEW] is met.

    Active rows whose multiplier would become negative are removed. Return how many of the q active
    rows are left, or ``NO_POINT`` if no point meets the row together with them.
    """
    X = space.work
    p = space.p
    while True:
        over = dot(X, NEW, X, POINT, START, p) - side
        copy(X, TURNED, X, NEW, p)
        apply_transposed(space.qr, q, X, TURNED)
        leaving = advance(space.qr, X, TURNED, over, q, p)
        if leaving < 0:
            return q if leaving == NONE else NO_POINT
        q -= 1
        drop(space, leaving, q)


@in_place
def append(space: Space, row: int, side: float, q: int) -> None:
    """Add the row with the normal X[NEW] to the q active ones.

    X[TURNED] is the normal in the basis of the QR.
    """
    X = space.work
    copy(space.normals, q, X, NEW, space.p)
    copy(space.qr.columns, q, X, TURNED, space.p)
    make_reflection(space.qr, q)
    space.active[q] = row
    X[SIDE, q] = side


@in_place
def minimise(space: Space, q: int) -> None:
    """Compute the point nearest to the origin on the q active rows, and the multipliers."""
    X = space.work
    for j in range(space.p):
        X[POINT, j] = X[SIDE, j] if j < q else 0.0
    least_distance.minimise(space.qr, X, q)


@in_place
def write_normal(
    cost: Cost, factor: Factor, limits: Limits, space: Space, row: int, penalty: float
) -> float:
    """Write the unit normal of a row of the constraints or of the box to X[NEW]; return its side.

    Return NaN if no plan has any influence on the row.
    """
    X = space.work
    m = limits.gradient.shape[1]
    first_slack = limits.low.size
    differentiate(cost, factor, limits, row, space.adjoint, X)
    side = dot(X, NEW, X, POINT, START, first_slack) - excess(limits, space, row)
    has_slack = space.p > first_slack and is_constraint(limits, row)
    if has_slack:
        # the slack allows an excess of unit z = unit (z + π) − unit π; z + π is the coordinate
        i = row % m
        X[NEW, first_slack + i] = -space.slack_unit[i]
        side -= space.slack_unit[i] * penalty
    length = np.sqrt(dot(X, NEW, X, NEW, START, space.p))
    # the gradient of a bound of the box cannot vanish, and there may be no other rows
    if is_constraint(limits, row) and length <= ZERO_GRADIENT * limits.scale[row % m]:
        return math.nan
    for j in range(space.p):
        X[NEW, j] /= length
    distance: float = side / length
    return distance


@in_place
def write_slack_normal(space: Space, coordinate: int, penalty: float) -> float:
    """Write the normal of z ≥ 0, i.e. −(z + π) ≤ −π, to X[NEW]; return its side.

    ``coordinate`` is that of z + π.
    """
    X = space.work
    X[NEW] = 0.0
    X[NEW, coordinate] = -1.0
    return -penalty


@in_place
def most_negative_slack(space: Space, penalty: float, first: int) -> int:
    """Write the slacks, and return the index of the most negative one, or ``NONE``.

    Negligible slacks are set to zero. ``first`` is the coordinate of the first slack.
    """
    X = space.work
    chosen = NONE
    least = -NEGLIGIBLE * penalty
    for i in range(space.p - first):
        z = X[POINT, first + i] - penalty
        if z < least:
            chosen = i
            least = z
        space.slack[i] = space.slack_unit[i] * z if z > NEGLIGIBLE * penalty else 0.0
    return chosen


@in_place
def cost_of(space: Space, penalty: float, first: int) -> float:
    """Return twice the cost of the point beyond that of the plan without rows.

    It increases with every added row.
    """
    X = space.work
    total = dot(X, POINT, X, POINT, START, first)
    for j in range(first, space.p):
        z = X[POINT, j] - penalty
        total += z * (z + 2.0 * penalty)
    return total


@in_place
def search(
    cost: Cost, factor: Factor, limits: Limits, space: Space, q: int, penalty: float, met: float
) -> tuple[int, int]:
    """Add rows to the q active ones until all are met.

    Return the code and the number of active rows. Every added row increases the cost. If one does
    not, rounding errors prevail, and the search fails.
    """
    m = limits.gradient.shape[1]
    first_slack = limits.low.size
    last_cost = -1.0
    now = 0.0
    for _ in range(20 * space.p):
        slack = most_negative_slack(space, penalty, first_slack)
        predict(cost, factor, limits, space)
        if slack != NONE:
            row = first_slack_row(limits) + slack
            side = write_slack_normal(space, first_slack + slack, penalty)
        else:
            row = most_exceeded(limits, space, met)
            if row == NONE:
                return SOLVED, q
            side = write_normal(cost, factor, limits, space, row, penalty)
        if math.isnan(side):
            if not is_constraint(limits, row):
                return FAILED, q
            # a row that no plan changes becomes slack, whatever the cost
            space.slack[row % m] = max(space.slack[row % m], excess(limits, space, row))
            continue
        if not now > last_cost:
            return FAILED, q
        q = reach(space, side, q)
        if q == NO_POINT:
            return INCOMPATIBLE, 0
        append(space, row, side, q)
        q += 1
        minimise(space, q)
        clip_forces(space.work, q)
        last_cost = now
        now = cost_of(space, penalty, first_slack)
    return FAILED, q


@in_place
def is_predicted(limits: Limits, row: int) -> bool:
    """True if a row is a bound of the box, or a constraint at instants that can be predicted."""
    if is_constraint(limits, row):
        t = row // limits.gradient.shape[1]
        return bool(t < limits.instants - 1)
    return bool(row < first_slack_row(limits))


@in_place
def resume(cost: Cost, factor: Factor, limits: Limits, space: Space) -> int:
    """Start with the previously active rows that are still active, and return their number."""
    X = space.work
    q = 0
    predict(cost, factor, limits, space)
    for k in range(space.held[0]):
        row = space.active[k]
        if not is_predicted(limits, row):
            continue
        side = write_normal(cost, factor, limits, space, row, 1.0)
        copy(X, TURNED, X, NEW, space.p)
        apply_transposed(space.qr, q, X, TURNED)
        outside = dot(X, TURNED, X, TURNED, q, space.p)
        if abs(side) < math.inf and outside > INDEPENDENT:
            append(space, row, side, q)
            q += 1
    minimise(space, q)
    while q > 0:
        leaving = 0
        for j in range(q):
            if X[FORCE, j] < X[FORCE, leaving]:
                leaving = j
        if X[FORCE, leaving] >= 0.0:
            break
        q -= 1
        drop(space, leaving, q)
        minimise(space, q)
    return q


@in_place
def measure_excess(
    cost: Cost, factor: Factor, limits: Limits, space: Space, weights: Array
) -> tuple[float, float]:
    """Return the greatest distance of a constraint row from the plan without rows, and a mean.

    The mean is the geometric mean, over the exceeded rows, of their gradients with respect to w, in
    units of their scales and multiplied by their weights. Both are 1 if no row is exceeded.
    """
    X = space.work
    m = limits.gradient.shape[1]
    greatest = 0.0
    sum_of_logarithms = 0.0
    count = 0
    for row in range((limits.instants - 1) * m):
        i = row % m
        over = excess(limits, space, row)
        if not over > 0.0:
            continue
        differentiate(cost, factor, limits, row, space.adjoint, X)
        length = np.sqrt(dot(X, NEW, X, NEW, START, limits.low.size))
        if length > ZERO_GRADIENT * limits.scale[i]:
            greatest = max(greatest, over / length)
            sum_of_logarithms += np.log(length * weights[i] / limits.scale[i])
            count += 1
    distance = greatest if greatest > 0.0 else 1.0
    return distance, np.exp(sum_of_logarithms / max(count, 1))


@in_place
def soften(
    cost: Cost, factor: Factor, limits: Limits, space: Space, weights: Array, strength: float
) -> tuple[int, float]:
    """Start with slacks of zero; return the number of active rows and the penalty π.

    The active rows are z ≥ 0 for each slack. π is ``strength`` times the greatest distance of a row
    from the plan without rows. The unit of a slack is that by which a step moves the exceeded rows,
    in the geometric mean by weight.
    """
    m = limits.gradient.shape[1]
    X = space.work
    first_slack = limits.low.size
    X[POINT] = 0.0
    space.slack[:] = 0.0
    predict(cost, factor, limits, space)
    distance, mean_gradient = measure_excess(cost, factor, limits, space, weights)
    penalty = strength * distance
    for i in range(m):
        space.slack_unit[i] = mean_gradient * limits.scale[i] / weights[i]
        side = write_slack_normal(space, first_slack + i, penalty)
        copy(X, TURNED, X, NEW, space.p)
        apply_transposed(space.qr, i, X, TURNED)
        append(space, first_slack_row(limits) + i, side, i)
    minimise(space, m)
    clip_forces(X, m)
    return m, penalty


@in_place
def with_unknowns(space: Space, p: int) -> Space:
    """Return a workspace in the same arrays, of a search with p unknowns."""
    return Space(
        p,
        space.u,
        space.x,
        space.moved,
        space.work,
        space.normals,
        QR(space.qr.columns, space.qr.scalars),
        space.active,
        space.held,
        space.slack,
        space.slack_unit,
        space.adjoint,
    )


@in_place
def plan_best(
    cost: Cost, factor: Factor, limits: Limits, space: Space, weights: Array
) -> tuple[int, int]:
    """Write the best plan to ``space.u``, with slacks if rows contradict each other.

    Return the code and the number of active rows.
    """
    hard = with_unknowns(space, limits.low.size)
    if not factorise(cost, factor):
        return RANK_LOSS, 0
    hard.work[POINT] = 0.0
    hard.slack[:] = 0.0
    q = resume(cost, factor, limits, hard)
    code, q = search(cost, factor, limits, hard, q, 1.0, MET)
    space.held[0] = q if code == SOLVED else 0
    soft = with_unknowns(space, space.p)
    for strength in (STRONG, WEAK):
        if code in (INCOMPATIBLE, FAILED):
            q, penalty = soften(cost, factor, limits, soft, weights, strength)
            code, q = search(cost, factor, limits, soft, q, penalty, MET_SOFT)
            code = RELAXED_ROWS if code == SOLVED else FAILED
    return code, q
