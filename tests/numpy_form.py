"""Rows and tasks in NumPy, from the state of a scene: what compiled code computes, computed again
for comparison.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from vsconstraints.compiled import load
from vsconstraints.constraints import ConstraintSet, Manipulability, PerformanceFunnel, RowBlock
from vsconstraints.constraints.manipulability import ROWS_OF
from vsconstraints.control import ControlStep
from vsconstraints.formulas.features import MINIMUM_DEPTH, image_motion, pose_error, pose_rates
from vsconstraints.formulas.innovation import MEMORY, depth_innovation, image_innovation, slip
from vsconstraints.formulas.limits import joint_box
from vsconstraints.formulas.motion import angle
from vsconstraints.formulas.rotation import rotation_vector_rate, turn_by
from vsconstraints.formulas.tracking import demanded, funnel, goal_at, resting
from vsconstraints.formulas.vectors import rotate
from vsconstraints.images.sensor import ImageSensor
from vsconstraints.robots.geometry import Pose
from vsconstraints.rows import UNKNOWN, Array, Rows, Task
from vsconstraints.vision.camera import Camera
from vsconstraints.vision.features import CameraPose, Feature, FeatureMotion, Goal, ImagePoints
from vsconstraints.vision.measurement import Measurement
from vsconstraints.vision.scene import PointMotion, Scene, State, interaction_matrix
from vsconstraints.vision.tracking import VisualTask

# --- states ---


def believed(
    scene: Scene, state: State, camera: Pose | None = None, seen: tuple[Array, Array] | None = None
) -> State:
    """The state as a controller believes it: it knows the target's motion only if told, and
    measures as it does.
    """
    J = state.camera_J
    twist = state.camera_twist
    drift = state.camera_drift
    if scene.motion is not None and not scene.motion.known:
        still = Scene(scene.robot, scene.camera, scene.markers_at(state.robot.q, state.t))
        there = still.evaluate(state.t, state.robot.q, state.robot.qd)
        twist = there.camera_twist
        drift = there.camera_drift
    pixels, Z = seen or (state.pixels.position, state.depth)
    P = np.concatenate((scene.camera.normalised(pixels) * Z[:, None], Z[:, None]), axis=1)
    x, y, x_dot, y_dot, x_ddot, y_ddot = image_motion(
        P.T, twist[:3], twist[3:], drift[:3], drift[3:]
    )
    xy, xy_dot, xy_ddot = (
        np.stack(pair, axis=1) for pair in ((x, y), (x_dot, y_dot), (x_ddot, y_ddot))
    )
    J_xy = interaction_matrix(xy, Z) @ J
    F = np.asarray(scene.camera.focal)
    normalised = PointMotion(xy, J_xy, xy_dot, xy_ddot)
    image = PointMotion(scene.camera.pixels(xy), J_xy * F[:, None], xy_dot * F, xy_ddot * F)
    return State(
        state.t,
        state.robot,
        camera or state.camera,
        J,
        twist,
        drift,
        Z,
        normalised,
        image,
        believed=True,
    )


def remounted(scene: Scene, state: State) -> State:
    """The state of the same scene with another mount, its camera's pose and motion as they are with
    this one.
    """
    there = scene.evaluate(state.t, state.robot.q, state.robot.qd)
    names = "camera", "camera_J", "camera_twist", "camera_drift"
    return replace(state, **{name: getattr(there, name) for name in names})


def keep_view(views: dict[float, Pose], scene: Scene, state: State, known: bool = False) -> None:
    """Keep where the camera is now beside its poses at the times before, as far as motion is
    known.
    """
    if views and state.t < max(views):
        views.clear()
    unknown = scene.motion is not None and not (known or scene.motion.known)
    views[state.t] = scene.camera_pose(state.robot.q, 0.0 if unknown else state.t)


def moved_on(
    measured: Measurement, scene: Scene, state: State, views: dict[float, Pose]
) -> tuple[Pose | None, Array, Array]:
    """What is measured of the camera's pose, and (M, 2) pixels and (M,) depths, as the model has
    moved since.

    The model is where it was at the nearest of the times, and moved by the twist of now for what is
    left.
    """
    pixels = measured.pixels
    Z = measured.depth
    camera = measured.camera
    assert pixels is not None
    assert Z is not None
    assert measured.taken is not None
    if not measured.taken < state.t:
        return camera, pixels, Z
    nearest = min(reversed(views), key=lambda t: abs(t - measured.taken))
    twist = believed(scene, state).camera_twist
    rest = measured.taken - nearest
    then = views[nearest] @ Pose(np.asarray(pin.exp3(rest * twist[3:])), rest * twist[:3])
    now = views[state.t]
    pixels = pixels + scene.project(now) - scene.project(then)
    return camera and camera @ then.inverse @ now, pixels, Z + scene.depth(now) - scene.depth(then)


def measured_state(
    measured: Measurement,
    scene: Scene,
    state: State,
    correction: Array,
    views: dict[float, Pose] | None = None,
) -> State:
    """What a controller believes that is told this of a state; keeps the correction (M, 2) up."""
    seen = (
        measured
        if measured.pixels is not None
        else replace(measured, pixels=np.full_like(correction, np.nan))
    )
    camera, pixels, Z = moved_on(seen, scene, state, views or {state.t: state.camera})
    if measured.pixels is None:
        return believed(scene, state, camera)
    model = state.normalised.position
    eye = scene.camera
    found = np.flatnonzero(np.isfinite(pixels).all(axis=1))
    correction[found] = (eye.normalised(pixels) - model)[found]
    Z = np.where(np.isnan(Z), state.depth, Z)
    return believed(scene, state, camera, (eye.pixels(model + correction), Z))


def innovation(
    measured: Measurement | None, model: State, found_pose: Pose, camera: Camera, correction: Array, slip: Array,
    bounds: Array, depth_ratio: Array,
) -> Array:  # fmt: skip
    """(8,) how far what is measured is from the model, and the greatest ratio of that to its
    bounds.
    """
    found = np.zeros(8)
    if measured is not None and measured.pixels is not None:
        seen = model.pixels.position + correction * camera.focal
        found[:2] = image_innovation(seen, correction, *camera.focal)
        found[4] = model.t - measured.taken
        found[6] = depth_innovation(depth_ratio)
    if measured is not None and measured.camera is not None:
        found[2] = np.linalg.norm(found_pose.t - model.camera.t)
        found[3] = angle(((found_pose.R - model.camera.R) ** 2).sum())
    found[5] = np.abs(slip).max(initial=0.0) / MEMORY
    found[7] = (found[:7] / bounds).max()
    return found


def estimated_pose(markers: Array, normalised: Array, near: Pose) -> Pose:
    """Pose of the camera in the target's frame that explains an image best, by singular values of
    LAPACK.
    """
    camera = near
    for _ in range(10):
        P = (markers - camera.t) @ camera.R
        Z = np.maximum(P[:, 2], MINIMUM_DEPTH)
        xy = P[:, :2] / Z[:, None]
        U, s, Vt = np.linalg.svd(interaction_matrix(xy, Z).reshape(-1, 6), full_matrices=False)
        kept = s > 1e-4 * s[0]
        step = Vt[kept].T @ ((U[:, kept].T @ (normalised - xy).ravel()) / s[kept])
        camera = camera @ Pose(np.array(turn_by(step[3:].tolist())), step[:3])
        if np.sqrt(step @ step) < 1e-10:
            break
    return camera


SAMPLES: WeakKeyDictionary[Any, int] = WeakKeyDictionary()
VIEWS: WeakKeyDictionary[Any, dict[float, Pose]] = WeakKeyDictionary()


def observe(sensor: Any, state: State) -> State:
    """What is believed of the next sample's state."""
    if not sensor.disturbed:
        return state
    k = SAMPLES.get(sensor, 0)
    settings = sensor.disturbances
    SAMPLES[sensor] = k + 1
    if not settings.sensing and not isinstance(sensor, ImageSensor):
        return believed(sensor.scene, state)
    world = Evaluated(
        None, None, None, None, state.pixels.position, None, state.camera.R, state.camera.t
    )  # type: ignore
    measured = sensor.measured(k, state.robot.q, state.robot.qd, world)
    camera = state.camera
    pixels = state.pixels.position
    Z = state.depth
    if settings.mount:
        state = remounted(sensor.believed, state)
    if measured is not None:
        views = VIEWS.setdefault(sensor, {})
        keep_view(views, sensor.believed, state)
        if not settings.delay_known and not isinstance(sensor, ImageSensor):
            # states of tests may be of another time than the sample
            measured = replace(measured, taken=state.t)
        camera, pixels, Z = moved_on(measured, sensor.believed, state, views)
    return believed(sensor.believed, state, camera, (pixels, settings.depth_factor * Z))


