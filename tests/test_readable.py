"""Objects are shown in one line that says what they are."""

from __future__ import annotations

import numpy as np
import pytest

from folder_laws import GoalGovernor
from scenes import arm_with_prismatic_joints
from vsconstraints import Camera, Robot
from vsconstraints.constraints import ImageConstraint
from vsconstraints.controllers import Controller, HierarchicalQP, SlidingMode
from vsconstraints.robots import READY_MADE
from vsconstraints.robots.geometry import Pose
from vsconstraints.rows import Command, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.scenarios.scenario import shipped_scenarios
from vsconstraints.simulation import score_run, simulate
from vsconstraints.vision.distortion import Distortion

LONGEST = 180


@pytest.mark.parametrize("name", shipped_scenarios())
def test_parts_of_a_scenario_take_one_line(name: str) -> None:
    scenario = Scenario.load(name)
    setup = scenario.setup()
    parts = [
        scenario,
        setup,
        setup.scene,
        setup.constraints,
        *setup.constraints.constraints,
        setup.task,
    ]
    parts += [setup.scene.robot, setup.scene.camera, setup.task.goals[0].camera]
    for part in parts:
        text = repr(part)
        assert "\n" not in text
        assert len(text) < LONGEST, text
        assert " at 0x" not in text
    for constraint in setup.constraints.constraints:
        assert f"{constraint.kind}" in repr(constraint)


def test_each_says_what_it_is_with_units() -> None:
    assert (
        repr(READY_MADE["ur5"]())
        == "<Robot UR5: 6 revolute joints (−6.28 to 6.28 rad, up to 3.2 rad/s)>"
    )
    mixed = repr(arm_with_prismatic_joints())
    assert "3 revolute joints (" in mixed
    assert " m, up to 1.42 m/s)" in mixed
    assert "no ranges" in repr(Robot.from_dh([[0.0, 0.1, 0.2, 0.3]]))
    half = Robot.from_dh([[0.0, 0.1, 0.2, 0.3]] * 2, q_min=[-1.0, -np.inf], q_max=[1.0, np.inf])
    assert "not all limited [rad]" in repr(half)
    fixed = Camera(
        (600.0, 500.0), (640.0, 480.0), fixed=Pose.from_xyz_rpy((1.0, 0.0, 0.5), (0.0, 0.0, 0.0))
    )
    assert (
        repr(fixed) == "<Camera 640 × 480 px, focal length 600 and 500 px, fixed at (1, 0, 0.5) m>"
    )
    lens = Camera(
        (600.0, 600.0), (640.0, 480.0), distortion=Distortion("fisheye", (0.1, 0.0, 0.0, 0.0))
    )
    assert repr(lens) == "<Camera 640 × 480 px, focal length 600 px, fisheye lens, on the robot>"
    turned = Pose.from_xyz_rpy((0.1, -0.2, 1e-15), (0.0, 0.0, 0.5))
    assert repr(turned) == "<Pose (0.1, −0.2, 0) m, turned by (0, 0, 0.5) rad>"


def test_rows_tasks_and_commands_name_what_matters() -> None:
    labels = tuple(f"row {i + 1}" for i in range(5))
    rows = Rows(np.array([-1.0, 0.0, 0.25, 0.1, 0.2]), np.eye(5), np.zeros(5), np.ones(5), labels)
    assert repr(rows) == (
        "<Rows: 5 rows of 5 joints, greatest φ 0.25 (row 3), φ ≥ 0: row 2, row 3, row 4 and 1 more>"
    )
    assert repr(Rows.none(3)) == "<Rows: none>"
    assert (
        repr(Task(np.eye(2, 3), np.array([3.0, 4.0]))) == "<Task: 2 features of 3 joints, ‖b‖ = 5>"
    )
    assert "‖e‖ = 5" in repr(Task(np.eye(2, 3), np.zeros(2), np.array([3.0, 4.0])))
    command = Command(
        np.array([0.5, -2.0]),
        "relaxed",
        np.array([True, False]),
        ("a", "b"),
        reason="a, b\ndisagree",
    )
    assert repr(command) == (
        "<Command relaxed (a, b disagree): greatest |q̈| 2 rad/s² or m/s² (joint 2), acted: a>"
    )


def test_what_is_wrong_can_be_shown_all_the_same() -> None:
    """Messages about wrong rows show them."""
    wrong = Rows(None, None, None, None, ("a",))  # type: ignore[arg-type]
    assert repr(wrong).startswith("<vsconstraints.rows.Rows object at")
    assert repr(Command(np.empty(0), "ok", np.empty(0, dtype=np.bool_), ())).startswith(
        "<vsconstraints.rows.Command"
    )


def test_laws_are_shown_as_they_are_made() -> None:
    class Own(Controller):
        name = "own"

        def __init__(self, *, gain: float = 2.0, hidden: int = 0):
            self.gain = gain

        def solve(self, rows: Rows, task: Task) -> Command:
            raise NotImplementedError

    assert repr(Own(gain=3.0)) == "Own(gain=3.0)"
    assert "law=Pair(demand=" in repr(GoalGovernor())
    assert repr(HierarchicalQP(rows="active")).startswith("HierarchicalQP(rows='active', ")


def test_own_constraints_are_shown_too() -> None:
    class Horizon(ImageConstraint):
        kind = "horizon"

        def sigma(self, y: np.ndarray) -> np.ndarray:
            return y[..., 0]

        def gradient(self, y: np.ndarray) -> np.ndarray:
            return np.broadcast_to([1.0, 0.0], y.shape)

    horizon = Horizon(K=0.2, switching_gain=3.0, length=100.0, markers=(1, 3))
    assert repr(horizon) == "<Horizon horizon: markers 1, 3, K = 0.2 s, u⁺ = 3 per s, L = 100 px>"


def test_runs_are_shown_by_how_they_ended() -> None:
    setup = Scenario.load("example-2d-fov").with_override("duration", 1.0).setup()
    assert (
        repr(simulate(setup, SlidingMode())) == "<Trajectory unfinished: 1 s, 201 samples, 2 rows>"
    )
    assert (
        repr(score_run(setup, SlidingMode())) == "<RunScores unfinished: 1 s, 0 rows of 2 outside>"
    )
