"""Limits of actuators: the box of a joint against brute force, in step and loop of both forms, and
as data.
"""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

from numpy_form import define
from vsconstraints import Robot
from vsconstraints.compiled import available
from vsconstraints.control import ControlStep
from vsconstraints.controllers import Controller, HierarchicalQP, SlidingMode, Tracking
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.formulas.limits import JointLimits, actuator_box, joint_box, stopping
from vsconstraints.robots import panda, planar_3r, ur5
from vsconstraints.robots.limits import NO_LIMITS, ActuatorLimits
from vsconstraints.rows import Command
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import score_run, simulate

compiled = pytest.mark.skipif(not available(), reason="there is no compiler")
POSITIVE = st.floats(0.01, 100.0)


def limits_of(n=1, a=np.inf, change=np.inf, q=np.inf, v=np.inf, ranges=0, period=0.01):
    wide = np.ones(n)
    return JointLimits(a * wide, change * wide, -q * wide, q * wide, v * wide, ranges, period)


def drive(q, qd, limits, up, steps):
    """Drive joints as hard as their boxes allow, up or down; q, q̇ and q̈ of every sample."""
    T = limits.period
    last = np.zeros_like(q)
    track = []
    for _ in range(steps):
        last = joint_box(q, qd, last, limits)[1 if up else 0]
        q = q + T * qd + 0.5 * T * T * last
        qd = qd + T * last
        track.append((q, qd, last))
    return tuple(np.array(each) for each in zip(*track, strict=True))


@pytest.mark.parametrize("up", [True, False])
def test_joints_driven_as_hard_as_allowed_stop_at_the_end_of_their_range(up):
    rng = np.random.default_rng(0)
    N = 2000
    T = 0.01
    a = rng.uniform(0.5, 20.0, N)
    v = rng.uniform(0.5, 5.0, N)
    limits = JointLimits(a, np.full(N, np.inf), -np.ones(N), np.ones(N), v, 1, T)
    q = rng.uniform(-1.0, 1.0, N)
    # wherever stopping in time is possible at first
    most = np.minimum(np.sqrt(2.0 * a * (1.0 - q)), v)
    least = -np.minimum(np.sqrt(2.0 * a * (1.0 + q)), v)
    qd = rng.uniform(least, most)
    q, qd, qdd = drive(q, qd, limits, up, 800)
    sign = 1.0 if up else -1.0
    assert (np.abs(q) - 1.0).max() <= 1e-13
    assert (np.abs(qd) - v).max() <= 1e-12
    assert (np.abs(qdd) <= a).all()
    # and they do go all the way, the slowest of them too
    assert np.abs(q[-1] - sign).max() <= 0.01
    # inside a period they turn back before the end, too: q̇²/(2|q̈|) from where they are
    turns = (sign * qd[:-1] > 0.0) & (sign * qd[1:] < 0.0)
    peak = sign * q[:-1] + np.divide(
        qd[:-1] ** 2, 2.0 * np.abs(qdd[1:]), where=turns, out=np.zeros_like(q[:-1])
    )
    assert peak[turns].max(initial=-1.0) <= 1.0 + 1e-12


@given(
    left=st.floats(1e-6, 3.0),
    share=st.floats(-1.0, 1.0),
    a=POSITIVE,
    T=st.floats(1e-4, 0.1),
    beyond=st.floats(1e-6, 1.0),
)
def test_the_greatest_acceleration_is_the_greatest(left, share, a, T, beyond):
    """A state from which the joint can stop stays one, and with any more it is none: by motion
    alone.
    """
    speed = share * np.sqrt(2.0 * a * left)

    def excess(u):
        # how far the joint gets at least, braking as hard as it can after the period
        times = [0.0, T] + ([-speed / u] if u != 0.0 and 0.0 < -speed / u < T else [])
        peak = max(speed * t + 0.5 * u * t * t for t in times)
        w = speed + T * u
        there = speed * T + 0.5 * u * T * T
        return max(peak, there + max(w, 0.0) ** 2 / (2.0 * a)) - left

    u = float(stopping(left, speed, a, T))
    assert u >= -a * (1.0 + 1e-9)
    assert excess(u) <= 1e-9 * (1.0 + left)
    assert excess(u + beyond * (1.0 + abs(u))) > 0.0


