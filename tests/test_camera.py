"""The pinhole camera against a projection written with its intrinsic matrix."""

from __future__ import annotations

import numpy as np
import pytest

from scenes import camera, random_scene, robot
from vsconstraints import Camera
from vsconstraints.errors import ConfigurationError, InvalidInput, SceneError
from vsconstraints.robots.geometry import Pose
from vsconstraints.rows import Array
from vsconstraints.vision.scene import MINIMUM_DEPTH, Scene, interaction_matrix


def project_from_corner(eye: Camera, points: Array) -> Array:
    """Pixels (m, 2) from the top left corner: the textbook's K [X Y Z]ᵀ, for points in the camera's
    frame.
    """
    u0, v0 = (
        (0.5 * eye.size[0], 0.5 * eye.size[1])
        if eye.principal_point_px is None
        else eye.principal_point_px
    )
    K = np.array([[eye.focal[0], 0.0, u0], [0.0, eye.focal[1], v0], [0.0, 0.0, 1.0]])
    homogeneous = points @ K.T
    return homogeneous[:, :2] / homogeneous[:, 2:]


CAMERAS = {
    "off-centre": camera(),
    "centred": Camera((710.1, 709.8), (640, 480)),
    "corner": Camera((300, 400), (512, 256), (0.0, 255.0)),
}


@pytest.mark.parametrize("eye", CAMERAS.values(), ids=CAMERAS)
def test_pixels_are_those_of_the_intrinsic_matrix(eye: Camera) -> None:
    rng = np.random.default_rng(1)
    points = np.column_stack((rng.uniform(-1, 1, (20, 2)), rng.uniform(0.5, 2.0, 20)))
    corner = project_from_corner(eye, points)
    centred = eye.pixels(points[:, :2] / points[:, 2:])
    np.testing.assert_allclose(centred, corner - np.array(eye.size) / 2.0, atol=1e-10)
    np.testing.assert_allclose(eye.from_corner(corner), centred, atol=1e-10)
    np.testing.assert_allclose(eye.normalised(centred), points[:, :2] / points[:, 2:], atol=1e-14)


def test_pixels_count_from_the_images_centre_and_not_from_the_principal_point() -> None:
    eye = camera()
    np.testing.assert_allclose(
        eye.pixels(np.zeros(2)), np.subtract(eye.principal_point_px, (320.0, 240.0))
    )
    np.testing.assert_allclose(eye.offset, [-9.5, 10.25])
    np.testing.assert_array_equal(Camera((1.0, 1.0), (640, 480)).offset, [0.0, 0.0])
    np.testing.assert_array_equal(eye.from_corner(np.array([0.0, 0.0])), [-320.0, -240.0])
    np.testing.assert_array_equal(eye.from_corner(np.array([[640.0, 480.0]])), [[320.0, 240.0]])


def test_the_image_ends_at_its_border() -> None:
    eye = camera()  # the principal point does not move the border
    inside = np.array([[320.0, 240.0], [-320.0, -240.0], [0.0, 0.0], [-319.9, 239.9]])
    outside = np.array([[320.01, 0.0], [0.0, -240.01], [-400.0, 300.0], [0.0, 240.5]])
    np.testing.assert_array_equal(eye.sees(inside), [True] * 4)
    np.testing.assert_array_equal(eye.sees(outside), [False] * 4)
    assert eye.sees(np.array([0.0, 0.0]))
    assert eye.sees(inside.reshape(2, 2, 2)).shape == (2, 2)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"focal_px": (0.0, 1.0)}, "focal_px must be positive"),
        ({"focal_px": (1.0, -1.0)}, "focal_px must be positive"),
        ({"focal_px": (1.0,)}, "focal_px must be 2 numbers"),
        ({"focal_px": 500.0}, "focal_px must be 2 numbers"),
        ({"focal_px": (np.nan, 1.0)}, "focal_px must be finite"),
        ({"size_px": (512, 0)}, "size_px must be positive"),
        ({"size_px": (512, 512, 3)}, "size_px must be 2 numbers"),
        ({"size_px": ("a", "b")}, "size_px must be 2 numbers"),
        ({"principal_point_px": (np.inf, 0.0)}, "principal_point_px must be finite"),
        ({"principal_point_px": (1.0, 2.0, 3.0)}, "principal_point_px must be 2 numbers"),
    ],
)
def test_a_camera_that_is_none_is_refused(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        Camera(**{"focal_px": (500.0, 500.0), "size_px": (640, 480), **arguments})


def test_markers_are_seen_where_the_intrinsic_matrix_puts_them() -> None:
    """From the base frame through tip and mount: ᶜP = ᶜMₑ ᵉM_b P."""
    arm = robot("viper-s650")
    rng = np.random.default_rng(2)
    scene, q, qd = random_scene(arm, rng)
    tip = arm.pose(q)
    eye = scene.camera
    in_tip = (scene.markers - tip.t) @ tip.R
    in_camera = in_tip @ eye.mount.R.T + eye.mount.t
    expected = project_from_corner(eye, in_camera) - np.array(eye.size) / 2.0
    state = scene.evaluate(0.0, q, qd)
    np.testing.assert_allclose(state.pixels.position, expected, atol=1e-9)
    np.testing.assert_allclose(state.depth, in_camera[:, 2], atol=1e-12)
    np.testing.assert_allclose(scene.project(scene.camera_pose(q)), expected, atol=1e-9)
    np.testing.assert_allclose(scene.glance(q)[0], expected, atol=1e-9)


def test_interaction_matrix_is_the_textbooks() -> None:
    """Chaumette and Hutchinson, Visual Servo Control part I (2006), eq. (11)."""
    x = 0.3
    y = -0.7
    Z = 1.3
    expected = [
        [-1 / Z, 0, x / Z, x * y, -(1 + x * x), y],
        [0, -1 / Z, y / Z, 1 + y * y, -x * y, -x],
    ]
    L = interaction_matrix(np.array([[0.0, 0.0], [x, y]]), np.array([1.0, Z]))
    np.testing.assert_allclose(L[1], expected, atol=1e-15)


def test_markers_that_are_not_in_front_are_named() -> None:
    eye = Camera((500.0, 500.0), (640, 480))
    markers = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.5 * MINIMUM_DEPTH]])
    scene = Scene(robot("planar-3r"), eye, markers)
    with pytest.raises(SceneError) as error:
        scene.project(Pose.identity())
    assert "marker 2 (depth -1 m)" in str(error.value)
    assert "marker 3" in str(error.value)
    assert "marker 1" not in str(error.value)


@pytest.mark.parametrize("markers", [np.zeros(3), np.zeros((2, 2)), np.full((2, 3), np.nan)])
def test_markers_of_the_wrong_shape_are_refused(markers: Array) -> None:
    with pytest.raises(InvalidInput, match="markers must be"):
        Scene(robot("planar-3r"), camera(), markers)


def test_the_first_examples_start_is_the_printed_image() -> None:
    """Marker positions in base frame and image were recorded together by an independent program."""
    eye = Camera((543.7, 543.7), (512, 512))
    scene = Scene(
        robot("planar-3r"), eye, np.array([[-0.24613, -1.24385, -1.0], [-0.47884, -1.04071, -1.0]])
    )
    pixels = scene.project(scene.camera_pose([-0.72, -1.744, 1.074]))
    # positions are given to 1e-5 m: 0.005 px
    np.testing.assert_allclose(pixels, [[-44.1, 112.9], [-175.5, 217.5]], atol=0.06)


def test_errors_are_of_the_package() -> None:
    assert issubclass(InvalidInput, ValueError)
    assert issubclass(ConfigurationError, ValueError)
