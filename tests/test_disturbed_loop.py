"""What is measured wrongly runs compiled as it does in NumPy: poses, images, gradients,
predictions, whole runs.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from numpy_form import estimated_pose, observe
from scenes import random_configuration, robot
from vsconstraints import Camera
from vsconstraints.compiled import available, load
from vsconstraints.compiled.memory import Workspace
from vsconstraints.compiled.workspace import Step
from vsconstraints.constraints import ConstraintSet, FieldOfView, RowBlock
from vsconstraints.control import ControlStep, Model
from vsconstraints.controllers import Controller, HierarchicalQP, SlidingMode
from vsconstraints.errors import SceneError
from vsconstraints.robots.geometry import Pose, distance
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, score_run, simulate
from vsconstraints.simulation.disturbances import Disturbances
from vsconstraints.simulation.sensing import Sensor
from vsconstraints.vision.features import Goal, ImagePoints
from vsconstraints.vision.scene import Scene, State
from vsconstraints.vision.tracking import TrackingGains, VisualTask

pytestmark = pytest.mark.skipif(not available(), reason="there is no compiler here")

SETTINGS: dict[str, dict[str, Any]] = {
    "noise": {"pixel_noise": 0.3},
    "late": {"image_period": 0.04, "delay": 1},
    "lost": {"lost_frames": 0.3, "pixel_noise": 0.3},
    "intrinsics": {"focal_factor": [1.05, 0.97], "principal_point_error": [4.0, -3.0]},
    "depth": {"depth_factor": 1.2},
    "mount": {
        "mount_translation_error": [0.01, -0.004, 0.006],
        "mount_rotation_error": [0.02, 0.01, -0.03],
    },
    "markers": {"marker_distance_factor": 1.05},
    "gradient": {"gradient_error": 0.3},
    "gradient alone": {"gradient_error": 0.3, "gradient_error_in_phi": False},
}
SETTINGS["all"] = {
    name: value for one in list(SETTINGS.values())[:-1] for name, value in one.items()
} | {
    "time_constant": 0.01,
    "acceleration_noise": 0.1,
}
SETTINGS["dated"] = SETTINGS["all"] | {"delay": 2, "delay_known": True}


def disturbed(name: str, settings: dict[str, Any], duration: float = 0.2) -> Setup:
    scenario = Scenario.load(name).with_override("duration", duration)
    for key, value in settings.items():
        scenario = scenario.with_override(f"disturbances.{key}", value)
    return scenario.setup()


# --- the camera's pose ---


def square(side: float) -> Array:
    return (
        0.5
        * side
        * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    )


LINE = np.array([[0.1 * i, 0.05 * i, 0.02 * i] for i in range(4)])

MARKERS = {
    "one": square(0.2)[:1],
    "two": square(0.2)[:2],
    "two at one place": square(0.0)[:2],
    "three": square(0.2)[:3],
    "on a line": LINE,
    "at one place": square(0.0),
    "square": square(0.2),
    "small square": square(0.03),
    "tiny square": square(3e-5),
    "six": np.concatenate((square(0.3), [[0.1, 0.0, 0.2], [0.0, 0.15, -0.1]])),
}


def seen_by_both(markers: Array, seed: int, noise: float) -> tuple[State, Step] | None:
    """What both forms believe, from an image with noise; None if both find no pose that explains
    it.
    """
    rng = np.random.default_rng(seed)
    arm = robot("ur5")
    eye = Camera(
        (543.7, 512.3),
        (640.0, 480.0),
        (310.5, 250.25),
        Pose.from_xyz_rpy((0.02, 0.07, -0.05), (0.1, 0, -1)),
    )
    q = random_configuration(arm, rng)
    there = (
        arm.pose(q)
        @ eye.mount.inverse
        @ Pose.from_xyz_rpy((0.05, 0.1, 0.9), rng.uniform(-0.5, 0.5, 3))
    )
    scene = Scene(arm, eye, there.act(markers))
    pixels = scene.glance(q)[0]
    task = VisualTask(
        ImagePoints(), [Goal(0.0, pixels, eye.normalised(pixels))], TrackingGains(5.0)
    )
    true, believed = (ControlStep(scene, ConstraintSet([], scene), task) for _ in range(2))
    sensor = Sensor(scene, Disturbances(pixel_noise=noise, seed=(seed,)), 0.01)
    one = true.bound()
    other = believed.bound()
    assert one is not None
    assert other is not None
    assert one.evaluate(0.0, q, np.zeros(6)) == 0
    sensing = sensor.sensing(1)
    words = Workspace(sensing)
    refused = load("sensing").observe(words, one.packed.workspace, other.packed.workspace, 0.0, 0)
    state = scene.evaluate(0.0, q, np.zeros(6))
    if refused:
        with pytest.raises(SceneError, match="no camera pose explains"):
            observe(sensor, state)
        return None
    return observe(sensor, state), other.packed.step


@pytest.mark.parametrize("noise", [0.3, 3.0])
@pytest.mark.parametrize("markers", MARKERS.values(), ids=MARKERS)
def test_both_forms_find_the_same_pose(
    markers: Array, noise: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where markers do not determine it; by singular values of LAPACK, and by reflections."""
    monkeypatch.setattr("vsconstraints.simulation.sensing.estimated_pose", estimated_pose)
    both = [found for seed in range(8) if (found := seen_by_both(markers, seed, noise)) is not None]
    assert len(both) > 4
    for defined, step in both:
        assert max(distance(defined.camera, Pose(step.camera_R, step.camera_t))) < 1e-9
        told = np.column_stack((defined.pixels.position, defined.depth))
        np.testing.assert_allclose(step.measured, told, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(step.camera_R @ step.camera_R.T, np.eye(3), atol=1e-14)


# --- images ---


def test_what_goes_wrong_with_images_is_drawn_for_one_after_the_other() -> None:
    there = disturbed(
        "case-study-6r", {"pixel_noise": 2.0, "lost_frames": 0.4, "image_period": 0.006}
    )
    images = there.sensor().images(151)
    random = np.random.default_rng((*there.disturbances.seed, 1))
    assert len(images.noise) == len(images.lost) == 51
    for noise, lost in zip(images.noise, images.lost, strict=True):
        np.testing.assert_array_equal(noise, 2.0 * random.standard_normal(noise.shape))
        assert lost == (random.random() < 0.4)


def test_more_samples_than_were_told_go_on_with_the_same_numbers() -> None:
    there = disturbed("case-study-6r", {"pixel_noise": 2.0, "delay": 2})
    state = there.scene.evaluate(0.0, there.q0, there.qd0)
    long = there.sensor()
    short = there.sensor()
    long.images(60)
    for _ in range(60):
        np.testing.assert_array_equal(
            observe(long, state).pixels.position, observe(short, state).pixels.position
        )


# --- whole runs ---


def in_numpy(setup: Setup, law: Controller, monkeypatch: pytest.MonkeyPatch) -> Any:
    with monkeypatch.context() as patch:
        patch.setattr("vsconstraints.control.control_step.ControlStep.bound", lambda step: None)
        return simulate(setup, law)


def assert_same(mine: Any, theirs: Any, close: float = 1e-9) -> None:
    assert mine.reason == theirs.reason
    assert mine.status == theirs.status
    for part in (
        "q",
        "qd",
        "qdd_command",
        "phi",
        "sigma",
        "error",
        "features_px",
        "camera_position",
        "clearance",
    ):
        one = getattr(mine, part)
        other = getattr(theirs, part)
        np.testing.assert_allclose(
            one, other, rtol=close, atol=close * max(1.0, np.abs(other).max()), err_msg=part
        )
    for part in ("active", "saturated"):
        np.testing.assert_array_equal(getattr(mine, part), getattr(theirs, part))
    one = mine.between_clearance
    other = theirs.between_clearance
    np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-6)


