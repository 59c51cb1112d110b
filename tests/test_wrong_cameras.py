"""A camera that is believed to be another one: its mount, its lens, and how far apart the markers
are.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from numpy_form import observe
from test_disturbed_loop import assert_same, in_numpy
from vsconstraints.compiled import available
from vsconstraints.control import ControlStep, Model
from vsconstraints.controllers import HierarchicalQP, SlidingMode, Tracking
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.robots.geometry import Pose, distance
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, simulate
from vsconstraints.vision.scene import Scene

LENS = {"model": "brown-conrady", "coefficients": [-0.28, 0.1, 0.0007, -0.0004]}
FISHEYE = {"model": "fisheye", "coefficients": [-0.02, 0.01, -0.005, 0.001]}
NEVER: list[Any] = []


def setup(
    name: str, duration: float, lens: dict[str, Any] | None = None, **disturbances: Any
) -> Setup:
    there = Scenario.load(name).with_override("duration", duration)
    if lens is not None:
        there = there.with_override("camera.distortion", lens)
    for key, value in disturbances.items():
        there = there.with_override(f"disturbances.{key}", value)
    return there.setup()


def free(
    name: str, duration: float, lens: dict[str, Any] | None = None, **disturbances: Any
) -> Setup:
    """Without constraints, so that tracking alone gets to the goal."""
    there = (
        Scenario.load(name).with_override("duration", duration).with_override("constraints", NEVER)
    )
    if lens is not None:
        there = there.with_override("camera.distortion", lens)
    for key, value in disturbances.items():
        there = there.with_override(f"disturbances.{key}", value)
    return there.setup()


# --- what is believed, by hand ---

ERROR = {
    "mount_translation_error": [0.01, -0.004, 0.006],
    "mount_rotation_error": [0.02, 0.01, -0.03],
}


@pytest.mark.parametrize("name", ["ur5-fov", "eye-to-hand-ibvs"])
def test_the_camera_is_believed_beside_where_it_is_in_its_own_axes(name: str) -> None:
    there = setup(name, 0.1, **ERROR)
    true = there.scene.camera
    believed = there.sensor().camera
    error = Pose(
        Rotation.from_rotvec(ERROR["mount_rotation_error"]).as_matrix(),
        np.array([0.01, -0.004, 0.006]),
    )
    if true.fixed is None:
        assert max(distance(believed.mount.inverse, true.mount.inverse @ error)) < 1e-12
    else:
        assert believed.fixed is not None
        assert max(distance(believed.fixed, true.fixed @ error)) < 1e-12


@pytest.mark.parametrize("name", ["ur5-fov", "eye-to-hand-ibvs", "moving-target-unknown"])
def test_a_wrong_mount_is_believed_of_the_motion_and_not_of_the_image(name: str) -> None:
    there = setup(name, 0.1, **ERROR)
    sensor = there.sensor()
    rng = np.random.default_rng(3)
    n = there.scene.robot.n
    q = there.q0 + 0.01 * rng.normal(size=n)
    qd = rng.normal(size=n)
    true = there.scene.evaluate(0.2, q, qd)
    believed = observe(sensor, true)
    other = Scene(
        there.scene.robot, sensor.camera, there.scene.markers, (), there.scene.motion
    ).evaluate(0.2, q, qd)
    np.testing.assert_allclose(believed.pixels.position, true.pixels.position, atol=1e-12)
    # the image alone says where the camera is
    assert max(distance(believed.camera, true.camera)) < 1e-6
    np.testing.assert_allclose(believed.camera_J, other.camera_J, atol=1e-12)
    if there.scene.motion is None:
        np.testing.assert_allclose(believed.camera_drift, other.camera_drift, atol=1e-12)
    assert np.abs(believed.camera_J - true.camera_J).max() > 1e-3


def test_markers_that_are_believed_farther_apart_are_believed_farther_away() -> None:
    there = setup("ur5-fov", 0.1, marker_distance_factor=1.1)
    true = there.scene.evaluate(0.0, there.q0, there.qd0)
    believed = observe(there.sensor(), true)
    middle = there.scene.markers.mean(axis=0)
    np.testing.assert_allclose(believed.depth, 1.1 * true.depth, rtol=1e-9)
    np.testing.assert_allclose(
        believed.camera.t - middle, 1.1 * (true.camera.t - middle), atol=1e-9
    )
    np.testing.assert_allclose(believed.camera.R, true.camera.R, atol=1e-9)


@pytest.mark.parametrize("lens", [LENS, FISHEYE], ids=["brown-conrady", "fisheye"])
def test_noise_is_the_sensors_and_the_belief_the_lenss(lens: dict[str, Any]) -> None:
    factor = np.array([0.8, 1.2, 0.5, 1.5])
    there = setup("ur5-fov", 0.1, lens, distortion_factor=factor.tolist(), pixel_noise=0.5)
    true = there.scene.evaluate(0.0, there.q0, there.qd0)
    sensor = there.sensor()
    noise = sensor.images(10).noise[0]
    on_sensor = there.scene.camera.distort(true.pixels.position) + noise
    believed = observe(sensor, true)
    assert sensor.camera.distortion is not None
    np.testing.assert_allclose(sensor.camera.distortion.coefficients, factor * lens["coefficients"])
    np.testing.assert_allclose(
        sensor.camera.distort(believed.pixels.position), on_sensor, atol=1e-8
    )
    assert np.abs(believed.pixels.position - true.pixels.position).max() > 0.4


# --- where a loop ends ---


def test_position_based_control_stops_at_the_scaled_distance() -> None:
    there = free("ur5-fov", 3.0, marker_distance_factor=1.1)
    run = simulate(there, Tracking())
    goal = there.task.goals[0].camera
    middle = there.scene.markers.mean(axis=0)
    assert goal is not None
    at = there.scene.camera_pose(run.q[-1])
    np.testing.assert_allclose(at.t - middle, (goal.t - middle) / 1.1, atol=2e-3)
    np.testing.assert_allclose(at.R, goal.R, atol=1e-2)


@pytest.mark.parametrize(
    "wrong", [ERROR, {"marker_distance_factor": 1.1}], ids=["mount", "markers"]
)
def test_image_based_control_gets_there_all_the_same(wrong: dict[str, Any]) -> None:
    """The image says where the goal is; the way there is another one."""
    exact, run = (simulate(free("ur5-image", 16.0, **told), Tracking()) for told in ({}, wrong))
    assert exact.feature_error_px[-1] < 1.0
    assert run.feature_error_px[-1] < 1.0
    assert np.abs(run.q - exact.q).max() > 1e-3


def test_a_goal_that_was_shown_to_the_lens_is_reached_with_a_wrong_one() -> None:
    told = {"distortion_factor": 0.5}
    run = simulate(free("ur5-image", 16.0, LENS, **told), Tracking())
    assert run.feature_error_px[-1] < 1.0


# --- both forms ---

CASES: dict[str, dict[str, Any]] = {
    "lens": {"distortion_factor": 0.7},
    "noise": {"pixel_noise": 0.3, "delay": 1, "lost_frames": 0.2},
    "all": {
        "distortion_factor": [0.8, 1.1, 1.0, 0.5],
        "pixel_noise": 0.3,
        "focal_factor": [1.02, 0.98],
        "principal_point_error": [3.0, -2.0],
        "marker_distance_factor": 0.97,
        **ERROR,
    },
}


@pytest.mark.skipif(not available(), reason="there is no compiler here")
@pytest.mark.parametrize("wrong", CASES.values(), ids=CASES)
@pytest.mark.parametrize("lens", [LENS, FISHEYE], ids=["brown-conrady", "fisheye"])
def test_a_run_through_a_lens_is_the_same_in_both_forms(
    lens: dict[str, Any], wrong: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    law = SlidingMode() if lens is LENS else HierarchicalQP()
    compiled = simulate(setup("ur5-fov", 0.2, lens, **wrong), law)
    assert compiled.compiled
    assert_same(
        compiled, in_numpy(setup("ur5-fov", 0.2, lens, **wrong), law, monkeypatch), close=1e-8
    )


@pytest.mark.skipif(not available(), reason="there is no compiler here")
def test_predictions_through_a_lens_are_alike_in_both_forms(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    there = setup("ur5-fov", 0.2, LENS, **CASES["all"])
    rng = np.random.default_rng(4)
    step = there.control()
    sensor = there.sensor()
    step.evaluate(0.0, there.q0, there.qd0)
    q = there.q0 + 0.02 * rng.normal(size=(5, 6))
    qd = rng.normal(size=(5, 6))
    mine = Model(step, sensor).along(np.arange(5) * 0.02, q, qd)
    with monkeypatch.context() as patch:
        patch.setattr("vsconstraints.control.evaluator.Evaluator.bound", lambda step: None)
        theirs = Model(step, sensor).along(np.arange(5) * 0.02, q, qd)
    for part in ("phi", "Lg", "J", "b", "pixels"):
        np.testing.assert_allclose(
            getattr(mine, part), getattr(theirs, part), rtol=1e-9, atol=1e-9, err_msg=part
        )


def test_what_is_not_disturbed_is_the_scene_itself() -> None:
    there = setup("ur5-fov", 0.1, LENS)
    assert there.sensor().believed is there.scene
    assert not there.sensor().disturbed
    assert isinstance(there.control(), ControlStep)


# --- what cannot be used ---


@pytest.mark.parametrize(
    ("lens", "wrong", "words"),
    [
        (None, {"distortion_factor": 0.9}, "distortion_factor needs a camera with distortion"),
        (
            LENS,
            {"distortion_factor": [1.0, 0.9]},
            "distortion_factor must be one number or 4, one per coefficient, not 2",
        ),
        (LENS, {"distortion_factor": "no"}, "distortion_factor must be a list of numbers"),
        (None, {"marker_distance_factor": 0.0}, "marker_distance_factor must be positive"),
        (None, {"mount_rotation_error": [0.1, 0.2]}, "mount_rotation_error must be 3 numbers"),
    ],
)
def test_a_disturbance_that_cannot_be_says_why(
    lens: Any, wrong: dict[str, Any], words: str
) -> None:
    with pytest.raises((ConfigurationError, InvalidInput), match=words):
        setup("ur5-fov", 0.1, lens, **wrong)
