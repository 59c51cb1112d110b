"""Control step with a controller: from the state of the joints to a command.

A :class:`Model` predicts rows and task at future states.
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
from .evaluator import CompiledStep, CurrentState, Evaluation, Evaluator
from .gradients import own_constraints, require_gradients, require_interaction

if TYPE_CHECKING:
    from ..controllers.base import Controller

ROWS = ("phi", "Lg", "Lf", "sigma", "sigma_dot")
TASK = ("J", "b", "error", "error_rate", "rest")
FLOAT = np.dtype(np.float64)

#: Function from time [s], q and q̇ (n,) to evaluation and command. Optional arguments are
#: ``pixels``, ``depth``, ``taken`` and ``camera``.
StateToCommand = Callable[..., tuple[Evaluation, Command]]


@dataclass(frozen=True, slots=True)
class Prediction:
    """Rows and task at N instants, with m rows, n joints, k features and M markers.

    See :class:`.Rows` and :class:`.Task`. Of the rows, phi, sigma, sigma_dot and Lf are (N, m), and
    Lg is (N, m, n). Of the task, J is (N, k, n), b, error and error_rate are (N, k), and rest is
    (N, n) or (N, 0). pixels (N, M, 2) are the markers, from the image's centre [px].
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
    """Model of the controller for rows and task at future states; see :meth:`.ControlStep.model`.

    It has an evaluator of its own, so that the memory of the one in the loop is unchanged. If
    anything moves that controllers do not know, all predictions are for the present time. J̇_s q̇
    and ṡ are exact. ``estimate`` and ``gradient_error`` are the controller's estimate of a state,
    and of its rows, where these differ from the scene.

    ``labels`` are the m rows, and ``K`` (m,) [s] their approach times, 0 for rows on φ itself.
    ``acceleration`` (n,) is the known limit of the magnitude of q̈ [rad/s² or m/s²], infinite where
    there is none. ``ranges`` are those of the robot, and ``task`` is the visual task.
    ``streams`` is that of the evaluator. ``step`` is the compiled step that predicts, None where
    anything runs in NumPy.
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
        self.streams = of.streams
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
        """Create a model that starts at the state of the last evaluation of this one."""
        model = Model(self._own, self._estimate, self._gradient_error)
        model.acceleration = self.acceleration
        return model

    @property
    def present(self) -> CurrentState:
        """State of the last evaluation of rows and task in the loop."""
        return self._of.present

    @property
    def goal(self) -> int:
        """Index of the goal at the present time."""
        return self._of.visual_task.goal_at(self.present.t)

    @property
    def until(self) -> float:
        """Time [s] until which the current goal holds and all motion is known.

        It is the present time if a motion is unknown.
        """
        if self._of.believes:
            return self.present.t
        following = self.task.goals[self.goal + 1 :]
        if not following:
            return np.inf
        return following[0].from_time - JUST_BEFORE

    @property
    def loop(self) -> CompiledStep | None:
        """Compiled step in the loop; None where anything runs in NumPy."""
        return self._of.bound()

    @property
    def frozen(self) -> bool:
        """True if all predictions are for the present time."""
        return self._of.believes

    def at(self, t: float, q: Array, qd: Array) -> Evaluation:
        """Evaluate rows, task and pixels at time ``t`` [s], ``q`` and ``qd`` (n,).

        The memory is that of the sample in the loop. Raises SceneError if a marker is not in front
        of the camera there, InvalidInput if a number is not finite.
        """
        self._own.remember(self._of)
        return self._evaluated(t, q, qd)

    def along(self, t: Array, q: Array, qd: Array) -> Prediction:
        """Predict rows, task and pixels at consecutive states.

        They are given by (N,) times t [s], and (N, n) coordinates and speeds. The prediction ends,
        and is then shorter, before a state with a marker that is not in front of the camera, or
        with a number that is not finite.
        """
        self._own.remember(self._of)
        packed = self._own.packed
        if self._of.believes:
            t = np.full(len(t), self.present.t)
        t = np.ascontiguousarray(t, dtype=np.float64)
        q = np.ascontiguousarray(q, dtype=np.float64)
        qd = np.ascontiguousarray(qd, dtype=np.float64)
        out = np.empty((len(t), packed.out.size))
        if self.step is not None:
            kernels = load("from_state")
            N = kernels.predict(packed.workspace, t, q, qd, packed.out, out)
        else:
            N = self._predict_in_numpy(t, q, qd, out)
        predicted = {}
        evaluated = out[:N]
        for name in (*ROWS, *TASK, "pixels"):
            columns, shape = packed.parts[name]
            part = evaluated[:, columns]
            predicted[name] = part.reshape(N, *shape)
        return Prediction(**predicted)

    def _predict_in_numpy(self, t: Array, q: Array, qd: Array, out: Array) -> int:
        """Write the evaluations at the states of :meth:`along`; return how many there are."""
        count = 0
        with suppress(SceneError, InvalidInput):
            for state in zip(t.tolist(), q, qd, strict=True):
                out[count] = self._evaluated(*state).out
                count += 1
        return count

    def _evaluated(self, t: float, q: Array, qd: Array) -> Evaluation:
        if self._of.believes:
            t = self.present.t
        step = self._own.evaluate(t, q, qd)
        if self.step is None and self._gradient_error is not None:
            rows = self._gradient_error(step.rows, qd)
            for name in ("phi", "Lg", "Lf"):
                step.part(name)[:] = getattr(rows, name)
        return step


class ControlStep(Evaluator):
    """Evaluator that also computes the command of a controller for its rows and task.

    For the parameters see :class:`Evaluator`.
    """

    _controller: Controller | None = None
    _options: dict[str, Any] | None = None
    _gradients_checked = False

    def model(self, estimate: Any = None, gradient_error: Any = None) -> Model:
        """Create a model of rows and task at predicted states, see :class:`Model`."""
        return Model(self, estimate, gradient_error)

    def evaluate(self, t: float, q: Array, qd: Array, **measured: Any) -> Evaluation:
        """Evaluate rows and task, see :meth:`.Evaluator.evaluate`.

        The first call checks the gradients of custom constraints and the interaction matrices of
        custom features. It raises ConfigurationError, which names the row or the component and the
        coordinate, if one is not the derivative of its σ or of its value.
        """
        evaluation = super().evaluate(t, q, qd, **measured)
        if not self._gradients_checked:
            self._check_gradients(t, q, qd)
        return evaluation

    def _check_gradients(self, t: float, q: Array, qd: Array) -> None:
        state = (t, np.asarray(q), np.asarray(qd))
        require_gradients(self.scene, self.constraints, self.visual_task, state)
        if self.packed.own_feature:
            require_interaction(self.visual_task, self._state())
        self._gradients_checked = True

    def command(
        self, controller: Controller, t: float, q: Array, qd: Array, **measured: Any
    ) -> tuple[Evaluation, Command]:
        """Compute the command for a state: :meth:`evaluate`, then ``controller.command``.

        ``measured`` are ``pixels``, ``depth``, ``taken`` and ``camera`` of :meth:`evaluate`. Raises
        the errors of both methods.
        """
        options = self._options
        try:
            changed = options is not None and _options_of(controller) != options
        except ValueError:
            # arrays among the options cannot be compared
            changed = True
        if changed or controller is not self._controller:
            self.bind(controller)
        return self._to_command(t, q, qd, **measured)

    def bind(self, controller: Controller) -> StateToCommand:
        """Return a function for loops, equal to :meth:`command` of this controller.

        It uses the present options of the controller. If step and law are compiled, they run on
        fixed arrays, and only results are copied. A law that uses a model gets one by a reset; from
        then on it belongs to this step.
        """
        if "model" in controller.uses and controller is not self._controller:
            reset: Callable[..., None] = controller.reset
            reset(model=self.model())
        in_one = self._in_one_call(controller)
        if in_one is not None and own_constraints(self.constraints):
            in_one = partial(self._after_check, in_one)
        self._controller = controller
        self._to_command = in_one or partial(self._in_two_calls, controller)
        # only a bound law has copied its options
        self._options = None if in_one is None else _options_of(controller)
        return self._to_command

    def _after_check(
        self, in_one: StateToCommand, t: float, q: Array, qd: Array, **measured: Any
    ) -> tuple[Evaluation, Command]:
        """Run step and law in one call; check the gradients before the first call."""
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
        """Return the command with a remark on implausible measurements, if there are any."""
        doubts = self.doubts(evaluation)
        if not doubts:
            return command
        remarks = [text for text in (command.remark, doubts) if text]
        return replace(command, remark="; ".join(remarks))

    def _in_one_call(self, controller: Controller) -> StateToCommand | None:
        """Return step and law as one compiled call; None if either runs in NumPy.

        Input that the compiled functions refuse is passed to :meth:`_in_two_calls`.
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
                # compiled functions check neither type nor dimension, and would convert a string
                # to a number; they check everything else
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
                    image_time = t if taken is None else taken
                    plain = (
                        pixels.dtype is FLOAT
                        and Z.dtype is FLOAT
                        and pixels.ndim == 2
                        and Z.ndim == 1
                    )
                    # a masked array needs the other path, which heeds its mask
                    plain = plain and type(pixels) is np.ndarray and type(Z) is np.ndarray
                    seen = pixels if undistort is None or not plain else undistort(pixels)
                    if plain and seen is not None:
                        plain = not measure(seen, Z, image_time + 0.0, t + 0.0)
                    else:
                        plain = False
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
            if doubt() > 1.0:
                command = with_doubts(evaluation, command)
            return evaluation, command

        return in_one


def _options_of(controller: Controller) -> dict[str, Any]:
    """Return the attributes of a controller, including those of its inner law if it has one."""
    options = vars(controller)
    inner: Any = options.get("law")
    if not hasattr(inner, "__dict__"):
        return {**options}
    return {**_options_of(inner), **options}


def undistortion(camera: Camera, markers: int) -> Callable[[Array], Array | None] | None:
    """Return a function from distorted to ideal pixels (M, 2); None without distortion.

    The function returns None where pixels cannot be undistorted.
    """
    if camera.distortion is None:
        return None
    through = load("lenses").through(camera.distortion.model)
    eye = np.array(camera.eye)
    ideal = np.empty((markers, 2))

    def undistort(pixels: Array) -> Array | None:
        if pixels.shape != ideal.shape:
            return None
        is_refused = through(eye, pixels, ideal, True)
        return None if is_refused else ideal

    return undistort
