"""Solid bodies in figures: what is drawn does not depend on what happens to be in memory."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from vsconstraints.reports.plots.mesh import PLATE, Mesh


def picture(mesh: Mesh, elevation: float = 20.0, azimuth: float = 30.0) -> Any:
    figure = Figure(figsize=(2.0, 2.0), dpi=60)
    canvas = FigureCanvasAgg(figure)
    ax = figure.add_subplot(projection="3d", computed_zorder=False)
    mesh.draw(ax, [0.0, 0.0, 0.0], 1.0, elevation, azimuth)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba()).copy()


def test_polygons_of_several_sizes_are_drawn_whatever_is_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """matplotlib pads polygons with memory it has not written; of great numbers there the projection overflows."""
    mesh = Mesh()
    mesh.tube(np.array([[-0.5, 0.0, 0.0], [0.5, 0.2, 0.1]]), 0.2, "#3366CC")  # squares, and caps of ten corners
    mesh.add(np.array([[0.0, 0.0, 0.5], [0.5, 0.0, 0.5], [0.0, 0.5, 0.6]]), "#CC3333")
    clean, empty = picture(mesh), np.empty

    def dirty(*args: Any, **options: Any) -> Any:
        made = empty(*args, **options)
        if made.dtype == np.float64:
            made.fill(np.finfo(float).max)
        return made

    with monkeypatch.context() as patched, np.errstate(over="raise"):
        patched.setattr(np, "empty", dirty)
        again = picture(mesh)
    np.testing.assert_array_equal(again, clean)
    assert len(np.unique(clean.reshape(-1, 4), axis=0)) > 10


def test_nothing_is_drawn_of_nothing() -> None:
    assert (picture(Mesh()) == 255).all()


@pytest.mark.parametrize("azimuth", [-60.0, 30.0, 120.0, 210.0])
def test_a_plate_hides_none_of_its_markers(azimuth: float) -> None:
    """Polygons are ordered by their mean distance: a plate in one piece is drawn over the markers behind its middle."""
    markers = 0.5 * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    seen = []
    for number in range(4):
        with_all, without_one = Mesh(), Mesh()
        with_all.target(markers, 0.01, 0.08)
        without_one.target(markers, 0.01, 0.08)
        without_one.polygons, without_one.colours = _without_marker(without_one, markers[number])
        differs = (picture(with_all, 45.0, azimuth) != picture(without_one, 45.0, azimuth)).any(axis=-1)
        seen.append(int(differs.sum()))
    assert min(seen) > 0.6 * max(seen), seen


def _without_marker(mesh: Mesh, place: Any) -> tuple[list[Any], list[str]]:
    kept = [
        (polygon, colour)
        for polygon, colour in zip(mesh.polygons, mesh.colours, strict=True)
        if np.abs(polygon - place).max() > 0.081 or colour == PLATE
    ]
    return [polygon for polygon, _ in kept], [colour for _, colour in kept]
