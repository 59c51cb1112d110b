"""Polar coordinates of markers in the image."""

from __future__ import annotations

import numpy as np

from ...errors import SceneError
from ...rows import Array
from .view import View, ViewFeature

SMALLEST_RADIUS = 1e-6  #: ρ below which θ is not defined, in normalised coordinates.


class Polar(ViewFeature):
    """Polar coordinates s = (ρ₁, θ₁, ρ₂, …) of the markers: ρ = √(x² + y²), θ = atan2(y, x).

    L_ρ = (−c/Z, −s/Z, ρ/Z, (1 + ρ²) s, −(1 + ρ²) c, 0) and L_θ = (s/(ρZ), −c/(ρZ), 0, c/ρ, s/ρ,
    −1), with c = cos θ and s = sin θ (Iwatsuki and Okiyama 2005; Corke and Hutchinson 2011).
    """

    name = "polar"
    angles = slice(1, None, 2)

    def size(self, markers: int) -> int:
        """Return 2m: two coordinates of each marker."""
        return 2 * self.count(markers)

    def value(self, view: View, goal: View) -> Array:
        """Return s; raise SceneError for a marker on the optical axis."""
        x, y = view.xy.T
        rho = np.hypot(x, y)
        if (rho < SMALLEST_RADIUS).any():
            raise SceneError(
                f"the feature {self.name} is not defined: a marker is on the optical axis, where "
                "it has no angle. Move the start or the goal, or choose other markers"
            )
        return np.column_stack((rho, np.arctan2(y, x))).ravel()

    def interaction_matrix(self, view: View, goal: View) -> Array:
        """Return the interaction matrix of the class's formula."""
        x, y = view.xy.T
        Z = view.depth
        rho = np.hypot(x, y)
        c = x / rho
        s = y / rho
        zero = np.zeros_like(rho)
        wide = 1.0 + rho * rho
        radial = [-c / Z, -s / Z, rho / Z, wide * s, -wide * c, zero]
        angular = [s / (rho * Z), -c / (rho * Z), zero, c / rho, s / rho, -np.ones_like(rho)]
        return np.array([radial, angular]).transpose(2, 0, 1).reshape(-1, 6)
