"""Laws that seek scores instead of doing the task: a contract test sees to it that none of them
gains by it.

Each stands for a way to win a column, and says in which scenario it would pay.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from vsconstraints.controllers import (
    Controller,
    HierarchicalQP,
    SlidingMode,
    Tracking,
    VelocityController,
)
from vsconstraints.rows import Array, Command, Rows, Task
from vsconstraints.scenarios import Scenario


class Cheat(Controller):
    """Asks an honest law and does otherwise."""

    honest: Controller = SlidingMode()

    @property
    def name(self) -> str:  # type: ignore[override]
        return type(self).__name__

    def solve(self, rows: Rows, task: Task) -> Command:
        return self.honest.command(rows, task)


class SkipsAGoal(Cheat):
    """Makes for the last goal from the beginning: where the goal changes, it is half way there
    (``case-study-6r``).

    No law is told of goals to come. This one was: it follows the arm by its own commands.
    """

    scenario = "case-study-6r"

    def reset(self) -> None:
        setup = Scenario.load(self.scenario).setup()
        setup.task.goals = (replace(setup.task.goals[-1], from_time=0.0),)
        self._control = setup.control()
        self._Ts = setup.Ts
        self._t = 0.0
        self._q = setup.q0.copy()
        self._qd = setup.qd0.copy()

    def solve(self, rows: Rows, task: Task) -> Command:
        command = super().solve(rows, self._control.evaluate(self._t, self._q, self._qd).task)
        self._t += self._Ts
        self._q += self._Ts * self._qd + 0.5 * self._Ts**2 * command.qdd
        self._qd += self._Ts * command.qdd
        return command


class Overspeeds(Cheat):
    """Is told of joint speeds that may be 5 % higher (``case-study-6r``; it pays where T_s u⁺ is
    more than that).
    """

    honest = HierarchicalQP(rows="barrier")
    excess = 0.05

    def solve(self, rows: Rows, task: Task) -> Command:
        direct = rows.K == 0.0
        return super().solve(
            replace(rows, phi=np.where(direct, rows.phi - self.excess * rows.scale, rows.phi)), task
        )


class Bounces(Cheat):
    """Strikes back from a boundary with 50 u⁺: the row acts in one sample, at full usage
    (``example-2d-fov``).
    """

    def solve(self, rows: Rows, task: Task) -> Command:
        return super().solve(replace(rows, switching_gain=50.0 * rows.switching_gain), task)


class StandsStill(Cheat):
    """Leaves no row and uses no command: anywhere."""

    def solve(self, rows: Rows, task: Task) -> Command:
        return Command(
            np.zeros(rows.Lg.shape[1]),
            "ok",
            np.zeros(len(rows.labels), dtype=np.bool_),
            rows.labels,
        )


class Crawls(Cheat):
    """Takes far longer than anybody needs, calmly: tracking with 100 per s more of damping (any
    scene).
    """

    def solve(self, rows: Rows, task: Task) -> Command:
        return super().solve(rows, replace(task, b=task.b - 100.0 * task.error_rate))


class ActsOnIdleRows(Cheat):
    """Holds back rows that nothing pushes against their boundary, and says that they act (any
    scene).
    """

    honest = Tracking()

    def solve(self, rows: Rows, task: Task) -> Command:
        command = super().solve(rows, task)
        idle = int(np.argmin(rows.phi / rows.scale))
        gradient = rows.Lg[idle]
        size = float(gradient @ gradient)
        qdd = (
            command.qdd - (0.05 * rows.switching_gain[idle] / size) * gradient
            if size > 1e-9
            else command.qdd
        )
        return replace(command, qdd=qdd, acted=np.ones(len(rows.labels), dtype=np.bool_))


class ClaimsRankLoss(Cheat):
    """Reports a loss of rank where it begins to be difficult, to be aborted with a clean record
    (any scene).
    """

    def solve(self, rows: Rows, task: Task) -> Command:
        command = super().solve(rows, task)
        return (
            replace(command, status="rank-loss", reason="lost")
            if (rows.phi >= 0.0).any()
            else command
        )


class WritesIntoRows(Cheat):
    """Makes u⁺ and the scale of its rows larger, and so what is tolerated and what counts as acting
    (any scene).
    """

    honest = Tracking()

    def solve(self, rows: Rows, task: Task) -> Command:
        for values in (
            rows.switching_gain,
            rows.scale,
            rows.K,
            rows.phi,
            rows.sigma,
            rows.Lg,
            task.error,
        ):
            writable(values)
            values *= 100.0
        return super().solve(rows, task)


def writable(values: Array) -> None:
    """What a law that wants to can do to an array; raises where it is refused."""
    while True:
        values.flags.writeable = True
        if not isinstance(values.base, np.ndarray):
            return
        values = values.base


class Exits(Cheat):
    """Ends the process, and with it whatever would have been scored (any scene)."""

    def solve(self, rows: Rows, task: Task) -> Command:
        raise SystemExit(0)


class Tunnels(Cheat):
    """Flies through what no sample shows, too fast to be seen there: :data:`TUNNEL`."""

    speed = 1.2

    def __init__(self) -> None:
        self._at = 0

    def reset(self) -> None:
        self._at = 0

    def solve(self, rows: Rows, task: Task) -> Command:
        # one period to reach the speed, seven at it, one to brake; along x
        qdd = np.zeros(rows.Lg.shape[1])
        qdd[1] = {0: 1.0, 8: -1.0}.get(self._at, 0.0) * self.speed / 0.1
        self._at += 1
        return Command(qdd, "ok", np.zeros(len(rows.labels), dtype=np.bool_), rows.labels)


TUNNEL: dict[str, Any] = {
    "robot": "free-camera",
    "q0": [0.0, -0.48, 0.0, 0.0, 0.0, 0.0],
    "sampling_time": 0.1,
    "duration": 3.0,
    "camera": {"focal_px": [300.0, 300.0], "size_px": [1400, 1400]},
    "target": {"markers": [[-0.1, -0.1, 1.2], [0.1, -0.1, 1.2], [0.1, 0.1, 1.2], [-0.1, 0.1, 1.2]]},
    "task": {
        "feature": "camera-pose",
        "Kp0": 10.0,
        "goals": [{"camera_at_q": [0.0, 0.48, 0.0, 0.0, 0.0, 0.0]}],
    },
    "constraints": [
        {
            "type": "forbidden-sphere",
            "centre": [0.0, 0.0, 0.0],
            "radius": 0.05,
            "K": 0.3,
            "switching_gain": 1.0,
        }
    ],
}
"""A sphere of 5 cm on the straight way to the goal: it is passed within a period, 6 cm from it at
both ends.
"""


class CheatAtSpeed(VelocityController):
    """Cheat that commands joint speeds."""

    @property
    def name(self) -> str:  # type: ignore[override]
        return type(self).__name__


class KeepsStill(CheatAtSpeed):
    """Reports that every row acts and all is well, and commands no speed (anywhere)."""

    def solve(self, rows: Rows, task: Task) -> Command:
        n = rows.Lg.shape[1]
        acted = np.ones(len(rows.labels), dtype=np.bool_)
        return Command(np.zeros(n), "ok", acted, rows.labels, qd=np.zeros(n))


class RushesThroughTheGoal(CheatAtSpeed):
    """Is at the goal in a sample, far earlier than anybody else, at full speed
    (``example-2d-fov``).

    It makes for the goal straight and at one speed, and does not stop there.
    """

    speed = 1.0
    near = 0.02

    def reset(self, period: float | None = None) -> None:
        super().reset(period)
        self._passed = False

    def solve(self, rows: Rows, task: Task) -> Array:  # type: ignore[override]
        way = -np.linalg.pinv(task.J) @ task.error
        distance = float(np.linalg.norm(way))
        self._passed = self._passed or distance < self.near
        return self.last if self._passed else (self.speed / distance) * way


class TunnelsAtSpeed(CheatAtSpeed):
    """Flies through what no sample shows, as :class:`Tunnels` does, by speeds: :data:`TUNNEL`."""

    def reset(self, period: float | None = None) -> None:
        super().reset(period)
        self._at = 0

    def solve(self, rows: Rows, task: Task) -> Array:  # type: ignore[override]
        # seven periods at full speed between two at half of it; along x
        qd = np.zeros(rows.Lg.shape[1])
        if self._at <= 8:
            qd[1] = Tunnels.speed * (0.5 if self._at in (0, 8) else 1.0)
        self._at += 1
        return qd


CHEATS = (
    SkipsAGoal,
    Overspeeds,
    Bounces,
    StandsStill,
    Crawls,
    ActsOnIdleRows,
    ClaimsRankLoss,
    WritesIntoRows,
    Exits,
)
"""Those that are tried on the case study."""
CHEATS_AT_SPEED = (KeepsStill, RushesThroughTheGoal)
"""Those that are tried on an arm that takes velocities."""
