"""What an image of a board says: where the markers are in it, and where the camera is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import InvalidInput
from ...robots.geometry import Pose, distance
from ...rows import Array, BoolArray
from ..camera import Camera
from .board import Board
from .detectors import Detector, Pixels

MAX_RESIDUAL = 5.0
"""Root mean square of the corners' distances from where a pose has them, above which they are of no such board [px]."""

AS_GOOD = 2.0
"""Two poses explain a plane that is seen nearly along its normal: one by up to this factor worse counts as well."""


@dataclass(frozen=True)
class TagPose:
    """What one image says of M markers.

    Attributes
    ----------
    camera
        Its pose in the target's frame; None if no tag was usable.
    pixels
        (M, 2) ideal pixels of the markers from the image's centre: of those whose tag was not seen, where the pose has
        them.
    seen
        (M,) whose tag was.
    residual_px
        Root mean square of the corners' distances from where the pose has them.
    foreign
        Numbers of tags that were seen and are not the board's, or are on it twice.
    unfit
        Whether tags were seen, but no pose explains them.
    """

    camera: Pose | None
    pixels: Array
    seen: BoolArray
    residual_px: float = np.nan
    foreign: tuple[int, ...] = ()
    unfit: bool = False


def locate_board(image: Pixels, detector: Detector, board: Board, camera: Camera, near: Pose | None = None) -> TagPose:
    """What an image (H, W) says.

    Parameters
    ----------
    image
        Grey levels.
    detector
        What finds the tags.
    board, camera
        As they are believed to be.
    near
        The camera's pose in the target's frame as it is expected, which chooses between two that explain the image.

    Raises
    ------
    InvalidInput
        if the image has another size than the camera was calibrated for.
    """
    W, H = camera.size
    height, width = image.shape
    if (width, height) != (W, H):
        raise InvalidInput(f"an image of {width} × {height} px, with a camera calibrated for {W:g} × {H:g} px")
    tags, M = detector.find(image), len(board.ids)
    known = {int(number): i for i, number in enumerate(board.ids)}
    numbers = tags.ids.tolist()
    own = [k for k, number in enumerate(numbers) if number in known and numbers.count(number) == 1]
    foreign = tuple(sorted({number for k, number in enumerate(numbers) if k not in own}))
    pixels, seen = np.full((M, 2), np.nan), np.zeros(M, dtype=np.bool_)
    corners: Array = np.empty((0, 4, 2))
    if own:
        corners, certain = _undistorted(camera, camera.from_corner(tags.corners[own], detector.counts))
        own, corners = [k for k, sure in zip(own, certain, strict=True) if sure], corners[certain]
    if not own:
        return TagPose(None, pixels, seen, foreign=foreign)
    at = [known[numbers[k]] for k in own]
    flat = board.corners[at].reshape(-1, 2)
    expected = None if near is None else board.camera_in_board(near)
    pose, residual = board_pose(flat, camera.normalised(corners.reshape(-1, 2)), expected)
    residual_px = residual * float(np.mean(camera.focal))
    if pose is None or residual_px > MAX_RESIDUAL:
        return TagPose(None, pixels, seen, residual_px, foreign, unfit=True)
    P = (np.pad(board.corners[:, 0], ((0, 0), (0, 1))) - pose.t) @ pose.R
    pixels = camera.pixels(P[:, :2] / P[:, 2:])
    pixels[at], seen[at] = corners[:, 0], True
    return TagPose(board.camera_in_target(pose), pixels, seen, residual_px, foreign)


def _undistorted(camera: Camera, corners: Array) -> tuple[Array, BoolArray]:
    """Ideal pixels of tags' corners (n, 4, 2), and (n,) whether the lens can be inverted where all four are."""
    if camera.distortion is None:
        return corners, np.ones(len(corners), dtype=np.bool_)
    ideal, certain = camera.distortion.remove(camera.normalised(corners))
    return camera.pixels(ideal), np.asarray(certain.all(axis=1))


def board_pose(flat: Array, normalised: Array, near: Pose | None = None) -> tuple[Pose | None, float]:
    """Pose of the camera in the board's frame that explains points of the board best.

    One pose is found in closed form (IPPE: Collins & Bartoli 2014) and refined by Levenberg and Marquardt's method. A
    plane that is seen from afar has a second one: tilted the other way, mirrored along the line of sight (Schweighofer
    & Pinz 2006). It is refined likewise.

    Parameters
    ----------
    flat
        (N, 2) points of the board in its plane [m], four or more.
    normalised
        (N, 2) their normalised coordinates in the image.
    near
        Expected pose: of two that explain the image about as well, the nearer one is taken.

    Returns
    -------
    tuple
        The pose, None if there is none with the points in front of the camera, and the root mean square of the points'
        distances from where it has them, in normalised coordinates.
    """
    import cv2

    solid, eye = np.pad(flat, ((0, 0), (0, 1))), np.eye(3)
    found: list[tuple[float, Pose]] = []
    done, turn, shift = cv2.solvePnP(solid, normalised, eye, None, flags=cv2.SOLVEPNP_IPPE)
    if not done:
        return None, np.nan
    middle = solid.mean(axis=0)
    R = cv2.Rodrigues(turn)[0]
    there = R @ middle + shift.ravel()
    mirrored = (eye - 2.0 * np.outer(there, there) / (there @ there)) @ R @ np.diag((1.0, 1.0, -1.0))
    for start in (R, mirrored):
        begun = cv2.Rodrigues(start)[0], (there - start @ middle)[:, None]
        refined, moved = cv2.solvePnPRefineLM(solid, normalised, eye, None, *begun)
        R = cv2.Rodrigues(refined)[0]
        P = solid @ R.T + moved.ravel()
        if not (np.isfinite(P).all() and (P[:, 2] > 0.0).all()):
            continue
        off = P[:, :2] / P[:, 2:] - normalised
        found.append((float(np.sqrt((off**2).sum(axis=1).mean())), Pose(R, moved.ravel()).inverse))
    if not found:
        return None, np.nan
    least = min(error for error, _ in found)
    if near is not None:
        found = [one for one in found if one[0] <= AS_GOOD * least]
        error, pose = min(found, key=lambda one: distance(one[1], near)[1])
        return pose, error
    error, pose = min(found, key=lambda one: one[0])
    return pose, error
