"""Control of a real or simulated arm.

A law's accelerations are integrated and streamed to a robot. The run is supervised, and stopped if
anything is wrong. See :doc:`/on-an-arm`. A driver is one small file and a line in
:data:`vsconstraints.arms.drivers.DRIVERS`.
"""

from .driver import Address, ArmError, Driver, Joints
from .drivers import DRIVERS, driver_for
from .envelope import Envelope, Setpoint
from .images import ImageSource, SimulatedImages, image_source
from .loop import Job, run_on_arm
from .realtime import real_time
from .record import ArmLog, Period, Punctuality, store, trajectory_of
from .supervision import Supervision

__all__ = [
    "DRIVERS",
    "Address",
    "ArmError",
    "ArmLog",
    "Driver",
    "Envelope",
    "ImageSource",
    "Job",
    "Joints",
    "Period",
    "Punctuality",
    "Setpoint",
    "SimulatedImages",
    "Supervision",
    "driver_for",
    "image_source",
    "real_time",
    "run_on_arm",
    "store",
    "trajectory_of",
]
