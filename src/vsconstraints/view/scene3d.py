"""Scene in space for previews, films, replays and figures: coloured meshes fixed to frames.

:meth:`Scene3D.draw` draws it with matplotlib; :mod:`vsconstraints.view.replay.space` plays it
in a browser with viser.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ..constraints.meshes import Mesh, mesh_of
from ..errors import ConfigurationError
from ..reports.plots.style import INK, rgb
from ..robots.geometry import Pose
from ..robots.robot import Robot
from ..robots.urdf import link_geometry
from ..rows import Array

LINK = "#C9CED6"
JOINT = "#4A5568"
PLATE = "#F4F1E6"
AXIS_COLOURS = ("#D42A2A", "#2E8B3D", "#1447C4")
LIGHT = np.array([0.35, -0.55, 0.76])  # (3,) direction to the light, in the base frame
#: Reach for which the following radii hold [m]; the radii of other arms scale with reach.
REACH = 0.8
#: Radii of the first and the last link [m]; ratio of a prismatic link to a revolute one.
BASE_LINK = 0.034
LAST_LINK = 0.022
RAIL = 0.25
#: Cells of a plate in each direction: triangles are ordered by the mean distance of their corners.
PLATE_CELLS = 8


class Part(NamedTuple):
    """Mesh of one colour ``#RRGGBB``, in the coordinates of a named frame.

    An empty name stands for the base frame.
    """

    mesh: Mesh
    colour: str
    frame: str = ""
    opacity: float = 1.0
    shaded: bool = True


class Placement(NamedTuple):
    """Pose of a frame in the base frame; parts fixed to it are stretched along its z axis."""

    pose: Pose
    stretch: float = 1.0


class Viewpoint(NamedTuple):
    """Viewpoint on a cube with this centre (3,) and half side [m].

    ``elevation`` and ``azimuth`` are the angles from which it is seen [deg].
    """

    centre: Array
    half: float
    elevation: float
    azimuth: float


class Scene3D:
    """Set of meshes that are drawn at the poses of their frames."""

    def __init__(self) -> None:
        self.parts: list[Part] = []

    def add(self, mesh: Mesh, colour: str, frame: str = "", **look: Any) -> None:
        """Add a mesh in a frame; ``look`` are further fields of :class:`Part`."""
        if len(mesh.triangles):
            self.parts.append(Part(mesh, colour, frame, **look))

    def axes(self, pose: Pose, length: float, radius: float) -> None:
        """Add red, green and blue bars along the x, y and z axes of a frame."""
        for axis, colour in zip(pose.R.T, AXIS_COLOURS, strict=True):
            self.add(tube(np.array([pose.t, pose.t + length * axis]), radius, 6), colour)

    def pyramid(self, base: Array, colour: str, frame: str = "") -> None:
        """Add a camera at the origin of a frame: a glass pyramid with this base (4, 3)."""
        mesh = Mesh(
            np.concatenate((np.zeros((1, 3)), base)),
            np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]]),
        )
        self.add(mesh, colour, frame, opacity=0.55, shaded=False)

    def target(self, markers: Array, edge: float, marker: float, frame: str = "") -> None:
        """Add markers (M, 3), on a plate if there are more than two.

        ``edge`` and ``marker`` are the radii of the plate's edges and of the markers [m].
        """
        if len(markers) > 2:
            centre = markers.mean(axis=0)
            corners = centre + 1.25 * (markers - centre)
            # Small cells: a triangle in one piece would be drawn over bodies on the plate.
            steps = np.linspace(0.0, 1.0, PLATE_CELLS + 1)[:, None, None]
            wedges = []
            edges = []
            for corner, following in pairwise([*corners, corners[0]]):
                side = np.linspace(corner, following, PLATE_CELLS + 1)
                wedges.append(_grid(centre + steps * (side - centre)))
                edges.append(tube(np.array([corner, following]), edge, 6))
            self.add(joined(wedges), PLATE, frame, shaded=False)
            self.add(joined(edges), INK, frame)
        balls = [ball(place, marker, 10) for place in markers]
        self.add(joined(balls), INK, frame)

    def draw(
        self,
        ax: Any,
        view: Viewpoint,
        frames: Mapping[str, Placement] | None = None,
        whole: bool = True,
    ) -> None:
        """Draw everything into 3D axes of matplotlib that show the cube of a viewpoint.

        Axes in space are square. Parts outside their square are cut off unless ``whole`` is True.
        """
        from mpl_toolkits.mplot3d.art3d import Poly3DCollection

        corners = []
        colours = []
        for part in self.parts:
            points = part.mesh.points
            if part.frame:
                pose, stretch = (frames or {})[part.frame]
                points = pose.act(points * (1.0, 1.0, stretch))
            corners.append(points[part.mesh.triangles])
            colours.append(_shaded(corners[-1], part))
        if corners:
            faces = np.concatenate(colours)
            # Opaque triangles are outlined in their own colour to close the seams between them.
            edges = np.where(faces[:, 3:] < 1.0, 0.0, faces)
            solids = Poly3DCollection(
                np.concatenate(corners),
                facecolors=faces,
                edgecolors=edges,
                linewidths=0.25,
                zsort="average",
                clip_on=not whole,
            )
            ax.add_collection3d(solids, autolim=False)
        for name, middle in zip("xyz", view.centre, strict=True):
            getattr(ax, f"set_{name}lim")(middle - view.half, middle + view.half)
        ax.set_box_aspect((1, 1, 1), zoom=1.45)
        ax.view_init(elev=view.elevation, azim=view.azimuth)
        ax.set_proj_type("persp", focal_length=0.6)
        ax.set_axis_off()
        ax.patch.set_alpha(0.0)


def _shaded(corners: Array, part: Part) -> Array:
    """Return colours (F, 4) of triangles (F, 3, 3), shaded by their angle to the light."""
    count = len(corners)
    shade = np.ones(count)
    if part.shaded:
        first, second, third = corners.transpose(1, 0, 2)
        normals = np.cross(second - first, third - first)
        lengths = np.linalg.norm(normals, axis=1)
        facing = np.ones(count)
        np.divide(np.abs(normals @ LIGHT), lengths, out=facing, where=lengths > 0.0)
        shade = 0.55 + 0.45 * np.minimum(facing, 1.0)
    colours = shade[:, None] * np.array(rgb(part.colour)) / 255.0
    opacity = np.full(count, part.opacity)
    return np.column_stack((colours, opacity))


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Return several meshes as one."""
    if not meshes:
        return Mesh(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64))
    points = []
    triangles = []
    count = 0
    for mesh in meshes:
        points.append(mesh.points)
        triangles.append(mesh.triangles + count)
        count += len(mesh.points)
    return Mesh(np.concatenate(points), np.concatenate(triangles))


