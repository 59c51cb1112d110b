"""Goal governor: the tracked reference moves to the goal only as far as the rows allow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from ..compiled import load
from ..compiled.workspace import zeros
from ..errors import ConfigurationError, InvalidInput, SceneError, format_value
from ..rows import Array, BoolArray, Command, Rows, Task
from .base import Controller, require_model, restart
from .compiled import COUNT, BoundLaw, CompiledLaw, Wrapped, in_usual_layout, tracking_of
from .demands import Nothing
from .laws import Pair
from .least_norm import RANK_TOLERANCE
from .ranges import Choices, Declared, Range, positive
from .resolver import Priority

#: Number of predicted accelerations; the last one lasts e^GROWTH times as long as the first.
STEPS = 40
GROWTH = 3.5
#: Predicted duration before rest, in time constants of the slowest motion of the tracking law.
TIME_CONSTANTS = 4.0
#: Distance of the reference from the goal, in units of the error, above which a remark names the
#: row that holds it.
NEAR = 1e-2


class GoalGovernor(Controller):
    """An explicit reference governor: moves only the goal of the tracking law.

    Garone and Nicotra, IEEE Transactions on Automatic Control, 2016; formulas: :doc:`/laws`. The
    dynamic safety margin d is the smallest −σ of all rows, relative to their scale. It is taken
    along the motion of the tracking law with the reference s_ref at rest, and at the end of that
    motion. The reference never makes a step after which d would be less than δ/2.

    No row is violated under three conditions: the motion is the one that the model predicts, with
    accelerations that are held longer and longer; it comes to rest at s_ref; and it starts where
    the rows are met with s_ref = s at rest. If the start is outside, s_ref stays where it is. Of
    the rows it uses σ and L_gφ, neither u⁺ nor L_fφ. The inner law may be any law, and gets the
    task with s_ref as its goal; predictions are those of tracking.

    Parameters
    ----------
    speed
        v, the greatest speed of the reference [units of the error per second].
    margin
        δ, the share of each row's scale that is kept where a motion ends at rest; half of it is
        kept on the way.
    influence
        ζ > δ, the margin by the row's scale below which rows slow the reference and repel it.
    horizon
        Duration of the predicted response before it comes to rest [s], from the next reset on; None
        for four time constants of the tracking law.
    options
        ``demand``, ``resolver`` and their options, of the inner law: see :class:`.Pair`; tracking
        if not given.
    """

    name = "goal-governor"
    ranges: ClassVar[Mapping[str, Declared]] = {
        "speed": Range(0.5, 5.0),
        "margin": Range(0.005, 0.05),
        "influence": Range(0.1, 0.5),
        "horizon": Choices((None, 2.0, 4.0, 6.0)),
    }

    model: Any
    alpha = 0.0  #: Rate of the barrier [1/s]; 0 without a barrier.
    sharpness = 0.0

    def __init__(
        self,
        *,
        speed: float = 2.0,
        margin: float = 0.01,
        influence: float = 0.3,
        horizon: float | None = None,
        **options: Any,
    ) -> None:
        self.speed = speed
        self.margin = margin
        self.influence = influence
        self.horizon = horizon
        self.law = Pair(**{"demand": "nothing", **options})
        self.ignores = self.law.ignores
        self.model = None
        self._forget()

    def __setattr__(self, name: str, value: Any) -> None:
        if name in type(self).ranges:
            if not (name == "horizon" and value is None) and positive(value) is None:
                raise InvalidInput(
                    f"{name} of {self.name} must be positive, not {format_value(value)}"
                )
            own = {**vars(self), name: value}
            if {"margin", "influence"} <= own.keys() and own["influence"] <= own["margin"]:
                raise ConfigurationError(
                    f"influence of {self.name} must be above its margin {own['margin']:g}, not "
                    f"{own['influence']:g}"
                )
        super().__setattr__(name, value)

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "governor": None}

    def __repr__(self) -> str:
        return f"{super().__repr__()[:-1]}, law={self.law!r})"

    def _forget(self) -> None:
        #: Durations (N,) of the predicted accelerations [s].
        self.periods: Array = np.empty(0)
        self.governor: Governor | None = None

    @property
    def reference(self) -> Array | None:
        """Return s_ref (k,) less the feature at the goal; None before the first command."""
        own: Any = self.governor and self.governor.own
        return (
            None
            if own is None or own.counts[load("goal_governor").GOAL] < 0
            else own.reference.copy()
        )

    @property
    def uses(self) -> tuple[str, ...]:
        """Required information: a model, and that of the inner law."""
        return (*(known for known in self.law.uses if known != "memory"), "memory", "model")

    @property
    def kernels(self) -> tuple[str, ...]:
        """See :class:`.Controller`."""
        return ("goal_governor", *self.law.kernels)

    def reset(self, period: float | None = None, model: Any = None) -> None:
        """Restart at the first sample; see :class:`.Controller`.

        Raises ConfigurationError if the goals have reference trajectories, or if tracking never
        comes to rest.
        """
        if model is not None:
            if any(goal.reference is not None for goal in model.task.goals):
                raise ConfigurationError(
                    f"{self.name} moves the reference itself: leave reach_in out of the goals"
                )
            self.model = model
        self._forget()
        restart(self.law, period) if period is not None else self.law.reset()
        if self.model is not None:
            shares = np.expm1(np.linspace(0.0, GROWTH, STEPS + 1)) / np.expm1(GROWTH)
            self.periods = self._predicted_time(self.model) * np.diff(shares)

    def _predicted_time(self, model: Any) -> float:
        if self.horizon is not None:
            return self.horizon
        Kp, Kv = model.task.gains.at(np.zeros(1))
        slowest = 0.5 * (Kv - np.sqrt(max(Kv * Kv - 4.0 * Kp, 0.0)))
        if not slowest > 0.0:
            raise ConfigurationError(
                f"without damping tracking never comes to rest: give {self.name} a horizon"
            )
        return float(TIME_CONSTANTS / slowest)

    def remark(self, labels: tuple[str, ...]) -> str:
        """Report where the reference stopped, and at which row; empty at the goal."""
        own: Any = self.governor and self.governor.own
        said = self.law.remark(labels)
        known = own is not None and own.times[load("goal_governor").KNOWN] > 0.0
        if not (known and labels) or np.linalg.norm(own.reference) < NEAR:
            return said
        row = labels[int(np.argmin(own.least))]
        left = (
            f"the governor's goal is {np.linalg.norm(own.reference):.3g} from the task's, held "
            f"by {row}"
        )
        return "; ".join(filter(None, (said, left)))

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class."""
        rows, task = in_usual_layout(rows, task) or (rows, task)
        own = self._ready(rows, task).decide(self.model, rows, task)
        return self.law.command(
            rows, Task(task.J, own.b.copy(), own.error.copy(), task.error_rate, task.rest)
        )

    def bind(self, rows: Rows, task: Task, acted: BoolArray, qdd: Array) -> BoundLaw | None:
        """See :class:`.Controller`."""
        inner = self.law.bind(rows, task, acted, qdd)
        if (
            inner is None
            or type(self).command is not Controller.command
            or type(self).solve is not GoalGovernor.solve
        ):
            return None
        governor = self._ready(rows, task)
        if not governor.own.step:
            return None
        over = governor.own._replace(law=inner.workspace.address)
        return BoundLaw(inner.resolver, Governor(over, inner.law), rows, task, acted, qdd)

    def _ready(self, rows: Rows, task: Task) -> Governor:
        """Return the governor of these rows, with the present options.

        Raises InvalidInput if there is no model of the rows, or if the task lacks its error or
        differs from the last one.
        """
        model = self.model
        k, n = task.J.shape
        if len(task.error) != len(task.b) or len(task.error_rate) != len(task.b):
            raise InvalidInput(
                f"{self.name} uses task.error and task.error_rate, which this task does not give"
            )
        require_model(self.name, rows, task, model)
        made = self.governor or Governor.of(model, self.periods, (k, n))
        if made.own.Jt.shape != (n, k):
            raise InvalidInput(f"{self.name} has remembered another task: reset() it first")
        self.governor = made
        made.own.settings[:] = self.speed, self.margin, self.influence, self.alpha, self.sharpness
        return made


