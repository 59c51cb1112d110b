"""How targets and obstacles move, and the camera relative to them: see :mod:`vsconstraints.motion`."""

from __future__ import annotations

import numpy as np

from ..rows import Array
from .compiler import in_place
from .kinematics import ANGULAR_ACCELERATION, ANGULAR_VELOCITY, cross, turn_about, turned, turned_back
from .rotation import length


@in_place
def displacement(F: Array, at: int, size: int, t: float, out: Array) -> None:
    """Write displacement, velocity and acceleration (3, size) of a motion to ``out``."""
    rate, phase = F[at + 2 * size], F[at + 2 * size + 1]
    s, c, s0 = np.sin(rate * t + phase), np.cos(rate * t + phase), np.sin(phase)
    for i in range(size):
        v, A = F[at + i], F[at + size + i]
        out[0, i] = v * t + A * (s - s0)
        out[1, i] = v + A * rate * c
        out[2, i] = -A * rate * rate * s


@in_place
def target_pose(F: Array, at: int, t: float, moved: Array, R: Array, position: Array, axis: Array) -> None:
    """Write the target's displacement and its derivatives (3, 3), and its pose R (3, 3) and position (3,).

    ``axis`` (3,) gets that of its turn, if it turns.
    """
    displacement(F, at, 3, t, moved)
    omega, centre = F[at + 8 : at + 11], F[at + 11 : at + 14]
    rate = length(omega)
    for i in range(3):
        axis[i] = omega[i] / rate if rate > 0.0 else 0.0
    turn_about(axis, np.sin(rate * t), np.cos(rate * t), R)
    turned(R, centre, position)
    for i in range(3):
        position[i] = centre[i] - position[i] + moved[0, i]


@in_place
def relative_motion(
    tip: Array,
    origin: Array,
    moved: Array,
    omega: Array,
    away: Array,
    s: Array,
    base: Array,
    twist: Array,
    camera_R: Array,
) -> None:
    """Write v, ω, v̇ and ω̇ (4, 3) of the camera relative to the target, in the camera's axes, to ``twist``.

    Parameters
    ----------
    tip
        (6, 3) motion of the body that carries the camera.
    origin
        (3, 3) position, velocity and acceleration of the camera's origin in the base frame.
    moved, omega, away
        (3, 3), (3,) and (3,): the target's displacement with its derivatives, its angular velocity, and the camera's
        origin from its centre, in the base frame.
    s, base
        (3,) and (4, 3), scratch.
    camera_R
        (3, 3) orientation of the camera in the base frame.
    """
    # velocity of the target's body at the camera's origin
    cross(omega, away, s)
    for i in range(3):
        base[0, i] = origin[1, i] - moved[1, i] - s[i]
        base[1, i] = tip[ANGULAR_VELOCITY, i] - omega[i]
        # until it is needed for what it is
        base[3, i] = origin[1, i] - moved[1, i]
    cross(omega, base[3], s)
    cross(tip[ANGULAR_VELOCITY], base[0], base[2])
    for i in range(3):
        base[2, i] = origin[2, i] - moved[2, i] - s[i] - base[2, i]
    cross(tip[ANGULAR_VELOCITY], omega, base[3])
    for i in range(3):
        base[3, i] += tip[ANGULAR_ACCELERATION, i]
    for i in range(4):
        turned_back(camera_R, base[i], twist[i])
