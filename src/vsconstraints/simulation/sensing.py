"""What a controller believes: late, noisy or lost images, through a camera not quite known;
erroneous gradients.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pinocchio as pin

from ..compiled import load
from ..compiled.images import Images, Lenses, Sensing, usable
from ..compiled.workspace import Scratch, Step
from ..constraints import ConstraintSet, SpeedConstraint
from ..control.evaluator import Evaluation
from ..control.packing import write_camera
from ..errors import ConfigurationError, SceneError, unknown_name
from ..formulas.row import gradient_error
from ..robots.geometry import Pose
from ..rows import Array, BoolArray, Rows
from ..vision.camera import Camera
from ..vision.measurement import Measurement, estimated_pose
from ..vision.scene import Scene
from .disturbances import VISIBILITY, Disturbances


def believed_camera(camera: Camera, disturbances: Disturbances) -> Camera:
    """The camera that the control calculates with; raises ConfigurationError if a distortion factor
    does not fit it.
    """
    believed = camera
    wrong = disturbances
    if wrong.distortion:
        factors = np.asarray(wrong.distortion_factor, dtype=np.float64)
        lens = camera.distortion
        if lens is None:
            raise ConfigurationError("disturbance distortion_factor needs a camera with distortion")
        if len(factors) not in (1, len(lens.coefficients)):
            raise ConfigurationError(
                f"disturbance distortion_factor must be one number or {len(lens.coefficients)}, "
                f"one per coefficient, "
                f"not {len(factors)}"
            )
        believed = replace(believed, distortion=lens.scaled(factors))
    if wrong.intrinsics:
        focal = np.multiply(camera.focal, wrong.focal_factor)
        corner = camera.offset + 0.5 * np.asarray(camera.size) + wrong.principal_point_error
        believed = replace(believed, focal_px=tuple(focal), principal_point_px=tuple(corner))
    if wrong.mount:
        turn = np.asarray(pin.exp3(np.array(wrong.mount_rotation_error)))
        error = Pose(turn, np.array(wrong.mount_translation_error))
        if camera.fixed is not None:
            return replace(believed, fixed=camera.fixed @ error)
        # of the camera in the tip's frame, which the mount is the inverse of
        return replace(believed, mount=error.inverse @ camera.mount)
    return believed


def believed_scene(scene: Scene, disturbances: Disturbances) -> Scene:
    """The scene that the control calculates with; the true one where it does not differ."""
    camera = believed_camera(scene.camera, disturbances)
    markers = scene.markers
    if disturbances.target:
        middle = markers.mean(axis=0)
        markers = middle + disturbances.marker_distance_factor * (markers - middle)
    if camera is scene.camera and markers is scene.markers:
        return scene
    return Scene(scene.robot, camera, markers, scene.points, scene.motion)


def ideal_pixels(camera: Camera, pixels: Array) -> Array:
    """(..., 2) ideal pixels of those on the sensor, also where a camera would refuse to say."""
    if camera.distortion is None:
        return pixels
    return camera.pixels(camera.distortion.remove(camera.normalised(pixels))[0])


def shown_to(camera: Camera, believed: Camera, pixels: Array) -> Array:
    """(..., 2) normalised coordinates by a believed camera of what is at these ideal pixels of the
    true one.
    """
    return believed.normalised(ideal_pixels(believed, camera.distort(pixels)))


class Sensor:
    """Makes measurements of what is true, sample after sample.

    The camera's pose is estimated from the measured image by least squares (section 2, third part
    of the computer vision algorithm); where the markers do not determine it, it is taken from the
    kinematics. Robot coordinates and speeds are measured without error. ``unknown_motion`` says
    whether something that constraints forbid moves unknown to the controller. Raises
    ConfigurationError if images do not come at samples.
    """

    blind = False  #: Whether there is nothing to go by, and the arm has to be braked.

    def __init__(
        self, scene: Scene, disturbances: Disturbances, Ts: float, unknown_motion: bool = False
    ) -> None:
        self.scene = scene
        self.disturbances = disturbances
        self.believed = believed_scene(scene, disturbances)
        self.camera = self.believed.camera
        self._Ts = Ts
        period = disturbances.image_period / Ts if disturbances.image_period else 1.0
        self._every = max(int(np.round(period)), 1)
        if abs(period - self._every) > 1e-6:
            raise ConfigurationError(
                f"disturbance image_period must be a multiple of the sampling time, {Ts} s, not "
                f"{disturbances.image_period} s"
            )
        unknown_target = scene.motion is not None and not scene.motion.known
        #: Whether what is believed differs from what is true.
        self.disturbed = disturbances.sensing or unknown_target or unknown_motion
        self.reset()

    def reset(self) -> None:
        """Begin a new run with the same random numbers."""
        self._covered = 0
        self._images: Images | None = None

    def images(self, samples: int) -> Images:
        """What a run of so many samples sees: what goes wrong with each image is drawn
        beforehand.
        """
        settings = self.disturbances
        markers = len(self.scene.markers)
        noise: Array = np.zeros((1, markers, 2))
        lost: BoolArray = np.zeros(1, dtype=np.bool_)
        if settings.pixel_noise or settings.lost_frames:
            normal, uniform = _drawn((*settings.seed, 1), 1 + (samples - 1) // self._every, markers)
            noise = settings.pixel_noise * normal
            lost = uniform < settings.lost_frames
        slots = settings.delay + 1
        memory = (
            (np.zeros((slots, markers, 2)), np.zeros(slots))
            if self._images is None
            else self._images[-2:]
        )
        self._images = Images(self._every, int(settings.delay_known), noise, lost, *memory)
        self._covered = samples
        return self._images

    @property
    def estimates(self) -> bool:
        """Whether the camera's pose is estimated from the measured image."""
        wrong = self.disturbances
        return wrong.image or wrong.intrinsics or wrong.distortion or wrong.mount or wrong.target

    def sensing(self, samples: int) -> Sensing:
        """What the compiled form of :meth:`measured` works with, in a run of so many samples."""
        M = len(self.scene.markers)
        camera = self.scene.camera
        address = 0
        if camera.distortion is not None:
            address = load("lenses").address_of(camera.distortion.model)
        lenses = Lenses(address, np.array(camera.eye), np.array(self.camera.eye), np.empty((M, 2)))
        scratch = Scratch(np.empty(64 * M + 256), np.zeros(1, dtype=np.int64))
        return Sensing(self.images(samples), lenses, scratch)

    def measured(
        self, k: int, q: Array, qd: Array, world: Evaluation | None = None
    ) -> Measurement | None:
        """What is measured in sample k of what is true then, None where that is what the believed
        scene predicts.

        Raises SceneError if the image cannot be explained by any pose with all markers in front of
        the camera.
        """
        if not self.estimates or world is None:
            return None
        seen = self.scene.camera.distort(world.pixels)
        images = self._images
        if images is None or k >= self._covered:
            images = self.images(2 * k + 1)
        t = k * self._Ts
        slot = usable(images, k, t, seen)
        pixels = ideal_pixels(self.camera, images.held[slot].copy())
        near = Pose(world.camera_R, world.camera_t)
        camera = estimated_pose(self.believed.markers, self.camera.normalised(pixels), near)
        try:
            Z = self.believed.depth(camera)
        except SceneError as error:
            raise SceneError(
                f"the measured image is explained by no pose that sees it: {error}"
            ) from error
        return Measurement(pixels, Z, images.taken[slot] if images.dated else t, camera)

    def write(self, step: Step) -> None:
        """Let a compiled step believe what would be seen of a state to come: at once and without
        noise.
        """
        write_camera(step, self.camera)
        step.markers[:] = self.believed.markers
        step.camera["depth_factor"] = self.disturbances.depth_factor

    def remarks(self) -> list[str]:
        """What a reader of the results should know of what was seen."""
        return []


