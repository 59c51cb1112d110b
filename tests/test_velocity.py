"""Rows and task in terms of joint speeds, and the laws that command these.

Rows are in tests/test_derivatives.py. Oracles: finite differences, cvxpy, numpy.linalg.pinv, and the published formulas of ViSP with
numbers worked out by hand.
"""

from __future__ import annotations

import inspect
import pickle
from dataclasses import replace
from typing import Any

import cvxpy as cp
import numpy as np
import pytest

from vsconstraints.arms import Job, driver_for, run_on_arm
from vsconstraints.compiled import load
from vsconstraints.controllers import (
    CONTROLLERS,
    VELOCITY_LAWS,
    Observed,
    ResolvedRate,
    ResolvedRateAvoidance,
    VelocityController,
    VelocityDamper,
    VelocityHierarchicalQP,
    VelocityQP,
    make_controller,
)
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.rows import Array, Command, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate
from vsconstraints.velocity import adaptive_gain, commands_velocity
from vsconstraints.velocity.avoidance import large_projection

NAMES = [law.name for law in VELOCITY_LAWS]
T_S = 0.01


def problem(seed: int, n: int = 6, k: int = 6, m: int = 5) -> tuple[Rows, Task]:
    """Return random rows and a task at a random speed."""
    rng = np.random.default_rng(seed)
    sigma, sigma_dot = rng.normal(size=(2, m))
    K = rng.uniform(0.1, 1.0, m)
    labels = tuple(f"range[joint {i + 1}].upper" for i in range(m))
    Lg = K[:, None] * rng.normal(size=(m, n))
    rows = Rows(
        sigma + K * sigma_dot, Lg, np.zeros(m), np.ones(m), labels, np.ones(m), sigma, sigma_dot, K
    )
    error, rate = rng.normal(size=(2, k))
    task = Task(rng.normal(size=(k, n)), np.zeros(k), error, rate, qd=rng.normal(size=n))
    return rows, task


def made(name: str, **options: Any) -> VelocityController:
    """Return a law that knows its period."""
    law = make_controller(name, options)
    assert isinstance(law, VelocityController)
    law.reset(period=T_S)
    return law


# --- rows and task ---


@pytest.mark.parametrize("name", ["ur5-fov", "ur5-image", "moving-target", "moving-sphere"])
def test_speeds_that_meet_the_task_let_the_error_decay(name: str) -> None:
    """ė of the next instant, by difference quotients, is −λ e at the speeds J q̇ = v."""
    setup = Scenario.load(name).setup()
    step = setup.world()
    rng = np.random.default_rng(3)
    t = 0.4
    q = setup.q0 + 0.01 * rng.normal(size=len(setup.q0))
    task = step.evaluate(t, q, 0.1 * rng.normal(size=len(q))).task
    J, v = task.velocity_form(1.7)
    qd = np.linalg.lstsq(J, v, rcond=None)[0]
    h = 1e-6
    ends = []
    for side in (-h, h):
        step.reset()
        ends.append(step.evaluate(t + side, q + side * qd, qd).error)
    rate = (ends[1] - ends[0]) / (2.0 * h)
    reached = -1.7 * task.error + (J @ qd - v)
    np.testing.assert_allclose(rate, reached, atol=2e-6 * (1.0 + np.abs(v).max()))


# --- laws against oracles ---


