"""Images in the loop: rendered as the camera sees the scene, detected, and moved on by the known motion."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..errors import ConfigurationError, SceneError
from ..robots.geometry import Pose
from ..rows import Array
from ..vision.images.board import Board
from ..vision.images.detectors import DETECTORS, Detector
from ..vision.images.settings import ImageSettings
from ..vision.images.sighting import Sighting, sight
from ..vision.measurement import Measurement
from ..vision.scene import Scene, State
from .disturbances import Disturbances
from .photographer import Photographer
from .sensing import Sensor

POSTULATED = ("pixel_noise", "image_period", "delay", "lost_frames")
"""Disturbances of images that are not rendered."""

STOPPING = 0.1
"""Time constant with which an arm without images is braked [s]."""


class Exposure(NamedTuple):
    """One image: when it was taken [s], what it says, and the markers' true ideal pixels.

    ``camera`` is the camera's true pose in the target's frame.
    """

    taken: float
    sighting: Sighting
    pixels: Array
    camera: Pose


@dataclass(frozen=True, slots=True)
class _Memory:
    """What was last seen: the camera's pose then, as measured and as the model had it, and measured pixels."""

    taken: float
    camera: Pose
    model: Pose
    pixels: Array


class ImageSensor(Sensor):
    """A sensor that renders images, detects tags in them, and believes what they say.

    From an image that can be used until the next one, the camera's pose moves on as the control's kinematics, and the
    target's motion as far as it is known, say that it moved since the image was taken; markers move along with that
    pose, by as much beside it as they were seen then.

    Parameters
    ----------
    scene
        What is seen.
    disturbances
        What goes wrong otherwise.
    settings
        Of the images.
    photographer
        Who takes them.
    Ts
        Sampling time [s].

    Attributes
    ----------
    exposures
        Every image so far.
    blind
        Whether the last image that could be used is too old to go on with.

    Raises
    ------
    ConfigurationError
        if disturbances postulate what images have by themselves, or a package is missing.
    """

    def __init__(
        self, scene: Scene, disturbances: Disturbances, settings: ImageSettings, photographer: Photographer, Ts: float
    ) -> None:
        for name in POSTULATED:
            if getattr(disturbances, name):
                raise ConfigurationError(
                    f'disturbances.{name} is of markers that are seen without images: with sensor = "images", rate_hz, '
                    "latency_s, noise and blur_px of the sensor say what an image is like"
                )
        super().__init__(scene, disturbances, Ts)
        self.settings, self._photographer, self._Ts = settings, photographer, Ts
        self.disturbed = True
        self._board = Board.of_markers(self.believed.markers, photographer.eye, settings.tag_side_m, settings.tags)
        told = scene.motion if scene.motion is not None and scene.motion.known else None
        self._model = Scene(scene.robot, self.camera, self.believed.markers, (), told)

    def reset(self) -> None:
        """Begin a new run with the same noise."""
        super().reset()
        self.exposures: list[Exposure] = []
        self._waiting: deque[tuple[float, _Memory | None]] = deque()
        self._last: _Memory | None = None
        self._taken, self._braked, self.blind = -1, 0, False
        self._told: tuple[int, Measurement] | None = None

    @property
    def estimates(self) -> bool:
        """No: not by compiled code."""
        return False

    @cached_property
    def _detector(self) -> Detector:
        return DETECTORS[self.settings.detector]()

    def measured(self, k: int, q: Array, qd: Array) -> Measurement:
        """What a controller is told in sample k, of ``q`` and ``qd`` (n,).

        Raises
        ------
        SceneError
            if no tag is seen in the first image, or markers are not in front of the camera where they are believed.
        """
        if self._told is None or self._told[0] != k:
            self._told = k, self._measured(k * self._Ts, q, qd)
        return self._told[1]

    def _measured(self, t: float, q: Array, qd: Array) -> Measurement:
        number = self.settings.number(t)
        if number > self._taken:
            self._taken = number
            self._take(number, t, q, qd)
        while self._waiting and self._waiting[0][0] <= t + 1e-9:
            self._last = self._waiting.popleft()[1] or self._last
        last = self._last
        if last is None:
            besides = _besides(self.exposures[0].sighting)
            raise SceneError(f"no tag that is looked for is seen in the first image{besides}")
        self.blind = t - last.taken > self.settings.latency_s + 1.0 / self.settings.rate_hz + self.settings.patience_s
        self._braked += self.blind
        now = self._model.camera_pose(q, t)
        camera, pixels = last.camera, last.pixels
        if self.settings.prediction:
            camera = last.camera @ (last.model.inverse @ now)
            pixels = self._model.project(camera) + last.pixels - self._model.project(last.camera)
        depth = self.settings.depth
        if isinstance(depth, str):
            Z = self._model.depth(camera if depth == "pose" else now)
        else:
            Z = np.full(len(pixels), float(depth))
        return Measurement(pixels, Z, t, camera)

    def _take(self, number: int, t: float, q: Array, qd: Array) -> None:
        """Take an image, and find out at once what it will say."""
        state, model, last = self.scene.evaluate(t, q, qd), self._model.camera_pose(q, t), self._last
        near = None if last is None else last.camera @ (last.model.inverse @ model)
        image = self._photographer.image(number, state)
        seen = sight(image, self._detector, self._board, self.camera, near)
        self.exposures.append(Exposure(t, seen, state.pixels.position, state.camera))
        memory = None if seen.camera is None else _Memory(t, seen.camera, model, seen.pixels)
        # the first one is waited for
        self._waiting.append((t + self.settings.latency_s if number else t, memory))

    def observe(self, state: State) -> State:
        """What is believed of the next sample's state; raises as :meth:`measured` does."""
        told, wrong = self.measured(self.sample, state.robot.q, state.robot.qd), self.disturbances
        self.sample += 1
        if wrong.mount:
            state = self.believed.remounted(state)
        assert told.pixels is not None
        assert told.depth is not None
        return self.believed.believed(state, told.camera, (told.pixels, wrong.depth_factor * told.depth))

    def braking(self, qd: Array) -> Array:
        """(n,) q̈ that stops the arm without an image to go by; what actuators can do of it, they will."""
        slower: Array = -qd / STOPPING
        return slower

    def remarks(self) -> list[str]:
        """What a reader of the results should know of the images."""
        exposures, said = self.exposures, []
        nothing = [one.taken for one in exposures if one.sighting.camera is None]
        if nothing:
            said.append(f"{len(nothing)} of {len(exposures)} images could not be used, the first at {nothing[0]:.3g} s")
        unfit = sum(one.sighting.unfit for one in exposures)
        if unfit:
            said.append(f"in {unfit} images the tags were not where those of the board can be")
        foreign = sorted({number for one in exposures for number in one.sighting.foreign})
        if foreign:
            said.append(f"tags were seen that are not the board's: {', '.join(map(str, foreign))}")
        if self._braked:
            said.append(f"without an image to go by, the arm was braked for {self._braked * self._Ts:.3g} s")
        return said


def _besides(seen: Sighting) -> str:
    """What a first image shows instead."""
    if seen.unfit:
        return ": those that are seen are not where those of the board can be"
    return f", but tags {', '.join(map(str, seen.foreign))}" if seen.foreign else ""
