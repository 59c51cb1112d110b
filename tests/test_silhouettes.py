"""What stands before the tags, held against rays through pixels, and against coal's lines of
sight.
"""

from __future__ import annotations

from typing import Any

import coal
import cv2
import numpy as np
import pytest

from vsconstraints import Camera, Robot
from vsconstraints.constraints.meshes import hull_points
from vsconstraints.images.detectors import DETECTORS
from vsconstraints.images.silhouettes import BEFORE, NEAR, clipped, covered
from vsconstraints.images.tag_pose import locate_board
from vsconstraints.robots.geometry import Pose
from vsconstraints.rows import Array, BoolArray
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation.occluders import LinesOfSight, Occluders
from vsconstraints.vision.distortion import Distortion
from vsconstraints.vision.scene import Scene

PINHOLE = Camera((200.0, 210.0), (160.0, 120.0), (83.0, 57.0))
BENT = Camera(
    (200.0, 210.0),
    (160.0, 120.0),
    (83.0, 57.0),
    distortion=Distortion("brown-conrady", (-0.3, 0.1, 0.0, 0.0)),
)
TILT = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.3, -0.2, 0.0)).R[:, 2]
BOARD = np.append(TILT, 0.5)


def rays(camera: Camera) -> Array:
    """(H, W, 3) through the centres of pixels, to z = 1."""
    width, height = (int(side) for side in camera.size)
    v, u = np.mgrid[:height, :width]
    ideal = camera.undistort(camera.from_corner(np.stack((u, v), axis=-1), "centres"))
    return np.concatenate([camera.normalised(ideal), np.ones((height, width, 1))], axis=-1)


def meets(along: Array, enters: Array, leaves: Array) -> BoolArray:
    """Whether rays that are in a solid between two depths are so before the board."""
    deepest = np.where(along @ BOARD[:3] > 0.0, (BOARD[3] - BEFORE) / (along @ BOARD[:3]), np.inf)
    found: BoolArray = np.maximum(enters, NEAR) < np.minimum(leaves, deepest)
    return found


def through_a_ball(along: Array, middle: Array, radius: float) -> BoolArray:
    square = (along**2).sum(axis=-1)
    mixed = along @ middle
    root = mixed**2 - square * (middle @ middle - radius**2)
    reach = np.sqrt(np.maximum(root, 0.0))
    return (root > 0.0) & meets(along, (mixed - reach) / square, (mixed + reach) / square)


def through_a_box(along: Array, at: Pose, half: Array) -> BoolArray:
    eye = at.inverse.t
    way = along @ at.R
    with np.errstate(divide="ignore"):
        ends = np.stack([(side * half - eye) / way for side in (-1.0, 1.0)])
    return meets(along, ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1))


def assert_alike(found: BoolArray, true: BoolArray) -> None:
    """But for pixels along the outline: those that it touches are filled."""
    inner = cv2.erode(true.astype(np.uint8), np.ones((3, 3))) > 0
    outer = cv2.dilate(true.astype(np.uint8), np.ones((5, 5))) > 0
    assert not (inner & ~found).any()
    # at a sharp corner some more
    assert (found & ~outer).sum() <= 12


@pytest.mark.parametrize("camera", [PINHOLE, BENT])
def test_solids_cover_what_rays_meet(camera: Camera) -> None:
    along = rays(camera)
    rng = np.random.default_rng(3)
    drawn = 0
    for k in range(40):
        middle = rng.uniform((-0.3, -0.2, -0.1), (0.3, 0.2, 0.7))
        if k % 2:
            true = through_a_ball(along, middle, 0.06)
            points = hull_points(coal.Sphere(0.0605)) + middle
        else:
            # long ones are beside the camera, behind it, and in the board
            half = np.array([0.02, 0.05, 0.4])
            at = Pose.from_xyz_rpy(tuple(middle), tuple(rng.uniform(-3.0, 3.0, 3)))
            if (np.abs(at.inverse.t) <= half + NEAR).all():
                continue
            true = through_a_box(along, at, half)
            points = at.act(hull_points(coal.Box(*(2.0 * half))))
        assert_alike(covered([points], BOARD, camera), true)
        drawn += 0 < true.sum() < true.size
    assert drawn > 15


def test_what_is_behind_the_board_or_the_camera_covers_nothing() -> None:
    ball = hull_points(coal.Sphere(0.05))
    for z in (-0.5, 0.6):
        assert not covered(
            [ball + np.array([0.0, 0.0, z])], np.array([0.0, 0.0, 1.0, 0.5]), PINHOLE
        ).any()
    assert covered(
        [ball + np.array([0.0, 0.0, 0.4])], np.array([0.0, 0.0, 1.0, 0.5]), PINHOLE
    ).any()
    assert len(clipped(ball, np.array([0.0, 0.0, 1.0, 1.0]))) == 0


