"""The figure of a whole comparison: utilization against acceleration variation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ...comparisons.suite import BASELINE
from ..numbers import median
from ..plots import Look, Sheet, darker, decades, line, logarithmic, looks, shortened, symbol
from ..plots.sheet import WIDTH
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
LETTER = 5.6  # width of a bold letter of a name [pt]
#: Offsets of a name from its marker in steps of its size, by preference: right, left, above, …
OFFSETS = (
    *((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)),
    *(
        (1, 2),
        (-1, 2),
        (1, -2),
        (-1, -2),
        (1, 3),
        (-1, 3),
        (1, -3),
        (-1, -3),
        (0, 2),
        (0, -2),
        (0, 3),
        (0, -3),
    ),
)
NEAR = 4  # the first offsets are so near that a name needs no line to its marker
LEADER: dict[str, Any] = {"arrowstyle": "-", "linewidth": 0.8, "shrinkA": 1.0, "shrinkB": 4.0}
Box = tuple[float, float, float, float]


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
        converged = [run for run in runs if run["status"] == "converged"]
        used = [run["utilization"] for run in converged if math.isfinite(run["utilization"])]
        variation = [
            run["acceleration_variation"]
            for run in converged
            if math.isfinite(run["acceleration_variation"])
        ]
        if not used or not variation:
            return cls(math.nan, math.nan, (math.nan, math.nan), (math.nan, math.nan))
        return cls(
            median(used),
            median(variation),
            (min(used), max(used)),
            (min(variation), max(variation)),
        )


def draw_trade_off(results: Results, controllers: Sequence[str]) -> Sheet | None:
    """Draw each run as a small marker, and the medians of each controller as a large one.

    Large markers have the controller's name and ranges.
    """
    every = shown_runs(results, results.competitors)
    found = {name: own for name, own in every.items() if own and name in controllers}
    if not found:
        return None
    look = looks(controllers)
    sheet = Sheet(left=0.72, right=0.2)
    (ax,) = sheet.panels(1, height=HEIGHT, above=0.02)
    for name, own in found.items():
        for run in own:
            _mark_run(ax, run, look[name])
    centres = {name: Centre.of(results.all_runs(name)) for name in found}
    centres = {name: centre for name, centre in centres.items() if centre.variation > 0.0}
    for name, centre in centres.items():
        _mark_centre(ax, centre, look[name])
    unused = [1.0 - _drawn_utilization(run["utilization"]) for own in every.values() for run in own]
    most = 1.4 * max([*unused, 0.1])
    least = max(min(unused) / 1.6, LEAST_UNUSED)
    logarithmic(ax.xaxis, ())
    logarithmic(ax.yaxis)
    logarithmic(ax.yaxis, decades(*ax.get_ylim()))
    ax.set_xlim(most, least)
    ticks = [share for share in SHARES if least <= 1.0 - share + 1e-12 and 1.0 - share <= most]
    ax.set_xticks(
        [1.0 - s for s in ticks],
        ["≥ 99.99" if s == SHARES[-1] else f"{100.0 * s:g}" for s in ticks],
    )
    ax.set_xlabel("utilization [%], more is better → (logarithmic in the unused share)")
    ax.set_ylabel("← less is better, acceleration variation [rad/s³]")
    size = (72.0 * (WIDTH - sheet.left - sheet.right), 72.0 * HEIGHT)
    name_centres(ax, centres, look, size)
    unnamed = [name for name in found if name not in centres]
    entries = [
        symbol(look[n].marker, look[n].colour, look[n].colour, 8.0, label=shortened(n))
        for n in unnamed
    ]
    entries += [
        symbol("o", GREY, GREY, LARGE, label="medians of the runs that converged"),
        line("from the least to the greatest of them", GREY, linewidth=RANGE["linewidth"]),
        symbol("o", GREY, GREY, SMALL, label="one run"),
        symbol("o", "white", GREY, 7.0, label="hollow: a constraint was violated")
        | {"markeredgewidth": 1.5},
    ]
    sheet.at += 0.08
    sheet.legend(entries, 2)
    return sheet


def _mark_run(ax: Any, run: Line, look: Look) -> None:
    """Draw a run as a small marker, hollow if a row was violated."""
    kept = run["violation_depth"] == 0.0
    face, edge = (look.colour, darker(look.colour)) if kept else ("white", look.colour)
    mark = symbol(look.marker, face, edge, SMALL) | {"markeredgewidth": 0.7 if kept else 1.5}
    place = [1.0 - _drawn_utilization(run["utilization"])], [run["acceleration_variation"]]
    ax.plot(*place, **mark, clip_on=False, alpha=0.6, zorder=3)


def _mark_centre(ax: Any, centre: Centre, look: Look) -> None:
    """Draw the medians as a large marker, and the ranges as a cross of thin lines."""
    x = 1.0 - _drawn_utilization(centre.used)
    y = centre.variation
    ax.plot(
        [1.0 - _drawn_utilization(used) for used in centre.used_range],
        [y, y],
        color=look.colour,
        **RANGE,
    )
    ax.plot([x, x], centre.variation_range, color=look.colour, **RANGE)
    mark = symbol(look.marker, look.colour, "white", LARGE) | {"markeredgewidth": 1.0}
    ax.plot([x], [y], **mark, clip_on=False, zorder=4)


def name_centres(
    ax: Any, centres: Mapping[str, Centre], look: Mapping[str, Look], size: tuple[float, float]
) -> None:
    """Write each controller's name beside its large marker.

    Names cover neither each other nor large markers. A name farther from its marker has a line to
    it. ``size`` is the size of the panel [pt].
    """
    to_axes = ax.transScale + ax.transLimits
    places = {}
    for name, centre in centres.items():
        place = to_axes.transform((1.0 - _drawn_utilization(centre.used), centre.variation))
        places[name] = (float(place[0]) * size[0], float(place[1]) * size[1])
    half = 0.6 * LARGE
    taken = [(x - half, y - half, x + half, y + half) for x, y in places.values()]
    for name, (x, y) in sorted(places.items(), key=lambda item: -item[1][1]):
        text = shortened(name)
        width = LETTER * len(text)
        height = 11.0
        boxes = [_box(x, y, across, up, width, height) for across, up in OFFSETS]
        free = [
            box
            for box in boxes
            if _fits(box, size) and not any(_overlap(box, other) for other in taken)
        ]
        box = free[0] if free else boxes[0]
        taken.append(box)
        beside = box in boxes[:NEAR]
        middle = (0.5 * (box[0] + box[2]) - x, 0.5 * (box[1] + box[3]) - y)
        ax.annotate(
            text,
            (x / size[0], y / size[1]),
            middle,
            xycoords="axes fraction",
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=8.0,
            fontweight="bold",
            color=darker(look[name].colour),
            arrowprops=None if beside else LEADER | {"color": look[name].colour},
            bbox={
                "boxstyle": "square,pad=0.05",
                "facecolor": "white",
                "edgecolor": "none",
                "alpha": 0.8,
            },
            zorder=6,
        )


def _box(x: float, y: float, across: int, up: int, width: float, height: float) -> Box:
    """Return left, bottom, right and top of a name at an offset in steps from its marker."""
    away = 0.7 * LARGE
    left = x - 0.5 * width + across * (0.5 * width + away)
    bottom = y - 0.5 * height + up * (0.5 * height + away)
    return left, bottom, left + width, bottom + height


def _fits(box: Box, size: tuple[float, float]) -> bool:
    """Return True if a name lies within the panel."""
    return box[0] >= 0.0 and box[1] >= 0.0 and box[2] <= size[0] and box[3] <= size[1]


def _overlap(a: Box, b: Box) -> bool:
    """Return True if two boxes have points in common."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _drawn_utilization(utilization: float) -> float:
    """Return the utilization at which a value is drawn, at most at the edge of the axis."""
    return min(utilization, 1.0 - LEAST_UNUSED)
