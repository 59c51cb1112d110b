"""Demands of control barrier functions, which use L_fφ."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, ClassVar

import numpy as np

from ..errors import ConfigurationError, shown
from ..formulas.limits import stopping
from ..formulas.row import Row
from .demand import Demand
from .ranges import GAINS, option


@dataclass(frozen=True)
class WithRate(Demand):
    """What barriers with a rate α have in common."""

    alpha: float = option(20.0, "rate α [1/s]", (1.0, 200.0))

    uses: ClassVar[tuple[str, ...]] = ("Lf",)
    ignores = GAINS

    def refusal(self, name: str, wanted: str = "a positive, finite number") -> Exception:
        """See :class:`.Demand`."""
        return ConfigurationError(f"{name} must be {wanted}, not {shown(getattr(self, name))}")


@dataclass(frozen=True)
class Barrier(WithRate):
    """Every row demands −αφ − L_fφ, so that φ decays exponentially to its bound and never crosses it.

    Ames, Xu, Grizzle and Tabuada (2017). With φ = σ + K σ̇ this is the high-order control barrier function of h = −σ
    with the rates 1/K and α. Uses all of the space without chattering; needs L_fφ, and knows no limits of q̈.
    """

    name = "barrier"

    @staticmethod
    def formula(row: Row, alpha: float) -> Any:
        """−αφ − L_fφ."""
        return -alpha * row.phi - row.Lf


@dataclass(frozen=True)
class RobustBarrier(WithRate):
    """Every row demands −αφ − L_fφ − D ‖L_gφ‖₁: safe for any disturbance of q̈ of up to D in each joint.

    Jankovic (2018). Without a disturbance, φ stays D ‖L_gφ‖₁/α away from its bound.
    """

    disturbance: float = option(0.1, "D, the same for every joint [rad/s² or m/s²]", (0.001, 10.0))

    name, uses = "robust-barrier", ("Lf", "norm_1")

    @staticmethod
    def formula(row: Row, alpha: float, disturbance: float) -> Any:
        """−αφ − L_fφ − D ‖L_gφ‖₁."""
        return -alpha * row.phi - row.Lf - disturbance * row.norm_1


@dataclass(frozen=True)
class ProbabilisticBarrier(WithRate):
    """Every row demands −αφ − L_fφ − z s_d: the barrier's condition φ̇ ≤ −αφ is violated with the rate ε at most.

    The chance constraint of Zhang, Yang and Luo (arXiv 2309.03476), by the normal quantile z of 1 − ε. They derive it
    for the distance of image points from a disc, quadratic in the noise, and within predictive control. Here it is that
    of any row, linear in the noise, for the present sample: the measured φ has a normal error with the standard
    deviation ``noise`` × scale, the accelerations one of ``acceleration_noise`` in each joint, independent of each
    other, so that s_d² = (α noise scale)² + (acceleration_noise ‖L_gφ‖)². Of a row that is held alone the rate is ε,
    of others less. It is that of each row in each sample, not of a run. Errors of L_fφ and L_gφ are not in it.
    """

    violation_rate: float = option(0.01, "ε, of each row and sample", (1e-4, 0.2), below=0.5)
    noise: float = option(0.01, "standard deviation of measured φ, a fraction of each row's scale", (1e-4, 0.1))
    acceleration_noise: float = option(0.01, "that of each joint's q̈ [rad/s² or m/s²]", (0.001, 10.0))

    name, uses = "probabilistic-barrier", ("Lf", "norm")

    @property
    def parameters(self) -> tuple[float, ...]:
        """See :class:`.Demand`: with the quantile in place of ε."""
        return self.alpha, NormalDist().inv_cdf(1.0 - self.violation_rate), self.noise, self.acceleration_noise

    @staticmethod
    def formula(row: Row, alpha: float, quantile: float, noise: float, acceleration_noise: float) -> Any:
        """−αφ − L_fφ − z √((α noise × scale)² + (acceleration_noise ‖L_gφ‖)²)."""
        measured, moved = alpha * noise * row.scale, acceleration_noise * row.norm
        return -alpha * row.phi - row.Lf - quantile * np.sqrt(measured * measured + moved * moved)


@dataclass(frozen=True)
class InputToStateSafeBarrier(WithRate):
    """Every row demands −αφ − L_fφ − ‖L_gφ‖²/(ε s), so that φ leaves its bound by no more than disturbances are worth.

    Kolathaya and Ames (2019), with φ/s as the barrier function; s is the row's scale. With a disturbance ‖d_c‖ ≤ d,
    φ̇ ≤ −αφ + ε s d²/4, so that φ stays below ε s d²/(4α). It leaves ‖L_gφ‖²/(α ε s) of the space unused.
    """

    epsilon: float = option(1.0, "ε [s³/rad²]: the smaller, the safer", (0.01, 100.0))

    name, uses = "input-to-state-safe-barrier", ("Lf", "norm")

    @staticmethod
    def formula(row: Row, alpha: float, epsilon: float) -> Any:
        """−αφ − L_fφ − ‖L_gφ‖²/(ε × scale)."""
        return -alpha * row.phi - row.Lf - row.norm * (row.norm / row.scale) / epsilon


@dataclass(frozen=True)
class GradientRobustBarrier(WithRate):
    """Every row demands −αφ − L_fφ − c_e ‖L_gφ‖ ‖q̈_track‖: a margin for gradients that are wrong by the fraction c_e.

    The measurement-robust barrier (Dean, Taylor, Cosner, Recht and Ames 2020) for eq. (49): an L_gφ that is wrong by
    c_e in each entry misjudges L_gφ q̈ by c_e ‖L_gφ‖ ‖q̈‖ at most. ‖q̈_track‖ stands for ‖q̈‖, which is not known yet:
    too little where the law commands more. The error of L_fφ is not in it.
    """

    gradient_error: float = option(0.1, "c_e, a fraction", (0.001, 1.0))

    name, uses = "gradient-robust-barrier", ("Lf", "norm", "effort")

    @staticmethod
    def formula(row: Row, alpha: float, gradient_error: float) -> Any:
        """−αφ − L_fφ − c_e ‖L_gφ‖ ‖q̈_track‖."""
        return -alpha * row.phi - row.Lf - gradient_error * row.norm * row.effort


@dataclass(frozen=True)
class SampledBarrier(WithRate):
    """Every row demands −min(α, 1/T_s) φ − L_fφ − ν, with ν = ½ T_s max|φ̈|: the barrier between samples.

    Breeden, Garg and Panagou (2022): a command that is constant for T_s keeps φ(t) ≤ 0 over the period if its bound is
    lower by ν, and if α T_s ≤ 1. It holds only if |φ̈| ≤ ``curvature`` × scale in every period near the boundary.
    Measured within 0.1 of the scale: up to 15 times the scale in the paper's scenes with convex rows, 18 in
    ``ur5-fov``, 88 in ``panda-fov``, and thousands around what is not convex. φ rests ν/α inside.
    """

    curvature: float = option(
        20.0, "largest φ̈ of any row near its boundary, as a multiple of its scale [1/s²]", (0.1, 1000.0)
    )

    name, uses = "sampled-barrier", ("Lf", "period")

    @staticmethod
    def formula(row: Row, alpha: float, curvature: float) -> Any:
        """−min(α, 1/T_s) φ − L_fφ − ν, with ν = ½ T_s × curvature × scale."""
        rate = np.minimum(alpha, 1.0 / row.period)
        return -rate * row.phi - row.Lf - 0.5 * row.period * curvature * row.scale


@dataclass(frozen=True)
class ReciprocalBarrier(WithRate):
    """Every row demands −α φ³/s² − L_fφ where φ < 0, with s its scale: the reciprocal barrier function −1/φ.

    d/dt(−1/φ) ≤ −α φ/s² (Ames, Xu, Grizzle and Tabuada 2017) is this bound. Beyond the boundary rows return with the
    linear −αφ − L_fφ. Ignores rows far inside; φ approaches its bound like 1/√t only.
    """

    name = "reciprocal-barrier"

    @staticmethod
    def formula(row: Row, alpha: float) -> Any:
        """−α φ³/s² − L_fφ, and −αφ − L_fφ where φ > 0."""
        depth = row.phi / row.scale
        return -alpha * row.phi * np.where(depth < 0.0, depth * depth, 1.0) - row.Lf


@dataclass(frozen=True)
class FiniteTimeBarrier(WithRate):
    """Every row demands −α sign(φ) √(s |φ|) − L_fφ, with s its scale, which takes φ to its bound in finite time.

    The class K function of Li, Wang, Pierpaoli and Egerstedt (2018) with the exponent ½. Within |φ| < (α T_s)² s it
    overshoots in every period, and chatters.
    """

    alpha: float = option(2.0, "rate α [1/s]", (0.1, 20.0))

    name = "finite-time-barrier"

    @staticmethod
    def formula(row: Row, alpha: float) -> Any:
        """−α sign(φ) √(s |φ|) − L_fφ."""
        return -alpha * np.sign(row.phi) * np.sqrt(row.scale) * np.sqrt(np.abs(row.phi)) - row.Lf


@dataclass(frozen=True)
class PrescribedTimeBarrier(WithRate):
    """Rows demand −αφ − L_fφ, and from outside they are back on the boundary a prescribed time T later at most.

    Inside, the barrier Lyapunov function −ln(−φ/s) grows by no more than α. Outside it has no value: from the sample on
    at which the row is found outside, the gain is α + p/(T − t) (Song, Wang, Holloway and Krstic 2017), so that φ = φ₀
    e^(−αt) (1 − t/T)^p is zero at T from any start, below the performance function φ₀ (1 − t/T)^p. Of visual servoing
    with barrier Lyapunov functions and a prescribed time (Robotics 14(12) 190, 2025), which narrows the bounds of a
    tracking error, this is what a row can have. The decrease is that of a whole period, so that commands are finite; at
    T the clock starts anew. From afar in a short time commands are large.
    """

    time: float = option(1.0, "T [s]", (0.1, 10.0))
    exponent: float = option(2.0, "p; 1 returns straight, larger ones arrive gently", (1.0, 6.0), at_least=1.0)

    name, uses, remembers = "prescribed-time-barrier", ("Lf", "period"), (0.0,)

    @staticmethod
    def formula(row: Row, alpha: float, time: float, exponent: float) -> Any:
        """−αφ − L_fφ inside; outside −φ (1 − e^(−αT_s) (1 − T_s/(T − t))^p)/T_s − L_fφ; t, 0 inside and from T on."""
        share = 1.0 - row.period / np.maximum(time - row.memory[0], row.period)
        rate = np.where(row.phi > 0.0, (1.0 - np.exp(-alpha * row.period) * share**exponent) / row.period, alpha)
        later = row.memory[0] + row.period
        return -rate * row.phi - row.Lf, np.where((row.phi > 0.0) & (later < time), later, 0.0)


@dataclass(frozen=True)
class BackupBarrier(WithRate):
    """Rows demand that braking by σ̈ = −a can still stop them: the backup barrier function of a braking row.

    The backup policy brakes, so that σ comes as far as H = σ + max(0, σ̇)²/(2a); H, the greatest σ of the backup
    trajectory, is what has to stay below zero (van Wijk, Das, Molnar, Ames and Burdick 2025, who interpolate between
    command and backup in closed form: for one row, this bound). Here H decays by e^(−αT_s) in a period, exactly: the
    demand is never more than −a, so that it can always be met if σ̈ = −a can and nothing drifts, and with α → ∞ it is
    the closed form of Del Prete (2018). Rows outside demand −αφ − L_fφ, within −a. Rows that are φ itself (K = 0)
    demand −αφ − L_fφ.
    """

    braking: float = option(5.0, "a as a multiple of each row's scale [1/s²]", (0.1, 100.0))

    name = "backup-barrier"
    uses = ("sigma", "sigma_dot", "K", "Lf", "period")

    @staticmethod
    def formula(row: Row, alpha: float, braking: float) -> Any:
        """σ̇ + K max(−a, σ̈) − L_fφ, with the greatest σ̈ that has H₊ ≤ e^(−αT_s) H; −αφ − L_fφ where K = 0."""
        a, direct = braking * row.scale, row.K == 0.0
        speed = np.maximum(row.sigma_dot, 0.0)
        farthest = row.sigma + speed * speed / (2.0 * a)
        second = stopping(np.exp(-alpha * row.period) * farthest - row.sigma, row.sigma_dot, a, row.period)
        back = (-alpha * row.phi - row.sigma_dot) / (row.K + direct)
        kept = np.maximum(-a, np.where(row.sigma < 0.0, second, np.minimum(second, back)))
        return np.where(direct, -alpha * row.phi, row.sigma_dot + row.K * kept) - row.Lf


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
    uses, ignores = ("sigma", "sigma_dot", "K", "Lf"), GAINS

    @staticmethod
    def formula(row: Row, alpha: float, braking: float) -> Any:
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
