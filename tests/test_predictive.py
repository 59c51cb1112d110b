"""The predictive law: its predictions, its QP stated otherwise, and what it keeps where others act
too late.
"""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import cvxpy
import numpy as np
import pytest

from scenes import Straight
from vsconstraints.bench.families.frozen import TestSet
from vsconstraints.control import ControlStep, Model
from vsconstraints.controllers import HierarchicalQP, PredictiveControl, Tracking
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.prediction.kernels import last_plan
from vsconstraints.prediction.planner import Planner
from vsconstraints.rows import Array, Command, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, Trajectory, simulate
from vsconstraints.vision.tracking import TrackingGains

FIELDS = ("t", "q", "qd", "plan", "then", "made", "qdd")


def setup(name: str, **changes: Any) -> Setup:
    scenario = Scenario.load(name)
    for key, value in changes.items():
        scenario = scenario.with_override(key, value)
    return scenario.setup()


# --- predictions ---


def standing(n: int, most: float | Array = np.inf, **options: Any) -> Planner:
    """What plans for a robot at rest without rows, with a sampling period of 0.01 s."""
    model = Straight(Rows.none(n), Task(np.eye(n), np.zeros(n)))
    model.acceleration = np.full(n, most)
    return Planner(PredictiveControl(**options), cast(Model, model), 0.01, (n, n))


