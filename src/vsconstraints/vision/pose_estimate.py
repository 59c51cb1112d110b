"""Where a camera is, from what it sees: section 2, third part of the computer vision algorithm."""

from __future__ import annotations

import numpy as np

from ..formulas.rotation import turn_by
from ..qp.decomposition import svd
from ..robots.geometry import Pose
from ..rows import Array
from .scene import MINIMUM_DEPTH, interaction_matrix

ITERATIONS = 10
"""Of the pose estimation at most; three or four are usual."""

CONVERGED = 1e-10
"""Step of the pose estimation [m, rad] at which it ends."""

RANK_TOLERANCE = 1e-4
"""Directions of the camera's motion to which the image is less sensitive than this, relative to the most sensitive
one, are left as they are where the search starts."""


def estimated_pose(markers: Array, normalised: Array, near: Pose) -> Pose:
    """Pose of the camera in the target's frame that explains an image best: Gauss–Newton from a pose near by.

    Singular values by LAPACK here, reflections in :mod:`vsconstraints.compiled.sensing`: the two are a pair, which
    ``test_both_forms_find_the_same_pose`` holds together.

    Parameters
    ----------
    markers
        (m, 3) in the target's frame [m].
    normalised
        (m, 2) measured normalised coordinates.
    near
        Where the search starts; also what counts where the markers do not determine the pose.

    Raises
    ------
    numpy.linalg.LinAlgError
        if numbers leave the range of floating point.
    """
    camera = near
    for _ in range(ITERATIONS):
        P = (markers - camera.t) @ camera.R
        Z = np.maximum(P[:, 2], MINIMUM_DEPTH)
        xy = P[:, :2] / Z[:, None]
        L = interaction_matrix(xy, Z).reshape(-1, 6)
        U, s, Vt = svd(L, full_matrices=False)
        kept = s > RANK_TOLERANCE * s[0]
        step = Vt[kept].T @ ((U[:, kept].T @ (normalised - xy).ravel()) / s[kept])
        camera = camera @ Pose(np.array(turn_by(step[3:].tolist())), step[:3])
        if np.sqrt(step @ step) < CONVERGED:
            break
    return camera
