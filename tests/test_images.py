"""Rendered boards of tags: against OpenCV's projection, found by both detectors, and what
detections say.
"""

from __future__ import annotations

import subprocess
import sys
from functools import cache

import cv2
import numpy as np
import pytest

from vsconstraints import Camera
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.images.board import Board
from vsconstraints.images.detectors import DETECTORS, Detector, Pixels, Tags, roomy
from vsconstraints.images.rendering import Renderer
from vsconstraints.images.settings import ImageSettings
from vsconstraints.images.tag_pose import TagPose, board_pose, locate_board
from vsconstraints.robots.geometry import Pose, distance
from vsconstraints.rows import Array
from vsconstraints.vision.distortion import Distortion

SIDE = 0.14
MARKERS = (
    0.5 * SIDE * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
)
PINHOLE = Camera((600.0, 600.0), (640.0, 480.0))
CLEAN = ImageSettings(noise=0.0)
ABOVE = np.array([0.0, 0.0, 0.5])
BOARD = Board.of_markers(MARKERS, ABOVE, None, None)


def looking_down(
    x: float = 0.0, y: float = 0.0, z: float = 0.4, roll: float = 0.0, tilt: float = 0.0
) -> Pose:
    """A camera above the middle of the board, or beside that, turned about its axis and then
    tilted.
    """
    return Pose.from_xyz_rpy((x, y, z), (np.pi + tilt, 0.5 * tilt, roll))


def placed(rng: np.random.Generator) -> Pose:
    """One that sees all tags, 0.3 to 0.6 m away."""
    roll = np.pi + rng.uniform(-0.35, 0.35)
    pitch = rng.uniform(-0.35, 0.35)
    yaw = rng.uniform(-3.0, 3.0)
    turned = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (roll, pitch, yaw))
    return Pose(
        turned.R,
        -rng.uniform(0.3, 0.6) * turned.R[:, 2] + np.append(rng.uniform(-0.02, 0.02, 2), 0.0),
    )


def taken(
    camera: Camera, pose: Pose, settings: ImageSettings = CLEAN, board: Board = BOARD, seed: int = 0
) -> Pixels:
    return Renderer(board, camera, settings).render(lambda after: pose, np.random.default_rng(seed))


def projected(camera: Camera, pose: Pose, points: Array = MARKERS) -> Array:
    """(m, 2) where OpenCV has points, from the top left corner by pixels' centres."""
    seen = pose.inverse
    fu, fv = camera.focal
    cu, cv = camera.to_corner(camera.offset, "centres")
    lens = None if camera.distortion is None else np.array(camera.distortion.coefficients)
    K = np.array([[fu, 0.0, cu], [0.0, fv, cv], [0.0, 0.0, 1.0]])
    return cv2.projectPoints(points, cv2.Rodrigues(seen.R)[0], seen.t, K, lens)[0][:, 0]


def look(
    camera: Camera, image: Pixels, detector: str = "apriltag", board: Board = BOARD
) -> TagPose:
    return locate_board(image, DETECTORS[detector](), board, camera)


@cache
def offsets(detector: str, noise: float) -> tuple[Array, Array]:
    """(N, 2) found less true pixels on the sensor, and (N, 2) errors of the board's pose [m, rad],
    for 20 poses.
    """
    rng = np.random.default_rng(5)
    off = []
    errors = []
    for k in range(20):
        pose = placed(rng)
        seen = look(PINHOLE, taken(PINHOLE, pose, ImageSettings(noise=noise), seed=k), detector)
        true = PINHOLE.from_corner(projected(PINHOLE, pose), "centres")
        off.append((seen.pixels - true)[seen.seen])
        assert seen.camera is not None
        errors.append(distance(seen.camera.inverse, pose.inverse))
    return np.concatenate(off), np.array(errors)


# --- rendered and detected ---


