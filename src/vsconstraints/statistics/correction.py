"""Many comparisons at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InvalidInput
from ..rows import Array


def holm(p_values: ArrayLike) -> Array:
    """Each p as if it were the only one: corrected for all that are given, which are one family (Holm 1979).

    Of m values in order, the i-th is multiplied by m + 1 − i, and is at least as great as those before it: the chance
    of even one false finding stays below the level that the corrected values are held against. (statsmodels says the
    same, but collects garbage in the whole process at every call, which takes a third of a second.)
    """
    p = np.atleast_1d(np.asarray(p_values, dtype=float))
    if p.ndim != 1 or not ((p >= 0.0) & (p <= 1.0)).all():
        raise InvalidInput("p-values must be one line of numbers from 0 to 1")
    order = np.argsort(p, kind="stable")
    corrected = np.empty_like(p)
    corrected[order] = np.minimum(np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)), 1.0)
    return corrected
