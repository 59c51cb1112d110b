"""Joints that turn without end count on the circle wherever joints are compared, as Pinocchio has
it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from vsconstraints.arms import (
    Envelope,
    Job,
    Joints,
    Setpoint,
    Supervision,
    driver_for,
    run_on_arm,
    trajectory_of,
)
from vsconstraints.arms.stream import Stream
from vsconstraints.arms.supervision import require_start
from vsconstraints.constraints.joint_limits import JointRange
from vsconstraints.controllers import HierarchicalQP
from vsconstraints.errors import ConfigurationError
from vsconstraints.robots import viper_s650
from vsconstraints.robots.robot import Robot
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup
from vsconstraints.vision.tracking import Rest

TURN = 2.0 * np.pi
URDF = Path(__file__).parents[1] / "examples" / "six_axis.urdf"
ROBOT = Robot.from_urdf(URDF, "tool")
LAST = 5  #: The joint of this robot that turns without end.


def rotate(q: Array, turns: int) -> Array:
    other = np.array(q)
    other[..., LAST] += turns * TURN
    return other


def scenario(
    start: float, constraints: list[dict[str, Any]] | None = None, **changes: Any
) -> Scenario:
    """README's, with the last joint turned to ``start`` and its goal 1.4 rad farther."""
    loaded = Scenario.load(URDF.with_name("my-arm.toml"))
    loaded = loaded.with_override("q0", [0.0, 0.3, 1.4, 0.0, 1.3, start])
    loaded = loaded.with_override(
        "task.goals", [{"camera_at_q": [0.12, 0.35, 1.5, 0.1, 1.15, start + 1.4]}]
    )
    if constraints is not None:
        loaded = loaded.with_override("constraints", constraints)
    for key, value in changes.items():
        loaded = loaded.with_override(key, value)
    return loaded


RANGE = {
    "type": "joint-range",
    "joints": [6],
    "lower": [2.0],
    "upper": [5.0],
    "K": 0.15,
    "switching_gain": 4.0,
}


# --- the difference itself ---


def test_differences_are_pinocchios() -> None:
    """Of a model that Pinocchio reads from the same file, whose last joint is a point of the unit
    circle there.
    """
    model = pin.buildModelFromUrdf(str(URDF))
    assert (model.nq, model.nv) == (7, 6)
    assert ROBOT.continuous.tolist() == [False] * 5 + [True]

    def configuration(q: Array) -> Array:
        return np.concatenate((q[:LAST], [np.cos(q[LAST]), np.sin(q[LAST])]))

    random = np.random.default_rng(3)
    for _ in range(200):
        a, b = random.uniform(-2.5, 2.5, (2, 6))
        a[LAST], b[LAST] = random.uniform(-20.0, 20.0, 2)
        expected = pin.difference(model, configuration(b), configuration(a))
        np.testing.assert_allclose(ROBOT.difference(a, b), expected, atol=1e-12)
        nearest = ROBOT.nearest_turn(a, b)
        np.testing.assert_allclose(configuration(nearest), configuration(a), atol=1e-13)
        assert abs(nearest[LAST] - b[LAST]) <= np.pi + 1e-12


def test_joints_with_a_range_and_those_that_slide_are_not_on_a_circle() -> None:
    """Two turns apart a joint with a range of four turns is elsewhere."""
    a = np.full(6, 3.0)
    b = np.full(6, -3.0)
    np.testing.assert_array_equal(viper_s650().difference(a, b), a - b)
    rail = Robot.from_dh([[0.0, 0.0, 0.3, 0.0]] * 2, prismatic=[1])
    assert rail.continuous.tolist() == [False, True]
    np.testing.assert_allclose(
        rail.difference(np.array([7.0, 7.0]), np.zeros(2)), [7.0, 7.0 - TURN]
    )
    half = Robot.from_dh([[0.0, 0.0, 0.3, 0.0]], q_min=[-np.inf], q_max=[3.0])
    assert not half.continuous.any()


def test_what_lies_within_half_a_turn_is_a_plain_difference_to_the_last_bit() -> None:
    random = np.random.default_rng(4)
    a, b = random.uniform(-1.5, 1.5, (2, 50, 6))
    np.testing.assert_array_equal(ROBOT.difference(a, b), a - b)
    np.testing.assert_array_equal(ROBOT.nearest_turn(a, b), a)
    assert np.isnan(ROBOT.difference(np.full(6, np.nan), np.zeros(6))).all()


# --- rows, task and what is expected of measurements ---


@pytest.mark.parametrize("turns", [-2, 1, 3])
def test_a_range_is_one_of_the_circle(turns: int) -> None:
    setup = scenario(3.0, [RANGE]).setup()
    q = setup.q0.copy()
    qd = np.full(6, 0.1)
    expected = setup.control().evaluate(0.0, q, qd).rows
    rows = setup.control().evaluate(0.0, rotate(q, turns), qd).rows
    for name in ("phi", "sigma", "Lg", "Lf"):
        np.testing.assert_allclose(
            getattr(rows, name), getattr(expected, name), atol=1e-12, err_msg=name
        )
    # by hand: 0.5 below the middle of 2 to 5
    np.testing.assert_allclose(rows.sigma, [-0.5 / 1.5 - 1.0, 0.5 / 1.5 - 1.0], atol=1e-12)
    (constraint,) = setup.constraints.constraints
    assert isinstance(constraint, JointRange)
    np.testing.assert_allclose(constraint.sigma(rotate(q, turns)), rows.sigma, atol=1e-12)
    assert not setup.control().in_numpy


