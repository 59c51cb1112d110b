"""A moment of a preview in space: the arm, its camera and what it sees, the target, and forbidden regions."""

from __future__ import annotations

from contextlib import suppress
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...errors import InvalidInput
from ...robots.geometry import Pose
from ...rows import Array
from ...simulation import Setup
from ...vision.camera import Camera
from ..plots.arm import JOINT, add_arm, bars_of
from ..plots.mesh import Mesh
from .moments import Moment
from .obstacles import add_obstacles

CAMERA = "#0072B2"

REACH = 0.8
"""Of the arm whose bars are as thick as :mod:`vsconstraints.reports.plots.arm` says [m]."""

NEAREST = 0.05
"""At which what the camera sees is drawn at least [m], where markers are behind it."""

IN_VIEW = 1.16
"""Half the height that a view shows, relative to half the side of its cube."""

MARGIN = 1.12
"""By how much more is shown than is there: bars have a thickness, and what is near is seen larger."""

TALL, FLAT = 20.0, 55.0
"""Elevation from which a scene is seen, and one that lies in a horizontal plane [deg]."""


class Viewpoint(NamedTuple):
    """What is shown, a cube of this centre (3,) and half side [m], seen from this elevation and azimuth [deg]."""

    centre: Array
    half: float
    elevation: float
    azimuth: float


class Places(NamedTuple):
    """Where things are in a moment, in the base frame.

    Attributes
    ----------
    arm
        (p, 3) corners from the base to the tip.
    camera
        Its pose.
    markers
        (M, 3).
    corners
        (4, 3) of what the camera sees at the markers' distance.
    """

    arm: Array
    camera: Pose
    markers: Array
    corners: Array

    @classmethod
    def of(cls, setup: Setup, moment: Moment) -> Places:
        """Those of a moment whose configuration is known."""
        scene = setup.scene
        assert moment.q is not None
        camera = scene.camera.fixed or scene.robot.pose(moment.q) @ scene.camera.mount.inverse
        arm = np.concatenate(([] if scene.robot.prismatic[0] else [np.zeros((1, 3))]) + bars_of(scene.robot, moment.q))
        markers = scene.markers_at(moment.q, moment.t)
        depth = max(float(camera.inverse.act(markers)[:, 2].mean()), NEAREST)
        return cls(arm, camera, markers, camera.act(depth * _rays(scene.camera)))

    @property
    def points(self) -> Array:
        """(k, 3) all of them."""
        return np.concatenate((self.arm, self.camera.t[None], self.markers, self.corners))


def viewpoint_of(setup: Setup, moments: list[Moment], aspect: float) -> Viewpoint:
    """One viewpoint for all moments: everything is in it, and seen from where it covers most of the picture.

    ``aspect`` is the width of the views over their height, at least 1.
    """
    points = np.concatenate([Places.of(setup, moment).points for moment in moments])
    size = float(np.ptp(points, axis=0).max())
    elevation = FLAT if np.ptp(points[:, 2]) < 0.25 * size else TALL
    azimuth = max(np.arange(-90.0, 91.0, 10.0), key=lambda azimuth: _area(points @ axes_of(elevation, azimuth)))
    axes = axes_of(elevation, azimuth)
    seen = points @ axes
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    across, up = 0.5 * np.ptp(seen, axis=0)[:2]
    return Viewpoint(axes @ middle, MARGIN * max(up, across / aspect) / IN_VIEW, elevation, float(azimuth))


def axes_of(elevation: float, azimuth: float) -> Array:
    """(3, 3) directions to the right, up and towards the reader, as columns, of a view from two angles [deg]."""
    e, a = np.deg2rad([elevation, azimuth])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    return np.stack((right, np.cross(towards, right), towards), axis=1)


def _area(seen: Array) -> float:
    """How much of a picture is covered by points (k, 3) of which the first two coordinates are across and up."""
    area: float = np.linalg.det(np.cov(seen[:, :2].T))
    return area


def drawn(setup: Setup, moment: Moment, size: float) -> Mesh:
    """Everything at a moment whose configuration is known; ``size`` is half of what is shown [m]."""
    assert moment.q is not None
    mesh, places, scale = Mesh(), Places.of(setup, moment), size / REACH
    add_obstacles(mesh, setup, moment.t, size)
    add_arm(mesh, setup.scene.robot, moment.q, scale)
    mesh.target(places.markers, 0.003 * scale, 0.015 * scale)
    _camera(mesh, setup.scene.camera, places, scale)
    return mesh


def _camera(mesh: Mesh, camera: Camera, places: Places, scale: float) -> None:
    """A pyramid at the camera, the edges of what it sees, and what the tip carries: the camera, or the target."""
    base = places.camera.act(0.09 * scale * _rays(camera))
    for a, b in pairwise([*base, base[0]]):
        mesh.add(np.array([places.camera.t, a, b]), f"{CAMERA}8C", shaded=False)
    for a, b in pairwise([*places.corners, places.corners[0]]):
        for start, end in ((places.camera.t, a), (a, b)):
            mesh.tube(np.linspace(start, end, 12), 0.0022 * scale, CAMERA, 4, caps=False)
    carried = places.camera.t if camera.fixed is None else places.markers.mean(axis=0)
    if np.linalg.norm(carried - places.arm[-1]) > 1e-6:
        mesh.tube(np.linspace(places.arm[-1], carried, 6), 0.007 * scale, JOINT, 8)


def _rays(camera: Camera) -> Array:
    """(4, 3) where the corners of the image are at depth 1, in the camera's frame."""
    half = 0.5 * np.asarray(camera.size)
    corners = half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    with suppress(InvalidInput):  # where the lens cannot be inverted, those of a pinhole
        corners = camera.undistort(corners)
    return np.concatenate((camera.normalised(corners), np.ones((4, 1))), axis=1)
