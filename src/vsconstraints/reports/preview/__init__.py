"""Start and goals of a scenario before anything is simulated: image, arm, and constraints near
their boundary.
"""

from ...scenarios.moments import Moment, goal_configuration
from .figure import FIGURE, lines
from .preview import Preview, Row

__all__ = ["FIGURE", "Moment", "Preview", "Row", "goal_configuration", "lines"]
