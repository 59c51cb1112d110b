"""What is best of many points when every objective is to be small: front, hypervolume, and one of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .objectives import REFERENCE, Point, scaled


def front(points: Sequence[Point]) -> list[int]:
    """Where the points are that no other dominates; of equal ones the first."""
    import moocore

    if not points:
        return []
    return [int(i) for i in np.flatnonzero(moocore.is_nondominated(np.array(points), keep_weakly=False))]


def hypervolume(points: Sequence[Point], reference: Point = REFERENCE) -> float:
    """Volume of what the points dominate, as far as the reference point; 0 if none is better than it in everything."""
    import moocore

    inside = [point for point in points if all(a < b for a, b in zip(point, reference, strict=True))]
    return float(moocore.hypervolume(np.array(inside), ref=np.array(reference))) if inside else 0.0


def choose(points: Sequence[Point]) -> int:
    """Which point is nearest to the ideal one: that with the least value of each objective on the front.

    Distances are Euclidean, in the objectives' units, which are the same for all laws; of equal ones the first is
    taken. ("Compromise programming": Zeleny 1973.)
    """
    best = front(points)
    on_front = scaled([points[i] for i in best])
    distance = np.linalg.norm(on_front - on_front.min(axis=0), axis=1)
    return best[int(np.argmin(distance))]
