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
    sine = np.sqrt(((R - pose.R) ** 2).sum(axis=(1, 2)) / 8.0)
    away = np.sqrt(((t - pose.t) ** 2).sum(axis=1))
    return np.stack((away, 2.0 * np.arcsin(np.minimum(1.0, sine))), axis=1)


def skew(w: Array) -> Array:
    """(..., 3, 3) matrices [w]× with [w]× a = w × a, of vectors w (..., 3)."""
    W = np.zeros((*w.shape, 3))
    x, y, z = w[..., 0], w[..., 1], w[..., 2]
    W[..., 0, 1], W[..., 0, 2], W[..., 1, 2] = -z, y, -x
    W[..., 1, 0], W[..., 2, 0], W[..., 2, 1] = z, -y, x
    return W


def rotation_vector(R: Array, near: Array | None = None) -> Array:
    """θu (3,) with exp([θu]×) = R.

    The same rotation is θu, (θ − 2π)u, (θ + 2π)u, …: with ``near`` the one closest to that vector is returned, so
    that a sequence of calls stays continuous in time, also through θ = π. Without it θ ≤ π, and at θ = π, where the
    sign of the axis is ambiguous, the axis is the one whose largest component is positive.
    """
    w = np.asarray(pin.log3(R))
    theta = float(np.linalg.norm(w))
    if near is None:
        # log3 is accurate to about the square root of the rounding error at θ = π
        if theta > np.pi - 1e-6 and w[np.argmax(np.abs(w))] < 0.0:
            return w * (1.0 - 2.0 * np.pi / theta)
        return w
    if theta < 1e-12:
        # no rotation, or whole turns about the axis of ``near``
        length = float(np.linalg.norm(near))
        return near * (2.0 * np.pi * np.round(length / (2.0 * np.pi)) / length) if length > np.pi else w
    axis = w / theta
    turns = np.round((near @ axis - theta) / (2.0 * np.pi))
    closest: Array = w + 2.0 * np.pi * turns * axis
    return closest


def _cotangent_coefficient(theta: float) -> tuple[float, float]:
    """c(θ) = (1 − (θ/2) cot(θ/2)) / θ² and c'(θ) / θ; the series below θ = 0.1 is exact to rounding (1e-13)."""
    if theta < 0.1:
        s = theta * theta
        c = 1.0 / 12.0 + s * (1.0 / 720.0 + s * (1.0 / 30240.0 + s / 1209600.0))
        return c, 1.0 / 360.0 + s * (1.0 / 7560.0 + s * (1.0 / 201600.0 + s / 5987520.0))
    half = 0.5 * theta
    cot = np.cos(half) / np.sin(half)
    c = (1.0 - half * cot) / theta**2
    # d/dθ of (θ/2) cot(θ/2) is ½ cot(θ/2) − (θ/4)(1 + cot²(θ/2))
    slope = (-0.5 * cot + 0.5 * half * (1.0 + cot * cot)) / theta**2 - 2.0 * c / theta
    return float(c), float(slope / theta)


def rotation_vector_rate(w: Array, omega: Array) -> tuple[Array, Array]:
    """L_θu and L̇_θu: how a rotation vector w = θu of R moves when Ṙ = R [ω]×.

    ẇ = L_θu ω with L_θu = I + ½ [w]× + c(θ) [w]×², c(θ) = (1 − sinc θ / sinc²(θ/2)) / θ² (eq. 44 and its reference);
    the sign of the middle term is that of ω expressed in the current, rotating frame.

    Returns
    -------
    tuple
        L (3, 3) and its time derivative (3, 3) along ω [rad/s].
    """
    theta = float(np.sqrt(w @ w))
    c, c_slope = _cotangent_coefficient(theta)
    W = skew(w)
    L = np.eye(3) + 0.5 * W + c * (W @ W)
    w_dot = L @ omega
    W_dot = skew(w_dot)
    WW_dot = W_dot @ W
    L_dot = 0.5 * W_dot + c_slope * float(w @ w_dot) * (W @ W) + c * (WW_dot + WW_dot.T)
    return L, L_dot
