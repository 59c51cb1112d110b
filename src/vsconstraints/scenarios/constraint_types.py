"""Constraints in scenario files: the keys of a type are the arguments of its class."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from inspect import Parameter
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import coal
import msgspec
import numpy as np

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
    PerformanceFunnel,
    SelfCollision,
    attached_body,
    fixed_body,
    link_bodies,
    link_points,
    mesh,
)
from ..constraints.base import PositionConstraint
from ..constraints.curves import SHAPES, Shape
from ..errors import ConfigurationError, VsconstraintsError, described, format_value
from ..plugins.classes import imported_class
from ..robots.geometry import Pose
from ..robots.kinematics import RobotPoint
from ..robots.robot import Robot
from ..vision.camera import Camera
from ..vision.features import Goal
from ..vision.motion import Motion
from .reading import (
    Context,
    Table,
    checked,
    chosen,
    from_table,
    parameters,
    placed,
    require_known,
    require_table,
    split,
    takes_any,
)

#: Constructor of each constraint type in scenario files; custom types are ``module:Class``.
CONSTRAINTS: dict[str, Callable[..., Constraint]] = {
    "field-of-view": FieldOfView,
    "occlusion": Occlusion,
    "joint-range": JointRange,
    "joint-speed": JointSpeed,
    "forbidden-sphere": ForbiddenSphere,
    "forbidden-box": ForbiddenBox,
    "forbidden-cylinder": ForbiddenCylinder,
    "forbidden-capsule": ForbiddenCapsule,
    "forbidden-half-space": ForbiddenHalfSpace,
    "manipulability": Manipulability,
    "collision": Collision,
    "self-collision": SelfCollision,
    "performance-funnel": PerformanceFunnel,
}


def make_constraint(
    table: object,
    where: str,
    robot: Robot,
    camera: Camera,
    folder: Path,
    goals: Sequence[Goal] = (),
) -> Constraint:
    """Return the constraint that a table describes.

    Raises ConfigurationError for unknown types and keys.
    """
    values = require_table(table, where)
    motion = None
    if "motion" in values:
        motion = from_table(Motion, values.pop("motion"), f"{where}.motion")
    kind = values.get("type")
    is_custom = isinstance(kind, str) and ":" in kind
    if is_custom:
        make: Callable[..., Constraint] = imported_class(values.pop("type"), Constraint, folder)
    else:
        make = chosen(values, "type", CONSTRAINTS, where, others=["module:Class"])
    context = {"robot": robot, "camera": camera, "folder": folder, "goals": goals}
    if not takes_any(make):
        require_known(values, ["type", "motion", *keys(make)], where)
    try:
        arguments = {name: value for name, value in context.items() if name not in values}
        for step in _steps(make):
            arguments |= step.take(values, where, context)
        constraint = from_table(make, values, where, arguments)
    except VsconstraintsError:
        raise
    except (Exception, SystemExit) as error:  # a custom constraint may raise anything
        if not is_custom:
            raise
        raise ConfigurationError(
            f"{where}: {kind} cannot be made with {format_value(values)}: {described(error)}"
        ) from error
    if motion is None:
        return constraint
    if not isinstance(constraint, PositionConstraint):
        raise ConfigurationError(
            f"{where}: {constraint.kind} cannot move; only obstacles in the image and forbidden "
            "regions can"
        )
    return constraint.moving(motion)


def keys(make: Callable[..., Constraint]) -> dict[str, Parameter]:
    """Return the keys of a constraint's table as parameters, with annotations and defaults."""
    found = {}
    for name, key in parameters(make).items():
        is_optional = key.annotation in STEPS and not STEPS[key.annotation].required
        found[name] = key.replace(default=()) if is_optional else key
    for step in _steps(make):
        for made in step.makes:
            for name, key in parameters(made).items():
                found.setdefault(name, key)
    return {
        name: key
        for name, key in found.items()
        if name not in ("robot", "camera", "folder", "goals")
    }


class Step(NamedTuple):
    """Construction of an argument whose type a file cannot hold.

    ``take`` removes the keys from a table and returns the arguments. The signatures of ``makes``
    declare further keys.
    """

    take: Callable[[Table, str, Context], dict[str, Any]]
    makes: tuple[Callable[..., Any], ...] = ()
    required: bool = True


def _steps(make: Callable[..., Constraint]) -> list[Step]:
    annotations = [parameter.annotation for parameter in parameters(make).values()]
    return [STEPS[annotation] for annotation in annotations if annotation in STEPS]


def _curve(table: Table, where: str, context: Context) -> dict[str, Any]:
    curve, place = _inner(table, "curve", where)
    kind = chosen(curve, "shape", SHAPES, place)
    of_shape, of_curve = split(curve, place, kind, Curve, without=["shape"])
    shape = from_table(kind, of_shape, place)
    return {"curve": from_table(Curve, of_curve, place, {"shape": shape})}


