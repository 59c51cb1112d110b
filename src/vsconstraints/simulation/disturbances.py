"""Deviations of the real system from the controller's model.

They are settings of a scenario and the same for every controller.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from ..errors import InvalidInput
from ..robots.geometry import Vector3, require_sign, vector
from ..robots.limits import per_joint
from ..rows import Array

#: Signs of eq. (49), one per joint; repeated for arms with more joints.
GRADIENT_SIGNS = (-1.0, 1.0, 1.0, 1.0, -1.0, -1.0)
VISIBILITY = ("fov", "occlusion")  #: Kinds of the rows that eq. (49) concerns.


@dataclass(frozen=True)
class Disturbances:
    """Deviations of actuation, measurement and model; the default is none."""

    gradient_error: float = 0.0  #: c_e of eq. (49): ∇σ_e = ∇σ + c_e s ∘ abs(∇σ) in place of ∇σ.
    #: True: ∇σ_e also stands in φ = σ + K σ̇ and in L_fφ. False: only in L_gφ. The paper does not
    #: specify this.
    gradient_error_in_phi: bool = True
    gradient_error_signs: tuple[float, ...] = GRADIENT_SIGNS  #: s, one sign per joint.
    #: Kinds of the rows concerned; visibility rows in (49).
    gradient_error_rows: tuple[str, ...] = VISIBILITY
    #: d_c of eq. (6), one per joint or one for all [rad/s² or m/s²].
    acceleration: tuple[float, ...] = (0.0,)
    #: Standard deviation of noise that is added to d_c, drawn anew in every period.
    acceleration_noise: float = 0.0
    #: Time constant of the low-level loop C [s]: that of a first-order lag of q̈ behind q̈_c or,
    #: with position control, the inverse of both poles of a critically damped position loop.
    time_constant: float = 0.0
    #: Delay from the beginning of a command's period until it acts, for one period [s]. Until the
    #: first command acts, q̈_c is zero. The law does not know the delay. Not applicable to an arm
    #: with mass.
    command_delay: float = 0.0
    #: Standard deviation of the noise on every pixel coordinate of every image [px].
    pixel_noise: float = 0.0
    depth_factor: float = 1.0  #: Believed depth of the markers relative to the true one.
    #: Believed focal lengths (F_u, F_v) relative to the true ones.
    focal_factor: tuple[float, float] = (1.0, 1.0)
    #: Error of the believed principal point, believed minus true [px].
    principal_point_error: tuple[float, float] = (0.0, 0.0)
    #: Believed distortion coefficients of the lens relative to the true ones: one number, or one
    #: per coefficient; 0 stands for a lens that is believed to be free of distortion.
    distortion_factor: tuple[float, ...] = (1.0,)
    #: Error of the believed position of the camera on the robot, or in space if it is fixed, in the
    #: camera's true frame [m].
    mount_translation_error: Vector3 = (0.0, 0.0, 0.0)
    #: Rotation vector of the error of the believed orientation, about the camera's own axes [rad].
    mount_rotation_error: Vector3 = (0.0, 0.0, 0.0)
    #: Believed distances between markers relative to the true ones, with the same centroid.
    marker_distance_factor: float = 1.0
    #: Time between images [s], a multiple of the sampling time; zero stands for the sampling time.
    #: The last image is held between images.
    image_period: float = 0.0
    delay: int = 0  #: Age of an image when it becomes usable, in image periods.
    #: True if images carry their time stamp: they are then predicted to the current time with the
    #: model's motion.
    delay_known: bool = False
    #: Probability that an image is lost; the last one before it then remains in use.
    lost_frames: float = 0.0
    #: Seed of everything random: the same numbers are drawn whatever the controller does.
    seed: tuple[int, ...] = (0,)

    def __post_init__(self) -> None:
        for field in fields(self):
            # a seed is an integer of any size, which np.isfinite may not accept
            named = field.name in ("gradient_error_rows", "seed")
            if not named and not np.isfinite(getattr(self, field.name)).all():
                raise InvalidInput(
                    f"disturbance {field.name} must be finite, not {getattr(self, field.name)}"
                )
        for name in ("focal_factor", "principal_point_error"):
            if len(getattr(self, name)) != 2:
                raise InvalidInput(
                    f"disturbance {name} must be two numbers, not {getattr(self, name)}"
                )
        least = (
            *(
                "gradient_error",
                "acceleration_noise",
                "time_constant",
                "command_delay",
                "pixel_noise",
                "image_period",
            ),
            "delay",
        )
        factors = "depth_factor", "focal_factor", "marker_distance_factor"
        require_sign(self, "disturbance ", positive=factors, zero_or_more=least)
        if self.delay != int(self.delay):
            raise InvalidInput(
                f"disturbance delay is a whole number of image periods, not {self.delay}"
            )
        if not 0.0 <= self.lost_frames < 1.0:
            raise InvalidInput(
                f"disturbance lost_frames is a probability below 1, not {self.lost_frames}"
            )
        for name in ("mount_translation_error", "mount_rotation_error"):
            vector(getattr(self, name), 3, f"disturbance {name}")
        if not self.gradient_error_signs or not set(self.gradient_error_signs) <= {-1.0, 1.0}:
            raise InvalidInput(
                f"gradient_error_signs must be 1 or −1 per joint, not {self.gradient_error_signs}"
            )

    def per_joint(self, name: str, n: int) -> Array:
        """Return a setting for n joints, also if it is given as one number for all.

        The default signs of (49) are repeated.
        """
        values = getattr(self, name)
        if name == "gradient_error_signs" and tuple(values) == GRADIENT_SIGNS:
            return np.resize(np.array(values), n)
        return per_joint(f"disturbance {name}", values[0] if len(values) == 1 else values, n)

    @property
    def random(self) -> bool:
        """True if anything is drawn from the seed."""
        return bool(self.acceleration_noise or self.pixel_noise or self.lost_frames)

    @property
    def image(self) -> bool:
        """True if the measured image differs from the true image at that time."""
        return bool(self.pixel_noise or self.delay or self.lost_frames or self.image_period)

    @property
    def intrinsics(self) -> bool:
        """True if the believed focal lengths or principal point are wrong."""
        return tuple(self.focal_factor) != (1.0, 1.0) or tuple(self.principal_point_error) != (
            0.0,
            0.0,
        )

    @property
    def distortion(self) -> bool:
        """True if the believed distortion of the lens is wrong."""
        return any(factor != 1.0 for factor in self.distortion_factor)

    @property
    def mount(self) -> bool:
        """True if the believed mounting of the camera is wrong."""
        return any((*self.mount_translation_error, *self.mount_rotation_error))

    @property
    def target(self) -> bool:
        """True if the believed distances between the markers are wrong."""
        return self.marker_distance_factor != 1.0

    @property
    def sensing(self) -> bool:
        """True if the image is measured or interpreted wrongly."""
        wrong = self.intrinsics or self.distortion or self.mount or self.target
        return self.image or wrong or self.depth_factor != 1.0
