"""What a camera has measured: pixels of markers, their depths, its own pose; and what a controller then believes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from .camera import Camera
from .errors import InvalidInput, shown
from .geometry import Pose
from .rows import Array
from .scene import Scene, State


@dataclass(frozen=True, slots=True)
class Measurement:
    """What takes the place of the model's prediction in one step.

    Attributes
    ----------
    pixels
        (M, 2) of the markers, from the image's centre [px], on the sensor; NaN for one that was not seen, which is
        taken to be as far from where the model has it as when it was last seen.
    depth
        (M,) Z of the markers [m], NaN or not given where the model's is to be taken.
    taken
        When the image was taken [s]; now if None. What was seen before has moved on with its present velocity.
    camera
        The camera's pose in the target's frame, for position-based tasks; the model's if None.
    """

    pixels: Array | None = None
    depth: Array | None = None
    taken: float | None = None
    camera: Pose | None = None

    def checked(self, M: int, t: float) -> Self:
        """The same in plain arrays, with depths and time, for M markers at t [s]; raises InvalidInput."""
        pixels = np.full((M, 2), np.nan) if self.pixels is None else numbers(self.pixels, (M, 2), "pixels")
        depth = np.full(M, np.nan) if self.depth is None else numbers(self.depth, (M,), "depth")
        if self.depth is not None and self.pixels is None:
            raise InvalidInput("measured depth needs the pixels that it belongs to")
        if (depth <= 0.0).any():
            raise InvalidInput(f"measured depth must be positive, or NaN where it is not known, not {depth}")
        taken = t if self.taken is None else self.taken
        if not math.isfinite(taken) or taken > t + 1e-9:
            raise InvalidInput(f"an image was taken before now, t = {t:g} s, not at {shown(self.taken)}")
        if self.camera is not None and not isinstance(self.camera, Pose):
            raise InvalidInput(f"the measured pose of the camera must be a Pose, not {shown(self.camera)}")
        return type(self)(None if self.pixels is None else pixels, depth, taken, self.camera)

    def undistorted(self, camera: Camera) -> Self:
        """The same with ideal pixels; raises InvalidInput for one where the lens cannot be inverted."""
        return self if self.pixels is None else replace(self, pixels=camera.undistort(self.pixels))

    def believed(self, scene: Scene, state: State, correction: Array) -> State:
        """What a controller believes that is told this of a state; the compiled step does the same.

        Pixels are ideal by now. ``correction`` (M, 2) is by how much markers were last seen beside where the model has
        them, and is kept up.
        """
        if self.pixels is None:
            return scene.believed(state, self.camera)
        assert self.depth is not None
        assert self.taken is not None
        model, eye = state.normalised.position, scene.camera
        Z = np.where(np.isnan(self.depth), state.depth, self.depth)
        seen = np.flatnonzero(np.isfinite(self.pixels).all(axis=1))
        there = state.pixels.position.copy()
        there[seen] = self.pixels[seen]
        velocity = scene.believed(state, self.camera, (there, Z)).normalised.velocity
        moved = eye.normalised(there) + (state.t - self.taken) * velocity
        correction[seen] = (moved - model)[seen]
        return scene.believed(state, self.camera, (eye.pixels(model + correction), Z))


def numbers(value: object, shape: tuple[int, ...], what: str) -> Array:
    """``value`` as an array of floats of that shape, NaN among them; raises InvalidInput that names ``what``."""
    try:
        array = np.array(value, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"measured {what} must be {shape} numbers, not {shown(value)}") from error
    if array.shape != shape or np.isinf(array).any():
        raise InvalidInput(f"measured {what} must be {shape} numbers, NaN where there is none, not {shown(value)}")
    return array
