"""The scene in space, once for previews, films, replays and the paper's figures: coloured meshes fixed to frames.

:meth:`Scene3D.draw` draws it with matplotlib; :mod:`vsconstraints.reports.replay.space` plays it in a browser by viser.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ..constraints.meshes import Mesh, mesh_of
from ..errors import ConfigurationError, InvalidInput
from ..robots.geometry import Pose
from ..robots.robot import Robot
from ..robots.urdf import link_geometry
from ..rows import Array
from ..simulation import Setup
from ..vision.camera import Camera
from ..vision.motion import Motion
from .plots.style import INK, rgb

LINK, JOINT, CAMERA, PLATE, OBSTACLE = "#C9CED6", "#4A5568", "#0072B2", "#F4F1E6", "#F0A202"
AXIS_COLOURS = ("#D42A2A", "#2E8B3D", "#1447C4")
GLASS = 0.4
"""Opacity of obstacles."""

LIGHT = np.array([0.35, -0.55, 0.76])
"""(3,) direction to the light, in the base frame."""

REACH = 0.8
"""Of the arm for which the following radii hold [m]; other arms are drawn as much thicker as they are longer."""

BASE_LINK, LAST_LINK, RAIL = 0.034, 0.022, 0.25
"""Radii of the first and the last link [m], and of a sliding link relative to its revolute one."""

PLATE_CELLS = 8
"""A plate is cut into so many parts each way: triangles are ordered by the mean distance of their corners."""

MIN_DEPTH = 0.05
"""At which the camera's view is drawn at least [m], where markers are behind it."""

IN_VIEW, MARGIN = 1.16, 1.12
"""Half the height that a view shows, relative to half the side of its cube; and what is added for thick links."""

ELEVATION, ELEVATION_FLAT = 20.0, 55.0
"""From which a scene is seen, and one that lies in a horizontal plane [deg]."""


class Part(NamedTuple):
    """A mesh of one colour ``#RRGGBB``, in the coordinates of the frame with this name (the base frame if empty)."""

    mesh: Mesh
    colour: str
    frame: str = ""
    opacity: float = 1.0
    shaded: bool = True
    name: str = ""


class Placement(NamedTuple):
    """Where a frame is in the base frame; what is fixed to it is stretched along its z axis."""

    pose: Pose
    stretch: float = 1.0


class Viewpoint(NamedTuple):
    """What is shown, a cube of this centre (3,) and half side [m], seen from this elevation and azimuth [deg]."""

    centre: Array
    half: float
    elevation: float
    azimuth: float


class Scene3D:
    """Meshes, to be drawn wherever their frames are."""

    def __init__(self) -> None:
        self.parts: list[Part] = []

    def add(self, mesh: Mesh, colour: str, frame: str = "", **look: Any) -> None:
        """A mesh in a frame; ``look`` are further fields of :class:`Part`."""
        if len(mesh.triangles):
            self.parts.append(Part(mesh, colour, frame, **look))

    def tube(self, points: Array, radius: float, colour: str, sides: int = 10, caps: bool = True) -> None:
        """A round bar along a polyline (p, 3), in the base frame."""
        self.add(tube(points, radius, sides, caps), colour)

    def ball(self, centre: Array, radius: float, colour: str, count: int = 16) -> None:
        """A sphere, in the base frame."""
        self.add(ball(centre, radius, count), colour)

    def axes(self, pose: Pose, length: float, radius: float) -> None:
        """Red, green and blue bars along the x, y and z axes of a frame."""
        for axis, colour in enumerate(AXIS_COLOURS):
            self.tube(np.array([pose.t, pose.t + length * pose.R[:, axis]]), radius, colour, sides=6)

    def pyramid(self, base: Array, colour: str, frame: str = "", name: str = "") -> None:
        """A camera at the origin of a frame: a pyramid of glass with this base (4, 3)."""
        mesh = Mesh(np.concatenate((np.zeros((1, 3)), base)), np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]]))
        self.add(mesh, colour, frame, opacity=0.55, shaded=False, name=name)

    def target(self, markers: Array, edge: float, marker: float, frame: str = "") -> None:
        """Markers (M, 3), on a plate if they are more than two; radii of the plate's edges and of markers [m]."""
        if len(markers) > 2:
            centre = markers.mean(axis=0)
            corners = centre + 1.25 * (markers - centre)
            sides = list(pairwise([*corners, corners[0]]))
            self.add(joined([_wedge(centre, a, b) for a, b in sides]), PLATE, frame, shaded=False, name="plate")
            self.add(joined([tube(np.array(side), edge, 6) for side in sides]), INK, frame, name="edges")
        self.add(joined([ball(place, marker, 10) for place in markers]), INK, frame, name="markers")

    def draw(self, ax: Any, view: Viewpoint, frames: Mapping[str, Placement] | None = None, whole: bool = True) -> None:
        """Draw everything into 3D axes of matplotlib, which show the cube of a viewpoint.

        Axes in space are square within their place; what is beside is cut off unless the ``whole`` is wanted.
        """
        from mpl_toolkits.mplot3d.art3d import Poly3DCollection

        corners, colours = [], []
        for part in self.parts:
            mesh = part.mesh
            if part.frame:
                pose, stretch = (frames or {})[part.frame]
                mesh = Mesh(mesh.points * (1.0, 1.0, stretch), mesh.triangles).moved(pose)
            own = mesh.points[mesh.triangles]
            corners.append(own)
            colours.append(_shaded(own, part))
        if corners:
            faces = np.concatenate(colours)
            # opaque triangles are outlined in their own colour, which closes the seams between them
            edges = np.where(faces[:, 3:] < 1.0, 0.0, faces)
            look = {"facecolors": faces, "edgecolors": edges, "linewidths": 0.25, "zsort": "average"}
            solids = Poly3DCollection(np.concatenate(corners), **look)
            ax.add_collection3d(solids, autolim=False)
            solids.set_clip_on(not whole)
        for name, middle in zip("xyz", view.centre, strict=True):
            getattr(ax, f"set_{name}lim")(middle - view.half, middle + view.half)
        ax.set_box_aspect((1, 1, 1), zoom=1.45)
        ax.view_init(elev=view.elevation, azim=view.azimuth)
        ax.set_proj_type("persp", focal_length=0.6)
        ax.set_axis_off()
        ax.patch.set_alpha(0.0)


