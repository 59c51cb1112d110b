"""Punctuality of a 1 kHz loop on this machine: ``python -m checks.realtime [SECONDS]``.

The compiled step and a law run in the supervised loop, against a driver that answers at once,
without and with SCHED_FIFO, and against the fake arm ``loopback://``. Nothing is asserted, because
the result depends on the machine and its load.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from vsconstraints.arms import (
    ArmError,
    Driver,
    Job,
    Joints,
    Punctuality,
    Supervision,
    driver_for,
    real_time,
    run_on_arm,
)
from vsconstraints.arms.driver import Address
from vsconstraints.arms.record import LATENESS, punctuality
from vsconstraints.controllers import HierarchicalQP
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup

SCENE = "ur5-fov"
PATIENT = Supervision(late_s=10.0, hang_s=10.0, following_rad=10.0)
"""Delays are measured here, and do not end the run."""


class Immediate(Driver):
    """Arm that reaches each setpoint at once."""

    real = False

    def connect(self) -> None:
        """Do nothing: the arm stands at the start."""

    def __init__(self, address: Address, setup: Setup) -> None:
        super().__init__(address, setup)
        self._state = Joints(0.0, setup.q0.copy(), np.zeros_like(setup.q0))

    def read(self) -> Joints:
        """Return the last setpoint."""
        return self._state

    def send(self, q: Array, qd: Array) -> None:
        """Take the setpoint."""
        self._state = Joints(self._state.t + self.period, q, qd)

    def halt(self, deceleration: float) -> None:
        """Do nothing: the arm stands already."""

    def close(self) -> None:
        """Do nothing."""


def measured(setup: Setup, address: str, fifo: bool) -> tuple[Punctuality, list[str]]:
    """Return the punctuality of a run, and the permissions of the system."""
    driver = driver_for(address, setup) if address else Immediate(Address("immediate"), setup)
    with real_time(fifo) as permitted:
        _, log = run_on_arm(Job(setup, HierarchicalQP(), driver, supervision=PATIENT))
    if log.ended != "done":
        raise ArmError(log.cause)
    return punctuality(log), permitted.sentences()


def main(arguments: Sequence[str]) -> int:
    """Print numbers; with a second argument, draw histograms to that file."""
    seconds = float(arguments[0]) if arguments else 10.0
    scenario = (
        Scenario.load(SCENE)
        .with_override("sampling_time", 0.001)
        .with_override("duration", seconds)
    )
    found = {}
    for name, address, fifo in (
        ("without real time", "", False),
        ("with real time", "", True),
        ("with real time, a fake arm", "loopback://", True),
    ):
        found[name], said = measured(replace(scenario.setup()), address, fifo)
        print(f"{name}: {'; '.join(said)}")
        for line in found[name].lines():
            print(f"  {line}", flush=True)
    if len(arguments) > 1:
        LATENESS.write(Path(arguments[1]), found)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
