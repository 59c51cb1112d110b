"""Resolvers: ways to share q̈ among demands and task.

One half of a law; :mod:`vsconstraints.controllers.demands` are the other.
"""

from .additive import Additive
from .base import Resolver
from .filter import Filter
from .hierarchy import Hierarchy
from .priority import Priority

__all__ = ["RESOLVERS", "Additive", "Filter", "Hierarchy", "Priority", "Resolver"]

RESOLVERS: tuple[type[Resolver], ...] = (Priority, Hierarchy, Filter, Additive)
"""Resolvers that files can name, by their ``name``."""
