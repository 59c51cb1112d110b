"""Scenes as an environment of Gymnasium: the same loop as a simulation's, its rewards, and its
ends.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium")

import gymnasium
from gymnasium.utils.env_checker import check_env

from vsconstraints.bench.families import Family
from vsconstraints.bench.learning import Policy
from vsconstraints.bench.learning.environment import ServoEnv
from vsconstraints.controllers import Tracking
from vsconstraints.errors import ConfigurationError
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

ENV = "vsconstraints.bench.learning.environment:vsconstraints/Servo-v0"
FOV = "example-2d-fov"


def scenario(name: str = FOV, **changes: Any) -> Scenario:
    scenario = Scenario.load(name)
    for key, value in changes.items():
        scenario = scenario.with_override(key.replace("__", "."), value)
    return scenario


def played(env: ServoEnv, actions: Any, **reset: Any) -> tuple[list[Any], ...]:
    """Observations, rewards and infos of an episode with these actions, until it ends."""
    observation, info = env.reset(**reset)
    seen = [observation]
    rewards = []
    infos = [info]
    for action in actions:
        observation, reward, terminated, truncated, info = env.step(action)
        (
            seen.append(observation),
            rewards.append(reward),
            infos.append({**info, "ends": (terminated, truncated)}),
        )
        if terminated or truncated:
            break
    return seen, rewards, infos


@pytest.mark.parametrize("options", [{"count": 2}, {"scenes": "ur5-fov", "law": "sliding-mode"}])
def test_gymnasium_finds_nothing_wrong(options: dict[str, Any]) -> None:
    check_env(gymnasium.make(ENV, **options).unwrapped)


def test_a_seed_says_which_scene_and_all_that_follows() -> None:
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (200, 3))
    first, second = (
        played(ServoEnv(count=5, condition="disturbed"), actions, seed=3) for _ in range(2)
    )
    assert all(np.array_equal(a, b) for a, b in zip(first[0], second[0], strict=True))
    assert first[1:] == second[1:]
    env = ServoEnv(count=5, condition="disturbed")
    again = played(env, actions, seed=3)
    assert again[1:] == first[1:]
    assert {env.reset(seed=seed)[1]["scene"] for seed in range(40)} == set(range(5))
    assert env.reset(options={"scene": 4})[1]["scene"] == 4


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"limits": {"acceleration": 3.0}},
        {
            "disturbances": {
                "pixel_noise": 0.5,
                "delay": 2,
                "time_constant": 0.02,
                "acceleration_noise": 0.5,
            }
        },
        {"name": "moving-target"},
        {"name": "case-study-6r"},
        {"name": "example-2d-fast", "duration": 4.0},
    ],
    ids=str,
)
def test_it_is_the_simulation(changes: dict[str, Any]) -> None:
    """No addition to a law: states, violation and end are those of the law's simulation."""
    given = scenario(**{"duration": 2.0, **changes})
    run = simulate(given.setup(), Tracking())
    env = ServoEnv(given, law="tracking")
    env.reset()
    done = False
    k = 0
    while not done:
        x = env.run.loop.plant.x
        assert np.array_equal(x[:2], [run.q[k], run.qd[k]])
        _, _, terminated, truncated, info = env.step(np.zeros(len(x[0])))
        k = k + 1
        done = terminated or truncated
    assert truncated == (k == len(run.t) - 1)
    assert info["t"] == run.t[k]
    scale = env.run.loop.true.scale
    assert info["violation"] == max(0.0, float((run.sigma[1 : k + 1] / scale).max()))
    # success is what the run is judged by, as soon as it is there
    setup = given.setup()
    there = setup.reached(run.t, run.camera_error, run.feature_error_px, run.qd)
    begin = round(setup.goal_begins[-1] / setup.Ts)
    dwell = round(setup.tolerances.dwell_s / setup.Ts)
    ends = [
        end for end in range(begin + dwell + 1, len(run.t)) if there[end - 1 - dwell : end].all()
    ]
    assert info["success"] == terminated == (k in ends[:1])
    assert terminated == ("duration" in changes)


def test_a_policy_meets_what_it_was_trained_on(tmp_path: Path) -> None:
    """Its actions in the environment are its commands in a simulation, up to the rounding of
    observations.
    """
    random = np.random.default_rng(0)
    env = ServoEnv("ur5-fov", law="tracking")
    size = env.observation_space.shape[0]
    arrays = {
        "W0": random.normal(0.0, 0.1, (8, size)),
        "b0": np.zeros(8),
        "W1": random.normal(0.0, 0.01, (6, 8)),
    }
    np.savez(tmp_path / "w.npz", b1=np.zeros(6), law="tracking", **arrays)
    policy = Policy(weights=str(tmp_path / "w.npz"))
    run = simulate(scenario("ur5-fov", duration=0.5).setup(), policy)
    assert (
        np.abs(
            run.qdd_command
            - simulate(scenario("ur5-fov", duration=0.5).setup(), Tracking()).qdd_command
        ).max()
        > 0.1
    )
    observation, _ = env.reset()
    for qdd in run.qdd_command[:-1]:
        observation, *_ = env.step(policy.action(observation))
        np.testing.assert_allclose(env.run.loop.answer.qdd, qdd, rtol=0.0, atol=1e-4)


