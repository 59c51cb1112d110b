"""Whatever fails, and however, an arm that never stops by itself is at rest in the end: more than
170 faults.
"""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
import pytest

from socket_arm import SocketArm, in_thread
from vsconstraints.arms import (
    Address,
    ArmError,
    ArmLog,
    Driver,
    Envelope,
    Job,
    Joints,
    Supervision,
    run_on_arm,
    stream,
)
from vsconstraints.arms.drivers.loopback import FakeArm
from vsconstraints.arms.guardian import Guardian
from vsconstraints.controllers import Controller, HierarchicalQP
from vsconstraints.errors import ConfigurationError
from vsconstraints.rows import Array, Command, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.vision.measurement import Measurement

SETUP = (
    Scenario.load("ur5-fov")
    .with_override("duration", 0.3)
    .with_override("on_hidden_markers", "continue")
    .setup()
)
AT = 40
"""In which period it happens: the arm moves by then."""


def endless() -> FakeArm:
    """An arm that goes on as it was sent for ever."""
    own = Envelope.of(SETUP.scene.robot, SETUP.limits, SETUP.Ts)
    return FakeArm(SETUP.q0, own, 1e9)


class Fault:
    """Happens where it is asked for, from a call on, so many times."""

    def __init__(
        self, where: str, happens: Callable[[Any], Any], times: float = 1, at: int = AT
    ) -> None:
        self.where = where
        self.happens = happens
        self.times = times
        self.at = at
        self.calls = 0
        self.happened = 0

    def __call__(self, where: str, value: Any = None) -> Any:
        """The value, or what becomes of it."""
        if where != self.where:
            return value
        self.calls += 1
        if self.calls < self.at or self.happened >= self.times:
            return value
        self.happened += 1
        return self.happens(value)


class Faulty(Driver):
    """The endless arm in simulated time, whose calls fail."""

    real = False
    simulated_time = True

    def __init__(self, fault: Fault) -> None:
        super().__init__(Address("faulty"), SETUP)
        self.fault = fault
        self.arm = endless()
        self.moving = 0.0

    def connect(self) -> None:
        self.fault("connect")

    def begin(self) -> None:
        self.fault("begin")

    def read(self) -> Joints:
        return Joints(self.arm.t, *self.fault("read", self.arm.state()))

    def send(self, q: Array, qd: Array) -> None:
        self.fault("send")
        self.arm.take(q, qd)
        self.arm.advance(self.period)
        self.moving = max(self.moving, float(np.abs(self.arm.state()[1]).max()))

    def halt(self, deceleration: float) -> None:
        self.fault("halt")
        self.arm.stop("halted")

    def close(self) -> None:
        self.fault("close")


class Law(Controller):
    """The hierarchical QP; its call number ``AT`` fails."""

    name = "faulty"

    def __init__(self, fault: Fault) -> None:
        self._law = HierarchicalQP()
        self._fault = fault

    def solve(self, rows: Rows, task: Task) -> Command:
        command = self._law.solve(rows, task)
        command.qdd = self._fault("law", command.qdd)
        return command


def run(fault: Fault) -> tuple[Faulty, ArmLog]:
    driver = Faulty(fault)

    def eye(t: float, q: Array) -> Measurement | None:
        pixels = fault("camera", SETUP.scene.glance(q)[0])
        return None if pixels is None else Measurement(pixels, None, t)

    return driver, run_on_arm(Job(SETUP, Law(fault), driver, eye))[1]


def assert_at_rest(arm: FakeArm) -> None:
    """It is, or has been stop command sent."""
    arm.advance(1.0)
    assert np.abs(arm.state()[1]).max() < 1e-12


def raising(kind: type[BaseException]) -> Callable[[Any], Any]:
    def happens(value: Any) -> Any:
        raise kind("a fault")

    return happens


class OwnExit(BaseException):
    """Not even an exception of Python's."""


KINDS = (RuntimeError, ArmError, MemoryError, SystemExit, KeyboardInterrupt, GeneratorExit, OwnExit)
WHERE = ("begin", "read", "send", "halt", "close", "law", "camera", "log")
RAISED = [
    (where, kind, again) for where, kind, again in itertools.product(WHERE, KINDS, (1, np.inf))
]


