"""What a controller believes of a measured image: by hand, and by the textbook's interaction
matrix.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from numpy_form import measured_state
from scenes import random_scene, robot
from vsconstraints.errors import InvalidInput
from vsconstraints.robots.geometry import Pose
from vsconstraints.rows import Array
from vsconstraints.vision.measurement import Measurement
from vsconstraints.vision.scene import Scene, State

T = 2.0


def scene_and_state() -> tuple[Scene, State, Array]:
    """Of a moving arm; nothing is known beside the model yet."""
    scene, q, qd = random_scene(robot("ur5"), np.random.default_rng(4))
    state = scene.evaluate(T, q, qd)
    return scene, state, np.zeros_like(state.pixels.position)


def believed(scene: Scene, state: State, correction: Array, **measured: Any) -> State:
    return measured_state(
        Measurement(**measured).checked(len(correction), T), scene, state, correction
    )


def textbook(x: float, y: float, Z: float) -> Array:
    """Eq. (24)."""
    return np.array(
        [[-1 / Z, 0, x / Z, x * y, -(1 + x * x), y], [0, -1 / Z, y / Z, 1 + y * y, -x * y, -x]]
    )


def test_what_is_seen_is_believed_and_what_is_not_stays_as_far_from_the_model() -> None:
    scene, state, correction = scene_and_state()
    model = state.pixels.position
    seen = model + np.arange(2.0 * len(model)).reshape(-1, 2)
    np.testing.assert_allclose(
        believed(scene, state, correction, pixels=seen).pixels.position, seen, atol=1e-9
    )
    beside = correction.copy()
    seen[0] = np.nan
    seen[1, 1] = np.nan
    seen[2:] += 5.0
    found = believed(scene, state, correction, pixels=seen).pixels.position
    expected = np.concatenate((model[:2] + np.array([[0.0, 1.0], [2.0, 3.0]]), seen[2:]))
    np.testing.assert_allclose(found, expected, atol=1e-9)
    np.testing.assert_array_equal(correction[:2], beside[:2])
    # an image in normalised coordinates: a pixel is 1/f
    np.testing.assert_allclose((correction - beside)[2:] * scene.camera.focal, 5.0, rtol=1e-9)
    assert believed(scene, state, correction).pixels is not None
    np.testing.assert_allclose(believed(scene, state, correction).pixels.position, model, atol=1e-9)


def test_depth_is_the_models_where_it_is_not_measured() -> None:
    scene, state, correction = scene_and_state()
    pixels = state.pixels.position
    depth = 1.1 * state.depth
    depth[1] = np.nan
    found = believed(scene, state, correction, pixels=pixels, depth=depth)
    expected = 1.1 * state.depth
    expected[1] = state.depth[1]
    np.testing.assert_allclose(found.depth, expected, rtol=1e-12)
    for (x, y), Z, velocity in zip(
        found.normalised.position, expected, found.normalised.velocity.reshape(-1, 2), strict=True
    ):
        np.testing.assert_allclose(
            velocity, textbook(x, y, Z) @ state.camera_twist, rtol=1e-9, atol=1e-12
        )
    np.testing.assert_allclose(
        believed(scene, state, correction, pixels=pixels).depth, state.depth, rtol=1e-12
    )


def test_a_late_image_moves_on_with_the_velocity_of_the_model() -> None:
    """Where nothing else is known of the time between; to first order, and depths likewise."""
    scene, state, correction = scene_and_state()
    seen = state.pixels.position + 20.0
    age = 1e-6
    found = believed(scene, state, correction, pixels=seen, taken=T - age, depth=1.2 * state.depth)
    moved = (found.normalised.position - scene.camera.normalised(seen)) / age
    away = (found.depth - 1.2 * state.depth) / age
    for (x, y), Z, velocity, Z_dot in zip(
        state.normalised.position, state.depth, moved, away, strict=True
    ):
        assert np.abs(velocity).max() > 1e-2
        np.testing.assert_allclose(
            velocity, textbook(x, y, Z) @ state.camera_twist, rtol=1e-4, atol=1e-5
        )
        v = state.camera_twist[:3]
        omega = state.camera_twist[3:]
        np.testing.assert_allclose(
            Z_dot, -v[2] - omega[0] * y * Z + omega[1] * x * Z, rtol=1e-4, atol=1e-5
        )


def test_a_measured_pose_is_believed() -> None:
    scene, state, correction = scene_and_state()
    pose = Pose(state.camera.R, state.camera.t + 0.25)
    for measured in ({}, {"pixels": state.pixels.position}):
        found = believed(scene, state, correction, camera=pose, **measured)
        np.testing.assert_array_equal(found.camera.t, pose.t)
        np.testing.assert_allclose(found.pixels.position, state.pixels.position, atol=1e-9)


def test_what_is_checked_becomes_arrays() -> None:
    nothing = Measurement().checked(2, T)
    assert (nothing.pixels, nothing.taken, nothing.camera) == (None, T, None)
    assert np.isnan(nothing.depth).all()
    assert np.shape(nothing.depth) == (2,)
    some = Measurement([[1, 2], [np.nan, 3]], [np.nan, 1e-9], T + 0.019).checked(2, T)  # type: ignore[arg-type]
    np.testing.assert_array_equal(some.pixels, [[1.0, 2.0], [np.nan, 3.0]])
    np.testing.assert_array_equal(some.depth, [np.nan, 1e-9])
    # one that came after the state was read, within 20 ms, counts as taken with it
    assert some.taken == T
    assert Measurement(taken=T - 0.01).checked(2, T).taken == T - 0.01


def test_what_is_masked_was_not_measured() -> None:
    pixels = np.ma.masked_equal([[1.0, 2.0], [7.0, 3.0]], 7.0)
    depth = np.ma.array([0.5, -1.0], mask=[False, True])
    some = Measurement(pixels, depth).checked(2, T)
    np.testing.assert_array_equal(some.pixels, [[1.0, 2.0], [np.nan, 3.0]])
    np.testing.assert_array_equal(some.depth, [0.5, np.nan])
    assert type(some.pixels) is type(some.depth) is np.ndarray
    whole = np.ma.array([[1, 2], [3, 4]], mask=np.ma.nomask)
    np.testing.assert_array_equal(Measurement(whole).checked(2, T).pixels, [[1.0, 2.0], [3.0, 4.0]])


BAD = {
    "shape": ({"pixels": np.zeros((3, 2))}, "pixels must be"),
    "text": ({"pixels": "image"}, "pixels must be"),
    "one infinite": ({"pixels": [[0.0, 0.0], [np.inf, 0.0]]}, "pixels must be"),
    "depth alone": ({"depth": np.ones(2)}, "needs the pixels"),
    "a depth behind the camera": (
        {"pixels": np.zeros((2, 2)), "depth": np.array([1.0, -1.0])},
        "must be positive",
    ),
    "shape of depth": ({"pixels": np.zeros((2, 2)), "depth": np.ones(3)}, "depth must be"),
    "not yet": ({"taken": T + 0.021}, "before now"),
    "at no time": ({"taken": np.nan}, "before now"),
    "a matrix": ({"camera": np.eye(4)}, "must be a Pose"),
}


@pytest.mark.parametrize(("measured", "says"), BAD.values(), ids=BAD)
def test_what_does_not_fit_is_refused(measured: dict[str, Any], says: str) -> None:
    with pytest.raises(InvalidInput, match=says):
        Measurement(**measured).checked(2, T)
