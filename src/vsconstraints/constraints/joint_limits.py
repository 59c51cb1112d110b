"""Constraints on joint coordinates and speeds: ranges and speed limits, and custom ones.

See sections 4.3.4 and 4.3.5.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..errors import ConfigurationError, format_value
from ..formulas.rotation import whole_turns
from ..robots.geometry import Numbers
from ..robots.robot import Robot
from ..rows import Array
from ..vision.scene import Scene, State
from .base import Constraint, RowBlock, Trace, require_numbers, to_first_order
from .by_formula import CompiledRowSpec, differences_along


class RowsOfJoints(Constraint):
    """Rows on joint coordinates or speeds, given by a function of them and its gradient."""

    linear: ClassVar[bool] = False
    """True if the gradient is constant; the rows are then compiled."""

    @abstractmethod
    def gradient(self, y: Array) -> Array:
        """Return the gradient (..., r, n) at y (..., n)."""

    @abstractmethod
    def characteristic_length(self, scene: Scene) -> Array:
        """Return half of the allowed range (r,) of each row."""

    def is_linear(self, value: str) -> bool:
        """True if the rows are declared linear, with values from the method of that name."""
        return self.linear and self.declares("linear", (value, "gradient", "curvature", "rows"))


class JointConstraint(RowsOfJoints):
    """Constraint on joint coordinates y = q (n,): r values of one vector.

    A custom constraint defines ``kind``, :meth:`labels`, :meth:`sigma`, :meth:`gradient` and
    :meth:`characteristic_length`.
    """

    unit = "rad"

    @abstractmethod
    def sigma(self, q: Array) -> Array:
        """Return σ (..., r) at q (..., n): positive where forbidden."""

    def curvature(self, q: Array, qd: Array) -> Array:
        """Return q̇ᵀ H q̇ (r,) for each row.

        It is computed by central differences of the gradient, unless a subclass overrides it.
        """
        return differences_along(self.gradient, q, qd, 1e-6)

    def rows(self, state: State, points: slice) -> RowBlock:
        """Return the rows; joint coordinates need no chain rule (eqs. 26 and 37)."""
        q = state.robot.q
        qd = state.robot.qd
        g = self.gradient(q)
        sigma_dot = g @ qd
        return self.block(self.sigma(q), sigma_dot, g, self.curvature(q, qd))

    def compiled_form(self, scene: Scene, points: slice) -> CompiledRowSpec | None:
        """Return the compiled form of rows that are declared linear, from σ at q = 0."""
        if not self.is_linear("sigma"):
            return None
        from ..compiled.constraint_rows import joint_rows

        zero = np.zeros(scene.robot.n)
        gradients = self.gradient(zero)
        return CompiledRowSpec(joint_rows, gradients=gradients, offsets=self.sigma(zero))

    def clearance(self, trace: Trace, points: slice) -> Array:
        """Return −σ / ‖∂σ/∂q‖ [rad]: exact for linear rows, of first order elsewhere."""
        return to_first_order(self.sigma(trace.q), self.gradient(trace.q))


class SpeedConstraint(RowsOfJoints):
    """Constraint φ(q̇) ≤ 0 on joint speeds y = q̇ (n,), which has relative degree one.

    A custom constraint defines ``kind``, :meth:`labels`, :meth:`phi`, :meth:`gradient` and
    :meth:`characteristic_length`.
    """

    unit = "rad/s"

    def __init__(self, *, switching_gain: float) -> None:
        super().__init__(K=1.0, switching_gain=switching_gain)

    @abstractmethod
    def phi(self, qd: Array) -> Array:
        """Return φ (..., r) at q̇ (..., n): positive where forbidden."""

    def rows(self, state: State, points: slice) -> RowBlock:
        """Return the rows, with L_gφ = ∂φ/∂q̇ (eq. 38) and L_fφ = 0 (eq. 34)."""
        qd = state.robot.qd
        phi = self.phi(qd)
        no_drift = np.zeros_like(phi)
        return RowBlock(phi, phi, self.gradient(qd), no_drift)

    def compiled_form(self, scene: Scene, points: slice) -> CompiledRowSpec | None:
        """Return the compiled form of rows that are declared linear, from φ at rest."""
        if not self.is_linear("phi"):
            return None
        from ..compiled.constraint_rows import speed_rows

        rest = np.zeros(scene.robot.n)
        gradients = self.gradient(rest)
        return CompiledRowSpec(speed_rows, gradients=gradients, offsets=self.phi(rest))

    def clearance(self, trace: Trace, points: slice) -> Array:
        """Return −φ / ‖∂φ/∂q̇‖ [rad/s]: exact for linear rows, of first order elsewhere."""
        return to_first_order(self.phi(trace.qd), self.gradient(trace.qd))

    def sampling_band(self, scene: Scene, Ts: float) -> Array:
        """Return T_s u⁺ / ‖∂φ/∂q̇‖, with the gradient at rest.

        φ itself is the clearance, and eq. (43) allows it to switch by T_s u⁺.
        """
        rest = np.zeros(scene.robot.n)
        slope = np.linalg.norm(self.gradient(rest), axis=-1)
        band = np.zeros(len(slope))
        np.divide(Ts * self.switching_gain, slope, out=band, where=slope > 0.0)
        return band


class _Limits(NamedTuple):
    """Limits on one side: the given ones, which take precedence, and the robot's (n,)."""

    given: ArrayLike | None
    of_robot: Array