def _shaded(corners: Array, part: Part) -> Array:
    """(F, 4) colours of triangles (F, 3, 3) by how they face the light."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    facing = np.divide(np.abs(normals @ LIGHT), lengths, out=np.ones_like(lengths), where=lengths > 0.0)
    shade = 0.55 + 0.45 * np.minimum(facing, 1.0) if part.shaded else np.ones(len(corners))
    colours = shade[:, None] * np.array(rgb(part.colour)) / 255.0
    return np.column_stack((colours, np.full(len(corners), part.opacity)))


# --- meshes ---


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one."""
    if not meshes:
        return Mesh(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64))
    first = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    triangles = [mesh.triangles + start for mesh, start in zip(meshes, first, strict=False)]
    return Mesh(np.concatenate([mesh.points for mesh in meshes]), np.concatenate(triangles))


def _grid(points: Array) -> Mesh:
    """A surface through a grid of points (a, b, 3)."""
    a, b, _ = points.shape
    i, j = (index.ravel() for index in np.meshgrid(np.arange(a - 1), np.arange(b - 1), indexing="ij"))
    p, q, r, s = i * b + j, i * b + j + 1, (i + 1) * b + j + 1, (i + 1) * b + j
    triangles = np.concatenate((np.stack((p, q, r), axis=1), np.stack((p, r, s), axis=1)))
    return Mesh(points.reshape(-1, 3), triangles)