def _grid(points: Array) -> Mesh:
    """Return the surface through a grid of points (a, b, 3)."""
    a, b, _ = points.shape
    k = np.arange(a * b).reshape(a, b)
    # Each cell is two triangles, on both sides of its diagonal.
    begin = k[:-1, :-1].ravel()
    right = k[:-1, 1:].ravel()
    left = k[1:, :-1].ravel()
    end = k[1:, 1:].ravel()
    above = np.stack((begin, right, end), axis=1)
    below = np.stack((begin, end, left), axis=1)
    return Mesh(points.reshape(-1, 3), np.concatenate((above, below)))


def ball(centre: Array, radius: float, count: int = 16) -> Mesh:
    """Return a sphere with ``count`` meridians."""
    polar = np.linspace(0.0, np.pi, count // 2 + 1)
    azimuth = np.linspace(0.0, 2.0 * np.pi, count + 1)
    theta, phi = np.meshgrid(polar, azimuth, indexing="ij")
    x = np.sin(theta) * np.cos(phi)
    y = np.sin(theta) * np.sin(phi)
    z = np.cos(theta)
    directions = np.stack((x, y, z), axis=-1)
    return _grid(centre + radius * directions)


def tube(points: Array, radius: float, sides: int = 12, caps: bool = True) -> Mesh:
    """Return a round bar along a polyline (p, 3)."""
    points = np.asarray(points, dtype=np.float64)
    along = _unit(np.gradient(points, axis=0))
    # All sections are oriented by the direction in which the line extends least.
    _, _, directions = np.linalg.svd(along)
    x = _unit(np.cross(along, directions[2]))
    y = np.cross(along, x)
    angles = 2.0 * np.pi * np.arange(sides + 1) / sides
    cos = np.cos(angles)[:, None]
    sin = np.sin(angles)[:, None]
    sections = cos * x[:, None] + sin * y[:, None]
    surface = points[:, None] + radius * sections
    if caps:
        first = np.broadcast_to(points[0], surface[:1].shape)
        last = np.broadcast_to(points[-1], surface[:1].shape)
        surface = np.concatenate((first, surface, last))
    return _grid(surface)


def _unit(vectors: Array) -> Array:
    """Return vectors (p, 3) scaled to length 1."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit: Array = vectors / np.maximum(lengths, 1e-12)
    return unit


def joint_poses(robot: Robot, q: Array) -> tuple[list[Pose], Array]:
    """Return poses of the base and of each joint's child link (n + 1), and joint axes (n, 3)."""
    data = robot.model.createData()
    pin.computeJointJacobians(robot.model, data, q)
    J = np.asarray(data.J).reshape(6, -1)
    poses = []
    for placement in data.oMi:
        poses.append(Pose(np.array(placement.rotation), np.array(placement.translation)))
    axes = np.where(np.array(robot.prismatic), J[:3], J[3:]).T
    return poses, axes


def bars_of(robot: Robot, q: Array) -> list[Array]:
    """Return the corners (p, 3) of a bar behind each joint.

    A bar follows the joint's axis, then the common normal to the next one.
    """
    poses, axes = joint_poses(robot, q)
    places = [pose.t for pose in poses[1:]]
    places.append(robot.pose(q).t)
    bars = []
    for (begin, end), axis in zip(pairwise(places), axes, strict=True):
        along_axis = float(axis @ (end - begin))
        elbow = begin + along_axis * axis
        corners = [begin]
        for point in (elbow, end):
            if np.linalg.norm(point - begin) > 1e-6:
                corners.append(point)
        bars.append(np.array(corners))
    return bars


def bars(robot: Robot, size: float) -> list[Part]:
    """Return an arm as bars between its joint axes, in the frames of :func:`arm_frames`.

    ``size`` scales their width. A prismatic joint is thin and has a rail instead of a drum; an arm
    that begins with one has no base.
    """
    zero = np.zeros(robot.n)
    n = robot.n
    parts = []
    poses, axes = joint_poses(robot, zero)
    radii = size * (BASE_LINK + (LAST_LINK - BASE_LINK) * np.arange(n) / n)
    if not robot.prismatic[0]:
        base = tube(size * np.array([[0, 0, -0.005], [0, 0, 0.04]]), 0.09 * size, 24)
        parts.append(Part(base, JOINT, "joint 0"))
        if np.linalg.norm(poses[1].t) > 1e-6:
            column = tube(np.array([np.zeros(3), poses[1].t]), 0.8 * radii[0])
            parts.append(Part(column, LINK, "joint 0"))
    for i, corners in enumerate(bars_of(robot, zero), start=1):
        radius = radii[i - 1]
        is_prismatic = robot.prismatic[i - 1]
        to_joint = poses[i].inverse
        frame = f"joint {i}"
        thickness = (RAIL if is_prismatic else 0.8) * radius
        pieces = []
        for begin, end in pairwise(corners):
            steps = max(2, int(np.linalg.norm(end - begin) / (0.05 * size)))
            pieces.append(tube(np.linspace(begin, end, steps), thickness))
            pieces.append(ball(end, thickness, 12))
        if pieces:
            parts.append(Part(joined(pieces).moved(to_joint), LINK, frame))
        if is_prismatic:
            rail = tube(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), 0.004)
            parts.append(Part(rail, LINK, f"slide {i}"))
        else:
            half = 1.35 * radius * axes[i - 1]
            drum = tube(poses[i].t + np.array([-half, half]), 1.25 * radius, 14)
            parts.append(Part(drum.moved(to_joint), JOINT, frame))
    return parts