@given(
    q=st.floats(-3.0, 3.0), qd=st.floats(-9.0, 9.0), last=st.floats(-60.0, 60.0), a=POSITIVE, jerk=POSITIVE,
    top=st.floats(0.0, 2.0), v=POSITIVE,
)  # fmt: skip
def test_a_box_is_never_empty_and_never_beyond_the_actuator(q, qd, last, a, jerk, top, v):
    limits = limits_of(1, a, jerk * 0.01, top, v, 1)
    least, greatest = actuator_box(last, limits)
    low, high = joint_box(np.array([q]), np.array([qd]), np.array([last]), limits)
    assert np.isfinite([low, high]).all()
    assert (low <= high).all()
    assert ((least <= low) & (high <= greatest)).all()
    assert (np.abs(high) <= a).all()
    # outside its speed a joint brakes as hard as it can, or to just within
    if qd > v:
        assert high[0] == pytest.approx(max(least[0], min((v - qd) / 0.01, high[0])))
        assert high[0] <= max(least[0], (v - qd) / 0.01) + 1e-9
    # outside its range it does not go on
    if q > top and qd > 0.0:
        assert high[0] <= max(least[0], -qd / 0.01) + 1e-9


def test_a_box_by_hand():
    limits = JointLimits(*(np.array([x]) for x in (10.0, 2.0, -1.0, 1.0, 3.0)), 1, 0.1)
    box = joint_box(np.array([0.0]), np.array([0.0]), np.array([9.0]), limits)
    np.testing.assert_allclose(box, [[7.0], [10.0]])
    # w² + a T w = 2 a (d − T q̇/2): w² + w = 20 (0.25 − 0.1) = 3, w = (√13 − 1)/2, and then less
    # than 9 − 2
    box = joint_box(np.array([0.75]), np.array([2.0]), np.array([-5.0]), limits)
    np.testing.assert_allclose(box, [[-7.0], [((13.0**0.5 - 1.0) / 2.0 - 2.0) / 0.1]], rtol=1e-14)
    # at the end, at rest: it may stay
    np.testing.assert_allclose(
        joint_box(np.array([1.0]), np.zeros(1), np.zeros(1), limits), [[-2.0], [0.0]]
    )
    # turning back within the period: −q̇²/(2d)
    assert stopping(0.01, 0.25, 10.0, 0.1) == pytest.approx(-(0.25**2) / 0.02)
    assert stopping(np.inf, 0.25, 10.0, 0.1) == np.inf


def test_jerk_makes_stopping_late_by_what_it_takes_to_brake():
    """With a limit of jerk what is viable under accelerations alone may be left: for a/j, once or
    twice.
    """
    rng = np.random.default_rng(1)
    N = 500
    T = 0.002
    a = 5.0
    j = 500.0
    v = 2.0
    limits = limits_of(N, a, j * T, 1.0, v, 1, T)
    q, _, qdd = drive(rng.uniform(-0.5, 0.5, N), np.zeros(N), limits, True, 2500)
    assert np.abs(np.diff(qdd, axis=0)).max() <= j * T * (1.0 + 1e-12)
    assert 0.0 < q.max() - 1.0 < 2.0 * v * a / j


# --- the step ---


def setup_of(name, **limits):
    return Scenario.load(name).with_override("limits", limits).setup()


CASES = {
    "acceleration": {"acceleration": 5.0},
    "jerk": {"jerk": [100.0, 200.0, 300.0, 400.0, 500.0, 600.0]},
    "both": {"acceleration": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "jerk": 1000.0},
    "ranges": {"acceleration": 5.0, "jerk": 900.0, "ranges": True},
}


@compiled
@pytest.mark.parametrize("case", CASES)
def test_the_compiled_step_and_the_definition_have_the_same_box(case):
    setup = setup_of("ur5-fov", **CASES[case])
    rng = np.random.default_rng(0)
    step = setup.control()
    robot = setup.scene.robot
    for _ in range(50):
        q = setup.q0 + rng.normal(scale=0.05, size=6)
        qd = rng.normal(size=6)
        step.commanded(rng.normal(scale=3.0, size=6))
        rows = step.evaluate(0.0, q, qd).rows
        defined = define(step, setup.scene.evaluate(0.0, q, qd)).rows
        for name in ("qdd_min", "qdd_max"):
            np.testing.assert_allclose(getattr(rows, name), getattr(defined, name), rtol=1e-12)
            by_hand = joint_box(
                q, qd, step.last_command, setup.limits.arrays(robot.ranges, setup.Ts)
            )
        np.testing.assert_allclose([rows.qdd_min, rows.qdd_max], by_hand, rtol=1e-12)


def test_without_limits_rows_state_no_box():
    setup = Scenario.load("ur5-image").setup()
    assert setup.limits is NO_LIMITS
    for rows in (
        setup.control().evaluate(0.0, setup.q0, setup.qd0).rows,
        define(setup.control(), setup.scene.evaluate(0.0, setup.q0, setup.qd0)).rows,
    ):
        assert rows.qdd_min.shape == rows.qdd_max.shape == (0,)


