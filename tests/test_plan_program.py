"""The program of a plan, against a dense one of the same numbers and against linear programming."""

from __future__ import annotations

import numpy as np
import pytest
from qpsolvers import solve_qp
from scipy.optimize import linprog

from vsconstraints.compiled.codes import RELAXED_ROWS, SOLVED
from vsconstraints.compiled.least_distance import FORCE
from vsconstraints.compiled.memory import zeros
from vsconstraints.prediction.kernels import plan_program
from vsconstraints.prediction.kernels.plan_arrays import Cost, Factor, Limits, Space, lengths_of
from vsconstraints.prediction.kernels.plan_search import most_negative_force
from vsconstraints.rows import Array

T = 0.05
PERIOD = 0.01


class Problem:
    """A random program of H blocks for n joints and m rows, one of them on φ itself, and its dense
    matrices.

    Without any acceleration rows begin at about ``value`` and rise from instant to instant; |q̈| is
    at most ``most``. The first row is ``steep`` times as large, and its shares as much smaller, as
    the program is told.
    """

    def __init__(self, seed: int, value: float, most: float, steep: float = 1.0) -> None:
        H = 4
        n = 3
        m = 5
        rng = np.random.default_rng(seed)
        J = rng.normal(size=(H, 4, n))
        b = 5.0 * rng.normal(size=(H, 4))
        gains = rng.uniform(1.0, 5.0, (H, 2))
        rest = rng.uniform(0.0, 3.0, (H, 2))
        free = rng.normal(size=(H, n))
        self.cost = Cost(
            T,
            0.01,
            gains,
            rest,
            np.einsum("hki,hkj->hij", J, J),
            np.einsum("hki,hk->hi", J, b),
            free,
        )
        block = np.array([0, 0, *range(H), H])
        since = np.array([0.0, PERIOD, *[T] * H, 0.0])
        N = len(block)
        stop = 0.3
        values = np.cumsum(rng.uniform(-0.005, 0.005, (N, m)), axis=0) + value * rng.uniform(
            0.5, 1.5, m
        )
        gradient = rng.normal(size=(N, m, n))
        by_speed = np.array([*[0] * (m - 1), 1])
        falls = np.array([*rng.uniform(0.7, 0.95, N - 2), 0.0])
        left = np.zeros((N - 1, m))
        left[-1, by_speed > 0] = np.inf
        scale = rng.uniform(0.5, 2.0, m)
        self.weights = rng.uniform(0.5, 2.0, m)
        low = -most * rng.uniform(0.5, 1.0, (H, n))
        high = most * rng.uniform(0.5, 1.0, (H, n))
        share = rng.uniform(0.2, 1.0, (N - 1, m))
        larger = np.array([steep, *[1.0] * (m - 1)])
        rows = values * larger, gradient * larger[:, None], by_speed, falls, left, share / larger
        self.limits = Limits(N, block, since, stop, *rows, scale, low, high)
        lengths = lengths_of(H, N, n, m)
        self.factor = zeros(Factor, lengths)
        self.space = zeros(Space, lengths, {"p": lengths["p"]})
        self.code, self.active = plan_program.plan_best(
            self.cost, self.factor, self.limits, self.space, self.weights
        )
        # how q and q̇ at each instant change with the plan
        eye = np.eye(n)
        Q = np.zeros((N, n, H, n))
        V = np.zeros((N, n, H, n))
        ends = T * np.arange(H + 1)
        for t in range(1, N - 1):
            now = ends[block[t]] + since[t]
            for k in range(H):
                within = np.clip(now - ends[k], 0.0, T)
                V[t, :, k] = within * eye
                Q[t, :, k] = within * (now - ends[k] - 0.5 * within) * eye
        Q[-1] = Q[-2] + 0.5 * stop * V[-2]
        size = H * n
        rows = np.einsum("tmi,tij->tmj", gradient, Q.reshape(N, n, size))
        rows[:, by_speed > 0] = np.einsum("tmi,tij->tmj", gradient, V.reshape(N, n, size))[
            :, by_speed > 0
        ]
        G = rows[1:] - falls[:, None, None] * rows[:-1]
        h = left - values[1:] + falls[:, None] * values[:-1]
        bounded = np.isfinite(h)
        G = share[:, :, None] * G
        h = share * h
        self.G = G[bounded]
        self.h = h[bounded]
        self.row = np.tile(np.arange(m), (N - 1, 1))[bounded]
        begins = np.array([0, *range(2, H + 1)])
        residuals = []
        sides = []
        for k, t in enumerate(begins):
            own = np.zeros((n, H, n))
            own[:, k] = eye
            task = own + gains[k, 0] * Q[t] + gains[k, 1] * V[t]
            still = own + rest[k, 0] * Q[t] + rest[k, 1] * V[t]
            residuals += [J[k] @ task.reshape(n, size), 0.1 * still.reshape(n, size)]
            sides += [b[k], 0.1 * free[k]]
        self.M = np.vstack(residuals)
        self.y = np.concatenate(sides)

    @property
    def u(self) -> Array:
        """The plan that was found."""
        return self.space.u.ravel()

    @property
    def box(self) -> tuple[Array, Array]:
        """Of the plan."""
        return self.limits.low.ravel(), self.limits.high.ravel()


