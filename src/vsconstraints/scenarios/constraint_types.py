"""Constraints as scenario files describe them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, cast, get_args

import coal
import numpy as np

from ..camera import Camera
from ..constraints import (
    Body,
    Collision,
    Constraint,
    Curve,
    FieldOfView,
    ForbiddenBox,
    ForbiddenCapsule,
    ForbiddenCylinder,
    ForbiddenHalfSpace,
    ForbiddenSphere,
    JointRange,
    JointSpeed,
    Manipulability,
    Occlusion,
    SelfCollision,
    attached_body,
    fixed_body,
    link_bodies,
    link_points,
    mesh,
)
from ..constraints.base import PositionConstraint
from ..constraints.curves import SHAPES, shape
from ..constraints.manipulability import Part
from ..errors import ConfigurationError, VsconstraintsError, described, shown, unknown_name
from ..geometry import Pose
from ..kinematics import RobotPoint
from ..plugins import imported_class
from ..robot import Robot
from .motion_tables import read_motion
from .section import Section


def make_constraint(section: Section, robot: Robot, camera: Camera, folder: Path) -> Constraint:
    """The constraint that a table describes; raises ConfigurationError for unknown types and keys."""
    motion = read_motion(section.section("motion")) if "motion" in section else None
    constraint = _make(section, robot, camera, folder)
    if motion is None:
        return constraint
    if not isinstance(constraint, PositionConstraint):
        raise ConfigurationError(
            f"{section.where}: {constraint.kind} cannot move; what can are obstacles in the image and forbidden regions"
        )
    return constraint.moving(motion)


def _make(section: Section, robot: Robot, camera: Camera, folder: Path) -> Constraint:
    kind = section.take("type", str)
    if ":" in kind:
        own = imported_class(kind, Constraint, folder)
        options = section.rest()
        try:
            return own(**options)
        except VsconstraintsError:
            raise
        except (Exception, SystemExit) as error:  # an own constraint may fail in any way
            raise ConfigurationError(
                f"{section.where}: {kind} cannot be made with {shown(options)}: {described(error)}"
            ) from error
    if kind not in CONSTRAINTS:
        raise unknown_name(f"type in {section.where}", kind, [*CONSTRAINTS, "module:Class"])
    if kind in WITH_FILES:
        constraint = WITH_FILES[kind](section, robot, camera, folder)
    else:
        constraint = CONSTRAINTS[kind](section, robot, camera)
    section.finish()
    return constraint


def _field_of_view(section: Section, robot: Robot, camera: Camera) -> Constraint:
    """Markers stay inside a hyperellipse in the image."""
    return FieldOfView(
        camera,
        K=section.number("K"),
        switching_gain=section.number("switching_gain"),
        margin=section.number("margin", None),
        margin_px=section.number("margin_px", None),
        n=section.number("n", 16.0),
        markers=section.take("markers", list, None),
    )


def _occlusion(section: Section, robot: Robot, camera: Camera) -> Constraint:
    """Markers stay outside an implicit curve in the image."""
    curve = section.section("curve")
    kind = curve.choice("shape", SHAPES)
    centre = curve.array("centre_px", np.zeros(2), (2,))
    rotation = float(curve.number("rotation", 0.0))
    parameters = curve.numbers()
    try:
        outline = shape(kind, **parameters)
    except TypeError as error:
        raise ConfigurationError(f"{curve.where}: {error}") from error
    return Occlusion(
        Curve(outline, centre, rotation),
        K=section.number("K"),
        switching_gain=section.number("switching_gain"),
        margin=section.number("margin", 0.0),
        name=section.take("name", str, ""),
        markers=section.take("markers", list, None),
    )


def _joint_range(section: Section, robot: Robot, camera: Camera) -> Constraint:
    """Joints stay in their ranges, the robot's or given ones."""
    return JointRange(
        robot,
        K=section.number("K"),
        switching_gain=section.number("switching_gain"),
        joints=section.take("joints", list, None),
        lower=section.array("lower", None),
        upper=section.array("upper", None),
        margin=section.number("margin", 0.0),
    )


