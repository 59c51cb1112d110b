"""The least cost that rows allow or, where they contradict each other, with the least violation of those that may give.

An exact penalty: with linear weights above the multipliers, slacks are zero wherever rows are compatible (Fletcher,
"Practical Methods of Optimization", 1987, section 14.3).
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from scipy.linalg import lapack

from ..errors import InvalidInput, SolverError
from ..rows import Array, BoolArray, IntArray
from .chain import SolverChain, Verified
from .least_distance import scale
from .solver import QPSolver

PENALTY = 1e4
"""Least weight of a slack, where the cost, rows and the way to the nearest point that meets the farthest of them have
the size 1."""

NEGLIGIBLE = 1e-7
"""Slack as a fraction of the largest side of a row, below which the row is met."""


Stated = tuple[IntArray, Array]
"""Which rows (r,), and their gradients (r, n)."""


class ManyRows(Protocol):
    """Rows A x ≤ c, so many that most are never written down."""

    def excess(self, x: Array) -> Array:
        """A x − c (m,) of all; −∞ where there is no bound."""

    def stated(self, which: IntArray) -> Stated:
        """Those of these rows, in ascending order, that are not zero, and their A."""

    def of(self, which: IntArray) -> IntArray:
        """Which slack each of these shares with others; −1 of rows that are always met."""

    def open(self, A: Array, c: Array) -> BoolArray:
        """Which of some rows those that are always met do not imply."""


class Penalised(NamedTuple):
    """A minimiser (n,), rows (r,) and their multipliers (r,), slack (g,) of each group, and who found it, if anybody.

    Rows that are not among these have no multiplier.
    """

    x: Array
    rows: IntArray
    multipliers: Array
    slack: Array
    verified: Verified | None


class Cost(NamedTuple):
    """½‖v‖² with v = Lᵀ(x − center).

    Attributes
    ----------
    center, L
        (n,), and (n, n) regular, of which the lower triangle counts.
    """

    center: Array
    L: Array

    def gradients(self, A: Array) -> Array:
        """(m, n) by v of rows with the gradients A (m, n) by x."""
        G: Array = lapack.dtrtrs(self.L, A.T, lower=1)[0].T
        return G

    def point(self, v: Array) -> Array:
        """(n,) x."""
        x: Array = self.center + lapack.dtrtrs(self.L, v, lower=1, trans=1)[0]
        return x


def penalised(cost: Cost, rows: ManyRows, weights: Array, solvers: SolverChain, guess: IntArray) -> Penalised:
    """Minimise ½‖Lᵀ(x − center)‖² subject to A x ≤ c + s, where s is zero unless the rows contradict each other.

    Parameters
    ----------
    cost
        Center and L.
    rows
        A and c. By what a row of zeros is exceeded is slack.
    weights
        (g,) of slacks: Σ wᵢ sᵢ is what is least where rows contradict each other.
    solvers
        Who solves the QP.
    guess
        Rows that may hold the minimiser; where they do not, they take time and no more.

    Raises
    ------
    SolverError
        if no solver has an answer.
    """
    over, slack = rows.excess(cost.center), np.zeros(len(weights))
    # what is not a number is for the solver to refuse
    exceeded = ~(over <= 0.0)
    free = Penalised(cost.center, guess[:0], np.empty(0), slack, None)
    if not exceeded.any():
        return free
    asked = exceeded.copy()
    asked[guess[guess < len(asked)]] = True
    which, A = rows.stated(np.flatnonzero(asked))
    zero = exceeded.copy()
    zero[which] = False
    np.maximum.at(slack, rows.of(np.flatnonzero(zero)), over[zero])
    if not exceeded[which].any():
        return free
    try:
        if solvers.preferred.recognises_infeasibility:
            try:
                return _by_few(cost, rows, over, (which, A), solvers.preferred)._replace(slack=slack)
            except SolverError:
                pass  # incompatible rows or a failed solver: with slacks there is an answer
        found = _with_slack(cost, rows, over, weights, solvers)
    except InvalidInput as error:
        raise SolverError(f"beyond the range of floating point: {error}") from error
    return found._replace(slack=np.maximum(slack, found.slack))


def _by_few(cost: Cost, rows: ManyRows, over: Array, asked: Stated, solver: QPSolver) -> Penalised:
    """The minimiser under the rows that are asked for, and then those too that it exceeds, until there are none.

    What minimises under some of the rows and meets all minimises under all.
    """
    (which, A), n = asked, len(cost.center)
    unit, origin = np.eye(n), np.zeros(n)
    while True:
        problem = scale(cost.gradients(A), -over[which])
        answer = solver.solve(unit, origin, problem.G, problem.h)
        x = cost.point(problem.size * answer.x)
        exceeded = rows.excess(x) > 0.0
        exceeded[which] = False
        if not exceeded.any() or not len((more := rows.stated(np.flatnonzero(exceeded)))[0]):
            return Penalised(x, which, answer.multipliers, np.empty(0), Verified(answer, solver.name))
        which, A = np.concatenate((which, more[0])), np.concatenate((A, more[1]))


def _with_slack(cost: Cost, rows: ManyRows, over: Array, weights: Array, solvers: SolverChain) -> Penalised:
    which, A = rows.stated(np.flatnonzero(over != -np.inf))
    has = rows.open(A, A @ cost.center - over[which]) | (rows.of(which) < 0)
    which, A = which[has], A[has]
    groups, problem = rows.of(which), scale(cost.gradients(A), -over[which])
    (m, n), g = problem.G.shape, len(weights)
    # a slack's unit: that in which it moves a row by the size of the problem
    sizes = problem.norms * problem.size
    soft = groups >= 0
    unit = np.zeros(g)
    np.maximum.at(unit, groups[soft], sizes[soft])
    unit[unit == 0.0] = 1.0
    G, h = np.zeros((m + g, n + g)), np.zeros(m + g)
    G[:m, :n], h[:m] = problem.G, problem.h
    G[np.flatnonzero(soft), n + groups[soft]] = -unit[groups[soft]] / sizes[soft]
    G[m:, n:] = -np.eye(g)
    each = weights * unit
    q = np.concatenate((np.zeros(n), PENALTY * each / each.min(initial=np.inf)))
    verified = solvers.solve(np.eye(n + g), q, G, h)
    found = np.maximum(verified.answer.x[n:], 0.0)
    found[found <= NEGLIGIBLE * max(1.0, float(np.abs(problem.h).max()))] = 0.0
    x = cost.point(problem.size * verified.answer.x[:n])
    return Penalised(x, which, verified.answer.multipliers[:m], unit * found, verified)
