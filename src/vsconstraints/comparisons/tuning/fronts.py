"""What is best of many points when every objective is to be small: front, hypervolume, and one of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .objectives import REFERENCE, Point, scaled

ROUNDING = 1e-12
"""Distances that differ by less, relatively, are the same."""


def front(points: Sequence[Point]) -> list[int]:
    """Where the points are that no other dominates; of equal ones the first."""
    import moocore

    if not points:
        return []
    # which of equal points moocore leaves out differs from version to version
    best = np.flatnonzero(moocore.is_nondominated(np.array(points), keep_weakly=True))
    return sorted({points[i]: int(i) for i in best[::-1]}.values())


def hypervolume(points: Sequence[Point], reference: Point = REFERENCE) -> float:
    """Volume of what the points dominate, as far as the reference point; 0 if none is better than it in everything."""
    import moocore

    inside = [point for point in points if all(a < b for a, b in zip(point, reference, strict=True))]
    return float(moocore.hypervolume(np.array(inside), ref=np.array(reference))) if inside else 0.0


def choose(points: Sequence[Point]) -> int:
    """Which point is nearest to the ideal one: that with the least value of each objective on the front.

    Distances are Euclidean, in the objectives' units, which are the same for all laws. Of points as near as each other,
    to rounding, the one with the least first objective is taken, then second, third; of equal ones the first.
    ("Compromise programming": Zeleny 1973.)
    """
    best = front(points)
    on_front = scaled([points[i] for i in best])
    distance = np.linalg.norm(on_front - on_front.min(axis=0), axis=1)
    nearest = np.flatnonzero(distance <= distance.min() * (1.0 + ROUNDING))
    return min((best[i] for i in nearest), key=lambda i: (points[i], i))
