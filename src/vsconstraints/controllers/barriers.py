"""Demands of control barrier functions, which use L_fφ.

For formulas, sources and properties see :doc:`/laws`.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, ClassVar

import numpy as np

from ..errors import ConfigurationError, format_value
from ..formulas import where
from ..formulas.limits import stopping
from ..formulas.row import Row
from .demand import Demand
from .ranges import GAINS, option


@dataclass(frozen=True)
class WithRate(Demand):
    """Common option of barriers with a rate α."""

    alpha: float = option(20.0, "α: rate at which φ may approach zero [1/s]", (1.0, 200.0))

    uses: ClassVar[tuple[str, ...]] = ("Lf",)
    ignores = GAINS

    def refusal(self, name: str, wanted: str = "a positive, finite number") -> Exception:
        """See :class:`.Demand`."""
        return ConfigurationError(
            f"{name} must be {wanted}, not {format_value(getattr(self, name))}"
        )


@dataclass(frozen=True)
class Barrier(WithRate):
    """Every row demands −αφ − L_fφ: φ decays exponentially to its bound, without crossing it.

    Ames et al. 2017.
    """

    name = "barrier"

    @staticmethod
    def formula(row: Row, alpha: float) -> Any:
        return -alpha * row.phi - row.Lf


@dataclass(frozen=True)
class RobustBarrier(WithRate):
    """Every row demands −αφ − L_fφ − D ‖L_gφ‖₁: safe for disturbances of q̈ up to D.

    Jankovic 2018. D holds for each joint.
    """

    disturbance: float = option(
        0.1,
        "D: bound on the disturbance of each joint's acceleration [rad/s² or m/s²]",
        (0.001, 10.0),
    )

    name = "robust-barrier"
    uses = ("Lf", "norm_1")

    @staticmethod
    def formula(row: Row, alpha: float, disturbance: float) -> Any:
        return -alpha * row.phi - row.Lf - disturbance * row.norm_1


@dataclass(frozen=True)
class ProbabilisticBarrier(WithRate):
    """Every row demands −αφ − L_fφ − z s_d: φ̇ ≤ −αφ is violated at a rate of at most ε.

    After the chance constraint of Zhang, Yang and Luo (arXiv 2309.03476), for any row, linear in
    the noise, in the present sample. z is the normal quantile of 1 − ε. The measured φ and the
    acceleration of each joint have independent noise: s_d² = (α noise scale)² + (acceleration_noise
    ‖L_gφ‖)². The rate refers to each row in each sample, not to a run; it is lower for rows that
    are held together with others. Errors of L_fφ and L_gφ are not included.
    """

    violation_rate: float = option(
        0.01, "ε: probability of a violation, for each row in each sample", (1e-4, 0.2), below=0.5
    )
    noise: float = option(
        0.01, "standard deviation of the measured φ, as a fraction of each row's scale", (1e-4, 0.1)
    )
    acceleration_noise: float = option(
        0.01, "standard deviation of each joint's acceleration [rad/s² or m/s²]", (0.001, 10.0)
    )

    name = "probabilistic-barrier"
    uses = ("Lf", "norm")

    @property
    def parameters(self) -> tuple[float, ...]:
        """See :class:`.Demand`; the quantile replaces ε."""
        return (
            self.alpha,
            NormalDist().inv_cdf(1.0 - self.violation_rate),
            self.noise,
            self.acceleration_noise,
        )

    @staticmethod
    def formula(
        row: Row, alpha: float, quantile: float, noise: float, acceleration_noise: float
    ) -> Any:
        measured = alpha * noise * row.scale
        moved = acceleration_noise * row.norm
        return -alpha * row.phi - row.Lf - quantile * np.sqrt(measured * measured + moved * moved)


@dataclass(frozen=True)
class InputToStateSafeBarrier(WithRate):
    """Every row demands −αφ − L_fφ − ‖L_gφ‖²/(ε s): bounded violation under disturbances.

    Kolathaya and Ames (2019): for a disturbance ‖d_c‖ ≤ d, φ stays below ε s d²/(4α). s is the
    scale of the row.
    """

    epsilon: float = option(
        1.0, "ε: the violation under a disturbance is proportional to it [s³/rad²]", (0.01, 100.0)
    )

    name = "input-to-state-safe-barrier"
    uses = ("Lf", "norm")

    @staticmethod
    def formula(row: Row, alpha: float, epsilon: float) -> Any:
        return -alpha * row.phi - row.Lf - row.norm * (row.norm / row.scale) / epsilon


@dataclass(frozen=True)
class GradientRobustBarrier(WithRate):
    """Every row demands −αφ − L_fφ − c_e ‖L_gφ‖ ‖q̈_track‖, for gradients with an error c_e.

    Dean, Taylor, Cosner, Recht and Ames (2020), for eq. (49). c_e is the relative error of the
    gradients. The margin is too small where the law commands more than tracking.
    """

    gradient_error: float = option(
        0.1, "c_e: relative error of the gradients, as a fraction", (0.001, 1.0)
    )

    name = "gradient-robust-barrier"
    uses = ("Lf", "norm", "effort")

    @staticmethod
    def formula(row: Row, alpha: float, gradient_error: float) -> Any:
        return -alpha * row.phi - row.Lf - gradient_error * row.norm * row.effort


@dataclass(frozen=True)
class SampledBarrier(WithRate):
    """Every row demands −min(α, 1/T_s) φ − L_fφ − ν, with ν = ½ T_s max|φ̈|.

    The barrier is kept between samples, too (Breeden, Garg and Panagou 2022), if |φ̈| ≤
    ``curvature`` × scale near the boundary. φ rests ν/α inside.
    """

    curvature: float = option(
        20.0,
        "bound on |φ̈| of every row near its boundary, as a multiple of the row's scale [1/s²]",
        (0.1, 1000.0),
    )

    name = "sampled-barrier"
    uses = ("Lf", "period")

    @staticmethod
    def formula(row: Row, alpha: float, curvature: float) -> Any:
        rate = np.minimum(alpha, 1.0 / row.period)
        return -rate * row.phi - row.Lf - 0.5 * row.period * curvature * row.scale


@dataclass(frozen=True)
class ReciprocalBarrier(WithRate):
    """Every row demands −α φ³/s² − L_fφ where φ < 0: the reciprocal barrier −1/φ.

    Ames, Xu, Grizzle and Tabuada (2017). s is the scale of the row. Beyond the boundary, rows
    return with −αφ − L_fφ.
    """

    name = "reciprocal-barrier"

    @staticmethod
    def formula(row: Row, alpha: float) -> Any:
        depth = row.phi / row.scale
        return -alpha * row.phi * where(depth < 0.0, depth * depth, 1.0) - row.Lf


@dataclass(frozen=True)
class FiniteTimeBarrier(WithRate):
    """Every row demands −α sign(φ) √(s |φ|) − L_fφ: φ reaches its bound in finite time.

    Li, Wang, Pierpaoli and Egerstedt (2018), with the exponent ½. s is the scale of the row. The
    demand overshoots and chatters within |φ| < (α T_s)² s.
    """

    alpha: float = option(2.0, "α: rate at which φ may approach zero [1/s]", (0.1, 20.0))

    name = "finite-time-barrier"

    @staticmethod
    def formula(row: Row, alpha: float) -> Any:
        return -alpha * np.sign(row.phi) * np.sqrt(row.scale) * np.sqrt(np.abs(row.phi)) - row.Lf


@dataclass(frozen=True)
class PrescribedTimeBarrier(WithRate):
    """Rows demand −αφ − L_fφ; from outside they return within a prescribed time T.

    The gain α + p/(T − t) of Song, Wang, Holloway and Krstic (2017), with the decrease of a whole
    period, so that commands are finite. At T the clock restarts. Commands are large if a row is far
    outside and T is short.
    """

    time: float = option(
        1.0, "T: time within which a violated row returns to its boundary [s]", (0.1, 10.0)
    )
    exponent: float = option(
        2.0,
        "p: exponent of the return, φ₀ e^(−αt) (1 − t/T)^p",
        (1.0, 6.0),
        at_least=1.0,
    )

    name = "prescribed-time-barrier"
    uses = ("Lf", "period")
    remembers = (0.0,)

    @staticmethod
    def formula(row: Row, alpha: float, time: float, exponent: float) -> Any:
        """Return −αφ − L_fφ inside, and t as memory, which is 0 inside and from T on.

        Outside, c = −φ (1 − e^(−αT_s) (1 − T_s/(T − t))^p)/T_s − L_fφ.
        """
        remaining_time = np.maximum(time - row.memory[0], row.period)
        remaining_share = 1.0 - row.period / remaining_time
        kept = np.exp(-alpha * row.period) * remaining_share**exponent
        rate = where(row.phi > 0.0, (1.0 - kept) / row.period, alpha)
        later = row.memory[0] + row.period
        return -rate * row.phi - row.Lf, where((row.phi > 0.0) & (later < time), later, 0.0)


@dataclass(frozen=True)
class BackupBarrier(WithRate):
    """Rows demand that braking by σ̈ = −a can still stop them: a backup barrier function.

    Van Wijk, Das, Molnar, Ames and Burdick (2025). The demand is never more than −a, so that it can
    always be met if the row can reach σ̈ = −a and does not drift. Rows outside, and rows that are φ
    itself (K = 0), demand −αφ − L_fφ.
    """

    braking: float = option(
        5.0,
        "a: deceleration of the backup manoeuvre, as a multiple of each row's scale [1/s²]",
        (0.1, 100.0),
    )

    name = "backup-barrier"
    uses = ("sigma", "sigma_dot", "K", "Lf", "period")

    @staticmethod
    def formula(row: Row, alpha: float, braking: float) -> Any:
        """Return σ̇ + K max(−a, σ̈) − L_fφ, and −αφ − L_fφ where K = 0.

        σ̈ is the greatest one with H₊ ≤ e^(−αT_s) H.
        """
        a = braking * row.scale
        direct = row.K == 0.0
        speed = np.maximum(row.sigma_dot, 0.0)
        farthest = row.sigma + speed * speed / (2.0 * a)
        room = np.exp(-alpha * row.period) * farthest - row.sigma
        second = stopping(room, row.sigma_dot, a, row.period)
        # direct keeps the divisor positive where K = 0
        back = (-alpha * row.phi - row.sigma_dot) / (row.K + direct)
        wanted = where(row.sigma < 0.0, second, np.minimum(second, back))
        kept = np.maximum(-a, wanted)
        phi_dot = where(direct, -alpha * row.phi, row.sigma_dot + row.K * kept)
        return phi_dot - row.Lf


@dataclass(frozen=True)
class HighOrderBarrier(Demand):
    """Rows demand σ̈ ≤ −α₁'(−σ) σ̇ + α ψ₁, ψ₁ = −σ̇ + α₁(−σ): a high-order barrier of h = −σ.

    Xiao and Belta (2019). Far from the boundary, σ may approach as fast as σ̈ = −a can still stop
    it. This is no guarantee where other rows or tracking act as well. Rows that are φ itself (K =
    0) demand −αφ − L_fφ.
    """

    alpha: float = option(20.0, "α: rate at which ψ₁ may approach zero [1/s]", (1.0, 200.0))
    braking: float = option(
        5.0,
        "a: assumed deceleration before the boundary, as a multiple of each row's scale [1/s²]",
        (0.1, 100.0),
    )

    name = "high-order-barrier"
    uses = ("sigma", "sigma_dot", "K", "Lf")
    ignores = GAINS

    @staticmethod
    def formula(row: Row, alpha: float, braking: float) -> Any:
        """Return σ̇ + K (−α₁'(−σ) σ̇ + α ψ₁) − L_fφ, and −αφ − L_fφ where K = 0.

        ψ₁ = −σ̇ + α₁(−σ) and α₁(h) = sign(h) (√((aK)² + 2a|h|) − aK) with a = braking × scale. α₁
        is computed without cancellation.
        """
        a = braking * row.scale
        corner = a * row.K
        root = np.sqrt(corner * corner + 2.0 * a * np.abs(row.sigma))
        # direct keeps the divisors positive where K = 0, and K then cancels their terms
        direct = row.K == 0.0
        approach = -2.0 * a * row.sigma / (root + corner + direct)
        psi = approach - row.sigma_dot
        second = -a / (root + direct) * row.sigma_dot + alpha * psi
        return row.sigma_dot + row.K * second - alpha * row.phi * direct - row.Lf