class BarrierGovernor(GoalGovernor):
    """The reference governor by control barrier functions, in closed form.

    After Nakano, Garone and Notomista (arXiv:2604.04001, 2026); formulas and differences:
    :doc:`/laws`. Its predictions are those of :class:`GoalGovernor`. The barrier h is a softmin of
    the predicted margins of the rows, less δ. The reference moves to the goal as directly as ∇h
    ṡ_ref ≥ −α h allows. Where h < 0 it returns, with a speed of at most v.

    Parameters
    ----------
    alpha, sharpness
        α, the largest rate of decrease of h relative to h [1/s]; and κ: h is less than the least
        dᵢ − δ by up to log(m)/κ.
    speed, margin, horizon, options
        As of :class:`GoalGovernor`.
    """

    name = "barrier-governor"
    ignores = ("influence",)
    ranges: ClassVar[Mapping[str, Declared]] = {
        "alpha": Range(0.5, 20.0),
        "sharpness": Range(30.0, 1000.0),
    }

    def __init__(
        self,
        *,
        speed: float = 2.0,
        margin: float = 0.02,
        alpha: float = 5.0,
        sharpness: float = 200.0,
        horizon: float | None = None,
        **options: Any,
    ) -> None:
        self.alpha = alpha
        self.sharpness = sharpness
        super().__init__(
            speed=speed, margin=margin, influence=float("inf"), horizon=horizon, **options
        )


