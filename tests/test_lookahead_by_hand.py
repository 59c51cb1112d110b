"""What a predictive law linearises and limits, and how a goal is moved, with numbers that are
worked out here.

Two rows of one joint: ``a`` on σ with K = 0.5, and ``b`` on φ itself.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from math import exp, inf, log, sqrt
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from folder_laws import BarrierGovernor, GoalGovernor
from scenes import Straight
from vsconstraints.compiled.codes import FAILED
from vsconstraints.compiled.least_distance import FORCE, NEW
from vsconstraints.compiled.workspace import Answer, RowArrays, TaskArrays
from vsconstraints.control import Model, Prediction
from vsconstraints.control.evaluator import CurrentState
from vsconstraints.controllers import PredictiveControl, Range
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.prediction.kernels import (
    last_plan,
    plan_cost,
    plan_rows,
    predicted_program,
    predictive,
)
from vsconstraints.prediction.kernels.plan_arrays import Cost
from vsconstraints.prediction.planner import Planner
from vsconstraints.rows import UNKNOWN, Array, Command, Rows, Task
from vsconstraints.rows.tolerances import PULLING
from vsconstraints.vision.tracking import FREE, Rest, TrackingGains

K = np.array([0.5, 0.0])


def row_arrays(rows: Rows) -> RowArrays:
    """The same as compiled functions take them."""
    return RowArrays(*(getattr(rows, name) for name in RowArrays._fields))


def planner(
    rows: Rows, task: Task, model: Straight | None = None, period: float = 0.1, **options: Any
) -> Planner:
    """What plans in blocks of one period unless options say otherwise."""
    law = PredictiveControl(**{"horizon": 1, "block": 1, **options})
    return Planner(
        law, cast(Model, model or Straight(rows, task)), period, (task.J.shape[0], task.J.shape[1])
    )


class Given(Straight):
    """A model that gives a prediction, whatever is asked, of rows with the K above."""

    def __init__(self, rows: Rows, task: Task, **seen: Any) -> None:
        super().__init__(rows, task)
        N = len(seen["phi"])
        n = task.J.shape[1]
        zeros = np.zeros((N, len(task.b)))
        none = np.empty((N, 0))
        usual = {
            "Lf": np.zeros_like(seen["phi"]),
            "sigma_dot": np.zeros_like(seen["phi"]),
            "b": zeros,
            "error": zeros,
        }
        usual |= {
            "J": np.ones((N, len(task.b), n)),
            "error_rate": zeros,
            "rest": none,
            "pixels": none,
        }
        self.seen = Prediction(**{"sigma": seen["phi"], **usual, **seen})
        self.K = K[: len(rows.labels)]

    def along(self, t: Array, q: Array, qd: Array) -> Prediction:
        """See :class:`Straight`."""
        return self.seen


@pytest.mark.parametrize("sigma", [[0.08, 0.9], None])
def test_what_the_model_says_otherwise_of_now_stays_so(sigma: list[float] | None) -> None:
    """σ of ``a`` is 0.03 more than predicted where it is given, else by as much as φ is, 0.05; b by
    1, q̈₀ by 0.5.

    Of ``b`` φ is what counts, whatever σ is.
    """
    known = UNKNOWN if sigma is None else np.array(sigma)
    rows = Rows(
        np.array([0.15, 0.1]), np.ones((2, 1)), np.zeros(2), np.ones(2), ("a", "b"), sigma=known
    )
    task = Task(np.array([[7.0]]), np.array([10.0]), rest=np.array([3.5]))
    model = Given(
        rows,
        task,
        phi=np.array([[0.1, 0.2], [0.3, 0.5]]),
        Lg=np.array([[[1.0], [2.0]], [[3.0], [4.0]]]),
        sigma=np.array([[0.05, 0.2], [0.25, 0.5]]),
        J=np.array([[[6.0]], [[8.0]]]),
        b=np.array([[9.0], [5.0]]),
        error=np.array([[1.0], [2.0]]),
        rest=np.array([[3.0], [2.0]]),
    )
    law = planner(rows, task, model, horizon=2)
    law.solve(rows, task)
    plans = law.plans
    more = 0.05 if sigma is None else 0.03
    np.testing.assert_allclose(plans.value[:2], [[0.05 + more, 0.1], [0.25 + more, 0.4]])
    np.testing.assert_allclose(plans.gradient[:2, :, 0], [[2.0, 2.0], [6.0, 4.0]])
    # J = 7 and 8, b = 10 and 6
    np.testing.assert_allclose(plans.square[:, 0, 0], [49.0, 64.0])
    np.testing.assert_allclose(plans.pull[:, 0], [70.0, 48.0])
    np.testing.assert_allclose(plans.free[:, 0], [3.5, 2.5])


def test_what_is_observed_beside_the_model_fades_along_the_plan() -> None:
    """φ − σ of ``a`` is 0.05 with K = 0.5: σ̇ of the model is 0.1, and rows say 0.5. A drift of 0.4
    fades in 0.2 s.

    Half a second later it has moved σ by 0.4 · 0.2 · (1 − e^(−2.5)); a row on φ itself has none,
    nor has one of a law without an observer.
    """
    rows = Rows(
        np.array([0.1, 0.2]), np.ones((2, 1)), np.zeros(2), np.ones(2), ("a", "b"),
        sigma=np.array([0.05, 0.2]), sigma_dot=np.array([0.5, 0.7]),
    )  # fmt: skip
    task = Task(np.ones((1, 1)), np.zeros(1))
    phi = np.array([[0.1, 0.2]] * 2)
    sigma = np.array([[0.05, 0.2]] * 2)
    Lg = np.ones((2, 2, 1))
    values = {}
    for fading in (0.0, 0.2):
        law = PredictiveControl(horizon=1, block=1)
        law.fading = fading
        plans = Planner(
            law, cast(Model, Given(rows, task, phi=phi, Lg=Lg, sigma=sigma)), 0.5, (1, 1)
        )
        plans.solve(rows, task)
        values[fading] = plans.plans.value[:2].copy()
    np.testing.assert_allclose(values[0.0], [[0.05, 0.2]] * 2)
    np.testing.assert_allclose(
        values[0.2], [[0.05, 0.2], [0.05 + 0.4 * 0.2 * (1.0 - exp(-2.5)), 0.2]]
    )
    # without σ̇ there is nothing to observe
    plans = Planner(law, cast(Model, Given(rows, task, phi=phi, Lg=Lg, sigma=sigma)), 0.5, (1, 1))
    plans.solve(replace(rows, sigma_dot=UNKNOWN), task)
    np.testing.assert_array_equal(plans.plans.value[:2], values[0.0])


def test_limits_of_a_plan() -> None:
    """One block of 1 s, T_s = 0.5 s, κ = 2 s. From q̇ = 1 with q̈ = 1 the joint brakes by 2 rad/s²
    for another second.

    A q̈ of 0.1 more moves q by 0.0125, 0.05 and 0.1, and q̇ by 0.05, 0.1 and 0.
    """
    value = np.array([[0.08, 0.1], [0.1, 0.2], [0.2, 0.3], [0.3, 0.4]])
    gradient = np.array([[[1.0], [1.0]], [[2.0], [2.0]], [[3.0], [3.0]], [[4.0], [4.0]]])
    rows = Rows(value[0], np.ones((2, 1)), np.zeros(2), np.ones(2), ("a", "b"), sigma=value[0])
    task = Task(np.ones((1, 1)), np.zeros(1))
    model = Given(rows, task, phi=value, Lg=gradient * np.array([[0.5], [1.0]]))
    model.present = model.present._replace(qd=np.ones(1))
    plans = planner(rows, task, model, 0.5, block=2, approach=2.0, max_acceleration=2.0).plans
    plans.now[2] = 1.0
    plans.plan[:] = 1.0
    plans.seen[:, :2] = plans.seen[:, 2:4] = value
    plans.seen[:, 4:6] = gradient[..., 0] * np.array([0.5, 1.0])
    last_plan.set_box(plans, RowArrays(*(UNKNOWN,) * 10))
    assert last_plan.walk(plans) == 4
    np.testing.assert_allclose(plans.times, [0.0, 0.5, 1.0, 2.0])
    predicted_program.linearise(plans, 4, row_arrays(rows))
    # rows that change by 0.02, 0.03 and 0.04 over 0.01 rad, of scales above and below
    predicted_program.limit(plans, 4, np.array([0.01, 1.0]))
    np.testing.assert_allclose(plans.row_factor, [[1 / 2, 1.0], [1 / 3, 1.0], [1 / 4, 1.0]])
    # the instant before counts by what is left of it, but for the brake
    steep = np.array([100.0, 2.0, 300.0, 4.0])
    plans.gradient[:, 0, 0] = steep
    predicted_program.limit(plans, 4, np.array([0.01, 1.0]))
    np.testing.assert_allclose(1.0 / plans.row_factor[:, 0], [100.0 * exp(-0.25), 300.0, 4.0])
    plans.gradient[:, 0, 0] = gradient[:, 0, 0]
    predicted_program.limit(plans, 4, rows.scale)
    limits = predictive.limits_of(plans, 4, rows.scale)
    space = plans.space
    f = exp(-0.25)
    space.u[:] = 1.1
    plan_cost.follow_block(1.0, space.u, space.x, 0, 1)
    plan_rows.move(limits, space.u, space.x, space.moved)
    excess = [
        0.125 - f * 0.08, 0.3 - f * 0.1,
        0.35 - f * 0.125, 0.6 - f * 0.3,
        0.7 - 0.08 * exp(-1.0), -inf,
        1.1 - 2.0, -2.0 - 1.1,
    ]  # fmt: skip
    np.testing.assert_allclose([plan_rows.excess(limits, space, row) for row in range(8)], excess)
    # w = √49 u − y
    plans.square[:] = 49.0
    plans.pull[:] = 0.0
    cost = Cost(
        1.0, 0.0, *(getattr(plans, name) for name in ("gains", "rest", "square", "pull", "free"))
    )
    assert plan_cost.factorise(cost, plans.factor)
    slopes = []
    for row in (0, 1, 2, 3, 4, 6, 7):
        plan_rows.differentiate(cost, plans.factor, limits, row, space.adjoint, space.work)
        slopes.append(7.0 * space.work[NEW, 0])
    np.testing.assert_allclose(slopes, [0.25, 1.0, 1.5 - 0.25 * f, 3.0 - f, 4.0, 1.0, -1.0])


def test_a_plan_stays_near_to_what_joints_do_at_rest() -> None:
    """Against least squares of all that is summed: two blocks, three joints, one feature, and q̈₀ =
    −4 q̇ − 4 q.
    """
    rng = np.random.default_rng(0)
    T = 0.2
    gains, J, b, rest = (
        np.array([[9.0, 6.0], [4.0, 3.0]]),
        *(rng.normal(size=(2, size)) for size in (3, 1, 3)),
    )
    M = []
    y = []
    weight = 1e-2
    for k in range(2):
        # after a block of T = 0.2 s that of its q̈ is in q by T²/2, in q̇ by T
        moved = np.zeros((3, 6))
        speed = np.zeros((3, 6))
        if k == 1:
            moved[:, :3], speed[:, :3] = T**2 / 2 * np.eye(3), T * np.eye(3)
        now = np.kron(np.eye(2)[k], np.eye(3))
        M += [J[k : k + 1] @ (now + gains[k, 0] * moved + gains[k, 1] * speed)]
        M += [sqrt(weight) * (now + 4.0 * moved + 4.0 * speed)]
        y += [b[k], sqrt(weight) * rest[k]]
    best = np.linalg.lstsq(np.vstack(M), np.concatenate(y), rcond=None)[0]
    plans = planner(Rows.none(3), Task(np.ones((1, 3)), np.ones(1)), horizon=2, block=2).plans
    square = np.einsum("ki,kj->kij", J, J)
    cost = Cost(T, weight, gains, np.full((2, 2), 4.0), square, b * J, rest)
    assert plan_cost.factorise(cost, plans.factor)
    plan_cost.roll_out(cost, plans.factor, plans.space)
    np.testing.assert_allclose(plans.space.u.ravel(), best, rtol=1e-9)


def test_a_plan_without_one_optimum_fails() -> None:
    """q̈₁ + q̈₂ is asked for, and the damping is less than rounding."""
    task = Task(np.ones((1, 2)), np.ones(1))
    law = PredictiveControl(horizon=1, block=1, damping=1e-300)
    law.reset(period=0.1, model=cast(Model, Straight(Rows.none(2), task)))
    command = law.command(Rows.none(2), task)
    assert (command.status, list(command.qdd)) == ("failed", [0.0, 0.0])
    assert "rounding exceeds the damping 1e-300" in command.reason


def test_what_no_acceleration_influences_is_told_by_the_scale_of_the_row() -> None:
    """1e-9 for each rad/s is nothing to a row whose scale is a million: it is unmet, and tracking
    goes on.
    """
    rows = Rows(np.ones(1), np.array([[1e-9]]), np.zeros(1), np.ones(1), ("a",), np.array([1e6]))
    law = PredictiveControl(horizon=1, block=1)
    task = Task(np.ones((1, 1)), np.array([3.0]))
    law.reset(period=0.1, model=cast(Model, Straight(rows, task)))
    command = law.command(rows, task)
    assert command.status == "relaxed"
    assert command.qdd[0] == pytest.approx(3.0, rel=1e-5)


@pytest.mark.parametrize(
    ("scale", "weights", "kept"), [(4.0, {}, 0), (0.25, {}, 1), (4.0, {"b": 8.0}, 1)]
)
def test_of_rows_that_contradict_each_other_the_heavier_by_its_scale_is_kept(
    scale: float, weights: dict[str, float], kept: int
) -> None:
    """q̇ ≤ −1 and q̇ ≥ 1 of a joint at rest: Σ w s/scale is least with all of it on the lighter
    one.
    """
    rows = Rows(
        np.ones(2),
        np.array([[1.0], [-1.0]]),
        np.zeros(2),
        np.ones(2),
        ("a", "b"),
        np.array([1.0, scale]),
    )
    law = PredictiveControl(horizon=1, block=1, approach=1e-3, weights=weights)
    task = Task(np.ones((1, 1)), np.zeros(1))
    law.reset(period=0.1, model=cast(Model, Straight(rows, task)))
    command = law.command(rows, task)
    assert command.status == "relaxed"
    assert np.sign(command.qdd[0]) == (-1.0, 1.0)[kept]
    assert ("b by", "a by")[kept] in command.reason
    assert ("a by", "b by")[kept] not in command.reason


def planned(
    b: float, rows: Rows | None = None, qd: float = 0.0, J: float = 1.0, **options: Any
) -> PredictiveControl:
    """A law that has planned one block of 0.1 s for one joint that moves with q̇ [rad/s]."""
    task = Task(np.array([[J]]), np.array([b]))
    model = Straight(Rows.none(1) if rows is None else rows, task)
    model.present = model.present._replace(qd=np.array([qd]))
    law = PredictiveControl(horizon=1, block=1, **options)
    law.reset(period=0.1, model=cast(Model, model))
    assert law.command(model.rows, task).status == "ok"
    return law


def test_rows_fall_with_the_time_constant_of_so_many_blocks() -> None:
    """From −1 to −e^(−0.1/0.2) within a block, though q̈ = 10 is asked for: q̈ = 10 (1 −
    e^(−0.5)).
    """
    rows = Rows(np.array([-1.0]), np.ones((1, 1)), np.zeros(1), np.ones(1), ("a",))
    law = planned(10.0, rows, qd=-1.0, approach=2.0)
    assert law.plan is not None
    assert law.plan.qdd[0, 0] == pytest.approx(10.0 * (1.0 - exp(-0.5)), rel=1e-5)
    law = PredictiveControl(horizon=1, block=1, approach=2.0)
    task = Task(np.ones((1, 1)), np.array([10.0]))
    model = Straight(rows, task)
    model.present = model.present._replace(qd=np.array([-1.0]))
    law.reset(period=0.1, model=cast(Model, model))
    assert law.command(rows, task).qdd[0] == pytest.approx(10.0 * (1.0 - exp(-0.5)), rel=1e-5)


def test_a_plan_goes_on_with_a_brake() -> None:
    """1 rad/s is left at its end, or 0.1 after −0.1, and 2 rad/s² there are; without a bound
    nothing is known.
    """
    for b, qd, most, then in ((0.0, 1.0, 2.0, -2.0), (5.0, -0.1, 2.0, -2.0), (0.0, 1.0, None, 0.0)):
        law = planned(b, qd=qd, max_acceleration=most)
        assert law.plan is not None
        np.testing.assert_allclose(law.plan.then, [then], atol=1e-12)


def test_joints_brake_together_from_what_is_left_at_the_plans_end() -> None:
    """(1, 0.2) rad/s after two blocks of 0.1 s with (0, 1) rad/s²: half a second for the first
    joint.
    """
    task = Task(np.eye(2), np.array([0.0, 1.0]))
    model = Straight(Rows.none(2), task)
    model.present = model.present._replace(qd=np.array([1.0, 0.0]))
    law = PredictiveControl(horizon=2, block=1, max_acceleration=2.0)
    law.reset(period=0.1, model=cast(Model, model))
    law.command(model.rows, task)
    assert law.plan is not None
    np.testing.assert_allclose(law.plan.then, [-2.0, -0.4], rtol=1e-5)


def test_of_two_rows_in_the_way_the_nearer_one_holds() -> None:
    """Both would be exceeded by q̈ = 10; ``b`` allows 5 (1 − e^(−0.5)), half of what ``a`` does."""
    rows = Rows(np.array([-1.0, -0.5]), np.ones((2, 1)), np.zeros(2), np.ones(2), ("a", "b"))
    law = PredictiveControl(horizon=1, block=1, approach=2.0)
    task = Task(np.ones((1, 1)), np.array([10.0]))
    law.reset(period=0.1, model=cast(Model, Straight(rows, task)))
    command = law.command(rows, task)
    assert command.qdd[0] == pytest.approx(5.0 * (1.0 - exp(-0.5)), rel=1e-5)
    np.testing.assert_array_equal(command.acted, [False, True])


def test_what_rows_say_of_accelerations_now_holds_for_the_first_block() -> None:
    rows = replace(Rows.none(1), qdd_min=np.array([-2.0]), qdd_max=np.array([1.0]))
    for b, first in ((3.0, 1.0), (-3.0, -2.0)):
        law = PredictiveControl(horizon=2, block=1)
        task = Task(np.ones((1, 1)), np.array([b]))
        law.reset(period=0.1, model=cast(Model, Straight(rows, task)))
        assert law.command(rows, task).qdd[0] == pytest.approx(first)
        assert law.plan is not None
        np.testing.assert_allclose(law.plan.qdd[:, 0], [first, b], rtol=1e-5)


class Short(Straight):
    """A model that gives no more than so many states."""

    states = 2

    def along(self, t: Array, q: Array, qd: Array) -> Prediction:
        return super().along(t[: self.states], q, qd[: self.states])


def test_two_states_are_enough_to_plan() -> None:
    """Of now and 0.1 s ahead; with that of now alone the joint, which moves with 0.05 rad/s, brakes
    in one block.
    """
    task = Task(np.ones((1, 1)), np.array([3.0]))
    model = Short(Rows.none(1), task)
    model.present = model.present._replace(qd=np.array([0.05]))
    law = PredictiveControl(horizon=2, block=1)
    law.reset(period=0.1, model=cast(Model, model))
    command = law.command(model.rows, task)
    assert (command.status, command.qdd[0]) == ("ok", pytest.approx(3.0))
    assert "no more than 0.2 s are predicted" in command.remark
    model.states = 1
    command = law.command(model.rows, task)
    assert (command.status, command.qdd[0]) == ("suboptimal", pytest.approx(-0.5))
    assert command.reason.startswith("braking: no more than 0.1 s")
    assert law.plan is None


def test_only_a_plan_that_was_found_is_called_continued() -> None:
    """A violation of 1e6 beside one of 1 is too much for rounding, so that no plan passes the
    check. Without an earlier plan the joint brakes its 1 rad/s in the one block of 0.1 s, however
    often it is asked. Half a block later it still brakes, by half of that. A plan of 1 rad/s², and
    nothing after it, is continued in the sample in which it was found, too. Half a block after it
    was made, it is 0.5.
    """
    task = Task(np.ones((1, 1)), np.ones(1))
    Lg = np.array([[-1.0], [1.0]])
    harmless = Rows(-np.ones(2), Lg, np.zeros(2), np.ones(2), ("a", "b"), np.ones(2))
    hopeless = replace(harmless, phi=np.array([1e6, 1.0]))
    model = Straight(hopeless, task)
    model.present = model.present._replace(qd=np.ones(1))
    law = PredictiveControl(horizon=1, block=1)
    law.reset(period=0.1, model=cast(Model, model))
    for _ in range(2):
        command = law.command(hopeless, task)
        assert (command.status, command.qdd[0]) == ("suboptimal", -10.0)
        assert command.reason == "braking: no plan passes the check"
    model.present = model.present._replace(t=0.05)
    command = law.command(hopeless, task)
    assert (command.status, command.qdd[0]) == ("suboptimal", pytest.approx(-5.0))
    assert command.reason == "braking: no plan passes the check"
    model.rows = harmless
    assert law.command(harmless, task).status == "ok"
    model.rows = hopeless
    for t, qdd in ((0.05, 1.0), (0.1, 0.5), (0.1, 0.5)):
        model.present = model.present._replace(t=t)
        command = law.command(hopeless, task)
        assert command.status == "suboptimal"
        assert command.reason.startswith("the previous plan is continued: ")
        assert command.qdd[0] == pytest.approx(qdd, rel=1e-5)


@pytest.mark.parametrize(
    ("t", "then"), [(0.0, 0.0), (0.05, -1.0), (0.1, 5.0), (0.15, 5.0), (-0.1, 5.0)]
)
@pytest.mark.parametrize("made", [0.0, 0.3])
def test_a_plan_that_has_ended_is_forgotten(t: float, then: float, made: float) -> None:
    """Half a block on it is the mean of 0 and −2; after its one block, and before it, −0.5 rad/s is
    braked anew.
    """
    plans = planner(Rows.none(1), Task(np.ones((1, 1)), np.zeros(1)), max_acceleration=9.0).plans
    last_plan.set_box(plans, row_arrays(Rows.none(1)))
    plans.plan[:] = 0.0
    plans.then[:] = -2.0
    plans.made[:] = made
    plans.now[:] = made + t, 0.0, -0.5
    last_plan.carry_on(plans)
    assert plans.plan[0, 0] == pytest.approx(then, abs=1e-12)


def test_what_is_commanded_is_the_first_block() -> None:
    """q̇ of ``a`` falls from −1 to −e^(−0.5) in the first block of 0.1 s, and to −e^(−1) in the
    second one.
    """
    rows = Rows(np.array([-1.0]), np.ones((1, 1)), np.zeros(1), np.ones(1), ("a",))
    law = PredictiveControl(horizon=2, block=1, approach=2.0)
    task = Task(np.ones((1, 1)), np.array([10.0]))
    law.reset(period=0.1, model=cast(Model, Straight(rows, task)))
    command = law.command(rows, task)
    assert law.plan is not None
    np.testing.assert_allclose(
        law.plan.qdd[:, 0], [10.0 * (1.0 - exp(-0.5)), 10.0 * (exp(-0.5) - exp(-1.0))], rtol=1e-5
    )
    assert command.qdd[0] == law.plan.qdd[0, 0]


def test_where_no_plan_passes_the_check_the_last_one_goes_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """0.1 s after (3, 1) was planned: 1, and 0 after the plan."""
    rows = Rows(-np.ones(1), np.ones((1, 1)), np.zeros(1), np.ones(1), ("a",))
    task = Task(np.ones((1, 1)), np.ones(1))
    law = planner(rows, task, horizon=2)
    plans = law.plans
    outputs = (np.zeros(1), np.zeros(1, dtype=np.bool_), np.zeros(1), np.zeros(1, dtype=np.int64))
    plans.plan[:, 0] = [1.0, 0.0]
    plans.now[0] = 0.1
    plans.outcome[predictive.PREDICTED] = plans.outcome[predictive.ASKED] = last_plan.walk(plans)
    plans.seen[:] = 0.0
    monkeypatch.setattr(predictive, "plan_best", lambda *_: (FAILED, 1))
    now = row_arrays(rows), TaskArrays(task.J, task.b, *(UNKNOWN,) * 4)
    assert predictive.decide(law.arrays, plans, *now, Answer(*outputs, UNKNOWN)) == FAILED
    assert (outputs[0][0], plans.made[0], outputs[1][0]) == (1.0, 0.1, False)
    np.testing.assert_allclose(plans.plan[:, 0], [1.0, 0.0])


@pytest.mark.parametrize(
    ("first", "second", "held"), [(4.0, 3.0, [1, 0]), (0.5, 0.6, [1, 1]), (0.0, 0.0, [0, 0])]
)
def test_rows_hold_whose_multipliers_are_no_rounding_of_the_greatest(
    first: float, second: float, held: list[int]
) -> None:
    """That of the second row is given in units of ``PULLING``."""
    rows = Rows(-np.ones(2), np.ones((2, 1)), np.zeros(2), np.ones(2), ("a", "b"))
    task = Task(np.eye(1), np.zeros(1))
    plans = planner(rows, task).plans
    acted = np.ones(2, dtype=np.bool_)
    plans.outcome[predictive.PREDICTED] = 2
    plans.space.active[:2] = [0, 1]
    plans.space.work[FORCE, :2] = [first, second * PULLING]
    predictive.mark_active(
        plans, Answer(UNKNOWN, acted, UNKNOWN, np.zeros(1, dtype=np.int64), UNKNOWN), 2
    )
    np.testing.assert_array_equal(acted, np.array(held, dtype=bool))
    assert plans.outcome[predictive.ACTIVE] == (2 if first else 0)


def test_what_is_looked_at_comes_after_now_and_once_where_a_plan_leads_to_it() -> None:
    asked: list[Array] = []

    class Seen(Short):
        def along(self, t: Array, q: Array, qd: Array) -> Prediction:
            asked.append(t)
            return super().along(t, q, qd)

    task = Task(np.ones((1, 1)), np.array([3.0]))
    model = Seen(Rows.none(1), task)
    model.present = model.present._replace(t=5.0)
    law = PredictiveControl(horizon=2, block=1)
    law.reset(period=0.1, model=cast(Model, model))
    law.command(model.rows, task)
    assert len(asked) == 1
    np.testing.assert_allclose(asked[0], [5.0, 5.1, 5.2])


def test_an_option_that_changes_and_a_reset_forget_the_plan() -> None:
    law = planned(3.0)
    assert law.plan is not None
    law.damping = 0.5
    assert law.plan is None
    law = planned(3.0)
    law.reset()
    assert law.plan is None


def test_horizons_have_up_to_a_hundred_blocks_of_ten_thousand_periods() -> None:
    law = PredictiveControl(horizon=100, block=10_000)
    for name, most in (("horizon", 100), ("block", 10_000)):
        with pytest.raises(
            InvalidInput, match=f"{name} must be a whole number from 1 to {most}, not {most + 1}"
        ):
            setattr(law, name, most + 1)


def test_weights_of_no_row_are_told() -> None:
    assert (
        PredictiveControl(weights={"b": 2.0}).remark(("a",))
        == "weights that match the beginning of no row's label: 'b'"
    )
    assert PredictiveControl().remark(("a",)) == ""


def test_a_joint_that_cannot_stop_in_a_block_goes_on_in_the_next() -> None:
    """1 rad/s by 4 rad/s² at most in blocks of 0.1 s: 0.6 and 0.2 are left, and the last block is
    not needed.
    """
    plans = planner(
        Rows.none(1), Task(np.eye(1), np.zeros(1)), horizon=4, max_acceleration=4.0
    ).plans
    plans.now[2] = 1.0
    last_plan.set_box(plans, row_arrays(Rows.none(1)))
    last_plan.brake(plans)
    np.testing.assert_allclose(plans.plan[:, 0], [-4.0, -4.0, -2.0, 0.0])


def test_joints_that_move_without_a_bound_have_no_time_to_stop() -> None:
    for qd, most, time in (
        ([1.0, 0.0, 2.0], [inf, inf, 1.0], 0.0),
        ([0.0, 0.0, -2.0], [inf, 1.0, 4.0], 0.5),
    ):
        plans = planner(Rows.none(3), Task(np.eye(3), np.zeros(3))).plans
        plans.now[4:] = qd
        plans.most[:] = most
        assert last_plan.stopping_time(plans) == time


def test_options_are_those_that_are_documented() -> None:
    law = PredictiveControl()
    moving = GoalGovernor()
    assert (law.horizon, law.block, law.approach, law.damping) == (10, 10, 5.0, 1e-6)
    assert (moving.speed, moving.margin, moving.influence, moving.horizon) == (2.0, 0.01, 0.3, None)
    assert {name: str(one) for name, one in law.ranges.items()} == {
        "horizon": "3–30", "block": "5–25", "approach": "1.5–10", "damping": "1e-08–0.0001",
        "margin": "0–0.2",
    }  # fmt: skip
    whole = {name for name, one in law.ranges.items() if isinstance(one, Range) and one.integer}
    assert whole == {"horizon", "block"}
    assert {name: str(one) for name, one in moving.ranges.items()} == {
        "speed": "0.5–5", "margin": "0.005–0.05", "influence": "0.1–0.5", "horizon": "none or 2.0 or 4.0 or 6.0",
    }  # fmt: skip


def test_the_damping_is_relative_to_the_mean_of_the_gains() -> None:
    """The least of (2u − 10)² + ¼ × 4u² is at 20 = 5u."""
    law = planned(10.0, J=2.0, damping=0.25)
    assert law.plan is not None
    assert law.plan.qdd[0, 0] == pytest.approx(4.0)
    # of (u/2 − 10)² + 4 × ¼u² at 5 = 1¼ u
    law = planned(10.0, J=0.5, damping=4.0)
    assert law.plan is not None
    assert law.plan.qdd[0, 0] == pytest.approx(4.0)
    law = planned(0.0, J=0.0)
    assert law.plan is not None
    np.testing.assert_array_equal(law.plan.qdd, [[0.0]])


# --- the goal governor ---


def known(sigma: Array, Lg: Array, J: Array, K: Array, law: Any = None) -> Any:
    """A governor with v = 2, δ = 0.1 and ζ = 0.3 that knows the response of rows at rest."""
    law = law or GoalGovernor(speed=2.0, margin=0.1, influence=0.3)
    law.model = SimpleNamespace(K=K)
    law.response = response(np.full(len(K), 0.3), J, np.zeros(Lg.shape))
    law.response.sigma[:] = sigma
    law.response.Lg[:] = Lg
    return law


def response(margins: Array, J: Array, slopes: Array) -> Any:
    """A response with these margins, whose Jacobian is J everywhere."""
    m, n = slopes.shape
    every_J = np.tile(J, (m, 1, 1))
    kind = sys.modules[GoalGovernor.__module__].Response
    return kind(margins, np.zeros(m), np.zeros((m, n)), J, slopes, every_J)


def direction(law: Any, r: Array) -> Array:
    """ρ at a reference: where half a second leads by 2 a second."""
    return np.asarray(law.candidate(r, law.response, 0.5)) - r


def test_rows_repel_the_reference_as_strongly_as_the_goal_attracts_it_where_the_margin_is_reached() -> (
    None
):
    """At (2, 0) the goal attracts by (−1, 0). J⁻ᵀ(1, 1) = (1, ½); 0.2 inside it counts half, 0.4
    inside not at all.
    """
    J = np.diag([1.0, 2.0])
    Lg = np.array([[1.0, 1.0], [1.0, 1.0], [5.0, 0.0]])
    r = np.array([2.0, 0.0])
    unit = np.array([1.0, 0.5]) / sqrt(1.25)
    for inside, strength in ((0.1, 1.0), (0.2, 0.5), (0.4, 0.0)):
        law = known(np.array([-inside, -0.4, -0.1]), Lg, J, np.array([0.2, 0.2, 0.0]))
        np.testing.assert_allclose(
            direction(law, r), np.array([-1.0, 0.0]) - strength * unit, atol=1e-15
        )
    # near the goal the attraction falls: 0.05 away of the 0.2 from which on it does
    np.testing.assert_allclose(direction(law, np.array([0.0, 0.05])), [0.0, -0.25], atol=1e-15)


@pytest.mark.parametrize("size", [1.0, 0.1])
def test_how_steep_a_row_is_does_not_count_and_one_that_is_flat_repels_nothing(size: float) -> None:
    law = known(np.array([-0.1, -0.1]), np.array([[size], [0.0]]), np.eye(1), np.array([0.2, 0.2]))
    np.testing.assert_allclose(direction(law, np.array([2.0])), [-2.0])


def test_the_reference_is_the_slower_the_nearer_its_motion_comes_to_a_row() -> None:
    law = known(np.zeros(1), np.zeros((1, 2)), np.eye(2), np.zeros(1))
    for least, speed in ((0.5, 2.0), (0.3, 2.0), (0.2, 1.0), (0.1, 0.0), (-1.0, 0.0)):
        law.response.margins[:] = least
        np.testing.assert_allclose(direction(law, np.array([3.0, 0.0])), [-0.5 * speed, 0.0])


@pytest.mark.parametrize(
    ("alpha", "inside", "there"),
    [
        (1.0, 0.3, (-0.55, -0.45)),  # ½ s of −α h = −0.2
        (100.0, 0.3, (-1.0, 0.0)),
        (1.0, 0.1, (-0.5, -0.5)),  # on the boundary: along it
        (1.0, -0.2, (-0.425, -0.575)),
        # returns no faster than the reference may move
        (10.0, -0.2, (0.25 / sqrt(1.625), -1.25 / sqrt(1.625))),
    ],
)
def test_a_barrier_changes_the_move_by_the_least(
    alpha: float, inside: float, there: tuple[float, float]
) -> None:
    """At (2, 0) the goal attracts by (−1, 0), and d rises by (1, −1): the slope is Jᵀ (−1, 1)."""
    J = np.diag([1.0, 2.0])
    law = BarrierGovernor(speed=2.0, margin=0.1, alpha=alpha, sharpness=100.0)
    law.response = response(np.array([inside]), J, (J.T @ [-1.0, 1.0])[None])
    np.testing.assert_allclose(direction(law, np.array([2.0, 0.0])), there, atol=1e-12)


def test_rows_of_a_barrier_count_by_how_near_they_are() -> None:
    """Two as near count half each, and lower h by log(2)/κ; one that is far counts nothing."""
    law = BarrierGovernor(speed=2.0, margin=0.1, alpha=1.0, sharpness=100.0)
    slopes = np.array([[-1.0, 1.0], [-1.0, -1.0], [1.0, 0.0]])
    law.response = response(np.array([0.3, 0.3, 5.0]), np.eye(2), slopes)
    found = direction(law, np.array([2.0, 0.0]))
    np.testing.assert_allclose(found, [-0.5 * (0.2 - log(2.0) / 100.0), 0.0], atol=1e-12)


class Moved:
    """A model that Python asks: rows by σ of t, q and q̇, of a task whose feature is the first
    joints themselves.
    """

    until = inf
    goal = 0
    labels = ("a",)

    def __init__(
        self,
        gains: TrackingGains,
        q: Array,
        sigma: Any,
        qd: Array | None = None,
        k: int | None = None,
    ) -> None:
        n = len(q)
        self.J = np.eye(n)[:k]
        self.sigma = sigma
        self.gains = gains
        self.present = CurrentState(0.0, q, np.zeros(n) if qd is None else qd)
        self.times = list[float]()
        rest = FREE if k is None else Rest()
        self.task = SimpleNamespace(gains=gains, goals=[], rest_of=lambda n, k: rest)
        self.K = np.zeros(len(self.labels))

    def at(self, t: float, q: Array, qd: Array) -> Any:
        """See :class:`.Model`."""
        self.times.append(t)
        e = self.J @ q
        rate = self.J @ qd
        rest = UNKNOWN if len(self.J) == len(q) else -5.0 * qd
        Kp, Kv = self.gains.at(e)
        sigma = self.sigma(t, q, qd)
        m = len(sigma)
        zeros = np.zeros(m)
        Lg = np.full((m, len(q)), 7.0)
        rows = Rows(sigma, Lg, zeros, np.ones(m), self.labels, np.full(m, 2.0), sigma, zeros, zeros)
        return SimpleNamespace(task=Task(self.J, -Kp * e - Kv * rate, e, rate, rest), rows=rows)

    def command(self, law: Any, t: float) -> Command:
        """That of the present state at time t."""
        self.present = self.present._replace(t=t)
        now = self.at(t, self.present.q, self.present.qd)
        command: Command = law.command(now.rows, now.task)
        return command


@pytest.mark.parametrize(("least", "there"), [(0.05, 0.0), (0.049, 0.05)])
def test_the_reference_moves_where_its_motion_keeps_half_the_margin(
    least: float, there: float
) -> None:
    """Near the goal the attraction of (0.05, 0) is a quarter: 0.1 s by 2 a second lead to the
    goal.
    """
    model = Moved(
        TrackingGains(4.0, damping=2.5),
        np.array([0.05, 0.0]),
        lambda t, q, qd: np.array([-inside[0]]),
    )
    law = GoalGovernor(speed=2.0, margin=0.1, influence=0.3)
    inside = [1.0]
    law.reset(model=cast(Model, model))
    for t, inside[0] in ((0.0, 1.0), (0.1, 2.0 * least)):
        model.command(law, t)
    assert law.reference is not None
    np.testing.assert_allclose(law.reference, [there, 0.0], atol=1e-15)


def test_a_move_is_given_up_as_soon_as_it_comes_too_near() -> None:
    """The first state that the moved reference leads to is within half the margin; without a move
    all is predicted.
    """
    model = Moved(
        TrackingGains(4.0),
        np.ones(1),
        lambda t, q, qd: np.array([-2.0 if q[0] > edge[0] else -0.09]),
    )
    law = GoalGovernor(speed=2.0, margin=0.1, influence=0.3)
    edge = [0.5]
    law.reset(model=cast(Model, model))
    model.command(law, 0.0)
    edge[0] = 1.0 - 1e-9
    model.times.clear()
    model.command(law, 0.1)
    # with the two states that are evaluated before: of now for the rows, and of each response
    assert len(model.times) == 1 + 2 + 43
    assert law.reference == pytest.approx([1.0])


def test_from_a_hundredth_on_it_says_what_holds_the_reference() -> None:
    model = Moved(TrackingGains(1.0), np.zeros(2), lambda t, q, qd: np.array([-0.8, -0.2]))
    model.labels, model.K, law = ("a", "b"), np.zeros(2), GoalGovernor()
    law.reset(model=cast(Model, model))
    assert law.remark(("a", "b")) == ""
    for away, said in ((0.007, ""), (0.01, "0.01 from the task's"), (0.02, "0.02 from the task's")):
        model.present = model.present._replace(q=np.array([0.0, away]))
        law.reset()
        model.command(law, 0.0)
        assert law.remark(("a", "b")) == (said and f"the governor's goal is {said}, held by b")
        assert law.remark(()) == ""
    # nothing is known where nothing can be evaluated
    model.sigma = lambda t, q, qd: np.full(2, np.nan) if len(model.times) > 1 else -np.ones(2)
    model.times.clear()
    law.reset()
    model.command(law, 0.0)
    assert law.reference is not None
    assert law.remark(("a", "b")) == ""


def test_a_governor_begins_without_a_reference_and_uses_what_its_law_does() -> None:
    law = GoalGovernor(demand="implicit-switch")
    assert (law.reference, len(law.periods)) == (None, 0)
    assert law.uses == ("T_s", "memory", "model")
    law.reset(period=0.1)
    assert law.law.period == 0.1
    law.reset()
    assert law.law.period == 0.1


def test_influence_must_exceed_the_margin() -> None:
    with pytest.raises(
        ConfigurationError,
        match=r"influence of goal-governor must be above its margin 0\.2, not 0\.2",
    ):
        GoalGovernor(margin=0.2, influence=0.2)


def test_the_law_underneath_is_given_the_task_of_the_reference() -> None:
    """K_p = 4/2^|e| and K_v = 2.5 √K_p: with e = 1, ė = 0.1 and r = 0.8, b = −0.2 K_p(0.2) − 0.1
    K_v(0.2).

    Where the goal changes, the reference is carried there.
    """
    given: list[Task] = []
    gains = TrackingGains(4.0, 4.0 * log(2.0), 2.5)
    model = Moved(gains, np.ones(1), lambda t, q, qd: -2.0 * np.ones(1), np.array([0.1]))
    model.task.goals = [SimpleNamespace(reference=None, place=place) for place in (0.0, 0.5)]
    model.task.feature = SimpleNamespace(
        carried=lambda r, before, after, error: r + before.place - after.place + 0.0 * error
    )
    law = GoalGovernor(speed=2.0, margin=0.1, influence=0.3, horizon=3.0)
    law.reset(model=cast(Model, model))

    def command(rows: Rows, task: Task) -> Command:
        given.append(task)
        return Command(np.zeros(1), "ok", np.zeros(1, dtype=bool), rows.labels)

    law.law.command = command  # type: ignore[method-assign]
    for t in (0.0, 0.1):
        model.command(law, t)
    np.testing.assert_allclose([law.reference, given[-1].error], [[0.8], [0.2]])
    Kp = 4.0 / 2.0**0.2
    np.testing.assert_allclose(given[-1].b, [-0.2 * Kp - 0.25 * sqrt(Kp)])
    model.goal = 1
    model.command(law, 0.1)
    np.testing.assert_allclose(law.reference, [0.3])
    # it goes on from there
    model.command(law, 0.2)
    np.testing.assert_allclose(law.reference, [0.1])


@pytest.mark.parametrize(("gains", "T"), [((0.16, 1.0), 20.0), ((1.0, 1.0), 8.0)])
def test_what_is_predicted_lasts_four_time_constants_of_the_slowest_motion(
    gains: tuple[float, float], T: float
) -> None:
    """The roots are 0.2 and 0.8, or have the real part 0.5. Of 40 steps each is e^(3.5/40) times
    the one before.
    """
    task = SimpleNamespace(
        goals=[], gains=SimpleNamespace(at=lambda error: (9.0, 9.0) if error.any() else gains)
    )
    law = GoalGovernor()
    law.reset(model=cast(Model, SimpleNamespace(task=task)))
    assert len(law.periods) == 40
    assert law.periods.sum() == pytest.approx(T)
    np.testing.assert_allclose(law.periods[1:] / law.periods[:-1], exp(3.5 / 40.0))
    law.horizon = 3.0
    law.reset()
    assert law.periods.sum() == pytest.approx(3.0)


def test_one_goal_with_a_reference_of_its_own_is_one_too_many() -> None:
    goals = [SimpleNamespace(reference=None), SimpleNamespace(reference=1.0)]
    with pytest.raises(ConfigurationError, match="leave reach_in out"):
        GoalGovernor().reset(model=cast(Model, SimpleNamespace(task=SimpleNamespace(goals=goals))))


def test_a_response_of_two_joints_of_which_the_feature_is_the_first() -> None:
    """K_p = 4 and K_v = 5 where the reference is 0.5 away, held for 1 s: 4/4.5 and 7/4.5 by the
    implicit midpoint rule.

    q̈₁ = −(0.5 × 4 + 0.3 × 7)/4.5 = −4.1/4.5; the other joint, which nothing asks of, is damped by
    5/3.5. At rest q₁ is 0.5. Of the goal there is no more to be known after 0.6 s. Scales are 2.
    """
    gains = TrackingGains(8.0, 16.0 * log(2.0), 2.5)
    q = np.array([1.0, 0.0])
    qd = np.array([0.3, 0.3])
    model = Moved(gains, q, lambda t, q, qd: np.array([q[0], -q[0], q[1]]), qd, k=1)
    model.labels, model.K, model.until = ("a", "b", "c"), np.zeros(3), 0.6
    law = GoalGovernor(horizon=1.0)
    law.reset(model=cast(Model, model))
    law.periods = np.ones(1)
    model.times.clear()
    found = law.predict(np.array([0.5]))
    first = 1.3 - 0.5 * 4.1 / 4.5
    other = 0.3 - 0.5 * 0.3 * 5.0 / 3.5
    np.testing.assert_allclose(found.margins, [-0.5 * first, 0.25, -0.5 * other])
    np.testing.assert_allclose(found.sigma, [0.25, -0.25, 0.5 * other])
    np.testing.assert_allclose(found.Lg, 7.0)
    np.testing.assert_allclose(found.J, [[1.0, 0.0]])
    assert model.times == [0.0, 0.6, 0.6, 0.6]


def test_in_each_sample_the_reference_moves_on() -> None:
    """From 1 off, by 2 a second where no row is near; beyond what is acceptable it stays, and where
    time goes back.
    """
    model = Moved(
        TrackingGains(4.0, damping=2.5), np.ones(1), lambda t, q, qd: np.array([-2.0 * inside[0]])
    )
    law = GoalGovernor(speed=2.0, margin=0.1, influence=0.3)
    inside = [1.0]
    seen = []
    law.reset(model=cast(Model, model))
    for t, inside[0] in ((1.0, 1.0), (1.1, 1.0), (1.2, 0.2), (1.3, 0.049), (1.4, 0.2), (1.3, 1.0)):
        model.command(law, t)
        assert law.reference is not None
        seen.append(law.reference[0])
    np.testing.assert_allclose(seen, [1.0, 0.8, 0.6, 0.6, 0.6, 0.6])
    law.reset()
    assert law.reference is None
