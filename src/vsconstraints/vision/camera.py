"""Camera: pixels, normalised coordinates, lens distortion and mounting pose.

One convention for pixels holds everywhere: (u, v) from the centre of the image, u to the right and
v down. Pixels that count from the top left corner are converted by :meth:`Camera.from_corner` and
:meth:`Camera.to_corner`.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from ..errors import CalibrationWarning, ConfigurationError, InvalidInput, unknown_name
from ..robots.geometry import Pose, Vector2, vector
from ..rows import Array, BoolArray
from ..rows.readable import amounts, in_one_line
from .calibration import read_calibration
from .distortion import Distortion
from .hand_eye import read_hand_eye

LARGEST_IMAGE = 1e4  #: Longest side of an image [px].
#: Largest plausible distance of a principal point from the image centre, relative to half the image
#: size.
CENTRED = 0.2
#: Distance, in the same units, beyond which the principal point belongs to another image.
ELSEWHERE = 0.4
#: Distances of a camera above which millimetres are suspected: from the tip that carries it, and
#: from the robot's base if it is fixed [m].
MAX_MOUNT = 3.0
MAX_FIXED = 20.0
#: Number of coefficients of a fisheye, which a Brown–Conrady lens may have, too.
FISHEYE_COUNT = 4
TANGENTIAL = 0.02  #: Largest plausible coefficient of tangential distortion.
#: Arguments of :meth:`.mounted` for a camera that the arm carries.
CARRIED = ("camera_in_tip", "tip_in_camera")
Count = Literal["edges", "centres"]  #: Origin of pixels: edge or centre of the first one.


@dataclass(frozen=True)
class Camera:
    """Pinhole camera with optional lens distortion, carried by the end-effector or fixed in space.

    With distortion, pixels are *ideal*: those of a pinhole of the same focal lengths and principal
    point, in which straight lines are straight. :meth:`undistort` computes them from pixels on the
    *sensor*, :meth:`distort` is its inverse. Without distortion the two are equal.

    The principal point is where the optical axis meets the image, measured from the top left
    corner; None is the image centre. Pixels are counted by their edges, so its coordinates are half
    a pixel larger than OpenCV's c_x and c_y.
    """

    focal_px: tuple[float, float]  #: (F_u, F_v): focal length divided by the pixel size.
    size_px: tuple[float, float]  #: (W, H): width and height of the image.
    principal_point_px: tuple[float, float] | None = None
    #: ᶜMₑ: pose of the robot tip in the camera frame, for a camera on the robot.
    mount: Pose = field(default_factory=Pose.identity)
    #: Pose in the base frame, for a camera that observes the robot (eye-to-hand).
    fixed: Pose | None = None
    distortion: Distortion | None = None  #: Lens distortion; None for an ideal pinhole.

    def __post_init__(self) -> None:
        for name in ("focal_px", "size_px"):
            if (vector(getattr(self, name), 2, f"camera {name}") <= 0.0).any():
                raise InvalidInput(f"camera {name} must be positive, not {getattr(self, name)}")
        if max(self.size_px) > LARGEST_IMAGE:
            raise InvalidInput(
                f"camera size_px is at most {LARGEST_IMAGE:g} px a side, not {self.size_px}"
            )
        if self.principal_point_px is not None:
            vector(self.principal_point_px, 2, "camera principal_point_px")
        if self.fixed is not None and (
            self.mount.t.any() or not np.array_equal(self.mount.R, np.eye(3))
        ):
            raise InvalidInput(
                "a camera is mounted on the robot or fixed in space, not both: give mount or fixed"
            )

    @in_one_line
    def __repr__(self) -> str:
        width, height = self.size_px
        lens = "" if self.distortion is None else f", {self.distortion.model} lens"
        place = "on the robot" if self.fixed is None else f"fixed at {amounts(self.fixed.t, 'm')}"
        focal = " and ".join(dict.fromkeys(f"{F:.4g}" for F in self.focal_px))
        return f"<Camera {width:g} × {height:g} px, focal length {focal} px{lens}, {place}>"

    def pose(self, tip: Pose) -> Pose:
        """Return the pose in the base frame while the tip is at ``tip``; a fixed camera stays."""
        return tip @ self.mount.inverse if self.fixed is None else self.fixed

    @classmethod
    def from_calibration(
        cls,
        calibration: str | Path,
        *,
        size_px: Vector2 | None = None,
        distortion_model: Literal["brown-conrady", "fisheye"] | None = None,
    ) -> Camera:
        """Return the camera of a calibration file from OpenCV, ROS or Kalibr.

        Formats are ``cv::FileStorage`` (YAML or XML), camera_info and camchain files. ``size_px``
        is the size of the images in use: it is compared with the file, or replaces a missing size.
        ``distortion_model`` overrides the model in the file; the default is ``brown-conrady`` if
        neither states one. Raises ConfigurationError if the file cannot be used or belongs to
        another image size. Issues a CalibrationWarning for implausible values: see :attr:`doubts`.
        """
        camera = cls(**read_calibration(calibration, distortion_model, size_px))
        if size_px is not None and tuple(size_px) != camera.size_px:
            raise ConfigurationError(
                f"{calibration} is a calibration for images of {camera.size[0]:g} × "
                f"{camera.size[1]:g} px, not of {size_px[0]:g} × {size_px[1]:g} px: calibrate "
                "the camera at the size that is used"
            )
        for doubt in camera.doubts:
            warnings.warn(f"{calibration}: {doubt}", CalibrationWarning, stacklevel=2)
        return camera

    def mounted(
        self,
        *,
        camera_in_tip: Pose | str | Path | None = None,
        tip_in_camera: Pose | str | Path | None = None,
        camera_in_base: Pose | str | Path | None = None,
        base_in_camera: Pose | str | Path | None = None,
    ) -> Camera:
        """Return the camera at a pose from a hand–eye calibration; exactly one pose is given.

        A pose may be replaced by the path of a file that a calibration tool has written: see
        :func:`.read_hand_eye`.

        Parameters
        ----------
        camera_in_tip
            ᵉM_c: pose of the camera in the tip frame. For a camera on the robot,
            ``cv2.calibrateHandEye`` returns it as R_cam2gripper and t_cam2gripper.
        tip_in_camera
            ᶜMₑ, its inverse: :attr:`mount`.
        camera_in_base, base_in_camera
            Pose of a camera that is fixed in space in the robot's base frame, :attr:`fixed`, or
            its inverse.

        Raises
        ------
        InvalidInput
            unless exactly one pose is given.
        ConfigurationError
            if a file cannot be read, or if it states that the camera is on the arm while the
            argument is for a camera beside it, or vice versa.

        Warns
        -----
        CalibrationWarning
            if the camera is so far away that millimetres are suspected.
        """
        given = {
            "camera_in_tip": camera_in_tip,
            "tip_in_camera": tip_in_camera,
            "camera_in_base": camera_in_base,
            "base_in_camera": base_in_camera,
        }
        poses = {key: _pose_of(value, key) for key, value in given.items() if value is not None}
        if len(poses) != 1:
            raise InvalidInput(
                "a camera has one of camera_in_tip, tip_in_camera, camera_in_base and "
                "base_in_camera"
            )
        ((key, pose),) = poses.items()
        if key in ("camera_in_tip", "base_in_camera"):
            pose = pose.inverse
        if key in CARRIED:
            camera = replace(self, mount=pose, fixed=None)
        else:
            camera = replace(self, mount=Pose.identity(), fixed=pose)
        doubt = camera._doubt_of_place()
        if doubt:
            warnings.warn(doubt, CalibrationWarning, stacklevel=2)
        return camera

    @property
    def doubts(self) -> list[str]:
        """Warnings about implausible values, one sentence each, with a possible cause."""
        doubts = []
        principal_point = self._doubt_of_principal_point()
        if principal_point:
            doubts.append(principal_point)
        lens = self._doubt_of_lens()
        if lens:
            doubts.append(lens)
        place = self._doubt_of_place()
        if place:
            doubts.append(place)
        return doubts

    def _doubt_of_lens(self) -> str:
        """Return a warning if the coefficients may be those of a fisheye; empty if not."""
        if self.distortion is None or self.distortion.model != "brown-conrady":
            return ""
        coefficients = self.distortion.coefficients
        tangential = coefficients[2:4]
        if max(map(abs, tangential)) > TANGENTIAL:
            p1, p2 = (f"{value:.3g}" for value in tangential)
            return (
                f"the lens's tangential coefficients p₁ = {p1}, p₂ = {p2} are larger than "
                f"real lenses have them: "
                'are these coefficients of a fisheye (distortion_model = "fisheye")?'
            )
        if self.distortion.assumed and len(coefficients) == FISHEYE_COUNT:
            return (
                "the calibration gives four coefficients of distortion and no model; they are "
                'read as k₁, k₂, p₁, p₂ (distortion_model = "brown-conrady"): '
                'are these coefficients of a fisheye (distortion_model = "fisheye")?'
            )
        return ""

    def _doubt_of_place(self) -> str:
        """Return a warning if the camera is far from the robot's tip or base; empty if it is not.

        The base counts for a camera that is fixed in space.
        """
        if self.fixed is None:
            distance = float(np.linalg.norm(self.mount.t))
            if distance <= MAX_MOUNT:
                return ""
            place = f"mounted {distance:.3g} m from the arm's tip"
        else:
            distance = float(np.linalg.norm(self.fixed.t))
            if distance <= MAX_FIXED:
                return ""
            place = f"fixed {distance:.3g} m from the robot's base"
        return f"the camera is {place}: are its coordinates in mm, not m?"

    def _doubt_of_principal_point(self) -> str:
        """Return a warning if the principal point is far off the centre; empty if it is not."""
        if self.principal_point_px is None:
            return ""
        u, v = self.principal_point_px
        width, height = self.size_px
        off_centre = np.hypot(2.0 * u / width - 1.0, 2.0 * v / height - 1.0)
        off_centre_swapped = np.hypot(2.0 * u / height - 1.0, 2.0 * v / width - 1.0)
        off_corner = np.hypot(2.0 * u / width, 2.0 * v / height)
        point = f"the principal point ({u:.4g}, {v:.4g}) px"
        if width != height and off_centre_swapped < CENTRED < off_centre:
            return (
                f"{point} is the centre of {height:g} × {width:g} px, not of {width:g} × "
                f"{height:g} px: "
                "are width and height swapped?"
            )
        if off_centre <= ELSEWHERE:
            return ""
        if off_corner < CENTRED:
            return (
                f"{point} is at the image's corner: is it counted from the image's centre, "
                "not from the top left corner?"
            )
        place = (
            f"{point} is at {u / width:.0%} of the image's width and {v / height:.0%} of its height"
        )
        if min(u, v) > 0.0:
            place += f", near the centre of an image of {2.0 * u:.0f} × {2.0 * v:.0f} px"
        return f"{place}: are these intrinsics of another resolution?"

    @property
    def focal(self) -> tuple[float, float]:
        """:attr:`focal_px`."""
        return self.focal_px

    @property
    def size(self) -> tuple[float, float]:
        """:attr:`size_px`."""
        return self.size_px

    @property
    def offset(self) -> Array:
        """(2,) principal point relative to the image centre [px]."""
        if self.principal_point_px is None:
            return np.zeros(2)
        return np.asarray(self.principal_point_px) - 0.5 * np.asarray(self.size_px)

    def pixels(self, normalised: Array) -> Array:
        """Return pixels (..., 2) relative to the image centre.

        They are computed from normalised coordinates (x, y) = (X/Z, Y/Z).
        """
        pixels: Array = normalised * np.asarray(self.focal_px) + self.offset
        return pixels

    def normalised(self, pixels: Array) -> Array:
        """Return normalised coordinates (..., 2) of pixels relative to the image centre."""
        normalised: Array = (pixels - self.offset) / np.asarray(self.focal_px)
        return normalised

    def from_corner(self, pixels: Array, count: Count = "edges") -> Array:
        """Convert pixels (..., 2) from the top left corner to pixels from the image centre.

        With ``edges``, as in AprilTag, the centre of the first pixel is (0.5, 0.5); with
        ``centres``, as in OpenCV, it is (0, 0).
        """
        centred: Array = np.asarray(pixels) - self._centre(count)
        return centred

    def to_corner(self, pixels: Array, count: Count = "edges") -> Array:
        """Convert pixels (..., 2) from the image centre to pixels from the top left corner.

        See :meth:`from_corner`.
        """
        corner: Array = np.asarray(pixels) + self._centre(count)
        return corner

    def _centre(self, count: Count) -> Array:
        if count not in get_args(Count):
            raise unknown_name("way to count pixels", count, get_args(Count))
        centre: Array = 0.5 * np.asarray(self.size_px) - 0.5 * (count == "centres")
        return centre

    @property
    def eye(self) -> tuple[float, ...]:
        """Parameters of the lens formulas: F_u, F_v, principal point from the centre, lens."""
        focal = self.focal_px
        offset = self.offset.tolist()
        return (
            float(focal[0]),
            float(focal[1]),
            *offset,
            *(self.distortion.parameters if self.distortion else ()),
        )

    def distort(self, pixels: Array) -> Array:
        """Return pixels (..., 2) on the sensor of ideal ones, both relative to the image centre."""
        if self.distortion is None:
            return pixels
        return self.pixels(self.distortion.apply(self.normalised(pixels)))

    def undistort(self, pixels: Array) -> Array:
        """Return ideal pixels (..., 2) of those on the sensor, both relative to the image centre.

        NaN is preserved. Raises InvalidInput if a pixel lies where the distortion cannot be
        inverted.
        """
        if self.distortion is None:
            return pixels
        ideal, certain = self.distortion.remove(self.normalised(pixels))
        if not certain.all():
            first = np.asarray(pixels)[~certain][0]
            raise InvalidInput(
                f"a pixel at ({first[0]:.1f}, {first[1]:.1f}) from the image's centre cannot be "
                f"undistorted: the lens "
                f"({self.distortion.model}) can be inverted up to {self.reach_px:.0f} px from the "
                f"principal point"
            )
        return self.pixels(ideal)

    @property
    def reach_px(self) -> float:
        """Radius around the principal point in which sensor pixels can be undistorted [px]."""
        if self.distortion is None:
            return np.inf
        turn = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
        edge = self.distortion.apply(
            self.distortion.reach * np.stack((np.cos(turn), np.sin(turn)), axis=-1)
        )
        return float(np.linalg.norm(edge * np.asarray(self.focal_px), axis=-1).min())

    def sees(self, pixels: Array) -> BoolArray:
        """True (...) for ideal pixels, relative to the image centre, that lie on the sensor."""
        inside = (np.abs(self.distort(pixels)) <= 0.5 * np.asarray(self.size_px)).all(axis=-1)
        if self.distortion is not None:
            inside &= (
                np.hypot(*np.moveaxis(self.normalised(pixels), -1, 0)) <= self.distortion.reach
            )
        return np.asarray(inside)


def _pose_of(value: Pose | str | Path, key: str) -> Pose:
    """Return a pose, or read it from a hand–eye calibration file.

    Raises ConfigurationError if the file does not fit the argument ``key`` of
    :meth:`.Camera.mounted`.
    """
    if isinstance(value, Pose):
        return value
    pose, carried = read_hand_eye(value)
    if carried is not None and carried != (key in CARRIED):
        right = "camera_in_tip" if carried else "camera_in_base"
        place = (
            "in the hand (in the tip's frame)" if carried else "beside the arm (in the base frame)"
        )
        raise ConfigurationError(
            f"{value} is of a camera {place}: give it as {right}, not as {key}"
        )
    return pose
