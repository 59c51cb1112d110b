"""Arms that take velocities or positions: their motion against step-by-step integration, and what
scenarios say about them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vsconstraints.compiled import load
from vsconstraints.controllers import HierarchicalQP, ResolvedRate, Tracking, VelocityQP
from vsconstraints.dynamics import ArmDynamics
from vsconstraints.errors import ConfigurationError, InvalidInput, SceneError
from vsconstraints.rows import Array, Command
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate
from vsconstraints.simulation.disturbances import Disturbances
from vsconstraints.simulation.follower import ArmInput, FollowingPlant, LowLevelLoop, periods_of
from vsconstraints.simulation.plant import Plant
from vsconstraints.stacks.description import describe

T_S = 0.02
STEPS = 2000


def integrated(state: Array, wanted: float, arm: ArmInput, push: float, span: float = T_S) -> Array:
    """Integrate q, q̇ and a by the definition of the loop, in small steps."""
    q, qd, a = state
    most = np.inf if arm.acceleration is None else arm.acceleration
    jerk = np.inf if arm.jerk is None else arm.jerk
    h = span / STEPS

    def aim(speed: float) -> float:
        return float(np.clip((wanted - speed) / arm.lag, -most, most))

    a = aim(qd) if jerk == np.inf else a
    for _ in range(STEPS):
        after = a + float(np.clip(aim(qd + h * (a + push)) - a, -jerk * h, jerk * h))
        mean = 0.5 * (a + after) + push
        q += h * qd + 0.5 * h * h * mean
        qd += h * mean
        a = after
    return np.array([q, qd, a])


@pytest.mark.parametrize("push", [0.0, -3.0, 8.0])
@pytest.mark.parametrize("jerk", [None, 300.0, 3e4])
@pytest.mark.parametrize("acceleration", [None, 5.0, 30.0])
def test_the_loop_moves_as_it_is_defined(
    acceleration: float | None, jerk: float | None, push: float
) -> None:
    """Pushes beyond the limit, reversals and overshoot of the jerk-limited loop included."""
    arm = ArmInput("velocity", lag=0.015, acceleration=acceleration, jerk=jerk)
    loop = LowLevelLoop(arm, np.array([0.3]), np.array([0.5]), T_S)
    k = loop.kernels
    x = loop.x
    x[-1] = push
    for wanted in (0.6, 0.62, -0.4, -0.4, 0.1):
        before = x[[k.Q, k.QD, k.ACCELERATION], 0].copy()
        x[-2] = (wanted - x[k.COMMANDS + 1]) / T_S
        k.follow_period(loop.workspace, x)
        expected = integrated(before, wanted, arm, push)
        # steps of 10 µs are of second order, but of first where the jerk changes inside one
        within = 3e-6 if jerk is None else 3e-5
        np.testing.assert_allclose(x[[k.Q, k.QD], 0], expected[:2], atol=within)


def test_an_acceleration_just_beyond_its_limit_is_at_it() -> None:
    """A push beyond the limit brings a to its end, up to rounding, and holds it there."""
    most, push, wanted = 0.175, -1.25, -0.01
    arm = ArmInput("velocity", lag=0.1, acceleration=most, jerk=60.0)
    loop = LowLevelLoop(arm, np.array([0.0]), np.array([-0.035]), T_S)
    k = loop.kernels
    loop.x[k.ACCELERATION] = np.nextafter(most, 1.0)
    loop.x[-1] = push
    loop.x[-2] = (wanted + 0.035) / T_S
    k.follow_period(loop.workspace, loop.x)
    assert loop.x[k.ACCELERATION, 0] == most
    assert loop.x[k.QD, 0] == pytest.approx(-0.035 + T_S * (most + push))


def test_a_fast_joint_leaves_its_limit_of_acceleration_up_to_rounding() -> None:
    """A short lag magnifies the rounding of q̇, so that the loop never asks for just the limit."""
    most = 0.1
    lag = 1e-3
    arm = ArmInput("velocity", lag=lag, acceleration=most)
    rng = np.random.default_rng(3)
    for qd, change in zip(rng.uniform(1.0, 3.0, 200), rng.uniform(-1.5, 1.5, 200), strict=True):
        wanted = qd + change * most * T_S
        loop = LowLevelLoop(arm, np.array([0.0]), np.array([qd]), T_S)
        k = loop.kernels
        loop.x[-2] = (wanted - loop.x[k.COMMANDS + 1]) / T_S
        k.follow_period(loop.workspace, loop.x)
        loop.check()
        assert abs(loop.x[k.QD, 0] - qd) <= most * T_S * (1.0 + 1e-9)
        # beyond lag A from the wanted speed it moves at the limit, then with the lag
        ramp = max(abs(wanted - qd) / most - lag, 0.0)
        rest = wanted - qd if ramp == 0.0 else np.copysign(lag * most, change)
        left = rest * np.exp(-(T_S - ramp) / lag)
        if ramp > T_S:
            left = wanted - qd - np.copysign(most * T_S, change)
        assert loop.x[k.QD, 0] == pytest.approx(wanted - left, abs=1e-12)


def swinging(offset: float, lag: float, jerk: float) -> FollowingPlant:
    """Return an arm after a period whose wanted speed is ``offset`` [rad/s] above its own.

    With so little lag, the limit of jerk lets the speed swing about the wanted one.
    """
    plant = plant_of(ArmInput("velocity", lag=lag, jerk=jerk))
    plant.begin(np.array([offset / T_S]))
    plant.step()
    return plant


@pytest.mark.parametrize("offset", [1e-4, 1e-6])
def test_a_loop_that_swings_often_in_a_period_is_followed_to_its_end(offset: float) -> None:
    """Over 64 times: the swings do not grow, as a spring with ȧ = ±j has no other energy."""
    plant = swinging(offset, lag=1e-9, jerk=3e4)
    plant.check()
    assert abs(plant.qd[0] - offset) <= offset * (1.0 + 1e-9)
    assert plant.q[0] == pytest.approx(0.3 + T_S * offset, abs=0.2 * T_S * offset)


def test_a_loop_that_swings_too_often_is_an_error_with_its_remedy() -> None:
    plant = swinging(1e-9, lag=1e-12, jerk=3e4)
    with pytest.raises(SceneError, match=r"more than 10000 times .* give a longer lag"):
        plant.check()


@pytest.mark.parametrize(
    ("delay", "ticks", "share"),
    [
        (7.0 * T_S, 1, 0.0),
        (29.0 * T_S, 10, 0.0),
        (0.5 * T_S, 1, 0.0),
        (2.5 * T_S, 10, 0.5),
        (0.33 * T_S, 10, 0.4),
    ],
)
def test_a_late_command_acts_at_an_instant_of_the_arm(
    delay: float, ticks: int, share: float
) -> None:
    """7 × 0.02 / 0.02 is 7.000000000000001 in floating point, and still a whole number."""
    plant = plant_of(ArmInput("velocity", rate=ticks / T_S), delay=delay)
    assert plant.switch == share
    waiting = math.ceil(delay / T_S - share - 1e-9)
    for period in range(waiting + 1):
        assert plant.qd[0] == 0.0
        plant.begin(np.array([1.0 / T_S if period == 0 else 0.0]))
        begins = plant.x.T[None].copy()
        plant.step()
    before, after = (plant.inside(begins, T_S * (share + side))[1][0, 0] for side in (-0.01, 0.01))
    assert (before, after) == pytest.approx((0.0, 1.0))


def plant_of(arm: ArmInput, n: int = 1, delay: float = 0.0) -> FollowingPlant:
    return FollowingPlant(arm, np.full(n, 0.3), np.zeros(n), T_S, Disturbances(command_delay=delay))


def speeds(plant: FollowingPlant, wanted: list[float]) -> list[float]:
    """Return the speed at the end of each period with these commands."""
    plant.take_speeds()
    reached = []
    for speed in wanted:
        command = Command(np.zeros(1), "ok", np.zeros(0, np.bool_), (), qd=np.array([speed]))
        plant.begin(plant.acceleration_of(command))
        plant.step()
        reached.append(float(plant.qd[0]))
    return reached


def test_without_lag_and_limits_the_arm_has_the_commanded_speed_at_once() -> None:
    plant = plant_of(ArmInput("velocity"))
    assert speeds(plant, [0.5, -0.2]) == pytest.approx([0.5, -0.2])
    assert plant.q[0] == pytest.approx(0.3 + 0.5 * T_S - 0.2 * T_S)


def test_a_limit_without_lag_is_a_ramp() -> None:
    """0.5 rad/s at 10 rad/s² takes 50 ms, two periods and a half."""
    plant = plant_of(ArmInput("velocity", acceleration=10.0))
    assert speeds(plant, [0.5] * 4) == pytest.approx([0.2, 0.4, 0.5, 0.5])
    assert plant.q[0] == pytest.approx(0.3 + 0.5 * 0.5**2 / 10.0 + 0.5 * 0.03)


def test_a_lag_alone_is_an_exponential() -> None:
    plant = plant_of(ArmInput("velocity", lag=0.05))
    reached = speeds(plant, [1.0] * 3)
    assert reached == pytest.approx(1.0 - np.exp(-np.arange(1, 4) * T_S / 0.05))


def test_commands_are_taken_late_and_seldom() -> None:
    """A delay of one period and a half, and an arm that takes every second command."""
    late = plant_of(ArmInput("velocity"), delay=1.5 * T_S)
    assert speeds(late, [1.0, 2.0, 3.0, 4.0]) == pytest.approx([0.0, 0.0, 1.0, 2.0])
    finer = plant_of(ArmInput("velocity", rate=2.0 / T_S), delay=1.5 * T_S)
    assert speeds(finer, [1.0, 2.0, 3.0, 4.0]) == pytest.approx([0.0, 1.0, 2.0, 3.0])
    assert finer.q[0] == pytest.approx(0.3 + T_S * (0.5 + 1.5 + 2.5))
    seldom = plant_of(ArmInput("velocity", rate=0.5 / T_S))
    assert speeds(seldom, [1.0, 2.0, 3.0, 4.0]) == pytest.approx([1.0, 1.0, 3.0, 3.0])


@pytest.mark.parametrize("rate", [None, 1.0 / T_S, 4.0 / T_S, 0.5 / T_S])
def test_an_arm_that_takes_positions_reaches_them(rate: float | None) -> None:
    """At rest it stands at q_c; without lag it is there at the end of every period."""
    plant = plant_of(ArmInput("position", rate=rate))
    speeds(plant, [1.0, 1.0, -0.5, -0.5])
    taken = 1.5 if rate == 0.5 / T_S else 1.0  # every second command: the one before the last
    assert plant.q[0] == pytest.approx(0.3 + taken * T_S, abs=1e-12)
    lagging = plant_of(ArmInput("position", lag=0.03, acceleration=20.0, jerk=2000.0, rate=rate))
    speeds(lagging, [1.0, 1.0, *[0.0] * 60])
    assert lagging.q[0] == pytest.approx(0.3 + 2 * T_S, abs=1e-4)


@pytest.mark.parametrize("rate", [None, 4.0 / T_S, 0.5 / T_S])
@pytest.mark.parametrize("lag", [0.0, 0.003, 0.05])
def test_an_arm_that_takes_positions_stops_at_the_last(lag: float, rate: float | None) -> None:
    """From 2 rad/s at 8 rad/s² it needs 0.25 rad to stop: it passes q_c by no more, only once."""
    plant = plant_of(ArmInput("position", lag=lag, acceleration=8.0, rate=rate))
    reached = np.array(speeds(plant, [2.0] * 50 + [0.0] * 250))
    at = plant.q[0]
    assert at == pytest.approx(0.3 + 50 * 2.0 * T_S, abs=1e-6)
    assert np.abs(reached[-10:]).max() < 1e-6
    back = T_S * -reached[reached < 0.0].sum()
    assert back == pytest.approx(0.25, abs=0.05)


@pytest.mark.parametrize("lag", [0.1, 0.3])
def test_a_loop_of_positions_is_critically_damped(lag: float) -> None:
    """ë + ė/τ + e/(4τ²) = 0, of which e = (e₀ + (ė₀ + e₀/2τ) t) exp(−t/2τ) is the solution."""
    plant = plant_of(ArmInput("position", lag=lag))
    speeds(plant, [0.5])
    error = 0.3 + 0.5 * T_S - plant.q[0]
    rate = -plant.qd[0]
    for k in range(1, 100):
        speeds(plant, [0.0])
        t = k * T_S
        expected = (error + (rate + error / (2.0 * lag)) * t) * np.exp(-t / (2.0 * lag))
        # the loop of positions is sampled: it holds its speed for a period
        assert 0.3 + 0.5 * T_S - plant.q[0] == pytest.approx(expected, abs=0.02 * error)


def test_an_arm_in_motion_keeps_its_speed_until_a_delayed_command_arrives() -> None:
    arm = ArmInput("velocity", lag=0.01)
    disturbances = Disturbances(command_delay=1.5 * T_S)
    plant = FollowingPlant(arm, np.full(1, 0.3), np.full(1, 0.4), T_S, disturbances)
    # the command arrives in the middle of the second period, and is taken at its end
    assert speeds(plant, [0.0] * 3) == pytest.approx([0.4, 0.4, 0.4 * np.exp(-T_S / 0.01)])


def test_a_delay_beyond_all_bounds_is_refused() -> None:
    with pytest.raises(InvalidInput, match="command_delay must not exceed"):
        plant_of(ArmInput("velocity", lag=0.01), delay=1e4 * T_S)


@pytest.mark.parametrize("delay", [0.0, 1.0, 1.5, 2.0])
def test_an_arm_that_takes_accelerations_reaches_late_speeds_late(delay: float) -> None:
    """A period after the command has begun to act, as without a delay."""
    plant = Plant(
        np.zeros(1), np.zeros(1), T_S, "acceleration", Disturbances(command_delay=delay * T_S)
    )
    wanted = [0.3, -0.2, 0.5, 0.1, 0.0, 0.0, 0.0, 0.0]
    after = (delay % 1.0) * T_S or T_S
    reached = []
    for speed in wanted:
        command = Command(np.zeros(1), "ok", np.zeros(0, np.bool_), (), qd=np.array([speed]))
        plant.begin(plant.acceleration_of(command))
        reached.append(float(plant.inside(plant.x.T[None], after)[1][0, 0]))
        plant.step()
    late = math.floor(delay) + (1 if delay % 1.0 else 0)
    np.testing.assert_allclose(reached[late:], wanted[: len(wanted) - late], atol=1e-12)


def test_a_loop_of_positions_may_reverse_between_looks() -> None:
    """Of 500 periods of 20 ms with random speeds, none hides a way out and back of 0.2 mrad.

    Without looks inside the period, some hide 0.9 mrad.
    """
    plant = plant_of(ArmInput("position", acceleration=60.0, rate=10.0 / T_S))
    plant.take_speeds()
    random = np.random.default_rng(0)
    hidden = []
    for speed in 0.5 * random.normal(size=500):
        command = Command(np.zeros(1), "ok", np.zeros(0, np.bool_), (), qd=np.array([speed]))
        plant.begin(plant.acceleration_of(command))
        begins = plant.x.T[None].copy()
        looks = np.linspace(0.05, 1.0, 20) * T_S
        q = [begins[0, 0, 0], *(plant.inside(begins, look)[0][0, 0] for look in looks)]
        way = max(max(q) - max(q[0], q[-1]), min(q[0], q[-1]) - min(q))
        at = [plant.inside(begins, share * T_S)[1][0, 0] for share in (*plant.reversals, 1.0)]
        speeds_seen = np.array([begins[0, 0, 1], *at])
        if (speeds_seen[:-1] * speeds_seen[1:] >= 0.0).all():
            hidden.append(way)
        plant.step()
    assert max(hidden) < 2e-4


def test_accelerations_are_integrated_from_one_command_to_the_next() -> None:
    """The adapter of real arms: the order filter, not the measured speed."""
    plant = plant_of(ArmInput("velocity", lag=0.1))
    k = load("follower")
    for qdd in (2.0, 1.0, -0.5):
        plant.begin(np.array([qdd]))
        plant.step()
    assert plant.x[k.COMMANDS + 1, 0] == pytest.approx(2.5 * T_S)
    assert plant.x[k.COMMANDS, 0] == pytest.approx(0.3 + T_S**2 * (1.0 + 2.5 + 2.75))
    assert plant.remarks() == ["the arm takes velocities, to which the law's q̈_c was integrated"]


def test_the_motion_within_a_period_is_that_of_the_period() -> None:
    plant = plant_of(ArmInput("velocity", lag=0.02, acceleration=8.0, rate=4.0 / T_S), 2)
    plant.begin(np.array([30.0, -20.0]))
    state = plant.x.copy()
    plant.step()
    states = state.T[None]
    end = plant.inside(states, T_S)
    np.testing.assert_allclose(end[0][0], plant.q, atol=1e-15)
    np.testing.assert_allclose(end[1][0], plant.qd, atol=1e-15)
    rate = (plant.inside(states, 0.5 * T_S + 1e-6)[0] - plant.inside(states, 0.5 * T_S)[0]) / 1e-6
    np.testing.assert_allclose(rate, plant.inside(states, 0.5 * T_S)[1], rtol=1e-3)


# --- scenarios ---


def scene(**arm: Any) -> Scenario:
    return Scenario.load("ur5-fov").with_override("duration", 0.1).with_override("arm", arm)


@pytest.mark.parametrize(
    ("arm", "words"),
    [
        ({"command": "torque"}, r"command in ur5-fov\.arm.*acceleration, position, velocity"),
        ({"command": "velocity", "delay": 0.1}, r"key in ur5-fov\.arm.*'delay'"),
        ({"command": "velocity", "lag": -0.1}, r"arm\.lag is a number of seconds"),
        ({"command": "velocity", "acceleration": 0.0}, r"arm\.acceleration must be positive"),
        ({"command": "velocity", "jerk": 100.0}, r"arm\.jerk needs arm\.lag"),
        ({"command": "velocity", "acceleration": [1.0, 2.0]}, r"arm\.acceleration must be one"),
        ({"command": "velocity", "rate": 1e9}, r"at most 1000 times the sampling rate, 500 Hz"),
        ({"command": "velocity", "rate": 300.0}, r"multiple or a divisor of the sampling rate"),
        ({"lag": 0.02}, r"give disturbances\.time_constant"),
        ({"acceleration": 8.0}, r"give limits\.acceleration"),
    ],
)
def test_what_an_arm_cannot_be_is_refused(arm: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        scene(**arm).setup()


def test_a_rate_is_one_number() -> None:
    with pytest.raises(ConfigurationError, match=r"arm\.rate must be one positive .*\[500\.0\]"):
        ArmInput("velocity", rate=[500.0])  # type: ignore[arg-type]


@pytest.mark.parametrize("value", ["8", True, [None, 1.0], np.nan, -1.0])
def test_values_that_are_no_numbers_are_refused_in_python(value: Any) -> None:
    for name in ("acceleration", "rate", "lag"):
        with pytest.raises(ConfigurationError, match=rf"arm\.{name} (must be|is)"):
            ArmInput("velocity", **{name: value})


def test_an_arm_is_described_once() -> None:
    both = scene(command="velocity").with_override("actuation", "position")
    with pytest.raises(ConfigurationError, match="leave out one"):
        both.setup()
    lagging = scene(command="velocity").with_override("disturbances.time_constant", 0.1)
    with pytest.raises(ConfigurationError, match=r"positions give arm\.lag"):
        lagging.setup()


def test_rates_are_multiples_or_divisors() -> None:
    assert periods_of(None, 0.002) == (1, 1)
    assert periods_of(500.0, 0.002) == (1, 1)
    assert periods_of(1000.0, 0.002) == (2, 1)
    assert periods_of(125.0, 0.002) == (1, 4)


def test_an_arm_that_takes_accelerations_stays_as_it_is() -> None:
    """Bit by bit."""
    plain = Scenario.load("ur5-fov").with_override("duration", 0.05)
    said = plain.with_override("arm", {"command": "acceleration"})
    runs = [simulate(each.setup(), HierarchicalQP()) for each in (plain, said)]
    np.testing.assert_array_equal(runs[0].q, runs[1].q)


def test_the_compiled_loop_moves_the_arm_as_the_one_in_python() -> None:
    setup = scene(command="position", lag=0.02, acceleration=8.0, rate=250.0).setup()
    setup = replace(setup, disturbances=Disturbances(command_delay=0.003, acceleration=(0.5,)))
    fast = simulate(setup, HierarchicalQP())
    slow = simulate(setup, HierarchicalQP(), by_public_call=True)
    assert "the arm takes positions" in fast.reason
    np.testing.assert_allclose(fast.q, slow.q, atol=1e-12)


@pytest.mark.parametrize(
    "arm",
    [
        ArmInput("velocity", acceleration=8.0),
        ArmInput("velocity", lag=0.02, acceleration=8.0, jerk=800.0),
        ArmInput("position", lag=0.02, acceleration=8.0),
    ],
    ids=repr,
)
def test_the_reference_of_an_arm_with_mass_ends_where_the_loop_does(arm: ArmInput) -> None:
    """After 500 commands that jump; a reference with the speeds of the loop would drift off."""
    loop = LowLevelLoop(arm, np.zeros(1), np.zeros(1), T_S)
    loop.take_speeds()
    k = loop.kernels
    q, qd = np.zeros(1), np.zeros(1)
    loop.lead(q, qd, (0, 0))
    x = np.zeros((4, 1))
    jumps = 0.3 * np.random.default_rng(0).normal(size=500)
    distances = []
    for wanted in [*jumps, *[0.0] * 100]:
        x[-2] = (wanted - loop.x[k.COMMANDS + 1]) / T_S
        k.refer(loop.workspace, x)
        q += T_S * (qd + 0.5 * T_S * x[-2])
        qd += T_S * x[-2]
        distances.append(float(np.abs(q - loop.x[k.Q])[0]))
    assert max(distances) < 8.0 * T_S**2  # what a limit of 8 rad/s² does to a period
    assert distances[-1] < 1e-9
    assert np.abs(qd).max() < 1e-9


@pytest.mark.parametrize("controller", ["computed-torque", "position", "speed"])
def test_an_arm_with_mass_follows_the_loop(controller: str) -> None:
    """With a stiff controller the arm with mass moves as the loop without mass does."""
    arm = {"command": "velocity", "lag": 0.03, "acceleration": 8.0}
    setup = scene(**arm).with_override("duration", 0.3).setup()
    heavy = replace(setup, dynamics=ArmDynamics(controller=controller, bandwidth=100.0, effort=1e4))
    for law in (Tracking(), ResolvedRate(gain=0.5)):
        light, massive = (simulate(each, law) for each in (setup, heavy))
        np.testing.assert_allclose(massive.q, light.q, atol=5e-3)


@pytest.mark.parametrize(("base", "last"), [("ur5-fov", 40.0), ("case-study-6r", 50.0)])
def test_laws_and_stacks_are_told_what_arm_and_actuators_can_both_do(
    base: str, last: float
) -> None:
    """Actuators of ur5-fov do 40 rad/s²; those of case-study-6r have no limit."""
    arm = {"command": "velocity", "lag": 0.02, "acceleration": [8.0] * 5 + [50.0]}
    setup = Scenario.load(base).with_override("arm", arm).setup()
    told = [8.0] * 5 + [last]
    assert describe(setup, ["limits"])["limits"]["acceleration"] == told
    assert setup.control().acceleration.tolist() == told
    unknown = replace(setup, limits=replace(setup.limits, known=False))
    assert describe(unknown, ["limits"])["limits"]["acceleration"] is None
    assert np.isinf(unknown.control().acceleration).all()


@pytest.mark.parametrize("base", ["ur5-fov", "case-study-6r"])
def test_the_box_of_a_velocity_law_is_that_of_the_arm(base: str) -> None:
    arm = {"command": "velocity", "lag": 0.02, "acceleration": 8.0}
    scenario = Scenario.load(base).with_override("duration", 0.1).with_override("arm", arm)
    told, stated, free = (
        simulate(scenario.setup(), VelocityQP(max_acceleration=most)).q
        for most in ("limits", 8.0, None)
    )
    np.testing.assert_allclose(told, stated, atol=1e-9)
    assert np.abs(told - free).max() > 1e-5


def test_images_and_delays_do_not_keep_velocity_laws_from_running() -> None:
    images = Scenario.load("ur5-images").with_override("duration", 0.1)
    arm = {"command": "velocity", "lag": 0.02, "acceleration": 8.0}
    run = simulate(images.with_override("arm", arm).setup(), VelocityQP())
    assert run.status == "unfinished", run.reason
