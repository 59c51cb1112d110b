"""A predictive safety filter: of all plans that satisfy the rows, the one nearest to what the tracking law would do."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Integral
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..compiled import load
from ..compiled.workspace import (
    FAILED,
    NEEDS_PYTHON,
    RANK_LOSS,
    RELAXED_ROWS,
    SOLVED,
    LawArrays,
    Workspace,
)
from ..errors import InvalidInput, SolverError, shown
from ..rows import Array, BoolArray, Command, Rows, Task
from .base import Controller
from .compiled import COUNT, BoundLaw, CompiledLaw, tracking_of, whole_call
from .demands import Nothing
from .least_norm import RANK_TOLERANCE
from .ranges import ROWS, Declared, Range, positive_number, share
from .resolver import Priority, row_weights
from .resolvers import Hierarchy

MAX_BLOCKS, MAX_PERIODS = 100, 10_000  #: Of a horizon, and of a block.
#: What a model gives along a plan, in the order of the compiled law.
PREDICTED = ("phi", "sigma", "Lg", "J", "b", "error", "rest")


class Plan(NamedTuple):
    """What was planned: q̈ of the blocks (H, n), what comes after them (n,), and when it was made [s]."""

    qdd: Array
    then: Array
    made: float


class PredictiveControl(Controller):
    """A predictive safety filter: minimise the tracking law's residual along a plan whose states keep all rows.

    What is filtered is the command of the tracking law (Wabersich and Zeilinger, Automatica 129, 2021): where its
    motion keeps all rows over the horizon, it is commanded unchanged, and otherwise the least is taken from it.
    Differences to that paper: nearness is measured in the task, ‖J u − b‖, and over all blocks instead of the first
    alone (Pizarro Bejarano, Brunke and Schoellig, CDC 2023); rows are soft where no plan meets them; and the plan ends
    with a brake in place of an invariant set, so that nothing proves that there will always be a plan. It is not the
    model predictive control of Allibert, Courtial and Chaumette (IEEE Transactions on Robotics, 2010), which minimises
    the error of the image features themselves over the horizon: here the tracking law alone says how the error falls.

    The plan u has H blocks of constant q̈; the first one's is the command, and in the next sample all is computed anew.
    Along the plan of the sample before, moved on in time, the model gives rows and task, which are linearised there in
    every sample: one real-time iteration (Diehl, Bock, Schlöder, SIAM Journal on Control and Optimization, 2005) of

        min Σₖ ‖J uₖ − b‖² + λ‖u − q̈₀‖²,   σ(τ + Δτ) ≤ e^(−Δτ/κ) σ(τ),   q̈_min ≤ u ≤ q̈_max

    J, b and q̈₀ are those of the beginning of block k, where b falls with the errors that the plan makes by K_p and K_v
    of the tracking law, and q̈₀ with its motion. Instants τ are now, one sampling period later, and the ends of blocks;
    rows on φ itself, such as speeds, stand with φ in place of σ. The condition on σ (Zeng, Zhang, Sreenath, ACC 2021)
    lets it approach its boundary with the time constant κ. States are eliminated, so that u alone is left.

    After the plan all joints brake together, as fast as their bounds allow, with σ ≤ 0 meanwhile; a plan that meets its
    rows can then be continued by one that does. Without bounds of all q̈ there is no such row.

    What the model says otherwise of now than rows and task do is taken to stay so, as in Allibert's internal model.
    Where rows contradict each other, Σ wᵢ sᵢ / scaleᵢ is least, with sᵢ the most that row i is exceeded by, the status
    is ``relaxed`` and the reason names the rows. States that the model cannot give, with a marker behind the camera,
    shorten the horizon, and ``Command.remark`` says so. Where no row resists, the command is that of
    :class:`~vsconstraints.controllers.Tracking`. Plans are not searched globally: around what is not convex, such as a
    bowl, a plan may come to lie beyond it.

    Parameters
    ----------
    horizon
        H, from 1 to 100.
    block
        Length of a block in sampling periods, from 1 to 10,000.
    approach
        κ in blocks.
    damping
        λ relative to the mean of ‖J‖² in the Frobenius norm.
    margin
        Share of each row's scale by which rows count as greater than they are, for what the law cannot know.
    weights
        w by the beginning of the label, as of :class:`.HierarchicalQP`.
    max_acceleration
        Bound of every |q̈| [rad/s² or m/s²] beside the box of the rows; None for none.

    Attributes
    ----------
    period, model
        Those of the last :meth:`reset`.
    """

    name, ignores = "predictive", ("K", "observer")
    ranges: ClassVar[Mapping[str, Declared]] = {
        "horizon": Range(3, 30, integer=True),
        "block": Range(5, 25, integer=True),
        "approach": Range(1.5, 10.0),
        "damping": Range(1e-8, 1e-4),
        "margin": ROWS["margin"],
    }

    def __init__(
        self,
        *,
        horizon: int = 10,
        block: int = 10,
        approach: float = 5.0,
        damping: float = 1e-6,
        margin: float = 0.0,
        weights: Mapping[str, float] | None = None,
        max_acceleration: float | None = None,
    ) -> None:
        self.period: float | None = None
        self.model: Any = None
        self.horizon, self.block, self.approach, self.damping = horizon, block, approach, damping
        self.margin = margin
        self.weights, self.max_acceleration = weights, max_acceleration

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
            self._planner: Any = None

    def __getstate__(self) -> dict[str, Any]:
        """All but addresses, which are those of one process."""
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

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class.

        Raises
        ------
        InvalidInput
            if there is no model or no sampling period, or the model is of other rows.
        """
        command: Command = self._ready(rows, task).solve(rows, task)
        return command

    def bind(self, rows: Rows, task: Task, acted: BoolArray, qdd: Array) -> BoundLaw | None:
        """See :class:`.Controller`."""
        if type(self).command is not Controller.command or type(self).solve is not PredictiveControl.solve:
            return None
        planner = self._ready(rows, task)
        return BoundLaw(planner, planner, rows, task, acted, qdd) if planner.compiled else None

    def _ready(self, rows: Rows, task: Task) -> Any:
        """What plans for these rows; raises InvalidInput if there is no model of them, or no sampling period."""
        if self.model is None:
            raise InvalidInput(
                f"the law {self.name!r} uses a model: ask it by ControlStep.command, or tell it by "
                "reset(model=step.model()) of the control step that makes these rows"
            )
        if self.period is None:
            raise InvalidInput(
                f"the law {self.name!r} uses the sampling period: tell it by reset(period=...) before the first command"
            )
        if rows.labels != self.model.labels or task.J.shape[1] != len(self.model.acceleration):
            raise InvalidInput(f"the law {self.name!r} has the model of other rows or of another robot")
        if self._planner is None or self._planner.shape != task.J.shape:
            self._planner = self.planner(task.J.shape)
        return self._planner

    def planner(self, shape: tuple[int, int]) -> Any:
        """What plans for a task of that shape (k, n), once model and period are known."""
        return Planner(self, self.model, self.period or np.nan, shape)


