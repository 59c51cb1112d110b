"""The hierarchy level by level, by named QP solvers: least violation, task, acceleration.

The descent of :mod:`vsconstraints.compiled.hierarchy`, with its QPs answered by any solver. QP
solvers do not answer level 1, and level 2 alone, well; both use the compiled descent. The test
``test_the_two_descents_agree`` in ``tests/test_kernels.py`` compares the two.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, Self

import numpy as np

from ..compiled import codes, load
from ..errors import InvalidInput, SolverError
from ..qp import SolverChain, Verified
from ..qp.decomposition import svd
from ..qp.scaling import scale
from ..rows import Array, BoolArray, Command, Rows, Task
from ..rows import tolerances as limit
from .least_norm import LeastNorm, least_norm
from .resolver import row_weights, unmet


class Target(NamedTuple):
    """Costs of levels 2 and 3, and their sum with a damping.

    Level 2 is ½‖diag(gains) directionsᵀ (x − center)‖², level 3 is ½‖x − center‖². ``center`` (n,)
    is the minimiser without rows, and ``directions`` (n, n) is orthogonal. ``gains`` (n,) are the
    singular values of the task over its norm, zero below the ``tolerance``. ``strict``: level 2 is
    solved alone where the damping has cost it something.
    """

    center: Array
    directions: Array
    gains: Array
    damping: float
    tolerance: float
    strict: bool

    @classmethod
    def of(cls, tracking: LeastNorm, damping: float, tolerance: float, strict: bool) -> Self:
        """Create the target of a tracking command.

        With J q̈ fixed, q̈ − q̈_track differs from q̈ − q̈₀ by a constant orthogonal to the null
        space of J.
        """
        gains = tracking.gains
        size = float(np.linalg.norm(gains))
        if size > 0.0:
            gains = gains / size
        return cls(tracking.qdd, tracking.directions, gains, damping, tolerance, strict)

    @property
    def stiffness(self) -> Array:
        """Square roots (n,) of the weights of the sum."""
        return np.sqrt(self.gains * self.gains + self.damping)

    def damped(self, x: Array) -> bool:
        """True if the damping may have cost x a relevant residual.

        The residual is relevant if level 2 alone does not have it, and if it exceeds the
        tolerances.
        """
        is_redundant = bool((self.gains == 0.0).any())
        if not (self.strict and is_redundant):
            return False
        offset = self.directions.T @ (x - self.center)
        residual = float(np.linalg.norm(self.gains * offset))
        distance = float(np.linalg.norm(offset))
        rounding = limit.MET * float(np.linalg.norm(x))
        return residual > limit.STRICT * distance + rounding

    def cut(self) -> float:
        """Return the relative gain below which level 2 alone leaves directions unused."""
        used = self.gains[self.gains > 0.0]
        least = used.min(initial=np.inf)
        greatest = used.max(initial=0.0)
        if least >= limit.WELL_CONDITIONED * greatest:
            return self.tolerance
        return max(self.tolerance, float(np.sqrt(self.damping)))


class Optimum(NamedTuple):
    """Lexicographic optimum x (n,).

    ``violation`` (m,) is the violation of each row, exactly zero where the row can be met.
    ``holding`` (m,) are the rows that are violated, or at their bound with a positive multiplier.
    ``shortfall`` is the reason why the levels below the first may be better met than by x, empty if
    they cannot. ``fallback`` lists earlier failures, empty if there were none. ``iterations`` are
    those of all QPs on the way to x.
    """

    x: Array
    violation: Array
    holding: BoolArray
    verified: Verified | None
    shortfall: str = ""
    fallback: str = ""
    iterations: int = 0


class Walls(NamedTuple):
    """Inequalities A x ≤ c, A (w, n) and c (w,)."""

    A: Array
    c: Array

    @classmethod
    def with_box(cls, A: Array, c: Array, box: Array) -> Self:
        """Return the rows A x ≤ c, then the finite ends of the box (2, n)."""
        n = A.shape[1]
        least, greatest = box
        ends = np.concatenate((greatest, -least))
        is_bounded = np.isfinite(ends)
        faces = np.vstack((np.eye(n), -np.eye(n)))
        normals = np.vstack((A, faces[is_bounded]))
        sides = np.concatenate((c, ends[is_bounded]))
        return cls(normals, sides)

    def terms(self, x: Array) -> Array:
        """Return the size (w,) of the terms of A x − c."""
        norms = np.linalg.norm(self.A, axis=1)
        size: Array = norms * np.linalg.norm(x) + np.abs(self.c)
        return size

    def with_room(self, x: Array, room: float) -> Self:
        """Relax the sides so that x meets them.

        ``room`` is the tolerance for rounding, as a fraction of the terms.
        """
        met = np.maximum(self.c, self.A @ x)
        return self._replace(c=met + room * self.terms(x))

    def not_constant_along(self, Z: Array) -> BoolArray:
        """Return a mask (w,) of the walls that are not constant along Z (n, p)."""
        along = np.linalg.norm(self.A @ Z, axis=1)
        norms = np.linalg.norm(self.A, axis=1)
        mask: BoolArray = along > limit.DEPENDENT * norms
        return mask

    def part(self, mask: BoolArray) -> Self:
        """Return some of the walls."""
        return type(self)(self.A[mask], self.c[mask])


def by_solvers(resolver: Any, rows: Rows, task: Task, c: Array, solvers: SolverChain) -> Command:
    """Compute the command of a :class:`.Hierarchy` for the bounds c (m,) of the rows."""
    tolerance = resolver.rank_tolerance
    damping = resolver.damping
    tracking = least_norm(task.J, task.b, tolerance, task.rest)
    n = task.J.shape[1]
    box = resolver.box(rows, n)
    center, acted = resolver.center(rows, tracking.qdd, c, box)
    if resolver.aim in (codes.NEAREST, codes.SCALED):
        cost = Target(center, np.eye(n), np.ones(n), damping, tolerance, strict=False)
    else:
        cost = Target.of(tracking, damping, tolerance, strict=resolver.aim == codes.STRICT)
    which = np.flatnonzero(c < np.inf)
    lengths = np.linalg.norm(rows.Lg[which], axis=1)
    is_fixed = lengths <= limit.ZERO_GRADIENT * rows.scale[which]
    free = which[~is_fixed]
    stuck = which[is_fixed]
    labels = [rows.labels[i] for i in free]
    weights = row_weights(labels, resolver.weights or {})
    try:
        best = descend(rows.Lg[free], c[free], weights, cost, box, solvers)
    except InvalidInput as error:
        raise SolverError(f"beyond the range of floating point: {error}") from error
    slack = np.zeros(len(rows.labels))
    acted[free] |= best.holding
    slack[free] = best.violation
    slack[stuck] = np.maximum(-c[stuck], 0.0)
    status: Literal["ok", "relaxed", "suboptimal"] = "ok"
    if slack.any():
        status = "relaxed"
    elif best.shortfall:
        status = "suboptimal"
    reasons = unmet(rows.labels, slack, stuck), best.shortfall
    command = Command(
        best.x,
        status,
        acted,
        rows.labels,
        reason="; ".join(filter(None, reasons)),
        slack=slack,
        fallback=best.fallback,
    )
    if best.verified:
        command.solver = best.verified.solver
        command.iterations = best.iterations
    return command


def descend(
    A: Array, c: Array, weights: Array, cost: Target, box: Array, solvers: SolverChain
) -> Optimum:
    """Find the x of least cost among those in the box (2, n) with the least ‖W max(0, Ax − c)‖.

    A (m, n) has no zero row, c and weights are (m,). Hard rows are tried first. If they are
    incompatible, the violated rows become equalities, Ax = c + violation, and the cost is minimised
    within them. Only an exact solver is trusted to report incompatibility; with any other solver
    the least violation is computed at once. Rows that rounding makes incompatible are relaxed by
    just that rounding. Raises SolverError if the least violation is not found.
    """
    m, n = A.shape
    walls = Walls.with_box(A, c, box)
    if solvers.preferred.recognises_infeasibility:
        try:
            return _with_hard_rows(m, cost, walls, box, solvers)
        except SolverError:
            pass  # the rows are incompatible, or the solver failed: the least violation decides

    least = _least_violation(A, c, weights, cost, box)
    # the feasible set may lack an interior, as with two opposite rows: x gets a small tolerance
    walls = walls.with_room(least.x, limit.RELAXED)
    pinned_axes = np.eye(n)[least.pinned]
    determined = np.vstack((A[least.violated], pinned_axes))
    equal, free = _split(determined)
    # rows within the span of the violated ones are determined by the equalities
    others = walls.not_constant_along(free)
    others[:m] &= ~least.violated
    found = _within_equalities(least.x, equal, free, cost, walls.part(others), solvers)
    x = np.clip(found.x, *box)
    holding = np.zeros(len(walls.c), dtype=np.bool_)
    holding[others] = found.holding
    excess = np.maximum(A @ x - c, 0.0)
    violation = np.where(least.violated, excess, 0.0)
    return found._replace(x=x, violation=violation, holding=least.violated | holding[:m])


def _with_hard_rows(
    m: int, cost: Target, walls: Walls, box: Array, solvers: SolverChain
) -> Optimum:
    """Minimise the cost within the walls, of which the first m are rows, and all can be met.

    The QP is  min ½‖u‖²  in x = center + T u: with the stiffness K and the directions V, T = V K⁻¹
    makes ‖K Vᵀ(x − center)‖ the norm of u. Raises SolverError if there is no answer.
    """
    T: Array = cost.directions / cost.stiffness
    found = _nearest(cost.center, T, walls, solvers, first_only=True)
    if cost.damped(found.x):
        no_equalities = np.empty((0, cost.center.size))
        found = _strictly(found, cost, no_equalities, walls, solvers)
    x = np.clip(found.x, *box)
    return found._replace(x=x, violation=np.zeros(m), holding=found.holding[:m])


class LeastViolation(NamedTuple):
    """Point x (n,) of least violation: violated rows (m,), coordinates (n,) pinned to the box."""

    x: Array
    violated: BoolArray
    pinned: BoolArray


def _least_violation(
    A: Array, c: Array, weights: Array, cost: Target, box: Array
) -> LeastViolation:
    """Find a point of least violation in the box; raises SolverError if it is not found.

    A coordinate is pinned where the violations pull it against the box: it is at that bound in
    every point of least violation. The pull is the gradient Σ wᵢ² eᵢ Aᵢ of ½‖W max(0, Ax − c)‖²
    with the excess e.
    """
    least, greatest = box
    x = np.clip(cost.center, least, greatest)
    given = _contiguous(A, c, weights, box)
    code = load("level_by_level").violate_least(*given, x)
    if code != codes.SOLVED:
        raise SolverError(
            "the least violation of the rows was not found within the limit of iterations"
        )
    excess = A @ x - c
    violated = excess > limit.SIGNIFICANT * Walls(A, c).terms(x)
    weighted = weights[violated] ** 2 * excess[violated]
    forces = A[violated] * weighted[:, None]
    pull = np.abs(forces.sum(axis=0))
    terms = np.abs(forces).sum(axis=0)
    is_pulled = pull > limit.SIGNIFICANT * terms
    is_at_bound = (x <= least) | (x >= greatest)
    return LeastViolation(x, violated, is_pulled & is_at_bound)


def _within_equalities(
    x: Array, equal: Array, free: Array, cost: Target, walls: Walls, solvers: SolverChain
) -> Optimum:
    """Minimise the cost from x along the columns of ``free`` (n, p), within the walls.

    ``equal`` (n − p, n) spans the other directions. Without a choice, x is the answer; if the
    solvers fail, it is the answer with a shortfall.
    """
    found = Optimum(x, np.empty(0), np.zeros(len(walls.c), dtype=np.bool_), None)
    if not free.shape[1]:
        return found
    center = cost.center
    metric: Array = cost.directions / cost.stiffness
    if len(equal):
        center, metric = _restricted(cost, x, free)
    try:
        found = _nearest(center, metric, walls, solvers)
    except SolverError as error:
        found = found._replace(shortfall=str(error), fallback=str(error))
    if found.shortfall or cost.damped(found.x):
        found = _strictly(found, cost, equal, walls, solvers)
    return found


def _restricted(cost: Target, x: Array, free: Array) -> tuple[Array, Array]:
    """Return the minimiser (n,) of the cost in x + Z y, Z = ``free``, and its metric T (n, p).

    With the stiffness K and the directions V, the cost is ½‖E y + e‖² with E = K VᵀZ and e = K
    Vᵀ(x − center). With E = QR it is ½‖R y + Qᵀe‖² and a constant. The minimiser is y_min =
    −R⁻¹Qᵀe, and ½‖u‖² with u = R (y − y_min) is the rest. Hence T = Z R⁻¹, and x + Z y_min = x −
    T Qᵀe.
    """
    K = cost.stiffness
    Vt = cost.directions.T
    E = K[:, None] * (Vt @ free)
    Q, R = np.linalg.qr(E)
    T: Array = free @ np.linalg.inv(R)
    e = K * (Vt @ (x - cost.center))
    center: Array = x - T @ (Q.T @ e)
    return center, T


def _nearest(
    center: Array, T: Array, walls: Walls, solvers: SolverChain, *, first_only: bool = False
) -> Optimum:
    """Solve  min ½‖u‖²  within the walls, x = center + T u."""
    A, c = walls
    problem = scale(A @ T, c - A @ center)
    if problem.size <= 0.0:
        return Optimum(center, np.empty(0), np.zeros(c.size, dtype=np.bool_), None)
    p = T.shape[1]
    data = np.eye(p), np.zeros(p), problem.G, problem.h
    if first_only:
        preferred = solvers.preferred
        verified = Verified(preferred.solve(*data), preferred.name)
    else:
        verified = solvers.solve(*data)
    answer = verified.answer
    x = center + T @ (problem.size * answer.x)
    # the check of the solver is relative to the distance from the minimiser without rows, which
    # may be very long
    excess = A @ x - c
    norms = np.linalg.norm(A, axis=1)
    allowed = limit.MISSED * walls.terms(x) + limit.NEGLIGIBLE * norms
    if (excess > allowed).any():
        raise SolverError(
            f"the answer of {verified.solver} exceeds a row by {excess.max():.1e}, due to rounding"
        )
    multipliers = answer.multipliers
    return Optimum(
        x,
        violation=np.empty(0),
        holding=multipliers > limit.PULLING * multipliers.max(),
        verified=verified,
        fallback=verified.fallback,
        iterations=answer.iterations,
    )


def _strictly(
    found: Optimum, cost: Target, equal: Array, walls: Walls, solvers: SolverChain
) -> Optimum:
    """Solve level 2 alone from a point that meets all rows, then level 3 if a choice is left.

    If level 3 has no answer, that of level 2 is returned with a shortfall.
    """
    walls = walls.with_room(found.x, limit.MET)
    G: Array = cost.gains[:, None] * cost.directions.T
    x = found.x.copy()
    holding = found.holding.copy()
    given = _contiguous(G, cost.center, equal, walls.A, walls.c)
    is_found = load("level_by_level").track_best(*given, x, holding, cost.cut())
    if not is_found:
        unfound = "level 2 was not found within the limit of iterations"
        return found._replace(x=x, shortfall=found.shortfall or unfound)
    used = G[cost.gains > 0.0]
    determined = np.vstack((equal, walls.A[holding], used))
    _, N = _split(determined)
    if not N.shape[1]:
        return found._replace(x=x, holding=holding, shortfall="")
    free = walls.not_constant_along(N)
    # the point of the null space N nearest to the center
    in_null_space = N.T @ (x - cost.center)
    center = x - N @ in_null_space
    try:
        last = _nearest(center, N, walls.part(free), solvers)
    except (SolverError, InvalidInput) as error:
        return found._replace(x=x, holding=holding, shortfall=f"level 3: {error}")
    holding[free] |= last.holding
    return found._replace(
        x=last.x,
        holding=holding,
        verified=last.verified or found.verified,
        shortfall="",
        iterations=found.iterations + last.iterations,
    )


def _split(A: Array) -> tuple[Array, Array]:
    """Return orthonormal bases of the row space (r, n) and of the null space (n, n − r) of A.

    No row of A is zero.
    """
    if not len(A):
        return A, np.eye(A.shape[1])
    row_norms = np.linalg.norm(A, axis=1)
    _, s, Vt = svd(A / row_norms[:, None])
    is_independent = s > limit.DEPENDENT * s[0]
    rank = int(np.count_nonzero(is_independent))
    return Vt[:rank], Vt[rank:].T


def _contiguous(*arrays: Array) -> list[Array]:
    return [np.ascontiguousarray(array) for array in arrays]
