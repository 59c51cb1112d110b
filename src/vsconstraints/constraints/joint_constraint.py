"""Constraints on joint coordinates and joint speeds."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from ..rows import Array
from ..vision.scene import Scene, State
from .base import Constraint, RowBlock, Trace, to_first_order
from .by_formula import Form, differences_along


class JointConstraint(Constraint):
    """Constraints on joint coordinates y = q (n,): r values of one vector.

    An own one gives ``kind``, :meth:`labels`, :meth:`sigma`, :meth:`gradient` and :meth:`characteristic_length`.
    """

    unit = "rad"
    linear: ClassVar[bool] = False
    """Whether the gradient is the same everywhere: then the rows are compiled."""

    @abstractmethod
    def sigma(self, q: Array) -> Array:
        """(..., r) σ at q (..., n): positive where forbidden."""

    @abstractmethod
    def gradient(self, q: Array) -> Array:
        """(..., r, n) ∂σ/∂q at q (..., n)."""

    def curvature(self, q: Array, qd: Array) -> Array:
        """(r,) q̇ᵀ H q̇ for each row; by central differences of the gradient unless a subclass knows it."""
        return differences_along(self.gradient, q, qd, 1e-6)

    def rows(self, state: State, points: slice) -> RowBlock:
        """Joint coordinates need no chain rule (eqs. 26 and 37)."""
        q, qd = state.robot.q, state.robot.qd
        g = self.gradient(q)
        return self.block(self.sigma(q), g @ qd, g, self.curvature(q, qd))

    def compiled_form(self, scene: Scene, points: slice) -> Form | None:
        """Rows that say that they are linear, as they are at rest."""
        if not self.linear or not self.says("linear", ("sigma", "gradient", "curvature", "rows")):
            return None
        rest = np.zeros(scene.robot.n)
        return Form("joint_rows", gradients=self.gradient(rest), offsets=self.sigma(rest))

    def clearance(self, trace: Trace, points: slice) -> Array:
        """−σ / ‖∂σ/∂q‖: exact for linear rows, to first order elsewhere [rad]."""
        return to_first_order(self.sigma(trace.q), self.gradient(trace.q))


class SpeedConstraint(Constraint):
    """Constraints on joint speeds y = q̇ (n,), which have relative degree one as they are: φ(q̇) ≤ 0.

    An own one gives ``kind``, :meth:`labels`, :meth:`phi`, :meth:`gradient` and :meth:`characteristic_length`.
    """

    unit = "rad/s"
    linear: ClassVar[bool] = False
    """Whether the gradient is the same everywhere: then the rows are compiled."""

    def __init__(self, *, switching_gain: float) -> None:
        super().__init__(K=1.0, switching_gain=switching_gain)

    @abstractmethod
    def phi(self, qd: Array) -> Array:
        """(..., r) φ at q̇ (..., n): positive where forbidden."""

    @abstractmethod
    def gradient(self, qd: Array) -> Array:
        """(..., r, n) ∂φ/∂q̇ at q̇ (..., n)."""

    def rows(self, state: State, points: slice) -> RowBlock:
        """L_gφ = ∂φ/∂q̇ (eq. 38) and L_fφ = 0 (eq. 34)."""
        qd = state.robot.qd
        phi = self.phi(qd)
        return RowBlock(phi, phi, self.gradient(qd), np.zeros_like(phi))

    def compiled_form(self, scene: Scene, points: slice) -> Form | None:
        """Rows that say that they are linear, as they are at rest."""
        if not self.linear or not self.says("linear", ("phi", "gradient", "curvature", "rows")):
            return None
        rest = np.zeros(scene.robot.n)
        return Form("speed_rows", gradients=self.gradient(rest), offsets=self.phi(rest))

    def clearance(self, trace: Trace, points: slice) -> Array:
        """−φ / ‖∂φ/∂q̇‖: exact for linear rows, to first order elsewhere [rad/s]."""
        return to_first_order(self.phi(trace.qd), self.gradient(trace.qd))

    def sampling_band(self, scene: Scene, Ts: float) -> Array:
        """T_s u⁺ / ‖∂φ/∂q̇‖, of the gradient at rest: φ is the clearance itself, and (43) lets it switch by T_s u⁺."""
        g = self.gradient(np.zeros(scene.robot.n))
        length = np.sqrt((g * g).sum(axis=-1))
        band: Array = np.divide(Ts * self.switching_gain, length, out=np.zeros(len(g)), where=length > 0.0)
        return band