def test_resolved_rate_is_the_pseudoinverse() -> None:
    for seed, (n, k) in enumerate([(6, 6), (7, 6), (6, 8), (3, 6)]):
        rows, task = problem(seed, n, k)
        command = made("resolved-rate", gain=1.3).command(rows, task)
        drift = task.error_rate - task.J @ task.qd
        expected = np.linalg.pinv(task.J) @ (-1.3 * task.error - drift)
        np.testing.assert_allclose(command.qd, expected, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(command.qdd, (expected - task.qd) / T_S, rtol=1e-9, atol=1e-7)


def test_the_adaptive_gain_is_that_of_visp() -> None:
    """vpAdaptiveGain(4, 0.4, 30): a = 3.6, b = 30/3.6, c = 0.4; worked out at 0, 0.1 and 10."""
    assert adaptive_gain(0.0, 4.0, 0.4, 30.0) == 4.0
    assert adaptive_gain(0.1, 4.0, 0.4, 30.0) == pytest.approx(3.6 * 0.43459820850707825 + 0.4)
    assert adaptive_gain(10.0, 4.0, 0.4, 30.0) == pytest.approx(0.4)
    slope = (adaptive_gain(1e-6, 4.0, 0.4, 30.0) - 4.0) / 1e-6
    assert slope == pytest.approx(-30.0, rel=1e-4)
    assert adaptive_gain(0.3, 2.0, 2.0, 30.0) == 2.0
    law = made("resolved-rate", gain=0.4, gain_at_zero=4.0)
    assert law.gain_of(np.array([0.02, -0.1])) == adaptive_gain(0.1, 4.0, 0.4, 30.0)  # type: ignore[attr-defined]


def visp_projection(J: Array, e: Array) -> Array:
    """Eq. (24) of Marey and Chaumette (IROS 2010), term by term."""
    n = J.shape[1]
    classical = np.eye(n) - np.linalg.pinv(J) @ J
    of_norm = np.eye(n) - (J.T @ np.outer(e, e) @ J) / (e @ J @ J.T @ e)
    norm = np.linalg.norm(e)
    if norm < 0.1:
        share = 0.0
    elif norm > 0.7:
        share = 1.0
    else:
        share = 1.0 / (1.0 + np.exp(-12.0 * (norm - 0.1) / 0.6 + 6.0))
    projection: Array = share * of_norm + (1.0 - share) * classical
    return projection


@pytest.mark.parametrize("size", [0.05, 0.3, 2.0])
def test_the_large_projection_is_that_of_the_publication(size: float) -> None:
    rng = np.random.default_rng(5)
    J = rng.normal(size=(4, 6))
    e = rng.normal(size=4)
    e *= size / np.linalg.norm(e)
    np.testing.assert_allclose(
        large_projection(J, e, 1e-6), visp_projection(J, e), rtol=1e-10, atol=1e-12
    )


def visp_avoidance(q: Array, qd: Array, low: Array, high: Array, P: Array) -> Array:
    """q̇₂ of vpServo::secondaryTaskJointLimitAvoidance with its defaults, joint by joint."""
    rho, rho1, tune = 0.1, 0.3, 0.7
    q2 = np.zeros(len(q))
    for i in range(len(q)):
        span = high[i] - low[i]
        for sense, left in ((1.0, high[i] - q[i]), (-1.0, q[i] - low[i])):
            if left >= rho * span:
                continue
            along = P @ (sense * np.eye(len(q))[i])
            b = abs(qd[i]) / abs(along[i])
            if b >= 1.0:
                continue
            depth = (rho * span - left) / (rho * rho1 * span)
            share = 1.0 if depth > 1.0 else 1.0 / (1.0 + np.exp(-12.0 * depth + 6.0))
            q2 -= share * (1.0 + tune) * b * along
    return q2


@pytest.mark.parametrize("form", ["command", "define"])
@pytest.mark.parametrize("unit", [1.0, 0.4])
@pytest.mark.parametrize("at", [0.05, 0.09, 0.095])
def test_avoidance_is_that_of_visp(at: float, unit: float, form: str) -> None:
    """One joint is within the zone, at these shares of its range from the end, another outside.

    σ counts in units of which half the range has ``1 / unit``.
    """
    rng = np.random.default_rng(8)
    n = 6
    low, high = np.full(n, -2.0), np.full(n, 3.0)
    q = np.full(n, 0.4)
    q[1] = high[1] - at * 5.0
    q[4] = low[4] + 0.08 * 5.0
    half = 2.5
    scale = np.full(2 * n, 1.0 / unit)
    sigma = np.concatenate([(q - 0.5) / half - 1.0, (0.5 - q) / half - 1.0]) * scale
    K = np.full(2 * n, 0.1)
    Lg = np.vstack([np.eye(n), -np.eye(n)]) * 0.1 / half / unit
    labels = tuple(f"range[joint {i + 1}].{side}" for side in ("upper", "lower") for i in range(n))
    task = Task(
        rng.normal(size=(6, n)), np.zeros(6), 0.1 * rng.normal(size=6), np.zeros(6), qd=np.zeros(n)
    )
    rows = Rows(sigma, Lg, np.zeros(2 * n), np.ones(2 * n), labels, scale, sigma,
                np.zeros(2 * n), K)  # fmt: skip
    primary = made("resolved-rate", gain=0.2).command(rows, task).qd
    command = getattr(made("resolved-rate-avoidance", gain=0.2), form)(rows, task)
    expected = primary + visp_avoidance(q, primary, low, high, visp_projection(task.J, task.error))
    np.testing.assert_allclose(command.qd, expected, rtol=1e-9, atol=1e-12)
    assert not np.allclose(command.qd, primary)
    assert set(command.active) == {"range[joint 2].upper", "range[joint 5].lower"}


@pytest.mark.parametrize("seed", [*range(6), 8])
@pytest.mark.parametrize("name", ["velocity-qp", "velocity-damper"])
def test_quadratic_programs_are_solved_as_by_cvxpy(name: str, seed: int) -> None:
    """Rows that fit (1, 3, 5), also beside a box of accelerations (8), and rows that do not."""
    rows, task = problem(seed, m=4)
    limit = None if seed % 2 else 30.0
    weighted = {"task_weights": [1.0, 2.0, 0.5, 1.0, 3.0, 1.0]} if name == "velocity-qp" else {}
    weights = weighted.get("task_weights", [1.0] * 6)
    law = made(name, gain=1.5, damping=1e-3, max_acceleration=limit, **weighted)
    G, h = law.bounds(rows, task)  # type: ignore[attr-defined]
    J, v = task.velocity_form(1.5)
    x = cp.Variable(6)
    demands = h < 1e100
    missed = np.zeros(int(demands.sum()))
    box = [] if limit is None else [cp.abs(x - task.qd) <= limit * T_S]
    cost = cp.sum_squares(np.diag(weights) @ (J @ x - v)) + 1e-3 * cp.sum_squares(x)
    tight = {"tol_gap_abs": 1e-13, "tol_gap_rel": 1e-13, "tol_feas": 1e-13}
    program = cp.Problem(cp.Minimize(cost), [*box, G[demands] @ x <= h[demands]])
    program.solve(solver=cp.CLARABEL, **tight)
    command = law.command(rows, task)
    if program.status == cp.INFEASIBLE:
        assert command.status == "relaxed"
        s = cp.Variable(len(missed))
        least = [*box, G[demands] @ x <= h[demands] + s]
        cp.Problem(cp.Minimize(cp.sum_squares(s)), least).solve(solver=cp.CLARABEL, **tight)
        missed = s.value
        assert command.slack is not None
        np.testing.assert_allclose(command.slack[demands], np.maximum(missed, 0.0), atol=1e-6)
        # the violation of the first level is known to the accuracy of its solver
        bounds = h[demands] + np.maximum(missed, 0.0) + 1e-9
        program = cp.Problem(cp.Minimize(cost), [*box, G[demands] @ x <= bounds])
        program.solve(solver=cp.CLARABEL)
        np.testing.assert_allclose(command.qd, x.value, atol=1e-4)
    else:
        assert command.status == "ok"
        np.testing.assert_allclose(command.qd, x.value, rtol=1e-7, atol=1e-7)


def test_the_damper_is_that_of_faverjon_and_tournassoud() -> None:
    """ḋ ≥ −ξ (d − d_s)/(d_i − d_s) by hand: d = 0.2, d_i = 0.3, d_s = 0.1, ξ = 2 give ḋ ≥ −1."""
    rows = Rows(
        np.array([-0.2, -0.9]), 0.5 * np.eye(2), np.zeros(2), np.ones(2), ("near", "far"),
        np.ones(2), np.array([-0.2, -0.9]), np.zeros(2), np.full(2, 0.5),
    )  # fmt: skip
    task = Task(np.eye(2), np.zeros(2), np.array([-9.0, -9.0]), np.zeros(2), qd=np.zeros(2))
    law = VelocityDamper(gain=1.0, speed=2.0, influence=0.3, security=0.1, damping=1e-9)
    law.reset(period=T_S)
    np.testing.assert_allclose(law.command(rows, task).qd, [1.0, 9.0], rtol=1e-6)


@pytest.mark.parametrize("K", [[0.5, 0.5], [0.5, 0.1], [100.0, 100000.0], [1e-3, 2.0]])
@pytest.mark.parametrize("in_numpy", [True, False])
def test_dampers_that_contradict_each_other_do_not_depend_on_the_unit_of_k(
    K: list[float], in_numpy: bool
) -> None:
    """By hand: of σ = 0.2 and 0.1, and ∂σ/∂t = 0.1 of the first, with ξ = 1, d_i = 0.3, d_s = 0.

    q̇ ≤ −2/3 − 0.1 and −q̇ ≤ −1/3 miss by 1.1 together, and share it.
    """
    sigma = np.array([0.2, 0.1])
    drift = np.array([0.1, 0.0])
    gradient = np.array([[1.0, 0.0], [-1.0, 0.0]])
    factors = np.array(K)
    qd = np.array([0.7, -0.4])
    sigma_dot = gradient @ qd + drift
    rows = Rows(
        sigma + factors * sigma_dot, factors[:, None] * gradient, np.zeros(2), np.ones(2),
        ("a", "b"), np.ones(2), sigma, sigma_dot, factors,
    )  # fmt: skip
    task = Task(np.eye(2), np.zeros(2), np.array([-3.0, -3.0]), np.eye(2) @ qd, qd=qd)
    law = VelocityDamper(gain=1.0, damping=1e-9)
    law.reset(period=T_S)
    command = law.define(rows, task) if in_numpy else law.command(rows, task)
    assert command.status == "relaxed"
    np.testing.assert_allclose(command.qd, [-2.0 / 3.0 - 0.1 + 0.55, 3.0], atol=1e-6)
    assert command.slacks == pytest.approx({"a": 0.55, "b": 0.55})
    assert "exceeded, in units of σ per second" in command.reason


def test_priorities_of_speeds_are_strict_and_rows_that_contradict_are_shared() -> None:
    """x ≤ −1 and x ≥ 1 miss by 1 each, and the task of the other joint is met."""
    rows = Rows(
        np.array([1.0, 1.0]), np.array([[1.0, 0.0], [-1.0, 0.0]]), np.zeros(2), np.ones(2),
        ("a", "b"), np.ones(2), np.array([1.0, 1.0]), np.zeros(2), np.ones(2),
    )  # fmt: skip
    task = Task(np.eye(2), np.zeros(2), np.array([-3.0, -3.0]), np.zeros(2), qd=np.zeros(2))
    for law in (VelocityHierarchicalQP(gain=1.0), VelocityQP(gain=1.0, damping=1e-9)):
        law.reset(period=T_S)
        command = law.command(rows, task)
        assert command.status == "relaxed"
        assert command.slacks == pytest.approx({"a": 1.0, "b": 1.0})
        assert "no joint speed meets every row" in command.reason
        np.testing.assert_allclose(command.qd, [0.0, 3.0], atol=1e-6)


# --- contract ---


class Own(VelocityController):
    """Damped least squares, as a user writes it."""

    name = "own"

    def solve(self, rows: Rows, task: Task) -> Array:  # type: ignore[override]
        J, v = task.velocity_form(2.0)
        qd: Array = np.linalg.solve(J.T @ J + 1e-4 * np.eye(J.shape[1]), J.T @ v)
        return qd


@pytest.mark.parametrize("name", NAMES)
def test_without_speed_or_period_there_is_no_command(name: str) -> None:
    rows, task = problem(1)
    with pytest.raises(InvalidInput, match=r"uses the sampling period: call reset"):
        make_controller(name).command(rows, task)
    with pytest.raises(InvalidInput, match=r"uses task\.qd, which this task does not give"):
        made(name).command(rows, replace(task, qd=np.empty(0)))
    with pytest.raises(InvalidInput, match=r"task\.qd is not finite in row 5"):
        made(name).command(rows, replace(task, qd=np.append(task.qd[:5], np.nan)))


@pytest.mark.parametrize("name", NAMES)
def test_accelerations_are_differences_of_the_laws_own_commands(name: str) -> None:
    rows, task = problem(2)
    law = made(name)
    first = law.command(rows, task)
    second = law.command(rows, replace(task, error=0.9 * task.error, qd=task.qd + 1.0))
    np.testing.assert_allclose(second.qdd, (second.qd - first.qd) / T_S)
    law.reset()
    np.testing.assert_array_equal(law.command(rows, task).qdd, first.qdd)


@pytest.mark.parametrize("value", [np.full(6, np.nan), np.zeros(5), np.zeros(6, int), "fast", None])
def test_a_law_that_gives_no_speeds_fails(value: Any) -> None:
    law = Own()
    law.reset(period=T_S)
    law.solve = lambda rows, task: value  # type: ignore[method-assign]
    command = law.command(*problem(3))
    assert command.status == "failed"
    assert "not 6 finite joint speeds" in command.reason
    assert not command.qdd.any()
    assert not len(command.qd)


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("resolved-rate", {"gain": 0.0}, "gain must be a positive"),
        ("resolved-rate", {"gain": 3.0, "gain_at_zero": 1.0}, "gain_at_zero must be at least"),
        ("resolved-rate-avoidance", {"zone": 0.6}, "zone must be at most 0.5"),
        ("velocity-qp", {"max_acceleration": "all"}, "max_acceleration is a number"),
        ("velocity-damper", {"security": 0.4}, "security must be below influence"),
    ],
)
def test_unusable_options_are_named(name: str, options: dict[str, Any], words: str) -> None:
    with pytest.raises((ConfigurationError, InvalidInput), match=words):
        make_controller(name, options)


