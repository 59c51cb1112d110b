"""A board of AprilTags: where the tags of a scene's markers are."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from ...errors import ConfigurationError, shown
from ...qp.decomposition import svd
from ...robots.geometry import Pose
from ...rows import Array, IntArray

#: Cells along the side of a tag's black square, the outer ones black (tag36h11), and of white
#: needed around it.
CELLS = 8
BORDER = 1
FLAT = 1e-4  #: How far markers may be from their plane [m].
#: Diagonal of a tag by the least distance of a marker from the middle, if no side is given.
DIAGONAL = 0.8
#: Corners of a tag as it is printed, in units of its side: x to the right, y down.
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


class Board(NamedTuple):
    """M tags in a plane, x to the right and y down as one looks at the print, z into the board.

    The first corner of a tag's black square is at its marker, and the opposite one towards the
    markers' mean: all tags are where the markers are in the image, or between them. The pose is
    that of the board in the target's frame, its origin the markers' mean; corners (M, 4, 2) of the
    black squares are in the plane [m], in the order of :data:`SQUARE`; ids (M,) are the numbers of
    the tags.
    """

    pose: Pose
    corners: Array
    ids: IntArray

    @classmethod
    def of_markers(
        cls, markers: Array, seen_from: Array, side: float | None, ids: Sequence[int] | None
    ) -> Board:
        """The board of markers (M, 3) in the target's frame [m], printed on the side of a point
        (3,) in that frame.

        Raises
        ------
        ConfigurationError
            if there are fewer than three markers, they are not in a plane or in one line, tags
            would overlap, or there are not as many numbers as markers.
        """
        M = len(markers)
        middle = markers.mean(axis=0)
        away = markers - middle
        if M < 3:
            raise ConfigurationError(f"a board of tags takes three markers or more, not {M}")
        _, s, Vt = svd(away, full_matrices=False)
        if s[1] < FLAT:
            raise ConfigurationError("a board of tags takes markers that are not in one line")
        off = np.abs(away @ Vt[2]).max()
        if off > FLAT:
            raise ConfigurationError(
                f"a board of tags takes markers in one plane: one is {1e3 * off:.3g} mm away from "
                f"theirs"
            )
        inwards = -np.sign((seen_from - middle) @ Vt[2]) * Vt[2]
        x = away[1] - away[0]
        x -= inwards * (inwards @ x)
        x /= np.sqrt(x @ x)
        pose = Pose(np.stack((x, np.cross(inwards, x), inwards), axis=1), middle)
        numbers = np.arange(M) if ids is None else np.array(ids, dtype=np.int64)
        if len(numbers) != M:
            raise ConfigurationError(
                f"sensor: there are {M} markers, and {len(numbers)} numbers of tags: {shown(ids)}"
            )
        return cls(pose, _corners((away @ pose.R)[:, :2], side), numbers)

    @property
    def cell(self) -> float:
        """Side of a cell [m]."""
        edge = self.corners[0, 1] - self.corners[0, 0]
        return float(np.sqrt(edge @ edge)) / CELLS

    def camera_in_board(self, camera: Pose) -> Pose:
        """A camera's pose in the board's frame, of the one in the target's."""
        return self.pose.inverse @ camera


def _corners(markers: Array, side: float | None) -> Array:
    """(M, 4, 2) corners of tags with one at each marker (M, 2), towards the origin; raises where
    two overlap.
    """
    distance = np.sqrt((markers**2).sum(axis=1))
    if distance.min() < FLAT:
        raise ConfigurationError("a board of tags takes markers away from their mean")
    a = DIAGONAL * distance.min() / np.sqrt(2.0) if side is None else side
    towards = -markers / distance[:, None]
    # 45° to either side of the way to the middle
    c = np.sqrt(0.5)
    x = towards @ np.array([[c, -c], [c, c]])
    y = towards @ np.array([[c, c], [-c, c]])
    corners: Array = markers[:, None] + a * (
        SQUARE[:, :1] * x[:, None] + SQUARE[:, 1:] * y[:, None]
    )
    wide = bordered(corners)
    for i, j in combinations(range(len(markers)), 2):
        if _overlap(wide[i], wide[j]):
            raise ConfigurationError(
                f"tags {i + 1} and {j + 1} with sides of {1e3 * a:.3g} mm overlap, or the white "
                f"around them does: give "
                "a smaller tag_side_m"
            )
    return corners


def bordered(corners: Array) -> Array:
    """(..., 4, 2) corners of tags with the white around them, of those of their black squares."""
    middle = corners.mean(axis=-2, keepdims=True)
    wider: Array = middle + (1.0 + 2.0 * BORDER / CELLS) * (corners - middle)
    return wider


def _overlap(a: Array, b: Array) -> bool:
    """Whether two squares (4, 2) overlap: no edge of either has the other one beyond it."""
    for one, other in ((a, b), (b, a)):
        for i in range(2):
            along = one[i + 1] - one[i]
            mine = one @ along
            theirs = other @ along
            if mine.max() <= theirs.min() or theirs.max() <= mine.min():
                return False
    return True
