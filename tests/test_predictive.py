"""The predictive law: its predictions, its QP stated otherwise, and what it keeps where others act too late."""

from __future__ import annotations

import pickle
from typing import Any, cast

import cvxpy
import numpy as np
import pytest

from scenes import Straight
from vsconstraints.control import ControlStep, Model
from vsconstraints.controllers import HierarchicalQP, PredictiveControl, Tracking, condensed, predictive
from vsconstraints.controllers.horizon import Horizon
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.rows import Array, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, Trajectory, simulate


def setup(name: str, **changes: Any) -> Setup:
    scenario = Scenario.load(name)
    for key, value in changes.items():
        scenario = scenario.with_override(key, value)
    return scenario.setup()


# --- predictions ---


@pytest.mark.parametrize(("blocks", "block"), [(1, 1), (4, 1), (3, 5)])
def test_states_along_a_plan_are_those_of_a_double_integrator(blocks: int, block: int) -> None:
    rng, Ts, n = np.random.default_rng(1), 0.01, 2
    horizon = Horizon.of(blocks, block, Ts)
    plan, q, qd = rng.normal(size=(blocks, n)), rng.normal(size=n), rng.normal(size=n)
    at = horizon.instants(q, qd, plan, np.full(n, np.inf))
    assert at.braking == len(at.times) == len(set(at.times))
    x, v, t = q.copy(), qd.copy(), 0.0
    found = {0.0: (x, v)}
    for k in range(blocks * block):
        u = plan[k // block]
        x, v, t = x + Ts * v + Ts**2 / 2 * u, v + Ts * u, t + Ts
        found[round(t, 9)] = x, v
    for i, tau in enumerate(at.times):
        np.testing.assert_allclose(at.q[i], found[round(float(tau), 9)][0], atol=1e-14)
        np.testing.assert_allclose(at.qd[i], found[round(float(tau), 9)][1], atol=1e-14)


def test_after_the_plan_all_joints_brake_together() -> None:
    horizon, most = Horizon.of(2, 3, 0.01), np.array([1.0, 2.0])
    plan, q, qd = np.zeros((2, 2)), np.zeros(2), np.array([0.5, -0.4])
    at = horizon.instants(q, qd, plan, most)
    # half a second for the first joint, which has the longest way to go
    assert at.times[-1] == pytest.approx(0.06 + 0.5)
    np.testing.assert_allclose(at.q[-1], qd * (0.06 + 0.25))
    np.testing.assert_array_equal(at.qd[-1], 0.0)
    np.testing.assert_allclose(at.Q[-1], at.Q[-2] + 0.25 * at.V[-2])
    np.testing.assert_array_equal(at.V[-1], 0.0)
    assert len(horizon.instants(q, qd, plan, np.array([1.0, np.inf])).times) == at.braking


def test_a_plan_that_goes_on_is_the_mean_of_what_comes() -> None:
    horizon = Horizon.of(3, 4, 0.01)
    plan, then = np.array([[1.0], [3.0], [5.0]]), np.array([9.0])
    np.testing.assert_allclose(horizon.later(plan, then, 0.01), [[1.5], [3.5], [6.0]])
    np.testing.assert_allclose(horizon.later(plan, then, 0.06), [[4.0], [7.0], [9.0]])
    np.testing.assert_array_equal(horizon.later(plan, then, 0.0), plan)


# --- the quadratic program ---


class Linear(Straight):
    """A model with σ = σ₀ + a q and an error that grows with q, of a robot at q₀, q̇₀."""

    def __init__(self, rows: Rows, task: Task, q: Array, qd: Array, K: float) -> None:
        super().__init__(rows, task)
        self.present = self.present._replace(q=q, qd=qd)
        self.K = np.full(len(rows.labels), K)

    def along(self, t: Array, q: Array, qd: Array) -> Any:
        """See :class:`Straight`."""
        a, J = self.rows.Lg / self.K[:, None], self.task.J
        seen = super().along(t, q, qd)
        sigma = self.rows.sigma + (q - self.present.q) @ a.T
        away = (q - self.present.q) @ J.T, (qd - self.present.qd) @ J.T
        parts = {name: getattr(seen, name) for name in seen.__slots__}
        parts.update(sigma=sigma, b=self.task.b - 4.0 * away[0] - 3.0 * away[1])
        return type(seen)(**parts)

    def gains(self, error: Array) -> Array:
        """Those by which b falls."""
        return np.tile([4.0, 3.0], (len(error), 1))


def linear_problem(seed: int, most: float) -> tuple[PredictiveControl, Linear, Rows, Task]:
    rng, n, m, K = np.random.default_rng(seed), 3, 4, 0.2
    rows = Rows(
        phi=np.zeros(m),
        Lg=K * rng.normal(size=(m, n)),
        Lf=np.zeros(m),
        switching_gain=np.ones(m),
        labels=tuple("abcd"),
        sigma=-rng.uniform(0.05, 0.3, m),
    )
    task = Task(rng.normal(size=(n, n)), 5.0 * rng.normal(size=n))
    model = Linear(rows, task, rng.normal(size=n), 0.3 * rng.normal(size=n), K)
    law = PredictiveControl(horizon=4, block=5, approach=2.0, max_acceleration=most)
    law.reset(period=0.01, model=cast(Model, model))
    return law, model, rows, task


@pytest.mark.parametrize("seed", range(6))
def test_the_condensed_program_is_the_one_with_states(seed: int) -> None:
    law, model, rows, task = linear_problem(seed, most=8.0)
    # the model is linear, so that one iteration is exact, but for the time of braking
    for _ in range(20):
        command = law.command(rows, task)
    H, T, n = 4, 0.05, 3
    q, qd, u = cvxpy.Variable((H + 2, n)), cvxpy.Variable((H + 1, n)), cvxpy.Variable((H, n))
    a, J, kappa = rows.Lg / model.K[:, None], task.J, 2.0 * T
    q0, qd0 = model.present.q, model.present.qd
    asked: list[Any] = [q[0] == q0, qd[0] == qd0, cvxpy.abs(u) <= 8.0]
    after = q0 + 0.01 * qd0 + 0.01**2 / 2 * u[0]
    residuals = []

    def sigma(there: Any) -> Any:
        return rows.sigma + a @ (there - q0)

    asked.append(sigma(after) <= np.exp(-0.01 / kappa) * rows.sigma)
    asked.append(sigma(q[1]) <= np.exp(-0.04 / kappa) * sigma(after))
    for k in range(H):
        asked += [q[k + 1] == q[k] + T * qd[k] + T**2 / 2 * u[k], qd[k + 1] == qd[k] + T * u[k]]
        if k > 0:
            asked.append(sigma(q[k + 1]) <= np.exp(-T / kappa) * sigma(q[k]))
        residuals.append(J @ u[k] - task.b + 4.0 * J @ (q[k] - q0) + 3.0 * J @ (qd[k] - qd0))
    assert law.plan is not None
    last = qd0 + T * law.plan.qdd.sum(axis=0)
    stops = float(np.abs(last).max()) / 8.0
    asked.append(sigma(q[H] + 0.5 * stops * qd[H]) <= 0.0)
    damping = 1e-6 * float(np.sum(J**2))
    total = sum(cvxpy.sum_squares(r) for r in residuals) + damping * cvxpy.sum_squares(u)
    problem = cvxpy.Problem(cvxpy.Minimize(total), asked)
    problem.solve(solver="CLARABEL")
    assert problem.status == "optimal"
    assert command.status == "ok"
    np.testing.assert_allclose(law.plan.qdd, u.value, rtol=2e-3, atol=2e-3)


def test_rows_that_contradict_each_other_are_violated_least_and_named() -> None:
    law, model, rows, task = linear_problem(1, most=8.0)
    rows.Lg[1], rows.Lg[0] = -rows.Lg[0], rows.Lg[0]
    # both are outside, on opposite sides: σ of the two adds up to 0.4 whatever is planned
    rows.sigma[:2] = 0.2
    model.rows.sigma[:2] = 0.2
    for solver in ("daqp", "proxqp"):
        law.solver = solver
        command = law.command(rows, task)
        assert command.status == "relaxed"
        assert "a by" in command.reason or "b by" in command.reason
        assert np.isfinite(command.qdd).all()
        assert np.abs(command.qdd).max() <= 8.0 + 1e-9


def test_other_solvers_find_the_same_plan() -> None:
    plans = []
    for solver in ("daqp", "proxqp", "osqp", "piqp"):
        law, _, rows, task = linear_problem(2, most=8.0)
        try:
            law.solver = solver
        except ConfigurationError:
            continue  # not installed here
        assert law.command(rows, task).status == "ok"
        assert law.plan is not None
        plans.append(law.plan.qdd)
    assert len(plans) >= 3
    for plan in plans[1:]:
        np.testing.assert_allclose(plan, plans[0], atol=1e-3)


# --- in the loop ---


def excess(run: Trajectory) -> float:
    """Greatest σ of a run, of rows on φ itself φ."""
    return float(run.sigma.max())


@pytest.mark.parametrize("name", ["example-2d-fov", "example-2d-fast", "ur5-fov", "panda-fov"])
def test_it_holds_what_the_barrier_holds(name: str) -> None:
    scene = setup(name, duration=1.0)
    assert excess(simulate(scene, PredictiveControl())) <= 0.0


def test_it_holds_the_case_study() -> None:
    run = simulate(setup("case-study-6r", duration=3.0), PredictiveControl())
    assert excess(run) <= 0.0
    # it uses the space: what is challenged comes close to its bounds
    assert run.clearance.min() < 1e-3


def test_a_safety_filter_lets_a_motion_pass_that_is_safe() -> None:
    """Wabersich and Zeilinger (2021): nothing is changed, to the last bit, until the horizon meets a row."""
    scene = setup("example-2d-fov", duration=3.2)
    filtered, tracking = simulate(scene, PredictiveControl()), simulate(scene, Tracking())
    horizon = PredictiveControl().horizon * PredictiveControl().block
    contact = int(np.argmax(tracking.sigma.max(axis=1) > 0.0))
    first = int(np.argmax((filtered.qdd_command != tracking.qdd_command).any(axis=1)))
    assert contact - 2 * horizon < first < contact
    np.testing.assert_array_equal(filtered.qdd_command[:first], tracking.qdd_command[:first])
    assert "predictive safety filter" in cast(str, PredictiveControl.__doc__)


def test_it_brakes_in_time_where_the_barrier_acts_too_late() -> None:
    scene = setup("example-2d-fast", duration=3.0)
    late = simulate(scene, HierarchicalQP(max_acceleration=0.5))
    ahead = simulate(scene, PredictiveControl(max_acceleration=0.5))
    assert late.clearance.min() < -5.0
    assert ahead.clearance.min() >= 0.0
    assert np.abs(ahead.qdd_command).max() <= 0.5 + 1e-9


def test_a_linearisation_that_is_frozen_does_not_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    """Gradients of a hyperellipse of exponent 16 say nothing of where it will be exceeded."""
    anew = condensed.look_ahead

    def frozen(rows: Rows, task: Task, seen: Any, at: Any, plan: Array, K: Array) -> condensed.Lookahead:
        ahead = anew(rows, task, seen, at, plan, K)
        now = ahead.gradient[0]
        moved = np.where((K == 0.0)[None, :], (at.qd - at.qd[0]) @ now.T, (at.q - at.q[0]) @ now.T)
        return ahead._replace(value=ahead.value[0] + moved, gradient=np.array([now] * len(ahead.gradient)))

    scene, law = setup("example-2d-fast", duration=3.0), PredictiveControl(max_acceleration=0.5)
    assert excess(simulate(scene, law)) <= 0.0
    monkeypatch.setattr(predictive, "look_ahead", frozen)
    assert excess(simulate(scene, law)) > 0.01


@pytest.mark.parametrize("options", [{"horizon": 1, "block": 1}, {"horizon": 1}, {"horizon": 30, "block": 5}])
def test_both_extremes_of_the_horizon(options: dict[str, Any]) -> None:
    run = simulate(setup("example-2d-fov", duration=0.3), PredictiveControl(**options))
    assert run.status == "unfinished"
    assert excess(run) <= 0.0


def test_a_marker_behind_the_camera_shortens_the_horizon() -> None:
    scene = setup("case-study-6r")
    step = ControlStep(scene.scene, scene.constraints, scene.task)
    law = PredictiveControl(horizon=10, block=100, max_acceleration=0.1)
    law.reset(period=0.002)
    # so fast that the camera will have turned away, whatever is planned
    qd = scene.qd0 + 3.0 * np.eye(6)[0]
    _, command = step.command(law, 0.0, scene.q0, qd)
    assert "predicted" in command.remark + command.reason
    assert np.isfinite(command.qdd).all()
    assert np.abs(command.qdd).max() <= 0.1 + 1e-9


def test_the_same_twice_and_after_a_reset() -> None:
    scene = setup("example-2d-fov", duration=0.1)
    law = PredictiveControl()
    first, again = simulate(scene, law), simulate(scene, law)
    np.testing.assert_array_equal(first.qdd_command, again.qdd_command)
    law.reset()
    assert law.plan is None
    assert law.period == scene.Ts
    assert pickle.loads(pickle.dumps(law)).horizon == law.horizon


def test_disturbed_scenes_run() -> None:
    scene = setup(
        "case-study-6r", duration=0.02, **{"disturbances.pixel_noise": 0.3, "disturbances.focal_factor": [1.02, 1.02]}
    )
    run = simulate(scene, PredictiveControl(horizon=3))
    assert run.status == "unfinished"


# --- what cannot be used ---


def test_without_a_model_it_says_what_to_do() -> None:
    rows, task = Rows.none(2), Task(np.eye(2), np.zeros(2))
    law = PredictiveControl()
    with pytest.raises(InvalidInput, match=r"uses a model.*reset\(model=step\.model\(\)\)"):
        law.command(rows, task)
    law.reset(model=cast(Model, Straight(rows, task)))
    with pytest.raises(InvalidInput, match=r"sampling period.*reset\(period"):
        law.command(rows, task)
    law.reset(period=0.01)
    assert law.command(rows, task).status == "ok"
    other = Rows(np.zeros(1), np.ones((1, 2)), np.zeros(1), np.ones(1), ("other",))
    with pytest.raises(InvalidInput, match="model of other rows"):
        law.command(other, task)


@pytest.mark.parametrize(
    ("option", "value"),
    [
        *(("horizon", value) for value in (0, -1, 2.0, True, 101, None, "10")),
        *(("block", value) for value in (0, 1.5, 10_001)),
        *((name, value) for name in ("approach", "damping") for value in (0.0, -1.0, np.nan, np.inf, None, "1")),
        *(("max_acceleration", value) for value in (0.0, -1.0, np.nan)),
        ("weights", {"fov": -1.0}), ("weights", 3), ("solver", "none-such"),
    ],
)  # fmt: skip
def test_options_that_cannot_be_used_are_refused(option: str, value: Any) -> None:
    with pytest.raises((InvalidInput, ConfigurationError), match=option if option != "solver" else "none-such"):
        PredictiveControl(**{option: value})
    law = PredictiveControl()
    kept = getattr(law, option)
    with pytest.raises((InvalidInput, ConfigurationError)):
        setattr(law, option, value)
    assert getattr(law, option) == kept
