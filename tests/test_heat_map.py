"""The heat map of many scenes by many laws."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.collections import QuadMesh

from vsconstraints.reports.figures.overview import COLOURS, HeatMap, draw_heat_map
from vsconstraints.reports.plots import WIDTH, Figure
from vsconstraints.reports.plots.style import STYLE


def made(r: int, c: int, name: str = "law") -> HeatMap:
    values = np.random.default_rng(0).uniform(size=(r, c))
    values[0, 0] = np.nan
    texts = [[f"{100.0 * x:.0f}" if np.isfinite(x) else "–" for x in line] for line in values]
    return HeatMap([f"family {i}" for i in range(r)], [f"{name}-{k}" for k in range(c)], values, texts)


def test_every_value_is_a_cell_of_its_colour_at_its_place() -> None:
    import matplotlib

    shown = made(3, 4)
    sheet = draw_heat_map(shown)
    assert sheet is not None
    ax = sheet.figure.axes[0]
    (mesh,) = (part for part in ax.collections if isinstance(part, QuadMesh))
    values = np.ma.filled(mesh.get_array(), np.nan)
    np.testing.assert_array_equal(values, shown.values)
    mesh.update_scalarmappable()
    expected = matplotlib.colormaps[COLOURS](shown.values[2, 1])
    np.testing.assert_allclose(mesh.get_facecolor().reshape(3, 4, 4)[2, 1], expected)
    assert ax.get_ylim() == (2.5, -0.5)  # the first row on top
    assert {(text.get_position(), text.get_text()) for text in ax.texts} == {
        ((k, i), shown.texts[i][k]) for i in range(3) for k in range(4)
    }


def test_texts_are_left_out_where_cells_are_too_small() -> None:
    for r, c in ((100, 3), (3, 60)):
        sheet = draw_heat_map(made(r, c))
        assert sheet is not None
        assert not sheet.figure.axes[0].texts


@pytest.mark.parametrize(("r", "c"), [(1, 1), (2, 30), (120, 7)])
def test_it_fits_the_sheet(r: int, c: int, tmp_path: Path) -> None:
    shown = made(r, c, "a-law-with-a-very-long-name-indeed")
    with rc_context(STYLE):
        sheet = draw_heat_map(shown)
        assert sheet is not None
        sheet.save(tmp_path / "map.png")
    inches = sheet.figure.get_tightbbox()
    assert inches.x0 >= -0.01
    assert inches.x1 <= WIDTH + 0.01
    assert inches.y0 >= -0.01


def test_nothing_is_drawn_of_nothing(tmp_path: Path) -> None:
    figure = Figure("map", "t", "c", draw_heat_map)
    assert not figure.write(tmp_path / "map.png", HeatMap([], ["law"], np.empty((0, 1))))
    assert not figure.write(tmp_path / "map.png", HeatMap(["scene"], [], np.empty((1, 0))))
    assert figure.write(tmp_path / "map.png", made(1, 1))
