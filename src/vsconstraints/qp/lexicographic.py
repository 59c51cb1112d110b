"""Strict priorities between rows and a quadratic cost: the least violation first, then the least cost.

For QP solvers with names, and where there is no compiler; :mod:`vsconstraints.compiled.hierarchy`, which says why there
are two, is the compiled one of the pair. ``test_the_two_descents_agree`` in ``tests/test_kernels.py`` holds them
together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..errors import SolverError
from ..rows import Array, BoolArray
from .chain import SolverChain, Verified
from .decomposition import svd
from .least_distance import least_distance
from .least_residual import least_residual
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


STRICT = 1e-6
"""Level 2 is found by itself if the damped residual exceeds this fraction of ‖J‖ times the way from J†b."""

WELL_CONDITIONED = 1e-3
"""Relative gain of J below which a task is nearly singular: √damping then limits what level 2 may ask for."""


@dataclass(frozen=True, slots=True)
class Cost:
    """Levels 2 and 3, ½‖diag(gains) directionsᵀ (x − center)‖² and ½‖x − center‖², and their sum with a damping.

    Attributes
    ----------
    center
        (n,) the minimiser without rows.
    directions
        (n, n) orthogonal matrix.
    gains
        (n,) singular values of the task over its norm; zero for what counts as its null space.
    damping
        Positive weight of level 3 in the sum.
    tolerance
        Relative gains below this count as zero.
    strict
        Whether level 2 is found by itself where the damping has cost it something.
    """

    center: Array
    directions: Array
    gains: Array
    damping: float
    tolerance: float
    strict: bool = True

    @property
    def stiffness(self) -> Array:
        """(n,) square roots of the weights of the sum."""
        return np.sqrt(self.gains * self.gains + self.damping)

    @property
    def task(self) -> Array:
        """(n, n) matrix of level 2."""
        return self.gains[:, None] * self.directions.T

    def damped(self, x: Array) -> bool:
        """Whether the damping may have cost x a residual that level 2 by itself does not have, and that matters."""
        if not self.strict:
            return False
        away = self.directions.T @ (x - self.center)
        allowed = STRICT * float(np.linalg.norm(away)) + MET * float(np.linalg.norm(x))
        return bool((self.gains == 0.0).any() and np.linalg.norm(self.gains * away) > allowed)

    def cut(self) -> float:
        """Relative gain below which level 2 by itself leaves directions within the rows alone."""
        kept = self.gains[self.gains > 0.0]
        well = kept.min(initial=np.inf) >= WELL_CONDITIONED * kept.max(initial=0.0)
        return self.tolerance if well else max(self.tolerance, float(np.sqrt(self.damping)))


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
    shortfall
        Why the levels below the first may be better met than by x; empty if they cannot.
    fallback
        What failed before; empty if the solver that was asked for gave the answer.
    """

    x: Array
    violation: Array
    holding: BoolArray
    verified: Verified | None
    shortfall: str = ""
    fallback: str = ""


def lexicographic(A: Array, c: Array, weights: Array, cost: Cost, solvers: SolverChain, box: Array) -> Optimum:
    """Of all x in the box with the least ‖W max(0, Ax − c)‖, find the one with the least cost.

    Hard rows are tried first. Only if they are incompatible (by the word of an exact solver, which is then
    proved by computing the least violation, or at once for a solver whose word means little) the violated
    rows become equalities, Ax = c + violation, and the cost is minimised within them. Rows that rounding
    makes incompatible are relaxed by just that rounding, at most :data:`SIGNIFICANT` of their terms.

    Where the damping costs a redundant task more than :data:`STRICT` allows, and where no solver has an answer, level 2
    is found by itself, from what is known by then, and level 3 within it.

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
    box
        (2, n) least and greatest x, the first nowhere above the second; infinite where there is no bound.

    Raises
    ------
    SolverError
        if the least violation is not found.
    """
    lower, upper = box
    ends, end_sides = _ends(box)
    walls, sides = np.vstack((A, ends)), np.concatenate((c, end_sides))
    T: Array = cost.directions / cost.stiffness
    if solvers.preferred.recognises_infeasibility:
        try:
            found = _nearest(cost.center, T, walls, sides, solvers, first_only=True)
        except SolverError:
            pass  # incompatible rows or a failed solver: computing the least violation tells which
        else:
            if cost.damped(found.x):
                found = _strictly(found, cost, np.empty((0, cost.center.size)), walls, sides, solvers)
            return Optimum(
                np.clip(found.x, lower, upper),
                np.zeros(c.size),
                found.holding[: c.size],
                found.verified,
                found.shortfall,
            )

    x = least_violation(A, c, weights, cost.center, box)
    excess = A @ x - c
    terms = np.linalg.norm(A, axis=1) * np.linalg.norm(x) + np.abs(c)
    violated = excess > SIGNIFICANT * terms
    # From here on x itself is feasible, with a little room: compatible rows may leave a set without interior (two that
    # are opposite to each other), which rounding would empty.
    sides = _with_room(walls, sides, x, RELAXED)
    # Where the violations pull a coordinate against the box, every point that violates least has it at that bound.
    forces = A[violated] * (weights[violated] ** 2 * excess[violated])[:, None]
    pinned = np.abs(forces.sum(axis=0)) > SIGNIFICANT * np.abs(forces).sum(axis=0)
    pinned &= (x <= lower) | (x >= upper)
    equal, Z = _split(np.vstack((A[violated], np.eye(x.size)[pinned])))
    # Rows within the span of the violated ones are settled by the equalities.
    others = np.linalg.norm(walls @ Z, axis=1) > DEPENDENT * np.linalg.norm(walls, axis=1)
    others[: c.size] &= ~violated
    found = Found(x, None, np.zeros(int(others.sum()), dtype=np.bool_))
    if Z.shape[1]:
        center, reduced = cost.center, T
        if len(equal):
            # In x + Z y the cost is ½‖E y + e‖²: center it, and measure distances in its metric.
            E = cost.stiffness[:, None] * (cost.directions.T @ Z)
            e = cost.stiffness * (cost.directions.T @ (x - cost.center))
            Q, R = np.linalg.qr(E)
            reduced = Z @ np.linalg.inv(R)
            center = x - reduced @ (Q.T @ e)
        try:
            found = _nearest(center, reduced, walls[others], sides[others], solvers)
        except SolverError as error:
            found = found._replace(shortfall=str(error), failed=str(error))
        if found.shortfall or cost.damped(found.x):
            found = _strictly(found, cost, equal, walls[others], sides[others], solvers)
    x = np.clip(found.x, lower, upper)
    held = np.zeros(len(walls), dtype=np.bool_)
    held[others] = found.holding
    violation = np.where(violated, np.maximum(A @ x - c, 0.0), 0.0)
    return _optimum(found, x, violation, violated | held[: c.size])


