"""The least time in which an arm can arrive: against linear programs, by hand, and where it is not
known.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from typer.testing import CliRunner

from vsconstraints.bench.families import Family
from vsconstraints.bench.families.attempts import least_time, rest_to_rest
from vsconstraints.bench.families.placements import Ends
from vsconstraints.cli import app
from vsconstraints.controllers import HierarchicalQP
from vsconstraints.robots.limits import ActuatorLimits
from vsconstraints.simulation import Setup, score_run

POSITIVE = st.floats(0.05, 20.0)
SLOW = """
extends = "example-2d-fast"
duration = 0.3
q0 = { gaussian = [[-0.720, -1.744, 1.074], 0.01] }
[conditions.limited.limits]
acceleration = { choice = [ACCELERATION] }
"""


def farthest(T: float, a: float, v: float, steps: int) -> float:
    """How far a joint comes from rest to rest in a time: the linear program over its accelerations
    step by step.
    """
    h = T / steps
    speeds = h * np.tril(np.ones((steps, steps)))
    before = np.vstack((np.zeros(steps), speeds[:-1]))
    reached = h * (before + 0.5 * h * np.eye(steps)).sum(axis=0)
    found = linprog(
        -reached,
        A_ub=np.vstack((speeds, -speeds)),
        b_ub=np.full(2 * steps, v),
        A_eq=speeds[-1:],
        b_eq=[0.0],
        bounds=(-a, a),
    )
    assert found.status == 0
    return -float(found.fun)


@settings(max_examples=40, deadline=None)
@given(POSITIVE, POSITIVE, POSITIVE)
def test_no_joint_comes_farther_in_the_least_time(d: float, a: float, v: float) -> None:
    """Whoever accelerates in steps comes no farther than d, and as far but for what one step of 60
    loses.
    """
    T = float(rest_to_rest(np.array([d]), np.array([a]), np.array([v]))[0])
    reached = farthest(T, a, v, 60)
    assert reached <= d * (1.0 + 1e-7)
    assert reached >= d * (1.0 - 2.0 / 60.0)


def test_joints_by_hand() -> None:
    """1 rad at 4 rad/s²: half a second up to 2 rad/s and half down; at 1 rad/s, ¼ + ¾ + ¼ s; at
    rest, or at once.
    """
    inf = math.inf
    d = np.array([1.0, 1.0, 0.0, 3.0, 3.0])
    a = np.array([4.0, 4.0, 4.0, inf, inf])
    found = rest_to_rest(d, a, np.array([inf, 1.0, 1.0, 2.0, inf]))
    np.testing.assert_allclose(found, [1.0, 1.25, 0.0, 1.5, 0.0], rtol=1e-15)


def ends_of(setup: Setup, q: Any) -> Ends:
    return Ends(setup.scene, [setup.q0, None if q is None else np.array(q)])


@pytest.fixture(scope="module")
def arm() -> tuple[Setup, np.ndarray]:
    """A planar arm whose joints have 5 rad/s², and its goal."""
    drawn = Family.load("planar-arm").scene(0)
    setup = replace(drawn.setup(), limits=ActuatorLimits(acceleration=5.0))
    return setup, np.array(drawn.tables["nominal"]["task"]["goals"][0]["camera_at_q"])


def test_the_slowest_joint_tells(arm: tuple[Setup, np.ndarray]) -> None:
    setup, goal = arm
    (rows,) = (each for each in setup.constraints.constraints if each.kind == "speed")
    times = []
    for i in range(3):
        d = abs(goal[i] - setup.q0[i])
        v = rows.upper[i] * (1.0 + setup.Ts * rows.switching_gain)
        times.append(2.0 * math.sqrt(d / 5.0) if d <= v * v / 5.0 else d / v + v / 5.0)
    assert least_time(setup, ends_of(setup, goal)) == pytest.approx(max(times), rel=1e-14)
    # rows that allow one direction less, and a robot that keeps its own speed by itself
    rest = [each for each in setup.constraints.constraints if each is not rows]
    there = float(np.sign(goal[0] - setup.q0[0]))
    slow: dict[str, Any] = {"upper": [9.0], "lower": [-9.0]} | (
        {"upper": [0.1]} if there > 0.0 else {"lower": [-0.1]}
    )
    one = type(rows)(setup.scene.robot, switching_gain=20.0, joints=[1], margin=0.2, **slow)
    other = replace(setup, constraints=type(setup.constraints)([*rest, one], setup.scene))
    v = 0.1 * (0.8 + setup.Ts * 20.0)
    expected = abs(goal[0] - setup.q0[0]) / v + v / 5.0
    assert least_time(other, ends_of(setup, goal)) == pytest.approx(expected, rel=1e-12)


def test_limits_that_keep_speeds_count() -> None:
    drawn = Family.load("ur5").scene(0)
    setup = drawn.setup()
    goal = np.array(drawn.tables["nominal"]["task"]["goals"][0]["camera_at_q"])
    others = [each for each in setup.constraints.constraints if each.kind != "speed"]
    free = replace(setup, constraints=type(setup.constraints)(others, setup.scene))
    kept = replace(free, limits=ActuatorLimits(acceleration=1e9, ranges=True))
    expected = float((np.abs(goal - setup.q0) / setup.scene.robot.qd_max).max())
    assert least_time(kept, ends_of(setup, goal)) == pytest.approx(expected, rel=1e-6)
    only = replace(free, limits=ActuatorLimits(acceleration=1e9))
    assert least_time(only, ends_of(setup, goal)) < 0.01 * expected


def test_where_it_is_not_known(arm: tuple[Setup, np.ndarray]) -> None:
    setup, goal = arm
    assert math.isnan(least_time(replace(setup, limits=ActuatorLimits()), ends_of(setup, goal)))
    assert math.isnan(
        least_time(replace(setup, qd0=np.array([0.0, 0.1, 0.0])), ends_of(setup, goal))
    )
    assert math.isnan(least_time(setup, ends_of(setup, None)))


@pytest.mark.parametrize(
    ("name", "known"), [("ur5", True), ("panda", False), ("moving", False), ("free-camera", False)]
)
def test_arms_with_a_joint_too_many_and_targets_that_move_have_none(name: str, known: bool) -> None:
    scene = Family.load(name).scene(1)
    assert math.isfinite(scene.least_time) == known
    stated = scene.tables["nominal"]["duration"]
    # of the longest run: where the target moves, none goes on
    assert scene.duration == pytest.approx(stated) if name == "moving" else scene.duration > stated
    assert not scene.too_far


@pytest.fixture
def slow(tmp_path: Path) -> Callable[[str], str]:
    def written(accelerations: str) -> str:
        (tmp_path / "slow.toml").write_text(SLOW.replace("ACCELERATION", accelerations))
        return str(tmp_path / "slow.toml")

    return written


def test_the_command_counts_scenes_that_are_too_far(slow: Callable[[str], str]) -> None:
    done = CliRunner().invoke(app, ["families", slow("0.5, 5000.0"), "--scenes", "6"])
    family = Family.load(slow("0.5, 5000.0"))
    late = [
        family.scene(i).scenario("limited").tables["limits"]["acceleration"] == 0.5
        for i in range(6)
    ]
    assert 0 < sum(late) < 6
    assert [family.scene(i).too_far for i in range(6)] == late
    assert f"no law can arrive in time in {sum(late)} of 6 scenes" in done.output


def test_who_arrives_takes_longer() -> None:
    scene = Family.load("planar-arm").scene(0)
    scores = score_run(scene.setup("limited"), HierarchicalQP(rows="barrier"))
    assert scores.status == "converged"
    assert scores.settling_time_s > scene.least_time
