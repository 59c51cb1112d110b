"""Tracking: gains, goals that change, and derivatives by differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from folder_laws import goal_governor
from numpy_form import evaluate_task, feature_motion, reset
from scenes import random_goal, random_scene, robot, slope
from vsconstraints.controllers import Tracking
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.formulas.tracking import resting
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate
from vsconstraints.vision.features import CameraPose, Feature, Goal, ImagePoints, MinimumJerk
from vsconstraints.vision.scene import Scene, State
from vsconstraints.vision.tracking import TrackingGains, VisualTask

FEATURES = [CameraPose(), ImagePoints()]


def scene_and_goals(count: int = 2, seed: int = 1) -> tuple[Scene, Array, Array, list[Goal]]:
    rng = np.random.default_rng(seed)
    scene, q, qd = random_scene(robot("viper-s650"), rng)
    state = scene.evaluate(0.0, q, qd)
    goals = [
        replace(random_goal(state, scene.camera, rng, 0.8), from_time=2.0 * i) for i in range(count)
    ]
    return scene, q, qd, goals


def states_along(scene: Scene, q: Array, qd: Array, times: Array) -> list[State]:
    return [scene.evaluate(float(t), q + t * qd, qd) for t in times]


# --- gains ---


def test_gains_have_the_printed_value_and_slope_at_zero() -> None:
    """Eq. (42) with the paper's numbers: K_p(0) = 20, its slope 40, K_v = 3 √K_p."""
    gains = TrackingGains(20.0, 40.0)
    assert gains.at(np.zeros(6)) == (20.0, pytest.approx(3.0 * np.sqrt(20.0)))

    def along(s: float) -> float:
        return gains.at(np.array([0.0, s, 0.0]))[0]

    h = 1e-6
    assert (along(h) - along(0.0)) / h == pytest.approx(-40.0, rel=1e-5)
    # the norm is Euclidean, and the gain vanishes far away
    assert gains.at(np.array([0.3, 0.4]))[0] == pytest.approx(20.0 * np.exp(-2.0 * 0.5))
    assert gains.at(np.full(6, 100.0))[0] == pytest.approx(0.0, abs=1e-100)
    for error in (np.zeros(3), np.array([0.1, -0.2, 0.05])):
        Kp, Kv = gains.at(error)
        assert Kv == pytest.approx(3.0 * np.sqrt(Kp))


def test_the_experiments_gain_decays_as_fast_as_they_say() -> None:
    """K_T,p(e) = 0.6 exp(−16.7 ‖e‖)."""
    gains = TrackingGains(0.6, 10.0)
    assert gains.at(np.array([0.5]))[0] == pytest.approx(0.6 * np.exp(-16.7 * 0.5), rel=0.02)


