"""Boundaries and forbidden sides of the constraints in the image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...constraints import ImageConstraint
from ...rows import Array
from ...simulation import Setup

AROUND = 1.12
"""How much of the image plane figures show, relative to the image; what lies beyond is cut off."""

FORBIDDEN = "#DCDCDC"
HATCH = "#B0B0B0"
MOMENTS = 5
"""How often a boundary that moves is drawn."""

LOOKS = 200
"""How often it is looked at to find when it is in the image."""

GRID_STEP = 2.0
"""Of the grid on which the forbidden side is found [px]; the boundary line on top of its edge is exact."""


@dataclass(frozen=True)
class Outlines:
    """What constrains markers in the image.

    Attributes
    ----------
    constraints
        Those on pixels that stand still.
    lines
        Polylines (p, 2) along their boundaries [px].
    half_size
        (2,) of the part of the image plane that is shown [px].
    moving
        Time [s] and polylines of the boundaries that move, at :data:`MOMENTS` instants from start to end.
    """

    constraints: tuple[ImageConstraint, ...]
    lines: list[Array]
    half_size: Array
    moving: list[tuple[float, list[Array]]]

    @classmethod
    def of(cls, setup: Setup | None, size: tuple[float, float]) -> Outlines:
        """Those of a setup; none if it is not known."""
        every = setup.constraints.constraints if setup is not None else ()
        image = tuple(c for c in every if isinstance(c, ImageConstraint))
        still = tuple(c for c in image if c.motion is None)
        return cls(
            still,
            [line for c in still for line in c.boundary(size)],
            0.5 * AROUND * np.asarray(size),
            _moments([c for c in image if c.motion is not None], setup.duration if setup is not None else 0.0, size),
        )

    @property
    def any(self) -> bool:
        """Whether there is anything to draw."""
        return bool(self.constraints or self.moving)

    def draw(self, ax: Any, centre: Array | None = None, half: float = 0.0) -> None:
        """Shade the forbidden side and draw the boundary on top, everywhere or within ``half`` of a centre [px]."""
        middle = np.zeros(2) if centre is None else centre
        reach = self.half_size if centre is None else np.full(2, half)
        count = int(min(max(2.0 * reach.max() / GRID_STEP, 80.0), 600.0))
        u, v = (np.linspace(m - r, m + r, count) for m, r in zip(middle, reach, strict=True))
        if self.constraints:
            grid = np.stack(np.meshgrid(u, v), axis=-1)
            # only the sign is wanted: far from a boundary values may be huge, which spoils interpolation
            sigma = np.max([np.clip(c.sigma(grid), -0.1, 0.1) for c in self.constraints], axis=0)
            if (sigma > 0.0).any():
                filled = ax.contourf(u, v, sigma, levels=[0.0, 1.0], colors=[FORBIDDEN], hatches=["/////"], zorder=0.6)
                filled.set_edgecolor(HATCH)
                filled.set_linewidth(0.0)
        for line in self.lines:
            ax.plot(line[:, 0], line[:, 1], color="#222222", linewidth=0.9, zorder=3)
        for k, (t, lines) in enumerate(self.moving):
            for line in lines:
                ax.plot(*line.T, **moving_style(k), zorder=2.1)
                middle_of_it = 0.5 * (line.min(axis=0) + line.max(axis=0))
                if centre is None:
                    ax.annotate(
                        f"{t:.1f} s",
                        middle_of_it,
                        ha="center",
                        va="center",
                        fontsize=7.5,
                        color="#444444",
                        clip_on=True,
                        annotation_clip=True,
                        zorder=2.2,
                    )


def _moments(
    moving: list[ImageConstraint], duration: float, size: tuple[float, float]
) -> list[tuple[float, list[Array]]]:
    """The moving boundaries at :data:`MOMENTS` instants from when the first is in the image to when the last is."""
    every = np.linspace(0.0, duration, LOOKS)
    lines = [(c.motion.displacement(every), line) for c in moving if c.motion for line in c.boundary(size, every)]
    half = 0.5 * np.asarray(size)
    seen = np.array([any((np.abs(line + d[k]) < half).all(axis=1).any() for d, line in lines) for k in range(LOOKS)])
    if not seen.any():
        return []
    first, last = np.flatnonzero(seen)[[0, -1]]
    at = np.unique(np.round(np.linspace(first, last, MOMENTS)).astype(int))
    return [(float(every[k]), [line + d[k] for d, line in lines]) for k in at]


def moving_style(moment: int) -> dict[str, Any]:
    """How a moving boundary is drawn at one of its moments: later ones are darker."""
    return {"color": "#222222", "linewidth": 0.9, "linestyle": "--", "alpha": 0.3 + 0.7 * moment / (MOMENTS - 1)}
