"""The literature suite: its cases are those of the literature, and come out as theory says."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from scenes import rotation_matrix
from vsconstraints.comparisons import Suite
from vsconstraints.controllers import Controller, SlidingMode, Tracking
from vsconstraints.robots import free_camera
from vsconstraints.robots.geometry import Pose
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Trajectory, simulate

SUITE = Path(__file__).parent.parent / "comparisons" / "literature.toml"

MATRICES = ("current", "desired", "mean")

# Start and goal as t [m] and θu [rad], object in camera, and the target's half side [m].
CASES: dict[str, tuple[list[float], list[float], float]] = {
    # O. Kermorgant, ecn_visualservo, config.yaml
    "large-translation": ([0.2, -0.3, 3.0, -0.03, 0.1, 0.0], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0], 0.05),
    "large-rotation": ([0.01, -0.05, 0.8, 0.5, -0.6, 2.5], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0], 0.05),
    "local-minimum": (
        [0.3, -0.2, 2.0, 0.0, np.pi / 4, 0.7],
        [0.0, 0.0, 1.0, 0.0, -np.pi / 4, 0.7],
        0.05,
    ),
    "near-180": ([0.0, 0.0, 0.4, 0.0, 0.0, -2.6], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0], 0.05),
    "visibility": ([0.05, 0.02, 0.7, -0.7, -1.0, 2.8], [0.0, 0.0, 0.5, 0.0, 0.0, 0.0], 0.05),
    # ViSP: tutorial/visual-servo/ibvs, and example/robot-simulator/viper850
    "visp-tutorial": (
        [0.15, -0.1, 1.0, *np.deg2rad([10.0, -10.0, 50.0])],
        [0.0, 0.0, 0.75, 0.0, 0.0, 0.0],
        0.1,
    ),
    "visp": (
        [-0.05, -0.05, 0.7, *np.deg2rad([10.0, 10.0, -30.0])],
        [0.0, 0.0, 0.8, 0.0, 0.0, 0.0],
        0.045,
    ),
    **{
        f"rotation-{angle:03d}": (
            [0.0, 0.0, 1.0, 0.0, 0.0, np.deg2rad(angle)],
            [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            0.1,
        )
        for angle in (30, 60, 90, 120, 150, 179)
    },
}

SCALES = {"large-translation": 0.25, "large-rotation": 0.5, "local-minimum": 0.25, "near-180": 0.5, "visibility": 0.7,
          "visp": 1.0, "rotation": 0.3}  # fmt: skip
"""Lengths on the UR5, as fractions of the cases' lengths."""


@cache
def variants() -> dict[str, Scenario]:
    """The suite's scenarios by name."""
    return {scenario.name: scenario for scenario in Suite.load(SUITE).scenarios}


def pose(numbers: list[float], scale: float) -> Pose:
    return Pose(rotation_matrix(np.array(numbers[3:])), scale * np.array(numbers[:3]))


def square(half: float) -> Array:
    return half * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])


def run(name: str, law: Controller, **changes: object) -> Trajectory:
    """One variant of the suite, its rows left out for tracking; changes with ``__`` for dots."""
    scenario = variants()[name]
    if isinstance(law, Tracking):
        scenario = scenario.with_override("constraints", [])
    for key, value in changes.items():
        scenario = scenario.with_override(key.replace("__", "."), value)
    return simulate(scenario.setup(), law)


def rotation(angle: float, matrix: str, **changes: object) -> Trajectory:
    """A free camera 1 m before the target, which turns by an angle [°] about its optical axis."""
    q0 = [-1.0, 0.0, 0.0, 0.0, 0.0, -np.deg2rad(angle)]
    return run(
        "rotation-030-current", Tracking(), q0=q0, task__interaction_matrix=matrix, **changes
    )


# --- the free camera ---