@pytest.mark.parametrize(("blocks", "block"), [(1, 1), (4, 1), (3, 5)])
def test_states_along_a_plan_are_those_of_a_double_integrator(blocks: int, block: int) -> None:
    rng = np.random.default_rng(1)
    Ts = 0.01
    n = 2
    plans = standing(n, horizon=blocks, block=block).plans
    plans.plan[:], plans.now[1:] = rng.normal(size=(blocks, n)), rng.normal(size=2 * n)
    count = last_plan.walk(plans)
    assert count == blocks + 1 + (block > 1) == len(set(plans.times[:count]))
    x = plans.now[1 : 1 + n].copy()
    v = plans.now[1 + n :].copy()
    t = 0.0
    found = {0.0: (x, v)}
    for k in range(blocks * block):
        u = plans.plan[k // block]
        x = x + Ts * v + Ts**2 / 2 * u
        v = v + Ts * u
        t = t + Ts
        found[round(t, 9)] = x, v
    for i, tau in enumerate(plans.times[:count]):
        np.testing.assert_allclose(plans.states[:, i], found[round(float(tau), 9)], atol=1e-14)


def test_after_the_plan_all_joints_brake_together() -> None:
    plans = standing(2, np.array([1.0, 2.0]), horizon=2, block=3).plans
    qd = plans.now[3:] = np.array([0.5, -0.4])
    count = last_plan.walk(plans)
    # half a second for the first joint, which has the longest way to go
    assert plans.times[count - 1] == pytest.approx(0.06 + 0.5)
    np.testing.assert_allclose(plans.states[:, count - 1], [qd * (0.06 + 0.25), [0.0, 0.0]])
    plans = standing(2, np.array([1.0, np.inf]), horizon=2, block=3).plans
    plans.now[3:] = qd
    assert last_plan.walk(plans) == count - 1


def test_a_plan_that_goes_on_is_the_mean_of_what_comes() -> None:
    plans = standing(1, 100.0, horizon=3, block=4).plans
    last_plan.set_box(plans, Rows.none(1))
    for after, means in ((0.01, [1.5, 3.5, 6.0]), (0.06, [4.0, 7.0, 9.0]), (0.0, [1.0, 3.0, 5.0])):
        plans.plan[:, 0] = [1.0, 3.0, 5.0]
        plans.then[:] = 9.0
        plans.made[:] = 2.0
        plans.now[0] = 2.0 + after
        last_plan.carry_on(plans)
        np.testing.assert_allclose(plans.plan[:, 0], means)


# --- the quadratic program ---


class Linear(Straight):
    """A model with σ = σ₀ + a q and an error that grows with q, of a robot at q₀, q̇₀."""

    def __init__(self, rows: Rows, task: Task, q: Array, qd: Array, K: float) -> None:
        super().__init__(rows, task)
        # those by which b falls: K_p = 4, K_v = 3
        self.task.gains = TrackingGains(4.0, damping=1.5)
        self.present = self.present._replace(q=q, qd=qd)
        self.K = np.full(len(rows.labels), K)

    def along(self, t: Array, q: Array, qd: Array) -> Any:
        """See :class:`Straight`."""
        a = self.rows.Lg / self.K[:, None]
        J = self.now.J
        seen = super().along(t, q, qd)
        sigma = self.rows.sigma + (q - self.present.q) @ a.T
        away = (q - self.present.q) @ J.T, (qd - self.present.qd) @ J.T
        parts = {name: getattr(seen, name) for name in seen.__slots__}
        parts.update(sigma=sigma, b=self.now.b - 4.0 * away[0] - 3.0 * away[1])
        return type(seen)(**parts)


def linear_problem(seed: int, most: float) -> tuple[PredictiveControl, Linear, Rows, Task]:
    rng = np.random.default_rng(seed)
    n = 3
    m = 4
    K = 0.2
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
    H = 4
    T = 0.05
    n = 3
    q = cvxpy.Variable((H + 2, n))
    qd = cvxpy.Variable((H + 1, n))
    u = cvxpy.Variable((H, n))
    a = rows.Lg / model.K[:, None]
    J = task.J
    kappa = 2.0 * T
    q0 = model.present.q
    qd0 = model.present.qd
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
    command = law.command(rows, task)
    assert command.status == "relaxed"
    assert "a by" in command.reason or "b by" in command.reason
    assert np.isfinite(command.qdd).all()
    assert np.abs(command.qdd).max() <= 8.0 + 1e-9


@pytest.mark.parametrize("name", ["panda-fov", "moving-sphere"])
def test_what_python_predicts_is_planned_alike(name: str) -> None:
    scene = setup(name)
    step = scene.control()
    other = scene.control()
    model = other.model()
    model.step = None  # as with a constraint in NumPy
    commands = []
    for control, of in ((step, step.model()), (other, model)):
        law = PredictiveControl()
        law.reset(period=scene.Ts, model=of)
        q = scene.q0.copy()
        qd = scene.qd0.copy()
        for k in range(5):
            seen = control.evaluate(k * scene.Ts, q, qd)
            commands.append(law.command(seen.rows, seen.task).qdd)
            q = q + scene.Ts * qd
            qd = qd + scene.Ts * commands[-1]
    np.testing.assert_allclose(commands[:5], commands[5:], rtol=1e-9, atol=1e-9)


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
    """Wabersich and Zeilinger (2021): nothing is changed, to the last bit, until the horizon meets
    a row.
    """
    scene = setup("example-2d-fov", duration=3.2)
    filtered = simulate(scene, PredictiveControl())
    tracking = simulate(scene, Tracking())
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


RECORDED = dict(np.load(Path(__file__).parent / "data" / "predictive-plans.npz"))


@pytest.mark.parametrize("key", sorted({name.rpartition("--")[0] for name in RECORDED}))
def test_plans_are_those_of_a_dense_program_with_states_eliminated(key: str) -> None:
    """A thousand samples of runs, planned by a Cholesky factorisation of all blocks and DAQP: the
    same to 1e-9.
    """
    t, q, qd, plan, then, made, wanted = (RECORDED[f"{key}--{name}"] for name in FIELDS)
    name, horizon, block = key.split("--")
    scene = setup(name)
    step = scene.control()
    law = PredictiveControl(horizon=int(horizon), block=int(block))
    planner = Planner(law, step.model(), scene.Ts, step.evaluate(t[0], q[0], qd[0]).task.J.shape)
    for k in range(len(t)):
        seen = step.evaluate(t[k], q[k], qd[k])
        planner.plans.plan[:], planner.plans.then[:], planner.plans.made[:] = (
            plan[k],
            then[k],
            made[k],
        )
        # begun with the rows that held another plan, some of them far away
        command = planner.solve(seen.rows, seen.task)
        np.testing.assert_allclose(
            command.qdd, wanted[k], atol=1e-9 * max(1.0, np.abs(wanted[k]).max())
        )


@pytest.mark.parametrize(
    "options", [{"horizon": 1, "block": 1}, {"horizon": 1}, {"horizon": 30, "block": 5}]
)
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


def test_a_long_plan_may_lead_far_outside_the_image() -> None:
    """There the rows of markers are 10¹² times their scale: the program has its answer all the
    same, and keeps rows.
    """
    (family,) = TestSet.load().chosen(("ur5",), "held-out", 1, None)["families"]
    setup = replace(family.scene(0).setup(), duration=0.4)
    law = PredictiveControl(horizon=20)
    run = simulate(setup, law, by_public_call=True)
    assert run.status != "failed"
    assert run.phi.max() < 0.0
    step = setup.control()
    answers = []
    law.reset(setup.Ts, step.model())
    for state in zip(run.t.tolist(), run.q, run.qd, strict=True):
        answers.append(step.command(law, *state)[1].status)
    assert set(answers) == {"ok"}


def test_the_same_twice_and_after_a_reset() -> None:
    scene = setup("example-2d-fov", duration=0.1)
    law = PredictiveControl()
    first = simulate(scene, law)
    again = simulate(scene, law)
    np.testing.assert_array_equal(first.qdd_command, again.qdd_command)
    law.reset()
    assert law.plan is None
    assert law.period == scene.Ts
    assert pickle.loads(pickle.dumps(law)).horizon == law.horizon


def test_disturbed_scenes_run() -> None:
    scene = setup(
        "case-study-6r",
        duration=0.02,
        **{"disturbances.pixel_noise": 0.3, "disturbances.focal_factor": [1.02, 1.02]},
    )
    run = simulate(scene, PredictiveControl(horizon=3))
    assert run.status == "unfinished"


# --- what cannot be used ---


def test_without_a_model_it_says_what_to_do() -> None:
    rows = Rows.none(2)
    task = Task(np.eye(2), np.zeros(2))
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
        ("weights", {"fov": -1.0}), ("weights", 3),
    ],
)  # fmt: skip
def test_options_that_cannot_be_used_are_refused(option: str, value: Any) -> None:
    with pytest.raises((InvalidInput, ConfigurationError), match=option):
        PredictiveControl(**{option: value})
    law = PredictiveControl()
    kept = getattr(law, option)
    with pytest.raises((InvalidInput, ConfigurationError)):
        setattr(law, option, value)
    assert getattr(law, option) == kept


