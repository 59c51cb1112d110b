"""The figure kit: what is drawn is all there, what is not is not, and matplotlib waits until it is
needed.
"""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from types import SimpleNamespace
from typing import cast
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.path import Path as MplPath
from matplotlib.text import Text
from PIL import Image

from vsconstraints.comparisons import RunRecord, StoredComparison, Suite
from vsconstraints.comparisons.runs.spec import ControllerSpec
from vsconstraints.errors import ConfigurationError
from vsconstraints.reports.drawing import draw_overview, remove_stale
from vsconstraints.reports.figures import OVERVIEW
from vsconstraints.reports.figures.overview import Centre, draw_trade_off, name_centres
from vsconstraints.reports.figures.signals import draw_errors, draw_phi
from vsconstraints.reports.figures.tracks import draw_tracks
from vsconstraints.reports.figures.view import View
from vsconstraints.reports.numbers import number as printed
from vsconstraints.reports.numbers import percent
from vsconstraints.reports.plots import (
    FORMATS,
    WIDTH,
    Figure,
    Sheet,
    decades,
    formats_of,
    line,
    logarithmic,
    looks,
    shortened,
)
from vsconstraints.reports.plots.image import Plane
from vsconstraints.reports.plots.sheet import DPI, FOOT
from vsconstraints.reports.plots.style import LOOKS, area, folded, plain, rgb, windows_of
from vsconstraints.reports.results import Results
from vsconstraints.reports.summary import law_table
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate


def grid() -> Sheet:
    sheet = Sheet()
    for ax in sheet.panels(5, 2, height=1.0, above=0.25, labels=("x", "y")):
        ax.plot([1.0, 2.0], [1.0, 10.0])
    return sheet


def test_a_sheet_grows_with_what_it_holds(tmp_path: Path) -> None:
    sheet = grid()
    assert sheet.bottom == pytest.approx(0.08 + 3 * 1.25 + FOOT)
    sheet.legend([line(f"{k}", "#000000") for k in range(7)])
    assert sheet.bottom > 0.08 + 3 * 1.25 + FOOT + 0.5
    sheet.save(tmp_path / "sheet.png")
    with Image.open(tmp_path / "sheet.png") as image:
        assert image.size == (1200, int(sheet.bottom * DPI))
        assert set(image.info) == {"dpi"}


def test_a_legend_shows_dashes_beside_marks_and_takes_entries_without_a_style_of_line() -> None:
    lengths = []
    for style in ({}, {"linestyle": "-"}, {"linestyle": "--"}, {"linestyle": (0, (4, 2))}):
        sheet = grid()
        sheet.legend([{"label": "law", "color": "#000000", "marker": "o", **style}])
        (legend,) = sheet.figure.legends
        lengths.append(legend.handlelength)
    assert lengths[0] == lengths[1] < lengths[2] == lengths[3]


def test_only_outer_panels_have_labels() -> None:
    axes = grid().figure.axes
    assert [ax.get_xlabel() for ax in axes] == ["", "", "", "x", "x"]
    assert [ax.get_ylabel() for ax in axes] == ["y", "", "y", "", "y"]


def test_a_figure_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    def nothing() -> None:
        return None

    def broken() -> Sheet:
        sheet = grid()
        sheet.figure.axes[0].set_yscale("no such scale")
        return sheet

    path = tmp_path / "figure.png"
    assert Figure("a", "a", "A.", grid).write(path)
    before = path.read_bytes()
    assert not Figure("b", "b", "B.", nothing).write(path)
    with pytest.raises(ValueError, match="no such scale"):
        Figure("c", "c", "C.", broken).write(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_tables_of_figures_load_no_matplotlib() -> None:
    code = (
        "import sys, vsconstraints.reports.figures, vsconstraints.paper.figures, "
        "vsconstraints.paper.studies\n"
        "print(sorted({'matplotlib', 'PIL', 'mpl_toolkits'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.03, 200.0, [0.1, 1.0, 10.0, 100.0]),
        (-20.0, 1.5, [-10.0, -1.0, 0.0, 1.0]),
        (-0.5, 0.5, [0.0]),
        (-2e9, 2e9, [-1e8, -1e5, -1e2, 0.0, 1e2, 1e5, 1e8]),
        (1e-2, 2e15, [1e-2, 1.0, 1e2, 1e4, 1e6, 1e8, 1e10, 1e12, 1e14]),
    ],
)
def test_decades_lie_within_limits(low: float, high: float, expected: list[float]) -> None:
    assert decades(low, high) == pytest.approx(expected)


