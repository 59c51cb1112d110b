"""Robot programs: controllers that get measurements instead of rows and a task."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from os.path import isfile  # unlike Path.is_file, it takes a text that is too long for a path
from pathlib import Path
from typing import Literal, NamedTuple, get_args

import numpy as np

from ..controllers import Controller
from ..errors import ConfigurationError, InvalidInput
from ..formulas.tracking import goal_at
from ..robots.geometry import Pose
from ..rows import Array, Command, Rows, Task
from .plant import Plant
from .sensing import Sensor
from .setup import Setup

Output = Literal["velocity", "position", "acceleration"]
"""Quantity that a robot program commands in each period: q̇ or q at its end, or q̈ during it."""

OUTPUTS: tuple[Output, ...] = get_args(Output)
#: What a program with each output commands, for sentences.
COMMANDS: dict[str, str] = {
    "velocity": "velocities",
    "position": "positions",
    "acceleration": "accelerations",
}


#: What :func:`declaration` writes after the name, up to the end of the remark. The name itself may
#: read like it: the last one in a reason counts.
DECLARED = re.compile(
    rf".* uses ([a-z]+(?:, [a-z]+)*) and commands (?:{'|'.join(COMMANDS.values())})(?:; |$)",
    re.DOTALL,
)
NO_DATA = "nothing"  #: What a :func:`declaration` says instead of data.


def declaration(name: str, uses: Sequence[str], output: Output) -> str:
    """Return what a program declared before a run, for a reader of the results."""
    return f"{name} uses {', '.join(uses) or NO_DATA} and commands {COMMANDS[output]}"


def declared_uses(reason: str) -> tuple[str, ...] | None:
    """Return the data of a :func:`declaration` in the reason of a run; None without one."""
    found = DECLARED.match(reason)
    if found is None:
        return None
    return () if found[1] == NO_DATA else tuple(found[1].split(", "))


def declared_in(reasons: Iterable[str]) -> tuple[str, ...] | None:
    """Return the data that any of these reasons of a stack's runs declares; None if none does."""
    declared = [uses for uses in map(declared_uses, reasons) if uses is not None]
    return tuple(dict.fromkeys(chain.from_iterable(declared))) if declared else None


def uses_by_controller(reasons: Mapping[str, Iterable[str]]) -> dict[str, tuple[str, ...]]:
    """Return the data that each stack declared, by controller, from the reasons of its runs."""
    by_controller = {}
    for name, own in reasons.items():
        uses = declared_in(own)
        if uses is not None:
            by_controller[name] = uses
    return by_controller


def program_name(command: Sequence[str]) -> str:
    """Return a short name of a command: that of its script, or of the program.

    The script is the first file among the arguments.
    """
    script = next(filter(isfile, command[1:]), command[0])
    return Path(script).stem


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
    #: It gets no rows, so that no factor on them affects it.
    ignores = ("K", "switching_gain")

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
        """Raise InvalidInput, because a robot program gets measurements, not rows and a task."""
        raise InvalidInput(
            f"{self.name} gets measurements, not rows and a task: run it in a scenario, "
            "for example by simulate(scenario.setup(), stack)"
        )


class ProgramLoop:
    """A robot program in one run, between :meth:`begin` and :meth:`end`.

    Commanded positions become the velocities between them, from q₀ on. In a period without an
    answer, the velocity zero is commanded, whatever the program commands otherwise.
    """

    def __init__(self, program: RobotProgram, setup: Setup, sensor: Sensor, plant: Plant) -> None:
        self.program = program
        self._setup = setup
        self._sensor = sensor
        self._plant = plant
        self._begun = False
        self._goal_times = [goal.from_time for goal in setup.task.goals]
        self._position = setup.q0  # last commanded position (n,)
        #: Time that the program has computed for its last answer, as it says [s].
        self.compute_time = np.nan

    def begin(self) -> None:
        """Begin the run; raises ConfigurationError if the arm cannot take its commands."""
        self._begun = True
        self.program.begin(self._setup)
        if self.program.output == "acceleration":
            return
        self._require_arm()
        self._plant.take_speeds()

    def _require_arm(self) -> None:
        if self._setup.arm.streams:
            return
        n = self._setup.scene.robot.n
        limited = np.isfinite(self._setup.limits.of_joint("acceleration", n)).all()
        if self.program.output == "velocity" and limited:
            return
        why = "" if limited else " without a limit, so that it would follow any step"
        raise ConfigurationError(
            f"{self.program.name} commands {COMMANDS[self.program.output]}, and the arm of this "
            f'scene takes accelerations{why}: give arm = {{ command = "velocity", lag = 0.02, '
            "acceleration = 8.0 } with the arm's own numbers"
        )

    def end(self) -> None:
        """End the run, if it has begun."""
        if self._begun:
            self._begun = False
            self.program.end()

    def command(self, k: int, pixels: Array, camera: Pose, labels: tuple[str, ...]) -> Command:
        """Ask the program for sample ``k``, and return its answer as a command.

        ``pixels`` (M, 2) are the true ideal pixels, and ``camera`` is the true pose, from which an
        estimation begins where nothing was measured. ``labels`` are those of the rows, none of
        which acts.
        """
        t = k * self._setup.Ts
        seen, taken, pose = self._sensor.newest(k, pixels)
        answer = self.program.respond(
            Observation(
                t=t,
                goal=goal_at(self._goal_times, t),
                q=self._plant.q,
                qd=self._plant.qd,
                pixels=seen,
                taken=taken,
                near=pose or camera,
                exact=pose is not None or not self._sensor.estimates,
            )
        )
        self.compute_time = answer.compute_time
        acted = np.zeros(len(labels), dtype=np.bool_)
        n = len(self._position)
        if self.program.output == "acceleration" and answer.command is not None:
            return Command(answer.command, "ok", acted, labels)
        return Command(np.zeros(n), "ok", acted, labels, qd=self._velocity(answer))

    def _velocity(self, answer: Answer) -> Array:
        """Return the commanded velocity (n,) of an answer, and note a commanded position."""
        if answer.command is None:
            return np.zeros(len(self._position))
        if self.program.output == "velocity":
            return answer.command
        velocity: Array = (answer.command - self._position) / self._setup.Ts
        self._position = answer.command
        return velocity
