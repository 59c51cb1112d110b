"""Demands: what rows ask of the acceleration, L_gφ q̈ ≤ c.

One half of a law; :mod:`vsconstraints.controllers.resolvers` are the other.
"""

from .barrier import Barrier
from .base import USES, Demand
from .boundary_layer import BoundaryLayer
from .implicit_switch import ImplicitSwitch
from .nothing import Nothing
from .repulsion import Repulsion
from .switch import Switch

__all__ = ["DEMANDS", "USES", "Barrier", "BoundaryLayer", "Demand", "ImplicitSwitch", "Nothing", "Repulsion", "Switch"]

DEMANDS: tuple[type[Demand], ...] = (Switch, ImplicitSwitch, BoundaryLayer, Repulsion, Barrier, Nothing)
"""Demands that files can name, by their ``name``."""
