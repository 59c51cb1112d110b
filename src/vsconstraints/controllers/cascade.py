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
        size = float(np.linalg.norm(tracking.gains))
        relative = tracking.gains / size if size > 0.0 else tracking.gains
        return cls(tracking.qdd, tracking.directions, relative, damping, tolerance, strict)

    @property
    def stiffness(self) -> Array:
        """Square roots (n,) of the weights of the sum."""
        return np.sqrt(self.gains * self.gains + self.damping)

    def damped(self, x: Array) -> bool:
        """True if the damping may have cost x a relevant residual.

        The residual is relevant if level 2 alone does not have it, and if it exceeds the
        tolerances.
        """
        offset = self.directions.T @ (x - self.center)
        distance = float(np.linalg.norm(offset))
        allowed = limit.STRICT * distance + limit.MET * float(np.linalg.norm(x))
        redundant = self.strict and bool((self.gains == 0.0).any())
        return redundant and bool(np.linalg.norm(self.gains * offset) > allowed)

    def cut(self) -> float:
        """Return the relative gain below which level 2 alone leaves directions unused."""
        kept = self.gains[self.gains > 0.0]
        well = kept.min(initial=np.inf) >= limit.WELL_CONDITIONED * kept.max(initial=0.0)
        return self.tolerance if well else max(self.tolerance, float(np.sqrt(self.damping)))


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


def by_solvers(resolver: Any, rows: Rows, task: Task, c: Array, solvers: SolverChain) -> Command:
    """Compute the command of a :class:`.Hierarchy` for the bounds c (m,) of the rows."""
    tracking = least_norm(task.J, task.b, resolver.rank_tolerance, task.rest)
    n = task.J.shape[1]
    box = resolver.box(rows, n)
    center, active = resolver.center(rows, tracking.qdd, c, box)
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
    active[free] |= best.holding
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
        active,
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
    walls, sides = _with_box(A, c, box)
    if solvers.preferred.recognises_infeasibility:
        try:
            return _with_hard_rows(len(c), cost, walls, sides, box, solvers)
        except SolverError:
            pass  # the rows are incompatible, or the solver failed: the least violation decides

    least = _least_violation(A, c, weights, cost, box)
    # the feasible set may lack an interior, as with two opposite rows: x gets a small tolerance
    sides = _with_room(walls, sides, least.x, limit.RELAXED)
    pinned_axes = np.eye(len(least.x))[least.pinned]
    equal, free = _split(np.vstack((A[least.violated], pinned_axes)))
    # rows within the span of the violated ones are determined by the equalities
    others = _seen(walls, free)
    others[: len(c)] &= ~least.violated
    found = _within_equalities(least.x, equal, free, cost, walls[others], sides[others], solvers)
    x = np.clip(found.x, *box)
    holding = np.zeros(len(walls), dtype=np.bool_)
    holding[others] = found.holding
    violation = np.where(least.violated, np.maximum(A @ x - c, 0.0), 0.0)
    return found._replace(x=x, violation=violation, holding=least.violated | holding[: len(c)])


def _with_box(A: Array, c: Array, box: Array) -> tuple[Array, Array]:
    """Return walls (w, n) and sides (w,): the rows A x ≤ c, then the finite ends of the box."""
    n = A.shape[1]
    ends = np.concatenate((box[1], -box[0]))
    bounded = np.isfinite(ends)
    faces = np.vstack((np.eye(n), -np.eye(n)))
    return np.vstack((A, faces[bounded])), np.concatenate((c, ends[bounded]))


def _with_hard_rows(
    m: int, cost: Target, walls: Array, sides: Array, box: Array, solvers: SolverChain
) -> Optimum:
    """Minimise the cost within the walls, of which the first m are rows, and all can be met.

    The QP is  min ½‖u‖²  in x = center + T u: with the stiffness K and the directions V, T = V K⁻¹
    makes ‖K Vᵀ(x − center)‖ the norm of u. Raises SolverError if there is no answer.
    """
    T: Array = cost.directions / cost.stiffness
    found = _nearest(cost.center, T, walls, sides, solvers, first_only=True)
    if cost.damped(found.x):
        found = _strictly(found, cost, np.empty((0, cost.center.size)), walls, sides, solvers)
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
    x = np.clip(cost.center, *box)
    if load("level_by_level").violate_least(*_contiguous(A, c, weights, box), x) != 0:
        raise SolverError(
            "the least violation of the rows was not found within the limit of iterations"
        )
    excess = A @ x - c
    violated = excess > limit.SIGNIFICANT * _terms(A, c, x)
    weighted = weights[violated] ** 2 * excess[violated]
    forces = A[violated] * weighted[:, None]
    pull = np.abs(forces.sum(axis=0))
    pulled = pull > limit.SIGNIFICANT * np.abs(forces).sum(axis=0)
    at_bound = (x <= box[0]) | (x >= box[1])
    pinned = pulled & at_bound
    return LeastViolation(x, violated, pinned)


