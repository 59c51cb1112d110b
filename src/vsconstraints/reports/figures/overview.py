"""The figure of a whole comparison: utilization against acceleration variation."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import Any, NamedTuple

from ...comparisons.suite import BASELINE
from ..numbers import finite_values, median
from ..plots import Look, Sheet, Style, darker, decades, line, logarithmic, looks, shortened, symbol
from ..plots.sheet import POINTS, WIDTH
from ..results import Line, Results

# Share of unused space below which points are drawn at the edge.
LEAST_UNUSED = 1e-4
# Ticks of utilization.
SHARES = (0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.998, 0.999, 0.9995, 0.9999)
HEIGHT = 3.6
GREY = "#666666"
# Sizes of markers [pt].
SMALL = 5.0
LARGE = 11.0
HOLLOW = symbol(
    "o",
    "white",
    GREY,
    7.0,
    label="hollow: a constraint was violated",
    markeredgewidth=1.5,
)
RANGE: Style = {"linewidth": 0.9, "alpha": 0.55, "zorder": 2.5}
# Width of a bold letter of a name, and height of a name [pt].
LETTER = 5.6
TEXT_HEIGHT = 11.0
#: Offsets of a name from its marker in steps of its size, by preference: right, left, above, …
NEAR = ((1, 0), (-1, 0), (0, 1), (0, -1))
#: Offsets (across, up) at which a line leads from the name to its marker. A name is wide and low:
#: it moves up or down.
FAR = (
    *((across, up) for up in (1, -1, 2, -2, 3, -3) for across in (1, -1)),
    *((0, up) for up in (2, -2, 3, -3)),
)
LEADER: Style = {"arrowstyle": "-", "linewidth": 0.8, "shrinkA": 1.0, "shrinkB": 4.0}
NAME_BOX: Style = {
    "boxstyle": "square,pad=0.05",
    "facecolor": "white",
    "edgecolor": "none",
    "alpha": 0.8,
}


def shown_runs(results: Results, controllers: Sequence[str]) -> dict[str, list[Line]]:
    """Return the runs that a row limited and that moved, by controller.

    The other runs have no place in the figure.
    """
    shown: dict[str, list[Line]] = {}
    for name in controllers:
        if name == BASELINE:
            continue
        shown[name] = []
        for run in results.all_runs(name):
            is_limited = math.isfinite(run["utilization"])
            if is_limited and run["acceleration_variation"] > 0.0:
                shown[name].append(run)
    return shown


class Centre(NamedTuple):
    """Medians and ranges of a controller's converged runs, as in the first table of the report."""

    used: float  #: Median utilization.
    variation: float  #: Median acceleration variation [rad/s³].
    used_range: tuple[float, float]
    variation_range: tuple[float, float]

    @classmethod
    def of(cls, runs: Sequence[Line]) -> Centre:
        """Compute medians and ranges from lines of results.csv."""
        converged = [run for run in runs if run["status"] == "converged"]
        used = finite_values(run["utilization"] for run in converged)
        variation = finite_values(run["acceleration_variation"] for run in converged)
        if not used or not variation:
            used = variation = [math.nan]
        return cls(
            used=median(used),
            variation=median(variation),
            used_range=(min(used), max(used)),
            variation_range=(min(variation), max(variation)),
        )


def draw_trade_off(results: Results, controllers: Sequence[str]) -> Sheet | None:
    """Draw each run as a small marker, and the medians of each controller as a large one.

    Large markers have the controller's name and ranges.
    """
    runs_of_all = shown_runs(results, results.competitors)
    drawn = []
    for name, runs in runs_of_all.items():
        if runs and name in controllers:
            drawn.append(name)
    if not drawn:
        return None
    look = looks(controllers)
    sheet = Sheet(left=0.72, right=0.2)
    (ax,) = sheet.panels(1, height=HEIGHT, above=0.02)
    centres = {name: Centre.of(results.all_runs(name)) for name in runs_of_all}
    named = {}
    without_name = {}
    for name in drawn:
        for run in runs_of_all[name]:
            _mark_run(ax, run, look[name])
        if centres[name].variation > 0.0:
            named[name] = centres[name]
        else:
            without_name[name] = look[name]
    for name, centre in named.items():
        _mark_centre(ax, centre, look[name])
    # Axes are those of all controllers, so that the figures of several groups can be compared.
    runs_of_axes = [*chain(*runs_of_all.values())]
    _scale_axes(ax, runs_of_axes, centres.values())
    width = WIDTH - sheet.left - sheet.right
    name_centres(ax, named, look, (POINTS * width, POINTS * HEIGHT))
    sheet.bottom += 0.08
    sheet.legend(_entries(without_name), 2)
    return sheet


def _entries(without_name: Mapping[str, Look]) -> list[Style]:
    """Return the legend entries of controllers without a name in the figure, and of the marks."""
    entries = []
    for name, look in without_name.items():
        label = shortened(name)
        entries.append(symbol(look.marker, look.colour, look.colour, 8.0, label=label))
    entries += [
        symbol("o", GREY, GREY, LARGE, label="medians of the runs that converged"),
        line("from the least to the greatest of them", GREY, linewidth=RANGE["linewidth"]),
        symbol("o", GREY, GREY, SMALL, label="one run"),
        HOLLOW,
    ]
    return entries


