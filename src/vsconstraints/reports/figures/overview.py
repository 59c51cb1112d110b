"""The figure of a whole comparison: utilization against acceleration variation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ...comparisons.suite import BASELINE
from ..numbers import median
from ..plots import Look, Sheet, darker, decades, line, logarithmic, looks, shortened, symbol
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
RANGE: dict[str, Any] = {"linewidth": 0.9, "alpha": 0.55, "zorder": 2.5}
# Width of a bold letter of a name, and height of a name [pt].
LETTER = 5.6
TEXT_HEIGHT = 11.0
#: Offsets of a name from its marker in steps of its size, by preference: right, left, above, …
NEAR = ((1, 0), (-1, 0), (0, 1), (0, -1))
#: Offsets at which a line leads from the name to its marker.
FAR = (
    *((across, up) for up in (1, -1, 2, -2, 3, -3) for across in (1, -1)),
    *((0, up) for up in (2, -2, 3, -3)),
)
LEADER: dict[str, Any] = {"arrowstyle": "-", "linewidth": 0.8, "shrinkA": 1.0, "shrinkB": 4.0}


def shown_runs(results: Results, controllers: Sequence[str]) -> dict[str, list[Line]]:
    """Return the runs that a row limited and that moved, by controller.

    The other runs have no place in the figure.
    """

    def drawn(run: Line) -> bool:
        return math.isfinite(run["utilization"]) and run["acceleration_variation"] > 0.0

    return {
        name: [run for run in results.all_runs(name) if drawn(run)]
        for name in controllers
        if name != BASELINE
    }


class Centre(NamedTuple):
    """Medians and ranges of a controller's converged runs, as in the first table of the report."""

    used: float  #: Median utilization.
    variation: float  #: Median acceleration variation [rad/s³].
    used_range: tuple[float, float]
    variation_range: tuple[float, float]

    @classmethod
    def of(cls, runs: Sequence[Line]) -> Centre:
        """Compute medians and ranges from lines of results.csv."""
        used = _finite_values(runs, "utilization")
        variation = _finite_values(runs, "acceleration_variation")
        if not used or not variation:
            return cls(math.nan, math.nan, (math.nan, math.nan), (math.nan, math.nan))
        return cls(
            median(used),
            median(variation),
            (min(used), max(used)),
            (min(variation), max(variation)),
        )


def _finite_values(runs: Sequence[Line], column: str) -> list[float]:
    """Return the finite values of a column in the runs that converged."""
    values = [float(run[column]) for run in runs if run["status"] == "converged"]
    return [value for value in values if math.isfinite(value)]


def draw_trade_off(results: Results, controllers: Sequence[str]) -> Sheet | None:
    """Draw each run as a small marker, and the medians of each controller as a large one.

    Large markers have the controller's name and ranges.
    """
    # Axes are those of all controllers, so that the figures of several groups can be compared.
    every = shown_runs(results, results.competitors)
    drawn = {name: runs for name, runs in every.items() if runs and name in controllers}
    if not drawn:
        return None
    look = looks(controllers)
    sheet = Sheet(left=0.72, right=0.2)
    (ax,) = sheet.panels(1, height=HEIGHT, above=0.02)
    centres = {}
    for name, runs in drawn.items():
        for run in runs:
            _mark_run(ax, run, look[name])
        centre = Centre.of(results.all_runs(name))
        if centre.variation > 0.0:
            centres[name] = centre
    for name, centre in centres.items():
        _mark_centre(ax, centre, look[name])
    _scale_axes(ax, [run for runs in every.values() for run in runs])
    size = (POINTS * (WIDTH - sheet.left - sheet.right), POINTS * HEIGHT)
    name_centres(ax, centres, look, size)
    entries = []
    for name in drawn:
        if name not in centres:
            colour = look[name].colour
            entries.append(symbol(look[name].marker, colour, colour, 8.0, label=shortened(name)))
    hollow = symbol("o", "white", GREY, 7.0, label="hollow: a constraint was violated")
    entries += [
        symbol("o", GREY, GREY, LARGE, label="medians of the runs that converged"),
        line("from the least to the greatest of them", GREY, linewidth=RANGE["linewidth"]),
        symbol("o", GREY, GREY, SMALL, label="one run"),
        hollow | {"markeredgewidth": 1.5},
    ]
    sheet.bottom += 0.08
    sheet.legend(entries, 2)
    return sheet


