"""Solid bodies that move with a robot's links, or stand still: what collision constraints measure between."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

from ..errors import ConfigurationError
from ..robots.geometry import Pose, Vector3, vector
from ..robots.meshes import mesh_files
from ..robots.robot import Robot
from .base import demand_positive
from .by_formula import Keyed
from .link_points import FIXED, segments
from .meshes import convex


@dataclass(frozen=True)
class Body:
    """Convex solids that move together, each with its placement in the frame of the joint that moves them.

    The name is used in labels; the joint is an index of the robot's model, 0 if the body stands still in the base.
    """

    name: str
    joint: int
    parts: tuple[tuple[pin.SE3, coal.CollisionGeometry], ...]


def fixed_body(name: str, solid: coal.CollisionGeometry, pose: Pose) -> Body:
    """A solid that stands still at a pose in the base frame."""
    return Body(name, 0, ((pin.SE3(pose.R, pose.t), convex(solid, name)),))


def attached_body(robot: Robot, link: str, solid: coal.CollisionGeometry, pose: Pose, name: str = "") -> Body:
    """A solid fixed to a link, at a pose in that link's frame: a camera, a gripper."""
    frame = robot.model.frames[robot.frame_id(link)]
    placement = frame.placement * pin.SE3(pose.R, pose.t)
    return Body(name or link, int(frame.parentJoint), ((placement, convex(solid, name or link)),))


def link_bodies(robot: Robot, link_radius: float | None = None) -> tuple[Body, ...]:
    """One body for each link, from base to tip.

    Without ``link_radius`` from the URDF's collision geometry, made convex (see :func:`convex`). With it capsules of
    that radius [m] around the straight lines between the joints' origins. Raises ConfigurationError if there is no
    collision geometry and no radius, or a mesh cannot be read.
    """
    if link_radius is None:
        return _hulls(Keyed(_made_of(robot), robot))
    demand_positive(link_radius, "radius of the links")
    bodies = {}
    for segment in segments(robot):
        if segment.length > FIXED:
            along = (segment.end - segment.start) / segment.length
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along).matrix()
            part = pin.SE3(turn, 0.5 * (segment.start + segment.end)), coal.Capsule(link_radius, segment.length)
            bodies[segment.link] = Body(segment.link, segment.joint, (part,))
    return tuple(bodies.values())


def _made_of(robot: Robot) -> tuple[object, ...]:
    """What a URDF arm's links depend on: its files with their dates, and the joints that are locked."""
    source = robot.source
    if source is None:
        return ()
    try:
        paths = source.path, *_meshes(source.path, source.package_dirs, source.path.stat().st_mtime_ns)
        files = tuple((path, path.stat().st_mtime_ns) for path in paths)
    except OSError:  # gone, which is said where it is read
        files = ()
    return files, source.package_dirs, robot.joint_names, tuple(source.positions.tolist())


@lru_cache(maxsize=16)
def _meshes(urdf: Path, folders: tuple[str, ...], changed: int) -> tuple[Path, ...]:
    return tuple(mesh_files(urdf, folders))


@lru_cache(maxsize=16)
def _hulls(links: Keyed) -> tuple[Body, ...]:
    """The collision geometry of links, made convex: read once, since reading takes as long as a run."""
    robot: Robot = links.of
    parts: dict[str, tuple[int, list[tuple[pin.SE3, coal.CollisionGeometry]]]] = {}
    for solid in robot.collision_geometry().geometryObjects:
        link = robot.model.frames[solid.parentFrame].name
        part = pin.SE3(solid.placement), convex(solid.geometry, solid.name)
        parts.setdefault(link, (int(solid.parentJoint), []))[1].append(part)
    return tuple(Body(link, joint, tuple(solids)) for link, (joint, solids) in parts.items())


def mesh(file: str | Path, scale: Vector3 = (1.0, 1.0, 1.0)) -> coal.CollisionGeometry:
    """The convex hull of a mesh file [m after scaling]; raises ConfigurationError that names a file it cannot read."""
    if not Path(file).is_file():
        raise ConfigurationError(f"no mesh file at {str(file)!r}")
    try:
        read = coal.MeshLoader().load(str(file), vector(scale, 3, "scale of a mesh"))
    except (RuntimeError, ValueError) as error:
        raise ConfigurationError(f"{str(file)!r} cannot be read as a mesh: {error}") from error
    return convex(read, str(file))


def disabled_pairs(srdf: str | Path) -> frozenset[frozenset[str]]:
    """Pairs of links that an SRDF file says need no check; raises ConfigurationError if it cannot be read."""
    try:
        root = ElementTree.parse(srdf).getroot()
    except (OSError, ElementTree.ParseError) as error:
        raise ConfigurationError(f"{str(srdf)!r} cannot be read as an SRDF: {error}") from error
    pairs = root.iter("disable_collisions")
    return frozenset(frozenset((pair.get("link1", ""), pair.get("link2", ""))) for pair in pairs)