@pytest.mark.parametrize(
    ("where", "kind", "times"),
    RAISED,
    ids=[f"{where}-{kind.__name__}-{times}" for where, kind, times in RAISED],
)
def test_whatever_is_raised_the_arm_stops(
    where: str, kind: type[BaseException], times: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    fault = Fault(where, raising(kind), times, at=1 if where in ("begin", "halt", "close") else AT)
    if where == "halt":
        # of what cannot be told at all only a process of its own could tell it
        fault.times = min(times, stream.HALTS - 1)
        monkeypatch.setattr(stream, "Brake", lambda *arguments: raising(kind)(None))
    log_period = stream.Stream.log

    def log(line: stream.Stream, *arguments: Any, **options: Any) -> None:
        fault("log")
        log_period(line, *arguments, **options)

    monkeypatch.setattr(stream.Stream, "log", log)
    driver, log_of_run = run(fault)
    assert fault.happened
    assert driver.moving > 0.1 or where == "begin"
    assert log_of_run.ended == ("done" if where in ("halt", "close") else "failed")
    assert log_of_run.at_rest or log_of_run.stop.endswith("stop command sent")
    assert_at_rest(driver.arm)


NUMBERS: dict[str, Callable[[Any], Any]] = {
    "nan": lambda value: np.nan * np.asarray(value),
    "infinite": lambda value: np.inf * np.ones_like(value),
    "shape": lambda value: np.asarray(value)[..., :1],
    "nothing": lambda value: None,
    "text": lambda value: "six joints",
}


@pytest.mark.parametrize("times", [1, np.inf])
@pytest.mark.parametrize("what", NUMBERS)
@pytest.mark.parametrize("where", ["read", "law", "camera"])
def test_whatever_is_said_the_arm_stops(where: str, what: str, times: float) -> None:
    fault = Fault(where, NUMBERS[what], times)
    driver, log = run(fault)
    assert fault.happened
    assert driver.moving > 0.1
    # one image without markers is no fault
    harmless = where == "camera" and what in ("nan", "nothing") and times == 1
    assert log.ended == ("done" if harmless else "failed")
    assert_at_rest(driver.arm)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("where", ["begin", "read", "send", "law", "camera"])
def test_whenever_a_signal_comes_the_arm_stops(where: str, number: signal.Signals) -> None:
    fault = Fault(
        where,
        lambda value: [value, os.kill(os.getpid(), number)][0],
        at=1 if where == "begin" else AT,
    )
    driver, log = run(fault)
    assert (log.ended, log.signal) == ("stopped", number)
    assert_at_rest(driver.arm)


def test_a_handler_that_others_set_does_not_keep_the_arm_from_its_stop() -> None:
    """A library in the loop that makes Ctrl-C an exception again, in the middle of the stop too."""

    def interrupt(value: Any) -> Any:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        os.kill(os.getpid(), signal.SIGINT)
        return value

    driver, log = run(Fault("read", interrupt, np.inf))
    assert log.stop.startswith("while braking, KeyboardInterrupt")
    assert_at_rest(driver.arm)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_raised_before_the_first_setpoint_moves_nothing(kind: type[BaseException]) -> None:
    fault = Fault("connect", raising(kind), at=1)
    driver = Faulty(fault)
    with pytest.raises(kind):
        run_on_arm(Job(SETUP, HierarchicalQP(), driver))
    assert driver.arm.t == 0.0


# --- what no exception tells of: the process is gone, or does not go on ---


@contextmanager
def served() -> Iterator[tuple[FakeArm, int]]:
    """The endless arm behind a socket."""
    arm = endless()
    # setpoints come late on a slow machine
    arm.limits.qd_max[:] = 100.0
    arm.limits.acceleration[:] = 1e4
    port, end = in_thread(arm)
    yield arm, port
    end()


VICTIM = Path(__file__).with_name("arm_victim.py")
HARD = [
    *itertools.product(
        ("law", "camera", "read", "send"), ("exit", "killed", "crash", "suspended", "held")
    ),
    # where a stop can still be streamed, it is
    *itertools.product(("read", "send"), ("held in the end", "interrupted")),
]


def assert_guarded(where: str, what: str) -> None:
    """The arm is told to stop, though the process that ran the loop is in no state to."""
    with served() as (arm, port):
        words = [sys.executable, str(VICTIM), where, what, str(port)]
        with subprocess.Popen(
            words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as process:
            until = time.monotonic() + 120.0
            while not arm.stopped and time.monotonic() < until and process.poll() is None:
                time.sleep(0.01)
            for _ in range(500):  # it is told after the process has gone
                if arm.stopped:
                    break
                time.sleep(0.01)
            moved = np.abs(arm.state()[0] - SETUP.q0).max()
            process.kill()
            output = process.communicate()[1]
        assert arm.stopped == "halted", output
        assert moved > 1e-4
        assert_at_rest(arm)


@pytest.mark.faults
@pytest.mark.parametrize(("where", "what"), HARD)
def test_an_arm_stops_whatever_becomes_of_the_process(where: str, what: str) -> None:
    assert_guarded(where, what)


@pytest.mark.parametrize(("where", "what"), [("send", "held"), ("law", "exit")])
def test_an_arm_stops_where_python_is_held_or_gone(where: str, what: str) -> None:
    assert_guarded(where, what)


class Told:
    """Stops nothing, but leaves a file."""

    def __init__(self, path: Path, fails: int = 0) -> None:
        self.path = path
        self.fails = fails

    def __call__(self) -> None:
        self.fails -= 1
        if self.fails >= 0:
            raise SystemExit("no route")
        self.path.touch()


@pytest.mark.parametrize(
    ("safe", "fails", "said"),
    [
        (True, 0, ""),
        (
            False,
            2,
            "the loop has ended, and the guardian process sent the arm its stop command",
        ),
        (
            False,
            3,
            "the loop has ended, and the guardian process COULD NOT SEND THE ARM ITS STOP COMMAND "
            "(SystemExit: no route",
        ),
    ],
)
def test_a_guardian_is_told_that_all_is_well(
    safe: bool, fails: int, said: str, tmp_path: Path
) -> None:
    guardian = Guardian(Told(tmp_path / "told", fails), 60.0)
    guardian.alive()
    assert not guardian.lost
    assert guardian.end(safe).startswith(said)
    assert (tmp_path / "told").exists() == (not safe and fails < 3)


def test_a_guardian_that_is_gone_or_cannot_begin_is_told(tmp_path: Path) -> None:
    # the second one holds a lock, for which pickle raises TypeError
    for stop in (lambda: None, partial(print, Lock())):
        with pytest.raises(ConfigurationError, match="cannot be sent to the guardian process"):
            Guardian(stop, 1.0)
    guardian = Guardian(Told(tmp_path / "told"), 60.0)
    guardian.alive()
    os.kill(guardian.process.pid, signal.SIGKILL)
    guardian.process.wait()
    guardian.alive()
    assert guardian.lost
    assert guardian.end(True) == ""


def heard_after(guardian: Guardian, seconds: float) -> str:
    """Send heartbeats for so long, or until it is lost; returns why it is."""
    until = time.monotonic() + seconds
    while not guardian.lost and time.monotonic() < until:
        guardian.alive()
        time.sleep(0.005)
    return guardian.lost


def test_a_guardian_answers_until_it_is_suspended(tmp_path: Path) -> None:
    guardian = Guardian(Told(tmp_path / "told"), 2.0)
    assert heard_after(guardian, 3.0) == ""
    os.kill(guardian.process.pid, signal.SIGSTOP)
    assert heard_after(guardian, 30.0).startswith("has not answered for 2")
    assert guardian.end(True) == ""
    assert guardian.process.returncode == -signal.SIGKILL
    assert not (tmp_path / "told").exists()


def test_what_a_guardian_says_of_its_stop_is_not_taken_for_an_answer(tmp_path: Path) -> None:
    guardian = Guardian(Told(tmp_path / "told"), 0.2)
    guardian.alive()
    guardian.process.wait(30.0)
    assert heard_after(guardian, 30.0) == "has ended"
    assert guardian.end(False).startswith(
        "the loop has sent nothing for 200 ms, and the guardian process sent the arm"
    )


@pytest.mark.parametrize(
    ("number", "told"), [(signal.SIGKILL, "has ended"), (signal.SIGSTOP, "has not answered for ")]
)
def test_a_loop_whose_guardian_is_gone_or_suspended_brakes(
    number: signal.Signals, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    alive = Guardian.alive

    def once(guardian: Guardian, more: float = 0.0) -> None:
        guardian.process.send_signal(number)
        if number == signal.SIGKILL:
            guardian.process.wait()
        alive(guardian, more)

    monkeypatch.setattr(Guardian, "alive", once)
    setup = replace(SETUP, duration=60.0)
    with served() as (arm, port):
        driver = SocketArm(Address.parse(f"socket://127.0.0.1:{port}?patience=20"), setup)
        # nothing else ends it on a machine that is late
        patient = Supervision(
            late_s=10.0, hang_s=0.5, following_rad=10.0, speed_rad_s=1e3, stalled_s=10.0
        )
        log = run_on_arm(Job(setup, HierarchicalQP(), driver, supervision=patient))[1]
        assert f"the guardian process, which stops the arm if the loop cannot, {told}" in log.cause
        assert_at_rest(arm)
