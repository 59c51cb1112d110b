"""Motion of targets and obstacles (section 5.4).

Motions are known functions of time with their first two derivatives.
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
    """Displacement d(t) = v t + A (sin(2πft + ψ) − sin ψ) in the image or in space, zero at t = 0.

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
        True if controllers know the motion: φ and L_fφ then contain ∂φ/∂t, and tasks ∂s/∂t.
        Otherwise they see the current position, but assume that the object is static.
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
        """Return d (..., k) at times (...)."""
        return self._at(np.asarray(t, dtype=np.float64)[..., None])[0]

    def rates(self, t: float) -> tuple[Array, Array]:
        """Return velocity and acceleration (k,) at time t [s]."""
        return self._at(t)[1:]

    def _at(self, t: Array | float) -> tuple[Array, Array, Array]:
        return displacement(t, self.velocity, self.amplitude, self.rate, self.phase)


@dataclass(frozen=True)
class TargetMotion:
    """Rigid motion x ↦ R(t)(x − c) + c + d(t) of the target at constant angular velocity.

    The target's frame O coincides with the base frame at t = 0 and moves with the target.
    """

    #: d(t) [m] in the base frame; its ``known`` holds for the whole motion.
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
        """True if controllers know the motion."""
        return self.translation.known

    def pose(self, t: float) -> Pose:
        """Return the pose of the target's frame in the base frame at time t [s]."""
        R, position = target_pose(
            t, self.angular_velocity, self.centre, self.translation.displacement(t)
        )
        return Pose(np.array(R), np.array(position))
