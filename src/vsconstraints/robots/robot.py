"""Serial arms on Pinocchio: from a DH table or a URDF file, any number of joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from ..errors import ConfigurationError, InvalidInput, format_value, unknown_name
from ..formulas.rotation import whole_turns
from ..rows import Array, BoolArray
from ..rows.readable import amount, counted, in_one_line, span
from .geometry import Numbers, Pose, skew, vector
from .kinematics import Kinematics, KinematicsEvaluator, RobotPoint, as_matrix
from .limits import NO_LIMITS, ActuatorLimits
from .urdf import UrdfSource, link_geometry, read_urdf

#: θ offset [rad], d [m], a [m], α [rad] of a link.
DhRow = Annotated[Sequence[float], msgspec.Meta(min_length=4, max_length=4)]
#: Tolerance of joint ranges for rounding, relative to half the range: ranges are written with about
#: six digits, and scores count a row as violated from ten times this tolerance.
ROUNDED = 1e-5


class Robot:
    """A serial arm with n joints, each revolute or prismatic.

    Build one with :meth:`from_dh` or :meth:`from_urdf`, or take one from
    :mod:`vsconstraints.robots.catalogue`. Ranges ``q_min`` and ``q_max`` (n,) [rad or m] and speeds
    ``qd_min`` and ``qd_max`` (n,) are infinite where there is no limit.
    """

    def __init__(
        self,
        model: pin.Model,
        tip_frame: int,
        name: str,
        q_min: Array,
        q_max: Array,
        qd_max: Array,
        source: UrdfSource | None = None,
        limits: ActuatorLimits = NO_LIMITS,
    ) -> None:
        wrong = []
        for joint, low, high, speed in zip(model.names[1:], q_min, q_max, qd_max, strict=True):
            if low > high or speed <= 0.0:
                wrong.append(f"{joint} [{low:g}, {high:g}], speed {speed:g}")
        if wrong:
            raise ConfigurationError(
                f"limits of {name} must be lower ≤ upper and a positive speed: {'; '.join(wrong)}"
            )
        self.model = model
        self.name = name
        self._tip_frame = tip_frame
        self.source = source  #: The URDF file of the robot; None for other robots.
        self.joint_names: tuple[str, ...] = tuple(model.names[1:])  #: Names from base to tip.
        self.q_min = q_min
        self.q_max = q_max
        self.qd_min = -qd_max
        self.qd_max = qd_max
        for limit in ("acceleration", "jerk", "effort"):
            limits.of_joint(limit, self.n)
        #: Known limits of the actuators; they are applied only if a control step or a scenario uses
        #: them.
        self.limits = limits
        # scratch memory of the model's algorithms; every result is copied out of it
        self._data = model.createData()

    @in_one_line
    def __repr__(self) -> str:
        slides = np.array(self.prismatic, dtype=np.bool_)
        kinds = []
        if not slides.all():
            kinds.append(self._describe("revolute", ~slides, "rad"))
        if slides.any():
            kinds.append(self._describe("prismatic", slides, "m"))
        return f"<Robot {self.name}: {', '.join(kinds)}>"

    def _describe(self, kind: str, chosen: BoolArray, unit: str) -> str:
        """Describe number, ranges and speeds of the chosen joints, all of one kind."""
        joints = counted(int(chosen.sum()), f"{kind} joint")
        ranges = span(self.q_min[chosen], self.q_max[chosen], unit)
        speed = self.qd_max[chosen].max()
        if np.isfinite(speed):
            return f"{joints} ({ranges}, up to {amount(speed)} {unit}/s)"
        return f"{joints} ({ranges})"

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.model.nv)

    @property
    def ranges(self) -> tuple[Array, Array, Array]:
        """Copies of q_min, q_max and qd_max, (n,) each."""
        return self.q_min.copy(), self.q_max.copy(), self.qd_max.copy()

    @cached_property
    def prismatic(self) -> tuple[bool, ...]:
        """True for each of the n joints that is prismatic."""
        return tuple("JointModelP" in joint.shortname() for joint in self.model.joints[1:])

    @cached_property
    def continuous(self) -> BoolArray:
        """True (n,) for continuous joints: revolute joints without a range.

        Their angles count modulo 2π.
        """
        unbounded = np.isinf(self.q_min) & np.isinf(self.q_max)
        return unbounded & ~np.array(self.prismatic, dtype=np.bool_)

    def difference(self, a: Array, b: Array) -> Array:
        """Return a − b (..., n) [rad or m].

        For continuous joints, it is the difference on the circle, in [−π, π].
        """
        return self.nearest_turn(a, b) - b

    def nearest_turn(self, q: Array, near: Array) -> Array:
        """Return ``q`` (..., n) with continuous joints in the turn nearest to ``near`` (..., n)."""
        away = q - near
        # numbers that are not finite stay as they are
        counted_by_turns = self.continuous & np.isfinite(away)
        nearest: Array = q - whole_turns(np.where(counted_by_turns, away, 0.0))
        return nearest

    @cached_property
    def axes(self) -> Array:
        """Unit axes (n, 3) of the joints, each in its own frame.

        Raises ConfigurationError if the joints are not a chain of revolute and prismatic ones.
        """
        model = self.model
        axes = np.empty((self.n, 3))
        for i, joint in enumerate(model.joints[1:]):
            if model.parents[i + 1] != i or joint.nq != 1 or joint.nv != 1:
                name = model.names[i + 1]
                raise ConfigurationError(
                    f"only serial chains are supported, not {name} ({joint.shortname()})"
                )
            data = joint.createData()
            joint.calc(data, np.zeros(model.nq), np.zeros(model.nv))
            linear, angular = np.asarray(data.S).reshape(2, 3)
            axes[i] = linear if self.prismatic[i] else angular
        return axes

    @property
    def links(self) -> tuple[str, ...]:
        """Names of the frames to which points can be fixed."""
        names = [frame.name for frame in self.model.frames]
        others = [name for name in names if name not in ("tip", "universe")]
        return ("tip", *others)

    @classmethod
    def from_dh(
        cls,
        dh: Sequence[DhRow],
        *,
        prismatic: Sequence[int] = (),
        q_min: Numbers | None = None,
        q_max: Numbers | None = None,
        qd_max: Numbers | None = None,
        name: str = "robot",
        limits: ActuatorLimits = NO_LIMITS,
    ) -> Robot:
        """Build a robot from standard Denavit–Hartenberg parameters (n, 4).

        Rows are θ offset [rad], d [m], a [m], α [rad]. Link i is placed by Rz(θ) Tz(d) Tx(a) Rx(α),
        with θ = q_i + the table's θ offset; for a joint whose number, from 1, is in ``prismatic``,
        d = q_i + the table's d. The link frames are called ``link 1`` … ``link n``; the last is the
        tip. Ranges and speeds (n,) are infinite if not given. Raises InvalidInput if the table or a
        limit has a wrong shape or is not a number.
        """
        model, frame = _read_dh(dh, prismatic, name)
        n = model.nv
        low = _joint_limits(q_min, -np.inf, n, "q_min")
        high = _joint_limits(q_max, np.inf, n, "q_max")
        speed = _joint_limits(qd_max, np.inf, n, "qd_max")
        return cls(model, frame, name, low, high, speed, limits=limits)

    @classmethod
    def from_urdf(
        cls,
        urdf: str | Path,
        tip: str | None = None,
        *,
        locked: Mapping[str, float] | None = None,
        name: str | None = None,
        package_dirs: Sequence[str | Path] | None = None,
        limits: ActuatorLimits = NO_LIMITS,
    ) -> Robot:
        """Build a robot from a URDF file.

        Joint ranges, speeds and efforts are those of the file; ``limits`` adds others. Raises
        ConfigurationError if the file is missing or not a URDF, if several links may be the tip and
        none is named, or if a link or a joint is unknown or of a kind that an arm does not have.

        Parameters
        ----------
        urdf
            The URDF file. Its meshes are read by :meth:`collision_geometry` only.
        tip
            Name of the link at the tip; optional if there is only one last link. Joints that do not
            move it (a gripper's fingers) are locked at their neutral position, or at the position
            given by the joint that they mimic.
        locked
            Joints to lock, with their coordinate [rad or m].
        name
            Name for reports; by default the robot's name in the file.
        package_dirs
            Folders that ``package://`` paths of meshes start from; by default all folders above the
            file. Those in ``AMENT_PREFIX_PATH`` and ``ROS_PACKAGE_PATH`` are searched after them.
        """
        arm = read_urdf(urdf, tip, locked or {}, package_dirs)
        if limits.effort is None and np.isfinite(arm.effort).any():
            limits = replace(limits, effort=arm.effort.tolist())
        return cls(
            arm.model,
            arm.tip_frame,
            name or arm.model.name,
            arm.q_min,
            arm.q_max,
            arm.qd_max,
            arm.source,
            limits,
        )

    def collision_geometry(self) -> pin.GeometryModel:
        """Read the collision geometry of the URDF's links, in this robot's model.

        Every call reads the files again. Raises ConfigurationError if the robot is not from a URDF
        file, or if a mesh, which it names, cannot be read.
        """
        if self.source is None:
            raise ConfigurationError(
                f"{self.name} is not from a URDF file, so its links have no collision geometry; "
                "give link_radius, the links' radius around the lines between the joints"
            )
        return link_geometry(self.source)

    def frame_id(self, link: str) -> int:
        """Return the index of a link's frame in the model.

        Raises ConfigurationError, which names the known links, if the link is unknown.
        """
        if link == "tip":
            return self._tip_frame
        if not self.model.existFrame(link):
            raise unknown_name(f"link of {self.name}", link, self.links)
        return int(self.model.getFrameId(link))

    def configuration(self, q: object, what: str = "q") -> Array:
        """Return ``q`` as a finite (n,) array; raises InvalidInput that names ``what``."""
        return vector(q, self.n, f"{what} of {self.name}")

    def outside_ranges(self, q: Array) -> list[str]:
        """Return a sentence for each joint of ``q`` outside its range.

        Numbers in files are rounded: a joint may exceed its range by :data:`ROUNDED` of half the
        range.
        """
        half = 0.5 * (self.q_max - self.q_min)
        tolerated = ROUNDED * np.where(np.isfinite(half), half, 1.0)
        beyond = np.maximum(self.q_min - q, q - self.q_max)
        units = ["m" if slides else "rad" for slides in self.prismatic]
        return [
            f"joint {i + 1} ({self.joint_names[i]}) is at {q[i]:.7g}, {beyond[i]:.3g} {units[i]} "
            f"outside [{self.q_min[i]:.7g}, {self.q_max[i]:.7g}]"
            for i in np.flatnonzero(beyond > tolerated)
        ]

    def pose(self, q: ArrayLike, link: str = "tip") -> Pose:
        """Return the pose of a link in the base frame at ``q`` (n,)."""
        pin.forwardKinematics(self.model, self._data, self.configuration(q))
        placement = pin.updateFramePlacement(self.model, self._data, self.frame_id(link))
        return Pose.of(placement)

    def jacobian(
        self,
        q: ArrayLike,
        link: str = "tip",
        offset: Sequence[float] = (0.0, 0.0, 0.0),
        axes: str = "base",
    ) -> Array:
        """Return the Jacobian (6, n) at ``q`` (n,) of the twist (v, ω) of a point fixed to a link.

        ``offset`` (3,) is the point in the link's frame [m], and v and ω are in ``"base"`` or
        ``"tip"`` axes. Raises ConfigurationError or InvalidInput if the link or the axes are
        unknown, or a shape is wrong.
        """
        return self._twist(q, np.zeros(self.n), link, offset, axes)[0]

    def drift(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        link: str = "tip",
        offset: Sequence[float] = (0.0, 0.0, 0.0),
        axes: str = "base",
    ) -> Array:
        """Return the exact J̇ q̇ (6,) of :meth:`jacobian` at ``q`` and ``qd`` (n,).

        It is the derivative of that twist when q̈ = 0.
        """
        return self._twist(q, qd, link, offset, axes)[1]

    def _twist(
        self, q: ArrayLike, qd: ArrayLike, link: str, offset: Sequence[float], axes: str
    ) -> tuple[Array, Array]:
        """Return the Jacobian (6, n) and J̇ q̇ (6,) of a point's twist.

        Used by :meth:`jacobian` and :meth:`drift`.
        """
        if axes not in ("base", "tip"):
            raise unknown_name("axes", axes, ("base", "tip"))
        q = self.configuration(q)
        qd = self.configuration(qd, "qd")
        x, y, z = vector(offset, 3, "offset")
        motion = self.kinematics(q, qd, [RobotPoint(link, (x, y, z))])
        model = self.model
        data = self._data
        frame = self.frame_id(link)
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        frame_J = as_matrix(pin.getFrameJacobian(model, data, frame, world))
        frame_drift = pin.getFrameAcceleration(model, data, frame, world)
        linear_J = motion.point_J[0]
        angular_J = frame_J[3:]
        J = np.concatenate((linear_J, angular_J))
        drift = np.concatenate((motion.point_drift[0], frame_drift.angular))
        if axes == "base":
            return J, drift
        # the tip's axes turn with it: d/dt (Rᵀ a) = Rᵀ (ȧ − ω × a)
        R = motion.tip.R
        tip_omega = R @ (motion.J[3:] @ qd)
        omega_cross = skew(tip_omega)
        v = linear_J @ qd
        omega = angular_J @ qd
        turning = np.concatenate((omega_cross @ v, omega_cross @ omega))
        to_tip = np.kron(np.eye(2), R.T)
        return to_tip @ J, to_tip @ (drift - turning)

    def kinematics(self, q: Array, qd: Array, points: Sequence[RobotPoint] = ()) -> Kinematics:
        """Return pose, Jacobian and exact J̇ q̇ of the tip and points at ``q`` and ``qd`` (n,)."""
        return self.evaluator(points)(q, qd)

    def evaluator(self, points: Sequence[RobotPoint] = ()) -> KinematicsEvaluator:
        """Return :meth:`kinematics` for a fixed set of points, with their frames looked up once."""
        frames = [self.frame_id(point.link) for point in points]
        return KinematicsEvaluator(self.model, self._data, self.frame_id("tip"), points, frames)


def _read_dh(dh: Sequence[DhRow], prismatic: Sequence[int], name: str) -> tuple[pin.Model, int]:
    """Return a table's model and the index of its tip's frame; raises as :meth:`Robot.from_dh`."""
    try:
        rows = np.array(dh, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInput(
            f"the DH table must be rows of four numbers (θ offset, d, a, α): {error}"
        ) from error
    is_table = rows.ndim == 2 and rows.shape[1] == 4
    if not is_table or len(rows) == 0:
        raise InvalidInput(
            f"the DH table must be (n, 4): θ offset, d, a, α; it has the shape {rows.shape}"
        )
    if not np.isfinite(rows).all():
        raise InvalidInput("the DH table must be finite")
    numbers = list(prismatic) if isinstance(prismatic, Sequence) else [prismatic]
    unknown = [number for number in numbers if number not in range(1, len(rows) + 1)]
    if unknown:
        raise InvalidInput(f"prismatic joints are numbers from 1 to {len(rows)}, not {unknown}")
    model = pin.Model()
    model.name = name
    last_link = pin.SE3.Identity()
    for i, (theta, d, a, alpha) in enumerate(rows, start=1):
        about_z = np.asarray(pin.rpy.rpyToMatrix(0.0, 0.0, theta))
        about_x = np.asarray(pin.rpy.rpyToMatrix(alpha, 0.0, 0.0))
        placement = last_link * pin.SE3(about_z, np.zeros(3))
        joint = pin.JointModelPZ() if i in prismatic else pin.JointModelRZ()
        joint_id = model.addJoint(i - 1, joint, placement, f"joint {i}")
        last_link = pin.SE3(about_x, np.array([a, 0.0, d]))
        frame = pin.Frame(f"link {i}", joint_id, last_link, pin.FrameType.BODY)
        frame_id = model.addFrame(frame)
    return model, int(frame_id)


def _joint_limits(value: ArrayLike | None, unlimited: float, n: int, what: str) -> Array:
    """Return joint limits (n,), which may be infinite; None stands for ``unlimited`` joints.

    Raises InvalidInput, which names ``what``, if the shape is wrong or a limit is not a number.
    """
    if value is None:
        return np.full(n, unlimited)
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (n,) or np.isnan(array).any():
        raise InvalidInput(
            f"{what} must be {n} numbers (infinite where there is no limit), not "
            f"{format_value(value)}"
        )
    return array
