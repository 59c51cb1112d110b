"""Tracking: gains, goals that change, and derivatives by differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenes import random_goal, random_scene, robot, slope
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.features import CameraPose, Feature, Goal, ImagePoints
from vsconstraints.rows import Array
from vsconstraints.scene import Scene, State
from vsconstraints.tracking import TrackingGains, VisualTask

FEATURES = [CameraPose(), ImagePoints()]


def scene_and_goals(count: int = 2, seed: int = 1) -> tuple[Scene, Array, Array, list[Goal]]:
    rng = np.random.default_rng(seed)
    scene, q, qd = random_scene(robot("viper-s650"), rng)
    state = scene.evaluate(0.0, q, qd)
    goals = [replace(random_goal(state, scene.camera, rng, 0.8), from_time=2.0 * i) for i in range(count)]
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
        ({"slope": -1.0}, "slope must be zero or more"),
        ({"slope": np.nan}, "slope must be zero or more"),
        ({"damping": -0.1}, "damping must be zero or more"),
    ],
)
def test_gains_that_are_none_are_refused(arguments: dict[str, float], words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        TrackingGains(**{"Kp0": 1.0, **arguments})


# --- the law ---


@pytest.mark.parametrize("feature", FEATURES, ids=lambda f: f.name)
def test_the_task_makes_the_error_obey_a_damped_oscillator(feature: Feature) -> None:
    """With J q̈ = b, ë = −K_v ė − K_p e: checked on the error's own second derivative along that motion."""
    scene, q, qd, goals = scene_and_goals()
    gains = TrackingGains(7.0, 3.0)
    task = VisualTask(feature, goals, gains)
    state = scene.evaluate(0.0, q, qd)
    demand, error = task.evaluate(state)
    motion = feature.evaluate(state, goals[0], None)
    # any q̈ that meets the task; with six joints and six equations there is one
    qdd = np.linalg.lstsq(demand.J, demand.b)[0]
    met = demand.J @ qdd

    def velocity(t: float) -> Array:
        moved = scene.evaluate(t, q + t * qd + 0.5 * t * t * qdd, qd + t * qdd)
        return feature.evaluate(moved, goals[0], motion.error).velocity

    Kp, Kv = gains.at(error)
    wanted = -Kv * motion.velocity - Kp * error
    np.testing.assert_allclose(slope(velocity, 2e-4), wanted + (met - demand.b), rtol=1e-6, atol=1e-6)
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
        _, error = task.evaluate(state)
        np.testing.assert_allclose(error, feature.evaluate(state, goal, None).error, atol=1e-12)


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
    scene, q, qd, _ = scene_and_goals()
    state = scene.evaluate(0.0, q, qd)
    with pytest.raises(ValueError, match="camera pose"):
        CameraPose().evaluate(state, replace(goals[0], camera=None), None)
    with pytest.raises(ConfigurationError, match=r"unknown drift 'exactly'.*Did you mean 'exact'"):
        VisualTask(CameraPose(), goals, gains, drift="exactly")
    with pytest.raises(ConfigurationError, match="unknown velocity 'none'"):
        VisualTask(CameraPose(), goals, gains, velocity="none")


# --- differences ---


def terms(feature: Feature, state: State, goal: Goal, gains: TrackingGains, b: Array) -> Array:
    """What b holds besides −K_p e: −(K_v ṡ + J̇_s q̇)."""
    motion = feature.evaluate(state, goal, None)
    return b + gains.at(motion.error)[0] * motion.error


