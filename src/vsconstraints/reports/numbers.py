"""Numbers as a report prints them: three significant digits, a dash where there is none."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

DASH = "–"  #: Stands where a value does not exist.
Format = Callable[[float], str]


def number(value: float) -> str:
    """Three significant digits; powers of ten only where plain digits would be hard to read."""
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
        text = f"{size:.{max(0, 2 - math.floor(math.log10(size)))}f}"
    return "−" * (rounded < 0.0) + text


def error(value: float) -> str:
    """Three significant digits; of positive values below a thousandth of their unit only that."""
    return "<0.001" if 0.0 < value < 1e-3 else number(value)


def percent(value: float) -> str:
    """A share as per cent with two decimals: the distance from 100 is what matters."""
    return f"{100.0 * value:.2f}" if math.isfinite(value) else DASH


def percentage(share: float, digits: int) -> str:
    """A share in per cent; never 0 or 100 where it is not, and without decimals where it is."""
    if not math.isfinite(share):
        return DASH
    if share in (0.0, 1.0):
        return f"{100.0 * share:.0f}"
    while digits < 6 and abs(float(f"{100.0 * share:.{digits}f}")) in (0.0, 100.0):
        digits += 1
    return f"{100.0 * share:.{digits}f}".replace("-", "−")


#: How the styles of metrics print.
FORMATS: dict[str, Format] = {"number": number, "error": error, "percent": percent}
FORMATS["count"] = lambda value: str(round(value)) if math.isfinite(value) else DASH


def of_length(tolerance: float) -> str:
    """A tolerated depth, a fraction of the characteristic length L, as text."""
    return f"{100.0 * tolerance:g} % of L"


def median(values: Sequence[float]) -> float:
    """Median of the finite values; NaN if there is none."""
    exist = [value for value in values if math.isfinite(value)]
    return float(np.median(exist)) if exist else math.nan


def largest(values: Sequence[float]) -> float:
    """Greatest of the finite values; NaN if there is none."""
    return max((value for value in values if math.isfinite(value)), default=math.nan)


def over_trials(values: Sequence[float], show: Format = number) -> str:
    """One value, or ``median [least–greatest]`` of several that differ as shown; a dash if none is
    finite.
    """
    exist = [value for value in values if math.isfinite(value)]
    middle = show(median(exist))
    if not exist or show(min(exist)) == show(max(exist)):
        return middle
    return f"{middle} [{show(min(exist))}–{show(max(exist))}]"