@lru_cache(maxsize=4)
def _drawn(seed: tuple[int, ...], images: int, markers: int) -> tuple[Array, Array]:
    """(N, m, 2) and (N,) standard normal and uniform numbers: drawn for one image after the other,
    used or not.

    So every controller meets the same ones; they are kept for the next one.
    """
    random = np.random.default_rng(seed)
    normal = np.empty((images, markers, 2))
    uniform = np.empty(images)
    for i in range(images):
        random.standard_normal(out=normal[i])
        uniform[i] = random.random()
    return normal, uniform


class GradientError:
    """∇σ_e = ∇σ + c_e s ∘ |∇σ| where the rows contain ∇σ: in L_gφ and, unless set otherwise, in φ
    and L_fφ.
    """

    def __init__(self, constraints: ConstraintSet, disturbances: Disturbances, n: int) -> None:
        kinds = disturbances.gradient_error_rows
        known = set(constraints.kinds)
        if disturbances.gradient_error:
            # of the visibility rows, which are the default, some may be absent
            wrong = [kind for kind in kinds if kind not in known and kind not in VISIBILITY]
            if wrong:
                raise unknown_name(
                    "kind of rows in gradient_error_rows", str(wrong[0]), sorted(known)
                )
            if not known & set(kinds):
                raise ConfigurationError(
                    f"gradient_error concerns rows of the kinds {', '.join(kinds)}, of which "
                    f"there is none; "
                    f"gradient_error_rows may name {', '.join(sorted(known)) or 'nothing here'}"
                )
            speeds = sorted(
                {c.kind for c in constraints.constraints if isinstance(c, SpeedConstraint)}
                & set(kinds)
            )
            if speeds:
                raise ConfigurationError(
                    f"gradient_error_rows cannot name {', '.join(speeds)}: a speed is not σ + K σ̇"
                )
        concerned = np.isin(constraints.kinds, kinds)
        signs = disturbances.per_joint("gradient_error_signs", n)
        self._share = disturbances.gradient_error * np.outer(concerned, signs)
        self._K = constraints.K
        self._in_phi = disturbances.gradient_error_in_phi
        self.any = bool(self._share.any())

    def __call__(self, rows: Rows, qd: Array) -> Rows:
        """The rows with erroneous gradients, at q̇ (n,)."""
        if not self.any:
            return rows
        error = gradient_error(rows.Lg, self._share)
        if not self._in_phi:
            return replace(rows, Lg=rows.Lg + error)
        change = error @ qd
        return replace(
            rows, phi=rows.phi + change, Lg=rows.Lg + error, Lf=rows.Lf + change / self._K
        )

    def write(self, step: Step) -> None:
        """Let a compiled step make the same rows."""
        if self.any:
            step.gradient_error["address"] = load("constraint_rows").APPLY_GRADIENT_ERROR
            step.gradient_error["in_phi"] = self._in_phi
            step.gradient_share[:] = self._share
