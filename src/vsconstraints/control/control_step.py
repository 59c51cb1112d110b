"""The control step with a controller: from the state of the joints to a command; rows and task of
future states.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..compiled import load
from ..errors import InvalidInput, SceneError
from ..formulas.tracking import JUST_BEFORE
from ..robots.geometry import Pose
from ..rows import Array, Command
from ..vision.camera import Camera
from ..vision.tracking import VisualTask
from .evaluator import Bound, CurrentState, Evaluation, Evaluator
from .gradients import demand_gradients, own_constraints

if TYPE_CHECKING:
    from ..controllers.base import Controller

ROWS = ("phi", "Lg", "Lf", "sigma", "sigma_dot")
TASK = ("J", "b", "error", "error_rate", "rest")
FLOAT = np.dtype(np.float64)

#: From time [s], q and q̇ (n,), and ``pixels``, ``depth``, ``taken`` and ``camera`` if measured, to
#: a command.
StateToCommand = Callable[..., tuple[Evaluation, Command]]


@dataclass(frozen=True, slots=True)
class Prediction:
    """Rows and task at N instants, with m rows, n joints, k features and M markers: see
    :class:`.Rows`, :class:`.Task`.

    Of rows phi, sigma, sigma_dot and Lf are (N, m), Lg (N, m, n); of the task J is (N, k, n), b,
    error and error_rate (N, k), rest (N, n) or (N, 0); pixels (N, M, 2) are markers from the
    image's centre [px].
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
    """Rows and task at future states, as the controller believes them to be; see
    :meth:`.ControlStep.model`.

    Its evaluator is its own, so that the memory of the one in the loop stays as it is. Where
    anything moves that controllers do not know, everything is predicted at the present time. J̇_s
    q̇ and ṡ are exact. ``estimate`` and ``gradient_error`` are what the controller believes of a
    state, and of its rows, where that is not what the scene says.

    It has the ``labels`` of the m rows, their ``K`` (m,) [s], 0 of rows on φ itself; the limit
    ``acceleration`` (n,) of
    |q̈| that the controller knows [rad/s² or m/s²], infinite where there is none; the robot's ``ranges``; the visual
    ``task``; and the compiled ``step`` that predicts, None where anything runs in NumPy.
    """

    def __init__(self, of: Evaluator, estimate: Any = None, gradient_error: Any = None) -> None:
        self.task: VisualTask = copy(of.visual_task)
        self.task.drift = self.task.velocity = self.task.reference = "exact"
        self._of = of
        self._estimate = estimate
        self._gradient_error = gradient_error
        self._own = Evaluator(of.scene, of.constraints, self.task, known=of.known)
        self.K = of.constraints.approach_time
        self.acceleration = of.acceleration
        self.labels = of.constraints.labels
        self.ranges = of.scene.robot.ranges
        self.step = self._own.bound()
        if estimate is not None:
            estimate.write(self._own.packed.step)
        if gradient_error is not None and self.step is not None:
            gradient_error.write(self.step.packed.step)

    def __getstate__(self) -> dict[str, Any]:
        return {"of": self._of, "estimate": self._estimate, "gradient_error": self._gradient_error}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(**state)  # type: ignore[misc]

    def ahead(self) -> Model:
        """A model of what follows the state at which this one was evaluated last."""
        model = Model(self._own, self._estimate, self._gradient_error)
        model.acceleration = self.acceleration
        return model

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
        """Up to which time [s] the current goal holds and what moves is known; the present where it
        is not.
        """
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
        """Rows, task and pixels at time ``t`` [s], ``q`` and ``qd`` (n,), from the sample in the
        loop on.

        Raises SceneError if a marker is not in front of the camera there, InvalidInput if a number
        is not finite.
        """
        self._own.remember(self._of)
        return self._evaluated(t, q, qd)

    def along(self, t: Array, q: Array, qd: Array) -> Prediction:
        """Rows, task and pixels at consecutive states: (N,) times t [s], (N, n) coordinates and
        speeds.

        A state with a marker that is not in front of the camera, or with a number that is not
        finite, ends the prediction, which then is shorter.
        """
        self._own.remember(self._of)
        packed = self._own.packed
        t = (
            np.full(len(t), self.present.t)
            if self._of.believes
            else np.ascontiguousarray(t, dtype=np.float64)
        )
        q, qd = (np.ascontiguousarray(each, dtype=np.float64) for each in (q, qd))
        out = np.empty((len(t), packed.out.size))
        N = 0
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