@pytest.mark.parametrize("feature", FEATURES, ids=lambda f: f.name)
def test_differences_start_afresh_at_the_first_sample_and_where_the_goal_changes(feature: Feature) -> None:
    scene, q, qd, goals = scene_and_goals(2)
    gains = TrackingGains(5.0)
    task = VisualTask(feature, goals, gains, drift="differences", velocity="differences")
    fresh = VisualTask(feature, goals, gains, drift="differences", velocity="differences")
    Ts = 0.01
    first, second, third = states_along(scene, q, qd, np.array([2.0 - 2 * Ts, 2.0 - Ts, 2.0]))
    started, _ = task.evaluate(first)
    # at the first sample there is no difference: the velocity is exact and the drift left out
    motion = feature.evaluate(first, goals[0], None)
    Kp, Kv = gains.at(motion.error)
    np.testing.assert_allclose(started.b, -Kp * motion.error - Kv * motion.velocity, rtol=1e-12)
    running, _ = task.evaluate(second)
    now = feature.evaluate(second, goals[0], motion.error)
    expected = -Kp * now.error - Kv * (now.error - motion.error) / Ts - (now.J - motion.J) @ second.robot.qd / Ts
    Kp_now = gains.at(now.error)[0]
    assert Kp_now == Kp
    np.testing.assert_allclose(running.b, expected, rtol=1e-9, atol=1e-9)
    # where the goal jumps, the task is that of a controller which has just been started
    jumped, _ = task.evaluate(third)
    restarted, _ = fresh.evaluate(third)
    np.testing.assert_array_equal(jumped.b, restarted.b)
    assert np.abs(jumped.b).max() < 1e3


@pytest.mark.parametrize("feature", FEATURES, ids=lambda f: f.name)
@pytest.mark.parametrize("which", ["drift", "velocity"])
def test_differences_converge_to_the_exact_derivative_with_first_order(feature: Feature, which: str) -> None:
    scene, q, qd, goals = scene_and_goals(1)
    gains = TrackingGains(4.0)
    exact, _ = VisualTask(feature, goals, gains).evaluate(scene.evaluate(1.0, q, qd))
    deviations = []
    for Ts in (4e-3, 2e-3, 1e-3, 5e-4):
        task = VisualTask(feature, goals, gains, **{which: "differences"})
        task.evaluate(scene.evaluate(1.0 - Ts, q - Ts * qd, qd))
        by_differences, _ = task.evaluate(scene.evaluate(1.0, q, qd))
        deviations.append(np.abs(by_differences.b - exact.b).max())
    ratios = np.array(deviations[:-1]) / np.array(deviations[1:])
    # halving the period halves the error, up to its own second-order part of a few periods
    np.testing.assert_allclose(ratios, 2.0, atol=0.05)
    assert deviations[-1] < 1e-2 * np.abs(exact.b).max()
    assert deviations[-1] > 1e-8


def test_two_samples_at_one_time_do_not_divide_by_zero() -> None:
    scene, q, qd, goals = scene_and_goals(1)
    task = VisualTask(CameraPose(), goals, TrackingGains(1.0), drift="differences", velocity="differences")
    state = scene.evaluate(1.0, q, qd)
    first, _ = task.evaluate(state)
    again, _ = task.evaluate(state)
    np.testing.assert_allclose(first.b, again.b, rtol=1e-12)


def test_reset_forgets_the_last_sample() -> None:
    scene, q, qd, goals = scene_and_goals(1)
    task = VisualTask(CameraPose(), goals, TrackingGains(1.0), drift="differences", velocity="differences")
    early, late = states_along(scene, q, qd, np.array([0.0, 0.01]))
    task.evaluate(early)
    continued, _ = task.evaluate(late)
    task.reset()
    assert task.memory.last is None
    assert task.memory.goal == -1
    afresh, _ = task.evaluate(late)
    alone, _ = VisualTask(
        CameraPose(), goals, TrackingGains(1.0), drift="differences", velocity="differences"
    ).evaluate(late)
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
        _, error = task.evaluate(pose_only)
        angles.append(float(np.linalg.norm(error[3:])))
    np.testing.assert_allclose(angles, 0.1 * np.arange(50), atol=1e-6)
    assert angles[-1] > np.pi + 1.0