# --- features and tasks ---


def feature_motion(
    feature: Feature, state: State, goal: Goal, previous: Array | None
) -> FeatureMotion:
    """Error, Jacobian and drift of a feature."""
    qd = state.robot.qd
    if isinstance(feature, CameraPose):
        near = np.zeros(3) if previous is None else previous[3:]
        wanted = goal.camera
        camera = state.camera
        assert wanted is not None
        E, e, w = pose_error(wanted.R, wanted.t, camera.R, camera.t, near, previous is not None)
        v = state.camera_twist[:3]
        omega = state.camera_twist[3:]
        drift = state.camera_drift
        w_dot, L, L_dot = rotation_vector_rate(w, omega)
        t_dot, t_ddot, w_ddot = pose_rates(E, L, L_dot, v, omega, drift[:3], drift[3:])
        J = np.concatenate((rotate(E, state.camera_J[:3]), rotate(L, state.camera_J[3:])))
        velocity = np.array((*t_dot, *w_dot))
        return FeatureMotion(
            np.array((*e, *w)), J, velocity, np.array((*t_ddot, *w_ddot)), velocity - J @ qd
        )
    if not isinstance(feature, ImagePoints):
        return feature.evaluate(state, goal, previous)
    image = state.normalised
    J = image.J.reshape(-1, image.J.shape[2])
    velocity = image.velocity.ravel()
    drift = image.drift.ravel()
    partial = velocity - J @ qd
    if feature.interaction_matrix != "current":
        L = goal.interaction
        if feature.interaction_matrix == "mean":
            L = 0.5 * (L + interaction_matrix(image.position, state.depth).reshape(-1, 6))
        J = L @ state.camera_J
        drift = L @ state.camera_drift
        velocity = J @ qd + partial
    return FeatureMotion((image.position - goal.normalised).ravel(), J, velocity, drift, partial)


