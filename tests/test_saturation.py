"""Saturation in the null space against its formula, against what cannot be better, and by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from test_laws import problem
from test_resolvers import FORMS, answer, rows_that_ask
from vsconstraints.controllers import Barrier, Hierarchy, Priority, Saturation, Scaling
from vsconstraints.errors import ConfigurationError
from vsconstraints.rows import Array, Rows, Task


def formula(A: Array, c: Array, task: Task, s: float) -> Array:
    """q̈(s) of the rows that are saturated, by pseudoinverses as it is written."""
    n = task.J.shape[1]
    A_inverse = np.linalg.pinv(A) if len(A) else np.zeros((n, 0))
    held = A_inverse @ c
    projected = task.J @ (np.eye(n) - A_inverse @ A)
    cut = 1e-9 * np.linalg.norm(task.J) / max(np.linalg.norm(projected, 2), 1e-300)
    rest = (
        np.zeros(n)
        if cut >= 1.0
        else np.linalg.pinv(projected, rcond=cut) @ (s * task.b - task.J @ held)
    )
    return np.asarray(held + rest)


def exceeds(rows: Rows, qdd: Array, room: float = 1e-9) -> bool:
    return bool((rows.Lg @ qdd > -rows.phi + room * (1.0 + np.abs(qdd).max())).any())


@FORMS
@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 5), k=st.integers(1, 5), m=st.integers(1, 8))
def test_what_is_saturated_is_held_and_the_task_has_what_is_left(
    form: str, seed: int, n: int, k: int, m: int
) -> None:
    rng = np.random.default_rng(seed)
    task = Task(rng.normal(size=(k, n)), rng.normal(size=k))
    rows = rows_that_ask(rng.normal(size=(m, n)), rng.uniform(0.05, 0.5, m))
    found = answer(Saturation(scales=False), rows, task, form)
    assert found.status == "ok"
    assert not exceeds(rows, found.qdd)
    np.testing.assert_array_equal(found.slack, 0.0)
    A = rows.Lg[found.acted]
    c = -rows.phi[found.acted]
    np.testing.assert_allclose(A @ found.qdd, c, atol=1e-8 * (1.0 + np.abs(found.qdd).max()))
    none = formula(A, c, task, 0.0)
    whole = formula(A, c, task, 1.0)
    way = whole - none
    s = float(way @ (found.qdd - none) / (way @ way)) if way @ way > 1e-20 else 1.0
    assert -1e-7 <= s <= 1.0 + 1e-7
    np.testing.assert_allclose(found.qdd, none + s * way, atol=1e-6 * (1.0 + np.abs(whole).max()))
    # zero meets all demands, and so nothing has to be scaled
    np.testing.assert_allclose(s, 1.0, atol=1e-6)
    # no law that keeps the rows meets the task better than the hierarchy does, but for what its
    # damping takes
    best = answer(Hierarchy(), rows, task)
    cost, least = (np.linalg.norm(task.J @ qdd - task.b) for qdd in (found.qdd, best.qdd))
    assert cost >= least - 1e-3 * (1.0 + least)


@FORMS
def test_one_row_is_held_as_by_priority_and_by_the_hierarchy(form: str) -> None:
    for seed in range(20):
        rows, task = problem(seed, m=1)
        rows = rows_that_ask(rows.Lg, rows.Lg @ np.linalg.solve(task.J, task.b) - 0.5)
        saturated = answer(Saturation(scales=False), rows, task, form)
        assert saturated.active == ("row[0]",)
        # the least ‖J x − b‖ with a x = c, by its optimality conditions
        a = rows.Lg
        c = -rows.phi
        conditions = np.block([[task.J.T @ task.J, a.T], [a, np.zeros((1, 1))]])
        expected = np.linalg.solve(conditions, np.concatenate((task.J.T @ task.b, c)))[:6]
        size = 1.0 + np.abs(expected).max()
        np.testing.assert_allclose(saturated.qdd, expected, atol=1e-6 * size)
        for other in (Priority(), Hierarchy()):
            np.testing.assert_allclose(
                saturated.qdd, answer(other, rows, task, form).qdd, atol=1e-5 * size
            )


@FORMS
def test_it_is_the_hierarchy_wherever_that_holds_the_same_rows(form: str) -> None:
    alike = 0
    for seed in range(100):
        rows, task = problem(seed, k=6 if seed % 2 else 3)
        resolvers = Saturation(scales=False), Hierarchy(damping=1e-10)
        one, other = (answer(resolver, rows, task, form, Barrier()) for resolver in resolvers)
        if one.active == other.active:
            alike += 1
            np.testing.assert_allclose(
                one.qdd, other.qdd, atol=1e-5 * (1.0 + np.abs(other.qdd).max())
            )
    assert alike >= 60


@FORMS
def test_joints_are_saturated_one_after_another(form: str) -> None:
    """Three joints in a row that move one point: the others take over, until all are at their
    ends.
    """
    J = np.ones((1, 3))

    def found(b: float, c: list[float]) -> tuple[list[float], tuple[str, ...]]:
        command = answer(
            Saturation(scales=False), rows_that_ask(np.eye(3), c), Task(J, np.array([b])), form
        )
        assert command.status == "ok"
        return [round(value, 9) for value in command.qdd], command.active

    assert found(3.0, [2.0, 2.0, 2.0]) == ([1.0, 1.0, 1.0], ())
    assert found(3.0, [0.5, 2.0, 2.0]) == ([0.5, 1.25, 1.25], ("row[0]",))
    assert found(3.0, [0.5, 1.0, 2.0]) == ([0.5, 1.0, 1.5], ("row[0]", "row[1]"))
    assert found(3.0, [0.8, 0.8, 0.8])[0] == [0.8, 0.8, 0.8]
    boxed = answer(
        Saturation(scales=False, max_acceleration=1.1),
        rows_that_ask(np.eye(3)[:1], [0.5]),
        Task(J, np.array([3.0])),
        form,
    )
    np.testing.assert_allclose(boxed.qdd, [0.5, 1.1, 1.1], atol=1e-12)
    assert boxed.active == ("row[0]",)


@FORMS
def test_as_published_the_task_keeps_its_direction(form: str) -> None:
    task = Task(np.eye(2), np.array([4.0, 2.0]))
    rows = rows_that_ask([[1.0, 0.0]], [1.0])
    np.testing.assert_allclose(
        answer(Saturation(scales=False), rows, task, form).qdd, [1.0, 2.0], atol=1e-12
    )
    np.testing.assert_allclose(answer(Saturation(), rows, task, form).qdd, [1.0, 0.5], atol=1e-12)
    rng = np.random.default_rng(0)
    scaled = 0
    for _ in range(60):
        A = rng.normal(size=(4, 4))
        c = rng.uniform(0.05, 0.5, 4)
        J = rng.normal(size=(2, 4))
        b = rng.normal(size=2)
        rows = rows_that_ask(A, c)
        found = answer(Saturation(), rows, Task(J, b), form)
        assert found.status == "ok"
        assert not exceeds(rows, found.qdd)
        s = float(b @ (J @ found.qdd) / (b @ b))
        np.testing.assert_allclose(
            J @ found.qdd, s * b, atol=1e-6 * (1.0 + np.abs(found.qdd).max())
        )
        assert s <= 1.0 + 1e-9
        whole = formula(A[found.acted], c[found.acted], Task(J, b), s + 1e-5)
        assert s > 1.0 - 1e-9 or exceeds(rows, whole, 1e-12)
        scaled += s < 1.0 - 1e-9
        # without redundancy nothing can be saturated at all
        task = Task(rng.normal(size=(4, 4)), rng.normal(size=4))
        one, other = (answer(resolver, rows, task, form) for resolver in (Saturation(), Scaling()))
        np.testing.assert_allclose(one.qdd, other.qdd, atol=1e-8 * (1.0 + np.abs(other.qdd).max()))
    assert 5 < scaled < 55


@FORMS
def test_the_direction_of_the_task_is_lost_only_where_that_is_asked_for(form: str) -> None:
    """In 99 problems without redundancy in which tracking exceeds what rows allow."""
    rng = np.random.default_rng(1)
    turned = {True: 0, False: 0}
    tried = 0
    while tried < 99:
        task = Task(rng.normal(size=(5, 5)), rng.normal(size=5))
        rows = rows_that_ask(rng.normal(size=(5, 5)), rng.uniform(0.0, 0.2, 5))
        if not exceeds(rows, np.linalg.solve(task.J, task.b)):
            continue
        tried += 1
        for resolver in (Saturation(), Saturation(scales=False)):
            motion = task.J @ answer(resolver, rows, task, form).qdd
            along = motion @ task.b / (np.linalg.norm(motion) * np.linalg.norm(task.b))
            turned[resolver.scales] += along < 1.0 - 1e-9
    assert turned == {True: 0, False: 99}


@FORMS
def test_where_nothing_can_be_saturated_the_hierarchy_answers(form: str) -> None:
    task = Task(np.eye(2), np.array([3.0, 4.0]))
    rows = rows_that_ask([[1.0, 0.0], [-1.0, 0.0]], [-1.0, -1.0])
    one, other = (
        answer(resolver, rows, task, form) for resolver in (Saturation(scales=False), Hierarchy())
    )
    assert (one.status, one.slacks) == ("relaxed", pytest.approx({"row[0]": 1.0, "row[1]": 1.0}))
    assert "row[0] by 1, row[1] by 1" in one.reason
    np.testing.assert_allclose(one.qdd, other.qdd, atol=1e-9)
    # one that no acceleration influences: met by all, and by none
    still = rows_that_ask([[0.0, 0.0], [1.0, 0.0]], [1.0, 1.0])
    np.testing.assert_allclose(
        answer(Saturation(scales=False), still, task, form).qdd, [1.0, 4.0], atol=1e-12
    )
    still = rows_that_ask([[0.0, 0.0], [1.0, 0.0]], [-1.0, 1.0])
    command = answer(Saturation(scales=False), still, task, form)
    assert command.status == "relaxed"
    assert "no acceleration influences row[0]" in command.reason
    np.testing.assert_allclose(command.qdd, [1.0, 4.0], atol=1e-6)


def test_whether_it_scales_is_checked() -> None:
    nonsense: Any = "yes"
    with pytest.raises(ConfigurationError, match="scales must be true or false, not 'yes'"):
        Saturation(scales=nonsense)
