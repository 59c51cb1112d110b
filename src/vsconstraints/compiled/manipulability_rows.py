"""Row of manipulability: see :class:`vsconstraints.constraints.Manipulability`.

Twists are in the base frame's axes, about the tip's origin. Singular values, and brackets up to
that rotation, are the same as in the tip's axes.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from ..formulas.vectors import matrix, plus, rotate, vector
from ..rows import Array
from .compiler import inner
from .constraint_rows import RowTemplate, WriteRows, write_row
from .kinematics import point_jacobian
from .least_squares import orthogonalise
from .linear import START, add, constant, dot, length, squared_length
from .parts import load_step, to_fixed_tuple
from .workspace import Step

#: Below this singular value the curvature is that at this value, so that it stays finite.
SINGULAR = 1e-9
#: Below this singular value, relative to the largest, its singular vector is only rounding.
GONE = 1e-14
#: Parts of the twists T (3, n, 6): the columns (v, ω) of J, J̇ and J̈ for q̈ = 0.
JACOBIAN = constant(0)
FIRST = constant(1)
SECOND = constant(2)


@inner
def add_bracket(a: Array, b: Array, out: Array) -> None:
    """Add [a, b] = (ω_a × v_b + v_a × ω_b, ω_a × ω_b) of twists (v, ω) to ``out`` (6,)."""
    omega_a = a[3:]
    omega_b = b[3:]
    for i in range(3):
        j = (i + 1) % 3
        k = (i + 2) % 3
        omega_a_v_b = omega_a[j] * b[k] - omega_a[k] * b[j]
        out[i] += omega_a_v_b + a[j] * omega_b[k] - a[k] * omega_b[j]
        out[3 + i] += omega_a[j] * omega_b[k] - omega_a[k] * omega_b[j]


@inner
def tip_twists(step: Step, T: Array) -> None:
    """Write J, J̇ and J̈ of the tip for q̈ = 0, by columns (3, n, 6)."""
    n = len(step.joints)
    J = step.J_point
    body = step.bodies[n]
    from_origin = rotate(matrix(body.R), vector(step.camera[0].tip_t))
    tip = plus(from_origin, vector(body.origin))
    point_jacobian(step, n, tip, J)
    for j in range(n):
        turns = 0.0 if step.joints[j].prismatic else 1.0
        axis = step.bodies[j + 1].axis
        for i in range(3):
            T[JACOBIAN, j, i] = J[i, j]
            T[JACOBIAN, j, 3 + i] = turns * axis[i]
    write_rates(T, step.qd)


@inner
def write_rates(T: Array, qd: Array) -> None:
    """Write J̇ and J̈ for q̈ = 0 behind the columns of J (3, n, 6).

    Seen from the tip, a joint moves the columns of those before it: with the bracket [·, ·] of
    twists, J̇_j = [J_j, V_j] with V_j = Σ J_k q̇_k of the joints k > j, and J̈_j = [J_j, V̇_j] +
    [J̇_j, V_j]. The columns are in the base's axes or in the tip's.
    """
    sums = np.zeros((2, 6))
    V = sums[0]
    V_dot = sums[1]
    for j in range(T.shape[1] - 1, -1, -1):
        J = T[JACOBIAN, j]
        J_dot = T[FIRST, j]
        J_ddot = T[SECOND, j]
        for i in range(6):
            J_dot[i] = 0.0
            J_ddot[i] = 0.0
        add_bracket(J, V, J_dot)
        add_bracket(J, V_dot, J_ddot)
        add_bracket(J_dot, V, J_ddot)
        for i in range(6):
            V[i] += J[i] * qd[j]
            V_dot[i] += J_dot[i] * qd[j]


@inner
def sort_descending(X: Array, count: int, s: Array) -> None:
    """Write the lengths of the rows of X, in their first ``count`` entries, to s, and sort both."""
    c = len(s)
    for m in range(c):
        longest = m
        for other in range(m, c):
            s[other] = length(X, other, count)
            if s[other] > s[longest]:
                longest = other
        s[m], s[longest] = s[longest], s[m]
        for i in range(X.shape[1]):
            X[m, i], X[longest, i] = X[longest, i], X[m, i]


@inner
def freest_axis(U: Array, count: int) -> int:
    """Return the coordinate axis that the first ``count`` unit vectors u (rows) cover least."""
    best = 0
    least = math.inf
    for i in range(U.shape[1]):
        taken = 0.0
        for m in range(count):
            taken += U[m, i] * U[m, i]
        if taken < least:
            best = i
            least = taken
    return best


@inner
def singular(M: Array, s: Array, U: Array) -> Array:
    """Write singular values and vectors of M (l, c), l ≥ c, and return [M v | v] (c, l + c).

    The singular values s (c,) are decreasing, the unit vectors u of U are (c, l). The last u is
    orthogonal to the others in any case. Otherwise w could not leave a singular configuration to a
    definite side.
    """
    long, short = M.shape
    last = short - 1
    X = np.zeros((short, long + short))
    for m in range(short):
        X[m, long + m] = 1.0
        for i in range(long):
            X[m, i] = M[i, m]
    orthogonalise(X, short, START, long)
    sort_descending(X, long, s)
    for m in range(last):
        is_zero = not s[m] > 0.0
        for i in range(long):
            U[m, i] = 0.0 if is_zero else X[m, i] / s[m]
    if s[last] <= GONE * s[0]:
        axis = freest_axis(U, last)
        for i in range(long):
            U[last, i] = 1.0 if i == axis else 0.0
    else:
        for i in range(long):
            U[last, i] = X[last, i]
    # Gram-Schmidt, repeated because of cancellation
    for _ in range(2):
        for m in range(last):
            projection = dot(U, m, U, last, START, long)
            add(U, last, -projection, U, m, START, long)
        size = length(U, last, long)
        for i in range(long):
            U[last, i] /= size
    return X


@inner
def write_long_matrix(T: Array, first: int, count: int, M: Array) -> None:
    """Write ``count`` rows of J, from ``first`` on, to M, transposed if M is longer then."""
    n = T.shape[1]
    is_wide = count <= n
    for i in range(count):
        for j in range(n):
            entry = T[JACOBIAN, j, first + i]
            if is_wide:
                M[j, i] = entry
            else:
                M[i, j] = entry


@inner
def product_of_others(s: Array, m: int) -> float:
    """Return the product of all singular values but s[m]."""
    product = 1.0
    for o in range(len(s)):
        if o != m:
            product *= s[o]
    return product


@inner
def log_determinant_rates(s: Array, PV: Array, D: Array, D2: Array) -> tuple[float, float]:
    """Return half the first derivative of log det G along q̇, with G = P Pᵀ, and the second.

    In the basis of v, G is diagonal, with the entries s². The rows of ``PV``, ``D`` and ``D2`` are
    those of P, Ṗ and P̈ in this basis. Then (log det G)˙ = tr G⁻¹Ġ, and (log det G)¨ = tr G⁻¹G̈ −
    tr (G⁻¹Ġ)².
    """
    long = D.shape[1]
    half_rate = 0.0
    by_G_ddot = 0.0
    by_G_dot = 0.0
    for m in range(len(s)):
        gain = max(s[m], SINGULAR) ** 2
        PD = dot(D, m, PV, m, START, long)
        PD2 = dot(D2, m, PV, m, START, long)
        DD = squared_length(D, m, START, long)
        half_rate += PD / gain
        by_G_ddot += 2.0 * (PD2 + DD) / gain
        for o in range(len(s)):
            other_gain = max(s[o], SINGULAR) ** 2
            D_PV = dot(D, m, PV, o, START, long)
            PV_D = dot(PV, m, D, o, START, long)
            G_dot = D_PV + PV_D
            by_G_dot += G_dot * G_dot / (gain * other_gain)
    return half_rate, by_G_ddot - by_G_dot


@inner
def write_rates_in_basis(T: Array, first: int, count: int, W: Array, D: Array, D2: Array) -> None:
    """Write the rows vᵀ Ṗ to D and vᵀ P̈ to D2, both (c, l), for the v in W of :func:`measure`."""
    n = T.shape[1]
    short, long = D.shape
    is_wide = count <= n
    for m in range(short):
        for j in range(n):
            for i in range(count):
                # entry of P, which is J or Jᵀ
                row = i if is_wide else j
                column = j if is_wide else i
                v = W[m, long + row]
                D[m, column] += v * T[FIRST, j, first + i]
                D2[m, column] += v * T[SECOND, j, first + i]


@inner
def write_slope(
    T: Array, first: int, count: int, s: Array, W: Array, U: Array, slope: Array
) -> None:
    """Write ∂w/∂q (n,): the sum of all vᵀ (∂P/∂q_k) u, each times the other singular values."""
    n = T.shape[1]
    short, long = U.shape
    is_wide = count <= n
    change = np.zeros(6)
    for k in range(n):
        slope[k] = 0.0
    for m in range(short):
        others = product_of_others(s, m)
        for j in range(n):
            J_j = T[JACOBIAN, j]
            for k in range(j + 1, n):
                J_k = T[JACOBIAN, k]
                for i in range(6):
                    change[i] = 0.0
                # ∂J_j/∂q_k = −[J_k, J_j] = [J_j, J_k]
                add_bracket(J_j, J_k, change)
                for i in range(count):
                    row = i if is_wide else j
                    column = j if is_wide else i
                    v = W[m, long + row]
                    slope[k] += others * v * U[m, column] * change[first + i]


@inner
def measure(T: Array, first: int, count: int, slope: Array) -> tuple[float, float]:
    """Return w and q̇ᵀ (∂²w/∂q²) q̇ of ``count`` rows of J, and write ∂w/∂q (n,).

    The rows begin with ``first``. T (3, n, 6) is written by :func:`tip_twists`.

    P = Σ s v uᵀ is J, or Jᵀ if there are fewer joints than directions, and w = Π s. Each singular
    value has the derivative vᵀ (∂P/∂q_k) u. From w = √det G with G = P Pᵀ follow r = ẇ/w =
    ½ (log det G)˙ and ẅ = w (r² + ½ (log det G)¨).
    """
    n = T.shape[1]
    short = min(count, n)
    long = max(count, n)
    M = np.empty((long, short))
    s = np.zeros(short)
    U = np.empty((short, long))
    D = np.zeros((short, long))
    D2 = np.zeros((short, long))
    write_long_matrix(T, first, count, M)
    W = singular(M, s, U)  # [vᵀ P | vᵀ]
    write_rates_in_basis(T, first, count, W, D, D2)
    write_slope(T, first, count, s, W, U, slope)
    rate, bend = log_determinant_rates(s, W, D, D2)
    product = 1.0
    bounded_product = 1.0
    for m in range(short):
        product *= s[m]
        bounded_product *= max(s[m], SINGULAR)
    return product, bounded_product * (rate * rate + 0.5 * bend)


@partial(RowTemplate, makes_arrays=True)
def manipulability_rows() -> WriteRows:
    """Make the function that writes the row of manipulability.

    It takes the address of a step and the row's number among the parts. The parameters are the
    least w, the scale, and the first and the number of the rows of the Jacobian that count.
    """

    def rows(address: int, number: int) -> None:
        step = load_step(address)
        n = len(step.qd)
        part = step.parts[number]
        minimum, scale, start, count = to_fixed_tuple(step.parameters[number], 4)
        T = np.empty((3, n, 6))
        slope = np.empty(n)
        tip_twists(step, T)
        w, w_bend = measure(T, int(start), int(count), slope)
        row = part.first
        K = part.K
        factor = -1.0 / scale
        sigma = (minimum - w) / scale
        sigma_dot = 0.0
        for j in range(n):
            sigma_dot += factor * slope[j] * step.qd[j]
            step.rows.Lg[row, j] = K * factor * slope[j]
        write_row(step, row, K, sigma, sigma_dot, factor * w_bend)

    return rows