# --- what is not checked twice ---


def asked(law: PredictiveControl, name: str, k: int) -> tuple[Rows, Task]:
    """Rows and task of a sample of the law's own run; it has a model of them, and no plan yet."""
    own = setup(name)
    run = simulate(own, PredictiveControl(), remarks=())
    step = ControlStep(own.scene, own.constraints, own.task)
    law.reset(period=own.Ts, model=step.model())
    evaluation = step.evaluate(float(run.t[k]), run.q[k], run.qd[k])
    return evaluation.rows, evaluation.task


@pytest.mark.parametrize(
    ("name", "k"), [("case-study-6r", 0), ("example-2d-fov", 400), ("example-2d-bowl", 300)]
)
def test_a_command_is_the_one_that_all_checks_in_numpy_let_pass(name: str, k: int) -> None:
    laws = PredictiveControl(), PredictiveControl()
    rows, task = asked(laws[0], name, k)
    _ = asked(laws[1], name, k)
    plain = laws[0].command(rows, task)
    checked = laws[1].define(rows, task)
    np.testing.assert_array_equal(plain.qdd, checked.qdd)
    np.testing.assert_array_equal(plain.acted, checked.acted)
    assert (plain.status, plain.reason, plain.remark) == (
        checked.status,
        checked.reason,
        checked.remark,
    )


@pytest.mark.parametrize(
    "part",
    [
        "rows.phi",
        "rows.Lg",
        "rows.Lf",
        "rows.switching_gain",
        "rows.scale",
        "rows.sigma",
        "task.J",
        "task.b",
    ],
)
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_bad_input_is_refused_by_name_though_the_compiled_law_is_asked_first(
    part: str, bad: float
) -> None:
    law = PredictiveControl()
    given = dict(zip(("rows", "task"), asked(law, "case-study-6r", 0), strict=True))
    of, _, name = part.partition(".")
    wrong = np.array(getattr(given[of], name))
    wrong.flat[-1] = bad
    given[of] = replace(given[of], **{name: wrong})
    with pytest.raises(InvalidInput, match=name):
        law.command(**given)


def test_a_law_of_ones_own_that_solves_otherwise_is_asked_by_all_checks() -> None:
    class Own(PredictiveControl):
        def solve(self, rows: Rows, task: Task) -> Command:
            return replace(super().solve(rows, task), qdd=np.full(task.J.shape[1], np.nan))

    law = Own()
    command = law.command(*asked(law, "case-study-6r", 0))
    assert command.status == "failed"
    assert not command.qdd.any()


def test_what_the_compiled_law_has_not_checked_is_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    law = PredictiveControl()
    rows, task = asked(law, "case-study-6r", 0)
    lost = Command(
        np.full(task.J.shape[1], np.nan),
        "suboptimal",
        np.zeros(len(rows.labels), dtype=np.bool_),
        rows.labels,
    )
    monkeypatch.setattr(Planner, "solve", lambda planner, rows, task: replace(lost))
    command = law.command(rows, task)
    assert command.status == "failed"
    assert not command.qdd.any()
