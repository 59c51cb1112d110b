"""Controllers that get measurements instead of rows and a task, as a robot program does."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar, Literal, NamedTuple, get_args

from ..errors import InvalidInput
from ..robots.geometry import Pose
from ..rows import Array, Command, Rows, Task
from .base import Controller

if TYPE_CHECKING:
    from ..simulation.setup import Setup

Output = Literal["velocity", "position", "acceleration"]
"""Quantity that a robot program commands in each period: q̇ or q at its end, or q̈ during it."""

OUTPUTS: tuple[Output, ...] = get_args(Output)
#: What a program with each output commands, for sentences.
COMMANDS: dict[str, str] = {
    "velocity": "velocities",
    "position": "positions",
    "acceleration": "accelerations",
}


class Observation(NamedTuple):
    """Measurements at the beginning of a period, for n joints and M markers."""

    t: float  #: Time [s].
    goal: int  #: Index of the goal that holds at this time.
    q: Array  #: (n,) joint coordinates [rad or m].
    qd: Array  #: (n,) joint speeds [rad/s or m/s].
    #: (M, 2) sensor pixels of the markers in the newest usable image, from the image centre [px].
    pixels: Array
    taken: float  #: Time of that image [s]; ``t`` if the controller does not know it.
    near: Pose  #: Pose of the camera in the target's frame where an estimation of it may begin.
    exact: bool  #: True if ``near`` is the pose in that image, so that nothing is to be estimated.


class Answer(NamedTuple):
    """Command of a robot program for one period."""

    #: (n,) joint velocities [rad/s or m/s], positions [rad or m] or accelerations [rad/s² or m/s²];
    #: None if the program has no answer for this period.
    command: Array | None
    compute_time: float  #: Time that the program has computed [s]; NaN if it does not say.
    reason: str = ""  #: Reason for having no answer.


class RobotProgram(Controller):
    """Controller that gets measurements, and commands velocities, positions or accelerations.

    A run calls :meth:`begin`, then :meth:`respond` once per period, then :meth:`end`. Exceptions
    end the run with the status ``failed``.
    """

    output: Output = "velocity"
    #: The rows' K and u⁺ are none of its business.
    ignores: ClassVar[tuple[str, ...]] = ("K", "switching_gain")

    @abstractmethod
    def begin(self, setup: Setup) -> None:
        """Begin a run."""

    @abstractmethod
    def respond(self, now: Observation) -> Answer:
        """Compute the command for a period."""

    def end(self) -> None:
        """End the run; called once after each :meth:`begin`, also if that has raised."""

    def run_remarks(self) -> list[str]:
        """Return remarks on the run for a reader of the results."""
        return []

    def solve(self, rows: Rows, task: Task) -> Command:
        """Raise InvalidInput: rows and a task are not what a robot program gets."""
        raise InvalidInput(
            f"{self.name} gets measurements, not rows and a task: run it in a scenario, "
            "for example by simulate(scenario.setup(), stack)"
        )