def test_wrappers_of_velocity_laws_command_velocities() -> None:
    law = VelocityQP()
    assert commands_velocity(Observed(law))
    assert not commands_velocity(make_controller("tracking"))


@pytest.mark.parametrize("name", ["resolved-rate-avoidance", "velocity-damper"])
def test_rows_without_sigma_are_refused_by_name(name: str) -> None:
    rows, task = problem(0, m=4)
    with pytest.raises(InvalidInput, match=r"rows\.sigma"):
        made(name).command(replace(rows, sigma=np.empty(0)), task)


# --- compiled ---

FORMS: list[dict[str, Any]] = [
    {},
    {"gain": 0.4, "gain_at_zero": 4.0},
    {"avoids": "all", "zone": 0.5},
    {"max_acceleration": 20.0},
    {"max_acceleration": "limits"},
    {"task_weights": [1.0, 2.0, 0.5, 1.0, 3.0, 1.0], "weights": {"range[joint 1]": 5.0}},
    {"influence": 1.5, "security": 0.1, "speed": 0.3},
]


def takes(name: str, options: dict[str, Any]) -> bool:
    """True if a law has these options."""
    return options.keys() <= inspect.signature(CONTROLLERS[name]).parameters.keys()


FORMS_OF_LAWS = [(name, each) for name in NAMES for each in FORMS if takes(name, each)]


