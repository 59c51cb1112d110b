"""Demands: what rows ask of the acceleration, L_gφ q̈ ≤ c, each by an elementwise formula.

One half of a law; :mod:`vsconstraints.controllers.resolvers` are the other. A new demand is a formula, a class with its
options, and a line in :data:`DEMANDS`.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from ..errors import ConfigurationError, InvalidInput, shown
from ..formulas import formula
from ..formulas.row import Row
from .ranges import Part, option, positive

USES: dict[str, str] = {
    "Lf": "L_fφ",
    "sigma": "σ",
    "sigma_dot": "σ̇",
    "K": "K",
    "tracked": "L_gφ q̈ of tracking",
    "norm": "‖L_gφ‖",
    "norm_1": "‖L_gφ‖₁",
    "effort": "‖q̈‖ of tracking",
    "last_rate": "L_gφ q̈ of the last sample",
    "period": "T_s",
}
"""What a demand may use beside φ, u⁺ and the scale: fields of :class:`vsconstraints.formulas.row.Row`, as printed."""


@dataclass(frozen=True)
class Demand(Part, ABC):
    """What the rows ask of the acceleration, L_gφ q̈ ≤ c, with c = ∞ for a row that asks for nothing.

    A frozen dataclass: its fields are the parameters of :attr:`formula`, positive numbers.

    Attributes
    ----------
    name
        In reports.
    formula
        c of a :class:`vsconstraints.formulas.row.Row` and the parameters, in units of φ per second; marked by
        :func:`vsconstraints.formulas.formula`. With memory, a tuple of c and what is to be remembered.
    uses
        Which of :data:`USES` the formula uses.
    remembers
        Initial memory of each row, one float each; ``row.memory`` has what the formula returned last.
    relative
        Whether the formula gives by how much c is above L_gφ q̈ of tracking, which it then need not use.
    everywhere
        Whether resolvers with equalities impose L_gφ q̈ = c wherever a row demands something; if not, only where the
        tracking command exceeds c.
    owner
        What messages call it; its name if empty.
    """

    name: ClassVar[str]
    formula: ClassVar[Callable[..., Any]]
    uses: ClassVar[tuple[str, ...]] = ()
    remembers: ClassVar[tuple[float, ...]] = ()
    relative: ClassVar[bool] = False
    everywhere: ClassVar[bool] = False
    owner: ClassVar[str] = ""

    def __post_init__(self) -> None:
        for each in fields(self):
            number = positive(getattr(self, each.name))
            if number is None:
                raise self.refusal(each.name)
            if number < (least := each.metadata.get("at_least", 0.0)):
                raise self.refusal(each.name, f"at least {least:g}")
            if number >= (limit := each.metadata.get("below", np.inf)):
                raise self.refusal(each.name, f"less than {limit:g}")
            object.__setattr__(self, each.name, number)

    def refusal(self, name: str, wanted: str = "positive") -> Exception:
        """What is raised for a parameter that is not as wanted."""
        return InvalidInput(f"{name} of {self.owner or self.name} must be {wanted}, not {shown(getattr(self, name))}")

    @property
    def parameters(self) -> tuple[float, ...]:
        """The parameters, in the order in which the formula takes them."""
        return tuple(getattr(self, each.name) for each in fields(self))

    @property
    def sees_tracking(self) -> bool:
        """Whether the formula uses the tracking command."""
        return "tracked" in self.uses or "effort" in self.uses

    @property
    def tracks(self) -> bool:
        """Whether c depends on the tracking command."""
        return self.relative or self.sees_tracking


# --- barriers ---


@formula
def barrier(row: Row, alpha: float) -> Any:
    """−αφ − L_fφ."""
    return -alpha * row.phi - row.Lf


@dataclass(frozen=True)
class Barrier(Demand):
    """Every row demands −αφ − L_fφ, so that φ decays exponentially to its bound and never crosses it.

    Ames, Xu, Grizzle and Tabuada (2017). With φ = σ + K σ̇ this is the high-order control barrier function of h = −σ
    with the rates 1/K and α. Uses all of the space without chattering; needs L_fφ, and knows no limits of q̈.
    """

    alpha: float = option(20.0, "rate α [1/s]", (1.0, 200.0))

    name = "barrier"
    formula: ClassVar[Callable[..., Any]] = staticmethod(barrier)
    uses: ClassVar[tuple[str, ...]] = ("Lf",)

    def refusal(self, name: str, wanted: str = "a positive, finite number") -> Exception:
        """See :class:`.Demand`."""
        return ConfigurationError(f"{name} must be {wanted}, not {shown(getattr(self, name))}")


@formula
def robust_barrier(row: Row, alpha: float, disturbance: float) -> Any:
    """−αφ − L_fφ − D ‖L_gφ‖₁."""
    return barrier(row, alpha) - disturbance * row.norm_1


@dataclass(frozen=True)
class RobustBarrier(Barrier):
    """Every row demands −αφ − L_fφ − D ‖L_gφ‖₁: safe for any disturbance of q̈ of up to D in each joint.

    Jankovic (2018). Without a disturbance, φ stays D ‖L_gφ‖₁/α away from its bound.
    """

    disturbance: float = option(0.1, "D, the same for every joint [rad/s² or m/s²]", (0.001, 10.0))

    name = "robust-barrier"
    formula = staticmethod(robust_barrier)
    uses = ("Lf", "norm_1")


@formula
def input_to_state_safe_barrier(row: Row, alpha: float, epsilon: float) -> Any:
    """−αφ − L_fφ − ‖L_gφ‖²/(ε × scale)."""
    return barrier(row, alpha) - row.norm * (row.norm / row.scale) / epsilon


@dataclass(frozen=True)
class InputToStateSafeBarrier(Barrier):
    """Every row demands −αφ − L_fφ − ‖L_gφ‖²/(ε s), so that φ leaves its bound by no more than disturbances are worth.

    Kolathaya and Ames (2019), with φ/s as the barrier function; s is the row's scale. With a disturbance ‖d_c‖ ≤ d,
    φ̇ ≤ −αφ + ε s d²/4, so that φ stays below ε s d²/(4α). It leaves ‖L_gφ‖²/(α ε s) of the space unused.
    """

    epsilon: float = option(1.0, "ε [s³/rad²]: the smaller, the safer", (0.01, 100.0))

    name = "input-to-state-safe-barrier"
    formula = staticmethod(input_to_state_safe_barrier)
    uses = ("Lf", "norm")


@formula
def gradient_robust_barrier(row: Row, alpha: float, gradient_error: float) -> Any:
    """−αφ − L_fφ − c_e ‖L_gφ‖ ‖q̈_track‖."""
    return barrier(row, alpha) - gradient_error * row.norm * row.effort


@dataclass(frozen=True)
class GradientRobustBarrier(Barrier):
    """Every row demands −αφ − L_fφ − c_e ‖L_gφ‖ ‖q̈_track‖: a margin for gradients that are wrong by the fraction c_e.

    The measurement-robust barrier (Dean, Taylor, Cosner, Recht and Ames 2020) for eq. (49): an L_gφ that is wrong by
    c_e in each entry misjudges L_gφ q̈ by c_e ‖L_gφ‖ ‖q̈‖ at most. ‖q̈_track‖ stands for ‖q̈‖, which is not known yet:
    too little where the law commands more. The error of L_fφ is not in it.
    """

    gradient_error: float = option(0.1, "c_e, a fraction", (0.001, 1.0))

    name = "gradient-robust-barrier"
    formula = staticmethod(gradient_robust_barrier)
    uses = ("Lf", "norm", "effort")


@formula
def sampled_barrier(row: Row, alpha: float, curvature: float) -> Any:
    """−min(α, 1/T_s) φ − L_fφ − ν, with ν = ½ T_s × curvature × scale."""
    rate = np.minimum(alpha, 1.0 / row.period)
    return barrier(row, rate) - 0.5 * row.period * curvature * row.scale


@dataclass(frozen=True)
class SampledBarrier(Barrier):
    """Every row demands −min(α, 1/T_s) φ − L_fφ − ν, with ν = ½ T_s max|φ̈|: the barrier between samples.

    Breeden, Garg and Panagou (2022): a command that is constant for T_s keeps φ(t) ≤ 0 over the period if its bound is
    lower by ν, and if α T_s ≤ 1. It holds only if |φ̈| ≤ ``curvature`` × scale in every period near the boundary.
    Measured within 0.1 of the scale: up to 15 times the scale in the paper's scenes with convex rows, 18 in
    ``ur5-fov``, 88 in ``panda-fov``, and thousands around what is not convex. φ rests ν/α inside.
    """

    curvature: float = option(
        20.0, "largest φ̈ of any row near its boundary, as a multiple of its scale [1/s²]", (0.1, 1000.0)
    )

    name = "sampled-barrier"
    formula = staticmethod(sampled_barrier)
    uses = ("Lf", "period")


@formula
def reciprocal_barrier(row: Row, alpha: float) -> Any:
    """−α φ³/s² − L_fφ, and −αφ − L_fφ where φ > 0."""
    depth = row.phi / row.scale
    return -alpha * row.phi * np.where(depth < 0.0, depth * depth, 1.0) - row.Lf


@dataclass(frozen=True)
class ReciprocalBarrier(Barrier):
    """Every row demands −α φ³/s² − L_fφ where φ < 0, with s its scale: the reciprocal barrier function −1/φ.

    d/dt(−1/φ) ≤ −α φ/s² (Ames, Xu, Grizzle and Tabuada 2017) is this bound. Beyond the boundary rows return with the
    linear −αφ − L_fφ. Ignores rows far inside; φ approaches its bound like 1/√t only.
    """

    name = "reciprocal-barrier"
    formula = staticmethod(reciprocal_barrier)


@formula
def finite_time_barrier(row: Row, alpha: float) -> Any:
    """−α sign(φ) √(s |φ|) − L_fφ."""
    return -alpha * np.sign(row.phi) * np.sqrt(row.scale) * np.sqrt(np.abs(row.phi)) - row.Lf


@dataclass(frozen=True)
class FiniteTimeBarrier(Barrier):
    """Every row demands −α sign(φ) √(s |φ|) − L_fφ, with s its scale, which takes φ to its bound in finite time.

    The class K function of Li, Wang, Pierpaoli and Egerstedt (2018) with the exponent ½. Within |φ| < (α T_s)² s it
    overshoots in every period, and chatters.
    """

    alpha: float = option(2.0, "rate α [1/s]", (0.1, 20.0))

    name = "finite-time-barrier"
    formula = staticmethod(finite_time_barrier)


@formula
def high_order_barrier(row: Row, alpha: float, braking: float) -> Any:
    """σ̇ + K (−α₁'(−σ) σ̇ + α ψ₁) − L_fφ, ψ₁ = −σ̇ + α₁(−σ), and −αφ − L_fφ where K = 0.

    α₁(h) = sign(h) (√((aK)² + 2a|h|) − aK), a = braking × scale, written without a difference.
    """
    a = braking * row.scale
    corner = a * row.K
    root = np.sqrt(corner * corner + 2.0 * a * np.abs(row.sigma))
    # where K = 0 the terms with divisors count nothing
    direct = row.K == 0.0
    approach = -2.0 * a * row.sigma / (root + corner + direct)
    psi = approach - row.sigma_dot
    second = -a / (root + direct) * row.sigma_dot + alpha * psi
    return row.sigma_dot + row.K * second - alpha * row.phi * direct - row.Lf


@dataclass(frozen=True)
class HighOrderBarrier(Demand):
    """Rows demand σ̈ ≤ −α₁'(−σ) σ̇ + α ψ₁ with ψ₁ = −σ̇ + α₁(−σ): a high-order barrier function of h = −σ.

    Xiao and Belta (2019). :class:`Barrier` has α₁(h) = h/K. Here α₁(h) = √((aK)² + 2ah) − aK, odd in h, with the slope
    1/K on the boundary: far from it σ may approach as fast as σ̈ = −a can still stop it, and α₁ α₁' ≤ a. As a → ∞ it is
    :class:`Barrier`. Rows that are φ itself (K = 0, σ = φ) demand −αφ − L_fφ. Suits limited accelerations, though a is
    no promise where other rows or tracking act as well.
    """

    alpha: float = option(20.0, "rate α of ψ₁ [1/s]", (1.0, 200.0))
    braking: float = option(5.0, "a as a multiple of each row's scale [1/s²]", (0.1, 100.0))

    name = "high-order-barrier"
    formula = staticmethod(high_order_barrier)
    uses = ("sigma", "sigma_dot", "K", "Lf")


# --- sliding modes ---


@formula
def switch(row: Row) -> Any:
    """−u⁺ where φ ≥ 0 (eqs. 10 and 11)."""
    return np.where(row.phi >= 0.0, -row.switching_gain, np.inf)


@dataclass(frozen=True)
class Switch(Demand):
    """Rows with φ ≥ 0 demand −u⁺, the others nothing (eqs. 10 and 11).

    Muñoz-Benavent et al. (2018). Uses all of the space from φ and L_gφ only; chatters in a band of T_s u⁺, and u⁺ has
    to exceed drift and tracking.
    """

    name = "switch"
    formula = staticmethod(switch)
    everywhere = True


@formula
def implicit_switch(row: Row, periods: float) -> Any:
    """max(−u⁺, −φ/(p T_s))."""
    return np.maximum(-row.switching_gain, -row.phi / (periods * row.period))


@dataclass(frozen=True)
class ImplicitSwitch(Demand):
    """Rows demand that φ is no more than zero p periods from now, and never more than −u⁺: max(−u⁺, −φ/(p T_s)).

    The paper's switch by the implicit Euler method (Acary and Brogliato 2010): with p = 1 it is the v in [−u⁺, v_track]
    that is complementary to φ + T_s v ≤ 0. It does not chatter, but φ comes to rest at p T_s L_fφ. p > 1 averages
    noise, and suits commands that are followed late; p < 1 would overshoot.
    """

    periods: float = option(1.0, "p, in sampling periods", (1.0, 50.0), at_least=1.0)

    name = "implicit-switch"
    formula = staticmethod(implicit_switch)
    uses: ClassVar[tuple[str, ...]] = ("period",)


@formula
def implicit_switch_with_drift(row: Row, periods: float) -> Any:
    """max(−u⁺, −φ/(p T_s) − d̂), d̂ = (φ − φ₋)/T_s − v₋ within ±u⁺, 0 at first; φ."""
    seen = (row.phi - row.memory[0]) / row.period - row.last_rate
    drift = np.where(np.isnan(seen), 0.0, np.minimum(np.maximum(seen, -row.switching_gain), row.switching_gain))
    return np.maximum(-row.switching_gain, -row.phi / (periods * row.period) - drift), row.phi


@dataclass(frozen=True)
class ImplicitSwitchWithDrift(ImplicitSwitch):
    """Rows demand what :class:`ImplicitSwitch` does, less the drift d̂ = (φ − φ₋)/T_s − v₋ of the period before.

    v₋ is the L_gφ q̈ that this law commanded then; d̂ is kept within ±u⁺, and 0 at first. A drift that is observed and
    compensated a sample later (Su, Drakunov and Özgüner 2000) leaves φ = O(T_s²) at rest where the implicit switch
    leaves O(T_s). Misidentifies lag, delay or saturation as drift, and divides noise of φ by T_s.
    """

    name = "implicit-switch-with-drift"
    formula = staticmethod(implicit_switch_with_drift)
    uses = ("period", "last_rate")
    remembers = (np.nan,)


@formula
def gains(row: Row, rate: float) -> Any:
    """k₁ = 1.5 √L and k₂ = 1.1 L with L = rate × u⁺ (Levant 1998)."""
    L = rate * row.switching_gain
    return 1.5 * np.sqrt(L), 1.1 * L


@formula
def saturated(row: Row, c: Any, integral: Any) -> Any:
    """The bound c, at least −u⁺, and the integral within ±u⁺ where tracking exceeds c, else 0."""
    bound = np.maximum(-row.switching_gain, c)
    kept = np.minimum(np.maximum(integral, -row.switching_gain), row.switching_gain)
    return bound, np.where(row.tracked > bound, kept, 0.0)


@formula
def super_twisting(row: Row, rate: float) -> Any:
    """max(−u⁺, w − k₁ √|φ| sign φ); w − T_s k₂ sign φ."""
    k1, k2 = gains(row, rate)
    w = row.memory[0]
    side = np.sign(row.phi)
    return saturated(row, w - k1 * np.sqrt(np.abs(row.phi)) * side, w - row.period * k2 * side)


@dataclass(frozen=True)
class SuperTwisting(Demand):
    """Rows demand φ̇ = −k₁ √|φ| sign φ + w with ẇ = −k₂ sign φ, and never more than −u⁺.

    The super-twisting algorithm (Levant 1993), a sliding mode of second order: w, which is integrated where tracking
    would exceed c and else 0, learns the drift. Drifts that change by less than L a second stay in a band of O(T_s²)
    without L_fφ. Large L chatter in this explicit form, small ones overshoot, and at each contact w is learnt anew.
    """

    rate: float = option(20.0, "L as a multiple of u⁺ [1/s]; k₁ = 1.5 √L, k₂ = 1.1 L", (1.0, 100.0))

    name = "super-twisting"
    formula = staticmethod(super_twisting)
    uses = ("tracked", "period")
    remembers = (0.0,)


@formula
def implicit_super_twisting(row: Row, rate: float) -> Any:
    """max(−u⁺, w₊ + (x − φ)/T_s), x + T_s k₁ √|x| sign x + T_s² k₂ sign x ∋ φ; w₊ = w − T_s k₂ sign x.

    Of the inclusion x is 0 where |φ| ≤ T_s² k₂, and sign x then the number in between that solves it; else the square
    of y = √|x|, which solves y² + T_s k₁ y = |φ| − T_s² k₂.
    """
    k1, k2 = gains(row, rate)
    step, half = row.period * row.period * k2, 0.5 * row.period * k1
    over = np.maximum(np.abs(row.phi) - step, 0.0)
    # y without the difference of two numbers that are nearly equal
    y = over / (half + np.sqrt(half * half + over))
    after = row.memory[0] - np.minimum(np.maximum(row.phi, -step), step) / row.period
    return saturated(row, after + (np.sign(row.phi) * y * y - row.phi) / row.period, after)


@dataclass(frozen=True)
class ImplicitSuperTwisting(SuperTwisting):
    """Rows demand what :class:`SuperTwisting` does, by the proper implicit Euler method, and never more than −u⁺.

    Seeber and Andritsch (2025): x = φ − T_s k₁ √|x| sign x − T_s² k₂ sign x is where φ would be after the period if w
    were what the drift takes, w₊ = w − T_s k₂ sign x, and v = w₊ + (x − φ)/T_s = −k₁ √|x| sign x + 2w₊ − w. A drift
    that changes by no more than L < k₂ a second leaves |φ| ≤ L T_s², the least that any law can promise that does not
    know the drift to come; a constant one is rejected exactly, without chattering. Once φ rests this is
    :class:`ImplicitSwitchWithDrift` with p = 1. Learns anew at contacts, needs commands that are followed at once,
    divides noise of φ by T_s, and resolvers with inequalities keep rows far inside to v ≤ k₁ √|φ|.
    """

    name = "implicit-super-twisting"
    formula = staticmethod(implicit_super_twisting)


# --- potential fields and layers ---


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


@dataclass(frozen=True)
class Field(Demand):
    """What the demands of potential fields have in common: see :class:`RampRepulsion`."""

    region: float = option(0.2, "δ as a fraction of each row's scale", (0.01, 1.0))
    exponent: float = option(1.0, "how ψ grows; 1 is linear", (0.5, 4.0))
    strength: float = option(1.0, "factor s on every u⁺", (0.1, 10.0))

    owner = "a potential field"


@dataclass(frozen=True)
class RampRepulsion(Field):
    """Rows inside the region demand ψ s u⁺ less than what tracking does, with ψ = (1 + φ/δ)^exponent.

    A repulsion that is finite everywhere: s u⁺ on the boundary, and growing beyond it; :class:`Firas` is the classical
    one. Since φ = σ + K σ̇, it is a spring in σ together with a damper in σ̇. Smooth commands; but rows and task may
    each win, so that rows are violated, and the arm stops where the two are equal, beside goals near a boundary.
    """

    name = "ramp-repulsion"
    formula = staticmethod(ramp_repulsion)
    relative = True
    everywhere = True


@formula
def firas(row: Row, region: float, strength: float, contact: float) -> Any:
    """−s u⁺ (r − 1) r² below what tracking does, where r = δ/ρ > 1, with ρ = −σ, but contact × δ at least."""
    ratio = 1.0 / np.maximum(-row.sigma / row.scale / region, contact)
    return np.where(ratio > 1.0, -(strength * row.switching_gain * (ratio - 1.0) * ratio * ratio), np.inf)


@dataclass(frozen=True)
class Firas(Demand):
    """Rows nearer than ρ₀ demand η (1/ρ − 1/ρ₀)/ρ² less than what tracking does: the force of Khatib's FIRAS function.

    Khatib (1986): U = ½ η (1/ρ − 1/ρ₀)² where the distance ρ is less than ρ₀, else 0, pushes by −dU/dρ. Here ρ = −σ as
    a fraction of the row's scale, and η = ``strength`` × u⁺ ρ₀³, so that the push is s u⁺ (r − 1) r² with r = ρ₀/ρ, s
    u⁺ at ρ = ρ₀/1.47. Rows that are φ itself have σ = φ. Beyond the boundary U is not defined: ρ counts as no less than
    ``contact`` × ρ₀, so that the push is at most s u⁺ (1 − contact)/contact³. Sampling near the boundary makes blows.
    """

    region: float = option(0.2, "ρ₀ as a fraction of each row's scale", (0.01, 1.0))
    strength: float = option(0.1, "factor s on every u⁺", (0.01, 1.0))
    contact: float = option(0.1, "least distance that is distinguished, a fraction of ρ₀", (0.02, 0.5), below=1.0)

    name = "firas"
    formula = staticmethod(firas)
    uses = ("sigma",)
    relative = True
    everywhere = True


@formula
def boundary_layer(row: Row, region: float, exponent: float, strength: float) -> Any:
    """(1 − ψ) L_gφ q̈_track − ψ s u⁺ where ψ > 0, ψ at most 1."""
    psi = np.minimum(grown(row, region, exponent), 1.0)
    return np.where(psi > 0.0, (1.0 - psi) * row.tracked - psi * strength * row.switching_gain, np.inf)


@dataclass(frozen=True)
class BoundaryLayer(Field):
    """Rows inside the region demand (1 − ψ) L_gφ q̈_track − ψ s u⁺, with ψ = min(1, (1 + φ/δ)^exponent).

    With exponent 1 and :class:`~vsconstraints.controllers.resolvers.Priority` this is the boundary layer of sliding
    mode control (Slotine and Sastry 1983), inside the boundary; as δ shrinks it becomes :class:`Switch`. No chattering,
    and no violation while drift is less than u⁺; φ rests inside the layer, whose space is not used.
    """

    name = "boundary-layer"
    formula = staticmethod(boundary_layer)
    uses = ("tracked",)
    everywhere = True


@formula
def outer_layer(row: Row, layer: float) -> Any:
    """(1 − s) L_gφ q̈_track − s u⁺ where φ ≥ 0, with s = min(1, φ/δ)."""
    share = np.minimum(row.phi / row.scale / layer, 1.0)
    return np.where(row.phi >= 0.0, (1.0 - share) * row.tracked - share * row.switching_gain, np.inf)


@dataclass(frozen=True)
class OuterLayer(Demand):
    """Rows with φ ≥ 0 demand (1 − s) L_gφ q̈_track − s u⁺, with s = min(1, φ/δ).

    The boundary layer of sliding mode control as published (Slotine and Sastry 1983; Slotine and Li 1991, section 7.2),
    outside the boundary, where the paper's switch acts; :class:`BoundaryLayer` is inside. It violates: φ comes to rest
    where s balances drift and tracking.
    """

    layer: float = option(0.05, "δ as a fraction of each row's scale", (0.001, 0.5))

    name = "outer-layer"
    formula = staticmethod(outer_layer)
    uses = ("tracked",)
    everywhere = True


# --- without parameters ---


@formula
def nothing(row: Row) -> Any:
    """Infinity."""
    return np.inf * row.scale


@dataclass(frozen=True)
class Nothing(Demand):
    """No row demands anything."""

    name = "nothing"
    formula = staticmethod(nothing)
    everywhere = True


@formula
def remembered(row: Row) -> Any:
    """The row's memory, twice."""
    return row.memory[0], row.memory[0]


class Known(Demand):
    """Bounds that were computed beforehand and stand in the law's memory, for formulas that do not compile."""

    name = "known"
    formula = staticmethod(remembered)
    remembers = (np.inf,)
    everywhere = True


class KnownPush(Known):
    """Likewise, relative to L_gφ q̈ of tracking."""

    relative = True


DEMANDS: tuple[type[Demand], ...] = (
    Switch, ImplicitSwitch, ImplicitSwitchWithDrift, BoundaryLayer, OuterLayer, SuperTwisting, ImplicitSuperTwisting,
    Firas, RampRepulsion, Barrier, ReciprocalBarrier, FiniteTimeBarrier, HighOrderBarrier, RobustBarrier,
    InputToStateSafeBarrier, GradientRobustBarrier, SampledBarrier, Nothing,
)  # fmt: skip
"""Demands that files can name, by their ``name``."""