class ControlStep(Evaluator):
    """An :class:`Evaluator`, which says what it takes, and controllers on what it gives."""

    _controller: Controller | None = None
    _options: dict[str, Any] | None = None
    _gradients_checked = False

    def model(self, estimate: Any = None, gradient_error: Any = None) -> Model:
        """Rows and task at predicted states: see :class:`Model`."""
        return Model(self, estimate, gradient_error)

    def evaluate(self, t: float, q: Array, qd: Array, **measured: Any) -> Evaluation:
        """Rows and task, as :meth:`.Evaluator.evaluate`; the first call checks the gradients of own
        constraints.

        Raises ConfigurationError, which names the row and the coordinate, if one is not the
        derivative of its σ.
        """
        evaluation = super().evaluate(t, q, qd, **measured)
        if not self._gradients_checked:
            self._check_gradients(t, q, qd)
        return evaluation

    def _check_gradients(self, t: float, q: Array, qd: Array) -> None:
        demand_gradients(
            self.scene, self.constraints, self.visual_task, (t, np.asarray(q), np.asarray(qd))
        )
        self._gradients_checked = True

    def command(
        self, controller: Controller, t: float, q: Array, qd: Array, **measured: Any
    ) -> tuple[Evaluation, Command]:
        """From state to command: as :meth:`evaluate` and then ``controller.command``, errors too.

        ``measured`` are ``pixels``, ``depth``, ``taken`` and ``camera`` of :meth:`evaluate`.
        """
        options = self._options
        try:
            changed = options is not None and _options_of(controller) != options
        except ValueError:
            # arrays of its own do not compare
            changed = True
        if changed or controller is not self._controller:
            self.bind(controller)
        return self._to_command(t, q, qd, **measured)

    def bind(self, controller: Controller) -> StateToCommand:
        """Make a function for loops that does as :meth:`command`, for this controller with its
        present options.

        Where step and law are compiled, they run on arrays that stay where they are, and only
        results are copied. A law that uses a model is given one, by a reset; it belongs to this
        step from then on.
        """
        if "model" in controller.uses and controller is not self._controller:
            reset: Callable[..., None] = controller.reset
            reset(model=self.model())
        in_one = self._in_one_call(controller)
        if in_one is not None and own_constraints(self.constraints):
            in_one = partial(self._after_check, in_one)
        self._controller = controller
        self._to_command = in_one or partial(self._in_two_calls, controller)
        # only a law that is bound has options that were read beforehand
        self._options = None if in_one is None else _options_of(controller)
        return self._to_command

    def _after_check(
        self, in_one: StateToCommand, t: float, q: Array, qd: Array, **measured: Any
    ) -> tuple[Evaluation, Command]:
        """Step and law in one call, before the first of which gradients are checked."""
        if not self._gradients_checked:
            self._check_gradients(t, q, qd)
        return in_one(t, q, qd, **measured)

    def _in_two_calls(
        self, controller: Controller, t: float, q: Array, qd: Array, **measured: Any
    ) -> tuple[Evaluation, Command]:
        evaluation = self.evaluate(t, q, qd, **measured)
        command = controller.command(evaluation.rows, evaluation.task)
        self.commanded(command.qdd)
        return evaluation, self._with_doubts(evaluation, command)

    def _with_doubts(self, evaluation: Evaluation, command: Command) -> Command:
        doubts = self.doubts(evaluation)
        return (
            replace(command, remark="; ".join(filter(None, (command.remark, doubts))))
            if doubts
            else command
        )

    def _in_one_call(self, controller: Controller) -> StateToCommand | None:
        """Step and law in one compiled call; None where either runs in NumPy.

        What the compiled functions refuse is left to :meth:`_in_two_calls`.
        """
        step = self.bound()
        if step is None:
            return None
        size = step.packed.size
        law = step.bind(controller)
        if law is None:
            return None
        kernels = load("from_state")
        packed = step.packed
        measure = step.measure
        both = kernels.command_by.bind(packed.workspace, law.workspace, law.answer)
        refused = kernels.REFUSED
        answer = law.command
        copied = step.out.copy
        constraints = self.constraints
        doubt = self.innovation[-1:].item
        undistort = undistortion(self.scene.camera, size.M)
        unknown = np.full(size.M, np.nan)
        in_two = partial(self._in_two_calls, controller)
        with_doubts = self._with_doubts

        def in_one(
            t: float,
            q: Array,
            qd: Array,
            *,
            pixels: Array | None = None,
            depth: Array | None = None,
            taken: float | None = None,
            camera: Pose | None = None,
        ) -> tuple[Evaluation, Command]:
            code = refused
            try:
                # compiled functions take type and dimension for granted, look at the rest by
                # themselves, and would make a number of a string
                plain = (
                    q.dtype is FLOAT
                    and qd.dtype is FLOAT
                    and q.ndim == 1
                    and qd.ndim == 1
                    and camera is None
                )
                if pixels is None:
                    plain = plain and depth is None and taken is None
                elif plain:
                    Z = unknown if depth is None else depth
                    at = t if taken is None else taken
                    plain = (
                        pixels.dtype is FLOAT
                        and Z.dtype is FLOAT
                        and pixels.ndim == 2
                        and Z.ndim == 1
                    )
                    # of a masked array the mask counts, too
                    plain = plain and type(pixels) is np.ndarray and type(Z) is np.ndarray
                    seen = pixels if undistort is None or not plain else undistort(pixels)
                    plain = plain and seen is not None and not measure(seen, Z, at + 0.0, t + 0.0)
                if plain:
                    code = both(t + 0.0, q, qd)
            except (AttributeError, TypeError):
                # not arrays
                pass
            if code == refused:
                return in_two(t, q, qd, pixels=pixels, depth=depth, taken=taken, camera=camera)
            evaluation = Evaluation(packed, constraints, copied())
            command = answer(code)
            if command is None:
                command = controller.command(evaluation.rows, evaluation.task)
                self.commanded(command.qdd)
            return evaluation, with_doubts(evaluation, command) if doubt() > 1.0 else command

        return in_one


def _options_of(controller: Controller) -> dict[str, Any]:
    """Its attributes, and those of the law that it asks, if there is one."""
    own = vars(controller)
    return {**(_options_of(own["law"]) if hasattr(own.get("law"), "__dict__") else {}), **own}


def undistortion(camera: Camera, markers: int) -> Callable[[Array], Array | None] | None:
    """Ideal pixels (M, 2) of distorted ones, or None where they cannot be undistorted; None without
    distortion.
    """
    if camera.distortion is None:
        return None
    through = load("lenses").through(camera.distortion.model)
    eye = np.array(camera.eye)
    ideal = np.empty((markers, 2))

    def undistort(pixels: Array) -> Array | None:
        return None if pixels.shape != ideal.shape or through(eye, pixels, ideal, True) else ideal

    return undistort
