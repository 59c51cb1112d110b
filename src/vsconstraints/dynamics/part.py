"""Additions of arms with mass to the core."""

from ..plugins.registry import Part

_SETTINGS = "vsconstraints.dynamics.settings"

PART = Part(
    scenario_tables={
        "plant": {
            "dynamics": f"{_SETTINGS}:ArmDynamics",
            "mujoco": f"{_SETTINGS}:MujocoDynamics",
        }
    },
    figures=("vsconstraints.dynamics.figure:DISTURBANCE",),
)
