"""Solid bodies made of polygons: drawn as one collection, so that nearer ones hide those behind them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ...robots.geometry import Pose
from ...rows import Array
from .style import INK, darker

LIGHT = np.array([0.35, -0.55, 0.76])
"""(3,) where the light comes from, in the base frame."""

AXIS_COLOURS = ("#D42A2A", "#2E8B3D", "#1447C4")
PLATE = "#F4F1E6"

CELLS = 8
"""Into how many parts each way a plate is cut: polygons are ordered by the mean distance of their corners."""


class Mesh:
    """Polygons with a colour each, shaded by how they face the light."""

    def __init__(self) -> None:
        self.polygons: list[Array] = []
        self.colours: list[str] = []

    def add(self, polygon: Array, colour: str, shaded: bool = True) -> None:
        """One flat polygon (p, 3), of a colour ``#RRGGBB`` or, with its opacity, ``#RRGGBBAA``."""
        normal = np.cross(polygon[1] - polygon[0], polygon[2] - polygon[0])
        length = float(np.sqrt(normal @ normal))
        facing = abs(float(normal @ LIGHT)) / length if shaded and length > 0.0 else 1.0
        self.polygons.append(polygon)
        self.colours.append(darker(colour, 0.55 + 0.45 * facing))

    def tube(self, points: Array, radius: float, colour: str, sides: int = 10, caps: bool = True) -> None:
        """A round bar along a polyline (p, 3)."""
        rings = _rings(points, radius, sides)
        for a, b in pairwise(rings):
            for k in range(sides):
                j = (k + 1) % sides
                self.add(np.array([a[k], a[j], b[j], b[k]]), colour)
        if caps:
            self.add(rings[0], colour)
            self.add(rings[-1], colour)

    def ball(self, centre: Array, radius: float, colour: str, count: int = 16) -> None:
        """A sphere."""
        theta, phi = np.linspace(0.0, np.pi, count // 2 + 1), np.linspace(0.0, 2.0 * np.pi, count + 1)
        T, P = np.meshgrid(theta, phi, indexing="ij")
        grid = centre + radius * np.stack((np.sin(T) * np.cos(P), np.sin(T) * np.sin(P), np.cos(T)), axis=-1)
        for i in range(len(theta) - 1):
            for j in range(count):
                self.add(np.array([grid[i, j], grid[i + 1, j], grid[i + 1, j + 1], grid[i, j + 1]]), colour)

    def frame(self, pose: Pose, length: float, radius: float) -> None:
        """Red, green and blue bars along the x, y and z axes of a frame."""
        for axis, colour in enumerate(AXIS_COLOURS):
            self.tube(np.array([pose.t, pose.t + length * pose.R[:, axis]]), radius, colour, sides=6)

    def pyramid(self, pose: Pose, width: float, height: float, depth: float, colour: str) -> None:
        """What a camera sees: its apex at the frame's origin, its base across the frame's z axis."""
        base = pose.act(np.array([[x * width, y * height, depth] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]))
        for k in range(4):
            self.add(np.array([pose.t, base[k], base[(k + 1) % 4]]), f"{colour}8C", shaded=False)

    def target(self, markers: Array, edge: float, marker: float) -> None:
        """A target's markers (M, 3), on a plate where they are more than two; radii of its edges and of markers [m]."""
        if len(markers) > 2:
            centre = markers.mean(axis=0)
            plate = centre + 1.25 * (markers - centre)
            for a, b in pairwise([*plate, plate[0]]):
                self._wedge(centre, a, b)
                self.tube(np.array([a, b]), edge, INK, 6)
        for place in markers:
            self.ball(place, marker, INK, count=10)

    def _wedge(self, apex: Array, a: Array, b: Array) -> None:
        """A triangle of a plate (corners (3,) each) in small cells: whole, it would be drawn over bodies it carries."""
        along, across = np.linspace(0.0, 1.0, CELLS + 1)[:, None], np.linspace(a, b, CELLS + 1) - apex
        for near, far in pairwise(apex + along[:, None] * across):
            for k in range(CELLS):
                self.add(np.array([near[k], far[k], far[k + 1], near[k + 1]]), PLATE, shaded=False)

    def draw(
        self, ax: Any, centre: Sequence[float], half: float, elevation: float, azimuth: float, whole: bool = False
    ) -> None:
        """Put everything into 3D axes, and look at a cube around a centre (3,) from two angles [deg].

        Axes in space are square within their place; what is beside is cut off unless the ``whole`` is wanted.
        """
        from mpl_toolkits.mplot3d.art3d import Poly3DCollection

        # opaque polygons are outlined in their own colour, which closes the seams between them
        edges = [colour if len(colour) == 7 else "none" for colour in self.colours]
        look = {"facecolors": self.colours, "edgecolors": edges, "linewidths": 0.25}
        solids = Poly3DCollection(_padded(self.polygons), **look, zsort="average")
        ax.add_collection3d(solids, autolim=False)
        solids.set_clip_on(not whole)
        for name, middle in zip("xyz", centre, strict=True):
            getattr(ax, f"set_{name}lim")(middle - half, middle + half)
        ax.set_box_aspect((1, 1, 1), zoom=1.45)
        ax.view_init(elev=elevation, azim=azimuth)
        ax.set_proj_type("persp", focal_length=0.6)
        ax.set_axis_off()
        ax.patch.set_alpha(0.0)


def _padded(polygons: Sequence[Array]) -> Any:
    """Polygons as one masked array (n, p, 3) with as many corners as the largest has.

    matplotlib would pad them with whatever is in memory, and warn where that overflows when it is projected.
    """
    count = np.array([len(polygon) for polygon in polygons], dtype=int)
    corner = np.arange(count.max(initial=0))
    # the last corner again: matplotlib before 3.10 knows nothing of masks
    last = np.minimum(corner, count[:, None] - 1)
    corners = np.array([polygon[own] for polygon, own in zip(polygons, last, strict=True)]).reshape(*last.shape, 3)
    mask = np.broadcast_to((corner >= count[:, None])[..., None], corners.shape)
    return np.ma.MaskedArray(corners, mask)


def _rings(points: Array, radius: float, sides: int) -> list[Array]:
    """A ring of ``sides`` points around each point of a polyline, turned as little as possible from one to the next."""
    along = np.gradient(points, axis=0)
    angles = 2.0 * np.pi * np.arange(sides) / sides
    across: Array = np.zeros(3)
    rings = []
    for point, direction in zip(points, along, strict=True):
        d = direction / max(float(np.sqrt(direction @ direction)), 1e-12)
        helper = across if across @ across > 0.5 and abs(across @ d) < 0.9 else np.eye(3)[int(np.argmin(np.abs(d)))]
        across = helper - (helper @ d) * d
        across = across / np.sqrt(across @ across)
        other = np.cross(d, across)
        rings.append(point + radius * (np.outer(np.cos(angles), across) + np.outer(np.sin(angles), other)))
    return rings
