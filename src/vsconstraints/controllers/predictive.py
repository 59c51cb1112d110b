"""A predictive safety filter: of all plans that keep the rows, the one nearest to what the tracking law would do."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Integral
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..errors import InvalidInput, SolverError, shown
from ..qp import SolverChain
from ..qp.penalised import Penalised, penalised
from ..rows import Array, BoolArray, Command, IntArray, Rows, Status, Task, in_box
from ..rows.tolerances import PULLING, ZERO_GRADIENT
from .base import Controller
from .condensed import Lookahead, cost, limits, look_ahead
from .horizon import Horizon, Instants, stopping_time
from .laws import Tracking
from .ranges import Declared, Range, positive
from .resolvers import Hierarchy, row_weights

MAX_BLOCKS, MAX_PERIODS = 100, 10_000
"""Of a horizon, whose QP has n times as many unknowns; and of a block."""

NO_ROWS: IntArray = np.empty(0, dtype=np.int64)
"""Of the QP."""


class Plan(NamedTuple):
    """What was planned at the time ``made`` [s]: q̈ of the blocks (H, n), and what comes after them (n,).

    ``held`` are the rows of the QP that held it, by their indices there: those are likely to hold the next one.
    """

    qdd: Array
    then: Array
    made: float
    held: IntArray = NO_ROWS


class PredictiveControl(Controller):
    """A predictive safety filter: minimise the tracking law's residual along a plan whose states keep all rows.

    What is filtered is the command of the tracking law (Wabersich and Zeilinger 2021): where its motion keeps all rows
    over the horizon, it is commanded unchanged, and otherwise the least is taken from it. Differences to that paper:
    nearness is measured in the task, ‖J u − b‖, and over all blocks instead of the first alone (multi-step safety
    filters: Pizarro Bejarano, Brunke and Schoellig 2023); rows are soft where no plan meets them; and the plan ends
    with a brake in place of an invariant set, so that nothing proves that there will always be a plan. It is not the
    model predictive control of Allibert, Courtial and Chaumette (2010), which minimises the error of the image features
    themselves over the horizon: here the tracking law alone says how the error falls.

    The plan u has H blocks of constant q̈; the first one's is the command, and in the next sample all is computed anew.
    Along the plan of the sample before, moved on in time, the model gives rows and task, which are linearised there in
    every sample: one real-time iteration (Diehl, Bock, Schlöder 2005) of

        min Σₖ ‖J uₖ − b‖² + λ‖u − q̈₀‖²,   σ(τ + Δτ) ≤ e^(−Δτ/κ) σ(τ),   q̈_min ≤ u ≤ q̈_max

    J, b and q̈₀ are those of the beginning of block k, where b falls with the errors that the plan makes by K_p and K_v
    of the tracking law, and q̈₀ with its motion. Instants τ are now, one sampling period later, and the ends of blocks;
    rows on φ itself, such as speeds, stand with φ in place of σ. The condition on σ (Zeng, Zhang, Sreenath 2021) lets
    it approach its boundary with the time constant κ. States are eliminated, so that u alone is left.

    Terminal treatment: after the plan all joints brake together, as fast as their bounds allow, with σ ≤ 0 meanwhile; a
    plan that meets its rows can then be continued by one that does. Without bounds of all q̈ there is no such row.

    What the model says otherwise of now than rows and task do is taken to stay so (the internal model of Allibert,
    Courtial, Chaumette 2010). Where rows contradict each other, Σ wᵢ sᵢ / scaleᵢ is least, with sᵢ the most that row i
    is exceeded by, the status is ``relaxed`` and the reason names the rows. States that the model cannot give, with a
    marker behind the camera, shorten the horizon, and ``Command.remark`` says so. Where no row resists, the command is
    that of :class:`~vsconstraints.controllers.Tracking`. Plans are not searched globally: around what is not convex,
    such as a bowl, a plan may come to lie beyond it.

    References: Wabersich, Zeilinger, "A predictive safety filter for learning-based control of constrained nonlinear
    dynamical systems", Automatica 129, 2021. Pizarro Bejarano, Brunke, Schoellig, "Multi-step model predictive safety
    filters: reducing chattering by increasing the prediction horizon", IEEE Conference on Decision and Control, 2023.
    Allibert, Courtial, Chaumette, "Predictive control for constrained image-based visual servoing", IEEE
    Transactions on Robotics, 2010. Hajiloo, Keshmiri, Xie, Wang, "Robust online model predictive control for a
    constrained image-based visual servoing", IEEE Transactions on Industrial Electronics, 2016. Diehl, Bock, Schlöder,
    "A real-time iteration scheme for nonlinear optimization in optimal feedback control", SIAM Journal on Control and
    Optimization, 2005. Zeng, Zhang, Sreenath, "Safety-critical model predictive control with discrete-time control
    barrier function", American Control Conference, 2021.

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
    weights
        w by the beginning of the label, as of :class:`.HierarchicalQP`.
    solver
        Name of a QP solver; if the answer of another one than DAQP fails the check, others are asked.
    max_acceleration
        Bound of every |q̈| [rad/s² or m/s²] beside the box of the rows; None for none.
    """

    name = "predictive"
    ranges: ClassVar[Mapping[str, Declared]] = {
        "horizon": Range(3, 30, integer=True),
        "block": Range(5, 25, integer=True),
        "approach": Range(1.5, 10.0),
        "damping": Range(1e-8, 1e-4),
    }

    solvers: SolverChain
    plan: Plan | None

    def __init__(
        self,
        *,
        horizon: int = 10,
        block: int = 10,
        approach: float = 5.0,
        damping: float = 1e-6,
        weights: Mapping[str, float] | None = None,
        solver: str = "daqp",
        max_acceleration: float | None = None,
    ) -> None:
        self.period: float | None = None
        self.model: Any = None
        self._tracking = Tracking()
        self.horizon, self.block, self.approach, self.damping = horizon, block, approach, damping
        self.weights, self.solver, self.max_acceleration = weights, solver, max_acceleration

    def __setattr__(self, name: str, value: Any) -> None:
        if name in ("horizon", "block"):
            value = _count(name, value, MAX_BLOCKS if name == "horizon" else MAX_PERIODS)
        elif name in ("approach", "damping"):
            value = _positive(name, value)
        elif name in ("weights", "max_acceleration"):
            value = getattr(Hierarchy(**{name: value}), name)
        elif name == "solver":
            super().__setattr__("solvers", SolverChain(value))
        super().__setattr__(name, value)
        if name != "plan":
            super().__setattr__("plan", None)

    def reset(self, period: float | None = None, model: Any = None) -> None:
        """Forget the plan and what solvers remember; without a period or a model, those of the last reset stay."""
        if period is not None:
            self.period = _positive("the sampling period", period)
        if model is not None:
            self.model = model
        self.plan = None
        self.solvers.reset()

    @property
    def uses(self) -> tuple[str, ...]:
        """See :class:`.Controller`."""
        return ("σ", "T_s", "memory", "model")

    def remark(self, labels: tuple[str, ...]) -> str:
        """See :class:`.Controller`."""
        return Hierarchy(weights=self.weights).remark(labels) if self.weights else ""

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class; InvalidInput if there is no model or no sampling period, or the model is of other rows."""
        model, horizon = self._ready(rows, task)
        now, most = model.present, self._most(model)
        low, high = self._box(rows, most)

        def seen_along(plan: Array) -> tuple[Instants, Any]:
            at = horizon.instants(now.q, now.qd, plan, most)
            return at, model.along(now.t + at.times, at.q, at.qd)

        plan = self.continued(horizon, now, low, high)
        at, seen = seen_along(plan)
        if len(seen) < 2:
            plan = horizon.brake(now.qd, low, high)
            at, seen = seen_along(plan)
        remark = ""
        if len(seen) < len(at.times):
            ahead = f"no more than {at.times[len(seen)]:.3g} s are predicted"
            remark = f"{ahead}, since a marker is then not in front of the camera"
        if len(seen) < 2:
            self.plan = None
            return self._answer(rows, plan[0], "suboptimal", f"braking: {remark}")
        try:
            found, held = self._optimum(rows, look_ahead(rows, task, seen, at, plan, model.K), horizon, (low, high))
        except SolverError as error:
            self.plan = self._planned(horizon, plan, now, most, NO_ROWS)
            return self._answer(rows, plan[0], "suboptimal", f"the plan goes on as it was: {error}", remark)
        best, unmet = found.x.reshape(plan.shape), found.slack
        self.plan = self._planned(horizon, best, now, most, found.rows[found.multipliers > 0.0])
        # bit by bit what tracking alone commands
        free = not found.multipliers.any() and not unmet.any()
        qdd = self._tracking.command(Rows.none(len(now.q)), task).qdd if free else best[0]
        amounts = ", ".join(f"{rows.labels[i]} by {unmet[i]:.3g}" for i in np.flatnonzero(unmet))
        reason = f"no plan meets every row; exceeded at most, in units of the rows: {amounts}" if amounts else ""
        command = self._answer(rows, qdd, "relaxed" if amounts else "ok", reason, remark)
        command.acted = held
        if found.verified is not None:
            command.solver, command.fallback = found.verified.solver, found.verified.fallback
            command.iterations = found.verified.answer.iterations
        return command

    def _ready(self, rows: Rows, task: Task) -> tuple[Any, Horizon]:
        if self.model is None:
            raise InvalidInput(
                "the law 'predictive' uses a model: ask it by ControlStep.command, or tell it by "
                "reset(model=step.model()) of the control step that makes these rows"
            )
        if self.period is None:
            raise InvalidInput(
                "the law 'predictive' uses the sampling period: tell it by reset(period=...) before the first command"
            )
        if rows.labels != self.model.labels or task.J.shape[1] != len(self.model.present.q):
            raise InvalidInput("the law 'predictive' was told the model of other rows or of another robot")
        return self.model, Horizon.of(self.horizon, self.block, self.period)

    def _most(self, model: Any) -> Array:
        """Greatest |q̈| (n,)."""
        own = np.inf if self.max_acceleration is None else self.max_acceleration
        most: Array = np.minimum(own, model.acceleration)
        return most

    def _box(self, rows: Rows, most: Array) -> tuple[Array, Array]:
        """Least and greatest q̈ of the blocks (H, n); what rows say of now holds for the first."""
        high = np.empty((self.horizon, len(most)))
        high[:] = most
        low = -high
        low[0], high[0] = in_box(rows, low[0]), in_box(rows, high[0])
        return low, high

    def continued(self, horizon: Horizon, now: Any, low: Array, high: Array) -> Array:
        """The last sample's plan, as it goes on from now; braking if there is none."""
        plan = self.plan
        if plan is None or not 0.0 <= now.t - plan.made < horizon.blocks * horizon.length:
            return horizon.brake(now.qd, low, high)
        return np.minimum(np.maximum(horizon.later(plan.qdd, plan.then, now.t - plan.made), low), high)

    @staticmethod
    def _planned(horizon: Horizon, plan: Array, now: Any, most: Array, held: IntArray) -> Plan:
        end = now.qd + horizon.V[-1] @ plan
        stops = stopping_time(end, most)
        return Plan(plan, -end / stops if stops > 0.0 else np.zeros_like(end), now.t, held)

    def _optimum(
        self, rows: Rows, ahead: Lookahead, horizon: Horizon, box: tuple[Array, Array]
    ) -> tuple[Penalised, BoolArray]:
        """The QP's plan, and which rows hold it (m,)."""
        assert self.model is not None
        given = limits(ahead, self.approach * horizon.length, box, ZERO_GRADIENT * rows.scale)
        begins = horizon.begins[horizon.begins < len(ahead.b)]
        rest = self.model.task.rest_of(ahead.plan.shape[1], ahead.b.shape[1]) if ahead.rest.size else None
        best = cost(ahead, horizon, self.model.gains(ahead.error[begins]), self.damping, rest)
        weights = row_weights(rows.labels, self.weights or {}) / rows.scale
        guess = NO_ROWS if self.plan is None else self.plan.held
        found = penalised(best, given, weights, self.solvers, guess)
        holding = found.rows[found.multipliers > PULLING * found.multipliers.max(initial=0.0)]
        held = np.zeros(len(rows.labels) + 1, dtype=np.bool_)
        held[given.of(holding)] = True
        return found, held[:-1]

    def _answer(self, rows: Rows, qdd: Array, status: Status, reason: str, remark: str = "") -> Command:
        none, remarks = np.zeros(len(rows.labels), dtype=np.bool_), filter(None, (remark, self.remark(rows.labels)))
        return Command(qdd.copy(), status, none, rows.labels, reason=reason, remark="; ".join(remarks))


def _positive(name: str, value: object) -> float:
    number = positive(value)
    if number is None:
        raise InvalidInput(f"{name} must be a positive number, not {shown(value)}")
    return number


def _count(name: str, value: object, most: int) -> int:
    """The value if it is a whole number from 1 to ``most``; raises InvalidInput otherwise."""
    if not isinstance(value, bool) and isinstance(value, Integral) and 1 <= int(value) <= most:
        return int(value)
    raise InvalidInput(f"{name} must be a whole number from 1 to {most}, not {shown(value)}")
