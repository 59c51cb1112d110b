"""Start and goals of a scenario before anything is simulated: image, arm, and constraints near their boundary."""

from .figure import FIGURE, lines
from .preview import Moment, Preview, Row, goal_configuration

__all__ = ["FIGURE", "Moment", "Preview", "Row", "goal_configuration", "lines"]