def test_rendered_tags_are_found_where_they_are() -> None:
    """Published for this detector and camera: 0.06 px, 0.04 mm and 0.65 mrad, no tag missed."""
    off, errors = offsets("apriltag", 2.0)
    assert len(off) == 80
    # the mean of 80 has a hundredth of a pixel itself
    assert np.abs(off.mean(axis=0)).max() < 0.02
    assert off.std(axis=0).max() < 0.1
    assert np.median(errors[:, 0]) < 1e-4
    assert np.median(errors[:, 1]) < 1e-3


def test_both_detectors_count_pixels_alike() -> None:
    """Half a pixel is what they would differ by."""
    off, _ = offsets("aruco", 2.0)
    assert len(off) >= 72
    assert np.abs(off.mean(axis=0)).max() < 0.06
    assert off.std(axis=0).max() < 0.25


@pytest.mark.parametrize("size", [(64, 64), (120, 160), (1, 20_479), (700, 3)])
def test_a_small_image_has_room_in_the_detector(size: tuple[int, int]) -> None:
    """AprilTag's memory is for at least one block of 2048 outlines from 143 × 143 pixels on."""
    image = np.random.default_rng(0).integers(0, 255, size, dtype=np.uint8)
    roomier = roomy(image)
    assert roomier.size >= 143 * 143
    assert roomier.shape[1] == size[1]
    np.testing.assert_array_equal(roomier[: size[0]], image)
    assert (roomier[size[0] :] == image[-1]).all()
    enough = np.zeros((143, 144), dtype=np.uint8)
    assert roomy(enough) is enough


