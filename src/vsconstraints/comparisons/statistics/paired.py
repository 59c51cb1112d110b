"""Two laws on the same scenes, by a number."""

from __future__ import annotations

from typing import Literal, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InvalidInput, shown
from ...rows import Array
from .inputs import Better, checked_name, numbers, pair
from .median import median
from .rates import sign_test

Kind = Literal["difference", "log-ratio"]
"""a − b, or ln(a/b)."""


class Paired(NamedTuple):
    """How a differs from b on the same scenes.

    Attributes
    ----------
    median, low, high
        Median of a − b, or of ln(a/b), over the scenes in which they differ, and its exact interval,
        :func:`.median.median`. Where they differ in none the median is zero and the interval from −∞ to ∞.
    n
        Scenes in which both have a value: the only ones that are compared. Of none, the median is NaN.
    wins, losses
        Scenes in which a is better than b, and in which it is worse.
    p
        Two-sided, of the exact sign test of wins and losses: at most 1 − confidence if and only if the interval
        excludes zero.
    of
        Scenes given.
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
        """Chance that a is better than b on a scene, equal values counting half; 0.5 of no scene."""
        return (1.0 + (self.wins - self.losses) / self.n) / 2.0 if self.n else 0.5


def paired(
    a: ArrayLike,
    b: ArrayLike,
    kind: Kind = "difference",
    *,
    better: Better = "less",
    least: float = 0.0,
    confidence: float = 0.95,
) -> Paired:
    """Compare two columns of numbers, (n,) each, entry i of both being scene i.

    NaN stands for a run that does not count (one that diverged, or violated): its scene is left out for both. Values
    that are no more than ``least`` apart are equal.

    Raises
    ------
    InvalidInput
        if the lengths differ, a value is infinite, or one is negative of which a ratio is asked.
    ConfigurationError
        if an option is none.
    """
    checked_name("kind", kind, Kind)
    checked_name("direction", better, Better)
    one, other = numbers(a, "a"), numbers(b, "b")
    pair(one, other)
    both = ~(np.isnan(one) | np.isnan(other))
    one, other = one[both], other[both]
    differences = one - other if kind == "difference" else log_ratios(one, other)
    middle = median(differences[np.abs(one - other) > least], confidence)
    less, more = int((other - one > least).sum()), int((one - other > least).sum())
    wins, losses = (less, more) if better == "less" else (more, less)
    value = middle.median if middle.n or not len(one) else 0.0
    return Paired(value, middle.low, middle.high, len(one), wins, losses, sign_test(wins, losses), len(both))


def log_ratios(a: Array, b: Array) -> Array:
    """(n,) ln(a/b) of values that are not negative: −∞ where only a is zero, ∞ where only b is, 0 where both are."""
    negative = np.concatenate([a[a < 0.0], b[b < 0.0]])
    if len(negative):
        raise InvalidInput(f"no ratio of negative values: {shown(negative[0])}")
    with np.errstate(divide="ignore", invalid="ignore"):  # logarithms of zero, as said
        return cast(Array, np.where(a == b, 0.0, np.log(a) - np.log(b)))
