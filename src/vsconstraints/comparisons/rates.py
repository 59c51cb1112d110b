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
    interval = f"{_decimals(low, places)} to {_decimals(high, places)}"
    return f"{_decimals(value, places)} ({interval}){after}"


def rate_text(rate: Rate) -> str:
    """Format a rate with its interval, such as ``812 of 1 000: 81.2 % (95 %: 78.6 to 83.6 %)``.

    If the count is zero or complete, only one bound is stated in the text, such as ``0 of 10 000:
    at most 3.7e-4 (95 %)``.
    """
    level = f"{100.0 * rate.confidence:g} %"
    counted = f"{_count(rate.count)} of {_count(rate.of)}"
    if rate.of == 0:
        return f"{counted}: nothing is known"
    if rate.count == 0:
        return f"{counted}: at most {_rounded_up(rate.high)} ({level})"
    if rate.count == rate.of:
        return f"{counted}: at least {_rounded_down(rate.low)} ({level})"
    places = _places(50.0 * (rate.high - rate.low), 100.0 * rate.share)
    share = _decimals(100.0 * rate.share, places)
    low = _decimals(100.0 * rate.low, places)
    high = _decimals(100.0 * rate.high, places)
    return f"{counted}: {share} % ({level}: {low} to {high} %)"


def _count(number: int) -> str:
    """Format a count, with groups of three digits from 10 000 on."""
    return f"{number:,}".replace(",", " ") if number >= 10_000 else str(number)


def _rounded_up(share: float) -> str:
    """Format an upper bound on a rate, rounded up to two digits; below 1e-3 not in per cent."""
    places = _places(share, share)
    unit = 10.0**places
    bound = math.ceil(share * unit) / unit
    if bound < 1e-3:
        return _short_exponent(f"{bound:.1e}")
    return f"{_decimals(100.0 * bound, places - 2)} %"


def _rounded_down(share: float) -> str:
    """Format a lower bound on a rate, rounded down to two digits of the remainder."""
    places = _places(1.0 - share, share)
    unit = 10.0**places
    bound = math.floor(share * unit) / unit
    return f"{_decimals(100.0 * bound, places - 2)} %"


def _short_exponent(text: str) -> str:
    """Remove the leading zero of an exponent: 1.2e-4 instead of 1.2e-04."""
    return text.replace("e-0", "e-").replace("e+0", "e+")


def _places(half: float, value: float) -> int:
    """Return the number of decimals that show two digits of the half-width of an interval.

    If the half-width is zero, three digits of the value are shown.
    """
    size, digits = (half, 2) if half > 0.0 else (abs(value), 3)
    if not (size > 0.0 and math.isfinite(size)):
        return 0
    return digits - 1 - math.floor(math.log10(size))


def _decimals(value: float, places: int) -> str:
    if not math.isfinite(value):
        return "∞" if value > 0.0 else "-∞"
    shown = round(value, places) + 0.0  # no −0
    size = math.floor(math.log10(abs(shown))) if shown else 0
    if places > 5 or size > 5:
        return _short_exponent(f"{shown:.{max(size + places, 0)}e}")
    return f"{shown:.{max(places, 0)}f}"
