"""What goes otherwise than the control assumes: settings of a scenario, the same for every
controller.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from ..errors import InvalidInput
from ..robots.geometry import Vector3, demand_sign, vector
from ..robots.limits import per_joint
from ..rows import Array

#: Of eq. (49), one per joint; repeated for arms with more of them.
GRADIENT_SIGNS = (-1.0, 1.0, 1.0, 1.0, -1.0, -1.0)
VISIBILITY = ("fov", "occlusion")  #: Kinds of the rows that eq. (49) is about.


@dataclass(frozen=True)
class Disturbances:
    """How actuation, measurement and model are off; nothing is unless it is set."""

    gradient_error: float = 0.0  #: c_e of eq. (49): ∇σ_e = ∇σ + c_e s ∘ abs(∇σ) in place of ∇σ.
    #: Whether ∇σ_e stands in φ = σ + K σ̇ (and in L_fφ) too, or in L_gφ alone: the paper does not
    #: say.
    gradient_error_in_phi: bool = True
    gradient_error_signs: tuple[float, ...] = GRADIENT_SIGNS  #: s, one sign per joint.
    #: Kinds of the rows concerned; (49): visibility rows.
    gradient_error_rows: tuple[str, ...] = VISIBILITY
    #: d_c of eq. (6), one per joint or one for all [rad/s² or m/s²].
    acceleration: tuple[float, ...] = (0.0,)
    #: Standard deviation of what is added to d_c anew in every period.
    acceleration_noise: float = 0.0
    #: Of the low-level loop C [s]: a first-order lag of q̈ behind q̈_c or, with position control,
    #: the inverse of both poles of a critically damped position loop.
    time_constant: float = 0.0
    #: How long after the beginning of its period a command begins to act [s], as long as one; until
    #: the first one does, q̈_c is zero. The law is not told. Not of an arm with mass.
    command_delay: float = 0.0
    pixel_noise: float = 0.0  #: Standard deviation of every pixel coordinate of every image [px].
    depth_factor: float = 1.0  #: Believed depth of the markers relative to the true one.
    #: Believed focal lengths (F_u, F_v) relative to the true ones.
    focal_factor: tuple[float, float] = (1.0, 1.0)
    #: Believed principal point less the true one [px].
    principal_point_error: tuple[float, float] = (0.0, 0.0)
    #: Believed coefficients of the lens's distortion relative to the true ones: one number, or one
    #: per coefficient; 0 is a lens that is taken for perfect.
    distortion_factor: tuple[float, ...] = (1.0,)
    #: Where the camera is believed to be on the robot, or in space if it is fixed, in the frame
    #: where it is [m].
    mount_translation_error: Vector3 = (0.0, 0.0, 0.0)
    #: The rotation vector by which it is believed to be turned about its own axes [rad].
    mount_rotation_error: Vector3 = (0.0, 0.0, 0.0)
    #: Believed distances of markers relative to the true ones; same middle.
    marker_distance_factor: float = 1.0
    #: Time between images, a multiple of the sampling time; that itself if zero [s]. Between images
    #: the last is held.
    image_period: float = 0.0
    delay: int = 0  #: How many image periods an image is old when it can be used.
    #: Whether images say when they were taken: what they show is then moved on to now, as the model
    #: says it moved.
    delay_known: bool = False
    #: Probability that an image is lost; the last one before it then stays in use.
    lost_frames: float = 0.0
    #: Of everything random: the same numbers are drawn whatever the controller does.
    seed: tuple[int, ...] = (0,)

    def __post_init__(self) -> None:
        for field in fields(self):
            # a seed is a whole number of any size, which NumPy does not ask such things of
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
        demand_sign(self, "disturbance ", positive=factors, zero_or_more=least)
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
        """A setting for n joints, which one number stands for, too; the default signs of (49) are
        repeated.
        """
        values = getattr(self, name)
        if name == "gradient_error_signs" and tuple(values) == GRADIENT_SIGNS:
            return np.resize(np.array(values), n)
        return per_joint(f"disturbance {name}", values[0] if len(values) == 1 else values, n)

    @property
    def random(self) -> bool:
        """Whether anything is drawn from the seed."""
        return bool(self.acceleration_noise or self.pixel_noise or self.lost_frames)

    @property
    def image(self) -> bool:
        """Whether the measured image is another one than the true image of this moment."""
        return bool(self.pixel_noise or self.delay or self.lost_frames or self.image_period)

    @property
    def intrinsics(self) -> bool:
        """Whether focal lengths or principal point are believed wrongly."""
        return tuple(self.focal_factor) != (1.0, 1.0) or tuple(self.principal_point_error) != (
            0.0,
            0.0,
        )

    @property
    def distortion(self) -> bool:
        """Whether the lens's distortion is believed wrongly."""
        return any(factor != 1.0 for factor in self.distortion_factor)

    @property
    def mount(self) -> bool:
        """Whether the camera is believed to be mounted otherwise than it is."""
        return any((*self.mount_translation_error, *self.mount_rotation_error))

    @property
    def target(self) -> bool:
        """Whether the markers are believed to be farther from one another than they are, or
        nearer.
        """
        return self.marker_distance_factor != 1.0

    @property
    def sensing(self) -> bool:
        """Whether what is seen is measured or interpreted wrongly."""
        wrong = self.intrinsics or self.distortion or self.mount or self.target
        return self.image or wrong or self.depth_factor != 1.0