def test_other_damping_and_constant_gain() -> None:
    gains = TrackingGains(9.0, damping=2.0)
    assert gains.at(np.zeros(2)) == (9.0, 6.0)
    assert gains.at(np.full(2, 5.0)) == (9.0, 6.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"Kp0": 0.0}, "Kp0 must be positive"),
        ({"Kp0": -1.0}, "Kp0 must be positive"),
        ({"Kp0": np.nan}, "Kp0 must be positive"),
        ({"Kp0": np.inf}, "Kp0 must be positive"),
        ({"Kp_slope": -1.0}, "Kp_slope must be zero or more"),
        ({"Kp_slope": np.nan}, "Kp_slope must be zero or more"),
        ({"damping": -0.1}, "damping must be zero or more"),
    ],
)
def test_gains_that_are_none_are_refused(arguments: dict[str, float], words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        TrackingGains(**{"Kp0": 1.0, **arguments})


# --- the law ---


@pytest.mark.parametrize("feature", FEATURES, ids=lambda f: f.name)
def test_the_task_makes_the_error_obey_a_damped_oscillator(feature: Feature) -> None:
    """With J q̈ = b, ë = −K_v ė − K_p e: checked on the error's own second derivative along that
    motion.
    """
    scene, q, qd, goals = scene_and_goals()
    gains = TrackingGains(7.0, 3.0)
    task = VisualTask(feature, goals, gains)
    state = scene.evaluate(0.0, q, qd)
    demand, error = evaluate_task(task, state)
    motion = feature_motion(feature, state, goals[0], None)
    # any q̈ that meets the task; with six joints and six equations there is one
    qdd = np.linalg.lstsq(demand.J, demand.b)[0]
    met = demand.J @ qdd

    def velocity(t: float) -> Array:
        moved = scene.evaluate(t, q + t * qd + 0.5 * t * t * qdd, qd + t * qdd)
        return feature_motion(feature, moved, goals[0], motion.error).velocity

    Kp, Kv = gains.at(error)
    wanted = -Kv * motion.velocity - Kp * error
    np.testing.assert_allclose(
        slope(velocity, 2e-4), wanted + (met - demand.b), rtol=1e-6, atol=1e-6
    )
    assert np.abs(wanted).max() > 0.1
    np.testing.assert_array_equal(error, motion.error)


# --- goals ---


@pytest.mark.parametrize("feature", FEATURES, ids=lambda f: f.name)
def test_goals_change_at_their_times(feature: Feature) -> None:
    scene, q, qd, goals = scene_and_goals(3)
    task = VisualTask(feature, goals, TrackingGains(1.0))
    assert [task.goal_at(t) for t in (0.0, 1.9999, 2.0, 3.0, 4.0, 100.0)] == [0, 0, 1, 1, 2, 2]
    # a multiple of the sampling time that is a rounding below the goal's counts
    assert task.goal_at(2.0 - 1e-12) == 1
    for t, goal in ((0.0, goals[0]), (2.0, goals[1]), (4.5, goals[2])):
        state = scene.evaluate(t, q, qd)
        _, error = evaluate_task(task, state)
        np.testing.assert_allclose(
            error, feature_motion(feature, state, goal, None).error, atol=1e-12
        )


def test_the_first_goal_holds_from_the_start_whatever_its_time() -> None:
    _, _, _, goals = scene_and_goals(1)
    late = VisualTask(ImagePoints(), [replace(goals[0], from_time=5.0)], TrackingGains(1.0))
    assert late.goal_at(0.0) == 0


def test_goals_that_cannot_be_followed_are_refused() -> None:
    _, _, _, goals = scene_and_goals(2)
    gains = TrackingGains(1.0)
    with pytest.raises(ConfigurationError, match="at least one goal"):
        VisualTask(CameraPose(), [], gains)
    with pytest.raises(ConfigurationError, match=r"order of their times.*\[2.0, 0.0\]"):
        VisualTask(CameraPose(), goals[::-1], gains)
    with pytest.raises(ConfigurationError, match="order of their times"):
        VisualTask(CameraPose(), [goals[0], goals[0]], gains)
    with pytest.raises(ConfigurationError, match="camera pose"):
        VisualTask(CameraPose(), [goals[0], replace(goals[1], camera=None)], gains)
    with pytest.raises(ConfigurationError, match=r"unknown drift 'exactly'.*Did you mean 'exact'"):
        VisualTask(CameraPose(), goals, gains, drift="exactly")
    with pytest.raises(ConfigurationError, match="unknown velocity 'none'"):
        VisualTask(CameraPose(), goals, gains, velocity="none")


# --- differences ---


def terms(feature: Feature, state: State, goal: Goal, gains: TrackingGains, b: Array) -> Array:
    """What b holds besides −K_p e: −(K_v ṡ + J̇_s q̇)."""
    motion = feature_motion(feature, state, goal, None)
    return b + gains.at(motion.error)[0] * motion.error


@pytest.mark.parametrize("feature", FEATURES, ids=lambda f: f.name)
def test_differences_start_afresh_at_the_first_sample_and_where_the_goal_changes(
    feature: Feature,
) -> None:
    scene, q, qd, goals = scene_and_goals(2)
    gains = TrackingGains(5.0)
    task = VisualTask(feature, goals, gains, drift="differences", velocity="differences")
    fresh = VisualTask(feature, goals, gains, drift="differences", velocity="differences")
    Ts = 0.01
    first, second, third = states_along(scene, q, qd, np.array([2.0 - 2 * Ts, 2.0 - Ts, 2.0]))
    started, _ = evaluate_task(task, first)
    # at the first sample there is no difference: the velocity is exact and the drift left out
    motion = feature_motion(feature, first, goals[0], None)
    Kp, Kv = gains.at(motion.error)
    np.testing.assert_allclose(started.b, -Kp * motion.error - Kv * motion.velocity, rtol=1e-12)
    running, _ = evaluate_task(task, second)
    now = feature_motion(feature, second, goals[0], motion.error)
    expected = (
        -Kp * now.error
        - Kv * (now.error - motion.error) / Ts
        - (now.J - motion.J) @ second.robot.qd / Ts
    )
    Kp_now = gains.at(now.error)[0]
    assert Kp_now == Kp
    np.testing.assert_allclose(running.b, expected, rtol=1e-9, atol=1e-9)
    # where the goal jumps, the task is that of a controller which has just been started
    jumped, _ = evaluate_task(task, third)
    restarted, _ = evaluate_task(fresh, third)
    np.testing.assert_array_equal(jumped.b, restarted.b)
    assert np.abs(jumped.b).max() < 1e3


@pytest.mark.parametrize("feature", FEATURES, ids=lambda f: f.name)
@pytest.mark.parametrize("which", ["drift", "velocity"])
def test_differences_converge_to_the_exact_derivative_with_first_order(
    feature: Feature, which: str
) -> None:
    scene, q, qd, goals = scene_and_goals(1)
    gains = TrackingGains(4.0)
    exact, _ = evaluate_task(VisualTask(feature, goals, gains), scene.evaluate(1.0, q, qd))
    deviations = []
    for Ts in (4e-3, 2e-3, 1e-3, 5e-4):
        task = VisualTask(feature, goals, gains, **{which: "differences"})
        evaluate_task(task, scene.evaluate(1.0 - Ts, q - Ts * qd, qd))
        by_differences, _ = evaluate_task(task, scene.evaluate(1.0, q, qd))
        deviations.append(np.abs(by_differences.b - exact.b).max())
    ratios = np.array(deviations[:-1]) / np.array(deviations[1:])
    # halving the period halves the error, up to its own second-order part of a few periods
    np.testing.assert_allclose(ratios, 2.0, atol=0.05)
    assert deviations[-1] < 1e-2 * np.abs(exact.b).max()
    assert deviations[-1] > 1e-8


def test_two_samples_at_one_time_do_not_divide_by_zero() -> None:
    scene, q, qd, goals = scene_and_goals(1)
    task = VisualTask(
        CameraPose(), goals, TrackingGains(1.0), drift="differences", velocity="differences"
    )
    state = scene.evaluate(1.0, q, qd)
    first, _ = evaluate_task(task, state)
    again, _ = evaluate_task(task, state)
    np.testing.assert_allclose(first.b, again.b, rtol=1e-12)


def test_reset_forgets_the_last_sample() -> None:
    scene, q, qd, goals = scene_and_goals(1)
    task = VisualTask(
        CameraPose(), goals, TrackingGains(1.0), drift="differences", velocity="differences"
    )
    early, late = states_along(scene, q, qd, np.array([0.0, 0.01]))
    evaluate_task(task, early)
    continued, _ = evaluate_task(task, late)
    reset(task)
    afresh, _ = evaluate_task(task, late)
    other = VisualTask(
        CameraPose(), goals, TrackingGains(1.0), drift="differences", velocity="differences"
    )
    alone, _ = evaluate_task(other, late)
    np.testing.assert_array_equal(afresh.b, alone.b)
    assert not np.array_equal(afresh.b, continued.b)


def test_the_rotation_stays_continuous_through_half_a_turn() -> None:
    """The error of a camera that turns past π grows beyond it instead of jumping to −π."""
    arm = robot("planar-3r")
    rng = np.random.default_rng(2)
    scene, q, _ = random_scene(arm, rng)
    qd = np.array([0.0, 0.0, 1.0])
    state = scene.evaluate(0.0, q, qd)
    goal = random_goal(state, scene.camera, rng, 0.0)
    task = VisualTask(CameraPose(), [goal], TrackingGains(1.0))
    # the markers would leave the image; only the pose matters here
    angles = []
    for k in range(50):
        t = 0.1 * k
        camera = scene.camera_pose(q + t * qd)
        pose_only = replace(state, t=t, camera=camera)
        _, error = evaluate_task(task, pose_only)
        angles.append(float(np.linalg.norm(error[3:])))
    np.testing.assert_allclose(angles, 0.1 * np.arange(50), atol=1e-6)
    assert angles[-1] > np.pi + 1.0


# --- reference trajectories ---


def test_a_reference_goes_from_start_to_goal_and_rests_there() -> None:
    start = np.array([0.4, -1.2])
    reference = MinimumJerk(2.5)
    for elapsed, expected in (
        (0.0, start),
        (2.5, 0.0 * start),
        (7.0, 0.0 * start),
        (1.25, 0.5 * start),
    ):
        s_ref, rate, acceleration = reference.at(elapsed, start)
        np.testing.assert_allclose(s_ref, expected, atol=1e-15)
        if elapsed != 1.25:
            np.testing.assert_array_equal(rate, 0.0)
            np.testing.assert_array_equal(acceleration, 0.0)


def test_derivatives_of_a_reference_are_those_of_finite_differences() -> None:
    start = np.array([0.4, -1.2])
    reference = MinimumJerk(2.5)
    h = 1e-5
    for elapsed in np.linspace(0.05, 2.4, 17):
        before, (_, rate, acceleration), after = (
            reference.at(elapsed + step, start) for step in (-h, 0.0, h)
        )
        np.testing.assert_allclose(rate, (after[0] - before[0]) / (2.0 * h), rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(
            acceleration, (after[1] - before[1]) / (2.0 * h), rtol=1e-6, atol=1e-9
        )


@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan, np.inf])
def test_a_reference_takes_a_positive_time(duration: float) -> None:
    with pytest.raises(InvalidInput, match="duration of a reference trajectory"):
        MinimumJerk(duration)


