"""What a controller believes to see: images that are late, noisy or lost, seen through a camera not quite known."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np
import pinocchio as pin

from ..camera import Camera
from ..decomposition import svd
from ..errors import ConfigurationError, SceneError
from ..geometry import Pose
from ..rows import Array
from ..scene import MINIMUM_DEPTH, Scene, State, interaction_matrix
from .disturbances import Disturbances

ITERATIONS = 10
"""Of the pose estimation at most; three or four are usual."""

CONVERGED = 1e-10
"""Step of the pose estimation [m, rad] at which it ends."""

RANK_TOLERANCE = 1e-4
"""Directions of the camera's motion to which the image is less sensitive than this, relative to the most sensitive
one, are left as the kinematics say."""


def believed_camera(camera: Camera, disturbances: Disturbances) -> Camera:
    """The camera that the control calculates with."""
    if not disturbances.intrinsics:
        return camera
    focal = np.multiply(camera.focal, disturbances.focal_factor)
    corner = camera.offset + 0.5 * np.asarray(camera.size) + disturbances.principal_point_error
    return replace(camera, focal_px=tuple(focal), principal_point_px=tuple(corner))


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
        self._random = np.random.default_rng((*self.disturbances.seed, 1))
        self._images: deque[Array] = deque(maxlen=self.disturbances.delay + 1)
        self._sample = 0

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
        if settings.image or settings.intrinsics:
            camera = estimated_pose(self.scene.markers, self.camera.normalised(pixels), state.camera)
            try:
                Z = self.scene.depth(camera)
            except SceneError as error:
                raise SceneError(f"the measured image is explained by no pose that sees it: {error}") from error
        return self.scene.believed(state, camera, (self.camera, pixels, settings.depth_factor * Z))

    def expected(self, state: State) -> State:
        """What would be believed of a state to come: seen through the believed camera, at once and without noise."""
        seen = self.camera.pixels(state.normalised.position)
        return self.scene.believed(state, None, (self.camera, seen, self.disturbances.depth_factor * state.depth))

    def _image(self, pixels: Array) -> Array:
        """(m, 2) the measured pixels that can be used now."""
        if self._sample % self._every == 0:
            settings = self.disturbances
            # drawn for every image, used or not, so that every controller meets the same ones
            noise = settings.pixel_noise * self._random.standard_normal(pixels.shape)
            lost = self._random.random() < settings.lost_frames
            # what was seen before the beginning is what is seen at it
            self._images.append(self._images[-1] if lost and self._images else pixels + noise)
        self._sample += 1
        return self._images[0]


def estimated_pose(markers: Array, normalised: Array, near: Pose) -> Pose:
    """Pose of the camera in the target's frame that explains an image best: Gauss–Newton from a pose near by.

    Parameters
    ----------
    markers
        (m, 3) in the target's frame [m].
    normalised
        (m, 2) measured normalised coordinates.
    near
        Where the search starts; also what counts where the markers do not determine the pose.
    """
    camera = near
    for _ in range(ITERATIONS):
        P = (markers - camera.t) @ camera.R
        Z = np.maximum(P[:, 2], MINIMUM_DEPTH)
        xy = P[:, :2] / Z[:, None]
        L = interaction_matrix(xy, Z).reshape(-1, 6)
        U, s, Vt = svd(L, full_matrices=False)
        kept = s > RANK_TOLERANCE * s[0]
        step = Vt[kept].T @ ((U[:, kept].T @ (normalised - xy).ravel()) / s[kept])
        camera = camera @ Pose(np.asarray(pin.exp3(step[3:])), step[:3])
        if np.sqrt(step @ step) < CONVERGED:
            break
    return camera
