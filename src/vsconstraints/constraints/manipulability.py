"""The arm stays away from singular configurations: section 4.3.6."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from ..errors import ConfigurationError, unknown_name
from ..qp.decomposition import svd
from ..robots.robot import Robot
from ..rows import Array
from ..vision.scene import Scene
from .base import Constraint, Trace, demand_positive
from .by_formula import Form

Part = Literal["pose", "position", "orientation"]  #: Which rows of the tip's Jacobian count.
#: Which these are.
ROWS_OF = {"pose": slice(0, 6), "position": slice(0, 3), "orientation": slice(3, 6)}


class Manipulability(Constraint):
    """The arm stays away from singular configurations.

    (w_min − w) / w_scale ≤ 0 with w the product of the singular values of the tip's Jacobian, of
    whose rows the directions of the ``part`` count: √det(J Jᵀ) (Yoshikawa), or √det(Jᵀ J) for arms
    with fewer joints than directions. Gradient and curvature are exact, ∂w/∂q_k = w tr(J⁺ ∂J/∂q_k);
    in a singular configuration the gradient is one of two sides, finite. ``minimum`` is w_min, in
    products of metres and radians, ``scale`` w_scale, w_min if not given. K is the approach time
    constant [s], ``switching_gain`` u⁺ [1/s]. Raises ConfigurationError if w is always zero.
    """

    kind = "manipulability"
    unit = "1"

    def __init__(
        self,
        robot: Robot,
        *,
        minimum: float,
        K: float,
        switching_gain: float,
        scale: float | None = None,
        part: Part = "pose",
    ) -> None:
        super().__init__(K=K, switching_gain=switching_gain)
        self.minimum = demand_positive(minimum, "minimum of manipulability")
        self.w_scale = demand_positive(
            minimum if scale is None else scale, "scale of manipulability"
        )
        if part not in get_args(Part):
            raise unknown_name("part of manipulability", part, get_args(Part))
        self.robot = robot
        self.part = part
        self._rows = ROWS_OF[part]
        self._evaluate = robot.evaluator()
        rng = np.random.default_rng(0)
        if self._measure(rng.uniform(-1.0, 1.0, (8, robot.n))).max() < 1e-12:
            raise ConfigurationError(
                f"manipulability of {robot.name} is zero in every configuration: its {robot.n} "
                f"joints do not move "
                f"the {part} of the tip in enough directions; choose another part "
                f"({', '.join(get_args(Part))})"
            )

    def labels(self, scene: Scene) -> tuple[str, ...]:
        """``manipulability``, and the part if it is not the pose."""
        return (self.kind if self.part == "pose" else f"{self.kind}[{self.part}]",)

    def compiled_form(self, scene: Scene, points: slice) -> Form | None:
        """The row that compiled code makes from the tip's Jacobian, by a decomposition of its
        own.
        """
        at = self._rows
        numbers = self.minimum, self.w_scale, at.start, at.stop - at.start
        return (
            Form("manipulability_rows", parameters=numbers)
            if type(self).rows is Constraint.rows
            else None
        )

    def clearance(self, trace: Trace, points: slice) -> Array:
        """(w − w_min) / w_scale."""
        return (self._measure(trace.q) - self.minimum) / self.w_scale

    def characteristic_length(self, scene: Scene) -> Array:
        """1: w_scale in units of itself."""
        return np.ones(1)

    def _measure(self, q: Array) -> Array:
        """(N, 1) product of the singular values at q (N, n)."""
        jacobians = [self._evaluate(x, np.zeros_like(x)).J[self._rows] for x in q]
        return np.array([float(svd(J, full_matrices=False)[1].prod()) for J in jacobians]).reshape(
            -1, 1
        )
