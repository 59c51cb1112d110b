"""Times of two commands side by side; they decide nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from .groups import Group

TIMES = ("step_time_median_us", "step_time_p99_us", "rows_time_median_us")


@dataclass(frozen=True)
class Ratio:
    """Times of a law's runs.

    Attributes
    ----------
    group, column
        Whose, and which time.
    before, after
        Their medians in A and B [µs].
    ratio
        Median of B / A over the pairs.
    """

    group: Group
    column: str
    before: float
    after: float
    ratio: float


def ratios(groups: Iterable[Group]) -> Iterator[Ratio]:
    """All of which there are pairs with both."""
    for group in groups:
        for column in TIMES:
            a, b = (runs[column].to_numpy(dtype=float) for runs in (group.a, group.b))
            exist = np.isfinite(a) & np.isfinite(b) & (a > 0.0)
            if exist.any():
                a, b = a[exist], b[exist]
                yield Ratio(group, column, float(np.median(a)), float(np.median(b)), float(np.median(b / a)))
