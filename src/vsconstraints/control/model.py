"""Rows and task of future states, for laws that look ahead."""

from __future__ import annotations

from contextlib import suppress
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..compiled import load
from ..errors import InvalidInput, SceneError
from ..formulas.tracking import JUST_BEFORE
from ..rows import Array
from ..vision.tracking import VisualTask
from .evaluator import Bound, CurrentState, Evaluation, Evaluator

ROWS = ("phi", "Lg", "Lf", "sigma", "sigma_dot")
TASK = ("J", "b", "error", "error_rate", "rest")


@dataclass(frozen=True, slots=True)
class Prediction:
    """Rows and task at N instants, with m rows, n joints, k features and M markers: see :class:`.Rows`, :class:`.Task`.

    Of rows phi, sigma, sigma_dot and Lf are (N, m), Lg (N, m, n); of the task J is (N, k, n), b, error and error_rate
    (N, k), rest (N, n) or (N, 0); pixels (N, M, 2) are markers from the image's centre [px].
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


class Model:
    """Rows and task at future states, as the controller believes them to be; see :meth:`.ControlStep.model`.

    Its evaluator is its own, so that the memory of the one in the loop stays as it is. Where anything moves that
    controllers do not know, everything is predicted at the present time. J̇_s q̇ and ṡ are exact. ``estimate`` and
    ``gradient_error`` are what the controller believes of a state, and of its rows, where that is not what the scene
    says.

    It has the ``labels`` of the m rows, their ``K`` (m,) [s], 0 of rows on φ itself; the limit ``acceleration`` (n,) of
    |q̈| that the controller knows [rad/s² or m/s²], infinite where there is none; the visual ``task``; and the compiled
    ``step`` that predicts, None where anything runs in NumPy.
    """

    def __init__(self, of: Evaluator, estimate: Any = None, gradient_error: Any = None) -> None:
        self.task: VisualTask = copy(of.visual_task)
        self.task.drift = self.task.velocity = self.task.reference = "exact"
        self._of, self._estimate, self._gradient_error = of, estimate, gradient_error
        self._own = Evaluator(of.scene, of.constraints, self.task, known=of.known)
        self.K, self.acceleration, self.labels = of.constraints.approach_time, of.acceleration, of.constraints.labels
        self.step = self._own.bound()
        if estimate is not None:
            estimate.write(self._own.packed.step)
        if gradient_error is not None and self.step is not None:
            gradient_error.write(self.step.packed.step)

    def __getstate__(self) -> dict[str, Any]:
        return {"of": self._of, "estimate": self._estimate, "gradient_error": self._gradient_error}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(**state)  # type: ignore[misc]

    @property
    def present(self) -> CurrentState:
        """The state at which rows and task in the loop were evaluated last."""
        return self._of.present

    @property
    def goal(self) -> int:
        """Index of the goal at the present time."""
        return self._of.visual_task.goal_at(self.present.t)

    @property
    def until(self) -> float:
        """Up to which time [s] the current goal holds and what moves is known; the present where it is not."""
        if self._of.believes:
            return self.present.t
        following = self.task.goals[self.goal + 1 :]
        return following[0].from_time - JUST_BEFORE if following else np.inf

    @property
    def loop(self) -> Bound | None:
        """The compiled step in the loop; None where anything runs in NumPy."""
        return self._of.bound()

    @property
    def frozen(self) -> bool:
        """Whether everything is predicted at the present time."""
        return self._of.believes

    def at(self, t: float, q: Array, qd: Array) -> Evaluation:
        """Rows, task and pixels at time ``t`` [s], ``q`` and ``qd`` (n,), from the sample in the loop on.

        Raises SceneError if a marker is not in front of the camera there, InvalidInput if a number is not finite.
        """
        self._own.remember(self._of)
        return self._evaluated(t, q, qd)

    def along(self, t: Array, q: Array, qd: Array) -> Prediction:
        """Rows, task and pixels at consecutive states: (N,) times t [s], (N, n) coordinates and speeds.

        A state with a marker that is not in front of the camera, or with a number that is not finite, ends the
        prediction, which then is shorter.
        """
        self._own.remember(self._of)
        packed = self._own.packed
        t = np.full(len(t), self.present.t) if self._of.believes else np.ascontiguousarray(t, dtype=np.float64)
        q, qd = (np.ascontiguousarray(each, dtype=np.float64) for each in (q, qd))
        out, N = np.empty((len(t), packed.out.size)), 0
        if self.step is not None:
            N = load("from_state").predict(packed.workspace, t, q, qd, packed.out, out)
        else:
            with suppress(SceneError, InvalidInput):
                for N, state in enumerate(zip(t.tolist(), q, qd, strict=True)):
                    out[N] = self._evaluated(*state).out
                N = len(t)
        parts = (packed.parts[name] for name in (*ROWS, *TASK, "pixels"))
        return Prediction(*(out[:N, where].reshape(N, *shape) for where, shape in parts))

    def _evaluated(self, t: float, q: Array, qd: Array) -> Evaluation:
        step = self._own.evaluate(self.present.t if self._of.believes else t, q, qd)
        if self.step is None and self._gradient_error is not None:
            rows = self._gradient_error(step.rows, qd)
            for name in ("phi", "Lg", "Lf"):
                step.part(name)[:] = getattr(rows, name)
        return step