@dataclass(slots=True)
class Memory:
    """What tracking remembers between samples; the reference is less the feature's value at the
    goal.
    """

    goal: int = -1
    time: float = 0.0
    last: FeatureMotion | None = None
    began: float = 0.0
    start: Array | None = None
    reference: Array | None = None
    reference_rate: Array | None = None


MEMORIES: WeakKeyDictionary[VisualTask, Memory] = WeakKeyDictionary()


def reset(task: VisualTask) -> None:
    """Forget the last sample."""
    MEMORIES.pop(task, None)


def evaluate_task(task: VisualTask, state: State) -> tuple[Task, Array]:
    """The task now, and the error e = s − s_ref (k,)."""
    memory = MEMORIES.get(task, Memory())
    goal = task.goal_at(state.t)
    last = memory.last if goal == memory.goal else None
    motion = feature_motion(
        task.feature, state, task.goals[goal], None if last is None else last.error
    )
    velocity = motion.velocity
    drift = motion.drift
    k = len(motion.error)
    Ts = state.t - memory.time
    differences = last is not None and Ts > 0.0
    if task.drift == "differences":
        drift = np.zeros_like(drift)
        if differences:
            drift = ((motion.J - last.J) @ state.robot.qd + motion.partial - last.partial) / Ts
    if differences and task.velocity == "differences":
        velocity = (motion.error - last.error) / Ts
    now = Memory(goal, state.t, motion)
    s_ref = rate = acceleration = np.zeros(k)
    following = task.goals[goal].reference
    if following is not None:
        fresh = last is None or memory.start is None
        now.began, now.start = (state.t, motion.error) if fresh else (memory.began, memory.start)
        s_ref, rate, acceleration = following.at(state.t - now.began, now.start)
        if task.reference == "differences":
            rate = acceleration = np.zeros(k)
            if differences and memory.reference is not None:
                rate = (s_ref - memory.reference) / Ts
                acceleration = (rate - memory.reference_rate) / Ts
        now.reference = s_ref
        now.reference_rate = rate
    MEMORIES[task] = now
    q = state.robot.q
    qd = state.robot.qd
    error = motion.error - s_ref
    rest = task.rest_of(len(q), k)
    posture = np.array(rest.posture) if len(rest.posture) else q
    free = (
        np.asarray(resting(q, qd, posture, rest.damping, rest.stiffness)) if rest.any else UNKNOWN
    )
    b = acceleration + demanded(error, velocity - rate, drift, *task.gains.at(error))
    return Task(motion.J, b, error, velocity - rate, free), error


# --- rows ---


def block(constraint: Any, state: State, points: slice) -> RowBlock:
    """The rows of one constraint."""
    if isinstance(constraint, PerformanceFunnel):
        goal = constraint.goals[goal_at([goal.from_time for goal in constraint.goals], state.t)]
        # type: ignore[arg-type]
        seen = state.pixels
        form = constraint.compiled_form(None, points)
        if constraint.of_image:
            error = (seen.position - goal.pixels).ravel()
            J = seen.J.reshape(-1, seen.J.shape[2])
            velocity = seen.velocity.ravel()
            drift = seen.drift.ravel()
        else:
            error, J, velocity, drift, _ = feature_motion(CameraPose(), state, goal, None)
        at = form.which
        side = form.offsets
        width, rate, bend = funnel(state.t - goal.from_time, constraint.final, constraint.decay)
        return constraint.block(
            side * error[at] - width,
            side * velocity[at] - rate,
            side[:, None] * J[at],
            side * drift[at] - bend,
        )
    if isinstance(constraint, Manipulability):
        qd = state.robot.qd
        factor = -1.0 / constraint.w_scale
        at = ROWS_OF[constraint.part]
        w, slope, bent = manipulability(state.robot.J, qd, at.start, at.stop - at.start)
        g = factor * slope[None, :]
        sigma = np.array([(constraint.minimum - w) / constraint.w_scale])
        return constraint.block(sigma, g @ qd, g, np.array([factor * bent]))
    return constraint.rows(state, points)


