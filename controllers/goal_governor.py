"""Reference governors: the tracked reference moves to the goal only as far as the rows allow.

Two laws share the prediction of this file: ``goal_governor.py:GoalGovernor`` and
``goal_governor.py:BarrierGovernor``. For formulas, sources and results see ``docs/laws.md``.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np

from vsconstraints.controllers import Choices, Controller, Pair, Range, Tracking
from vsconstraints.controllers.base import require_model, restart
from vsconstraints.controllers.ranges import Declared, positive
from vsconstraints.errors import ConfigurationError, InvalidInput, SceneError, format_value
from vsconstraints.rows import Array, Command, IntArray, Rows, Task

#: Number of predicted accelerations; the last one lasts e^GROWTH times as long as the first.
STEPS = 40
GROWTH = 3.5
#: Predicted duration before rest, in time constants of the slowest motion of the tracking law.
TIME_CONSTANTS = 4.0
#: Newton steps from the end of a predicted motion to its state of rest.
NEWTON_STEPS = 2
#: Distance of the reference from the goal, in units of the error, above which a remark names the
#: row that holds it.
NEAR_GOAL = 1e-2
#: The attraction of the goal decreases where the reference is within the speed times this of it
#: [s].
SETTLING_TIME = 0.1
#: Weight in the softmin, relative to the nearest row's, below which a row's gradient is omitted.
NEGLIGIBLE_WEIGHT = 1e-6


def retargeted(b: Array, error: Array, rate: Array, reference: Array, now: Any, then: Any) -> Array:
    """Return b (k,) of the task for a reference s_ref (k,) that stands still.

    It is computed from ``b`` for the goal itself. Error and reference are given relative to the
    feature's value at the goal. ``now`` and ``then`` are K_p and K_v for the two errors.
    """
    Kp_now, Kv_now = now
    Kp_then, Kv_then = then
    untracked = b + Kp_now * error + Kv_now * rate
    moved: Array = untracked - Kp_then * (error - reference) - Kv_then * rate
    return moved


def held_gains(Kp: float, Kv: float, h: float) -> tuple[float, float]:
    """Return K_p and K_v for q̈ held for h [s], by the implicit midpoint rule.

    The error does not grow, however long h is.
    """
    damping = Kv + 0.5 * h * Kp
    lag = 1.0 + 0.5 * h * damping
    return Kp / lag, damping / lag


def held_rest(rest: Array, qd: Array, damping: float, stiffness: float, h: float) -> Array:
    """Return the rest acceleration q̈₀ (n,) held for h [s], by the implicit midpoint rule.

    ``rest`` is that of :func:`vsconstraints.formulas.tracking.resting`, at q̇ (n,).
    """
    lag = 1.0 + 0.5 * h * (damping + 0.5 * h * stiffness)
    held: Array = (rest - 0.5 * h * stiffness * qd) / lag
    return held


@cache
def no_rows(n: int) -> Rows:
    """Return rows of n joints that limit nothing."""
    return Rows.none(n)


@dataclass
class Response:
    """Predicted motion of the tracking law towards a reference at rest.

    Margins and values of σ are divided by the scale of their row.
    """

    margins: Array  #: (m,) least −σ of each row on the way and at rest: d_i.
    sigma: Array  #: (m,) σ at rest.
    Lg: Array  #: (m, n) L_gφ at rest.
    J: Array  #: (k, n) Jacobian of the task at rest.
    #: For a barrier: Jᵀ (∂σ_i/∂s_ref)ᵀ (m, n) and J (m, k, n) at the state where row i is nearest.
    slopes: Array
    nearest_J: Array

    @classmethod
    def unknown(cls, m: int, n: int, k: int) -> Response:
        """Return arrays for m rows, n joints and k features, with infinite margins."""
        return cls(
            np.full(m, np.inf),
            np.zeros(m),
            np.zeros((m, n)),
            np.zeros((k, n)),
            np.zeros((m, n)),
            np.zeros((m, k, n)),
        )

    @property
    def least_margin(self) -> float:
        """The dynamic safety margin d; infinite without rows."""
        return float(self.margins.min(initial=np.inf))


@dataclass
class Motion:
    """Predicted state: time [s], q and q̇ (n,), and the response of the feature to a unit step."""

    t: float
    q: Array
    qd: Array
    feature: float = 0.0  #: S = ∂s/∂s_ref.
    feature_rate: float = 0.0  #: Ṡ [1/s].


class ReferenceGovernor(Controller):
    """Base of the governors: predicts the response to a reference, and moves the reference.

    References are relative to the feature's value at the goal, so that the goal is zero. The inner
    law gets the task with the reference as its goal; predictions are those of tracking.
    """

    ranges: ClassVar[Mapping[str, Declared]] = {
        "speed": Range(0.5, 5.0),
        "margin": Range(0.005, 0.05),
        "horizon": Choices((None, 2.0, 4.0, 6.0)),
    }

    def __init__(
        self, *, speed: float, margin: float, horizon: float | None = None, **options: Any
    ) -> None:
        self.speed = speed
        self.margin = margin
        self.horizon = horizon
        self.law = Pair(**{"demand": "nothing", **options})
        self.ignores = self.law.ignores
        self.model: Any = None
        self._tracking = Tracking()
        self._forget()

    def __setattr__(self, name: str, value: Any) -> None:
        if name in type(self).ranges:
            self._require_valid(name, value)
        super().__setattr__(name, value)

    def _require_valid(self, name: str, value: Any) -> None:
        """Raise InvalidInput or ConfigurationError if this is no value of an option."""
        may_be_none = name == "horizon"
        if positive(value) is None and not (may_be_none and value is None):
            raise InvalidInput(f"{name} of {self.name} must be positive, not {format_value(value)}")

    def __repr__(self) -> str:
        return f"{super().__repr__()[:-1]}, law={self.law!r})"

    def _forget(self) -> None:
        #: (N,) durations of the predicted accelerations [s].
        self.periods: Array = np.empty(0)
        #: Response to the reference; None before the first sample, and if the model cannot
        #: predict it.
        self.response: Response | None = None
        #: True if the last sample moved the reference.
        self.moved = False
        self._reference: Array | None = None
        self._goal = -1
        self._last_time = 0.0

    @property
    def reference(self) -> Array | None:
        """Return s_ref (k,) less the feature at the goal; None before the first command."""
        return None if self._reference is None else self._reference.copy()

    @property
    def uses(self) -> tuple[str, ...]:
        """Required information: a model, and that of the inner law."""
        return (*(name for name in self.law.uses if name != "memory"), "memory", "model")

    @property
    def kernels(self) -> tuple[str, ...]:
        """See :class:`vsconstraints.controllers.Controller`."""
        return self.law.kernels

    def reset(self, period: float | None = None, model: Any = None) -> None:
        """Restart at the first sample.

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
        if period is None:
            self.law.reset()
        else:
            restart(self.law, period)
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
        remarks = [self.law.remark(labels)]
        if self._reference is not None and self.response is not None and labels:
            distance = float(np.linalg.norm(self._reference))
            if distance >= NEAR_GOAL:
                row = labels[int(np.argmin(self.response.margins))]
                remarks.append(
                    f"the governor's goal is {distance:.3g} from the task's, held by {row}"
                )
        return "; ".join(filter(None, remarks))

    def solve(self, rows: Rows, task: Task) -> Command:
        """Move the reference, and compute the command of the inner law for it."""
        if len(task.error) != len(task.b) or len(task.error_rate) != len(task.b):
            raise InvalidInput(
                f"{self.name} uses task.error and task.error_rate, which this task does not give"
            )
        require_model(self.name, rows, task, self.model)
        if self._reference is not None and len(self._reference) != len(task.error):
            raise InvalidInput(f"{self.name} has remembered another task: reset() it first")
        self._move(task)
        assert self._reference is not None
        error, b, _ = self._retarget(task, self._reference, 0.0)
        return self.law.command(rows, Task(task.J, b, error, task.error_rate, task.rest))

    def _move(self, task: Task) -> None:
        """Move the reference by one sample, unless its motion would come too near to a row."""
        model = self.model
        now = model.present
        if self._reference is None:
            reference = task.error.copy()
            elapsed = 0.0
        elif self._goal != model.goal:
            old, new = model.task.goals[self._goal], model.task.goals[model.goal]
            reference = model.task.feature.carried(self._reference.copy(), old, new, task.error)
            elapsed = 0.0
        else:
            reference = self._reference
            elapsed = max(now.t - self._last_time, 0.0)
        candidate = reference
        if self.response is not None:
            candidate = self.candidate(reference, self.response, elapsed)
        self.moved = bool((candidate != reference).any())
        response = None
        if self.moved:
            response = self.predict(candidate, 0.5 * self.margin)
            self.moved = response is not None
        if response is None:
            candidate = reference
            response = self.predict(reference)
        self.response = response
        self._reference = candidate.copy()
        self._goal = model.goal
        self._last_time = now.t

    @abstractmethod
    def candidate(self, reference: Array, response: Response, period: float) -> Array:
        """Return the reference after a period [s], of the response to the present reference."""

    def _attraction(self, reference: Array) -> Array:
        """Return a = (s* − s_ref) / max(‖s* − s_ref‖, v · SETTLING_TIME)."""
        distance = float(np.linalg.norm(reference))
        return -reference / max(distance, SETTLING_TIME * self.speed)

    def predict(self, reference: Array, least_margin: float = -np.inf) -> Response | None:
        """Predict the response to a reference (k,) from the present state.

        None if the model cannot predict it, or as soon as a margin is below ``least_margin``.
        Raises InvalidInput if the task of the model has another number of features.
        """
        model = self.model
        motion = Motion(*model.present)
        m, n, k = len(model.labels), len(motion.q), len(reference)
        response = Response.unknown(m, n, k)
        N = len(self.periods)
        at_rest = N + NEWTON_STEPS
        for step in range(at_rest + 1):
            try:
                state = model.at(motion.t, motion.q, motion.qd)
            except (SceneError, InvalidInput):
                return None
            rows = state.rows
            task = state.task
            if len(task.b) != k:
                raise InvalidInput(f"{self.name} predicts other rows and another task than these")
            # the present state and those between Newton steps do not belong to the motion
            if 0 < step <= N or step == at_rest:
                if not np.isfinite(rows.sigma).all():
                    return None
                response.sigma[:] = rows.sigma / rows.scale
                nearer = np.flatnonzero(-response.sigma < response.margins)
                response.margins[nearer] = -response.sigma[nearer]
                self._note_slopes(response, nearer, rows, task, motion)
                if response.least_margin < least_margin:
                    return None
            try:
                if step < N:
                    self._track(motion, task, reference, self.periods[step])
                elif step < at_rest:
                    self._approach_rest(motion, task, reference)
            except (InvalidInput, np.linalg.LinAlgError):  # a number is not finite
                return None
        response.Lg[:] = rows.Lg
        response.J[:] = task.J
        return response

    def _track(self, motion: Motion, task: Task, reference: Array, period: float) -> None:
        """Continue the motion by tracking with constant q̈ for about a period [s]."""
        _, b, (Kp, Kv, held) = self._retarget(task, reference, period)
        q0 = task.rest
        if len(q0):
            rest = self.model.task.rest_of(len(motion.q), len(reference))
            q0 = held_rest(q0, motion.qd, rest.damping, rest.stiffness, held)
        qdd = self._least_norm(Task(task.J, b, rest=q0))
        motion.q = motion.q + held * (motion.qd + 0.5 * held * qdd)
        motion.qd = motion.qd + held * qdd
        motion.t = min(motion.t + held, self.model.until)
        acceleration = Kp * (1.0 - motion.feature) - Kv * motion.feature_rate
        motion.feature += held * (motion.feature_rate + 0.5 * held * acceleration)
        motion.feature_rate += held * acceleration

    def _approach_rest(self, motion: Motion, task: Task, reference: Array) -> None:
        """Make a Newton step to the state of rest at the reference."""
        motion.q = motion.q + self._least_norm(Task(task.J, reference - task.error))
        motion.qd = np.zeros(len(motion.q))
        motion.feature = 1.0
        motion.feature_rate = 0.0

    def _note_slopes(
        self, response: Response, nearer: IntArray, rows: Rows, task: Task, motion: Motion
    ) -> None:
        """Note the gradients of the rows that are ``nearer`` than before, if the law uses them."""

    def _retarget(
        self, task: Task, reference: Array, period: float
    ) -> tuple[Array, Array, tuple[float, float, float]]:
        """Return error and b of the task whose goal is at the reference, with its gains.

        The gains are K_p, K_v and the period [s] for which they are held.
        """
        gains = self.model.task.gains
        error = task.error - reference
        Kp, Kv = gains.at(error)
        period = self._held(period, Kp)
        held = held_gains(Kp, Kv, period)
        b = retargeted(task.b, task.error, task.error_rate, reference, gains.at(task.error), held)
        return error, b, (*held, period)

    def _held(self, period: float, Kp: float) -> float:
        """Return how long a predicted acceleration is held [s], with K_p at the present error."""
        return period

    def _least_norm(self, task: Task) -> Array:
        """Return the q̈ of tracking (n,): the least-norm solution of J q̈ = b.

        Raises InvalidInput or LinAlgError if a number is not finite.
        """
        command = self._tracking.command(no_rows(task.J.shape[1]), task)
        if command.status == "failed":
            raise np.linalg.LinAlgError(command.reason)
        return command.qdd

    def _gradient(self, J: Array, slope: Array) -> Array:
        """Return ∇_s (k,) of the least joint motion: the solution of Jᵀ ∇_s = slope (n,)."""
        return self._least_norm(Task(J.T, slope))