def visuals(robot: Robot, size: float) -> tuple[list[Part], str]:
    """Return the visual meshes of a robot's URDF, and a remark.

    If there are no meshes, or one is missing, bars are returned and the remark says so.
    """
    if robot.source is None:
        remark = f"{robot.name} has no meshes: bars follow the axes of its joints."
        return bars(robot, size), remark
    parts = []
    remark = f"{robot.name} has no visual meshes: bars follow its axes."
    try:
        for body in link_geometry(robot.source, "visual").geometryObjects:
            mesh = mesh_of(body.geometry)
            if mesh is not None:
                placement = body.placement
                pose = Pose(np.array(placement.rotation), np.array(placement.translation))
                parts.append(Part(mesh.moved(pose), LINK, f"joint {body.parentJoint}"))
    except ConfigurationError as error:
        parts = []
        remark = f"Bars follow the axes of its joints instead of meshes: {error}."
    return (parts, "") if parts else (bars(robot, size), remark)


def arm_frames(robot: Robot, q: Array) -> dict[str, Placement]:
    """Return the frames ``joint 0`` (the base) to ``joint n``, ``tip``, and one per rail.

    A frame ``slide k`` lies along each prismatic joint k.
    """
    poses, axes = joint_poses(robot, q)
    frames = {f"joint {i}": Placement(pose) for i, pose in enumerate(poses)}
    frames["tip"] = Placement(robot.pose(q))
    z = np.array([0.0, 0.0, 1.0])
    for i in range(robot.n):
        if robot.prismatic[i]:  # the rail ends at the joint's zero position
            turn = pin.Quaternion.FromTwoVectors(z, -axes[i]).matrix()
            pose = Pose(turn, poses[i + 1].t)
            frames[f"slide {i + 1}"] = Placement(pose, float(q[i]) or 1e-6)
    return frames
