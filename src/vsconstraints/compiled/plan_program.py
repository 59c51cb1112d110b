"""The plan of constant accelerations that tracks best of those that meet every row, compiled.

A plan u has H blocks for n joints; x = (q, q̇) is how far it moves them, as double integrators.
Minimised is

    ½ Σₖ ‖Jₖ (uₖ + K_p qₖ + K_v q̇ₖ) − bₖ‖² + λ ‖uₖ + s qₖ + d q̇ₖ − rₖ‖²

subject to rows σ(τ + Δτ) ≤ e^(−Δτ/κ) σ(τ), linear in x, at N instants, and to a box of u. A Riccati
recursion turns the cost into ½‖w‖² with Lₖᵀ uₖ = wₖ + yₖ − Yₖ xₖ, in a time linear in H. In w the
plan is the point nearest to the origin, which a dual active-set method finds (Goldfarb and Idnani
1983): every row is evaluated at every point, but only those that are added are differentiated, by
an adjoint recursion.

Where rows contradict each other, each has a slack zᵢ ≥ 0, common to all instants, of the cost ½zᵢ²
+ π zᵢ.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np

from ..rows import Array, IntArray
from ..rows.tolerances import ZERO_GRADIENT
from . import least_distance
from .compiler import in_place
from .least_distance import FORCE, NEW, NONE, POINT, advance, clip_forces
from .linear import START, add, apply_transposed, constant, copy, dot, make_reflection
from .workspace import FAILED, INCOMPATIBLE, RANK_LOSS, RELAXED_ROWS, SOLVED

#: π by the greatest distance of a row from the plan without rows; the weaker one where the stronger
#: one fails.
STRONG = 1e6
WEAK = 1e4
NEGLIGIBLE = 1e-14  #: Slack by π that is none.
#: Square of the part of a unit normal outside the span of others from which on a row is begun with.
INDEPENDENT = 1e-12
#: A row exceeded by less than this fraction of its scale is met: of rows that are compatible, and
#: with slacks.
MET = 1e-11
MET_SOFT = 1e-6
#: Rows that change by more than their scale over this way [rad or m] are divided by as much. Far
#: outside the image a row may be 10¹² times its scale: rounding then exceeds any fraction of it,
#: and no other row would count beside it.
WAY = 1e-2
#: Rows of the work space behind those of :mod:`.least_distance`, and how many there are in all.
TURNED = constant(5)
SIDE = constant(6)
VECTORS = 7


class Cost(NamedTuple):
    """What a plan is to follow."""

    #: Of a block [s], and λ.
    length: float
    damping: float
    #: (H, 2) K_p and K_v, s and d; zero in blocks that cannot be predicted, like the following.
    gains: Array
    rest: Array
    #: (H, n, n) JᵀJ, (H, n) Jᵀb, and (H, n) r.
    square: Array
    pull: Array
    free: Array


class Factor(NamedTuple):
    """Y (H, n, 2n), y (H, n), L (H, n, n) and the inverses of its diagonal (H, n); P (2n + 1, 2n)
    of the cost to go.
    """

    Y: Array
    y: Array
    L: Array
    inverse: Array
    P: Array


class Limits(NamedTuple):
    """Rows along a plan."""

    instants: int  #: N, of those that can be predicted.
    #: (N,) in which block each instant is, and how long it has lasted [s]; the block H is that of
    #: the brake.
    block: IntArray
    since: Array
    stop: float  #: How long the brake takes [s].
    #: (N, m) of the plan without any acceleration, and (N, m, n) by q, or by q̇ where ``by_speed``
    #: (m,) is not 0.
    value: Array
    gradient: Array
    by_speed: IntArray
    #: (N − 1,) and (N − 1, m): rows are value(t + 1) − fall value(t) ≤ left, multiplied by their
    #: shares.
    falls: Array
    left: Array
    share: Array
    scale: Array  #: (m,) of the rows.
    #: (H, n) the box.
    low: Array
    high: Array


class Space(NamedTuple):
    """Where to compute, with p unknowns: x (H + 1, 2n), moved (2, N, n), work (VECTORS, p),
    normals, F (p, p), T.

    ``active`` (p,) are the rows that hold the plan, ``held`` (1,) how many did in the sample
    before; ``slack`` (m,) and ``gives`` (m,) how far rows give.
    """

    p: int
    u: Array
    x: Array
    moved: Array
    work: Array
    normals: Array
    F: Array
    T: Array
    active: IntArray
    held: IntArray
    slack: Array
    gives: Array
    adjoint: Array

    @classmethod
    def of(cls, H: int, N: int, n: int, m: int) -> Self:
        """For H blocks, up to N instants, n joints and m rows."""
        p = H * n + m
        zeros = np.zeros
        states = (zeros((H, n)), zeros((H + 1, 2 * n)), zeros((2, N, n)))
        square = (p, p)
        search = zeros((VECTORS, p)), zeros(square), zeros(square), zeros((2, p))
        counts = np.zeros(p, dtype=np.int64), np.zeros(1, dtype=np.int64)
        return cls(p, *states, *search, *counts, zeros(m), zeros(m), zeros((3, n)))


@in_place
def factorise(cost: Cost, factor: Factor) -> bool:
    """The Riccati recursion, from the last block to the first; False where rounding exceeds the
    damping.
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
        # a block later q is q + T q̇
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
    """Take the acceleration of block k out of the cost to go, by Cholesky's factorisation."""
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
                inverse[j] = 1.0 / math.sqrt(L[j, j])
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
    """Write the plan and the states that w makes."""
    H, n = cost.pull.shape
    T = cost.length
    u = space.u
    x = space.x
    for k in range(H):
        for i in range(n):
            u[k, i] = (
                space.work[POINT, k * n + i]
                + factor.y[k, i]
                - dot(factor.Y[k], i, x, k, START, 2 * n)
            )
        for i in range(n - 1, -1, -1):
            u[k, i] *= factor.inverse[k, i]
            add(u, k, -u[k, i], factor.L[k], i, START, i)
        follow_block(T, u, x, k, n)


