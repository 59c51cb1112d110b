"""Planner of the predictive safety filter: its compiled law for the rows of a model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..compiled import load
from ..compiled.codes import (
    FAILED,
    FEWEST_INSTANTS,
    NEEDS_PYTHON,
    QUANTITIES,
    RANK_LOSS,
    RELAXED_ROWS,
    REST,
    SOLVED,
    STAGE,
)
from ..compiled.memory import zeros
from ..controllers.compiled import COUNT, CompiledAnswer, CompiledLaw, Wrapped, tracking_of
from ..controllers.demands import Nothing
from ..controllers.least_norm import RANK_TOLERANCE
from ..controllers.resolver import Priority, row_weights
from ..errors import SolverError
from ..rows import Array, BoolArray, Command, IntArray, Rows, Task

KERNELS = "vsconstraints.prediction.kernels"  #: Package of the compiled functions.
ABSENT = -1  #: First entry of a quantity that is not predicted.


class Plan(NamedTuple):
    """Planned q̈ of the blocks (H, n), q̈ after them (n,), and the time of planning [s]."""

    qdd: Array
    then: Array
    made: float


class PlanningLaw(Protocol):
    """Options of a law that plans, as of :class:`~vsconstraints.controllers.PredictiveControl`."""

    horizon: int
    block: int
    fading: float
    approach: float
    damping: float
    margin: float
    weights: Mapping[str, float] | None
    max_acceleration: float | None

    def remark(self, labels: tuple[str, ...]) -> str:
        """See :class:`.Controller`."""


class Planner(Wrapped):
    """The compiled law for the rows of a model, see ``kernels/predictive.py``.

    ``compiled`` is true if the model is compiled too. Otherwise Python predicts, between two calls
    of the compiled law.
    """

    answers = SOLVED, RELAXED_ROWS

    def __init__(self, law: PlanningLaw, model: Any, period: float, shape: tuple[int, int]) -> None:
        kernels = load(f"{KERNELS}.predictive")
        arrays = load(f"{KERNELS}.predictive_arrays")
        k, n = shape
        m = len(model.labels)
        H = law.horizon
        T = law.block * period
        times, block = instants(H, T, period)
        step: Any = getattr(model, "step", None)
        loop: Any = getattr(model, "loop", None)
        self.compiled = step is not None and loop is not None
        begins, out = self._layout(step if self.compiled else None, (m, n, k))
        bound = np.inf if law.max_acceleration is None else law.max_acceleration
        K = np.array(model.K, dtype=np.float64)
        weights = row_weights(model.labels, law.weights or {})
        since = times - T * block
        self.model = model
        self.shape = shape
        self._begins = begins
        lengths = load(f"{KERNELS}.plan_arrays").lengths_of(H, len(times), n, m)
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
            "most": np.minimum(bound, model.acceleration),
            "K": K,
            "weights": weights * np.ones(m),
            "at": np.array(begins),
            "out": out,
            "times": times,
            "block": block,
            "since": np.clip(since, 0.0, T),
            "made": np.full(1, np.nan),
            "by_speed": (K == 0.0).astype(np.int64),
            "p": lengths["p"],
        }
        self.plans = zeros(arrays.PlanArrays, {**lengths, "outputs": out.size}, known)
        inner = CompiledLaw(Nothing(), Priority(), model.labels)
        options = np.array([RANK_TOLERANCE, arrays.ALL])
        super().__init__(inner, self.plans, kernels.look_ahead, options=options)
        self.remark = law.remark(model.labels)
        self.measures = True

    @staticmethod
    def _layout(step: Any, sizes: tuple[int, int, int]) -> tuple[list[int], Array]:
        """Return the first entries of the parts of a prediction, and the array of one prediction.

        It is the output of the compiled ``step``, in which absent parts begin at :data:`ABSENT`. If
        Python predicts, the parts follow each other; ``sizes`` are the numbers m, n and k of rows,
        joints and features.
        """
        if step is not None:
            begins = []
            for name in QUANTITIES:
                place, _ = step.packed.parts[name]
                is_empty = place.stop == place.start
                begins.append(ABSENT if is_empty else place.start)
            return begins, step.out
        m, n, k = sizes
        # φ, σ, L_gφ, J, b, e and q̈₀, in the order of QUANTITIES
        lengths = [m, m, m * n, k * n, k, k, n]
        *ends, total = np.cumsum(lengths).tolist()
        return [0, *ends], np.empty(total)

    @property
    def plan(self) -> Plan | None:
        """The last plan; None if there is none."""
        plans = self.plans
        if np.isnan(plans.made[0]):
            return None
        return Plan(plans.plan.copy(), plans.then.copy(), float(plans.made[0]))

    def solve(self, rows: Rows, task: Task) -> Command:
        """Compute the command; ``suboptimal`` if the law brakes or continues its previous plan.

        Raises SolverError if a number leaves the range of floating point, or if the plan has no
        unique optimum.
        """
        m = len(self.labels)
        qdd = np.zeros(self.shape[1])
        acted = np.zeros(m, dtype=np.bool_)
        slack = np.zeros(m)
        code = self._make_plan(rows, task, (qdd, acted, slack, np.zeros(1, COUNT)))
        command = self.command(CompiledAnswer(code, qdd, acted, slack, 0), self.labels)
        if command is not None:
            return command
        if code == NEEDS_PYTHON:
            raise SolverError("numbers are beyond the range of floating point")
        plans = self.plans
        predicted, requested, _, outcome, was_found = plans.outcome.tolist()
        if outcome == RANK_LOSS:
            raise SolverError(
                f"the plan has no unique optimum: rounding exceeds the damping {plans.damping:g}"
            )
        short = ""
        if predicted < requested:
            short = (
                f"no more than {plans.times[predicted]:.3g} s are predicted, since a marker is "
                f"then not in front of the camera"
            )
        if outcome != FAILED:
            command = self._answer(qdd, acted, slack)
        else:
            if was_found:
                why = "the previous plan is continued: no better one passes the check"
            elif predicted >= FEWEST_INSTANTS:
                why = "braking: no plan passes the check"
            else:
                # at least FEWEST_INSTANTS are always requested, so that ``short`` is not empty
                why = f"braking: {short}"
            command = Command(qdd, "suboptimal", acted, self.labels, reason=why)
        command.remark = "; ".join(filter(None, (short, self.remark)))
        return command

    def _make_plan(self, rows: Rows, task: Task, outputs: tuple[Any, ...]) -> int:
        """Call the compiled law, which writes to the outputs, and return its code.

        If the model is not compiled, the law is called in stages, and Python predicts in between.
        """
        stages = load(f"{KERNELS}.predictive_arrays")
        solve, *arguments = self.call(rows, task)

        def run(stage: int) -> int:
            self.arrays.options[STAGE] = stage
            code: int = solve(*arguments, *outputs)
            return code

        if self.compiled:
            return run(stages.ALL)
        now = self.model.present
        self.plans.now[:] = np.concatenate(([now.t], now.q, now.qd))
        code = run(stages.PROPOSE)
        if code != SOLVED:
            return code
        if self._predict() < FEWEST_INSTANTS:
            run(stages.BRAKE)
            self._predict()
        return run(stages.CONCLUDE)

    def _predict(self) -> int:
        """Predict along the plan; return the number of instants that the model can predict."""
        arrays = load(f"{KERNELS}.predictive_arrays")
        plans = self.plans
        now = self.model.present
        requested = int(plans.outcome[arrays.ASKED])
        q, qd = plans.states[:, :requested]
        seen = self.model.along(now.t + plans.times[:requested], q, qd)
        count = len(seen)
        for name, begin in zip(QUANTITIES, self._begins, strict=True):
            values = getattr(seen, name).reshape(count, -1)
            end = begin + values.shape[1]
            plans.seen[:count, begin:end] = values
        if not seen.rest.size:
            plans.at[REST] = ABSENT
        plans.outcome[arrays.PREDICTED] = count
        return count

    def command(self, answer: CompiledAnswer, labels: tuple[str, ...]) -> Command | None:
        """See :meth:`.Resolver.command`.

        None also if the command needs a reason other than slack.
        """
        if answer.code not in self.answers:
            return None
        command = self._answer(answer.qdd, answer.acted, answer.slack)
        command.remark = self.remark
        return command

    def _answer(self, qdd: Array, acted: BoolArray, slack: Array) -> Command:
        """Return the command of a plan.

        Its reason names the rows that no plan satisfies, with their violation.
        """
        if not slack.any():
            return Command(qdd, "ok", acted, self.labels)
        amounts = ", ".join(f"{self.labels[i]} by {slack[i]:.3g}" for i in np.flatnonzero(slack))
        reason = f"no plan satisfies every row; exceeded at most, in units of the rows: {amounts}"
        return Command(qdd, "relaxed", acted, self.labels, reason=reason)


def instants(H: int, T: float, period: float) -> tuple[Array, IntArray]:
    """Return the instants (N,) [s] at which rows are predicted, and their blocks (N,).

    They are now (t = 0), the ends of the H blocks of T seconds, and the end of the first sampling
    period where no block ends. The last instant is the end of the brake after the plan; it is NaN,
    since it is not known yet.
    """
    times = T * np.arange(H + 1)
    if not np.isclose(period, T):
        times = np.sort(np.append(times, period))
    # an instant at the end of a block belongs to it, up to rounding
    block = np.maximum(np.ceil(times / T - 1e-9).astype(np.int64) - 1, 0)
    return np.append(times, np.nan), np.append(block, H)
