"""One control step up to the controller: rows and task from time, coordinates and speeds."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..constraints import Constraint, ConstraintSet
from ..errors import InvalidInput
from ..formulas.innovation import slip
from ..formulas.limits import joint_box
from ..robots.geometry import Pose
from ..robots.limits import NO_LIMITS, ActuatorLimits
from ..rows import Array, BoolArray, Command
from ..vision.measurement import Measurement, Plausible, doubts_of, innovation
from ..vision.scene import Scene, State
from ..vision.tracking import VisualTask
from . import load
from .evaluation import Bound, CompiledEvaluation, DefinedEvaluation, Evaluation
from .model import CurrentState, GradientErrorModel, Model, StateEstimator
from .state_to_command import StateToCommand, in_one_call, in_two_calls

if TYPE_CHECKING:
    from ..controllers import Controller
    from .packing import Packed


class ControlStep:
    """Evaluates a scene, its constraints and its task together: at compiled speed where all of them have that form.

    The NumPy form, ``scene.evaluate``, ``constraints.rows`` and ``task.evaluate``, runs where the scene or the task has
    no compiled form, and where the compiled form cannot answer: then it says why. Constraints without a compiled form
    (own ones, for example) give their rows in NumPy beside the compiled ones of the others.

    Constraints and task are compiled with the options that they have when a step is made. A step keeps scratch: threads
    need one each.

    Parameters
    ----------
    scene, constraints, task
        What is evaluated.
    known
        Whether motions that controllers are not told of (section 5.4) count as known. If not, such an object is where
        it is, but its velocity is taken for zero.
    limits, period
        What the actuators can do, and the sampling period T_s [s]: rows then state the box of q̈ that is left at each
        sample. It depends on the command before, at first zero: see :meth:`commanded`.
    plausible
        How far what is measured may be from what the model predicts: beyond it :meth:`doubts` and ``Command.remark``
        say so.

    Attributes
    ----------
    not_compiled
        Why the NumPy form runs for all; empty if the compiled one does.
    known
        As given.
    believes
        Whether something moves that controllers are not told of.
    last_command
        (n,) q̈_c of the sample before, as the step was told.
    innovation
        (7,) how far what was measured for the last sample is from the model, see
        :data:`vsconstraints.vision.measurement.INNOVATIONS`, and the greatest ratio of that to what is plausible.

    Raises
    ------
    ConfigurationError, InvalidInput
        if there are limits, but not one for each joint, or no period.
    """

    def __init__(
        self,
        scene: Scene,
        constraints: ConstraintSet,
        task: VisualTask,
        *,
        known: bool = False,
        limits: ActuatorLimits = NO_LIMITS,
        period: float | None = None,
        plausible: Plausible | None = None,
    ) -> None:
        self.scene, self.constraints, self.visual_task = scene, constraints, task
        self.not_compiled, self.known = "", known
        self.believes = not known and constraints.has_unknown_motion(scene)
        n = scene.robot.n
        self._now: tuple[Array, Array, Array] = np.zeros(1), np.zeros(n), np.zeros(n)
        self._correction: Array = np.zeros((len(scene.markers), 2))
        self.last_command: Array = np.zeros(n)
        self._slip: Array = np.full(n, np.nan)
        self.innovation: Array = np.zeros(7)
        self._bounds: Array = np.zeros(6)
        self._given = limits, period
        self._limits = limits.arrays(scene.robot, period) if limits.any else None
        self._packed: Packed | None = None
        self._controller: Controller | None = None
        self._options: dict[str, Any] | None = None
        packing, self._kernels = load("packing"), load("step")
        if packing is None or self._kernels is None:
            self.not_compiled = "there is no compiler"
        else:
            # of a step of its own, whose address need not be looked at
            self._evaluate_step = self._kernels.evaluate_step.unchecked
            try:
                self._packed = packing.Packed(scene, constraints, task, known, self._limits)
                step = self._packed.step
                self._now, self.last_command = (step.time, step.q, step.qd), step.last_command
                self.innovation, self._bounds, self._slip = step.innovation, step.bounds, step.slip
                self._correction = step.correction
            except packing.NotCompiled as reason:
                self.not_compiled = str(reason)
        self.plausible = plausible or Plausible()

    @property
    def plausible(self) -> Plausible:
        """How far what is measured may be from what the model predicts."""
        return self._plausible

    @plausible.setter
    def plausible(self, plausible: Plausible) -> None:
        self._plausible = plausible
        self._bounds[:] = plausible.bounds(self.scene.camera)

    def doubts(self, evaluation: Evaluation) -> str:
        """What of the last measurement cannot be right, as its evaluation shows it; empty if all of it can."""
        if not self.innovation[6] > 1.0:
            return ""
        camera, seen = self.scene.camera, evaluation.pixels
        return doubts_of(self.innovation, self._bounds, camera, seen, self._correction, self._slip)

    def doubted(self, evaluation: Evaluation, command: Command) -> Command:
        """The command, with a remark that says so."""
        said = self.doubts(evaluation)
        return replace(command, remark="; ".join(filter(None, (command.remark, said)))) if said else command

    @property
    def in_numpy(self) -> tuple[Constraint, ...]:
        """Constraints whose rows are computed in NumPy, beside the compiled ones."""
        if self._packed is None:
            return self.constraints.constraints
        return tuple(constraint for constraint, _, _ in self._packed.others)

    def __getstate__(self) -> dict[str, Any]:
        """What it is made of, and what it remembers; the compiled form is made again where it is needed."""
        memory = None if self._packed is None else self._packed.remembered()
        names = "scene", "constraints", "visual_task", "known", "plausible", "_correction"
        made = {name: getattr(self, name) for name in names}
        return {**made, "given": self._given, "last_command": self.last_command.copy(), "memory": memory}

    def __setstate__(self, made: dict[str, Any]) -> None:
        scene, constraints, task, (limits, period) = (
            made[name] for name in ("scene", "constraints", "visual_task", "given")
        )
        options = {"known": made["known"], "limits": limits, "period": period, "plausible": made["plausible"]}
        self.__init__(scene, constraints, task, **options)  # type: ignore[misc]
        self._correction[:], self.last_command[:] = made["_correction"], made["last_command"]
        if self._packed is not None and made["memory"] is not None:
            self._packed.recall(made["memory"])

    def reset(self) -> None:
        """Forget the last sample."""
        self.visual_task.reset()
        self._correction[:] = self.last_command[:] = self.innovation[:] = 0.0
        self._slip[:] = np.nan
        if self._packed is not None:
            self._packed.reset()

    def remember(self, other: ControlStep) -> None:
        """Remember what another step of the same scene, constraints and features remembers."""
        self.visual_task.memory = other.visual_task.memory
        self._correction[:] = other._correction
        if self._packed is not None and other._packed is not None:
            self._packed.recall(other._packed.memory)

    @property
    def present(self) -> CurrentState:
        """What rows and task were made of last; at first zeros."""
        t, q, qd = self._now
        return CurrentState(float(t[0]), q.copy(), qd.copy())

    @property
    def acceleration(self) -> Array:
        """(n,) limit of |q̈| that is known, infinite where there is none."""
        limits = self._limits
        return np.full(self.scene.robot.n, np.inf) if limits is None else np.array(limits.acceleration)

    def model(self, estimate: StateEstimator | None = None, gradient_error: GradientErrorModel | None = None) -> Model:
        """Rows and task at predicted states: see :class:`~vsconstraints.compiled.model.Model`."""
        return Model(self, estimate, gradient_error)

    def evaluate(
        self,
        t: float,
        q: Array,
        qd: Array,
        *,
        pixels: Array | None = None,
        depth: Array | None = None,
        taken: float | None = None,
        camera: Pose | None = None,
    ) -> Evaluation:
        """Rows and task at time ``t`` [s], ``q`` and ``qd`` (n,).

        The model predicts the image, or takes what a camera has measured: see
        :class:`.Measurement` for ``pixels``, ``depth``, ``taken`` and ``camera``. Pixels are
        those on the sensor: where the camera's lens has distortion, they are undistorted first.

        Raises
        ------
        SceneError
            if a marker is not in front of the camera.
        InvalidInput
            if t is not finite, q or qd are not (n,) finite numbers, what is measured does not fit the scene, or a pixel
            is where the lens cannot be inverted.
        """
        measured = None
        if any(value is not None for value in (pixels, depth, taken, camera)):
            measured = Measurement(pixels, depth, taken, camera).checked(len(self.scene.markers), t)
            measured = measured.undistorted(self.scene.camera)
        return self._evaluated(t, q, qd, measured)

    def _evaluated(self, t: float, q: Array, qd: Array, measured: Measurement | None) -> Evaluation:
        packed = self._packed
        if packed is None:
            return self._defined(t, q, qd, measured)
        before = packed.remembered() if packed.others else []
        if measured is not None:
            packed.measure(measured)
        try:
            refused = self._evaluate_step(packed.address, t, q, qd)
        except TypeError:
            t, q, qd = self._checked(t, q, qd)
            refused = self._evaluate_step(packed.address, t, q, qd)
        if refused:
            # what cannot be evaluated is told by the definition
            return self._defined(t, q, qd, measured)
        if packed.others:
            try:
                state = self._believed(self.scene.evaluate(*self._checked(t, q, qd)), measured)
                for constraint, rows, points in packed.others:
                    packed.insert(rows, constraint, constraint.rows(state, points))
            except BaseException:
                # a sample without rows is not remembered
                packed.recall(before)
                raise
        return CompiledEvaluation(packed, self.constraints, packed.out.copy())

    def _defined(self, t: float, q: Array, qd: Array, measured: Measurement | None) -> Evaluation:
        model = self.scene.evaluate(*self._checked(t, q, qd))
        evaluation = self.define(self._believed(model, measured))
        self.innovation[:] = innovation(measured, model, self.scene.camera, self._correction, self._slip, self._bounds)
        return evaluation

    def _believed(self, state: State, measured: Measurement | None) -> State:
        if measured is not None:
            return measured.believed(self.scene, state, self._correction)
        return self.scene.believed(state) if self.believes else state

    def _checked(self, t: float, q: Array, qd: Array) -> tuple[float, Array, Array]:
        robot = self.scene.robot
        if not math.isfinite(t):
            raise InvalidInput(f"the time must be a finite number of seconds, not {t}")
        return float(t), robot.configuration(q), robot.configuration(qd, "qd")

    def command(
        self, controller: Controller, t: float, q: Array, qd: Array, **measured: Any
    ) -> tuple[Evaluation, Command]:
        """From state to command: what :meth:`evaluate` and then ``controller.command`` give, and raise.

        ``measured`` are ``pixels``, ``depth``, ``taken`` and ``camera`` of :meth:`evaluate`.
        """
        options = self._options
        try:
            changed = options is not None and controller.__dict__ != options
        except ValueError:
            # arrays of its own do not compare
            changed = True
        if changed or controller is not self._controller:
            self.bind(controller)
        return self._to_command(t, q, qd, **measured)

    def bind(self, controller: Controller) -> StateToCommand:
        """Make a function for loops that does as :meth:`command`, for this controller with the options that it has now.

        Where step and law are compiled, they run on arrays that stay where they are, and only what they come to is
        copied. A law that uses a model is given one, by a reset; it belongs to this step from then on.
        """
        if "model" in controller.uses and controller is not self._controller:
            reset: Callable[..., None] = controller.reset
            reset(model=self.model())

        in_one = in_one_call(self, controller)
        self._controller, self._to_command = controller, in_one or in_two_calls(self, controller)
        # only a law that is bound has options that were read beforehand
        self._options = None if in_one is None else dict(vars(controller))
        return self._to_command

    def commanded(self, qdd: Array) -> None:
        """Tell what the robot was commanded (n,), from which limits of jerk are counted.

        :meth:`command` and what :meth:`bind` gives do so by themselves; a loop that only evaluates the step has to.
        """
        self.last_command[:] = qdd

    def bound(self) -> Bound | None:
        """The compiled step on arrays that stay where they are; None where anything runs in NumPy."""
        packed = self._packed
        return None if packed is None or packed.others else Bound(packed, self.constraints, self._kernels)

    def views(self, t: Array, q: Array) -> tuple[Array, Array, BoolArray]:
        """What can be seen at many instants, without its motion.

        Parameters
        ----------
        t, q
            (N,) times [s] and (N, n) coordinates.

        Returns
        -------
        tuple
            (N, M, 2) pixels of the markers, (N, p, 3) robot points in the base frame [m], and (N,) whether all markers
            are in front of the camera; where they are not, the pixels do not count.
        """
        if self._packed is None:
            return self.scene.glances(t, q)
        size, t, q = self._packed.size, np.ascontiguousarray(t), np.ascontiguousarray(q)
        if q.shape != (len(t), size.n):
            raise InvalidInput(f"coordinates at {len(t)} times must be of the shape {(len(t), size.n)}, not {q.shape}")
        out = np.zeros((len(t), size.M, 2)), np.zeros((len(t), size.P, 3)), np.ones(len(t), dtype=np.bool_)
        self._kernels.views(self._packed.address, t, q, *out)
        return out

    def define(self, state: State) -> Evaluation:
        """The NumPy form, from a state, which may be a believed one."""
        t, q, qd = self._now
        moved, mean_speed = state.robot.q - q, 0.5 * (state.robot.qd + qd)
        self._slip[:] = slip(self._slip, moved, mean_speed, state.t - t[0])
        t[:], q[:], qd[:] = state.t, state.robot.q, state.robot.qd
        rows, sigma = self.constraints.rows(state)
        if self._limits is not None:
            rows.qdd_min, rows.qdd_max = joint_box(state.robot.q, state.robot.qd, self.last_command, self._limits)
        task, error = self.visual_task.evaluate(state)
        seen = state.pixels.position, state.robot.points, state.camera.R, state.camera.t
        return DefinedEvaluation(rows, task, error, sigma, *seen)