@in_place
def follow_block(T: float, u: Array, x: Array, k: int, n: int) -> None:
    """The state after block k."""
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
            if k == len(u):
                moved[0, t, j] = x[k, j] + 0.5 * limits.stop * x[k, n + j]
                moved[1, t, j] = 0.0
            else:
                moved[0, t, j] = x[k, j] + tau * (x[k, n + j] + 0.5 * tau * u[k, j])
                moved[1, t, j] = x[k, n + j] + tau * u[k, j]


@in_place
def at(limits: Limits, moved: Array, t: int, i: int) -> float:
    """The value of a row at an instant."""
    order = 1 if limits.by_speed[i] else 0
    value: float = limits.value[t, i] + dot(
        limits.gradient[t], i, moved[order], t, START, moved.shape[2]
    )
    return value


@in_place
def excess(limits: Limits, space: Space, row: int) -> float:
    """By how much a row is exceeded: those of all instants, then the upper and the lower side of
    the box.
    """
    m = limits.gradient.shape[1]
    n = limits.gradient.shape[2]
    rows = limits.left.size
    over: float
    if row < rows:
        t = row // m
        i = row % m
        over = (
            at(limits, space.moved, t + 1, i)
            - limits.falls[t] * at(limits, space.moved, t, i)
            - limits.left[t, i]
        )
        over *= limits.share[t, i]
    else:
        entry = row - rows
        size = limits.low.size
        k = (entry % size) // n
        j = entry % n
        over = (
            space.u[k, j] - limits.high[k, j] if entry < size else limits.low[k, j] - space.u[k, j]
        )
    return over


