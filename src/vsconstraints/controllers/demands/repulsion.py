"""The demands of potential fields: Khatib's FIRAS, and a ramp."""

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
def ramp_repulsion(row: Row, region: float, exponent: float, strength: float) -> Any:
    """−ψ s u⁺ below what tracking does, where ψ > 0."""
    psi = grown(row, region, exponent)
    return np.where(psi > 0.0, -(psi * strength * row.switching_gain), np.inf)


@formula
def firas(row: Row, region: float, strength: float, contact: float) -> Any:
    """−s u⁺ (r − 1) r² below what tracking does, where r = δ/ρ > 1, with ρ = −σ, but contact × δ at least."""
    ratio = 1.0 / np.maximum(-row.sigma / row.scale / region, contact)
    return np.where(ratio > 1.0, -(strength * row.switching_gain * (ratio - 1.0) * ratio * ratio), np.inf)


@dataclass(frozen=True)
class Field(Demand):
    """What the demands of potential fields have in common: see :class:`RampRepulsion`."""

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
class RampRepulsion(Field):
    """Rows inside the region demand ψ s u⁺ less than what tracking does, with ψ = (1 + φ/δ)^exponent.

    A repulsion that is finite everywhere: s u⁺ on the boundary, and growing beyond it; :class:`Firas` is the classical
    one. Since φ = σ + K σ̇, it is a spring in σ together with a damper in σ̇. Good at: smooth commands, from little
    knowledge. Bad at: rows and task may each win, so that rows are violated, and the arm comes to rest where the two
    are equal, beside goals near a boundary.

    Parameters
    ----------
    region
        δ as a fraction of each row's scale.
    exponent
        How ψ grows; 1 is linear.
    strength
        Factor s on every u⁺.
    """

    name = "ramp-repulsion"
    formula = staticmethod(ramp_repulsion)
    relative: ClassVar[bool] = True
    everywhere: ClassVar[bool] = True


@dataclass(frozen=True)
class Firas(Demand):
    """Rows nearer than ρ₀ demand η (1/ρ − 1/ρ₀)/ρ² less than what tracking does: the force of Khatib's FIRAS function.

    Khatib (1986): U = ½ η (1/ρ − 1/ρ₀)² where the distance ρ is less than ρ₀, else 0, pushes by −dU/dρ. Here ρ = −σ as
    a fraction of the row's scale, ρ₀ = ``region``, and η = ``strength`` × u⁺ ρ₀³, so that the push is s u⁺ (r − 1) r²
    with r = ρ₀/ρ. It knows positions alone; what damps is tracking. Rows that are φ itself, such as speeds, have
    σ = φ. On the boundary the push is infinite, and beyond, where a sampled motion may end, U is not defined: there
    and before, ρ counts as no less than ``contact`` × ρ₀, so that the push is at most s u⁺ (1 − contact)/contact³.
    Good at: little knowledge; far rows are left alone. Bad at: sampling, which it answers with blows near the boundary;
    rows that act late; and, as all sums of task and repulsion, the arm comes to rest where the two are equal.

    Parameters
    ----------
    region
        ρ₀ as a fraction of each row's scale.
    strength
        Factor s on every u⁺: the push where ρ is ρ₀/1.47.
    contact
        Least distance that is distinguished, as a fraction of ρ₀; less than 1.
    """

    region: float = 0.2
    strength: float = 0.1
    contact: float = 0.1

    name = "firas"
    formula = staticmethod(firas)
    uses: ClassVar[tuple[str, ...]] = ("sigma",)
    relative: ClassVar[bool] = True
    everywhere: ClassVar[bool] = True
    ranges: ClassVar[Mapping[str, tuple[float, float]]] = {
        "region": (0.01, 1.0),
        "strength": (0.01, 1.0),
        "contact": (0.02, 0.5),
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.contact >= 1.0:
            raise self.refusal("contact", "less than 1")
