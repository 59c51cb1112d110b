"""Ellipse with the moments of the markers."""

from __future__ import annotations

import numpy as np

from ...rows import Array
from .view import View, ViewFeature


class Ellipse(ViewFeature):
    """Ellipse with the moments of the markers: s = (x_g, y_g, n₂₀, n₁₁, n₀₂).

    x_g and y_g are the means of the markers, n₂₀, n₁₁ and n₀₂ the means of (x − x_g)²,
    (x − x_g)(y − y_g) and (y − y_g)². With ẋ and ẏ of each point: ṅ₂₀ = 2 mean((x − x_g) ẋ),
    ṅ₁₁ = mean((x − x_g) ẏ + (y − y_g) ẋ), ṅ₀₂ = 2 mean((y − y_g) ẏ) (Tahri and Chaumette 2005).
    """

    name = "ellipse"

    def size(self, markers: int) -> int:
        """Return 5."""
        self.count(markers)
        return 5

    def value(self, view: View, goal: View) -> Array:
        """Return s."""
        centre = view.xy.mean(axis=0)
        x, y = (view.xy - centre).T
        return np.array([*centre, (x * x).mean(), (x * y).mean(), (y * y).mean()])

    def interaction_matrix(self, view: View, goal: View) -> Array:
        """Return the interaction matrix of the class's formula."""
        x, y = (view.xy - view.xy.mean(axis=0)).T
        Lx, Ly, _ = view.point_rows.transpose(1, 0, 2)
        m = len(x)
        of_moments = np.stack((2.0 * x @ Lx, x @ Ly + y @ Lx, 2.0 * y @ Ly)) / m
        return np.vstack((Lx.mean(axis=0), Ly.mean(axis=0), of_moments))