def test_a_step_remembers_the_command_and_forgets_it():
    setup = setup_of("ur5-fov", jerk=100.0)
    step = setup.control()
    law = SlidingMode()
    first = step.command(law, 0.0, setup.q0, setup.qd0)[1].qdd
    np.testing.assert_array_equal(step.last_command, first)
    assert np.abs(first).max() == 100.0 * setup.Ts
    again = pickle.loads(pickle.dumps(step))
    np.testing.assert_array_equal(again.last_command, first)
    second = [each.command(law, 0.002, setup.q0, setup.qd0)[1].qdd for each in (step, again)]
    np.testing.assert_array_equal(*second)
    assert np.abs(second[0]).max() == pytest.approx(2 * 100.0 * setup.Ts)
    step.reset()
    assert not step.last_command.any()


class Reckless(Controller):
    """A law in NumPy that commands far too much, up and down."""

    name = "reckless"

    def __init__(self):
        self.sign = 1.0

    def reset(self, period=None):
        self.sign = 1.0

    def solve(self, rows, task):
        self.sign = -self.sign
        return Command(
            np.full(6, 1e3 * self.sign), "ok", np.zeros(len(rows.labels), dtype=bool), rows.labels
        )


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("case", ["both", "ranges"])
@pytest.mark.parametrize("law", [SlidingMode, HierarchicalQP, Tracking, Reckless])
def test_no_run_exceeds_what_the_actuators_have(law, case, known):
    setup = replace(
        setup_of("ur5-fov", **CASES[case], known=known), duration=0.6, on_rank_loss="continue"
    )
    run = simulate(setup, law())
    limits = setup.limits
    a = limits.of_joint("acceleration", 6)
    j = limits.of_joint("jerk", 6)
    commands = np.vstack([np.zeros(6), run.qdd_command])
    assert (np.abs(commands) <= a).all()
    assert (np.abs(np.diff(commands, axis=0)) <= j * setup.Ts * (1.0 + 1e-9)).all()
    # what was commanded was carried out
    np.testing.assert_allclose(np.diff(run.qd, axis=0), setup.Ts * run.qdd_command[:-1], atol=1e-12)
    at = (np.abs(commands[1:]) >= a * (1 - 1e-9)) | (
        np.abs(np.diff(commands, axis=0)) >= j * setup.Ts * (1 - 1e-6)
    )
    np.testing.assert_array_equal(run.saturated, at.any(axis=1))
    scores = score_run(setup, law())
    assert scores.saturated_time_s == pytest.approx(run.saturated.sum() * setup.Ts)
    np.testing.assert_array_equal(scores.share_to_hold, run.share_to_hold)


@compiled
@pytest.mark.parametrize("law", [SlidingMode, HierarchicalQP])
def test_both_loops_say_the_same(law, monkeypatch):
    setup = replace(setup_of("ur5-fov", **CASES["ranges"]), duration=0.6)
    one = simulate(setup, law())
    monkeypatch.setattr("vsconstraints.control.control_step.ControlStep.bound", lambda step: None)
    other = simulate(setup, law())
    assert one.compiled
    assert not other.compiled
    np.testing.assert_allclose(one.qdd_command, other.qdd_command, atol=1e-5)
    np.testing.assert_array_equal(one.saturated, other.saturated)
    np.testing.assert_allclose(one.share_to_hold, other.share_to_hold, rtol=1e-6)


def test_what_holding_takes_is_what_a_linear_program_says():
    """Where φ first comes to zero or tracking brings it there: min over |q̈| ≤ a of φ̇ is positive
    above a share of 1.
    """
    above = below = 0
    for name, a in (
        ("ur5-fov", 1.0),
        ("ur5-fov", 5.0),
        ("panda-fov", 2.0),
        ("example-2d-fast", 0.5),
    ):
        setup = setup_of(name, acceleration=a)
        run = simulate(setup, Tracking())
        step = setup.control()
        law = Tracking()
        found = np.full(len(run.labels), np.nan)
        for k in range(len(run.t)):
            now = step.evaluate(run.t[k], run.q[k], run.qd[k])
            rows = now.rows
            free = law.command(now.rows, now.task).qdd
            soon = rows.phi + setup.Ts * (rows.Lf + rows.Lg @ free)
            for i in np.flatnonzero((np.maximum(rows.phi, soon) >= 0.0) & np.isnan(found)):
                falls = linprog(rows.Lg[i], bounds=[(-a, a)] * setup.scene.robot.n)
                found[i] = rows.Lf[i] / -falls.fun
                # a row of a speed has L_fφ = 0
                above += rows.Lf[i] + falls.fun > 0.0
                below += rows.Lf[i] + falls.fun < 0.0
        np.testing.assert_allclose(run.share_to_hold, found, rtol=1e-6, atol=1e-9)
    assert above
    assert below


