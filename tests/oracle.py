"""The lexicographic optimum by cvxpy, level by level, the first level in rationals, and random
problems for both.

Nothing here comes from the package: the oracle states the three levels as their definition does. It
is delicate in two places. Level 1 minimises a norm, not its square, whose optimum would be found to
half the digits only; and what a level has fixed is eliminated with an orthonormal basis before the
next, not passed on as a constraint that rounding could empty.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from fractions import Fraction

import cvxpy as cp
import numpy as np

TOLERANCES = (1e-11, 1e-9, 1e-8)
RANK = 1e-7


@dataclass(frozen=True)
class Problem:
    """Rows A x ≤ c with level-1 weights, a task J x = b, and the box |x| ≤ bound, or box[0] ≤ x ≤
    box[1], or none.
    """

    A: np.ndarray
    c: np.ndarray
    weights: np.ndarray
    J: np.ndarray
    b: np.ndarray
    bound: float | None = None
    box: np.ndarray | None = None

    def ends(self):
        """The box as rows and their sides."""
        n = self.J.shape[1]
        box = np.array([[-np.inf], [np.inf]]) * np.ones(n) if self.box is None else self.box
        if self.bound is not None:
            box = np.clip(box, -self.bound, self.bound)
        sides = np.concatenate([box[1], -box[0]])
        return np.vstack([np.eye(n), -np.eye(n)])[sides < np.inf], sides[sides < np.inf]

    def objectives(self, x):
        """Norm of the weighted violation, norm of the task's residual, norm of x."""
        violation = self.weights * np.maximum(self.A @ x - self.c, 0.0)
        return np.array(
            [np.linalg.norm(violation), np.linalg.norm(self.J @ x - self.b), np.linalg.norm(x)]
        )


def lexicographic_optimum(problem):
    """Return the (n,) optimum of the three levels."""
    n = problem.J.shape[1]
    ends, end_sides = problem.ends()
    walls = np.vstack([problem.A, ends])
    sides = np.concatenate([problem.c, end_sides])
    x = np.zeros(n) if problem.box is None else np.clip(np.zeros(n), *problem.box)
    Z = np.eye(n)

    def minimise(objective, free_rows):
        """Minimise over x + Z y, y meeting the free rows as far as x does; return the new x."""
        if Z.shape[1] == 0:
            return x
        y = cp.Variable(Z.shape[1])
        rows = walls[free_rows] @ Z
        room = np.maximum(sides[free_rows] - walls[free_rows] @ x, 0.0)
        moving = np.linalg.norm(rows, axis=1) > RANK * np.maximum(
            np.linalg.norm(walls[free_rows], axis=1), 1e-300
        )
        constraints = [rows[moving] @ y <= room[moving]] if moving.any() else []
        program = cp.Problem(cp.Minimize(objective(y)), constraints)
        with warnings.catch_warnings():
            # These tolerances are at the limit of the solver: it may say that it came close instead
            # of reaching them. How close is what the comparison shows.
            warnings.filterwarnings("ignore", "Solution may be inaccurate", UserWarning)
            for tolerance in TOLERANCES:
                try:
                    program.solve(
                        solver=cp.CLARABEL,
                        tol_gap_abs=tolerance,
                        tol_gap_rel=tolerance,
                        tol_feas=tolerance,
                    )
                except cp.SolverError:  # it stalled before it came close: ask for less
                    continue
                break
        assert y.value is not None, program.status
        return x + Z @ y.value

    box = np.zeros(len(sides), dtype=bool)
    box[len(problem.c) :] = True
    # Unit rows and unit demands condition the first level; its metric is untouched, since the
    # weights compensate.
    size = np.maximum(np.linalg.norm(problem.A, axis=1), 1e-300)
    metric = problem.weights * np.where(size > 1e-300, size, 1.0)
    unit_rows = problem.A / np.where(size > 1e-300, size, 1.0)[:, None]
    unit_sides = problem.c / np.where(size > 1e-300, size, 1.0)
    if len(problem.c):
        x = minimise(
            lambda y: cp.norm(cp.multiply(metric, cp.pos(unit_rows @ (x + y) - unit_sides))), box
        )
    excess = unit_rows @ x - unit_sides
    violated = excess > 1e-6 * (1.0 + np.abs(unit_sides))
    Z = Z @ _null_space(unit_rows[violated] @ Z)
    free = np.concatenate([~violated, np.ones(len(sides) - len(violated), dtype=bool)])
    scale = max(np.linalg.norm(problem.J, 2), 1e-300) if problem.J.size else 1.0
    if problem.J.size:
        x = minimise(lambda y: cp.norm(problem.J @ (x + Z @ y) - problem.b), free)
        Z = Z @ _null_space(problem.J @ Z / scale)
    return minimise(lambda y: cp.norm(x + Z @ y), free)


