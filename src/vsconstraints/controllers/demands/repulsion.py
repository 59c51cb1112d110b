"""The demand of the classical potential field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput, shown
from ...formulas import formula
from ...formulas.row import Row
from .base import Demand


@formula
def grown(row: Row, region: float, exponent: float) -> Any:
    """ψ = (1 + φ/δ)^exponent where −δ < φ, else 0, with δ = region × scale, which may be zero in floating point."""
    psi = np.maximum(1.0 + row.phi / row.scale / region, 0.0)
    return psi if exponent == 1.0 else psi**exponent


@formula
def repulsion(row: Row, region: float, exponent: float, strength: float) -> Any:
    """−ψ s u⁺ below what tracking does, where ψ > 0."""
    psi = grown(row, region, exponent)
    return np.where(psi > 0.0, -(psi * strength * row.switching_gain), np.inf)


@dataclass(frozen=True)
class Field(Demand):
    """What the demands of potential fields have in common: see :class:`Repulsion`."""

    region: float = 0.2
    exponent: float = 1.0
    strength: float = 1.0

    ranges: ClassVar[Mapping[str, tuple[float, float]]] = {
        "region": (0.01, 1.0),
        "exponent": (0.5, 4.0),
        "strength": (0.1, 10.0),
    }

    def refusal(self, name: str, wanted: str = "positive") -> Exception:
        """See :class:`.Demand`."""
        return InvalidInput(f"{name} of a potential field must be {wanted}, not {shown(getattr(self, name))}")


@dataclass(frozen=True)
class Repulsion(Field):
    """Rows inside the region demand ψ s u⁺ less than what tracking does, with ψ = (1 + φ/δ)^exponent.

    The repulsion of artificial potential fields (Khatib 1986). ψ goes on growing beyond the boundary. Good at: smooth
    commands, from little knowledge. Bad at: rows and task may each win, so that rows are violated, and the arm comes to
    rest where the two are equal, beside goals near a boundary.

    Parameters
    ----------
    region
        δ as a fraction of each row's scale.
    exponent
        How ψ grows; 1 is linear.
    strength
        Factor s on every u⁺.
    """

    name = "repulsion"
    formula = staticmethod(repulsion)
    relative: ClassVar[bool] = True
    everywhere: ClassVar[bool] = True
