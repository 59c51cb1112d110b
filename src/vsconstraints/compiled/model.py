"""What a law may ask for beside rows and task of now: rows and task of states that are still to come."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from ..errors import InvalidInput, SceneError
from ..formulas.tracking import gains
from ..rows import Array, Rows
from ..vision.scene import State
from . import load
from .evaluation import DefinedEvaluation, Evaluation

if TYPE_CHECKING:
    from ..vision.tracking import VisualTask
    from .control_step import ControlStep
    from .evaluation import Bound
    from .structures import Step

StateEstimator = Callable[[State], State]
"""From a state to what a controller would estimate it to be; compiled, if it is :class:`Compiled`."""

GradientErrorModel = Callable[[Rows, Array], Rows]
"""From rows and q̇ (n,) to those that a controller would be given; compiled likewise."""


@runtime_checkable
class Compiled(Protocol):
    """What a compiled step can do as well."""

    def write(self, step: Step) -> None:
        """Let a compiled step do the same."""


class CurrentState(NamedTuple):
    """The time [s], q and q̇ (n,) that rows and task were made of last."""

    t: float
    q: Array
    qd: Array


@dataclass(frozen=True, slots=True)
class Prediction:
    """Rows and task at N instants, with m rows, n joints, k features and M markers: see :class:`.Rows`, :class:`.Task`.

    Attributes
    ----------
    phi, sigma, sigma_dot, Lf
        (N, m).
    Lg
        (N, m, n).
    J, b, error, error_rate, rest
        (N, k, n), (N, k), and (N, n) or (N, 0).
    pixels
        (N, M, 2) markers from the image's centre [px].
    """

    phi: Array
    Lg: Array
    Lf: Array
    sigma: Array
    sigma_dot: Array
    J: Array
    b: Array
    error: Array
    error_rate: Array
    rest: Array
    pixels: Array

    def __len__(self) -> int:
        return len(self.phi)


JUST_BEFORE = 1e-6
"""How long before the next goal [s] the goal of now ends."""

ROWS = ("phi", "Lg", "Lf", "sigma", "sigma_dot")
TASK = ("J", "b", "error", "error_rate", "rest")


class Model:
    """Rows and task at states that are still to come, as the control believes them to be; made by a control step.

    It computes on a step of its own, so that the memory of the one in the loop stays as it is. What it does not know
    stands still: where anything moves that controllers are not told of, everything is predicted at the present time.
    J̇_s q̇ and ṡ are exact, also where the loop takes them from differences between samples.

    Parameters
    ----------
    of
        The control step in the loop.
    estimate, gradient_error
        What the control believes of a state, and what becomes of its rows, where that is not what the scene says.

    Attributes
    ----------
    K
        (m,) of the rows [s], 0 of rows on φ itself.
    acceleration
        (n,) limit of |q̈| that the control knows of [rad/s² or m/s²], infinite where there is none.
    step
        The compiled step that predicts; None where anything runs in NumPy.
    """

    def __init__(
        self, of: ControlStep, estimate: StateEstimator | None = None, gradient_error: GradientErrorModel | None = None
    ) -> None:
        task = copy(of.visual_task)
        task.drift = task.velocity = task.reference = "exact"
        self._of, self._estimate, self._gradient_error = of, estimate, gradient_error
        self._own = type(of)(of.scene, of.constraints, task, known=of.known)
        self.K, self.acceleration = of.constraints.approach_time, of.acceleration
        self._kernels = load("predictions")
        wrong: list[object] = [part for part in (estimate, gradient_error) if part is not None]
        write = [part.write for part in wrong if isinstance(part, Compiled)]
        self.step = self._own.bound() if self._kernels is not None and len(write) == len(wrong) else None
        if self.step is not None:
            for each in write:
                each(self.step.packed.step)

    def __getstate__(self) -> dict[str, Any]:
        """What it is made of; the compiled form is made again where it is needed."""
        return {"of": self._of, "estimate": self._estimate, "gradient_error": self._gradient_error}

    def __setstate__(self, made: dict[str, Any]) -> None:
        self.__init__(**made)  # type: ignore[misc]

    @property
    def present(self) -> CurrentState:
        """What the rows and the task in the loop were made of last."""
        return self._of.present

    @property
    def goal(self) -> int:
        """Index of the goal that holds at the present time."""
        return self._of.visual_task.goal_at(self.present.t)

    @property
    def task(self) -> VisualTask:
        """The visual task: its feature, goals and gains."""
        return self._own.visual_task

    @property
    def until(self) -> float:
        """Up to which time [s] the goal of now holds and what moves is known; the present where it is not."""
        if self._of.believes:
            return self.present.t
        following = self.task.goals[self.goal + 1 :]
        return following[0].from_time - JUST_BEFORE if following else np.inf

    def compiled(self) -> Bound | None:
        """The step that predicts, as it goes on from the sample in the loop; None where anything runs in NumPy."""
        self._own.remember(self._of)
        return self.step

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the m rows."""
        return self._of.constraints.labels

    def at(self, t: float, q: Array, qd: Array) -> Evaluation:
        """Rows, task and pixels at time ``t`` [s], ``q`` and ``qd`` (n,), from the sample in the loop on.

        Raises
        ------
        SceneError
            if a marker is not in front of the camera there.
        InvalidInput
            if t is not finite, or q or qd are not (n,) finite numbers.
        """
        self._own.remember(self._of)
        return self._evaluated(t, q, qd)

    def along(self, t: Array, q: Array, qd: Array) -> Prediction:
        """Rows, task and pixels at states one after the other, up to the first that cannot be evaluated.

        Parameters
        ----------
        t, q, qd
            (N,) times [s], (N, n) coordinates and speeds. A state with a marker that is not in front of the camera, or
            with a number that is not finite, ends the prediction, which then is shorter.
        """
        self._own.remember(self._of)
        step = self.step
        if step is None:
            return self._one_by_one(t, q, qd)
        packed = step.packed
        t = np.full(len(t), self.present.t) if self._of.believes else np.ascontiguousarray(t, dtype=np.float64)
        q, qd = (np.ascontiguousarray(each, dtype=np.float64) for each in (q, qd))
        out = np.empty((len(t), step.out.size))
        N = self._kernels.predict(packed.address, t, q, qd, step.out, out)

        def part(name: str) -> Array:
            where, shape = packed.parts[name]
            return out[:N, where].reshape(N, *shape)

        return Prediction(*(part(name) for name in (*ROWS, *TASK, "pixels")))

    def gains(self, error: Array) -> Array:
        """(N, 2) K_p and K_v of the tracking law at errors (N, k)."""
        own = self._own.visual_task.gains
        squared = (error * error).sum(axis=1).tolist()
        return np.array([gains(each, own.Kp0, own.Kp_slope, own.damping) for each in squared]).reshape(-1, 2)

    def _evaluated(self, t: float, q: Array, qd: Array) -> Evaluation:
        own = self._own
        if self._of.believes:
            t = self.present.t
        if self.step is not None:
            return own.evaluate(t, q, qd)
        if self._estimate is not None:
            found: Evaluation = own.define(self._estimate(own.scene.evaluate(t, q, qd)))
        else:
            found = own.evaluate(t, q, qd)
        if self._gradient_error is None:
            return found
        seen = found.error, found.sigma, found.pixels, found.points, found.camera_R, found.camera_t
        return DefinedEvaluation(self._gradient_error(found.rows, qd), found.task, *seen)

    def _one_by_one(self, t: Array, q: Array, qd: Array) -> Prediction:
        found: list[tuple[Array, ...]] = []
        for each in zip(t.tolist(), q, qd, strict=True):
            try:
                step = self._evaluated(*each)
            except (SceneError, InvalidInput):
                break
            rows, task = step.rows, step.task
            found.append(
                (*(getattr(rows, name) for name in ROWS), *(getattr(task, name) for name in TASK), step.pixels)
            )
        if found:
            return Prediction(*(np.array(parts) for parts in zip(*found, strict=True)))
        m, n, M = len(self.labels), q.shape[1], len(self._own.scene.markers)
        none: Array = np.empty((0, 0))
        each_row: Array = np.empty((0, m))
        return Prediction(
            each_row, np.empty((0, m, n)), *(each_row,) * 3, np.empty((0, 0, n)), *(none,) * 4, np.empty((0, M, 2))
        )
