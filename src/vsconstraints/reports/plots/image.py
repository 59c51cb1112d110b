"""Image plane: its frame, the boundaries and forbidden sides of constraints, and markers."""

from __future__ import annotations

from collections.abc import Sequence
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
from .style import FAINT, INK, line, patch, symbol

# Size of the shown part of the image plane, relative to the image; the rest is cut off.
AROUND = 1.12
FORBIDDEN: dict[str, Any] = {"facecolor": "#DCDCDC", "edgecolor": "#B0B0B0", "hatch": "/////"}
FRAME: dict[str, Any] = {"color": "#606060", "linewidth": 1.7, "solid_joinstyle": "miter"}
BOUNDARY: dict[str, Any] = {"color": INK, "linewidth": 0.9}
LABELLED = 0.93  # farthest place of a time from the centre, relative to half of the shown part
#: Most drawings of a moving boundary; instants at which its presence in the image is checked.
MOMENTS = 5
INSTANTS = 200
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
        image = [c for c in setup.constraints.constraints if isinstance(c, ImageConstraint)]
        every = np.linspace(0.0, setup.duration, INSTANTS)
        drifting = tuple(
            (c, c.motion, c.boundary((width, height), every)) for c in image if c.motion is not None
        )
        still = tuple(c for c in image if c.motion is None)
        plane = cls((width, height), still, drifting, (), _outline(setup.scene.camera))
        half = 0.5 * np.array(plane.size)
        seen = [
            any((np.abs(line) < half).all(axis=1).any() for line in plane.moved(t)) for t in every
        ]
        if any(seen):
            first, last = np.flatnonzero(seen)[[0, -1]]
            plane.times = tuple(
                every[np.unique(np.round(np.linspace(first, last, MOMENTS)).astype(int))]
            )
        return plane

    def moved(self, t: float) -> list[Array]:
        """Return polylines (p, 2) of the moving boundaries at a time [px]."""
        return [
            line + motion.displacement(t) for _, motion, lines in self.drifting for line in lines
        ]

    @property
    def moving(self) -> tuple[tuple[float, list[Array]], ...]:
        """Times [s] and polylines of the moving boundaries, as they are drawn."""
        return tuple((t, lines) for t in self.times if (lines := self.moved(t)))

    @cached_property
    def lines(self) -> list[Array]:
        """Polylines (p, 2) along the fixed boundaries [px]."""
        return [points for c in self.constraints for points in c.boundary(self.size)]

    @property
    def edge(self) -> Array:
        """Edge of the sensor (p, 2) as a closed line [px].

        It is the rectangle of the image's size if there is no distortion.
        """
        corners = 0.5 * np.asarray(self.size) * [[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]
        return corners if self.outline is None else self.outline

    @property
    def half(self) -> Array:
        """Half the size (2,) of the shown part [px]."""
        return np.asarray(
            AROUND * np.maximum(0.5 * np.asarray(self.size), np.abs(self.edge).max(axis=0))
        )

    @cached_property
    def forbidden(self) -> list[Array]:
        """Outlines (p, 2) of the forbidden areas in the shown part, including holes [px]."""
        return self.forbidden_within(np.zeros(2), self.half)

    def forbidden_within(self, centre: Array, half: Array) -> list[Array]:
        """Return outlines (p, 2) of forbidden areas within ``half`` (2,) of a centre (2,) [px]."""
        if not self.constraints:
            return []
        count = int(min(max(2.0 * half.max() / GRID_STEP, 80.0), 600.0))
        u, v = (np.linspace(m - r, m + r, count) for m, r in zip(centre, half, strict=True))
        filled = contour_generator(u, v, self.depth(u, v), fill_type="OuterOffset").filled(0.0, 1.0)
        return [
            ring
            for points, ends in zip(*filled, strict=True)
            for ring in np.split(points, ends[1:-1].astype(int))
        ]

    def depth(self, u: Array, v: Array) -> Array:
        """Return the greatest σ (b, a) of fixed constraints on a grid of u (a,) and v (b,) [px].

        Values are clipped at ±0.1.
        """
        grid = np.stack(np.meshgrid(u, v), axis=-1)
        # Only the sign is needed; huge values far from a boundary would spoil interpolation.
        return np.asarray(
            np.max(
                [np.clip(c.sigma(grid), -0.1, 0.1) for c in self.constraints], axis=0, initial=-0.1
            )
        )

    def draw(self, ax: Any, *, labels: bool = True, upwards: bool = False) -> None:
        """Draw the whole plane; ``v`` points down, as in an image, or up with ``upwards``."""
        from matplotlib.ticker import MaxNLocator

        self.draw_part(ax, np.zeros(2), self.half, self.forbidden)
        for t, lines in self.moving:
            for points in lines:
                middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
                if (np.abs(middle) <= LABELLED * self.half).all():  # a time beyond would be cut off
                    place: dict[str, Any] = {
                        "ha": "center",
                        "va": "center",
                        "clip_on": True,
                        "annotation_clip": True,
                    }
                    ax.annotate(
                        f"{t:.1f} s", middle, **place, fontsize=7.5, color=FAINT, zorder=2.2
                    )
        ax.plot(*self.edge.T, **FRAME, zorder=2.5)
        if upwards:
            ax.invert_yaxis()
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_locator(MaxNLocator(7, steps=[1, 2, 5, 10], symmetric=True))
        if labels:
            ax.set_xlabel("u [px]", labelpad=1)
            ax.set_ylabel(f"v [px], {'upwards' if upwards else 'downwards'}", labelpad=1)

    def draw_part(
        self, ax: Any, centre: Array, half: Array, forbidden: list[Array] | None = None
    ) -> None:
        """Draw the forbidden side and the boundaries within ``half`` (2,) of a centre (2,).

        ``v`` points down.
        """
        from matplotlib.patches import PathPatch
        from matplotlib.path import Path

        if rings := self.forbidden_within(centre, half) if forbidden is None else forbidden:
            outlines = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
            ax.add_artist(PathPatch(outlines, **FORBIDDEN, linewidth=0.0, zorder=0.6))
        for points in self.lines:
            ax.plot(*points.T, **BOUNDARY, zorder=3)
        for k, (_, lines) in enumerate(self.moving):
            for points in lines:
                ax.plot(*points.T, **_moving(k, len(self.times)), zorder=2.1)
        ax.set_xlim(centre[0] - half[0], centre[0] + half[0])
        ax.set_ylim(centre[1] + half[1], centre[1] - half[1])
        ax.grid(False)

    def entries(self, boundary: str = "", forbidden: str = "forbidden") -> list[dict[str, Any]]:
        """Return legend entries of the image and its contents; of the boundary if it has a name."""
        when = "these times" if len(self.times) > 1 else "that time"
        return [
            patch("image", "none", edgecolor=FRAME["color"], linewidth=FRAME["linewidth"]),
            *[line(boundary, **BOUNDARY)] * bool(boundary),
            *[patch(forbidden, **FORBIDDEN)] * bool(self.constraints),
            *[line(f"boundary at {when}", **_moving(2, MOMENTS))] * bool(self.moving),
        ]


def _moving(moment: int, of: int) -> dict[str, Any]:
    """Return the style of a moving boundary at one of its moments; later ones are darker."""
    return {
        **BOUNDARY,
        "linestyle": "--",
        "alpha": 0.3 + 0.7 * moment / (of - 1) if of > 1 else 1.0,
    }


def square(
    ax: Any, centre: Sequence[float] | Array, half_u: float, half_v: float, **look: Any
) -> None:
    """Draw the outline of a part of the image [px]."""
    u, v = centre
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
    ax.plot([u + i * half_u for i, _ in signs], [v + j * half_v for _, j in signs], **look)


def tracks(ax: Any, pixels: Array, **look: Any) -> None:
    """Draw the paths (N, M, 2) of markers in the image."""
    for i in range(pixels.shape[1]):
        ax.plot(*pixels[:, i].T, **look)


#: Symbol of markers with numbers; colour of violations and of markers beyond the shown part.
START = symbol("o", "white", size=10.5)
OUTSIDE = "#B00020"


def numbered(ax: Any, pixels: Array, within: Array | None = None) -> None:
    """Draw discs with numbers at markers (M, 2).

    Markers beyond ``within`` (2,) are drawn at its edge, in red.
    """
    for i, marker in enumerate(pixels):
        if np.isfinite(marker).all():
            u, v = marker if within is None else np.clip(marker, -within, within)
            colour = INK if (u, v) == tuple(marker) else OUTSIDE
            order = 6.4 + 0.01 * i
            clip = within is None
            ax.plot(u, v, **START | {"markeredgecolor": colour}, zorder=order, clip_on=clip)
            place: dict[str, Any] = {"ha": "center", "va": "center_baseline", "clip_on": clip}
            ax.text(u, v, str(i + 1), fontsize=8, color=colour, zorder=order + 0.005, **place)


def _outline(camera: Camera) -> Array | None:
    """Return the sensor's edge (p, 2) in ideal pixels.

    Return None without distortion, or if the lens cannot be inverted there.
    """
    if camera.distortion is None:
        return None
    side = np.linspace(-0.5, 0.5, 41)
    ends = np.full(41, 0.5)
    edge = np.stack(
        (np.concatenate((side, ends, -side, -ends)), np.concatenate((-ends, side, ends, -side))),
        axis=1,
    )
    try:
        return camera.undistort(edge * np.asarray(camera.size))
    except InvalidInput:
        return None