def _scale_axes(ax: Any, runs: Sequence[Line]) -> None:
    """Set limits, logarithmic scales, ticks and labels for these runs."""
    unused = [_unused_share(run["utilization"]) for run in runs]
    most = 1.4 * max(0.1, *unused)
    least = max(min(unused) / 1.6, LEAST_UNUSED)
    logarithmic(ax.xaxis, ())
    logarithmic(ax.yaxis)
    logarithmic(ax.yaxis, decades(*ax.get_ylim()))
    ax.set_xlim(most, least)
    ticks = [share for share in SHARES if least - 1e-12 <= 1.0 - share <= most]
    labels = ["≥ 99.99" if share == SHARES[-1] else f"{100.0 * share:g}" for share in ticks]
    ax.set_xticks([1.0 - share for share in ticks], labels)
    ax.set_xlabel("utilization [%], more is better → (logarithmic in the unused share)")
    ax.set_ylabel("← less is better, acceleration variation [rad/s³]")


def _mark_run(ax: Any, run: Line, look: Look) -> None:
    """Draw a run as a small marker, hollow if a row was violated."""
    if run["violation_depth"] == 0.0:
        mark = symbol(look.marker, look.colour, darker(look.colour), SMALL, markeredgewidth=0.7)
    else:
        mark = symbol(look.marker, "white", look.colour, SMALL, markeredgewidth=1.5)
    x = _unused_share(run["utilization"])
    ax.plot([x], [run["acceleration_variation"]], **mark, clip_on=False, alpha=0.6, zorder=3)


def _mark_centre(ax: Any, centre: Centre, look: Look) -> None:
    """Draw the medians as a large marker, and the ranges as a cross of thin lines."""
    x = _unused_share(centre.used)
    y = centre.variation
    x_range = [_unused_share(used) for used in centre.used_range]
    ax.plot(x_range, [y, y], color=look.colour, **RANGE)
    ax.plot([x, x], centre.variation_range, color=look.colour, **RANGE)
    mark = symbol(look.marker, look.colour, "white", LARGE, markeredgewidth=1.0)
    ax.plot([x], [y], **mark, clip_on=False, zorder=4)


def name_centres(
    ax: Any, centres: Mapping[str, Centre], look: Mapping[str, Look], size: tuple[float, float]
) -> None:
    """Write each controller's name beside its large marker.

    Names cover neither each other nor large markers. A name farther from its marker has a line to
    it. ``size`` is the size of the panel [pt].
    """
    from matplotlib.transforms import Bbox

    width, height = size
    to_axes = ax.transScale + ax.transLimits
    places: dict[str, tuple[float, float]] = {}
    for name, centre in centres.items():
        x, y = to_axes.transform((_unused_share(centre.used), centre.variation))
        places[name] = (float(x) * width, float(y) * height)
    marker = 1.2 * LARGE
    taken = [
        Bbox.from_bounds(x - 0.5 * marker, y - 0.5 * marker, marker, marker)
        for x, y in places.values()
    ]
    for name, (x, y) in sorted(places.items(), key=lambda item: -item[1][1]):
        text = shortened(name)
        text_width = LETTER * len(text)
        step_x = 0.5 * text_width + 0.7 * LARGE
        step_y = 0.5 * TEXT_HEIGHT + 0.7 * LARGE
        chosen = NEAR[0]
        for offset in (*NEAR, *FAR):
            box = _name_box(x + offset[0] * step_x, y + offset[1] * step_y, text_width)
            is_inside = box.x0 >= 0.0 and box.y0 >= 0.0 and box.x1 <= width and box.y1 <= height
            if is_inside and not box.count_overlaps(taken):
                chosen = offset
                break
        shift = (chosen[0] * step_x, chosen[1] * step_y)
        taken.append(_name_box(x + shift[0], y + shift[1], text_width))
        ax.annotate(
            text,
            (x / width, y / height),
            shift,
            xycoords="axes fraction",
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=8.0,
            fontweight="bold",
            color=darker(look[name].colour),
            arrowprops=None if chosen in NEAR else LEADER | {"color": look[name].colour},
            bbox={
                "boxstyle": "square,pad=0.05",
                "facecolor": "white",
                "edgecolor": "none",
                "alpha": 0.8,
            },
            zorder=6,
        )


def _name_box(x: float, y: float, width: float) -> Any:
    """Return the box of a name with its centre at a place [pt]."""
    from matplotlib.transforms import Bbox

    return Bbox.from_bounds(x - 0.5 * width, y - 0.5 * TEXT_HEIGHT, width, TEXT_HEIGHT)


def _unused_share(utilization: float) -> float:
    """Return the share of unused space at which a utilization is drawn."""
    return max(1.0 - utilization, LEAST_UNUSED)
