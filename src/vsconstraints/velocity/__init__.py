"""Laws that command joint speeds, for arms that take velocities or positions."""

from __future__ import annotations

from ..controllers.velocity_controller import VelocityController, commands_velocity
from ..formulas.velocity import adaptive_gain
from .avoidance import ResolvedRateAvoidance
from .damper import VelocityDamper
from .gain import VelocityLaw
from .quadratic import VelocityHierarchicalQP, VelocityQP
from .resolved_rate import ResolvedRate

__all__ = [
    "VELOCITY_LAWS",
    "ResolvedRate",
    "ResolvedRateAvoidance",
    "VelocityController",
    "VelocityDamper",
    "VelocityHierarchicalQP",
    "VelocityLaw",
    "VelocityQP",
    "adaptive_gain",
    "commands_velocity",
]

#: Velocity laws that files can name, by their ``name``.
VELOCITY_LAWS: tuple[type[VelocityController], ...] = (
    ResolvedRate,
    ResolvedRateAvoidance,
    VelocityQP,
    VelocityHierarchicalQP,
    VelocityDamper,
)
