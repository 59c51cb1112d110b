"""Poses and rotations: the few formulas that kinematics, cameras and features share.

``aMb`` maps coordinates in frame b to coordinates in frame a: p_a = R p_b + t. Twists are (v, ω), linear first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import msgspec
import numpy as np
import pinocchio as pin

from .errors import InvalidInput, shown
from .formulas import rotation
from .formulas.poses import angle
from .rows import Array

Numbers = Sequence[float] | Array
Vector2 = Annotated[Sequence[float], msgspec.Meta(min_length=2, max_length=2)]
Vector3 = Annotated[Sequence[float], msgspec.Meta(min_length=3, max_length=3)]
"""Any, two, and three numbers: arguments that files may give, too."""


def vector(value: object, length: int, what: str) -> Array:
    """``value`` as a finite float array of shape (length,); raises InvalidInput that names ``what``."""
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInput(f"{what} must be {length} numbers, not {shown(value)}") from error
    if array.shape != (length,):
        raise InvalidInput(f"{what} must be {length} numbers; it has the shape {array.shape}")
    if not np.isfinite(array).all():
        raise InvalidInput(f"{what} must be finite, not {array}")
    return array


@dataclass(frozen=True, slots=True)
class Pose:
    """A rigid transformation aMb: R (3, 3) a rotation matrix, t (3,) in metres."""

    R: Array
    t: Array

    @classmethod
    def identity(cls) -> Pose:
        """The transformation that changes nothing."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def from_xyz_rpy(cls, xyz: Vector3, rpy: Vector3) -> Pose:
        """From a translation [m] and roll, pitch, yaw [rad]: R = Rz(yaw) Ry(pitch) Rx(roll), as in URDF."""
        roll, pitch, yaw = vector(rpy, 3, "rpy")
        return cls(np.asarray(pin.rpy.rpyToMatrix(roll, pitch, yaw)), vector(xyz, 3, "xyz"))

    @property
    def inverse(self) -> Pose:
        """BMa for this aMb."""
        return Pose(self.R.T, -self.R.T @ self.t)

    def __matmul__(self, other: Pose) -> Pose:
        return Pose(self.R @ other.R, self.R @ other.t + self.t)

    def act(self, points: Array) -> Array:
        """Coordinates (..., 3) in frame a of points given in frame b."""
        moved: Array = points @ self.R.T + self.t
        return moved

    @property
    def twist_matrix(self) -> Array:
        """(6, 6) aVb, which turns a twist (v, ω) at b's origin in b's axes into the one at a's origin in a's axes."""
        V = np.zeros((6, 6))
        V[:3, :3] = V[3:, 3:] = self.R
        V[:3, 3:] = skew(self.t) @ self.R
        return V


def distance(a: Pose, b: Pose) -> tuple[float, float]:
    """Translation [m] and angle [rad] between two poses."""
    d = a.t - b.t
    # accurate near zero too, where the arc cosine of the trace is not
    sine = np.linalg.norm(a.R - b.R) / np.sqrt(8.0)
    return float(np.sqrt(d @ d)), 2.0 * float(np.arcsin(min(1.0, sine)))


def distances(R: Array, t: Array, pose: Pose) -> Array:
    """(N, 2) what :func:`distance` says of poses, R (N, 3, 3) and t (N, 3), and another one."""
    away = np.sqrt(((t - pose.t) ** 2).sum(axis=1))
    return np.stack((away, angle(((R - pose.R) ** 2).sum(axis=(1, 2)))), axis=1)


def skew(w: Array) -> Array:
    """(..., 3, 3) matrices [w]× with [w]× a = w × a, of vectors w (..., 3)."""
    W = np.zeros((*w.shape, 3))
    x, y, z = w[..., 0], w[..., 1], w[..., 2]
    W[..., 0, 1], W[..., 0, 2], W[..., 1, 2] = -z, y, -x
    W[..., 1, 0], W[..., 2, 0], W[..., 2, 1] = z, -y, x
    return W


def rotation_vector(R: Array, near: Array | None = None) -> Array:
    """θu (3,) with exp([θu]×) = R, the one closest to ``near`` (3,): see :func:`.formulas.rotation.rotation_vector`."""
    return np.array(rotation.rotation_vector(R.tolist(), (0.0, 0.0, 0.0) if near is None else near, near is not None))


def rotation_vector_rate(w: Array, omega: Array) -> tuple[Array, Array]:
    """L_θu and L̇_θu (3, 3): see :func:`.formulas.rotation.rotation_vector_rate`."""
    _, L, L_dot = rotation.rotation_vector_rate(w.tolist(), omega.tolist())
    return np.array(L), np.array(L_dot)
