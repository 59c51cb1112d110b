"""Where a camera is, from what it sees: section 2, third part of the computer vision algorithm."""

from __future__ import annotations

import numpy as np

from ..compiled import load
from ..robots.geometry import Pose
from ..rows import Array


def estimated_pose(markers: Array, normalised: Array, near: Pose) -> Pose:
    """Pose of the camera in the target's frame that explains an image best: Gauss–Newton from a pose near by.

    Markers are (m, 3) in the target's frame [m], seen at normalised coordinates (m, 2). Where they do not determine the
    pose, it is as near by. Raises LinAlgError if numbers leave the range of floating point.
    """
    R, t, seen = np.array(near.R, order="C"), np.array(near.t), np.ascontiguousarray(normalised)
    scratch = np.empty(64 * len(markers) + 256), np.zeros(1, dtype=np.int64)
    if not load("sensing").estimate(np.ascontiguousarray(markers), seen, R, t, *scratch):
        raise np.linalg.LinAlgError("no pose explains the image within the range of floating point")
    return Pose(R, t)
