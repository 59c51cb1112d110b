"""The closed loop: state → what is believed of it → rows and task → controller → robot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

import numpy as np

from ..control_step import ControlStep
from ..controllers import Controller, Tracking
from ..controllers.base import restart
from ..errors import ConfigurationError, SceneError, described
from ..evaluation import CompiledEvaluation
from ..geometry import Pose
from ..rows import Command, Rows, Task
from .acting import loses_rank
from .line_of_sight import LinesOfSight
from .log import STEPS, Log
from .setup import Setup
from .trajectory import Trajectory

LOOKS = 100
"""How often in a run lines of sight are looked at."""


def simulate(setup: Setup, controller: Controller, *, by_public_call: bool = False) -> Trajectory:
    """Run a controller on a setup, from t = 0 to its duration or until it cannot go on.

    A scene that can no longer be evaluated, a controller that fails, and own parts that raise anything end the run with
    the status ``failed``; what was simulated until then is kept. The command of the last sample is computed but not
    carried out. The reason also holds the remarks of :meth:`Setup.check_start` and of the controller, how often
    another QP solver had to answer, and how often a law claimed a loss of rank that its rows do not show, at which no
    run is stopped.

    Parameters
    ----------
    setup
        What is simulated.
    controller
        What commands it.
    by_public_call
        Whether every law is asked by ``controller.command(rows, task)``, as a user's own loop does, so that the times
        of different laws are those of the same call. Otherwise compiled laws run on the arrays of the compiled step,
        which is faster; their commands are the same.

    Raises
    ------
    ConfigurationError
        if the robot cannot start (see :meth:`Setup.check_start`).
    """
    remarks = setup.check_start()
    setup.task.reset()
    restart(controller, setup.Ts)
    run = _Run(setup, controller, by_public_call)
    run.to_the_end()
    trajectory = run.log.finish(run.ended, run.reason)
    remarks += _hidden(setup, trajectory)
    if trajectory.fallbacks:
        remarks.append(f"another QP solver than the one asked for answered in {trajectory.fallbacks} samples")
    if run.unfounded:
        remarks.append(f"the law claimed a loss of rank in {run.unfounded} samples in which its rows have full rank")
    remarks.append(controller.remark(setup.constraints.labels))
    reason = "; ".join(filter(None, (trajectory.reason, *remarks)))
    return replace(trajectory, reason=reason, compiled=run.compiled)


class _Run:
    """A controller and a robot, sample by sample."""

    def __init__(self, setup: Setup, controller: Controller, by_public_call: bool = False) -> None:
        self.setup, self.controller, self.by_public_call = setup, controller, by_public_call
        self.baseline = Tracking()
        self.control = ControlStep(setup.scene, setup.constraints, setup.task)
        self.plant, self.sensor, self.gradient_error = setup.plant(), setup.sensor(), setup.gradient_error()
        self.log = Log(setup, self.control, self.plant)
        self.ended, self.reason, self.compiled = "", "", False
        self.unfounded = 0

    def to_the_end(self) -> None:
        k = 0
        sample = self._compiled() or self._sample
        try:
            for k in range(self.setup.samples):
                sample(k)
                if self.ended:
                    break
        except SceneError as error:
            self._end("failed", k, str(error))
        except Exception as error:  # own constraints and laws may raise anything; what was simulated is kept
            self._end("failed", k, described(error))

    def _end(self, status: str, k: int, reason: str) -> None:
        self.ended, self.reason = status, f"t = {k * self.setup.Ts:.4g} s: {reason}"

    def _sample(self, k: int) -> None:
        """One sample, whatever is disturbed and whatever the law."""
        plant, control, log = self.plant, self.control, self.log
        t, q, qd = k * self.setup.Ts, plant.q, plant.qd
        started = perf_counter()
        if self.sensor.disturbed:
            state = self.setup.scene.evaluate(t, q, qd)
            believed = self.sensor.observe(state)
            # what comes before is the world's part, not the control's
            started = perf_counter()
            step = control.define(believed)
        else:
            step = control.evaluate(t, q, qd)
        rows = self.gradient_error(step.rows, qd)
        ready = perf_counter()
        # before the call: a law may use its rows as it likes. What is kept is what is true
        log.error(k, step.error)
        true_Lg = step.rows.Lg
        if self.sensor.disturbed:
            true_rows, sigma = self.setup.constraints.rows(state)
            true_Lg = true_rows.Lg
            log.true(k, true_rows.phi, sigma, state.pixels.position, state.robot.points, state.camera)
        else:
            log.true(k, step.rows.phi, step.sigma, step.pixels, step.points, Pose(step.camera_R, step.camera_t))
        true_Lg, task = true_Lg.copy(), Task(step.task.J.copy(), step.task.b.copy())
        given = replace(rows, phi=rows.phi.copy(), Lg=rows.Lg.copy())
        called = perf_counter()
        command = self.controller.command(rows, step.task)
        ended = perf_counter()
        log.slowed[k] = true_Lg @ (self.baseline.command(Rows.none(len(q)), task).qdd - command.qdd)
        self._carry_out(k, command, given, ready - started, ended - called)

    def _carry_out(self, k: int, command: Command, given: Rows, rows_time: float, step_time: float) -> None:
        """Go on to the next sample, or end the run.

        A loss of rank that the law claims is believed where the rows that it was given show it.
        """
        self.plant.begin(command.qdd)
        self.log.command(k, command, rows_time, step_time)
        claimed = command.status == "rank-loss"
        lost = claimed and loses_rank(given)
        self.unfounded += claimed and not lost
        if command.status == "failed" or (lost and self.setup.on_rank_loss == "abort"):
            self._end("failed" if command.status == "failed" else "aborted", k, command.reason)
        else:
            self.plant.step()

    def _compiled(self) -> Callable[[int], None] | None:
        """One sample where the step is compiled and measured is what is true; None if that is not so.

        It works on arrays that stay where they are, and so do compiled laws unless they are asked by the public call:
        making new arrays takes longer than computing what they hold.
        """
        if self.setup.disturbances.sensing or self.gradient_error.any:
            return None
        setup, x, log, plant, controller = self.setup, self.plant.x, self.log, self.plant, self.controller
        Ts, bound = setup.Ts, self.control.bound()
        # what is kept is what is true; where no motion is unknown, that is what controllers are told
        true = bound
        if self.sensor.disturbed:
            true = ControlStep(setup.scene, setup.constraints, setup.task, known=True).bound()
        if bound is None or true is None:
            return None
        q, qd, acted, qdd = x[0], x[1], np.empty(len(log.labels), dtype=np.bool_), x[-2]
        now, untouched, alone = bound.now, np.empty(len(log.labels), dtype=np.bool_), np.empty(len(q))
        tracking = self.baseline.bind(now.rows, now.task, untouched, alone)
        if tracking is None:
            return None
        law = controller.bind(now.rows, now.task, acted, qdd)
        self.compiled = law is not None
        solve = None if law is None or self.by_public_call else law.solve
        evaluate, out, steps, tracked = bound.evaluate, true.out, log.begin_steps(true), log.tracked
        look, track = None if true is bound else true.evaluate, tracking.solve
        rows_times, step_times, states, varies = log.rows_times, log.step_times, log.states, plant.varies

        def sample(k: int) -> None:
            t = k * Ts
            if look is not None:
                look(t, q, qd)
            started = perf_counter()
            if evaluate(t, q, qd):
                # for the reason, or for the answer of the definition
                self._sample(k)
                return
            ready = perf_counter()
            asks = solve is None or solve()
            ended = perf_counter()
            i = k % STEPS
            if i == 0:
                log.keep_steps(k)
            steps[i] = out
            tracked[k] = self.baseline.command(now.rows, now.task).qdd if track() else alone
            if asks:
                # a law may use its rows as it likes
                step = CompiledEvaluation(bound.packed, setup.constraints, bound.out.copy())
                rows, task = step.rows, step.task
                called = perf_counter()
                command = controller.command(rows, task)
                ended = perf_counter()
                self._carry_out(k, command, now.rows, ready - started, ended - called)
                return
            if varies:
                plant.begin(qdd)
            states[k] = x
            rows_times.append(ready - started)
            step_times.append(ended - ready)
            plant.step()

        return sample


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
