"""Families as random effects: what is true of a family like those that were run, and what hangs on one of them."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import expit, xlogy
from scipy.stats import f as variance_ratio
from scipy.stats import norm, rankdata

from ...errors import InvalidInput
from ...rows import Array
from .judged import array, checked_confidence

#: Where likelihoods are evaluated: logits of families, the standard deviation of these, and their mean, which is wider
#: the more they vary: rates from 1e-4 to 1 − 1e-4. A family of 1000 scenes, whose logit is known to 0.06, is resolved.
LOGITS, SPREADS = np.linspace(-12.0, 12.0, 601), np.geomspace(0.04, 6.0, 24)
MEANS = np.linspace(-9.0, 9.0, 181) * np.sqrt(1.0 + SPREADS[:, None] ** 2 / 3.0)


class Across(NamedTuple):
    """A rate in a family drawn like those that were run, and its interval; ``spread`` is that of families' logits."""

    share: float
    low: float
    high: float
    spread: float


def across_families(counts: ArrayLike, of: ArrayLike, confidence: float = 0.95) -> list[Across]:
    """Rates of ``counts`` in ``of`` scenes, (rates, families) each, by mixed logistic regression.

    The logit of a family's rate is normal around a common mean, and the count binomial. The share is the mean rate over
    all such families, at the greatest likelihood. The interval is that of its profile, with the quantile of F(1,
    families − 1) instead of χ², since the spread is estimated from few families. Of two laws, the scenes of each family
    in which only the first succeeds, of those in which they differ, give a share of 0.5 where neither is better: then
    what all families have in common is left out, as by conditional logistic regression.

    Raises InvalidInput for counts that are none, and fewer than two families.
    """
    successes, scenes = array(counts, "counts", 2), array(of, "of", 2)
    if successes.shape != scenes.shape or successes.shape[1] < 2:
        raise InvalidInput(
            f"counts and of must be of the same families, two at least: {successes.shape}, {scenes.shape}"
        )
    if not ((successes >= 0.0) & (successes <= scenes)).all():
        raise InvalidInput("counts must be from 0 to the number of scenes")
    density, shares = _grid()
    # without the binomial coefficient, relative to the greatest value
    known = xlogy(successes, expit(LOGITS)[:, None, None]) + xlogy(scenes - successes, expit(-LOGITS)[:, None, None])
    top = known.max(axis=0)
    likelihood = np.tensordot(density, np.exp(known - top), axes=1)  # (spreads, means, rates, families)
    profile = np.log(np.maximum(likelihood, 1e-300)).sum(axis=-1)
    drop = variance_ratio.isf(1.0 - checked_confidence(confidence), 1, successes.shape[1] - 1) / 2.0
    return [_across(profile[..., i], shares, drop) for i in range(len(successes))]


@lru_cache(maxsize=1)
def _grid() -> tuple[Array, Array]:
    """How likely each logit is (spreads, means, logits), and the mean rate (spreads, means)."""
    edges = np.concatenate([[-np.inf], (LOGITS[1:] + LOGITS[:-1]) / 2.0, [np.inf]])
    weights = np.diff(norm.cdf((edges - MEANS[..., None]) / SPREADS[:, None, None]))
    return weights, weights @ expit(LOGITS)


def _across(profile: Array, shares: Array, drop: float) -> Across:
    """From log-likelihoods and rates (spreads, means)."""
    best = np.unravel_index(profile.argmax(), profile.shape)
    low, high, last = 1.0, 0.0, profile.shape[1] - 1
    for line, share in zip(profile - profile.max() + drop, shares, strict=True):
        within = np.flatnonzero(line >= 0.0)
        if len(within):
            a, b = within[0], within[-1]
            low = min(low, _crossing(line, share, a, a - 1) if a else 0.0)
            high = max(high, _crossing(line, share, b, b + 1) if b < last else 1.0)
    share = {0: 0.0, last: 1.0}.get(int(best[1]), float(shares[best]))  # the ends stand for ±∞
    return Across(share, low, high, float(SPREADS[best[0]]))


def _crossing(line: Array, share: Array, inner: int, outer: int) -> float:
    """The rate at which a line passes zero, between two of its points."""
    part = line[inner] / (line[inner] - line[outer])
    return float(share[inner] + part * (share[outer] - share[inner]))


def left_out_ranks(rates: ArrayLike) -> Array:
    """Ranks (families, laws) by the mean of ``rates`` (families, laws) without one family, 1 the best; ties share."""
    each = array(rates, "rates", 2)
    if len(each) < 2:
        raise InvalidInput("one family cannot be left out of one")
    ranks: Array = rankdata(-np.round(each.sum(axis=0) - each, 12), method="min", axis=1)
    return ranks
