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
        self._fixed = [curve for curve in curves if curve.motion is None]
        self.seen_from = scene.camera_pose(q0).t
        ids = settings.tags if settings.printed is None else settings.printed
        board = Board.of_markers(scene.markers, self.seen_from, settings.tag_side_m, ids)
        self.renderer = Renderer(board, scene.camera, settings)
        width, height = map(int, scene.camera.size)
        self._shape = (height, width)

    def image(self, number: int, state: State) -> Pixels:
        """Render image ``number`` (H, W); ``state`` is that in the middle of its exposure."""
        linear = state.camera_twist[:3]
        angular = state.camera_twist[3:]

        def motion(t: float) -> Pose:
            if t == 0.0:
                return state.camera
            turn = np.asarray(pin.exp3(t * angular))
            return state.camera @ Pose(turn, t * linear)

        hidden = self._fixed_curves | self._covered_by_solids(state)
        for curve in self._moving:
            hidden |= self._covered_by_curve(curve, state.t)
        random = np.random.default_rng((*self._seed, 3, number))
        return self.renderer.render(motion, random, hidden)

    @cached_property
    def _occluders(self) -> Occluders:
        """Occluding solids, created with the first image since it may read meshes."""
        return Occluders(self.scene, self._constraints, self.settings.opaque)

    def _covered_by_solids(self, state: State) -> BoolArray:
        """Return the mask (H, W) of the pixels covered by solids."""
        q = state.robot.q
        scene = self.scene
        eye = scene.camera.pose(scene.robot.pose(q))
        solids = []
        for points in self._occluders.solids(q, state.t):
            solids.append((points - eye.t) @ eye.R)
        # the board is the plane z = 0 of its frame
        in_board = self.renderer.board.camera_in_board(state.camera)
        normal = in_board.R[2]
        distance = -in_board.t[2]
        return covered(solids, np.append(normal, distance), scene.camera)

    @cached_property
    def _fixed_curves(self) -> BoolArray:
        """(H, W) mask of the pixels covered by curves that do not move."""
        mask = np.zeros(self._shape, dtype=np.bool_)
        for curve in self._fixed:
            mask |= self._covered_by_curve(curve, 0.0)
        return mask

    def _covered_by_curve(self, curve: Occlusion, t: float) -> BoolArray:
        """Return the mask (H, W) of the pixels covered by a curve."""
        displaced = curve.displaced(self._ideal_pixels, np.array([t]))[0]
        inside: BoolArray = curve.sigma(displaced) > curve.margin
        return inside.reshape(self._shape)

    @cached_property
    def _ideal_pixels(self) -> Array:
        """Ideal pixels (1, H · W, 2) of all pixels of an image, NaN beyond the lens."""
        camera = self.scene.camera
        v, u = np.indices(self._shape, dtype=np.float64)
        grid = np.stack((u, v), axis=-1).reshape(1, -1, 2)
        centred = camera.from_corner(grid, "centres")
        if camera.distortion is None:
            return centred
        distorted = camera.normalised(centred)
        ideal, certain = camera.distortion.remove(distorted)
        ideal[~certain] = np.nan
        return camera.pixels(ideal)


class Exposure(NamedTuple):
    """Image with its true state.

    The fields are the time of exposure [s], the measured pose of the tags, the markers' true ideal
    pixels and the camera's true pose.
    """

    taken: float
    tags: TagPose
    pixels: Array
    camera: Pose


class _UsableImage(NamedTuple):
    """Image with tags from which a pose was measured.

    The fields are the time of exposure [s], the camera's pose as measured and according to the
    model, and the measured pixels.
    """

    taken: float
    camera: Pose
    model: Pose
    pixels: Array


class _Waiting(NamedTuple):
    """Image with the time from which it can be used [s]; None if it is not usable."""

    usable_from: float
    image: _UsableImage | None


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
        known_motion = None
        if scene.motion is not None and scene.motion.known:
            known_motion = scene.motion
        self._model = Scene(scene.robot, self.camera, self.believed.markers, (), known_motion)

    def reset(self) -> None:
        """Begin a new run with the same noise."""
        super().reset()
        self.exposures = []
        self._waiting: deque[_Waiting] = deque()
        self._last: _UsableImage | None = None
        self._number = -1  # of the last image
        self._braked_samples = 0
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
            measurement = self._measured(k * self._Ts, q, qd)
            self._newest = (k, measurement)
        return self._newest[1]

    def _measured(self, t: float, q: Array, qd: Array) -> Measurement:
        """Return the measurement at t [s], after taking the image that is due."""
        number = self.settings.number(t)
        if number > self._number:
            self._number = number
            self._take(number, t, q, qd)
        while self._waiting and self._waiting[0].usable_from <= t + 1e-9:
            self._last = self._waiting.popleft().image or self._last
        last = self._last
        if last is None:
            raise self._no_first_image()
        settings = self.settings
        longest = settings.latency_s + 1.0 / settings.rate_hz + settings.patience_s
        self.blind = t - last.taken > longest
        self._braked_samples += self.blind
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
        expected = None
        if self._last is not None:
            motion = self._last.model.inverse @ model
            expected = self._last.camera @ motion
        image = self._renderer.image(number, state)
        tags = locate_board(image, self._detector, self._board, self.camera, expected)
        self.exposures.append(Exposure(t, tags, state.pixels.position, state.camera))
        usable = None
        if tags.camera is not None:
            usable = _UsableImage(t, tags.camera, model, tags.pixels)
        # the loop waits for the first image
        latency = self.settings.latency_s if number else 0.0
        self._waiting.append(_Waiting(t + latency, usable))

    def _no_first_image(self) -> SceneError:
        """Return the error for a first image without usable tags."""
        tags = self.exposures[0].tags
        why = ""
        if tags.unfit:
            why = ": the board cannot be where the tags that are seen would put it"
        elif tags.foreign:
            why = f", but tags {', '.join(map(str, tags.foreign))}"
        return SceneError(f"none of the expected tags is seen in the first image{why}")

    def newest(self, k: int, ideal: Array) -> tuple[Array, float, Pose | None]:
        """Return the newest usable image, see :meth:`.Sensor.newest`."""
        last = self._last
        assert last is not None
        pixels = self.camera.distort(last.pixels)
        taken = last.taken if self.settings.prediction else k * self._Ts
        return pixels, taken, last.camera

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
        if self._braked_samples:
            time = self._braked_samples * self._Ts
            remarks.append(f"without a usable image, the arm was braked for {time:.3g} s")
        return remarks