def ball(centre: Array, radius: float, count: int = 16) -> Mesh:
    """A sphere with ``count`` meridians."""
    theta, phi = np.linspace(0.0, np.pi, count // 2 + 1), np.linspace(0.0, 2.0 * np.pi, count + 1)
    T, P = np.meshgrid(theta, phi, indexing="ij")
    return _grid(centre + radius * np.stack((np.sin(T) * np.cos(P), np.sin(T) * np.sin(P), np.cos(T)), axis=-1))


def tube(points: Array, radius: float, sides: int = 12, caps: bool = True) -> Mesh:
    """A round bar along a polyline (p, 3), its sections turned as little as possible from one point to the next."""
    points = np.asarray(points, dtype=np.float64)
    angles = 2.0 * np.pi * np.arange(sides + 1) / sides
    across: Array = np.zeros(3)
    rings = []
    for point, along in zip(points, np.gradient(points, axis=0), strict=True):
        d = along / max(float(np.linalg.norm(along)), 1e-12)
        helper = across if across @ across > 0.5 and abs(across @ d) < 0.9 else np.eye(3)[int(np.argmin(np.abs(d)))]
        across = helper - (helper @ d) * d
        across = across / np.linalg.norm(across)
        rings.append(
            point + radius * (np.outer(np.cos(angles), across) + np.outer(np.sin(angles), np.cross(d, across)))
        )
    ends = [points[:1].repeat(sides + 1, axis=0), points[-1:].repeat(sides + 1, axis=0)]
    return _grid(np.array([ends[0], *rings, ends[1]] if caps else rings))


def _wedge(apex: Array, a: Array, b: Array) -> Mesh:
    """A triangle (corners (3,) each) in small cells: in one piece it would be drawn over bodies that it carries."""
    along, across = np.linspace(0.0, 1.0, PLATE_CELLS + 1), np.linspace(a, b, PLATE_CELLS + 1) - apex
    return _grid(apex + along[:, None, None] * across)


# --- the arm ---


class ArmMeshes(NamedTuple):
    """What an arm with n joints looks like: for its base and each joint (n + 1), in that joint's frame at rest.

    Attributes
    ----------
    links, drums
        Meshes of the links, and of drums around the axes of revolute joints.
    remark
        Why bars are drawn instead of the URDF's meshes.
    """

    links: tuple[Mesh, ...]
    drums: tuple[Mesh, ...]
    remark: str = ""


def joint_places(robot: Robot, q: Array) -> tuple[Array, Array]:
    """Origins of the joints and of the tip (n + 1, 3), and directions of the joints' axes (n, 3), in the base frame."""
    model, data = robot.model, robot.model.createData()
    pin.computeJointJacobians(model, data, q)
    J = np.asarray(data.J).reshape(6, -1)
    axes = np.where(np.array(robot.prismatic), J[:3], J[3:]).T
    origins = [np.array(data.oMi[i].translation) for i in range(1, model.njoints)]
    return np.array([*origins, robot.pose(q).t]), axes


def bars_of(robot: Robot, q: Array) -> list[Array]:
    """(p, 3) corners of a bar behind each joint: along its axis, then along the common normal to the next one."""
    places, axes = joint_places(robot, q)
    bars = []
    for before, after, axis in zip(places[:-1], places[1:], axes, strict=True):
        corners = [before]
        elbow = before + float(axis @ (after - before)) * axis
        corners += [point for point in (elbow, after) if np.linalg.norm(point - corners[-1]) > 1e-6]
        bars.append(np.array(corners))
    return bars


def bar_meshes(robot: Robot, size: float) -> ArmMeshes:
    """An arm as bars between the axes of its joints; ``size`` scales how thick they are.

    What slides is thin and has no drum; an arm that begins with it has no base.
    """
    zero, n = np.zeros(robot.n), robot.n
    places, axes = joint_places(robot, zero)
    radii = size * (BASE_LINK + (LAST_LINK - BASE_LINK) * np.arange(n) / n)
    links: list[list[Mesh]] = [[] for _ in range(n + 1)]
    drums = [joined([]) for _ in range(n + 1)]
    if not robot.prismatic[0]:
        drums[0] = tube(size * np.array([[0.0, 0.0, -0.005], [0.0, 0.0, 0.04]]), 0.09 * size, 24)
        if np.linalg.norm(places[0]) > 1e-6:
            links[0] = [tube(np.array([np.zeros(3), places[0]]), 0.8 * radii[0])]
    for i, corners in enumerate(bars_of(robot, zero), start=1):
        radius, slides = radii[i - 1], robot.prismatic[i - 1]
        if not slides:
            half = 1.35 * radius * axes[i - 1]
            drums[i] = tube(np.array([places[i - 1] - half, places[i - 1] + half]), 1.25 * radius, 14)
        thickness = (RAIL if slides else 0.8) * radius
        for a, b in pairwise(corners):
            steps = max(2, int(np.linalg.norm(b - a) / (0.05 * size)))
            links[i] += [tube(np.linspace(a, b, steps), thickness), ball(b, thickness, 12)]
    rest = [pose.inverse for pose in joint_poses(robot, zero)]
    own = tuple(joined(parts).moved(pose) for parts, pose in zip(links, rest, strict=True))
    return ArmMeshes(own, tuple(drum.moved(pose) for drum, pose in zip(drums, rest, strict=True)))


def joint_poses(robot: Robot, q: Array) -> list[Pose]:
    """(n + 1) poses of the base and of what each joint moves."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    return [Pose(np.array(data.oMi[i].rotation), np.array(data.oMi[i].translation)) for i in range(robot.n + 1)]


def urdf_meshes(robot: Robot, size: float) -> ArmMeshes:
    """The visual meshes of a robot's URDF; bars, and a sentence that says so, where it has none or one is missing."""
    if robot.source is None:
        return bar_meshes(robot, size)._replace(
            remark=f"{robot.name} has no meshes: bars follow the axes of its joints."
        )
    try:
        geometry = link_geometry(robot.source, "visual")
    except ConfigurationError as error:
        return bar_meshes(robot, size)._replace(
            remark=f"Bars follow the axes of its joints instead of meshes: {error}."
        )
    bodies: list[list[Mesh]] = [[] for _ in range(robot.n + 1)]
    for part in geometry.geometryObjects:
        mesh = mesh_of(part.geometry)
        if mesh is not None:
            pose = Pose(np.array(part.placement.rotation), np.array(part.placement.translation))
            bodies[part.parentJoint].append(mesh.moved(pose))
    if not any(bodies):
        return bar_meshes(robot, size)._replace(remark=f"{robot.name} has no visual meshes: bars follow its axes.")
    return ArmMeshes(tuple(joined(parts) for parts in bodies), (joined([]),) * (robot.n + 1))


def arm_frames(robot: Robot, q: Array, prefix: str = "") -> dict[str, Placement]:
    """Frames ``joint 0`` (the base) to ``joint n``, ``tip``, and a ``slide k`` along each prismatic joint k."""
    poses = joint_poses(robot, q)
    frames = {f"{prefix}joint {i}": Placement(pose) for i, pose in enumerate(poses)}
    for i, slides in enumerate(robot.prismatic, start=1):
        if slides:
            rest = robot.model.jointPlacements[i]
            before = poses[robot.model.parents[i]] @ Pose(np.array(rest.rotation), np.array(rest.translation))
            along = poses[i].t - before.t
            length = float(np.linalg.norm(along))
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along / length if length else np.eye(3)[2])
            frames[f"{prefix}slide {i}"] = Placement(Pose(turn.matrix(), before.t), max(length, 1e-6))
    frames[f"{prefix}tip"] = Placement(robot.pose(q))
    return frames


