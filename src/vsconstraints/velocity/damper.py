"""Law ``velocity-damper``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from ..controllers.ranges import Declared, Range, positive_number, share_number
from ..controllers.velocity_controller import VelocityController
from ..errors import ConfigurationError
from ..formulas.velocity import damped_bound, rate_factor
from ..rows import Array, Rows, Task
from .quadratic import VelocityQP


class VelocityDamper(VelocityQP):
    """Velocity dampers: near a boundary, the speed towards it falls linearly with the distance.

    Rows at a distance d = −σ below the influence distance d_i demand ḋ ≥ −ξ (d − d_s)/(d_i − d_s),
    so that d never falls below the security distance d_s; the others demand nothing. Distances
    count in scales of the rows. Bounds of speeds hold as they are. The cost is that of
    :class:`.VelocityQP`. Of rows that contradict each other, violations count in units of σ per
    second, so that no command depends on K. Faverjon and Tournassoud, "A local based approach for
    path planning of manipulators with a high number of degrees of freedom", ICRA 1987.

    Parameters
    ----------
    speed
        ξ: greatest speed towards the boundary at the influence distance [row scales per second].
    influence, security
        d_i and d_s: influence distance and security distance [row scales].
    damping, max_acceleration
        See :class:`.VelocityQP`.
    """

    name = "velocity-damper"
    kernel = "quadratic"
    ranges: ClassVar[Mapping[str, Declared]] = {
        "speed": Range(0.1, 10.0),
        "influence": Range(0.05, 1.0),
    }
    ignores = (*VelocityController.ignores, "K")
    unit_of_excess = "units of σ per second (bounds of speeds: units of φ)"

    def __init__(
        self,
        *,
        gain: float = 2.0,
        gain_at_zero: float | None = None,
        slope_at_zero: float = 30.0,
        speed: float = 1.0,
        influence: float = 0.3,
        security: float = 0.0,
        damping: float = 1e-6,
        max_acceleration: float | Literal["limits"] | None = None,
    ) -> None:
        super().__init__(
            gain=gain,
            gain_at_zero=gain_at_zero,
            slope_at_zero=slope_at_zero,
            damping=damping,
            max_acceleration=max_acceleration,
        )
        self.speed = positive_number("speed", speed)
        self.influence = positive_number("influence", influence)
        self.security = share_number("security", security)
        if self.security >= self.influence:
            raise ConfigurationError(
                f"security must be below influence, {self.influence:g}, not {self.security:g}"
            )

    @property
    def uses(self) -> tuple[str, ...]:
        """See :class:`.Controller`."""
        return (*super().uses, "σ", "K")

    def bounds(self, rows: Rows, task: Task) -> tuple[Array, Array]:
        """Return G (m, n), which is ∇σᵀ, and h (m,), huge beyond the influence distance."""
        self.require_sigma(rows)
        G, h = rows.velocity_form(task.qd)
        damper = self.speed, self.influence, self.security
        damped: Array = damped_bound(h, rows.sigma, rows.K, rows.scale, *damper)
        gradients: Array = G / rate_factor(rows.K)[:, None]
        return gradients, damped

    def compiled_options(self, rows: Rows, n: int) -> dict[str, Any]:
        """See :class:`.VelocityLaw`."""
        damper = {"speed": self.speed, "influence": self.influence, "security": self.security}
        return {**super().compiled_options(rows, n), **damper}
