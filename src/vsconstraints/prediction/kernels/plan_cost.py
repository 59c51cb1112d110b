"""Cost of a plan as the distance of a point from the origin, compiled.

A Riccati recursion turns the cost of :mod:`.plan_arrays` into ½‖w‖² and a constant, in a time
linear in the number H of blocks. It yields Lₖᵀ uₖ = wₖ + yₖ − Yₖ xₖ. The plan without rows is
w = 0.
"""

from __future__ import annotations

import numpy as np

from ...compiled.compiler import in_place
from ...compiled.least_distance import POINT
from ...compiled.linear import START, add, dot
from ...rows import Array
from .plan_arrays import Cost, Factor, Space


@in_place
def factorise(cost: Cost, factor: Factor) -> bool:
    """Run the Riccati recursion from the last block to the first.

    Return False if rounding exceeds the damping.
    """
    H, n = cost.pull.shape
    factor.P[:] = 0.0
    for k in range(H - 1, -1, -1):
        write_terms_of_acceleration(k, cost, factor)
        go_back_through_block(cost.length, factor.P, n)
        add_cost_of_block(k, cost, factor.P)
        if not eliminate(k, factor):
            return False
    return True


@in_place
def feedback_of(cost: Cost, k: int) -> tuple[float, float, float, float]:
    """Return K_p and K_v, s and d of block k."""
    gains = cost.gains[k]
    rest = cost.rest[k]
    return gains[0], gains[1], rest[0], rest[1]


@in_place
def write_terms_of_acceleration(k: int, cost: Cost, factor: Factor) -> None:
    """Write ½ uᵀL u + uᵀ(Y x − y): the terms of the cost with the acceleration u of block k.

    x is the state before the block. P is the cost-to-go of the state after it. L is not factored
    yet.
    """
    n = cost.pull.shape[1]
    T = cost.length
    h = 0.5 * cost.length**2
    P = factor.P
    Y = factor.Y[k]
    y = factor.y[k]
    L = factor.L[k]
    linear = 2 * n
    Kp, Kv, s, d = feedback_of(cost, k)
    for i in range(n):
        pull = cost.pull[k, i]
        free = cost.damping * cost.free[k, i]
        y[i] = pull + free + h * P[linear, i] + T * P[linear, n + i]
        for j in range(n):
            square = cost.square[k, i, j]
            unit = cost.damping if i == j else 0.0
            # the acceleration of joint i moves its q by h, and its q̇ by T
            by_q = h * P[i, j] + T * P[n + i, j]
            by_qd = h * P[i, n + j] + T * P[n + i, n + j]
            own = square + unit
            feedback_of_q = Kp * square + s * unit
            feedback_of_qd = Kv * square + d * unit
            L[i, j] = own + h * by_q + T * by_qd
            Y[i, j] = feedback_of_q + by_q
            Y[i, n + j] = feedback_of_qd + T * by_q + by_qd


@in_place
def go_back_through_block(T: float, P: Array, n: int) -> None:
    """Turn the cost-to-go after a block into one of the state before it, without acceleration.

    Within a block of T seconds, q becomes q + T q̇.
    """
    linear = 2 * n
    for i in range(linear + 1):
        for j in range(n):
            P[i, n + j] += T * P[i, j]
    for i in range(n):
        for j in range(linear):
            P[n + i, j] += T * P[i, j]


@in_place
def add_cost_of_block(k: int, cost: Cost, P: Array) -> None:
    """Add the cost of block k without acceleration to the cost-to-go."""
    n = cost.pull.shape[1]
    linear = 2 * n
    Kp, Kv, s, d = feedback_of(cost, k)
    for i in range(n):
        pull = cost.pull[k, i]
        free = cost.damping * cost.free[k, i]
        P[linear, i] += Kp * pull + s * free
        P[linear, n + i] += Kv * pull + d * free
        for j in range(n):
            square = cost.square[k, i, j]
            unit = cost.damping if i == j else 0.0
            q_q = Kp * Kp * square + s * s * unit
            q_qd = Kp * Kv * square + s * d * unit
            qd_qd = Kv * Kv * square + d * d * unit
            P[i, j] += q_q
            P[i, n + j] += q_qd
            P[n + i, j] += q_qd
            P[n + i, n + j] += qd_qd


@in_place
def eliminate(k: int, factor: Factor) -> bool:
    """Eliminate the acceleration of block k from the cost-to-go, by Cholesky factorization of L.

    Y and y are multiplied by L⁻¹. Return False if the factorization fails.
    """
    P = factor.P
    Y = factor.Y[k]
    y = factor.y[k]
    L = factor.L[k]
    inverse = factor.inverse[k]
    n = len(y)
    states = 2 * n
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
            multiple = L[i, c]
            y[i] -= multiple * y[c]
            add(Y, i, -multiple, Y, c, START, states)
        y[i] *= inverse[i]
        for j in range(states):
            Y[i, j] *= inverse[i]
    linear = states
    for c in range(n):
        for i in range(states):
            add(P, i, -Y[c, i], Y, c, START, states)
        add(P, linear, -y[c], Y, c, START, states)
    return True


@in_place
def roll_out(cost: Cost, factor: Factor, space: Space) -> None:
    """Write the plan and the states that follow from w."""
    H, n = cost.pull.shape
    states = 2 * n
    u = space.u
    x = space.x
    for k in range(H):
        L = factor.L[k]
        Y = factor.Y[k]
        first = k * n
        # Lᵀ u = w + y − Y x
        for i in range(n):
            w = space.work[POINT, first + i]
            feedback = dot(Y, i, x, k, START, states)
            u[k, i] = w + factor.y[k, i] - feedback
        for i in range(n - 1, -1, -1):
            u[k, i] *= factor.inverse[k, i]
            add(u, k, -u[k, i], L, i, START, i)
        follow_block(cost.length, u, x, k, n)


@in_place
def follow_block(T: float, u: Array, x: Array, k: int, n: int) -> None:
    """Write the state after block k."""
    for j in range(n):
        q = x[k, j]
        qd = x[k, n + j]
        qdd = u[k, j]
        mean_speed = qd + 0.5 * T * qdd
        x[k + 1, j] = q + T * mean_speed
        x[k + 1, n + j] = qd + T * qdd