class JointLimitRows:
    """Rows on single joints: one for each upper limit, then one for each lower limit.

    ``joints`` are the numbers of the joints.
    """

    kind: ClassVar[str]
    unit: ClassVar[str]
    prismatic_unit: ClassVar[str]

    def _select(
        self, robot: Robot, joints: Sequence[int] | None, lower: _Limits, upper: _Limits
    ) -> None:
        """Store the joints concerned with their finite limits."""
        self.joints = self._selected_joints(robot, joints, lower, upper)
        self._indices = np.array(self.joints) - 1
        self.lower = self._finite_limits("lower", lower)
        self.upper = self._finite_limits("upper", upper)
        empty = []
        limits = zip(self.joints, self.lower, self.upper, strict=True)
        for number, low, high in limits:
            if low >= high:
                name = robot.joint_names[number - 1]
                empty.append(f"joint {number} ({name}) has [{low:g}, {high:g}]")
        if empty:
            raise ConfigurationError(
                f"lower of {self.kind} must be below upper: {'; '.join(empty)}. Lock a joint that "
                "does not move, or leave it out by joints = […]"
            )

    def _selected_joints(
        self, robot: Robot, joints: Sequence[int] | None, lower: _Limits, upper: _Limits
    ) -> tuple[int, ...]:
        """Return the numbers of the joints concerned.

        By default they are all joints if limits are given, otherwise all that have limits.
        """
        if joints is not None:
            numbers = require_numbers(joints, f"joints of {self.kind}")
            if max(numbers) > robot.n:
                raise ConfigurationError(
                    f"joints of {self.kind} are numbers from 1 to {robot.n}, not {list(numbers)}"
                )
            return numbers
        if lower.given is not None or upper.given is not None:
            return tuple(range(1, robot.n + 1))
        has_lower = np.isfinite(lower.of_robot)
        has_upper = np.isfinite(upper.of_robot)
        limited = np.flatnonzero(has_lower & has_upper)
        if not len(limited):
            raise ConfigurationError(
                f"{robot.name} has no limits for {self.kind}: give lower and upper"
            )
        return tuple(int(i) + 1 for i in limited)

    def _finite_limits(self, side: str, limits: _Limits) -> Array:
        """Return the limits (k,) of the joints concerned; ConfigurationError unless all finite."""
        values: Array
        if limits.given is None:
            values = limits.of_robot[self._indices]
        else:
            values = limit_array(limits.given, f"{side} of {self.kind}")
        has_shape = values.shape == (len(self.joints),)
        if not (has_shape and np.isfinite(values).all()):
            raise ConfigurationError(
                f"{side} of {self.kind} must be a finite number for each of the joints "
                f"{list(self.joints)}, not {values}"
            )
        return values

    def _set_rows(
        self, n: int, mid: Array | float, upper: Array, lower: Array, margin: float
    ) -> None:
        """Set the rows (y − mid)/upper and (y − mid)/lower, less 1 − margin.

        y (n,) are coordinates or speeds of all joints; ``lower`` is negative.
        """
        if not 0.0 <= margin < 1.0:
            raise ConfigurationError(f"margin of {self.kind} must be in [0, 1), not {margin}")
        self.margin = float(margin)
        self.mid = mid
        self._divisors = (upper, lower)
        is_own_joint = np.eye(n, dtype=np.bool_)[self._indices]
        gradients = []
        for divisor in self._divisors:
            slope = 1.0 / divisor
            gradients.append(np.where(is_own_joint, slope[:, None], 0.0))
        self._gradient: Array = np.concatenate(gradients)

    def _value(self, y: Array) -> Array:
        """Return the values (..., r) of the rows at y (..., n)."""
        offset = y[..., self._indices] - self.mid
        shares = [offset / divisor for divisor in self._divisors]
        share = np.concatenate(shares, axis=-1)
        return share - (1.0 - self.margin)

    def characteristic_length(self, scene: Scene) -> Array:
        """Return half the allowed range, or the allowed speed, of each row."""
        divisors = np.concatenate(self._divisors)
        length: Array = np.abs(divisors) * (1.0 - self.margin)
        return length

    def labels(self, scene: Scene) -> tuple[str, ...]:
        """Return the labels of all upper rows, then of all lower ones."""
        upper = [f"{self.kind}[joint {i}].upper" for i in self.joints]
        lower = [f"{self.kind}[joint {i}].lower" for i in self.joints]
        return (*upper, *lower)

    def units(self, scene: Scene) -> tuple[str, ...]:
        """Return the units of revolute or prismatic joints."""
        prismatic = scene.robot.prismatic
        units = [self.prismatic_unit if prismatic[i] else self.unit for i in self._indices]
        return (*units, *units)

    def gradient(self, y: Array) -> Array:
        """Return the gradient, which is constant."""
        return self._gradient


