"""Commands that act late: against an ODE solver with the delayed input, and against commands
shifted by hand.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from test_disturbances import REFUSED, case
from vsconstraints.bench.advice import Situation
from vsconstraints.controllers import HierarchicalQP, SlidingMode
from vsconstraints.controllers.base import Controller
from vsconstraints.controllers.delay import MAX_PENDING
from vsconstraints.robots.limits import NO_LIMITS, ActuatorLimits
from vsconstraints.rows import Array, Command, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, simulate
from vsconstraints.simulation.disturbances import Disturbances
from vsconstraints.simulation.intersample import inspected_periods
from vsconstraints.simulation.plant import Actuation, Plant

TS = 0.01
TAU = 0.03


def derivative(actuation: Actuation, tau: float, x: Array, u: Array, d: Array) -> Array:
    """ẋ of eq. (6), with x = (q, q̇), (q, q̇, a) or (q, q̇, q_c, q̇_c) one after the other."""
    if tau == 0.0:
        return np.concatenate((x[len(u) :], u + d))
    if actuation == "acceleration":
        _, qd, a = x.reshape(3, -1)
        return np.concatenate((qd, a + d, (u - a) / tau))
    q, qd, qc, qcd = x.reshape(4, -1)
    return np.concatenate((qd, (qc - q) / tau**2 + 2.0 * (qcd - qd) / tau + d, qcd, u))


@pytest.mark.parametrize("actuation", ["acceleration", "position"])
@pytest.mark.parametrize("tau", [0.0, TAU])
@pytest.mark.parametrize("delay", [0.003, 0.0099, 0.01, 0.0142, 0.03])
def test_a_late_command_is_the_delayed_input_of_the_differential_equation(
    actuation: Actuation, tau: float, delay: float
) -> None:
    rng = np.random.default_rng(5)
    n = 2
    N = 12
    q0 = rng.normal(size=n)
    qd0 = rng.normal(size=n)
    commands = 3.0 * rng.normal(size=(N, n))
    d = np.zeros(n) if (actuation, tau) == ("position", 0.0) else rng.normal(size=n)
    pushed = {"acceleration": tuple(d), "time_constant": tau, "command_delay": delay}
    plant = Plant(q0, qd0, TS, actuation, Disturbances(**pushed))

    def u(t: float) -> Array:
        k = int(np.floor((t - delay) / TS + 1e-9))
        return commands[k] if k >= 0 else np.zeros(n)

    def at(start: Array, begin: float, end: float) -> Array:
        """The state after the ODE solver went from one time to another, from switch to switch of
        its input.
        """
        switches = [t for k in range(N) if begin + 1e-9 < (t := k * TS + delay) < end - 1e-9]
        for first, last in zip([begin, *switches], [*switches, end], strict=True):
            held = u(0.5 * (first + last))
            moved = solve_ivp(
                lambda _, x, held=held: derivative(actuation, tau, x, held, d), (0.0, last - first), start,
                rtol=1e-11, atol=1e-13,
            )  # fmt: skip
            start = moved.y[:, -1]
        return start

    rest = () if tau == 0.0 else (np.zeros(n),) if actuation == "acceleration" else (q0, qd0)
    x = np.concatenate((q0, qd0, *rest))
    for k, command in enumerate(commands):
        plant.begin(command)
        state = plant.x.T[None].copy()
        for share in (0.2, 0.4, 0.42, 0.9):
            expected = at(x, k * TS, (k + share) * TS)
            q, qd = plant.inside(state, share * TS)
            np.testing.assert_allclose([q[0], qd[0]], expected[: 2 * n].reshape(2, n), atol=1e-8)
        plant.step()
        x = at(x, k * TS, (k + 1) * TS)
        np.testing.assert_allclose([plant.q, plant.qd], x[: 2 * n].reshape(2, n), atol=1e-8)


def test_by_hand() -> None:
    """0.04 s late in periods of 0.1 s, from rest: q̈ = 10 acts for 0.06 s, q̇ = 0.6, q = 0.018; −10
    for as long then.

    In between 10 acts on: q̇ = 1, q = 0.05 at 0.14 s; q̇ = 0.4, q = 0.092 at 0.2 s.
    """
    plant = Plant(np.zeros(1), np.zeros(1), 0.1, "acceleration", Disturbances(command_delay=0.04))
    for command, q, qd in ((10.0, 0.018, 0.6), (-10.0, 0.092, 0.4)):
        plant.begin(np.array([command]))
        plant.step()
        np.testing.assert_allclose([plant.q[0], plant.qd[0]], [q, qd], rtol=1e-12)
    assert plant.x.shape == (5, 1)
    np.testing.assert_array_equal(plant.x[2:, 0], [-10.0, -10.0, 0.0])


class Shifted(Controller):
    """The law of another one, a sample late."""

    name = "shifted"

    def __init__(self, law: Controller) -> None:
        self.law = law

    def reset(self, period: float | None = None) -> None:
        self.law.reset(period)
        self.waiting: Array | None = None

    def solve(self, rows: Rows, task: Task) -> Command:
        command = self.law.solve(rows, task)
        before = self.waiting
        self.waiting = command.qdd
        return Command(
            np.zeros_like(command.qdd) if before is None else before,
            "ok",
            command.acted,
            command.labels,
        )


def late(delay: float, **settings: Any) -> Setup:
    return case(0.3, command_delay=delay, **settings)


@pytest.mark.parametrize(
    "limits",
    [NO_LIMITS, ActuatorLimits(acceleration=1.0, jerk=200.0, known=False)],
    ids=["free", "limited"],
)
@pytest.mark.parametrize(
    "settings", [{}, {"time_constant": 0.01}, {"actuation": "position"}], ids=str
)
def test_a_delay_of_one_period_is_a_shift_by_one_sample(
    settings: dict[str, Any], limits: ActuatorLimits
) -> None:
    at_once, setup = (replace(late(delay, **settings), limits=limits) for delay in (0.0, 0.002))
    assert setup.Ts == 0.002
    run, shifted, free = (
        simulate(*pair)
        for pair in (
            (setup, SlidingMode()),
            (at_once, Shifted(SlidingMode())),
            (at_once, SlidingMode()),
        )
    )
    assert len(run.t) == len(shifted.t) == setup.samples
    assert run.saturated.any() == limits.any
    np.testing.assert_allclose(run.q, shifted.q, atol=1e-11)
    np.testing.assert_allclose(run.qdd_command[:-1], shifted.qdd_command[1:], atol=1e-7)
    assert np.abs(run.q - free.q).max() > 1e-6


@pytest.mark.parametrize("by_public_call", [False, True])
def test_the_loop_integrates_its_late_commands(by_public_call: bool) -> None:
    """1.5 periods late: half of each period has the command before the last one, half the last
    one.
    """
    setup = late(0.003)
    run = simulate(setup, HierarchicalQP(), by_public_call=by_public_call)
    u = np.vstack((np.zeros((2, 6)), run.qdd_command))
    halves = np.repeat(u[: len(run.t)], 2, axis=0)[1:-1]
    halves = np.vstack((u[:1], halves, u[len(run.t) - 1 : len(run.t)]))
    h = 0.5 * setup.Ts
    q = setup.q0.copy()
    qd = setup.qd0.copy()
    for k in range(len(run.t) - 1):
        np.testing.assert_allclose(run.q[k], q, atol=1e-12)
        for half in (2 * k, 2 * k + 1):
            command = u[k + half % 2]
            q = q + h * qd + 0.5 * h * h * command
            qd = qd + h * command


def test_no_delay_changes_no_bit() -> None:
    free = simulate(case(0.2), SlidingMode())
    none = simulate(late(0.0), SlidingMode())
    np.testing.assert_array_equal(free.q[:100], none.q[:100])
    plant = Plant(np.ones(1), np.ones(1), TS, "acceleration", Disturbances())
    np.testing.assert_array_equal(
        plant.transition,
        [[1, TS, TS**2 / 2, TS**2 / 2], [0, 1, TS, TS], [0, 0, 1, 0], [0, 0, 0, 1]],
    )


def test_a_joint_that_turns_where_the_command_changes_is_seen() -> None:
    """Back and out inside one period, at the same speed at both ends: the period is inspected."""
    plant = Plant(np.zeros(1), np.zeros(1), 0.1, "acceleration", Disturbances(command_delay=0.05))
    plant.x[:, 0] = [0.0, 1.0, -40.0, 40.0, 0.0]
    assert plant.switch == pytest.approx(0.5)
    q, qd = plant.inside(plant.x.T[None].copy(), 0.05)
    np.testing.assert_allclose([q[0, 0], qd[0, 0]], [0.0, -1.0], atol=1e-12)
    states = [plant.x.copy()]
    plant.step()
    assert plant.qd[0] == pytest.approx(1.0)
    states = np.array([*states, plant.x])
    far = np.ones((2, 1))
    setup = SimpleNamespace(Ts=0.1, constraints=SimpleNamespace(characteristic_length=np.ones(1)))
    np.testing.assert_array_equal(inspected_periods(cast(Any, setup), plant, states, far), [0])
    plant.switch = 0.0
    assert not len(inspected_periods(cast(Any, setup), plant, states, far))


def test_a_situation_counts_the_delay_as_latency() -> None:
    scenario = Scenario.load("case-study-6r")
    late_one = scenario.with_override("disturbances.command_delay", 0.004)
    assert Situation.of(late_one).delay == Situation.of(scenario).delay + 0.004


@pytest.mark.parametrize(
    ("delay", "words"),
    [
        (-1e-3, "command_delay must be zero or more"),
        (float("inf"), "command_delay must be finite"),
        (
            0.002 * MAX_PENDING + 1e-4,
            "command_delay must not exceed 100 sampling times, 0.2 s, not 0.2001 s",
        ),
    ],
)
def test_a_delay_of_nonsense_is_refused(delay: float, words: str) -> None:
    with pytest.raises(REFUSED, match=words):
        late(delay)
