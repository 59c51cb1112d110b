"""The demand of tracking alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...formulas import formula
from ...formulas.row import Row
from .base import Demand


@formula
def nothing(row: Row) -> Any:
    """Infinity."""
    return np.inf * row.scale


@dataclass(frozen=True)
class Nothing(Demand):
    """No row demands anything."""

    name = "nothing"
    formula = staticmethod(nothing)
    everywhere: ClassVar[bool] = True
