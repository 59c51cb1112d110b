"""Links of a robot as solid bodies, for collision constraints, and as characteristic points.

Finitely many characteristic points represent the whole surface of the links (section 4.3.6).
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from ..errors import ConfigurationError, unknown_name
from ..plugins.regular_files import read_regular
from ..qp.decomposition import svd
from ..robots.geometry import Pose, Vector3, vector
from ..robots.kinematics import RobotPoint
from ..robots.meshes import mesh_files, unit_of_mesh
from ..robots.robot import Robot
from ..rows import Array
from .base import require_positive
from .by_formula import Keyed
from .meshes import convex, surface

#: Maximum number of points along a link: each is a row, and the number of patches that cover a
#: link's surface grows with its square.
MAX_POINTS = 60
FIXED = 1e-9  #: A point that no joint moves faster than this counts as fixed [m per rad or m].
#: Points (k, 3) of each link in its frame, and the distance of its surface from them [m].
Points = dict[str, tuple[Array, float]]


@dataclass(frozen=True)
class Body:
    """Convex solids that move together, each with its placement in the frame of their joint.

    The name is used in labels. The joint is an index of the robot's model, 0 for a body that is
    fixed to the base.
    """

    name: str
    joint: int
    parts: tuple[tuple[pin.SE3, coal.CollisionGeometry], ...]


def fixed_body(name: str, solid: coal.CollisionGeometry, pose: Pose) -> Body:
    """Return a solid that stands still at a pose in the base frame."""
    return Body(name, 0, ((pin.SE3(pose.R, pose.t), convex(solid, name)),))


def attached_body(
    robot: Robot, link: str, solid: coal.CollisionGeometry, pose: Pose, name: str = ""
) -> Body:
    """Return a solid fixed to a link, at a pose in that link's frame: a camera, a gripper."""
    frame = robot.model.frames[robot.frame_id(link)]
    placement = frame.placement * pin.SE3(pose.R, pose.t)
    return Body(name or link, int(frame.parentJoint), ((placement, convex(solid, name or link)),))


def link_bodies(robot: Robot, link_radius: float | None = None) -> tuple[Body, ...]:
    """Return one body for each link, from base to tip.

    Without ``link_radius``, the bodies are the URDF's collision geometry, made convex (see
    :func:`convex`). With it, they are capsules of that radius [m] around the straight lines between
    the joints' origins. Raises ConfigurationError if there is neither collision geometry nor a
    radius, or if a mesh cannot be read.
    """
    if link_radius is None:
        return _hulls(Keyed(_made_of(robot), robot))
    require_positive(link_radius, "radius of the links")
    bodies = {}
    for segment in segments(robot):
        if segment.length > FIXED:
            along = (segment.end - segment.start) / segment.length
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along).matrix()
            part = (
                pin.SE3(turn, 0.5 * (segment.start + segment.end)),
                coal.Capsule(link_radius, segment.length),
            )
            bodies[segment.link] = Body(segment.link, segment.joint, (part,))
    return tuple(bodies.values())


def _made_of(robot: Robot) -> tuple[object, ...]:
    """Return the inputs that determine a URDF arm's links: files with dates, and locked joints."""
    source = robot.source
    if source is None:
        return ()
    try:
        paths = (
            source.path,
            *_meshes(source.path, source.package_dirs, source.path.stat().st_mtime_ns),
        )
        files = tuple((path, path.stat().st_mtime_ns) for path in paths)
    except OSError:  # a missing file is reported where it is read
        files = ()
    return files, source.package_dirs, robot.joint_names, tuple(source.positions.tolist())


@lru_cache(maxsize=16)
def _meshes(urdf: Path, folders: tuple[str, ...], changed: int) -> tuple[Path, ...]:
    return tuple(mesh_files(urdf, folders))


@lru_cache(maxsize=16)
def _hulls(links: Keyed) -> tuple[Body, ...]:
    """Return the convex collision geometry of links.

    It is cached, because reading it takes as long as a run.
    """
    robot: Robot = links.of
    parts: dict[str, tuple[int, list[tuple[pin.SE3, coal.CollisionGeometry]]]] = {}
    for solid in robot.collision_geometry().geometryObjects:
        link = robot.model.frames[solid.parentFrame].name
        part = pin.SE3(solid.placement), convex(solid.geometry, solid.name)
        parts.setdefault(link, (int(solid.parentJoint), []))[1].append(part)
    return tuple(Body(link, joint, tuple(solids)) for link, (joint, solids) in parts.items())


