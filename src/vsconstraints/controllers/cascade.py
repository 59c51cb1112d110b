"""The hierarchy level by level, by QP solvers with names: the least violation, then the task, then
the acceleration.

The descent of :mod:`vsconstraints.compiled.hierarchy` with its QPs answered by any solver. Level 1,
and level 2 by itself, are no QPs that solvers answer well, and are those of the compiled descent.
The test ``test_the_two_descents_agree`` in ``tests/test_kernels.py`` compares the two.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, Self

import numpy as np

from ..compiled import load
from ..compiled import workspace as codes
from ..errors import InvalidInput, SolverError
from ..qp import SolverChain, Verified
from ..qp.decomposition import svd
from ..qp.scaling import scale
from ..rows import Array, BoolArray, Command, Rows, Task
from ..rows import tolerances as limit
from .least_norm import LeastNorm, least_norm
from .resolver import row_weights, unmet


class Target(NamedTuple):
    """Levels 2 and 3, ½‖diag(gains) directionsᵀ (x − center)‖² and ½‖x − center‖², and their sum
    with a damping.

    ``center`` (n,) is the minimiser without rows, ``directions`` (n, n) orthogonal, ``gains`` (n,)
    singular values of the task over its norm; zero below the ``tolerance``. ``strict``: level 2 by
    itself where the damping has cost it something.
    """

    center: Array
    directions: Array
    gains: Array
    damping: float
    tolerance: float
    strict: bool

    @classmethod
    def of(cls, tracking: LeastNorm, damping: float, tolerance: float, strict: bool) -> Self:
        """With J q̈ fixed, q̈ − q̈_track differs from q̈ − q̈₀ by a constant orthogonal to the null
        space of J.
        """
        size = float(np.linalg.norm(tracking.gains))
        relative = tracking.gains / size if size > 0.0 else tracking.gains
        return cls(tracking.qdd, tracking.directions, relative, damping, tolerance, strict)

    @property
    def stiffness(self) -> Array:
        """(n,) square roots of the weights of the sum."""
        return np.sqrt(self.gains * self.gains + self.damping)

    def damped(self, x: Array) -> bool:
        """Whether the damping may have cost x a residual that level 2 by itself does not have, and
        that matters.
        """
        away = self.directions.T @ (x - self.center)
        allowed = limit.STRICT * float(np.linalg.norm(away)) + limit.MET * float(np.linalg.norm(x))
        redundant = self.strict and bool((self.gains == 0.0).any())
        return redundant and bool(np.linalg.norm(self.gains * away) > allowed)

    def cut(self) -> float:
        """Relative gain below which level 2 by itself leaves directions within the rows alone."""
        kept = self.gains[self.gains > 0.0]
        well = kept.min(initial=np.inf) >= limit.WELL_CONDITIONED * kept.max(initial=0.0)
        return self.tolerance if well else max(self.tolerance, float(np.sqrt(self.damping)))


class Optimum(NamedTuple):
    """The lexicographic optimum x (n,).

    ``violation`` (m,) is what each row is exceeded by, exactly zero where the rows allow it to be
    met; ``holding`` (m,) are rows that are exceeded, or at their bound with a positive multiplier.
    ``shortfall`` says why the levels below the first may be better met than by x, ``fallback`` what
    failed before; empty if they cannot, or nothing did.
    """

    x: Array
    violation: Array
    holding: BoolArray
    verified: Verified | None
    shortfall: str = ""
    fallback: str = ""


def by_solvers(resolver: Any, rows: Rows, task: Task, c: Array, solvers: SolverChain) -> Command:
    """The command of a :class:`.Hierarchy` for what rows ask for, c (m,)."""
    tracking = least_norm(task.J, task.b, resolver.rank_tolerance, task.rest)
    n = task.J.shape[1]
    box = resolver.box(rows, n)
    center, acted = resolver.center(rows, tracking.qdd, c, box)
    cost = Target.of(
        tracking, resolver.damping, resolver.rank_tolerance, resolver.aim == codes.STRICT
    )
    if resolver.aim in (codes.NEAREST, codes.SCALED):
        cost = Target(
            center, np.eye(n), np.ones(n), resolver.damping, resolver.rank_tolerance, False
        )
    which = np.flatnonzero(c < np.inf)
    fixed = np.linalg.norm(rows.Lg[which], axis=1) <= limit.ZERO_GRADIENT * rows.scale[which]
    free = which[~fixed]
    stuck = which[fixed]
    weights = row_weights([rows.labels[i] for i in free], resolver.weights or {})
    try:
        best = descend(rows.Lg[free], c[free], weights, cost, box, solvers)
    except InvalidInput as error:
        raise SolverError(f"beyond the range of floating point: {error}") from error
    slack = np.zeros(len(rows.labels))
    acted[free] |= best.holding
    slack[free], slack[stuck] = best.violation, np.maximum(-c[stuck], 0.0)
    status: Literal["ok", "relaxed", "suboptimal"] = "suboptimal" if best.shortfall else "ok"
    return Command(
        best.x,
        "relaxed" if slack.any() else status,
        acted,
        rows.labels,
        reason="; ".join(filter(None, (unmet(rows.labels, slack, stuck), best.shortfall))),
        slack=slack,
        solver=best.verified.solver if best.verified else "",
        iterations=best.verified.answer.iterations if best.verified else 0,
        fallback=best.fallback,
    )


def descend(
    A: Array, c: Array, weights: Array, cost: Target, box: Array, solvers: SolverChain
) -> Optimum:
    """Of all x in the box (2, n) with the least ‖W max(0, Ax − c)‖, find the one with the least
    cost.

    Hard rows are tried first, A (m, n) without a zero one, c and weights (m,). Only if they are
    incompatible (by the word of an exact solver, or at once for a solver whose word means little)
    the violated rows become equalities, Ax = c + violation, and the cost is minimised within them.
    Rows that rounding makes incompatible are relaxed by just that rounding. SolverError if the
    least violation is not found.
    """
    n = cost.center.size
    m = c.size
    ends = np.concatenate((box[1], -box[0]))
    bounded = np.isfinite(ends)
    walls = np.vstack((A, np.vstack((np.eye(n), -np.eye(n)))[bounded]))
    sides = np.concatenate((c, ends[bounded]))
    T: Array = cost.directions / cost.stiffness
    if solvers.preferred.recognises_infeasibility:
        try:
            found = _nearest(cost.center, T, walls, sides, solvers, first_only=True)
        except SolverError:
            pass  # incompatible rows or a failed solver: computing the least violation tells which
        else:
            if cost.damped(found.x):
                found = _strictly(found, cost, np.empty((0, n)), walls, sides, solvers)
            return found._replace(
                x=np.clip(found.x, *box), violation=np.zeros(m), holding=found.holding[:m]
            )

    x = np.clip(cost.center, *box)
    if load("level_by_level").violate_least(*_contiguous(A, c, weights, box), x) != 0:
        raise SolverError(
            "the least violation of the rows was not found within the limit of iterations"
        )
    excess = A @ x - c
    violated = excess > limit.SIGNIFICANT * _terms(A, c, x)
    # compatible rows may leave a set without interior (two that are opposite to each other): x is
    # given a little room
    sides = _with_room(walls, sides, x, limit.RELAXED)
    # where the violations pull a coordinate against the box, every point that violates least has it
    # at that bound
    forces = A[violated] * (weights[violated] ** 2 * excess[violated])[:, None]
    pinned = np.abs(forces.sum(axis=0)) > limit.SIGNIFICANT * np.abs(forces).sum(axis=0)
    pinned &= (x <= box[0]) | (x >= box[1])
    equal, Z = _split(np.vstack((A[violated], np.eye(n)[pinned])))
    # rows within the span of the violated ones are settled by the equalities
    others = _seen(walls, Z)
    others[:m] &= ~violated
    found = Optimum(x, np.empty(0), np.zeros(int(others.sum()), dtype=np.bool_), None)
    if Z.shape[1]:
        center = cost.center
        reduced = T
        if len(equal):
            # in x + Z y the cost is ½‖E y + e‖²: center it, and measure distances in its metric
            E = cost.stiffness[:, None] * (cost.directions.T @ Z)
            Q, R = np.linalg.qr(E)
            reduced = Z @ np.linalg.inv(R)
            center = x - reduced @ (
                Q.T @ (cost.stiffness * (cost.directions.T @ (x - cost.center)))
            )
        try:
            found = _nearest(center, reduced, walls[others], sides[others], solvers)
        except SolverError as error:
            found = found._replace(shortfall=str(error), fallback=str(error))
        if found.shortfall or cost.damped(found.x):
            found = _strictly(found, cost, equal, walls[others], sides[others], solvers)
    x = np.clip(found.x, *box)
    holding = np.zeros(len(walls), dtype=np.bool_)
    holding[others] = found.holding
    violation = np.where(violated, np.maximum(A @ x - c, 0.0), 0.0)
    return found._replace(x=x, violation=violation, holding=violated | holding[:m])


def _nearest(
    center: Array, T: Array, A: Array, c: Array, solvers: SolverChain, *, first_only: bool = False
) -> Optimum:
    """Solve  min ½‖u‖²  subject to  A x ≤ c, x = center + T u."""
    problem = scale(A @ T, c - A @ center)
    if problem.size <= 0.0:
        return Optimum(center, np.empty(0), np.zeros(c.size, dtype=np.bool_), None)
    p = T.shape[1]
    preferred = solvers.preferred
    data = np.eye(p), np.zeros(p), problem.G, problem.h
    verified = (
        Verified(preferred.solve(*data), preferred.name) if first_only else solvers.solve(*data)
    )
    x = center + T @ (problem.size * verified.answer.x)
    multipliers = verified.answer.multipliers
    # the solver's check is relative to the way from the minimiser without rows, which may be very
    # long
    excess = A @ x - c
    norms = np.linalg.norm(A, axis=1)
    if (excess > limit.MISSED * _terms(A, c, x) + limit.NEGLIGIBLE * norms).any():
        raise SolverError(
            f"the answer of {verified.solver} exceeds a row by {excess.max():.1e}, which is "
            f"rounding"
        )
    holding = multipliers > limit.PULLING * multipliers.max()
    return Optimum(x, np.empty(0), holding, verified, fallback=verified.fallback)


def _strictly(
    found: Optimum, cost: Target, equal: Array, walls: Array, sides: Array, solvers: SolverChain
) -> Optimum:
    """Level 2 by itself, from a point that meets all rows, and level 3 where that leaves a
    choice.
    """
    sides = _with_room(walls, sides, found.x, limit.MET)
    G: Array = cost.gains[:, None] * cost.directions.T
    x = found.x.copy()
    holding = found.holding.copy()
    given = _contiguous(G, cost.center, equal, walls, sides)
    if not load("level_by_level").track_best(*given, x, holding, cost.cut()):
        return found._replace(
            x=x, shortfall=found.shortfall or "level 2 was not found within the limit of iterations"
        )
    _, N = _split(np.vstack((equal, walls[holding], G[cost.gains > 0.0])))
    free = _seen(walls, N)
    if not N.shape[1]:
        return found._replace(x=x, holding=holding, shortfall="")
    try:
        last = _nearest(x - N @ (N.T @ (x - cost.center)), N, walls[free], sides[free], solvers)
    except SolverError as error:
        return found._replace(x=x, holding=holding, shortfall=f"level 3: {error}")
    holding[free] |= last.holding
    return found._replace(
        x=last.x, holding=holding, verified=last.verified or found.verified, shortfall=""
    )


def _terms(A: Array, c: Array, x: Array) -> Array:
    """(m,) size of the terms of A x − c."""
    size: Array = np.linalg.norm(A, axis=1) * np.linalg.norm(x) + np.abs(c)
    return size


def _with_room(walls: Array, sides: Array, x: Array, room: float) -> Array:
    """Sides that x meets, with room, as a fraction of their terms, for rounding."""
    wide: Array = np.maximum(sides, walls @ x) + room * _terms(walls, sides, x)
    return wide


def _seen(walls: Array, Z: Array) -> BoolArray:
    """(w,) walls that are not constant along Z (n, p)."""
    seen: BoolArray = np.linalg.norm(walls @ Z, axis=1) > limit.DEPENDENT * np.linalg.norm(
        walls, axis=1
    )
    return seen


def _split(A: Array) -> tuple[Array, Array]:
    """Orthonormal bases: (r, n) of what the rows of A (none of them zero) span, and (n, n − r) of
    what none sees.
    """
    if not len(A):
        return A, np.eye(A.shape[1])
    _, s, Vt = svd(A / np.linalg.norm(A, axis=1)[:, None])
    rank = int(np.count_nonzero(s > limit.DEPENDENT * s[0]))
    return Vt[:rank], Vt[rank:].T


def _contiguous(*arrays: Array) -> list[Array]:
    return [np.ascontiguousarray(array) for array in arrays]
