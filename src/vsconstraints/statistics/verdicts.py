"""When two laws are said to differ."""

from __future__ import annotations

from typing import Literal

from .inputs import FEWEST, Better, checked_confidence

Verdict = Literal["better", "worse", "not distinguishable", "too few"]
"""What is said of a against b."""


def distinguishable(
    low: float, high: float, p: float, *, n: int = FEWEST, least: float = 0.0, confidence: float = 0.95
) -> bool:
    """Whether a difference is told from none, by the rule of :func:`verdict`."""
    significant = 1.0 - p > checked_confidence(confidence)
    return n >= FEWEST and significant and (low > least or high < -least)


def verdict(
    low: float,
    high: float,
    p: float,
    *,
    n: int = FEWEST,
    better: Better = "less",
    least: float = 0.0,
    confidence: float = 0.95,
) -> Verdict:
    """What is said of a against b, from the interval of a − b and p, which is corrected for all that was compared.

    They differ if both say so: the interval lies beyond ``least``, the smallest difference that matters, to one side,
    and p is below 1 − confidence. Fewer than :data:`.inputs.FEWEST` scenes are too few to tell.
    """
    if n < FEWEST:
        return "too few"
    if not distinguishable(low, high, p, n=n, least=least, confidence=confidence):
        return "not distinguishable"
    return "better" if (high < 0.0) == (better == "less") else "worse"
