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
            sides = np.stack((corners, np.roll(corners, -1, axis=0)), axis=1)
            # Small cells: a triangle in one piece would be drawn over bodies on the plate.
            steps = np.linspace(0.0, 1.0, PLATE_CELLS + 1)
            wedges = [
                centre + steps[:, None, None] * (np.linspace(a, b, PLATE_CELLS + 1) - centre)
                for a, b in sides
            ]
            self.add(joined([_grid(wedge) for wedge in wedges]), PLATE, frame, shaded=False)
            self.add(joined([tube(side, edge, 6) for side in sides]), INK, frame)
        self.add(joined([ball(place, marker, 10) for place in markers]), INK, frame)

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
            look: dict[str, Any] = {
                "facecolors": faces,
                "edgecolors": edges,
                "linewidths": 0.25,
                "zsort": "average",
            }
            solids = Poly3DCollection(np.concatenate(corners), **look, clip_on=not whole)
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
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    facing = np.divide(
        np.abs(normals @ LIGHT), lengths, out=np.ones_like(lengths), where=lengths > 0.0
    )
    shade = 0.55 + 0.45 * np.minimum(facing, 1.0) if part.shaded else np.ones(len(corners))
    return np.column_stack(
        (shade[:, None] * np.array(rgb(part.colour)) / 255.0, np.full(len(corners), part.opacity))
    )


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Return several meshes as one."""
    if not meshes:
        return Mesh(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64))
    first = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    triangles = [mesh.triangles + start for mesh, start in zip(meshes, first, strict=False)]
    return Mesh(np.concatenate([mesh.points for mesh in meshes]), np.concatenate(triangles))


def _grid(points: Array) -> Mesh:
    """Return the surface through a grid of points (a, b, 3)."""
    a, b, _ = points.shape
    k = np.arange(a * b).reshape(a, b)
    p, q, r, s = (corner.ravel() for corner in (k[:-1, :-1], k[:-1, 1:], k[1:, 1:], k[1:, :-1]))
    return Mesh(
        points.reshape(-1, 3),
        np.concatenate((np.stack((p, q, r), axis=1), np.stack((p, r, s), axis=1))),
    )


def ball(centre: Array, radius: float, count: int = 16) -> Mesh:
    """Return a sphere with ``count`` meridians."""
    theta = np.linspace(0.0, np.pi, count // 2 + 1)
    phi = np.linspace(0.0, 2.0 * np.pi, count + 1)
    T, P = np.meshgrid(theta, phi, indexing="ij")
    return _grid(
        centre
        + radius * np.stack((np.sin(T) * np.cos(P), np.sin(T) * np.sin(P), np.cos(T)), axis=-1)
    )


def tube(points: Array, radius: float, sides: int = 12, caps: bool = True) -> Mesh:
    """Return a round bar along a polyline (p, 3)."""
    along = np.gradient(np.asarray(points, dtype=np.float64), axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    # All sections are oriented by the direction in which the line extends least.
    across = np.cross(along, np.linalg.svd(along)[2][2])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    angles = 2.0 * np.pi * np.arange(sides + 1) / sides
    around = (
        np.cos(angles)[:, None] * across[:, None]
        + np.sin(angles)[:, None] * np.cross(along, across)[:, None]
    )
    radii = np.array([0.0, *[1.0] * len(points), 0.0]) if caps else np.ones(len(points))
    at = np.arange(len(points)) if not caps else np.array([0, *range(len(points)), len(points) - 1])
    return _grid(np.asarray(points)[at][:, None] + radius * radii[:, None, None] * around[at])


def joint_poses(robot: Robot, q: Array) -> tuple[list[Pose], Array]:
    """Return poses of the base and of each joint's child link (n + 1), and joint axes (n, 3)."""
    data = robot.model.createData()
    pin.computeJointJacobians(robot.model, data, q)
    J = np.asarray(data.J).reshape(6, -1)
    poses = [
        Pose(np.array(data.oMi[i].rotation), np.array(data.oMi[i].translation))
        for i in range(robot.n + 1)
    ]
    return poses, np.where(np.array(robot.prismatic), J[:3], J[3:]).T


