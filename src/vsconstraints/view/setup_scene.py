"""Scene of a setup in space: poses of everything at an instant, and the viewpoint."""

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
from .arm import JOINT, REACH, SHORT, arm_frames, bars, bars_of
from .scene3d import Part, Placement, Scene3D, Viewpoint
from .solids import joined, tube

CAMERA = "#0072B2"
OBSTACLE = "#F0A202"
GLASS = 0.4  # opacity of obstacles
# Depth of the pyramid that represents the camera, for an arm of :data:`.REACH` [m].
CAMERA_SIZE = 0.12
#: Radii of the edges and markers of the target, for an arm of :data:`.REACH` [m].
EDGE_RADIUS = 0.003
MARKER_RADIUS = 0.015
#: Corners of an image, relative to half its size.
CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
MIN_DEPTH = 0.05  # least depth of the drawn view [m], for markers behind the camera
#: Half the height of a view relative to half the side of its cube; allowance for thick links.
IN_VIEW = 1.16
MARGIN = 1.12
# Elevation of the viewpoint, and that for a scene in a horizontal plane [deg].
ELEVATION = 20.0
ELEVATION_FLAT = 55.0


def setup_frames(setup: Setup, q: Array, t: float) -> dict[str, Placement]:
    """Return the placements of all frames at ``q`` (n,) and ``t`` [s].

    These are the arm's frames, ``camera``, ``target`` and ``obstacle k``.
    """
    scene = setup.scene
    camera = scene.camera
    frames = arm_frames(scene.robot, q)
    tip = frames["tip"].pose
    target = tip
    if camera.fixed is None:
        target = Pose.identity() if scene.motion is None else scene.motion.pose(t)
    frames["camera"] = Placement(camera.pose(tip))
    frames["target"] = Placement(target)
    for k, constraint in enumerate(setup.constraints.constraints):
        motion: Motion | None = getattr(constraint, "motion", None)
        pose = Pose.identity()
        if motion is not None and motion.size == 3:
            shift = motion.displacement(t) - motion.displacement(0.0)
            pose = Pose(pose.R, shift)
        frames[f"obstacle {k}"] = Placement(pose)
    return frames


def obstacle_meshes(setup: Setup, size: float) -> dict[int, Mesh]:
    """Return the meshes of forbidden regions in space, by the index of their constraint.

    ``size`` is half the side of the shown cube [m].
    """
    obstacles = {}
    for k, constraint in enumerate(setup.constraints.constraints):
        meshes = constraint.meshes(0.0, 0.8 * size)
        if meshes:
            obstacles[k] = joined(meshes)
    return obstacles


def add_surroundings(scene: Scene3D, setup: Setup, size: float, colour: str = OBSTACLE) -> None:
    """Add obstacles and the target; ``size`` is half the side of the shown cube [m]."""
    for k, mesh in obstacle_meshes(setup, size).items():
        scene.add(mesh, colour, f"obstacle {k}", opacity=GLASS)
    edge_radius = EDGE_RADIUS * size / REACH
    marker_radius = MARKER_RADIUS * size / REACH
    scene.target(setup.scene.markers, edge_radius, marker_radius, "target")


def add_robot(
    scene: Scene3D,
    setup: Setup,
    arm: Iterable[Part],
    scale: float,
    colour: str = CAMERA,
    prefix: str = "",
) -> None:
    """Add the parts of an arm and a bar from its tip to the object that it carries.

    This object is a camera, drawn in ``colour`` if that is not empty, or the target. The names of
    frames begin with ``prefix``.
    """
    for part in arm:
        frame = prefix + part.frame
        scene.parts.append(part._replace(frame=frame))
    camera = setup.scene.camera
    carried = camera.mount.inverse.t
    if camera.fixed is not None:
        carried = setup.scene.markers.mean(axis=0)
    if np.linalg.norm(carried) > SHORT:
        line = np.linspace(np.zeros(3), carried, 6)
        holder = tube(line, 0.007 * scale, 8)
        scene.add(holder, JOINT, f"{prefix}tip")
    if colour:
        base = CAMERA_SIZE * scale * image_corners(camera)
        scene.pyramid(base, colour, f"{prefix}camera")