def _within_equalities(
    x: Array,
    equal: Array,
    free: Array,
    cost: Target,
    walls: Array,
    sides: Array,
    solvers: SolverChain,
) -> Optimum:
    """Minimise the cost from x along the columns of ``free`` (n, p), within the walls.

    ``equal`` (n − p, n) spans the other directions. Without a choice, x is the answer; if the
    solvers fail, it is the answer with a shortfall.
    """
    found = Optimum(x, np.empty(0), np.zeros(len(walls), dtype=np.bool_), None)
    if not free.shape[1]:
        return found
    center = cost.center
    metric: Array = cost.directions / cost.stiffness
    if len(equal):
        center, metric = _restricted(cost, x, free)
    try:
        found = _nearest(center, metric, walls, sides, solvers)
    except SolverError as error:
        found = found._replace(shortfall=str(error), fallback=str(error))
    if found.shortfall or cost.damped(found.x):
        found = _strictly(found, cost, equal, walls, sides, solvers)
    return found


def _restricted(cost: Target, x: Array, free: Array) -> tuple[Array, Array]:
    """Return the minimiser (n,) of the cost in x + Z y, Z = ``free``, and its metric T (n, p).

    With the stiffness K and the directions V, the cost is ½‖E y + e‖² with E = K VᵀZ and e = K
    Vᵀ(x − center). With E = QR it is ½‖R y + Qᵀe‖² and a constant. The minimiser is y_min =
    −R⁻¹Qᵀe, and ½‖u‖² with u = R (y − y_min) is the rest. Hence T = Z R⁻¹, and x + Z y_min = x −
    T Qᵀe.
    """
    E = cost.stiffness[:, None] * (cost.directions.T @ free)
    Q, R = np.linalg.qr(E)
    T: Array = free @ np.linalg.inv(R)
    e = cost.stiffness * (cost.directions.T @ (x - cost.center))
    center: Array = x - T @ (Q.T @ e)
    return center, T


def _nearest(
    center: Array, T: Array, A: Array, c: Array, solvers: SolverChain, *, first_only: bool = False
) -> Optimum:
    """Solve  min ½‖u‖²  subject to  A x ≤ c, x = center + T u."""
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
    x = center + T @ (problem.size * verified.answer.x)
    multipliers = verified.answer.multipliers
    # the check of the solver is relative to the distance from the minimiser without rows, which
    # may be very long
    excess = A @ x - c
    norms = np.linalg.norm(A, axis=1)
    allowed = limit.MISSED * _terms(A, c, x) + limit.NEGLIGIBLE * norms
    if (excess > allowed).any():
        raise SolverError(
            f"the answer of {verified.solver} exceeds a row by {excess.max():.1e}, due to rounding"
        )
    holding = multipliers > limit.PULLING * multipliers.max()
    iterations = verified.answer.iterations
    return Optimum(
        x, np.empty(0), holding, verified, fallback=verified.fallback, iterations=iterations
    )


def _strictly(
    found: Optimum, cost: Target, equal: Array, walls: Array, sides: Array, solvers: SolverChain
) -> Optimum:
    """Solve level 2 alone from a point that meets all rows, then level 3 if a choice is left.

    If level 3 has no answer, that of level 2 is returned with a shortfall.
    """
    sides = _with_room(walls, sides, found.x, limit.MET)
    G: Array = cost.gains[:, None] * cost.directions.T
    x = found.x.copy()
    holding = found.holding.copy()
    given = _contiguous(G, cost.center, equal, walls, sides)
    if not load("level_by_level").track_best(*given, x, holding, cost.cut()):
        unfound = "level 2 was not found within the limit of iterations"
        return found._replace(x=x, shortfall=found.shortfall or unfound)
    used = G[cost.gains > 0.0]
    _, N = _split(np.vstack((equal, walls[holding], used)))
    if not N.shape[1]:
        return found._replace(x=x, holding=holding, shortfall="")
    free = _seen(walls, N)
    # the point of the null space N nearest to the center
    center = x - N @ (N.T @ (x - cost.center))
    try:
        last = _nearest(center, N, walls[free], sides[free], solvers)
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


def _terms(A: Array, c: Array, x: Array) -> Array:
    """Return the size (m,) of the terms of A x − c."""
    size: Array = np.linalg.norm(A, axis=1) * np.linalg.norm(x) + np.abs(c)
    return size


def _with_room(walls: Array, sides: Array, x: Array, room: float) -> Array:
    """Relax the sides so that x meets them.

    ``room`` is the tolerance for rounding, as a fraction of the terms.
    """
    wide: Array = np.maximum(sides, walls @ x) + room * _terms(walls, sides, x)
    return wide


def _seen(walls: Array, Z: Array) -> BoolArray:
    """Return a mask (w,) of the walls that are not constant along Z (n, p)."""
    along = np.linalg.norm(walls @ Z, axis=1)
    norms = np.linalg.norm(walls, axis=1)
    seen: BoolArray = along > limit.DEPENDENT * norms
    return seen


def _split(A: Array) -> tuple[Array, Array]:
    """Return orthonormal bases of the row space (r, n) and of the null space (n, n − r) of A.

    No row of A is zero.
    """
    if not len(A):
        return A, np.eye(A.shape[1])
    _, s, Vt = svd(A / np.linalg.norm(A, axis=1)[:, None])
    rank = int(np.count_nonzero(s > limit.DEPENDENT * s[0]))
    return Vt[:rank], Vt[rank:].T


def _contiguous(*arrays: Array) -> list[Array]:
    return [np.ascontiguousarray(array) for array in arrays]
