"""Delayed, noisy or lost images.

As in :mod:`.samples`, the functions use only operations that compile.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..rows import Array, BoolArray
from .workspace import Scratch


class Images(NamedTuple):
    """Images of M markers [px]: errors of N images, and a ring buffer of the last ones.

    An image is taken in every ``every``-th sample. ``noise`` is added to its pixels, or the image
    is ``lost``. If images are ``dated``, the controller knows when they were ``taken`` [s].
    ``held`` are the last images.
    """

    every: int
    dated: int
    noise: Annotated[Array, "N M 2"]
    lost: Annotated[BoolArray, "N"]
    held: Annotated[Array, "delay+1 M 2"]
    taken: Annotated[Array, "delay+1"]


class Lenses(NamedTuple):
    """True and believed eye of a camera, and scratch.

    See :attr:`vsconstraints.vision.camera.Camera.eye`. ``address`` is that of the function that
    takes pixels through such a lens, or 0 without distortion.
    """

    address: int
    true: Annotated[Array, "eye"]
    believed: Annotated[Array, "eye"]
    pixels: Annotated[Array, "M 2"]


class Sensing(NamedTuple):
    """Arrays of the compiled sensor: images, lenses, and scratch for the camera's pose."""

    images: Images
    lenses: Lenses
    scratch: Scratch


def usable(images: Images, k: int, t: float, pixels: Array) -> int:
    """Return the slot of the image that can be used in sample k, at t [s].

    An image that is taken in this sample, of ``pixels`` (M, 2), is stored first. The previous image
    replaces a lost one. Before any image has arrived, the first image is used.
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
                pixel = pixels[j, c] + images.noise[i, j, c]
                if stays:
                    pixel = images.held[before, j, c]
                images.held[slot, j, c] = pixel
        images.taken[slot] = images.taken[before] if stays else t
    return max(number - slots + 1, 0) % slots
