"""Scenarios: TOML files that a user can copy, and the code that builds simulations from them."""

from .constraint_types import CONSTRAINTS
from .scenario import SHIPPED, Scenario, shipped_scenarios

__all__ = ["CONSTRAINTS", "SHIPPED", "Scenario", "shipped_scenarios"]
