"""Scene in space for previews, films, replays and figures: coloured meshes fixed to frames.

:meth:`Scene3D.draw` draws it with matplotlib; :mod:`vsconstraints.view.replay.space` plays it
in a browser with viser.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ..constraints.meshes import Mesh
from ..reports.plots.style import INK, rgb
from ..robots.geometry import Pose
from ..rows import Array
from .solids import ball, bar, grid_surface, joined

PLATE = "#F4F1E6"
AXIS_COLOURS = ("#D42A2A", "#2E8B3D", "#1447C4")
LIGHT = np.array([0.35, -0.55, 0.76])  # (3,) direction to the light, in the base frame
#: Brightness of a surface along the light, and what is added on one that faces it.
AMBIENT = 0.55
DIFFUSE = 0.45
#: Cells of a plate in each direction: triangles are ordered by the mean distance of their corners.
PLATE_CELLS = 8
#: Triangles of a pyramid: its apex and two corners of its base.
PYRAMID_SIDES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]])


class Part(NamedTuple):
    """Mesh of one colour ``#RRGGBB``, in the coordinates of a named frame.

    An empty name stands for the base frame.
    """

    mesh: Mesh
    colour: str
    frame: str = ""
    opacity: float = 1.0
    shaded: bool = True


class Placement(NamedTuple):
    """Pose of a frame in the base frame; parts fixed to it are stretched along its z axis."""

    pose: Pose
    stretch: float = 1.0


class Viewpoint(NamedTuple):
    """Viewpoint on a cube with this centre (3,) and half side [m].

    ``elevation`` and ``azimuth`` are the angles from which it is seen [deg].
    """

    centre: Array
    half: float
    elevation: float
    azimuth: float


class Scene3D:
    """Set of meshes that are drawn at the poses of their frames."""

    def __init__(self) -> None:
        self.parts: list[Part] = []

    def add(self, mesh: Mesh, colour: str, frame: str = "", **look: Any) -> None:
        """Add a mesh in a frame; ``look`` are further fields of :class:`Part`."""
        if len(mesh.triangles):
            self.parts.append(Part(mesh, colour, frame, **look))

    def axes(self, pose: Pose, length: float, radius: float) -> None:
        """Add red, green and blue bars along the x, y and z axes of a frame."""
        for axis, colour in zip(pose.R.T, AXIS_COLOURS, strict=True):
            end = pose.t + length * axis
            self.add(bar(pose.t, end, radius, 6), colour)

    def pyramid(self, base: Array, colour: str, frame: str = "") -> None:
        """Add a camera at the origin of a frame: a glass pyramid with this base (4, 3)."""
        apex = np.zeros((1, 3))
        points = np.concatenate((apex, base))
        sides = Mesh(points, PYRAMID_SIDES)
        self.add(sides, colour, frame, opacity=0.55, shaded=False)

    def target(self, markers: Array, edge: float, marker: float, frame: str = "") -> None:
        """Add markers (M, 3), on a plate if there are more than two.

        ``edge`` and ``marker`` are the radii of the plate's edges and of the markers [m].
        """
        if len(markers) > 2:
            self._plate(markers, edge, frame)
        balls = [ball(place, marker, 10) for place in markers]
        self.add(joined(balls), INK, frame)

    def _plate(self, markers: Array, edge: float, frame: str) -> None:
        """Add the plate of markers (M, 3), with edges of radius ``edge`` [m]."""
        centre = markers.mean(axis=0)
        corners = centre + 1.25 * (markers - centre)
        # small cells: a triangle in one piece would be drawn over bodies on the plate
        cell_count = PLATE_CELLS + 1
        steps = np.linspace(0.0, 1.0, cell_count)[:, None, None]
        wedges = []
        edges = []
        for corner, following in pairwise([*corners, corners[0]]):
            side = np.linspace(corner, following, cell_count)
            wedge = centre + steps * (side - centre)
            wedges.append(grid_surface(wedge))
            edges.append(bar(corner, following, edge, 6))
        self.add(joined(wedges), PLATE, frame, shaded=False)
        self.add(joined(edges), INK, frame)

    def draw(
        self,
        ax: Any,
        view: Viewpoint,
        frames: Mapping[str, Placement] | None = None,
        whole: bool = True,
    ) -> None:
        """Draw everything into 3D axes of matplotlib that show the cube of a viewpoint.

        Axes in space are square. Parts outside their square are cut off unless ``whole`` is True.
        """
        if self.parts:
            self._draw_parts(ax, frames or {}, whole)
        low = view.centre - view.half
        high = view.centre + view.half
        x_limits, y_limits, z_limits = np.stack((low, high), axis=1).tolist()
        ax.set(xlim=x_limits, ylim=y_limits, zlim=z_limits)
        ax.set_box_aspect((1, 1, 1), zoom=1.45)
        ax.view_init(elev=view.elevation, azim=view.azimuth)
        ax.set_proj_type("persp", focal_length=0.6)
        ax.set_axis_off()
        ax.patch.set_alpha(0.0)

    def _draw_parts(self, ax: Any, frames: Mapping[str, Placement], whole: bool) -> None:
        """Draw the triangles of all parts."""
        from mpl_toolkits.mplot3d.art3d import Poly3DCollection

        triangles = []
        colours = []
        for part in self.parts:
            points = part.mesh.points
            if part.frame:
                pose, stretch = frames[part.frame]
                stretched = points * (1.0, 1.0, stretch)
                points = pose.act(stretched)
            corners = points[part.mesh.triangles]
            triangles.append(corners)
            colours.append(_colours(corners, part))
        faces = np.concatenate(colours)
        is_glass = faces[:, 3:] < 1.0
        # opaque triangles are outlined in their own colour to close the seams between them
        edges = np.where(is_glass, 0.0, faces)
        solids = Poly3DCollection(
            np.concatenate(triangles),
            facecolors=faces,
            edgecolors=edges,
            linewidths=0.25,
            zsort="average",
            clip_on=not whole,
        )
        ax.add_collection3d(solids, autolim=False)


def _colours(corners: Array, part: Part) -> Array:
    """Return colours (F, 4) of triangles (F, 3, 3), shaded by their angle to the light."""
    colour = np.array(rgb(part.colour))
    count = len(corners)
    brightness: Array = np.ones(count)
    if part.shaded:
        brightness = _brightness(corners)
    colours = brightness[:, None] * colour / 255.0
    return np.column_stack((colours, np.full(count, part.opacity)))


def _brightness(corners: Array) -> Array:
    """Return the brightness (F,) of triangles (F, 3, 3): 1 where they face the light."""
    first, second, third = corners.transpose(1, 0, 2)
    normals = np.cross(second - first, third - first)
    lengths = np.linalg.norm(normals, axis=1)
    has_area = lengths > 0.0
    towards_light = np.abs(normals @ LIGHT)
    facing = np.ones(len(corners))
    np.divide(towards_light, lengths, out=facing, where=has_area)
    brightness: Array = AMBIENT + DIFFUSE * np.minimum(facing, 1.0)
    return brightness
