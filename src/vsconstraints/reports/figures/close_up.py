"""Where in the image controllers differ most at a boundary: what a close-up shows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...comparisons import RunRecord
from ...comparisons.metrics import NEGLIGIBLE
from ...figures.image import Plane
from ...rows import Array
from .view import View

SHARE = 0.025
"""Half the side of the close-up, relative to the image's larger side; more where a violation is deeper."""

DEEP = 0.05
"""A violation deeper than this share of the image needs no close-up."""


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
    controller that acts on such a row comes nearest to its boundary.
    """
    size = max(plane.size)
    found = _deepest(view, DEEP * size) or _nearest(view)
    if found is None:
        return None
    centre, depth = found
    return CloseUp(centre, max(SHARE * size, 1.6 * depth))


def _shown(view: View, run: RunRecord) -> list[tuple[int, int]]:
    """The rows in the image whose φ is shown."""
    return [(i, marker) for i, marker in rows_in_image(run) if run.trajectory.labels[i] in view.phi_rows]


def _deepest(view: View, most: float) -> tuple[Array, float] | None:
    """Where a competitor is farthest outside, and how far [px]; violations by more than ``most`` are plain anyway."""
    found, worst = None, NEGLIGIBLE
    for run in view.compared:
        for i, marker in _shown(view, run):
            clearance = run.trajectory.clearance[:, i]
            k = int(np.argmin(clearance))
            if clearance[k] > -most and -clearance[k] / run.length[i] > worst:
                worst = float(-clearance[k] / run.length[i])
                found = run.trajectory.features_px[k, marker], float(-clearance[k])
    return found


def _nearest(view: View) -> tuple[Array, float] | None:
    """Where the first controller that acts on a row in the image comes nearest to the boundary of such a row."""
    for run in view.compared:
        acting = [(i, m) for i, m in _shown(view, run) if run.trajectory.active[:, i].any()]
        if acting:
            i, marker = min(acting, key=lambda pair: float(run.trajectory.clearance[:, pair[0]].min()))
            return run.trajectory.features_px[int(np.argmin(run.trajectory.clearance[:, i])), marker], 0.0
    return None