@pytest.mark.skipif(load("laws") is None, reason="there is no compiler")
@pytest.mark.parametrize(("name", "options"), FORMS_OF_LAWS)
def test_compiled_laws_command_what_they_do_in_numpy(name: str, options: dict[str, Any]) -> None:
    """Sample by sample, each with the last command of its own; also with an arm's limits."""
    one, other = made(name, **options), made(name, **options)
    acted = 0
    for seed in range(30):
        n = 7 if seed % 10 < 3 else 6
        rows, task = problem(seed, n)
        if n == 6:
            limit = np.full(n, 15.0)
            rows = replace(rows, qdd_min=-limit, qdd_max=limit)
        expected = one.define(rows, task)
        found = other.compute(rows, task)
        if found is None:
            # the last command is of another arm, or the box that of another scene
            assert seed % 10 in (0, 3)
            found = other.define(rows, task)
        scale = 1.0 + np.linalg.norm(expected.qd)
        assert (found.status, found.labels) == (expected.status, expected.labels)
        np.testing.assert_array_equal(found.acted, expected.acted)
        np.testing.assert_allclose(found.qd, expected.qd, rtol=0.0, atol=1e-12 * scale)
        np.testing.assert_allclose(found.qdd, expected.qdd, rtol=0.0, atol=2e-12 * scale / T_S)
        np.testing.assert_array_equal(other.last, found.qd)
        assert found.reason == expected.reason
        acted += int(found.acted.sum())
    assert acted > 0 or "avoidance" in name or name == "resolved-rate"


