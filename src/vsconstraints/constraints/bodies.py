"""Links of a robot and obstacles as solid bodies, for collision constraints."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from ..errors import ConfigurationError
from ..plugins.regular_files import read_regular
from ..robots.geometry import Pose, Vector3, vector
from ..robots.meshes import mesh_files, unit_of_mesh
from ..robots.robot import Robot
from ..rows import Array
from .base import require_positive
from .by_formula import Keyed
from .meshes import convex

#: A point that no joint moves faster than this counts as fixed [m per rad or m]; a link that is
#: shorter counts as a point [m].
FIXED = 1e-9
#: Convex solid with its placement in the frame of a joint.
PlacedSolid = tuple[pin.SE3, coal.CollisionGeometry]


@dataclass(frozen=True)
class Body:
    """Convex solids that move together, each with its placement in the frame of their joint.

    The name is used in labels. The joint is an index of the robot's model, 0 for a body that is
    fixed to the base.
    """

    name: str
    joint: int
    parts: tuple[PlacedSolid, ...]


def fixed_body(name: str, solid: coal.CollisionGeometry, pose: Pose) -> Body:
    """Return a solid that stands still at a pose in the base frame."""
    placement = pin.SE3(pose.R, pose.t)
    part = placement, convex(solid, name)
    return Body(name, 0, (part,))


def attached_body(
    robot: Robot, link: str, solid: coal.CollisionGeometry, pose: Pose, name: str = ""
) -> Body:
    """Return a solid fixed to a link, at a pose in that link's frame: a camera, a gripper."""
    name = name or link
    frame = robot.model.frames[robot.frame_id(link)]
    placement = frame.placement * pin.SE3(pose.R, pose.t)
    part = placement, convex(solid, name)
    return Body(name, int(frame.parentJoint), (part,))


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
    z = np.array([0.0, 0.0, 1.0])  # axis of coal's capsules
    for segment in segments(robot):
        if segment.length <= FIXED:
            continue
        direction = (segment.end - segment.start) / segment.length
        turn = pin.Quaternion.FromTwoVectors(z, direction)
        middle = 0.5 * (segment.start + segment.end)
        placement = pin.SE3(turn.matrix(), middle)
        part = placement, coal.Capsule(link_radius, segment.length)
        bodies[segment.link] = Body(segment.link, segment.joint, (part,))
    return tuple(bodies.values())


def _made_of(robot: Robot) -> tuple[object, ...]:
    """Return the inputs that determine a URDF arm's links: files with dates, and locked joints."""
    source = robot.source
    if source is None:
        return ()
    try:
        changed = source.path.stat().st_mtime_ns
        meshes = _meshes(source.path, source.package_dirs, changed)
        paths = (source.path, *meshes)
        files = tuple((path, path.stat().st_mtime_ns) for path in paths)
    except OSError:  # a missing file is reported where it is read
        files = ()
    locked = tuple(source.positions.tolist())
    return files, source.package_dirs, robot.joint_names, locked


@lru_cache(maxsize=16)
def _meshes(urdf: Path, folders: tuple[str, ...], changed: int) -> tuple[Path, ...]:
    """Return the mesh files of a URDF; ``changed`` is its date, so that a new file is read."""
    return tuple(mesh_files(urdf, folders))


@lru_cache(maxsize=16)
def _hulls(links: Keyed) -> tuple[Body, ...]:
    """Return the convex collision geometry of links.

    It is cached, because reading it takes as long as a run.
    """
    robot: Robot = links.of
    bodies: dict[str, Body] = {}
    for solid in robot.collision_geometry().geometryObjects:
        link = robot.model.frames[solid.parentFrame].name
        placement = pin.SE3(solid.placement)
        part = placement, convex(solid.geometry, solid.name)
        others = bodies[link].parts if link in bodies else ()
        joint = int(solid.parentJoint)
        bodies[link] = Body(link, joint, (*others, part))
    return tuple(bodies.values())


def mesh(file: str | Path, scale: Vector3 = (1.0, 1.0, 1.0)) -> coal.CollisionGeometry:
    """Return the convex hull of a mesh file, whose coordinates times ``scale`` are metres.

    A COLLADA file that specifies its unit of length is converted to metres before it is scaled.
    Raises ConfigurationError if the file cannot be read; the message names it.
    """
    if not Path(file).is_file():
        raise ConfigurationError(f"no mesh file at {str(file)!r}")
    try:
        factors = vector(scale, 3, "scale of a mesh")
        to_metres = unit_of_mesh(Path(file)) * factors
        loaded = coal.MeshLoader().load(str(file), to_metres)
    except (RuntimeError, ValueError) as error:
        raise ConfigurationError(f"{str(file)!r} cannot be read as a mesh: {error}") from error
    return convex(loaded, str(file))


def disabled_pairs(srdf: str | Path) -> frozenset[frozenset[str]]:
    """Return the pairs of links that an SRDF file exempts from collision checks.

    Raises ConfigurationError if it cannot be read.
    """
    try:
        root = ElementTree.fromstring(read_regular(srdf))
    except (OSError, ValueError, LookupError, ElementTree.ParseError) as error:
        raise ConfigurationError(f"{str(srdf)!r} cannot be read as an SRDF: {error}") from error
    pairs = set()
    for pair in root.iter("disable_collisions"):
        links = pair.get("link1", ""), pair.get("link2", "")
        pairs.add(frozenset(links))
    return frozenset(pairs)


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
    names: dict[int, str] = {}  # the first link of each joint
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY:
            names.setdefault(frame.parentJoint, frame.name)
    for joint in range(1, model.njoints):
        is_last = joint == model.njoints - 1
        following = tip.placement if is_last else model.jointPlacements[joint + 1]
        end = np.array(following.translation)
        joint_type = model.joints[joint].shortname()
        slides = joint_type.startswith("JointModelP")
        shared = joint > 1 and not slides
        link = names.get(joint, tip.name)
        yield Segment(link, joint, np.zeros(3), end, shared)
