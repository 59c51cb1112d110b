"""Where in the image controllers differ most at a boundary: what a close-up shows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...comparisons import RunRecord
from ...comparisons.metrics import NEGLIGIBLE
from ...rows import Array
from ..plots.image import Plane
from .view import View

SHARE = 0.025
"""Half the side of the close-up, relative to the image's larger side; more where a violation is deeper."""

DEEP = 0.05
"""A violation deeper than this share of the image needs no close-up."""

GRID = 33
"""Points in each direction at which it is asked whether a boundary passes."""


class CloseUp(NamedTuple):
    """A square of the image: its centre (2,) and half its side [px]."""

    centre: Array
    half: float


def rows_in_image(run: RunRecord) -> list[tuple[int, int]]:
    """Index of each row that is about a marker's place in the image, and of its marker."""
    found, count = [], run.trajectory.features_px.shape[1]
    for i, (label, unit) in enumerate(zip(run.trajectory.labels, run.units, strict=True)):
        digits = label.rpartition("marker ")[2].rstrip("]")
        if unit == "px" and digits.isdecimal() and int(digits) <= count:
            found.append((i, int(digits) - 1))
    return found


def close_up(view: View, plane: Plane) -> CloseUp | None:
    """The same close-up for all panels, or None where no row in the image matters.

    Around the deepest violation of a competitor if there is one; otherwise where the first
    controller that acts on such a row comes nearest to its boundary. It lies in the part of the plane that is
    shown, and a boundary passes through it: without one there is nothing to see.
    """
    size = max(plane.size)
    for found in (_deepest(view, plane, DEEP * size), _nearest(view, plane)):
        if found is not None:
            centre, depth = found
            detail = CloseUp(centre, max(SHARE * size, 1.6 * depth))
            if _bounded(plane, detail):
                return detail
    return None


def comes_here(run: RunRecord, detail: CloseUp) -> bool:
    """Whether a marker of a run comes into the close-up, between samples included."""
    from matplotlib.path import Path
    from matplotlib.transforms import Bbox

    pixels, window = run.trajectory.features_px, Bbox([detail.centre - detail.half, detail.centre + detail.half])
    known = (track[np.isfinite(track).all(axis=1)] for track in np.moveaxis(pixels, 1, 0))
    return any(len(track) > 0 and Path(track).intersects_bbox(window, filled=False) for track in known)


def _bounded(plane: Plane, detail: CloseUp) -> bool:
    """Whether a boundary passes through a close-up."""
    moving = [points for _, lines in plane.moving for points in lines]
    if any((np.abs(points - detail.centre) < detail.half).all(axis=1).any() for points in moving):
        return True
    if not plane.constraints:
        return False
    u, v = (middle + np.linspace(-detail.half, detail.half, GRID) for middle in detail.centre)
    depth = plane.depth(u, v)
    return bool(depth.min() <= 0.0 <= depth.max())


def _shown(view: View, run: RunRecord) -> list[tuple[int, int]]:
    """The rows in the image whose φ is shown."""
    return [(i, marker) for i, marker in rows_in_image(run) if run.trajectory.labels[i] in view.phi_rows]


def _deepest(view: View, plane: Plane, most: float) -> tuple[Array, float] | None:
    """Where a competitor is farthest outside, and how far [px]; violations by more than ``most`` are plain anyway."""
    found, worst = None, NEGLIGIBLE
    for run in view.compared:
        for i, marker in _shown(view, run):
            clearance = _in_view(run, plane, i, marker)
            k = int(np.argmin(clearance))
            if -most < clearance[k] < 0.0 and -clearance[k] / run.length[i] > worst:
                worst = float(-clearance[k] / run.length[i])
                found = run.trajectory.features_px[k, marker], float(-clearance[k])
    return found


def _nearest(view: View, plane: Plane) -> tuple[Array, float] | None:
    """Where the first controller that acts on a row in the image comes nearest to the boundary of such a row."""
    for run in view.compared:
        acting = [(i, m) for i, m in _shown(view, run) if run.trajectory.active[:, i].any()]
        if acting:
            i, marker = min(acting, key=lambda pair: float(_in_view(run, plane, *pair).min()))
            return run.trajectory.features_px[int(np.argmin(_in_view(run, plane, i, marker))), marker], 0.0
    return None


def _in_view(run: RunRecord, plane: Plane, i: int, marker: int) -> Array:
    """(N,) clearance of a row [px], infinite where its marker is not in the part of the plane that is shown."""
    seen = (np.abs(run.trajectory.features_px[:, marker]) <= plane.half).all(axis=1)
    clearance: Array = np.where(seen, run.trajectory.clearance[:, i], np.inf)
    return clearance