@pytest.mark.parametrize("feature", FEATURES, ids=lambda f: f.name)
def test_a_reference_enters_error_rate_and_acceleration(feature: Feature) -> None:
    """b = s̈_ref − K_p (s − s_ref) − K_v (ṡ − ṡ_ref) − J̇_s q̇, with s_ref written out here (eqs.
    41 and 42).
    """
    scene, q, qd, goals = scene_and_goals(1)
    gains = TrackingGains(5.0, 3.0)
    task = VisualTask(feature, [replace(goals[0], reference=MinimumJerk(1.6))], gains)
    for t in (0.2, 0.5, 1.1, 2.5):
        state = scene.evaluate(t, q + t * qd, qd)
        motion = feature_motion(feature, state, goals[0], None)
        found, error = evaluate_task(task, state)
        if t == 0.2:
            start = motion.error
        x = min((t - 0.2) / 1.6, 1.0)
        left = np.polyval([-6, 15, -10, 0, 0, 1], x)
        rate = 0.0
        acceleration = 0.0
        if x < 1.0:
            rate = np.polyval([-30, 60, -30, 0, 0], x) / 1.6
            acceleration = np.polyval([-120, 180, -60, 0], x) / 1.6**2
        np.testing.assert_allclose(error, motion.error - left * start, atol=1e-12)
        Kp, Kv = gains.at(error)
        expected = (
            acceleration * start - Kp * error - Kv * (motion.velocity - rate * start) - motion.drift
        )
        np.testing.assert_allclose(found.b, expected, rtol=1e-10, atol=1e-10)


