"""When two laws are said to differ."""

from __future__ import annotations

from typing import Literal

from .inputs import FEWEST, Better

Verdict = Literal["better", "worse", "not distinguishable", "too few"]
"""What is said of a against b."""


def distinguishable(low: float, high: float, n: int = FEWEST) -> bool:
    """Whether an interval of a difference on n scenes excludes zero, and there are scenes enough to say so."""
    return n >= FEWEST and not low <= 0.0 <= high


def verdict(low: float, high: float, *, n: int = FEWEST, better: Better = "less") -> Verdict:
    """What is said of a against b, from the interval of a − b, which is simultaneous for all that is compared.

    They differ if it excludes zero. Fewer than :data:`.inputs.FEWEST` scenes are too few to tell.
    """
    if not distinguishable(low, high, n):
        return "too few" if n < FEWEST else "not distinguishable"
    return "better" if (high < 0.0) == (better == "less") else "worse"