def _joint_speed(section: Section, robot: Robot, camera: Camera) -> Constraint:
    """Joints stay below their speeds, the robot's or given ones."""
    return JointSpeed(
        robot,
        switching_gain=section.number("switching_gain"),
        joints=section.take("joints", list, None),
        lower=section.array("lower", None),
        upper=section.array("upper", None),
        margin=section.number("margin", 0.0),
    )


def _forbidden_sphere(section: Section, robot: Robot, camera: Camera) -> Constraint:
    """Robot points stay out of a sphere."""
    return ForbiddenSphere(
        centre=section.array("centre", shape=(3,)), radius=section.number("radius"), **_region(section, robot)
    )


def _forbidden_box(section: Section, robot: Robot, camera: Camera) -> Constraint:
    """Robot points stay out of a box, also a turned one."""
    return ForbiddenBox(
        centre=section.array("centre", shape=(3,)),
        size=section.array("size", shape=(3,)),
        rpy=section.array("rpy", np.zeros(3), (3,)),
        **_region(section, robot),
    )


def _forbidden_cylinder(section: Section, robot: Robot, camera: Camera) -> Constraint:
    """Robot points stay out of a cylinder with flat ends."""
    return ForbiddenCylinder(
        start=section.array("start", shape=(3,)),
        end=section.array("end", shape=(3,)),
        radius=section.number("radius"),
        **_region(section, robot),
    )


def _forbidden_capsule(section: Section, robot: Robot, camera: Camera) -> Constraint:
    """Robot points stay out of a cylinder with round ends."""
    return ForbiddenCapsule(
        start=section.array("start", shape=(3,)),
        end=section.array("end", shape=(3,)),
        radius=section.number("radius"),
        **_region(section, robot),
    )


def _forbidden_half_space(section: Section, robot: Robot, camera: Camera) -> Constraint:
    """Robot points stay on one side of a plane: above a table, before a wall."""
    return ForbiddenHalfSpace(
        point=section.array("point", shape=(3,)),
        normal=section.array("normal", shape=(3,)),
        length=section.number("length", 0.1),
        **_region(section, robot),
    )


def _region(section: Section, robot: Robot) -> dict[str, Any]:
    """What all forbidden regions share; ``points = "links"`` stands for points along the links."""
    points, enlargement = _points(section, robot)
    return {
        "K": section.number("K"),
        "switching_gain": section.number("switching_gain"),
        "margin": section.number("margin", 0.0) + enlargement,
        "robot_points": points,
        "name": section.take("name", str, ""),
    }


def _points(section: Section, robot: Robot) -> tuple[tuple[RobotPoint, ...], float]:
    """The points concerned, and by how much an obstacle must be enlarged for them [m]."""
    value = section.take("points", (list, str), [])
    if isinstance(value, list):
        tables = [Section(table, f"{section.where}.points[{i}]") for i, table in enumerate(value)]
        return tuple(map(_point, tables)) or (RobotPoint(),), 0.0
    if value != "links":
        raise ConfigurationError(f'{section.where}: points must be a list of tables, or "links", not {shown(value)}')
    along = link_points(
        robot,
        spacing=section.number("spacing", 0.1),
        radius=section.number("link_radius", None),
        links=section.take("links", list, None),
    )
    return along.points, along.enlargement


def _manipulability(section: Section, robot: Robot, camera: Camera) -> Constraint:
    """The arm stays away from singular configurations."""
    return Manipulability(
        robot,
        minimum=section.number("minimum"),
        K=section.number("K"),
        switching_gain=section.number("switching_gain"),
        scale=section.number("scale", None),
        part=cast("Part", section.choice("part", get_args(Part), "pose")),
    )


def _collision(section: Section, robot: Robot, camera: Camera, folder: Path = Path()) -> Constraint:
    """Bodies of the robot keep clear of an obstacle; bodies are those of the URDF, capsules, or given ones."""
    obstacle = section.section("obstacle")
    solid, pose = _solid(obstacle, folder)
    obstacle.finish()
    return Collision(
        robot,
        _bodies(section, robot, folder),
        fixed_body(section.take("name", str, ""), solid, pose),
        links=section.take("links", list, None),
        **_distance(section),
    )