def test_a_cut_keeps_what_is_on_one_side_of_a_plane() -> None:
    box = hull_points(coal.Box(2.0, 2.0, 2.0))
    plane = np.array([0.6, 0.0, 0.8, 0.2])
    assert box is not None
    cut = clipped(box, plane)
    assert (cut @ plane[:3] > plane[3] - 1e-6).all()
    # on the edges x = ±1 of the sides y = ±1: z = (0.2 ∓ 0.6) / 0.8
    for y in (-1.0, 1.0):
        for corner in ((1.0, y, -0.5), (-1.0, y, 1.0), (1.0, y, 1.0)):
            assert np.abs(cut - corner).max(axis=1).min() < 1e-6


def test_solids_have_their_own_extent() -> None:
    for solid, half in (
        (coal.Box(0.2, 0.4, 0.6), [0.1, 0.2, 0.3]),
        (coal.Sphere(0.1), [0.1, 0.1, 0.1]),
        (coal.Capsule(0.1, 0.4), [0.1, 0.1, 0.3]),
        (coal.Cylinder(0.1, 0.4), [0.1, 0.1, 0.2]),
        (coal.Ellipsoid(0.1, 0.2, 0.3), [0.1, 0.2, 0.3]),
    ):
        points = hull_points(solid)
        assert points is not None
        np.testing.assert_allclose(points.max(axis=0), half, rtol=0.02)
        np.testing.assert_allclose(points.min(axis=0), -np.array(half), rtol=0.02)
    assert hull_points(coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)) is None


def test_links_hide_the_markers_that_lines_of_sight_say() -> None:
    robot = Scenario.load("ur5-fov").setup().scene.robot
    rng = np.random.default_rng(1)
    found = [0, 0]
    assert isinstance(robot, Robot)
    markers = 0.05 * np.array(
        [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]
    )
    for _ in range(60):
        q = rng.uniform(-2.0, 2.0, 6)
        tip = robot.pose(q)
        # looks at the tip, from the side that the board is printed on or from the other one
        eye = tip.t + 1.2 * (away := rng.standard_normal(3)) / np.linalg.norm(away)
        z = (tip.t - eye) / 1.2
        x = np.cross(z, rng.standard_normal(3))
        x /= np.linalg.norm(x)
        fixed = Pose(np.stack([x, np.cross(z, x), z], axis=1), eye)
        camera = Camera((600.0, 600.0), (640.0, 480.0), fixed=fixed)
        scene = Scene(robot, camera, markers, ())
        told = {number for number, _ in LinesOfSight(scene).hidden(q[None], [0.0])[0]}
        solids = [
            (points - eye) @ fixed.R for points in Occluders(scene, (), ("links",)).solids(q, 0.0)
        ]
        there = (tip.act(markers) - eye) @ fixed.R
        n = np.cross(there[1] - there[0], there[2] - there[0])
        n /= np.linalg.norm(n) * np.sign(n @ there[0])
        mask = covered(solids, np.append(n, n @ there[0]), camera)
        for number, (u, v) in enumerate(
            camera.to_corner(camera.pixels(there[:, :2] / there[:, 2:]), "centres"), 1
        ):
            around = mask[int(v) - 3 : int(v) + 5, int(u) - 3 : int(u) + 5]
            if around.size == 64 and around.all() == around.any():
                assert around.all() == (number in told)
                found[int(around.all())] += 1
    assert min(found) > 20


SPHERE: dict[str, Any] = {
    "type": "forbidden-sphere",
    "radius": 0.03,
    "K": 0.1,
    "switching_gain": 1.0,
}


@pytest.mark.parametrize(("opaque", "seen"), [(["links", "bodies"], True), (["regions"], False)])
def test_a_tag_behind_a_solid_is_lost_because_the_image_hides_it(
    opaque: list[str], seen: bool
) -> None:
    scenario = Scenario.load("ur5-images").with_override("sensor.opaque", opaque)
    first = scenario.setup()
    q = first.q0 + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.5])
    eye = (first.scene.robot.pose(q) @ first.scene.camera.mount.inverse).t
    between = 0.6 * first.scene.markers[0] + 0.4 * eye
    constraints = [*scenario.tables["constraints"], {**SPHERE, "centre": between.tolist()}]
    setup = scenario.with_override("constraints", constraints).setup()
    photographer = setup.photographer()
    state = setup.scene.evaluate(0.0, q, setup.qd0)
    image = photographer.image(0, state)
    found = locate_board(
        image, DETECTORS["apriltag"](), photographer.renderer.board, setup.scene.camera
    )
    assert found.seen.tolist() == [seen, True, True, True]
    # a marker that is hidden is where the other tags have it
    np.testing.assert_allclose(found.pixels, state.pixels.position, atol=0.3)


def test_a_lens_with_distortion_shows_no_link_where_there_is_none() -> None:
    """An intersection of OpenCV 4.14 gave corners at infinity for a link of this arm."""
    lens = {"model": "brown-conrady", "coefficients": [-0.2, 0.05, 0.001, -0.001, 0.0]}
    setup = Scenario.load("ur5-images").with_override("camera.distortion", lens).setup()
    photographer = setup.photographer()
    image = photographer.image(0, setup.scene.evaluate(0.0, setup.q0, setup.qd0))
    found = locate_board(
        image, DETECTORS["apriltag"](), photographer.renderer.board, setup.scene.camera
    )
    assert found.seen.all()