@pytest.mark.skipif(load("laws") is None, reason="there is no compiler")
@pytest.mark.parametrize("name", ["velocity-qp", "velocity-damper"])
def test_a_task_beyond_the_memory_of_the_compiled_form_is_solved_in_numpy(name: str) -> None:
    """The quadratic program refers to arrays by address: they must not be allocated elsewhere."""
    rows, task = problem(0, 7)
    many = replace(
        task,
        J=np.tile(task.J, (200, 1)),
        b=np.tile(task.b, 200),
        error=np.tile(task.error, 200),
        error_rate=np.tile(task.error_rate, 200),
    )
    law = made(name)
    assert law.compute(rows, task) is not None
    assert law.compute(rows, many) is None
    expected = made(name).define(rows, many).qd
    np.testing.assert_allclose(made(name).command(rows, many).qd, expected, rtol=0.0, atol=0.0)


def test_what_a_subclass_overrides_counts() -> None:
    """A compiled form belongs to the class that declares it, and to its options as they are."""

    class Slow(VelocityQP):
        def task_of(self, task: Task) -> tuple[Array, Array]:
            J, v = super().task_of(task)
            return J, 0.5 * v

    rows, task = problem(1)
    law, slow = VelocityQP(), Slow()
    half = VelocityQP(gain=1.0)
    for each in (law, slow, half):
        each.reset(period=T_S)
    free = replace(task, error_rate=task.J @ task.qd)
    assert slow.compute(rows, free) is None
    np.testing.assert_allclose(slow.command(rows, free).qd, half.command(rows, free).qd)
    law.command(rows, free)
    law.gain = 1.0
    np.testing.assert_array_equal(law.command(rows, free).qd, half.command(rows, free).qd)
    law.solve = lambda rows, task: np.ones(6)  # type: ignore[method-assign, assignment, return-value]
    np.testing.assert_array_equal(law.command(rows, free).qd, np.ones(6))


