"""Rates with their intervals, as reports show them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.stats import binomtest

from ..errors import ConfigurationError, InvalidInput, format_value


@dataclass(frozen=True)
class Rate:
    """``count`` out of ``of`` scenes, with the exact two-sided interval of the rate.

    The interval is that of Clopper and Pearson (1934).
    """

    count: int
    of: int
    low: float
    high: float
    confidence: float = 0.95

    @property
    def share(self) -> float:
        """count/of; NaN without scenes."""
        return self.count / self.of if self.of else math.nan


def checked_confidence(confidence: float) -> float:
    """Return a confidence level. Raises ConfigurationError unless 0 < level < 1."""
    if not isinstance(confidence, (int, float)) or not 0.0 < confidence < 1.0:
        raise ConfigurationError(
            f"confidence must be between 0 and 1, such as 0.95, not {format_value(confidence)}"
        )
    return float(confidence)


def rate_of(count: int, of: int, confidence: float = 0.95) -> Rate:
    """Return the rate of ``count`` in ``of`` scenes. Raises InvalidInput if it is not a rate."""
    checked_confidence(confidence)
    if not 0 <= count <= of:
        raise InvalidInput(f"{count} of {of} is not a rate")
    if of == 0:
        return Rate(0, 0, 0.0, 1.0, confidence)
    exact = binomtest(count, of).proportion_ci(confidence, method="exact")
    return Rate(count, of, float(exact.low), float(exact.high), confidence)


def with_interval(
    value: float, low: float, high: float, factor: float = 1.0, unit: str = ""
) -> str:
    """Format a value with its interval, such as ``2.13 (2.08 to 2.19) s``.

    The numbers are multiplied by ``factor``, and ``unit`` is that of the product. Missing values
    and intervals are stated in words.
    """
    value = factor * value
    low = factor * low
    high = factor * high
    after = f" {unit}" if unit else ""
    if math.isnan(value):
        return "no value"
    if math.isinf(low) and math.isinf(high):
        return f"{_decimals(value, _places(0.0, value))}{after} (too few for an interval)"
    half = (high - low) / 2.0
    places = _places(half if math.isfinite(half) else 0.0, value)
    return (
        f"{_decimals(value, places)} ({_decimals(low, places)} to {_decimals(high, places)}){after}"
    )


def rate_text(rate: Rate) -> str:
    """Format a rate with its interval, such as ``812 of 1 000: 81.2 % (95 %: 78.6 to 83.6 %)``.

    If the count is zero or complete, only one bound is stated in the text, such as ``0 of 10 000:
    at most 3.7e-4 (95 %)``.
    """
    level = f"{100.0 * rate.confidence:g} %"
    count, of = (
        f"{each:,}".replace(",", " ") if each >= 10_000 else str(each)
        for each in (rate.count, rate.of)
    )
    counted = f"{count} of {of}"
    if rate.of == 0:
        return f"{counted}: nothing is known"
    if rate.count == 0:  # rounded up to two digits
        places = _places(rate.high, rate.high)
        up = math.ceil(rate.high * 10.0**places) / 10.0**places
        most = _short(f"{up:.1e}") if up < 1e-3 else f"{_decimals(100.0 * up, places - 2)} %"
        return f"{counted}: at most {most} ({level})"
    if rate.count == rate.of:  # rounded down to two digits of the remainder
        places = _places(1.0 - rate.low, rate.low)
        least = _decimals(100.0 * (math.floor(rate.low * 10.0**places) / 10.0**places), places - 2)
        return f"{counted}: at least {least} % ({level})"
    places = _places(50.0 * (rate.high - rate.low), 100.0 * rate.share)
    low, high, share = (
        _decimals(100.0 * each, places) for each in (rate.low, rate.high, rate.share)
    )
    return f"{counted}: {share} % ({level}: {low} to {high} %)"


def _short(text: str) -> str:
    return text.replace("e-0", "e-").replace("e+0", "e+")


def _places(half: float, value: float) -> int:
    """Return the number of decimals that show two digits of the half-width of an interval.

    If the half-width is zero, three digits of the value are shown.
    """
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