def test_the_free_camera_is_where_its_coordinates_say() -> None:
    q = np.array([0.1, 0.2, 0.3, 0.4, -0.5, 0.6])
    tip = free_camera().pose(q)
    turns = [rotation_matrix(axis * angle) for axis, angle in zip(np.eye(3), q[3:], strict=True)]
    np.testing.assert_allclose(tip.t, [0.2, 0.3, 0.1], atol=1e-15)
    np.testing.assert_allclose(tip.R, turns[0] @ turns[1] @ turns[2], atol=1e-15)


def test_the_free_camera_is_singular_where_it_is_tilted_by_90_degrees_only() -> None:
    robot = free_camera()
    for q in np.random.default_rng(0).uniform(-3.0, 3.0, (50, 6)):
        determinant = np.linalg.det(robot.jacobian(q))
        assert abs(determinant) == pytest.approx(abs(np.cos(q[4])), abs=1e-12)


# --- the suite's cases ---


def test_every_case_is_there_with_every_matrix() -> None:
    on_arm = [
        name for name in CASES if name not in ("visp-tutorial", "rotation-150", "rotation-179")
    ]
    cases = [name for name in CASES if name != "visp"] + [f"ur5-{name}" for name in on_arm]
    assert set(variants()) == {f"{case}-{matrix}" for case in cases for matrix in MATRICES}
    for scenario in variants().values():
        assert scenario.tables["task"]["interaction_matrix"] == scenario.name.rpartition("-")[2]


def test_starts_and_goals_are_those_of_the_literature() -> None:
    for scenario in variants().values():
        case = scenario.name.rpartition("-")[0].removeprefix("ur5-")
        start, goal, half = CASES[case]
        scale = 1.0
        if scenario.name.startswith("ur5"):
            scale = SCALES.get(case, SCALES["rotation"])
        setup = scenario.setup()
        markers = square(half * scale)
        for camera, cMo in (
            (setup.scene.camera_pose(setup.q0), pose(start, scale)),
            (setup.task.goals[-1].camera, pose(goal, scale)),
        ):
            assert camera is not None
            # four points fix the pose: what the camera sees is all there is to compare
            seen = (setup.scene.markers - camera.t) @ camera.R
            np.testing.assert_allclose(seen, cMo.act(markers), atol=5e-6, err_msg=scenario.name)


# --- what theory says of pure rotations ---

STRONGLY_DAMPED = {
    "task__Kp0": 250.0,
    "task__damping": 20.0,
    "sampling_time": 0.002,
    "duration": 4.0,
}
"""K_p / K_v is 0.79 /s, and the acceleration follows the velocity law after 1/K_v = 3 ms."""


@pytest.mark.parametrize(
    ("angle", "Ts"),
    [(30, 5e-3), (60, 5e-3), (90, 5e-3), (120, 5e-3), (150, 5e-3), (170, 1e-3), (179, 2e-4)],
)
def test_with_the_current_matrix_the_camera_retreats(angle: float, Ts: float) -> None:
    """The markers go straight, so that half-way they are nearer to the axis by cos(θ/2): the depth
    is Z₀/cos(θ/2).

    What holding the command over a sampling period adds is proportional to T_s, and grows with
    tan(θ/2).
    """
    trajectory = rotation(angle, "current", sampling_time=Ts, duration=2.0)
    depth = -trajectory.q[:, 0]
    assert np.argmax(depth) < len(depth) - 1, "has not turned back yet"
    assert depth.max() == pytest.approx(1.0 / np.cos(0.5 * np.deg2rad(angle)), rel=0.01)


@pytest.mark.parametrize("angle", [30, 60, 90, 120])
def test_with_the_desired_matrix_the_camera_comes_closer(angle: float) -> None:
    """Under v = −λ L* ⁺ e the depth is Z(θ) = Z₀ (1 − (θ₀ − θ) tan(θ/2)); the least is Z₀ cos θ₁
    with θ₁ + sin θ₁ = θ₀.

    Strong damping makes that velocity law of the acceleration law.
    """
    start = np.deg2rad(angle)
    trajectory = rotation(angle, "desired", **STRONGLY_DAMPED)
    depth = -trajectory.q[:, 0]
    turn = np.abs(trajectory.q[:, 5])
    moving = turn < 0.99 * start
    theory = 1.0 - (start - turn) * np.tan(0.5 * turn)
    np.testing.assert_allclose(depth[moving], theory[moving], atol=0.01)
    theta = np.linspace(0.0, np.pi, 10001)
    assert depth.min() == pytest.approx(
        np.cos(np.interp(start, theta + np.sin(theta), theta)), abs=0.01
    )


