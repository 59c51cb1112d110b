"""What panels share: signals over time, scales with plain numbers, reference lines, symbols and legend entries."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ...rows import Array
from .style import INK

#: How bounds and references are drawn.
REFERENCE: dict[str, Any] = {"color": INK, "linewidth": 1.1, "linestyle": (0, (4, 2))}


def line(label: str, color: str, linestyle: Any = "-", **look: Any) -> dict[str, Any]:
    """Legend entry of a line."""
    return {"label": label, "color": color, "linestyle": linestyle, "linewidth": 2.0, **look}


def patch(label: str, facecolor: str, **look: Any) -> dict[str, Any]:
    """Legend entry of an area."""
    return {"label": label, "facecolor": facecolor, "linewidth": 0.0, **look}


def symbol(marker: str, face: str, edge: str = INK, size: float = 8.5, **look: Any) -> dict[str, Any]:
    """How a symbol looks, as a mark or as a legend entry with its ``label``."""
    size = {"*": 1.5, "x": 0.95}.get(marker, 1.0) * size
    colours = {"markerfacecolor": face, "markeredgecolor": edge, "markeredgewidth": 2.0 if marker == "x" else 0.9}
    return {"linestyle": "none", "marker": marker, "markersize": size, **colours, **look}


def signal(ax: Any, t: Array, values: Array, **look: Any) -> None:
    """A signal (N,) over time (N,) [s]: matplotlib simplifies long lines without losing a peak."""
    ax.plot(t, values, **{"linewidth": 1.5, **look})


def time_axis(ax: Any, end: float, events: Iterable[float] = (), label: str = "", **look: Any) -> None:
    """From zero to the end [s], with a dashed line at each event, and a label of what is drawn."""
    ax.set_xlim(0.0, end)
    for time in events:
        ax.axvline(time, **{"color": INK, "linestyle": (0, (4, 3)), "linewidth": 0.9, "zorder": 1.5, **look})
    if label:
        ax.set_ylabel(label, labelpad=3)


def zero_line(ax: Any) -> None:
    """Where a value is zero."""
    ax.axhline(0.0, color=INK, linewidth=0.9, zorder=1.6)


def band(ax: Any, low: float, high: float, colour: str = "#F1E9C9", **look: Any) -> None:
    """A shaded range of values."""
    ax.axhspan(low, high, **{"color": colour, "linewidth": 0.0, "zorder": 0.5, **look})


def area(ax: Any, t: Array, low: Array, high: Array, **look: Any) -> None:
    """What lies between two signals (N,) over time (N,), without a change of the axes' limits."""
    limits = ax.dataLim.frozen()
    ax.fill_between(t, low, high, where=np.isfinite(low) & np.isfinite(high), **look)
    ax.dataLim.set(limits)


def note(ax: Any, text: str, height: float, across: float = 0.0, above: bool = True) -> None:
    """A small text at a value, above or below it, so far across the panel (0 to 1)."""
    away, aligned = ((4, 2), "bottom") if above else ((4, -2), "top")
    place = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points", "va": aligned}
    ax.annotate(text, (across, height), away, **place, fontsize=8, color=INK)


def inside_legend(ax: Any, columns: int = 1, place: str = "best") -> None:
    """A legend of what a panel shows, within it, on a white ground so that lines do not cross it."""
    spaces = {"borderpad": 0.35, "borderaxespad": 0.4, "labelspacing": 0.3, "columnspacing": 1.2}
    ground = {"frameon": True, "framealpha": 0.92, "edgecolor": "none", "facecolor": "white"}
    ax.legend(loc=place, ncols=columns, fontsize=8.0, **spaces, **ground)


def above_legend(ax: Any, columns: int) -> None:
    """A legend of what a panel shows, above its right corner."""
    place = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.02), "ncols": columns}
    ax.legend(**place, handlelength=1.5, columnspacing=1.2, fontsize=8.5)


def decades(low: float, high: float, least: float = 1.0, most: int = 9) -> list[float]:
    """Powers of ten within limits; where zero is within them, zero and powers of either sign from ``least`` on.

    Some are left out, evenly, where there would be more than ``most``, whose numbers would overlap; those next to zero
    too, as the part between them and zero is as short as a decade.
    """
    least, both = (low, 1) if low > 0.0 else (least, 2)
    first, last = math.ceil(math.log10(least)), math.floor(math.log10(max(-low, high)))
    step = max(math.ceil(both * (last - first + 1) / most), 1)
    sizes = [10.0**k for k in range(first if low > 0.0 else first + step - 1, last + 1, step)]
    return [x for x in (*(-size for size in reversed(sizes)), 0.0, *sizes) if low <= x <= high]


def logarithmic(
    axis: Any, ticks: Sequence[float] | None = None, linear_below: float | None = None, linear_size: float = 0.6
) -> None:
    """Make an axis (``ax.xaxis`` or ``ax.yaxis``) logarithmic with plain numbers, once everything is drawn.

    ``ticks`` None: where matplotlib would put them. ``linear_below``: linear between this value and zero, for data that
    may be zero or of either sign, in a part of ``linear_size`` decades.
    """
    setter = axis.axes.set_xscale if axis.axis_name == "x" else axis.axes.set_yscale
    if linear_below is not None:
        setter("symlog", linthresh=linear_below, linscale=linear_size)
    elif math.isfinite(axis.get_minpos()):
        setter("log")
    else:
        return  # nothing that a logarithmic axis could show
    axis.set_major_formatter(lambda value, _: plain(value))
    axis.set_minor_formatter("")
    if ticks is not None:
        axis.set_ticks(list(ticks), [plain(tick) for tick in ticks])
        axis.set_ticks([], minor=True)


def plain(value: float) -> str:
    """A tick's number: plain digits, or a power of ten where they would be long."""
    if value == 0.0 or 1e-3 <= abs(value) < 1e4:
        return f"{value:g}".replace("-", "−")
    mantissa, exponent = f"{value:.0e}".split("e")
    factor = {"1": "", "-1": "−"}.get(mantissa, f"{mantissa.replace('-', '−')}·")
    return f"{factor}10{str(int(exponent)).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"


def widths(names: Sequence[str], thickest: float = 2.6, thinnest: float = 1.0) -> dict[str, float]:
    """Line widths for lines that may coincide: those drawn first are wider, so that each remains visible."""
    step = (thickest - thinnest) / max(len(names) - 1, 1)
    return {name: thickest - step * i for i, name in enumerate(names)}


def extremes(t: Array, y: Array, bins: int) -> tuple[Array, Array, Array, Array]:
    """(B,) middle time and (B, …) least, greatest and mean value of y (N, …) in up to ``bins`` windows; NaN: none."""
    starts = np.unique(np.linspace(0, len(t), min(bins, len(t)), endpoint=False).astype(np.int64))
    middle = 0.5 * (t[starts] + t[np.append(starts[1:], len(t)) - 1])
    known = np.isfinite(y)
    total, count = (np.add.reduceat(x, starts, axis=0) for x in (np.where(known, y, 0.0), known.astype(np.int64)))
    mean = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)
    return middle, np.fmin.reduceat(y, starts, axis=0), np.fmax.reduceat(y, starts, axis=0), mean
