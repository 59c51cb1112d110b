"""What a controller believes to see: images that are late, noisy or lost, seen through a camera not quite known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ..camera import Camera
from ..errors import ConfigurationError, SceneError
from ..kernels.images import Images, Sensing, usable
from ..kernels.structures import Scratch, Step
from ..pose_estimate import estimated_pose
from ..rows import Array, BoolArray
from ..scene import Scene, State
from .disturbances import Disturbances

__all__ = ["Expectation", "Sensor", "believed_camera", "estimated_pose"]


def believed_camera(camera: Camera, disturbances: Disturbances) -> Camera:
    """The camera that the control calculates with."""
    if not disturbances.intrinsics:
        return camera
    focal = np.multiply(camera.focal, disturbances.focal_factor)
    corner = camera.offset + 0.5 * np.asarray(camera.size) + disturbances.principal_point_error
    return replace(camera, focal_px=tuple(focal), principal_point_px=tuple(corner))


@dataclass(frozen=True, slots=True)
class Expectation:
    """What would be believed of a state to come: seen through the believed camera, at once and without noise."""

    scene: Scene
    camera: Camera
    depth_factor: float

    def __call__(self, state: State) -> State:
        """The believed state."""
        seen = self.camera.pixels(state.normalised.position)
        return self.scene.believed(state, None, (self.camera, seen, self.depth_factor * state.depth))

    def write(self, step: Step) -> None:
        """Let a compiled step believe the same."""
        step.camera["focal"], step.camera["offset"] = self.camera.focal, self.camera.offset
        step.camera["depth_factor"] = self.depth_factor


class Sensor:
    """Turns true states into believed ones, sample after sample.

    The camera's pose is estimated from the measured image by least squares (section 2, third part of the computer
    vision algorithm); where the markers do not determine it, it is taken from the kinematics. Robot coordinates and
    speeds are measured without error.

    Parameters
    ----------
    scene
        What is seen.
    disturbances
        What goes wrong.
    Ts
        Sampling time [s].
    unknown_motion
        Whether something that constraints forbid moves without the controller's being told.

    Attributes
    ----------
    disturbed
        Whether what is believed differs from what is true.
    sample
        Which one is observed next.

    Raises
    ------
    ConfigurationError
        if images do not come at samples.
    """

    def __init__(self, scene: Scene, disturbances: Disturbances, Ts: float, unknown_motion: bool = False) -> None:
        self.scene, self.disturbances = scene, disturbances
        self.camera = believed_camera(scene.camera, disturbances)
        period = disturbances.image_period / Ts if disturbances.image_period else 1.0
        self._every = max(int(np.round(period)), 1)
        if abs(period - self._every) > 1e-6:
            raise ConfigurationError(
                f"disturbance image_period must be a multiple of the sampling time, {Ts} s, not "
                f"{disturbances.image_period} s"
            )
        unknown_target = scene.motion is not None and not scene.motion.known
        self.disturbed = disturbances.sensing or unknown_target or unknown_motion
        self.reset()

    def reset(self) -> None:
        """Begin a new run with the same random numbers."""
        self.sample, self._covered = 0, 0
        self._images: Images | None = None

    def images(self, samples: int) -> Images:
        """What a run of so many samples sees: what goes wrong with each image is drawn beforehand."""
        settings, markers = self.disturbances, len(self.scene.markers)
        noise: Array = np.zeros((1, markers, 2))
        lost: BoolArray = np.zeros(1, dtype=np.bool_)
        if settings.pixel_noise or settings.lost_frames:
            normal, uniform = _drawn((*settings.seed, 1), 1 + (samples - 1) // self._every, markers)
            noise, lost = settings.pixel_noise * normal, uniform < settings.lost_frames
        held = np.zeros((settings.delay + 1, markers, 2)) if self._images is None else self._images.held
        self._images, self._covered = Images(self._every, noise, lost, held), samples
        return self._images

    @property
    def estimates(self) -> bool:
        """Whether the camera's pose is estimated from the measured image."""
        return self.disturbances.image or self.disturbances.intrinsics

    def sensing(self, samples: int) -> Sensing:
        """What the compiled form of :meth:`observe` works with, in a run of so many samples."""
        numbers = np.empty(64 * len(self.scene.markers) + 256)
        return Sensing(self.images(samples), Scratch(numbers, np.zeros(1, dtype=np.int64)))

    def observe(self, state: State) -> State:
        """What is believed of the next sample's state; the state itself where nothing is disturbed.

        Raises
        ------
        SceneError
            if the image cannot be explained by any pose with all markers in front of the camera.
        """
        if not self.disturbed:
            return state
        settings = self.disturbances
        if not settings.sensing:
            return self.scene.believed(state)
        pixels = self._image(state.pixels.position)
        camera, Z = state.camera, state.depth
        if self.estimates:
            camera = estimated_pose(self.scene.markers, self.camera.normalised(pixels), state.camera)
            try:
                Z = self.scene.depth(camera)
            except SceneError as error:
                raise SceneError(f"the measured image is explained by no pose that sees it: {error}") from error
        return self.scene.believed(state, camera, (self.camera, pixels, settings.depth_factor * Z))

    @property
    def expected(self) -> Expectation:
        """What would be believed of a state to come."""
        return Expectation(self.scene, self.camera, self.disturbances.depth_factor)

    def _image(self, pixels: Array) -> Array:
        """(m, 2) the measured pixels that can be used now."""
        images, k = self._images, self.sample
        if images is None or k >= self._covered:
            images = self.images(2 * k + 1)
        self.sample += 1
        seen: Array = images.held[usable(images, k, pixels)].copy()
        return seen


@lru_cache(maxsize=4)
def _drawn(seed: tuple[int, ...], images: int, markers: int) -> tuple[Array, Array]:
    """(N, m, 2) and (N,) standard normal and uniform numbers: drawn for one image after the other, used or not.

    So every controller meets the same ones; they are kept for the next one.
    """
    random = np.random.default_rng(seed)
    normal, uniform = np.empty((images, markers, 2)), np.empty(images)
    for i in range(images):
        random.standard_normal(out=normal[i])
        uniform[i] = random.random()
    return normal, uniform