def image_corners(camera: Camera) -> Array:
    """Return the corners (4, 3) of the image at depth 1, in the camera's frame."""
    pixels = 0.5 * np.asarray(camera.size) * CORNERS
    with suppress(InvalidInput):  # where the lens cannot be inverted, corners of a pinhole camera
        pixels = camera.undistort(pixels)
    corners = camera.normalised(pixels)
    return np.column_stack((corners, np.ones(4)))


def view_corners(setup: Setup, camera: Pose, q: Array, t: float) -> Array:
    """Return corners (4, 3) of the camera's view at the markers' distance, in the base frame."""
    markers = setup.scene.markers_at(q, t)
    depths = camera.inverse.act(markers)[:, 2]
    depth = max(float(depths.mean()), MIN_DEPTH)
    corners = image_corners(setup.scene.camera)
    return camera.act(depth * corners)


_bars = lru_cache(maxsize=8)(bars)


def draw_setup(ax: Any, setup: Setup, q: Array, t: float, view: Viewpoint) -> None:
    """Draw everything at an instant with matplotlib: the arm as bars, and the camera's view."""
    frames = setup_frames(setup, q, t)
    scale = view.half / REACH
    robot = setup.scene.robot
    scene = Scene3D()
    add_surroundings(scene, setup, view.half)
    add_robot(scene, setup, _bars(robot, scale), scale)
    camera = frames["camera"].pose
    corners = view_corners(setup, camera, q, t)
    edges = []
    for corner, following in pairwise([*corners, corners[0]]):
        edges.append((camera.t, corner))
        edges.append((corner, following))
    for begin, end in edges:
        points = np.linspace(begin, end, 12)
        line = tube(points, 0.0022 * scale, 4, caps=False)
        scene.add(line, CAMERA)
    scene.draw(ax, view, frames)


def points_in_view(setup: Setup, q: Array, t: float) -> Array:
    """Return corners (k, 3) of arm, camera, markers and camera's view, in the base frame."""
    robot = setup.scene.robot
    camera = setup_frames(setup, q, t)["camera"].pose
    points = bars_of(robot, q)
    points.append(camera.t[None])
    points.append(setup.scene.markers_at(q, t))
    points.append(view_corners(setup, camera, q, t))
    if not robot.prismatic[0]:
        base = np.zeros((1, 3))
        points.insert(0, base)
    return np.concatenate(points)


def viewpoint_of(setup: Setup, instants: Sequence[tuple[Array, float]], aspect: float) -> Viewpoint:
    """Return one viewpoint that shows several q (n,) and t [s].

    All points are in view, and the azimuth is the one at which they cover most of the picture.
    ``aspect`` is the width of the views over their height, at least 1.
    """
    points = np.concatenate([points_in_view(setup, q, t) for q, t in instants])
    extent = np.ptp(points, axis=0)
    is_flat = extent[2] < 0.25 * extent.max()
    elevation = ELEVATION_FLAT if is_flat else ELEVATION

    def covered_area(azimuth: float) -> float:
        seen = points @ view_axes(elevation, azimuth)
        across, up, _ = seen.T
        covariance = np.cov((across, up))
        return float(np.linalg.det(covariance))

    azimuths = np.arange(-90.0, 91.0, 10.0)
    azimuth = float(max(azimuths, key=covered_area))
    axes = view_axes(elevation, azimuth)
    seen = points @ axes
    low = seen.min(axis=0)
    high = seen.max(axis=0)
    half_width, half_height, _ = 0.5 * (high - low)
    needed = max(half_height, half_width / aspect)
    return Viewpoint(
        centre=axes @ (0.5 * (low + high)),
        half=MARGIN * needed / IN_VIEW,
        elevation=elevation,
        azimuth=azimuth,
    )


def view_axes(elevation: float, azimuth: float) -> Array:
    """Return directions right, up and towards the viewer as columns (3, 3), for angles [deg]."""
    elevation_rad, azimuth_rad = np.deg2rad([elevation, azimuth])
    cos = np.cos(azimuth_rad)
    sin = np.sin(azimuth_rad)
    level = np.cos(elevation_rad)
    height = np.sin(elevation_rad)
    right = np.array([-sin, cos, 0.0])
    towards = np.array([level * cos, level * sin, height])
    up = np.cross(towards, right)
    return np.column_stack((right, up, towards))
