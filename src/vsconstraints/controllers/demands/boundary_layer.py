"""A demand that grows from what tracking does to −u⁺ within a layer inside the boundary."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...formulas import formula
from ...formulas.row import Row
from .repulsion import Field, grown


@formula
def boundary_layer(row: Row, region: float, exponent: float, strength: float) -> Any:
    """(1 − ψ) L_gφ q̈_track − ψ s u⁺ where ψ > 0, ψ at most 1."""
    psi = np.minimum(grown(row, region, exponent), 1.0)
    return np.where(psi > 0.0, (1.0 - psi) * row.tracked - psi * strength * row.switching_gain, np.inf)


@dataclass(frozen=True)
class BoundaryLayer(Field):
    """Rows inside the region demand (1 − ψ) L_gφ q̈_track − ψ s u⁺, with ψ = min(1, (1 + φ/δ)^exponent).

    With exponent 1 and :class:`~vsconstraints.controllers.resolvers.Priority` this is the boundary layer of sliding
    mode control (Slotine and Sastry 1983), laid inside the boundary. As δ shrinks it becomes :class:`Switch`. Good at:
    no chattering, and no violation while drift is less than u⁺. Bad at: φ comes to rest inside the layer, whose space
    is given away.

    Parameters
    ----------
    region
        δ as a fraction of each row's scale.
    exponent
        How ψ grows; 1 is linear.
    strength
        Factor s on every u⁺.
    """

    name = "boundary-layer"
    formula = staticmethod(boundary_layer)
    uses: ClassVar[tuple[str, ...]] = ("tracked",)
    everywhere: ClassVar[bool] = True
