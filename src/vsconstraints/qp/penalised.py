"""The least cost that rows allow or, where they contradict each other, with the least violation of those that may give.

An exact penalty: with linear weights above the multipliers, slacks are zero wherever rows are compatible (Fletcher,
"Practical Methods of Optimization", 1987, section 14.3).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InvalidInput, SolverError
from ..rows import Array, IntArray
from .chain import SolverChain, Verified
from .least_distance import LeastDistance, least_distance

PENALTY = 1e4
"""Least weight of a slack, where the cost, rows and the way to the nearest point that meets the farthest of them have
the size 1."""

NEGLIGIBLE = 1e-7
"""Slack as a fraction of the largest side of a row, below which the row is met."""


class Penalised(NamedTuple):
    """A minimiser (n,), the multipliers of the rows (m,), slack (g,) of each group, and who found it, if anybody."""

    x: Array
    multipliers: Array
    slack: Array
    verified: Verified | None


def penalised(
    center: Array, T: Array, A: Array, c: Array, groups: IntArray, weights: Array, solvers: SolverChain
) -> Penalised:
    """Minimise ½‖T⁻¹(x − center)‖² subject to A x ≤ c + s, where s is zero unless the rows contradict each other.

    Parameters
    ----------
    center, T
        (n,) and (n, n) regular.
    A, c
        (m, n) and (m,); no row of A is zero.
    groups
        (m,) which slack a row shares with others; −1 of rows that are always met.
    weights
        (g,) of slacks: Σ wᵢ sᵢ is what is least where rows contradict each other.
    solvers
        Who solves the QP.

    Raises
    ------
    SolverError
        if no solver has an answer.
    """
    none: Array = np.zeros(len(weights))
    problem = least_distance(center, T, A, c)
    if problem is None:
        return Penalised(center, np.zeros(len(c)), none, None)
    n = len(center)
    try:
        if solvers.preferred.recognises_infeasibility:
            try:
                verified = Verified(
                    solvers.preferred.solve(np.eye(n), np.zeros(n), problem.G, problem.h), solvers.preferred.name
                )
                return Penalised(problem.point(verified.answer.x), verified.answer.multipliers, none, verified)
            except SolverError:
                pass  # incompatible rows or a failed solver: with slacks there is an answer
        return _with_slack(problem, A @ T, groups, weights, solvers)
    except InvalidInput as error:
        raise SolverError(f"beyond the range of floating point: {error}") from error


def _with_slack(
    problem: LeastDistance, rows: Array, groups: IntArray, weights: Array, solvers: SolverChain
) -> Penalised:
    (m, n), g = problem.G.shape, len(weights)
    # a slack's unit: that in which it moves a row by the size of the problem
    sizes = np.linalg.norm(rows, axis=1) * problem.size
    soft = groups >= 0
    unit = np.zeros(g)
    np.maximum.at(unit, groups[soft], sizes[soft])
    unit[unit == 0.0] = 1.0
    G, h = np.zeros((m + g, n + g)), np.zeros(m + g)
    G[:m, :n], h[:m] = problem.G, problem.h
    G[np.flatnonzero(soft), n + groups[soft]] = -unit[groups[soft]] / sizes[soft]
    G[m:, n:] = -np.eye(g)
    cost = weights * unit
    q = np.concatenate((np.zeros(n), PENALTY * cost / cost.min(initial=np.inf)))
    verified = solvers.solve(np.eye(n + g), q, G, h)
    found = np.maximum(verified.answer.x[n:], 0.0)
    found[found <= NEGLIGIBLE * max(1.0, float(np.abs(problem.h).max()))] = 0.0
    return Penalised(problem.point(verified.answer.x[:n]), verified.answer.multipliers[:m], unit * found, verified)
