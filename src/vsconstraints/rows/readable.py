"""One-line text of objects, in plain words with units, for consoles and notebooks."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import wraps
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

ZERO_BELOW = 1e-9  #: Smaller numbers in a list are shown as zero.


def in_one_line(text: Callable[[Any], str]) -> Callable[[Any], str]:
    """Make a ``__repr__`` one line; if it fails, use the default ``__repr__``."""

    @wraps(text)
    def representation(self: Any) -> str:
        try:
            return " ".join(text(self).split())
        # error messages show incomplete objects, and objects with invalid arrays
        except Exception:
            return object.__repr__(self)

    return representation


def amount(value: float | np.floating[Any]) -> str:
    """Format with three significant digits."""
    return f"{float(value):.3g}".replace("-", "−")


def amounts(values: Iterable[float], unit: str = "") -> str:
    """Format a few numbers with their unit: ``(0.1, 0, 0.4) m``."""
    shown = [value if abs(value) > ZERO_BELOW else 0.0 for value in values]
    listed = ", ".join(amount(value) for value in shown)
    return f"({listed}) {unit}" if unit else f"({listed})"


def span(low: Array, high: Array, unit: str) -> str:
    """Format the span of ranges (n,): ``−6.28 to 6.28 rad``, or a note that there is none."""
    is_limited = np.isfinite((low, high))
    if is_limited.all():
        least = low.min(initial=np.inf)
        greatest = high.max(initial=-np.inf)
        return f"{amount(least)} to {amount(greatest)} {unit}"
    if is_limited.any():
        return f"not all limited [{unit}]"
    return "no ranges"


def enumerated(names: Iterable[object], most: int = 3) -> str:
    """List the first few names: ``a, b, c and 4 more``."""
    texts = [str(name) for name in names]
    first = ", ".join(texts[:most])
    left = len(texts) - most
    return first if left <= 0 else f"{first} and {left} more"


def counted(count: int, singular: str, several: str = "") -> str:
    """Format a count: ``1 marker``, ``4 markers``, ``2 families``."""
    if count == 1:
        return f"1 {singular}"
    plural = several or f"{singular}s"
    return f"{count} {plural}"
