"""Markers that no motion can bring to their goals: the image's allowed area between the two is not connected."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from ..constraints import FieldOfView, ImageConstraint
from ..rows import Array, IntArray

if TYPE_CHECKING:
    from .setup import Setup

COARSE, FINE = 4.0, 1.0
"""Sides of the squares by which the image is filled [px]: by small ones only where large ones do not show a connection.

Passages narrower than the last are not seen.
"""

AROUND = 2.0
"""How much larger than the image the area is that is filled, where no field of view bounds it."""


UNSOLVABLE = "no law can bring it there without violating one"
"""How the sentence about a marker that is closed off from a goal ends."""


def separated_markers(setup: Setup) -> list[str]:
    """One sentence for each marker whose pixels at the start and at a goal are in different parts of the allowed area.

    A marker's path in the image is continuous, whatever moves, so that no law can solve such a scene without violating
    a constraint. Constraints that move are left out, and so are starts and goals that are themselves forbidden. That
    nothing is separated proves nothing: markers do not move independently.
    """
    still = [one for one in setup.constraints.constraints if isinstance(one, ImageConstraint) and one.motion is None]
    start, found = setup.scene.evaluate(0.0, setup.q0, setup.qd0).pixels.position, []
    for i in range(len(start)):
        own = [one for one in still if one.markers is None or i + 1 in one.markers]
        # a field of view alone is convex
        if all(isinstance(one, FieldOfView) for one in own):
            continue
        places = np.array([start[i], *(goal.pixels[i] for goal in setup.task.goals)])
        image = np.asarray(setup.scene.camera.size)
        part, size = _parts(own, places, image, COARSE)
        if not part.all() or (part != part[0]).any():
            part, size = _parts(own, places, image, FINE)
        closed = [number for number in range(1, len(part)) if part[0] and part[number] not in (0, part[0])]
        found += [
            f"marker {i + 1} starts in a part of the image of {size:.0f} px² that its constraints close off from "
            f"goal {number}: {UNSOLVABLE}"
            for number in closed
        ]
    return found


def _parts(constraints: Sequence[ImageConstraint], places: Array, image: Array, cell: float) -> tuple[IntArray, float]:
    """The connected part in which each place (p, 2) lies, 0 where it is forbidden, and the area of the first [px²]."""
    bounded = any(isinstance(one, FieldOfView) for one in constraints)
    half = 0.5 * (1.0 if bounded else AROUND) * image + 2.0 * cell
    u, v = (np.arange(-side, side + cell, cell) for side in half)
    grid = np.stack(np.meshgrid(u, v), axis=-1)
    allowed, around = np.all([one.sigma(grid) <= 0.0 for one in constraints], axis=0), np.ones((3, 3))
    # large squares may lie on both sides of a thin obstacle: only those count that are allowed all around
    parts, _ = ndimage.label(ndimage.binary_erosion(allowed, around) if cell > FINE else allowed, around)
    column, row = np.rint((places + half) / cell).astype(int).T
    inside = (column >= 0) & (column < len(u)) & (row >= 0) & (row < len(v))
    part = np.where(inside, parts[row.clip(0, len(v) - 1), column.clip(0, len(u) - 1)], 0)
    return part, cell**2 * np.count_nonzero(parts == part[0])