@pytest.mark.parametrize("name", ["ur5-fov", "panda-fov"])
def test_what_the_actuators_hold_back_no_row_does(name):
    """Tracking alone asks for more than there is: that slows rows, but none of them acts."""
    run = simulate(Scenario.load(name).setup(), Tracking())
    assert run.saturated.any()
    assert not run.active.any()


# --- as data ---


def test_ready_made_robots_have_published_limits():
    np.testing.assert_array_equal(
        panda().limits.acceleration, [15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]
    )
    np.testing.assert_array_equal(
        panda().limits.jerk, [7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]
    )
    np.testing.assert_array_equal(panda().limits.effort, [87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])
    assert ur5().limits.acceleration == 40.0
    np.testing.assert_array_equal(ur5().limits.effort, [150.0, 150.0, 150.0, 28.0, 28.0, 28.0])
    assert planar_3r().limits is NO_LIMITS


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        ({"acceleration": 0.0}, "acceleration must be a positive number"),
        ({"acceleration": -1.0}, "so that a joint can stand still"),
        ({"acceleration": [1.0, -1.0]}, "positive number"),
        ({"acceleration": float("nan")}, "positive number"),
        ({"acceleration": []}, "positive number"),
        ({"acceleration": True}, "positive number"),
        ({"acceleration": "5"}, "positive number"),
        ({"jerk": [[1.0]]}, "jerk must be a positive number"),
        ({"effort": 0.0}, "effort must be a positive number"),
        ({"ranges": True}, "need an acceleration limit for every joint"),
        (
            {"ranges": True, "acceleration": [1.0, float("inf")]},
            "need an acceleration limit for every joint",
        ),
    ],
)
def test_limits_that_are_none_are_refused(limits, said):
    with pytest.raises(ConfigurationError, match=said):
        ActuatorLimits(**limits)


def test_limits_that_do_not_fit_are_refused():
    setup = Scenario.load("ur5-fov").setup()
    parts = setup.scene, setup.constraints, setup.task
    with pytest.raises(
        ConfigurationError, match="the limit of jerk must be one number or 6, one per joint, not 2"
    ):
        ControlStep(*parts, limits=ActuatorLimits(jerk=(1.0, 2.0)), period=0.002)
    for period in (None, 0.0, -1.0, float("inf"), float("nan")):
        with pytest.raises(InvalidInput, match="need the sampling period"):
            ControlStep(*parts, limits=ActuatorLimits(jerk=1.0), period=period)
    with pytest.raises(
        ConfigurationError,
        match="the limit of acceleration must be one number or 1, one per joint, not 2",
    ):
        Robot.from_dh([[0.0, 0.0, 1.0, 0.0]], limits=ActuatorLimits(acceleration=(1.0, 2.0)))
    for value, said in (
        ("arm", "arm"),
        ({"acceleration": 0.0}, "positive number"),
        ({"speed": 1.0}, "speed"),
        ({"acceleration": [1.0, 2.0]}, "must be one number or 6"),
    ):
        with pytest.raises(ConfigurationError, match=said):
            Scenario.load("ur5-fov").with_override("limits", value).setup()
    assert not Scenario.load("example-2d-fov").with_override("limits", "robot").setup().limits.any


def test_a_scenario_takes_the_robots_limits_or_states_its_own():
    base = Scenario.load("ur5-fov")
    assert base.with_override("limits", "robot").setup().limits == ur5().limits
    assert base.with_override("limits", {"acceleration": 2}).setup().limits == ActuatorLimits(
        acceleration=2.0
    )


def test_limits_decide_more_than_the_law():
    """With ±1 rad/s² the barrier within the box keeps the image that the paper's law, brought into
    the box, loses.
    """
    setup = replace(setup_of("example-2d-fast", acceleration=1.0), on_rank_loss="continue")
    barrier = simulate(setup, HierarchicalQP())
    paper = simulate(setup, SlidingMode())
    assert barrier.status == "converged"
    assert barrier.sigma.max() < 0.0
    assert paper.sigma.max() > 100.0
    # nor does the barrier keep it with half of that
    assert (
        simulate(setup_of("example-2d-fast", acceleration=0.5), HierarchicalQP()).sigma.max() > 1.0
    )
