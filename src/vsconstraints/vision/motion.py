"""How targets and obstacles move (section 5.4): known functions of time with their first two
derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InvalidInput
from ..formulas.motion import displacement, target_pose
from ..robots.geometry import Pose, vector
from ..rows import Array

TURN = 2.0 * np.pi


class Motion:
    """A displacement d(t) = v t + A (sin(2πft + ψ) − sin ψ), zero at t = 0, in the image or in
    space.

    Parameters
    ----------
    velocity
        (k,) v, in px/s (k = 2) or m/s (k = 3).
    amplitude
        (k,) A, in px or m.
    frequency
        f [Hz].
    phase
        ψ [rad].
    known
        Whether controllers are told: φ and L_fφ then contain ∂φ/∂t, and tasks ∂s/∂t. Otherwise they
        see where the thing is, but take it for static.
    """

    def __init__(
        self,
        velocity: Sequence[float] | None = None,
        *,
        amplitude: Sequence[float] | None = None,
        frequency: float = 0.0,
        phase: float = 0.0,
        known: bool = True,
    ) -> None:
        given = [value for value in (velocity, amplitude) if value is not None]
        size = len(given[0]) if given and isinstance(given[0], Sequence | np.ndarray) else 3
        self.velocity = vector(
            np.zeros(size) if velocity is None else velocity, size, "velocity of a motion"
        )
        self.amplitude = vector(
            np.zeros(size) if amplitude is None else amplitude, size, "amplitude of a motion"
        )
        if not (np.isfinite(frequency) and frequency >= 0.0 and np.isfinite(phase)):
            raise InvalidInput(
                f"frequency must be zero or more and phase finite, not {frequency} and {phase}"
            )
        if self.amplitude.any() and frequency == 0.0:
            raise InvalidInput("an amplitude needs a frequency, else nothing moves")
        self.size = size
        self.rate = TURN * float(frequency)
        self.phase = float(phase)
        self.known = bool(known)

    def displacement(self, t: Array | float) -> Array:
        """(..., k) d at times (...)."""
        return self._at(np.asarray(t, dtype=np.float64)[..., None])[0]

    def rates(self, t: float) -> tuple[Array, Array]:
        """Velocity and acceleration (k,) at time t [s]."""
        return self._at(t)[1:]

    def _at(self, t: Array | float) -> tuple[Array, Array, Array]:
        return displacement(t, self.velocity, self.amplitude, self.rate, self.phase)


@dataclass(frozen=True)
class TargetMotion:
    """A rigid motion x ↦ R(t)(x − c) + c + d(t) of the target, R a turn with constant angular
    velocity.

    The target's frame O coincides with the base frame at t = 0 and moves with the target.
    """

    #: d(t), in metres in the base frame; says whether the whole motion is known.
    translation: Motion
    angular_velocity: Array  #: (3,) ω in the base frame [rad/s].
    centre: Array  #: (3,) c in the base frame at t = 0 [m].

    def __post_init__(self) -> None:
        if self.translation.size != 3:
            raise InvalidInput(
                f"a target moves in space: three numbers, not {self.translation.size}"
            )
        for name in ("angular_velocity", "centre"):
            vector(getattr(self, name), 3, f"{name} of a target's motion")

    @property
    def known(self) -> bool:
        """Whether controllers are told."""
        return self.translation.known

    def pose(self, t: float) -> Pose:
        """Pose of the target's frame in the base frame."""
        R, position = target_pose(
            t, self.angular_velocity, self.centre, self.translation.displacement(t)
        )
        return Pose(np.array(R), np.array(position))
