"""The pinhole camera: pixels, normalised coordinates, and where it is mounted."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .errors import InvalidInput
from .geometry import Pose, vector
from .renamed import renamed
from .rows import Array, BoolArray

LARGEST_IMAGE = 1e4
"""Sides of an image beyond which boundaries in it are not looked for [px]."""


@renamed(focal="focal_px", size="size_px", principal_point="principal_point_px")
@dataclass(frozen=True)
class Camera:
    """A pinhole camera without distortion, carried by the end-effector or fixed in space.

    Pixel coordinates (u, v) are measured from the centre of the image, u to the right and v down, as in eq. (20);
    :meth:`from_corner` converts those measured from the top left corner.

    Attributes
    ----------
    focal_px
        (F_u, F_v): focal length divided by the size of a pixel [px].
    size_px
        (W, H): width and height of the image [px].
    principal_point_px
        (2,) where the optical axis meets the image, from the top left corner [px]; the centre if None.
    mount
        ᶜMₑ: end-effector (robot tip) coordinates to camera coordinates, for a camera that the robot carries.
    fixed
        Pose in the base frame of a camera that looks at the robot instead (eye-to-hand); None if the robot carries it.
    """

    focal_px: tuple[float, float]
    size_px: tuple[float, float]
    principal_point_px: tuple[float, float] | None = None
    mount: Pose = field(default_factory=Pose.identity)
    fixed: Pose | None = None

    def __post_init__(self) -> None:
        for name in ("focal_px", "size_px"):
            if (vector(getattr(self, name), 2, f"camera {name}") <= 0.0).any():
                raise InvalidInput(f"camera {name} must be positive, not {getattr(self, name)}")
        if max(self.size_px) > LARGEST_IMAGE:
            raise InvalidInput(f"camera size_px is at most {LARGEST_IMAGE:g} px a side, not {self.size_px}")
        if self.principal_point_px is not None:
            vector(self.principal_point_px, 2, "camera principal_point_px")
        if self.fixed is not None and (self.mount.t.any() or not np.array_equal(self.mount.R, np.eye(3))):
            raise InvalidInput("a camera is mounted on the robot or fixed in space, not both: give mount or fixed")

    @property
    def focal(self) -> tuple[float, float]:
        """:attr:`focal_px`."""
        return self.focal_px

    @property
    def size(self) -> tuple[float, float]:
        """:attr:`size_px`."""
        return self.size_px

    @property
    def principal_point(self) -> tuple[float, float] | None:
        """:attr:`principal_point_px`."""
        return self.principal_point_px

    @property
    def offset(self) -> Array:
        """(2,) principal point measured from the image's centre [px]."""
        if self.principal_point_px is None:
            return np.zeros(2)
        return np.asarray(self.principal_point_px) - 0.5 * np.asarray(self.size_px)

    def pixels(self, normalised: Array) -> Array:
        """(..., 2) pixels from the image's centre, of normalised coordinates (x, y) = (X/Z, Y/Z)."""
        pixels: Array = normalised * np.asarray(self.focal_px) + self.offset
        return pixels

    def normalised(self, pixels: Array) -> Array:
        """(..., 2) normalised coordinates of pixels measured from the image's centre."""
        normalised: Array = (pixels - self.offset) / np.asarray(self.focal_px)
        return normalised

    def from_corner(self, pixels: Array) -> Array:
        """(..., 2) pixels from the image's centre, of pixels measured from the top left corner."""
        centred: Array = np.asarray(pixels) - 0.5 * np.asarray(self.size_px)
        return centred

    def sees(self, pixels: Array) -> BoolArray:
        """(...) whether pixels measured from the image's centre lie in the image."""
        return np.asarray((np.abs(pixels) <= 0.5 * np.asarray(self.size_px)).all(axis=-1))
