"""Numbers with the digits that their intervals support."""

from __future__ import annotations

import math

from .rates import Rate


def with_interval(value: float, low: float, high: float, factor: float = 1.0, unit: str = "") -> str:
    """``2.13 (2.08 to 2.19) s``, in the unit that is ``factor`` times the value's; what is not known is said so."""
    value, low, high = factor * value, factor * low, factor * high
    after = f" {unit}" if unit else ""
    if math.isnan(value):
        return "no value"
    if math.isinf(low) and math.isinf(high):
        return f"{_decimals(value, _places(0.0, value))}{after} (too few for an interval)"
    half = (high - low) / 2.0
    places = _places(half if math.isfinite(half) else 0.0, value)
    return f"{_decimals(value, places)} ({_decimals(low, places)} to {_decimals(high, places)}){after}"


def rate_text(rate: Rate) -> str:
    """``812 of 1 000: 81.2 % (95 %: 78.6 to 83.6 %)``, or one end of it: ``0 of 10 000: at most 3.7e-4 (95 %)``."""
    level = f"{100.0 * rate.confidence:g} %"
    count, of = (f"{each:,}".replace(",", " ") if each >= 10_000 else str(each) for each in (rate.count, rate.of))
    counted = f"{count} of {of}"
    if rate.of == 0:
        return f"{counted}: nothing is known"
    if rate.count == 0:  # rounded up to two digits
        places = _places(rate.high, rate.high)
        up = math.ceil(rate.high * 10.0**places) / 10.0**places
        most = _short(f"{up:.1e}") if up < 1e-3 else f"{_decimals(100.0 * up, places - 2)} %"
        return f"{counted}: at most {most} ({level})"
    if rate.count == rate.of:  # rounded down to two digits of what it leaves
        places = _places(1.0 - rate.low, rate.low)
        least = _decimals(100.0 * (math.floor(rate.low * 10.0**places) / 10.0**places), places - 2)
        return f"{counted}: at least {least} % ({level})"
    places = _places(50.0 * (rate.high - rate.low), 100.0 * rate.share)
    low, high, share = (_decimals(100.0 * each, places) for each in (rate.low, rate.high, rate.share))
    return f"{counted}: {share} % ({level}: {low} to {high} %)"


def _short(text: str) -> str:
    return text.replace("e-0", "e-").replace("e+0", "e+")


def _places(half: float, value: float) -> int:
    """Decimals that show two digits of half an interval's width, or three of the value where that is zero."""
    size, digits = (half, 2) if half > 0.0 else (abs(value), 3)
    return digits - 1 - math.floor(math.log10(size)) if size > 0.0 and math.isfinite(size) else 0


def _decimals(value: float, places: int) -> str:
    if not math.isfinite(value):
        return "∞" if value > 0.0 else "-∞"
    shown = round(value, places) + 0.0  # no −0
    size = math.floor(math.log10(abs(shown))) if shown else 0
    if places > 5 or size > 5:
        return _short(f"{shown:.{max(size + places, 0)}e}")
    return f"{shown:.{max(places, 0)}f}"