@pytest.mark.parametrize("seed", range(60))
def test_plans_are_those_of_a_dense_program(seed: int) -> None:
    problem = Problem(seed, value=-0.3, most=20.0 / (1.0 + seed % 8))
    P = problem.M.T @ problem.M
    q = -problem.M.T @ problem.y
    low, high = problem.box
    best = solve_qp(P, q, problem.G, problem.h, lb=low, ub=high, solver="quadprog")
    assert problem.code == SOLVED
    np.testing.assert_allclose(problem.u, best, atol=1e-9 * max(1.0, np.abs(best).max()))
    assert not problem.space.slack.any()


@pytest.mark.parametrize("value", [-0.3, 0.1])
def test_a_row_beyond_all_rounding_is_as_good_as_any(value: float) -> None:
    """As of a marker far outside the image; with slacks and without."""
    for seed in range(20):
        usual, steep = (Problem(seed, value, 2.0, factor) for factor in (1.0, 1e12))
        assert steep.code == usual.code
        np.testing.assert_allclose(steep.u, usual.u, atol=1e-5 * np.abs(usual.u).max())
        np.testing.assert_allclose(steep.space.slack, usual.space.slack, atol=1e-5)


def test_some_programs_have_no_rows_in_the_way_and_some_many() -> None:
    active = [Problem(seed, value=-0.3, most=20.0 / (1.0 + seed % 8)).active for seed in range(60)]
    assert min(active) <= 2
    assert max(active) >= 8


@pytest.mark.parametrize("seed", range(40))
def test_rows_that_contradict_each_other_are_violated_least(seed: int) -> None:
    """Σ wᵢ sᵢ / scaleᵢ is that of a linear program, and rows are exceeded by no more than their
    slack.
    """
    problem = Problem(seed, value=0.1, most=0.5)
    price = problem.weights / problem.limits.scale
    m = len(problem.weights)
    size = len(problem.u)
    A = np.hstack((problem.G, -np.eye(m)[problem.row]))
    bounds = [*zip(*problem.box, strict=True), *[(0.0, None)] * m]
    least = linprog(np.append(np.zeros(size), price), A, problem.h, bounds=bounds).fun
    slack = problem.space.slack
    assert problem.code == (RELAXED_ROWS if least > 1e-9 else SOLVED)
    assert price @ slack == pytest.approx(least, rel=1e-3, abs=1e-6)
    assert (problem.G @ problem.u - problem.h - slack[problem.row]).max() < 1e-5
    # with slacks, rows and bounds are met up to a millionth of their scale; commands are brought
    # into the box behind it
    low, high = problem.box
    beyond = np.maximum(problem.u - high, low - problem.u) / (high - low)
    assert beyond.max() <= 1.1e-6


def test_a_plan_after_a_relaxed_one_is_that_of_new_arrays() -> None:
    """The search with slacks has more unknowns in the same arrays."""
    for seed in range(20):
        before = Problem(seed, value=0.5, most=0.5)
        assert before.code == RELAXED_ROWS
        problem = Problem(seed, value=-0.3, most=20.0 / (1.0 + seed % 8))
        code, active = plan_program.plan_best(
            problem.cost, problem.factor, problem.limits, before.space, problem.weights
        )
        assert (code, active) == (SOLVED, problem.active)
        np.testing.assert_allclose(before.u, problem.u, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_the_penalty_is_relative_to_distances_and_gradients_in_the_metric_of_the_cost(
    seed: int,
) -> None:
    problem = Problem(seed, value=0.1, most=2.0)
    distance, mean_gradient = plan_program.measure_excess(
        problem.cost, problem.factor, problem.limits, problem.space, problem.weights
    )
    P = problem.M.T @ problem.M
    over = problem.G @ problem.u - problem.h
    exceeded = over > 0.0
    lengths = np.sqrt((problem.G * np.linalg.solve(P, problem.G.T).T).sum(axis=1))
    price = (problem.weights / problem.limits.scale)[problem.row]
    assert exceeded.sum() > 1
    assert distance == pytest.approx((over / lengths)[exceeded].max(), rel=1e-9)
    logarithms = np.log(lengths * price)[exceeded]
    assert mean_gradient == pytest.approx(np.exp(logarithms.mean()), rel=1e-9)


def test_the_least_force_is_that_of_an_active_row() -> None:
    """What stands behind the active rows is of earlier ones."""
    X = np.zeros((FORCE + 1, 4))
    X[FORCE] = 3.0, 1.0, 2.0, -5.0
    assert most_negative_force(X, 3) == 1