def _self_collision(section: Section, robot: Robot, camera: Camera, folder: Path = Path()) -> Constraint:
    """Bodies of the robot keep clear of each other; bodies are those of the URDF, capsules, or given ones."""
    srdf = section.take("srdf", str, None)
    return SelfCollision(
        robot,
        _bodies(section, robot, folder),
        pairs=section.take("pairs", list, None),
        srdf=None if srdf is None else folder / srdf,
        **_distance(section),
    )


def _distance(section: Section) -> dict[str, Any]:
    return {
        "K": section.number("K"),
        "switching_gain": section.number("switching_gain"),
        "margin": section.number("margin", 0.0),
        "length": section.number("length", 0.1),
    }


def _bodies(section: Section, robot: Robot, folder: Path) -> tuple[Body, ...]:
    """The links' own bodies, if there are any, and the given ones."""
    given = []
    for table in section.sections("bodies"):
        solid, pose = _solid(table, folder)
        given.append(attached_body(robot, table.take("link", str, "tip"), solid, pose, table.take("name", str, "")))
        table.finish()
    radius = section.number("link_radius", None)
    if given and radius is None and robot.source is None:
        return tuple(given)
    return (*link_bodies(robot, radius), *given)


def _solid(section: Section, folder: Path) -> tuple[coal.CollisionGeometry, Pose]:
    """A solid and its pose."""
    kind = section.choice("shape", SOLIDS)
    pose = Pose.from_xyz_rpy(section.array("xyz", np.zeros(3), (3,)), section.array("rpy", np.zeros(3), (3,)))
    if kind == "half-space":
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), pose
    if kind == "mesh":
        return mesh(folder / section.take("file", str), section.array("scale", np.ones(3), (3,))), pose
    keys = SOLIDS[kind]
    sizes = section.array("size", shape=(3,)) if kind == "box" else np.array([section.number(key) for key in keys])
    if (sizes <= 0.0).any():
        raise ConfigurationError(f"{section.where}: {', '.join(keys)} must be positive, not {sizes}")
    make = {"box": coal.Box, "sphere": coal.Sphere, "capsule": coal.Capsule, "cylinder": coal.Cylinder}[kind]
    return make(*map(float, sizes)), pose


def _point(section: Section) -> RobotPoint:
    x, y, z = section.array("offset", np.zeros(3), (3,))
    point = RobotPoint(section.take("link", str, "tip"), (float(x), float(y), float(z)), section.take("name", str, ""))
    section.finish()
    return point


CONSTRAINTS: dict[str, Callable[[Section, Robot, Camera], Constraint]] = {
    "field-of-view": _field_of_view,
    "occlusion": _occlusion,
    "joint-range": _joint_range,
    "joint-speed": _joint_speed,
    "forbidden-sphere": _forbidden_sphere,
    "forbidden-box": _forbidden_box,
    "forbidden-cylinder": _forbidden_cylinder,
    "forbidden-capsule": _forbidden_capsule,
    "forbidden-half-space": _forbidden_half_space,
    "manipulability": _manipulability,
    "collision": _collision,
    "self-collision": _self_collision,
}
"""What makes a constraint of each type that scenario files know; others are named as ``module:Class``."""

WITH_FILES: dict[str, Callable[[Section, Robot, Camera, Path], Constraint]] = {
    "collision": _collision,
    "self-collision": _self_collision,
}
"""Those of them that name files, relative to the scenario's folder."""

SOLIDS: dict[str, tuple[str, ...]] = {
    "box": ("size",),
    "sphere": ("radius",),
    "capsule": ("radius", "length"),
    "cylinder": ("radius", "length"),
    "half-space": (),
    "mesh": ("file",),
}
"""Solids of collision constraints and what gives their size; lengths are along z, a half-space is below its z = 0."""
