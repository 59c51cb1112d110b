"""Measured motion scored as a simulation is: rows, markers and camera are those of the model."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from ..controllers import Controller
from ..formulas.limits import JointLimits
from ..rows import Array, Command, IntArray, Rows, Task
from .disturbances import Disturbances
from .follower import ACCELERATIONS
from .plant import Plant, cubic
from .runs import simulate
from .setup import Setup
from .trajectory import Trajectory


class _Measured(Plant):
    """Robot that takes measured positions (N, n) and speeds (N, n), given as (N, 2, n)."""

    follows = True

    def __init__(
        self, states: Array, Ts: float, commanded: bool, limits: JointLimits | None
    ) -> None:
        super().__init__(states[0, 0], states[0, 1], Ts, "acceleration", Disturbances(), limits)
        self._states = states
        self._at = 0
        self._commanded = commanded

    def follow(self) -> None:
        """Go to the next measurement."""
        self._at = min(self._at + 1, len(self._states) - 1)
        self.x[:2] = self._states[self._at]

    step = follow

    def within(self, states: Array, periods: IntArray, share: float) -> tuple[Array, Array]:
        """Return q and q̇ (P, n) at a share of some periods; cubics without known commands."""
        if self._commanded:
            return super().within(states, periods, share)
        begin = states[periods, 0], states[periods, 1]
        end = states[periods + 1, 0], states[periods + 1, 1]
        return cubic(begin, end, self.Ts, share)


class _Repeated(Controller):
    name = "recorded"

    def __init__(self, qdd: Array) -> None:
        self._commands = iter(qdd)

    def solve(self, rows: Rows, task: Task) -> Command:
        """Return the next recorded command."""
        return Command(
            next(self._commands).copy(),
            "ok",
            np.zeros(len(rows.labels), dtype=np.bool_),
            rows.labels,
        )

    command = define = solve


def follow_measured(
    setup: Setup, states: Array, qdd: Array, *, commanded: bool = True, limited: bool = False
) -> Trajectory:
    """Return the trajectory of a robot that takes measured positions and speeds.

    ``states`` (N, 2, n) are q and q̇ at the sampling times of the setup, and ``qdd`` (N, n) the
    accelerations [rad/s² or m/s²]. If these are ``commanded``, they hold for a period. Otherwise
    motion between samples is cubic. With ``limited``, the actuators' limits apply to them, and to
    the unconstrained command with which they are compared.
    """
    limits = None
    if limited and setup.limits.any:
        limits = setup.limits.arrays(setup.scene.robot.ranges, setup.Ts)

    class Measured(Setup):
        def plant(self) -> Plant:
            return _Measured(states, self.Ts, commanded, limits)

    changes: dict[str, Any] = {
        "disturbances": Disturbances(),
        "dynamics": None,
        "images": None,
        "actuation": "acceleration",
        "arm": ACCELERATIONS,
        "time_limit": None,
        "duration": (len(states) - 1) * setup.Ts,
    }
    settings = {each.name: getattr(setup, each.name) for each in fields(Setup)}
    measured = Measured(**(settings | changes))
    return simulate(measured, _Repeated(qdd), remarks=())
