"""Families of scenes: robot, camera and task drawn from stated distributions by a seed, physically possible."""

from .drawn import Drawn
from .family import HALVES, SHIPPED, Family, families
from .reasons import Reason

__all__ = ["HALVES", "SHIPPED", "Drawn", "Family", "Reason", "families"]
