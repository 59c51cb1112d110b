"""Predictive safety filter: of all plans that satisfy the rows, the nearest to tracking."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Integral
from typing import Any, ClassVar

import numpy as np

from ..controllers.base import Controller, fault_of, require_known, require_model
from ..controllers.compiled import BoundLaw
from ..controllers.ranges import GAINS, ROWS, Range, option, positive_number, share_number
from ..controllers.resolvers import Hierarchy
from ..errors import InvalidInput, format_value
from ..rows import Array, BoolArray, Command, Rows, Task, keep_box
from .planner import KERNELS, Plan, Planner

MAX_BLOCKS = 100  #: Largest horizon, in blocks.
MAX_PERIODS = 10_000
CHECKED = "ok", "relaxed"  #: Statuses that imply a check by the compiled law.


@dataclass(kw_only=True, eq=False, repr=False)
class PredictiveControl(Controller):
    """A predictive safety filter: minimises the tracking residual of a plan that keeps all rows.

    Wabersich and Zeilinger, Automatica 129, 2021; formulas, sources and differences: :doc:`/laws`.
    The plan has H blocks of constant q̈; the first one is the command. In every sample, rows and
    task are linearised along the plan of the last sample. After the plan all joints brake together,
    as fast as their bounds allow, with σ ≤ 0 meanwhile. If not all q̈ are bounded, there is no such
    row.

    The present difference between the model and rows or task is taken as constant. If rows
    contradict each other, Σ wᵢ sᵢ / scaleᵢ is minimised, the status is ``relaxed``, and the reason
    names the rows. sᵢ is the largest violation of row i, divided by its slope where it is steep.
    States that the model cannot predict, with a marker behind the camera, shorten the horizon, and
    ``Command.remark`` reports this. Plans are local optima: a plan may end beyond a nonconvex
    obstacle.

    The attributes ``period`` and ``model`` are those of the last :meth:`reset`.
    """

    name = "predictive"
    ignores = ("K", *GAINS)
    kernels: ClassVar[tuple[str, ...]] = (f"{KERNELS}.predictive",)
    #: Time constant [s] with which the difference between σ̇ and its model fades along the plan;
    #: set by an observer.
    fading = 0.0

    horizon: int = option(
        10, "H: number of blocks in the plan, from 1 to 100", Range(3, 30, integer=True)
    )
    block: int = option(
        10, "length of a block, in sampling periods, from 1 to 10,000", Range(5, 25, integer=True)
    )
    approach: float = option(
        5.0, "κ: time constant with which rows may approach their boundary, in blocks", (1.5, 10.0)
    )
    damping: float = option(
        1e-6,
        "λ: weight of the accelerations, relative to the mean of ‖J‖² in the Frobenius norm",
        (1e-8, 1e-4),
    )
    margin: float = option(
        0.0, "safety margin added to every row, as a fraction of its scale", ROWS["margin"]
    )
    weights: Mapping[str, float] | None = option(
        None,
        "w: weights of violations, by the beginning of the row's label, as of ``hierarchical-qp``",
    )
    max_acceleration: float | None = option(
        None, "bound on |q̈| of every joint, in addition to the box of the rows [rad/s² or m/s²]"
    )

    period: float | None = field(default=None, init=False)
    model: Any = field(default=None, init=False)
    _planner: Any = field(default=None, init=False)

    def __setattr__(self, name: str, value: Any) -> None:
        if name in ("horizon", "block"):
            value = whole_number(name, value, MAX_BLOCKS if name == "horizon" else MAX_PERIODS)
        elif name in ("approach", "damping"):
            value = positive_number(name, value)
        elif name == "margin":
            value = share_number(name, value)
        elif name in ("weights", "max_acceleration"):
            value = getattr(Hierarchy(**{name: value}), name)
        super().__setattr__(name, value)
        if name != "_planner":
            self._planner = None

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_planner": None}

    def reset(self, period: float | None = None, model: Any = None) -> None:
        """Clear the plan; if no period or no model is given, the last one is kept."""
        if period is not None:
            self.period = positive_number("the sampling period", period)
        if model is not None:
            self.model = model
        self._planner = None

    @property
    def plan(self) -> Plan | None:
        """Plan of the last sample; None before the first, or without a prediction."""
        return None if self._planner is None else self._planner.plan

    @property
    def uses(self) -> tuple[str, ...]:
        """See :class:`.Controller`."""
        return ("σ", "T_s", "memory", "model")

    def remark(self, labels: tuple[str, ...]) -> str:
        """See :class:`.Controller`."""
        return Hierarchy(weights=self.weights).remark(labels) if self.weights else ""

    def command(self, rows: Rows, task: Task) -> Command:
        """See :class:`.Controller`.

        Checks that the compiled law has done are not repeated.
        """
        try:
            planner = self._ready(rows, task)
            if planner.compiled and type(self).solve is PredictiveControl.solve:
                command: Command = planner.solve(rows, task)
                if command.status in CHECKED or not fault_of(command, rows, task):
                    keep_box(rows, command)
                    return command
        except Exception:
            pass
        return self.define(rows, task)

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class.

        Raises InvalidInput if there is no model or no sampling period, or if the model has other
        rows.
        """
        command: Command = self._ready(rows, task).solve(rows, task)
        return command

    def bind(self, rows: Rows, task: Task, acted: BoolArray, qdd: Array) -> BoundLaw | None:
        """See :class:`.Controller`."""
        if (
            type(self).command is not PredictiveControl.command
            or type(self).solve is not PredictiveControl.solve
        ):
            return None
        planner = self._ready(rows, task)
        return BoundLaw(planner, planner, rows, task, acted, qdd) if planner.compiled else None

    def _ready(self, rows: Rows, task: Task) -> Any:
        """Return the planner for these rows.

        Raises InvalidInput if there is no model of them, or no sampling period.
        """
        who = f"the law {self.name!r}"
        require_model(who, rows, task, self.model)
        require_known(who, rows, ("period",), self.period)
        if self._planner is None or self._planner.shape != task.J.shape:
            self._planner = self.planner(task.J.shape)
        return self._planner

    def planner(self, shape: tuple[int, int]) -> Any:
        """Create the planner for a task of shape (k, n).

        Model and period are known.
        """
        return Planner(self, self.model, self.period or np.nan, shape)


def whole_number(name: str, value: object, most: int) -> int:
    """Return the value; raise InvalidInput unless it is an integer from 1 to ``most``."""
    if not isinstance(value, bool) and isinstance(value, Integral) and 1 <= int(value) <= most:
        return int(value)
    raise InvalidInput(f"{name} must be a whole number from 1 to {most}, not {format_value(value)}")