class Governor(Wrapped):
    """Compiled governor in front of a compiled law: see :mod:`.compiled.goal_governor`."""

    def __init__(self, own: Any, inner: CompiledLaw) -> None:
        kernels = load("goal_governor")
        super().__init__(
            inner, own, kernels.govern, options=np.array([RANK_TOLERANCE, kernels.ALL])
        )

    @classmethod
    def of(cls, model: Any, periods: Array, shape: tuple[int, int]) -> Governor:
        """Create a governor without an inner law.

        It is for the rows of a model and a task of shape (k, n).
        """
        step = getattr(model, "step", None)
        loop = getattr(model, "loop", None)
        k, n = shape
        both = (loop, step) if step is not None and loop is not None else ()
        known = dict(
            zip(("loop", "step"), (each.packed.workspace.address for each in both), strict=False)
        )
        known |= {
            "frozen": int(bool(both) and model.frozen),
            "tracking": tracking_of(model.task, n, k),
        }
        known |= {"K": np.array(model.K), "periods": periods}
        lengths = {"k": k, "n": n, "m": len(model.labels), "1 + 2n": 1 + 2 * n}
        own = zeros(load("goal_governor").GovernorArrays, lengths, known)
        # no reference and no response yet
        own.counts[:] = -1
        own.times[-1] = -np.inf
        return cls(own, CompiledLaw(Nothing(), Priority(), model.labels))

    def decide(self, model: Any, rows: Rows, task: Task) -> Any:
        """Move the reference and return the arrays.

        If the model is not compiled, Python predicts between the stages.
        """
        kernels = load("goal_governor")
        own = self.own
        counts = self.own.counts
        now = model.present
        if counts[kernels.GOAL] not in (-1, model.goal):
            old = model.task.goals[counts[kernels.GOAL]]
            new = model.task.goals[model.goal]
            own.reference[:] = model.task.feature.carried(
                own.reference.copy(), old, new, task.error
            )
            counts[kernels.GOAL] = model.goal
            own.times[kernels.LAST] = now.t
        if own.step:
            self._ask(kernels.ALL, rows, task)
            return own
        counts[kernels.PRESENT] = model.goal
        own.times[kernels.UNTIL] = model.until
        own.now[:] = np.concatenate(([now.t], now.q, now.qd))
        self._ask(kernels.BEGIN, rows, task)
        while counts[kernels.NEXT] >= 0:
            try:
                seen = model.at(own.times[kernels.AHEAD], own.state[0].copy(), own.state[1].copy())
                self._ask(kernels.GO_ON, seen.rows, seen.task)
            except (SceneError, InvalidInput):
                self._ask(kernels.LOST, rows, task)
        self._ask(kernels.CONCLUDE, rows, task)
        return own

    def _ask(self, stage: int, rows: Rows, task: Task) -> None:
        """Run one stage of the decision.

        Raises InvalidInput if the sizes of rows or task differ from those of the model.
        """
        follow, workspace, *arguments = self.call(rows, task)
        self.arrays.options[1] = stage
        n = len(self.own.rest)
        m = len(self.labels)
        if follow(
            workspace,
            *arguments,
            np.empty(n),
            np.empty(m, np.bool_),
            np.empty(0),
            np.zeros(1, COUNT),
        ):
            raise InvalidInput(
                f"{GoalGovernor.name} predicts other rows and another task than these"
            )
