"""Silhouettes of convex solids in an image: clipped to what is before a board, projected, and
filled.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...rows import Array, BoolArray
from ..camera import Camera

#: How far what is drawn is from the plane through the camera, and before the board: what lies on it
#: covers nothing [m].
NEAR = 0.01
BEFORE = 1e-3
#: Through a lens with distortion, in normalised coordinates: parts of an edge, and where nothing is
#: drawn any more.
PART = 0.02
WIDEST = 10.0
#: Around the reach of a lens, by which it is scaled.
SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]], dtype=np.float32)
SHIFT = 4  #: Binary digits of a pixel that corners are rounded to.


def covered(solids: Iterable[Array], board: Array, camera: Camera) -> BoolArray:
    """(H, W) pixels of a camera that convex solids cover, of those before a board.

    Each solid is (V, 3) points whose convex hull it is, ``board`` (4,) a unit normal n away from
    the camera and d in n·P = d, all in the camera's frame [m].
    """
    import cv2

    width, height = (int(side) for side in camera.size)
    image = np.zeros((height, width), dtype=np.uint8)
    for points in solids:
        outline = silhouette(points, board, camera)
        if outline is not None:
            cv2.fillPoly(image, [np.rint(outline * 2**SHIFT).astype(np.int32)], 1, shift=SHIFT)
    return image > 0


def silhouette(points: Array, board: Array, camera: Camera) -> Array | None:
    """(K, 2) corners of a solid's outline, counted by pixels' centres; None if nothing of it is
    before the board.
    """
    import cv2

    seen = clipped(points, np.array([0.0, 0.0, 1.0, NEAR]))
    seen = clipped(seen, np.append(-board[:3], BEFORE - board[3]))
    if len(seen) < 3:
        return None
    outline = cv2.convexHull((seen[:, :2] / seen[:, 2:]).astype(np.float32))[:, 0]
    if camera.distortion is not None:
        reach = np.float32(min(camera.distortion.reach, WIDEST))
        _, within = cv2.intersectConvexConvex(outline, reach * SQUARE)
        if within is None:
            return None
        outline = _finely(within[:, 0])
    corners: Array = camera.to_corner(
        camera.distort(camera.pixels(outline.astype(np.float64))), "centres"
    )
    return corners


def _finely(outline: Array) -> Array:
    """An outline (K, 2) with corners every :data:`PART`."""
    parts = []
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        count = int(np.ceil(np.abs(b - a).max() / PART)) + 1
        parts.append(a + np.linspace(0.0, 1.0, count)[:, None] * (b - a))
    return np.concatenate(parts)


def clipped(points: Array, plane: Array) -> Array:
    """(V', 3) points whose convex hull is that of points (V, 3), less where n·P < d; ``plane`` (4,)
    is n and d.

    Where the plane cuts lines between two of the points, there are new ones: the corners of the cut
    are among them.
    """
    import cv2

    inside = points @ plane[:3] - plane[3]
    kept = inside >= 0.0
    left: Array = points[kept]
    if kept.all() or not kept.any():
        return left
    a = left
    b = points[~kept]
    here = inside[kept]
    there = inside[~kept]
    share = here[:, None] / (here[:, None] - there)
    cut = (a[:, None] + share[..., None] * (b - a[:, None])).reshape(-1, 3)
    # in the plane: its outline is enough
    flat = np.delete(cut, np.argmax(np.abs(plane[:3])), axis=1)
    around = cv2.convexHull(flat.astype(np.float32), returnPoints=False).ravel()
    return np.concatenate([a, cut[around]])
