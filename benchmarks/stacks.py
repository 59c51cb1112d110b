"""What a period of a stack costs beside the stack itself, in this process and in another one."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup
from vsconstraints.simulation.programs import Observation
from vsconstraints.stacks import ExternalStack, Stack
from vsconstraints.stacks.external import ADAPTERS
from vsconstraints.stacks.stack import MeasuredProgram

from .part import Effort, Part, Table, microseconds

TEXT = """
A period of a stack that does nothing, on the UR5, back to back: measurements become messages, and \
an answer is checked. A stack in another process is one in Python that reads and writes JSON by \
the standard library; the time that it reports to have computed is subtracted. *joints* gets \
coordinates and speeds, *image* also pixels, pose and Jacobian.
"""

DECLARED = {
    "joints": ("q", "qd"),
    "image": ("q", "qd", "pixels", "pose", "jacobian"),
}
WARM = 20  #: Number of first periods that are left out.

#: A stack that stands still, by the protocol of the adapters.
STILL = f"""
import sys
sys.path.insert(0, {str(ADAPTERS)!r})
from stack_io import serve
class Still:
    name = "still"
    output = "velocity"
    uses = %r
    def start(self, setup):
        self.answer = [0.0] * len(setup["joints"])
    def step(self, now):
        return self.answer
serve(Still())
"""


class Still(Stack):
    """Stack in this process that stands still."""

    name = "still"

    def __init__(self, uses: tuple[str, ...]) -> None:
        self.uses = uses

    def start(self, setup: Mapping[str, Any]) -> None:
        """Begin a run."""

    def step(self, now: Mapping[str, Any]) -> NDArray[np.float64]:
        """Return q̇ = 0."""
        return np.zeros(6)


def overhead(stack: MeasuredProgram, setup: Setup, turns: int) -> float:
    """Return the median time of a period [s], without the time that the stack has computed."""
    state = setup.scene.evaluate(0.0, setup.q0, setup.qd0)
    pixels = setup.scene.camera.distort(state.pixels.position)
    times = []
    stack.begin(setup)
    try:
        for k in range(WARM + turns):
            t = k * setup.Ts
            now = Observation(t, 0, setup.q0, setup.qd0, pixels, t, state.camera, True)
            begun = perf_counter()
            answer = stack.respond(now)
            times.append(perf_counter() - begun - answer.compute_time)
    finally:
        stack.end()
    return float(np.median(times[WARM:]))


def measure(effort: Effort) -> Part:
    """Measure the overhead of stacks."""
    setup = Scenario.load("ur5-fov").setup()
    part = Part("Stacks", TEXT)
    table = Table(["measurements", "stack", "a period [µs]"], [], 2)
    part.tables.append(table)
    for name, uses in DECLARED.items():
        command = [sys.executable, "-c", STILL % (uses,)]
        subjects = {"in this process": Still(uses), "in another process": ExternalStack(command)}
        for place, stack in subjects.items():
            seconds = overhead(stack, setup, effort.turns)
            table.lines.append([name, place, microseconds(seconds)])
            part.numbers[f"{name}, {place}: µs"] = 1e6 * seconds
    return part
