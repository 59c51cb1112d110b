"""Arms as coloured meshes, those of the URDF or bars between joints, and their frames."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin

from ..constraints.meshes import Mesh, mesh_of
from ..errors import ConfigurationError
from ..robots.geometry import Pose
from ..robots.robot import Robot
from ..robots.urdf import link_geometry
from ..rows import Array
from .scene3d import Part, Placement
from .solids import ball, bar, joined, tube

LINK = "#C9CED6"
JOINT = "#4A5568"
#: Reach for which the following radii hold [m]; the radii of other arms scale with reach.
REACH = 0.8
#: Radii of the first and the last link [m].
BASE_LINK = 0.034
LAST_LINK = 0.022
#: Thickness of links, relative to the radius of the joint before them: revolute, prismatic.
REVOLUTE = 0.8
PRISMATIC = 0.25
#: Radius and height of the base's plate; the plate begins below the base frame [m].
BASE_RADIUS = 0.09
BASE_TOP = 0.04
BASE_BOTTOM = -0.005
#: Rail of a prismatic joint: one metre long, and stretched to the joint's coordinate.
RAIL = bar(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.004)
SHORT = 1e-6  #: Distance below which two points coincide [m].


def joint_poses(robot: Robot, q: Array) -> tuple[list[Pose], Array]:
    """Return poses of the base and of each joint's child link (n + 1), and joint axes (n, 3)."""
    model = robot.model
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    poses = [Pose.of(placement) for placement in data.oMi]
    linear, angular = np.asarray(data.J).reshape(2, 3, -1)
    is_prismatic = np.array(robot.prismatic)
    axes = np.where(is_prismatic, linear, angular)
    return poses, axes.T


def bars_of(robot: Robot, q: Array) -> list[Array]:
    """Return the corners (p, 3) of a bar behind each joint.

    A bar follows the joint's axis, then the common normal to the next one.
    """
    poses, axes = joint_poses(robot, q)
    places = [pose.t for pose in poses[1:]]
    places.append(robot.pose(q).t)
    bars = []
    for (begin, end), axis in zip(pairwise(places), axes, strict=True):
        along_axis = float(axis @ (end - begin))
        elbow = begin + along_axis * axis
        corners = [begin]
        for point in (elbow, end):
            if np.linalg.norm(point - begin) > SHORT:
                corners.append(point)
        bars.append(np.array(corners))
    return bars


def bars(robot: Robot, size: float) -> list[Part]:
    """Return an arm as bars between its joint axes, in the frames of :func:`arm_frames`.

    ``size`` scales their width. A prismatic joint is thin and has a rail instead of a drum; an arm
    that begins with one has no base.
    """
    zero = np.zeros(robot.n)
    poses, axes = joint_poses(robot, zero)
    narrowing = (LAST_LINK - BASE_LINK) * np.arange(robot.n) / robot.n
    radii = size * (BASE_LINK + narrowing)
    parts = []
    if not robot.prismatic[0]:
        parts += _base(size, poses[1].t, REVOLUTE * radii[0])
    for i, corners in enumerate(bars_of(robot, zero)):
        number = i + 1
        pose = poses[number]
        frame = f"joint {number}"
        radius = radii[i]
        is_prismatic = robot.prismatic[i]
        thickness = PRISMATIC if is_prismatic else REVOLUTE
        if len(corners) > 1:
            link = _rounded_bar(corners, thickness * radius, 0.05 * size)
            parts.append(Part(link.moved(pose.inverse), LINK, frame))
        if is_prismatic:
            parts.append(Part(RAIL, LINK, f"slide {number}"))
        else:
            half = 1.35 * radius * axes[i]
            drum = bar(pose.t - half, pose.t + half, 1.25 * radius, 14)
            parts.append(Part(drum.moved(pose.inverse), JOINT, frame))
    return parts


def _base(size: float, first_joint: Array, radius: float) -> list[Part]:
    """Return the base's plate, and a column with this radius from there to the first joint (3,)."""
    origin = np.zeros(3)
    up = np.array([0.0, 0.0, size])
    plate = bar(BASE_BOTTOM * up, BASE_TOP * up, BASE_RADIUS * size, 24)
    parts = [Part(plate, JOINT, "joint 0")]
    if np.linalg.norm(first_joint) > SHORT:
        column = bar(origin, first_joint, radius)
        parts.append(Part(column, LINK, "joint 0"))
    return parts


def _rounded_bar(corners: Array, radius: float, step: float) -> Mesh:
    """Return a bar along corners (p, 3) with round ends, in sections ``step`` [m] apart."""
    pieces = []
    for begin, end in pairwise(corners):
        length = np.linalg.norm(end - begin)
        count = max(2, int(length / step))
        line = np.linspace(begin, end, count)
        pieces.append(tube(line, radius))
        pieces.append(ball(end, radius, 12))
    return joined(pieces)


def visuals(robot: Robot, size: float) -> tuple[list[Part], str]:
    """Return the visual meshes of a robot's URDF, and a remark.

    If there are no meshes, or one is missing, bars are returned and the remark says so.
    """
    if robot.source is None:
        remark = f"{robot.name} has no meshes: bars follow the axes of its joints."
        return bars(robot, size), remark
    parts = []
    try:
        for body in link_geometry(robot.source, "visual").geometryObjects:
            mesh = mesh_of(body.geometry)
            if mesh is not None:
                in_joint = mesh.moved(Pose.of(body.placement))
                parts.append(Part(in_joint, LINK, f"joint {body.parentJoint}"))
    except ConfigurationError as error:
        remark = f"Bars follow the axes of its joints instead of meshes: {error}."
        return bars(robot, size), remark
    if not parts:
        return bars(robot, size), f"{robot.name} has no visual meshes: bars follow its axes."
    return parts, ""


def arm_frames(robot: Robot, q: Array) -> dict[str, Placement]:
    """Return the frames ``joint 0`` (the base) to ``joint n``, ``tip``, and one per rail.

    A frame ``slide k`` lies along each prismatic joint k.
    """
    poses, axes = joint_poses(robot, q)
    frames = {f"joint {i}": Placement(pose) for i, pose in enumerate(poses)}
    frames["tip"] = Placement(robot.pose(q))
    z = np.array([0.0, 0.0, 1.0])
    for i in np.flatnonzero(robot.prismatic):
        # the rail ends at the joint's zero position
        turn = pin.Quaternion.FromTwoVectors(z, -axes[i])
        number = i + 1
        rail = Pose(turn.matrix(), poses[number].t)
        stretch = float(q[i]) or 1e-6
        frames[f"slide {number}"] = Placement(rail, stretch)
    return frames
