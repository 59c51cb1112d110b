"""Reference tracking of section 4.4: the terms of the equality J_s q̈ = b of level 2."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..errors import ConfigurationError, InvalidInput, format_value, unknown_name
from ..formulas.tracking import gains, goal_at
from ..rows import Array
from ..rows.readable import amount, counted, in_one_line
from .features import Feature, Goal

DERIVATIVES = ("exact", "differences")
Derivative = Literal["exact", "differences"]


@dataclass(frozen=True, slots=True)
class TrackingGains:
    """Gains K_T,p and K_T,v of eq. (42), which decay exponentially with the error.

    K_p(‖e‖) = K_p(0) exp(−Kp_slope/K_p(0) ‖e‖₂) has the value K_p(0) and the slope −``Kp_slope`` at
    zero error and vanishes at infinity. K_v = ``damping`` √K_p.
    """

    Kp0: float  #: Gain at zero error [1/s²].
    Kp_slope: float = 0.0  #: Decrease per error norm at zero error [1/s² per unit of the error].
    damping: float = 3.0  #: K_v / √K_p: 2 is critically damped, 3 is the paper's.

    def __post_init__(self) -> None:
        for name, least in (("Kp0", 1e-300), ("Kp_slope", 0.0), ("damping", 0.0)):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= least):
                raise InvalidInput(
                    f"tracking gain {name} must be {'positive' if least else 'zero or more'}, not "
                    f"{value}"
                )

    def at(self, error: Array) -> tuple[float, float]:
        """Return K_p and K_v at an error (k,)."""
        return gains(float(error @ error), self.Kp0, self.Kp_slope, self.damping)


@dataclass(frozen=True, slots=True)
class Rest:
    """Rest acceleration q̈₀ = −d q̇ + (d/2)² (q_posture − q), where task and rows leave freedom.

    Without it, a redundant arm keeps moving after the camera has reached its goal.
    """

    damping: float = 5.0  #: d [1/s]; 0 for q̈₀ = 0.
    #: (n,) q_posture [rad or m], approached with critical damping; none if empty.
    posture: Sequence[float] = ()

    def __post_init__(self) -> None:
        if not (np.isfinite(self.damping) and self.damping >= 0.0):
            raise InvalidInput(f"the damping of rest must be zero or more, not {self.damping}")
        if not np.isfinite(np.asarray(self.posture, dtype=np.float64)).all():
            raise InvalidInput(
                f"the posture of rest must be finite numbers, not {format_value(self.posture)}"
            )
        if len(self.posture) and self.damping == 0.0:
            raise ConfigurationError("rest.posture needs rest.damping above zero")

    @property
    def any(self) -> bool:
        """True if q̈₀ can be nonzero."""
        return self.damping > 0.0

    @property
    def stiffness(self) -> float:
        """(d/2)² [1/s²]; 0 without a posture."""
        return 0.25 * self.damping**2 if len(self.posture) else 0.0


#: Default rest acceleration of arms with more joints than the task needs, and of other arms.
DAMPED = Rest()
FREE = Rest(damping=0.0)


class VisualTask:
    """Task that tracks a visual feature towards goals at given times, evaluated by compiled code.

    b = s̈_ref − K_p e − K_v ė − J̇_s q̇ − ∂ṡ/∂t with e = s − s_ref (eqs. 41 and 42). s_ref is the
    goal itself, or follows the goal's reference trajectory. ∂s/∂t, in ė and in the last term, is
    nonzero for a target whose motion is known (section 5.4).

    Goals are in the order of their times; the first holds from the start. J̇_s q̇, ṡ, and ṡ_ref
    with s̈_ref are computed from the kinematics (``"exact"``) or from ``"differences"`` between
    samples (``drift``, ``velocity`` and ``reference``: lines 5, 2, 3 and 4 of Appendix B).
    Differences restart at the first sample and when the goal changes; those of the reference
    restart at zero. ``rest`` is the rest acceleration; None selects that of :meth:`rest_of`.
    """

    def __init__(
        self,
        feature: Feature,
        goals: Sequence[Goal],
        gains: TrackingGains,
        drift: Derivative = "exact",
        velocity: Derivative = "exact",
        reference: Derivative = "exact",
        rest: Rest | None = None,
    ) -> None:
        for name, value in (("drift", drift), ("velocity", velocity), ("reference", reference)):
            if value not in DERIVATIVES:
                raise unknown_name(name, value, DERIVATIVES)
        if not goals:
            raise ConfigurationError("a task needs at least one goal")
        self._times = times = [goal.from_time for goal in goals]
        if times != sorted(times) or len(set(times)) < len(times):
            raise ConfigurationError(
                f"goals must be in the order of their times; from_time is {format_value(times)}"
            )
        for goal in goals:
            feature.check_goal(goal)
        self.feature = feature
        self.goals = tuple(goals)
        self.gains = gains
        self.drift = drift
        self.velocity = velocity
        self.reference = reference
        self.rest = rest

    @in_one_line
    def __repr__(self) -> str:
        gains = f"K_p(0) = {amount(self.gains.Kp0)} per s², damping {amount(self.gains.damping)}"
        return f"<VisualTask {self.feature.name}: {counted(len(self.goals), 'goal')}, {gains}>"

    def goal_at(self, t: float) -> int:
        """Return the index of the goal that holds at time t [s], up to rounding."""
        return goal_at(self._times, t)

    def rest_of(self, n: int, k: int) -> Rest:
        """Return the rest acceleration of n joints with k features.

        Unless ``rest`` is given, it is damping if there are more joints than the task needs, and
        zero otherwise. A feature of a rigid target needs at most six joints. Raises
        ConfigurationError if the posture has another number of joints.
        """
        if self.rest is None:
            return DAMPED if n > min(k, 6) else FREE
        if len(self.rest.posture) not in (0, n):
            raise ConfigurationError(
                f"rest.posture has {len(self.rest.posture)} values; the robot has {n} joints"
            )
        return self.rest
