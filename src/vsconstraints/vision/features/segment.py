"""Segment between two markers."""

from __future__ import annotations

import math

import numpy as np

from ...rows import Array
from .pair import MarkerPair
from .view import View


class Segment(MarkerPair):
    """Segment between two markers: s = (x_m, y_m, l, α), its middle, length and angle.

    The angle is that of the direction from the first marker to the second. With L₁ and L₂ of the
    points: L_m = (L₁ + L₂)/2, L_l = (cos α, sin α)(L₂ − L₁), L_α = (−sin α, cos α)(L₂ − L₁)/l
    (Chaumette 1990).
    """

    name = "segment"
    angles = slice(3, 4)

    def size(self, markers: int) -> int:
        """Return 4."""
        self.count(markers)
        return 4

    def value(self, view: View, goal: View) -> Array:
        """Return s; raise SceneError if the markers coincide in the image."""
        length, (dx, dy) = self.direction(view)
        middle = view.xy.mean(axis=0)
        return np.array([*middle, length, math.atan2(dy, dx)])

    def interaction_matrix(self, view: View, goal: View) -> Array:
        """Return the interaction matrix of the class's formula."""
        length, (c, s) = self.direction(view)
        L = view.point_rows[:, :2]
        apart = L[1] - L[0]
        of_length = np.array([c, s]) @ apart
        of_angle = np.array([-s, c]) @ apart / length
        return np.vstack((L.mean(axis=0), of_length, of_angle))
