"""Demands: what rows ask of the acceleration, L_gφ q̈ ≤ c.

One half of a law; :mod:`vsconstraints.controllers.resolvers` are the other.
"""

from .barrier import Barrier
from .base import USES, Demand
from .boundary_layer import BoundaryLayer
from .high_order_barrier import HighOrderBarrier
from .implicit_switch import ImplicitSwitch
from .implicit_switch_with_drift import ImplicitSwitchWithDrift
from .margins import GradientRobustBarrier, InputToStateSafeBarrier, RobustBarrier, SampledBarrier
from .nonlinear_barriers import FiniteTimeBarrier, ReciprocalBarrier
from .nothing import Nothing
from .outer_layer import OuterLayer
from .repulsion import Firas, RampRepulsion
from .super_twisting import ImplicitSuperTwisting, SuperTwisting
from .switch import Switch

__all__ = [
    "DEMANDS",
    "USES",
    "Barrier",
    "BoundaryLayer",
    "Demand",
    "FiniteTimeBarrier",
    "Firas",
    "GradientRobustBarrier",
    "HighOrderBarrier",
    "ImplicitSuperTwisting",
    "ImplicitSwitch",
    "ImplicitSwitchWithDrift",
    "InputToStateSafeBarrier",
    "Nothing",
    "OuterLayer",
    "RampRepulsion",
    "ReciprocalBarrier",
    "RobustBarrier",
    "SampledBarrier",
    "SuperTwisting",
    "Switch",
]

DEMANDS: tuple[type[Demand], ...] = (
    Switch,
    ImplicitSwitch,
    ImplicitSwitchWithDrift,
    BoundaryLayer,
    OuterLayer,
    SuperTwisting,
    ImplicitSuperTwisting,
    Firas,
    RampRepulsion,
    Barrier,
    ReciprocalBarrier,
    FiniteTimeBarrier,
    HighOrderBarrier,
    RobustBarrier,
    InputToStateSafeBarrier,
    GradientRobustBarrier,
    SampledBarrier,
    Nothing,
)
"""Demands that files can name, by their ``name``."""
