"""Measurements that a controller receives, and errors of the rows' gradients.

Images may be late, noisy or lost, and the controller's model of the camera may be wrong.
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

STOPPING = 0.1  #: Time constant with which an arm without usable images is braked [s].


def believed_camera(camera: Camera, disturbances: Disturbances) -> Camera:
    """Return the camera model that the controller uses.

    Raises ConfigurationError if a distortion factor does not fit the camera.
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
        # the error applies to the camera's pose in the tip's frame, the inverse of the mount
        return replace(believed, mount=error.inverse @ camera.mount)
    return believed


def believed_scene(scene: Scene, disturbances: Disturbances) -> Scene:
    """Return the scene that the controller uses; the true one if they do not differ."""
    camera = believed_camera(scene.camera, disturbances)
    markers = scene.markers
    if disturbances.target:
        middle = markers.mean(axis=0)
        markers = middle + disturbances.marker_distance_factor * (markers - middle)
    if camera is scene.camera and markers is scene.markers:
        return scene
    return Scene(scene.robot, camera, markers, scene.points, scene.motion)


def ideal_pixels(camera: Camera, pixels: Array) -> Array:
    """Return ideal pixels (..., 2) of sensor pixels, even where the camera would refuse."""
    if camera.distortion is None:
        return pixels
    return camera.pixels(camera.distortion.remove(camera.normalised(pixels))[0])


def shown_to(camera: Camera, believed: Camera, pixels: Array) -> Array:
    """Return normalised coordinates (..., 2) as a believed camera sees them.

    ``pixels`` (..., 2) are ideal pixels of the true camera.
    """
    return believed.normalised(ideal_pixels(believed, camera.distort(pixels)))


