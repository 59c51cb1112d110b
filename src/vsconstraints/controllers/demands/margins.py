"""Control barrier functions with margins for what is not known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...formulas import formula
from ...formulas.row import Row
from .barrier import Barrier, barrier


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

    Parameters
    ----------
    alpha
        Rate α [1/s].
    disturbance
        D, the same for every joint [rad/s² or m/s²].
    """

    disturbance: float = 0.1

    name = "robust-barrier"
    formula = staticmethod(robust_barrier)
    uses: ClassVar[tuple[str, ...]] = ("Lf", "norm_1")
    ranges: ClassVar[Mapping[str, tuple[float, float]]] = {"alpha": (1.0, 200.0), "disturbance": (0.001, 10.0)}


@dataclass(frozen=True)
class InputToStateSafeBarrier(Barrier):
    """Every row demands −αφ − L_fφ − ‖L_gφ‖²/(ε s), so that φ leaves its bound by no more than disturbances are worth.

    Kolathaya and Ames (2019), with φ/s as the barrier function, so that units of φ do not matter; s is the row's scale.
    With a disturbance ‖d_c‖ ≤ d, φ̇ ≤ −αφ + ε s d²/4, so that φ stays below ε s d²/(4α). Good at: disturbances of
    unknown size. Bad at: the space, of which it leaves ‖L_gφ‖²/(α ε s).

    Parameters
    ----------
    alpha
        Rate α [1/s].
    epsilon
        ε [s³/rad²]: the smaller, the safer.
    """

    epsilon: float = 1.0

    name = "input-to-state-safe-barrier"
    formula = staticmethod(input_to_state_safe_barrier)
    uses: ClassVar[tuple[str, ...]] = ("Lf", "norm")
    ranges: ClassVar[Mapping[str, tuple[float, float]]] = {"alpha": (1.0, 200.0), "epsilon": (0.01, 100.0)}


@dataclass(frozen=True)
class GradientRobustBarrier(Barrier):
    """Every row demands −αφ − L_fφ − c_e ‖L_gφ‖ ‖q̈_track‖: a margin for gradients that are wrong by the fraction c_e.

    The measurement-robust barrier (Dean, Taylor, Cosner, Recht and Ames 2020) for eq. (49): an L_gφ that is wrong by
    c_e in each entry misjudges L_gφ q̈ by c_e ‖L_gφ‖ ‖q̈‖ at most. For ‖q̈‖ there stands that of tracking, which is known
    before q̈ is, and keeps this a bound of one row: conservative where the law commands less, and too little where it
    commands more. The error of L_fφ is not in it. Bad at: large motions, at which every row demands much.

    Parameters
    ----------
    alpha
        Rate α [1/s].
    gradient_error
        c_e, a fraction.
    """

    gradient_error: float = 0.1

    name = "gradient-robust-barrier"
    formula = staticmethod(gradient_robust_barrier)
    uses: ClassVar[tuple[str, ...]] = ("Lf", "norm", "effort")
    ranges: ClassVar[Mapping[str, tuple[float, float]]] = {"alpha": (1.0, 200.0), "gradient_error": (0.001, 1.0)}


@dataclass(frozen=True)
class SampledBarrier(Barrier):
    """Every row demands −min(α, 1/T_s) φ − L_fφ − ν, with ν = ½ T_s max|φ̈|: the barrier between samples.

    Breeden, Garg and Panagou (2022): a command that is held for T_s keeps φ(t) ≤ 0 over the period if its bound is
    lower by ν, and if α T_s ≤ 1; a faster α would demand that φ passes its bound. That is a promise only if φ̈ is no
    more than ``curvature`` × scale in every period that begins near the boundary. No formula here bounds φ̈, which
    depends on scene and arm: measured within 0.1 of the scale, it is up to 15 times the scale in the paper's scenes
    with convex rows, 18 in ``ur5-fov`` and 88 in ``panda-fov``, and thousands around what is not convex. Bad at: that;
    and long periods, at which φ rests ν/α inside.

    Parameters
    ----------
    alpha
        Rate α [1/s].
    curvature
        Largest φ̈ of any row near its boundary, as a multiple of its scale [1/s²]: to be set for scene and arm.
    """

    curvature: float = 20.0

    name = "sampled-barrier"
    formula = staticmethod(sampled_barrier)
    uses: ClassVar[tuple[str, ...]] = ("Lf", "period")
    ranges: ClassVar[Mapping[str, tuple[float, float]]] = {"alpha": (1.0, 200.0), "curvature": (0.1, 1000.0)}
