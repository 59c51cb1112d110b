"""Images as they come: late, noisy or lost. Written once, in operations that compile, as
:mod:`.samples` is.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..rows import Array, BoolArray
from .workspace import BOOL, F8, Scratch


class Images(NamedTuple):
    """Images of M markers [px]: what goes wrong with each of N, and the last ones, filled round and
    round.

    An image is taken in ``every`` so many-th sample; ``noise`` is added to its pixels, or it is
    ``lost``. If they are ``dated``, the control knows when they were ``taken`` [s].
    """

    every: int
    dated: int
    noise: Annotated[Array, F8, "N", "M", 2]
    lost: Annotated[BoolArray, BOOL, "N"]
    held: Annotated[Array, F8, "delay + 1", "M", 2]
    taken: Annotated[Array, F8, "delay + 1"]


class Lenses(NamedTuple):
    """The true and the believed eye of a camera (:attr:`vsconstraints.vision.camera.Camera.eye`),
    and scratch.

    ``address`` is that of the function that takes pixels through such a lens, or 0 where there is
    no distortion.
    """

    address: int
    true: Annotated[Array, F8, "eye"]
    believed: Annotated[Array, F8, "eye"]
    pixels: Annotated[Array, F8, "M", 2]


class Sensing(NamedTuple):
    """What the compiled sensor works with: images, lenses, and scratch for the camera's pose."""

    images: Images
    lenses: Lenses
    scratch: Scratch


def usable(images: Images, k: int, t: float, pixels: Array) -> int:
    """Which of the held images can be used in sample k, at t [s]; one that is taken in it, of
    pixels (M, 2), is held.

    Where a lost one is looked for, the one before stands. What was seen before the beginning is
    what is seen at it.
    """
    number = k // images.every
    slots = len(images.held)
    if k % images.every == 0:
        i = number % len(images.lost)
        slot = number % slots
        before = (number - 1) % slots
        stays = number > 0 and images.lost[i]
        for j in range(len(pixels)):
            for c in range(2):
                images.held[slot, j, c] = (
                    images.held[before, j, c] if stays else pixels[j, c] + images.noise[i, j, c]
                )
        images.taken[slot] = images.taken[before] if stays else t
    return max(number - slots + 1, 0) % slots