def test_lines_3_and_4_of_appendix_b_difference_the_reference() -> None:
    scene, q, qd, goals = scene_and_goals(1)
    reference = MinimumJerk(1.6)
    Ts = 0.01
    gains = TrackingGains(5.0)
    goal = replace(goals[0], reference=reference)
    task = VisualTask(CameraPose(), [goal], gains, reference="differences")
    exact = VisualTask(CameraPose(), [goal], gains)
    start = feature_motion(CameraPose(), scene.evaluate(0.0, q, qd), goal, None).error
    s_ref = start
    rate = np.zeros(6)
    for k in range(6):
        state = scene.evaluate(k * Ts, q + k * Ts * qd, qd)
        found, error = evaluate_task(task, state)
        other, same = evaluate_task(exact, state)
        np.testing.assert_array_equal(error, same)
        now, its_rate, its_acceleration = reference.at(k * Ts, start)
        new_rate = (now - s_ref) / Ts if k else np.zeros(6)
        acceleration = (new_rate - rate) / Ts if k else np.zeros(6)
        s_ref = now
        rate = new_rate
        Kv = gains.at(error)[1]
        change = acceleration - its_acceleration + Kv * (rate - its_rate)
        np.testing.assert_allclose(found.b - other.b, change, rtol=1e-9, atol=1e-9)