def mesh(file: str | Path, scale: Vector3 = (1.0, 1.0, 1.0)) -> coal.CollisionGeometry:
    """Return the convex hull of a mesh file, whose coordinates times ``scale`` are metres.

    A COLLADA file that specifies its unit of length is converted to metres before it is scaled.
    Raises ConfigurationError if the file cannot be read; the message names it.
    """
    if not Path(file).is_file():
        raise ConfigurationError(f"no mesh file at {str(file)!r}")
    try:
        to_metres = unit_of_mesh(Path(file)) * vector(scale, 3, "scale of a mesh")
        read = coal.MeshLoader().load(str(file), to_metres)
    except (RuntimeError, ValueError) as error:
        raise ConfigurationError(f"{str(file)!r} cannot be read as a mesh: {error}") from error
    return convex(read, str(file))


def disabled_pairs(srdf: str | Path) -> frozenset[frozenset[str]]:
    """Return the pairs of links that an SRDF file exempts from collision checks.

    Raises ConfigurationError if it cannot be read.
    """
    try:
        root = ElementTree.fromstring(read_regular(srdf))
    except (OSError, ValueError, LookupError, ElementTree.ParseError) as error:
        raise ConfigurationError(f"{str(srdf)!r} cannot be read as an SRDF: {error}") from error
    pairs = root.iter("disable_collisions")
    return frozenset(frozenset((pair.get("link1", ""), pair.get("link2", ""))) for pair in pairs)


class LinkPoints(NamedTuple):
    """Characteristic points of a robot's links, link by link.

    Every point of a link's surface lies within the enlargement [m] of a characteristic point.
    Surface around points that were omitted because no joint moves them is an exception.
    """

    points: tuple[RobotPoint, ...]
    enlargement: float


def link_points(
    robot: Robot,
    *,
    spacing: float = 0.1,
    link_radius: float | None = None,
    links: Sequence[str] | None = None,
) -> LinkPoints:
    """Return characteristic points along a robot's links, with the enlargement of obstacles.

    Obstacles must be enlarged because points stand for the whole surface of a link.

    Without ``link_radius``, the links are the URDF's collision geometry. Each link is cut across
    its longest direction into slices as thick as the ``spacing`` [m], with a point in the middle of
    each. With ``link_radius``, the links are capsules of that radius [m] around the straight lines
    between the joints' origins (and the tip's), with points along these lines; the part that slides
    out of a prismatic joint is not covered. Links and points that no joint moves are omitted.
    ``links`` are the names of the links concerned, all if None.

    Raises ConfigurationError if there is neither collision geometry nor a radius, a mesh cannot be
    read, no point of a link moves, or a link would have more than :data:`MAX_POINTS` points.
    """
    require_positive(spacing, "spacing of points along the links")
    if link_radius is None:
        along = _along_geometry(robot, spacing)
    else:
        require_positive(link_radius, "radius of the links")
        along = _along_segments(robot, spacing, link_radius, links)
    for link in links or ():
        if link not in along:
            raise unknown_name(f"link with characteristic points of {robot.name}", link, along)
    if links is not None:
        along = {link: along[link] for link in along if link in links}
    points: list[RobotPoint] = []
    enlargement = 0.0
    for link, (offsets, reach) in along.items():
        own = [point for point in _points(link, offsets) if _moves(robot, point)]
        if own:
            enlargement = max(enlargement, reach)
        points += [
            RobotPoint(link, point.offset, f"{link} point {i}" if len(own) > 1 else link)
            for i, point in enumerate(own, start=1)
        ]
    if not points:
        raise ConfigurationError(
            f"no joint of {robot.name} moves a point of the links {', '.join(along) or 'it has'}"
        )
    return LinkPoints(tuple(points), enlargement)


def _points(link: str, offsets: Array) -> list[RobotPoint]:
    return [RobotPoint(link, (float(x), float(y), float(z))) for x, y, z in offsets]


def _moves(robot: Robot, point: RobotPoint) -> bool:
    rng = np.random.default_rng(0)
    qs = rng.uniform(-1.0, 1.0, (3, robot.n))
    return max(float(np.abs(robot.kinematics(q, q, [point]).point_J).max()) for q in qs) > FIXED


def _require_few(link: str, length: float, spacing: float) -> None:
    if length > MAX_POINTS * spacing:
        raise ConfigurationError(
            f"spacing of points along the links: {link} is {length:.3g} m long, "
            f"{length / spacing:.3g} points with a "
            f"spacing of {spacing:g} m; a link may have {MAX_POINTS}"
        )


class Segment(NamedTuple):
    """Straight part of a link between two joints' origins.

    It leads from start to end (3,) [m], in the axes of its joint. ``link`` is the name of a frame
    that moves with it. ``shared`` is true if the start is the end of the previous link in every
    configuration.
    """

    link: str
    joint: int
    start: Array
    end: Array
    shared: bool

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(np.linalg.norm(self.end - self.start))


