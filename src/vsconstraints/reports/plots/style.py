"""Style of figures: colour, marker and line style of each law, and common parts of panels."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np

from ...rows import Array, IntArray

#: Keyword arguments of a function of matplotlib, such as ``color``: how one thing is drawn. Styles
#: of what a law has in a figure follow from its :class:`Look`.
Style = dict[str, Any]
INK = "#222222"
FAINT = "#444444"
#: Style of bounds and references.
REFERENCE: Style = {"color": INK, "linewidth": 1.1, "linestyle": (0, (4, 2))}
STYLE_SHEET = Path(__file__).with_name("figures.mplstyle")
#: Settings of figures whose texts contain formulas, none of which come from a user.
FORMULAS: Style = {"text.parse_math": True, "mathtext.fontset": "dejavusans"}
_TABLE = tomllib.loads(Path(__file__).with_name("looks.toml").read_text(encoding="utf-8"))
COLOURS: dict[str, str] = _TABLE["colours"]
#: Preferred colours of custom laws: no law of the default comparison has them.
FREE_COLOURS = [COLOURS[name] for name in ("brown", "teal", "wine", "purple", "vermillion")]
DASHED = "--"
LINES = ("-", DASHED, "-.", ":")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p", "h", "*")
#: Digits and sign of an exponent.
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
TUNED = "-tuned"  # suffix of a tuned law, after the name of the original law


@dataclass(frozen=True)
class Look:
    """Colour, marker and line by which a controller is recognised in all figures.

    It is the same in every figure, see :func:`looks`; a :data:`Style` of it may differ, for example
    in width.
    """

    colour: str
    marker: str
    line: str = "-"


LOOKS: dict[str, Look] = {}
for _law, _look in _TABLE["laws"].items():
    _colour, _marker, _line = _look.split()
    LOOKS[_law] = Look(COLOURS[_colour], _marker, _line)


def looks(controllers: Sequence[str]) -> dict[str, Look]:
    """Return a look for each controller.

    It is that of its name in ``looks.toml``, or else a preferred one that no other controller has.
    A tuned law has the colour of the law from which it was tuned, dashed.
    """
    known = {}
    others = []
    for name in dict.fromkeys(controllers):
        if name in LOOKS:
            known[name] = LOOKS[name]
        else:
            others.append(name)
    # Tuned laws come last, when the looks of their originals are known.
    others.sort(key=lambda name: name.endswith(TUNED))
    for name in others:
        taken = list(known.values())
        if name.endswith(TUNED):
            original = name.removesuffix(TUNED)
            look = known.get(original) or LOOKS.get(original) or _free_look(original, taken)
            next_marker = MARKERS.index(look.marker) + 1
            known[name] = Look(look.colour, _free_marker(next_marker, taken), DASHED)
        else:
            known[name] = _free_look(name, taken)
    return {name: known[name] for name in controllers}


def _free_look(name: str, taken: Sequence[Look]) -> Look:
    """Return the preferred look of a name, as far as no other law has it.

    A colour that no other law has is more important than a solid line.
    """
    number = crc32(name.encode())
    preferred = _begun_at(number, FREE_COLOURS)
    _, *coloured = COLOURS.values()  # without the baseline's grey
    colours = dict.fromkeys([*preferred, *coloured])
    taken_colours = {look.colour for look in taken}
    taken_pairs = {(look.line, look.colour) for look in taken}

    def conflict(pair: tuple[str, str]) -> int:
        """Return 2 if a law has the pair of line and colour, 1 if one has the colour, else 0."""
        if pair in taken_pairs:
            return 2
        _, colour = pair
        return 1 if colour in taken_colours else 0

    # The first of the pairs with the least conflict, solid lines before others.
    line, colour = min(product(LINES, colours), key=conflict)
    return Look(colour, _free_marker(number, taken), line)


def _free_marker(start: int, taken: Sequence[Look]) -> str:
    """Return the first marker from ``start`` on that no other law has, or that at ``start``."""
    ordered = _begun_at(start, MARKERS)
    used = {look.marker for look in taken}
    for marker in ordered:
        if marker not in used:
            return marker
    return ordered[0]


def _begun_at(start: int, values: Sequence[str]) -> list[str]:
    """Return values in their order from the one at ``start`` on, counted round and round."""
    k = start % len(values)
    return [*values[k:], *values[:k]]


def rgb(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue, from 0 to 255, of ``#RRGGBB``."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue


def darker(colour: str, share: float = 0.8) -> str:
    """Return a shade of a colour ``#RRGGBB`` that is dark enough for text on white."""
    return _mixed(colour, share, 0)


def paler(colour: str, white: float = 0.45) -> str:
    """Return a colour ``#RRGGBB`` mixed with white."""
    return _mixed(colour, 1.0 - white, white * 255)


