"""What a joint's limits leave of its acceleration."""

from __future__ import annotations

from typing import Any

from . import formula

AT_END = 1e-9
"""Distance from an end of a box, as a fraction of the acceleration, that is rounding."""


@formula
def at_end(qdd: Any, least: Any, greatest: Any) -> Any:
    """Whether an acceleration is at an end of its box."""
    return (qdd - least <= AT_END * abs(qdd)) | (greatest - qdd <= AT_END * abs(qdd))
