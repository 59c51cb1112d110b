"""Area and centroid of the polygon of the markers."""

from __future__ import annotations

import numpy as np

from ...errors import SceneError
from ...rows import Array
from .view import View, ViewFeature

#: Least area relative to the square around the markers.
SMALLEST_AREA = 1e-6


class AreaCentroid(ViewFeature):
    """Centroid and area of the markers' polygon: s = (x_g, y_g, log √(a*/a)).

    The markers are its corners, in order; a is its area in the image and a* that at the goal. For
    a target parallel to the image plane, the third component is log(Z/Z*). With the edges' cross
    products cᵢ = xᵢ yᵢ₊₁ − xᵢ₊₁ yᵢ, a = ½ |Σ cᵢ| and x_g = Σ (xᵢ + xᵢ₊₁) cᵢ / (3 Σ cᵢ). The matrix
    is the sum over the corners of their derivatives times those of the points (Chaumette 2004).
    """

    name = "area-centroid"

    def size(self, markers: int) -> int:
        """Return 3."""
        self.count(markers)
        return 3

    def value(self, view: View, goal: View) -> Array:
        """Return s; raise SceneError if the area is zero or unlike the goal's order of corners."""
        twice, first = self._moments(view)
        wanted, _ = self._moments(goal)
        if twice * wanted < 0.0:
            raise SceneError(
                f"the feature {self.name} is not defined: the markers' polygon is seen from the "
                "other side than at the goal. Move the start or the goal"
            )
        return np.array([*(first / (3.0 * twice)), 0.5 * np.log(wanted / twice)])

    def interaction_matrix(self, view: View, goal: View) -> Array:
        """Return the interaction matrix of the class's formula."""
        twice, first = self._moments(view)
        here = view.xy
        after = np.roll(here, -1, axis=0)
        before = np.roll(here, 1, axis=0)
        c = _cross(here, after)
        # derivatives (m, 2) of Σ cᵢ by the corners, and (2, m, 2) of Σ (xᵢ + xᵢ₊₁) cᵢ
        x_after, y_after = after.T
        x_before, y_before = before.T
        of_twice = np.column_stack((y_after - y_before, x_before - x_after))
        turned_after = np.column_stack((y_after, -x_after))
        turned_before = np.column_stack((-y_before, x_before))
        around = (c + np.roll(c, 1))[:, None]
        with_after = here + after
        with_before = before + here
        of_first = []
        for axis, unit in enumerate(np.eye(2)):
            by_edges = around * unit
            by_next_edge = with_after[:, [axis]] * turned_after
            by_last_edge = with_before[:, [axis]] * turned_before
            of_first.append(by_edges + by_next_edge + by_last_edge)
        ratio = (first / twice)[:, None, None]
        of_centroid = (np.stack(of_first) - ratio * of_twice) / (3.0 * twice)
        of_logarithm = -0.5 * of_twice / twice
        slopes = np.concatenate((of_centroid, [of_logarithm]))
        L: Array = np.einsum("kmc,mcj->kj", slopes, view.point_rows[:, :2])
        return L

    def _moments(self, view: View) -> tuple[float, Array]:
        """Return Σ cᵢ and Σ (xᵢ + xᵢ₊₁) cᵢ, (2,); raise SceneError if the area is zero."""
        after = np.roll(view.xy, -1, axis=0)
        c = _cross(view.xy, after)
        twice = float(c.sum())
        extent = np.ptp(view.xy, axis=0).max()
        if abs(twice) <= SMALLEST_AREA * extent**2:
            raise SceneError(
                f"the feature {self.name} is not defined: the polygon of its {len(c)} markers has "
                "no area in the image. It takes three or more markers that are not on a line, in "
                "the order of the corners"
            )
        return twice, (view.xy + after).T @ c


def _cross(a: Array, b: Array) -> Array:
    return a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