def _mixed(colour: str, share: float, added: float) -> str:
    """Return ``share`` of a colour ``#RRGGBB`` with the same grey level added to each channel."""
    channels = [int(share * channel + added) for channel in rgb(colour)]
    return f"#{bytes(channels).hex().upper()}"


def shortened(name: str, most: int = 40) -> str:
    """Shorten a long name in its middle so that it fits into a title or legend."""
    if len(name) <= most:
        return name
    half = (most - 1) // 2
    return f"{name[:half]}…{name[-half:]}"


def folded(name: str, most: int) -> str:
    """Fold a long name after a hyphen into two lines, or shorten it in its middle."""
    if len(name) <= most:
        return name
    breaks = []
    for hyphen in re.finditer("-", name):
        k = hyphen.end()
        longer_line = max(k, len(name) - k)
        if longer_line <= most:
            breaks.append((longer_line, k))
    if not breaks:
        return shortened(name, most)
    _, middle = min(breaks)
    return f"{name[:middle]}\n{name[middle:]}"


# --- Common parts of panels ---


def line(label: str, color: str, linestyle: Any = "-", **style: Any) -> Style:
    """Return the legend entry of a line."""
    usual = {
        "label": label,
        "color": color,
        "linestyle": linestyle,
        "linewidth": 2.0,
    }
    return usual | style


def patch(label: str, facecolor: str, **style: Any) -> Style:
    """Return the legend entry of an area."""
    usual = {
        "label": label,
        "facecolor": facecolor,
        "linewidth": 0.0,
    }
    return usual | style


def symbol(marker: str, face: str, edge: str = INK, size: float = 8.5, **style: Any) -> Style:
    """Return the style of a symbol, as a mark or, with ``label``, as a legend entry."""
    factor = {"*": 1.5, "x": 0.95}.get(marker, 1.0)
    return {
        "linestyle": "none",
        "marker": marker,
        "markersize": factor * size,
        "markerfacecolor": face,
        "markeredgecolor": edge,
        "markeredgewidth": 2.0 if marker == "x" else 0.9,
        **style,
    }


def signal(ax: Any, t: Array, values: Array, **style: Any) -> None:
    """Draw a signal (N,) over time (N,) [s]; matplotlib simplifies long lines but keeps peaks."""
    ax.plot(t, values, **{"linewidth": 1.5, **style})


def time_axis(
    ax: Any, end: float, events: Iterable[float] = (), label: str = "", **style: Any
) -> None:
    """Set the time axis from zero to the end [s], with dashed lines at events and a label."""
    ax.set_xlim(0.0, end)
    dashed = {
        "color": INK,
        "linestyle": (0, (4, 3)),
        "linewidth": 0.9,
        "zorder": 1.5,
        **style,
    }
    for time in events:
        ax.axvline(time, **dashed)
    if label:
        ax.set_ylabel(label, labelpad=3)


def mark_of(look: Look) -> Style:
    """Return the style of the marker on a law's line.

    Markers are needed because not every reader can distinguish lines by colour.
    """
    return {
        "marker": look.marker,
        "markersize": 5.5,
        "markerfacecolor": look.colour,
        "markeredgecolor": "white",
        "markeredgewidth": 0.6,
    }


def markers(law: str, laws: Sequence[str], count: int, most: int = 4) -> Style:
    """Return a few markers on a law's line of ``count`` points.

    Markers of different laws stand at different places.
    """
    share = (list(laws).index(law) + 0.5) / len(laws)
    last = count - 1
    places = set()
    for k in range(most):
        place = int(count * (k + share) / most)
        places.add(min(place, last))
    style = mark_of(looks(laws)[law])
    style["markevery"] = sorted(places)
    return style


def zero_line(ax: Any) -> None:
    """Draw a line at zero."""
    ax.axhline(0.0, color=INK, linewidth=0.9, zorder=1.6)


def band(ax: Any, low: float, high: float, colour: str = "#F1E9C9", **style: Any) -> None:
    """Shade a range of values."""
    usual = {"color": colour, "linewidth": 0.0, "zorder": 0.5}
    ax.axhspan(low, high, **usual | style)


def area(ax: Any, t: Array, low: Array, high: Array, **style: Any) -> None:
    """Fill the area between two signals (N,) over time (N,) without changing the axes' limits."""
    limits = ax.dataLim.frozen()
    is_known = np.isfinite(low) & np.isfinite(high)
    ax.fill_between(t, low, high, where=is_known, **style)
    ax.dataLim.set(limits)


def note(ax: Any, text: str, height: float, across: float = 0.0, above: bool = True) -> None:
    """Write a small text above or below a value, at a relative place across the panel (0 to 1)."""
    ax.annotate(
        text,
        (across, height),
        (4, 2 if above else -2),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        va="bottom" if above else "top",
        fontsize=8,
        color=INK,
    )