def test_an_action_is_an_acceleration() -> None:
    """Against the double integrator by hand; beyond -1 and 1 it is cut."""
    env = ServoEnv(scenario(), acceleration=4.0)
    env.reset()
    setup = env.run.setup
    q = env.run.setup.q0
    qd = env.run.setup.qd0
    for action in ([0.5, -0.25, 0.1], [2.0, -7.0, 0.0]):
        env.step(np.array(action))
        qdd = 4.0 * np.clip(action, -1.0, 1.0)
        q = q + setup.Ts * qd + 0.5 * setup.Ts**2 * qdd
        qd = qd + setup.Ts * qdd
        np.testing.assert_allclose(env.run.loop.plant.x[:2], [q, qd], rtol=1e-12, atol=1e-14)
    limited = ServoEnv(scenario(limits={"acceleration": 3.0}), acceleration=4.0)
    limited.reset()
    limited.step(np.ones(3))
    np.testing.assert_allclose(limited.run.loop.plant.x[1], setup.qd0 + setup.Ts * 3.0, rtol=1e-12)


@pytest.mark.parametrize(("law", "action"), [("tracking", 0.0), (None, 0.5)])
def test_rewards_are_progress_less_violations(law: str | None, action: float) -> None:
    """Both from the control step of the setup, which the environment does not use; with more weight
    it pays less.
    """
    given = Family.load("planar-arm").scene(0, "training").scenario()
    paid, free = (ServoEnv(given, law=law, violation_weight=weight) for weight in (3.0, 0.0))
    (free.reset(), paid.reset())
    setup = given.setup()
    world = setup.world()
    before = first = np.linalg.norm(world.evaluate(0.0, setup.q0, setup.qd0).error)
    shares = []
    done = False
    while not done:
        rewards = [env.step(np.full(3, action)) for env in (free, paid)]
        _, reward, terminated, truncated, info = rewards[0]
        step = world.evaluate(info["t"], *free.run.loop.plant.x[:2])
        outside = [x / s for x, s in zip(step.sigma, step.rows.scale, strict=True) if x > 0.0]
        error = np.linalg.norm(step.error)
        assert reward == pytest.approx((before - error) / first + info["success"], abs=1e-12)
        assert reward - rewards[1][1] == pytest.approx(
            3.0 * setup.Ts * sum(1.0 + min(x, 1.0) for x in outside)
        )
        before = error
        done = terminated or truncated
        shares = [*shares, max(outside, default=0.0)]
    assert min(shares) == 0.0 < max(shares)
    assert max(shares) > 1.0 or law
    assert info["violation"] == pytest.approx(max(shares))
    assert info["success"] == bool(law)


def test_an_observation_holds_rows_task_and_joints() -> None:
    env = ServoEnv("ur5-fov", acceleration=5.0)
    env.reset()
    setup = env.run.setup
    a = np.full(6, setup.limits.acceleration)
    assert a[0] != 5.0
    low, high, speed = setup.scene.robot.ranges
    assert np.isfinite([low, high, speed]).all()
    world = setup.world()
    world.evaluate(0.0, setup.q0, setup.qd0)
    observation, *_, info = env.step(np.array([0.1, -0.5, 0.2, 0.3, -0.1, 0.9]))
    q, qd = env.run.loop.plant.x[:2]
    step = world.evaluate(info["t"], q, qd)
    assert np.abs(step.rows.Lf).max() > 1e-3
    rows = step.rows
    J = step.task.J * a
    numbers = [*(rows.phi / rows.scale), *(rows.Lf / rows.scale)]
    numbers += [
        a[j] * rows.Lg[i, j] / rows.scale[i] for i in range(len(rows.phi)) for j in range(6)
    ]
    numbers += [*(J / np.linalg.norm(J)).ravel(), *(step.task.b / np.linalg.norm(J))]
    numbers += [*((2.0 * q - low - high) / (high - low)), *(qd / speed)]
    np.testing.assert_allclose(
        observation, [x / (1.0 + abs(x)) for x in numbers], rtol=1e-6, atol=1e-7
    )


def test_episodes_end_with_the_duration_or_when_nothing_can_be_seen() -> None:
    _, rewards, infos = played(ServoEnv(scenario(duration=0.1)), np.zeros((1000, 3)))
    assert infos[-1]["ends"] == (False, True)
    assert len(rewards) == scenario(duration=0.1).setup().samples - 1
    seen, rewards, infos = played(ServoEnv("ur5-fov", acceleration=100.0), np.ones((1000, 6)))
    assert (infos[-1]["ends"], infos[-1]["success"], rewards[-1]) == ((True, False), False, -1.0)
    assert np.array_equal(seen[-1], seen[-2])
    assert np.isfinite(seen).all()


def test_a_scene_that_is_not_there_is_named() -> None:
    with pytest.raises(ConfigurationError, match="unknown scenario 'planar-amr'"):
        ServoEnv("planar-amr")


def test_what_has_no_compiled_loop_is_refused() -> None:
    pytest.importorskip("cv2")
    with pytest.raises(
        ConfigurationError,
        match="ur5-images: the environment does not support images, MuJoCo or custom parts",
    ):
        ServoEnv("ur5-images")


def test_scenes_of_other_sizes_are_refused() -> None:
    class Two(Family):
        def scene(self, number: int, half: str = "held-out", seed: int = 0) -> Any:
            return SimpleNamespace(
                setup=lambda condition: scenario((FOV, "ur5-fov")[number]).setup()
            )

    env = ServoEnv(Two("two", {}, Scenario.load(FOV).folder), count=2)
    with pytest.raises(
        ConfigurationError, match="two: scene 1 has observations of another size than scene 0"
    ):
        env.reset(options={"scene": 1})


def test_the_package_does_not_import_gymnasium() -> None:
    program = (
        "import sys, vsconstraints, vsconstraints.bench.learning, vsconstraints.cli; assert "
        "'gymnasium' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True, timeout=120)