class JointRange(JointLimitRows, JointConstraint):
    """Joints stay in their ranges, those of the robot or given ones.

    ±q̃_i − 1 + margin ≤ 0 with q̃_i = (q_i − mid) / half the range (eqs. 25 to 27), one row for
    each side. The paper uses one row with |q̃_i|, which has a kink at the middle; two linear rows
    are equivalent near the limits.

    For a continuous joint (:attr:`.Robot.continuous`), q_i is taken in the turn nearest to the
    middle of its range. An exception is a range of a whole turn or more, such as one that a cable
    imposes.

    ``joints`` are the numbers of the joints concerned, counted from 1, all that have a range if
    None. ``lower`` and ``upper`` replace the robot's ranges [rad or m]; ``margin`` is a fraction of
    half the range. K is the approach time constant [s] and ``switching_gain`` is u⁺ [1/s].
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
        lower_limits = _Limits(lower, robot.q_min)
        upper_limits = _Limits(upper, robot.q_max)
        self._select(robot, joints, lower_limits, upper_limits)
        half = 0.5 * (self.upper - self.lower)
        mid = 0.5 * (self.lower + self.upper)
        self._set_rows(robot.n, mid, half, -half, margin)
        #: (n,) middles of ranges on the circle; NaN for joints without such a range.
        self._middles = np.full(robot.n, np.nan)
        on_circle = robot.continuous[self._indices] & (half < np.pi)
        self._middles[self._indices] = np.where(on_circle, mid, np.nan)

    def sigma(self, q: Array) -> Array:
        """Return σ of eq. (25), one row for each side."""
        on_circle = np.isfinite(self._middles)
        from_middle = np.where(on_circle, q - self._middles, 0.0)
        turns = whole_turns(from_middle)
        return self._value(q - turns)

    def compiled_form(self, scene: Scene, points: slice) -> CompiledRowSpec | None:
        """Return linear rows; continuous joints are counted from the middle of their range."""
        form = super().compiled_form(scene, points)
        if form is None:
            return None
        # σ at q = 0 would use the turn nearest to the middle, so the offset is computed without it
        offsets = self._value(np.zeros(scene.robot.n))
        middles = np.tile(self._middles[self._indices], 2)
        return form._replace(offsets=offsets, middles=middles)


class JointSpeed(JointLimitRows, SpeedConstraint):
    """Joints stay below their speed limits, those of the robot or given ones.

    q̇_i/q̇_max,i − 1 + margin ≤ 0 and q̇_i/q̇_min,i − 1 + margin ≤ 0 (eqs. 28 and 29, split
    according to footnote 4). The arguments are those of :class:`JointRange`, with speeds lower < 0
    < upper instead of ranges [rad/s or m/s].
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
        least: ArrayLike | None = lower
        if lower is None and upper is not None:
            least = -limit_array(upper, "upper of speed")
        lower_limits = _Limits(least, robot.qd_min)
        upper_limits = _Limits(upper, robot.qd_max)
        self._select(robot, joints, lower_limits, upper_limits)
        if (self.lower >= 0.0).any() or (self.upper <= 0.0).any():
            raise ConfigurationError(
                f"speed limits must be lower < 0 < upper, not {self.lower} and {self.upper}"
            )
        self._set_rows(robot.n, 0.0, self.upper, self.lower, margin)

    def phi(self, qd: Array) -> Array:
        """Return φ of eq. (28), one row for each side."""
        return self._value(qd)


def limit_array(value: ArrayLike, what: str) -> Array:
    """Return ``value`` as a float array; raise ConfigurationError if it is not one.

    The message names ``what``.
    """
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ConfigurationError(f"{what} must be numbers, not {format_value(value)}") from None
