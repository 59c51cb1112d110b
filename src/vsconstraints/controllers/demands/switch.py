"""The paper's demand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...formulas import formula
from ...formulas.row import Row
from .base import Demand


@formula
def switch(row: Row) -> Any:
    """−u⁺ where φ ≥ 0 (eqs. 10 and 11)."""
    return np.where(row.phi >= 0.0, -row.switching_gain, np.inf)


@dataclass(frozen=True)
class Switch(Demand):
    """Rows with φ ≥ 0 demand −u⁺, the others nothing (eqs. 10 and 11).

    Muñoz-Benavent et al. (2018). Good at: all of the space, knowing nothing but φ and L_gφ. Bad at: it chatters, with a
    band of T_s u⁺, and u⁺ has to exceed what drift and tracking can do.
    """

    name = "switch"
    formula = staticmethod(switch)
    everywhere: ClassVar[bool] = True
