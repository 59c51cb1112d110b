"""The demand of control barrier functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ...errors import ConfigurationError, shown
from ...formulas import formula
from ...formulas.row import Row
from .base import Demand


@formula
def barrier(row: Row, alpha: float) -> Any:
    """−αφ − L_fφ."""
    return -alpha * row.phi - row.Lf


@dataclass(frozen=True)
class Barrier(Demand):
    """Every row demands −αφ − L_fφ, so that φ decays exponentially to its bound and never crosses it.

    Ames, Xu, Grizzle and Tabuada (2017). With φ = σ + K σ̇ this is the high-order control barrier function of h = −σ
    with the rates 1/K and α. Good at: all of the space, without chattering. Bad at: it needs L_fφ, second derivatives
    that are right, and knows nothing of limits of q̈.

    Parameters
    ----------
    alpha
        Rate α [1/s].
    """

    alpha: float = 20.0

    name = "barrier"
    formula: ClassVar[Callable[..., Any]] = staticmethod(barrier)
    uses: ClassVar[tuple[str, ...]] = ("Lf",)
    ranges: ClassVar[Mapping[str, tuple[float, float]]] = {"alpha": (1.0, 200.0)}

    def refusal(self, name: str, wanted: str = "a positive, finite number") -> Exception:
        """See :class:`.Demand`."""
        return ConfigurationError(f"{name} must be {wanted}, not {shown(getattr(self, name))}")
