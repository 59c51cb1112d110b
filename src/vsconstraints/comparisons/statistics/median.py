"""A median and its exact interval."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import binom

from ...errors import InvalidInput
from ...rows import Array
from .inputs import checked_confidence, line


class Median(NamedTuple):
    """A median.

    Attributes
    ----------
    median
        NaN of nothing.
    low, high
        Its interval; from −∞ to ∞ where so few values say nothing of it.
    n
        Values.
    """

    median: float
    low: float
    high: float
    n: int


def median(values: ArrayLike, confidence: float = 0.95) -> Median:
    """The median of (n,) values, which may be infinite, and its interval.

    The interval is exact and assumes no distribution: from the k-th value in order to the k-th from the end, where k is
    the greatest for which fewer than k of n values lie below the median with a chance of at most α/2. Of values that
    are not zero it excludes zero if and only if the two-sided sign test rejects at the level α.

    Raises
    ------
    InvalidInput
        if a value is NaN, or no number.
    """
    alpha = 1.0 - checked_confidence(confidence)
    ordered: Array = np.sort(line(values, "values").astype(float))
    n = len(ordered)
    if np.isnan(ordered).any():
        raise InvalidInput("a median of values of which one is NaN; leave out what does not count")
    if n == 0:
        return Median(math.nan, -math.inf, math.inf, 0)
    lower, upper = ordered[(n - 1) // 2], ordered[n // 2]
    middle = 0.0 if lower == -upper else float((lower + upper) / 2.0)  # of −∞ and ∞, zero
    k = int(np.count_nonzero(binom.cdf(np.arange(n), n, 0.5) <= alpha / 2.0))
    low, high = (float(ordered[k - 1]), float(ordered[n - k])) if k else (-math.inf, math.inf)
    return Median(middle, low, high, n)
