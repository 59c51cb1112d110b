"""Ready-made robots: the paper's three, two of example-robot-data, and a free-flying camera."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import numpy as np

from ..errors import ConfigurationError, unknown_name
from .limits import ActuatorLimits
from .robot import Robot

PI = np.pi


def planar_3r() -> Robot:
    """Planar arm of the first example (Table 1), without joint limits."""
    table = [
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, -PI],
    ]
    return Robot.from_dh(table, name="planar 3R")


def viper_s650() -> Robot:
    """6R arm of the case study (Table 2) with the lengths of the Adept Viper s650.

    Ranges and speeds are those of that arm, converted to the table's angles: (q₁, q₂, q₃ − π, −q₄,
    q₅, ·).
    """
    table = [
        [0, 0.335, 0.075, -PI / 2],
        [0, 0, 0.27, 0],
        [0, 0, 0.09, PI / 2],
        [0, -0.295, 0, -PI / 2],
        [0, 0, 0, PI / 2],
        [-PI / 2, -0.08, 0, PI],
    ]
    low = [-170, -190, -209, -190, -120, -360]
    high = [170, 45, 76, 190, 120, 360]
    speed = [328, 300, 375, 375, 375, 600]
    return _in_degrees(table, low, high, speed, "6R (Viper s650)")


def kuka_kr6() -> Robot:
    """Ceiling-mounted KUKA KR6 R900 sixx of the experiments (Table 3).

    Ranges and speeds are those of that arm, converted to the table's angles: (q₁, q₂ + π, q₃ − π/2,
    q₄, q₅, ·).
    """
    table = [
        [0, -0.400, 0.025, PI / 2],
        [0, 0, -0.455, 0],
        [0, 0, -0.035, -PI / 2],
        [0, -0.420, 0, PI / 2],
        [0, 0, 0, -PI / 2],
        [0, -0.080, 0, PI],
    ]
    low = [-170, -10, -210, -185, -120, -350]
    high = [170, 225, 66, 185, 120, 350]
    speed = [360, 300, 360, 381, 388, 615]
    return _in_degrees(table, low, high, speed, "KUKA KR6 R900 sixx")


def ur5() -> Robot:
    """Universal Robots UR5 from its URDF; the tip is ``tool0``.

    The manufacturer limits torques and states no accelerations. The limit here, 40 rad/s², is the
    largest that ur_rtde accepts (``UR_JOINT_ACCELERATION_MAX``). The manufacturer's driver has
    MoveIt plan with 5 rad/s² (``ur_moveit_config/config/joint_limits.yaml``), and calls that
    conservative.
    """
    limits = ActuatorLimits(acceleration=40.0)
    urdf = _example_robot("ur_description/urdf/ur5_robot.urdf")
    return Robot.from_urdf(urdf, tip="tool0", name="UR5", limits=limits)


def panda() -> Robot:
    """Franka Emika Panda from its URDF: seven joints, fingers locked.

    The tip is ``panda_hand``. Beyond the limits of acceleration and jerk, the arm's interface stops
    it (libfranka, ``rate_limiting.h``, ``kMaxJointAcceleration`` and ``kMaxJointJerk``).
    """
    limits = ActuatorLimits(
        acceleration=(15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0),
        jerk=(7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0),
    )
    urdf = _example_robot("panda_description/urdf/panda.urdf")
    return Robot.from_urdf(urdf, tip="panda_hand", name="Panda", limits=limits)


def free_camera() -> Robot:
    """Free-flying camera: three prismatic joints and a wrist of three revolute ones.

    It has no limits. The axes of joints 1 to 3 are z, x and y of the base, so that the tip is at
    (q₂, q₃, q₁) [m]; it is rotated by Rx(q₄) Ry(q₅) Rz(q₆) [rad]. Joint 6 turns about the tip's z
    axis, the optical axis of a camera mounted without offset. The wrist is singular only if q₅, the
    tilt, is ±90°.
    """
    right = PI / 2
    table = [
        [right, 0, 0, right],
        [right, 0, 0, right],
        [0, 0, 0, -right],
        [0, 0, 0, right],
        [right, 0, 0, right],
        [0.0, 0.0, 0.0, 0.0],
    ]
    return Robot.from_dh(table, prismatic=[1, 2, 3], name="free camera")


READY_MADE: dict[str, Callable[[], Robot]] = {
    "planar-3r": planar_3r,
    "viper-s650": viper_s650,
    "kuka-kr6": kuka_kr6,
    "ur5": ur5,
    "panda": panda,
    "free-camera": free_camera,
}


def ready_made(name: str) -> Robot:
    """Return a ready-made robot; raises ConfigurationError that names the candidates."""
    if name not in READY_MADE:
        raise unknown_name("robot", name, READY_MADE)
    return READY_MADE[name]()


def _in_degrees(
    table: Sequence[Sequence[float]],
    low: Sequence[float],
    high: Sequence[float],
    speed: Sequence[float],
    name: str,
) -> Robot:
    """Return the arm of a DH table with ranges [°] and speeds [°/s]."""
    return Robot.from_dh(
        table,
        q_min=np.deg2rad(low),
        q_max=np.deg2rad(high),
        qd_max=np.deg2rad(speed),
        name=name,
    )


def _example_robot(path: str) -> Path:
    try:
        package = distribution("example-robot-data")
    except PackageNotFoundError as error:
        raise ConfigurationError(
            "this arm's URDF comes with the package example-robot-data: pip install "
            "example-robot-data"
        ) from error
    folder = package.locate_file("cmeel.prefix/share/example-robot-data/robots")
    return Path(str(folder)) / path