def add_arm(
    scene: Scene3D,
    robot: Robot,
    meshes: ArmMeshes,
    colours: tuple[str, str] = (LINK, JOINT),
    prefix: str = "",
    **look: Any,
) -> None:
    """An arm whose frames are :func:`arm_frames`, in the colours of its links and drums."""
    for i, (link, drum) in enumerate(zip(meshes.links, meshes.drums, strict=True)):
        for mesh, colour, name in ((link, colours[0], "link"), (drum, colours[1], "drum")):
            scene.add(mesh, colour, f"{prefix}joint {i}", name=name, **look)
        if i and robot.prismatic[i - 1]:
            rail = tube(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), 0.004)
            scene.add(rail, colours[0], f"{prefix}slide {i}", name="rail", **look)


# --- a setup ---


def setup_frames(setup: Setup, q: Array, t: float) -> dict[str, Placement]:
    """Where the arm's frames, the ``camera``, the ``target`` and ``obstacle k`` are at ``q`` (n,) and ``t`` [s]."""
    world = setup.scene
    frames = arm_frames(world.robot, q)
    tip = frames["tip"].pose
    frames["camera"] = Placement(world.camera.fixed or tip @ world.camera.mount.inverse)
    target = Pose.identity() if world.motion is None else world.motion.pose(t)
    frames["target"] = Placement(tip if world.camera.fixed is not None else target)
    for k, constraint in enumerate(setup.constraints.constraints):
        motion: Motion | None = getattr(constraint, "motion", None)
        moved = np.zeros(3)
        if motion is not None and motion.size == 3:
            moved = motion.displacement(t) - motion.displacement(0.0)
        frames[f"obstacle {k}"] = Placement(Pose(np.eye(3), moved))
    return frames


def obstacle_meshes(setup: Setup, size: float) -> dict[int, Mesh]:
    """What constraints forbid in space, by their place in the list; ``size`` is half of what is shown [m]."""
    found = {k: one.meshes(0.0, 0.8 * size) for k, one in enumerate(setup.constraints.constraints)}
    return {k: joined(meshes) for k, meshes in found.items() if meshes}


def add_surroundings(scene: Scene3D, setup: Setup, size: float, colour: str = OBSTACLE, frame: str = "target") -> None:
    """Obstacles and the target; ``size`` is half of what is shown [m]."""
    scale = size / REACH
    for k, mesh in obstacle_meshes(setup, size).items():
        scene.add(mesh, colour, f"obstacle {k}", opacity=GLASS, name="glass")
    scene.target(setup.scene.markers, 0.003 * scale, 0.015 * scale, frame)