@in_place
def most_exceeded(limits: Limits, space: Space, met: float) -> int:
    """The row that is exceeded most, by its scale, or the width of the box; −1 if all are met."""
    N = limits.instants
    m = limits.gradient.shape[1]
    n = limits.gradient.shape[2]
    chosen = -1
    most = met
    for i in range(m):
        before = at(limits, space.moved, 0, i)
        for t in range(N - 1):
            after = at(limits, space.moved, t + 1, i)
            over = limits.share[t, i] * (after - limits.falls[t] * before - limits.left[t, i])
            over = (over - space.slack[i]) / limits.scale[i]
            if over > most:
                chosen = t * m + i
                most = over
            before = after
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
    """Add the gradient of a row at an instant by the acceleration of its block, adjoint[0], and by
    the state before it.

    That is adjoint[1] by q and adjoint[2] by q̇; the state is that of the end of the block before
    unless ``inside``.
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
    """Write the gradient of a row by w to X[NEW], block after block backwards."""
    m = limits.gradient.shape[1]
    n = limits.gradient.shape[2]
    rows = limits.left.size
    H = len(limits.low)
    T = cost.length
    X[NEW] = 0.0
    adjoint[:] = 0.0
    if row < rows:
        t = row // m
        i = row % m
        k = limits.block[t + 1]
        share = limits.share[t, i]
        if k == H:
            for j in range(n):
                adjoint[1, j] = share * limits.gradient[t + 1, i, j]
                adjoint[2, j] = 0.5 * limits.stop * adjoint[1, j]
        else:
            pull_on(limits, adjoint, t + 1, i, share, True)
        if t > 0:
            pull_on(limits, adjoint, t, i, -share * limits.falls[t], limits.block[t] == k)
    else:
        entry = row - rows
        k = (entry % limits.low.size) // n
        adjoint[0, entry % n] = 1.0 if entry < limits.low.size else -1.0
    if k == H:
        k -= 1
        step_back(T, adjoint)
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
    """From the gradient by the state after a block to those by its acceleration and by the state
    before it.
    """
    for j in range(adjoint.shape[1]):
        adjoint[0, j] = T * (0.5 * T * adjoint[1, j] + adjoint[2, j])
        adjoint[2, j] += T * adjoint[1, j]


@in_place
def drop(space: Space, leaving: int, q: int) -> None:
    """Let one of the active rows leave, of which q are left, and factor those behind it anew."""
    X = space.work
    F = space.F
    p = space.p
    for j in range(leaving, q):
        space.active[j], X[FORCE, j], X[SIDE, j] = (
            space.active[j + 1],
            X[FORCE, j + 1],
            X[SIDE, j + 1],
        )
        copy(space.normals, j, space.normals, j + 1, p)
        copy(F, j, space.normals, j, p)
        apply_transposed(F, space.T, j, F, j)
        make_reflection(F, space.T, j)


@in_place
def reach(space: Space, side: float, q: int) -> int:
    """Move the point until the row with the normal X[NEW] is met; rows whose multiplier would turn
    negative leave.

    Returns how many of the q are left, or −1 if no point meets the row together with them.
    """
    X = space.work
    F = space.F
    T = space.T
    p = space.p
    while True:
        over = dot(X, NEW, X, POINT, START, p) - side
        copy(X, TURNED, X, NEW, p)
        apply_transposed(F, T, q, X, TURNED)
        leaving = advance(F, T, X, TURNED, over, q, p)
        if leaving < 0:
            return q if leaving == NONE else -1
        q -= 1
        drop(space, leaving, q)


@in_place
def append(space: Space, row: int, side: float, q: int) -> None:
    """Add the row with the normal X[NEW], X[TURNED] in the basis of the QR, to the q active
    ones.
    """
    X = space.work
    copy(space.normals, q, X, NEW, space.p)
    copy(space.F, q, X, TURNED, space.p)
    make_reflection(space.F, space.T, q)
    space.active[q] = row
    X[SIDE, q] = side


@in_place
def minimise(space: Space, q: int) -> None:
    """Compute the point nearest to the origin on the q active rows, and multipliers."""
    X = space.work
    for j in range(space.p):
        X[POINT, j] = X[SIDE, j] if j < q else 0.0
    least_distance.minimise(space.F, space.T, X, q)


@in_place
def state_row(
    cost: Cost, factor: Factor, limits: Limits, space: Space, row: int, penalty: float
) -> float:
    """Write the unit normal of a row to X[NEW]; its side, or NaN where no plan has any influence on
    it.

    Rows behind those of the box are those of the slacks, z ≥ 0, in units of the size of the
    problem.
    """
    X = space.work
    m = limits.gradient.shape[1]
    first = limits.low.size
    bounds = limits.left.size + 2 * first
    if row >= bounds:
        X[NEW] = 0.0
        X[NEW, first + row - bounds] = -1.0
        return -penalty
    differentiate(cost, factor, limits, row, space.adjoint, X)
    side = dot(X, NEW, X, POINT, START, first) - excess(limits, space, row)
    if space.p > first and row < limits.left.size:
        i = row % m
        X[NEW, first + i] = -space.gives[i]
        side -= space.gives[i] * penalty
    length = math.sqrt(dot(X, NEW, X, NEW, START, space.p))
    # rows of the box have no gradient that could vanish, and there may be no others
    if row < limits.left.size and length <= ZERO_GRADIENT * limits.scale[row % m]:
        return math.nan
    for j in range(space.p):
        X[NEW, j] /= length
    return side / length


@in_place
def deepest_slack(space: Space, penalty: float, first: int) -> int:
    """Write the slacks, zeros where they are negligible; the most negative one, or −1."""
    X = space.work
    sunk = -1
    deep = -NEGLIGIBLE * penalty
    for i in range(space.p - first):
        z = X[POINT, first + i] - penalty
        if z < deep:
            sunk = i
            deep = z
        space.slack[i] = space.gives[i] * z if z > NEGLIGIBLE * penalty else 0.0
    return sunk


@in_place
def cost_of(space: Space, penalty: float, first: int) -> float:
    """Twice the cost of the point beyond that of no acceleration at all: it grows with every
    row.
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
    """Add rows until all are met: the code, and how many are active."""
    m = limits.gradient.shape[1]
    plan = limits.low.size
    bounds = limits.left.size + 2 * plan
    before = -1.0
    now = 0.0
    for _ in range(20 * space.p):
        row = deepest_slack(space, penalty, plan)
        row = row if row < 0 else bounds + row
        roll_out(cost, factor, space)
        move(limits, space.u, space.x, space.moved)
        if row < 0:
            row = most_exceeded(limits, space, met)
        if row < 0:
            return SOLVED, q
        side = state_row(cost, factor, limits, space, row, penalty)
        if math.isnan(side) and row >= limits.left.size:
            return FAILED, q
        if math.isnan(side):
            # what no plan changes is slack, whatever it costs
            space.slack[row % m] = max(space.slack[row % m], excess(limits, space, row))
            continue
        if not now > before:
            return FAILED, q
        q = reach(space, side, q)
        if q < 0:
            return INCOMPATIBLE, 0
        append(space, row, side, q)
        q += 1
        minimise(space, q)
        clip_forces(space.work, q)
        before = now
        now = cost_of(space, penalty, plan)
    return FAILED, q