def test_a_range_that_a_cable_sets_counts_turns() -> None:
    """Three turns to each side: after four the joint is outside."""
    cable = JointRange(
        ROBOT, joints=[6], lower=[-3.0 * TURN], upper=[3.0 * TURN], K=0.1, switching_gain=1.0
    )
    np.testing.assert_allclose(cable.sigma(rotate(np.zeros(6), 4)), [1.0 / 3.0, -7.0 / 3.0])


def test_a_posture_is_approached_the_short_way() -> None:
    setup = scenario(3.0).setup()
    posture = np.array([0.0, 0.3, 1.4, 0.0, 1.3, -3.0])
    task = replace_rest(setup, Rest(damping=2.0, posture=posture.tolist()))
    for turns in (0, 2):
        found = task.control().evaluate(0.0, rotate(setup.q0, turns), np.zeros(6)).task.rest
        # from 3 rad forwards over π, and not back by 6 rad
        np.testing.assert_allclose(found[LAST], TURN - 6.0, atol=1e-12)


def replace_rest(setup: Setup, rest: Rest) -> Setup:
    task = setup.task
    other = type(task)(task.feature, task.goals, task.gains, rest=rest)
    return replace(setup, task=other)


def test_an_encoder_that_passes_half_a_turn_is_no_wrong_speed() -> None:
    setup = scenario(3.0).setup()
    for wrapped in (False, True):
        control = setup.control()
        qd = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.5])
        for k in range(200):
            q = setup.q0 + k * setup.Ts * qd
            assert not wrapped or k < 150 or q[LAST] > np.pi
            now = control.evaluate(k * setup.Ts, encoder(q) if wrapped else q, qd)
            assert not control.doubts(now)
        assert control.innovation[5] < 1e-9


# --- on an arm ---


def encoder(q: Array) -> Array:
    """What an encoder of one turn shows."""
    shown = np.array(q)
    shown[LAST] = (shown[LAST] + np.pi) % TURN - np.pi
    return shown


@pytest.mark.parametrize("address", ["simulated://", "loopback://?time=simulated&patience=5"])
def test_an_encoder_that_passes_half_a_turn_changes_nothing(address: str) -> None:
    """The arm's stray, the law, what is sent and what is scored are those of an arm that counts its
    turns.
    """
    setup = scenario(3.0, duration=1.0).setup()
    logs = []
    runs = []
    for shows in (lambda q: q, encoder):
        driver = driver_for(address, setup)
        read = driver.read
        raw = []

        def shown(read: Any = read, raw: list[Array] = raw, shows: Any = shows) -> Joints:
            state = read()
            raw.append(shows(state.q))
            return state._replace(q=raw[-1])

        driver.read = shown  # type: ignore[method-assign]
        started, log = run_on_arm(Job(setup, HierarchicalQP(), driver))
        assert log.ended == "done", log.cause
        logs.append(log)
        runs.append(trajectory_of(started, log, address))
    assert np.abs(np.diff(np.array(raw)[:, LAST])).max() > 6.0, "its encoder has passed half a turn"
    for name in ("q", "qd", "sent_q", "sent_qd"):
        np.testing.assert_allclose(
            logs[1].column(name), logs[0].column(name), atol=1e-9, err_msg=name
        )
    for name in ("q", "sigma", "clearance", "phi"):
        np.testing.assert_allclose(
            getattr(runs[1], name), getattr(runs[0], name), atol=1e-9, err_msg=name
        )


def test_a_start_in_another_turn_is_the_start() -> None:
    setup = scenario(3.0, [RANGE]).setup()
    here = require_start(
        setup, Joints(0.0, rotate(setup.q0, -1) + 0.001, np.zeros(6)), Supervision(), False
    )
    # the arm's own turn is that in which it is sent setpoints
    np.testing.assert_allclose(here.q0, rotate(setup.q0, -1) + 0.001)
    with pytest.raises(ConfigurationError, match=r"joint 6 is at -3\.233, not at 3, 0\.05 away"):
        require_start(
            setup,
            Joints(0.0, rotate(setup.q0, -1) + np.array([0, 0, 0, 0, 0, 0.05]), np.zeros(6)),
            Supervision(start_rad=0.001),
            False,
        )


def test_a_stop_after_silence_goes_on_in_the_turn_in_which_the_arm_was_sent() -> None:
    setup = scenario(3.0).setup()
    driver = driver_for("simulated://", setup)
    q = np.array([0.0, 0.3, 1.4, 0.0, 1.3, np.pi - 0.001])
    line = Stream(driver, Envelope.of(setup.scene.robot, setup.limits, setup.Ts), q, 4)
    line.begin()
    moving = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.4])
    line.send(Setpoint(q, moving, np.zeros(6)))
    line.clock.wait(0.05)
    sent: list[Array] = []

    def send(q: Array, qd: Array) -> None:
        sent.append(q)

    states = iter(range(10_000))
    driver.read = lambda: Joints(
        float(next(states)), encoder(q + 0.01), 0.0 * moving if sent else moving
    )  # type: ignore[method-assign]
    driver.send = send  # type: ignore[method-assign]
    line.bring_to_rest(False, lambda: None)
    assert line.stop[1], line.stop[0]
    assert np.abs(np.diff([q, *sent], axis=0)).max() < 0.02
