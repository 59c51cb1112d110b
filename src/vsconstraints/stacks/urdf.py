"""A robot as URDF text: the chain of its joints, with their limits and bodies, without meshes."""

from __future__ import annotations

from itertools import combinations_with_replacement
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import pinocchio as pin

from ..robots.robot import Robot
from ..rows import Array

BASE = "base"  #: Name of the link that does not move.
TIP = "tip"  #: Name of the link at the tip.
#: Limits of a joint that has none [rad or m, rad/s or m/s, Nm or N]; URDF demands numbers.
UNLIMITED = 1e6
#: Mass [kg] and moment of inertia [kg m²] of a body whose mass is unknown: engines of dynamics
#: refuse bodies without mass, and kinematics do not depend on it.
UNKNOWN_MASS = 1.0
UNKNOWN_INERTIA = 0.01
AXES = "xyz"


def urdf_text(robot: Robot, limits: tuple[Array, Array, Array] | None = None) -> str:
    """Return the URDF of a robot whose joints keep their names and order.

    ``limits`` are lower and upper ends of ranges and greatest speeds, (n,) each, instead of the
    robot's :attr:`~.Robot.ranges`.

    Fixed and locked joints are merged, so that the text has exactly n joints and one fixed joint to
    the tip. Links are ``base``, ``link 1`` to ``link n`` and ``tip``. Continuous joints are
    revolute joints with a range that never ends, so that every library gives each one coordinate.
    """
    model = robot.model
    ranges = robot.ranges if limits is None else limits
    root = Element("robot", name=robot.name)
    SubElement(root, "link", name=BASE)
    parent = BASE
    for i, name in enumerate(robot.joint_names):
        number = i + 1  # in the model, whose joint 0 is the universe
        link = f"link {number}"
        kind = "prismatic" if robot.prismatic[i] else "revolute"
        joint = _joint(root, name, kind, parent, link, model.jointPlacements[number])
        SubElement(joint, "axis", xyz=_numbers(robot.axes[i]))
        SubElement(joint, "limit", _limits(robot, i, ranges))
        _body(root, link, model.inertias[number])
        parent = link
    frame = model.frames[robot.frame_id("tip")]
    _joint(root, "tip joint", "fixed", parent, TIP, frame.placement)
    SubElement(root, "link", name=TIP)
    indent(root)
    return tostring(root, encoding="unicode")


def _joint(
    root: Element, name: str, kind: str, parent: str, child: str, placement: pin.SE3
) -> Element:
    joint = SubElement(root, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    _origin(joint, placement)
    return joint


def _origin(element: Element, placement: pin.SE3) -> None:
    rpy = np.asarray(pin.rpy.matrixToRpy(placement.rotation))
    xyz = _numbers(placement.translation)
    SubElement(element, "origin", xyz=xyz, rpy=_numbers(rpy))


def _limits(robot: Robot, joint: int, ranges: tuple[Array, Array, Array]) -> dict[str, str]:
    lower, upper, speed = ranges
    effort = robot.limits.of_joint("effort", robot.n)
    limits = {"velocity": speed, "effort": effort, "lower": lower, "upper": upper}
    texts = {}
    for name, values in limits.items():
        value = np.clip(values[joint], -UNLIMITED, UNLIMITED)
        texts[name] = _number(value)
    return texts


def _body(root: Element, name: str, inertia: pin.Inertia) -> None:
    if inertia.mass <= 0.0:
        inertia = pin.Inertia(UNKNOWN_MASS, np.zeros(3), UNKNOWN_INERTIA * np.eye(3))
    link = SubElement(root, "link", name=name)
    body = SubElement(link, "inertial")
    centre = _numbers(np.asarray(inertia.lever))
    SubElement(body, "origin", xyz=centre, rpy="0 0 0")
    SubElement(body, "mass", value=_number(inertia.mass))
    moments = {}
    for row, column in combinations_with_replacement(range(3), 2):
        axes = AXES[row] + AXES[column]
        moments[f"i{axes}"] = _number(inertia.inertia[row, column])
    SubElement(body, "inertia", moments)


def _numbers(values: Array) -> str:
    return " ".join(map(_number, values))


def _number(value: float) -> str:
    return repr(float(value))
