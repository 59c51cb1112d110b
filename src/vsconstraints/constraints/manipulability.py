"""Manipulability: the arm stays away from singular configurations (section 4.3.6)."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from ..errors import ConfigurationError, unknown_name
from ..qp.decomposition import svd
from ..robots.robot import Robot
from ..rows import Array
from ..vision.scene import Scene
from .base import Constraint, Trace, require_positive
from .by_formula import CompiledRowSpec

Part = Literal["pose", "position", "orientation"]  #: Rows of the tip's Jacobian that count.
#: Range of these rows.
ROWS_OF = {"pose": slice(0, 6), "position": slice(0, 3), "orientation": slice(3, 6)}


class Manipulability(Constraint):
    """The arm stays away from singular configurations.

    (w_min − w) / w_scale ≤ 0, where w is the product of the singular values of the tip's Jacobian,
    restricted to the directions of the ``part``: √det(J Jᵀ) (Yoshikawa), or √det(Jᵀ J) for arms
    with fewer joints than directions. Gradient and curvature are exact, ∂w/∂q_k = w tr(J⁺ ∂J/∂q_k).
    In a singular configuration the gradient is that of one side and finite. ``minimum`` is w_min,
    in products of metres and radians; ``scale`` is w_scale, w_min by default. K is the approach
    time constant [s] and ``switching_gain`` is u⁺ [1/s]. Raises ConfigurationError if w is always
    zero.
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
        self.minimum = require_positive(minimum, "minimum of manipulability")
        self.w_scale = require_positive(
            minimum if scale is None else scale, "scale of manipulability"
        )
        if part not in get_args(Part):
            raise unknown_name("part of manipulability", part, get_args(Part))
        self.robot = robot
        self.part = part
        self._rows = ROWS_OF[part]
        self._evaluate = robot.evaluator()
        rng = np.random.default_rng(0)
        samples = rng.uniform(-1.0, 1.0, (8, robot.n))
        if self._measure(samples).max() < 1e-12:
            raise ConfigurationError(
                f"manipulability of {robot.name} is zero in every configuration: its {robot.n} "
                f"joints do not move the {part} of the tip in enough directions; choose another "
                f"part ({', '.join(get_args(Part))})"
            )

    def labels(self, scene: Scene) -> tuple[str, ...]:
        """Return ``manipulability``, with the part if it is not the pose."""
        return (self.kind if self.part == "pose" else f"{self.kind}[{self.part}]",)

    def compiled_form(self, scene: Scene, points: slice) -> CompiledRowSpec | None:
        """Return the form of the row that compiled code computes from the tip's Jacobian.

        Compiled code has its own decomposition of the Jacobian.
        """
        if type(self).rows is not Constraint.rows:
            return None
        from ..compiled.manipulability_rows import manipulability_rows

        first = self._rows.start
        count = self._rows.stop - first
        parameters = self.minimum, self.w_scale, first, count
        return CompiledRowSpec(manipulability_rows, parameters=parameters)

    def clearance(self, trace: Trace, points: slice) -> Array:
        """Return (w − w_min) / w_scale."""
        return (self._measure(trace.q) - self.minimum) / self.w_scale

    def characteristic_length(self, scene: Scene) -> Array:
        """Return 1: w_scale in its own unit."""
        return np.ones(1)

    def _measure(self, q: Array) -> Array:
        """Return the product (N, 1) of the singular values at q (N, n)."""
        products = np.empty((len(q), 1))
        for i, x in enumerate(q):
            J = self._evaluate(x, np.zeros_like(x)).J[self._rows]
            _, singular_values, _ = svd(J, full_matrices=False)
            products[i] = singular_values.prod()
        return products