def test_a_failed_command_of_a_compiled_law_is_not_its_last() -> None:
    rows, task = problem(4)
    law = made("velocity-qp")
    first = law.command(rows, task).qd
    with pytest.raises(InvalidInput, match=r"task\.qd is not finite"):
        law.command(rows, replace(task, qd=np.full(6, np.inf)))
    np.testing.assert_array_equal(law.last, first)
    copied = pickle.loads(pickle.dumps(law))
    np.testing.assert_array_equal(copied.last, first)
    copied.command(rows, replace(task, error=2.0 * task.error))
    np.testing.assert_array_equal(law.last, first)


ARMS: dict[str, dict[str, Any]] = {
    "velocities": {"arm": {"command": "velocity", "lag": 0.02, "acceleration": 8.0}},
    "positions": {"arm": {"command": "position", "lag": 0.02, "acceleration": 8.0, "rate": 250.0}},
    "accelerations": {"limits": {"acceleration": 8.0}},
    "late": {"limits": {"acceleration": 8.0}, "disturbances": {"command_delay": 0.003}},
    "mass": {
        "arm": {"command": "velocity", "lag": 0.02, "acceleration": 8.0},
        "plant": {"type": "dynamics", "effort": 1e4},
    },
}


@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.parametrize("law", [ResolvedRate, ResolvedRateAvoidance, VelocityQP, VelocityDamper])
def test_the_compiled_loop_is_the_one_in_python(law: type[VelocityController], arm: str) -> None:
    """A subclass is not compiled."""
    scene = Scenario.load("ur5-fov").with_override("duration", 0.2)
    for key, value in ARMS[arm].items():
        scene = scene.with_override(key, value)
    setup = scene.setup()
    compiled = simulate(setup, law())
    in_python = simulate(setup, type("Plain", (law,), {})())
    assert (compiled.compiled, in_python.compiled) == (load("compiler").compiles(), False)
    assert compiled.status == in_python.status
    np.testing.assert_allclose(compiled.q, in_python.q, rtol=0.0, atol=1e-12)
    scale = np.abs(in_python.qdd_command).max()
    np.testing.assert_allclose(
        compiled.qdd_command, in_python.qdd_command, rtol=0.0, atol=1e-11 * scale
    )


