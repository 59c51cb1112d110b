"""The image plane: its frame, the boundaries and forbidden sides of constraints in it, and marks of markers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from contourpy import contour_generator

from ...constraints import ImageConstraint
from ...errors import InvalidInput
from ...rows import Array
from ...simulation import Setup
from ...vision.camera import Camera
from .marks import line, patch
from .style import FAINT, INK

AROUND = 1.12
"""How much of the image plane figures show, relative to the image; what lies beyond is cut off."""

FORBIDDEN: dict[str, Any] = {"facecolor": "#DCDCDC", "edgecolor": "#B0B0B0", "hatch": "/////"}
FRAME: dict[str, Any] = {"color": "#606060", "linewidth": 1.7, "solid_joinstyle": "miter"}
BOUNDARY: dict[str, Any] = {"color": INK, "linewidth": 0.9}

LABELLED = 0.93
"""How far from the centre a time may stand, relative to the half of what is shown."""

MOMENTS = 5
"""How often a boundary that moves is drawn."""

INSTANTS = 200
"""At how many instants it is asked whether it is in the image."""

GRID_STEP = 2.0
"""Of the grid on which the forbidden side is found [px]; the boundary line on top of its edge is exact."""


@dataclass(frozen=True)
class Plane:
    """The image plane of a camera, and what constrains markers in it.

    Attributes
    ----------
    size
        Width and height of the image [px].
    constraints
        Those on pixels that stand still.
    lines
        Polylines (p, 2) along their boundaries [px].
    moving
        Time [s] and polylines of the boundaries that move, at :data:`MOMENTS` instants from start to end.
    outline
        (p, 2) the sensor's edge, where the lens bends it [px]; None if it is the rectangle of that size.
    """

    size: tuple[float, float]
    constraints: tuple[ImageConstraint, ...] = ()
    lines: tuple[Array, ...] = ()
    moving: tuple[tuple[float, list[Array]], ...] = ()
    outline: Array | None = None

    @classmethod
    def of(cls, setup: Setup) -> Plane:
        """That of a setup."""
        width, height = setup.scene.camera.size
        size = float(width), float(height)
        image = [c for c in setup.constraints.constraints if isinstance(c, ImageConstraint)]
        still = tuple(c for c in image if c.motion is None)
        moving = _moments([c for c in image if c.motion is not None], setup.duration, size)
        lines = tuple(points for c in still for points in c.boundary(size))
        return cls(size, still, lines, moving, _outline(setup.scene.camera))

    @classmethod
    def at(cls, setup: Setup, t: float) -> Plane:
        """That of a setup with what moves in it where it is at time ``t`` [s]."""
        plane = cls.of(setup)
        moving = [c for c in setup.constraints.constraints if isinstance(c, ImageConstraint) and c.motion is not None]
        every = np.linspace(0.0, setup.duration, INSTANTS)
        lines: list[Array] = []
        for c in moving:
            if c.motion is not None:
                lines += [line + c.motion.displacement(t) for line in c.boundary(plane.size, every)]
        return replace(plane, moving=((t, lines),)) if lines else plane

    @property
    def half(self) -> Array:
        """(2,) half the size of the part that is shown [px]."""
        half: Array = 0.5 * np.asarray(self.size)
        return AROUND * (half if self.outline is None else np.maximum(half, np.abs(self.outline).max(axis=0)))

    @property
    def whole(self) -> Part:
        """All of it that is shown."""
        return self.part(np.zeros(2), self.half)

    def draw(self, ax: Any, *, labels: bool = True, upwards: bool = False, part: Part | None = None) -> None:
        """The whole plane; ``v`` points down, as in an image, or upwards.

        ``part`` is :attr:`whole`, where it is known already: it is the same in all panels.
        """
        from matplotlib.ticker import MaxNLocator

        u, v = self.half
        (part or self.whole).draw(ax)
        for t, lines in self.moving:
            for points in lines:
                middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
                if (np.abs(middle) > LABELLED * self.half).any():
                    continue  # its time would be cut off
                time: dict[str, Any] = {"fontsize": 7.5, "color": FAINT, "zorder": 2.2}
                ax.annotate(f"{t:.1f} s", middle, ha="center", va="center", clip_on=True, annotation_clip=True, **time)
        if self.outline is None:
            square(ax, np.zeros(2), u / AROUND, v / AROUND, **FRAME, zorder=2.5)
        else:
            ax.plot(*self.outline.T, **FRAME, zorder=2.5)
        ax.set_ylim(*((-v, v) if upwards else (v, -v)))
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_locator(MaxNLocator(7, steps=[1, 2, 5, 10], symmetric=True))
        if labels:
            ax.set_xlabel("u [px]", labelpad=1)
            ax.set_ylabel(f"v [px], {'upwards' if upwards else 'downwards'}", labelpad=1)

    def part(self, centre: Array, half: Array) -> Part:
        """What lies within ``half`` (2,) of a centre (2,) [px]."""
        count = int(min(max(2.0 * half.max() / GRID_STEP, 80.0), 600.0))
        u, v = (np.linspace(m - r, m + r, count) for m, r in zip(centre, half, strict=True))
        forbidden: list[Array] = []
        if self.constraints:
            sigma = self.depth(u, v)
            outer = contour_generator(u, v, sigma, fill_type="OuterOffset").filled(0.0, 1.0)
            forbidden = [
                ring
                for points, offsets in zip(*outer, strict=True)
                for ring in np.split(np.asarray(points), np.asarray(offsets[1:-1], dtype=int))
            ]
        return Part(self, centre, half, tuple(forbidden))

    def depth(self, u: Array, v: Array) -> Array:
        """(b, a) the greatest σ of constraints that stand still, cut at ±0.1, on a grid of u (a,) and v (b,) [px]."""
        grid = np.stack(np.meshgrid(u, v), axis=-1)
        # only the sign is wanted: far from a boundary values may be huge, which spoils interpolation
        depth: Array = np.max([np.clip(c.sigma(grid), -0.1, 0.1) for c in self.constraints], axis=0)
        return depth

    def entries(self, boundary: str = "", forbidden: str = "forbidden") -> list[dict[str, Any]]:
        """Legend entries of the image and of what is drawn in it; of the boundary if it has a name."""
        entries = [patch("image", "none", edgecolor=FRAME["color"], linewidth=FRAME["linewidth"])]
        if boundary:
            entries.append(line(boundary, **BOUNDARY))
        if self.constraints:
            entries.append(patch(forbidden, **FORBIDDEN))
        if self.moving:
            where = "at the times given" if len(self.moving) > 1 else "where it is then"
            entries.append(line(f"moving boundary, {where}", **_moving(2, MOMENTS)))
        return entries


@dataclass(frozen=True)
class Part:
    """A rectangle of an image plane, and the outlines (p, 2) of what is forbidden in it, holes among them [px]."""

    plane: Plane
    centre: Array
    half: Array
    forbidden: tuple[Array, ...]

    def draw(self, ax: Any) -> None:
        """The forbidden side and the boundaries; ``v`` points down."""
        from matplotlib.patches import PathPatch
        from matplotlib.path import Path

        if self.forbidden:
            rings = Path.make_compound_path(*(Path(ring, closed=True) for ring in self.forbidden))
            ax.add_artist(PathPatch(rings, **FORBIDDEN, linewidth=0.0, zorder=0.6))
        for points in self.plane.lines:
            ax.plot(*points.T, **BOUNDARY, zorder=3)
        for k, (_, lines) in enumerate(self.plane.moving):
            for points in lines:
                ax.plot(*points.T, **_moving(k, len(self.plane.moving)), zorder=2.1)
        (u, v), (du, dv) = self.centre, self.half
        ax.set_xlim(u - du, u + du)
        ax.set_ylim(v + dv, v - dv)
        ax.grid(False)


def square(ax: Any, centre: Sequence[float] | Array, half_u: float, half_v: float, **look: Any) -> None:
    """The outline of a part of the image [px]."""
    (u, v), signs = centre, ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
    ax.plot([u + i * half_u for i, _ in signs], [v + j * half_v for _, j in signs], **look)


def tracks(ax: Any, pixels: Array, **look: Any) -> None:
    """Paths (N, M, 2) of markers in the image."""
    for i in range(pixels.shape[1]):
        ax.plot(*pixels[:, i].T, **look)


def _outline(camera: Camera) -> Array | None:
    """(p, 2) the sensor's edge in ideal pixels; None without distortion, or where the lens cannot be inverted there."""
    if camera.distortion is None:
        return None
    side, ends = np.linspace(-0.5, 0.5, 41), np.full(41, 0.5)
    across, down = (side, -side, -ends, ends), (-ends, ends, -side, side)
    edge = np.stack([np.concatenate([part[k] for k in (0, 3, 1, 2)]) for part in (across, down)], axis=1)
    try:
        return camera.undistort(edge * np.asarray(camera.size))
    except InvalidInput:
        return None


def _moments(
    moving: list[ImageConstraint], duration: float, size: tuple[float, float]
) -> tuple[tuple[float, list[Array]], ...]:
    """The moving boundaries at :data:`MOMENTS` instants from when the first is in the image to when the last is."""
    every = np.linspace(0.0, duration, INSTANTS)
    lines = [(c.motion.displacement(every), line) for c in moving if c.motion for line in c.boundary(size, every)]
    half = 0.5 * np.asarray(size)
    seen = np.array([any((np.abs(line + d[k]) < half).all(axis=1).any() for d, line in lines) for k in range(INSTANTS)])
    if not seen.any():
        return ()
    first, last = np.flatnonzero(seen)[[0, -1]]
    at = np.unique(np.round(np.linspace(first, last, MOMENTS)).astype(int))
    return tuple((float(every[k]), [line + d[k] for d, line in lines]) for k in at)


def _moving(moment: int, of: int) -> dict[str, Any]:
    """How a moving boundary is drawn at one of its moments: later ones are darker."""
    return {**BOUNDARY, "linestyle": "--", "alpha": 0.3 + 0.7 * moment / (of - 1) if of > 1 else 1.0}
