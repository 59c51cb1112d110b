"""The optimality conditions of a quadratic program, measured in numbers that do not depend on its scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..rows import Array


@dataclass(frozen=True, slots=True)
class OptimalityErrors:
    """How far (x, λ) is from the Karush-Kuhn-Tucker conditions; 0 is exact, all are dimensionless.

    With s the size of x (see :func:`optimality_errors`) and p the largest entry of P:

    Attributes
    ----------
    rows
        Largest (Gx − h)ᵢ / (‖Gᵢ‖ s + |hᵢ|).
    stationarity
        ‖Px + q + Gᵀλ‖ / (p s).
    sign
        Largest −λᵢ‖Gᵢ‖ / (p s).
    complementarity
        Largest |λᵢ (Gx − h)ᵢ| / (p s²).
    """

    rows: float
    stationarity: float
    sign: float
    complementarity: float

    @property
    def worst(self) -> float:
        """The largest of the four; not a number if one of them is none."""
        return float(np.max([self.rows, self.stationarity, self.sign, self.complementarity]))

    def __str__(self) -> str:
        return (
            f"rows exceeded by {self.rows:.1e}, stationarity off by {self.stationarity:.1e}, "
            f"multipliers negative by {self.sign:.1e}, complementarity off by {self.complementarity:.1e}"
        )


def optimality_errors(P: Array, q: Array, G: Array, h: Array, x: Array, multipliers: Array) -> OptimalityErrors:
    """Errors of (x, λ) in the conditions of  min ½xᵀPx + qᵀx  subject to  Gx ≤ h.

    The size s of x is what the data alone asks for, the largest of ‖q‖/p (the step to the free minimiser) and
    of −hᵢ/‖Gᵢ‖ (the distance to the farthest row that excludes the origin), or ‖x‖ if that is larger; 1 if
    all of these are zero. So multiplying the cost, a row or the unit of x by a factor changes nothing.

    Parameters
    ----------
    P, q, G, h
        (n, n), (n,), (m, n) and (m,), with m ≥ 1.
    x, multipliers
        (n,) and (m,).
    """
    row_norms = np.sqrt(np.einsum("ij,ij->i", G, G))
    cost_size = float(np.abs(P).max())
    distances = -h[row_norms > 0.0] / row_norms[row_norms > 0.0]
    size = max(
        float(np.sqrt(q @ q)) / cost_size,
        float(distances.max(initial=0.0)),
        float(np.sqrt(x @ x)),
    )
    if size == 0.0:
        size = 1.0
    excess = G @ x - h
    row_size = row_norms * size + np.abs(h)
    row_size[row_size == 0.0] = 1.0
    residual = P @ x + q + G.T @ multipliers
    return OptimalityErrors(
        rows=float(np.maximum(0.0, (excess / row_size).max())),
        stationarity=float(np.sqrt(residual @ residual)) / (cost_size * size),
        sign=float(np.maximum(0.0, (-multipliers * row_norms).max() / (cost_size * size))),
        complementarity=float(np.abs(multipliers * excess).max()) / (cost_size * size * size),
    )
