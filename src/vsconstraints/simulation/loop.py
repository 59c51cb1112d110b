"""Closed loop: state, measurement, rows and task, controller, robot."""

from __future__ import annotations

import math
from dataclasses import replace
from time import perf_counter

import numpy as np

from ..compiled import load
from ..compiled.codes import TOLERANCE
from ..compiled.memory import Workspace
from ..compiled.samples import ALONE, LAW, MOVE, STEP, Loop
from ..control.evaluator import Evaluation
from ..controllers import Controller
from ..controllers.base import restart
from ..controllers.least_norm import RANK_TOLERANCE
from ..controllers.task_priority import dependent_rows, unit_rows
from ..controllers.velocity_controller import commands_velocity
from ..errors import SceneError, VsconstraintsError, described
from ..robots.geometry import Pose
from ..rows import Command, Rows, Task
from .intersample import intersample_clearance
from .outcome import EarlyEnd, judge, scores_of
from .prepared import RunWorkspace, blank_step, make_loop
from .programs import ProgramLoop, RobotProgram
from .setup import require_followed
from .trajectory import Outcome, RunScores, Trajectory

CHUNK = 512  #: Samples per call of compiled code; signals are handled between calls.


class Run:
    """A controller and a robot in closed loop.

    Compiled code runs as far as it can and returns to Python for the rest.
    """

    def __init__(
        self,
        prepared: RunWorkspace,
        controller: Controller,
        *,
        whole: bool = True,
        by_public_call: bool = False,
    ) -> None:
        prepared.restart()
        require_followed(prepared.setup, controller)
        self.prepared = prepared
        self.setup = prepared.setup
        self.controller = controller
        self.whole = whole
        self.control = prepared.control
        self.bound = prepared.bound
        self.gradient_error = prepared.gradient_error
        self.plant = self.setup.plant()
        #: True if the controller commands speeds or positions.
        self.speeds = commands_velocity(controller)
        if self.speeds:
            self.plant.take_speeds()
        self.sensor = self.setup.sensor()
        #: Samples done, samples that another QP solver answered, and unfounded reports of rank
        #: loss.
        self.samples = self.fallbacks = self.unfounded = 0
        self.ended: EarlyEnd = ""
        self.reason = ""
        self.compiled = False
        self.law = 0
        #: The controller as a robot program; None if it is a function of rows and task.
        self.program: ProgramLoop | None = None
        if isinstance(controller, RobotProgram):
            self.program = ProgramLoop(controller, self.setup, self.sensor, self.plant)
        #: Rows and task that are passed to a compiled law, which leaves them unchanged; other laws
        #: may modify their arrays.
        self._given: tuple[Rows, Task] | None = None
        loop = None
        believe = self.sensor if self.setup.disturbances.sensing else None
        if believe is not None:
            believe.write(self.control.packed.step)
        try:
            wrong = self.gradient_error if self.gradient_error.any else None
            restart(controller, self.setup.Ts, lambda: self.control.model(believe, wrong))
            loop = self._compiled_loop(by_public_call)
        except VsconstraintsError:
            raise
        # an exception in a law ends its run, not the process
        except (Exception, SystemExit, GeneratorExit) as error:
            self._end("failed", described(error))
        self._begin(loop or self._python_loop())

    def to_the_end(self) -> None:
        """Run all samples, or until something ends the run."""
        try:
            self._to_the_end()
        finally:
            if self.program is not None:
                self.program.end()

    def _to_the_end(self) -> None:
        setup = self.setup
        N = self.setup.samples
        further = math.ceil(setup.rest_time / setup.Ts)
        dwell = setup.tolerances.dwell_s
        try:
            if self.program is not None and not self.ended:
                self.program.begin()
                self.speeds = self.program.program.output != "acceleration"
            self._run_to(N)
            while setup.samples_at_most > N and not self.ended:
                status, _ = self._outcome(dwell)
                if status not in ("slow", "unfinished"):
                    break
                N = min(N + further, setup.samples_at_most)
                self._run_to(N)
                # passing the goal at the moment of the check does not count as settling
                dwell = further * setup.Ts
        except SceneError as error:
            self._end("failed", str(error))
        # custom constraints and laws may raise anything; the samples so far are kept.
        # KeyboardInterrupt comes from the user and is not caught
        except (Exception, SystemExit, GeneratorExit) as error:
            self._end("failed", described(error))

    def _outcome(self, dwell: float | None = None) -> tuple[Outcome, str]:
        return judge(self.setup, self.loop, self.samples, self.ended, self.reason, dwell)

    def _end(self, ended: EarlyEnd, reason: str) -> None:
        self.ended = ended
        self.reason = f"t = {self.samples * self.setup.Ts:.4g} s: {reason}"

    def _run_to(self, last: int) -> None:
        """Run all samples before ``last``, unless something ends the run."""
        stage = STEP
        # a sample whose step is done is completed, even if it is the last one
        while stage != STEP or (self.samples < last and not self.ended):
            begun = self.samples
            end = begun + 1 if self.ended else min(begun + self.at_once, last)
            if stage == STEP and self.sensor.renders:
                self._render(begun)
            self.samples, stage = self.run(begun, end, stage)
            if self.pushes and self.samples > begun:
                self.plant.follow()
            if self.samples < end:
                stage = self._answer(self.samples, stage)

    def _render(self, k: int) -> None:
        """Measure sample k in a rendered image, for a compiled step."""
        step_is_compiled = self.bound is not None and self.loop.parts["evaluate"][0] != 0
        if not step_is_compiled:
            return
        assert self.bound is not None
        seen = self.sensor.measured(k, self.plant.q, self.plant.qd)
        assert seen is not None
        self.bound.packed.measure(seen)
        # without a usable image no law is called and the arm brakes
        self.loop.parts["law"] = 0 if self.sensor.blind else self.law

    def _compiled_loop(self, by_public_call: bool) -> Loop | None:
        """Return a loop whose step is compiled, or None if it has no compiled form."""
        setup = self.setup
        bound = self.bound
        true = self.prepared.true
        alone = self.prepared.alone
        if bound is None or true is None or alone is None:
            return None
        believed = bound.packed
        loop = make_loop(setup, self.plant, believed.step, true.packed.step, self.whole)
        parts = loop.parts
        parts["evaluate"] = believed.step.evaluate
        parts["believed"] = believed.workspace.address
        parts["true"] = true.packed.workspace.address
        self.gradient_error.write(believed.step)
        if setup.disturbances.sensing and self.sensor.estimates:
            self._sensing = self.sensor.sensing(setup.samples_at_most)
            self._sensed = Workspace(self._sensing)
            parts["observe"] = load("sensing").OBSERVE
            parts["sensing"] = self._sensed.address
        rows = bound.now.rows
        task = bound.now.task
        law = self.controller.bind(rows, task, loop.answer.acted, loop.answer.qdd)
        self.compiled = law is not None and load("compiler").compiles()
        if law is not None:
            self._given = rows, task
        self._laws = alone, law  # keeps alive the objects behind their arrays
        parts["baseline"] = alone.workspace.address
        if law is not None and not by_public_call:
            self.law = law.workspace.address
            parts["law"] = self.law
            answer = loop.answer._replace(slack=law.slack)
            # at the same rank tolerance, the law may use the unconstrained command of the baseline
            if law.arrays.options[TOLERANCE] == alone.arrays.options[TOLERANCE]:
                answer = answer._replace(alone=loop.alone)
            loop = loop._replace(answer=answer)
        return loop

    def _python_loop(self, features: int = 0) -> Loop:
        """Return a loop whose step and law run in Python.

        The number of features is known after the first sample.
        """
        blank = blank_step(self.setup, self.control.constraints, features)._replace(
            last_command=self.control.last_command
        )
        return make_loop(self.setup, self.plant, blank, blank, self.whole)

    def _begin(self, loop: Loop) -> None:
        self.loop = loop
        move, plant = self.plant.mover
        loop.parts["move"] = move
        loop.parts["plant"] = plant
        # True if Python moves the robot. In that case, and if images are rendered, samples run one
        # by one
        self.pushes = self.plant.follows and self.plant.mover[0] == 0
        self.at_once = 1 if self.pushes or self.sensor.renders else CHUNK
        self.run = load("closed_loop").run.bind(Workspace(loop), typed=True)

    def _answer(self, k: int, stage: int) -> int:
        """Execute the stage that compiled code cannot execute, and return the next one."""
        if stage == STEP:
            self.plant.check()
            rows, task = self._evaluate(k)
            # computed before the law, which may change the task's arrays
            no_rows = Rows.none(self.plant.x.shape[1])
            self.loop.alone[:] = self.prepared.baseline.command(no_rows, task).qdd
        elif self._given is not None:
            rows, task = self._given
        else:
            assert self.bound is not None
            step = Evaluation(self.bound.packed, self.control.constraints, self.bound.out.copy())
            rows = step.rows
            task = step.task
        self._ask_law(k, rows, task)
        return ALONE if stage == LAW else MOVE

    def _evaluate(self, k: int) -> tuple[Rows, Task]:
        """Return rows and task as the controller knows them; write the true ones to the loop."""
        t = k * self.setup.Ts
        q = self.plant.q
        qd = self.plant.qd
        started = perf_counter()
        world = None
        measured = None
        if self.prepared.world is not self.control:
            world = self.prepared.world.evaluate(t, q, qd)
            measured = self.sensor.measured(k, q, qd, world)
            # evaluating the true state is not part of the control time
            started = perf_counter()
        step = self.control.evaluate_measured(t, q, qd, measured)
        rows = self.gradient_error(step.rows, qd)
        ready = perf_counter()
        true = world or step
        if k == 0 and len(step.error) != len(self.loop.task.error):
            self._begin(self._python_loop(len(step.error)))
        loop = self.loop
        loop.true.phi[:] = true.rows.phi
        loop.true.Lg[:] = true.rows.Lg
        loop.true.Lf[:] = true.rows.Lf
        loop.true.sigma[:] = true.sigma
        loop.pixels[:] = true.pixels
        loop.points[:] = true.points
        loop.camera_R[:] = true.camera_R
        loop.camera_t[:] = true.camera_t
        if self.setup.task.feature.reached_by == "feature":
            # normalised coordinates, angles and logarithms of 1 are as many pixels as the focal
            # length; the error is without the reference trajectory
            error = self.prepared.world.packed.step.last_error[: len(step.error)]
            focal = max(self.setup.scene.camera.focal)
            loop.own_error[0] = np.abs(error).max() * focal
        loop.task.error[:] = step.error
        times = loop.kept.rows_time
        times[k % len(times)] = ready - started
        return rows, step.task

    def _ask_law(self, k: int, rows: Rows, task: Task) -> None:
        """Obtain the controller's command, or end the run.

        A reported loss of rank counts only if the rows show it.
        """
        if self.sensor.blind:
            self.loop.answer.qdd[:] = self.sensor.braking(self.plant.qd)
            return
        given = rows
        if self._given is None:
            given = replace(rows, phi=rows.phi.copy(), Lg=rows.Lg.copy())
        called = perf_counter()
        command = self._command(k, rows, task)
        needed = perf_counter() - called
        if self.program is not None:
            needed = self.program.compute_time
        times = self.loop.kept.step_time
        times[k % len(times)] = needed
        self.loop.answer.qdd[:] = self.plant.acceleration_of(command)
        self.fallbacks += bool(command.fallback)
        claimed = command.status == "rank-loss"
        lost = claimed and loses_rank(given)
        self.unfounded += claimed and not lost
        if command.status == "failed":
            self._end("failed", command.reason)
        elif lost and self.setup.on_rank_loss == "abort":
            self._end("aborted", command.reason)

    def _command(self, k: int, rows: Rows, task: Task) -> Command:
        if self.program is None:
            return self.controller.command(rows, task)
        camera = Pose(self.loop.camera_R.copy(), self.loop.camera_t.copy())
        return self.program.command(k, self.loop.pixels, camera, rows.labels)

    def remarks(self) -> list[str]:
        """Return remarks for a reader of the results."""
        # a run that ended before its first command has moved no arm
        of_arm = self.plant.remarks() if self.samples else []
        return [*of_arm, *self.sensor.remarks(), *self.law_remarks()]

    def law_remarks(self) -> list[str]:
        """Return remarks on the law in this run."""
        remarks = []
        if self.fallbacks:
            remarks.append(
                f"a QP solver other than the requested one answered in {self.fallbacks} samples"
            )
        if self.unfounded:
            remarks.append(
                f"the law claimed a loss of rank in {self.unfounded} samples in which its rows "
                f"have full rank"
            )
        of_law = self.controller.remark(self.setup.constraints.labels)
        of_factors = self.controller.factors.remark(self.setup.constraints.kinds)
        if self.program is not None:
            remarks += self.program.program.run_remarks()
        return [*remarks, of_law, of_factors, self.controller.unused()]

    def scores(self) -> RunScores:
        """Return the scores of the run."""
        return scores_of(self.setup, self.loop, self.samples, self._outcome(), self.compiled)

    def trajectory(self) -> Trajectory:
        """Return the simulated samples."""
        setup = self.setup
        N = self.samples
        kept = self.loop.kept
        states = kept.states[:N]
        q = np.ascontiguousarray(states[:, 0])
        qd = np.ascontiguousarray(states[:, 1])
        t = np.arange(N) * setup.Ts
        pixels = kept.pixels[:N]
        points = kept.points[:N]
        clearance = setup.clearance(t, q, qd, pixels, points)
        between = intersample_clearance(setup, self.prepared.world, self.plant, states, clearance)
        status, reason = self._outcome()
        return Trajectory(
            status=status,
            reason=reason,
            t=t,
            q=q,
            qd=qd,
            qdd_command=np.ascontiguousarray(states[:, -2]),
            error=kept.error[:N],
            camera_error=kept.camera_error[:N],
            feature_error_px=kept.feature_error[:N],
            camera_position=kept.camera_t[:N],
            features_px=pixels,
            points=points,
            labels=setup.constraints.labels,
            phi=kept.phi[:N],
            sigma=kept.sigma[:N],
            clearance=clearance,
            between_clearance=between,
            active=kept.active[:N],
            saturated=kept.saturated[:N],
            share_to_hold=self.loop.scores.share_to_hold,
            rows_time=kept.rows_time[:N],
            step_time=kept.step_time[:N],
            fallbacks=self.fallbacks,
            compiled=self.compiled,
        )


def loses_rank(rows: Rows) -> bool:
    """True if L_gφ of the rows with φ ≥ 0 has lost full row rank (section 5.2).

    The result does not depend on the rows' units.
    """
    reached = rows.phi >= 0.0
    gradients, _ = unit_rows(rows, rows.phi, reached)
    dependent = dependent_rows(gradients, RANK_TOLERANCE)
    return bool(dependent.shape[1] > 0)
