"""Rows that contradict each other: the least weighted violation, as of a linear program, and then the least cost."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple, cast

import cvxpy
import numpy as np
import pytest
from scipy.optimize import linprog

from vsconstraints.errors import SolverError
from vsconstraints.qp import Answer, SolverChain
from vsconstraints.qp.penalised import Cost, penalised
from vsconstraints.rows import Array, IntArray

DATA = Path(__file__).parent / "data"

NONE = np.empty(0, dtype=np.int64)


class Written(NamedTuple):
    """Rows A x ≤ c that are written down."""

    A: Array
    c: Array
    groups: IntArray

    def excess(self, x: Array) -> Array:
        """See :class:`vsconstraints.qp.penalised.ManyRows`."""
        over: Array = self.A @ x - self.c
        return over

    def stated(self, which: IntArray) -> tuple[IntArray, Array]:
        """See :class:`vsconstraints.qp.penalised.ManyRows`."""
        which = which[self.A[which].any(axis=1)]
        return which, self.A[which]

    def of(self, which: IntArray) -> IntArray:
        """See :class:`vsconstraints.qp.penalised.ManyRows`."""
        return self.groups[which]


def least_violation(rows: Written, weights: Array) -> float:
    """Σ wᵢ sᵢ by linear programming."""
    n, g = rows.A.shape[1], len(weights)
    # by steps that move rows alike: the program's tolerance is absolute
    size = np.where(rows.groups < 0, 1.0 / np.linalg.norm(rows.A, axis=1), weights[rows.groups])
    S = np.eye(g + 1)[rows.groups, :g] / np.append(weights, 1.0)[rows.groups][:, None]
    found = linprog(
        np.append(np.zeros(n), np.ones(g)),
        np.hstack([rows.A, -S]) * size[:, None],
        rows.c * size,
        bounds=[(None, None)] * n + [(0.0, None)] * g,
    )
    assert found.status == 0
    return float(found.fun)


def nearest(cost: Cost, rows: Written, weights: Array, violation: float) -> Array:
    """The point of least cost with that violation, by an interior-point method."""
    x, s = cvxpy.Variable(len(cost.center)), cvxpy.Variable(len(weights) + 1)
    asked = [rows.A @ x <= rows.c + s[rows.groups], s >= 0, s[-1] == 0, np.append(weights, 0.0) @ s <= violation]
    problem = cvxpy.Problem(cvxpy.Minimize(cvxpy.sum_squares(cost.L.T @ (x - cost.center))), asked)
    problem.solve(solver="CLARABEL")
    assert problem.status == "optimal"
    point: Array = x.value
    return point


def contradicting(seed: int) -> tuple[Cost, Written, Array]:
    """Rows in groups, some of which demand the opposite of others, and a box that is hard."""
    rng, n, m, g = np.random.default_rng(seed), 5, 16, 6
    A = rng.normal(size=(m, n))
    A[m // 2 :] = -A[: m // 2] + 0.1 * rng.normal(size=(m // 2, n))
    c = rng.normal(size=m)
    A, c = np.vstack([A, np.eye(n), -np.eye(n)]), np.append(c, np.full(2 * n, 3.0))
    groups = np.append(rng.integers(0, g, m), np.full(2 * n, -1))
    factor = 10.0 ** rng.uniform(-2.0, 2.0, g)
    A[:m], c[:m] = A[:m] * factor[groups[:m]][:, None], c[:m] * factor[groups[:m]]
    L = np.tril(rng.normal(size=(n, n))) + 3.0 * np.eye(n)
    return Cost(rng.normal(size=n), L), Written(A, c, groups), rng.uniform(0.5, 2.0, g) / factor


@pytest.mark.parametrize("seed", range(12))
def test_first_the_least_violation_then_the_least_cost(seed: int) -> None:
    cost, rows, weights = contradicting(seed)
    found = penalised(cost, rows, weights, SolverChain("daqp"), NONE)
    least = least_violation(rows, weights)
    assert least > 0.1
    assert weights @ found.slack == pytest.approx(least, rel=1e-8)
    assert (
        rows.excess(found.x) <= np.append(found.slack, 0.0)[rows.groups] + 1e-8 / np.append(weights, 1.0)[rows.groups]
    ).all()
    np.testing.assert_allclose(found.x, nearest(cost, rows, weights, least * (1.0 + 1e-9)), atol=1e-4)


@pytest.mark.parametrize("number", [0, 1])
def test_samples_of_an_arm_that_swings(number: int) -> None:
    """Norms of rows are up to 1e9 apart: the arm of a plan almost turns its camera away."""
    with np.load(DATA / "swinging_arm.npz") as stored:
        G, h, groups = (stored[f"{name}{number}"] for name in ("G", "h", "groups"))
    rows, n = Written(G.astype(np.float64), h, groups.astype(np.int64)), G.shape[1]
    weights = np.ones(groups.max() + 1)
    chain = SolverChain("daqp")
    found = penalised(Cost(np.zeros(n), np.eye(n)), rows, weights, chain, NONE)
    assert found.slack.sum() == pytest.approx(least_violation(rows, weights), rel=1e-6)
    assert found.verified is not None
    assert (found.verified.solver, found.verified.fallback) == ("daqp", "")
    # few rows decide
    assert len(found.rows) < len(h)


def test_rows_without_a_bound_are_not_asked_though_they_held_before() -> None:
    rows = Written(np.eye(2), np.array([np.inf, -1.0]), np.array([0, 1]))
    found = penalised(Cost(np.zeros(2), np.eye(2)), rows, np.ones(2), SolverChain("daqp"), np.array([0, 7]))
    np.testing.assert_allclose(found.x, [0.0, -1.0])


def test_an_answer_that_costs_more_than_need_be_is_refused() -> None:
    cost, rows, weights = contradicting(0)

    class Near:
        """DAQP, but for a thousandth of the unit of slacks."""

        name, recognises_infeasibility = "near", True

        def solve(self, P: Array, q: Array, G: Array, h: Array) -> Answer:
            answer = SolverChain("daqp").preferred.solve(P, q, G, h)
            return Answer(answer.x + 1e-3, answer.multipliers, 1)

    chain: Any = SolverChain("daqp")
    chain.preferred = Near()
    with pytest.raises(SolverError, match="near may cost"):
        penalised(cost, rows, weights, cast(SolverChain, chain), NONE)
