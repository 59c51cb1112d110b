"""Line through two markers."""

from __future__ import annotations

import math

import numpy as np

from ...rows import Array
from .pair import MarkerPair
from .view import View


class Line(MarkerPair):
    """Line x cos θ + y sin θ = ρ through two markers: s = (ρ, θ).

    (−sin θ, cos θ) points from the first marker to the second, so that θ has all values of a turn
    and ρ has a sign. With the rows Nᵢ = (cos θ, sin θ) L_i of both points and their coordinates τᵢ
    along the line, N = L_ρ − τ L_θ at both. Hence L_θ = (N₁ − N₂)/(τ₂ − τ₁) and L_ρ = N₁ + τ₁ L_θ.
    This is the matrix of Espiau, Chaumette and Rives (1992), with the plane given by two depths.
    """

    name = "line"
    angles = slice(1, 2)

    def size(self, markers: int) -> int:
        """Return 2."""
        self.count(markers)
        return 2

    def value(self, view: View, goal: View) -> Array:
        """Return s; raise SceneError if the markers coincide in the image."""
        _, (dx, dy) = self.direction(view)
        x, y = view.xy[0]
        return np.array([x * dy - y * dx, math.atan2(-dx, dy)])

    def interaction_matrix(self, view: View, goal: View) -> Array:
        """Return the interaction matrix of the class's formula."""
        length, along = self.direction(view)
        across = np.array([along[1], -along[0]])
        N = across @ view.point_rows[:, :2]
        of_theta = (N[0] - N[1]) / length
        of_rho = N[0] + view.xy[0] @ along * of_theta
        return np.stack((of_rho, of_theta))
