"""On an arm: a law's accelerations, integrated, streamed to a robot, supervised, stopped where anything is wrong.

See :doc:`/on-an-arm`. A driver is one small file and a line in :data:`vsconstraints.arms.drivers.DRIVERS`.
"""

from .driver import Address, ArmError, Driver, Joints
from .drivers import DRIVERS, driver_for
from .envelope import Envelope, Setpoint
from .images import Eye, SimulatedEye, eye_of
from .log import ArmLog, Period
from .loop import Job, run_on_arm
from .realtime import real_time
from .record import store, trajectory_of
from .supervision import Supervision
from .timing import Punctuality

__all__ = [
    "DRIVERS",
    "Address",
    "ArmError",
    "ArmLog",
    "Driver",
    "Envelope",
    "Eye",
    "Job",
    "Joints",
    "Period",
    "Punctuality",
    "Setpoint",
    "SimulatedEye",
    "Supervision",
    "driver_for",
    "eye_of",
    "real_time",
    "run_on_arm",
    "store",
    "trajectory_of",
]
