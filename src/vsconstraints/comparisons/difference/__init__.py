"""Two comparisons held together: what changed in code and settings, and what that did to the same scenes."""

from .difference import Difference, difference

__all__ = ["Difference", "difference"]
