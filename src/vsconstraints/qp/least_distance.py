"""The point of a polyhedron nearest to a given one, stated so that any QP solver can answer it well."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..rows import Array


@dataclass(frozen=True, slots=True)
class LeastDistance:
    """min ½‖u‖² subject to G u ≤ h, with x = center + size · T u.

    Rows have unit norm and the smallest entry of h is −1: the origin is excluded by a unit distance. Scaled
    so, a solver's absolute tolerances mean the same for every robot, unit and row, and the cost is the
    identity. Neither changes the minimiser, since the rows are hard here.

    Attributes
    ----------
    G, h
        (m, p) and (m,).
    center, T, size
        (n,), (n, p) and a length: the way back to x.
    """

    G: Array
    h: Array
    center: Array
    T: Array
    size: float

    def point(self, u: Array) -> Array:
        """(n,) x of a (p,) solution u."""
        return self.center + self.T @ (self.size * u)


def least_distance(center: Array, T: Array, A: Array, c: Array) -> LeastDistance | None:
    """State  min ½‖u‖²  subject to  A (center + T u) ≤ c; None if u = 0 is the answer.

    Parameters
    ----------
    center, T
        (n,) and (n, p) of full column rank.
    A, c
        (m, n) and (m,); A T must not have a row of zeros.
    """
    scaled = scale(A @ T, c - A @ center)
    return None if scaled.size <= 0.0 else LeastDistance(scaled.G, scaled.h, center, T, scaled.size)


class Scaled(NamedTuple):
    """Rows G u ≤ h of unit norm, with −1 the smallest entry of h: what ``size`` u makes of rows of these norms."""

    G: Array
    h: Array
    size: float
    norms: Array


def scale(G: Array, h: Array) -> Scaled:
    """Scale rows G v ≤ h, none of them zero, as :class:`LeastDistance` says; the size is 0 if v = 0 meets all."""
    norms = np.sqrt(np.einsum("ij,ij->i", G, G))
    h = h / norms
    size = -float(h.min(initial=0.0))
    return Scaled(G / norms[:, None], h / size if size > 0.0 else h, size, norms)
