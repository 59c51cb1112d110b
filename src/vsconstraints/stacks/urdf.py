"""A robot as URDF text: the chain of its joints, with their limits and bodies, without meshes."""

from __future__ import annotations

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


def urdf_text(robot: Robot, limits: tuple[Array, Array, Array] | None = None) -> str:
    """Return the URDF of a robot whose joints keep their names and order.

    ``limits`` are lower and upper ends of ranges and greatest speeds, (n,) each, instead of the
    robot's :attr:`~.Robot.ranges`.

    Fixed and locked joints are merged, so that the text has exactly n joints and one fixed joint to
    the tip. Links are ``base``, ``link 1`` to ``link n`` and ``tip``. Continuous joints are
    revolute joints with a range that never ends, so that every library gives each one coordinate.
    """
    model = robot.model
    root = Element("robot", name=robot.name)
    SubElement(root, "link", name=BASE)
    parent = BASE
    for i, name in enumerate(robot.joint_names):
        link = f"link {i + 1}"
        kind = "prismatic" if robot.prismatic[i] else "revolute"
        joint = _joint(root, name, kind, parent, link, model.jointPlacements[i + 1])
        SubElement(joint, "axis", xyz=_numbers(robot.axes[i]))
        SubElement(joint, "limit", _limits(robot, i, limits or robot.ranges))
        _body(root, link, model.inertias[i + 1])
        parent = link
    frame = model.frames[robot.frame_id("tip")]
    _joint(root, "tip joint", "fixed", parent, TIP, frame.placement)
    SubElement(root, "link", name=TIP)
    indent(root)
    return tostring(root, encoding="unicode")


def _joint(root: Element, name: str, kind: str, parent: str, child: str, at: pin.SE3) -> Element:
    joint = SubElement(root, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    rpy = np.asarray(pin.rpy.matrixToRpy(at.rotation))
    SubElement(joint, "origin", xyz=_numbers(at.translation), rpy=_numbers(rpy))
    return joint


def _limits(robot: Robot, joint: int, ranges: tuple[Array, Array, Array]) -> dict[str, str]:
    effort = robot.limits.of_joint("effort", robot.n)[joint]
    lower, upper, speed = (float(each[joint]) for each in ranges)
    limits = {"velocity": speed, "effort": effort, "lower": lower, "upper": upper}
    return {key: repr(float(np.clip(each, -UNLIMITED, UNLIMITED))) for key, each in limits.items()}


def _body(root: Element, name: str, inertia: pin.Inertia) -> None:
    link = SubElement(SubElement(root, "link", name=name), "inertial")
    known = inertia.mass > 0.0
    centre = inertia.lever if known else np.zeros(3)
    moments = inertia.inertia if known else UNKNOWN_INERTIA * np.eye(3)
    SubElement(link, "origin", xyz=_numbers(np.asarray(centre)), rpy="0 0 0")
    SubElement(link, "mass", value=repr(float(inertia.mass if known else UNKNOWN_MASS)))
    axes = "xyz"
    upper = {
        f"i{axes[row]}{axes[column]}": repr(float(moments[row, column]))
        for row in range(3)
        for column in range(row, 3)
    }
    SubElement(link, "inertia", upper)


def _numbers(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)
