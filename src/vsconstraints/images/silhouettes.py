"""Silhouettes of convex solids in an image.

The part of a solid in front of a board is projected and filled.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..rows import Array, BoolArray
from ..vision.camera import Camera

#: Least distance of drawn parts from the plane through the camera; and in front of the board, so
#: that an object on the board hides nothing [m].
NEAR = 0.01
BEFORE = 1e-3
#: For lenses with distortion, in normalised coordinates: length of the parts of an edge, and
#: largest radius that is drawn.
PART = 0.02
WIDEST = 10.0
#: Square around the invertible disc of a lens, for a unit radius.
SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]], dtype=np.float32)
SHIFT = 4  #: Fractional bits to which corners are rounded [px].


def covered(solids: Iterable[Array], board: Array, camera: Camera) -> BoolArray:
    """Return the pixels (H, W) that convex solids in front of a board cover.

    Each solid is the convex hull of points (V, 3). ``board`` (4,) is the plane n·P = d as n and d,
    with the unit normal n pointing away from the camera. All coordinates are in the camera's frame
    [m].
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
    """Return the corners (K, 2) of a solid's outline, in pixels counted by centres.

    Returns None if no part of the solid is in front of the board.
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
    """Return an outline (K, 2) with corners at most :data:`PART` apart."""
    parts = []
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        count = int(np.ceil(np.abs(b - a).max() / PART)) + 1
        parts.append(a + np.linspace(0.0, 1.0, count)[:, None] * (b - a))
    return np.concatenate(parts)


def clipped(points: Array, plane: Array) -> Array:
    """Return points (V', 3) whose hull is that of points (V, 3) without the part n·P < d.

    ``plane`` (4,) is n and d. New points are added where the plane cuts segments between points on
    different sides; they include the corners of the cut.
    """
    import cv2

    inside = points @ plane[:3] - plane[3]
    kept = inside >= 0.0
    left: Array = points[kept]
    if kept.all() or not kept.any():
        return left
    # points where segments from a kept point to a removed one meet the plane
    begins = left[:, None]
    ends = points[~kept]
    height = inside[kept][:, None]
    share = height / (height - inside[~kept])
    cut = (begins + share[..., None] * (ends - begins)).reshape(-1, 3)
    # the new points lie in the plane: the hull of the cut suffices
    flat = np.delete(cut, np.argmax(np.abs(plane[:3])), axis=1)
    corners = cv2.convexHull(flat.astype(np.float32), returnPoints=False).ravel()
    return np.concatenate([left, cut[corners]])
