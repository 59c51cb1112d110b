"""Board of AprilTags: positions of the tags of a scene's markers."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from ..errors import ConfigurationError, format_value
from ..qp.decomposition import svd
from ..robots.geometry import Pose
from ..rows import Array, IntArray

#: Cells along the side of a tag's black square, including its black border (tag36h11); and width of
#: the white border in cells.
CELLS = 8
BORDER = 1
FLAT = 1e-4  #: Largest distance of markers from their plane [m].
#: Default diagonal of a tag, relative to the least distance of a marker from the markers' mean.
DIAGONAL = 0.8
#: Corners of a printed tag in units of its side: x to the right, y down.
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


class Board(NamedTuple):
    """M tags in a plane; x points right and y down on the print, z into the board.

    The first corner of a tag's black square is at its marker, and the opposite one points to the
    markers' mean. In the image, all tags are therefore at the markers or between them. The pose is
    that of the board in the target's frame, with its origin at the markers' mean. The corners (M,
    4, 2) of the black squares are in the plane [m], in the order of :data:`SQUARE`. The ids (M,)
    are the numbers of the tags.
    """

    pose: Pose
    corners: Array
    ids: IntArray

    @classmethod
    def of_markers(
        cls, markers: Array, seen_from: Array, side: float | None, ids: Sequence[int] | None
    ) -> Board:
        """Return the board of markers (M, 3) in the target's frame [m].

        It is printed on the side that faces the point ``seen_from`` (3,) in that frame.

        Raises
        ------
        ConfigurationError
            if there are fewer than three markers, they are not in a plane or in one line, tags
            would overlap, or the number of ids differs from that of markers.
        """
        M = len(markers)
        middle = markers.mean(axis=0)
        away = markers - middle
        if M < 3:
            raise ConfigurationError(f"a board of tags needs three markers or more, not {M}")
        _, extent, axes = svd(away, full_matrices=False)
        if extent[1] < FLAT:
            raise ConfigurationError("a board of tags needs markers that are not on one line")
        normal = axes[2]
        distance = np.abs(away @ normal).max()
        if distance > FLAT:
            raise ConfigurationError(
                f"a board of tags needs markers in one plane: one is {1e3 * distance:.3g} mm away "
                "from that of the others"
            )
        inwards = -np.sign((seen_from - middle) @ normal) * normal
        x = away[1] - away[0]
        x -= inwards * (inwards @ x)
        x /= np.sqrt(x @ x)
        y = np.cross(inwards, x)
        R = np.stack((x, y, inwards), axis=1)
        pose = Pose(R, middle)
        numbers = np.arange(M)
        if ids is not None:
            numbers = np.array(ids, dtype=np.int64)
        if len(numbers) != M:
            raise ConfigurationError(
                f"sensor: there are {M} markers, and {len(numbers)} numbers of tags: "
                f"{format_value(ids)}"
            )
        in_plane = (away @ pose.R)[:, :2]
        return cls(pose, _corners(in_plane, side), numbers)

    @property
    def cell(self) -> float:
        """Side of a cell [m]."""
        edge = self.corners[0, 1] - self.corners[0, 0]
        return float(np.sqrt(edge @ edge)) / CELLS

    def camera_in_board(self, camera: Pose) -> Pose:
        """Return a camera's pose in the board's frame from its pose in the target's frame."""
        return self.pose.inverse @ camera


def _corners(markers: Array, side: float | None) -> Array:
    """Return the corners (M, 4, 2) of tags with one corner at each marker (M, 2).

    The tags point towards the origin. Raises ConfigurationError if two overlap.
    """
    distance = np.sqrt((markers**2).sum(axis=1))
    least = distance.min()
    if least < FLAT:
        raise ConfigurationError("a board of tags takes markers away from their mean")
    if side is None:
        side = float(DIAGONAL * least / np.sqrt(2.0))
    inwards = -markers / distance[:, None]
    # 45° to either side of the direction to the origin
    c = np.sqrt(0.5)
    to_one_side = np.array([[c, -c], [c, c]])
    to_other_side = np.array([[c, c], [-c, c]])
    x = inwards @ to_one_side
    y = inwards @ to_other_side
    right = SQUARE[:, :1] * x[:, None]
    down = SQUARE[:, 1:] * y[:, None]
    corners: Array = markers[:, None] + side * (right + down)
    squares = enumerate(bordered(corners), start=1)
    for (i, square), (j, other) in combinations(squares, 2):
        if _overlap(square, other):
            raise ConfigurationError(
                f"tags {i} and {j} with sides of {1e3 * side:.3g} mm overlap, or the "
                "white around them does: give a smaller tag_side_m"
            )
    return corners


def bordered(corners: Array) -> Array:
    """Return the corners (..., 4, 2) of tags with white borders from those of black squares."""
    middle = corners.mean(axis=-2, keepdims=True)
    scale = 1.0 + 2.0 * BORDER / CELLS
    outer: Array = middle + scale * (corners - middle)
    return outer


def in_space(flat: Array) -> Array:
    """Return points (N, 3) in the frame of a board from those (N, 2) in its plane."""
    return np.pad(flat, ((0, 0), (0, 1)))


def _overlap(a: Array, b: Array) -> bool:
    """True if two squares (4, 2) overlap: no edge direction of either one separates them."""
    for square in (a, b):
        for i in range(2):
            edge = square[i + 1] - square[i]
            along_a = a @ edge
            along_b = b @ edge
            if along_a.max() <= along_b.min() or along_b.max() <= along_a.min():
                return False
    return True
