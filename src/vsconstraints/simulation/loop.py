"""The closed loop: state → what is believed of it → rows and task → controller → robot."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np

from ..constraints import Trace
from ..control_step import ControlStep
from ..controllers import Controller
from ..errors import ConfigurationError, SceneError
from ..geometry import Pose, distance
from ..rows import Array, Command
from .line_of_sight import LinesOfSight
from .outcome import judge
from .plant import Plant
from .setup import Setup
from .trajectory import Trajectory

BETWEEN = (0.25, 0.5, 0.75)
"""Where inside a sampling period clearances are looked at, as fractions of it."""

NEAR = 0.05
"""Clearance, as a fraction of the characteristic length, below which the inside of a period is looked at."""

LOOKS = 100
"""How often in a run lines of sight are looked at."""


def simulate(setup: Setup, controller: Controller) -> Trajectory:
    """Run a controller on a setup, from t = 0 to its duration or until it cannot go on.

    A scene that can no longer be evaluated, a controller that fails, and own parts that raise anything end the run with
    the status ``failed``; what was simulated until then is kept. The command of the last sample is computed but not
    carried out. The reason also holds the remarks of :meth:`Setup.check_start`, and how often another QP solver had to
    answer.

    Raises
    ------
    ConfigurationError
        if the robot cannot start (see :meth:`Setup.check_start`).
    """
    remarks = setup.check_start()
    setup.task.reset()
    controller.reset()
    scene, Ts = setup.scene, setup.Ts
    control = ControlStep(scene, setup.constraints, setup.task)
    plant, sensor, gradient_error = setup.plant(), setup.sensor(), setup.gradient_error()
    log = _Log(setup, control, plant)
    ended, reason = "", ""
    for k in range(setup.samples):
        t = k * Ts
        q, qd = plant.q, plant.qd
        started = perf_counter()
        try:
            if sensor.disturbed:
                state = scene.evaluate(t, q, qd)
                believed = sensor.observe(state)
                # what comes before is the world's part, not the control's
                started = perf_counter()
                step = control.define(believed)
            else:
                step = control.evaluate(t, q, qd)
            rows, demand = gradient_error(step.rows, qd), step.task
            ready = perf_counter()
            # before the call: a law may use its rows as it likes. What is kept is what is true
            log.seen(k, q, qd, step.error)
            if sensor.disturbed:
                true_rows, sigma = setup.constraints.rows(state)
                log.true(k, true_rows.phi, sigma, state.pixels.position, state.robot.points, state.camera)
            else:
                log.true(k, step.rows.phi, step.sigma, step.pixels, step.points, step.camera)
            called = perf_counter()
            command = controller.command(rows, demand)
            done = perf_counter()
        except SceneError as error:
            ended, reason = "failed", f"t = {t:.4g} s: {error}"
            break
        except Exception as error:  # own constraints and laws may raise anything; what was simulated is kept
            ended, reason = "failed", f"t = {t:.4g} s: {type(error).__name__}: {error}"
            break
        log.command(k, command, ready - started, done - called)
        if command.status == "failed" or (command.status == "rank-loss" and setup.abort_on_rank_loss):
            ended = "failed" if command.status == "failed" else "aborted"
            reason = f"t = {t:.4g} s: {command.reason}"
            break
        log.plant_state[k] = plant.hold(command.qdd)
        plant.step()
    trajectory = log.finish(ended, reason)
    remarks += _hidden(setup, trajectory)
    if trajectory.fallbacks:
        remarks.append(f"another QP solver than the one asked for answered in {trajectory.fallbacks} samples")
    return replace(trajectory, reason="; ".join(filter(None, (trajectory.reason, *remarks))))


class _Log:
    """Arrays that a run fills, sample by sample."""

    def __init__(self, setup: Setup, control: ControlStep, plant: Plant) -> None:
        N, n, m = setup.samples, setup.scene.robot.n, len(setup.constraints.labels)
        self.setup, self.control, self.plant = setup, control, plant
        self.plant_state = np.empty((N, *plant.state.shape))
        self.length = 0
        self.t = np.arange(N) * setup.Ts
        self.q, self.qd, self.qdd = np.empty((N, n)), np.empty((N, n)), np.empty((N, n))
        self.error: list[Array] = []
        self.camera: list[Pose] = []
        self.goal = np.array([setup.task.goal_at(t) for t in self.t], dtype=np.int64)
        self.pixels = np.empty((N, len(setup.scene.markers), 2))
        self.points = np.empty((N, len(setup.scene.points), 3))
        self.phi, self.sigma = np.empty((N, m)), np.empty((N, m))
        self.active = np.zeros((N, m), dtype=np.bool_)
        self.rows_time, self.step_time = np.empty(N), np.empty(N)
        self.fallbacks = 0

    def seen(self, k: int, q: Array, qd: Array, error: Array) -> None:
        self.q[k], self.qd[k] = q, qd
        self.error.append(error)

    def true(self, k: int, phi: Array, sigma: Array, pixels: Array, points: Array, camera: Pose) -> None:
        self.phi[k], self.sigma[k], self.pixels[k], self.points[k] = phi, sigma, pixels, points
        self.camera.append(camera)

    def command(self, k: int, command: Command, rows_time: float, step_time: float) -> None:
        self.length = k + 1
        self.active[k], self.qdd[k] = command.acted, command.qdd
        self.rows_time[k], self.step_time[k] = rows_time, step_time
        self.fallbacks += bool(command.fallback)

    def finish(self, ended: str, reason: str) -> Trajectory:
        setup, N = self.setup, self.length
        del self.error[N:], self.camera[N:]
        q, qd, qdd = self.q[:N], self.qd[:N], self.qdd[:N]
        image_size = setup.scene.camera.size
        trace = Trace(self.t[:N], q, qd, self.pixels[:N], self.points[:N], image_size)
        clearance = setup.constraints.clearance(trace)
        between = _between(setup, self.control, self.plant, self.plant_state[: max(N - 1, 0)], clearance)
        camera_error, feature_error = self._errors(N)
        position = np.array([pose.t for pose in self.camera]).reshape(N, 3)
        status, why = judge(setup, ended, reason, self.t[:N], self.goal[:N], camera_error, feature_error, self.camera)
        return Trajectory(
            status,
            why,
            self.t[:N],
            q,
            qd,
            qdd,
            np.array(self.error) if N else np.empty((0, 0)),
            camera_error,
            feature_error,
            position,
            self.pixels[:N],
            self.points[:N],
            setup.constraints.labels,
            self.phi[:N],
            self.sigma[:N],
            clearance,
            self.active[:N],
            between,
            self.rows_time[:N],
            self.step_time[:N],
            self.fallbacks,
        )

    def _errors(self, N: int) -> tuple[Array, Array]:
        goals = self.setup.task.goals
        camera_error = np.full((N, 2), np.nan)
        wanted = np.array([goal.pixels for goal in goals])[self.goal[:N]]
        feature_error: Array = np.sqrt(((self.pixels[:N] - wanted) ** 2).sum(axis=2)).max(axis=1, initial=0.0)
        for k, pose in enumerate(self.camera):
            goal = goals[self.goal[k]].camera
            if goal is not None:
                camera_error[k] = distance(goal, pose)
        return camera_error, feature_error


def _between(setup: Setup, control: ControlStep, plant: Plant, states: Array, clearance: Array) -> Array:
    """(m,) least clearance inside the sampling periods in which some row is near its boundary.

    Parameters
    ----------
    setup, control, plant
        What was run.
    states
        (N − 1, n, s) of the plant at the beginning of each period.
    clearance
        (N, m) in the samples.
    """
    m = clearance.shape[1]
    least = np.full(m, np.inf)
    if m == 0 or not len(states):
        return least
    near = np.asarray((clearance < NEAR * setup.constraints.characteristic_length).any(axis=1))
    periods = np.flatnonzero(near[:-1] | near[1:])
    if not len(periods):
        return least
    inside = [plant.inside(states[periods], share * setup.Ts) for share in BETWEEN]
    q, qd = (np.concatenate(parts) for parts in zip(*inside, strict=True))
    t = np.concatenate([(periods + share) * setup.Ts for share in BETWEEN])
    pixels, points, seen = control.look(t, q)
    if not seen.any():
        return least
    trace = Trace(t[seen], q[seen], qd[seen], pixels[seen], points[seen], setup.scene.camera.size)
    found: Array = setup.constraints.clearance(trace).min(axis=0)
    return found


def _hidden(setup: Setup, trajectory: Trajectory) -> list[str]:
    """Which markers the robot's own links hide during a run, looked at in :data:`LOOKS` samples after the first."""
    try:
        lines = LinesOfSight(setup.scene)
    except ConfigurationError:
        # said at the start
        return []
    first: dict[tuple[int, str], float] = {}
    for k in np.unique(np.linspace(1, len(trajectory.t) - 1, LOOKS).astype(int)) if len(trajectory.t) > 1 else ():
        for hidden in lines.hidden(trajectory.q[k], float(trajectory.t[k])):
            first.setdefault(hidden, float(trajectory.t[k]))
    return [f"marker {number} is hidden by {link}, first seen at {t:.3g} s" for (number, link), t in first.items()]
