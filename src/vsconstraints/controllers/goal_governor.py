"""The goal governor: what is tracked is a reference that moves to the goal only as far as rows allow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from ..errors import ConfigurationError, InvalidInput, shown
from ..formulas.tracking import retargeted
from ..rows import Array, Command, Rows, Task
from .base import Controller, restart
from .laws import Pair
from .least_norm import RANK_TOLERANCE, least_norm
from .ranges import Choices, Declared, Range, positive
from .response import Response, response

SETTLING = 0.1  #: The attraction of the goal falls from where it is ``speed`` times this away [s].
#: How many accelerations are predicted; the last one lasts e^GROWTH times as long as the first.
STEPS, GROWTH = 40, 3.5
TIME_CONSTANTS = 4.0  #: Of the tracking law's slowest motion, which are predicted before it comes to rest.
NEAR = 1e-2  #: From which distance of the reference to the goal, in units of the error, a remark says what holds it.


class GoalGovernor(Controller):
    """An explicit reference governor: moves the goal of the tracking law, and nothing else.

    The reference s_ref begins where the feature is, and moves by

        ṡ_ref = v Δ(x, s_ref) ρ(s_ref, s*),   Δ = sat((d(x, s_ref) − δ) / (ζ − δ))

    (Garone and Nicotra, "Explicit reference governor for constrained nonlinear systems", IEEE Transactions on Automatic
    Control, 2016, with a dynamic safety margin d that is based on trajectories.) d is the least −σ, by the row's scale,
    of all rows along the motion that the tracking law would make with s_ref at rest, and at its end. The navigation
    field ρ is the attraction a = (s* − s_ref)/max(‖s* − s_ref‖, 0.1 s v) of the goal and, where the motion ends less
    than ζ from a row's boundary, the repulsion of that row: ρ = a − ‖a‖ Σ (ζ − dᵢ)/(ζ − δ) ∇sσᵢ/‖∇sσᵢ‖, which is as
    strong as the attraction where dᵢ = δ. No step is made after which d would be less than δ/2.

    Scalar reference governors (Gilbert and Kolmanovsky 2002) move the reference by the largest share κ of what is left
    to the goal that keeps the predicted motion admissible, explicit ones continuously, by Δ. Otherwise than in either,
    what is admissible is not a set that was proved invariant but one predicted motion and where it ends, and a step
    that is not accepted is left out whole.

    So no row is violated if the motion is the one that the model predicts, which holds its accelerations longer and
    longer, up to a tenth of what is predicted; if it comes to rest at s_ref; and if it starts where rows are met with
    s_ref = s at rest. δ is for what is wrong with that. A start that is outside holds s_ref where it is. Of rows it
    uses σ and L_gφ, no u⁺ and no L_fφ.

    What goes on underneath may be any law, which gets the task with s_ref for its goal. Predictions are those of
    tracking: a law that holds it back makes the motion another one.

    Parameters
    ----------
    speed
        v, the greatest speed of the reference [units of the error per second].
    margin
        δ, what is kept of each row's scale, by what ends at rest there and, by half of it, on the way.
    influence
        ζ > δ, from where on rows slow the reference and repel it, by the row's scale.
    horizon
        How long a response is predicted before it comes to rest [s], from the next reset on; None for four time
        constants of the tracking law.
    demand, resolver, options
        Of the law underneath, as of :class:`vsconstraints.controllers.laws.Pair`; tracking if not given.

    Attributes
    ----------
    reference
        (k,) s_ref less the feature's value at the goal; None before the first command.
    periods
        (N,) how long each of the predicted accelerations lasts [s]; empty before a model is given.
    """

    name = "goal-governor"
    ranges: ClassVar[Mapping[str, Declared]] = {
        "speed": Range(0.5, 5.0),
        "margin": Range(0.005, 0.05),
        "influence": Range(0.1, 0.5),
        "horizon": Choices((None, 2.0, 4.0, 6.0)),
    }

    model: Any
    reference: Array | None

    def __init__(
        self,
        *,
        speed: float = 2.0,
        margin: float = 0.01,
        influence: float = 0.3,
        horizon: float | None = None,
        demand: str = "nothing",
        resolver: str = "priority",
        **options: Any,
    ) -> None:
        self.speed, self.margin, self.influence, self.horizon = speed, margin, influence, horizon
        self.law = Pair(demand=demand, resolver=resolver, **options)
        self.ignores = self.law.ignores
        self.model = None
        self._forget()

    def __setattr__(self, name: str, value: Any) -> None:
        if name in type(self).ranges:
            if not (name == "horizon" and value is None) and positive(value) is None:
                raise InvalidInput(f"{name} of {self.name} must be positive, not {shown(value)}")
            own = {**vars(self), name: value}
            if {"margin", "influence"} <= own.keys() and own["influence"] <= own["margin"]:
                raise ConfigurationError(
                    f"influence of {self.name} must be above its margin {own['margin']:g}, not {own['influence']:g}"
                )
        super().__setattr__(name, value)

    def __repr__(self) -> str:
        return f"{super().__repr__()[:-1]}, law={self.law!r})"

    def _forget(self) -> None:
        self.reference = None
        self._goal, self._last = -1, np.nan
        self.periods: Array = np.empty(0)
        self.seen: Response | None = None

    @property
    def uses(self) -> tuple[str, ...]:
        """A model, and what the law underneath uses."""
        return (*(known for known in self.law.uses if known != "memory"), "memory", "model")

    def reset(self, period: float | None = None, model: Any = None) -> None:
        """Begin again at the first sample; see :class:`.Controller`.

        ConfigurationError if the goals have reference trajectories of their own, or tracking never comes to rest.
        """
        if model is not None:
            if any(goal.reference is not None for goal in model.task.goals):
                raise ConfigurationError(f"{self.name} moves the reference itself: leave reach_in out of the goals")
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
            raise ConfigurationError(f"without damping tracking never comes to rest: give {self.name} a horizon")
        return float(TIME_CONSTANTS / slowest)

    def remark(self, labels: tuple[str, ...]) -> str:
        """Where the reference stopped, and at which row."""
        said = self.law.remark(labels)
        if self.reference is None or self.seen is None or not len(labels) or np.linalg.norm(self.reference) < NEAR:
            return said
        row = labels[int(np.argmin(self.seen.least))]
        left = f"the governor's goal is {np.linalg.norm(self.reference):.3g} from the task's, held by {row}"
        return "; ".join(filter(None, (said, left)))

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class."""
        model, e = self.model, task.error
        if model is None:
            raise InvalidInput(
                f"{self.name} uses a model: tell it by reset(model=...) before the first command, or let a control "
                "step or a simulation do so"
            )
        if len(e) != len(task.b) or len(task.error_rate) != len(task.b):
            raise InvalidInput(f"{self.name} uses task.error and task.error_rate, which this task does not give")
        if rows.labels != model.labels:
            raise InvalidInput(f"{self.name} predicts the rows of its model, which are others than these")
        t = model.present.t
        if self.reference is None:
            self._see(model, e.copy(), rows.scale)
        elif model.goal != self._goal:
            goals = model.task.goals
            there = model.task.feature.carried(self.reference, goals[self._goal], goals[model.goal], e)
            self._see(model, there, rows.scale)
        else:
            self._move(model, max(t - self._last, 0.0), rows.scale)
        self._last, self._goal = t, model.goal
        assert self.reference is not None
        r, gains = self.reference, model.task.gains
        b = retargeted(task.b, e, task.error_rate, r, gains.at(e), gains.at(e - r))
        return self.law.command(rows, Task(task.J, b, e - r, task.error_rate, task.rest))

    def _see(self, model: Any, reference: Array, scale: Array) -> None:
        """Let the reference be there, whatever comes of it."""
        self.reference, self.seen = reference, response(model, reference, self.periods, scale)

    def _move(self, model: Any, period: float, scale: Array) -> None:
        """Move the reference by what one period allows, if what comes of it is acceptable."""
        r = self.reference
        assert r is not None
        step = period * self.speed_of_reference() * self.direction_of_reference(r, model, scale)
        there = response(model, r + step, self.periods, scale) if step.any() else None
        if there is not None and there.least.min(initial=np.inf) >= 0.5 * self.margin:
            self.reference, self.seen = r + step, there
        else:
            self._see(model, r, scale)

    def speed_of_reference(self) -> float:
        """V Δ."""
        least = -np.inf if self.seen is None else float(self.seen.least.min(initial=np.inf))
        return self.speed * float(np.clip((least - self.margin) / (self.influence - self.margin), 0.0, 1.0))

    def direction_of_reference(self, r: Array, model: Any, scale: Array) -> Array:
        """(k,) ρ."""
        direction: Array = -r / max(float(np.linalg.norm(r)), SETTLING * self.speed)
        if self.seen is None:
            return direction
        _, sigma, Lg, J = self.seen
        strength = float(np.linalg.norm(direction)) / (self.influence - self.margin)
        for i in np.flatnonzero((-sigma < self.influence) & (model.K > 0.0)):
            # ∇sσ: of the joints' motions that move the feature so, the least counts
            outwards = least_norm(J.T, Lg[i], RANK_TOLERANCE).qdd
            length = float(np.linalg.norm(outwards))
            if length > 0.0:
                direction = direction - strength * (self.influence + sigma[i]) * outwards / length
        return direction
