"""A boundary layer outside the boundary."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...formulas import formula
from ...formulas.row import Row
from .base import Demand


@formula
def outer_layer(row: Row, layer: float) -> Any:
    """(1 − s) L_gφ q̈_track − s u⁺ where φ ≥ 0, with s = min(1, φ/δ)."""
    share = np.minimum(row.phi / row.scale / layer, 1.0)
    return np.where(row.phi >= 0.0, (1.0 - share) * row.tracked - share * row.switching_gain, np.inf)


@dataclass(frozen=True)
class OuterLayer(Demand):
    """Rows with φ ≥ 0 demand (1 − s) L_gφ q̈_track − s u⁺, with s = min(1, φ/δ).

    The boundary layer of sliding mode control as published (Slotine and Sastry 1983; Slotine and Li 1991, section 7.2),
    on the side of the boundary where the paper's switch acts. Good at: no chattering, and none of the allowed space is
    given away. Bad at: what it promises, since φ comes to rest inside the layer, where s balances drift and tracking:
    it violates. :class:`BoundaryLayer` is the one laid inside.

    Parameters
    ----------
    layer
        δ as a fraction of each row's scale.
    """

    layer: float = 0.05

    name = "outer-layer"
    formula = staticmethod(outer_layer)
    uses: ClassVar[tuple[str, ...]] = ("tracked",)
    everywhere: ClassVar[bool] = True
    ranges: ClassVar[Mapping[str, tuple[float, float]]] = {"layer": (0.001, 0.5)}
