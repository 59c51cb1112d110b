"""The arm stays away from singular configurations: section 4.3.6.

Singular values are LAPACK's; :mod:`.manipulability_rows`, where it cannot be called, finds them by
rotations. ``test_arms_of_every_shape`` in ``tests/test_compiled_manipulability.py`` holds the pair together.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from ..errors import ConfigurationError, unknown_name
from ..formulas.manipulability import SINGULAR
from ..qp.decomposition import svd
from ..robots.geometry import skew
from ..robots.robot import Robot
from ..rows import Array
from ..vision.scene import Scene, State
from .base import Constraint, RowBlock, Trace, demand_positive
from .form import Form

Part = Literal["pose", "position", "orientation"]
"""Which rows of the tip's Jacobian count."""

ROWS_OF = {"pose": slice(0, 6), "position": slice(0, 3), "orientation": slice(3, 6)}
"""Which these are."""


class Manipulability(Constraint):
    """The arm stays away from singular configurations.

    (w_min − w) / w_scale ≤ 0 with w the product of the singular values of the tip's Jacobian.

    w = √det(J Jᵀ) (Yoshikawa's measure), or √det(Jᵀ J) for arms with fewer joints than directions. Unlike the
    smallest singular value, which has a kink wherever two of them cross, it is smooth wherever it is not zero, and it
    does not depend on the axes J is expressed in. Its gradient and curvature are exact:

        ∂w/∂q_k = w tr(J⁺ ∂J/∂q_k),   ∂J_j/∂q_k = −[J_k, J_j] for k > j in the tip's frame, zero otherwise.

    In a singular configuration, where w has a kink, the gradient is one of its two sides, finite.

    Parameters
    ----------
    robot
        The arm.
    minimum
        w_min, in the units of w: products of metres and radians.
    K, switching_gain
        Approach time constant [s] and u⁺ [1/s].
    scale
        w_scale; w_min if not given, so that σ is 1 in a singular configuration.
    part
        Directions of the tip that count: ``"pose"``, ``"position"`` or ``"orientation"``.

    Raises
    ------
    ConfigurationError
        if the arm can never move its tip in as many directions, so that w is always zero.
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
        demand_positive(minimum, "minimum of manipulability")
        demand_positive(minimum if scale is None else scale, "scale of manipulability")
        if part not in get_args(Part):
            raise unknown_name("part of manipulability", part, get_args(Part))
        self.robot, self.part = robot, part
        self.minimum, self.w_scale = float(minimum), float(minimum if scale is None else scale)
        self._rows, self._evaluate = ROWS_OF[part], robot.evaluator()
        rng = np.random.default_rng(0)
        if max(measure(self._jacobian(q)) for q in rng.uniform(-1.0, 1.0, (8, robot.n))) < 1e-12:
            raise ConfigurationError(
                f"manipulability of {robot.name} is zero in every configuration: its {robot.n} joints do not move "
                f"the {part} of the tip in enough directions; choose another part ({', '.join(get_args(Part))})"
            )

    def labels(self, scene: Scene) -> tuple[str, ...]:
        """``manipulability``, and the part if it is not the pose."""
        return (self.kind if self.part == "pose" else f"{self.kind}[{self.part}]",)

    def gradient(self, J: Array) -> Array:
        """(n,) ∂w/∂q from the tip's Jacobian J (6, n) in the tip's frame."""
        weighted = weighted_inverse(J[self._rows])
        change = jacobian_derivatives(J)[:, self._rows]
        gradient: Array = change.reshape(len(change), -1) @ weighted.T.ravel()
        return gradient

    def curvature(self, J: Array, qd: Array) -> Array:
        """() q̇ᵀ (∂²w/∂q²) q̇, from the first two derivatives of log det along q̇."""
        J_dot, J_ddot = jacobian_rates(J, qd)
        A, B, C = J[self._rows], J_dot[self._rows], J_ddot[self._rows]
        if A.shape[0] > A.shape[1]:
            A, B, C = A.T, B.T, C.T
        U, s, _ = svd(A, full_matrices=False)
        s = np.maximum(s, SINGULAR)
        # X = G⁻¹ Ġ and tr(G⁻¹ G̈) for G = A Aᵀ
        inverse = (U / s**2) @ U.T
        X = inverse @ (B @ A.T + A @ B.T)
        second = 2.0 * np.trace(inverse @ (C @ A.T + B @ B.T))
        rate = 0.5 * np.trace(X)
        curvature: Array = s.prod() * (rate**2 + 0.5 * (second - (X * X.T).sum()))
        return curvature

    def rows(self, state: State, points: slice) -> RowBlock:
        """One row, from the tip's Jacobian."""
        J, qd = state.robot.J, state.robot.qd
        factor = -1.0 / self.w_scale
        sigma = np.array([(self.minimum - measure(J[self._rows])) / self.w_scale])
        g = factor * self.gradient(J)[None, :]
        return self.block(sigma, g @ qd, g, factor * self.curvature(J, qd))

    def compiled_form(self, scene: Scene, points: slice) -> Form | None:
        """The row that compiled code makes from the tip's Jacobian, by a decomposition of its own."""
        directions = range(6)[self._rows]
        numbers = self.minimum, self.w_scale, directions.start, len(directions)
        return Form("manipulability_rows", parameters=numbers) if type(self) is Manipulability else None

    def clearance(self, trace: Trace, points: slice) -> Array:
        """(w − w_min) / w_scale."""
        w = np.array([measure(self._jacobian(q)) for q in trace.q]).reshape(-1, 1)
        return (w - self.minimum) / self.w_scale

    def characteristic_length(self, scene: Scene) -> Array:
        """1: w_scale in units of itself."""
        return np.ones(1)

    def _jacobian(self, q: Array) -> Array:
        return self._evaluate(q, np.zeros_like(q)).J[self._rows]


