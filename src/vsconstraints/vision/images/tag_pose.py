"""What an image of a board says: where the markers are in it, and where the camera is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...errors import InvalidInput
from ...robots.geometry import Pose, distance
from ...rows import Array, BoolArray
from ..camera import Camera
from .board import Board
from .detectors import Detector, Pixels, demand_image

#: Root mean square of the corners' distances from where a pose has them, above which they are of no
#: such board [px].
MAX_RESIDUAL = 5.0
#: Two poses explain a plane that is seen nearly along its normal: one by up to this factor worse
#: counts as well.
AS_GOOD = 2.0


class TagPose(NamedTuple):
    """What one image says of M markers.

    The camera's pose in the target's frame, None if no tag was usable; ideal pixels (M, 2) of the
    markers from the image's centre, where the pose has them if their tag was not seen (M,); the
    root mean square of the corners' distances from where the pose has them; numbers of tags that
    are not the board's, or were seen twice; and whether no pose explains the tags that were seen.
    """

    camera: Pose | None
    pixels: Array
    seen: BoolArray
    residual_px: float = np.nan
    foreign: tuple[int, ...] = ()
    unfit: bool = False


def locate_board(
    image: Pixels, detector: Detector, board: Board, camera: Camera, near: Pose | None = None
) -> TagPose:
    """What an image (H, W) of grey levels says, with board and camera as they are believed to be.

    ``near`` is the camera's expected pose in the target's frame, which chooses between two that
    explain the image. Raises InvalidInput if the array is no image, or has another size than the
    camera was calibrated for.
    """
    demand_image(image)
    W, H = camera.size
    height, width = image.shape
    if (width, height) != (W, H):
        raise InvalidInput(
            f"an image of {width} × {height} px, with a camera calibrated for {W:g} × {H:g} px"
        )
    tags = detector.find(image)
    M = len(board.ids)
    known = {int(number): i for i, number in enumerate(board.ids)}
    numbers = tags.ids.tolist()
    own = [k for k, number in enumerate(numbers) if number in known and numbers.count(number) == 1]
    foreign = tuple(sorted({number for k, number in enumerate(numbers) if k not in own}))
    pixels = np.full((M, 2), np.nan)
    seen = np.zeros(M, dtype=np.bool_)
    corners: Array = np.empty((0, 4, 2))
    if own:
        corners, certain = _undistorted(
            camera, camera.from_corner(tags.corners[own], detector.counts)
        )
        own = [k for k, sure in zip(own, certain, strict=True) if sure]
        corners = corners[certain]
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
    pixels[at] = corners[:, 0]
    seen[at] = True
    return TagPose(board.pose @ pose, pixels, seen, residual_px, foreign)


def _undistorted(camera: Camera, corners: Array) -> tuple[Array, BoolArray]:
    """Ideal pixels of tags' corners (n, 4, 2), and (n,) whether the lens can be inverted where all
    four are.
    """
    if camera.distortion is None:
        return corners, np.ones(len(corners), dtype=np.bool_)
    ideal, certain = camera.distortion.remove(camera.normalised(corners))
    return camera.pixels(ideal), np.asarray(certain.all(axis=1))


def board_pose(
    flat: Array, normalised: Array, near: Pose | None = None
) -> tuple[Pose | None, float]:
    """Pose of the camera in the board's frame that explains points of the board best.

    One pose is found in closed form (IPPE: Collins & Bartoli 2014) and refined by Levenberg and
    Marquardt's method. A plane that is seen from afar has a second one: tilted the other way,
    mirrored along the line of sight (Schweighofer & Pinz 2006). It is refined likewise; of two
    about as good, the one nearer to the expected pose is taken.

    ``flat`` (N, 2) are four or more points of the board in its plane [m], ``normalised`` (N, 2)
    where they are in the image. The pose is None if there is none with the points in front of the
    camera; beside it is the root mean square of the points' distances from where it has them, in
    normalised coordinates.
    """
    import cv2

    solid = np.pad(flat, ((0, 0), (0, 1)))
    eye = np.eye(3)
    found: list[tuple[float, Pose]] = []
    done, turn, shift = cv2.solvePnP(solid, normalised, eye, None, flags=cv2.SOLVEPNP_IPPE)
    if not done:
        return None, np.nan
    middle = solid.mean(axis=0)
    R = cv2.Rodrigues(turn)[0]
    there = R @ middle + shift.ravel()
    mirrored = (
        (eye - 2.0 * np.outer(there, there) / (there @ there)) @ R @ np.diag((1.0, 1.0, -1.0))
    )
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
    error, pose = min(found, key=lambda each: each[0])
    if near is not None:
        good = [each for each in found if each[0] <= AS_GOOD * error]
        error, pose = min(good, key=lambda each: distance(each[1], near)[1])
    return pose, error
