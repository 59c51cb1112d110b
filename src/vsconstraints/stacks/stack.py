"""Base of stacks: classes that get measurements and data of a scenario, in this process."""

from __future__ import annotations

from abc import abstractmethod
from collections import Counter
from collections.abc import Mapping
from time import perf_counter
from typing import Any, ClassVar

import numpy as np

from ..errors import described, format_value
from ..rows import Array
from ..simulation.programs import Answer, Observation, Output, RobotProgram, declaration
from ..simulation.setup import Setup
from ..vision.measurement import estimated_pose
from .description import describe, matrix
from .protocol import (
    StackFailedError,
    checked_answer,
    checked_declaration,
    setup_message,
    undeclared,
)

MAX_REASONS = 3  #: Number of different reasons for having no answer that a remark lists.


class NoAnswer(Exception):
    """A stack has no answer for this period; the message is the reason.

    The run goes on. The arm is brought to rest until there is an answer again.
    """


class Declared(dict[str, Any]):
    """Data that a stack has declared as used; others raise StackFailedError."""

    def __missing__(self, key: str) -> Any:
        wrong = undeclared(key)
        if wrong:
            raise StackFailedError(f"the stack {wrong}")
        raise KeyError(key)

    def get(self, key: str, default: Any = None, /) -> Any:
        """Return the value of a key; the default only for a key that no message has."""
        try:
            return self[key]
        except KeyError:
            return default


class Measured:
    """Measurements of a run as data, only those that a stack has declared."""

    def __init__(self, setup: Setup, uses: tuple[str, ...]) -> None:
        self._scene = setup.sensor().believed
        # pixels of the image centre, from which those of an observation are counted
        self._centre = self._scene.camera.to_corner(np.zeros(2), "centres")
        self._uses = uses
        self._pose: Array = np.empty((4, 4))  # of the camera in the last image
        self._pose_taken = np.nan  # time of that image [s]

    def __call__(self, now: Observation) -> dict[str, Any]:
        """Return the measurements of a period, with arrays."""
        uses = self._uses
        data: dict[str, Any] = {"t": now.t}
        if "goals" in uses:
            data["goal"] = now.goal
        if "q" in uses:
            data["q"] = now.q
        if "qd" in uses:
            data["qd"] = now.qd
        if "pixels" in uses:
            data["pixels"] = now.pixels + self._centre
        if "pixels" in uses or "pose" in uses:
            data["taken"] = now.taken
        if "pose" in uses:
            data["camera_in_target"] = self._camera_in_target(now)
        if "jacobian" in uses:
            data["jacobian"] = self._scene.camera_jacobian(now.q)
        return data

    def _camera_in_target(self, now: Observation) -> Array:
        """Return the homogeneous matrix (4, 4) of the camera's pose in the newest image."""
        if now.exact:
            return matrix(now.near)
        if now.taken == self._pose_taken and now.taken < now.t:
            return self._pose
        scene = self._scene
        seen = scene.camera.normalised(scene.camera.undistort(now.pixels))
        self._pose = matrix(estimated_pose(scene.markers, seen, now.near))
        self._pose_taken = now.taken
        return self._pose


class MeasuredProgram(RobotProgram):
    """Robot program that counts the periods without an answer."""

    _unanswered: Counter[str] | None = None  # periods without an answer by reason
    _periods = 0
    _declared = ""  # what the results say of its declaration

    def begin(self, setup: Setup) -> None:
        """Begin a run; see :class:`.RobotProgram`."""
        self._unanswered = Counter()
        self._periods = 0
        self._declared = ""

    def prepare(
        self, setup: Setup, name: str, uses: tuple[str, ...], settings: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Return the setup message of a run for the data that ``name`` declares as used."""
        self._declared = declaration(name, uses, self.output)
        self._n = setup.scene.robot.n
        self._measured = Measured(setup, uses)
        return setup_message(describe(setup, uses), settings)

    def counted(self, answer: Answer) -> Answer:
        """Return the answer, after counting it."""
        self._periods += 1
        if answer.command is None and self._unanswered is not None:
            self._unanswered[answer.reason] += 1
        return answer

    def run_remarks(self) -> list[str]:
        """Return the declaration and the periods without an answer: see :class:`.RobotProgram`."""
        declared = [self._declared] if self._declared else []
        if not self._unanswered:
            return declared
        missed = self._unanswered.total()
        listed = "; ".join(
            f"{count} times {format_value(reason)}"
            for reason, count in self._unanswered.most_common(MAX_REASONS)
        )
        return [
            *declared,
            f"no answer in {missed} of {self._periods} periods, in which the arm was brought to "
            f"rest: {listed}",
        ]


class Stack(MeasuredProgram):
    """Stack in this process: a class that gets the same data as a stack in another one.

    A subclass defines ``name``, ``uses``, ``output``, :meth:`start` and :meth:`step`. Arguments of
    its constructor are options in files.
    """

    uses: tuple[str, ...] = ()  #: Data that it gets: names of :data:`.USES`.
    output: Output = "velocity"
    settings: ClassVar[Mapping[str, Any]] = {}

    @abstractmethod
    def start(self, setup: Mapping[str, Any]) -> None:
        """Begin a run with the data of docs/stacks.md that ``uses`` names."""

    @abstractmethod
    def step(self, now: Mapping[str, Any]) -> Any:
        """Return the command (n,) for a period; raises :class:`NoAnswer` if there is none."""

    def begin(self, setup: Setup) -> None:
        """Begin a run; see :class:`.RobotProgram`."""
        super().begin(setup)
        uses, _ = checked_declaration(self.uses, self.output)
        message = self.prepare(setup, self.name, uses, self.settings)
        self.start(Declared(message))

    def respond(self, now: Observation) -> Answer:
        """Compute the command for a period; see :class:`.RobotProgram`."""
        data = Declared(self._measured(now))
        begun = perf_counter()
        try:
            command = self.step(data)
        except NoAnswer as error:
            reason = str(error) or described(error)
            return self.counted(Answer(None, perf_counter() - begun, reason))
        compute_time = perf_counter() - begun
        return self.counted(checked_answer(command, self.output, self._n, compute_time))