def measure(J: Array) -> float:
    """Product of the singular values of J (r, n)."""
    return float(svd(J, full_matrices=False)[1].prod())


def weighted_inverse(J: Array) -> Array:
    """(n, r) w J⁺ with w the product of the singular values: finite also where one of them is zero."""
    U, s, Vt = svd(J, full_matrices=False)
    others = np.where(np.eye(len(s), dtype=np.bool_), 1.0, s).prod(axis=1)
    weighted: Array = (Vt.T * others) @ U.T
    return weighted


def _structure() -> Array:
    """(6, 36) C with (a C) as a 6 × 6 matrix times b being [a, b] = (ω_a × v_b + v_a × ω_b, ω_a × ω_b)."""
    C = np.zeros((6, 6, 6))
    turns = skew(np.eye(3))
    C[:3, :3, 3:] = turns
    C[3:, :3, :3] = C[3:, 3:, 3:] = turns
    return C.reshape(6, 36)


_STRUCTURE = _structure()


def adjoints(twists: Array) -> Array:
    """(k, 6, 6) matrices of [a, ·] for twists a = (v, ω) (k, 6)."""
    matrices: Array = (twists @ _STRUCTURE).reshape(-1, 6, 6)
    return matrices


def jacobian_derivatives(J: Array) -> Array:
    """(n, 6, n) ∂J/∂q_k of a serial arm's tip Jacobian J (6, n) in the tip's frame, k first."""
    # a joint moves the columns of those before it, as seen from the tip
    n = J.shape[1]
    before = np.arange(n) < np.arange(n)[:, None]
    change: Array = (adjoints(J.T) @ -J) * before[:, None, :]
    return change


def jacobian_rates(J: Array, qd: Array) -> tuple[Array, Array]:
    """(6, n) J̇ and J̈ when q̈ = 0, for J as in :func:`jacobian_derivatives`."""
    columns = J.T
    turning = adjoints(_sum_after(columns * qd[:, None]))
    first = -(turning @ columns[:, :, None])[..., 0]
    turning_dot = adjoints(_sum_after(first * qd[:, None]))
    second = -(turning_dot @ columns[:, :, None] + turning @ first[:, :, None])[..., 0]
    return first.T, second.T


def _sum_after(twists: Array) -> Array:
    """(n, 6) what the joints after each one add to the tip's twist."""
    after: Array = twists[::-1].cumsum(axis=0)[::-1] - twists
    return after
