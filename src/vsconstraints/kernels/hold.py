"""The robot over one period, compiled."""

from __future__ import annotations

import numpy as np

from ..rows import Array
from .compiler import compiled


@compiled("void(float64[:, ::1], float64[:, ::1])")
def advance(transition: Array, x: Array) -> None:
    """Set x ← transition x: the state (s, n) at the end of a period, from that at its beginning."""
    s, n = x.shape
    after = np.empty(s)
    for j in range(n):
        for i in range(s):
            total = 0.0
            for k in range(s):
                total += transition[i, k] * x[k, j]
            after[i] = total
        for i in range(s):
            x[i, j] = after[i]
