"""Mean ranks of laws over many scenes, and performance profiles: how near to the best one, in how many scenes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import friedmanchisquare, rankdata, studentized_range

from ...errors import InvalidInput
from ...rows import Array
from .judged import array, checked_confidence
from .rates import sign_test


class Ranks(NamedTuple):
    """Mean ranks (laws,) over n scenes, and what distinguishes them (Demšar, J. Machine Learning Research 7, 2006).

    Rank 1 is the best; equal costs share their ranks. Mean ranks that differ by less than the critical difference
    q √(k (k + 1)/(6 n)) of k laws are not distinguished (Nemenyi 1963). ``p`` is of Friedman's test that all laws rank
    alike; of two laws, of the sign test. ``p_values`` (laws, laws) are of Nemenyi's test, corrected for all pairs.
    ``groups`` are the largest groups of two laws or more, by their columns, best first, that are not distinguished: the
    bars of a critical-difference diagram; all laws where Friedman's test finds no difference.
    """

    means: Array
    critical_difference: float
    p: float
    p_values: Array
    groups: tuple[tuple[int, ...], ...]
    n: int


def ranks(costs: ArrayLike, confidence: float = 0.95) -> Ranks:
    """Rank the columns of (scenes, laws) costs of which less is better, failures at infinity, and so equally last."""
    level, known = 1.0 - checked_confidence(confidence), _checked(costs)
    n, k = known.shape
    if n == 0:
        return Ranks(np.full(k, (k + 1) / 2), math.inf, 1.0, np.ones((k, k)), _groups(np.zeros(k), math.inf), 0)
    each = rankdata(known, axis=1)
    means = each.mean(axis=0)
    unit = math.sqrt(k * (k + 1) / (6.0 * n))
    width = unit * float(studentized_range.isf(level, k, math.inf)) / math.sqrt(2.0) if k > 1 else 0.0
    apart = np.abs(means[:, None] - means) / unit * math.sqrt(2.0)
    p_values = studentized_range.sf(apart, k, math.inf) if k > 1 else np.ones((1, 1))
    p = _friedman(each)
    return Ranks(means, width, p, p_values, _groups(means, width if p < level else math.inf), n)


def _checked(costs: ArrayLike) -> Array:
    known = array(costs, "costs", 2)
    if np.isnan(known).any() or (known == -np.inf).any():
        raise InvalidInput("costs must be numbers, or infinite where a law failed; leave out scenes without a value")
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

    ``ratios`` (scenes, laws) are each law's cost over the least of the scene, infinite where it failed; ``shift`` was
    added to all costs before: 0 if all are positive.
    """

    ratios: Array
    shift: float

    def share(self, tau: ArrayLike) -> Array:
        """(…, laws) ρ(τ): share of the scenes in which a law's ratio is at most τ. Zero of no scene."""
        ordered, finite = np.sort(self.ratios, axis=0), np.isfinite(self.ratios).sum(axis=0)
        within = [np.searchsorted(law, np.asarray(tau, dtype=float), side="right") for law in ordered.T]
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

    Ratios need positive costs. Where one is not, or on demand, ``shift`` is added to all of them; if it is not given,
    the least cost becomes as great as the median is above it (the mean, if the median is no greater; 1, if all are
    equal), so that a ratio of 2 is a median scene against the best possible one.
    """
    known = _checked(costs)
    finite = known[np.isfinite(known)]
    if shift is None:
        shift = _shift(finite) if finite.min(initial=1.0) <= 0.0 else 0.0
    moved = known + shift
    if moved.min(initial=1.0) <= 0.0:
        raise InvalidInput(
            f"a profile needs positive costs: the least is {finite.min():g}, and {shift:g} is added to it"
        )
    ratios = np.full(moved.shape, np.inf)
    np.divide(moved, moved.min(axis=1, keepdims=True), out=ratios, where=np.isfinite(moved))
    return Profile(ratios, shift)


def _shift(finite: Array) -> float:
    least = finite.min()
    above = float(np.median(finite) - least) or float(np.mean(finite) - least) or 1.0
    return above - float(least)