def manipulability(J: Array, qd: Array, first: int, count: int) -> tuple[float, Array, float]:
    """w, ∂w/∂q (n,) and q̇ᵀ (∂²w/∂q²) q̇ of ``count`` rows of J (6, n), from ``first`` on, by the
    functions of the compiled row in Python.
    """
    kernels = load("manipulability_rows")
    twists = np.zeros((3, J.shape[1], 6))
    slope = np.empty(J.shape[1])
    twists[kernels.JACOBIAN] = J.T
    kernels.write_rates(twists, qd)
    w, bent = kernels.measure(twists, first, count, slope)
    return float(w), slope, float(bent)


def evaluate_rows(constraints: ConstraintSet, state: State) -> tuple[Rows, Array]:
    """The rows now, and σ (m,) of each."""
    if not constraints.constraints:
        return Rows.none(constraints.scene.robot.n), np.empty(0)
    blocks = [block(c, state, at) for c, _, at in constraints.blocks()]
    sigma, phi, Lg, Lf = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    K = constraints.approach_time
    sigma_dot = np.where(K > 0.0, (phi - sigma) / np.where(K > 0.0, K, 1.0), Lf)
    gain = constraints.switching_gain
    labels = constraints.labels
    scale = constraints.scale
    return Rows(phi, Lg, Lf, gain, labels, scale, sigma, sigma_dot, K), sigma


# --- steps ---


@dataclass(slots=True)
class Evaluated:
    """What one step came to; see :class:`vsconstraints.control.evaluator.Evaluation`."""

    rows: Rows
    task: Task
    error: Array
    sigma: Array
    pixels: Array
    points: Array
    camera_R: Array
    camera_t: Array


def define(step: ControlStep, state: State) -> Evaluated:
    """Rows and task of a step from a state, which may be a believed one; the step itself stays as
    it is.
    """
    rows, sigma = evaluate_rows(step.constraints, state)
    limits = step.packed.step.limits
    if step.packed.size.limited:
        rows.qdd_min, rows.qdd_max = joint_box(
            state.robot.q, state.robot.qd, step.last_command, limits
        )
    task, error = evaluate_task(step.visual_task, state)
    seen = state.pixels.position, state.robot.points, state.camera.R, state.camera.t
    return Evaluated(rows, task, error, sigma, *seen)


class NumpyStep(ControlStep):
    """A control step whose rows and tasks are those in NumPy."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._mine = np.zeros(1), np.zeros(self.scene.robot.n), np.zeros(self.scene.robot.n)
        self._correction = np.zeros((len(self.scene.markers), 2))
        self._slip = np.full(self.scene.robot.n, np.nan)
        self._views: dict[float, Pose] = {}

    def reset(self) -> None:
        super().reset()
        reset(self.visual_task)
        self._slip[:] = np.nan
        self._correction[:] = 0.0
        self._views.clear()

    def evaluate_measured(self, t: float, q: Array, qd: Array, measured: Measurement | None) -> Any:
        state = model = self.scene.evaluate(*self._checked(t, q, qd))
        keep_view(self._views, self.scene, model, self.known)
        if measured is not None:
            state = measured_state(measured, self.scene, model, self._correction, self._views)
        elif self.believes:
            state = believed(self.scene, model)
        before, q_before, qd_before = self._mine
        self._slip[:] = slip(self._slip, q - q_before, 0.5 * (qd + qd_before), t - before[0])
        before[:] = t
        q_before[:] = q
        qd_before[:] = qd
        found = define(self, state)
        bounds = self.plausible.bounds(self.scene.camera)
        parts = model, state.camera, self.scene.camera, self._correction, self._slip
        ratio = np.full(len(model.depth), np.nan)
        if measured is not None and measured.pixels is not None:
            ratio = moved_on(measured, self.scene, model, self._views)[2] / model.depth
            self.packed.step.measured[:, 2] = measured.depth
            self.packed.step.depth_ratio[:] = ratio
        self.innovation[:] = innovation(measured, *parts, bounds, ratio)
        return found

    def bound(self) -> None:
        """Nothing of it is compiled."""
