"""Arms with more joints than the task needs, compiled: what the rows leave of the task loses ranks
by construction.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from test_kernels import agree, agree_hierarchy, conditioned
from vsconstraints import compiled as kernels
from vsconstraints.controllers import HierarchicalQP, PotentialField, SlidingMode, Tracking
from vsconstraints.rows import Rows, Task

TOLERANCE = 1e-6
LAWS = (SlidingMode(), PotentialField(blend="priority"), PotentialField(), Tracking())


def rows_of(A, rng, phi=0.1):
    """Rows with these gradients, all of the same φ."""
    m = len(A)
    labels = tuple(f"row[{i}]" for i in range(m))
    return Rows(
        np.full(m, phi), np.ascontiguousarray(A), np.zeros(m), rng.uniform(0.5, 2.0, m), labels
    )


def orthonormal(rng, k, n):
    """(k, n), k ≤ n, with orthonormal rows."""
    return np.ascontiguousarray(np.linalg.qr(rng.normal(size=(n, k)))[0].T)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.name} {getattr(law, 'blend', '')}")
@pytest.mark.parametrize(("n", "k"), [(7, 6), (12, 6), (12, 24), (30, 6), (30, 24), (30, 40)])
def test_rows_within_the_span_of_the_task(law, n, k):
    """As rows on the camera's pose are within that of a task on it: of 6 ranks, A₂Z keeps 6 − b."""
    rng = np.random.default_rng(n + k)
    for b in (1, 3, 5, 6):
        pose = conditioned(rng, 6, n)
        task = Task(conditioned(rng, k, 6) @ pose, rng.normal(size=k))
        assert agree(law, rows_of(conditioned(rng, b, 6) @ pose, rng), task)


@pytest.mark.parametrize("n", [7, 12, 30])
@pytest.mark.parametrize("k", [4, 9, 40])
@pytest.mark.parametrize("share", [1e-13, 1e-9, 1e-7, 0.05, 0.3, 0.9, 1.1, 3.0, 20.0, 1e3])
def test_the_cut_of_what_rows_leave_of_the_task_is_relative_to_the_whole_task(n, k, share):
    """The least singular value of A₂Z is that share of tolerance · σ₁(A₂), and all of A₂Z is
    small.
    """
    rng = np.random.default_rng(k)
    for b, size in ((1, 1.0), (3, 1e-2)):
        frame = orthonormal(rng, n, n)
        A1 = conditioned(rng, b, b) @ frame[:b]
        Z = frame[b:]
        ranks = min(k, n - b)
        A2 = rng.normal(size=(k, b)) @ frame[:b]
        U = orthonormal(rng, ranks, k)
        V = orthonormal(rng, ranks, n - b)
        gains = size * rng.uniform(0.3, 1.0, ranks)
        gains[-1] = 0.0
        whole = np.linalg.norm(A2 + (U.T * gains) @ V @ Z, 2)
        gains[-1] = share * TOLERANCE * whole
        task = Task(A2 + (U.T * gains) @ V @ Z, rng.normal(size=k))
        assert agree(SlidingMode(rank_tolerance=TOLERANCE), rows_of(A1, rng), task)


@pytest.mark.parametrize("n", [7, 12, 30])
@pytest.mark.parametrize("share", [0.0, 1e-10, 1e-7, 0.9, 1.1, 100.0])
def test_rows_that_nearly_depend_on_each_other(n, share):
    rng = np.random.default_rng(n)
    U = orthonormal(rng, 5, 5)
    V = orthonormal(rng, 5, n)
    A = (U * np.array([1.0, 0.8, 0.6, 0.4, share * TOLERANCE])) @ V
    task = Task(conditioned(rng, 6, n), rng.normal(size=6))
    # what counts is how far rows of unit length are from depending on each other
    gains = np.linalg.svd(A / np.linalg.norm(A, axis=1)[:, None], compute_uv=False)
    tolerance = gains[-1] / gains[0] / share if share > 0.5 else TOLERANCE
    field = PotentialField(blend="priority", rank_tolerance=tolerance)
    # before the boundary a dependence is met in the least-squares sense, at it the definition has a
    # name for it
    assert agree(field, rows_of(A, rng, phi=-0.3), task)
    for law in (field, SlidingMode(rank_tolerance=tolerance)):
        assert agree(law, rows_of(A, rng), task) == (share > 1.0)


@pytest.mark.parametrize("n", [7, 12])
@pytest.mark.parametrize(
    "law", [SlidingMode(), PotentialField(blend="priority")], ids=lambda law: law.name
)
def test_units_of_rows_decide_nothing(law, n):
    """Whether rows depend on each other is the same in any units."""
    rng = np.random.default_rng(n)
    A = conditioned(rng, 4, n)
    units = np.array([1e4, 1e-3, 1.0, 1e-9])[:, None]
    task = Task(conditioned(rng, 6, n), rng.normal(size=6))
    assert agree(law, rows_of(A * units, rng), task)
    A[3] = A[0] - 2.0 * A[1]
    assert not agree(law, rows_of(A * units, rng), task)
    unseen = np.concatenate((A[:3], 1e-13 * rng.normal(size=(1, n))))
    assert not agree(law, rows_of(unseen, rng), task)


