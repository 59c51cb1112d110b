"""Robot programs in the closed loop: what they observe, and what the arm is told to do."""

from __future__ import annotations

import numpy as np

from ..controllers.program import Answer, Observation, RobotProgram
from ..errors import ConfigurationError
from ..formulas.tracking import goal_at
from ..robots.geometry import Pose
from ..rows import Array, Command
from .image_sensor import ImageSensor
from .plant import Plant
from .sensing import Sensor
from .setup import Setup


class ProgramLoop:
    """A robot program in one run, between :meth:`begin` and :meth:`end`."""

    def __init__(self, program: RobotProgram, setup: Setup, sensor: Sensor, plant: Plant) -> None:
        self.program = program
        self._setup = setup
        self._sensor = sensor
        self._plant = plant
        self._begun = False
        self._goal_times = [goal.from_time for goal in setup.task.goals]
        #: Time that the program has computed for its last answer, as it says [s].
        self.compute_time = np.nan

    def begin(self) -> None:
        """Begin the run; raises ConfigurationError if the arm cannot take its commands."""
        self._begun = True
        self.program.begin(self._setup)
        output = self.program.output
        if output == "position":
            raise ConfigurationError(
                f"{self.program.name} commands positions, and this arm takes accelerations"
            )
        if output == "velocity" and not self._setup.limits.any:
            raise ConfigurationError(
                f"{self.program.name} commands velocities, and this arm takes accelerations "
                "without a limit, so that it would follow any step: state limits = "
                "{ acceleration = ... } in the scenario"
            )

    def end(self) -> None:
        """End the run, if it has begun."""
        if self._begun:
            self._begun = False
            self.program.end()

    def command(
        self, k: int, pixels: Array, camera: Pose, labels: tuple[str, ...]
    ) -> Command:
        """Ask the program for sample ``k``, and return the accelerations that execute its answer.

        ``pixels`` (M, 2) are the true ideal pixels, and ``camera`` is the true pose.
        """
        plant = self._plant
        t = k * self._setup.Ts
        seen, taken = self._sensor.newest(k, pixels)
        exact = not (self._sensor.estimates or isinstance(self._sensor, ImageSensor))
        answer = self.program.respond(
            Observation(
                t=t,
                goal=goal_at(self._goal_times, t),
                q=plant.q,
                qd=plant.qd,
                pixels=seen,
                taken=taken,
                near=camera,
                exact=exact,
            )
        )
        self.compute_time = answer.compute_time
        none = np.zeros(len(labels), dtype=np.bool_)
        return Command(self._accelerations(answer), "ok", none, labels)

    def _accelerations(self, answer: Answer) -> Array:
        """Return q̈ (n,) for the answer; without one, the arm is told to stand still."""
        if self.program.output == "acceleration" and answer.command is not None:
            return answer.command
        wanted = 0.0 if answer.command is None else answer.command
        qdd: Array = (wanted - self._plant.qd) / self._setup.Ts
        return qdd
