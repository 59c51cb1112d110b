"""What a period of a stack costs beside the stack itself, in this process and in another one.

``python -m benchmarks.stacks`` prints the table.
"""

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

from .part import FULL, Effort, Part, Table, microseconds

TEXT = """
A period of a stack that does nothing, on the UR5, back to back: measurements become messages, and \
an answer is checked. A stack in another process is one in Python that reads and writes JSON by \
the standard library, or by msgspec where that is said; the time that it reports to have computed \
is subtracted. All get coordinates and speeds of the joints, and those of an image its pixels. The \
pose is estimated from noisy pixels. Each time is the least of the medians of 20 successive \
periods, since other programs only add to it.
"""

JOINTS = ("q", "qd")
#: What stacks declare as used.
DECLARED = {
    "joints": JOINTS,
    "image": (*JOINTS, "pixels"),
    "image, Jacobian": (*JOINTS, "pixels", "jacobian"),
    "image, Jacobian, pose": (*JOINTS, "pixels", "jacobian", "pose"),
}
#: Most that a period may cost [µs].
BUDGETS = {
    "in this process": 50.0,
    "in another process": 100.0,
    "in another process with msgspec": 100.0,
}
WARM = 20  #: Number of first periods that are left out.
BLOCK = 20  #: Number of successive periods of a median.

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
#: Hides msgspec from a stack, which then reads and writes JSON by the standard library.
STANDARD_LIBRARY = 'import sys\nsys.modules["msgspec"] = None\n'


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


def external(program: str) -> ExternalStack:
    """Return a stack in another process of this interpreter."""
    return ExternalStack([sys.executable, "-c", program])


def overhead(stack: MeasuredProgram, setup: Setup, turns: int) -> float:
    """Return the least of several median times of a period [s], without the time of the stack."""
    state = setup.scene.evaluate(0.0, setup.q0, setup.qd0)
    pixels = setup.scene.camera.distort(state.pixels.position)
    exact = not setup.sensor().estimates
    times = []
    stack.begin(setup)
    try:
        for k in range(WARM + turns):
            t = k * setup.Ts
            now = Observation(t, 0, setup.q0, setup.qd0, pixels, t, state.camera, exact)
            begun = perf_counter()
            answer = stack.respond(now)
            times.append(perf_counter() - begun - answer.compute_time)
    finally:
        stack.end()
    blocks = np.array_split(times[WARM:], max(turns // BLOCK, 1))
    return min(float(np.median(block)) for block in blocks)


def measure(effort: Effort) -> Part:
    """Measure the overhead of stacks."""
    setup = Scenario.load("ur5-fov").with_override("disturbances.pixel_noise", 0.1).setup()
    part = Part("Stacks", TEXT)
    table = Table(["measurements", "stack", "a period [µs]", "at most [µs]"], [], 2)
    part.tables.append(table)
    for name, uses in DECLARED.items():
        program = STILL % (uses,)
        subjects = {
            "in this process": Still(uses),
            "in another process": external(STANDARD_LIBRARY + program),
            "in another process with msgspec": external(program),
        }
        for place, stack in subjects.items():
            seconds = overhead(stack, setup, effort.turns)
            table.lines.append([name, place, microseconds(seconds), f"{BUDGETS[place]:g}"])
            part.numbers[f"{name}, {place}: µs"] = 1e6 * seconds
    return part


if __name__ == "__main__":
    for measured in measure(FULL).tables:
        print("\n".join(" | ".join(line) for line in (measured.header, *measured.lines)))
