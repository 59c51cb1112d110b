"""Row of manipulability: see :class:`vsconstraints.constraints.Manipulability`.

Twists are in the base frame's axes, about the tip's origin. Singular values, and brackets up to
that rotation, are the same as in the tip's axes.
"""

from __future__ import annotations

import math

import numpy as np

from ..formulas.vectors import matrix, plus, rotate, vector
from ..rows import Array
from .compiler import inner
from .constraint_rows import WriteRows, write_row
from .kinematics import point_jacobian
from .least_squares import orthogonalise
from .linear import START, add, dot
from .parts import load_step, to_fixed_tuple
from .workspace import Step

#: Below this singular value the curvature is that at this value, so that it stays finite.
SINGULAR = 1e-9
#: Below this singular value, relative to the largest, its singular vector is only rounding.
GONE = 1e-14


@inner
def add_bracket(a: Array, b: Array, out: Array) -> None:
    """Add [a, b] = (ω_a × v_b + v_a × ω_b, ω_a × ω_b) of twists (v, ω) to ``out`` (6,)."""
    for i in range(3):
        j = (i + 1) % 3
        k = (i + 2) % 3
        out[i] += a[3 + j] * b[k] - a[3 + k] * b[j] + a[j] * b[3 + k] - a[k] * b[3 + j]
        out[3 + i] += a[3 + j] * b[3 + k] - a[3 + k] * b[3 + j]


@inner
def tip_twists(step: Step, T: Array) -> None:
    """Write J, J̇ and J̈ of the tip for q̈ = 0, by columns (3, n, 6)."""
    n = len(step.joints)
    J = step.J_point
    body = step.bodies[len(step.joints)]
    tip = plus(rotate(matrix(body.R), vector(step.camera[0].tip_t)), vector(body.origin))
    point_jacobian(step, n, tip, J)
    for j in range(n):
        turns = 0.0 if step.joints[j].prismatic else 1.0
        for i in range(3):
            T[0, j, i], T[0, j, 3 + i] = J[i, j], turns * step.bodies[j + 1].axis[i]
    write_rates(T, step.qd)


@inner
def write_rates(T: Array, qd: Array) -> None:
    """Write J̇ and J̈ for q̈ = 0 behind the columns of J (3, n, 6).

    The columns are in the base's axes or in the tip's.
    """
    after = np.zeros((2, 6))
    for j in range(T.shape[1] - 1, -1, -1):
        for i in range(6):
            T[1, j, i] = T[2, j, i] = 0.0
        # seen from the tip, a joint moves the columns of those before it: J̇_j = [J_j, sum of J_k
        # q̇_k after it]
        add_bracket(T[0, j], after[0], T[1, j])
        add_bracket(T[0, j], after[1], T[2, j])
        add_bracket(T[1, j], after[0], T[2, j])
        for i in range(6):
            after[0, i] += T[0, j, i] * qd[j]
            after[1, i] += T[1, j, i] * qd[j]


@inner
def singular(M: Array, s: Array, U: Array) -> Array:
    """Write singular values and vectors of M (l, c), l ≥ c, and return [M v | v] (c, l + c).

    The singular values s (c,) are decreasing, the unit vectors u are (c, l). The last u is
    orthogonal to the others in any case. Otherwise w could not leave a singular configuration to a
    definite side.
    """
    l, c = M.shape  # noqa: E741
    last = c - 1
    X = np.zeros((c, l + c))
    for m in range(c):
        X[m, l + m] = 1.0
        for i in range(l):
            X[m, i] = M[i, m]
    orthogonalise(X, c, START, l)
    for m in range(c):
        best = m
        for o in range(m, c):
            s[o] = np.sqrt(dot(X, o, X, o, START, l))
            best = o if s[o] > s[best] else best
        s[m], s[best] = s[best], s[m]
        for i in range(l + c):
            X[m, i], X[best, i] = X[best, i], X[m, i]
    for m in range(last):
        for i in range(l):
            U[m, i] = X[m, i] / s[m] if s[m] > 0.0 else 0.0
    best = 0
    least = math.inf
    for i in range(l):
        U[last, i] = X[last, i]
        taken = 0.0
        for m in range(last):
            taken += U[m, i] * U[m, i]
        if taken < least:
            best = i
            least = taken
    if s[last] <= GONE * s[0]:
        for i in range(l):
            U[last, i] = 1.0 if i == best else 0.0
    for _ in range(2):
        for m in range(last):
            add(U, last, -dot(U, m, U, last, START, l), U, m, START, l)
        size = np.sqrt(dot(U, last, U, last, START, l))
        for i in range(l):
            U[last, i] /= size
    return X


