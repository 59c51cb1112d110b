"""Evaluation of rows and task at a time, coordinates and speeds."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..compiled import load
from ..constraints import Constraint, ConstraintSet
from ..errors import InvalidInput, SceneError
from ..robots.geometry import Pose
from ..robots.limits import NO_LIMITS, ActuatorLimits
from ..rows import UNKNOWN, Array, BoolArray, Rows, Task
from ..vision.measurement import Deviations, Measurement, Plausible, describe_implausible
from ..vision.scene import PointMotion, Scene, State, interaction_matrix
from ..vision.tracking import VisualTask
from .packing import StepArrays

if TYPE_CHECKING:
    from ..controllers.base import Controller
    from ..controllers.compiled import BoundLaw


Evaluate = Callable[[float, Array, Array], int]
Measure = Callable[[Array, Array, float, float], int]


def _view(name: str) -> property:
    return property(lambda evaluation: evaluation.part(name))


class Evaluation:
    """Result of one step: views into the array that the compiled step writes.

    ``rows`` and ``task`` are the input of a controller. ``error`` (k,) is the error of the visual
    feature, and ``sigma`` (m,) is σ of each row. ``pixels`` (M, 2) are the markers, from the
    image's centre [px], and ``points`` (p, 3) the robot points of the scene in the base frame [m].
    ``camera_R`` (3, 3) and ``camera_t`` (3,) [m] are the camera's pose in the target's frame.
    """

    __slots__ = ("_constraints", "_packed", "out")

    def __init__(self, packed: StepArrays, constraints: ConstraintSet, out: Array) -> None:
        self._packed = packed
        self._constraints = constraints
        self.out = out

    def part(self, name: str) -> Array:
        """Return an output of the step by its name in :attr:`.Size.outputs`."""
        place, shape = self._packed.parts[name]
        part = self.out[place]
        return part if len(shape) == 1 else part.reshape(shape)

    @property
    def rows(self) -> Rows:
        """Rows as input of a controller."""
        constraints = self._constraints
        part = self.part
        least = UNKNOWN
        greatest = UNKNOWN
        if self._packed.size.limited:
            least = part("qdd_min")
            greatest = part("qdd_max")
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
            least,
            greatest,
        )

    @property
    def task(self) -> Task:
        """Task as input of a controller."""
        part = self.part
        rest = part("rest") if self._packed.size.rests else UNKNOWN
        return Task(part("J"), part("b"), part("error"), part("error_rate"), rest, part("qd"))

    error = _view("error")
    sigma = _view("sigma")
    pixels = _view("pixels")
    points = _view("points")
    camera_R = _view("camera_R")
    camera_t = _view("camera_t")


class CompiledStep:
    """Compiled step for loops: every sample overwrites the one before.

    ``evaluate`` takes time [s], q and q̇ (contiguous ``float64``). It returns 0 if ``out`` now
    holds the step, and ``now`` its parts by name; otherwise :meth:`Evaluator.evaluate` raises the
    error. ``measure`` takes pixels (M, 2), depths (M,), the time of their image and the present
    time, for the next step, and returns 0 if they are valid. ``packed`` are the arrays of the step.
    """

    __slots__ = ("evaluate", "measure", "now", "out", "packed")

    def __init__(self, packed: StepArrays, constraints: ConstraintSet) -> None:
        kernels = load("step")
        workspace = packed.workspace
        self.packed = packed
        self.out = packed.out
        self.now = Evaluation(packed, constraints, self.out)
        self.evaluate: Evaluate = kernels.evaluate_step.bind(workspace)
        self.measure: Measure = kernels.measure.bind(workspace)

    def bind(self, controller: Controller) -> BoundLaw | None:
        """Bind a controller to the rows and the task of ``now``; None if it is not compiled."""
        size = self.packed.size
        acted = np.empty(size.m, dtype=np.bool_)
        qdd = np.empty(size.n)
        return controller.bind(self.now.rows, self.now.task, acted, qdd)


class CurrentState(NamedTuple):
    """Time [s], q and q̇ (n,) of the last evaluation of rows and task."""

    t: float
    q: Array
    qd: Array


class Evaluator:
    """Evaluates a scene, its constraints and its task together, in one compiled step.

    Custom constraints and features without a compiled form are evaluated in NumPy after the
    compiled ones. Constraints and task are compiled with their options at construction. Every
    thread needs its own evaluator.

    With ``known``, motions that controllers do not know (section 5.4) count as known. Otherwise
    such an object is at its true position, but its velocity is taken as zero, and ``believes`` is
    true if there is one. With the actuators' ``limits`` and the sampling ``period`` T_s [s], the
    rows state the box of q̈ that remains at each sample. It depends on the previous command,
    ``last_command`` (n,), see :meth:`commanded`. ``streams`` is true if the arm takes velocities or
    positions, which it follows by itself; false if it takes accelerations; None if it is not known.
    ``innovation`` (8,) is the difference between the last measurement and the model, see
    :data:`vsconstraints.vision.measurement.INNOVATIONS`, and its greatest ratio to the
    ``plausible`` values. Beyond 1, :meth:`doubts` and ``Command.remark``
    report it. Raises ConfigurationError or InvalidInput if limits are given without a period, or
    not one for each joint.
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
        streams: bool | None = None,
    ) -> None:
        self.scene = scene
        self.constraints = constraints
        self.visual_task = task
        self.known = known
        self.believes = not known and constraints.has_unknown_motion(scene)
        self.streams = streams
        self._settings = {"known": known, "limits": limits, "period": period, "streams": streams}
        self._limits = limits.arrays(scene.robot.ranges, period) if limits.any else None
        self.packed = StepArrays(scene, constraints, task, known, self._limits)
        step = self.packed.step
        self._now = (step.time, step.q, step.qd)
        self._correction = step.correction
        self._slip = step.slip
        self.last_command = step.last_command
        self.innovation = step.innovation
        self._bounds = step.bounds
        kernels = load("step")
        self._evaluate_step = kernels.evaluate_step.bind(self.packed.workspace, typed=True)
        self.plausible = plausible or Plausible()

    @property
    def plausible(self) -> Plausible:
        """Largest plausible difference between measurements and the prediction of the model."""
        return self._plausible

    @plausible.setter
    def plausible(self, plausible: Plausible) -> None:
        self._plausible = plausible
        self._bounds[:] = plausible.bounds(self.scene.camera)

    def doubts(self, evaluation: Evaluation) -> str:
        """Describe the implausible parts of the last measurement; empty if all are plausible.

        ``evaluation`` is the evaluation of that measurement.
        """
        if not self.innovation[-1] > 1.0:
            return ""
        camera = self.scene.camera
        seen = evaluation.pixels
        step = self.packed.step
        beside = Deviations(self._correction, self._slip, step.measured[:, 2], step.depth_ratio)
        return describe_implausible(self.innovation, self._bounds, camera, seen, beside)

    @property
    def in_numpy(self) -> tuple[Constraint, ...]:
        """Constraints whose rows are computed in NumPy instead of the compiled step."""
        return tuple(constraint for constraint, _, _ in self.packed.others)

    def __getstate__(self) -> dict[str, Any]:
        return {
            "scene": self.scene,
            "constraints": self.constraints,
            "visual_task": self.visual_task,
            "settings": {**self._settings, "plausible": self.plausible},
            "memory": self.packed.remembered(),
            "views": self.packed.step.views,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        parts = (state["scene"], state["constraints"], state["visual_task"])
        self.__init__(*parts, **state["settings"])  # type: ignore[misc]
        self.packed.recall(state["memory"])
        self.packed.step.views[:] = state["views"]

    def reset(self) -> None:
        """Clear the memory of the last sample."""
        self.innovation[:] = 0.0
        self.packed.reset()

    def remember(self, other: Evaluator) -> None:
        """Copy the memory of another evaluator, except for past poses.

        It must have the same scene, constraints and features.
        """
        self.packed.recall(other.packed.memory)
        self.packed.step.last["views"] = 0

    @property
    def present(self) -> CurrentState:
        """State of the last evaluation; zeros before the first."""
        t, q, qd = self._now
        return CurrentState(float(t[0]), q.copy(), qd.copy())

    @property
    def acceleration(self) -> Array:
        """Known limit of |q̈| (n,), infinite where there is none."""
        if self._limits is None:
            return np.full(self.scene.robot.n, np.inf)
        return np.array(self._limits.acceleration)

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
        """Evaluate rows and task at time ``t`` [s], ``q`` and ``qd`` (n,).

        The model predicts the image, or takes a camera's measurement: see :class:`.Measurement` for
        ``pixels``, ``depth``, ``taken`` and ``camera``. Pixels are those on the sensor: where the
        camera's lens has distortion, they are undistorted first. Raises SceneError if a marker is
        not in front of the camera. Raises InvalidInput if t is not finite, q or qd are not (n,)
        finite numbers, a measurement does not fit the scene, or the lens cannot be inverted at a
        pixel.
        """
        measured = None
        given = (pixels, depth, taken, camera)
        if any(value is not None for value in given):
            measurement = Measurement(pixels, depth, taken, camera)
            checked = measurement.checked(len(self.scene.markers), t)
            measured = checked.undistorted(self.scene.camera)
        return self.evaluate_measured(t, q, qd, measured)

    def evaluate_measured(
        self, t: float, q: Array, qd: Array, measured: Measurement | None
    ) -> Evaluation:
        """Evaluate as :meth:`evaluate`, with a checked measurement in ideal pixels."""
        packed = self.packed
        before = []
        if packed.others or packed.own_feature:
            before = packed.remembered()
        if measured is not None:
            packed.measure(measured)
        try:
            refused = self._evaluate_step(t, q, qd)
        except TypeError:
            t, q, qd = self._checked(t, q, qd)
            refused = self._evaluate_step(t, q, qd)
        if refused:
            t, q, qd = self._checked(t, q, qd)
            camera = self.scene.camera_pose(q, t)
            self.scene.project(camera)
            raise SceneError("a marker is not in front of the camera in the controller's model")
        if before:
            try:
                self._add_own(t)
            except BaseException:
                # a sample without rows leaves no memory
                packed.recall(before)
                raise
        return Evaluation(packed, self.constraints, packed.out.copy())

    def _add_own(self, t: float) -> None:
        packed = self.packed
        state = self._state()
        task = self.visual_task
        for constraint, rows, points in packed.others:
            block = constraint.rows(state, points)
            packed.insert(rows, constraint, block)
        if packed.own_feature:
            goal = task.goal_at(t)
            previous = None
            if packed.step.last[0]["goal"] == goal:
                previous = packed.step.last_error[: packed.size.k].copy()
            motion = task.feature.evaluate(state, task.goals[goal], previous)
            packed.insert_feature(task.feature, motion)
            load("step").follow(packed.workspace, t)

    def _state(self) -> State:
        """Return the result of the compiled step, for the parts in NumPy."""
        step = self.packed.step
        eye = step.eye[0]
        seen = step.seen
        twist = np.concatenate((eye["velocity"], eye["angular_velocity"]))
        twist_drift = np.concatenate((eye["acceleration"], eye["angular_acceleration"]))
        position = seen["xy"].copy()
        velocity = seen["velocity"].copy()
        drift = seen["drift"].copy()
        J = interaction_matrix(position, seen["depth"]) @ step.camera_J
        focal = step.camera[0]["focal"]  # (2,) pixels per unit of normalised coordinates
        pixel_J = J * focal[:, None]
        pixel_velocity = velocity * focal
        pixel_drift = drift * focal
        return State(
            t=float(step.time[0]),
            robot=self.scene.kinematics(step.q, step.qd),
            camera=Pose(step.camera_R.copy(), step.camera_t.copy()),
            camera_J=step.camera_J.copy(),
            camera_twist=twist,
            camera_drift=twist_drift,
            depth=seen["depth"].copy(),
            normalised=PointMotion(position, J, velocity, drift),
            pixels=PointMotion(step.pixels.copy(), pixel_J, pixel_velocity, pixel_drift),
            believed=not self.known,
        )

    def _checked(self, t: float, q: Array, qd: Array) -> tuple[float, Array, Array]:
        robot = self.scene.robot
        if not math.isfinite(t):
            raise InvalidInput(f"the time must be a finite number of seconds, not {t}")
        return float(t), robot.configuration(q), robot.configuration(qd, "qd")

    def commanded(self, qdd: Array) -> None:
        """Record the commanded q̈ (n,), to which limits of jerk refer.

        :class:`.ControlStep` calls this method. A loop that only evaluates has to call it.
        """
        self.last_command[:] = qdd

    def bound(self) -> CompiledStep | None:
        """Return the compiled step for loops; None where anything runs in NumPy."""
        packed = self.packed
        if packed.others or packed.own_feature:
            return None
        return CompiledStep(packed, self.constraints)

    def views(self, t: Array, q: Array) -> tuple[Array, Array, BoolArray]:
        """Return the markers and robot points at (N,) times t [s] and (N, n) coordinates q.

        Their motion is not evaluated. Returns (N, M, 2) pixels of the markers, (N, p, 3) robot
        points in the base frame [m], and (N,) a mask of the instants with all markers in front of
        the camera. Elsewhere the pixels are not valid. Raises InvalidInput if q is of the wrong
        shape.
        """
        size = self.packed.size
        t = np.ascontiguousarray(t)
        q = np.ascontiguousarray(q)
        N = len(t)
        shape = (N, size.n)
        if q.shape != shape:
            raise InvalidInput(
                f"coordinates at {N} times must be of the shape {shape}, not {q.shape}"
            )
        pixels = np.zeros((N, size.M, 2))
        points = np.zeros((N, size.P, 3))
        is_in_front = np.ones(N, dtype=np.bool_)
        load("step").views(self.packed.workspace, t, q, pixels, points, is_in_front)
        return pixels, points, is_in_front
