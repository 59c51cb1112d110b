"""Strict priorities between rows and a quadratic cost: the least violation first, then the least cost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..decomposition import svd
from ..errors import SolverError
from ..rows import Array, BoolArray
from .chain import SolverChain, Verified
from .least_distance import least_distance
from .least_violation import least_violation

SIGNIFICANT = 1e-9
"""A least violation below this fraction of the row's terms is rounding: the rows are compatible."""

RELAXED = 1e-10
"""Fraction of their terms by which rows are relaxed once the hard ones have been found incompatible."""

DEPENDENT = 1e-9
"""Rows of unit norm count as dependent below this fraction, when violated rows are eliminated."""

PULLING = 1e-6
"""A row holds the solution if its multiplier exceeds this fraction of the largest one."""

MISSED, NEGLIGIBLE = 1e-6, 1e-9
"""A row exceeded by more than the first as a fraction of its terms, and by more than the second in x, is not met: the
minimiser without rows is too far away for rounding."""

MET = 1e-12
"""A demand exceeded by less than this fraction of its terms is met: it is the rounding of A q̈ − c."""

ZERO_GRADIENT = 1e-12
"""A row with ‖L_gφ‖ below this times its scale is one that no acceleration can influence."""


@dataclass(frozen=True, slots=True)
class Cost:
    """½‖diag(stiffness) directionsᵀ (x − center)‖².

    Attributes
    ----------
    center
        (n,) the minimiser without rows.
    directions
        (n, n) orthogonal matrix.
    stiffness
        (n,) positive.
    """

    center: Array
    directions: Array
    stiffness: Array


@dataclass(frozen=True, slots=True)
class Optimum:
    """The lexicographic optimum.

    Attributes
    ----------
    x
        (n,) the minimiser.
    violation
        (m,) what each row is exceeded by, exactly zero where the rows allow it to be met.
    holding
        (m,) rows that are exceeded, or at their bound with a positive multiplier.
    verified
        Answer of the QP solver; None if no solver was needed.
    """

    x: Array
    violation: Array
    holding: BoolArray
    verified: Verified | None