def inside_legend(ax: Any, columns: int = 1, place: str = "best") -> None:
    """Add a legend within a panel, on a white background that hides crossing lines."""
    ax.legend(
        loc=place,
        ncols=columns,
        fontsize=8.0,
        borderpad=0.35,
        borderaxespad=0.4,
        labelspacing=0.3,
        columnspacing=1.2,
        frameon=True,
        framealpha=0.92,
        edgecolor="none",
        facecolor="white",
    )


def above_legend(ax: Any, columns: int) -> None:
    """Add a legend above the right corner of a panel."""
    ax.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.02),
        ncols=columns,
        handlelength=1.5,
        columnspacing=1.2,
        fontsize=8.5,
    )


def decades(low: float, high: float, least: float = 1.0, most: int = 9) -> list[float]:
    """Return powers of ten within limits.

    If zero is within the limits, these are zero and powers of either sign from ``least`` on. Powers
    are left out evenly if there would be more than ``most``, and next to zero, where numbers
    overlap.
    """
    last = math.floor(math.log10(max(-low, high)))
    has_zero = low <= 0.0
    nearest = least if has_zero else low
    first = math.ceil(math.log10(nearest))
    count = last - first + 1
    if has_zero:
        count *= 2
    step = max(math.ceil(count / most), 1)
    if has_zero:
        first += step - 1
    ticks = [0.0]
    for exponent in range(first, last + 1, step):
        power = 10.0**exponent
        ticks += [-power, power]
    ticks.sort()
    return [tick for tick in ticks if low <= tick <= high]


def logarithmic(
    axis: Any,
    ticks: Sequence[float] | None = None,
    linear_below: float | None = None,
    linear_size: float = 0.6,
) -> None:
    """Make an axis logarithmic with plain numbers; call it after drawing.

    Ticks are at ``ticks``, or chosen by matplotlib. Below ``linear_below`` the axis is linear, for
    data that may be zero, over a length of ``linear_size`` decades.
    """
    setter = axis.axes.set_xscale if axis.axis_name == "x" else axis.axes.set_yscale
    if linear_below is not None:
        setter("symlog", linthresh=linear_below, linscale=linear_size)
    elif math.isfinite(axis.get_minpos()):
        setter("log")
    else:
        return  # no positive values
    axis.set_major_formatter(lambda value, _: plain(value))
    axis.set_minor_formatter("")
    if ticks is not None:
        axis.set_ticks(list(ticks), [plain(tick) for tick in ticks])
        axis.set_ticks([], minor=True)


def plain(value: float) -> str:
    """Format the number of a tick: plain digits, or a power of ten where they would be long."""
    if value == 0.0 or 1e-3 <= abs(value) < 1e4:
        text = f"{value:g}"
    else:
        mantissa, exponent = f"{value:.0e}".split("e")
        raised = str(int(exponent)).translate(RAISED)
        text = f"{mantissa}·10{raised}"
        text = re.sub(r"^(-?)1·", r"\1", text)
    return text.replace("-", "−")


def widths(names: Sequence[str], thickest: float = 2.6, thinnest: float = 1.0) -> dict[str, float]:
    """Return line widths for lines that may coincide: earlier lines are wider and stay visible."""
    steps = max(len(names) - 1, 1)
    step = (thickest - thinnest) / steps
    width = {}
    for i, name in enumerate(names):
        width[name] = thickest - step * i
    return width


class Windows(NamedTuple):
    """Signal in B short windows; values are NaN in a window without finite ones."""

    t: Array  #: (B,) middle of each window [s].
    least: Array  #: (B, …).
    greatest: Array  #: (B, …).
    mean: Array  #: (B, …).


def windows_of(t: Array, y: Array, most: int) -> Windows:
    """Return y (N, …) at times t (N,) [s] in at most ``most`` windows."""
    count = len(t)
    begins = np.linspace(0, count, min(most, count), endpoint=False)
    starts = np.unique(begins.astype(np.int64))
    ends = np.append(starts[1:], count) - 1
    return Windows(
        t=0.5 * (t[starts] + t[ends]),
        least=np.fmin.reduceat(y, starts),
        greatest=np.fmax.reduceat(y, starts),
        mean=_window_means(y, starts),
    )


def _window_means(y: Array, starts: IntArray) -> Array:
    """Return the mean of the finite values of y (N, …) in windows with these starts (B,)."""
    is_known = np.isfinite(y)
    known = np.where(is_known, y, 0.0)
    total = np.add.reduceat(known, starts)
    count = np.add.reduceat(is_known.astype(np.int64), starts)
    mean = np.full(total.shape, np.nan)
    np.divide(total, count, out=mean, where=count > 0)
    return mean
