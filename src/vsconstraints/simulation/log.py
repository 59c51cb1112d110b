"""What is kept of a run while it lasts, and what it comes to at the end."""

from __future__ import annotations

import numpy as np

from ..constraints import Trace
from ..control_step import ControlStep
from ..evaluation import Bound
from ..geometry import Pose, distances
from ..rows import Array, Command
from .acting import acting
from .outcome import judge
from .plant import Plant
from .setup import Setup
from .trajectory import Trajectory

BETWEEN = (0.25, 0.5, 0.75)
"""Where inside a sampling period clearances are looked at, as fractions of it."""

NEAR = 0.05
"""Clearance, as a fraction of the characteristic length, below which the inside of a period may be looked at."""

DIP = 2.0, 0.001
"""How much less than at both its ends a clearance may be inside a period: a multiple of the greatest change of the
run from one sample to the next, and a fraction of the characteristic length.

Half the change would do at a constant rate; periods whose ends are farther than that above the run's least are left
out, unless a joint turns back inside.
"""

BACK = 1e-5
"""Way that a joint goes out and back inside a period [rad or m] from which on its turning counts."""

STEPS = 256
"""Compiled steps that are kept whole before they are taken apart together."""


class Log:
    """Arrays that a run fills, sample by sample.

    Attributes
    ----------
    states
        (N, s, n) of the plant at the beginning of each period, q, q̇ and the command among them.
    slowed
        (N, m) by how much less φ rises with the command than with tracking alone [units of φ per second].
    tracked
        (N, n) what tracking alone would command; of compiled steps.
    rows_times, step_times
        Wall times of each sample; their length is the number of samples that came to a command.
    """

    def __init__(self, setup: Setup, control: ControlStep, plant: Plant) -> None:
        N, m = setup.samples, len(setup.constraints.labels)
        self.setup, self.control, self.plant, self.labels = setup, control, plant, setup.constraints.labels
        self.t = np.arange(N) * setup.Ts
        self.states = np.empty((N, *plant.x.shape))
        self._error: Array | None = None
        self.camera_R, self.camera_t = np.empty((N, 3, 3)), np.empty((N, 3))
        begins = [goal.from_time for goal in setup.task.goals]
        self.goal = np.maximum(np.searchsorted(begins, self.t + 1e-9, side="right") - 1, 0)
        self.pixels = np.empty((N, len(setup.scene.markers), 2))
        self.points = np.empty((N, len(setup.scene.points), 3))
        self.phi, self.sigma = np.empty((N, m)), np.empty((N, m))
        self.slowed, self.tracked = np.empty((N, m)), np.empty((N, setup.scene.robot.n))
        self.rows_times: list[float] = []
        self.step_times: list[float] = []
        self.fallbacks = 0
        self._bound: Bound | None = None
        self._kept = 0

    def error(self, k: int, error: Array) -> None:
        """Keep the feature's error (k,), as the controller believes it to be."""
        if self._error is None:
            self._error = np.empty((len(self.t), len(error)))
        self._error[k] = error

    def true(self, k: int, phi: Array, sigma: Array, pixels: Array, points: Array, camera: Pose) -> None:
        """Keep what is true."""
        if self._bound is not None:
            # a definition's sample among compiled ones
            self.keep_steps(k)
            self._kept = k + 1
        self.phi[k], self.sigma[k], self.pixels[k], self.points[k] = phi, sigma, pixels, points
        self.camera_R[k], self.camera_t[k] = camera.R, camera.t

    def command(self, k: int, command: Command, rows_time: float, step_time: float) -> None:
        """Keep a command and the state that it meets."""
        self.states[k] = self.plant.x
        self.rows_times.append(rows_time)
        self.step_times.append(step_time)
        self.fallbacks += bool(command.fallback)

    def begin_steps(self, bound: Bound) -> Array:
        """(STEPS, ·) where the compiled steps of a run go, sample k to row k % STEPS."""
        self._bound = bound
        self._steps = np.empty((STEPS, len(bound.out)))
        self._error = np.empty((len(self.t), bound.packed.size.k))
        return self._steps

    def keep_steps(self, end: int) -> None:
        """Take apart the compiled steps before sample ``end`` that have not been yet."""
        begin, self._kept = self._kept, end
        if self._bound is None or begin >= end:
            return
        assert self._error is not None
        packed = self._bound.packed
        steps = self._steps[begin % STEPS : begin % STEPS + end - begin]
        for part, name in (
            (self.phi, "phi"),
            (self.sigma, "sigma"),
            (self._error, "error"),
            (self.pixels, "pixels"),
            (self.points, "points"),
            (self.camera_R, "camera_R"),
            (self.camera_t, "camera_t"),
        ):
            part[begin:end] = steps[:, packed.parts[name][0]].reshape(end - begin, *part.shape[1:])
        change = self.tracked[begin:end] - self.states[begin:end, -2]
        where, shape = packed.parts["Lg"]
        Lg = steps[:, where].reshape(end - begin, *shape)
        self.slowed[begin:end] = (Lg @ change[:, :, None])[:, :, 0]

    def finish(self, ended: str, reason: str) -> Trajectory:
        """The trajectory, of the samples that came to a command."""
        setup, N = self.setup, len(self.step_times)
        self.keep_steps(N)
        q, qd, qdd = (np.ascontiguousarray(self.states[:N, i]) for i in (0, 1, -2))
        image_size = setup.scene.camera.size
        trace = Trace(self.t[:N], q, qd, self.pixels[:N], self.points[:N], image_size)
        constraints = setup.constraints
        clearance = constraints.clearance(trace)
        active = acting(self.phi[:N], self.slowed[:N], constraints.switching_gain, constraints.scale)
        between = _between(setup, self.control, self.plant, self.states[:N], clearance)
        camera_error, feature_error = self._errors(N)
        camera_R, camera_t = self.camera_R[:N], self.camera_t[:N]
        status, why = judge(
            setup, ended, reason, self.t[:N], self.goal[:N], camera_error, feature_error, camera_R, camera_t
        )
        return Trajectory(
            status,
            why,
            self.t[:N],
            q,
            qd,
            qdd,
            self._error[:N] if self._error is not None and N else np.empty((0, 0)),
            camera_error,
            feature_error,
            camera_t,
            self.pixels[:N],
            self.points[:N],
            setup.constraints.labels,
            self.phi[:N],
            self.sigma[:N],
            clearance,
            active,
            between,
            np.array(self.rows_times),
            np.array(self.step_times),
            self.fallbacks,
        )

    def _errors(self, N: int) -> tuple[Array, Array]:
        goals = self.setup.task.goals
        camera_error = np.full((N, 2), np.nan)
        wanted = np.array([goal.pixels for goal in goals])[self.goal[:N]]
        du, dv = np.moveaxis(self.pixels[:N] - wanted, 2, 0)
        feature_error: Array = np.sqrt((du * du + dv * dv).max(axis=1, initial=0.0))
        for number, goal in enumerate(goals):
            if goal.camera is not None:
                held = self.goal[:N] == number
                camera_error[held] = distances(self.camera_R[:N][held], self.camera_t[:N][held], goal.camera)
        return camera_error, feature_error


