"""Rendering of a board of tags through a camera, in grey levels.

Blur, noise and motion are modelled. The result is deterministic.
"""

from __future__ import annotations

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
from .board import BORDER, CELLS, Board, bordered
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
Where = Callable[[float], Pose]


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
        self, where: Where, random: np.random.Generator, hidden: BoolArray | None = None
    ) -> Pixels:
        """Return an image (H, W) of grey levels.

        Pixels that are ``hidden`` (H, W) show an obstacle.
        """
        import cv2

        settings = self.settings
        image = self._exposed(where)
        if hidden is not None:
            image[hidden] = OBSTACLE
        if settings.blur_px:
            image = cv2.GaussianBlur(
                image, (0, 0), settings.blur_px, borderType=cv2.BORDER_REPLICATE
            )
        image *= settings.light
        if settings.noise:
            noise = random.standard_normal(image.shape, dtype=np.float32)
            image += np.float32(settings.noise) * noise
        return np.clip(np.rint(image), 0.0, 255.0).astype(np.uint8)

    def _exposed(self, where: Where) -> Array:
        """Return the mean image (H, W) over the instants of an exposure."""
        import cv2

        W, H = map(int, self.camera.size)
        half = 0.5 * self.settings.exposure_s
        moved = 0.0
        if half:
            starts = self._normalised(_rounded(where(-half)))
            ends = self._normalised(_rounded(where(half)))
            if starts is not None and ends is not None:
                moved = float(np.abs((ends - starts) * np.asarray(self.camera.focal)).max())
        count = int(np.clip(np.ceil(moved), 1, MAX_EXPOSURES))
        # midpoints of equal parts of the exposure
        instants = half * (2.0 * np.arange(count) + 1.0 - count) / count
        total = np.zeros((H, W), dtype=np.float32)
        for instant in instants:
            fine = np.full((FINER * H, FINER * W), AROUND, dtype=np.float32)
            self._draw(fine, where, float(instant))
            total += cv2.resize(fine, (W, H), interpolation=cv2.INTER_AREA)
        return total / np.float32(count)

    def _normalised(self, camera: Pose) -> Array | None:
        """Return normalised coordinates (M · 4, 2) of the tags' outer corners.

        Returns None unless all of them are in front of the camera.
        """
        seen = self.board.camera_in_board(camera)
        flat = bordered(self.board.corners).reshape(-1, 2)
        P = (np.pad(flat, ((0, 0), (0, 1))) - seen.t) @ seen.R
        return P[:, :2] / P[:, 2:] if (P[:, 2] > 1e-3).all() else None

    def _draw(self, fine: Array, where: Where, instant: float) -> None:
        """Draw all tags at an instant on an image of FINER H × FINER W pixels."""
        import cv2

        late = 0.5 * self.settings.rolling_s
        shifts = (-late, 0.0, late) if late else (0.0,)
        poses = [_rounded(where(instant + shift)) for shift in shifts]
        outlines = []
        for pose in poses:
            corners = self._normalised(pose)
            if corners is None:
                return
            pixels = self.camera.distort(self.camera.pixels(corners))
            outlines.append(self.camera.to_corner(pixels).reshape(-1, 4, 2))
        height, width = fine.shape
        for i, number in enumerate(self.board.ids.tolist()):
            outline = np.array([corners[i] for corners in outlines])
            box = FINER * outline.reshape(-1, 2)
            low = np.clip(np.floor(box.min(axis=0)) - FINER, 0, (width, height)).astype(int)
            high = np.clip(np.ceil(box.max(axis=0)) + FINER, 0, (width, height)).astype(int)
            if (high <= low).any():
                continue
            maps = []
            for pose in poses:
                homography = self._to_tag(i, self.board.camera_in_board(pose))
                if homography is not None:
                    maps.append(homography)
            if len(maps) < len(poses):
                continue
            columns = slice(low[0], high[0])
            rows = slice(low[1], high[1])
            x, y = self._rays(rows, columns)
            tag_x, tag_y = _looked_up(maps, x, y, _late(rows, height))
            cell = FINER * float(np.ptp(outline, axis=1).max()) / (CELLS + 2 * BORDER)
            texels = int(min(2 ** np.ceil(np.log2(max(cell, 2.0))), MAX_TEXELS))
            # cells from the corner of the black square; OpenCV counts centres
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

    def _to_tag(self, i: int, camera: Pose) -> Array | None:
        """Return the homography (3, 3) from normalised image coordinates to cells of a tag.

        Returns None if the tag is seen from behind.
        """
        corner, right, _, down = self.board.corners[i] / self.board.cell
        plane = np.zeros((3, 3))
        plane[:2, 0] = (right - corner) / CELLS
        plane[:2, 1] = (down - corner) / CELLS
        plane[:2, 2] = corner
        # from points in the plane, in cells, to the camera's frame
        seen: Array = camera.R.T @ plane
        seen[:, 2] -= camera.R.T @ camera.t / self.board.cell
        return np.linalg.inv(seen) if np.linalg.det(seen) > 0.0 else None

    def _rays(self, rows: slice, columns: slice) -> tuple[Array, Array]:
        """Return ideal normalised coordinates of the points in the rows and columns.

        The arrays are (h, w), or broadcast to that shape.
        """
        camera = self.camera
        if camera.distortion is not None:
            width, height = map(int, camera.size)
            offset = tuple(camera.offset.tolist())
            x, y = _bent(camera.focal, offset, (width, height), camera.distortion)
            return x[rows, columns], y[rows, columns]
        u = (np.arange(columns.start, columns.stop) + 0.5) / FINER
        v = (np.arange(rows.start, rows.stop) + 0.5) / FINER
        middle = camera.to_corner(camera.offset)
        x = (u - middle[0]) / camera.focal[0]
        y = (v - middle[1]) / camera.focal[1]
        return x[None, :].astype(np.float32), y[:, None].astype(np.float32)