class Planner:
    """The compiled law for the rows of a model: see :class:`.CompiledLaw` and :mod:`vsconstraints.compiled.predictive`.

    ``compiled`` says whether the model is: otherwise Python predicts, between two calls of the compiled law.
    """

    measures, answers = True, (SOLVED, RELAXED_ROWS)

    def __init__(self, law: PredictiveControl, model: Any, period: float, shape: tuple[int, int]) -> None:
        kernels, address = load("predictive"), load("parts").address
        (k, n), m, H, T = shape, len(model.labels), law.horizon, law.block * period
        times = T * np.arange(H + 1)
        if not np.isclose(period, T):
            times = np.sort(np.append(times, period))
        block = np.maximum(np.ceil(times / T - 1e-9).astype(np.int64) - 1, 0)
        times, block = np.append(times, np.nan), np.append(block, H)
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
            begins, out = [0, *np.cumsum([*sizes.values()])[:-1].tolist()], np.empty(sum(sizes.values()))
        own = np.inf if law.max_acceleration is None else law.max_acceleration
        self.model, self.shape, self.labels, self.remark = model, shape, model.labels, law.remark(model.labels)
        self._begins, self._length = begins, T
        self.plans = kernels.PlanArrays(
            loop.packed.workspace.address if self.compiled else 0,
            step.packed.workspace.address if self.compiled else 0,
            int(self.compiled and model.frozen),
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
        self._workspace = Workspace(self.plans)
        self.arrays: LawArrays = CompiledLaw(Nothing(), Priority(), model.labels).arrays._replace(
            resolver=address(kernels.look_ahead),
            demand=self._workspace.address,
            options=np.array([RANK_TOLERANCE, kernels.ALL]),
        )
        self.workspace = Workspace(self.arrays)

    @property
    def plan(self) -> Plan | None:
        """The last plan, if there is one."""
        plans = self.plans
        return None if np.isnan(plans.made[0]) else Plan(plans.plan.copy(), plans.then.copy(), float(plans.made[0]))

    def call(self, rows: Rows, task: Task) -> tuple[Any, ...]:
        """See :meth:`.CompiledLaw.call`."""
        return whole_call(self.workspace, rows, task)

    def solve(self, rows: Rows, task: Task) -> Command:
        """The command; raises SolverError where numbers leave the range of floating point."""
        kernels, plans, m = load("predictive"), self.plans, len(self.labels)
        acted, qdd, slack = np.zeros(m, dtype=np.bool_), np.zeros(self.shape[1]), np.zeros(m)
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
            raise SolverError(f"the plan has no unique optimum: rounding exceeds the damping {plans.damping:g}")
        short = ""
        if predicted < asked:
            ahead = plans.times[predicted]
            short = f"no more than {ahead:.3g} s are predicted, since a marker is then not in front of the camera"
        if predicted >= 2 and outcome != FAILED:
            command = self._answer(qdd, acted, slack)
        else:
            why = f"braking: {short}" if predicted < 2 else "the plan goes on as it was: no better one passes the check"
            command = Command(qdd, "suboptimal", acted, self.labels, reason=why)
        command.remark = "; ".join(filter(None, (short, self.remark)))
        return command

    def _predict(self) -> int:
        """Let the model predict along the plan; at how many instants it can."""
        plans, now = self.plans, self.model.present
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
        self, code: int, qdd: Array, acted: BoolArray, labels: tuple[str, ...], slack: Array, iterations: int
    ) -> Command | None:
        """See :meth:`.Resolver.command`: None where something is to be said that is no slack."""
        if code not in self.answers:
            return None
        command = self._answer(qdd, acted, slack)
        command.remark = self.remark
        return command

    def _answer(self, qdd: Array, acted: BoolArray, slack: Array) -> Command:
        """The command of a plan; its reason names rows that no plan satisfies, and by how much they are exceeded."""
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
