"""Images as they come: late, noisy or lost. Written once, in operations that compile, as :mod:`.samples` is."""

from __future__ import annotations

from typing import NamedTuple

from ..rows import Array, BoolArray
from .workspace import Scratch


class Images(NamedTuple):
    """Images of M markers [px]: what goes wrong with each, and those that are still to be used.

    Attributes
    ----------
    every
        An image is taken in every so many-th sample.
    noise, lost
        (N, M, 2) what is added to the pixels of each image, and (N,) whether it is lost; (1, M, 2) and (1,) of zeros if
        that is never.
    held
        (delay + 1, M, 2) the last ones, filled round and round.
    """

    every: int
    noise: Array
    lost: BoolArray
    held: Array


class Lenses(NamedTuple):
    """A lens with distortion, as it is and as it is believed to be.

    Attributes
    ----------
    address
        Of the function that takes pixels through such a lens, or 0 where there is no distortion.
    true, believed
        Both cameras' :attr:`vsconstraints.vision.camera.Camera.eye`.
    pixels
        (M, 2) scratch.
    """

    address: int
    true: Array
    believed: Array
    pixels: Array


class Sensing(NamedTuple):
    """What the compiled sensor works with: images, lenses, and scratch for the camera's pose."""

    images: Images
    lenses: Lenses
    scratch: Scratch


def usable(images: Images, k: int, pixels: Array) -> int:
    """Which of the held images can be used in sample k; an image that is taken in it, of pixels (M, 2), is held.

    Where a lost one is looked for, the one before stands. What was seen before the beginning is what is seen at it.
    """
    number, slots = k // images.every, len(images.held)
    if k % images.every == 0:
        i, slot, before = number % len(images.lost), number % slots, (number - 1) % slots
        stays = number > 0 and images.lost[i]
        for j in range(len(pixels)):
            for c in range(2):
                images.held[slot, j, c] = images.held[before, j, c] if stays else pixels[j, c] + images.noise[i, j, c]
    return max(number - slots + 1, 0) % slots
