"""The resolvers filter, scaling and projection against closed forms, oracles and differences; which
are the same.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import oracle
from test_laws import problem
from vsconstraints.compiled import load
from vsconstraints.control import ControlStep
from vsconstraints.controllers import (
    Additive,
    Barrier,
    BoundaryLayer,
    Demand,
    Filter,
    Hierarchy,
    Law,
    Priority,
    Projection,
    RampRepulsion,
    Resolver,
    Saturation,
    SaturationExact,
    Scaling,
    Switch,
    Tracking,
)
from vsconstraints.errors import ConfigurationError, InvalidInput, VsconstraintsError
from vsconstraints.formulas.projection import opening
from vsconstraints.rows import Array, Command, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

compiled = pytest.mark.skipif(load("laws") is None, reason="there is no compiler")
FORMS = pytest.mark.parametrize("form", ["command", "define"])
SHARED = (
    Filter(),
    Filter(metric="task"),
    Scaling(),
    Saturation(scales=False),
    Projection(),
    Saturation(),
    Scaling(max_acceleration=4.0),
    Saturation(max_acceleration=4.0),
    SaturationExact(),
    SaturationExact(max_acceleration=4.0),
)


def rows_that_ask(A: Any, c: Any) -> Rows:
    """Rows of which the barrier with α = 1 asks A q̈ ≤ c."""
    A = np.array(A, dtype=float)
    c = np.array(c, dtype=float)
    return Rows(-c, A, np.zeros(c.size), np.ones(c.size), tuple(f"row[{i}]" for i in range(c.size)))


def answer(
    resolver: Resolver, rows: Rows, task: Task, form: str = "define", demand: Demand | None = None
) -> Command:
    command: Command = getattr(Law(demand or Barrier(1.0), resolver), form)(rows, task)
    return command


def tracked(task: Task) -> Array:
    return np.asarray(np.linalg.lstsq(task.J, task.b, rcond=None)[0])


@compiled
@pytest.mark.parametrize("resolver", SHARED, ids=lambda resolver: resolver.name)
@pytest.mark.parametrize(
    "demand",
    [Barrier(), Switch(), BoundaryLayer(), RampRepulsion()],
    ids=lambda demand: demand.name,
)
def test_a_formula_in_numpy_gives_the_same_command(demand: Demand, resolver: Resolver) -> None:
    answered = 0
    for seed in range(60):
        rows, task = problem(seed, k=6 if seed % 2 else 3)
        one = Law(demand, resolver).define(rows, task)
        other = Law(demand, resolver).compute(rows, task)
        if other is None:
            continue
        answered += 1
        assert (one.status, one.active) == (other.status, other.active)
        np.testing.assert_allclose(
            other.qdd, one.qdd, rtol=0.0, atol=1e-9 * (1.0 + np.linalg.norm(one.qdd))
        )
        if one.slack is not None:
            np.testing.assert_allclose(
                other.slack, one.slack, rtol=0.0, atol=1e-9 * (1.0 + one.slack.max())
            )
    assert answered >= 20


# --- filter ---


@FORMS
@pytest.mark.parametrize("k", [3, 6])
def test_the_metric_of_the_filter_is_what_it_says(form: str, k: int) -> None:
    cp = pytest.importorskip("cvxpy")
    for seed in range(5):
        rows, task = problem(seed, m=4, k=k)
        free = tracked(task)
        size = np.linalg.norm(task.J)
        x = cp.Variable(6)
        cost = cp.sum_squares(task.J @ (x - free) / size) + 1e-2 * cp.sum_squares(x - free)
        cp.Problem(cp.Minimize(cost), [rows.Lg @ x <= -20.0 * rows.phi - rows.Lf]).solve(
            solver="CLARABEL"
        )
        found = answer(Filter(metric="task", damping=1e-2), rows, task, form, Barrier())
        assert found.status == "ok"
        np.testing.assert_allclose(found.qdd, x.value, atol=1e-4 * (1.0 + np.abs(free).max()))


@FORMS
def test_the_damping_leads_from_the_hierarchy_to_the_joint_metric(form: str) -> None:
    for seed in range(20):
        rows, task = problem(seed)
        if np.linalg.cond(task.J) > 50.0:
            continue
        strict, light, heavy, joint = (
            answer(resolver, rows, task, form, Barrier()).qdd
            for resolver in (
                Hierarchy(),
                Filter(metric="task"),
                Filter(metric="task", damping=1e6),
                Filter(),
            )
        )
        size = 1.0 + np.abs(joint).max()
        np.testing.assert_allclose(light, strict, atol=1e-9 * size)
        np.testing.assert_allclose(heavy, joint, atol=1e-4 * size)


def test_in_the_case_study_the_joint_metric_is_late_and_the_task_metric_is_not() -> None:
    scenario = Scenario.load("case-study-6r")

    def run(metric: Any, more: float = 0.0) -> Any:
        longer = scenario.with_override("duration", scenario.tables["duration"] + more)
        return simulate(longer.setup(), Law(Barrier(), Filter(metric=metric)))

    assert run("task").status == "converged"
    late = run("joint")
    assert late.status == "slow"
    assert "2.92 mm and 5.27 mrad" in late.reason
    assert run("joint", 2.0).status == "converged"


def test_a_metric_that_there_is_not_is_refused() -> None:
    nonsense: Any = "euclid"
    with pytest.raises(VsconstraintsError, match=r"unknown metric 'euclid'.*joint, task"):
        Filter(metric=nonsense)


# --- scaling ---


@FORMS
@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), redundant=st.booleans())
def test_scaling_scales_as_little_as_the_rows_allow(form: str, seed: int, redundant: bool) -> None:
    rng = np.random.default_rng(seed)
    n = 4
    task = Task(rng.normal(size=(3 if redundant else 4, n)), rng.normal(size=3 if redundant else 4))
    A = rng.normal(size=(3, n))
    c = rng.uniform(0.0, 2.0, 3)
    free = tracked(task)
    lowest = 0.0
    highest = 1.0
    if not (A @ free <= c).all():
        for _ in range(60):  # by bisection: zero meets all
            middle = 0.5 * (lowest + highest)
            lowest, highest = (
                (middle, highest) if (A @ free * middle <= c).all() else (lowest, middle)
            )
        highest = lowest
    found = answer(Scaling(), rows_that_ask(A, c), task, form)
    assert found.status == "ok"
    np.testing.assert_allclose(found.qdd, highest * free, atol=1e-8 * (1.0 + np.abs(free).max()))
    if highest < 1.0:
        first = int(np.argmax(A @ free / np.maximum(c, 1e-300)))
        assert found.active == (f"row[{first}]",)


@FORMS
def test_a_row_that_must_brake_gets_the_least_correction(form: str) -> None:
    task = Task(np.eye(2), np.array([3.0, 4.0]))

    def found(A: Any, c: Any, **box: float) -> list[float]:
        command = answer(Scaling(**box), rows_that_ask(A, c), task, form)
        assert command.status == "ok"
        return [round(value, 9) + 0.0 for value in command.qdd]

    # outwards and at least to brake by 1: nothing of tracking, and the least acceleration
    assert found([[1.0, 1.0]], [-1.0]) == [-0.5, -0.5]
    # inwards, but by less than is asked: all of tracking, and the rest
    assert found([[-1.0, 0.0]], [-5.0]) == [5.0, 4.0]
    # what one row allows of it, and the rest for the other: on the side that is free
    assert found([[0.0, 1.0], [-1.0, 0.0]], [2.0, -5.0]) == [5.0, 2.0]
    assert found([[1.0, 0.0]], [10.0], max_acceleration=2.0) == [1.5, 2.0]
    task = Task(np.eye(2), np.array([-3.0, -4.0]))
    assert found([[1.0, 0.0]], [10.0], max_acceleration=2.0) == [-1.5, -2.0]
    task = Task(np.eye(2), np.array([3.0, 4.0]))
    # where the demand changes its sign nothing jumps
    below, above = (np.array(found([[1.0, 1.0]], [side])) for side in (-1e-7, 1e-7))
    np.testing.assert_allclose(below, above, atol=1e-6)


def test_scaling_is_limited_by_either_end_of_the_box() -> None:
    """Joint 2 may decelerate by 1 and accelerate by 10, and tracking asks for −4."""
    rows = rows_that_ask([[1.0, 1.0]], [100.0])
    box = np.array([[-2.0, -1.0], [10.0, 10.0]])
    for tracking, kappa in (([3.0, -4.0], 0.25), ([3.0, 4.0], 1.0), ([20.0, 4.0], 0.5)):
        scaled, acted = Scaling().center(rows, np.array(tracking), -rows.phi, box)
        np.testing.assert_allclose(scaled, kappa * np.array(tracking), rtol=1e-12)
        assert not acted.any()


def test_scaling_marks_the_row_that_allows_least() -> None:
    """As the hierarchy in Python uses it, where the compiled one gives no answer."""
    rows = rows_that_ask([[1.0, 0.0], [0.0, 1.0]], [0.5, 0.8])
    box = np.array([[-9.0, -9.0], [9.0, 9.0]])
    scaled, acted = Scaling().center(rows, np.ones(2), -rows.phi, box)
    np.testing.assert_allclose(scaled, [0.5, 0.5], rtol=1e-12)
    assert acted.tolist() == [True, False]


@FORMS
def test_scaling_names_what_it_cannot_meet(form: str) -> None:
    rows = rows_that_ask([[1.0, 0.0], [-1.0, 0.0]], [-1.0, -1.0])
    task = Task(np.eye(2), np.ones(2))
    found = answer(Scaling(), rows, task, form)
    assert found.status == "relaxed"
    assert found.slacks == pytest.approx({"row[0]": 1.0, "row[1]": 1.0})
    rows = rows_that_ask([[1.0, 0.0], [0.0, 0.0]], [5.0, -1.0])
    found = answer(Scaling(), rows, task, form)
    # a row that no acceleration influences slows nothing down
    np.testing.assert_allclose(found.qdd, [1.0, 1.0])
    assert (found.status, found.slacks) == ("relaxed", {"row[1]": 1.0})


# --- projection ---


@FORMS
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), k=st.integers(1, 6), size=st.floats(0.01, 3.0))
def test_what_is_projected_leaves_the_norm_of_the_error_alone(
    form: str, seed: int, k: int, size: float
) -> None:
    rng = np.random.default_rng(seed)
    e = rng.normal(size=k)
    task = Task(rng.normal(size=(k, 6)), rng.normal(size=k), size * e / np.linalg.norm(e))
    rows = problem(seed)[0]
    free = oracle.track(task)
    found = answer(Projection(), rows, task, form, Switch())
    push = np.where(rows.phi >= 0.0, np.minimum(-rows.switching_gain - rows.Lg @ free, 0.0), np.inf)
    push[-rows.switching_gain - rows.Lg @ free > 0.0] = np.inf
    z = oracle.pushes(rows, push)
    room = 1e-9 * (1.0 + np.linalg.norm(z)) * max(1.0, np.linalg.cond(task.J))
    expected = oracle.projector(task, opening(size, 0.1, 0.7)) @ z
    np.testing.assert_allclose(found.qdd - free, expected, rtol=0.0, atol=room)
    assert abs(task.error @ task.J @ (found.qdd - free)) <= room * np.linalg.norm(task.J)


def test_the_operator_opens_as_visp_has_it() -> None:
    found = [float(opening(size, 0.1, 0.7)) for size in (0.0, 0.0999, 0.1, 0.4, 0.7, 0.7001)]
    np.testing.assert_allclose(
        found, [0.0, 0.0, 1.0 / (1.0 + np.exp(6.0)), 0.5, 1.0 / (1.0 + np.exp(-6.0)), 1.0]
    )


@FORMS
def test_the_second_derivative_of_the_norm_of_the_error_is_that_of_tracking(form: str) -> None:
    """By differences of the error along the three motions."""
    setup = Scenario.load("case-study-6r").setup()
    q = setup.q0
    qd = np.linspace(-0.1, 0.1, 6)
    control = ControlStep(setup.scene, setup.constraints, setup.task)
    given_ = control.evaluate(0.0, q, qd)
    rows = replace(given_.rows, phi=np.where(np.arange(len(given_.rows.labels)) == 0, 0.1, -1.0))
    task = replace(
        given_.task, J=given_.task.J.copy(), b=given_.task.b.copy(), error=given_.task.error.copy()
    )
    rows = replace(rows, Lg=rows.Lg.copy(), Lf=rows.Lf.copy())
    motions = {
        "tracking": Tracking().command(rows, task).qdd,
        "projected": answer(Projection(), rows, task, form, Switch()).qdd,
        "pushed": answer(Additive(), rows, task, form, Switch()).qdd,
    }

    def half_squared(qdd: Array, t: float) -> float:
        e = ControlStep(setup.scene, setup.constraints, setup.task).evaluate(
            0.0, q + qd * t + 0.5 * qdd * t * t, qd
        )
        return 0.5 * float(e.task.error @ e.task.error)

    h = 1e-3
    second = {
        name: (half_squared(qdd, h) - 2.0 * half_squared(qdd, 0.0) + half_squared(qdd, -h)) / h**2
        for name, qdd in motions.items()
    }
    assert np.linalg.norm(motions["projected"] - motions["tracking"]) > 0.1
    assert second["projected"] == pytest.approx(second["tracking"], abs=1e-4)
    assert abs(second["pushed"] - second["tracking"]) > 1e-2


@FORMS
def test_where_no_joint_is_left_a_small_error_leaves_nothing_to_project(form: str) -> None:
    rows, task = problem(3)
    task = replace(task, error=0.01 * task.error / np.linalg.norm(task.error))
    found = answer(Projection(), rows, task, form, RampRepulsion(region=5.0))
    assert found.acted.any()
    np.testing.assert_allclose(found.qdd, tracked(task), atol=1e-8)


@FORMS
def test_without_a_task_to_leave_alone_it_is_the_sum(form: str) -> None:
    for seed in range(5):
        rows, task = problem(seed)
        task = replace(task, J=np.zeros((6, 6)))
        sum_, projected = (
            answer(resolver, rows, task, form, Switch()).qdd
            for resolver in (Additive(), Projection())
        )
        np.testing.assert_allclose(projected, sum_, atol=1e-12)


@FORMS
def test_it_says_that_the_error_is_missing(form: str) -> None:
    rows, task = problem(0)
    law = Law(Switch(), Projection())
    assert law.uses == ("e",)
    with pytest.raises(
        InvalidInput, match=r"'projection' uses task\.error, which this task does not give"
    ):
        getattr(law, form)(rows, Task(task.J, task.b))
    with pytest.raises(InvalidInput, match=r"task\.error is not finite in row 1"):
        getattr(law, form)(rows, replace(task, error=np.array([0.0, np.inf, 0.0, 0.0, 0.0, 0.0])))


def test_its_ends_are_checked() -> None:
    with pytest.raises(
        ConfigurationError, match=r"closed must be below opened, which is 0\.7, not 0\.7"
    ):
        Projection(closed=0.7)
    with pytest.raises(
        ConfigurationError, match="opened must be a positive, finite number, not nan"
    ):
        Projection(opened=float("nan"))


# --- the same under several names ---


@FORMS
def test_with_one_joint_there_is_nothing_to_share(form: str) -> None:
    task = Task(np.array([[2.0]]), np.array([6.0]), np.array([1.0]))
    for side in (1.0, -1.0, 5.0):
        rows = rows_that_ask([[1.0]], [side])
        for resolver in (Priority(), Hierarchy(), *SHARED[:4]):
            np.testing.assert_allclose(
                answer(resolver, rows, task, form).qdd, [min(3.0, side)], atol=1e-7
            )


@FORMS
def test_one_row_and_a_task_that_weighs_all_joints_alike(form: str) -> None:
    """Then the way to the row is along L_gφ for all of them, but for scaling, whose way is that of
    tracking.
    """
    rng = np.random.default_rng(1)
    J = 3.0 * np.linalg.qr(rng.normal(size=(4, 4)))[0]
    a = rng.normal(size=(1, 4))
    b = rng.normal(size=4)
    free = tracked(Task(J, b))
    c = a @ free - 0.5
    expected = free - 0.5 * a[0] / (a[0] @ a[0])
    rows = rows_that_ask(a, c)
    task = Task(J, b)
    for resolver in (
        Priority(),
        Additive(),
        Hierarchy(),
        Filter(),
        Filter(metric="task"),
        Saturation(scales=False),
    ):
        np.testing.assert_allclose(
            answer(resolver, rows, task, form).qdd, expected, atol=1e-7, err_msg=resolver.name
        )


@FORMS
def test_scaling_of_a_task_at_rest_is_the_filter(form: str) -> None:
    for seed in range(10):
        rows, task = problem(seed, m=3)
        task = replace(task, b=np.zeros(6))
        one, other = (
            answer(resolver, rows, task, form, Barrier()) for resolver in (Scaling(), Filter())
        )
        assert one.status == other.status
        np.testing.assert_allclose(one.qdd, other.qdd, atol=1e-9 * (1.0 + np.abs(other.qdd).max()))