CASES = [("case-study-6r", name) for name in SETTINGS] + [
    (name, settings)
    for name in ("eye-to-hand-ibvs", "moving-target-unknown", "panda-fov")
    for settings in ("all", "dated")
]


@pytest.mark.parametrize(("name", "settings"), CASES)
def test_a_disturbed_run_is_the_same_in_both_forms(
    name: str, settings: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    law = HierarchicalQP() if settings in ("noise", "all") else SlidingMode()
    compiled = simulate(disturbed(name, SETTINGS[settings]), law)
    defined = in_numpy(disturbed(name, SETTINGS[settings]), law, monkeypatch)
    assert compiled.compiled
    assert not defined.compiled
    assert_same(compiled, defined)
    scores = score_run(disturbed(name, SETTINGS[settings]), law)
    assert scores.status == compiled.status
    np.testing.assert_array_equal(scores.phi_max, compiled.phi.max(axis=0))


def test_the_public_call_is_given_the_same_rows() -> None:
    setup = disturbed("case-study-6r", SETTINGS["all"])
    assert_same(simulate(setup, SlidingMode()), simulate(setup, SlidingMode(), by_public_call=True))


class OwnView(FieldOfView):
    """What computes as its class does, but might do anything: it runs in NumPy."""

    def rows(self, state: State, points: slice) -> RowBlock:
        return super().rows(state, points)


def test_an_own_constraint_runs_beside_what_is_disturbed() -> None:
    setup = disturbed("case-study-6r", SETTINGS["all"])
    some = []
    for one in disturbed("case-study-6r", SETTINGS["all"]).constraints.constraints:
        if type(one) is FieldOfView:
            one.__class__ = OwnView
        some.append(one)
    own = replace(setup, constraints=ConstraintSet(some, setup.scene))
    run = simulate(own, SlidingMode())
    assert own.control().in_numpy
    assert not run.compiled
    assert_same(simulate(setup, SlidingMode()), run)


def test_an_image_that_no_pose_explains_ends_both_forms_alike(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    there = disturbed("case-study-6r", {"pixel_noise": 700.0})
    compiled = simulate(there, SlidingMode())
    defined = in_numpy(there, SlidingMode(), monkeypatch)
    assert compiled.status == defined.status == "failed"
    assert compiled.reason == defined.reason
    assert "no camera pose explains the measured image" in compiled.reason
    assert len(compiled.t) == len(defined.t)


@pytest.mark.parametrize(
    "settings", ["intrinsics", "depth", "mount", "markers", "gradient", "gradient alone", "all"]
)
def test_predictions_are_believed_alike_in_both_forms(
    settings: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    setup = disturbed("case-study-6r", SETTINGS[settings])
    rng = np.random.default_rng(4)
    step = setup.control()
    sensor = setup.sensor()
    spoil = setup.gradient_error()
    step.evaluate(0.3, setup.q0, setup.qd0)
    q = setup.q0 + 0.02 * rng.normal(size=(5, 6))
    t = 0.3 + 0.02 * np.arange(5)
    qd = rng.normal(size=q.shape)
    compiled = Model(step, sensor, spoil)
    with monkeypatch.context() as patch:
        patch.setattr("vsconstraints.control.evaluator.Evaluator.bound", lambda step: None)
        defined = Model(step, sensor, spoil)
    assert compiled.step is not None
    assert defined.step is None
    mine = compiled.along(t, q, qd)
    theirs = defined.along(t, q, qd)
    for part in (
        "phi",
        "Lg",
        "Lf",
        "sigma",
        "sigma_dot",
        "J",
        "b",
        "error",
        "error_rate",
        "pixels",
    ):
        np.testing.assert_allclose(
            getattr(mine, part), getattr(theirs, part), rtol=1e-9, atol=1e-9, err_msg=part
        )
    one = compiled.at(t[1], q[1], qd[1])
    other = defined.at(t[1], q[1], qd[1])
    np.testing.assert_allclose(one.rows.phi, other.rows.phi, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(one.rows.phi, mine.phi[1], rtol=1e-12)


def test_what_is_not_disturbed_loads_nothing_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def noted(name: str) -> Any:
        asked.append(name)
        return load(name)

    for module in ("loop", "sensing"):
        monkeypatch.setattr(f"vsconstraints.simulation.{module}.load", noted)
    simulate(disturbed("case-study-6r", {}), SlidingMode())
    assert "sensing" not in asked
    simulate(disturbed("case-study-6r", SETTINGS["all"]), SlidingMode())
    assert "sensing" in asked
