"""One control step up to the controller: rows and task from time, coordinates and speeds."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from .constraints import Constraint, ConstraintSet, RowBlock
from .errors import InvalidInput, SceneError
from .evaluation import Bound, CompiledEvaluation, DefinedEvaluation, Evaluation
from .formulas.limits import joint_box
from .geometry import Pose
from .kernels import entry, load
from .limits import NO_LIMITS, ActuatorLimits
from .measurement import Measurement
from .model import Believe, Model, Present, Spoil
from .renamed import renamed
from .rows import Array, BoolArray, Command
from .scene import Scene, State
from .tracking import VisualTask

if TYPE_CHECKING:
    from .controllers import Controller
    from .kernels.packing import Packed

FLOAT = np.dtype(np.float64)

StateToCommand = Callable[..., tuple[Evaluation, Command]]
"""From time [s], q and q̇ (n,), and ``pixels``, ``depth``, ``taken`` and ``camera`` if measured, to a command."""


@renamed(told="known")
class ControlStep:
    """Evaluates a scene, its constraints and its task together: at compiled speed where all of them have that form.

    The NumPy form, ``scene.evaluate``, ``constraints.rows`` and ``task.evaluate``, is the definition. It runs where
    there is no compiler, where the scene or the task has no compiled form, and where the compiled form cannot answer:
    then it says why. Constraints without a compiled form (own ones, for example) give their rows in NumPy beside the
    compiled ones of the others.

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
    ) -> None:
        self.scene, self.constraints, self.visual_task = scene, constraints, task
        self.not_compiled, self.known = "", known
        self.believes = not known and has_unknown_motion(scene, constraints)
        n = scene.robot.n
        self._now: tuple[Array, Array, Array] = np.zeros(1), np.zeros(n), np.zeros(n)
        self._correction = np.zeros((len(scene.markers), 2))
        self.last_command: Array = np.zeros(n)
        self._given = limits, period
        self._limits = limits.arrays(scene.robot, period) if limits.any else None
        self._packed: Packed | None = None
        self._controller: Controller | None = None
        self._options: dict[str, Any] | None = None
        packing, self._kernels = load("packing"), load("step")
        if packing is None or self._kernels is None:
            self.not_compiled = "there is no compiler"
            return
        try:
            self._packed = packing.Packed(scene, constraints, task, known, self._limits)
            step = self._packed.step
            self._now = step.time, step.q, step.qd
            self.last_command = step.last_command
        except packing.NotCompiled as reason:
            self.not_compiled = str(reason)

    @property
    def in_numpy(self) -> tuple[Constraint, ...]:
        """Constraints whose rows are computed in NumPy, beside the compiled ones."""
        packed = self._packed
        return (
            self.constraints.constraints if packed is None else tuple(constraint for constraint, _, _ in packed.others)
        )

    def __getstate__(self) -> dict[str, Any]:
        """What it is made of, and what it remembers; the compiled form is made again where it is needed."""
        memory = None if self._packed is None else [array.copy() for array in self._packed.memory]
        made = {name: getattr(self, name) for name in ("scene", "constraints", "visual_task", "known", "_correction")}
        return {**made, "given": self._given, "last_command": self.last_command.copy(), "memory": memory}

    def __setstate__(self, made: dict[str, Any]) -> None:
        scene, constraints, task, (limits, period) = (
            made[name] for name in ("scene", "constraints", "visual_task", "given")
        )
        self.__init__(scene, constraints, task, known=made["known"], limits=limits, period=period)  # type: ignore[misc]
        self._correction[:], self.last_command[:] = made["_correction"], made["last_command"]
        if self._packed is not None and made["memory"] is not None:
            for array, kept in zip(self._packed.memory, made["memory"], strict=True):
                array[...] = kept

    def reset(self) -> None:
        """Forget the last sample."""
        self.visual_task.reset()
        self._correction[:] = self.last_command[:] = 0.0
        if self._packed is not None:
            self._packed.reset()

    def remember(self, other: ControlStep) -> None:
        """Remember what another step of the same scene, constraints and features remembers."""
        self.visual_task.memory = other.visual_task.memory
        self._correction[:] = other._correction
        if self._packed is not None and other._packed is not None:
            for array, kept in zip(self._packed.memory, other._packed.memory, strict=True):
                array[...] = kept

    @property
    def present(self) -> Present:
        """What rows and task were made of last; at first zeros."""
        t, q, qd = self._now
        return Present(float(t[0]), q.copy(), qd.copy())

    @property
    def acceleration(self) -> Array:
        """(n,) limit of |q̈| that is known, infinite where there is none."""
        limits = self._limits
        return np.full(self.scene.robot.n, np.inf) if limits is None else np.array(limits.acceleration)

    def model(self, believe: Believe | None = None, spoil: Spoil | None = None) -> Model:
        """Rows and task at states to come, for laws that use a model: see :class:`vsconstraints.model.Model`."""
        return Model(self, believe, spoil)

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
        :class:`vsconstraints.measurement.Measurement` for ``pixels``, ``depth``, ``taken`` and ``camera``. Pixels are
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
            return self.define(self._state(t, q, qd, measured))
        before = [array.copy() for array in packed.memory] if packed.others else []
        if measured is not None:
            packed.measure(measured)
        try:
            refused = self._kernels.evaluate_step(packed.address, t, q, qd)
        except TypeError:
            t, q, qd = self._checked(t, q, qd)
            refused = self._kernels.evaluate_step(packed.address, t, q, qd)
        if refused:
            # what cannot be evaluated is told by the definition
            return self.define(self._state(t, q, qd, measured))
        if packed.others:
            try:
                state = self._state(t, q, qd, measured)
                for constraint, rows, points in packed.others:
                    self._insert(rows, constraint, constraint.rows(state, points))
            except BaseException:
                # a sample without rows is not remembered
                for array, kept in zip(packed.memory, before, strict=True):
                    array[...] = kept
                raise
        return CompiledEvaluation(packed, self.constraints, packed.out.copy())

    def _state(self, t: float, q: Array, qd: Array, measured: Measurement | None = None) -> State:
        state = self.scene.evaluate(*self._checked(t, q, qd))
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
        """From state to command: what :meth:`evaluate` and then ``controller.command`` give.

        ``measured`` are ``pixels``, ``depth``, ``taken`` and ``camera`` of :meth:`evaluate`.

        Raises
        ------
        SceneError
            if a marker is not in front of the camera.
        InvalidInput
            as both of them do.
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

        def asked(evaluation: Evaluation) -> tuple[Evaluation, Command]:
            command = controller.command(evaluation.rows, evaluation.task)
            self.commanded(command.qdd)
            return evaluation, command

        def in_two(t: float, q: Array, qd: Array, **measured: Any) -> tuple[Evaluation, Command]:
            return asked(self.evaluate(t, q, qd, **measured))

        self._controller, self._options = controller, None
        self._to_command: StateToCommand = in_two
        step, law = self.bound(), None
        if step is not None:
            size = step.packed.size
            law = controller.bind(step.now.rows, step.now.task, np.empty(size.m, dtype=np.bool_), np.empty(size.n))
        if step is None or law is None:
            return in_two
        kernels, packed, measure = load("from_state"), step.packed, step.measure
        both = partial(entry(kernels.command), packed.address, law.address, law.answer)
        refused, answer, copied = kernels.REFUSED, law.command, step.out.copy
        constraints, unknown = self.constraints, np.full(packed.size.M, np.nan)
        undistort = self._undistortion()

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
                # the compiled functions take type and dimension for granted, look at the rest by themselves, and would
                # make a number of a string
                plain = q.dtype is FLOAT and qd.dtype is FLOAT and q.ndim == 1 and qd.ndim == 1 and camera is None
                if pixels is None:
                    plain = plain and depth is None and taken is None
                elif plain:
                    Z, at = unknown if depth is None else depth, t if taken is None else taken
                    plain = pixels.dtype is FLOAT and Z.dtype is FLOAT and pixels.ndim == 2 and Z.ndim == 1
                    seen = pixels if undistort is None or not plain else undistort(pixels)
                    plain = plain and seen is not None and not measure(seen, Z, at + 0.0, t + 0.0)
                # what is not so is asked for, and looked at, in Python
                if plain:
                    code = both(t + 0.0, q, qd)
            except (AttributeError, TypeError):
                # not arrays
                pass
            if code == refused:
                return in_two(t, q, qd, pixels=pixels, depth=depth, taken=taken, camera=camera)
            evaluation = CompiledEvaluation(packed, constraints, copied())
            command = answer(code)
            return asked(evaluation) if command is None else (evaluation, command)

        # only a law that is bound has options that were read beforehand
        self._options, self._to_command = dict(vars(controller)), in_one
        return in_one

    def _undistortion(self) -> Callable[[Array], Array | None] | None:
        """What gives ideal pixels (M, 2), or None where they cannot be undistorted; None without distortion."""
        camera = self.scene.camera
        if camera.distortion is None:
            return None
        through, eye = load("lenses").through(camera.distortion.model), np.array(camera.eye)
        ideal = np.empty((len(self.scene.markers), 2))

        def undistort(pixels: Array) -> Array | None:
            return None if pixels.shape != ideal.shape or through(eye, pixels, ideal, True) else ideal

        return undistort

    def commanded(self, qdd: Array) -> None:
        """Tell what the robot was commanded (n,), from which limits of jerk are counted.

        :meth:`command` and what :meth:`bind` gives do so by themselves; a loop that only evaluates the step has to.
        """
        self.last_command[:] = qdd

    def bound(self) -> Bound | None:
        """The compiled step on arrays that stay where they are; None where anything runs in NumPy."""
        packed = self._packed
        return None if packed is None or packed.others else Bound(packed, self.constraints, self._kernels)

    def _insert(self, rows: slice, constraint: Constraint, block: RowBlock) -> None:
        """Write the rows of a constraint in NumPy between the compiled ones."""
        assert self._packed is not None
        now, n, r = self._packed.step.rows, self._packed.size.n, rows.stop - rows.start
        shapes = [part.shape for part in (block.sigma, block.phi, block.Lg, block.Lf)]
        if shapes != [(r,), (r,), (r, n), (r,)]:
            raise InvalidInput(
                f"rows (σ, φ, L_gφ, L_fφ) of the wrong shape: {constraint.kind} has {r} labels for {n} joints, but the "
                f"shapes {shapes}"
            )
        now.phi[rows], now.sigma[rows], now.Lf[rows], now.Lg[rows] = block.phi, block.sigma, block.Lf, block.Lg
        now.sigma_dot[rows] = (block.phi - block.sigma) / constraint.K

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
        scene, N = self.scene, len(t)
        pixels, points = np.zeros((N, len(scene.markers), 2)), np.zeros((N, len(scene.points), 3))
        seen = np.ones(N, dtype=np.bool_)
        if self._packed is not None:
            t, q = np.ascontiguousarray(t), np.ascontiguousarray(q)
            self._kernels.views(self._packed.address, t, q, pixels, points, seen)
            return pixels, points, seen
        for k in range(N):
            try:
                pixels[k], points[k] = scene.glance(q[k], float(t[k]))
            except SceneError:
                seen[k] = False
        return pixels, points, seen

    def define(self, state: State) -> Evaluation:
        """The NumPy form, from a state, which may be a believed one."""
        t, q, qd = self._now
        t[:], q[:], qd[:] = state.t, state.robot.q, state.robot.qd
        rows, sigma = self.constraints.rows(state)
        if self._limits is not None:
            rows.qdd_min, rows.qdd_max = joint_box(state.robot.q, state.robot.qd, self.last_command, self._limits)
        task, error = self.visual_task.evaluate(state)
        camera = state.camera
        return DefinedEvaluation(
            rows, task, error, sigma, state.pixels.position, state.robot.points, camera.R, camera.t
        )


def has_unknown_motion(scene: Scene, constraints: ConstraintSet) -> bool:
    """Whether the target or something forbidden moves without controllers' being told."""
    motions = [scene.motion, *(getattr(constraint, "motion", None) for constraint in constraints.constraints)]
    return any(motion is not None and not motion.known for motion in motions)