def _points(table: Table, where: str, context: Context) -> dict[str, Any]:
    """Return robot points from a list or along the links.

    For points along the links, the margin of obstacles is increased by the enlargement that
    ``link_points`` returns.
    """
    points = table.pop("points", [])
    if isinstance(points, str) and points != "links":
        raise ConfigurationError(
            f'{where}: points must be a list of tables, or "links", not {format_value(points)}'
        )
    if not isinstance(points, str):
        listed = tuple(checked(points, Sequence[RobotPoint], where, "points"))
        return {"points": listed or (RobotPoint(),)}
    along = from_table(link_points, _taken(table, link_points), where, context)
    margin = checked(table.pop("margin", 0.0), float, where, "margin")
    return {"points": along.points, "margin": margin + along.enlargement}


def _bodies(table: Table, where: str, context: Context) -> dict[str, Any]:
    """Return the bodies of the table and any collision bodies of the links."""
    robot = context["robot"]
    bodies = []
    tables = checked(table.pop("bodies", []), list[Any], where, "bodies")
    for i, value in enumerate(tables):
        place = f"{where}.bodies[{i}]"
        body = require_table(value, place)
        solid, pose, (link, name) = _solid(body, place, context, attached)
        bodies.append(attached_body(robot, link, solid, pose, name))
    of_links = _taken(table, link_bodies)
    if not bodies or of_links or robot.source is not None:
        bodies = [*from_table(link_bodies, of_links, where, context), *bodies]
    return {"bodies": tuple(bodies)}


def _obstacle(table: Table, where: str, context: Context) -> dict[str, Any]:
    """Return the obstacle of the table as a body."""
    obstacle, place = _inner(table, "obstacle", where)
    solid, pose, _ = _solid(obstacle, place, context, lambda: None)
    name = checked(table.pop("name", ""), str, where, "name")
    return {"obstacle": fixed_body(name, solid, pose)}


def attached(link: str = "tip", name: str = "") -> tuple[str, str]:
    """Return the link that a body is attached to, and the name of the body."""
    return link, name


def named(name: str = "") -> str:
    """Return the name of an obstacle."""
    return name


def _solid(
    table: Table, where: str, context: Context, further: Callable[..., Any]
) -> tuple[coal.CollisionGeometry, Pose, Any]:
    """Return the solid of a table, its pose, and what ``further`` makes of its other keys."""
    kind = chosen(table, "shape", SOLIDS, where)
    of_solid, of_pose, rest = split(table, where, kind, placed, further)
    solid = from_table(kind, of_solid, where, {"folder": context["folder"]})
    return solid, from_table(placed, of_pose, where), from_table(further, rest, where)


def _taken(table: Table, make: Callable[..., Any]) -> Table:
    """Remove the parameters of a function from a table, and return them."""
    return {key: table.pop(key) for key in parameters(make) if key in table}


def _inner(table: Table, key: str, where: str) -> tuple[Table, str]:
    """Remove a table from a table, and return it with its name in messages."""
    if key not in table:
        raise ConfigurationError(f"{where}: the key {key!r} is missing")
    return require_table(table.pop(key), f"{where}.{key}"), f"{where}.{key}"


Positive = Annotated[float, msgspec.Meta(gt=0.0)]


def _half_space() -> coal.CollisionGeometry:
    return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)


def _box(
    size: Annotated[Sequence[Positive], msgspec.Meta(min_length=3, max_length=3)],
) -> coal.CollisionGeometry:
    return coal.Box(*size)


def _sphere(radius: Positive) -> coal.CollisionGeometry:
    return coal.Sphere(radius)


def _capsule(radius: Positive, length: Positive) -> coal.CollisionGeometry:
    return coal.Capsule(radius, length)


def _cylinder(radius: Positive, length: Positive) -> coal.CollisionGeometry:
    return coal.Cylinder(radius, length)


#: Solids of collision constraints; lengths are along z, a half-space fills z < 0.
SOLIDS: dict[str, Callable[..., coal.CollisionGeometry]] = {
    "box": _box,
    "sphere": _sphere,
    "capsule": _capsule,
    "cylinder": _cylinder,
    "half-space": _half_space,
    "mesh": mesh,
}
#: Steps by the annotation of an argument that a file cannot hold as a value.
STEPS: dict[Any, Step] = {
    Curve | Shape: Step(_curve),
    Sequence[RobotPoint]: Step(_points, (link_points,), required=False),
    Sequence[Body]: Step(_bodies, (link_bodies,), required=False),
    Body: Step(_obstacle, (named,)),
}
