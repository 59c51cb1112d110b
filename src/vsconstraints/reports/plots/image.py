"""Image plane: its frame, the boundaries and forbidden sides of constraints, and markers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from contourpy import contour_generator

from ...constraints import ImageConstraint
from ...errors import InvalidInput
from ...rows import Array
from ...simulation import Setup
from ...vision.camera import Camera
from ...vision.motion import Motion
from .style import FAINT, INK, Style, line, patch, symbol

# Size of the shown part of the image plane, relative to the image; the rest is cut off.
AROUND = 1.12
FORBIDDEN: Style = {"facecolor": "#DCDCDC", "edgecolor": "#B0B0B0", "hatch": "/////"}
FRAME: Style = {"color": "#606060", "linewidth": 1.7, "solid_joinstyle": "miter"}
IMAGE = patch("image", "none", edgecolor=FRAME["color"], linewidth=FRAME["linewidth"])
BOUNDARY: Style = {"color": INK, "linewidth": 0.9}
#: Style of the time beside a moving boundary.
TIME: Style = {
    "ha": "center",
    "va": "center",
    "clip_on": True,
    "annotation_clip": True,
    "fontsize": 7.5,
    "color": FAINT,
    "zorder": 2.2,
}
LABELLED = 0.93  # farthest place of a time from the centre, relative to half of the shown part
#: Most drawings of a moving boundary; instants at which its presence in the image is checked.
MOMENTS = 5
INSTANTS = 200
#: Corners of an image, in order and back to the first, relative to half its size.
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
# Step of the grid on which the forbidden side is found [px]; the boundary line drawn on top of
# its edge is exact.
GRID_STEP = 2.0


@dataclass
class Plane:
    """Image plane of a camera, with the constraints on markers in it.

    ``size`` is the image's width and height [px]. ``constraints`` are fixed, ``drifting`` move,
    each with its motion and polylines (p, 2) at the start [px], drawn at ``times`` [s]. ``outline``
    (p, 2) is the sensor's edge in ideal pixels, None without distortion [px].
    """

    size: tuple[float, float]
    constraints: tuple[ImageConstraint, ...] = ()
    drifting: tuple[tuple[ImageConstraint, Motion, list[Array]], ...] = ()
    times: tuple[float, ...] = ()
    outline: Array | None = None

    @classmethod
    def of(cls, setup: Setup) -> Plane:
        """Return the image plane of a setup.

        Moving boundaries are shown from their first to their last time in the image.
        """
        width, height = map(float, setup.scene.camera.size)
        instants = np.linspace(0.0, setup.duration, INSTANTS)
        fixed = []
        drifting = []
        for constraint in setup.constraints.constraints:
            if not isinstance(constraint, ImageConstraint):
                continue
            if constraint.motion is None:
                fixed.append(constraint)
            else:
                lines = constraint.boundary((width, height), instants)
                drifting.append((constraint, constraint.motion, lines))
        plane = cls(
            size=(width, height),
            constraints=tuple(fixed),
            drifting=tuple(drifting),
            outline=_outline(setup.scene.camera),
        )
        half = 0.5 * np.array(plane.size)
        seen = []
        for k, t in enumerate(instants):
            if any(passes_through(line, half) for line in plane.moved(t)):
                seen.append(k)
        if seen:
            moments = np.linspace(seen[0], seen[-1], MOMENTS).round()
            plane.times = tuple(instants[np.unique(moments.astype(int))])
        return plane

    def moved(self, t: float) -> list[Array]:
        """Return polylines (p, 2) of the moving boundaries at a time [px]."""
        moved: list[Array] = []
        for _, motion, lines in self.drifting:
            displacement = motion.displacement(t)
            for points in lines:
                moved.append(points + displacement)
        return moved

    @property
    def moving(self) -> tuple[tuple[float, list[Array]], ...]:
        """Times [s] and polylines of the moving boundaries, as they are drawn."""
        if not any(lines for _, _, lines in self.drifting):
            return ()
        return tuple((t, self.moved(t)) for t in self.times)

    @cached_property
    def lines(self) -> list[Array]:
        """Polylines (p, 2) along the fixed boundaries [px]."""
        lines = []
        for constraint in self.constraints:
            lines += constraint.boundary(self.size)
        return lines

    @property
    def edge(self) -> Array:
        """Edge of the sensor (p, 2) as a closed line [px].

        It is the rectangle of the image's size if there is no distortion.
        """
        if self.outline is not None:
            return self.outline
        corners: Array = 0.5 * np.asarray(self.size) * CORNERS
        return corners

    @property
    def half(self) -> Array:
        """Half the size (2,) of the shown part [px]."""
        image = 0.5 * np.asarray(self.size)
        reach = np.abs(self.edge).max(axis=0)
        half: Array = AROUND * np.maximum(image, reach)
        return half

    @cached_property
    def forbidden(self) -> list[Array]:
        """Outlines (p, 2) of the forbidden areas in the shown part, including holes [px]."""
        return self.forbidden_within(np.zeros(2), self.half)

    def forbidden_within(self, centre: Array, half: Array) -> list[Array]:
        """Return outlines (p, 2) of forbidden areas within ``half`` (2,) of a centre (2,) [px]."""
        if not self.constraints:
            return []
        steps = 2.0 * half.max() / GRID_STEP
        count = int(np.clip(steps, 80, 600))
        low = centre - half
        high = centre + half
        u, v = np.linspace(low, high, count, axis=1)
        contours = contour_generator(u, v, self.depth(u, v), fill_type="OuterOffset")
        areas, offsets = contours.filled(0.0, 1.0)
        outlines = []
        for points, area_offsets in zip(areas, offsets, strict=True):
            begins = area_offsets[1:-1].astype(int)  # of the holes
            outlines += np.split(points, begins)
        return outlines

    def depth(self, u: Array, v: Array) -> Array:
        """Return the greatest σ (b, a) of fixed constraints on a grid of u (a,) and v (b,) [px].

        Values are clipped at ±0.1.
        """
        grid = np.stack(np.meshgrid(u, v), axis=-1)
        depth: Array = np.full((len(v), len(u)), -0.1)
        for constraint in self.constraints:
            depth = np.maximum(depth, constraint.sigma(grid))
        # Only the sign is needed; huge values far from a boundary would spoil interpolation.
        return np.minimum(depth, 0.1)

    def draw(self, ax: Any, *, labels: bool = True, upwards: bool = False) -> None:
        """Draw the whole plane; ``v`` points down, as in an image, or up with ``upwards``."""
        from matplotlib.ticker import MaxNLocator

        self.draw_part(ax, np.zeros(2), self.half, self.forbidden)
        for t, lines in self.moving:
            for points in lines:
                low = points.min(axis=0)
                high = points.max(axis=0)
                middle = 0.5 * (low + high)
                is_cut_off = np.abs(middle) > LABELLED * self.half
                if not is_cut_off.any():
                    ax.annotate(f"{t:.1f} s", middle, **TIME)
        ax.plot(*self.edge.T, **FRAME, zorder=2.5)
        if upwards:
            ax.invert_yaxis()
        for axis in (ax.xaxis, ax.yaxis):
            ticks = MaxNLocator(7, steps=[1, 2, 5, 10], symmetric=True)
            axis.set_major_locator(ticks)
        if labels:
            direction = "upwards" if upwards else "downwards"
            ax.set_xlabel("u [px]", labelpad=1)
            ax.set_ylabel(f"v [px], {direction}", labelpad=1)

    def draw_part(
        self, ax: Any, centre: Array, half: Array, forbidden: list[Array] | None = None
    ) -> None:
        """Draw the forbidden side and the boundaries within ``half`` (2,) of a centre (2,).

        ``v`` points down.
        """
        from matplotlib.patches import PathPatch
        from matplotlib.path import Path

        if forbidden is None:
            forbidden = self.forbidden_within(centre, half)
        if forbidden:
            paths = [Path(outline, closed=True) for outline in forbidden]
            area = Path.make_compound_path(*paths)
            ax.add_artist(PathPatch(area, **FORBIDDEN, linewidth=0.0, zorder=0.6))
        for points in self.lines:
            ax.plot(*points.T, **BOUNDARY, zorder=3)
        for k, (_, lines) in enumerate(self.moving):
            style = _moving_style(k, len(self.times))
            for points in lines:
                ax.plot(*points.T, **style, zorder=2.1)
        left, top = centre - half
        right, bottom = centre + half
        ax.set_xlim(left, right)
        ax.set_ylim(bottom, top)
        ax.grid(False)

    def entries(self, boundary: str = "", forbidden: str = "forbidden") -> list[Style]:
        """Return legend entries of the image and its contents; of the boundary if it has a name."""
        entries = [IMAGE]
        if boundary:
            entries.append(line(boundary, **BOUNDARY))
        if self.constraints:
            entries.append(patch(forbidden, **FORBIDDEN))
        if self.moving:
            times = "these times" if len(self.times) > 1 else "that time"
            style = _moving_style(2, MOMENTS)
            entries.append(line(f"boundary at {times}", **style))
        return entries


def passes_through(points: Array, half: Array | float) -> bool:
    """Return True if a polyline (p, 2) has a point with |u| and |v| below ``half``."""
    is_inside = (np.abs(points) < half).all(axis=1)
    return bool(is_inside.any())


def _moving_style(moment: int, count: int) -> Style:
    """Return the style of a moving boundary at one of ``count`` moments; later ones are darker."""
    alpha = 1.0
    if count > 1:
        alpha = 0.3 + 0.7 * moment / (count - 1)
    return BOUNDARY | {"linestyle": "--", "alpha": alpha}


def rectangle(ax: Any, centre: Array, half: Array | float, **style: Any) -> None:
    """Draw the outline of a part of the image, by its centre (2,) and half its sides (2,) [px]."""
    outline = centre + half * CORNERS
    ax.plot(*outline.T, **style)


def tracks(ax: Any, pixels: Array, **style: Any) -> None:
    """Draw the paths (N, M, 2) of markers in the image."""
    for i in range(pixels.shape[1]):
        ax.plot(*pixels[:, i].T, **style)


#: Symbol of markers with numbers; colour of violations and of markers beyond the shown part.
START = symbol("o", "white", size=10.5)
OUTSIDE = "#B00020"


def numbered(ax: Any, pixels: Array, within: Array | None = None) -> None:
    """Draw discs with numbers at markers (M, 2).

    Markers beyond ``within`` (2,) are drawn at its edge, in red.
    """
    clip = within is None
    for i, marker in enumerate(pixels):
        if not np.isfinite(marker).all():
            continue
        place = marker
        if within is not None:
            place = np.clip(marker, -within, within)
        u, v = place
        colour = INK if (place == marker).all() else OUTSIDE
        order = 6.4 + 0.01 * i
        disc = START | {"markeredgecolor": colour}
        ax.plot(u, v, **disc, zorder=order, clip_on=clip)
        ax.text(
            u,
            v,
            str(i + 1),
            fontsize=8,
            color=colour,
            ha="center",
            va="center_baseline",
            clip_on=clip,
            zorder=order + 0.005,
        )


def _outline(camera: Camera) -> Array | None:
    """Return the sensor's edge (p, 2) in ideal pixels.

    Return None without distortion, or if the lens cannot be inverted there.
    """
    if camera.distortion is None:
        return None
    rising = np.linspace(-0.5, 0.5, 41)
    constant = np.full(41, 0.5)
    # the upper, right, lower and left edge
    u = np.concatenate((rising, constant, -rising, -constant))
    v = np.concatenate((-constant, rising, constant, -rising))
    edge = np.column_stack((u, v))
    try:
        return camera.undistort(edge * np.asarray(camera.size))
    except InvalidInput:
        return None
