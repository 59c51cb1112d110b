"""Ranks and performance profiles of laws over many scenes; families of scenes as random effects."""

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

from ...errors import InvalidInput
from ...rows import Array
from .judged import array, checked_confidence
from .rates import sign_test


class Ranks(NamedTuple):
    """Mean ranks (laws,) over n scenes, 1 the best, and what distinguishes them (Demšar, JMLR 7,
    2006).

    Means that differ by less than the critical difference q √(k (k + 1)/(6 n)) of k laws are not
    distinguished (Nemenyi 1963). ``p`` is of Friedman's test that all rank alike; of two laws, of
    the sign test. ``p_values`` (laws, laws) are of Nemenyi's test, corrected for all pairs.
    ``groups`` are the largest of two laws or more, by their columns, best first, that are not
    distinguished; all laws where Friedman's test finds no difference.
    """

    means: Array
    critical_difference: float
    p: float
    p_values: Array
    groups: tuple[tuple[int, ...], ...]
    n: int


def ranks(costs: ArrayLike, confidence: float = 0.95) -> Ranks:
    """Rank the columns of (scenes, laws) costs of which less is better, failures at infinity, and
    so equally last.
    """
    level = 1.0 - checked_confidence(confidence)
    known = _checked(costs)
    n, k = known.shape
    if n == 0:
        return Ranks(
            np.full(k, (k + 1) / 2),
            math.inf,
            1.0,
            np.ones((k, k)),
            _groups(np.zeros(k), math.inf),
            0,
        )
    each = rankdata(known, axis=1)
    means = each.mean(axis=0)
    unit = math.sqrt(k * (k + 1) / (6.0 * n))
    width = (
        unit * float(studentized_range.isf(level, k, math.inf)) / math.sqrt(2.0) if k > 1 else 0.0
    )
    apart = np.abs(means[:, None] - means) / unit * math.sqrt(2.0)
    p_values = studentized_range.sf(apart, k, math.inf) if k > 1 else np.ones((1, 1))
    p = _friedman(each)
    return Ranks(means, width, p, p_values, _groups(means, width if p < level else math.inf), n)


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
    """Performance profile (Dolan and Moré, Mathematical Programming 91, 2002): (scenes, laws)
    ``ratios``.

    They are of each law's cost and the least of the scene, infinite where it failed; ``shift`` was
    added before.
    """

    ratios: Array
    shift: float

    def share(self, tau: ArrayLike) -> Array:
        """(…, laws) ρ(τ): share of the scenes in which a law's ratio is at most τ. Zero of no
        scene.
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
        """(laws,) share of the scenes in which a law did not fail: where its curve ends."""
        return self.share(np.inf)

    @property
    def steps(self) -> Array:
        """All τ at which a curve steps, in order, beginning with 1."""
        return np.unique(np.concatenate([[1.0], self.ratios[np.isfinite(self.ratios)]]))


def profile(costs: ArrayLike, shift: float | None = None) -> Profile:
    """The profile of (scenes, laws) costs of which less is better, failures at infinity.

    Where one is not positive, or on demand, ``shift`` is added to all: without it so much that the
    least becomes as great as the median is above it (the mean, if the median is no greater; 1, if
    all are equal).
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


#: Where likelihoods are evaluated: logits of families, the standard deviation of these, and their
#: mean, which is wider the more they vary: rates from 1e-4 to 1 − 1e-4. A family of 1000 scenes,
#: whose logit is known to 0.06, is resolved.
LOGITS = np.linspace(-12.0, 12.0, 601)
SPREADS = np.geomspace(0.04, 6.0, 24)
MEANS = np.linspace(-9.0, 9.0, 181) * np.sqrt(1.0 + SPREADS[:, None] ** 2 / 3.0)


class Across(NamedTuple):
    """A rate in a family like those that were run, and its interval; ``spread`` is that of
    families' logits.
    """

    share: float
    low: float
    high: float
    spread: float


def across_families(counts: ArrayLike, of: ArrayLike, confidence: float = 0.95) -> list[Across]:
    """Rates of ``counts`` in ``of`` scenes, (rates, families) each, by mixed logistic regression.

    The logit of a family's rate is normal around a common mean, and the count binomial. The share
    is the mean rate over all such families at the greatest likelihood, the interval that of its
    profile, with the quantile of F(1, families − 1) instead of χ², since the spread is estimated
    from few families. Of two laws, the scenes of each family in which only the first succeeds, of
    those in which they differ, give 0.5 where neither is better: what families have in common is
    left out, as by conditional logistic regression. Raises InvalidInput for fewer than two
    families.
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
    # without the binomial coefficient, relative to the greatest value
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
    """How likely logits are (spreads, means, logits), and the mean rate (spreads, means)."""
    edges = np.concatenate([[-np.inf], (LOGITS[1:] + LOGITS[:-1]) / 2.0, [np.inf]])
    weights = np.diff(norm.cdf((edges - MEANS[..., None]) / SPREADS[:, None, None]))
    return weights, weights @ expit(LOGITS)


def _across(profile: Array, shares: Array, drop: float) -> Across:
    """From log-likelihoods and rates (spreads, means)."""
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
    share = {0: 0.0, last: 1.0}.get(int(best[1]), float(shares[best]))  # the ends stand for ±∞
    return Across(share, low, high, float(SPREADS[best[0]]))


def _crossing(line: Array, share: Array, inner: int, outer: int) -> float:
    part = line[inner] / (line[inner] - line[outer])
    return float(share[inner] + part * (share[outer] - share[inner]))


def left_out_ranks(rates: ArrayLike) -> Array:
    """Ranks (families, laws) by the mean of ``rates`` (families, laws) without one family, 1 the
    best; ties share.
    """
    each = array(rates, "rates", 2)
    if len(each) < 2:
        raise InvalidInput("one family cannot be left out of one")
    ranks: Array = rankdata(-np.round(each.sum(axis=0) - each, 12), method="min", axis=1)
    return ranks
