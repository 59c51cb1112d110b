"""Demands: what rows ask of the acceleration, L_gφ q̈ ≤ c, each by an elementwise formula.

One half of a law; :mod:`vsconstraints.controllers.resolvers` are the other.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from ..errors import ConfigurationError, InvalidInput, shown
from ..formulas import formula
from ..formulas.row import Row
from .ranges import Declared, positive

Ranges = Mapping[str, Declared]

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
class Demand(ABC):
    """What the rows ask of the acceleration, L_gφ q̈ ≤ c, with c = ∞ for a row that asks for nothing.

    A new demand is a frozen dataclass: its fields are the parameters of :attr:`formula`, all positive numbers unless
    ``__post_init__`` checks otherwise.

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
        What it remembers of each row at first, one float each; ``row.memory`` holds what it gave back last.
    relative
        Whether the formula gives by how much c is above L_gφ q̈ of tracking, which it then need not use.
    everywhere
        Whether resolvers with equalities hold L_gφ q̈ = c wherever a row demands something; if not, only where the
        tracking command exceeds c.
    ranges
        From where to where a parameter is worth searching.
    """

    name: ClassVar[str]
    formula: ClassVar[Callable[..., Any]]
    uses: ClassVar[tuple[str, ...]] = ()
    remembers: ClassVar[tuple[float, ...]] = ()
    relative: ClassVar[bool] = False
    everywhere: ClassVar[bool] = False
    ranges: ClassVar[Ranges] = {}

    def __post_init__(self) -> None:
        for field in fields(self):
            number = positive(getattr(self, field.name))
            if number is None:
                raise self.refusal(field.name)
            object.__setattr__(self, field.name, number)

    def refusal(self, name: str, wanted: str = "positive") -> Exception:
        """What is raised for a parameter that is not as wanted."""
        return InvalidInput(f"{name} of {self.name} must be {wanted}, not {shown(getattr(self, name))}")

    @property
    def parameters(self) -> tuple[float, ...]:
        """The parameters, in the order in which the formula takes them."""
        return tuple(getattr(self, field.name) for field in fields(self))

    @property
    def sees_tracking(self) -> bool:
        """Whether the formula uses what tracking alone does."""
        return "tracked" in self.uses or "effort" in self.uses

    @property
    def tracks(self) -> bool:
        """Whether c depends on what tracking alone does."""
        return self.relative or self.sees_tracking


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
    """

    alpha: float = 20.0
    """Rate α [1/s]."""

    name = "barrier"
    formula: ClassVar[Callable[..., Any]] = staticmethod(barrier)
    uses: ClassVar[tuple[str, ...]] = ("Lf",)
    ranges: ClassVar[Ranges] = {"alpha": (1.0, 200.0)}

    def refusal(self, name: str, wanted: str = "a positive, finite number") -> Exception:
        """See :class:`.Demand`."""
        return ConfigurationError(f"{name} must be {wanted}, not {shown(getattr(self, name))}")


@formula
def robust_barrier(row: Row, alpha: float, disturbance: float) -> Any:
    """−αφ − L_fφ − D ‖L_gφ‖₁."""
    return barrier(row, alpha) - disturbance * row.norm_1


@formula
def input_to_state_safe_barrier(row: Row, alpha: float, epsilon: float) -> Any:
    """−αφ − L_fφ − ‖L_gφ‖²/(ε × scale)."""
    return barrier(row, alpha) - row.norm * (row.norm / row.scale) / epsilon


@formula
def gradient_robust_barrier(row: Row, alpha: float, gradient_error: float) -> Any:
    """−αφ − L_fφ − c_e ‖L_gφ‖ ‖q̈_track‖."""
    return barrier(row, alpha) - gradient_error * row.norm * row.effort


@formula
def sampled_barrier(row: Row, alpha: float, curvature: float) -> Any:
    """−min(α, 1/T_s) φ − L_fφ − ν, with ν = ½ T_s × curvature × scale."""
    rate = np.minimum(alpha, 1.0 / row.period)
    return barrier(row, rate) - 0.5 * row.period * curvature * row.scale


@dataclass(frozen=True)
class RobustBarrier(Barrier):
    """Every row demands −αφ − L_fφ − D ‖L_gφ‖₁: safe for any disturbance of q̈ of up to D in each joint.

    Jankovic (2018). Good at: φ̇ ≤ −αφ whatever d_c does within |d_c| ≤ D. Bad at: when nothing disturbs, φ stays
    D ‖L_gφ‖₁/α away from its bound.
    """

    disturbance: float = 0.1
    """D, the same for every joint [rad/s² or m/s²]."""

    name = "robust-barrier"
    formula = staticmethod(robust_barrier)
    uses = ("Lf", "norm_1")
    ranges: ClassVar[Ranges] = {"alpha": (1.0, 200.0), "disturbance": (0.001, 10.0)}