class Found(NamedTuple):
    """A point that meets rows, who found it, the rows that hold it, why a better one may be there, and what failed."""

    x: Array
    verified: Verified | None
    holding: BoolArray
    shortfall: str = ""
    failed: str = ""


def _optimum(found: Found, x: Array, violation: Array, holding: BoolArray) -> Optimum:
    fallback = found.failed or (found.verified.fallback if found.verified else "")
    return Optimum(x, violation, holding, found.verified, found.shortfall, fallback)


def _strictly(found: Found, cost: Cost, equal: Array, walls: Array, sides: Array, solvers: SolverChain) -> Found:
    """Level 2 by itself, from a point that meets all rows, and level 3 where that leaves a choice."""
    sides = _with_room(walls, sides, found.x, MET)
    target = cost.task @ cost.center
    x, holding, proved = least_residual(cost.task, target, equal, walls, sides, found.x, found.holding, cost.cut())
    if not proved:
        return found._replace(x=x, shortfall=found.shortfall or "level 2 was not found within the limit of iterations")
    _, N = _split(np.vstack((equal, walls[holding], cost.task[cost.gains > 0.0])))
    free = np.linalg.norm(walls @ N, axis=1) > DEPENDENT * np.linalg.norm(walls, axis=1)
    if not N.shape[1]:
        return found._replace(x=x, holding=holding, shortfall="")
    try:
        last = _nearest(x - N @ (N.T @ (x - cost.center)), N, walls[free], sides[free], solvers)
    except SolverError as error:
        return found._replace(x=x, holding=holding, shortfall=f"level 3: {error}")
    holding[free] |= last.holding
    return Found(last.x, last.verified or found.verified, holding, failed=found.failed)


def _nearest(center: Array, T: Array, A: Array, c: Array, solvers: SolverChain, *, first_only: bool = False) -> Found:
    """Solve  min ½‖u‖²  subject to  A x ≤ c, x = center + T u."""
    problem = least_distance(center, T, A, c)
    if problem is None:
        return Found(center, None, np.zeros(c.size, dtype=np.bool_))
    p = problem.G.shape[1]
    data = np.eye(p), np.zeros(p), problem.G, problem.h
    preferred = solvers.preferred
    verified = Verified(preferred.solve(*data), preferred.name) if first_only else solvers.solve(*data)
    x, multipliers = problem.point(verified.answer.x), verified.answer.multipliers
    # the solver's check is relative to the way from the minimiser without rows, which may be very long
    excess, norms = A @ x - c, np.linalg.norm(A, axis=1)
    if (excess > MISSED * (norms * np.linalg.norm(x) + np.abs(c)) + NEGLIGIBLE * norms).any():
        raise SolverError(f"the answer of {verified.solver} exceeds a row by {excess.max():.1e}, which is rounding")
    return Found(x, verified, multipliers > PULLING * multipliers.max())


def _ends(box: Array) -> tuple[Array, Array]:
    """Rows of the bounds of a box (2, n); none for infinite ones."""
    one = np.eye(box.shape[1])
    sides = np.concatenate((box[1], -box[0]))
    bounded = np.isfinite(sides)
    return np.vstack((one, -one))[bounded], sides[bounded]


def _with_room(walls: Array, sides: Array, x: Array, room: float) -> Array:
    """Sides that x meets, with room, as a fraction of their terms, for rounding."""
    terms = np.linalg.norm(walls, axis=1) * np.linalg.norm(x) + np.abs(sides)
    wide: Array = np.maximum(sides, walls @ x) + room * terms
    return wide


def _split(A: Array) -> tuple[Array, Array]:
    """Orthonormal bases: (r, n) of what the rows of A (none of them zero) span, and (n, n − r) of what none sees."""
    if not len(A):
        return A, np.eye(A.shape[1])
    _, s, Vt = svd(A / np.linalg.norm(A, axis=1)[:, None])
    rank = int(np.count_nonzero(s > DEPENDENT * s[0]))
    return Vt[:rank], Vt[rank:].T
