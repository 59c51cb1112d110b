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
    return (
        f"({', '.join(amount(value if abs(value) > ZERO_BELOW else 0.0) for value in values)})"
        f"{unit and ' '}{unit}"
    )


def span(low: Array, high: Array, unit: str) -> str:
    """Format the span of ranges (n,): ``−6.28 to 6.28 rad``, or a note that there is none."""
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        return f"not all limited [{unit}]" if np.isfinite((low, high)).any() else "no ranges"
    return f"{amount(low.min(initial=np.inf))} to {amount(high.max(initial=-np.inf))} {unit}"


def enumerated(names: Iterable[object], most: int = 3) -> str:
    """List the first few names: ``a, b, c and 4 more``."""
    texts = [str(name) for name in names]
    left = len(texts) - most
    return ", ".join(texts) if left <= 0 else f"{', '.join(texts[:most])} and {left} more"


def counted(count: int, singular: str, several: str = "") -> str:
    """Format a count: ``1 marker``, ``4 markers``, ``2 families``."""
    return f"{count} {singular if count == 1 else several or singular + 's'}"