@inner
def measure(T: Array, first: int, count: int, slope: Array) -> tuple[float, float]:
    """Return w and q̇ᵀ (∂²w/∂q²) q̇ of ``count`` rows of J, and write ∂w/∂q (n,).

    The rows begin with ``first``. T (3, n, 6) is written by :func:`tip_twists`.
    """
    n = T.shape[1]
    wide = count <= n
    c = min(count, n)
    l = max(count, n)  # noqa: E741
    # P = Σ s v uᵀ is J, or Jᵀ if there are fewer joints than directions; its derivatives, in the
    # basis of v
    M = np.empty((l, c))
    U = np.empty((c, l))
    D = np.zeros((c, l))
    D2 = np.zeros((c, l))
    s = np.zeros(c)
    change = np.zeros(6)
    for i in range(count):
        for j in range(n):
            if wide:
                M[j, i] = T[0, j, first + i]
            else:
                M[i, j] = T[0, j, first + i]
    W = singular(M, s, U)
    for k in range(n):
        slope[k] = 0.0
    whole = 1.0
    for m in range(c):
        others = 1.0
        for o in range(c):
            others *= 1.0 if o == m else s[o]
        whole *= max(s[m], SINGULAR)
        for j in range(n):
            for i in range(count):
                x, y = (i, j) if wide else (j, i)
                D[m, y] += W[m, l + x] * T[1, j, first + i]
                D2[m, y] += W[m, l + x] * T[2, j, first + i]
            for k in range(j + 1, n):
                for i in range(6):
                    change[i] = 0.0
                # ∂J_j/∂q_k = −[J_k, J_j]
                add_bracket(T[0, j], T[0, k], change)
                for i in range(count):
                    x, y = (i, j) if wide else (j, i)
                    slope[k] += others * W[m, l + x] * U[m, y] * change[first + i]
    # the first two derivatives of log det of G = P Pᵀ along q̇, in the basis of v, where G is
    # diagonal
    rate = second = squared = 0.0
    for m in range(c):
        gain = max(s[m], SINGULAR) ** 2
        rate += dot(D, m, W, m, START, l) / gain
        second += 2.0 * (dot(D2, m, W, m, START, l) + dot(D, m, D, m, START, l)) / gain
        for o in range(c):
            G_dot = dot(D, m, W, o, START, l) + dot(W, m, D, o, START, l)
            squared += G_dot * G_dot / (gain * max(s[o], SINGULAR) ** 2)
    product = 1.0
    for m in range(c):
        product *= s[m]
    return product, whole * (rate * rate + 0.5 * (second - squared))


def derivatives(J: Array, qd: Array, first: int, count: int) -> tuple[float, Array, float]:
    """Return w, ∂w/∂q (n,) and q̇ᵀ (∂²w/∂q²) q̇ of rows of the tip's J (6, n), in Python.

    ``count`` rows are used, from ``first`` on.
    """
    T = np.zeros((3, J.shape[1], 6))
    slope = np.empty(J.shape[1])
    T[0] = J.T
    write_rates(T, qd)
    w, bent = measure(T, first, count, slope)
    return float(w), slope, float(bent)


def manipulability_rows() -> WriteRows:
    """Make the function that writes the row of manipulability.

    It takes the address of a step and the row's number among the parts. The parameters are the
    least w, the scale, and the first and the number of the rows of the Jacobian that count.
    """

    def rows(address: int, i: int) -> None:
        step = load_step(address)
        n = len(step.qd)
        part = step.parts[i]
        minimum, scale, start, count = to_fixed_tuple(step.parameters[i], 4)
        T = np.empty((3, n, 6))
        slope = np.empty(n)
        rate = 0.0
        tip_twists(step, T)
        w, bent = measure(T, int(start), int(count), slope)
        factor = -1.0 / scale
        for j in range(n):
            rate += factor * slope[j] * step.qd[j]
            step.rows.Lg[part.first, j] = part.K * factor * slope[j]
        write_row(step, part.first, part.K, (minimum - w) / scale, rate, factor * bent)

    return rows