def _scale_axes(ax: Any, runs: Sequence[Line], centres: Iterable[Centre]) -> None:
    """Set limits, logarithmic scales, ticks and labels for these runs and medians."""
    variations = [run["acceleration_variation"] for run in runs]
    for centre in centres:
        variations += centre.variation_range
    positive = [variation for variation in variations if variation > 0.0]
    lowest = min(positive) / 1.6
    highest = 1.6 * max(positive)
    logarithmic(ax.yaxis, decades(lowest, highest))
    ax.set_ylim(lowest, highest)
    ax.set_ylabel("← less is better, acceleration variation [rad/s³]")
    unused = [_unused_share(run["utilization"]) for run in runs]
    most = 1.4 * max(0.1, *unused)
    least = max(min(unused) / 1.6, LEAST_UNUSED)
    logarithmic(ax.xaxis, ())
    ax.set_xlim(most, least)
    ticks = {}
    for share in SHARES:
        place = 1.0 - share
        if least - 1e-12 <= place <= most:
            ticks[place] = f"{100.0 * share:g}"
            if share == SHARES[-1]:
                ticks[place] = "≥ 99.99"
    ax.set_xticks([*ticks], [*ticks.values()])
    ax.set_xlabel("utilization [%], more is better → (logarithmic in the unused share)")


def _mark_run(ax: Any, run: Line, look: Look) -> None:
    """Draw a run as a small marker, hollow if a row was violated."""
    face = "white"
    edge = look.colour
    width = 1.5
    if run["violation_depth"] == 0.0:
        face = look.colour
        edge = darker(look.colour)
        width = 0.7
    mark = symbol(look.marker, face, edge, SMALL, markeredgewidth=width)
    x = _unused_share(run["utilization"])
    y = run["acceleration_variation"]
    ax.plot(x, y, **mark, clip_on=False, alpha=0.6, zorder=3)


def _mark_centre(ax: Any, centre: Centre, look: Look) -> None:
    """Draw the medians as a large marker, and the ranges as a cross of thin lines."""
    x = _unused_share(centre.used)
    y = centre.variation
    x_range = [_unused_share(used) for used in centre.used_range]
    cross = RANGE | {"color": look.colour}
    ax.plot(x_range, [y, y], **cross)
    ax.plot([x, x], centre.variation_range, **cross)
    mark = symbol(
        look.marker,
        look.colour,
        "white",
        LARGE,
        markeredgewidth=1.0,
        clip_on=False,
        zorder=4,
    )
    ax.plot(x, y, **mark)


def name_centres(
    ax: Any, centres: Mapping[str, Centre], look: Mapping[str, Look], size: tuple[float, float]
) -> None:
    """Write each controller's name beside its large marker.

    Names cover neither each other nor large markers. A name farther from its marker has a line to
    it. ``size`` is the size of the panel [pt].
    """
    width, height = size
    to_axes = ax.transScale + ax.transLimits
    places: dict[str, tuple[float, float]] = {}
    for name, centre in centres.items():
        x, y = to_axes.transform((_unused_share(centre.used), centre.variation))
        places[name] = (float(x) * width, float(y) * height)
    marker = 1.2 * LARGE
    taken = []
    for x, y in places.values():
        taken.append(_box(x, y, marker, marker))
    # Names are placed from the highest marker to the lowest.
    for name in sorted(places, key=lambda name: -places[name][1]):
        x, y = places[name]
        text = shortened(name)
        text_width = LETTER * len(text)
        step_x = 0.5 * text_width + 0.7 * LARGE
        step_y = 0.5 * TEXT_HEIGHT + 0.7 * LARGE
        chosen = NEAR[0]
        for offset in (*NEAR, *FAR):
            across, up = offset
            box = _box(x + across * step_x, y + up * step_y, text_width, TEXT_HEIGHT)
            fits_across = box.x0 >= 0.0 and box.x1 <= width
            fits_up = box.y0 >= 0.0 and box.y1 <= height
            if fits_across and fits_up and not box.count_overlaps(taken):
                chosen = offset
                break
        shift_x = chosen[0] * step_x
        shift_y = chosen[1] * step_y
        taken.append(_box(x + shift_x, y + shift_y, text_width, TEXT_HEIGHT))
        colour = look[name].colour
        leader = None
        if chosen in FAR:
            leader = LEADER | {"color": colour}
        ax.annotate(
            text,
            (x / width, y / height),
            (shift_x, shift_y),
            xycoords="axes fraction",
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=8.0,
            fontweight="bold",
            color=darker(colour),
            arrowprops=leader,
            bbox=NAME_BOX,
            zorder=6,
        )


def _box(x: float, y: float, width: float, height: float) -> Any:
    """Return a box with its centre at a place [pt]."""
    from matplotlib.transforms import Bbox

    return Bbox.from_bounds(x - 0.5 * width, y - 0.5 * height, width, height)


def _unused_share(utilization: float) -> float:
    """Return the share of unused space at which a utilization is drawn."""
    return max(1.0 - utilization, LEAST_UNUSED)