def test_a_detector_is_left_to_the_end_of_the_process() -> None:
    """Destroyed by its package, it reads families that are freed already: processes crashed after
    their last line.
    """
    program = """
import pupil_apriltags
pupil_apriltags.Detector.__del__ = lambda self: print("destroyed" if self.tag_detector_ptr else "left")
from vsconstraints.images.detectors import apriltag
apriltag()
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout == "left\n"


def test_a_tag_that_fills_whole_pixels_is_drawn_on_them() -> None:
    """F Z⁻¹ = 1000 px/m: cells of 7 mm are 7 px, and the first corner is at (250, 170) of 640 ×
    480.
    """
    camera = Camera((500.0, 500.0), (640.0, 480.0))
    image = taken(camera, looking_down(z=0.5), ImageSettings(noise=0.0, blur_px=1e-9))
    # seen from above with the x axis to the right, y is up: marker 4 is at the top left
    first = image[170:226, 250:306].reshape(8, 7, 8, 7)
    bits = cv2.aruco.generateImageMarker(
        cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11), 3, 8
    )
    # its first corner is at its marker: upright
    np.testing.assert_allclose(
        first[:, 1:6, :, 1:6].mean(axis=(1, 3)), np.where(bits > 127, 220.0, 30.0)
    )
    # cells end where pixels do
    assert set(np.unique(first[0, :, 0])) == {30}
    assert (image[169, 250:306] == 220).all()
    assert image[0, 0] == 120


@pytest.mark.parametrize(
    "lens",
    [
        Distortion("brown-conrady", (-0.05, 0.02, 0.0007, -0.0004)),
        Distortion("brown-conrady", (-0.28, 0.1, 0.0007, -0.0004)),
    ],
)
def test_a_lens_bends_the_image_as_opencvs_does(lens: Distortion) -> None:
    camera = Camera((500.0, 510.0), (640.0, 480.0), (322.0, 238.5), distortion=lens)
    off = []
    for k in range(4):
        pose = looking_down(0.02, -0.01, 0.35, roll=0.4 * k)
        image = taken(camera, pose)
        tags = DETECTORS["apriltag"]().find(image)
        off.append(tags.corners[:, 0] - 0.5 - projected(camera, pose))
    # edges that are bent are taken for straight ones
    assert np.abs(np.mean(off, axis=(0, 1))).max() < 0.1
    assert np.abs(off).max() < (0.3 if lens.coefficients[0] > -0.1 else 0.8)


def test_rows_of_a_rolling_shutter_are_taken_one_after_the_other() -> None:
    """0.2 m/s to the right at 0.4 m: 300 px/s, the image to the left; the middle row is as if at
    once.
    """
    settings = ImageSettings(noise=0.0, rolling_s=0.03)

    def where(after: float) -> Pose:
        return looking_down(x=0.2 * after)

    seen = look(PINHOLE, Renderer(BOARD, PINHOLE, settings).render(where, np.random.default_rng(0)))
    true = PINHOLE.from_corner(projected(PINHOLE, looking_down()), "centres")
    shift = seen.pixels - true
    np.testing.assert_allclose(shift[:, 0], -300.0 * 0.03 * true[:, 1] / 480.0, atol=0.15)
    np.testing.assert_allclose(shift[:, 1], 0.0, atol=0.15)


def test_an_open_shutter_smears_about_the_middle() -> None:
    """As above: 6 px wide, and corners stay where they are; across the motion edges are as sharp as
    before.
    """
    settings = ImageSettings(noise=0.0, exposure_s=0.02)
    image = Renderer(BOARD, PINHOLE, settings).render(
        lambda after: looking_down(x=0.2 * after), np.random.default_rng(0)
    )
    still = taken(PINHOLE, looking_down())
    true = PINHOLE.from_corner(projected(PINHOLE, looking_down()), "centres")
    np.testing.assert_allclose(look(PINHOLE, image).pixels, true, atol=0.4)
    # through the left edge of the black square of the first tag, whose border is three pixels and
    # more wide
    row = 150
    left = 215

    def width(line: Array) -> int:
        return int(((line > 40) & (line < 210)).sum())

    assert 5 <= width(image[row, left - 10 : left + 8]) <= 9
    assert width(still[row, left - 10 : left + 8]) <= 3


def test_light_and_noise_are_what_is_said() -> None:
    pose = looking_down()
    dark = taken(PINHOLE, pose, ImageSettings(noise=0.0, light=0.5)).astype(float)
    bright = taken(PINHOLE, pose, ImageSettings(noise=0.0)).astype(float)
    np.testing.assert_allclose(dark, 0.5 * bright, atol=0.76)
    assert taken(PINHOLE, pose, ImageSettings(noise=0.0, light=3.0)).max() == 255
    noisy = taken(PINHOLE, pose, ImageSettings(noise=5.0)).astype(float)
    assert abs((noisy - bright).std() - 5.0) < 0.05
    assert abs((noisy - bright).mean()) < 0.05
    again = taken(PINHOLE, Pose(pose.R, pose.t + 1e-13), ImageSettings(noise=5.0))
    np.testing.assert_array_equal(noisy, again)


def test_the_back_of_a_board_is_not_seen() -> None:
    below = Pose.from_xyz_rpy((0.0, 0.0, -0.4), (0.0, 0.0, 0.0))
    assert (taken(PINHOLE, below) == 120).all()
    behind = Pose.from_xyz_rpy((0.0, 0.0, 0.4), (0.0, 0.0, 0.0))
    assert (taken(PINHOLE, behind) == 120).all()


# --- what a detection says ---


def test_the_pose_of_exact_points_is_exact() -> None:
    rng = np.random.default_rng(3)
    flat = BOARD.corners.reshape(-1, 2)
    for _ in range(20):
        camera = BOARD.camera_in_board(placed(rng))
        P = (np.pad(flat, ((0, 0), (0, 1))) - camera.t) @ camera.R
        found, residual = board_pose(flat, P[:, :2] / P[:, 2:])
        assert found is not None
        assert max(distance(found, camera)) < 1e-6
        assert residual < 1e-7


def test_of_two_poses_the_expected_one_is_taken() -> None:
    """A tag seen nearly along its normal, halfway between the images of two tilts that look
    alike.
    """
    flat = 0.5 * (BOARD.corners[0] - BOARD.corners[0].mean(axis=0))
    solid = np.pad(flat, ((0, 0), (0, 1)))
    seen = []
    tilted = []
    for tilt in (0.3, -0.3):
        # the tag is on the optical axis, and the axes agree but for the tilt
        tilted.append(Pose.from_xyz_rpy((0.0, 0.0, 0.8), (tilt, 0.0, 0.0)).inverse)
        P = tilted[-1].inverse.act(solid)
        seen.append(P[:, :2] / P[:, 2:])
    assert np.abs(seen[1] - seen[0]).max() < 4e-4
    between = 0.5 * (seen[0] + seen[1])
    for expected in tilted:
        found, residual = board_pose(flat, between, expected)
        assert found is not None
        assert distance(found, expected)[1] < 0.1
        assert residual < 4e-4


def test_tags_that_are_not_seen_are_where_the_others_have_them() -> None:
    pose = looking_down()
    image = taken(PINHOLE, pose, ImageSettings(noise=1.0))
    true = PINHOLE.from_corner(projected(PINHOLE, pose), "centres")
    image[:, 320:] = 120
    image[240:, :] = 120
    seen = look(PINHOLE, image)
    # x to the right, y up: the fourth is at the top left
    assert seen.seen.tolist() == [False, False, False, True]
    np.testing.assert_allclose(seen.pixels[3], true[3], atol=0.2)
    np.testing.assert_allclose(seen.pixels, true, atol=3.0)
    assert seen.camera is not None
    assert distance(seen.camera, pose)[0] < 0.02
    image[:] = 120
    assert look(PINHOLE, image).camera is None
    assert np.isnan(look(PINHOLE, image).pixels).all()


def test_a_tag_beyond_the_lens_leaves_the_others() -> None:
    bent = Camera(
        (600.0, 600.0),
        (640.0, 480.0),
        distortion=Distortion("brown-conrady", (-0.9, 0.0, 0.0, 0.0)),
    )
    pose = looking_down()
    flat = BOARD.corners.reshape(-1, 2)
    P = (np.pad(flat, ((0, 0), (0, 1))) @ BOARD.pose.R.T + BOARD.pose.t - pose.t) @ pose.R
    corners = bent.to_corner(bent.distort(bent.pixels(P[:, :2] / P[:, 2:]))).reshape(4, 4, 2)
    corners[3, 0] = bent.to_corner(np.array([-bent.reach_px - 5.0, 0.0]))
    found = Detector(lambda image: Tags(BOARD.ids, corners), "edges")
    seen = locate_board(np.zeros((480, 640), dtype=np.uint8), found, BOARD, bent)
    assert seen.seen.tolist() == [True, True, True, False]
    assert seen.camera is not None
    assert distance(seen.camera, pose)[0] < 1e-6


def test_tags_of_something_else_are_left_out_and_named() -> None:
    pose = looking_down()
    other = Board.of_markers(MARKERS, ABOVE, None, [0, 1, 2, 17])
    seen = look(PINHOLE, taken(PINHOLE, pose, board=other))
    assert seen.seen.tolist() == [True, True, True, False]
    assert seen.foreign == (17,)
    np.testing.assert_allclose(
        seen.pixels, PINHOLE.from_corner(projected(PINHOLE, pose), "centres"), atol=0.5
    )
    # one that is there twice is no longer one of ours
    twice = look(
        PINHOLE, taken(PINHOLE, pose, board=Board.of_markers(MARKERS, ABOVE, None, [0, 1, 2, 2]))
    )
    assert twice.seen.tolist() == [True, True, False, False]
    assert twice.foreign == (2,)
    swapped = look(
        PINHOLE, taken(PINHOLE, pose, board=Board.of_markers(MARKERS, ABOVE, None, [1, 0, 2, 3]))
    )
    assert swapped.unfit
    assert swapped.camera is None
    none = look(
        PINHOLE,
        taken(PINHOLE, pose, board=Board.of_markers(MARKERS, ABOVE, None, [10, 11, 12, 13])),
    )
    assert none.foreign == (10, 11, 12, 13)
    assert none.camera is None


def test_images_of_another_size_than_the_cameras_are_refused() -> None:
    half = Camera((300.0, 300.0), (320.0, 240.0))
    with pytest.raises(
        InvalidInput, match=r"an image of 640 × 480 px, with a camera calibrated for 320 × 240 px"
    ):
        look(half, taken(PINHOLE, looking_down()))
    with pytest.raises(ConfigurationError, match="whole numbers of pixels"):
        Renderer(BOARD, Camera((300.0, 300.0), (320.5, 240.0)), CLEAN)


# --- boards ---


def test_tags_are_between_the_markers() -> None:
    board = Board.of_markers(MARKERS + 0.3, ABOVE + 0.3, None, None)
    solid = board.pose.act(np.pad(board.corners.reshape(-1, 2), ((0, 0), (0, 1)))).reshape(4, 4, 3)
    np.testing.assert_allclose(solid[:, 0], MARKERS + 0.3, atol=1e-12)
    # two fifths of the side, towards the middle
    np.testing.assert_allclose(solid[:, 2], 0.2 * MARKERS + 0.3, atol=1e-12)
    assert board.cell == pytest.approx(0.4 * SIDE / 8.0)
    # z into the board, as seen from above
    np.testing.assert_allclose(board.pose.R[:, 2], (0.0, 0.0, -1.0), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(board.pose.R), 1.0)
    below = Board.of_markers(MARKERS, -ABOVE, None, None)
    np.testing.assert_allclose(below.pose.R[:, 2], (0.0, 0.0, 1.0), atol=1e-12)


@pytest.mark.parametrize(
    ("markers", "side", "ids", "message"),
    [
        (MARKERS[:2], None, None, "needs three markers or more, not 2"),
        (np.arange(9.0).reshape(3, 3), None, None, "not on one line"),
        (
            MARKERS + np.diag((0.0, 0.0, 0.0, 0.02))[:, 1:],
            None,
            None,
            "in one plane: one is 5.02 mm away",
        ),
        (MARKERS, 0.07, None, "tags 1 and 2 with sides of 70 mm overlap"),
        (MARKERS, None, [1, 2, 3], "there are 4 markers, and 3 numbers of tags"),
        (np.vstack((MARKERS, np.zeros(3))), None, None, "away from their mean"),
    ],
)
def test_markers_that_are_no_board(
    markers: Array, side: float | None, ids: list[int] | None, message: str
) -> None:
    with pytest.raises(ConfigurationError, match=message):
        Board.of_markers(markers, ABOVE, side, ids)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"rate_hz": 0.0}, "rate_hz must be positive"),
        ({"latency_s": -0.1}, "latency_s must be zero or more"),
        ({"noise": float("nan")}, "noise must be zero or more"),
        ({"depth": -0.3}, "depth must be positive"),
        ({"depth": "poses"}, r"unknown depth of sensor 'poses'\. Did you mean 'pose'"),
        ({"detector": "april"}, r"Did you mean 'apriltag'"),
        ({"exposure_s": 0.05}, r"exposure_s must not exceed the time between images, 0\.0333 s"),
        ({"tags": [0, 1, 2, 600]}, "numbers from 0 to 586"),
        ({"tags": [0, 1, 2, 2]}, "must differ"),
        ({"patience_s": 0.0}, "patience_s must be positive"),
    ],
)
def test_settings_that_cannot_be(setting: dict[str, object], message: str) -> None:
    with pytest.raises((InvalidInput, ConfigurationError), match=message):
        ImageSettings(**setting)  # type: ignore[arg-type]
