"""A predictive safety filter: of all plans that satisfy the rows, the one nearest to what the
tracking law would do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Integral
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..compiled import load
from ..compiled.workspace import FAILED, NEEDS_PYTHON, RANK_LOSS, RELAXED_ROWS, SOLVED
from ..errors import InvalidInput, SolverError, shown
from ..rows import Array, BoolArray, Command, Rows, Task, keep_box
from .base import Controller, demand_known, demand_model, fault_of
from .compiled import COUNT, BoundLaw, CompiledLaw, Wrapped, tracking_of
from .demands import Nothing
from .least_norm import RANK_TOLERANCE
from .ranges import GAINS, ROWS, Range, option, positive_number, share
from .resolver import Priority, row_weights
from .resolvers import Hierarchy

MAX_BLOCKS = 100  #: Of a horizon, and of a block.
MAX_PERIODS = 10_000
#: What a model gives along a plan, in the order of the compiled law.
PREDICTED = ("phi", "sigma", "Lg", "J", "b", "error", "rest")
CHECKED = "ok", "relaxed"  #: Statuses of commands that the compiled law has checked.


class Plan(NamedTuple):
    """What was planned: q̈ of the blocks (H, n), what comes after them (n,), and when it was made
    [s].
    """

    qdd: Array
    then: Array
    made: float


@dataclass(kw_only=True, eq=False, repr=False)
class PredictiveControl(Controller):
    """A predictive safety filter: minimise the tracking law's residual along a plan whose states
    keep all rows.

    Wabersich and Zeilinger, Automatica 129, 2021; formulas, sources and differences: :doc:`/laws`.
    The plan has H blocks of constant q̈; the first one's is the command. Along the plan of the
    sample before, rows and task are linearised in every sample. After the plan all joints brake
    together, as fast as their bounds allow, with σ ≤ 0 meanwhile; without bounds of all q̈ there is
    no such row.

    What the model says otherwise of now than rows and task do is taken to stay so. Where rows
    contradict each other, Σ wᵢ sᵢ / scaleᵢ is least, with sᵢ the most that row i is exceeded by
    (where it is steep, divided by its slope), the status is ``relaxed`` and the reason names the
    rows. States that the model cannot give, with a marker behind the camera, shorten the horizon,
    and ``Command.remark`` says so. Plans are local: around what is not convex, a plan may come to
    lie beyond it.

    Attributes ``period`` and ``model`` are those of the last :meth:`reset`.
    """

    name = "predictive"
    ignores = ("K", *GAINS)
    kernels: ClassVar[tuple[str, ...]] = ("predictive",)
    #: Time constant [s] with which what σ̇ is now beside the model's is taken to fade: an
    #: observer's.
    fading = 0.0

    horizon: int = option(10, "H, from 1 to 100", Range(3, 30, integer=True))
    block: int = option(
        10, "length of a block in sampling periods, from 1 to 10,000", Range(5, 25, integer=True)
    )
    approach: float = option(5.0, "κ in blocks", (1.5, 10.0))
    damping: float = option(
        1e-6, "λ relative to the mean of ‖J‖² in the Frobenius norm", (1e-8, 1e-4)
    )
    margin: float = option(
        0.0, "share of each row's scale by which it counts as greater than it is", ROWS["margin"]
    )
    weights: Mapping[str, float] | None = option(
        None, "w by the beginning of the label, as of ``hierarchical-qp``"
    )
    max_acceleration: float | None = option(
        None, "bound of every |q̈| beside the box of the rows [rad/s² or m/s²]"
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
            value = share(name, value)
        elif name in ("weights", "max_acceleration"):
            value = getattr(Hierarchy(**{name: value}), name)
        super().__setattr__(name, value)
        if name != "_planner":
            self._planner = None

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_planner": None}

    def reset(self, period: float | None = None, model: Any = None) -> None:
        """Forget the plan; without a period or a model, those of the last reset stay."""
        if period is not None:
            self.period = positive_number("the sampling period", period)
        if model is not None:
            self.model = model
        self._planner = None

    @property
    def plan(self) -> Plan | None:
        """That of the last sample; None before the first, and where nothing could be predicted."""
        return None if self._planner is None else self._planner.plan

    @property
    def uses(self) -> tuple[str, ...]:
        """See :class:`.Controller`."""
        return ("σ", "T_s", "memory", "model")

    def remark(self, labels: tuple[str, ...]) -> str:
        """See :class:`.Controller`."""
        return Hierarchy(weights=self.weights).remark(labels) if self.weights else ""

    def command(self, rows: Rows, task: Task) -> Command:
        """See :class:`.Controller`; what the compiled law has checked by itself is not checked
        again.
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
        """See the class; InvalidInput if there is no model or no sampling period, or the model is
        of other rows.
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
        """What plans for these rows; raises InvalidInput if there is no model of them, or no
        sampling period.
        """
        who = f"the law {self.name!r}"
        demand_model(who, rows, task, self.model)
        demand_known(who, rows, ("period",), self.period)
        if self._planner is None or self._planner.shape != task.J.shape:
            self._planner = self.planner(task.J.shape)
        return self._planner

    def planner(self, shape: tuple[int, int]) -> Any:
        """What plans for a task of that shape (k, n), once model and period are known."""
        return Planner(self, self.model, self.period or np.nan, shape)


class Planner(Wrapped):
    """The compiled law for the rows of a model: see :mod:`vsconstraints.compiled.predictive`.

    ``compiled`` says whether the model is: otherwise Python predicts, between two calls of the
    compiled law.
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
        times = T * np.arange(H + 1)
        if not np.isclose(period, T):
            times = np.sort(np.append(times, period))
        block = np.maximum(np.ceil(times / T - 1e-9).astype(np.int64) - 1, 0)
        times = np.append(times, np.nan)
        block = np.append(block, H)
        N = len(times)
        step: Any = getattr(model, "step", None)
        loop: Any = getattr(model, "loop", None)
        self.compiled = step is not None and loop is not None
        sizes = {"phi": m, "sigma": m, "Lg": m * n, "J": k * n, "b": k, "error": k, "rest": n}
        if self.compiled:
            where = {name: step.packed.parts[name][0] for name in PREDICTED}
            begins = [part.start if part.stop > part.start else -1 for part in where.values()]
            out = step.out
        else:
            begins = [0, *np.cumsum([*sizes.values()])[:-1].tolist()]
            out = np.empty(sum(sizes.values()))
        own = np.inf if law.max_acceleration is None else law.max_acceleration
        self.model = model
        self.shape = shape
        self._begins = begins
        self.plans = kernels.PlanArrays(
            loop.packed.workspace.address if self.compiled else 0,
            step.packed.workspace.address if self.compiled else 0,
            int(self.compiled and model.frozen),
            law.fading,
            period,
            T,
            law.approach * T,
            law.damping,
            law.margin,
            tracking_of(model.task, n, k),
            np.minimum(own, model.acceleration),
            np.array(model.K, dtype=np.float64),
            row_weights(model.labels, law.weights or {}) * np.ones(m),
            np.zeros(1 + 2 * n),
            np.array(begins),
            np.empty((N, out.size)),
            out,
            times,
            block,
            np.clip(times - T * block, 0.0, T),
            by_speed=(np.asarray(model.K) == 0.0).astype(np.int64),
            **kernels.plan_space(H, N, n, m),
        )
        inner = CompiledLaw(Nothing(), Priority(), model.labels)
        super().__init__(
            inner, self.plans, kernels.look_ahead, options=np.array([RANK_TOLERANCE, kernels.ALL])
        )
        self.remark = law.remark(model.labels)
        self.measures = True

    @property
    def plan(self) -> Plan | None:
        """The last plan, if there is one."""
        plans = self.plans
        return (
            None
            if np.isnan(plans.made[0])
            else Plan(plans.plan.copy(), plans.then.copy(), float(plans.made[0]))
        )

    def solve(self, rows: Rows, task: Task) -> Command:
        """The command; raises SolverError where numbers leave the range of floating point."""
        kernels = load("predictive")
        plans = self.plans
        m = len(self.labels)
        acted = np.zeros(m, dtype=np.bool_)
        qdd = np.zeros(self.shape[1])
        slack = np.zeros(m)
        follow, *arguments = self.call(rows, task)

        def ask(stage: int) -> int:
            self.arrays.options[1] = stage
            code: int = follow(*arguments, qdd, acted, slack, np.zeros(1, COUNT))
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
        command = self.command(code, qdd, acted, self.labels, slack, 0)
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
            ahead = plans.times[predicted]
            short = (
                f"no more than {ahead:.3g} s are predicted, since a marker is then not in "
                f"front of the camera"
            )
        if predicted >= 2 and outcome != FAILED:
            command = self._answer(qdd, acted, slack)
        else:
            why = (
                f"braking: {short}"
                if predicted < 2
                else "the plan goes on as it was: no better one passes the check"
            )
            command = Command(qdd, "suboptimal", acted, self.labels, reason=why)
        command.remark = "; ".join(filter(None, (short, self.remark)))
        return command

    def _predict(self) -> int:
        """Let the model predict along the plan; at how many instants it can."""
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

    def command(
        self,
        code: int,
        qdd: Array,
        acted: BoolArray,
        labels: tuple[str, ...],
        slack: Array,
        iterations: int,
    ) -> Command | None:
        """See :meth:`.Resolver.command`: None where something is to be said that is no slack."""
        if code not in self.answers:
            return None
        command = self._answer(qdd, acted, slack)
        command.remark = self.remark
        return command

    def _answer(self, qdd: Array, acted: BoolArray, slack: Array) -> Command:
        """The command of a plan; its reason names rows that no plan satisfies, and by how much they
        are exceeded.
        """
        if not slack.any():
            return Command(qdd, "ok", acted, self.labels)
        amounts = ", ".join(f"{self.labels[i]} by {slack[i]:.3g}" for i in np.flatnonzero(slack))
        reason = f"no plan satisfies every row; exceeded at most, in units of the rows: {amounts}"
        return Command(qdd, "relaxed", acted, self.labels, reason=reason)


def whole_number(name: str, value: object, most: int) -> int:
    """The value if it is a whole number from 1 to ``most``; raises InvalidInput otherwise."""
    if not isinstance(value, bool) and isinstance(value, Integral) and 1 <= int(value) <= most:
        return int(value)
    raise InvalidInput(f"{name} must be a whole number from 1 to {most}, not {shown(value)}")
