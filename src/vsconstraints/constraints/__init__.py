"""Constraints as labelled rows φ ≤ 0."""

from .base import Constraint, RowBlock, Trace
from .bodies import Body, attached_body, fixed_body, link_bodies, mesh
from .characteristic_points import LinkPoints, link_points
from .collision import BodyDistance, Collision, SelfCollision
from .constraint_set import ConstraintSet, robot_points
from .curves import Bowl, Circle, Curve, Heart, Hyperellipse, Occlusion, Shape
from .field_of_view import FieldOfView
from .image_constraint import ImageConstraint
from .joint_limits import JointConstraint, JointRange, JointSpeed, SpeedConstraint
from .manipulability import Manipulability
from .meshes import Mesh
from .performance_funnel import PerformanceFunnel
from .regions import (
    ForbiddenBox,
    ForbiddenCapsule,
    ForbiddenCylinder,
    ForbiddenHalfSpace,
    ForbiddenRegion,
    ForbiddenSphere,
    PointConstraint,
)

__all__ = [
    "Body",
    "BodyDistance",
    "Bowl",
    "Circle",
    "Collision",
    "Constraint",
    "ConstraintSet",
    "Curve",
    "FieldOfView",
    "ForbiddenBox",
    "ForbiddenCapsule",
    "ForbiddenCylinder",
    "ForbiddenHalfSpace",
    "ForbiddenRegion",
    "ForbiddenSphere",
    "Heart",
    "Hyperellipse",
    "ImageConstraint",
    "JointConstraint",
    "JointRange",
    "JointSpeed",
    "LinkPoints",
    "Manipulability",
    "Mesh",
    "Occlusion",
    "PerformanceFunnel",
    "PointConstraint",
    "RowBlock",
    "SelfCollision",
    "Shape",
    "SpeedConstraint",
    "Trace",
    "attached_body",
    "fixed_body",
    "link_bodies",
    "link_points",
    "mesh",
    "robot_points",
]