class GoalGovernor(ReferenceGovernor):
    """An explicit reference governor: moves only the goal of the tracking law.

    Garone and Nicotra, IEEE Transactions on Automatic Control, 2016. The dynamic safety margin d is
    the smallest −σ of all rows, relative to their scale. It is taken along the motion of the
    tracking law with the reference s_ref at rest, and at the end of that motion. The reference
    never makes a step after which d would be less than δ/2.

    No row is violated under three conditions: the motion is the one that the model predicts, with
    accelerations that are held longer and longer; it comes to rest at s_ref; and it starts where
    the rows are met with s_ref = s at rest. If the start is outside, s_ref stays where it is. Of
    the rows it uses σ and L_gφ, neither u⁺ nor L_fφ. The inner law may be any law.

    Parameters
    ----------
    speed
        v: greatest speed of the reference [units of the error per second].
    margin
        δ: safety margin at the end of a predicted motion, as a fraction of each row's scale; half
        of it applies during the motion.
    influence
        ζ > δ: margin below which rows slow and repel the reference, as a fraction of their scale.
    horizon
        Duration of the predicted response before it comes to rest [s], from the next reset on; None
        for four time constants of the tracking law.
    options
        ``demand``, ``resolver`` and their options, of the inner law: see
        :class:`vsconstraints.controllers.Pair`; tracking by default.
    """

    name = "goal-governor"
    ranges: ClassVar[Mapping[str, Declared]] = {"influence": Range(0.1, 0.5)}

    def __init__(
        self,
        *,
        speed: float = 2.0,
        margin: float = 0.01,
        influence: float = 0.3,
        horizon: float | None = None,
        **options: Any,
    ) -> None:
        self.influence = influence
        super().__init__(speed=speed, margin=margin, horizon=horizon, **options)

    def _require_valid(self, name: str, value: Any) -> None:
        super()._require_valid(name, value)
        options = {**vars(self), name: value}
        influence = options.get("influence", np.inf)
        margin = options.get("margin", 0.0)
        if influence <= margin:
            raise ConfigurationError(
                f"influence of {self.name} must be above its margin {margin:g}, not {influence:g}"
            )

    def candidate(self, reference: Array, response: Response, period: float) -> Array:
        """Return s_ref + T v Δ ρ, with Δ and ρ of the explicit reference governor."""
        width = self.influence - self.margin
        share = min(max((response.least_margin - self.margin) / width, 0.0), 1.0)
        step = period * self.speed * share
        if not step > 0.0:
            return reference
        attraction = self._attraction(reference)
        moved = reference + step * attraction
        strength = step * float(np.linalg.norm(attraction)) / width
        repels = (-response.sigma < self.influence) & (np.asarray(self.model.K) > 0.0)
        for row in np.flatnonzero(repels):
            outwards = self._gradient(response.J, response.Lg[row])
            length = float(np.linalg.norm(outwards))
            if length > 0.0:
                depth = self.influence + response.sigma[row]
                moved -= strength * depth / length * outwards
        return moved