def test_with_the_desired_matrix_the_camera_runs_into_the_target_beyond_147_degrees() -> None:
    """The least depth is zero for θ₀ = π/2 + 1 rad."""
    assert rotation(140.0, "desired", **STRONGLY_DAMPED).status != "failed"
    crash = rotation(150.0, "desired", **STRONGLY_DAMPED)
    assert crash.status == "failed"
    assert "not in front of the camera" in crash.reason


@pytest.mark.parametrize("angle", [30, 60, 90, 120, 150])
def test_with_the_mean_matrix_the_depth_stays(angle: int) -> None:
    """On the symmetric path L† e has no component along the axis, whatever the gains: those here
    are the suite's.
    """
    trajectory = run(f"rotation-{angle:03d}-mean", Tracking())
    assert trajectory.status == "converged"
    assert np.abs(trajectory.q[:, 0] + 1.0).max() < 1e-12


def test_an_arm_retreats_as_the_free_camera_does() -> None:
    scenario = Scenario.load("ur5-image").with_override("duration", 3.0)
    height = simulate(scenario.setup(), Tracking()).camera_position[:, 2] + 0.3
    assert height.max() == pytest.approx(0.3 / np.cos(np.pi / 4), rel=0.01)


# --- what is known of the other cases ---


@pytest.mark.parametrize("robot", ["", "ur5-"])
def test_the_local_minimum_traps_the_current_matrix_only(robot: str) -> None:
    trapped = run(f"{robot}local-minimum-current", Tracking(), duration=16.0, sampling_time=0.01)
    assert trapped.status == "trapped"
    assert trapped.camera_error[-1, 1] > 1.5
    for matrix in ("desired", "mean"):
        assert (
            run(f"{robot}local-minimum-{matrix}", Tracking(), sampling_time=0.01).status
            == "converged"
        )


@pytest.mark.parametrize("case", ["large-rotation", "near-180", "visibility"])
def test_near_180_degrees_the_mean_matrix_neither_retreats_nor_runs_into_the_target(
    case: str,
) -> None:
    mean, current, desired = (
        run(f"{case}-{matrix}", Tracking(), sampling_time=0.01)
        for matrix in ("mean", "current", "desired")
    )
    assert mean.status == "converged"
    ends = sorted(-mean.q[[0, -1], 0])
    assert -mean.q[:, 0].max() > 0.64 * ends[0]
    assert -mean.q[:, 0].min() < 1.01 * ends[1]
    assert desired.status == "failed"
    assert "not in front of the camera" in desired.reason
    # current: far away, or through the plane of the target
    assert -current.q[:, 0].min() > 2.0 * ends[1] or current.q[:, 0].max() > 0.0


def test_rows_turn_a_collision_into_convergence_on_the_symmetric_path_alone() -> None:
    """150° with the desired matrix: tracking runs into the target; held in the image, the camera
    cannot.

    The path is a saddle: four markers in symmetric places slide at once, and beside the axis two of
    them are lost.
    """
    held = run("rotation-150-desired", SlidingMode())
    assert held.status == "converged"
    # rounding decides which marker switches first: none is farther out than one sample moves it
    assert held.clearance.min() > -np.abs(np.diff(held.clearance, axis=0)).max()
    assert -held.q[:, 0].max() > 0.4
    assert rotation(150.0, "desired").status == "failed"
    beside = run(
        "rotation-150-desired", SlidingMode(), q0=[-1.0, 0.01, 0.0, 0.0, 0.0, -np.radians(150.0)]
    )
    assert beside.clearance.min() < -10.0