def test_differences_of_a_reference_start_afresh_where_the_goal_changes() -> None:
    scene, q, qd, goals = scene_and_goals(2)
    goals = [replace(goal, reference=MinimumJerk(1.0)) for goal in goals]
    gains = TrackingGains(5.0)
    task = VisualTask(CameraPose(), goals, gains, reference="differences")
    fresh = VisualTask(CameraPose(), goals, gains, reference="differences")
    for state in states_along(scene, q, qd, np.array([1.98, 1.99])):
        evaluate_task(task, state)
    (at_change,) = states_along(scene, q, qd, np.array([2.0]))
    np.testing.assert_array_equal(
        evaluate_task(task, at_change)[0].b, evaluate_task(fresh, at_change)[0].b
    )
    np.testing.assert_allclose(evaluate_task(task, at_change)[1], 0.0, atol=1e-12)


def test_a_scenario_with_a_reference_follows_it() -> None:
    """Ideal tracking from rest stays on the reference, up to what sampling leaves."""
    scenario = Scenario.load("example-2d-fov").with_override("task.goals.0.reach_in", 3.0)
    scenario = scenario.with_override("duration", 4.0).with_override("task.drift", "exact")
    setup = scenario.setup()
    run = simulate(setup, Tracking())
    assert run.status == "converged"
    at_once = simulate(
        scenario.with_override("task.goals", [{"camera_at_q": [-0.72, -1.744, 4.2]}]).setup(),
        Tracking(),
    )
    assert np.abs(run.error).max() < 0.02 < np.abs(at_once.error).max()
    halfway = int(np.argmin(np.abs(run.t - 1.5)))
    assert run.camera_error[halfway, 1] == pytest.approx(0.5 * np.pi, abs=0.02)


@pytest.mark.parametrize("value", [0.0, -1.0, "soon"])
def test_a_scenario_says_what_is_wrong_with_its_reference(value: object) -> None:
    with pytest.raises(
        (ConfigurationError, InvalidInput), match=r"reach_in|duration of a reference"
    ):
        Scenario.load("example-2d-fov").with_override("task.goals.0.reach_in", value).setup()


@pytest.mark.parametrize("h", [1e-3, 0.1, 10.0])
def test_a_held_rest_is_by_the_implicit_midpoint_rule(h: float) -> None:
    """What is held equals what is asked in the middle, of a motion that holds it."""
    damping = 5.0
    stiffness = 6.25
    posture = 0.3
    q = 0.7
    qd = -0.4
    rest = resting(q, qd, posture, damping, stiffness)
    a = goal_governor.held_rest(rest, qd, damping, stiffness, h)
    q_mid = 0.5 * (q + q + h * qd + 0.5 * h * h * a)
    qd_mid = qd + 0.5 * h * a
    assert a == pytest.approx(-damping * qd_mid + stiffness * (posture - q_mid), rel=1e-12)


@pytest.mark.parametrize("h", [1e-3, 0.1, 10.0])
def test_held_gains_are_the_implicit_midpoint_rule(h: float) -> None:
    """What is held equals what the law asks in the middle, of a motion that holds it."""
    Kp = 20.0
    Kv = 13.0
    e = 0.7
    rate = -0.4
    P, V = goal_governor.held_gains(Kp, Kv, h)
    a = -P * e - V * rate
    e_mid = 0.5 * (e + e + h * rate + 0.5 * h * h * a)
    rate_mid = rate + 0.5 * h * a
    assert a == pytest.approx(-Kp * e_mid - Kv * rate_mid, rel=1e-12)
    energy = Kp * e * e + rate * rate
    for _ in range(200):
        a = -P * e - V * rate
        before = energy
        e = e + h * rate + 0.5 * h * h * a
        rate = rate + h * a
        energy = Kp * e * e + rate * rate
        assert energy < before
