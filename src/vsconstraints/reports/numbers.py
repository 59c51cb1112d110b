"""Numbers as a report prints them: three significant digits, a dash for missing values."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np

DASH = "–"  #: Printed for a missing value.
Format = Callable[[float], str]


def number(value: float) -> str:
    """Format with three significant digits, as a power of ten only if very small or large."""
    if not math.isfinite(value):
        return DASH
    rounded = float(f"{value:.3g}")
    size = abs(rounded)
    if size == 0.0:
        return "0"
    if size < 1e-3 or size >= 1e6:
        mantissa, exponent = f"{size:.2e}".split("e")
        text = f"{mantissa}e{int(exponent)}"
    else:
        decimals = max(0, 2 - math.floor(math.log10(size)))
        text = f"{size:.{decimals}f}"
    return f"−{text}" if rounded < 0.0 else text


def error(value: float) -> str:
    """Format with three significant digits; positive values below 0.001 are given as ``<0.001``."""
    return "<0.001" if 0.0 < value < 1e-3 else number(value)


def percent(value: float) -> str:
    """Format a share as per cent with two decimals: the distance from 100 matters."""
    return f"{100.0 * value:.2f}" if math.isfinite(value) else DASH


def percentage(share: float, digits: int) -> str:
    """Format a share in per cent so that only exact values are shown as 0 or 100.

    Decimals are added until a value that differs from both also looks different. Exact 0 and 100
    have no decimals.
    """
    if not math.isfinite(share):
        return DASH
    per_cent = 100.0 * share
    if share in (0.0, 1.0):
        return f"{per_cent:.0f}"
    while digits < 6 and abs(float(f"{per_cent:.{digits}f}")) in (0.0, 100.0):
        digits += 1
    return f"{per_cent:.{digits}f}".replace("-", "−")


#: Functions that format each style of metric.
FORMATS: dict[str, Format] = {"number": number, "error": error, "percent": percent}
FORMATS["count"] = lambda value: str(round(value)) if math.isfinite(value) else DASH


def of_length(tolerance: float) -> str:
    """Format a tolerated depth, given as a fraction of the characteristic length L."""
    return f"{100.0 * tolerance:g} % of L"


def median(values: Sequence[float]) -> float:
    """Return the median of the finite values, NaN if there is none."""
    finite = finite_values(values)
    return float(np.median(finite)) if finite else math.nan


def largest(values: Sequence[float]) -> float:
    """Return the greatest of the finite values, NaN if there is none."""
    return max(finite_values(values), default=math.nan)


def finite_values(values: Iterable[float]) -> list[float]:
    """Return the values that are neither NaN nor infinite."""
    return [value for value in values if math.isfinite(value)]


def over_trials(values: Sequence[float], show: Format = number) -> str:
    """Format one value, or several as ``median [least–greatest]`` if they differ as shown.

    A dash is returned if no value is finite.
    """
    finite = finite_values(values)
    if not finite:
        return show(math.nan)
    middle = show(median(finite))
    least = show(min(finite))
    greatest = show(max(finite))
    return middle if least == greatest else f"{middle} [{least}–{greatest}]"
