"""Tag detectors of AprilTag and OpenCV."""

from __future__ import annotations

import atexit
import math
from collections.abc import Callable
from functools import cache
from typing import Any, Literal, NamedTuple

import numpy as np

from ..errors import InvalidInput
from ..plugins.extras import demand
from ..rows import Array, IntArray

MAX_WRONG_BITS = 1  #: Largest number of wrong bits of an accepted tag.
#: Least number of pixels of an image: with fewer, AprilTag's library allocates too little memory
#: for outlines and writes out of bounds.
MIN_PIXELS = 20_480
Pixels = np.ndarray[tuple[int, int], np.dtype[np.uint8]]  #: (H, W) grey levels.


class Tags(NamedTuple):
    """Tags in an image: their numbers (n,) and the corners of their black squares (n, 4, 2).

    Corners are in the order of :data:`.board.SQUARE` on the print, in pixels from the image's top
    left corner.
    """

    ids: IntArray
    corners: Array


class Detector(NamedTuple):
    """Detector of tags of the family tag36h11.

    ``counts`` states how it counts pixels: see :meth:`.Camera.from_corner`. ``find`` raises
    InvalidInput for an array that is no image of grey levels.
    """

    find: Callable[[Pixels], Tags]
    counts: Literal["edges", "centres"]


def require_image(image: object) -> None:
    """Raise InvalidInput unless the value is an image (H, W) of grey levels from 0 to 255."""
    right = "an image must be an array (H, W) of grey levels, uint8"
    if not isinstance(image, np.ndarray):
        raise InvalidInput(f"{right}, not {type(image).__name__}")
    if image.ndim == 3:
        raise InvalidInput(
            f"{right}, not of colours {image.shape}: cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) "
            "gives it"
        )
    if image.ndim != 2 or not image.size:
        raise InvalidInput(f"{right}, not of the shape {image.shape}")
    if image.dtype != np.uint8:
        raise InvalidInput(
            f"{right}, not {image.dtype}: scale it to 0 to 255, then image.astype(np.uint8)"
        )


def tags_of(found: list[tuple[int, Any]]) -> Tags:
    """Return tags in the order of their numbers."""
    found.sort(key=lambda tag: tag[0])
    numbers = [number for number, _ in found]
    corners = [outline for _, outline in found]
    return Tags(
        ids=np.array(numbers, dtype=np.int64),
        corners=np.array(corners, dtype=np.float64).reshape(-1, 4, 2),
    )


def roomy(image: Pixels) -> Pixels:
    """Return the image with its last row repeated until the detector's least size is reached."""
    height, width = image.shape
    missing = math.ceil(MIN_PIXELS / width) - height
    if missing <= 0:
        return image
    below = ((0, missing), (0, 0))
    return np.pad(image, below, "edge")


@cache
def apriltag() -> Detector:
    """AprilTag's detector, on an image of half the size with edges refined at full size."""
    demand("images")
    import pupil_apriltags

    detector = pupil_apriltags.Detector(families="tag36h11", nthreads=1, quad_decimate=2.0)
    # the detector's finaliser frees the families before the detector, which still reads them: skip
    # it at exit, where all memory is freed anyway
    atexit.register(setattr, detector, "tag_detector_ptr", None)
    # its corners start elsewhere on OpenCV's print of a tag, and run in the opposite direction
    order = [1, 0, 3, 2]

    def find(image: Pixels) -> Tags:
        require_image(image)
        found = []
        for tag in detector.detect(roomy(image)):
            if tag.hamming <= MAX_WRONG_BITS:
                found.append((tag.tag_id, tag.corners[order]))
        return tags_of(found)

    return Detector(find, "edges")


@cache
def aruco() -> Detector:
    """OpenCV's detector, with subpixel refinement of the corners."""
    demand("images")
    import cv2

    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    detector = cv2.aruco.ArucoDetector(family, parameters)

    def find(image: Pixels) -> Tags:
        require_image(image)
        corners, ids, _ = detector.detectMarkers(image)
        # numbers are (N, 1) in OpenCV 4, (N,) in OpenCV 5, and None if no tag was found
        numbers = [] if ids is None else np.ravel(ids).tolist()
        return tags_of(list(zip(numbers, corners, strict=True)))

    return Detector(find, "centres")


#: Detectors by their names in scenario files.
DETECTORS: dict[str, Callable[[], Detector]] = {"apriltag": apriltag, "aruco": aruco}