def _late(rows: slice, height: int) -> Array:
    """Return the relative time (h, 1) of image rows: from −1 for the first to 1 for the last."""
    late = (np.arange(rows.start, rows.stop) + 0.5)[:, None] / (0.5 * height) - 1.0
    return late.astype(np.float32)


def _looked_up(maps: Sequence[Array], x: Array, y: Array, late: Array) -> tuple[Array, Array]:
    """Return the points where rays meet a tag [cells].

    With three maps, at the relative times −1, 0 and 1, a quadratic in time interpolates them.
    """
    h = maps[0][..., None, None].astype(np.float32)
    if len(maps) == 3:
        before, now, after = np.array(maps, dtype=np.float32)[..., None, None]
        h = now + late * 0.5 * (after - before) + late**2 * (0.5 * (after + before) - now)
    scale = h[2, 0] * x + h[2, 1] * y + h[2, 2]
    tag_x = (h[0, 0] * x + h[0, 1] * y + h[0, 2]) / scale
    tag_y = (h[1, 0] * x + h[1, 1] * y + h[1, 2]) / scale
    return tag_x, tag_y


def _rounded(pose: Pose) -> Pose:
    return Pose(pose.R.round(ROUNDED), pose.t.round(ROUNDED))


@lru_cache(maxsize=256)
def _picture(number: int, texels: int) -> Array:
    """Return the picture (n, n) of a tag with its white border, ``texels`` points per cell."""
    import cv2

    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    bits = cv2.aruco.generateImageMarker(family, number, CELLS)
    bordered_bits = np.pad(bits, BORDER, constant_values=255)
    grey: Array = np.where(bordered_bits > 127, np.float32(WHITE), np.float32(BLACK))
    picture: Array = np.kron(grey, np.ones((texels, texels), dtype=np.float32))
    return picture


@lru_cache(maxsize=2)
def _bent(
    focal: tuple[float, float],
    offset: tuple[float, float],
    size: tuple[int, int],
    distortion: Distortion,
) -> tuple[Array, Array]:
    """Return ideal normalised coordinates x and y (FINER H, FINER W) of all points of an image.

    They are NaN where the distortion cannot be inverted.
    """
    knots = [np.linspace(0.0, side, -(-side // KNOT) + 1) for side in size]
    fine = [(np.arange(FINER * side) + 0.5) / FINER for side in size]
    # imported here, since it takes longer to load than all other imports of a run
    from scipy.interpolate import RectBivariateSpline

    pinhole = Camera(focal, size, (offset[0] + 0.5 * size[0], offset[1] + 0.5 * size[1]))
    grid = pinhole.from_corner(np.stack(np.meshgrid(*knots), axis=-1))
    ideal, certain = distortion.remove(pinhole.normalised(grid))

    def interpolated(values: Array | BoolArray, degree: int) -> Array:
        spline = RectBivariateSpline(knots[1], knots[0], values, kx=degree, ky=degree)
        return np.asarray(spline(fine[1], fine[0]))

    x = interpolated(ideal[..., 0], 3)
    y = interpolated(ideal[..., 1], 3)
    beyond = interpolated(~certain, 1) > 0.0
    x[beyond] = np.nan
    y[beyond] = np.nan
    return x.astype(np.float32), y.astype(np.float32)
