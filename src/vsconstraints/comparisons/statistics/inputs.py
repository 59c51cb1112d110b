"""What the statistics accept, checked once and in the same words."""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from ...errors import ConfigurationError, InvalidInput, shown, unknown_name
from ...rows import Array, BoolArray

Better = Literal["less", "more"]
"""Which values are better."""

FEWEST = 6
"""Paired comparisons of fewer scenes are said to be too few: an exact two-sided test of n pairs never gives less than
2/2ⁿ, which is above 0.05 for n ≤ 5."""


def checked_confidence(confidence: float) -> float:
    """A confidence strictly between 0 and 1."""
    if not isinstance(confidence, (int, float)) or not 0.0 < confidence < 1.0:
        raise ConfigurationError(f"confidence must be between 0 and 1, such as 0.95, not {shown(confidence)}")
    return float(confidence)


def simultaneous(confidence: float, comparisons: int) -> float:
    """Confidence of each of several intervals, so that all hold at once with ``confidence`` (Bonferroni)."""
    return 1.0 - (1.0 - checked_confidence(confidence)) / max(comparisons, 1)


def checked_name(what: str, name: object, candidates: Any) -> None:
    """A name out of a ``Literal``."""
    if name not in get_args(candidates):
        raise unknown_name(what, name, get_args(candidates))


def flags(values: ArrayLike, name: str = "flags") -> BoolArray:
    """(n,) booleans; numbers have to be 0 or 1."""
    given = line(values, name)
    if given.dtype != np.bool_ and not np.isin(given, (0, 1)).all():
        raise InvalidInput(f"{name} must be true or false in every scene; give only scenes in which that is known")
    found: BoolArray = given.astype(np.bool_)
    return found


def numbers(values: ArrayLike, name: str) -> Array:
    """(n,) floats; NaN stands for a run that does not count, and nothing may be infinite."""
    given: Array = line(values, name).astype(float)
    if np.isinf(given).any():
        raise InvalidInput(f"{name} holds {shown(given[np.isinf(given)][0])}: NaN stands for a run that does not count")
    return given


def pair(a: Any, b: Any) -> None:
    """Two columns of one length: entry i of both is scene i."""
    if len(a) != len(b):
        raise InvalidInput(f"a and b must be of the same scenes, one entry each, not of {len(a)} and {len(b)}")


def table(costs: ArrayLike) -> Array:
    """(scenes, laws) floats with failures at infinity."""
    given: Array = _array(costs, "costs").astype(float)
    if given.ndim != 2 or given.shape[1] == 0:
        raise InvalidInput(f"costs must be of shape (scenes, laws), not {given.shape}")
    if np.isnan(given).any() or (given == -np.inf).any():
        raise InvalidInput("costs must be numbers, or infinite where a law failed; leave out scenes without a value")
    return given


def line(values: ArrayLike, name: str) -> Any:
    """(n,) numbers or booleans."""
    given = _array(values, name)
    if given.ndim != 1:
        raise InvalidInput(f"{name} must be of shape (scenes,), not {given.shape}")
    return given


def _array(values: ArrayLike, name: str) -> Any:
    try:
        given = np.asarray(values)
        return given if given.dtype == np.bool_ else given.astype(float)
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"{name} must hold numbers only: {error}") from error


Verdict = Literal["better", "worse", "not distinguishable", "too few"]
"""What is said of a against b."""


def distinguishable(low: float, high: float, n: int = FEWEST) -> bool:
    """Whether an interval of a difference on n scenes excludes zero, and there are scenes enough to say so."""
    return n >= FEWEST and not low <= 0.0 <= high


def verdict(low: float, high: float, *, n: int = FEWEST, better: Better = "less") -> Verdict:
    """What is said of a against b, from the interval of a − b, which is simultaneous for all that is compared.

    They differ if it excludes zero. Fewer than :data:`.inputs.FEWEST` scenes are too few to tell.
    """
    if not distinguishable(low, high, n):
        return "too few" if n < FEWEST else "not distinguishable"
    return "better" if (high < 0.0) == (better == "less") else "worse"
