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
SIDES = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))  #: Directions into the square.
SHIFT = 4  #: Fractional bits to which corners are rounded [px].


def covered(solids: Iterable[Array], board: Array, camera: Camera) -> BoolArray:
    """Return the pixels (H, W) that convex solids in front of a board cover.

    Each solid is the convex hull of points (V, 3). ``board`` (4,) is the plane n·P = d as n and d,
    with the unit normal n pointing away from the camera. All coordinates are in the camera's frame
    [m].
    """
    import cv2

    width, height = map(int, camera.size)
    image = np.zeros((height, width), dtype=np.uint8)
    for points in solids:
        outline = silhouette(points, board, camera)
        if outline is not None:
            fixed_point = np.rint(outline * 2**SHIFT).astype(np.int32)
            cv2.fillPoly(image, [fixed_point], 1, shift=SHIFT)
    return image > 0


def silhouette(points: Array, board: Array, camera: Camera) -> Array | None:
    """Return the corners (K, 2) of a solid's outline, in pixels counted by centres.

    Returns None if no part of the solid is in front of the board.
    """
    import cv2

    in_front_of_camera = np.array([0.0, 0.0, 1.0, NEAR])
    in_front_of_board = np.append(-board[:3], BEFORE - board[3])
    planes = [in_front_of_camera, in_front_of_board]
    lens = camera.distortion
    if lens is not None:
        # the square |x|, |y| ≤ reach around the invertible disc of the lens
        reach = min(lens.reach, WIDEST)
        for x, y in SIDES:
            planes.append(np.array([x, y, reach, 0.0]))
    for plane in planes:
        points = clipped(points, plane)
    if len(points) < 3:
        return None
    normalised = points[:, :2] / points[:, 2:]
    outline = cv2.convexHull(normalised.astype(np.float32))[:, 0]
    if lens is not None:
        outline = _finely(outline)
    ideal = camera.pixels(outline.astype(np.float64))
    pixels = camera.distort(ideal)
    corners: Array = camera.to_corner(pixels, "centres")
    return corners


def _finely(outline: Array) -> Array:
    """Return an outline (K, 2) with corners at most :data:`PART` apart."""
    edges = []
    following = np.roll(outline, -1, axis=0)
    for begin, end in zip(outline, following, strict=True):
        length = np.abs(end - begin).max()
        count = int(np.ceil(length / PART)) + 1
        shares = np.linspace(0.0, 1.0, count)[:, None]
        edges.append(begin + shares * (end - begin))
    return np.concatenate(edges)


def clipped(points: Array, plane: Array) -> Array:
    """Return points (V', 3) whose hull is that of points (V, 3) without the part n·P < d.

    ``plane`` (4,) is n and d. New points are added where the plane cuts segments between points on
    different sides; they include the corners of the cut.
    """
    import cv2

    normal = plane[:3]
    height = points @ normal - plane[3]
    is_kept = height >= 0.0
    kept: Array = points[is_kept]
    if is_kept.all() or not is_kept.any():
        return kept
    # points where segments from a kept point to a removed one meet the plane
    begins = kept[:, None]
    ends = points[~is_kept]
    above = height[is_kept][:, None]
    below = height[~is_kept]
    share = above / (above - below)
    cut = begins + share[..., None] * (ends - begins)
    cut = cut.reshape(-1, 3)
    # the new points lie in the plane: the hull of the cut suffices
    steepest = np.argmax(np.abs(normal))
    flat = np.delete(cut, steepest, axis=1)
    corners = cv2.convexHull(flat.astype(np.float32), returnPoints=False)
    return np.concatenate([kept, cut[corners.ravel()]])