@pytest.mark.parametrize("n", [7, 12, 30])
@pytest.mark.parametrize("bound", [None, 10.0])
def test_the_hierarchy_of_redundant_arms(n, bound):
    rng = np.random.default_rng(n)
    law = HierarchicalQP(rows="active", max_acceleration=bound)
    relaxed = 0
    for _ in range(20):
        A = conditioned(rng, 5, n)
        if rng.random() < 0.5:
            A[1] = -A[0]  # contradictory
        pose = conditioned(rng, 3, n)
        task = Task(conditioned(rng, 6, 3) @ pose, rng.normal(size=6))
        rows = rows_of(A, rng)
        agree_hierarchy(law, rows, task)
        relaxed += law.command(rows, task).status == "relaxed"
    assert 0 < relaxed < 20


@cache
def compiled_pseudoinverse():
    """Return the compiled pseudoinverse as a function of W, the tolerance and Y."""
    inner = kernels.load("least_squares").pseudoinverse
    start = kernels.load("linear").START
    none = kernels.load("scratch").no_scratch
    return kernels.load("compiler").numba.njit(
        lambda W, cut, Y: inner(W, start, 30.0 * cut, cut, W, Y, start, none())
    )


@pytest.mark.parametrize(
    ("k", "n", "rank"), [(3, 30, 3), (6, 12, 4), (12, 6, 4), (9, 9, 9), (9, 9, 5), (40, 7, 7)]
)
def test_the_pseudoinverse_keeps_the_singular_values_above_the_tolerance(k, n, rank):
    solve = compiled_pseudoinverse()
    rng = np.random.default_rng(0)
    c = min(k, n)
    for cut in (1e-6, 1e-2):
        gains = rng.uniform(1.5 * cut, 1.0, c)
        gains[0] = 1.0
        gains[rank:] *= 0.5 * cut / gains[rank:] if rank < c else 1.0
        M = (orthonormal(rng, c, k).T * gains) @ orthonormal(rng, c, n)
        b = rng.normal(size=k)
        W = np.column_stack((M, b))
        Y = np.zeros((1, n))
        qr, found, _ = solve(W, cut, Y)
        assert found == rank
        expected = np.linalg.pinv(M, rcond=cut) @ b
        np.testing.assert_allclose(Y[0], expected, atol=1e-9 * np.linalg.norm(expected))
        # what is left of W has the same Gram matrix, without what was cut
        _, s, Vt = np.linalg.svd(M, full_matrices=False)
        gram = (Vt.T * np.where(s > cut, s, 0.0) ** 2) @ Vt
        left = W[:, :n].T @ W[:, :n]
        np.testing.assert_allclose(left / np.trace(left), gram / np.trace(gram), atol=1e-13)
        if rank < n:
            # the reflections turn the rest of the unit vectors into a basis of the null space
            Z = np.eye(n)[rank:]
            for j in reversed(range(rank)):
                v = np.concatenate((np.zeros(j), qr.columns[j, j:]))
                Z -= qr.scalars[1, j] * np.outer(Z @ v, v)
            np.testing.assert_allclose(Z @ Vt[:rank].T, 0.0, atol=1e-9)


class Stages:
    """Stages of the hierarchy on three joints and a task of one, recorded in order.

    Every level has work to do: x₂ ≤ −1 and x₂ ≥ 1 contradict each other, x₁ + x₂ + x₃ ≤ −2 is in
    the way of the task x₁ = 3, and the damping increases the residual of the task.
    """

    def __init__(self, monkeypatch, last_code=None):
        self.module = kernels.load("hierarchy")
        self.solve_stage = self.module.solve_stage
        self.calls = []
        self.last_code = last_code
        monkeypatch.setattr(self.module, "solve_stage", self.record)

    def record(self, *arguments):
        code, steps = self.solve_stage(*arguments)
        self.calls.append((code, steps))
        separate = self.last_code is not None and len(self.calls) == 3
        return (self.last_code, 0) if separate else (code, steps)

    def solve(self):
        walls = kernels.load("walls")
        none = kernels.load("scratch").no_scratch()
        A = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [1.0, 1.0, 1.0]])
        c = np.array([-1.0, -1.0, -2.0])
        demands = walls.Demands(A, c, np.ones(3), np.ones(3))
        resolved = walls.Resolved(np.zeros(3), np.zeros(3), np.zeros(3, dtype=np.bool_))
        J = np.array([[1.0, 0.0, 0.0]])
        aim = self.module.aim_at_task(J, np.array([3.0]), np.empty(0), TOLERANCE, none)
        box = np.array([np.full(3, -np.inf), np.full(3, np.inf)])
        priorities = self.module.Priorities(box, 1e-2, TOLERANCE, True)
        with np.errstate(all="ignore"):  # as compiled
            code, iterations = self.module.hierarchy(demands, aim, priorities, resolved, none)
        return code, iterations, resolved.qdd


def test_iterations_of_all_stages_add_up(monkeypatch):
    stages = Stages(monkeypatch)
    code, iterations, qdd = stages.solve()
    assert code == kernels.load("codes").RELAXED_ROWS
    np.testing.assert_allclose(qdd, [3.0, 0.0, -5.0], atol=1e-9)
    steps = [added for _, added in stages.calls]
    assert len(steps) == 3
    assert min(steps[:2]) > 0
    assert iterations == sum(steps)


def test_a_last_stage_without_numbers_keeps_the_answer_of_the_task(monkeypatch):
    stages = Stages(monkeypatch, kernels.load("hierarchy").NO_ANSWER)
    code, _, qdd = stages.solve()
    assert code == kernels.load("codes").RELAXED_SHORT
    assert len(stages.calls) == 3
    # rows and task, but not the least acceleration
    np.testing.assert_allclose(qdd[:2], [3.0, 0.0], atol=1e-9)
    assert qdd[2] <= -5.0 + 1e-9
