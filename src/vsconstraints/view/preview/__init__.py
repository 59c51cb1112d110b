"""Preview of a scenario without simulation: start and goals, image, arm and nearest rows."""

from ...scenarios.moments import Moment, goal_configuration
from .figure import FIGURE, lines
from .preview import Preview, Row

__all__ = ["FIGURE", "Moment", "Preview", "Row", "goal_configuration", "lines"]
