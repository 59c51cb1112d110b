"""Scenarios: TOML files that a user can copy, and what makes simulations of them."""

from .constraint_types import CONSTRAINTS
from .scenario import SHIPPED, Scenario, shipped_scenarios

__all__ = ["CONSTRAINTS", "SHIPPED", "Scenario", "shipped_scenarios"]