def _null_space(A):
    """Orthonormal basis of what the rows of A, of about unit size, do not see."""
    n = A.shape[1]
    if A.shape[0] == 0 or n == 0:
        return np.eye(n)
    _, s, Vt = np.linalg.svd(A)
    return Vt[int((s > RANK).sum()) :].T


def exact_least_violation(A, c):
    """Return a minimiser x of ‖max(0, A x − c)‖, (n,) rationals, and that norm.

    An active-set method: rows taken in are met in the least-squares sense, all others exactly. One
    that would be exceeded on the way is taken in, and one that pulls without being exceeded is let
    go.
    """
    A = _rational(A)
    c = _rational([c])[0]
    x = [Fraction(0)] * len(A[0])
    taken = {i for i, side in enumerate(c) if side < 0}
    while True:
        rows = sorted(taken)
        columns = list(zip(*(A[i] for i in rows), strict=True)) or [()] * len(x)
        normal = [[_dot(a, b) for b in columns] for a in columns]
        target = _solve(normal, [_dot(column, [c[i] for i in rows]) for column in columns])
        way = [a - b for a, b in zip(target, x, strict=True)]
        length = Fraction(1)
        blocking = None
        for i in set(range(len(c))) - taken:
            change = _dot(A[i], way)
            if change > 0 and (c[i] - _dot(A[i], x)) / change < length:
                length = (c[i] - _dot(A[i], x)) / change
                blocking = i
        x = [a + length * b for a, b in zip(x, way, strict=True)]
        if blocking is not None:
            taken.add(blocking)
            continue
        worst, pulling = min(((_dot(A[i], x) - c[i], i) for i in rows), default=(Fraction(0), None))
        if worst >= 0:
            return x, violation_norm(A, c, x)
        taken.remove(pulling)


def violation_norm(A, c, x):
    """‖max(0, A x − c)‖, free of rounding but for the root."""
    A = _rational(A)
    c = _rational([c])[0]
    x = _rational([x])[0]
    return (
        float(
            sum(max(_dot(row, x) - side, Fraction(0)) ** 2 for row, side in zip(A, c, strict=True))
        )
        ** 0.5
    )


def _rational(rows):
    return [[Fraction(value) for value in row] for row in rows]


def _dot(a, b):
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def _solve(H, g):
    """Solve H p = g by elimination; what is free is zero."""
    M = [[*row, value] for row, value in zip(H, g, strict=True)]
    pivots = []
    for column in range(len(g)):
        at = next((i for i in range(len(pivots), len(g)) if M[i][column]), None)
        if at is None:
            continue
        r = len(pivots)
        M[r], M[at] = M[at], M[r]
        M[r] = [value / M[r][column] for value in M[r]]
        for i in range(len(g)):
            if i != r and M[i][column]:
                M[i] = [a - M[i][column] * b for a, b in zip(M[i], M[r], strict=True)]
        pivots.append(column)
    p = [Fraction(0)] * len(g)
    for r, column in enumerate(pivots):
        p[column] = M[r][-1]
    return p