# --- in scenes ---


def velocity_arm(**arm: Any) -> Scenario:
    """Return half a second of the UR5 with an arm that takes velocities."""
    scene = Scenario.load("ur5-fov").with_override("duration", 0.2)
    return scene.with_override("arm", {"command": "velocity", "lag": 0.02, **arm})


@pytest.mark.parametrize("law", [*(make_controller(name) for name in NAMES), Own()], ids=str)
def test_velocity_laws_run_in_scenes(law: VelocityController) -> None:
    run = simulate(velocity_arm(acceleration=8.0).setup(), law)
    assert run.status == "unfinished", run.reason
    assert np.abs(np.diff(run.qd, axis=0)).max() <= 8.0 * 0.002 * (1.0 + 1e-9)


class SaysItIsCalm(Own):
    """Commands speeds that jump, and claims accelerations of zero."""

    def solve(self, rows: Rows, task: Task) -> Command:  # type: ignore[override]
        qd = super().solve(rows, task) * (1.0 if len(self.last) else 0.5)
        m = len(rows.labels)
        return Command(np.zeros(len(qd)), "ok", np.ones(m, np.bool_), rows.labels, qd=qd)


def test_claimed_accelerations_do_not_count() -> None:
    """The scores are those of the commanded speeds: of the honest law, after the first jump."""
    setup = velocity_arm(acceleration=8.0).setup()
    honest, cheat = (simulate(setup, law) for law in (Own(), SaysItIsCalm()))
    assert np.abs(cheat.qdd_command[:2]).max() > np.abs(honest.qdd_command[1:]).max()
    np.testing.assert_array_equal(cheat.active[0], honest.active[0])


def test_a_velocity_law_runs_on_an_arm() -> None:
    """The setpoints sent are its speeds, as far as the limits of the arm allow."""
    setup = velocity_arm(acceleration=40.0).setup()
    law = ResolvedRate(gain=0.5)
    _, log = run_on_arm(Job(setup, law, driver_for("simulated://", setup)))
    assert log.ended == "done", log.cause
    on_arm = np.array([period.sent_qd for period in log.periods if not period.braking])
    run = simulate(setup, ResolvedRate(gain=0.5))
    np.testing.assert_allclose(on_arm[-1], law.last, atol=1e-9)
    assert np.abs(on_arm[50] - run.qd[50]).max() < 0.05


def test_an_arm_without_limits_refuses_velocity_laws() -> None:
    scene = Scenario.load("ur5-fov").with_override("limits", {})
    with pytest.raises(ConfigurationError, match=r'arm = \{ command = "velocity", lag = 0.02'):
        simulate(scene.setup(), VelocityQP())
