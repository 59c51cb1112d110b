"""Artificial potential fields on the same rows: repulsion that grows continuously towards the boundary."""

from __future__ import annotations

from typing import Any, Literal

from ..errors import unknown_name
from .demands import BoundaryLayer, Demand, RampRepulsion
from .law import Law
from .least_norm import RANK_TOLERANCE
from .resolvers import Additive, Priority, Resolver

BLENDS: dict[str, tuple[type[BoundaryLayer | RampRepulsion], type[Priority]]] = {
    "additive": (RampRepulsion, Additive),
    "priority": (BoundaryLayer, Priority),
}
"""Demand and resolver by the name of the blend."""


class PotentialField(Law):
    """Repulsion that grows continuously towards the boundary, inside an influence region.

    The repulsion is ψ(φ) u⁺ inside the region −δ < φ, with δ = ``region`` × the row's scale.
    ψ = (1 + φ/δ)^exponent is 0 where the region begins and 1 on the boundary: a ramp, where Khatib's FIRAS, the demand
    :class:`~vsconstraints.controllers.Firas`, is infinite. Since φ = σ + K σ̇, the repulsion is a spring in σ together
    with a damper in σ̇.

    ``additive`` is the classical sum of tracking and repulsion: q̈ = q̈_track − Σ ψᵢ u⁺ᵢ L_gφᵢ†, where ψ goes on growing
    beyond the boundary. Either part may win, so that rows can be violated.

    ``priority`` gives the rows the place they have in the paper's law: those inside their regions demand
    L_gφ q̈ = (1 − ψ) L_gφ q̈_track − ψ u⁺, with ψ at most 1, and the task acts in their null space. Where the region
    begins this is what tracking does anyway, on the boundary it is the sliding-mode law; in between it is continuous.
    As ``region`` goes to zero it becomes the sliding-mode law.

    Parameters
    ----------
    blend
        ``"additive"`` or ``"priority"``.
    region
        Depth of the influence region as a fraction of each row's allowed range; positive.
    exponent
        How ψ grows; 1 is linear, larger values concentrate the repulsion at the boundary.
    strength
        Factor on every u⁺.
    rank_tolerance
        As for :class:`SlidingMode`.
    """

    name = "potential-field"

    def __init__(
        self,
        *,
        blend: Literal["additive", "priority"] = "additive",
        region: float = 0.2,
        exponent: float = 1.0,
        strength: float = 1.0,
        rank_tolerance: float = RANK_TOLERANCE,
    ) -> None:
        super().__init__(*_cell(blend, (region, exponent, strength), rank_tolerance))

    @property
    def blend(self) -> str:
        """``"additive"`` or ``"priority"``."""
        return self.resolver.name

    @blend.setter
    def blend(self, blend: Any) -> None:
        demand, resolver = _cell(blend, self.demand.parameters, self.rank_tolerance)
        self.demand, self.resolver = demand, resolver


def _cell(blend: object, parameters: tuple[float, ...], rank_tolerance: float) -> tuple[Demand, Resolver]:
    if not (isinstance(blend, str) and blend in BLENDS):
        raise unknown_name("blend", blend, tuple(BLENDS))
    demand, resolver = BLENDS[blend]
    return demand(*parameters), resolver(rank_tolerance)