def lexicographic(
    A: Array, c: Array, weights: Array, cost: Cost, solvers: SolverChain, bound: float = np.inf
) -> Optimum:
    """Of all x in the box |x| ≤ bound with the least ‖W max(0, Ax − c)‖, find the one with the least cost.

    Hard rows are tried first. Only if they are incompatible (by the word of an exact solver, which is then
    proved by computing the least violation, or at once for a solver whose word means little) the violated
    rows become equalities, Ax = c + violation, and the cost is minimised within them. Rows that rounding
    makes incompatible are relaxed by just that rounding, at most :data:`SIGNIFICANT` of their terms.

    Parameters
    ----------
    A, c
        (m, n) and (m,); no row of A is zero.
    weights
        (m,) positive diagonal of W.
    cost
        What is minimised in second place.
    solvers
        Who solves the QPs.
    bound
        Half the width of the box.

    Raises
    ------
    SolverError
        if no solver gives an answer that passes the check.
    """
    box, box_sides = _box(cost.center.size, bound)
    walls, sides = np.vstack((A, box)), np.concatenate((c, box_sides))
    T = cost.directions / cost.stiffness
    if solvers.preferred.recognises_infeasibility:
        try:
            x, verified, holding = _nearest(cost.center, T, walls, sides, solvers, first_only=True)
        except SolverError:
            pass  # incompatible rows or a failed solver: computing the least violation tells which
        else:
            x = np.clip(x, -bound, bound)
            return Optimum(x, np.zeros(c.size), holding[: c.size], verified)

    x = least_violation(A, c, weights, cost.center, bound)
    excess = A @ x - c
    terms = np.linalg.norm(A, axis=1) * np.linalg.norm(x) + np.abs(c)
    violated = excess > SIGNIFICANT * terms
    # From here on x itself is feasible, with a little room: compatible rows may leave a set without interior (two that
    # are opposite to each other), which rounding would empty.
    room = RELAXED * (np.linalg.norm(walls, axis=1) * np.linalg.norm(x) + np.abs(sides))
    sides = np.maximum(sides, walls @ x) + room
    if not violated.any():
        x, verified, holding = _nearest(cost.center, T, walls, sides, solvers)
        return Optimum(np.clip(x, -bound, bound), np.zeros(c.size), holding[: c.size], verified)

    # Where the violations pull a coordinate against the box, every point that violates least has it at that bound.
    forces = A[violated] * (weights[violated] ** 2 * excess[violated])[:, None]
    pinned = np.abs(forces.sum(axis=0)) > SIGNIFICANT * np.abs(forces).sum(axis=0)
    pinned &= np.abs(x) >= bound
    Z = _null_space(np.vstack((A[violated], np.eye(x.size)[pinned])))
    violation = np.where(violated, excess, 0.0)
    holding = violated.copy()
    verified = None
    if Z.shape[1]:
        # In x + Z y the cost is ½‖E y + e‖²: center it, and measure distances in its metric.
        E = cost.stiffness[:, None] * (cost.directions.T @ Z)
        e = cost.stiffness * (cost.directions.T @ (x - cost.center))
        Q, R = np.linalg.qr(E)
        reduced = Z @ np.linalg.inv(R)
        others = np.ones(sides.size, dtype=np.bool_)
        others[: c.size] = ~violated
        # Rows within the span of the violated ones are settled by the equalities.
        others &= np.linalg.norm(walls @ Z, axis=1) > DEPENDENT * np.linalg.norm(walls, axis=1)
        x, verified, held = _nearest(x - reduced @ (Q.T @ e), reduced, walls[others], sides[others], solvers)
        held_rows = np.zeros(sides.size, dtype=np.bool_)
        held_rows[others] = held
        holding |= held_rows[: c.size]
        x = np.clip(x, -bound, bound)
        violation[violated] = np.maximum(A[violated] @ x - c[violated], 0.0)
    return Optimum(x, violation, holding, verified)


def _nearest(
    center: Array, T: Array, A: Array, c: Array, solvers: SolverChain, *, first_only: bool = False
) -> tuple[Array, Verified | None, BoolArray]:
    """Solve  min ½‖u‖²  subject to  A x ≤ c, x = center + T u: x, who found it, and the rows that hold it."""
    problem = least_distance(center, T, A, c)
    if problem is None:
        return center, None, np.zeros(c.size, dtype=np.bool_)
    p = problem.G.shape[1]
    data = np.eye(p), np.zeros(p), problem.G, problem.h
    preferred = solvers.preferred
    verified = Verified(preferred.solve(*data), preferred.name) if first_only else solvers.solve(*data)
    x, multipliers = problem.point(verified.answer.x), verified.answer.multipliers
    # the solver's check is relative to the way from the minimiser without rows, which may be very long
    excess, norms = A @ x - c, np.linalg.norm(A, axis=1)
    if (excess > MISSED * (norms * np.linalg.norm(x) + np.abs(c)) + NEGLIGIBLE * norms).any():
        raise SolverError(f"the answer of {verified.solver} exceeds a row by {excess.max():.1e}, which is rounding")
    return x, verified, multipliers > PULLING * multipliers.max()


def _box(n: int, bound: float) -> tuple[Array, Array]:
    """Rows of |x| ≤ bound; none for an infinite bound."""
    if not np.isfinite(bound):
        return np.empty((0, n)), np.empty(0)
    return np.vstack((np.eye(n), -np.eye(n))), np.full(2 * n, bound)


def _null_space(A: Array) -> Array:
    """Orthonormal basis (n, p) of the vectors that no row of A (none of them zero) sees."""
    _, s, Vt = svd(A / np.linalg.norm(A, axis=1)[:, None])
    rank = int(np.count_nonzero(s > DEPENDENT * s[0]))
    basis: Array = Vt[rank:].T
    return basis
