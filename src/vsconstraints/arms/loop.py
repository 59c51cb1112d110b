"""Control loop on an arm: state and image → law → limits → setpoint.

The loop is supervised; every exit brakes the arm.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from ..compiled import load
from ..controllers import Controller
from ..controllers.base import restart
from ..errors import ConfigurationError, SceneError, described
from ..plugins import portable
from ..rows import Array, Command
from ..simulation import Setup
from ..simulation.loop import loses_rank
from .driver import ArmError, Driver, Joints
from .envelope import Envelope
from .guardian import Guardian
from .images import ImageSource, SimulatedImages
from .measurements import Measurements
from .record import ArmLog
from .stream import Image, Stream, Times
from .supervision import (
    ArmEnd,
    Requests,
    RunEnded,
    Supervision,
    Watchdog,
    requests_noted,
    require_start,
)

GUARDED = 2.0  #: Factor by which the guardian waits longer than the watchdog.
REHEARSALS = 3  #: Calls of a law before the arm moves, because the first calls take longer.


class TakenOver(BaseException):
    """The watchdog has taken over the arm.

    It is a BaseException, so that a custom law's `except Exception` does not catch it.
    """


@dataclass(frozen=True)
class Job:
    """Run on an arm: setup, law, driver, images and supervision."""

    setup: Setup  #: Setup of the scenario; it starts at its q0.
    controller: Controller
    driver: Driver
    images: ImageSource | None = None  #: None if the image is predicted from the joints.
    #: Bounds beyond which the arm is braked.
    supervision: Supervision = field(default_factory=Supervision)
    #: True to start at the arm's present position, also far from the scenario's start.
    from_arm: bool = False


def run_on_arm(job: Job, keep: Callable[[ArmLog], None] | None = None) -> tuple[Setup, ArmLog]:
    """Run a law on an arm for the scenario's duration, or until an error; end at rest.

    After a stop the run is over, and nothing resumes it. A person starts a new run, which checks
    again that the arm is at rest and at the start.

    ``keep`` saves the log. It is called once the arm stands, before signals are obeyed again.
    Returns the setup with the arm's actual start, and the log. Before anything moves, raises
    ArmError if the arm cannot be reached, and ConfigurationError if it cannot start there
    (:func:`.require_start`), its accelerations are not limited, or images would be rendered in real
    time.
    """
    driver = job.driver
    setup = job.setup
    envelope = Envelope.of(setup.scene.robot, setup.limits, setup.Ts)
    if isinstance(job.images, SimulatedImages) and job.images.renders and not driver.simulated_time:
        raise ConfigurationError(
            "images are rendered in simulated time only, since rendering takes longer than a "
            "period: predict them (--images model), give a source (--images module:function), "
            "or give simulated:// or loopback://?time=simulated as the arm"
        )
    try:
        driver.connect()
        setup = require_start(setup, driver.read(), job.supervision, job.from_arm)
        return setup, ArmRun(replace(job, setup=setup), envelope).all_periods(keep)
    finally:
        # the arm stands by now: an error of its driver must not lose the log
        with suppress(BaseException):
            driver.close()


class ArmRun:
    """One run; its thread commands the arm unless the watchdog has taken over."""

    def __init__(self, job: Job, envelope: Envelope) -> None:
        setup = job.setup
        self.job = job
        self.setup = setup
        self.driver = job.driver
        self.bounds = job.supervision
        self.control = setup.control(job.controller.factors)
        self.Ts = setup.Ts
        self.stream = Stream(
            job.driver, envelope, setup.q0, len(setup.scene.markers), job.supervision
        )
        self.control.plausible = job.supervision
        self.measurements = Measurements(job.images, self.stream, job.supervision.image_s)
        #: Reason why the watchdog has taken over; empty if it has not.
        self.takeover = ""
        #: True if the arm has failed, so that setpoints may not bring it to rest.
        self.needs_halt = False
        self.watchdog: Watchdog | None = None
        self.guardian: Guardian | None = None
        self._patience = max(job.supervision.hang_s, 5.0 * setup.Ts)
        self._rehearse()

    def _rehearse(self) -> None:
        """Compile and load everything that a period needs, without the arm.

        Raises ConfigurationError if the law fails.
        """
        restart(self.job.controller, self.Ts, self.control.model)
        try:
            for _ in range(REHEARSALS):
                self._ask(0.0, self.setup.q0, np.zeros_like(self.setup.q0), {})
        except RunEnded as end:
            raise ConfigurationError(
                f"{self.job.controller.name} has no command at the start: {end}"
            ) from end
        # before the motion, since it calls custom code, which may fail
        step = self.control.bound()
        self.compiled = (
            step is not None
            and step.bind(self.job.controller) is not None
            and load("compiler").compiles()
        )
        self.control.reset()
        restart(self.job.controller, self.Ts, self.control.model)

    def all_periods(self, keep: Callable[[ArmLog], None] | None = None) -> ArmLog:
        """Run all periods, and the stop; ``keep`` is called with the log."""
        stream = self.stream
        with requests_noted() as requests:
            with self._guarded(), self._watched(requests):
                ended, cause = self._periods(requests)
                with stream.turn:
                    if not self.takeover:
                        stream.bring_to_rest(self.needs_halt, self._alive)
            log = self._log(ended, cause, requests.signal)
            if keep is not None:
                keep(log)
        # a signal that came while the log was saved
        return replace(log, signal=requests.signal)

    def _log(self, ended: ArmEnd, cause: str, signal_number: int) -> ArmLog:
        stream = self.stream
        return ArmLog(
            ended=ended,
            cause=cause,
            signal=signal_number,
            stop=stream.stop.description,
            at_rest=stream.stop.at_rest,
            periods=stream.periods,
            missed=stream.missed,
            real_time=not stream.clock.simulated,
            Ts=self.Ts,
            compiled=self.compiled,
            bounds=asdict(self.bounds),
            remarks=tuple(self._remarks()),
        )

    def _remarks(self) -> list[str]:
        stream = self.stream
        images = self.job.images
        remarks = []
        if stream.missed:
            remarks.append(
                f"{stream.missed} periods were missed, by {1e3 * stream.shift:.3g} ms in all"
            )
        limited = sum(period.guarded for period in stream.periods)
        if limited:
            remarks.append(f"commands were clipped to the arm's limits in {limited} periods")
        if isinstance(images, SimulatedImages):
            try:
                remarks += images.remarks()
            except Exception as error:  # the log must not be lost for a remark
                remarks.append(f"remarks on images failed: {described(error)}")
        return remarks

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """Run a guardian during the block, if time is real and the driver has a stopper."""
        if not (self.stream.clock.simulated or portable.STOPS_ARMS):
            raise ConfigurationError(
                "an arm needs Linux or macOS: on this platform no signal interrupts a call that "
                "hangs"
            )
        halt = None if self.stream.clock.simulated else self.driver.stopper()
        if halt is None:
            yield
            return
        self.guardian = Guardian(halt, GUARDED * self._patience)
        try:
            yield
        finally:
            report = self.guardian.end(self.stream.safe)
            if report:
                stop = self.stream.stop
                description = f"{report}; {stop.description}" if stop.description else report
                self.stream.stop = stop._replace(description=description)

    @contextmanager
    def _watched(self, requests: Requests) -> Iterator[None]:
        """Run a watchdog during the block, if time is real."""
        if self.stream.clock.simulated:
            yield
            return
        ours = threading.current_thread()

        def take_over() -> None:
            self.take_over()
            requests.raising = TakenOver
            if ours is threading.main_thread() and ours.ident is not None:
                signal.pthread_kill(ours.ident, portable.TAKE_OVER)

        self.watchdog = Watchdog(self._patience, take_over)
        self._alive(self.bounds.begin_s)
        self.watchdog.start()
        try:
            yield
        finally:
            self.watchdog.end()

    def take_over(self) -> None:
        """Brake in place of a loop that hangs; halt the arm if it hangs in a call to the arm."""
        waited = self._patience if self.stream.begun else self.bounds.begin_s + self._patience
        self.takeover = f"the loop was blocked for {1e3 * waited:g} ms"
        free = self.stream.turn.acquire(timeout=self._patience)
        try:
            self.stream.bring_to_rest(not free, self._alive)
        finally:
            if free:
                self.stream.turn.release()

    def _alive(self, more: float = 0.0) -> None:
        """Send a heartbeat to watchdog and guardian; the next may take ``more`` seconds longer."""
        if self.watchdog is not None:
            self.watchdog.alive(more)
        if self.guardian is not None:
            self.guardian.alive(more)

    @contextmanager
    def _own_turn(self) -> Iterator[None]:
        """Keep the watchdog from commanding the arm during the block.

        Raises TakenOver if it has done so before.
        """
        with self.stream.turn:
            if self.takeover:
                raise TakenOver
            yield

    def _periods(self, requests: Requests) -> tuple[ArmEnd, str]:
        k = 0
        try:
            self.driver.begin()
            self.stream.begin()
            for k in range(self.setup.samples):
                if requests.signal:
                    name = signal.Signals(requests.signal).name
                    raise RunEnded("stopped", f"{name} was received")
                with requests.period():
                    self._period(k)
        except RunEnded as end:
            return end.ended, f"t = {k * self.Ts:.4g} s: {end}"
        except TakenOver:
            return "failed", f"t = {k * self.Ts:.4g} s: {self.takeover}"
        except ArmError as error:
            self.needs_halt = True
            return "failed", f"t = {k * self.Ts:.4g} s: {error}"
        # custom laws, constraints and cameras may raise anything, even SystemExit
        except BaseException as error:
            why = str(error) if isinstance(error, SceneError) else described(error)
            return "failed", f"t = {k * self.Ts:.4g} s: {why}"
        return "done", ""

    def _period(self, k: int) -> None:
        """Read the state and the image, evaluate the law, send the setpoint; raises any error."""
        stream = self.stream
        due, late = stream.wait(k)
        self._alive()
        if late > self.bounds.late_s:
            raise RunEnded("failed", f"the period began {1e3 * late:.3g} ms late")
        if self.guardian is not None and self.guardian.lost:
            raise RunEnded(
                "failed",
                "the guardian process, which stops the arm if the loop cannot, "
                f"{self.guardian.lost}",
            )
        started = time.perf_counter()
        with self._own_turn():
            state = stream.read()
            # time at which the state was read, not the scheduled start of the period
            t = stream.now()
            self._check(state)
        measured = self.measurements.newest(t, state.q)
        command, rows_time, step_time = self._ask(t, state.q, state.qd, measured)
        # the watchdog may have begun a stop meanwhile, which integrates the same setpoints
        with self._own_turn():
            qdd, guarded = stream.within_limits(stream.acceleration_of(command))
            self.control.commanded(qdd)
            setpoint, refusal = stream.prepare(qdd)
            if refusal:
                raise RunEnded("failed", f"not sent, {refusal}")
            stream.send(setpoint)
            times = Times(due, late, rows_time, step_time, time.perf_counter() - started)
            image = Image(
                measured.get("pixels"),
                measured.get("taken", np.nan),
                self.control.innovation[:-1].copy(),
            )
            stream.log(times, state, image, guarded)

    def _check(self, state: Joints) -> None:
        if not (np.isfinite(state.q).all() and np.isfinite(state.qd).all()):
            raise RunEnded("failed", "the arm's state is not finite")
        off = self.stream.strayed(state)
        if off.max() > self.bounds.following_rad:
            j = int(np.argmax(off))
            raise RunEnded("failed", f"joint {j + 1} deviates by {off[j]:.3g} from its setpoint")

    def _ask(
        self, t: float, q: Array, qd: Array, measured: dict[str, Any]
    ) -> tuple[Command, float, float]:
        """Return the law's command, and the times of rows with task and of the law [s].

        Raises RunEnded if there is no command.
        """
        started = time.perf_counter()
        evaluation = self.control.evaluate(t, q, qd, **measured)
        doubts = self.control.doubts(evaluation)
        if doubts:
            unchanged = self.measurements.unchanged_for(measured)
            if unchanged > self.Ts:
                doubts += f"; the images have not changed for {unchanged:.3g} s: are they frozen?"
            raise RunEnded("failed", doubts)
        rows = evaluation.rows
        task = evaluation.task
        ready = time.perf_counter()
        command = self.job.controller.command(rows, task)
        done = time.perf_counter()
        if command.status == "failed":
            raise RunEnded("failed", command.reason)
        if (
            command.status == "rank-loss"
            and self.setup.on_rank_loss == "abort"
            and loses_rank(rows)
        ):
            raise RunEnded("aborted", command.reason)
        if command.qdd.shape != q.shape or not np.isfinite(command.qdd).all():
            raise RunEnded("failed", f"the law's command is not {len(q)} finite numbers")
        return command, ready - started, done - ready
