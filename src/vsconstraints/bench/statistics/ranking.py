"""Ranks and performance profiles of laws, and rates with scenario families as random effects."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import expit, xlogy
from scipy.stats import f as variance_ratio
from scipy.stats import friedmanchisquare, norm, rankdata, studentized_range

from ...comparisons.rates import checked_confidence
from ...errors import InvalidInput
from ...rows import Array
from .judged import array
from .rates import sign_test


class Ranks(NamedTuple):
    """Mean ranks (laws,) over n scenes, 1 the best, with significance tests.

    See Demšar, JMLR 7, 2006. Mean ranks of k laws do not differ significantly if their difference
    is less than the critical difference q √(k (k + 1)/(6 n)) (Nemenyi 1963). ``p`` is the p-value
    of Friedman's test of equal ranks, or of the sign test for two laws. ``p_values`` (laws, laws)
    belong to Nemenyi's test and are corrected for all pairs. ``groups`` are the largest sets of two
    or more laws without significant differences, as columns, best first. If Friedman's test is not
    significant, one group contains all laws.
    """

    means: Array
    critical_difference: float
    p: float
    p_values: Array
    groups: tuple[tuple[int, ...], ...]
    n: int


def ranks(costs: ArrayLike, confidence: float = 0.95) -> Ranks:
    """Rank the columns of (scenes, laws) costs, where smaller is better.

    A failure has infinite cost, so that all failures share the last rank.
    """
    level = 1.0 - checked_confidence(confidence)
    known = _checked(costs)
    n, k = known.shape
    p_values_if_equal = np.ones((k, k))
    if n == 0:
        means = np.full(k, (k + 1) / 2)
        return Ranks(means, math.inf, 1.0, p_values_if_equal, _groups(means, math.inf), n)
    scene_ranks = rankdata(known, axis=1)
    means = scene_ranks.mean(axis=0)
    if k == 1:
        return Ranks(means, 0.0, 1.0, p_values_if_equal, groups=(), n=n)
    p = _friedman(scene_ranks)
    # The studentized range is that of normal variables; their difference has √2 times the standard
    # deviation.
    unit = math.sqrt(k * (k + 1) / (6.0 * n))
    quantile = float(studentized_range.isf(level, k, math.inf))
    critical_difference = unit * quantile / math.sqrt(2.0)
    distances = np.abs(means[:, None] - means) / unit
    p_values = studentized_range.sf(distances * math.sqrt(2.0), k, math.inf)
    groups = _groups(means, critical_difference if p < level else math.inf)
    return Ranks(means, critical_difference, p, p_values, groups, n)


def _checked(costs: ArrayLike) -> Array:
    known = array(costs, "costs", 2)
    if np.isnan(known).any() or (known == -np.inf).any():
        raise InvalidInput(
            "costs must be numbers, or infinite where a law failed; leave out scenes without a "
            "value"
        )
    return known


def _friedman(scene_ranks: Array) -> float:
    """Return the p-value of equal ranks (scenes, laws)."""
    scene_means = scene_ranks.mean(axis=1, keepdims=True)
    if not (scene_ranks != scene_means).any():
        return 1.0
    if scene_ranks.shape[1] == 2:
        first, second = scene_ranks.T
        wins = int((first < second).sum())
        losses = int((first > second).sum())
        return sign_test(wins, losses)
    return float(friedmanchisquare(*scene_ranks.T).pvalue)


def _groups(means: Array, width: float) -> tuple[tuple[int, ...], ...]:
    """Return the largest sets of two or more laws whose means differ by at most a width."""
    order = np.argsort(means, kind="stable")
    ordered = means[order]
    groups = []
    longest_end = 0
    ends = np.searchsorted(ordered, ordered + width, side="right")
    for begin, end in enumerate(ends):
        # a group that ends where an earlier one does is contained in it
        if end > begin + 1 and end > longest_end:
            laws = order[begin:end].tolist()
            groups.append(tuple(laws))
        longest_end = max(longest_end, end)
    return tuple(groups)


@dataclass(frozen=True)
class Profile:
    """Performance profile (Dolan and Moré, Mathematical Programming 91, 2002).

    ``ratios`` (scenes, laws) divide the cost of each law by the smallest cost in the scene; inf
    where the law failed. ``shift`` was added to all costs before.
    """

    ratios: Array
    shift: float

    def share(self, tau: ArrayLike) -> Array:
        """Return ρ(τ) (…, laws): share of scenes in which the ratio of a law is at most τ.

        It is zero without scenes.
        """
        limits = np.asarray(tau, dtype=float)
        scenes = max(len(self.ratios), 1)
        shares = []
        for ratios in self.ratios.T:
            solved = np.sort(ratios[np.isfinite(ratios)])
            counts = np.searchsorted(solved, limits, side="right")
            shares.append(counts / scenes)
        return np.stack(shares, axis=-1)

    @property
    def solved(self) -> Array:
        """Share of scenes (laws,) in which a law did not fail: final value of its curve."""
        return self.share(np.inf)

    @property
    def steps(self) -> Array:
        """All τ at which a curve steps, in ascending order from 1."""
        finite = self.ratios[np.isfinite(self.ratios)]
        return np.unique(np.append(finite, 1.0))


def profile(costs: ArrayLike, shift: float | None = None) -> Profile:
    """Return the performance profile of (scenes, laws) costs, where smaller is better.

    A failure has infinite cost. ``shift`` is added to all costs. If it is not given but a cost is
    not positive, the shift makes the smallest cost equal to the distance between the smallest cost
    and the median. If this distance is zero, the mean replaces the median; if all costs are equal,
    the smallest cost becomes 1. Raises InvalidInput if a shifted cost is not positive.
    """
    known = _checked(costs)
    finite = known[np.isfinite(known)]
    if shift is None and finite.min(initial=1.0) <= 0.0:
        least = float(finite.min())
        to_median = float(np.median(finite) - least)
        to_mean = float(np.mean(finite) - least)
        smallest_shifted = to_median or to_mean or 1.0
        shift = smallest_shifted - least
    shift = shift or 0.0
    moved = known + shift
    if moved.min(initial=1.0) <= 0.0:
        raise InvalidInput(
            f"a profile needs positive costs: the least is {finite.min():g}, and {shift:g} is added"
        )
    ratios = np.full(moved.shape, np.inf)
    least_of_scene = moved.min(axis=1, keepdims=True)
    np.divide(moved, least_of_scene, out=ratios, where=np.isfinite(moved))
    return Profile(ratios, shift)


#: Grid on which likelihoods are evaluated: logits of families, their standard deviation and their
#: mean. The range of the mean grows with the standard deviation and covers rates from 1e-4 to
#: 1 − 1e-4. The grid resolves the logit of a family of 1000 scenes, which is known to 0.06.
LOGITS = np.linspace(-12.0, 12.0, 601)
SPREADS = np.geomspace(0.04, 6.0, 24)
_GROWTH = np.sqrt(1.0 + SPREADS[:, None] ** 2 / 3.0)
MEANS = np.linspace(-9.0, 9.0, 181) * _GROWTH


class Across(NamedTuple):
    """Rate in a family similar to those that were run, with its interval.

    ``spread`` is the standard deviation of the logits of families.
    """

    share: float
    low: float
    high: float
    spread: float


def across_families(counts: ArrayLike, of: ArrayLike, confidence: float = 0.95) -> list[Across]:
    """Estimate rates in a population of families by mixed logistic regression.

    ``counts`` and ``of``, (rates, families) each, are the counted and all scenes of each family.
    The logit of a family's rate is normally distributed around a common mean, and the count is
    binomial. The share is the mean rate over all such families at the maximum likelihood. The
    interval is the profile likelihood interval, with the quantile of F(1, families − 1) instead of
    χ², since the spread is estimated from few families.

    To compare two laws, let ``of`` be the number of scenes of each family in which they differ, and
    ``counts`` the number of those in which only the first succeeds. A share of 0.5 then means that
    neither is better. As in conditional logistic regression, effects that are common to all scenes
    of a family cancel. Raises InvalidInput for fewer than two families.
    """
    successes = array(counts, "counts", 2)
    scenes = array(of, "of", 2)
    if successes.shape != scenes.shape or successes.shape[1] < 2:
        raise InvalidInput(
            f"counts and of must be of the same two families or more: {successes.shape}, "
            f"{scenes.shape}"
        )
    if not ((successes >= 0.0) & (successes <= scenes)).all():
        raise InvalidInput("counts must be from 0 to the number of scenes")
    density, shares = _grid()
    # Log-likelihood (logits, rates, families) without the constant binomial coefficient. Its
    # maximum is subtracted before exponentiation, so that not all likelihoods vanish.
    success_rate = expit(LOGITS)[:, None, None]
    failure_rate = expit(-LOGITS)[:, None, None]
    given_logit = xlogy(successes, success_rate) + xlogy(scenes - successes, failure_rate)
    relative = np.exp(given_logit - given_logit.max(axis=0))
    # (spreads, means, rates, families): the logit of each family is integrated out
    likelihood = np.tensordot(density, relative, axes=1)
    log_likelihood = np.log(np.maximum(likelihood, 1e-300)).sum(axis=-1)
    families = successes.shape[1]
    quantile = variance_ratio.isf(1.0 - checked_confidence(confidence), 1, families - 1)
    drop = quantile / 2.0
    estimates = []
    for i in range(len(successes)):
        estimates.append(_across(log_likelihood[..., i], shares, drop))
    return estimates


@lru_cache(maxsize=1)
def _grid() -> tuple[Array, Array]:
    """Return the probabilities of logits and the mean rates on the grid.

    Their shapes are (spreads, means, logits) and (spreads, means).
    """
    midpoints = (LOGITS[1:] + LOGITS[:-1]) / 2.0
    edges = np.concatenate([[-np.inf], midpoints, [np.inf]])
    standardized = (edges - MEANS[..., None]) / SPREADS[:, None, None]
    weights = np.diff(norm.cdf(standardized))
    return weights, weights @ expit(LOGITS)


def _across(log_likelihood: Array, shares: Array, drop: float) -> Across:
    """Return the estimate from log-likelihoods and mean rates (spreads, means).

    The interval contains all mean rates whose log-likelihood is at most ``drop`` below the maximum,
    for any spread.
    """
    best = np.unravel_index(log_likelihood.argmax(), log_likelihood.shape)
    best_spread, best_mean = map(int, best)
    low = 1.0
    high = 0.0
    last = log_likelihood.shape[1] - 1
    margins = log_likelihood - log_likelihood.max() + drop
    for margin, share in zip(margins, shares, strict=True):
        inside = np.flatnonzero(margin >= 0.0)
        if not len(inside):
            continue
        first_inside = inside[0]
        last_inside = inside[-1]
        # the ends of the grid represent means of ±∞, that is, rates of 0 and 1
        begin = 0.0
        if first_inside > 0:
            begin = _crossing(margin, share, first_inside, first_inside - 1)
        end = 1.0
        if last_inside < last:
            end = _crossing(margin, share, last_inside, last_inside + 1)
        low = min(low, begin)
        high = max(high, end)
    estimate = float(shares[best])
    if best_mean == 0:
        estimate = 0.0
    elif best_mean == last:
        estimate = 1.0
    return Across(estimate, low, high, float(SPREADS[best_spread]))


def _crossing(margin: Array, share: Array, inner: int, outer: int) -> float:
    """Return the share at which the margin is zero, by linear interpolation."""
    part = margin[inner] / (margin[inner] - margin[outer])
    step = share[outer] - share[inner]
    return float(share[inner] + part * step)


def left_out_ranks(rates: ArrayLike) -> Array:
    """Return the ranks (families, laws) of laws with one family left out.

    Row i ranks laws by the mean of ``rates`` (families, laws) over all families except i. Rank 1 is
    the best, and equal laws share the better rank. Raises InvalidInput for fewer than two families.
    """
    each = array(rates, "rates", 2)
    if len(each) < 2:
        raise InvalidInput("leaving out a family needs two families or more, not one")
    sums_of_others = each.sum(axis=0) - each
    # sums that differ by rounding are equal
    ranks: Array = rankdata(-np.round(sums_of_others, 12), method="min", axis=1)
    return ranks