def bars_of(robot: Robot, q: Array) -> list[Array]:
    """Return the corners (p, 3) of a bar behind each joint.

    A bar follows the joint's axis, then the common normal to the next one.
    """
    poses, axes = joint_poses(robot, q)
    places = [*(pose.t for pose in poses[1:]), robot.pose(q).t]
    bars = []
    for (before, after), axis in zip(pairwise(places), axes, strict=True):
        elbow = before + float(axis @ (after - before)) * axis
        corners = [before]
        corners += [point for point in (elbow, after) if np.linalg.norm(point - corners[-1]) > 1e-6]
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
        parts.append(
            Part(
                tube(size * np.array([[0, 0, -0.005], [0, 0, 0.04]]), 0.09 * size, 24),
                JOINT,
                "joint 0",
            )
        )
        if np.linalg.norm(poses[1].t) > 1e-6:
            parts.append(
                Part(tube(np.array([np.zeros(3), poses[1].t]), 0.8 * radii[0]), LINK, "joint 0")
            )
    for i, (corners, radius, slides) in enumerate(
        zip(bars_of(robot, zero), radii, robot.prismatic, strict=True), 1
    ):
        rest = poses[i].inverse
        frame = f"joint {i}"
        thickness = (RAIL if slides else 0.8) * radius
        pieces = []
        for a, b in pairwise(corners):
            steps = max(2, int(np.linalg.norm(b - a) / (0.05 * size)))
            pieces += [tube(np.linspace(a, b, steps), thickness), ball(b, thickness, 12)]
        if pieces:
            parts.append(Part(joined(pieces).moved(rest), LINK, frame))
        half = 1.35 * radius * axes[i - 1]
        drum = tube(poses[i].t + np.array([-half, half]), 1.25 * radius, 14).moved(rest)
        rail = tube(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), 0.004)
        parts.append(Part(rail, LINK, f"slide {i}") if slides else Part(drum, JOINT, frame))
    return parts


def visuals(robot: Robot, size: float) -> tuple[list[Part], str]:
    """Return the visual meshes of a robot's URDF, and a remark.

    If there are no meshes, or one is missing, bars are returned and the remark says so.
    """
    parts = []
    remark = f"{robot.name} has no meshes: bars follow the axes of its joints."
    if robot.source is not None:
        remark = f"{robot.name} has no visual meshes: bars follow its axes."
        try:
            for one in link_geometry(robot.source, "visual").geometryObjects:
                if (mesh := mesh_of(one.geometry)) is not None:
                    pose = Pose(
                        np.array(one.placement.rotation), np.array(one.placement.translation)
                    )
                    parts.append(Part(mesh.moved(pose), LINK, f"joint {one.parentJoint}"))
        except ConfigurationError as error:
            parts = []
            remark = f"Bars follow the axes of its joints instead of meshes: {error}."
    return (parts, "") if parts else (bars(robot, size), remark)


def arm_frames(robot: Robot, q: Array) -> dict[str, Placement]:
    """Return the frames ``joint 0`` (the base) to ``joint n``, ``tip``, and one per rail.

    A frame ``slide k`` lies along each prismatic joint k.
    """
    poses, axes = joint_poses(robot, q)
    frames = {f"joint {i}": Placement(pose) for i, pose in enumerate(poses)} | {
        "tip": Placement(robot.pose(q))
    }
    for i, (axis, slides) in enumerate(zip(axes, robot.prismatic, strict=True), start=1):
        if slides:  # the rail ends at the joint's zero position
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), -axis).matrix()
            frames[f"slide {i}"] = Placement(Pose(turn, poses[i].t), float(q[i - 1]) or 1e-6)
    return frames
