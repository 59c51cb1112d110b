"""Rates and medians with intervals, and paired comparisons of two laws.

Laws are compared on the same scenes, by a flag or by a number.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.stats import binom, norm

from ...comparisons.rates import Rate, checked_confidence, rate_of
from ...errors import InvalidInput, format_value
from ...rows import Array
from .judged import Better, array, checked_name, flags, numbers, require_pairs

CONTINUITY = 1.0  #: Continuity correction, subtracted from |only a − only b| (Edwards 1948).

Kind = Literal["difference", "log-ratio"]  #: a − b, or ln(a/b)


class PairedRates(NamedTuple):
    """Difference of two rates, a − b, on the same n scenes, with its interval.

    It is NaN without scenes. ``p`` is the two-sided p-value of McNemar's test with continuity
    correction: it is at most 1 − confidence if and only if the interval excludes zero. ``only_a``
    and ``only_b`` count the scenes in which only a or only b has the flag.
    """

    difference: float
    low: float
    high: float
    n: int
    p: float
    only_a: int
    only_b: int


class Median(NamedTuple):
    """Median of n values with its interval.

    The median is NaN if n = 0. The interval is from −∞ to ∞ if there are too few values.
    """

    median: float
    low: float
    high: float
    n: int


class Paired(NamedTuple):
    """Difference of a and b on the n of ``of`` scenes in which both have a value.

    ``median``, with its exact interval, is the median of a − b or of ln(a/b) over the scenes in
    which they differ. It is zero if they differ in no scene, and NaN if n = 0. a is better in
    ``wins`` scenes and worse in ``losses``. ``p`` is the two-sided p-value of the exact sign test:
    it is at most 1 − confidence if and only if the interval excludes zero.
    """

    median: float
    low: float
    high: float
    n: int
    wins: int
    losses: int
    p: float
    of: int

    @property
    def effect(self) -> float:
        """Probability that a is better than b in a scene, with ties counted as half.

        It is 0.5 without scenes.
        """
        if not self.n:
            return 0.5
        return (1.0 + (self.wins - self.losses) / self.n) / 2.0


def rate(values: ArrayLike, confidence: float = 0.95) -> Rate:
    """Return the rate of a flag, (n,) booleans with one entry per scene.

    Without scenes, the interval is from 0 to 1.
    """
    column = flags(values)
    return rate_of(int(column.sum()), len(column), confidence)


def mcnemar(a: ArrayLike, b: ArrayLike, confidence: float = 0.95) -> PairedRates:
    """Test if a flag is set more often in a than in b on the same scenes, (n,) booleans each.

    The test (McNemar 1947, Edwards 1948) and the interval (Tango 1998) agree: both are the score
    test of a difference.
    """
    first = flags(a, "a")
    second = flags(b, "b")
    require_pairs(first, second)
    n = len(first)
    only_a = int((first & ~second).sum())
    only_b = int((second & ~first).sum())
    differing = only_a + only_b
    score = 0.0
    if differing:
        score = (abs(only_a - only_b) - CONTINUITY) / math.sqrt(differing)
    p = min(2.0 * float(norm.sf(score)), 1.0)
    difference = (only_a - only_b) / n if n else math.nan
    low, high = difference_interval(only_a, only_b, n, confidence)
    return PairedRates(difference, low, high, n, p, only_a, only_b)


def sign_test(wins: int, losses: int) -> float:
    """Return the two-sided p-value of the exact binomial sign test.

    It is the probability of a split at least as uneven if both sides were equally likely.
    """
    one_sided = float(binom.cdf(min(wins, losses), wins + losses, 0.5))
    return min(2.0 * one_sided, 1.0)


def difference_interval(
    only_a: int, only_b: int, n: int, confidence: float = 0.95, *, correction: float = CONTINUITY
) -> tuple[float, float]:
    """Return the interval of a difference of two rates on the same n scenes.

    This is Tango's score interval with continuity correction. It contains all differences δ with::

        |only_a − only_b − n δ| − correction ≤ z √(n (2 p + δ (1 − δ)))

    Here p is the maximum-likelihood rate of "only b" under δ. See Tango, Statistics in Medicine 17,
    1998, eqs. 24–26, there without a correction.
    """
    z = _quantile(confidence)
    low = _lowest(only_a, only_b, n, z, correction)
    # the greatest difference a − b is the negative of the smallest difference b − a
    high = -_lowest(only_b, only_a, n, z, correction)
    return low, high


def _quantile(confidence: float) -> float:
    """Return the two-sided quantile of the normal distribution."""
    alpha = 1.0 - checked_confidence(confidence)
    return float(norm.isf(alpha / 2.0))


def _lowest(only_a: int, only_b: int, n: int, z: float, correction: float) -> float:
    """Return the smallest difference δ in the interval of :func:`difference_interval`."""
    apart = only_a - only_b - correction
    if apart <= -n:
        return -1.0

    def excess(delta: float) -> float:
        # p is the positive root of 2 n p² + linear p − only_b δ (1 − δ) = 0
        linear = (2 * n - only_a + only_b) * delta - only_a - only_b
        discriminant = linear**2 + 8 * n * only_b * delta * (1.0 - delta)
        root = math.sqrt(max(discriminant, 0.0))
        p = (root - linear) / (4 * n)
        variance = n * (2.0 * p + delta * (1.0 - delta))
        deviation = math.sqrt(max(variance, 0.0))
        return apart - n * delta - z * deviation

    # exclude the observed difference: the expression may be zero there too, but it is not the end
    # of the interval
    below_observed = apart / n - 1e-12
    return float(brentq(excess, -1.0, below_observed, xtol=1e-14))


def detectable(n: int, differing: float, confidence: float = 0.95, power: float = 0.8) -> float:
    """Return the smallest difference of two rates on n scenes that :func:`mcnemar` detects.

    ``differing`` is the share of scenes in which the two differ. ``power`` is the probability of
    detecting the difference with the correct sign. The result is inf if not even a difference of 1
    would be detected.
    """
    z = _quantile(confidence)
    # The test is significant if (wins − losses − CONTINUITY)/√m ≥ z in m differing scenes, with
    # wins + losses = m.
    m = np.arange(n + 1)
    needed_wins = np.ceil((m + CONTINUITY + z * np.sqrt(m)) / 2.0)

    def excess(delta: float) -> float:
        # share of scenes that differ, and probability that the first law wins in one of these
        share = max(differing, delta)
        wins = 0.5
        if share:
            wins = (1.0 + delta / share) / 2.0
        significant = binom.sf(needed_wins - 1.0, m, wins)
        detected = binom.pmf(m, n, share) @ significant
        return float(detected) - power

    if excess(1.0) <= 0.0:
        return math.inf
    return float(brentq(excess, 0.0, 1.0, xtol=1e-6))


def median(values: ArrayLike, confidence: float = 0.95) -> Median:
    """Return the median of (n,) values, which may be infinite, and its interval.

    The interval is exact and distribution-free: it reaches from the k-th smallest to the k-th
    largest value. k is the largest number for which the probability that fewer than k of n values
    lie below the median is at most α/2. If no value is zero, the interval excludes zero if and only
    if the two-sided sign test rejects at the level α. Raises InvalidInput if a value is NaN or not
    a number.
    """
    alpha = 1.0 - checked_confidence(confidence)
    ordered: Array = np.sort(array(values, "values"))
    n = len(ordered)
    if np.isnan(ordered).any():
        raise InvalidInput(
            "the median is undefined, since a value is NaN: leave out values that do not count"
        )
    if n == 0:
        return Median(math.nan, -math.inf, math.inf, 0)
    lower = ordered[(n - 1) // 2]
    upper = ordered[n // 2]
    # the sum of −∞ and ∞ would be NaN
    middle = 0.0 if lower == -upper else float((lower + upper) / 2.0)
    fewer_below = binom.cdf(np.arange(n), n, 0.5)
    k = int(np.count_nonzero(fewer_below <= alpha / 2.0))
    if k == 0:
        return Median(middle, -math.inf, math.inf, n)
    low = float(ordered[k - 1])
    high = float(ordered[n - k])
    return Median(middle, low, high, n)


def paired(
    a: ArrayLike,
    b: ArrayLike,
    kind: Kind = "difference",
    *,
    better: Better = "less",
    least: float = 0.0,
    confidence: float = 0.95,
) -> Paired:
    """Compare two columns of numbers, (n,) each, where entry i of both belongs to scene i.

    Scenes with NaN, which marks a run that does not count, are left out for both. Values that
    differ by at most ``least`` are equal. Raises InvalidInput if lengths differ, a value is
    infinite, or a value in a ratio is negative; ConfigurationError for invalid options.
    """
    checked_name("kind", kind, Kind)
    checked_name("direction", better, Better)
    first = numbers(a, "a")
    second = numbers(b, "b")
    require_pairs(first, second)
    of = len(first)
    counted = ~(np.isnan(first) | np.isnan(second))
    first = first[counted]
    second = second[counted]
    differences: Array = first - second
    is_more = differences > least
    is_less = -differences > least
    differing = is_more | is_less
    if kind == "log-ratio":
        differences = log_ratios(first, second)
    middle, low, high, n_differing = median(differences[differing], confidence)
    n = len(first)
    if n and not n_differing:
        middle = 0.0
    wins = int(is_more.sum())
    losses = int(is_less.sum())
    if better == "less":
        wins, losses = losses, wins
    p = sign_test(wins, losses)
    return Paired(middle, low, high, n, wins, losses, p, of)


def log_ratios(a: Array, b: Array) -> Array:
    """Return ln(a/b) of nonnegative values, (n,).

    It is −∞ where only a is zero, ∞ where only b is zero, and 0 where both are zero. Raises
    InvalidInput if a value is negative.
    """
    negative = np.concatenate([a[a < 0.0], b[b < 0.0]])
    if len(negative):
        raise InvalidInput(
            f"the ratio of negative values is undefined: {format_value(negative[0])}"
        )
    with np.errstate(divide="ignore", invalid="ignore"):  # zeros are allowed, see above
        difference = np.log(a) - np.log(b)
    return cast(Array, np.where(a == b, 0.0, difference))