def add_carrier(scene: Scene3D, setup: Setup, scale: float, frame: str = "tip") -> None:
    """The bar from the tip to what it carries: the camera, or the target of a fixed one."""
    world = setup.scene
    carried = world.camera.mount.inverse.t if world.camera.fixed is None else world.markers.mean(axis=0)
    if np.linalg.norm(carried) > 1e-6:
        scene.add(tube(np.linspace(np.zeros(3), carried, 6), 0.007 * scale, 8), JOINT, frame, name="carrier")


def image_corners(camera: Camera) -> Array:
    """(4, 3) where the corners of the image are at depth 1, in the camera's frame."""
    half = 0.5 * np.asarray(camera.size)
    corners = half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    with suppress(InvalidInput):  # where the lens cannot be inverted, those of a pinhole
        corners = camera.undistort(corners)
    return np.concatenate((camera.normalised(corners), np.ones((4, 1))), axis=1)


def draw_setup(ax: Any, setup: Setup, q: Array, t: float, view: Viewpoint) -> None:
    """Everything at an instant, with matplotlib: the arm as bars, and what its camera sees."""
    frames, scale = setup_frames(setup, q, t), view.half / REACH
    scene = Scene3D()
    add_surroundings(scene, setup, view.half)
    add_arm(scene, setup.scene.robot, _cached_bars(setup.scene.robot, scale))
    add_carrier(scene, setup, scale)
    scene.pyramid(0.09 * scale * image_corners(setup.scene.camera), CAMERA, "camera")
    corners = view_corners(setup, frames["camera"].pose, q, t)
    origin = frames["camera"].pose.t
    for a, b in pairwise([*corners, corners[0]]):
        for start, end in ((origin, a), (a, b)):
            scene.tube(np.linspace(start, end, 12), 0.0022 * scale, CAMERA, 4, caps=False)
    scene.draw(ax, view, frames)


@lru_cache(maxsize=8)
def _cached_bars(robot: Robot, scale: float) -> ArmMeshes:
    return bar_meshes(robot, scale)


def view_corners(setup: Setup, camera: Pose, q: Array, t: float) -> Array:
    """(4, 3) corners of what the camera sees at the markers' distance, in the base frame."""
    depth = float(camera.inverse.act(setup.scene.markers_at(q, t))[:, 2].mean())
    return camera.act(max(depth, MIN_DEPTH) * image_corners(setup.scene.camera))


# --- viewpoints ---


def points_in_view(setup: Setup, q: Array, t: float) -> Array:
    """(k, 3) corners of the arm, camera, markers and the camera's view, in the base frame."""
    robot, frames = setup.scene.robot, setup_frames(setup, q, t)
    camera = frames["camera"].pose
    base = [] if robot.prismatic[0] else [np.zeros((1, 3))]
    arm = np.concatenate([*base, *bars_of(robot, q)])
    return np.concatenate((arm, camera.t[None], setup.scene.markers_at(q, t), view_corners(setup, camera, q, t)))


def viewpoint_of(setup: Setup, instants: Sequence[tuple[Array, float]], aspect: float) -> Viewpoint:
    """One viewpoint for several q (n,) and t [s]: all is in view, and seen from where it covers most of the picture.

    ``aspect`` is the width of the views over their height, at least 1.
    """
    points = np.concatenate([points_in_view(setup, q, t) for q, t in instants])
    size = float(np.ptp(points, axis=0).max())
    elevation = ELEVATION_FLAT if np.ptp(points[:, 2]) < 0.25 * size else ELEVATION
    azimuth = max(np.arange(-90.0, 91.0, 10.0), key=lambda azimuth: _area(points @ view_axes(elevation, azimuth)))
    axes = view_axes(elevation, azimuth)
    seen = points @ axes
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    across, up = 0.5 * np.ptp(seen, axis=0)[:2]
    return Viewpoint(axes @ middle, MARGIN * max(up, across / aspect) / IN_VIEW, elevation, float(azimuth))


def view_axes(elevation: float, azimuth: float) -> Array:
    """(3, 3) directions to the right, up and towards the viewer, as columns, for two angles [deg]."""
    e, a = np.deg2rad([elevation, azimuth])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    return np.stack((right, np.cross(towards, right), towards), axis=1)


def _area(seen: Array) -> float:
    """How much of a picture points (k, 3) cover, whose first two coordinates are across and up."""
    area: float = np.linalg.det(np.cov(seen[:, :2].T))
    return area
