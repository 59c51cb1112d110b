"""Constraints on joint coordinates and speeds: ranges and greatest speeds (sections 4.3.4 and
4.3.5), and own ones.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ..errors import ConfigurationError, shown
from ..formulas.rotation import whole_turns
from ..robots.geometry import Numbers
from ..robots.robot import Robot
from ..rows import Array
from ..vision.scene import Scene, State
from .base import Constraint, RowBlock, Trace, demand_numbers, to_first_order
from .by_formula import Form, differences_along


class RowsOfJoints(Constraint):
    """Rows on joint coordinates or speeds, by a function of them and its gradient."""

    linear: ClassVar[bool] = False
    """Whether the gradient is the same everywhere: then the rows are compiled."""
    _compiled: ClassVar[tuple[str, str]]  #: The compiled rows, and the method that gives the value.

    @abstractmethod
    def gradient(self, y: Array) -> Array:
        """(..., r, n) gradient at y (..., n)."""

    @abstractmethod
    def characteristic_length(self, scene: Scene) -> Array:
        """(r,) half the allowed range of each row."""

    def compiled_form(self, scene: Scene, points: slice) -> Form | None:
        """Rows that say that they are linear, as they are at rest."""
        rows, value = self._compiled
        if not (self.linear and self.says("linear", (value, "gradient", "curvature", "rows"))):
            return None
        rest = np.zeros(scene.robot.n)
        return Form(rows, gradients=self.gradient(rest), offsets=getattr(self, value)(rest))


class JointConstraint(RowsOfJoints):
    """Constraints on joint coordinates y = q (n,): r values of one vector.

    An own one gives ``kind``, :meth:`labels`, :meth:`sigma`, :meth:`gradient` and
    :meth:`characteristic_length`.
    """

    unit = "rad"
    _compiled = "joint_rows", "sigma"

    @abstractmethod
    def sigma(self, q: Array) -> Array:
        """(..., r) σ at q (..., n): positive where forbidden."""

    def curvature(self, q: Array, qd: Array) -> Array:
        """(r,) q̇ᵀ H q̇ for each row; by central differences of the gradient unless a subclass
        knows it.
        """
        return differences_along(self.gradient, q, qd, 1e-6)

    def rows(self, state: State, points: slice) -> RowBlock:
        """Joint coordinates need no chain rule (eqs. 26 and 37)."""
        q = state.robot.q
        qd = state.robot.qd
        g = self.gradient(q)
        return self.block(self.sigma(q), g @ qd, g, self.curvature(q, qd))

    def clearance(self, trace: Trace, points: slice) -> Array:
        """−σ / ‖∂σ/∂q‖: exact for linear rows, to first order elsewhere [rad]."""
        return to_first_order(self.sigma(trace.q), self.gradient(trace.q))


class SpeedConstraint(RowsOfJoints):
    """Constraints on joint speeds y = q̇ (n,), which have relative degree one as they are: φ(q̇) ≤
    0.

    An own one gives ``kind``, :meth:`labels`, :meth:`phi`, :meth:`gradient` and
    :meth:`characteristic_length`.
    """

    unit = "rad/s"
    _compiled = "speed_rows", "phi"

    def __init__(self, *, switching_gain: float) -> None:
        super().__init__(K=1.0, switching_gain=switching_gain)

    @abstractmethod
    def phi(self, qd: Array) -> Array:
        """(..., r) φ at q̇ (..., n): positive where forbidden."""

    def rows(self, state: State, points: slice) -> RowBlock:
        """L_gφ = ∂φ/∂q̇ (eq. 38) and L_fφ = 0 (eq. 34)."""
        qd = state.robot.qd
        phi = self.phi(qd)
        return RowBlock(phi, phi, self.gradient(qd), np.zeros_like(phi))

    def clearance(self, trace: Trace, points: slice) -> Array:
        """−φ / ‖∂φ/∂q̇‖: exact for linear rows, to first order elsewhere [rad/s]."""
        return to_first_order(self.phi(trace.qd), self.gradient(trace.qd))

    def sampling_band(self, scene: Scene, Ts: float) -> Array:
        """T_s u⁺ / ‖∂φ/∂q̇‖, of the gradient at rest: φ is the clearance itself, and (43) lets it
        switch by T_s u⁺.
        """
        g = self.gradient(np.zeros(scene.robot.n))
        length = np.sqrt((g * g).sum(axis=-1))
        band: Array = np.divide(
            Ts * self.switching_gain, length, out=np.zeros(len(g)), where=length > 0.0
        )
        return band


class OfJoints:
    """Rows on single joints, ``joints`` by their numbers: one for each upper side, then one for
    each lower side.
    """

    kind: ClassVar[str]
    unit: ClassVar[str]
    prismatic_unit: ClassVar[str]

    def _select(
        self,
        robot: Robot,
        joints: Sequence[int] | None,
        margin: float,
        lower: tuple[ArrayLike | None, Array],
        upper: tuple[ArrayLike | None, Array],
    ) -> None:
        """Keep the joints concerned with their finite limits, given ones (first) or the robot's
        (second).
        """
        if joints is None:
            given = lower[0] is not None or upper[0] is not None
            limited = np.isfinite(lower[1]) & np.isfinite(upper[1])
            numbers = (
                tuple(range(1, robot.n + 1))
                if given
                else tuple(int(i) + 1 for i in np.flatnonzero(limited))
            )
        else:
            numbers = demand_numbers(joints, f"joints of {self.kind}")
            if max(numbers) > robot.n:
                raise ConfigurationError(
                    f"joints of {self.kind} are numbers from 1 to {robot.n}, not {list(numbers)}"
                )
        if not numbers:
            raise ConfigurationError(
                f"{robot.name} has no limits for {self.kind}: give lower and upper"
            )
        self.joints = numbers
        self._at = np.array(numbers) - 1
        limits = []
        for side, (own, robots) in (("lower", lower), ("upper", upper)):
            limit = robots[self._at] if own is None else limit_array(own, f"{side} of {self.kind}")
            if limit.shape != (len(numbers),) or not np.isfinite(limit).all():
                raise ConfigurationError(
                    f"{side} of {self.kind} must be a finite number for each of the joints "
                    f"{list(numbers)}, not {limit}"
                )
            limits.append(limit)
        self.lower, self.upper = limits
        empty = [
            f"joint {number} ({robot.joint_names[number - 1]}) has [{low:g}, {high:g}]"
            for number, low, high in zip(numbers, self.lower, self.upper, strict=True)
            if low >= high
        ]
        if empty:
            raise ConfigurationError(
                f"lower of {self.kind} must be below upper: {'; '.join(empty)}. Lock a joint that "
                f"does not move, or "
                "leave it out by joints = […]"
            )
        if not 0.0 <= margin < 1.0:
            raise ConfigurationError(f"margin of {self.kind} must be in [0, 1), not {margin}")
        self.margin = float(margin)

    def _keep(self, n: int, mid: Array | float, upper: Array, lower: Array) -> None:
        """Keep from where, and by what, coordinates or speeds count in the upper and in the lower
        rows.
        """
        self.mid = mid
        self._by = (upper, lower)
        chosen = np.eye(n, dtype=np.bool_)[self._at]
        self._gradient: Array = np.concatenate(
            [np.where(chosen, (1.0 / size)[:, None], 0.0) for size in self._by]
        )

    def _value(self, y: Array) -> Array:
        x = y[..., self._at] - self.mid
        return np.concatenate([x / size for size in self._by], axis=-1) - (1.0 - self.margin)

    def characteristic_length(self, scene: Scene) -> Array:
        """Half the allowed range, or the allowed speed, of each row."""
        length: Array = np.abs(np.concatenate(self._by)) * (1.0 - self.margin)
        return length

    def labels(self, scene: Scene) -> tuple[str, ...]:
        """All upper rows, then all lower ones."""
        return tuple(
            f"{self.kind}[joint {i}].{side}" for side in ("upper", "lower") for i in self.joints
        )

    def units(self, scene: Scene) -> tuple[str, ...]:
        """Those of revolute or of prismatic joints."""
        return (
            tuple(self.prismatic_unit if scene.robot.prismatic[i] else self.unit for i in self._at)
            * 2
        )

    def gradient(self, y: Array) -> Array:
        """The same everywhere."""
        return self._gradient


class JointRange(OfJoints, JointConstraint):
    """Joints stay in their ranges, the robot's or given ones.

    ±q̃_i − 1 + margin ≤ 0 with q̃_i = (q_i − mid) / half the range (eqs. 25 to 27), one row for
    each side. The paper writes one row with |q̃_i|, which has a kink at the middle; two linear rows
    are the same where it matters.

    Of a joint that turns without end (:attr:`.Robot.continuous`), q_i counts in the turn nearest to
    the middle of its range, unless the range is a whole turn or more, as one that a cable sets.

    ``joints`` are the numbers of those concerned, counted from 1, all that have a range if None;
    ``lower`` and ``upper`` their ranges [rad or m] instead of the robot's, ``margin`` is a fraction
    of half the range. K is the approach time constant [s], ``switching_gain`` u⁺ [1/s].
    """

    kind = "range"
    linear = True
    prismatic_unit = "m"

    def __init__(
        self,
        robot: Robot,
        *,
        K: float,
        switching_gain: float,
        joints: Sequence[int] | None = None,
        lower: Numbers | None = None,
        upper: Numbers | None = None,
        margin: float = 0.0,
    ) -> None:
        super().__init__(K=K, switching_gain=switching_gain)
        self._select(robot, joints, margin, (lower, robot.q_min), (upper, robot.q_max))
        half = 0.5 * (self.upper - self.lower)
        self._keep(robot.n, 0.5 * (self.lower + self.upper), half, -half)
        #: (n,) middles of ranges on the circle; NaN for joints that have none.
        self._middles = np.full(robot.n, np.nan)
        self._middles[self._at] = np.where(
            robot.continuous[self._at] & (half < np.pi), self.mid, np.nan
        )

    def sigma(self, q: Array) -> Array:
        """Eq. (25), one row for each side."""
        on_circle = np.isfinite(self._middles)
        return self._value(q - whole_turns(np.where(on_circle, q - self._middles, 0.0)))

    def compiled_form(self, scene: Scene, points: slice) -> Form | None:
        """Linear rows, of joints that turn without end from the middle of their range."""
        form = super().compiled_form(scene, points)
        if form is None:
            return None
        # σ at zero counts in another turn where that is nearer to the middle
        return form._replace(
            offsets=self._value(np.zeros(scene.robot.n)),
            middles=np.tile(self._middles[self._at], 2),
        )


class JointSpeed(OfJoints, SpeedConstraint):
    """Joints stay below their speeds, the robot's or given ones.

    q̇_i/q̇_max,i − 1 + margin ≤ 0 and q̇_i/q̇_min,i − 1 + margin ≤ 0 (eqs. 28 and 29, split as
    footnote 4 says). The arguments are those of :class:`JointRange`, with speeds, lower < 0 <
    upper, in place of ranges [rad/s or m/s].
    """

    kind = "speed"
    linear = True
    prismatic_unit = "m/s"

    def __init__(
        self,
        robot: Robot,
        *,
        switching_gain: float,
        joints: Sequence[int] | None = None,
        lower: Numbers | None = None,
        upper: Numbers | None = None,
        margin: float = 0.0,
    ) -> None:
        super().__init__(switching_gain=switching_gain)
        given = (
            -limit_array(upper, "upper of speed") if lower is None and upper is not None else lower
        )
        self._select(robot, joints, margin, (given, robot.qd_min), (upper, robot.qd_max))
        if (self.lower >= 0.0).any() or (self.upper <= 0.0).any():
            raise ConfigurationError(
                f"speed limits must be lower < 0 < upper, not {self.lower} and {self.upper}"
            )
        self._keep(robot.n, 0.0, self.upper, self.lower)

    def phi(self, qd: Array) -> Array:
        """Eq. (28), one row for each side."""
        return self._value(qd)


def limit_array(value: ArrayLike, what: str) -> Array:
    """``value`` as a float array; raises ConfigurationError that names ``what`` if it is none."""
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ConfigurationError(f"{what} must be numbers, not {shown(value)}") from None
