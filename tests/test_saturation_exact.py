"""Exact saturation in the null space against a linear and a quadratic program by others, and by
hand.
"""

from __future__ import annotations

import cvxpy
import numpy as np
import pytest
from scipy.optimize import linprog

from test_resolvers import FORMS, answer, rows_that_ask
from vsconstraints.controllers import Hierarchy, Saturation, SaturationExact
from vsconstraints.rows import Array, Task

TIGHT = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


def oracle(
    A: Array, c: Array, J: Array, b: Array, most: float, rest: Array
) -> tuple[float, Array] | None:
    """The largest s by a linear program (HiGHS), then the q̈ nearest to q̈₀ by a quadratic one
    (Clarabel).
    """
    n = A.shape[1]
    k = len(b)
    along = J @ np.linalg.pinv(J) @ b
    equal = np.column_stack((J, -along))
    sides = [(-most, most)] * n + [(0.0, 1.0)]
    found = linprog(
        np.append(np.zeros(n), -1.0), np.column_stack((A, np.zeros(len(A)))), c, equal, np.zeros(k), sides,
        options=TIGHT,
    )  # fmt: skip
    if found.status != 0:
        return None
    s = float(found.x[-1])
    x = cvxpy.Variable(n)
    asked = [A @ x <= c + 1e-9, cvxpy.abs(x) <= most, cvxpy.abs(J @ x - s * along) <= 1e-9]
    cvxpy.Problem(cvxpy.Minimize(cvxpy.sum_squares(x - rest)), asked).solve(solver="CLARABEL")
    return s, np.asarray(x.value)


@FORMS
@pytest.mark.parametrize(
    ("n", "k", "m", "most"), [(7, 3, 8, 1e3), (6, 3, 12, 2.0), (4, 2, 3, 1.0), (5, 5, 6, 1e3)]
)
def test_it_is_the_largest_scale_and_then_the_least_norm(
    form: str, n: int, k: int, m: int, most: float
) -> None:
    rng = np.random.default_rng(n)
    compared = 0
    less = 0
    for case in range(80):
        A = rng.normal(size=(m, n))
        c = rng.uniform(-0.05, 0.5, m)
        J = rng.normal(size=(k, n))
        b = 2.0 * rng.normal(size=k)
        if case % 6 == 0 and k > 1:
            J[1] = 2.0 * J[0]
        rest = rng.normal(size=n) * (case % 2)
        rows = rows_that_ask(A, c)
        task = Task(J, b, rest=rest)
        found = oracle(A, c, J, b, most, rest)
        command = answer(SaturationExact(max_acceleration=most), rows, task, form)
        if found is None:
            other = answer(Hierarchy(max_acceleration=most), rows, task, form)
            np.testing.assert_array_equal(command.qdd, other.qdd)
            continue
        compared += 1
        s, qdd = found
        along = J @ np.linalg.pinv(J) @ b
        assert command.status == "ok"
        assert (A @ command.qdd <= c + 1e-9 * (1.0 + np.abs(command.qdd).max())).all()
        assert np.abs(command.qdd).max() <= most
        np.testing.assert_allclose(
            J @ command.qdd, s * along, atol=3e-6 * (1.0 + np.linalg.norm(b))
        )
        assert (
            np.linalg.norm(command.qdd - rest) <= np.linalg.norm(qdd - rest) * (1.0 + 1e-4) + 1e-5
        )
        greedy = answer(Saturation(max_acceleration=most), rows, task, form)
        kept = (
            np.abs(J @ greedy.qdd - (along @ (J @ greedy.qdd)) / (along @ along) * along).max()
            < 1e-6
        )
        share = float(along @ (J @ greedy.qdd) / (along @ along))
        less += kept and share < s - 1e-6
    assert compared >= 55
    # what lets nothing go is not it, where there is a choice
    assert less >= 3 or n == k


@FORMS
def test_three_joints_that_move_one_point(form: str) -> None:
    task = Task(np.array([[1.0, 1.0, 1.0]]), np.array([3.0]))
    found = answer(SaturationExact(), rows_that_ask(np.eye(3)[:1], [-1.0]), task, form)
    np.testing.assert_allclose(found.qdd, [-1.0, 2.0, 2.0], atol=1e-9)
    assert found.active == ("row[0]",)
    # all three are at their ends: two thirds of the task
    found = answer(SaturationExact(), rows_that_ask(np.eye(3), [0.5, 0.5, 1.0]), task, form)
    np.testing.assert_allclose(found.qdd, [0.5, 0.5, 1.0], atol=1e-9)
    # nothing resists
    found = answer(SaturationExact(), rows_that_ask(np.eye(3), [1.5, 1.5, 1.5]), task, form)
    np.testing.assert_allclose(found.qdd, [1.0, 1.0, 1.0], atol=1e-12)
    assert found.active == ()


@FORMS
def test_a_task_that_asks_for_nothing_leaves_the_null_space_to_rows(form: str) -> None:
    task = Task(np.array([[1.0, 1.0]]), np.zeros(1))
    found = answer(SaturationExact(), rows_that_ask([[1.0, 0.0]], [-1.0]), task, form)
    np.testing.assert_allclose(found.qdd, [-1.0, 1.0], atol=1e-9)


@FORMS
def test_the_task_is_neither_enlarged_nor_turned_round(form: str) -> None:
    """Rows that only s = 2 or s = −1 would meet: the hierarchy answers, which meets them and the
    rest of the task.
    """
    task = Task(np.eye(2), np.ones(2))
    for rows, expected in (
        (rows_that_ask([[-1.0, 0.0]], [-2.0]), [2.0, 1.0]),
        (rows_that_ask([[1.0, 0.0]], [-1.0]), [-1.0, 1.0]),
    ):
        np.testing.assert_allclose(
            answer(SaturationExact(), rows, task, form).qdd, expected, atol=1e-7
        )
