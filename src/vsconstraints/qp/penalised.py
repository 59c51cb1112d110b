"""The least cost that rows allow or, where they contradict each other, with the least violation of those that may give.

An exact penalty: with linear weights above the multipliers, slacks are zero wherever rows are compatible (Fletcher,
"Practical Methods of Optimization", 1987, section 14.3).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from ..errors import InvalidInput, SolverError
from ..rows import Array, IntArray
from .backends import SolverChain, Verified
from .decomposition import lapack
from .scaling import Scaled, scale
from .solver import QPSolver

STRONG, WEAK = 1e6, 1e4
"""Weights of slacks, where the cost has the size 1, and a slack the unit by which a step of that size moves one row in
two by more and one by less; the weaker one where there is no answer with the stronger one.

In samples of arms that swing the stronger one ends at the least violation, but for 3e-5 of it, the weaker one in every
second; with 1e8 DAQP begins to cycle.
"""

NEGLIGIBLE = 1e-9
"""Slack in its unit below which the row is met."""

GAP = 1e-6
"""Fraction of the least penalised cost by which an answer may exceed it."""

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
    """½‖v‖² with v = Lᵀ(x − center), of the center (n,) and the lower triangle of L (n, n), which is regular."""

    center: Array
    L: Array

    def gradients(self, A: Array) -> Array:
        """(m, n) by v of rows with the gradients A (m, n) by x."""
        G: Array = lapack().dtrtrs(self.L, A.T, lower=1)[0].T
        return G

    def point(self, v: Array) -> Array:
        """(n,) x."""
        x: Array = self.center + lapack().dtrtrs(self.L, v, lower=1, trans=1)[0]
        return x


class _Best(NamedTuple):
    """The best v (n,) under some rows, their multipliers, slack (g,), and by what each of all may be exceeded."""

    v: Array
    multipliers: Array
    slack: Array
    allowed: Array | float
    verified: Verified


_Solve = Callable[[Scaled, IntArray], _Best]


def penalised(cost: Cost, rows: ManyRows, weights: Array, solvers: SolverChain, guess: IntArray) -> Penalised:
    """Minimise ½‖Lᵀ(x − center)‖² subject to A x ≤ c + s, where s is zero unless the rows contradict each other.

    Then Σ wᵢ sᵢ with ``weights`` (g,) is least. By what a row of zeros is exceeded is slack. ``guess`` are rows that
    may be at their bounds at the minimiser; where they are not, they take time and no more. SolverError if no solver
    has an answer.
    """
    over, slack = rows.excess(cost.center), np.zeros(len(weights))
    # what is not a number is for the solver to refuse
    exceeded = ~(over <= 0.0)
    free = Penalised(cost.center, guess[:0], np.empty(0), slack, None)
    if not exceeded.any():
        return free
    asked = exceeded.copy()
    guess = guess[guess < len(asked)]
    asked[guess[over[guess] > -np.inf]] = True
    stated = which, _ = rows.stated(np.flatnonzero(asked))
    zero = exceeded.copy()
    zero[which] = False
    np.maximum.at(slack, rows.of(np.flatnonzero(zero)), over[zero])
    if not exceeded[which].any():
        return free
    preferred, groups = solvers.preferred, rows.of(np.arange(len(over)))

    def preferred_only(P: Array, q: Array, G: Array, h: Array) -> Verified:
        return Verified(preferred.solve(P, q, G, h), preferred.name)

    attempts = [_soft(solvers.solve, groups, weights, WEAK)]
    if preferred.recognises_infeasibility:
        # incompatible rows or a failed solver: with slacks there is an answer; where that fails too, others were
        # measured to fail as well, only later
        attempts = [_hard(preferred), *(_soft(preferred_only, groups, weights, size) for size in (STRONG, WEAK))]
    while True:
        try:
            found = _by_few(cost, rows, over, stated, attempts.pop(0))
            return found._replace(slack=np.maximum(slack, found.slack) if len(found.slack) else slack)
        except InvalidInput as error:
            raise SolverError(f"beyond the range of floating point: {error}") from error
        except SolverError:
            if not attempts:
                raise


def _by_few(cost: Cost, rows: ManyRows, over: Array, stated: Stated, best: _Solve) -> Penalised:
    """The minimiser under the rows that are stated, and then those too that it exceeds, until there are none.

    What minimises under some of the rows and meets all minimises under all.
    """
    which, A = stated
    while True:
        problem = scale(cost.gradients(A), -over[which])
        found = best(problem, which)
        x = cost.point(problem.size * found.v)
        exceeded = rows.excess(x) > found.allowed
        exceeded[which] = False
        if not exceeded.any() or not len((more := rows.stated(np.flatnonzero(exceeded)))[0]):
            return Penalised(x, which, found.multipliers, found.slack, found.verified)
        which, A = np.concatenate((which, more[0])), np.concatenate((A, more[1]))


def _hard(solver: QPSolver) -> _Solve:
    """Rows without slack."""

    def best(problem: Scaled, which: IntArray) -> _Best:
        n = problem.G.shape[1]
        answer = solver.solve(np.eye(n), np.zeros(n), problem.G, problem.h)
        return _Best(answer.x, answer.multipliers, np.empty(0), 0.0, Verified(answer, solver.name))

    return best


def _soft(
    solve: Callable[[Array, Array, Array, Array], Verified], groups: IntArray, weights: Array, penalty: float
) -> _Solve:
    """Rows with the slacks of those that have one, by the groups of all."""

    def best(problem: Scaled, which: IntArray) -> _Best:
        of, (m, n) = groups[which], problem.G.shape
        soft = np.flatnonzero(of >= 0)
        present, column = np.unique(of[soft], return_inverse=True)
        # weighted slacks count alike; the unit is what a step of the size of the problem moves one row in two by
        moved = weights[of[soft]] * problem.norms[soft] * problem.size
        unit, g = float(np.median(moved)) if len(moved) else 1.0, len(present)
        S = np.zeros((m, g))
        S[soft, column] = unit / moved
        norms = np.sqrt(1.0 + np.einsum("ij,ij->i", S, S))
        G, h = np.zeros((m + g, n + g)), np.zeros(m + g)
        G[:m, :n], G[:m, n:], h[:m] = problem.G / norms[:, None], -S / norms[:, None], problem.h / norms
        G[m:, n:] = -np.eye(g)
        verified = solve(np.eye(n + g), np.concatenate((np.zeros(n), np.full(g, penalty))), G, h)
        v, multipliers = verified.answer.x[:n], verified.answer.multipliers[:m] / norms
        if not (gap := _gap(problem, S, penalty, v, multipliers)) <= GAP:
            raise SolverError(f"the answer of {verified.solver} may cost {gap:.1e} of the least cost more than that")
        s = np.maximum(verified.answer.x[n:], 0.0)
        s[s <= NEGLIGIBLE] = 0.0
        slack = np.zeros(len(weights) + 1)
        slack[present] = s * unit / weights[present]
        return _Best(v, multipliers, slack[:-1], slack[groups], verified)

    return best


def _gap(problem: Scaled, S: Array, penalty: float, v: Array, multipliers: Array) -> float:
    """By what fraction the penalised cost of v, with all the slack it needs, may exceed the least: weak duality."""
    with np.errstate(all="ignore"):
        over, s = np.maximum(problem.G @ v - problem.h, 0.0), np.zeros(S.shape[1])
        row, column = np.nonzero(S)
        np.maximum.at(s, column, over[row] / S[row, column])
        over[row] = 0.0
        most = 0.5 * (v @ v + s @ s) + penalty * (s.sum() + over.sum())
        pull, beyond = problem.G.T @ multipliers, np.maximum(0.0, S.T @ multipliers - penalty)
        least = -0.5 * (pull @ pull + beyond @ beyond) - problem.h @ multipliers
        return float((most - least) / most)