class Sensor:
    """Sensor that turns true states into measurements, sample by sample.

    The camera's pose is estimated from the measured image by least squares (section 2, third part
    of the computer vision algorithm). If the markers do not determine it, it is taken from the
    kinematics. Robot coordinates and speeds are measured without error. ``unknown_motion`` is true
    if an object that constraints forbid moves in a way unknown to the controller. Raises
    ConfigurationError if the image period is not a multiple of the sampling time.
    """

    #: True if images are rendered: then a sample is measured in Python, before its step.
    renders = False
    blind = False  #: True if no usable image exists, so that the arm must brake.

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
        #: True if the controller's values differ from the true ones.
        self.disturbed = disturbances.sensing or unknown_target or unknown_motion
        self.reset()

    def reset(self) -> None:
        """Begin a new run with the same random numbers."""
        self._covered = 0
        self._images: Images | None = None

    def images(self, samples: int) -> Images:
        """Return the images of a run of so many samples; their errors are drawn beforehand."""
        settings = self.disturbances
        markers = len(self.scene.markers)
        noise: Array = np.zeros((1, markers, 2))
        lost: BoolArray = np.zeros(1, dtype=np.bool_)
        if settings.pixel_noise or settings.lost_frames:
            count = 1 + (samples - 1) // self._every
            normal, uniform = _drawn((*settings.seed, 1), count, markers)
            noise = settings.pixel_noise * normal
            lost = uniform < settings.lost_frames
        slots = settings.delay + 1
        if self._images is None:
            held: Array = np.zeros((slots, markers, 2))
            taken: Array = np.zeros(slots)
        else:
            held = self._images.held
            taken = self._images.taken
        self._images = Images(self._every, int(settings.delay_known), noise, lost, held, taken)
        self._covered = samples
        return self._images

    @property
    def estimates(self) -> bool:
        """True if the camera's pose is estimated from the measured image."""
        wrong = self.disturbances
        return wrong.image or wrong.intrinsics or wrong.distortion or wrong.mount or wrong.target

    def sensing(self, samples: int) -> Sensing:
        """Return the workspace of the compiled form of :meth:`measured`, for so many samples."""
        M = len(self.scene.markers)
        camera = self.scene.camera
        address = 0
        if camera.distortion is not None:
            address = load("lenses").address_of(camera.distortion.model)
        lenses = Lenses(
            address=address,
            true=np.array(camera.eye),
            believed=np.array(self.camera.eye),
            pixels=np.empty((M, 2)),
        )
        # room for the search of a pose that explains M markers
        room = np.empty(64 * M + 256)
        scratch = Scratch(room, np.zeros(1, dtype=np.int64))
        return Sensing(self.images(samples), lenses, scratch)

    def measured(
        self, k: int, q: Array, qd: Array, world: Evaluation | None = None
    ) -> Measurement | None:
        """Return the measurement in sample ``k``, or None if the believed scene predicts it.

        ``world`` is the evaluation of the true state. Raises SceneError if no pose with all markers
        in front of the camera explains the image.
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
            raise SceneError(f"no camera pose explains the measured image: {error}") from error
        return Measurement(pixels, Z, images.taken[slot] if images.dated else t, camera)

    def newest(self, k: int, ideal: Array) -> tuple[Array, float, Pose | None]:
        """Return the newest usable image in sample ``k``, after it was measured.

        Returns its sensor pixels (M, 2) from the image centre, its time [s] and, if the sensor has
        measured it already, the camera's pose in the target's frame. The time is the present one if
        the controller does not know it. ``ideal`` (M, 2) are the true ideal pixels.
        """
        t = k * self._Ts
        images = self._images
        if images is None:
            return self.scene.camera.distort(ideal), t, None
        slots = len(images.held)
        slot = max(k // images.every - slots + 1, 0) % slots
        taken = float(images.taken[slot]) if images.dated else t
        return images.held[slot].copy(), taken, None

    def write(self, step: Step) -> None:
        """Let a compiled step predict measurements of future states, without delay and noise."""
        write_camera(step, self.camera)
        step.markers[:] = self.believed.markers
        step.camera["depth_factor"] = self.disturbances.depth_factor

    def braking(self, qd: Array) -> Array:
        """Return q̈ (n,) that stops the arm when there is no usable image.

        The actuators execute as much of it as they can.
        """
        return -qd / STOPPING

    def remarks(self) -> list[str]:
        """Return remarks on the images for a reader of the results."""
        return []


@lru_cache(maxsize=4)
def _drawn(seed: tuple[int, ...], images: int, markers: int) -> tuple[Array, Array]:
    """Draw standard normal (N, m, 2) and uniform (N,) numbers for one image after the other.

    They are drawn whether they are used or not, so that every controller meets the same ones, and
    cached for the next controller.
    """
    random = np.random.default_rng(seed)
    normal = np.empty((images, markers, 2))
    uniform = np.empty(images)
    for i in range(images):
        random.standard_normal(out=normal[i])
        uniform[i] = random.random()
    return normal, uniform


class GradientError:
    """Error of the rows' gradients, ∇σ_e = ∇σ + c_e s ∘ |∇σ|.

    It applies where the rows contain ∇σ: in L_gφ and, unless set otherwise, in φ and L_fφ.
    """

    def __init__(self, constraints: ConstraintSet, disturbances: Disturbances, n: int) -> None:
        kinds = disturbances.gradient_error_rows
        known = set(constraints.kinds)
        if disturbances.gradient_error:
            # some of the visibility rows, which are the default, may be absent
            wrong = [kind for kind in kinds if kind not in known and kind not in VISIBILITY]
            if wrong:
                raise unknown_name(
                    "kind of rows in gradient_error_rows", str(wrong[0]), sorted(known)
                )
            if not known & set(kinds):
                raise ConfigurationError(
                    f"gradient_error_rows names the kinds {', '.join(kinds)}, but there are no "
                    f"such rows; it may name {', '.join(sorted(known)) or 'nothing here'}"
                )
            of_speeds = {
                constraint.kind
                for constraint in constraints.constraints
                if isinstance(constraint, SpeedConstraint)
            }
            named_speeds = sorted(of_speeds & set(kinds))
            if named_speeds:
                raise ConfigurationError(
                    f"gradient_error_rows cannot name {', '.join(named_speeds)}: a speed is not "
                    f"σ + K σ̇"
                )
        concerned = np.isin(constraints.kinds, kinds)
        signs = disturbances.per_joint("gradient_error_signs", n)
        self._share = disturbances.gradient_error * np.outer(concerned, signs)
        self._K = constraints.K
        self._in_phi = disturbances.gradient_error_in_phi
        self.any = bool(self._share.any())

    def __call__(self, rows: Rows, qd: Array) -> Rows:
        """Return the rows with erroneous gradients, at q̇ (n,)."""
        if not self.any:
            return rows
        error = gradient_error(rows.Lg, self._share)
        if not self._in_phi:
            return replace(rows, Lg=rows.Lg + error)
        change = error @ qd
        return replace(
            rows,
            phi=rows.phi + change,
            Lg=rows.Lg + error,
            Lf=rows.Lf + change / self._K,
        )

    def write(self, step: Step) -> None:
        """Let a compiled step apply the same errors."""
        if self.any:
            step.gradient_error["address"] = load("constraint_rows").APPLY_GRADIENT_ERROR
            step.gradient_error["in_phi"] = self._in_phi
            step.gradient_share[:] = self._share
