"""Start and goals of a scenario, looked at before anything is simulated: image, arm, and rows that are near."""

from .figure import FIGURE
from .goals import goal_configuration
from .moments import Moment
from .nearness import Row
from .preview import Preview
from .text import lines

__all__ = ["FIGURE", "Moment", "Preview", "Row", "goal_configuration", "lines"]
