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
    if n == 0:
        everything = _groups(np.zeros(k), math.inf)
        return Ranks(np.full(k, (k + 1) / 2), math.inf, 1.0, np.ones((k, k)), everything, 0)
    each = rankdata(known, axis=1)
    means = each.mean(axis=0)
    if k == 1:
        return Ranks(means, 0.0, 1.0, np.ones((1, 1)), (), n)
    p = _friedman(each)
    unit = math.sqrt(k * (k + 1) / (6.0 * n))
    width = unit * float(studentized_range.isf(level, k, math.inf)) / math.sqrt(2.0)
    distances = np.abs(means[:, None] - means) / unit
    p_values = studentized_range.sf(distances * math.sqrt(2.0), k, math.inf)
    groups = _groups(means, width if p < level else math.inf)
    return Ranks(means, width, p, p_values, groups, n)


def _checked(costs: ArrayLike) -> Array:
    known = array(costs, "costs", 2)
    if np.isnan(known).any() or (known == -np.inf).any():
        raise InvalidInput(
            "costs must be numbers, or infinite where a law failed; leave out scenes without a "
            "value"
        )
    return known


def _friedman(each: Array) -> float:
    if not (each != each.mean(axis=1, keepdims=True)).any():
        return 1.0
    if each.shape[1] == 2:
        return sign_test(int((each[:, 0] < each[:, 1]).sum()), int((each[:, 0] > each[:, 1]).sum()))
    return float(friedmanchisquare(*each.T).pvalue)


def _groups(means: Array, width: float) -> tuple[tuple[int, ...], ...]:
    order = np.argsort(means, kind="stable")
    ends = np.searchsorted(means[order], means[order] + width, side="right")
    first = [i for i, end in enumerate(ends) if end > i + 1 and (i == 0 or end > ends[i - 1])]
    return tuple(tuple(int(law) for law in order[i : ends[i]]) for i in first)


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
        ordered = np.sort(self.ratios, axis=0)
        finite = np.isfinite(self.ratios).sum(axis=0)
        within = [
            np.searchsorted(law, np.asarray(tau, dtype=float), side="right") for law in ordered.T
        ]
        share: Array = np.minimum(np.stack(within, axis=-1), finite) / max(len(ordered), 1)
        return share

    @property
    def solved(self) -> Array:
        """Share of scenes (laws,) in which a law did not fail: final value of its curve."""
        return self.share(np.inf)

    @property
    def steps(self) -> Array:
        """All τ at which a curve steps, in ascending order from 1."""
        return np.unique(np.concatenate([[1.0], self.ratios[np.isfinite(self.ratios)]]))


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
        shift = (float(np.median(finite) - least) or float(np.mean(finite) - least) or 1.0) - least
    shift = shift or 0.0
    moved = known + shift
    if moved.min(initial=1.0) <= 0.0:
        raise InvalidInput(
            f"a profile needs positive costs: the least is {finite.min():g}, and {shift:g} is added"
        )
    ratios = np.full(moved.shape, np.inf)
    np.divide(moved, moved.min(axis=1, keepdims=True), out=ratios, where=np.isfinite(moved))
    return Profile(ratios, shift)


#: Grid on which likelihoods are evaluated: logits of families, their standard deviation and their
#: mean. The range of the mean grows with the standard deviation and covers rates from 1e-4 to
#: 1 − 1e-4. The grid resolves the logit of a family of 1000 scenes, which is known to 0.06.
LOGITS = np.linspace(-12.0, 12.0, 601)
SPREADS = np.geomspace(0.04, 6.0, 24)
MEANS = np.linspace(-9.0, 9.0, 181) * np.sqrt(1.0 + SPREADS[:, None] ** 2 / 3.0)


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
    # log-likelihood without the constant binomial coefficient; its maximum is subtracted below
    known = xlogy(successes, expit(LOGITS)[:, None, None]) + xlogy(
        scenes - successes, expit(-LOGITS)[:, None, None]
    )
    top = known.max(axis=0)
    # (spreads, means, rates, families)
    likelihood = np.tensordot(density, np.exp(known - top), axes=1)
    profile = np.log(np.maximum(likelihood, 1e-300)).sum(axis=-1)
    drop = variance_ratio.isf(1.0 - checked_confidence(confidence), 1, successes.shape[1] - 1) / 2.0
    return [_across(profile[..., i], shares, drop) for i in range(len(successes))]


@lru_cache(maxsize=1)
def _grid() -> tuple[Array, Array]:
    """Return the probabilities of logits and the mean rates on the grid.

    Their shapes are (spreads, means, logits) and (spreads, means).
    """
    edges = np.concatenate([[-np.inf], (LOGITS[1:] + LOGITS[:-1]) / 2.0, [np.inf]])
    weights = np.diff(norm.cdf((edges - MEANS[..., None]) / SPREADS[:, None, None]))
    return weights, weights @ expit(LOGITS)


def _across(profile: Array, shares: Array, drop: float) -> Across:
    """Return the estimate from profile log-likelihoods and mean rates (spreads, means)."""
    best = np.unravel_index(profile.argmax(), profile.shape)
    low = 1.0
    high = 0.0
    last = profile.shape[1] - 1
    for line, share in zip(profile - profile.max() + drop, shares, strict=True):
        within = np.flatnonzero(line >= 0.0)
        if len(within):
            a = within[0]
            b = within[-1]
            low = min(low, _crossing(line, share, a, a - 1) if a else 0.0)
            high = max(high, _crossing(line, share, b, b + 1) if b < last else 1.0)
    share = {0: 0.0, last: 1.0}.get(int(best[1]), float(shares[best]))  # the ends represent ±∞
    return Across(share, low, high, float(SPREADS[best[0]]))


def _crossing(line: Array, share: Array, inner: int, outer: int) -> float:
    part = line[inner] / (line[inner] - line[outer])
    return float(share[inner] + part * (share[outer] - share[inner]))


def left_out_ranks(rates: ArrayLike) -> Array:
    """Return the ranks (families, laws) of laws with one family left out.

    Row i ranks laws by the mean of ``rates`` (families, laws) over all families except i. Rank 1 is
    the best, and equal laws share the better rank. Raises InvalidInput for fewer than two families.
    """
    each = array(rates, "rates", 2)
    if len(each) < 2:
        raise InvalidInput("leaving out a family needs two families or more, not one")
    ranks: Array = rankdata(-np.round(each.sum(axis=0) - each, 12), method="min", axis=1)
    return ranks