def test_an_axis_without_positive_values_stays_linear() -> None:
    ax = Sheet().axes(1.0, 1.0, 1.0, 1.0)
    ax.plot([0.0, 1.0], [-1.0, -2.0])
    logarithmic(ax.yaxis)
    assert ax.get_yscale() == "linear"
    logarithmic(ax.yaxis, (-2.0, -1.0), 1.0)
    assert ax.get_yscale() == "symlog"
    assert [text.get_text() for text in ax.get_yticklabels()] == ["−2", "−1"]


def test_numbers_on_axes_are_plain() -> None:
    assert [plain(value) for value in (0.0, 0.001, 25.0, 1e-5, 2e-4)] == [
        "0",
        "0.001",
        "25",
        "10⁻⁵",
        "2·10⁻⁴",
    ]


def test_looks_are_distinct_and_those_of_known_controllers_fixed() -> None:
    few = looks(["tracking", "mine", "sliding-mode"])
    many = looks(["tracking", *(f"mine-{k}" for k in range(30)), "sliding-mode"])
    for chosen in (few, many):
        assert chosen["sliding-mode"].colour == LOOKS["sliding-mode"].colour
        assert len({(look.colour, look.line) for look in chosen.values()}) == len(chosen)
    # an own law looks the same whoever else is there
    assert few["mine"] == looks(["cbf-filter", "mine", "hierarchical-qp"])["mine"]
    for tuned in (looks(["predictive-tuned"]), looks(["predictive", "predictive-tuned"])):
        assert tuned["predictive-tuned"].colour == LOOKS["predictive"].colour
        assert tuned["predictive-tuned"].line == "--"
    assert shortened("potential-field-priority") == "potential-field-priority"
    assert shortened("x" * 50) == "x" * 19 + "…" + "x" * 19
    assert folded("robust-hierarchical-qp-observer", 24) == "robust-hierarchical-\nqp-observer"
    assert folded("cbf-filter", 24) == "cbf-filter"


#: Machado, Oliveira and Fernandes (2009), table 1: what a deuteranope sees of linear red, green and
#: blue.
DEUTERANOPIA = np.array(
    [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ]
)
#: Of CIE XYZ from linear sRGB (IEC 61966-2-1), and its white point D65.
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
WHITE = np.array([0.9505, 1.0, 1.0890])
TOLD_APART = 15.0  # distance in CIELAB, of which about 2 is just noticeable side by side


