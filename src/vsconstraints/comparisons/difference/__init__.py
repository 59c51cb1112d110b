"""Two comparisons compared: what changed in code and settings, and the effect in the same scenes."""

from .difference import Difference, difference

__all__ = ["Difference", "difference"]