@in_place
def resume(cost: Cost, factor: Factor, limits: Limits, space: Space) -> int:
    """Begin with the rows that held the plan before, as far as they still do: how many are
    active.
    """
    X = space.work
    q = 0
    last = limits.left.size + 2 * limits.low.size
    roll_out(cost, factor, space)
    move(limits, space.u, space.x, space.moved)
    for k in range(space.held[0]):
        row = space.active[k]
        if row < last and (
            row >= limits.left.size or row // limits.gradient.shape[1] < limits.instants - 1
        ):
            side = state_row(cost, factor, limits, space, row, 1.0)
            copy(X, TURNED, X, NEW, space.p)
            apply_transposed(space.F, space.T, q, X, TURNED)
            if abs(side) < math.inf and dot(X, TURNED, X, TURNED, q, space.p) > INDEPENDENT:
                append(space, row, side, q)
                q += 1
    minimise(space, q)
    while q > 0:
        leaving = 0
        for j in range(q):
            leaving = j if X[FORCE, j] < X[FORCE, leaving] else leaving
        if X[FORCE, leaving] >= 0.0:
            break
        q -= 1
        drop(space, leaving, q)
        minimise(space, q)
    return q


@in_place
def soften(
    cost: Cost, factor: Factor, limits: Limits, space: Space, weights: Array, strength: float
) -> tuple[int, float]:
    """Begin with slacks, all of them zero: how many rows are active, and the penalty π.

    π is ``strength`` times the greatest distance of a row from the plan without rows; a slack is of
    the unit by which a step moves the exceeded rows, in the geometric mean by weight.
    """
    m = limits.gradient.shape[1]
    X = space.work
    first = limits.low.size
    X[POINT] = 0.0
    space.slack[:] = 0.0
    roll_out(cost, factor, space)
    move(limits, space.u, space.x, space.moved)
    size = 0.0
    total = 0.0
    count = 0
    for row in range((limits.instants - 1) * m):
        over = excess(limits, space, row)
        if over > 0.0:
            differentiate(cost, factor, limits, row, space.adjoint, X)
            length = math.sqrt(dot(X, NEW, X, NEW, START, first))
            if length > ZERO_GRADIENT * limits.scale[row % m]:
                size = max(size, over / length)
                total += math.log(length * weights[row % m] / limits.scale[row % m])
                count += 1
    penalty = strength * (size if size > 0.0 else 1.0)
    for i in range(m):
        space.gives[i] = math.exp(total / max(count, 1)) * limits.scale[i] / weights[i]
        X[NEW] = 0.0
        X[NEW, first + i] = -1.0
        copy(X, TURNED, X, NEW, space.p)
        apply_transposed(space.F, space.T, i, X, TURNED)
        append(space, limits.left.size + 2 * first + i, -penalty, i)
    minimise(space, m)
    clip_forces(X, m)
    return m, penalty


@in_place
def plan_best(
    cost: Cost, factor: Factor, limits: Limits, space: Space, weights: Array
) -> tuple[int, int]:
    """Write the plan to ``space.u``, with slacks where rows contradict each other: code and number
    of active rows.
    """
    hard = Space(
        limits.low.size, space.u, space.x, space.moved, space.work, space.normals, space.F, space.T, space.active,
        space.held, space.slack, space.gives, space.adjoint,
    )  # fmt: skip
    if not factorise(cost, factor):
        return RANK_LOSS, 0
    hard.work[POINT] = 0.0
    hard.slack[:] = 0.0
    q = resume(cost, factor, limits, hard)
    code, q = search(cost, factor, limits, hard, q, 1.0, MET)
    space.held[0] = q if code == SOLVED else 0
    soft = Space(
        space.p, space.u, space.x, space.moved, space.work, space.normals, space.F, space.T, space.active,
        space.held, space.slack, space.gives, space.adjoint,
    )  # fmt: skip
    for strength in (STRONG, WEAK):
        if code in (INCOMPATIBLE, FAILED):
            q, penalty = soften(cost, factor, limits, soft, weights, strength)
            code, q = search(cost, factor, limits, soft, q, penalty, MET_SOFT)
            code = RELAXED_ROWS if code == SOLVED else FAILED
    return code, q