def lab(colour: str, seen: np.ndarray) -> np.ndarray:
    """CIELAB of a colour that is seen through a matrix on linear sRGB."""
    encoded = np.array(rgb(colour)) / 255.0
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    relative = XYZ @ np.clip(seen @ linear, 0.0, 1.0) / WHITE
    f = np.where(relative > 216 / 24389, np.cbrt(relative), (24389 / 27 * relative + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def test_colour_distances_are_those_of_the_literature() -> None:
    """Of CIELAB: sRGB red is (53.24, 80.09, 67.20) (Lindbloom); grey stays grey for a
    deuteranope.
    """
    assert lab("#FF0000", np.eye(3)) == pytest.approx([53.24, 80.09, 67.20], abs=0.05)
    assert lab("#8A8A8A", DEUTERANOPIA) == pytest.approx(lab("#8A8A8A", np.eye(3)), abs=0.05)
    assert np.linalg.norm(lab("#009E73", DEUTERANOPIA) - lab("#CC79A7", DEUTERANOPIA)) < 20.0


@pytest.mark.parametrize("seen", [np.eye(3), DEUTERANOPIA], ids=["all cones", "deuteranopia"])
def test_laws_are_told_apart_without_red_and_green(seen: np.ndarray) -> None:
    """Each pair of shipped laws differs in marker or dashes, or else in a colour that every reader
    can see.
    """
    for (one, look), (other, own) in combinations(LOOKS.items(), 2):
        distance = np.linalg.norm(lab(look.colour, seen) - lab(own.colour, seen))
        same = (look.marker, look.line) == (own.marker, own.line)
        assert not same or distance >= TOLD_APART, f"{one} and {other}: {distance:.1f}"


def test_lines_of_laws_carry_their_markers() -> None:
    """In the figures over time, at times at which no other line has one."""
    view = small_view()
    for sheet in (draw_errors(view), draw_phi(view)):
        assert sheet is not None
        for ax in sheet.figure.axes:
            drawn = [one for one in ax.lines if one.get_marker() not in ("None", None, "")]
            for one in drawn:
                (law,) = [
                    name for name in view.competitors if view.looks[name].colour == one.get_color()
                ]
                assert one.get_marker() == view.looks[law].marker
            places = [float(one.get_xdata()[k]) for one in drawn for k in one.get_markevery()]
            assert len(places) == len(set(places))
        texts = {text.get_text() for text in sheet.figure.legends[0].get_texts()}
        assert {*view.competitors} <= texts


def test_time_axes_end_where_the_action_ends() -> None:
    """The runs go on for 20 s at rest: errors are drawn until they end, rows until the last of them
    acts.
    """
    view = small_view(20.0)
    longest = max(run.trajectory.t[-1] for run in view.runs.values())
    assert longest == pytest.approx(20.0)
    for name in view.competitors:
        run = view.runs[name].trajectory
        late = run.t > view.end
        change = np.abs(run.camera_error[late] - run.camera_error[-1]).max(axis=0)
        assert (change <= 0.2 * np.array([5e-3, 5e-3])).all()
        assert not run.active[run.t > view.rows_end].any()
    assert 2.0 < view.end < 6.0
    assert 0.5 < view.rows_end < view.end
    sheet = draw_errors(view)
    assert sheet.figure.axes[0].get_xlim() == (0.0, view.end)


def small_view(duration: float = 5.0) -> View:
    """Two laws and tracking alone on the UR5's scene."""
    scenario = Scenario.load("ur5-fov").with_override("duration", duration)
    setup = scenario.setup()
    laws = ("tracking", "hierarchical-qp", "cbf-filter")
    runs = {
        law: RunRecord.of(setup, simulate(setup, ControllerSpec(law).make()), "") for law in laws
    }
    rows = ("fov[marker 1]", "fov[marker 2]")
    return View(setup, runs, laws, rows, rows)


@given(
    st.lists(st.floats(-1e3, 1e3) | st.just(math.nan), min_size=1, max_size=400),
    st.integers(1, 50),
)
def test_decimation_keeps_peaks(values: list[float], bins: int) -> None:
    t = np.arange(float(len(values)))
    y = np.array(values)
    _, least, greatest, _ = windows_of(t, y, bins)
    assert len(least) <= bins
    if np.isfinite(y).any():
        assert np.nanmax(greatest) == np.nanmax(y)
        assert np.nanmin(least) == np.nanmin(y)


def test_window_means_leave_out_what_is_no_number() -> None:
    t, _, _, mean = windows_of(np.arange(6.0), np.array([1.0, 3.0, np.nan, 5.0, np.nan, np.nan]), 3)
    assert t.tolist() == [0.5, 2.5, 4.5]
    np.testing.assert_array_equal(mean, [2.0, 5.0, np.nan])


def test_a_moving_boundary_is_drawn_while_it_is_in_the_image() -> None:
    setup = Scenario.load("moving-occluder").setup()
    size = np.asarray(setup.scene.camera.size)
    moving = Plane.of(setup).moving
    times = [t for t, _ in moving]
    assert len(times) == 5
    assert 0.0 <= times[0] < times[-1] < setup.duration
    for _, lines in moving:
        assert any((np.abs(line) < 0.5 * size).all(axis=1).any() for line in lines)
    assert Plane.of(Scenario.load("example-2d-fov").setup()).moving == ()
    told = [
        [entry["label"] for entry in plane.entries()][-1]
        for plane in (Plane.of(setup), replace(Plane.of(setup), times=(0.0,)))
    ]
    assert told == ["boundary at these times", "boundary at that time"]


@pytest.mark.parametrize("name", ["panda-fov", "case-study-6r"])
def test_a_legend_beside_tracks_covers_no_panel_and_no_label(name, tmp_path):
    """Of a wide image and of a square one: the last place of the grid is free."""
    setup = Scenario.load(name).setup()
    runs = {
        law.name: RunRecord.of(setup, simulate(setup, law.make()), "")
        for law in Suite.load().controllers
    }
    sheet = draw_tracks(View(setup, runs, tuple(runs), phi_rows=setup.constraints.labels))
    sheet.save(tmp_path / "tracks.png")
    (legend,) = sheet.figure.legends
    told = [text.get_text() for text in legend.get_texts()]
    assert len(told) >= 6  # long enough to need care
    outside = [
        run
        for law, run in runs.items()
        if law != "tracking" and (run.trajectory.clearance < -1.0).any()
    ]
    assert ("row in the image violated" in told) == bool(outside)
    placed = legend.get_window_extent()
    for ax in sheet.figure.axes:
        assert not placed.overlaps(ax.get_tightbbox()), ax.get_title(loc="left")


def test_a_long_name_leaves_room_for_how_the_run_ended():
    setup = Scenario.load("example-2d-fov").setup()
    run = RunRecord.of(setup, simulate(setup, ControllerSpec("tracking").make()), "")
    names = ("hierarchical-qp-observer", "robust-hierarchical-qp-observer")
    view = View(setup, dict.fromkeys(names, run), names)
    for ax in draw_tracks(view).placed().axes:
        law, status = (
            next(
                text for text in ax.findobj(Text) if text.get_text() == ax.get_title(loc=side) != ""
            )
            for side in ("left", "right")
        )
        assert status.get_text().strip() == "converged"
        assert law.get_window_extent().x1 + 5.0 < status.get_window_extent().x0


def test_a_figure_is_written_in_the_formats_asked_for(tmp_path: Path) -> None:
    figure = Figure("a", "a", "A.", grid)
    formats = formats_of(["pdf", "svg"])
    assert formats == ("svg", "pdf")  # pages show no PDF
    assert formats_of(["pdf"]) == ("png", "pdf")
    assert formats_of(()) == ("png",)
    assert figure.file_in(formats, "--more") == "a--more.svg"
    written = {}
    for _ in range(2):
        assert figure.write(tmp_path / figure.file_in(formats), formats=formats)
        assert sorted(path.name for path in tmp_path.iterdir()) == ["a.pdf", "a.svg"]
        earlier = written
        written = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert written == earlier
    root = ElementTree.fromstring(written["a.svg"])
    assert root.attrib["width"] == "576pt"  # 8 in
    assert written["a.pdf"].startswith(b"%PDF-")
    with pytest.raises(ConfigurationError, match=r"gif.*png.*svg"):
        formats_of(["gif"])


def test_figures_of_another_format_are_stale(tmp_path: Path) -> None:
    names = [
        "a--tracks.png",
        "a--tracks.pdf",
        "a--tracks--own.svg",
        "a--tracks.txt",
        "b--phi.svg",
        "mine.png",
    ]
    for name in names:
        (tmp_path / name).touch()
    remove_stale(tmp_path, ["a--tracks.png"], ("png", "pdf"))
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == ["a--tracks.pdf", "a--tracks.png", "a--tracks.txt", "mine.png"]


def test_the_figure_of_an_earlier_comparison_is_removed_in_every_format(tmp_path: Path) -> None:
    """Whatever the format of the new one; here there is no group of laws to draw."""
    for kind in FORMATS:
        (tmp_path / f"{OVERVIEW.name}.{kind}").touch()
        (tmp_path / f"{OVERVIEW.name}--2.{kind}").touch()
    (tmp_path / "mine.svg").touch()
    assert draw_overview(cast(Results, SimpleNamespace(groups=())), tmp_path) == ""
    assert [path.name for path in tmp_path.iterdir()] == ["mine.svg"]


def test_no_label_is_cut_however_long_its_numbers(tmp_path: Path) -> None:
    """The edges of the picture stay white; with short numbers nothing moves."""

    def drawn(number: str) -> Sheet:
        sheet = Sheet(left=0.75)
        (ax,) = sheet.panels(1, height=1.0, labels=("", "two\nlines"))
        ax.set_yticks([0.5], [number])
        return sheet

    lefts = {}
    for number in ("0.5", "0.500000000"):
        made: list[Sheet] = []
        figure = Figure(
            "a", "a", "A.", lambda number=number, made=made: made.append(drawn(number)) or made[0]
        )
        figure.write(tmp_path / "a.png")
        (ax,) = made[0].figure.axes
        lefts[number] = float(ax.get_position().x0) * WIDTH
        with Image.open(tmp_path / "a.png") as image:
            assert np.asarray(image)[:, :3].min() > 200
    assert lefts["0.5"] == pytest.approx(0.75)
    assert lefts["0.500000000"] > 0.8


def test_an_area_leaves_gaps_and_the_limits_of_its_axes() -> None:
    ax = Sheet().axes(1.0, 1.0, 1.0, 1.0)
    low = np.array([0.0, 1.0, np.nan, 2.0, 3.0])
    limits = ax.dataLim.get_points().tolist()
    area(ax, np.arange(5.0), low, low + 1.0, color="#000000")
    (drawn,) = ax.collections
    inside = [
        drawn.get_paths()[k].contains_point(point)
        for k, point in ((0, (0.5, 1.0)), (1, (3.5, 3.0)))
    ]
    assert inside == [True, True]
    assert not any(path.contains_point((2.0, 2.0)) for path in drawn.get_paths())
    assert ax.dataLim.get_points().tolist() == limits


def test_large_markers_are_the_medians_of_the_table() -> None:
    """Of the kept default comparison: what is drawn is what the report's first table prints, and
    within the ranges.
    """
    results = Results(StoredComparison.load(Path(__file__).parent.parent / "reports" / "default"))
    table = law_table(results)
    used, variation = map(
        table.header.index, ("median utilization [%]", "acceleration variation [rad/s³]")
    )
    sheet = draw_trade_off(results, results.controllers)
    (ax,) = sheet.figure.axes
    large = {
        (float(one.get_xdata()[0]), float(one.get_ydata()[0]))
        for one in ax.lines
        if one.get_markersize() > 10.0
    }
    named = {text.get_text() for text in ax.texts}
    for line_ in table.lines:
        centre = Centre.of(results.all_runs(line_[0]))
        assert percent(centre.used) == line_[used].strip("*()").partition(",")[0]
        assert printed(centre.variation) == line_[variation].strip("*()").partition(",")[0]
        assert centre.used_range[0] <= centre.used <= centre.used_range[1]
        assert centre.variation_range[0] <= centre.variation <= centre.variation_range[1]
        assert (1.0 - centre.used, centre.variation) in large
        assert line_[0] in named


def test_the_figures_of_several_groups_have_the_same_axes() -> None:
    """Groups are compared side by side: in each, all laws' runs and ranges lie within the axes."""
    results = Results(StoredComparison.load(Path(__file__).parent.parent / "reports" / "default"))
    laws = results.competitors
    groups = [laws[:2], laws[2:]]
    axes = [draw_trade_off(results, group).figure.axes[0] for group in groups]
    limits = [(ax.get_xlim(), ax.get_ylim()) for ax in axes]
    assert limits[0] == limits[1]
    for ax in axes:
        low, high = ax.get_ylim()
        drawn = np.concatenate([line_.get_ydata() for line_ in ax.lines])
        assert low < drawn.min()
        assert drawn.max() < high


@pytest.mark.parametrize("seed", range(4))
def test_names_beside_markers_cover_none_of_them(seed: int) -> None:
    """Eight laws near each other: their names lie within the panel, and no two cover each other."""
    random = np.random.default_rng(seed)
    places = zip(
        (1.0 - 10 ** random.uniform(-2.3, -1.3, 8)).tolist(),
        (10 ** random.uniform(0, 2, 8)).tolist(),
        strict=True,
    )
    centres = {
        f"law-{k}": Centre(used, variation, (used, used), (variation, variation))
        for k, (used, variation) in enumerate(places)
    }
    sheet = Sheet(left=0.72, right=0.2)
    (ax,) = sheet.panels(1, height=3.6)
    for centre in centres.values():
        ax.plot([1.0 - centre.used], [centre.variation], "o")
    logarithmic(ax.xaxis, ())
    logarithmic(ax.yaxis)
    ax.set(xlim=(0.2, 1e-3), ylim=(0.1, 1e3))
    name_centres(ax, centres, looks([*centres]), (72.0 * (WIDTH - 0.92), 72.0 * 3.6))
    figure = sheet.placed()
    # without the lines to their markers
    boxes = [Text.get_window_extent(text, figure.canvas.get_renderer()) for text in ax.texts]
    assert len(boxes) == len(centres)
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


def test_long_names_of_markers_at_one_place_move_up_and_down() -> None:
    """They are wide and low, so that two steps to the side would lead far away."""
    centres = {
        f"hierarchical-qp-{k}": Centre(0.98 + 1e-4 * k, 10.0, (0.98, 0.98), (10.0, 10.0))
        for k in range(8)
    }
    sheet = Sheet(left=0.72, right=0.2)
    (ax,) = sheet.panels(1, height=3.6)
    logarithmic(ax.xaxis, ())
    logarithmic(ax.yaxis)
    ax.set(xlim=(0.2, 1e-3), ylim=(0.1, 1e3))
    name_centres(ax, centres, looks([*centres]), (72.0 * (WIDTH - 0.92), 72.0 * 3.6))
    sheet.placed()
    up = [abs(text.xyann[1]) for text in ax.texts]
    across = [abs(text.xyann[0]) for text in ax.texts]
    width = Text.get_window_extent(ax.texts[0]).width
    assert max(across) < width
    assert max(up) > 20.0


def test_what_is_forbidden_is_drawn_where_sigma_is_positive() -> None:
    plane = Plane.of(Scenario.load("example-2d-heart-concave").setup())
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (400, 2)) * plane.half * 0.99
    sigma = np.max([c.sigma(points) for c in plane.constraints], axis=0)
    rings = [MplPath(ring) for ring in plane.forbidden]
    inside = np.sum([ring.contains_points(points) for ring in rings], axis=0) % 2 == 1
    sure = np.abs(sigma) > 0.05  # the grid's step away from a boundary
    assert sure.sum() > 300
    np.testing.assert_array_equal(inside[sure], (sigma > 0.0)[sure])