def _between(setup: Setup, control: ControlStep, plant: Plant, states: Array, clearance: Array) -> Array:
    """(N, m) least clearance inside the period after each sample; infinite where it is not looked at.

    Looked at are periods inside which a row may be outside, or have its least clearance of the run: near its boundary
    (:data:`NEAR`), and not far from it or from its least in the samples (:data:`DIP`), or such that a joint turns back
    inside (:data:`BACK`).

    Parameters
    ----------
    setup, control, plant
        What was run.
    states
        (N, s, n) of the plant in the samples, at which periods begin.
    clearance
        (N, m) in the samples.
    """
    N, m = clearance.shape
    least = np.full((N, m), np.inf)
    if m == 0 or N < 2:
        return least
    near = NEAR * setup.constraints.characteristic_length
    ends = np.minimum(clearance[:-1], clearance[1:])
    with np.errstate(invalid="ignore"):
        change = np.abs(np.diff(clearance, axis=0)).max(axis=0)
    change[~np.isfinite(change)] = np.inf
    dip = DIP[0] * change + DIP[1] * setup.constraints.characteristic_length
    looks = (ends < np.fmin(near, np.maximum(clearance.min(axis=0), 0.0) + dip)).any(axis=1)
    turn = -(states[:-1, 1] * states[1:, 1]).min(axis=1) > (4.0 * BACK / setup.Ts) ** 2
    periods = np.flatnonzero(looks | turn & (ends < near).any(axis=1))
    for share in BETWEEN if len(periods) else ():
        q, qd = plant.inside(states[periods].transpose(0, 2, 1), share * setup.Ts)
        t = (periods + share) * setup.Ts
        pixels, points, seen = control.views(t, q)
        if not seen.any():
            continue
        at = periods[seen]
        trace = Trace(t[seen], q[seen], qd[seen], pixels[seen], points[seen], setup.scene.camera.size)
        least[at] = np.minimum(least[at], setup.constraints.clearance(trace))
    return least