def segments(robot: Robot) -> Iterator[Segment]:
    """Yield the straight lines between joints' origins, from base to tip.

    The last one ends at the tip.
    """
    model = robot.model
    tip = model.frames[robot.frame_id("tip")]
    for joint in range(1, model.njoints):
        last = joint == model.njoints - 1
        end = np.array(
            tip.placement.translation if last else model.jointPlacements[joint + 1].translation
        )
        link = next(
            (
                f.name
                for f in model.frames
                if f.parentJoint == joint and f.type == pin.FrameType.BODY
            ),
            tip.name,
        )
        slides = model.joints[joint].shortname().startswith("JointModelP")
        yield Segment(link, joint, np.zeros(3), end, joint > 1 and not slides)


def _along_segments(
    robot: Robot, spacing: float, radius: float, links: Sequence[str] | None
) -> Points:
    along: Points = {}
    # true if the last point of a selected link is also the first of the next one, which then needs
    # no second point there
    covered = False
    for segment in segments(robot):
        covered = covered and segment.shared
        if segment.length < FIXED:
            continue
        _require_few(segment.link, segment.length, spacing)
        count = int(np.ceil(segment.length / spacing - 1e-9))
        parts = np.arange(1 if covered else 0, count + 1) / count
        covered = links is None or segment.link in links
        inverse = robot.model.frames[robot.model.getFrameId(segment.link)].placement.inverse()
        start = np.asarray(inverse.act(segment.start))
        end = np.asarray(inverse.act(segment.end))
        reach = float(np.hypot(radius, 0.5 * (segment.length / count)))
        along[segment.link] = (start + parts[:, None] * (end - start), reach)
    return along


def _along_geometry(robot: Robot, spacing: float) -> Points:
    patches: dict[str, list[tuple[Array, float]]] = {}
    for body in robot.collision_geometry().geometryObjects:
        if body.parentJoint == 0:
            continue
        frame = robot.model.frames[body.parentFrame]
        placement = frame.placement.inverse() * body.placement
        R = np.array(placement.rotation)
        t = np.array(placement.translation)
        body.geometry.computeLocalAABB()
        box = body.geometry.aabb_local
        _require_few(frame.name, float(np.max(box.max_ - box.min_)), spacing)
        corners, slack = surface(body.geometry, 0.5 * spacing)
        patches.setdefault(frame.name, []).append((corners @ R.T + t, slack))
    along: Points = {}
    for link, own in patches.items():
        # the fewest slices whose middles all move: a wrist's middle may stand still where its axes
        # meet
        options = (_slices(own, spacing, more) for more in range(3))
        moving = (
            each
            for each in options
            if all(_moves(robot, point) for point in _points(link, each[0]))
        )
        along[link] = next(moving, None) or _slices(own, spacing, 0)
    return along


def _slices(patches: list[tuple[Array, float]], spacing: float, more: int) -> tuple[Array, float]:
    """Return points (k, 3) in the middle of slices across the longest direction, and their reach.

    The reach is the distance of the surface from the points. ``more`` is the number of slices
    beyond those that the spacing requires.
    """
    vertices = np.concatenate([corners.reshape(-1, 3) for corners, _ in patches])
    middle = vertices.mean(axis=0)
    from_middle = vertices - middle
    axes: Array = np.eye(3)
    if len(vertices) > 1:
        axes = svd(from_middle, full_matrices=False)[2]
    # coordinates along the principal axes
    x = from_middle @ axes.T
    low = x.min(axis=0)
    extent = x.max(axis=0) - low
    main = int(np.argmax(extent))
    length = extent[main]
    required = max(1, int(np.ceil(length / spacing)))
    count = required + more
    part = (x[:, main] - low[main]) / max(length, 1e-300)
    slice_of = np.minimum((part * count).astype(int), count - 1)
    centres = []
    for i in np.unique(slice_of):
        inside = x[slice_of == i]
        lowest = inside.min(axis=0)
        highest = inside.max(axis=0)
        centres.append(0.5 * (lowest + highest))
    points: Array = np.array(centres) @ axes + middle
    reaches = [_distance_to_nearest(corners, points) + slack for corners, slack in patches]
    return points, max(reaches)


def _distance_to_nearest(patches: Array, points: Array) -> float:
    """Return the greatest distance of patches (p, c, 3) from the point nearest to each.

    The distance to one point is convex: on a patch it is largest at a corner.
    """
    distances = np.linalg.norm(patches[:, :, None] - points, axis=3)
    of_patches = distances.max(axis=1).min(axis=1)
    return float(of_patches.max())
