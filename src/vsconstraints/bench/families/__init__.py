"""Scenario families: robot, camera and task drawn from distributions by a seed.

Every drawn scene is physically possible.
"""

from .attempts import Reason
from .drawn import Drawn
from .family import HALVES, SHIPPED, Family, families

__all__ = ["HALVES", "SHIPPED", "Drawn", "Family", "Reason", "families"]
