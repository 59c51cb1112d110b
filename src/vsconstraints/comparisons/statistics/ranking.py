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
from .judged import checked_confidence, table
from .rates import sign_test


class Ranks(NamedTuple):
    """Mean ranks, and what distinguishes them (Demšar, Journal of Machine Learning Research 7, 2006).

    Attributes
    ----------
    means
        (laws,) mean rank over the scenes: 1 for a law that is always the best; equal costs share their ranks.
    critical_difference
        Mean ranks that differ by less are not distinguished (Nemenyi 1963): q √(k (k + 1)/(6 n)) of k laws, n scenes.
    p
        Of Friedman's test that all laws rank alike; of two laws, of the sign test.
    p_values
        (laws, laws) of Nemenyi's test, each pair's corrected for all pairs.
    groups
        Laws that are not distinguished from each other, by their columns, best first: the bars of a critical-difference
        diagram. Largest groups only, of two laws or more; all laws where Friedman's test finds no difference.
    n
        Scenes.
    """

    means: Array
    critical_difference: float
    p: float
    p_values: Array
    groups: tuple[tuple[int, ...], ...]
    n: int


def ranks(costs: ArrayLike, confidence: float = 0.95) -> Ranks:
    """Rank the columns of (scenes, laws) costs of which less is better, failures at infinity, and so equally last."""
    level = 1.0 - checked_confidence(confidence)
    given = table(costs)
    n, k = given.shape
    if n == 0:
        return Ranks(np.full(k, (k + 1) / 2), math.inf, 1.0, np.ones((k, k)), _groups(np.zeros(k), math.inf), 0)
    each = rankdata(given, axis=1)
    means = each.mean(axis=0)
    unit = math.sqrt(k * (k + 1) / (6.0 * n))
    width = unit * float(studentized_range.isf(level, k, math.inf)) / math.sqrt(2.0) if k > 1 else 0.0
    apart = np.abs(means[:, None] - means) / unit * math.sqrt(2.0)
    p_values = studentized_range.sf(apart, k, math.inf) if k > 1 else np.ones((1, 1))
    p = _friedman(each)
    return Ranks(means, width, p, p_values, _groups(means, width if p < level else math.inf), n)


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

    Attributes
    ----------
    ratios
        (scenes, laws) each law's cost over the least of the scene; infinite where it failed.
    shift
        Added to all costs before: 0 if all are positive.
    """

    ratios: Array
    shift: float

    def share(self, tau: ArrayLike) -> Array:
        """(…, laws) ρ(τ): share of the scenes in which a law's ratio is at most τ. Zero of no scene."""
        given = np.asarray(tau, dtype=float)
        ordered = np.sort(self.ratios, axis=0)
        within = [np.searchsorted(law, given, side="right") for law in ordered.T]
        finite = np.isfinite(self.ratios).sum(axis=0)
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
    given = table(costs)
    finite = given[np.isfinite(given)]
    if shift is None:
        shift = _shift(finite) if finite.min(initial=1.0) <= 0.0 else 0.0
    moved = given + shift
    if moved.min(initial=1.0) <= 0.0:
        raise InvalidInput(
            f"a profile needs positive costs: the least is {finite.min():g}, and {shift:g} is added to it"
        )
    best = moved.min(axis=1, keepdims=True)
    ratios = np.full(moved.shape, np.inf)
    np.divide(moved, best, out=ratios, where=np.isfinite(moved))
    return Profile(ratios, shift)


def _shift(finite: Array) -> float:
    least = finite.min()
    above = float(np.median(finite) - least) or float(np.mean(finite) - least) or 1.0
    return above - float(least)
