"""Families of scenes: robot, camera and task drawn from stated distributions by a seed, physically
possible.
"""

from .attempts import Reason
from .drawn import Drawn
from .family import HALVES, SHIPPED, Family, families

__all__ = ["HALVES", "SHIPPED", "Drawn", "Family", "Reason", "families"]
