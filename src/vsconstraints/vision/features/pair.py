"""Base class of features of two markers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...errors import ConfigurationError, SceneError
from ...rows import Array
from .view import View, ViewFeature

SMALLEST_DISTANCE = 1e-6  #: Least distance of two markers in normalised coordinates.


class MarkerPair(ViewFeature):
    """Feature of two markers: the numbers ``markers``, from 1; by default the first two."""

    def __init__(self, markers: Sequence[int] = (1, 2)) -> None:
        if len(markers) != 2:
            raise ConfigurationError(
                f"the feature {self.name} is of two markers, for example markers = [1, 2], not of "
                f"{len(markers)}"
            )
        super().__init__(markers)

    def direction(self, view: View) -> tuple[float, Array]:
        """Return distance and unit vector (2,) from the first marker to the second.

        Raises SceneError if they coincide in the image.
        """
        along = view.xy[1] - view.xy[0]
        length = float(np.hypot(*along))
        if length < SMALLEST_DISTANCE:
            raise SceneError(
                f"the feature {self.name} is not defined: its two markers coincide in the image. "
                "Move the start or the goal, or choose other markers"
            )
        return length, along / length
