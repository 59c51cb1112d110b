"""A median and its interval: bootstrap over scenes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import binom, norm

from ..errors import InvalidInput
from ..rows import Array, IntArray
from .inputs import checked_confidence, line

RESAMPLES = 9999
"""Bootstrap samples."""

FEW = 50
"""Fewer values have the exact interval in place of the bootstrap, which covers only 88 % of 7 and 92 % of 21."""


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


def median(values: ArrayLike, confidence: float = 0.95, seed: int = 0) -> Median:
    """The median of (n,) values, which may be infinite, and its interval.

    Of :data:`FEW` values or more: bootstrap, bias-corrected and accelerated (Efron 1987), as ``scipy.stats.bootstrap``
    with ``method="BCa"``. Acceleration is left out, since a median hardly has any: without one value each, an even
    number has two medians equally often, which is none at all, and 51 values have one of at most 0.001.

    Of fewer: the exact interval between two of the values in order, for which no distribution is assumed (the sign test
    turned round); its coverage is never below the confidence.

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
    middle = float(_midpoint(ordered[(n - 1) // 2], ordered[n // 2]))
    low, high = _between(ordered, alpha) if n < FEW else _bootstrapped(ordered, middle, alpha, seed)
    return Median(middle, low, high, n)


def _between(ordered: Array, alpha: float) -> tuple[float, float]:
    """Values k and n + 1 − k in order: the greatest k with a chance of at most α/2 that fewer lie below the median."""
    n = len(ordered)
    k = int(np.count_nonzero(binom.cdf(np.arange(n), n, 0.5) <= alpha / 2.0))
    return (float(ordered[k - 1]), float(ordered[n - k])) if k else (-math.inf, math.inf)


def _bootstrapped(ordered: Array, middle: float, alpha: float, seed: int) -> tuple[float, float]:
    medians = np.sort(resampled(ordered, np.random.default_rng(seed)))
    below = (np.count_nonzero(medians < middle) + np.count_nonzero(medians <= middle)) / 2
    bias = norm.ppf(below / RESAMPLES)  # about half of them lie below, or many are the middle itself
    shares = norm.cdf(2.0 * bias + norm.ppf([alpha / 2.0, 1.0 - alpha / 2.0]))
    low, high = medians[np.ceil(shares * RESAMPLES).astype(int) - 1]
    return float(low), float(high)


def resampled(ordered: Array, rng: np.random.Generator) -> Array:
    """Medians of :data:`RESAMPLES` bootstrap samples of n values in order.

    A bootstrap sample takes the values ⌊n u⌋ of n independent uniform u; its median takes the middle one or two of u in
    order. These are drawn themselves: the m-th of n is beta distributed (m, n + 1 − m), and the next is the least of
    n − m uniform ones above it. The samples' distribution is the same, without n draws for each.
    """
    n = len(ordered)
    m = (n + 1) // 2
    u = rng.beta(m, n + 1 - m, RESAMPLES)
    lower = ordered[_place(u, n)]
    if n % 2:
        return lower
    following = u + (1.0 - u) * rng.beta(1, n - m, RESAMPLES)
    return _midpoint(lower, ordered[_place(following, n)])


def _place(u: Array, n: int) -> IntArray:
    return np.minimum((n * u).astype(np.int64), n - 1)


def _midpoint(x: Array, y: Array) -> Array:
    """Half of the sum; of opposite values, infinite ones among them, zero."""
    with np.errstate(invalid="ignore"):  # ∞ − ∞, which is not taken
        middle: Array = np.where(x == -y, 0.0, (x + y) / 2.0)
    return middle
