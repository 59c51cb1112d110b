"""Laws that command joint speeds, for arms that take velocities or positions."""

from typing import TYPE_CHECKING

from ..plugins.lazy import exported

if TYPE_CHECKING:
    from ..controllers import VELOCITY_LAWS
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
__getattr__, __dir__ = exported(
    __name__,
    {
        "VELOCITY_LAWS": ".controllers",
        "ResolvedRate": "resolved_rate",
        "ResolvedRateAvoidance": "avoidance",
        "VelocityController": ".controllers.velocity_controller",
        "VelocityDamper": "damper",
        "VelocityHierarchicalQP": "quadratic",
        "VelocityLaw": "gain",
        "VelocityQP": "quadratic",
        "adaptive_gain": ".formulas.velocity",
        "commands_velocity": ".controllers.velocity_controller",
    },
)
