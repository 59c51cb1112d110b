"""Poses and rotations: formulas that kinematics, cameras and features share.

``aMb`` maps coordinates in frame b to coordinates in frame a: p_a = R p_b + t. Twists are (v, ω),
linear first.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated

import msgspec
import numpy as np
import pinocchio as pin

from ..errors import InvalidInput, format_value
from ..formulas.motion import angle
from ..qp.decomposition import svd
from ..rows import Array
from ..rows.readable import amounts, in_one_line

#: Any number of numbers, two, and three, as arguments that files may give, too.
Numbers = Sequence[float] | Array
Vector2 = Annotated[Sequence[float], msgspec.Meta(min_length=2, max_length=2)]
Vector3 = Annotated[Sequence[float], msgspec.Meta(min_length=3, max_length=3)]
TYPED = 1e-3  #: Largest error of an entry of a rotation that was typed or rounded.


def vector(value: object, length: int, what: str) -> Array:
    """Return ``value`` as a finite float array of shape (length,).

    Raises InvalidInput, which names ``what``, if this is not possible.
    """
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInput(f"{what} must be {length} numbers, not {format_value(value)}") from error
    if array.shape != (length,):
        raise InvalidInput(f"{what} must be {length} numbers; it has the shape {array.shape}")
    if not np.isfinite(array).all():
        raise InvalidInput(f"{what} must be finite, not {array}")
    return array


def require_sign(
    of: object, what: str, *, positive: Iterable[str] = (), zero_or_more: Iterable[str] = ()
) -> None:
    """Raise InvalidInput unless fields hold finite numbers of the required sign.

    Each field is one number, several, or None. The error names the field.
    """
    for name in positive:
        value = getattr(of, name)
        if value is not None and not (_finite_numbers(value) > 0.0).all():
            raise InvalidInput(f"{what}{name} must be positive, not {format_value(value)}")
    for name in zero_or_more:
        value = getattr(of, name)
        if value is not None and not (_finite_numbers(value) >= 0.0).all():
            raise InvalidInput(f"{what}{name} must be zero or more, not {format_value(value)}")


def _finite_numbers(value: object) -> Array:
    """Return one or several finite numbers as an array (k,), and (NaN,) for anything else."""
    try:
        numbers = np.atleast_1d(np.array(value, dtype=np.float64))
    except (TypeError, ValueError):
        return np.array([np.nan])
    if numbers.ndim != 1 or len(numbers) == 0 or not np.isfinite(numbers).all():
        return np.array([np.nan])
    return numbers


@dataclass(frozen=True, slots=True)
class Pose:
    """A rigid transformation aMb: R (3, 3) a rotation matrix, t (3,) in metres."""

    R: Array
    t: Array

    @in_one_line
    def __repr__(self) -> str:
        turned = np.asarray(pin.log3(np.ascontiguousarray(self.R)))
        return f"<Pose {amounts(self.t, 'm')}, turned by {amounts(turned, 'rad')}>"

    @classmethod
    def identity(cls) -> Pose:
        """Return the identity transformation."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def of(cls, placement: pin.SE3) -> Pose:
        """Return a copy of Pinocchio's placement."""
        return cls(np.array(placement.rotation), np.array(placement.translation))

    @classmethod
    def from_xyz_rpy(cls, xyz: Vector3, rpy: Vector3) -> Pose:
        """Build a pose from a translation [m] and roll, pitch, yaw [rad].

        R = Rz(yaw) Ry(pitch) Rx(roll), as in URDF.
        """
        roll, pitch, yaw = vector(rpy, 3, "rpy")
        return cls(np.asarray(pin.rpy.rpyToMatrix(roll, pitch, yaw)), vector(xyz, 3, "xyz"))

    @classmethod
    def from_matrix(cls, matrix: Array | Sequence[Sequence[float]]) -> Pose:
        """Build a pose from a homogeneous matrix (4, 4) or (3, 4), its translation in metres.

        A rotation rounded to about three digits is replaced by the nearest exact one. Raises
        InvalidInput, which states the distance, if it is farther from a rotation.
        """
        try:
            M = np.array(matrix, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InvalidInput(
                f"a pose's matrix must be 4 × 4 numbers, not {format_value(matrix)}"
            ) from error
        if M.shape not in ((4, 4), (3, 4)) or not np.isfinite(M).all():
            raise InvalidInput(
                f"a pose's matrix must be 4 × 4 finite numbers; it has the shape {M.shape}"
            )
        last_row = (0.0, 0.0, 0.0, 1.0)
        if M.shape == (4, 4) and (np.abs(M[3] - last_row) > 1e-9).any():
            is_transposed = np.array_equal(M[:, 3], last_row)
            hint = "; is it transposed?" if is_transposed else ""
            raise InvalidInput(
                f"the last row of a pose's matrix must be 0 0 0 1, not "
                f"{format_value(M[3].tolist())}{hint}"
            )
        return cls(require_rotation(M[:3, :3]), M[:3, 3].copy())

    @classmethod
    def from_quaternion(
        cls,
        xyz: Vector3,
        *,
        wxyz: Sequence[float] | None = None,
        xyzw: Sequence[float] | None = None,
    ) -> Pose:
        """Build a pose from a translation [m] and a unit quaternion in one of two orders.

        Raises InvalidInput if both or none are given, or if the norm is not 1 up to rounding.
        """
        if (wxyz is None) == (xyzw is None):
            raise InvalidInput("a quaternion is given as wxyz or as xyzw, in one of the two orders")
        order = "wxyz" if xyzw is None else "xyzw"
        value = vector(wxyz if xyzw is None else xyzw, 4, f"quaternion {order}")
        norm = float(np.linalg.norm(value))
        if abs(norm - 1.0) > TYPED:
            nearest = ""
            if norm > 0.0:
                unit = np.round(value / norm, 6).tolist()
                nearest = f": {format_value(unit)} has length 1"
            raise InvalidInput(
                f"a quaternion that is a rotation has length 1, not {norm:.6g}, as {order} "
                f"has{nearest}"
            )
        if order == "xyzw":
            value = np.roll(value, 1)
        w, x, y, z = value / norm
        return cls(pin.Quaternion(w, x, y, z).matrix(), vector(xyz, 3, "xyz"))

    @classmethod
    def from_rotation_vector(cls, xyz: Vector3, rotation_vector: Vector3) -> Pose:
        """Build a pose from a translation [m] and a rotation vector θu [rad].

        OpenCV calls it rvec; ViSP and axis–angle tools use the same vector.
        """
        turn = vector(rotation_vector, 3, "rotation_vector")
        if np.linalg.norm(turn) > 2.0 * np.pi + TYPED:
            raise InvalidInput(
                f"rotation_vector is in radians and no longer than a turn (6.283), not "
                f"{format_value(turn.tolist())}: are these degrees?"
            )
        return cls(np.asarray(pin.exp3(turn)), vector(xyz, 3, "xyz"))

    @property
    def inverse(self) -> Pose:
        """Inverse transformation bMa."""
        return Pose(self.R.T, -self.R.T @ self.t)

    def __matmul__(self, other: Pose) -> Pose:
        return Pose(self.R @ other.R, self.R @ other.t + self.t)

    def act(self, points: Array) -> Array:
        """Return coordinates (..., 3) in frame a of points given in frame b."""
        return points @ self.R.T + self.t

    @property
    def twist_matrix(self) -> Array:
        """Matrix aVb (6, 6) that maps twists (v, ω) from frame b to frame a.

        It maps the twist at b's origin in b's axes to the one at a's origin in a's axes.
        """
        V = np.zeros((6, 6))
        V[:3, :3] = V[3:, 3:] = self.R
        V[:3, 3:] = skew(self.t) @ self.R
        return V


def require_rotation(R: Array) -> Array:
    """Return the rotation nearest to R (3, 3).

    Raises InvalidInput, which states the distance, if an entry is farther than :data:`TYPED` from
    it.
    """
    if np.abs(R.T @ R - np.eye(3)).max() < 1e-12 and np.linalg.det(R) > 0.0:
        return R.copy()
    U, s, Vt = svd(R)
    proper = np.diag((1.0, 1.0, np.sign(np.linalg.det(U @ Vt))))
    nearest: Array = U @ proper @ Vt
    if proper[2, 2] < 0.0 and (np.abs(s - 1.0) <= TYPED).all():
        raise InvalidInput(
            "a matrix with determinant -1 is a mirror, and no rotation: an axis points the wrong "
            "way"
        )
    off = float(np.abs(R - nearest).max())
    if off > TYPED:
        lengths = ", ".join(f"{length:.4g}" for length in np.linalg.norm(R, axis=0))
        rounded = np.round(nearest, 6).tolist()
        raise InvalidInput(
            f"not a rotation: an entry is {off:.3g} away from the nearest one (columns of length "
            f"{lengths}), which is {format_value(rounded)}"
        )
    return nearest


def distance(a: Pose, b: Pose) -> tuple[float, float]:
    """Return translation [m] and angle [rad] between two poses."""
    d = a.t - b.t
    translation = float(np.sqrt(d @ d))
    # accurate near zero, too, unlike the arc cosine of the trace
    sine_of_half = np.linalg.norm(a.R - b.R) / np.sqrt(8.0)
    turn = 2.0 * float(np.arcsin(min(1.0, sine_of_half)))
    return translation, turn


def distances(R: Array, t: Array, pose: Pose) -> Array:
    """Return :func:`distance` (N, 2) between poses, R (N, 3, 3) and t (N, 3), and another pose."""
    squared_distance = ((t - pose.t) ** 2).sum(axis=1)
    squared_difference = ((R - pose.R) ** 2).sum(axis=(1, 2))
    translation = np.sqrt(squared_distance)
    turn = angle(squared_difference)
    return np.stack((translation, turn), axis=1)


def skew(w: Array) -> Array:
    """Return matrices [w]× (..., 3, 3) with [w]× a = w × a, for vectors w (..., 3)."""
    W = np.zeros((*w.shape, 3))
    x = w[..., 0]
    y = w[..., 1]
    z = w[..., 2]
    W[..., 0, 1] = -z
    W[..., 0, 2] = y
    W[..., 1, 2] = -x
    W[..., 1, 0] = z
    W[..., 2, 0] = -y
    W[..., 2, 1] = x
    return W
