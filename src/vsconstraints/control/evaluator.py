"""Rows and task from time, coordinates and speeds: at compiled speed, or by the NumPy form that defines them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..compiled import load
from ..constraints import Constraint, ConstraintSet
from ..errors import InvalidInput
from ..formulas.innovation import slip
from ..formulas.limits import joint_box
from ..robots.geometry import Pose
from ..robots.limits import NO_LIMITS, ActuatorLimits
from ..rows import UNKNOWN, Array, BoolArray, Rows, Task
from ..vision.measurement import Measurement, Plausible, doubts_of, innovation
from ..vision.scene import Scene, State
from ..vision.tracking import VisualTask
from .packing import NotCompiled, Packed


@dataclass(slots=True)
class DefinedEvaluation:
    """Result of one step in NumPy.

    Attributes
    ----------
    rows, task
        As a controller takes them.
    error, sigma
        (k,) of the visual feature, and (m,) of each row.
    pixels, points
        (M, 2) markers from the image's centre [px], and (p, 3) the scene's robot points in the base frame [m].
    camera_R, camera_t
        (3, 3) orientation and (3,) position [m] of the camera in the target's frame.
    """

    rows: Rows
    task: Task
    error: Array
    sigma: Array
    pixels: Array
    points: Array
    camera_R: Array
    camera_t: Array


def _view(name: str) -> property:
    return property(lambda evaluation: evaluation.part(name))


class CompiledEvaluation:
    """The same as :class:`DefinedEvaluation`, by views into the array that the compiled step writes."""

    __slots__ = ("_constraints", "_out", "_packed")

    def __init__(self, packed: Packed, constraints: ConstraintSet, out: Array) -> None:
        self._packed, self._constraints, self._out = packed, constraints, out

    def part(self, name: str) -> Array:
        """An output of the step by its name in :attr:`.Size.outputs`."""
        where, shape = self._packed.parts[name]
        return self._out[where].reshape(shape)

    @property
    def rows(self) -> Rows:
        """The rows, as a controller takes them."""
        constraints, part = self._constraints, self.part
        return Rows(
            part("phi"),
            part("Lg"),
            part("Lf"),
            constraints.switching_gain,
            constraints.labels,
            constraints.scale,
            part("sigma"),
            part("sigma_dot"),
            constraints.approach_time,
            *((part("qdd_min"), part("qdd_max")) if self._packed.size.limited else (UNKNOWN, UNKNOWN)),
        )

    @property
    def task(self) -> Task:
        """The task, likewise."""
        part = self.part
        rest = part("rest") if self._packed.size.rests else UNKNOWN
        return Task(part("J"), part("b"), part("error"), part("error_rate"), rest)

    error, sigma, pixels, points = _view("error"), _view("sigma"), _view("pixels"), _view("points")
    camera_R, camera_t = _view("camera_R"), _view("camera_t")


Evaluation = DefinedEvaluation | CompiledEvaluation
"""Result of one step."""


class Bound:
    """The compiled step for loops: every sample overwrites the one before.

    Attributes
    ----------
    evaluate
        Takes time [s], q and q̇ (contiguous ``float64``), and returns 0 if ``out`` now holds the step; otherwise
        :meth:`Evaluator.evaluate` says what is wrong.
    measure
        Takes pixels (M, 2), depths (M,), the time of their image and now, for the next step; returns 0 if they fit.
    out, now
        All outputs as one array, and by their names.
    packed
        The arrays of the step.
    """

    __slots__ = ("evaluate", "measure", "now", "out", "packed")

    def __init__(self, packed: Packed, constraints: ConstraintSet) -> None:
        kernels = load("step")
        self.packed, self.out = packed, packed.out
        self.now = CompiledEvaluation(packed, constraints, self.out)
        self.evaluate: Callable[[float, Array, Array], int] = kernels.evaluate_step.bind(packed.workspace)
        self.measure: Callable[[Array, Array, float, float], int] = kernels.measure.bind(packed.workspace)


class CurrentState(NamedTuple):
    """The time [s], q and q̇ (n,) at which rows and task were evaluated last."""

    t: float
    q: Array
    qd: Array


class Evaluator:
    """Evaluates a scene, its constraints and its task together: at compiled speed where all of them have that form.

    The NumPy form, ``scene.evaluate``, ``constraints.rows`` and ``task.evaluate``, runs where the scene or the task has
    no compiled form, and where the compiled form cannot answer: then it says why. Constraints without a compiled form
    (own ones, for example) give their rows in NumPy beside the compiled ones of the others.

    Constraints and task are compiled with the options that they have when this is made. Threads need one each.

    Parameters
    ----------
    scene, constraints, task
        What is evaluated.
    known
        Whether motions that controllers do not know (section 5.4) count as known. If not, such an object is where it
        is, but its velocity is taken for zero.
    limits, period
        Limits of the actuators, and the sampling period T_s [s]: rows then state the box of q̈ that is left at each
        sample. It depends on the command before, at first zero: see :meth:`commanded`.
    plausible
        How far measurements may be from what the model predicts: beyond it :meth:`doubts` and ``Command.remark`` say
        so.

    Attributes
    ----------
    not_compiled
        Why the NumPy form runs for all; empty if the compiled one does.
    believes
        Whether something moves that controllers do not know.
    last_command
        (n,) q̈_c of the sample before.
    innovation
        (7,) how far the last measurement is from the model, see :data:`vsconstraints.vision.measurement.INNOVATIONS`,
        and the greatest ratio of that to what is plausible.

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
        self.known, self.believes = known, not known and constraints.has_unknown_motion(scene)
        n = scene.robot.n
        self._settings = {"known": known, "limits": limits, "period": period}
        self._limits = limits.arrays(scene.robot, period) if limits.any else None
        self._packed: Packed | None = None
        self.not_compiled = ""
        try:
            self._packed = Packed(scene, constraints, task, known, self._limits)
        except NotCompiled as reason:
            self.not_compiled = str(reason)
            self._now: tuple[Array, Array, Array] = np.zeros(1), np.zeros(n), np.zeros(n)
            self._correction: Array = np.zeros((len(scene.markers), 2))
            self._slip: Array = np.full(n, np.nan)
            self.last_command: Array = np.zeros(n)
            self.innovation: Array = np.zeros(7)
            self._bounds: Array = np.zeros(6)
        else:
            step = self._packed.step
            self._now, self._correction, self._slip = (step.time, step.q, step.qd), step.correction, step.slip
            self.last_command, self.innovation, self._bounds = step.last_command, step.innovation, step.bounds
            self._evaluate_step = load("step").evaluate_step.bind(self._packed.workspace, typed=True)
        self.plausible = plausible or Plausible()

    @property
    def plausible(self) -> Plausible:
        """How far measurements may be from what the model predicts."""
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

    @property
    def in_numpy(self) -> tuple[Constraint, ...]:
        """Constraints whose rows are computed in NumPy, beside the compiled ones."""
        if self._packed is None:
            return self.constraints.constraints
        return tuple(constraint for constraint, _, _ in self._packed.others)

    def __getstate__(self) -> dict[str, Any]:
        """Settings and memory; the compiled form is made again where it is needed."""
        memory = None if self._packed is None else self._packed.remembered()
        parts = {name: getattr(self, name) for name in ("scene", "constraints", "visual_task", "_correction")}
        settings = {**self._settings, "plausible": self.plausible}
        return {**parts, "settings": settings, "last_command": self.last_command.copy(), "memory": memory}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(state["scene"], state["constraints"], state["visual_task"], **state["settings"])  # type: ignore[misc]
        self._correction[:], self.last_command[:] = state["_correction"], state["last_command"]
        if self._packed is not None and state["memory"] is not None:
            self._packed.recall(state["memory"])

    def reset(self) -> None:
        """Forget the last sample."""
        self.visual_task.reset()
        self._correction[:] = self.last_command[:] = self.innovation[:] = 0.0
        self._slip[:] = np.nan
        if self._packed is not None:
            self._packed.reset()

    def remember(self, other: Evaluator) -> None:
        """Take over the memory of another one of the same scene, constraints and features."""
        self.visual_task.memory = other.visual_task.memory
        self._correction[:] = other._correction
        if self._packed is not None and other._packed is not None:
            self._packed.recall(other._packed.memory)

    @property
    def present(self) -> CurrentState:
        """The state of the last evaluation; at first zeros."""
        t, q, qd = self._now
        return CurrentState(float(t[0]), q.copy(), qd.copy())

    @property
    def acceleration(self) -> Array:
        """(n,) limit of |q̈| that is known, infinite where there is none."""
        limits = self._limits
        return np.full(self.scene.robot.n, np.inf) if limits is None else np.array(limits.acceleration)

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

        The model predicts the image, or takes a camera's measurement: see :class:`.Measurement` for ``pixels``,
        ``depth``, ``taken`` and ``camera``. Pixels are those on the sensor: where the camera's lens has distortion,
        they are undistorted first.

        Raises
        ------
        SceneError
            if a marker is not in front of the camera.
        InvalidInput
            if t is not finite, q or qd are not (n,) finite numbers, a measurement does not fit the scene, or a pixel
            is where the lens cannot be inverted.
        """
        measured = None
        if any(value is not None for value in (pixels, depth, taken, camera)):
            measured = Measurement(pixels, depth, taken, camera).checked(len(self.scene.markers), t)
            measured = measured.undistorted(self.scene.camera)
        packed = self._packed
        if packed is None:
            return self._defined(t, q, qd, measured)
        before = packed.remembered() if packed.others else []
        if measured is not None:
            packed.measure(measured)
        try:
            refused = self._evaluate_step(t, q, qd)
        except TypeError:
            t, q, qd = self._checked(t, q, qd)
            refused = self._evaluate_step(t, q, qd)
        if refused:
            # the definition says why
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

    def commanded(self, qdd: Array) -> None:
        """Tell what the robot was commanded (n,), from which limits of jerk are counted.

        :meth:`.ControlStep.command` and :meth:`.ControlStep.bind` do so by themselves; a loop that only evaluates has
        to.
        """
        self.last_command[:] = qdd

    def bound(self) -> Bound | None:
        """The compiled step for loops; None where anything runs in NumPy."""
        packed = self._packed
        return None if packed is None or packed.others else Bound(packed, self.constraints)

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
        load("step").views(self._packed.workspace, t, q, *out)
        return out
