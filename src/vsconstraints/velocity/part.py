"""Laws that command joint speeds, as additions to the core."""

from ..plugins.registry import Part

PART = Part(
    laws={
        "resolved-rate": "vsconstraints.velocity.resolved_rate:ResolvedRate",
        "resolved-rate-avoidance": "vsconstraints.velocity.avoidance:ResolvedRateAvoidance",
        "velocity-qp": "vsconstraints.velocity.quadratic:VelocityQP",
        "velocity-hierarchical-qp": "vsconstraints.velocity.quadratic:VelocityHierarchicalQP",
        "velocity-damper": "vsconstraints.velocity.damper:VelocityDamper",
    }
)
