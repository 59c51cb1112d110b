"""Resolvers: ways to share q̈ among demands and task.

One half of a law; :mod:`vsconstraints.controllers.demands` are the other.
"""

from .additive import Additive
from .base import Resolver
from .filter import Filter
from .hierarchy import Hierarchy
from .priority import Priority
from .projection import Projection
from .saturation import Saturation
from .scaling import Scaling

__all__ = [
    "RESOLVERS",
    "Additive",
    "Filter",
    "Hierarchy",
    "Priority",
    "Projection",
    "Resolver",
    "Saturation",
    "Scaling",
]

RESOLVERS: tuple[type[Resolver], ...] = (Priority, Hierarchy, Filter, Additive, Saturation, Projection, Scaling)
"""Resolvers that files can name, by their ``name``."""
