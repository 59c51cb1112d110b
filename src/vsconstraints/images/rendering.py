"""Rendering of a board of tags through a camera, in grey levels.

Blur, noise and motion are modelled. The result is deterministic.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..errors import ConfigurationError
from ..plugins.extras import demand
from ..robots.geometry import Pose
from ..rows import Array, BoolArray
from ..vision.camera import Camera
from ..vision.distortion import Distortion
from .board import BORDER, CELLS, Board, bordered, in_space
from .detectors import Pixels
from .settings import ImageSettings

FINER = 2  #: Points per side of a pixel at which a tag is sampled.
#: Grey levels of the print, of its surroundings, and of obstacles in front of it.
BLACK = 30.0
WHITE = 220.0
AROUND = 120.0
OBSTACLE = 80.0
#: Largest number of points along a cell of a tag's picture; and largest number of instants that an
#: exposure averages, one per pixel of motion.
MAX_TEXELS = 64
MAX_EXPOSURES = 16
#: Distance [px] of the grid points at which a lens is inverted; cubic splines interpolate between
#: them.
KNOT = 8
#: Decimals of the rendered pose: poses that differ by rounding errors give the same image.
ROUNDED = 8
#: Pose of the camera in the target's frame as a function of time [s], zero in the middle of the
#: exposure of the image's middle row.
CameraMotion = Callable[[float], Pose]


@dataclass(frozen=True)
class Renderer:
    """Renders a board with its printed tags through a camera, tag by tag.

    Every tag is sampled at the points where rays through the pixels meet the board. Lens
    distortion, rolling shutter and motion blur are therefore exact. Raises ConfigurationError if
    OpenCV is not installed, or if the image size is not an integer.
    """

    board: Board
    camera: Camera
    settings: ImageSettings

    def __post_init__(self) -> None:
        demand("images")
        if any(side != int(side) for side in self.camera.size):
            raise ConfigurationError(f"images have whole numbers of pixels, not {self.camera.size}")

    def render(
        self, motion: CameraMotion, random: np.random.Generator, hidden: BoolArray | None = None
    ) -> Pixels:
        """Return an image (H, W) of grey levels.

        Pixels that are ``hidden`` (H, W) show an obstacle.
        """
        import cv2

        settings = self.settings
        image = self._expose(motion)
        if hidden is not None:
            image[hidden] = OBSTACLE
        if settings.blur_px:
            any_size = (0, 0)
            border = cv2.BORDER_REPLICATE
            image = cv2.GaussianBlur(image, any_size, settings.blur_px, borderType=border)
        image *= settings.light
        if settings.noise:
            noise = random.standard_normal(image.shape, dtype=np.float32)
            image += np.float32(settings.noise) * noise
        rounded = np.rint(image)
        return np.clip(rounded, 0.0, 255.0).astype(np.uint8)

    def _expose(self, motion: CameraMotion) -> Array:
        """Return the mean image (H, W) over the instants of an exposure."""
        import cv2

        width, height = map(int, self.camera.size)
        half = 0.5 * self.settings.exposure_s
        distance = self._greatest_motion(motion, half)
        count = int(np.clip(np.ceil(distance), 1, MAX_EXPOSURES))
        total = np.zeros((height, width), dtype=np.float32)
        fine = np.empty((FINER * height, FINER * width), dtype=np.float32)
        for k in range(count):
            # midpoints of equal parts of the exposure
            instant = half * (2.0 * k + 1.0 - count) / count
            fine.fill(AROUND)
            self._draw_tags(fine, motion, instant)
            total += cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA)
        return total / np.float32(count)

    def _greatest_motion(self, motion: CameraMotion, half: float) -> float:
        """Return the greatest motion of a corner [px] from −half to half [s].

        It is 0 without motion, or if a corner is not in front of the camera.
        """
        if half == 0.0:
            return 0.0
        starts = self._outer_corners(_rounded(motion(-half)))
        ends = self._outer_corners(_rounded(motion(half)))
        if starts is None or ends is None:
            return 0.0
        shift = (ends - starts) * np.asarray(self.camera.focal)
        return float(np.abs(shift).max())

    def _outer_corners(self, camera: Pose) -> Array | None:
        """Return normalised coordinates (M · 4, 2) of the corners of the tags' white borders.

        Return None unless all of them are in front of the camera.
        """
        in_board = self.board.camera_in_board(camera)
        flat = bordered(self.board.corners).reshape(-1, 2)
        P = (in_space(flat) - in_board.t) @ in_board.R
        depths = P[:, 2:]
        is_in_front = (depths > 1e-3).all()
        return P[:, :2] / depths if is_in_front else None

    def _draw_tags(self, fine: Array, motion: CameraMotion, instant: float) -> None:
        """Draw all tags at an instant on an image of FINER H × FINER W pixels."""
        instants = [instant]
        half = 0.5 * self.settings.rolling_s
        if half:
            # with a rolling shutter, at the times of the first, the middle and the last row
            instants = [instant - half, instant, instant + half]
        poses = []
        outlines = []  # of all tags, at each instant
        for time in instants:
            pose = _rounded(motion(time))
            corners = self._outer_corners(pose)
            if corners is None:
                return
            pixels = self.camera.distort(self.camera.pixels(corners))
            outline = self.camera.to_corner(pixels).reshape(-1, 4, 2)
            outlines.append(outline)
            poses.append(self.board.camera_in_board(pose))
        for i in range(len(self.board.ids)):
            homographies = []
            for pose in poses:
                homography = self._homography(i, pose)
                if homography is not None:
                    homographies.append(homography)
            if len(homographies) == len(poses):
                outline = np.array([corners[i] for corners in outlines])
                self._draw_tag(fine, i, outline, homographies)

    def _draw_tag(self, fine: Array, i: int, outline: Array, homographies: Sequence[Array]) -> None:
        """Draw tag i from its outlines (p, 4, 2) [px] and homographies at p instants."""
        import cv2

        size = fine.shape[::-1]
        corners = FINER * outline.reshape(-1, 2)
        least = np.floor(corners.min(axis=0)) - FINER
        greatest = np.ceil(corners.max(axis=0)) + FINER
        left, top = np.clip(least, 0, size).astype(int)
        right, bottom = np.clip(greatest, 0, size).astype(int)
        if right <= left or bottom <= top:
            return
        columns = slice(left, right)
        rows = slice(top, bottom)
        x, y = self._rays(rows, columns)
        times = _row_times(rows, len(fine))
        tag_x, tag_y = _points_on_tag(homographies, x, y, times)
        extent = float(np.ptp(outline, axis=1).max())
        texels = _texels(FINER * extent / (CELLS + 2 * BORDER))
        number = int(self.board.ids[i])
        # from cells, from the corner of the black square, to points, which OpenCV counts by centres
        scale = np.float32(texels)
        border = np.float32(BORDER)
        centre = np.float32(0.5)
        patch = np.ascontiguousarray(fine[rows, columns])
        cv2.remap(
            _picture(number, texels),
            scale * (tag_x + border) - centre,
            scale * (tag_y + border) - centre,
            cv2.INTER_LINEAR,
            dst=patch,
            borderMode=cv2.BORDER_TRANSPARENT,
        )
        fine[rows, columns] = patch

    def _homography(self, i: int, camera: Pose) -> Array | None:
        """Return the homography (3, 3) from normalised image coordinates to cells of a tag.

        ``camera`` is the camera's pose in the board's frame. Return None if the tag is seen from
        behind.
        """
        # all lengths in cells: (x, y, 1) of the tag to the plane of the board, then to the camera
        cell = self.board.cell
        corner, right, _, down = self.board.corners[i] / cell
        to_board = np.zeros((3, 3))
        to_board[:2, 0] = (right - corner) / CELLS
        to_board[:2, 1] = (down - corner) / CELLS
        to_board[:2, 2] = corner
        board_R = camera.R.T
        to_camera: Array = board_R @ to_board
        to_camera[:, 2] -= board_R @ camera.t / cell
        is_seen_from_front = np.linalg.det(to_camera) > 0.0
        return np.linalg.inv(to_camera) if is_seen_from_front else None

    def _rays(self, rows: slice, columns: slice) -> tuple[Array, Array]:
        """Return ideal normalised coordinates of the points in the rows and columns.

        The arrays are (h, w), or broadcast to that shape.
        """
        camera = self.camera
        if camera.distortion is not None:
            width, height = map(int, camera.size)
            offset = tuple(camera.offset.tolist())
            x, y = _lens_rays(camera.focal, offset, (width, height), camera.distortion)
            return x[rows, columns], y[rows, columns]
        u = _middles(columns) / FINER
        v = _middles(rows) / FINER
        u0, v0 = camera.to_corner(camera.offset)
        fu, fv = camera.focal
        x = ((u - u0) / fu).astype(np.float32)
        y = ((v - v0) / fv).astype(np.float32)
        return x[None, :], y[:, None]


def _middles(cells: slice) -> Array:
    """Return the middles (k,) of a range of rows or columns."""
    return np.arange(cells.start, cells.stop) + 0.5


def _texels(cell: float) -> int:
    """Return a power of two of points along a cell of ``cell`` points, at most MAX_TEXELS."""
    exponent = np.ceil(np.log2(max(cell, 2.0)))
    return int(min(2**exponent, MAX_TEXELS))


def _row_times(rows: slice, height: int) -> Array:
    """Return the relative time (h, 1) of image rows: from −1 for the first to 1 for the last."""
    times = _middles(rows) / (0.5 * height) - 1.0
    return times[:, None].astype(np.float32)


def _points_on_tag(
    homographies: Sequence[Array], x: Array, y: Array, times: Array
) -> tuple[Array, Array]:
    """Return the points where rays meet a tag [cells].

    Three homographies are those at the relative times −1, 0 and 1; a quadratic in time interpolates
    them.
    """
    # each entry of a homography is broadcast to the shape of the rays
    entries = np.array(homographies, dtype=np.float32)[..., None, None]
    homography = entries[0]
    if len(entries) == 3:
        first, middle, last = entries
        slope = last - first
        curvature = 0.5 * (last + first) - middle
        homography = middle + times * 0.5 * slope + times**2 * curvature
    # x and y times the scale, and the scale
    scaled = [by_x * x + by_y * y + constant for by_x, by_y, constant in homography]
    scaled_x, scaled_y, scale = scaled
    return scaled_x / scale, scaled_y / scale


def _rounded(pose: Pose) -> Pose:
    """Return a pose without its rounding errors, see :data:`ROUNDED`."""
    return Pose(pose.R.round(ROUNDED), pose.t.round(ROUNDED))


@lru_cache(maxsize=256)
def _picture(number: int, texels: int) -> Array:
    """Return the picture (n, n) of a tag with its white border, ``texels`` points per cell."""
    import cv2

    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    bits = cv2.aruco.generateImageMarker(family, number, CELLS)
    is_white = np.pad(bits, BORDER, constant_values=255) > 127
    cells = np.where(is_white, np.float32(WHITE), np.float32(BLACK))
    columns = np.repeat(cells, texels, axis=1)
    picture: Array = np.repeat(columns, texels, axis=0)
    return picture


@lru_cache(maxsize=2)
def _lens_rays(
    focal: tuple[float, float],
    offset: tuple[float, float],
    size: tuple[int, int],
    distortion: Distortion,
) -> tuple[Array, Array]:
    """Return ideal normalised coordinates x and y (FINER H, FINER W) of all points of an image.

    They are NaN where the distortion cannot be inverted.
    """
    # imported here, since it takes longer to load than all other imports of a run
    from scipy.interpolate import RectBivariateSpline

    width, height = size
    knots_u = np.linspace(0.0, width, math.ceil(width / KNOT) + 1)
    knots_v = np.linspace(0.0, height, math.ceil(height / KNOT) + 1)
    fine_u = _middles(slice(0, FINER * width)) / FINER
    fine_v = _middles(slice(0, FINER * height)) / FINER
    offset_u, offset_v = offset
    centre = (offset_u + 0.5 * width, offset_v + 0.5 * height)
    pinhole = Camera(focal, size, centre)
    grid = np.stack(np.meshgrid(knots_u, knots_v), axis=-1)
    distorted = pinhole.normalised(pinhole.from_corner(grid))
    ideal, certain = distortion.remove(distorted)

    def interpolate(values: Array | BoolArray, degree: int) -> Array:
        spline = RectBivariateSpline(knots_v, knots_u, values, kx=degree, ky=degree)
        return np.asarray(spline(fine_v, fine_u))

    x = interpolate(ideal[..., 0], 3)
    y = interpolate(ideal[..., 1], 3)
    is_beyond = interpolate(~certain, 1) > 0.0
    x[is_beyond] = np.nan
    y[is_beyond] = np.nan
    return x.astype(np.float32), y.astype(np.float32)