@dataclass(frozen=True)
class InputToStateSafeBarrier(Barrier):
    """Every row demands −αφ − L_fφ − ‖L_gφ‖²/(ε s), so that φ leaves its bound by no more than disturbances are worth.

    Kolathaya and Ames (2019), with φ/s as the barrier function, so that units of φ do not matter; s is the row's scale.
    With a disturbance ‖d_c‖ ≤ d, φ̇ ≤ −αφ + ε s d²/4, so that φ stays below ε s d²/(4α). Good at: disturbances of
    unknown size. Bad at: the space, of which it leaves ‖L_gφ‖²/(α ε s).
    """

    epsilon: float = 1.0
    """ε [s³/rad²]: the smaller, the safer."""

    name = "input-to-state-safe-barrier"
    formula = staticmethod(input_to_state_safe_barrier)
    uses = ("Lf", "norm")
    ranges: ClassVar[Ranges] = {"alpha": (1.0, 200.0), "epsilon": (0.01, 100.0)}


@dataclass(frozen=True)
class GradientRobustBarrier(Barrier):
    """Every row demands −αφ − L_fφ − c_e ‖L_gφ‖ ‖q̈_track‖: a margin for gradients that are wrong by the fraction c_e.

    The measurement-robust barrier (Dean, Taylor, Cosner, Recht and Ames 2020) for eq. (49): an L_gφ that is wrong by
    c_e in each entry misjudges L_gφ q̈ by c_e ‖L_gφ‖ ‖q̈‖ at most. For ‖q̈‖ there stands that of tracking, which is known
    before q̈ is, and keeps this a bound of one row: conservative where the law commands less, and too little where it
    commands more. The error of L_fφ is not in it. Bad at: large motions, at which every row demands much.
    """

    gradient_error: float = 0.1
    """c_e, a fraction."""

    name = "gradient-robust-barrier"
    formula = staticmethod(gradient_robust_barrier)
    uses = ("Lf", "norm", "effort")
    ranges: ClassVar[Ranges] = {"alpha": (1.0, 200.0), "gradient_error": (0.001, 1.0)}


@dataclass(frozen=True)
class SampledBarrier(Barrier):
    """Every row demands −min(α, 1/T_s) φ − L_fφ − ν, with ν = ½ T_s max|φ̈|: the barrier between samples.

    Breeden, Garg and Panagou (2022): a command that is held for T_s keeps φ(t) ≤ 0 over the period if its bound is
    lower by ν, and if α T_s ≤ 1; a faster α would demand that φ passes its bound. That is a promise only if φ̈ is no
    more than ``curvature`` × scale in every period that begins near the boundary. No formula here bounds φ̈, which
    depends on scene and arm: measured within 0.1 of the scale, it is up to 15 times the scale in the paper's scenes
    with convex rows, 18 in ``ur5-fov`` and 88 in ``panda-fov``, and thousands around what is not convex. Bad at: that;
    and long periods, at which φ rests ν/α inside.
    """

    curvature: float = 20.0
    """Largest φ̈ of any row near its boundary, as a multiple of its scale [1/s²]: to be set for scene and arm."""

    name = "sampled-barrier"
    formula = staticmethod(sampled_barrier)
    uses = ("Lf", "period")
    ranges: ClassVar[Ranges] = {"alpha": (1.0, 200.0), "curvature": (0.1, 1000.0)}


@formula
def reciprocal_barrier(row: Row, alpha: float) -> Any:
    """−α φ³/s² − L_fφ, and −αφ − L_fφ where φ > 0."""
    depth = row.phi / row.scale
    return -alpha * row.phi * np.where(depth < 0.0, depth * depth, 1.0) - row.Lf


@formula
def finite_time_barrier(row: Row, alpha: float) -> Any:
    """−α sign(φ) √(s |φ|) − L_fφ."""
    return -alpha * np.sign(row.phi) * np.sqrt(row.scale) * np.sqrt(np.abs(row.phi)) - row.Lf


@dataclass(frozen=True)
class ReciprocalBarrier(Barrier):
    """Every row demands −α φ³/s² − L_fφ where φ < 0, with s its scale: the reciprocal barrier function −1/φ.

    d/dt(−1/φ) ≤ −α φ/s² (Ames, Xu, Grizzle and Tabuada 2017) is this bound. The function ends at the boundary; beyond,
    rows restart with the linear −αφ − L_fφ. Good at: rows far inside, which it leaves alone. Bad at: using the space,
    since φ approaches its bound like 1/√t only.
    """

    name = "reciprocal-barrier"
    formula = staticmethod(reciprocal_barrier)


