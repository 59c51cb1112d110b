"""The scene in space: what hides what, and that a constraint of a user's own is drawn and hides markers everywhere."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from vsconstraints.reports.plots import INK
from vsconstraints.reports.scene3d import Scene3D, Viewpoint


def picture(scene: Scene3D, elevation: float = 20.0, azimuth: float = 30.0) -> Any:
    figure = Figure(figsize=(2.0, 2.0), dpi=60)
    canvas = FigureCanvasAgg(figure)
    ax = figure.add_subplot(projection="3d", computed_zorder=False)
    scene.draw(ax, Viewpoint(np.zeros(3), 1.0, elevation, azimuth), whole=False)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba()).copy()


def test_nothing_is_drawn_of_nothing() -> None:
    assert (picture(Scene3D()) == 255).all()


@pytest.mark.parametrize("azimuth", [-60.0, 30.0, 120.0, 210.0])
def test_a_plate_hides_none_of_its_markers(azimuth: float) -> None:
    """Polygons are ordered by their mean distance: a plate in one piece is drawn over the markers behind its middle."""
    markers = 0.5 * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    seen = []
    for number in range(4):
        with_all, without_one = Scene3D(), Scene3D()
        with_all.target(markers, 0.01, 0.08)
        without_one.target(markers, 0.01, 0.08)
        without_one.parts = [part for part in with_all.parts if part.name != "markers"]
        for other in np.delete(markers, number, axis=0):
            without_one.ball(other, 0.08, INK, 10)
        differs = (picture(with_all, 45.0, azimuth) != picture(without_one, 45.0, azimuth)).any(axis=-1)
        seen.append(int(differs.sum()))
    assert min(seen) > 0.6 * max(seen), seen
