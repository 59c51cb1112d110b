"""Characteristic points of links: few points that stand for the whole surface (section 4.3.6)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress
from typing import NamedTuple

import numpy as np

from ..errors import ConfigurationError, unknown_name
from ..qp.decomposition import svd
from ..robots.kinematics import RobotPoint
from ..robots.robot import Robot
from ..rows import Array, BoolArray
from .base import require_positive
from .bodies import FIXED, segments
from .meshes import Surface, box_around, surface

#: Greatest length of the line of a link, or of a solid of it, in spacings. Each point is a row, and
#: the number of patches that cover a link's surface grows with the square of this length.
MAX_LENGTH = 60


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
    read, no point of a link moves, or the line of a link or a solid of it is longer than
    :data:`MAX_LENGTH` spacings.
    """
    require_positive(spacing, "spacing of points along the links")
    if link_radius is None:
        covers = _covers_of_geometry(robot, spacing)
    else:
        require_positive(link_radius, "radius of the links")
        covers = _covers_of_segments(robot, spacing, link_radius, links)
    for link in links or ():
        if link not in covers:
            raise unknown_name(f"link with characteristic points of {robot.name}", link, covers)
    if links is not None:
        covers = {link: covers[link] for link in covers if link in links}
    points: list[RobotPoint] = []
    enlargement = 0.0
    for link, cover in covers.items():
        candidates = _points(link, cover.offsets)
        is_moved = _are_moved(robot, candidates)
        moving = list(compress(candidates, is_moved))
        if moving:
            enlargement = max(enlargement, cover.reach)
        for i, point in enumerate(moving, start=1):
            label = link
            if len(moving) > 1:
                label += f" point {i}"
            points.append(RobotPoint(link, point.offset, label))
    if not points:
        raise ConfigurationError(
            f"no joint of {robot.name} moves a point of the links {', '.join(covers) or 'it has'}"
        )
    return LinkPoints(tuple(points), enlargement)


class _Cover(NamedTuple):
    """Points that cover the surface of a link.

    ``offsets`` (k, 3) are their places in the frame of the link [m]. Every point of the surface
    lies within the ``reach`` [m] of one of them.
    """

    offsets: Array
    reach: float


def _points(link: str, offsets: Array) -> list[RobotPoint]:
    return [RobotPoint(link, (x, y, z)) for x, y, z in offsets.tolist()]


def _are_moved(robot: Robot, points: Sequence[RobotPoint]) -> BoolArray:
    """Return for each point if a joint moves it, in one of three arbitrary configurations (k,)."""
    moved = np.zeros(len(points), dtype=np.bool_)
    rng = np.random.default_rng(0)
    for q in rng.uniform(-1.0, 1.0, (3, robot.n)):
        J = robot.kinematics(q, q, points).point_J
        moved |= np.abs(J).max(axis=(1, 2)) > FIXED
    return moved


def _require_short(link: str, length: float, spacing: float) -> None:
    """Raise ConfigurationError if a line or a solid of a link is too long for the spacing [m]."""
    if length > MAX_LENGTH * spacing:
        raise ConfigurationError(
            f"spacing of points along the links: {link} is {length:.3g} m long, "
            f"{length / spacing:.3g} times the spacing of {spacing:g} m; it may be at most "
            f"{MAX_LENGTH} times as long as the spacing"
        )


def _covers_of_segments(
    robot: Robot, spacing: float, radius: float, links: Sequence[str] | None
) -> dict[str, _Cover]:
    """Return points along the straight lines of the links, by link; see :func:`link_points`."""
    covers = {}
    # true if the last point of a selected link is also the first of the next one, which then needs
    # no second point there
    start_is_covered = False
    for segment in segments(robot):
        start_is_covered = start_is_covered and segment.shared
        if segment.length < FIXED:
            continue
        _require_short(segment.link, segment.length, spacing)
        needed = int(np.ceil(segment.length / spacing - 1e-9))
        count = max(1, needed)
        first = 1 if start_is_covered else 0
        shares = np.arange(first, count + 1) / count
        start_is_covered = links is None or segment.link in links
        number = robot.model.getFrameId(segment.link)
        frame = robot.model.frames[number]
        to_link = frame.placement.inverse()
        start = np.asarray(to_link.act(segment.start))
        end = np.asarray(to_link.act(segment.end))
        half_gap = 0.5 * (segment.length / count)
        reach = float(np.hypot(radius, half_gap))
        offsets = start + shares[:, None] * (end - start)
        covers[segment.link] = _Cover(offsets, reach)
    return covers


def _covers_of_geometry(robot: Robot, spacing: float) -> dict[str, _Cover]:
    """Return points in slices of the collision geometry, by link; see :func:`link_points`."""
    surfaces: dict[str, list[Surface]] = {}
    for body in robot.collision_geometry().geometryObjects:
        if body.parentJoint == 0:
            continue
        frame = robot.model.frames[body.parentFrame]
        placement = frame.placement.inverse() * body.placement
        R = np.array(placement.rotation)
        t = np.array(placement.translation)
        low, high = box_around(body.geometry)
        length = float(np.max(high - low))
        _require_short(frame.name, length, spacing)
        patches, slack = surface(body.geometry, 0.5 * spacing)
        in_link = Surface(patches @ R.T + t, slack)
        surfaces.setdefault(frame.name, []).append(in_link)
    covers = {}
    for link, surfaces_of_link in surfaces.items():
        # the fewest slices whose middles all move: a wrist's middle may stand still where its axes
        # meet
        for more in range(3):
            cover = _sliced(surfaces_of_link, spacing, more)
            if _are_moved(robot, _points(link, cover.offsets)).all():
                break
        else:
            cover = _sliced(surfaces_of_link, spacing, 0)
        covers[link] = cover
    return covers


def _sliced(surfaces: Sequence[Surface], spacing: float, more: int) -> _Cover:
    """Return the middles of slices across the longest direction of a link.

    ``more`` is the number of slices beyond those that the spacing requires.
    """
    vertices = np.concatenate([patches.reshape(-1, 3) for patches, _ in surfaces])
    middle = vertices.mean(axis=0)
    from_middle = vertices - middle
    axes: Array = np.eye(3)
    if len(vertices) > 1:
        _, _, axes = svd(from_middle, full_matrices=False)
    # coordinates along the principal axes
    x = from_middle @ axes.T
    low = x.min(axis=0)
    extent = x.max(axis=0) - low
    main = int(np.argmax(extent))
    length = extent[main]
    required = max(1, int(np.ceil(length / spacing)))
    count = required + more
    part = (x[:, main] - low[main]) / max(length, 1e-300)
    number = (part * count).astype(int)
    slice_of = np.minimum(number, count - 1)
    centres = []
    for i in np.unique(slice_of):
        inside = x[slice_of == i]
        lowest = inside.min(axis=0)
        highest = inside.max(axis=0)
        centres.append(0.5 * (lowest + highest))
    points: Array = np.array(centres) @ axes + middle
    reach = 0.0
    for patches, slack in surfaces:
        distance = _distance_to_nearest(patches, points)
        reach = max(reach, distance + slack)
    return _Cover(points, reach)


def _distance_to_nearest(patches: Array, points: Array) -> float:
    """Return the greatest distance of patches (p, c, 3) from the point nearest to each.

    The distance to one point is convex: on a patch it is largest at a corner.
    """
    from_points = patches[:, :, None] - points
    distances = np.linalg.norm(from_points, axis=3)
    of_patches = distances.max(axis=1).min(axis=1)
    return float(of_patches.max())
