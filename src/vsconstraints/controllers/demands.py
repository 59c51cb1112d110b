"""The demands that files can name: sliding modes, boundary layers and potential fields.

For the formulas see :doc:`/laws`; barriers are in :mod:`vsconstraints.controllers.barriers`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..formulas import formula, where
from ..formulas.row import Row
from .barriers import (
    BackupBarrier,
    Barrier,
    FiniteTimeBarrier,
    GradientRobustBarrier,
    HighOrderBarrier,
    InputToStateSafeBarrier,
    PrescribedTimeBarrier,
    ProbabilisticBarrier,
    ReciprocalBarrier,
    RobustBarrier,
    SampledBarrier,
)
from .demand import Demand
from .ranges import GAINS, ROWS, option

# --- sliding modes ---


@dataclass(frozen=True)
class Switch(Demand):
    """Rows with φ ≥ 0 demand −u⁺, the others nothing (eqs. 10 and 11).

    Muñoz-Benavent et al. 2018.
    """

    name = "switch"
    everywhere = True

    @staticmethod
    def formula(row: Row) -> Any:
        return where(row.phi >= 0.0, -row.switching_gain, np.inf)


@dataclass(frozen=True)
class ImplicitSwitch(Demand):
    """Rows demand max(−u⁺, −φ/(p T_s)): φ ≤ 0 after p periods, at a rate of at most u⁺.

    The implicit Euler method (Acary and Brogliato 2010). p > 1 averages noise, and suits commands
    that are followed late; p < 1 would overshoot.
    """

    periods: float = option(
        1.0,
        "p: number of sampling periods within which φ returns to zero",
        (1.0, 50.0),
        at_least=1.0,
    )

    name = "implicit-switch"
    uses: ClassVar[tuple[str, ...]] = ("period",)

    @staticmethod
    def formula(row: Row, periods: float) -> Any:
        return np.maximum(-row.switching_gain, -row.phi / (periods * row.period))


@dataclass(frozen=True)
class ImplicitSwitchWithDrift(ImplicitSwitch):
    """Demand of :class:`ImplicitSwitch` less the drift d̂ = (φ − φ₋)/T_s − v₋.

    Su, Drakunov and Özgüner (2000). φ₋ and v₋ = L_gφ q̈ are the row and its commanded rate in the
    sample before. d̂ is kept within ±u⁺, and 0 at first.
    """

    name = "implicit-switch-with-drift"
    uses = ("period", "last_rate")
    remembers = (np.nan,)

    @staticmethod
    def formula(row: Row, periods: float) -> Any:
        """Return max(−u⁺, −φ/(p T_s) − d̂), and φ as memory.

        d̂ = (φ − φ₋)/T_s − v₋ within ±u⁺, 0 at first.
        """
        seen = (row.phi - row.memory[0]) / row.period - row.last_rate
        drift = where(
            np.isnan(seen),
            0.0,
            np.minimum(np.maximum(seen, -row.switching_gain), row.switching_gain),
        )
        return np.maximum(-row.switching_gain, -row.phi / (periods * row.period) - drift), row.phi


@formula
def gains(row: Row, rate: float) -> Any:
    """Return k₁ = 1.5 √L and k₂ = 1.1 L with L = rate × u⁺ (Levant 1998)."""
    L = rate * row.switching_gain
    return 1.5 * np.sqrt(L), 1.1 * L


@formula
def saturated(row: Row, c: Any, integral: Any) -> Any:
    """Return the bound c, at least −u⁺, and the integral, within ±u⁺.

    The integral is 0 unless tracking exceeds c.
    """
    bound = np.maximum(-row.switching_gain, c)
    kept = np.minimum(np.maximum(integral, -row.switching_gain), row.switching_gain)
    return bound, where(row.tracked > bound, kept, 0.0)


@formula
def proper_implicit(row: Row, w: Any, rate: float) -> Any:
    """Return w₊ + (x − φ)/T_s and w₊ = w − T_s k₂ sign x.

    x solves the inclusion x + T_s k₁ √|x| sign x + T_s² k₂ sign x ∋ φ. If |φ| ≤ T_s² k₂, x is 0,
    and sign x is the number from −1 to 1 that solves it. Otherwise y = √|x| solves y² + T_s k₁ y =
    |φ| − T_s² k₂.
    """
    k1, k2 = gains(row, rate)
    step = row.period * row.period * k2
    half = 0.5 * row.period * k1
    over = np.maximum(np.abs(row.phi) - step, 0.0)
    # the root y, written without cancellation
    y = over / (half + np.sqrt(half * half + over))
    after = w - np.minimum(np.maximum(row.phi, -step), step) / row.period
    return after + (np.sign(row.phi) * y * y - row.phi) / row.period, after


@dataclass(frozen=True)
class SuperTwisting(Demand):
    """Rows demand φ̇ = −k₁ √|φ| sign φ + w with ẇ = −k₂ sign φ, at a rate of at most u⁺.

    Levant 1993. w learns the drift, anew at each contact: it is integrated where tracking would
    exceed c, and 0 elsewhere.
    """

    rate: float = option(
        20.0,
        "L: bound on the rate of change of the drift, as a multiple of u⁺ [1/s]; k₁ = 1.5 √L, k₂ "
        "= 1.1 L",
        (1.0, 100.0),
    )

    name = "super-twisting"
    remembers = (0.0,)
    uses: ClassVar[tuple[str, ...]] = ("tracked", "period")

    @staticmethod
    def formula(row: Row, rate: float) -> Any:
        """Return max(−u⁺, w − k₁ √|φ| sign φ), and w − T_s k₂ sign φ as memory."""
        k1, k2 = gains(row, rate)
        w = row.memory[0]
        side = np.sign(row.phi)
        return saturated(row, w - k1 * np.sqrt(np.abs(row.phi)) * side, w - row.period * k2 * side)


@dataclass(frozen=True)
class ImplicitSuperTwisting(SuperTwisting):
    """Demand of :class:`SuperTwisting` by the proper implicit Euler method.

    Seeber and Andritsch (2025): see :func:`proper_implicit`. The rate is at most u⁺ here, too.
    """

    name = "implicit-super-twisting"

    @staticmethod
    def formula(row: Row, rate: float) -> Any:
        """Return max(−u⁺, w₊ + (x − φ)/T_s), and w₊ as memory.

        See :func:`proper_implicit`.
        """
        c, after = proper_implicit(row, row.memory[0], rate)
        return saturated(row, c, after)


@dataclass(frozen=True)
class ConditionedSuperTwisting(ImplicitSuperTwisting):
    """Demand of :class:`ImplicitSuperTwisting` without windup at saturation.

    It learns from the applied u = L_gφ q̈ of the last sample: the conditioning technique of Seeber
    and Reichhartinger (2020), in a form of this package.
    """

    name = "conditioned-super-twisting"
    uses = ("tracked", "last_rate", "period")
    remembers = (np.nan,)

    @staticmethod
    def formula(row: Row, rate: float) -> Any:
        """Return the bound of :class:`ImplicitSuperTwisting` and a conditioned w.

        w = w₋ + clip((u − w₋)/2, ±T_s k₂). The memory is w in contact, else NaN.
        """
        step = row.period * gains(row, rate)[1]
        half_way = 0.5 * (row.last_rate - row.memory[0])
        w = row.memory[0] + np.minimum(np.maximum(half_way, -step), step)
        known = where(np.isnan(w), 0.0, w)
        w = np.minimum(np.maximum(known, -row.switching_gain), row.switching_gain)
        bound = np.maximum(-row.switching_gain, proper_implicit(row, w, rate)[0])
        return bound, where(row.tracked > bound, w, np.nan)


# --- potential fields and layers ---


@formula
def grown(row: Row, region: float, exponent: float) -> Any:
    """Return ψ = (1 + φ/δ)^exponent where −δ < φ, else 0.

    δ = region × scale, which may be zero in floating point.
    """
    psi = np.maximum(1.0 + row.phi / row.scale / region, 0.0)
    return psi if exponent == 1.0 else psi**exponent


@dataclass(frozen=True)
class Field(Demand):
    """Common options of the demands of potential fields, see :class:`RampRepulsion`."""

    region: float = option(
        0.2, "δ: width of the influence region, as a fraction of each row's scale", (0.01, 1.0)
    )
    exponent: float = option(1.0, "exponent of ψ in the influence region; 1 is linear", (0.5, 4.0))
    strength: float = option(1.0, "s: factor on every u⁺", (0.1, 10.0))

    owner = "a potential field"
    everywhere = True


@dataclass(frozen=True)
class RampRepulsion(Field):
    """Rows with −δ < φ demand L_gφ q̈_track − ψ s u⁺, with ψ = (1 + φ/δ)^exponent."""

    name = "ramp-repulsion"
    relative = True

    @staticmethod
    def formula(row: Row, region: float, exponent: float, strength: float) -> Any:
        psi = grown(row, region, exponent)
        return where(psi > 0.0, -(psi * strength * row.switching_gain), np.inf)


@dataclass(frozen=True)
class BoundaryLayer(Field):
    """Rows with −δ < φ demand (1 − ψ) L_gφ q̈_track − ψ s u⁺, a layer inside the boundary.

    ψ = min(1, (1 + φ/δ)^exponent). With exponent 1 and :class:`.Priority` it is the boundary layer
    of Slotine and Sastry (1983), inside the boundary.
    """

    name = "boundary-layer"
    uses = ("tracked",)

    @staticmethod
    def formula(row: Row, region: float, exponent: float, strength: float) -> Any:
        psi = np.minimum(grown(row, region, exponent), 1.0)
        return where(
            psi > 0.0, (1.0 - psi) * row.tracked - psi * strength * row.switching_gain, np.inf
        )


@dataclass(frozen=True)
class OuterLayer(Demand):
    """Rows with φ ≥ 0 demand (1 − s) L_gφ q̈_track − s u⁺, with s = min(1, φ/δ).

    Slotine and Sastry (1983).
    """

    layer: float = option(
        0.05, "δ: width of the boundary layer, as a fraction of each row's scale", (0.001, 0.5)
    )

    name = "outer-layer"
    uses = ("tracked",)
    everywhere = True

    @staticmethod
    def formula(row: Row, layer: float) -> Any:
        depth = np.minimum(row.phi / row.scale / layer, 1.0)
        blended = (1.0 - depth) * row.tracked - depth * row.switching_gain
        return where(row.phi >= 0.0, blended, np.inf)


@dataclass(frozen=True)
class Firas(Demand):
    """Rows with ρ < ρ₀ demand L_gφ q̈_track − η (1/ρ − 1/ρ₀)/ρ²: force of the FIRAS function.

    Khatib (1986). ρ = −σ as a fraction of the row's scale, at least ``contact`` × ρ₀, and η =
    ``strength`` × u⁺ ρ₀³.
    """

    region: float = option(
        0.2, "ρ₀: width of the influence region, as a fraction of each row's scale", (0.01, 1.0)
    )
    strength: float = option(0.1, "s: factor on every u⁺", (0.01, 1.0))
    contact: float = option(
        0.1, "least distance ρ used in the force, as a fraction of ρ₀", (0.02, 0.5), below=1.0
    )

    name = "firas"
    uses = ("sigma",)
    ignores = ("observer",)
    relative = True
    everywhere = True

    @staticmethod
    def formula(row: Row, region: float, strength: float, contact: float) -> Any:
        """Return −s u⁺ (r − 1) r², relative to tracking, where r = δ/ρ > 1.

        ρ = −σ, but at least contact × δ.
        """
        ratio = 1.0 / np.maximum(-row.sigma / row.scale / region, contact)
        return where(
            ratio > 1.0, -(strength * row.switching_gain * (ratio - 1.0) * ratio * ratio), np.inf
        )


@dataclass(frozen=True)
class PublishedFiras(Demand):
    """FIRAS as published: rows with ρ < ρ₀ are pushed by σ̈ = −η (1/ρ − 1/ρ₀)/ρ².

    Khatib (1986), with ρ = −σ as a fraction of the row's scale. The push is relative to L_gφ q̈ of
    tracking. Rows that are φ itself are pushed by φ̇. At ρ ≤ 0, where the article defines no force,
    ρ is set to ρ₀/1000.
    """

    region: float = option(
        0.2, "ρ₀: width of the influence region, as a fraction of each row's scale", (0.01, 1.0)
    )
    eta: float = option(
        0.05,
        "η: gain of the force, with ρ as a fraction of each row's scale [1/s²]",
        (0.0001, 10.0),
    )

    name = "firas-published"
    uses = ("sigma", "K")
    ignores = ("K", "observer", *GAINS)
    relative = True
    everywhere = True

    @staticmethod
    def formula(row: Row, region: float, eta: float) -> Any:
        """Return −K s η (1/ρ − 1/ρ₀)/ρ², relative to tracking, where ρ = −σ/s < ρ₀.

        Where K = 0, 1 is used for K.
        """
        rho = np.maximum(-row.sigma / row.scale, 0.001 * region)
        push = (
            where(row.K == 0.0, 1.0, row.K)
            * row.scale
            * eta
            * (1.0 / rho - 1.0 / region)
            / (rho * rho)
        )
        return where(rho < region, -push, np.inf)


# --- without parameters ---


@dataclass(frozen=True)
class Nothing(Demand):
    """No row demands anything."""

    name = "nothing"
    everywhere = True
    ignores = (*ROWS, "observer", "dead_time")

    @staticmethod
    def formula(row: Row) -> Any:
        return np.inf * row.scale


#: Demands that files can name, by their ``name``.
DEMANDS: tuple[type[Demand], ...] = (
    Switch,
    ImplicitSwitch,
    ImplicitSwitchWithDrift,
    BoundaryLayer,
    OuterLayer,
    SuperTwisting,
    ImplicitSuperTwisting,
    ConditionedSuperTwisting,
    Firas,
    PublishedFiras,
    RampRepulsion,
    Barrier,
    ReciprocalBarrier,
    FiniteTimeBarrier,
    PrescribedTimeBarrier,
    HighOrderBarrier,
    BackupBarrier,
    RobustBarrier,
    ProbabilisticBarrier,
    InputToStateSafeBarrier,
    GradientRobustBarrier,
    SampledBarrier,
    Nothing,
)
