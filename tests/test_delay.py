"""Laws that are told how late their commands act do what they would do with no delay, that much
later.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from vsconstraints.compiled import load
from vsconstraints.compiled.workspace import RowArrays
from vsconstraints.controllers import (
    CONTROLLERS,
    VELOCITY_LAWS,
    Controller,
    DelayCompensated,
    HierarchicalQP,
    Observed,
    Tracking,
    make_controller,
)
from vsconstraints.controllers.delay import split_delay
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

STATIC = Scenario.load("ur5-fov").with_override("duration", 0.3)
PERIOD = STATIC.setup().Ts
DELAYS = 0.5 * PERIOD, 17.3 * PERIOD


def late(delay: float, scenario: Scenario = STATIC) -> Scenario:
    return scenario.with_override("disturbances.command_delay", delay)


ARMS = (
    ("arm", {"command": "velocity", "rate": 10.0 / PERIOD, "acceleration": 1e8}),
    ("limits", {"acceleration": 8.0}),
    ("limits", {"acceleration": 1e5, "known": False}),
)
ACCELERATION_LAWS = [name for name, law in CONTROLLERS.items() if law not in VELOCITY_LAWS]


@pytest.mark.parametrize("law", VELOCITY_LAWS, ids=lambda law: law.name)
@pytest.mark.parametrize("periods", [1.0, 17.3])
@pytest.mark.parametrize("arm", ARMS, ids=["velocities", "accelerations", "unknown limits"])
def test_commanded_speeds_are_those_without_a_delay(
    law: type[Controller], periods: float, arm: tuple[str, dict[str, Any]]
) -> None:
    """In a compiled loop, and in a loop of calls.

    An arm of velocities takes ten commands a period and has their speeds at once; one of
    accelerations reaches them within a period.
    """
    scenario = STATIC.with_override(*arm)
    delay = periods * PERIOD
    plain = simulate(scenario.setup(), make_controller(law.name))
    told = make_controller(law.name, {"command_delay": delay})
    runs = [
        simulate(late(delay, scenario).setup(), told, by_public_call=by_calls)
        for by_calls in (False, True)
    ]
    scale = np.abs(plain.qdd_command).max()
    for run in runs:
        assert run.compiled == plain.compiled
        n = min(len(plain.t), len(run.t))
        assert n > 0.9 * STATIC.setup().duration / PERIOD
        np.testing.assert_allclose(run.qdd_command[:n], plain.qdd_command[:n], atol=1e-7 * scale)
    blind = simulate(late(delay, scenario).setup(), make_controller(law.name)).qdd_command
    n = min(len(blind), len(plain.t))
    assert np.abs(blind[:n] - plain.qdd_command[:n]).max() > 1e-3 * scale


@pytest.mark.parametrize("name", ACCELERATION_LAWS)
@pytest.mark.parametrize("delay", DELAYS)
def test_the_commands_are_those_without_a_delay(name: str, delay: float) -> None:
    """From rest, nothing but the time at which they act is another one, since nothing in the scene
    depends on time.
    """
    plain = simulate(STATIC.setup(), make_controller(name))
    told = simulate(late(delay).setup(), make_controller(name, {"command_delay": delay}))
    assert told.compiled == plain.compiled
    scale = np.abs(plain.qdd_command).max()
    n = min(len(plain.t), len(told.t))
    assert n > 0.9 * STATIC.setup().duration / PERIOD
    np.testing.assert_allclose(told.qdd_command[:n], plain.qdd_command[:n], atol=1e-7 * scale)
    blind = simulate(late(delay).setup(), make_controller(name)).qdd_command
    n = min(len(blind), len(plain.t))
    assert np.abs(blind[:n] - plain.qdd_command[:n]).max() > 1e-3 * scale


@pytest.mark.parametrize(
    "disturbances", [{"depth_factor": 1.2}, {"gradient_error": 0.3}, {"delay": 3}, {}]
)
@pytest.mark.parametrize(
    "options", [{"command_delay": 0.0213}, {"command_delay": 0.0213, "observer": 0.1}]
)
@pytest.mark.parametrize("name", ["hierarchical-qp", "predictive"])
def test_compiled_and_by_calls_alike(
    disturbances: dict[str, Any], options: dict[str, float], name: str
) -> None:
    """Where what is believed is wrong, something moves unknown to the model, and joints have
    limits.
    """
    scenario = late(0.02, Scenario.load("moving-sphere").with_override("duration", 0.8))
    scenario = scenario.with_override("constraints.0.motion.known", False)
    for key, value in disturbances.items():
        scenario = scenario.with_override(f"disturbances.{key}", value)
    setup = scenario.setup()
    whole = simulate(setup, make_controller(name, options))
    by_calls = simulate(setup, make_controller(name, options), by_public_call=True)
    assert whole.compiled
    np.testing.assert_allclose(whole.qdd_command, by_calls.qdd_command, atol=1e-6)


@given(
    st.floats(0.05, 12.0) | st.sampled_from([1e-15, 1.0, 3.0]), st.booleans(), st.integers(0, 20)
)
@settings(max_examples=40)
def test_the_state_when_a_command_begins_to_act(periods: float, frozen: bool, sent: int) -> None:
    """By superposition: a command that acts from a to b moves q by u ((D − a)² − (D − b)²)/2 within
    D.
    """
    kernels = load("delay")
    Ts = 0.01
    rng = np.random.default_rng(sent)
    D = periods * Ts
    u = rng.standard_normal((sent, 2))
    q = np.array([0.3, -1.0])
    qd = np.array([0.7, 2.0])
    own = kernels.DelayArrays.of(2, (0, 0, 0), frozen, Ts, split_delay("a delay", D, Ts))
    rows = RowArrays(*[np.zeros(0)] * 8, np.full(2, -1.0), np.full(2, 1.5))
    for each in u:
        kernels.send(own, rows, each)
    own.now[:] = 5.0, *q, *qd
    kernels.foresee(own)
    begins = D - Ts * np.arange(sent, 0, -1)  # from now; of the last it is D − T_s
    a = np.clip(begins, 0.0, D)
    b = np.clip(begins + Ts, 0.0, D)
    bounded = np.clip(u, -1.0, 1.5)
    assert own.now[0] == 5.0 + (0.0 if frozen else D)
    np.testing.assert_allclose(
        own.now[1:3], q + D * qd + 0.5 * ((D - a) ** 2 - (D - b) ** 2) @ bounded, atol=1e-12
    )
    np.testing.assert_allclose(own.now[3:], qd + (b - a) @ bounded, atol=1e-12)


@pytest.mark.parametrize("periods", [0.4, 1.0, 2.3])
def test_an_arm_of_accelerations_reaches_commanded_speeds_within_a_period(periods: float) -> None:
    """The arm is integrated by SciPy: q̈ is constant for a period and |q̈| ≤ 30, from D on."""
    kernels = load("delay")
    Ts = 0.01
    D = periods * Ts
    rows = RowArrays(*[np.zeros(0)] * 8, np.full(1, -30.0), np.full(1, 30.0))
    own = kernels.DelayArrays.of(
        1, (0, 0, 0), False, Ts, split_delay("a delay", D, Ts), speeds=True
    )
    rng = np.random.default_rng(1)
    accelerations: list[float] = []

    def state(end: float) -> Any:
        """Return q and q̇ at a time."""
        x = np.array([0.3, 0.7])
        begin = 0.0
        for k, qdd in enumerate([0.0, *accelerations]):
            until = min(end, D + k * Ts)
            if until > begin:
                motion = solve_ivp(
                    lambda t, x, qdd: [x[1], qdd], (begin, until), x, args=(qdd,), rtol=1e-12
                )
                x = motion.y[:, -1]
                begin = until
        return x

    for k in range(12):
        own.now[:] = k * Ts, *state(k * Ts)
        kernels.foresee(own)
        acts = state(k * Ts + D)
        np.testing.assert_allclose(own.now, [k * Ts + D, *acts], atol=1e-9)
        speed = rng.normal()
        kernels.send(own, rows, np.array([speed]))
        accelerations.append(float(np.clip((speed - acts[1]) / Ts, -30.0, 30.0)))
    assert 0 < sum(abs(qdd) == 30.0 for qdd in accelerations) < 12


def test_no_command_leaves_the_bounds_of_now() -> None:
    limited = STATIC.with_override("limits", {"acceleration": 5.0, "jerk": 400.0})
    run = simulate(
        late(0.02, limited).setup(), make_controller("hierarchical-qp", {"command_delay": 0.02})
    )
    plain = simulate(limited.setup(), make_controller("hierarchical-qp"))
    assert run.status == plain.status
    assert np.abs(run.qdd_command).max() <= 5.0 * (1 + 1e-9)
    assert np.abs(np.diff(run.qdd_command, axis=0)).max() <= 400.0 * PERIOD * (1 + 1e-9)


def test_every_command_under_way_is_forgotten_at_a_reset() -> None:
    setup = late(DELAYS[1]).setup()
    law = make_controller("hierarchical-qp", {"command_delay": DELAYS[1]})
    once = simulate(setup, law).qdd_command
    np.testing.assert_array_equal(simulate(setup, law).qdd_command, once)


def test_by_a_control_step_with_options_that_change() -> None:
    """Also those of the law inside two others."""
    step = STATIC.setup().control()
    setup = STATIC.setup()
    law = DelayCompensated(Observed(HierarchicalQP()), command_delay=0.02)
    law.reset(period=PERIOD)
    q = setup.q0
    qd = np.full(len(setup.q0), 0.3)
    bounds, command = step.command(law, 0.0, q, qd)
    step.evaluate(0.0, q, qd)
    rows, task = _rows(step, q + 0.02 * qd, qd)
    ahead = HierarchicalQP().command(
        replace(rows, qdd_min=bounds.rows.qdd_min, qdd_max=bounds.rows.qdd_max), task
    )
    np.testing.assert_allclose(command.qdd, ahead.qdd, atol=1e-9)
    inner: Any = law.law.law  # type: ignore[attr-defined]
    inner.margin = 0.2
    _, changed = step.command(law, 0.0, q, qd)
    assert np.abs(changed.qdd - command.qdd).max() > 1e-3


def _rows(step: Any, q: Any, qd: Any) -> tuple[Any, Any]:
    seen = step.model().at(0.02, q, qd)
    return seen.rows, seen.task


def test_where_the_state_cannot_be_foreseen_the_law_gets_what_is_there() -> None:
    setup = STATIC.setup()
    step = setup.control()
    law = make_controller("tracking", {"command_delay": 0.2})
    law.reset(period=PERIOD)
    away = np.zeros(len(setup.q0))
    away[3] = 5.0 * np.pi  # the camera then looks the other way
    evaluation, command = step.command(law, 0.0, setup.q0, away)
    assert (
        "the state at which the command acts could not be predicted: not in front of the camera: marker 1"
        in command.remark
    )
    plain = Tracking().command(evaluation.rows, evaluation.task)
    np.testing.assert_array_equal(command.qdd, plain.qdd)


def test_what_cannot_be_used_is_refused() -> None:
    for wrong in (0.0, -1.0, np.nan, np.inf, True, "late"):
        with pytest.raises(ConfigurationError, match="command_delay of a law, how late"):
            make_controller("hierarchical-qp", {"command_delay": wrong})
    rows, task = _rows(STATIC.setup().control(), STATIC.setup().q0, np.zeros(6))
    law = make_controller("hierarchical-qp", {"command_delay": 0.02})
    with pytest.raises(
        InvalidInput, match=r"a law with a command_delay uses a model: .*reset\(model="
    ):
        law.command(rows, task)
    setup: Any = law.reset
    setup(model=STATIC.setup().control().model())
    with pytest.raises(InvalidInput, match="sampling period"):
        law.command(rows, task)
    setup(period=1e-6)
    with pytest.raises(
        InvalidInput, match="command_delay of a law must not exceed 100 sampling times"
    ):
        law.command(rows, task)
    other: Any = make_controller("hierarchical-qp", {"command_delay": 0.02})
    other.reset(period=PERIOD, model=Scenario.load("moving-sphere").setup().control().model())
    with pytest.raises(InvalidInput, match="model of other rows"):
        other.command(rows, task)


def test_what_it_uses_and_says() -> None:
    law = make_controller(
        "hierarchical-qp", {"command_delay": 0.02, "observer": 0.1, "dead_time": 0.01}
    )
    assert isinstance(law, DelayCompensated)
    assert isinstance(law.law, Observed)
    assert law.uses == (*HierarchicalQP().uses, "σ", "σ̇", "K", "T_s", "memory", "model")
    assert make_controller("tracking", {"command_delay": 0.02}).unused() == ""
    assert (
        "observer is given, but no command of the law depends on it"
        in make_controller("tracking", {"command_delay": 0.02, "observer": 0.1}).unused()
    )
    assert law.remark(("a",)) == HierarchicalQP().remark(("a",))


def test_a_wrong_sign_or_a_sample_too_few_would_be_noticed() -> None:
    """A law that believes in a delay of another length commands something else."""
    plain = simulate(STATIC.setup(), make_controller("hierarchical-qp")).qdd_command
    for believed in (16.3, 18.3):
        law: Controller = make_controller("hierarchical-qp", {"command_delay": believed * PERIOD})
        wrong = simulate(late(DELAYS[1]).setup(), law).qdd_command
        n = min(len(plain), len(wrong))
        assert np.abs(wrong[:n] - plain[:n]).max() > 1e-3 * np.abs(plain).max()


@pytest.mark.parametrize(
    ("at_once", "speeds", "command", "entry"),
    [
        (1, 1, 0.7, 0.7),  # a speed that is taken at once
        (0, 0, 3.0, 3.0),  # an acceleration
        (0, 0, 9.0, 5.0),
        (0, 1, 0.7, 4.0),  # from 0.3 to 0.7 rad/s in 0.1 s
        (0, 1, -0.7, -5.0),
        (0, 1, np.nan, 0.0),  # without a command, the speed stays
    ],
)
def test_entries_of_pending_commands(
    at_once: int, speeds: int, command: float, entry: float
) -> None:
    """Of joint 2, which moves at 0.3 rad/s and may accelerate by 5 rad/s², in periods of 0.1 s."""
    now = np.array([0.0, 1.0, 2.0, -0.5, 0.3])
    own: Any = SimpleNamespace(
        at_once=at_once, speeds=speeds, now=now, sent=np.zeros((3, 2)), period=0.1
    )
    rows: Any = SimpleNamespace(qdd_min=np.full(2, -5.0), qdd_max=np.full(2, 5.0))
    found = load("delay").pending_command(own, rows, 1, command)
    assert found == pytest.approx(entry, rel=1e-12)
