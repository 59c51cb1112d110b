"""A loop on an arm to which something happens that no exception tells of: ``arm_victim.py WHERE
WHAT PORT``.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from typing import Any

import numpy as np

from socket_arm import SocketArm
from test_arm_faults import SETUP, Fault, Law
from vsconstraints.arms import Address, Job, Supervision, run_on_arm
from vsconstraints.vision.measurement import Measurement

where, what, port = sys.argv[1:]
HOUR = 3_600_000_000


def hold() -> None:
    """In C, without letting go of the interpreter."""
    ctypes.PyDLL(None).usleep(ctypes.c_uint(HOUR))


def happens(value: Any) -> Any:
    if what == "exit":
        os._exit(0)
    if what == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if what == "crash":
        ctypes.string_at(0)
    if what == "suspended":
        os.kill(os.getpid(), signal.SIGSTOP)
    if what == "held":
        hold()
    raise KeyboardInterrupt if what == "interrupted" else SystemExit


fault = Fault(where, happens, np.inf)
driver = SocketArm(Address.parse(f"socket://127.0.0.1:{port}?patience=20"), SETUP)
read = driver.read
send = driver.send
driver.read = lambda: fault("read", read())  # type: ignore[method-assign]
driver.send = lambda q, qd: (fault("send"), send(q, qd))[1]  # type: ignore[method-assign]
if what in ("held in the end", "interrupted"):
    # where it could still be told to stop, nothing does
    driver.halt = lambda deceleration: hold() if what.startswith("held") else happens(None)  # type: ignore[method-assign]


def eye(t: float, q: Any) -> Measurement:
    return Measurement(fault("camera", SETUP.scene.glance(q)[0]), None, t)


class Slow(Law):
    """Commands that the arm takes however late they come."""

    def solve(self, rows: Any, task: Any) -> Any:
        command = super().solve(rows, task)
        command.qdd = np.clip(command.qdd, -2.0, 2.0)
        return command


law = Slow(fault)
patient = Supervision(late_s=10.0, hang_s=0.15, following_rad=10.0)
run_on_arm(Job(SETUP, law, driver, eye, supervision=patient))
