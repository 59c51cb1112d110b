"""Logarithm of the markers' depths relative to the goal."""

from __future__ import annotations

import numpy as np

from ...rows import Array
from .view import View, ViewFeature


class Depth(ViewFeature):
    """Relative depths s = log(Z/Z*) of the markers, with Z* at the goal.

    L = (0, 0, −1/Z, −y, x, 0) for each marker (Malis, Chaumette and Boudet 1999).
    """

    name = "depth"
    needs = ("depth",)

    def size(self, markers: int) -> int:
        """Return m: one component of each marker."""
        return self.count(markers)

    def value(self, view: View, goal: View) -> Array:
        """Return s."""
        return np.log(view.depth / goal.depth)

    def interaction_matrix(self, view: View, goal: View) -> Array:
        """Return the interaction matrix of the class's formula."""
        L = np.zeros((len(view.depth), 6))
        L[:, 2] = -1.0 / view.depth
        L[:, 3] = -view.xy[:, 1]
        L[:, 4] = view.xy[:, 0]
        return L
