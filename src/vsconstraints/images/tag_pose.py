"""Estimation of marker pixels and camera pose from an image of a board."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InvalidInput
from ..robots.geometry import Pose, distance
from ..rows import Array, BoolArray
from ..vision.camera import Camera
from .board import Board, in_space
from .detectors import Detector, Pixels, require_image

#: Largest root mean square reprojection error of corners that belong to the board [px].
MAX_RESIDUAL = 5.0
#: Two poses explain a plane that is seen nearly along its normal: largest ratio of their errors at
#: which both are plausible.
AS_GOOD = 2.0


class TagPose(NamedTuple):
    """Measurement of M markers in one image.

    - ``camera``: pose of the camera in the target's frame, None if no tag was usable.
    - ``pixels``: ideal pixels (M, 2) of the markers from the image centre, predicted from the pose
      for markers whose tag was not seen.
    - ``seen``: True (M,) for markers whose tag was seen.
    - ``residual_px``: root mean square reprojection error of the corners [px].
    - ``foreign``: numbers of tags that do not belong to the board, or were seen twice.
    - ``unfit``: True if no pose explains the tags that were seen.
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
    """Return the measurement from an image (H, W) of grey levels, for a believed board and camera.

    ``near`` is the expected pose of the camera in the target's frame; it selects one of two poses
    that explain the image. Raises InvalidInput if the array is no image, or if its size differs
    from that of the calibration.
    """
    require_image(image)
    calibrated_width, calibrated_height = camera.size
    height, width = image.shape
    if width != calibrated_width or height != calibrated_height:
        raise InvalidInput(
            f"an image of {width} × {height} px, with a camera calibrated for "
            f"{calibrated_width:g} × {calibrated_height:g} px"
        )
    tags = detector.find(image)
    ids = board.ids.tolist()
    numbers = tags.ids.tolist()
    usable = []  # indices of detected tags
    markers = []  # their markers
    foreign = set()
    for k, number in enumerate(numbers):
        if number in ids and numbers.count(number) == 1:
            usable.append(k)
            markers.append(ids.index(number))
        else:
            foreign.add(number)
    measurement = TagPose(
        camera=None,
        pixels=np.full((len(ids), 2), np.nan),
        seen=np.zeros(len(ids), dtype=np.bool_),
        foreign=tuple(sorted(foreign)),
    )
    if not markers:
        return measurement
    measured = camera.from_corner(tags.corners[usable], detector.counts)
    corners, certain = _undistorted(camera, measured)
    corners = corners[certain]
    located = np.array(markers)[certain]
    if not len(located):
        return measurement
    flat = board.corners[located].reshape(-1, 2)
    normalised = camera.normalised(corners.reshape(-1, 2))
    expected = None if near is None else board.camera_in_board(near)
    pose, residual = board_pose(flat, normalised, expected)
    residual_px = residual * float(np.mean(camera.focal))
    if pose is None or residual_px > MAX_RESIDUAL:
        return measurement._replace(residual_px=residual_px, unfit=True)
    # markers that were seen are where they were measured
    pixels = camera.pixels(_projected(board.corners[:, 0], pose))
    pixels[located] = corners[:, 0]
    measurement.seen[located] = True
    return measurement._replace(camera=board.pose @ pose, pixels=pixels, residual_px=residual_px)


def _projected(flat: Array, camera: Pose) -> Array:
    """Return normalised coordinates (N, 2) of points (N, 2) of a board.

    ``camera`` is the camera's pose in the board's frame.
    """
    P = (in_space(flat) - camera.t) @ camera.R
    normalised: Array = P[:, :2] / P[:, 2:]
    return normalised


def _undistorted(camera: Camera, corners: Array) -> tuple[Array, BoolArray]:
    """Return ideal pixels of tags' corners (n, 4, 2).

    The second array (n,) is True if the distortion can be inverted at all four corners of a tag.
    """
    if camera.distortion is None:
        return corners, np.ones(len(corners), dtype=np.bool_)
    distorted = camera.normalised(corners)
    ideal, certain = camera.distortion.remove(distorted)
    return camera.pixels(ideal), np.asarray(certain.all(axis=1))


def board_pose(
    flat: Array, normalised: Array, near: Pose | None = None
) -> tuple[Pose | None, float]:
    """Return the pose of the camera in the board's frame that explains points of the board best.

    One pose is found in closed form (IPPE: Collins & Bartoli 2014) and refined by the
    Levenberg–Marquardt method. A plane that is seen from afar has a second one: tilted the other
    way, mirrored along the line of sight (Schweighofer & Pinz 2006). It is refined in the same way.
    If both are about equally good, the one nearer to the expected pose is taken.

    ``flat`` (N, 2) are four or more points in the plane of the board [m], ``normalised`` (N, 2)
    their image. The pose is None if no pose has the points in front of the camera. The second value
    is the root mean square reprojection error in normalised coordinates.
    """
    import cv2

    points = in_space(flat)
    identity = np.eye(3)
    found, turn, shift = cv2.solvePnP(points, normalised, identity, None, flags=cv2.SOLVEPNP_IPPE)
    if not found:
        return None, np.nan
    # poses of the board in the camera's frame
    middle = points.mean(axis=0)
    first_R, _ = cv2.Rodrigues(turn)
    sight = first_R @ middle + shift.ravel()
    along_sight = np.outer(sight, sight) / (sight @ sight)
    mirror = np.eye(3) - 2.0 * along_sight
    second_R = mirror @ first_R @ np.diag((1.0, 1.0, -1.0))
    candidates: list[tuple[Pose, float]] = []
    for start_R in (first_R, second_R):
        start_t = sight - start_R @ middle
        pose = _refined(points, normalised, Pose(start_R, start_t))
        P = points @ pose.R.T + pose.t
        depths = P[:, 2:]
        if np.isfinite(P).all() and (depths > 0.0).all():
            deviation = P[:, :2] / depths - normalised
            squared = (deviation**2).sum(axis=1)
            error = float(np.sqrt(squared.mean()))
            candidates.append((pose.inverse, error))
    if not candidates:
        return None, np.nan
    candidates.sort(key=lambda candidate: candidate[1])
    best, least_error = candidates[0]
    if near is None:
        return best, least_error
    plausible = [(pose, error) for pose, error in candidates if error <= AS_GOOD * least_error]
    return min(plausible, key=lambda candidate: distance(candidate[0], near)[1])


def _refined(points: Array, normalised: Array, start: Pose) -> Pose:
    """Return the pose of points (N, 3) before the camera, refined from ``start`` by their image."""
    import cv2

    turn, _ = cv2.Rodrigues(start.R)
    shift = start.t[:, None]
    identity = np.eye(3)
    turn, shift = cv2.solvePnPRefineLM(points, normalised, identity, None, turn, shift)
    R, _ = cv2.Rodrigues(turn)
    return Pose(R, shift.ravel())