@dataclass(frozen=True)
class FiniteTimeBarrier(Barrier):
    """Every row demands −α sign(φ) √(s |φ|) − L_fφ, with s its scale, which takes φ to its bound in finite time.

    The class K function of Li, Wang, Pierpaoli and Egerstedt (2018) with the exponent ½. Good at: a fast return from
    outside. Bad at: sampling, since its slope is infinite at the boundary: within |φ| < (α T_s)² s it overshoots in
    every period, and chatters.
    """

    alpha: float = 2.0
    """Rate α [1/s]."""

    name = "finite-time-barrier"
    formula = staticmethod(finite_time_barrier)
    ranges: ClassVar[Ranges] = {"alpha": (0.1, 20.0)}


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
    1/K on the boundary: far from it σ may come as fast as σ̈ = −a can still stop it, and α₁ α₁' ≤ a, so that no approach
    has to be braked harder. As a → ∞ it is :class:`Barrier`. As a bound on L_gφ q̈ it is
    σ̇ + K (−α₁'(−σ) σ̇ + α ψ₁) − L_fφ. Rows that are φ itself, such as speeds, have K = 0 and σ = φ: they need no second
    order, and demand −αφ − L_fφ. Good at: accelerations that are limited. Bad at: it needs L_fφ, σ and σ̇, and where
    other rows or tracking hold q̈ as well a is no promise.
    """

    alpha: float = 20.0
    """Rate α of ψ₁ [1/s]."""
    braking: float = 5.0
    """a as a multiple of each row's scale [1/s²]."""

    name = "high-order-barrier"
    formula = staticmethod(high_order_barrier)
    uses = ("sigma", "sigma_dot", "K", "Lf")
    ranges: ClassVar[Ranges] = {"alpha": (1.0, 200.0), "braking": (0.1, 100.0)}


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
    everywhere = True


@formula
def implicit_switch(row: Row, periods: float) -> Any:
    """max(−u⁺, −φ/(p T_s))."""
    return np.maximum(-row.switching_gain, -row.phi / (periods * row.period))


@dataclass(frozen=True)
class ImplicitSwitch(Demand):
    """Rows demand that φ is no more than zero p periods from now, and never more than −u⁺: max(−u⁺, −φ/(p T_s)).

    The paper's switch by the implicit Euler method (Acary and Brogliato 2010): with p = 1 it is the v in [−u⁺, v_track]
    that is complementary to φ + T_s v ≤ 0. Good at: the switch's promise, without second derivatives, and without its
    chattering. Bad at: φ comes to rest at p T_s L_fφ, beyond zero where the unknown drift L_fφ leads there. p > 1
    averages noise, and suits commands that are followed late.
    """

    periods: float = 1.0
    """p, in sampling periods; at least 1: below, φ is thrown beyond its goal and comes back."""

    name = "implicit-switch"
    formula = staticmethod(implicit_switch)
    uses: ClassVar[tuple[str, ...]] = ("period",)
    ranges: ClassVar[Ranges] = {"periods": (1.0, 50.0)}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.periods < 1.0:
            raise self.refusal("periods", "at least 1")


@formula
def implicit_switch_with_drift(row: Row, periods: float) -> Any:
    """max(−u⁺, −φ/(p T_s) − d̂), d̂ = (φ − φ₋)/T_s − v₋ within ±u⁺, 0 at first; φ."""
    seen = (row.phi - row.memory[0]) / row.period - row.last_rate
    drift = np.where(np.isnan(seen), 0.0, np.minimum(np.maximum(seen, -row.switching_gain), row.switching_gain))
    return np.maximum(-row.switching_gain, -row.phi / (periods * row.period) - drift), row.phi


@dataclass(frozen=True)
class ImplicitSwitchWithDrift(ImplicitSwitch):
    """Rows demand what :class:`ImplicitSwitch` does, less the drift d̂ = (φ − φ₋)/T_s − v₋ of the period before.

    v₋ is the L_gφ q̈ that this law commanded then; d̂ is kept within ±u⁺, and 0 at first. A drift that is seen and
    compensated a sample later, as Su, Drakunov and Özgüner (2000) do, leaves φ = O(T_s²) at rest where the implicit
    switch leaves O(T_s). Good at: unknown drifts, at a fraction of the switch's effort. Bad at: commands that are not
    followed at once, by lag, delay or saturation, which it takes for drift, and noise of φ, which it divides by T_s.
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
def held(row: Row, c: Any, integral: Any) -> Any:
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
    return held(row, w - k1 * np.sqrt(np.abs(row.phi)) * side, w - row.period * k2 * side)


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
    return held(row, after + (np.sign(row.phi) * y * y - row.phi) / row.period, after)


@dataclass(frozen=True)
class SuperTwisting(Demand):
    """Rows demand φ̇ = −k₁ √|φ| sign φ + w with ẇ = −k₂ sign φ, and never more than −u⁺.

    The super-twisting algorithm (Levant 1993), a sliding mode of second order: w, which is integrated where tracking
    would exceed c and else 0, learns the drift. Good at: drifts that change by less than L a second, which it holds in
    a band of O(T_s²) without L_fφ. Bad at: large L, which chatter in this explicit form, small ones, which overshoot,
    and contacts, at which w has to be learnt anew.
    """

    rate: float = 20.0
    """L as a multiple of u⁺ [1/s]; k₁ = 1.5 √L, k₂ = 1.1 L."""

    name = "super-twisting"
    formula = staticmethod(super_twisting)
    uses = ("tracked", "period")
    remembers = (0.0,)
    ranges: ClassVar[Ranges] = {"rate": (1.0, 100.0)}


@dataclass(frozen=True)
class ImplicitSuperTwisting(SuperTwisting):
    """Rows demand what :class:`SuperTwisting` does, by the proper implicit Euler method, and never more than −u⁺.

    Seeber and Andritsch (2025): x = φ − T_s k₁ √|x| sign x − T_s² k₂ sign x is where φ would be after the period if w
    were what the drift takes, w₊ = w − T_s k₂ sign x, and v = w₊ + (x − φ)/T_s = −k₁ √|x| sign x + 2w₊ − w. A drift
    that changes by no more than L < k₂ a second is held within |φ| ≤ L T_s², the least that any law can promise that
    does not know the drift of the period to come; a constant one is rejected exactly, without chattering, however
    large the rate is. Implicit forms before it (Brogliato, Polyakov and Efimov 2020) take φ + T_s v to zero, without
    the drift, and leave φ = T_s L_fφ. Once φ rests this is :class:`ImplicitSwitchWithDrift` with p = 1. Good at:
    unknown drifts, with far less switching than the explicit form. Bad at: contacts, as that one; commands that are
    not followed at once, and noise of φ, which it divides by T_s; and rows far inside, which resolvers with
    inequalities keep to v ≤ k₁ √|φ| as well, though a steep φ could come faster.
    """

    name = "implicit-super-twisting"
    formula = staticmethod(implicit_super_twisting)


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

    ranges: ClassVar[Ranges] = {
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
    """

    name = "ramp-repulsion"
    formula = staticmethod(ramp_repulsion)
    relative = True
    everywhere = True


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
    """

    region: float = 0.2
    """ρ₀ as a fraction of each row's scale."""
    strength: float = 0.1
    """Factor s on every u⁺: the push where ρ is ρ₀/1.47."""
    contact: float = 0.1
    """Least distance that is distinguished, as a fraction of ρ₀; less than 1."""

    name = "firas"
    formula = staticmethod(firas)
    uses = ("sigma",)
    relative = True
    everywhere = True
    ranges: ClassVar[Ranges] = {
        "region": (0.01, 1.0),
        "strength": (0.01, 1.0),
        "contact": (0.02, 0.5),
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.contact >= 1.0:
            raise self.refusal("contact", "less than 1")


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
    on the side of the boundary where the paper's switch acts. Good at: no chattering, and none of the allowed space is
    given away. Bad at: what it promises, since φ comes to rest inside the layer, where s balances drift and tracking:
    it violates. :class:`BoundaryLayer` is the one laid inside.
    """

    layer: float = 0.05
    """δ as a fraction of each row's scale."""

    name = "outer-layer"
    formula = staticmethod(outer_layer)
    uses = ("tracked",)
    everywhere = True
    ranges: ClassVar[Ranges] = {"layer": (0.001, 0.5)}


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
def known(row: Row) -> Any:
    """What stands in the row's memory, and the same again."""
    return row.memory[0], row.memory[0]


class Known(Demand):
    """Bounds that were computed beforehand and stand in the law's memory, for formulas that do not compile."""

    name = "known"
    formula = staticmethod(known)
    remembers = (np.inf,)
    everywhere = True


class KnownPush(Known):
    """Likewise, of what is below L_gφ q̈ of tracking."""

    relative = True


DEMANDS: tuple[type[Demand], ...] = (
    Switch,
    ImplicitSwitch,
    ImplicitSwitchWithDrift,
    BoundaryLayer,
    OuterLayer,
    SuperTwisting,
    ImplicitSuperTwisting,
    Firas,
    RampRepulsion,
    Barrier,
    ReciprocalBarrier,
    FiniteTimeBarrier,
    HighOrderBarrier,
    RobustBarrier,
    InputToStateSafeBarrier,
    GradientRobustBarrier,
    SampledBarrier,
    Nothing,
)
"""Demands that files can name, by their ``name``."""
