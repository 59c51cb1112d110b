"""Two laws on the same scenes, by a number."""

from __future__ import annotations

import warnings
from typing import Literal, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import wilcoxon

from ..errors import InvalidInput, shown
from ..rows import Array
from .inputs import FEWEST, Better, checked_name, numbers, pair
from .median import median
from .rates import difference_interval

Kind = Literal["difference", "log-ratio"]
"""a − b, or ln(a/b)."""


class Paired(NamedTuple):
    """How a differs from b on the same scenes.

    Attributes
    ----------
    median, low, high
        Median over the scenes of a − b, or of ln(a/b), and its interval, :func:`.median.median`; NaN of no scene, and
        an interval from −∞ to ∞ where there are too few.
    n
        Scenes in which both have a value: the only ones that are compared.
    p
        Two-sided, of Wilcoxon's signed-rank test, with Pratt's treatment of scenes without a difference. 1 where
        nothing differs.
    effect, effect_low, effect_high
        Chance that a is better than b on a scene, equal values counting half, and its interval
        (:func:`.rates.difference_interval` of wins and losses). 0.5 of no scene.
    of
        Scenes given.
    """

    median: float
    low: float
    high: float
    n: int
    p: float
    effect: float
    effect_low: float
    effect_high: float
    of: int

    @property
    def too_few(self) -> bool:
        """Whether there are too few scenes to tell anything."""
        return self.n < FEWEST


def paired(
    a: ArrayLike,
    b: ArrayLike,
    kind: Kind = "difference",
    *,
    better: Better = "less",
    confidence: float = 0.95,
    seed: int = 0,
) -> Paired:
    """Compare two columns of numbers, (n,) each, entry i of both being scene i.

    NaN stands for a run that does not count (one that diverged, or violated): its scene is left out for both.

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
    middle = median(differences, confidence, seed)
    less, more = int((one < other).sum()), int((one > other).sum())
    wins, losses = (less, more) if better == "less" else (more, less)
    n = middle.n
    low, high = difference_interval(wins, losses, n, confidence)
    effect = (1.0 + (wins - losses) / n) / 2.0 if n else 0.5
    return Paired(
        middle.median, middle.low, middle.high, n, signed_rank(differences),
        effect, (1.0 + low) / 2.0, (1.0 + high) / 2.0, len(both),
    )  # fmt: skip


def log_ratios(a: Array, b: Array) -> Array:
    """(n,) ln(a/b) of values that are not negative: −∞ where only a is zero, ∞ where only b is, 0 where both are."""
    negative = np.concatenate([a[a < 0.0], b[b < 0.0]])
    if len(negative):
        raise InvalidInput(f"no ratio of negative values: {shown(negative[0])}")
    with np.errstate(divide="ignore", invalid="ignore"):  # logarithms of zero, as said
        return cast(Array, np.where(a == b, 0.0, np.log(a) - np.log(b)))


def signed_rank(differences: Array) -> float:
    """Two-sided p of Wilcoxon's signed-rank test of (n,) differences, which may be infinite; 1 where all are zero."""
    if not differences.any():
        return 1.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of samples that are small: their size is told
        return float(wilcoxon(differences, zero_method="pratt").pvalue)
