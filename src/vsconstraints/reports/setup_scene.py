"""The scene of a setup in space: where everything is at an instant, and where it is seen from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from ..constraints.meshes import Mesh
from ..errors import InvalidInput
from ..robots.geometry import Pose
from ..rows import Array
from ..simulation import Setup
from ..vision.camera import Camera
from ..vision.motion import Motion
from .scene3d import (
    JOINT,
    REACH,
    Part,
    Placement,
    Scene3D,
    Viewpoint,
    arm_frames,
    bars,
    bars_of,
    joined,
    tube,
)

CAMERA = "#0072B2"
OBSTACLE = "#F0A202"
GLASS = 0.4  # opacity of obstacles
# depth of the pyramid that stands for the camera, for an arm of :data:`.REACH` [m]
CAMERA_SIZE = 0.12
MIN_DEPTH = 0.05  # at which the camera's view is drawn at least [m], where markers are behind it
#: Half the height that a view shows, relative to half the side of its cube; and what is added for
#: thick links.
IN_VIEW = 1.16
MARGIN = 1.12
# from which a scene is seen, and one that lies in a horizontal plane [deg]
ELEVATION = 20.0
ELEVATION_FLAT = 55.0


def setup_frames(setup: Setup, q: Array, t: float) -> dict[str, Placement]:
    """Where the arm's frames, the ``camera``, the ``target`` and ``obstacle k`` are at ``q`` (n,)
    and ``t`` [s].
    """
    world = setup.scene
    frames = arm_frames(world.robot, q)
    fixed = world.camera.fixed
    tip = frames["tip"].pose
    frames["camera"] = Placement(fixed or tip @ world.camera.mount.inverse)
    target = Pose.identity() if world.motion is None else world.motion.pose(t)
    frames["target"] = Placement(target if fixed is None else tip)
    for k, constraint in enumerate(setup.constraints.constraints):
        motion: Motion | None = getattr(constraint, "motion", None)
        moves = motion is not None and motion.size == 3
        moved = (
            motion.displacement(t) - motion.displacement(0.0) if motion and moves else np.zeros(3)
        )
        frames[f"obstacle {k}"] = Placement(Pose(np.eye(3), moved))
    return frames


def obstacle_meshes(setup: Setup, size: float) -> dict[int, Mesh]:
    """What constraints forbid in space, by their place in the list; ``size`` is half of what is
    shown [m].
    """
    found = {k: one.meshes(0.0, 0.8 * size) for k, one in enumerate(setup.constraints.constraints)}
    return {k: joined(meshes) for k, meshes in found.items() if meshes}


def add_surroundings(scene: Scene3D, setup: Setup, size: float, colour: str = OBSTACLE) -> None:
    """Obstacles and the target; ``size`` is half of what is shown [m]."""
    for k, mesh in obstacle_meshes(setup, size).items():
        scene.add(mesh, colour, f"obstacle {k}", opacity=GLASS)
    scene.target(setup.scene.markers, 0.003 * size / REACH, 0.015 * size / REACH, "target")


def add_robot(
    scene: Scene3D,
    setup: Setup,
    arm: Iterable[Part],
    scale: float,
    colour: str = CAMERA,
    prefix: str = "",
) -> None:
    """An arm of parts, with a bar to what its tip carries: a camera in a colour if there is one, or
    the target.

    The names of frames begin with ``prefix``.
    """
    scene.parts += [part._replace(frame=prefix + part.frame) for part in arm]
    camera = setup.scene.camera
    carried = camera.mount.inverse.t if camera.fixed is None else setup.scene.markers.mean(axis=0)
    if np.linalg.norm(carried) > 1e-6:
        bar = tube(np.linspace(np.zeros(3), carried, 6), 0.007 * scale, 8)
        scene.add(bar, JOINT, f"{prefix}tip")
    if colour:
        scene.pyramid(CAMERA_SIZE * scale * image_corners(camera), colour, f"{prefix}camera")


def image_corners(camera: Camera) -> Array:
    """(4, 3) where the corners of the image are at depth 1, in the camera's frame."""
    corners = (
        0.5
        * np.asarray(camera.size)
        * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    )
    with suppress(InvalidInput):  # where the lens cannot be inverted, those of a pinhole
        corners = camera.undistort(corners)
    return np.concatenate((camera.normalised(corners), np.ones((4, 1))), axis=1)


def view_corners(setup: Setup, camera: Pose, q: Array, t: float) -> Array:
    """(4, 3) corners of what the camera sees at the markers' distance, in the base frame."""
    depth = float(camera.inverse.act(setup.scene.markers_at(q, t))[:, 2].mean())
    return camera.act(max(depth, MIN_DEPTH) * image_corners(setup.scene.camera))


_bars = lru_cache(maxsize=8)(bars)


def draw_setup(ax: Any, setup: Setup, q: Array, t: float, view: Viewpoint) -> None:
    """Everything at an instant, with matplotlib: the arm as bars, and what its camera sees."""
    frames = setup_frames(setup, q, t)
    scale = view.half / REACH
    scene = Scene3D()
    add_surroundings(scene, setup, view.half)
    add_robot(scene, setup, _bars(setup.scene.robot, scale), scale)
    camera = frames["camera"].pose
    corners = view_corners(setup, camera, q, t)
    for a, b in pairwise([*corners, corners[0]]):
        for start, end in ((camera.t, a), (a, b)):
            scene.add(tube(np.linspace(start, end, 12), 0.0022 * scale, 4, caps=False), CAMERA)
    scene.draw(ax, view, frames)


def points_in_view(setup: Setup, q: Array, t: float) -> Array:
    """(k, 3) corners of the arm, camera, markers and the camera's view, in the base frame."""
    robot = setup.scene.robot
    camera = setup_frames(setup, q, t)["camera"].pose
    base = np.zeros((0 if robot.prismatic[0] else 1, 3))
    seen = setup.scene.markers_at(q, t), view_corners(setup, camera, q, t)
    return np.concatenate((base, *bars_of(robot, q), camera.t[None], *seen))


def viewpoint_of(setup: Setup, instants: Sequence[tuple[Array, float]], aspect: float) -> Viewpoint:
    """One viewpoint for several q (n,) and t [s]: all is in view, and seen from where it covers
    most of the picture.

    ``aspect`` is the width of the views over their height, at least 1.
    """
    points = np.concatenate([points_in_view(setup, q, t) for q, t in instants])
    flat = np.ptp(points[:, 2]) < 0.25 * np.ptp(points, axis=0).max()
    elevation = ELEVATION_FLAT if flat else ELEVATION

    def covered(azimuth: float) -> float:
        return float(np.linalg.det(np.cov((points @ view_axes(elevation, azimuth))[:, :2].T)))

    azimuth = float(max(np.arange(-90.0, 91.0, 10.0), key=covered))
    axes = view_axes(elevation, azimuth)
    low = (points @ axes).min(axis=0)
    high = (points @ axes).max(axis=0)
    across, up, _ = 0.5 * (high - low)
    return Viewpoint(
        axes @ (0.5 * (low + high)), MARGIN * max(up, across / aspect) / IN_VIEW, elevation, azimuth
    )


def view_axes(elevation: float, azimuth: float) -> Array:
    """(3, 3) directions to the right, up and towards the viewer, as columns, for two angles
    [deg].
    """
    e, a = np.deg2rad([elevation, azimuth])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    return np.stack((right, np.cross(towards, right), towards), axis=1)