class BarrierGovernor(ReferenceGovernor):
    """The reference governor by control barrier functions, in closed form.

    After Nakano, Garone and Notomista (arXiv:2604.04001, 2026). Its predictions are those of
    :class:`GoalGovernor`. The barrier h is a softmin of the predicted margins of the rows, less δ.
    The reference moves to the goal as directly as ∇h ṡ_ref ≥ −α h allows. Where h < 0 it returns,
    with a speed of at most v.

    Parameters
    ----------
    alpha, sharpness
        α: largest relative rate of decrease of h [1/s]. κ: sharpness of the smooth minimum h, which
        is less than the smallest dᵢ − δ by up to log(m)/κ for m rows.
    speed, margin, horizon, options
        As of :class:`GoalGovernor`.
    """

    name = "barrier-governor"
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
        super().__init__(speed=speed, margin=margin, horizon=horizon, **options)

    def candidate(self, reference: Array, response: Response, period: float) -> Array:
        """Return s_ref + T ṡ_ref, with the least change of v a that ∇h ṡ_ref ≥ −α h requires."""
        if not period > 0.0:
            return reference
        moved: Array = reference + period * self.speed * self._attraction(reference)
        h, gradient = self.barrier(response)
        squared = float(gradient @ gradient)
        if squared > 0.0:
            lacking = -self.alpha * h * period - float(gradient @ (moved - reference))
            moved += max(lacking, 0.0) / squared * gradient
            length = float(np.linalg.norm(moved - reference))
            if length > period * self.speed:
                moved = reference + (moved - reference) * period * self.speed / length
        return moved

    def barrier(self, response: Response) -> tuple[float, Array]:
        """Return h = −1/κ log Σ e^(−κ dᵢ) − δ of a response, and ∇h (k,)."""
        gradient = np.zeros(len(response.J))
        if not len(response.margins):
            return np.inf, gradient
        least = response.least_margin
        weights = np.exp(-self.sharpness * (response.margins - least))
        for row in np.flatnonzero(weights > NEGLIGIBLE_WEIGHT):
            slope = self._gradient(response.nearest_J[row], response.slopes[row])
            gradient -= weights[row] * slope
        total = float(weights.sum())
        h = least - self.margin - float(np.log(total)) / self.sharpness
        return h, gradient / total

    def _note_slopes(
        self, response: Response, nearer: IntArray, rows: Rows, task: Task, motion: Motion
    ) -> None:
        """See the base class.

        The feature moves by S with the reference, so that Jᵀ (∂σ/∂s_ref)ᵀ = S L_gφ/K, since L_gφ =
        K ∂σ/∂q. For a row on φ itself, as of a speed, it is Ṡ L_gφ.
        """
        K = np.asarray(self.model.K)[nearer]
        share = np.full(len(nearer), motion.feature_rate)
        np.divide(motion.feature, K, out=share, where=K > 0.0)
        response.slopes[nearer] = (share / rows.scale[nearer])[:, None] * rows.Lg[nearer]
        response.nearest_J[nearer] = task.J

    def _held(self, period: float, Kp: float) -> float:
        """Return a longer time where the reference is far away, since it is tracked more slowly."""
        return period * float(np.sqrt(self.model.task.gains.Kp0 / Kp))
