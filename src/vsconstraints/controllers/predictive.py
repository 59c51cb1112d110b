"""Predictive safety filter: of all plans that satisfy the rows, the nearest to tracking."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Integral
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..compiled import load
from ..compiled.workspace import FAILED, NEEDS_PYTHON, RANK_LOSS, RELAXED_ROWS, SOLVED, zeros
from ..errors import InvalidInput, SolverError, format_value
from ..rows import Array, BoolArray, Command, IntArray, Rows, Task, keep_box
from .base import Controller, fault_of, require_known, require_model
from .compiled import COUNT, BoundLaw, CompiledAnswer, CompiledLaw, Wrapped, tracking_of
from .demands import Nothing
from .least_norm import RANK_TOLERANCE
from .ranges import GAINS, ROWS, Range, option, positive_number, share_number
from .resolver import Priority, row_weights
from .resolvers import Hierarchy

MAX_BLOCKS = 100  #: Largest horizon, in blocks.
MAX_PERIODS = 10_000
#: Predicted quantities, in the order of the compiled law.
PREDICTED = ("phi", "sigma", "Lg", "J", "b", "error", "rest")
CHECKED = "ok", "relaxed"  #: Statuses that imply a check by the compiled law.


class Plan(NamedTuple):
    """Planned q̈ of the blocks (H, n), q̈ after them (n,), and the time of planning [s]."""

    qdd: Array
    then: Array
    made: float


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
    kernels: ClassVar[tuple[str, ...]] = ("predictive",)
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

    def bind(self, rows: Rows, task: Task, active: BoolArray, qdd: Array) -> BoundLaw | None:
        """See :class:`.Controller`."""
        if (
            type(self).command is not PredictiveControl.command
            or type(self).solve is not PredictiveControl.solve
        ):
            return None
        planner = self._ready(rows, task)
        return BoundLaw(planner, planner, rows, task, active, qdd) if planner.compiled else None

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


class Planner(Wrapped):
    """The compiled law for the rows of a model, see :mod:`vsconstraints.compiled.predictive`.

    ``compiled`` is true if the model is compiled too. Otherwise Python predicts, between two calls
    of the compiled law.
    """

    answers = SOLVED, RELAXED_ROWS

    def __init__(
        self, law: PredictiveControl, model: Any, period: float, shape: tuple[int, int]
    ) -> None:
        kernels = load("predictive")
        k, n = shape
        m = len(model.labels)
        H = law.horizon
        T = law.block * period
        times, block = instants(H, T, period)
        N = len(times)
        step: Any = getattr(model, "step", None)
        loop: Any = getattr(model, "loop", None)
        self.compiled = step is not None and loop is not None
        begins, out = self._layout(step if self.compiled else None, (m, n, k))
        most = np.inf if law.max_acceleration is None else law.max_acceleration
        self.model = model
        self.shape = shape
        self._begins = begins
        lengths = load("plan_program").lengths_of(H, N, n, m)
        known = {
            "loop": loop.packed.workspace.address if self.compiled else 0,
            "step": step.packed.workspace.address if self.compiled else 0,
            "frozen": int(self.compiled and model.frozen),
            "fading": law.fading,
            "period": period,
            "length": T,
            "approach": law.approach * T,
            "damping": law.damping,
            "margin": law.margin,
            "tracking": tracking_of(model.task, n, k),
            "most": np.minimum(most, model.acceleration),
            "K": np.array(model.K, dtype=np.float64),
            "weights": row_weights(model.labels, law.weights or {}) * np.ones(m),
            "at": np.array(begins),
            "out": out,
            "times": times,
            "block": block,
            "since": np.clip(times - T * block, 0.0, T),
            "made": np.full(1, np.nan),
            "by_speed": (np.asarray(model.K) == 0.0).astype(np.int64),
            "p": lengths["p"],
        }
        self.plans = zeros(kernels.PlanArrays, {**lengths, "outputs": out.size}, known)
        inner = CompiledLaw(Nothing(), Priority(), model.labels)
        super().__init__(
            inner, self.plans, kernels.look_ahead, options=np.array([RANK_TOLERANCE, kernels.ALL])
        )
        self.remark = law.remark(model.labels)
        self.measures = True

    @staticmethod
    def _layout(step: Any, sizes: tuple[int, int, int]) -> tuple[list[int], Array]:
        """Return the first entries of the parts of a prediction, and the array of one prediction.

        It is the output of the compiled ``step``, in which absent parts begin at −1. If Python
        predicts, the parts follow each other; ``sizes`` are the numbers m, n and k of rows, joints
        and features.
        """
        if step is not None:
            parts = [step.packed.parts[name][0] for name in PREDICTED]
            return [part.start if part.stop > part.start else -1 for part in parts], step.out
        m, n, k = sizes
        # in the order of PREDICTED: φ, σ, L_gφ, J, b, e and q̈₀
        ends = np.cumsum([m, m, m * n, k * n, k, k, n])
        return [0, *ends[:-1].tolist()], np.empty(int(ends[-1]))

    @property
    def plan(self) -> Plan | None:
        """The last plan; None if there is none."""
        plans = self.plans
        if np.isnan(plans.made[0]):
            return None
        return Plan(plans.plan.copy(), plans.then.copy(), float(plans.made[0]))

    def solve(self, rows: Rows, task: Task) -> Command:
        """Compute the command.

        Raises SolverError if a number leaves the range of floating point, or if the plan has no
        unique optimum.
        """
        kernels = load("predictive")
        plans = self.plans
        m = len(self.labels)
        active = np.zeros(m, dtype=np.bool_)
        qdd = np.zeros(self.shape[1])
        slack = np.zeros(m)
        solve, *arguments = self.call(rows, task)

        def ask(stage: int) -> int:
            self.arrays.options[1] = stage
            code: int = solve(*arguments, qdd, active, slack, np.zeros(1, COUNT))
            self.arrays.options[1] = kernels.ALL
            return code

        if self.compiled:
            code = ask(kernels.ALL)
        else:
            now = self.model.present
            plans.now[:] = np.concatenate(([now.t], now.q, now.qd))
            code = ask(kernels.PROPOSE)
            if code == SOLVED and self._predict() < 2:
                ask(kernels.BRAKE)
                self._predict()
            code = ask(kernels.CONCLUDE) if code == SOLVED else code
        command = self.command(CompiledAnswer(code, qdd, active, slack, 0), self.labels)
        if command is not None:
            return command
        predicted, asked, _, outcome = plans.outcome.tolist()
        if code == NEEDS_PYTHON:
            raise SolverError("numbers are beyond the range of floating point")
        if predicted >= 2 and outcome == RANK_LOSS:
            raise SolverError(
                f"the plan has no unique optimum: rounding exceeds the damping {plans.damping:g}"
            )
        short = ""
        if predicted < asked:
            short = (
                f"no more than {plans.times[predicted]:.3g} s are predicted, since a marker is "
                f"then not in front of the camera"
            )
        if predicted >= 2 and outcome != FAILED:
            command = self._answer(qdd, active, slack)
        else:
            why = (
                f"braking: {short}"
                if predicted < 2
                else "the previous plan is continued: no better one passes the check"
            )
            command = Command(qdd, "suboptimal", active, self.labels, reason=why)
        command.remark = "; ".join(filter(None, (short, self.remark)))
        return command

    def _predict(self) -> int:
        """Predict along the plan; return the number of instants that the model can predict."""
        plans = self.plans
        now = self.model.present
        asked = int(plans.outcome[load("predictive").ASKED])
        seen = self.model.along(now.t + plans.times[:asked], *plans.states[:, :asked])
        for name, begin in zip(PREDICTED, self._begins, strict=True):
            part = getattr(seen, name).reshape(len(seen), -1)
            plans.seen[: len(seen), begin : begin + part.shape[1]] = part
        if not seen.rest.size:
            plans.at[-1] = -1
        plans.outcome[0] = len(seen)
        return len(seen)

    def command(self, answer: CompiledAnswer, labels: tuple[str, ...]) -> Command | None:
        """See :meth:`.Resolver.command`.

        None also if the command needs a reason other than slack.
        """
        if answer.code not in self.answers:
            return None
        command = self._answer(answer.qdd, answer.active, answer.slack)
        command.remark = self.remark
        return command

    def _answer(self, qdd: Array, active: BoolArray, slack: Array) -> Command:
        """Return the command of a plan.

        Its reason names the rows that no plan satisfies, with their violation.
        """
        if not slack.any():
            return Command(qdd, "ok", active, self.labels)
        amounts = ", ".join(f"{self.labels[i]} by {slack[i]:.3g}" for i in np.flatnonzero(slack))
        reason = f"no plan satisfies every row; exceeded at most, in units of the rows: {amounts}"
        return Command(qdd, "relaxed", active, self.labels, reason=reason)


def instants(H: int, T: float, period: float) -> tuple[Array, IntArray]:
    """Return the instants (N,) [s] at which rows are predicted, and their blocks (N,).

    They are the ends of the H blocks of T seconds, and the end of the first sampling period. The
    last instant is the end of the brake after the plan, which is not known yet.
    """
    times = T * np.arange(H + 1)
    if not np.isclose(period, T):
        times = np.sort(np.append(times, period))
    # an instant at the end of a block belongs to it, up to rounding
    block = np.maximum(np.ceil(times / T - 1e-9).astype(np.int64) - 1, 0)
    return np.append(times, np.nan), np.append(block, H)


def whole_number(name: str, value: object, most: int) -> int:
    """Return the value; raise InvalidInput unless it is an integer from 1 to ``most``."""
    if not isinstance(value, bool) and isinstance(value, Integral) and 1 <= int(value) <= most:
        return int(value)
    raise InvalidInput(f"{name} must be a whole number from 1 to {most}, not {format_value(value)}")
