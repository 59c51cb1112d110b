"""Images in the loop: rendering, detection of tags, and prediction with the known motion."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ..constraints import Constraint, Occlusion
from ..control.evaluator import Evaluation
from ..errors import ConfigurationError, SceneError
from ..robots.geometry import Pose
from ..rows import Array, BoolArray
from ..simulation.disturbances import Disturbances
from ..simulation.occluders import Occluders
from ..simulation.sensing import Sensor
from ..vision.measurement import Measurement
from ..vision.scene import Scene, State
from .board import Board
from .detectors import DETECTORS, Detector, Pixels
from .rendering import Renderer
from .settings import ImageSettings
from .silhouettes import covered
from .tag_pose import TagPose, locate_board

#: Disturbances of measurements without rendered images.
POSTULATED = ("pixel_noise", "image_period", "delay", "delay_known", "lost_frames")


class SceneRenderer:
    """Renderer of a scene's markers, which are corners of tags.

    The tags are printed on the side of the board that is seen from the start ``q0`` (n,). The
    curves of occlusion constraints are in front of the target; the settings determine which bodies
    and regions hide it. The noise of an image follows from the seed and the image's number,
    whatever the controller does. Raises ConfigurationError if the markers cannot form a board of
    tags, or if packages are missing.
    """

    def __init__(
        self,
        scene: Scene,
        settings: ImageSettings,
        constraints: Sequence[Constraint],
        q0: Array,
        seed: tuple[int, ...],
    ) -> None:
        self.scene = scene
        self.settings = settings
        self._constraints = constraints
        self._seed = seed
        curves = [curve for curve in constraints if isinstance(curve, Occlusion)]
        self._moving = [curve for curve in curves if curve.motion is not None]
        self._still = [curve for curve in curves if curve.motion is None]
        self.seen_from = scene.camera_pose(q0).t
        ids = settings.tags if settings.printed is None else settings.printed
        board = Board.of_markers(scene.markers, self.seen_from, settings.tag_side_m, ids)
        self.renderer = Renderer(board, scene.camera, settings)

    def image(self, number: int, state: State) -> Pixels:
        """Render image ``number`` (H, W); ``state`` is that in the middle of its exposure."""
        velocity = state.camera_twist[:3]
        turning = state.camera_twist[3:]

        def where(after: float) -> Pose:
            if after == 0.0:
                return state.camera
            return state.camera @ Pose(np.asarray(pin.exp3(after * turning)), after * velocity)

        masks = [self._before(curve, state.t) for curve in self._moving]
        if self._still:
            masks.append(self._always)
        solids = self._occluders.solids(state.robot.q, state.t)
        if solids:
            # solids, and the board's plane, in the camera's frame
            camera = self.scene.camera
            eye = camera.fixed or self.scene.robot.pose(state.robot.q) @ camera.mount.inverse
            seen = self.renderer.board.camera_in_board(state.camera)
            plane = np.append(seen.R[2], -seen.t[2])
            in_camera = [(points - eye.t) @ eye.R for points in solids]
            masks.append(covered(in_camera, plane, camera))
        hidden = np.logical_or.reduce(masks) if masks else None
        random = np.random.default_rng((*self._seed, 3, number))
        return self.renderer.render(where, random, hidden)

    @cached_property
    def _occluders(self) -> Occluders:
        """Occluding solids, created with the first image since it may read meshes."""
        return Occluders(self.scene, self._constraints, self.settings.opaque)

    @cached_property
    def _always(self) -> BoolArray:
        """(H, W) mask of the pixels covered by curves that do not move."""
        masks = [self._before(curve, 0.0) for curve in self._still]
        always: BoolArray = np.logical_or.reduce(masks)
        return always

    def _before(self, curve: Occlusion, t: float) -> BoolArray:
        """Return the mask (H, W) of the pixels covered by a curve."""
        shape, ideal = self._ideal
        displaced = curve.displaced(ideal[None], np.array([t]))[0]
        inside: BoolArray = curve.sigma(displaced) > curve.margin
        return inside.reshape(shape)

    @cached_property
    def _ideal(self) -> tuple[tuple[int, int], Array]:
        """Image size (H, W), and ideal pixels (H · W, 2) of all its pixels, NaN beyond the lens."""
        camera = self.scene.camera
        W, H = map(int, camera.size)
        v, u = np.mgrid[:H, :W]
        centred = camera.from_corner(np.stack((u, v), axis=-1).reshape(-1, 2), "centres")
        if camera.distortion is None:
            return (H, W), centred
        ideal, certain = camera.distortion.remove(camera.normalised(centred))
        ideal[~certain] = np.nan
        return (H, W), camera.pixels(ideal)


class Exposure(NamedTuple):
    """Image with its true state.

    The fields are the time of exposure [s], the measured pose of the tags, the markers' true ideal
    pixels and the camera's true pose.
    """

    taken: float
    tags: TagPose
    pixels: Array
    camera: Pose


class _Memory(NamedTuple):
    """Last usable image.

    The fields are the time of exposure [s], the camera's pose as measured and according to the
    model, and the measured pixels.
    """

    taken: float
    camera: Pose
    model: Pose
    pixels: Array


class ImageSensor(Sensor):
    """Sensor that renders images, detects tags in them, and takes its measurements from the tags.

    Between usable images, the camera's pose is predicted: it moves on by the motion since the last
    image was taken, according to the controller's kinematics and to the target's motion as far as
    it is known. Markers move along with that pose and keep the offset with which they were seen.
    Raises ConfigurationError if disturbances specify effects that rendered images have anyway, or
    if a package is missing.
    """

    renders = True
    exposures: list[Exposure]  #: All images so far.

    def __init__(
        self,
        scene: Scene,
        disturbances: Disturbances,
        settings: ImageSettings,
        renderer: SceneRenderer,
        Ts: float,
    ) -> None:
        for name in POSTULATED:
            if getattr(disturbances, name):
                raise ConfigurationError(
                    f"disturbances.{name} applies to markers that are measured without images: "
                    'with sensor = "images", set rate_hz, latency_s, noise and blur_px of the '
                    "sensor"
                )
        super().__init__(scene, disturbances, Ts)
        self.settings = settings
        self._renderer = renderer
        self._Ts = Ts
        self.disturbed = True
        self._board = Board.of_markers(
            self.believed.markers, renderer.seen_from, settings.tag_side_m, settings.tags
        )
        known = scene.motion if scene.motion is not None and scene.motion.known else None
        self._model = Scene(scene.robot, self.camera, self.believed.markers, (), known)

    def reset(self) -> None:
        """Begin a new run with the same noise."""
        super().reset()
        self.exposures = []
        self._waiting: deque[tuple[float, _Memory | None]] = deque()
        self._last: _Memory | None = None
        self._taken = -1
        self._braked = 0
        self.blind = False
        self._newest: tuple[int, Measurement] | None = None

    estimates = False  # poses are not estimated by compiled code

    @cached_property
    def _detector(self) -> Detector:
        return DETECTORS[self.settings.detector]()

    def measured(self, k: int, q: Array, qd: Array, world: Evaluation | None = None) -> Measurement:
        """Return the measurement in sample ``k``, at ``q`` and ``qd`` (n,).

        Raises SceneError if no tag is seen in the first image, or if a marker is believed to be
        behind the camera.
        """
        if self._newest is None or self._newest[0] != k:
            self._newest = k, self._measured(k * self._Ts, q, qd)
        return self._newest[1]

    def _measured(self, t: float, q: Array, qd: Array) -> Measurement:
        number = self.settings.number(t)
        if number > self._taken:
            self._taken = number
            self._take(number, t, q, qd)
        while self._waiting and self._waiting[0][0] <= t + 1e-9:
            self._last = self._waiting.popleft()[1] or self._last
        last = self._last
        if last is None:
            tags = self.exposures[0].tags
            why = ""
            if tags.unfit:
                why = ": the board cannot be where the tags that are seen would put it"
            elif tags.foreign:
                why = f", but tags {', '.join(map(str, tags.foreign))}"
            raise SceneError(f"none of the expected tags is seen in the first image{why}")
        settings = self.settings
        longest = settings.latency_s + 1.0 / settings.rate_hz + settings.patience_s
        self.blind = t - last.taken > longest
        self._braked += self.blind
        if settings.depth == "pose":
            Z = self._model.depth(last.camera)
        elif settings.depth == "model":
            Z = self._model.depth(last.model)
        else:
            Z = np.full(len(last.pixels), float(settings.depth))
        taken = last.taken if settings.prediction else t
        return Measurement(last.pixels, Z, taken, last.camera)

    def _take(self, number: int, t: float, q: Array, qd: Array) -> None:
        """Render an image and evaluate it at once, ahead of its latency."""
        state = self.scene.evaluate(t, q, qd)
        model = self._model.camera_pose(q, t)
        last = self._last
        near = None if last is None else last.camera @ (last.model.inverse @ model)
        image = self._renderer.image(number, state)
        seen = locate_board(image, self._detector, self._board, self.camera, near)
        self.exposures.append(Exposure(t, seen, state.pixels.position, state.camera))
        memory = None if seen.camera is None else _Memory(t, seen.camera, model, seen.pixels)
        # the loop waits for the first image
        latency = self.settings.latency_s if number else 0.0
        self._waiting.append((t + latency, memory))

    def newest(self, k: int, ideal: Array) -> tuple[Array, float, Pose | None]:
        """Return the newest usable image, see :meth:`.Sensor.newest`."""
        assert self._last is not None
        taken = self._last.taken if self.settings.prediction else k * self._Ts
        return self.camera.distort(self._last.pixels), taken, self._last.camera

    def remarks(self) -> list[str]:
        """Return remarks on the images for a reader of the results."""
        exposures = self.exposures
        remarks = []
        unusable = [image.taken for image in exposures if image.tags.camera is None]
        if unusable:
            remarks.append(
                f"{len(unusable)} of {len(exposures)} images could not be used, the first at "
                f"{unusable[0]:.3g} s"
            )
        unfit = sum(image.tags.unfit for image in exposures)
        if unfit:
            remarks.append(f"in {unfit} images the tags were where those of the board cannot be")
        foreign = sorted({number for image in exposures for number in image.tags.foreign})
        if foreign:
            remarks.append(
                f"tags were seen that are not the board's: {', '.join(map(str, foreign))}"
            )
        if self._braked:
            remarks.append(
                f"without a usable image, the arm was braked for {self._braked * self._Ts:.3g} s"
            )
        return remarks
