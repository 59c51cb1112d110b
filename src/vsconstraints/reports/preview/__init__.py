"""Start and goals of a scenario before anything is simulated: image, arm, and constraints near their boundary."""

from .figure import FIGURE
from .moments import Moment, Row, goal_configuration
from .preview import Preview, lines

__all__ = ["FIGURE", "Moment", "Preview", "Row", "goal_configuration", "lines"]