def random_problem(kind, seed):
    """Draw one problem of that kind; the same seed gives the same problem."""
    rng = np.random.default_rng([seed, sum(kind.encode())])
    n = int(rng.integers(2, 9))
    m = int(rng.integers(1, 16))
    k = int(rng.integers(1, 10))
    bound = box = None
    if kind == "many rows":
        m = int(rng.integers(40, 101))
    if kind == "large":
        n = int(rng.integers(20, 31))
        m = int(rng.integers(20, 60))
        k = int(rng.integers(6, 25))
    if kind == "wide task":
        n = int(rng.integers(5, 10))
        k = int(rng.integers(1, 4))
    J = _conditioned(rng, k, n)
    b = rng.normal(size=k)
    A = rng.normal(size=(m, n))
    c = rng.normal(size=m)
    if kind in ("feasible", "large", "wide task", "rank-deficient task"):
        c = A @ rng.normal(size=n) + rng.uniform(0.0, 1.0, m) * (rng.random(m) < 0.8)
    if kind == "conflicting":
        A = np.vstack([A, -A[:2]])
        c = np.concatenate([c, -c[:2] - rng.uniform(0.1, 1.0, min(2, m))])
    if kind == "duplicate":
        A = np.vstack([A, A[:3], 2.0 * A[:1]])
        c = np.concatenate([c, c[:3], 2.0 * c[:1]])
    if kind == "redundant":
        combination = rng.uniform(0.0, 1.0, (3, m))
        A = np.vstack([A, combination @ A])
        c = np.concatenate([c, combination @ c + rng.uniform(0.0, 0.1, 3)])
    if kind == "rank-deficient task":
        J = np.vstack([J, J[:1], J[:1] - J[-1:]])
        J[:, 0] = J[:, 1]
        b = rng.normal(size=k + 2)
    if kind == "badly scaled":
        scale = 10.0 ** rng.uniform(-2.0, 2.0, m)
        A = A * scale[:, None]
        c = c * scale
    if kind == "zero rows":
        A[0] = 0.0
        A[m // 2] = 0.0
    if kind == "opposite":  # the rows leave a set without interior
        half = n // 2 + 1
        A = rng.normal(size=(half, n))
        c = A @ rng.normal(size=n)
        A = np.vstack([A, -A])
        c = np.concatenate([c, -c])
    if kind == "box":
        bound = 0.5
    if kind == "box of each joint":  # some joints without a bound, some that must move
        middle = rng.normal(size=n)
        half = rng.uniform(0.05, 1.0, n)
        c = A @ middle + rng.uniform(0.0, 1.0, m) if seed % 2 else c
        box = np.array([middle - half, middle + half])
        box[rng.random((2, n)) < 0.2] *= np.inf
        box = np.array(
            [
                np.where(np.isinf(box[0]), -np.inf, box[0]),
                np.where(np.isinf(box[1]), np.inf, box[1]),
            ]
        )
    weights = (
        rng.uniform(0.5, 2.0, len(c)) if kind in ("random", "conflicting") else np.ones(len(c))
    )
    return Problem(A, c, weights, J, b, bound, box)


KINDS = (
    "feasible",
    "random",
    "conflicting",
    "duplicate",
    "redundant",
    "many rows",
    "rank-deficient task",
    "wide task",
    "badly scaled",
    "zero rows",
    "opposite",
    "box",
    "box of each joint",
    "large",
)


def _conditioned(rng, k, n):
    """(k, n) matrix with singular values between 0.3 and 1."""
    U, _, Vt = np.linalg.svd(rng.normal(size=(k, n)), full_matrices=False)
    return (U * rng.uniform(0.3, 1.0, min(k, n))) @ Vt


# --- closed forms, by singular values ---


def resolve(A1, b1, A2, b2, tolerance=1e-6, rest=None):
    """Eq. (15): q̈ of least norm that meets A₁q̈ = b₁, and A₂q̈ = b₂ as far as that leaves it free;
    and the rank of A₁.
    """
    if rest is not None and len(rest):
        step, rank = resolve(A1, b1 - A1 @ rest, A2, b2 - A2 @ rest, tolerance)
        return rest + step, rank
    n = A2.shape[1]
    qdd = np.zeros(n)
    Z = np.eye(n)
    rank = 0
    if len(A1):
        U, s, Vt = np.linalg.svd(A1)
        rank = int((s > tolerance * s[0]).sum())
        qdd = Vt[:rank].T @ ((U[:, :rank].T @ b1) / s[:rank])
        Z = Vt[rank:].T
    if len(A2) and Z.shape[1]:
        U, s, Vt = np.linalg.svd(A2 @ Z, full_matrices=False)
        kept = s > tolerance * np.linalg.norm(A2, 2)
        qdd = qdd + Z @ (Vt[kept].T @ ((U[:, kept].T @ (b2 - A2 @ qdd)) / s[kept]))
    return qdd, rank


def track(task, tolerance=1e-6):
    """J†b, as near as possible to the rest acceleration."""
    n = task.J.shape[1]
    return resolve(np.empty((0, n)), np.empty(0), task.J, task.b, tolerance, task.rest)[0]


def prioritise(rows, task, c, tolerance=1e-6):
    """Rows of finite c meet L_gφ q̈ = c; q̈, and whether those with φ ≥ 0 have full row rank."""

    def unit(which):
        length = np.linalg.norm(rows.Lg[which], axis=1)
        length = np.where(length > 1e-12 * rows.scale[which], length, np.inf)
        return rows.Lg[which] / length[:, None], c[which] / length

    acts = c < np.inf
    qdd, rank = resolve(*unit(acts), task.J, task.b, tolerance, task.rest)
    reached = acts & (rows.phi >= 0.0)
    whole = (
        rank == acts.sum() or resolve(*unit(reached), task.J, task.b, tolerance)[1] == reached.sum()
    )
    return qdd, whole


def pushes(rows, push):
    """Σ pushᵢ L_gφᵢ† of the rows with a finite push."""
    return sum(
        (
            p * Lg / (Lg @ Lg)
            for p, Lg in zip(push, rows.Lg, strict=True)
            if p < np.inf and Lg @ Lg > 0.0
        ),
        np.zeros(rows.Lg.shape[1]),
    )


def projector(task, part, tolerance=1e-6):
    """λ P_e + (1 − λ)(I − J†J) of the large projection operator."""
    n = task.J.shape[1]
    direction = task.J.T @ task.error
    size = direction @ direction
    large = np.eye(n) - (np.outer(direction, direction) / size if size > 0.0 else 0.0)
    return part * large + (1.0 - part) * (
        np.eye(n) - np.linalg.pinv(task.J, rcond=tolerance) @ task.J
    )
