"""Control of a real or simulated arm.

A law's accelerations are integrated and streamed to a robot. The run is supervised, and stopped if
anything is wrong. See :doc:`/on-an-arm`. A driver is one small file and a line in
:data:`vsconstraints.arms.drivers.DRIVERS`.
"""

from typing import TYPE_CHECKING

from ..plugins.lazy import exported

if TYPE_CHECKING:
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
__getattr__, __dir__ = exported(
    __name__,
    {
        "Address": "driver",
        "ArmError": "driver",
        "Driver": "driver",
        "Joints": "driver",
        "DRIVERS": "drivers",
        "driver_for": "drivers",
        "Envelope": "envelope",
        "Setpoint": "envelope",
        "ImageSource": "images",
        "SimulatedImages": "images",
        "image_source": "images",
        "Job": "loop",
        "run_on_arm": "loop",
        "real_time": "realtime",
        "ArmLog": "record",
        "Period": "record",
        "Punctuality": "record",
        "store": "record",
        "trajectory_of": "record",
        "Supervision": "supervision",
    },
)
