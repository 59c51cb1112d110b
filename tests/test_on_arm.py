"""On an arm: what is sent, what ends a run, how it stops, and what is stored of it."""

from __future__ import annotations

import ctypes
import errno
import gc
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner, Result

from folder_laws import FOLDER_LAWS
from socket_arm import Server, SocketArm, in_thread
from vsconstraints.arms import (
    Address,
    ArmError,
    ArmLog,
    Envelope,
    Job,
    Joints,
    Punctuality,
    Setpoint,
    Supervision,
    driver_for,
    drivers,
    image_source,
    real_time,
    realtime,
    record,
    run_on_arm,
    stream,
    trajectory_of,
)
from vsconstraints.arms.drivers import ur_rtde
from vsconstraints.arms.drivers.loopback import WATCHDOG_S, FakeArm, Fault, LoopbackArm
from vsconstraints.arms.envelope import Brake, deceleration
from vsconstraints.arms.images import SimulatedImages
from vsconstraints.arms.loop import ArmRun
from vsconstraints.arms.realtime import RealClock, SimulatedClock
from vsconstraints.arms.stream import Stream
from vsconstraints.cli import app, main
from vsconstraints.comparisons import StoredComparison, Suite, compare
from vsconstraints.comparisons.record import run_file, stored_run
from vsconstraints.comparisons.runs import folder
from vsconstraints.comparisons.runs.files import storing
from vsconstraints.comparisons.stored import require_arm_kept, require_nothing_lost
from vsconstraints.controllers import Controller, HierarchicalQP, SlidingMode, make_controller
from vsconstraints.errors import ConfigurationError
from vsconstraints.robots.geometry import Pose
from vsconstraints.robots.limits import ActuatorLimits
from vsconstraints.robots.order_filter import OrderFilter
from vsconstraints.rows import Array, Command, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, simulate
from vsconstraints.vision.measurement import INNOVATIONS, Measurement

Ts = 0.002
UR5 = (
    Scenario.load("ur5-fov")
    .with_override("duration", 0.3)
    .with_override("on_hidden_markers", "continue")
)
SETUP = UR5.setup()
FAST = Supervision(hang_s=0.1)


def limits(
    n: int, acceleration: float = 5.0, jerk: float = np.inf, reach: float = np.inf
) -> Envelope:
    every = np.ones(n)
    return Envelope(
        -reach * every, reach * every, 3.0 * every, acceleration * every, jerk * every, Ts
    )


def on(address: str, law: Controller | None = None, **options: Any) -> ArmLog:
    setup = options.pop("setup", SETUP)
    driver = (
        SocketArm(Address.parse(address), setup)
        if address.startswith("socket")
        else driver_for(address, setup)
    )
    job = Job(setup, law or HierarchicalQP(), driver, supervision=FAST)
    return run_on_arm(replace(job, **options))[1]


def assert_stopped(log: ArmLog, envelope: Envelope | None = None) -> None:
    """What was sent ends at rest, and never leaves the limits, checked by differences of what was
    sent.
    """
    own = envelope or Envelope.of(SETUP.scene.robot, SETUP.limits, Ts)
    q = log.column("sent_q")
    qd = log.column("sent_qd")
    assert log.at_rest
    assert (qd[-1] == 0.0).all()
    changes = np.diff(qd, axis=0, prepend=0.0 * qd[:1]) / Ts
    assert (np.abs(changes) <= own.acceleration * (1.0 + 1e-9)).all()
    np.testing.assert_allclose(
        np.diff(q, axis=0), 0.5 * Ts * (qd[1:] + qd[:-1]), rtol=0.0, atol=1e-12
    )


def assert_told(log: ArmLog, told: str) -> None:
    """The run was ended for this reason, on a machine that was late by a period or more perhaps for
    another one.

    Then the test is skipped, and says how late. That the arm stands in the end is asserted all the
    same.
    """
    assert log.ended == "failed"
    assert (
        not log.periods
        or (log.column("sent_qd")[-1] == 0.0).all()
        or log.stop.endswith("stop command sent")
    )
    late = max((period.late + period.busy for period in log.periods), default=0.0)
    if told not in log.cause and late >= Ts:
        pytest.skip(
            f"this machine took {1e3 * late:.3g} ms for a period of {1e3 * Ts:g} ms: {log.cause}"
        )
    assert told in log.cause


# --- the stop ---


def stopped(
    qd: Array, qdd: Array, envelope: Envelope, q: Array | None = None
) -> tuple[Array, Array]:
    """(N, n) positions and accelerations of a stop, the present one first."""
    n = len(qd)
    filter_ = OrderFilter(np.zeros(n) if q is None else q, qd, Ts)
    brake = Brake(qdd, envelope)
    places = [filter_.q]
    accelerations = [qdd]
    while not brake.at_rest(filter_.qd):
        accelerations.append(brake.step(filter_.q, filter_.qd))
        places.append(filter_.step(accelerations[-1]))
        assert len(places) < 20_000
    return np.array(places), np.array([*accelerations, np.zeros(n)])


speeds = st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3).map(np.array)


@settings(max_examples=25, deadline=None)
@given(speeds, speeds, st.floats(1.0, 40.0), st.sampled_from([np.inf, 5000.0, 200.0]))
def test_a_stop_keeps_its_limits_and_ends(qd: Array, qdd: Array, a: float, jerk: float) -> None:
    envelope = limits(3, a, jerk)
    qdd = np.clip(qdd, -a, a)
    _, accelerations = stopped(qd, qdd, envelope)
    assert np.abs(accelerations).max() <= a * (1.0 + 1e-9)
    if np.isfinite(jerk):
        assert np.abs(np.diff(accelerations, axis=0)).max() <= jerk * Ts * (1.0 + 1e-9)


def test_a_stop_is_straight_and_as_short_as_the_slowest_joint_can() -> None:
    qd = np.array([1.0, -0.5, 0.25])
    places, _ = stopped(qd, np.zeros(3), limits(3, 5.0))
    # v²/2a of the first joint, whole periods apart; the others in proportion
    assert len(places) - 1 == 100
    np.testing.assert_allclose(places[-1], qd * 0.5 / 5.0, rtol=1e-9)
    np.testing.assert_allclose(places, places[:, :1] * qd, atol=1e-12)


def test_with_little_jerk_a_stop_takes_what_a_double_ramp_takes() -> None:
    v = 1.0
    a = 5.0
    jerk = 50.0
    places, accelerations = stopped(np.array([v]), np.zeros(1), limits(1, a, jerk))
    # trapezoid of acceleration: v/a + a/j, and a distance of half the time at v
    duration = v / a + a / jerk
    assert len(places) * Ts == pytest.approx(duration, abs=3 * Ts)
    assert places[-1][0] == pytest.approx(0.5 * v * duration, abs=3 * Ts * v)
    assert accelerations.min() == pytest.approx(-a)


def test_a_stop_leaves_the_line_where_that_would_leave_a_range() -> None:
    qd = np.array([2.0, 1.0])
    q = np.array([0.0, 0.85])
    places, _ = stopped(qd, np.zeros(2), limits(2, 5.0, reach=1.0), q)
    # on the line the second joint would end at 0.85 + 0.2; alone it takes 0.1
    assert places[:, 1].max() == pytest.approx(0.95, abs=0.003)
    assert places[:, 0].max() == pytest.approx(0.4, abs=0.005)


def test_deceleration_ends_at_rest_by_adding_up() -> None:
    step = 50.0 * Ts
    for x in (0.03, step, 3.7 * step, 12.0 * step):
        falling = np.array([max(x - i * step, 0.0) for i in range(20)])
        found = deceleration(np.array([Ts * falling.sum()]), np.array([50.0]), Ts)
        assert found[0] == pytest.approx(x)


# --- limits of what is sent ---


def test_what_is_sent_is_looked_at_by_itself() -> None:
    envelope = limits(2, 5.0, 1000.0, reach=1.0)
    n = np.zeros(2)
    rest = Setpoint(n, n, n)

    def after(qdd: float, q: float = 0.0, qd: float = 0.0, before: Setpoint = rest) -> str:
        a = np.array([0.0, qdd])
        fair = before.q + Ts * before.qd + 0.5 * Ts**2 * a, before.qd + Ts * a
        return envelope.refusal(before, Setpoint(fair[0] + [0.0, q], fair[1] + [0.0, qd], a))

    assert after(1.0) == ""
    assert "joint 2 exceeds its jerk" in after(2.1)
    moving = Setpoint(np.array([0.0, 0.5]), np.array([0.0, 2.9999]), np.array([0.0, 5.0]))
    assert "exceeds its speed" in after(5.0, before=moving)
    assert "exceeds its acceleration" in after(0.0, qd=0.02)
    assert "is outside its range" in after(0.0, q=1.01)
    assert "jumps" in after(0.0, q=0.001)
    assert "not finite" in after(np.nan)


def test_an_arm_without_a_limit_of_acceleration_is_refused() -> None:
    robot = Scenario.load("example-2d-fov").setup().scene.robot
    with pytest.raises(ConfigurationError, match="no acceleration limits"):
        Envelope.of(robot, ActuatorLimits(), Ts)
    own = Envelope.of(
        SETUP.scene.robot, ActuatorLimits(acceleration=(50.0, 3.0, 50.0, 50.0, 50.0, 50.0)), Ts
    )
    assert own.acceleration.tolist() == [40.0, 3.0, 40.0, 40.0, 40.0, 40.0]


# --- a dry run is the simulation ---


@pytest.mark.parametrize("images", ["simulated", "model"])
def test_a_dry_run_is_what_is_simulated(images: str) -> None:
    setup, log = run_on_arm(
        Job(
            SETUP,
            HierarchicalQP(),
            driver_for("simulated://", SETUP),
            image_source(images, SETUP),
            supervision=FAST,
        )
    )
    assert (log.ended, log.cause, log.missed, log.remarks) == ("done", "", 0, ())
    assert_stopped(log)
    ours = trajectory_of(setup, log, "simulated://")
    theirs = simulate(SETUP, HierarchicalQP())
    for name in (
        "q",
        "qd",
        "qdd_command",
        "phi",
        "sigma",
        "clearance",
        "features_px",
        "camera_error",
    ):
        np.testing.assert_allclose(
            getattr(ours, name), getattr(theirs, name), atol=1e-8, err_msg=name
        )
    assert (ours.active == theirs.active).all()
    assert (ours.labels, ours.status, ours.compiled) == (
        theirs.labels,
        theirs.status,
        theirs.compiled,
    )


@pytest.mark.parametrize("name", [FOLDER_LAWS["goal-governor"], "implicit-switch-with-drift"])
def test_a_law_that_uses_a_model_or_the_period_is_told(name: str) -> None:
    setup = replace(SETUP, duration=5 * Ts)
    log = on("simulated://", make_controller(name), setup=setup)
    assert log.ended == "done"
    np.testing.assert_allclose(
        log.column("q")[:6], simulate(setup, make_controller(name)).q, atol=1e-7
    )


def test_spoilt_gradients_are_for_simulations() -> None:
    with pytest.raises(ConfigurationError, match="applies to simulations only"):
        on("simulated://", setup=UR5.with_override("disturbances", {"gradient_error": 0.1}).setup())


def test_a_dry_run_moves_the_scenarios_own_arm() -> None:
    heavy = UR5.with_override(
        "plant", {"type": "dynamics", "controller": "position", "payload": {"mass": 1.0}}
    )
    setup = heavy.with_override("duration", 0.1).setup()
    log = on("simulated://", SlidingMode(), setup=setup)
    theirs = simulate(setup, SlidingMode())
    q = log.column("q")[~log.braking]
    np.testing.assert_allclose(q, theirs.q, atol=1e-8)
    assert np.abs(q - log.column("sent_q")[~log.braking]).max() > 1e-5


def test_custom_code_that_fails_besides_the_motion_loses_no_log(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Unbound(HierarchicalQP):
        def bind(self, *given: Any) -> Any:
            raise ValueError("no such form")

    setup = replace(SETUP, duration=0.05)
    driver = driver_for("simulated://", setup)
    monkeypatch.setattr(driver, "send", lambda q, qd: pytest.fail("it moves"))
    with pytest.raises(ValueError, match="no such form"):
        run_on_arm(Job(setup, Unbound(), driver))

    class Silent(SimulatedImages):
        def remarks(self) -> list[str]:
            raise ValueError("nothing to say")

    log = on("simulated://", images=Silent(setup), setup=setup)
    assert log.ended == "done"
    assert "nothing to say" in log.remarks[-1]


def test_images_of_a_dry_run_come_late_and_rarely() -> None:
    setup = UR5.with_override("disturbances", {"image_period": 0.02, "delay": 1}).setup()
    eye = image_source("simulated", setup)
    assert eye is not None
    seen = [eye(k * Ts, setup.q0) for k in range(35)]
    assert all(one is not None for one in seen)
    ages = [
        k * Ts - one.taken
        for k, one in enumerate(seen)
        if one is not None and one.taken is not None
    ]
    np.testing.assert_allclose(ages[20:30], 0.02 + Ts * np.arange(10), atol=1e-12)
    wrong = UR5.with_override("disturbances", {"focal_factor": [1.1, 1.1]}).setup()
    with pytest.raises(ConfigurationError, match="disturbances of calibration"):
        image_source("simulated", wrong)


# --- everything that can go wrong ends in a stop ---


def test_a_dry_run_sees_rendered_images() -> None:
    setup = Scenario.load("ur5-images").with_override("duration", 0.08).setup()
    job = Job(
        setup, HierarchicalQP(), driver_for("simulated://", setup), image_source("simulated", setup)
    )
    started, log = run_on_arm(job)
    theirs = simulate(setup, HierarchicalQP())
    np.testing.assert_allclose(trajectory_of(started, log, "simulated://").q, theirs.q, atol=1e-6)
    assert np.abs(log.column("pixels")[~log.braking] - theirs.features_px).max() > 1e-3
    assert log.remarks == ()
    other = Scenario.load("ur5-images").with_override(
        "sensor", {"type": "images", "printed": [0, 1, 2, 17]}
    )
    setup = other.with_override("duration", 0.01).setup()
    log = run_on_arm(
        replace(
            job,
            setup=setup,
            driver=driver_for("simulated://", setup),
            images=SimulatedImages(setup),
        )
    )[1]
    assert log.remarks == ("tags were seen that are not the board's: 17",)
    with pytest.raises(ConfigurationError, match="rendered in simulated time only"):
        run_on_arm(replace(job, driver=driver_for("loopback://", job.setup)))


def test_a_camera_that_leaves_is_told(tmp_path: Path) -> None:
    (tmp_path / "leaving_camera.py").write_text(
        "import sys\n\n\ndef eye(setup):\n    sys.exit('no camera')\n"
    )
    with pytest.raises(
        ConfigurationError, match="images by leaving_camera:eye: SystemExit: no camera"
    ):
        image_source("leaving_camera:eye", SETUP, tmp_path)


class Own(Controller):
    """The hierarchical QP until its call of this number; then something happens."""

    name = "own"

    def __init__(self, happens: Any, at: int = 60) -> None:
        self._law = HierarchicalQP()
        self._happens = happens
        self._left = at

    def solve(self, rows: Rows, task: Task) -> Command:
        self._left -= 1
        command = self._law.solve(rows, task)
        return self._happens(command) if self._left <= 0 else command


def nan(command: Command) -> Command:
    return replace(command, qdd=np.full(6, np.nan))


def wrong(command: Command) -> Command:
    raise KeyError("a law's own mistake")


def leave(command: Command) -> Command:
    sys.exit("no camera")


@pytest.mark.parametrize(
    ("happens", "told"),
    [(nan, "not finite"), (wrong, "a law's own mistake"), (leave, "SystemExit: no camera")],
)
def test_a_law_that_fails_ends_in_a_braked_stop(happens: Any, told: str) -> None:
    log = on("loopback://?time=simulated&patience=5", Own(happens))
    assert log.ended == "failed"
    assert told in log.cause
    assert log.cause.startswith("t = 0.112 s")
    assert log.braking.any()
    assert_stopped(log)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_in_a_braked_stop(number: signal.Signals) -> None:
    before = signal.getsignal(number)

    def asked(command: Command) -> Command:
        os.kill(os.getpid(), number)
        return command

    log = on("loopback://?time=simulated&patience=5", Own(asked))
    assert (log.ended, log.signal) == ("stopped", number)
    assert number.name in log.cause
    assert_stopped(log)
    assert signal.getsignal(number) == before


def test_lost_images_end_in_a_braked_stop() -> None:
    seen = SETUP.scene.glance(SETUP.q0)[0]

    def eye(t: float, q: Array) -> Measurement | None:
        pixels = SETUP.scene.glance(q)[0] if t < 0.05 else np.full_like(seen, np.nan)
        return Measurement(pixels, None, t)

    log = on(
        "loopback://?time=simulated&patience=5", images=eye, supervision=Supervision(image_s=0.04)
    )
    assert log.cause == "t = 0.09 s: no image shows a marker since t = 0.048 s"
    assert_stopped(log)
    # by the system's clock an image would never be old
    for taken in (1.7e9, np.nan):
        ahead = on("simulated://", images=lambda t, q, taken=taken: Measurement(seen, None, taken))
        assert "in the future: is it from another clock?" in ahead.cause
    never = on(
        "loopback://?time=simulated&patience=5",
        images=lambda t, q: None,
        supervision=Supervision(image_s=0.04),
    )
    assert "no image shows a marker" in never.cause
    nothing: Any = np.zeros(3)
    odd = on("simulated://", images=lambda t, q: nothing)
    assert "the source of images returned " in odd.cause
    assert odd.at_rest


class Unpunctual(SimulatedClock):
    """Each period begins late, by less than a period."""

    def wait(self, until: float) -> None:
        super().wait(until)
        self.t += 0.75 * Ts


@pytest.mark.parametrize(
    ("ahead", "told"),
    [(0.0, ""), (5e-4, ""), (0.0011, "ms in the future"), (0.5, "ms in the future")],
)
def test_a_stamp_is_judged_against_now(
    ahead: float, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A thread stamps images as they arrive: later than the period was to begin, and than the state
    was read.
    """
    clock = Unpunctual()
    monkeypatch.setattr(stream, "SimulatedClock", lambda: clock)

    def eye(t: float, q: Array) -> Measurement:
        clock.t += 1e-5  # an image arrives
        assert t < clock.t
        return Measurement(SETUP.scene.glance(q)[0], None, clock.t + ahead)

    log = on("simulated://", images=eye, setup=replace(SETUP, duration=0.1))
    assert (log.ended == "done") == (not told), log.cause
    assert told in log.cause
    if not told:
        # the law is told the time at which the state was read, to which the image counts
        own = ~log.braking
        np.testing.assert_allclose(
            log.column("taken")[own] - log.column("scheduled")[own], 0.75 * Ts, atol=1e-3
        )


@pytest.mark.parametrize(
    ("kind", "told"),
    [
        (Decimal, ""),
        (lambda taken: np.array([taken]), ""),
        (lambda taken: "now", "an image's time must be a number [s], not 'now'"),
        (lambda taken: np.array([taken, taken]), "an image's time must be a number [s]"),
    ],
)
def test_a_stamp_of_another_type_leaves_the_log_writable(
    kind: Callable[[float], Any], told: str, tmp_path: Path
) -> None:
    def eye(t: float, q: Array) -> Measurement:
        return Measurement(SETUP.scene.glance(q)[0], None, kind(t) if t > 0.05 else t)

    log = on("simulated://", images=eye, setup=replace(SETUP, duration=0.1))
    assert told in log.cause
    assert (log.ended == "done") == (not told)
    log.save(tmp_path / "log.npz")
    with np.load(tmp_path / "log.npz") as kept:
        assert kept["taken"].shape == kept["scheduled"].shape


def test_a_camera_that_stamps_in_a_thread_is_by_no_other_clock() -> None:
    """In real time, as README's reader would do it."""
    newest: list[tuple[float, Array]] = []
    over = threading.Event()
    here: list[Array] = [SETUP.q0]

    def camera() -> None:
        while not over.wait(0.001):
            newest.append((time.perf_counter(), SETUP.scene.glance(here[0])[0]))

    def eye(t: float, q: Array) -> Measurement | None:
        begun = time.perf_counter() - t
        here[0] = q.copy()
        return Measurement(newest[-1][1], None, newest[-1][0] - begun) if newest else None

    thread = threading.Thread(target=camera, daemon=True)
    thread.start()
    address, end = fake_arm_server()
    patient = Supervision(
        late_s=10.0, hang_s=10.0, image_s=10.0, speed_rad_s=100.0, following_rad=10.0
    )
    log = on(f"{address}?patience=20", images=eye, supervision=patient)
    over.set()
    thread.join()
    end()
    # a machine that is late may end it for another reason
    assert "is it from another clock" not in log.cause
    assert len(log.periods) > 5


def test_an_image_that_is_masked_shows_what_is_not_masked() -> None:
    """As with NaN for the markers that were not found."""
    hidden = np.zeros((4, 2), dtype=np.bool_)
    hidden[2] = True

    def masked(t: float, q: Array) -> Measurement:
        seen = SETUP.scene.glance(q)[0] + 500.0 * hidden
        return Measurement(np.ma.array(seen, mask=hidden), None, t)

    log = on("simulated://", images=masked)
    assert log.ended == "done", log.cause
    assert np.isnan(log.column("pixels")[~log.braking][:, 2]).all()
    all_hidden = on(
        "simulated://",
        images=lambda t, q: Measurement(np.ma.masked_all((4, 2)), None, t),
        supervision=Supervision(image_s=0.04),
    )
    assert "no image shows a marker since t = 0 s" in all_hidden.cause


def test_a_camera_can_tell_its_pose_alone() -> None:
    """A pose that is said to be elsewhere bends the way there, as pixels would."""
    straight = on("simulated://", images=None)
    camera_pose = SETUP.scene.camera_pose
    as_is, elsewhere = (
        on("simulated://", images=lambda t, q, by=by: Measurement(camera=by @ camera_pose(q, t)))
        for by in (Pose(np.eye(3), np.zeros(3)), Pose(np.eye(3), np.array([0.0, 0.02, 0.0])))
    )
    assert straight.ended == as_is.ended == elsewhere.ended == "done"
    np.testing.assert_allclose(as_is.column("sent_q"), straight.column("sent_q"), atol=1e-9)
    assert np.abs(elsewhere.column("sent_q") - straight.column("sent_q")).max() > 1e-3


Eyes = Callable[[float, Array], Array]


def shown(eye: Eyes, setup: Setup = SETUP, **bounds: float) -> ArmLog:
    """A run whose images are right but for what the eye makes of them."""

    def newest(t: float, q: Array) -> Measurement:
        return Measurement(eye(t, setup.scene.glance(q)[0]), None, t)

    return on("simulated://", images=newest, setup=setup, supervision=Supervision(**bounds))


HALF = 0.5 * np.asarray(SETUP.scene.camera.size)


@pytest.mark.parametrize(
    ("eye", "told"),
    [
        (lambda t, seen: seen * (-1.0, 1.0), "it fits a mirrored image"),
        (lambda t, seen: -seen, "it fits an image upside down"),
        (lambda t, seen: seen + HALF, "it fits pixels counted from the image's corner"),
        (lambda t, seen: seen[[1, 0, 2, 3]], "it fits another order of the markers"),
        (lambda t, seen: seen[[1, 2, 3, 0]], "it fits another order of the markers"),
        (
            lambda t, seen: SETUP.scene.camera.normalised(seen),
            "it fits coordinates in metres, or normalised, in place of pixels",
        ),
        (
            lambda t, seen: seen + np.array([0.0, 60.0]),
            "a camera that was moved, or a target that is elsewhere",
        ),
    ],
)
def test_an_image_that_cannot_be_right_moves_nothing(eye: Eyes, told: str) -> None:
    log = shown(eye)
    assert log.ended == "failed"
    assert log.cause.startswith("t = 0 s: marker ")
    assert told in log.cause
    assert not log.column("sent_qd").any()


def test_images_with_a_hidden_marker_are_known_as_frozen_too() -> None:
    frozen: list[Array] = []

    def eye(t: float, seen: Array) -> Array:
        seen = seen.copy()
        seen[3] = np.nan
        if t >= 0.1:
            frozen.append(seen)
            return frozen[0]
        return seen

    log = shown(eye, setup=replace(SETUP, duration=1.0), image_share=0.05)
    assert "are they frozen?" in log.cause


def test_an_image_that_becomes_wrong_brakes_and_is_named() -> None:
    """Frozen from 0.1 s on; the arm goes on until a marker should be beyond the bound, which is
    told with the log.
    """
    frozen: list[Array] = []

    def eye(t: float, seen: Array) -> Array:
        if t >= 0.1:
            frozen.append(seen)
            return frozen[0]
        return seen

    log = shown(eye, setup=replace(SETUP, duration=1.0), image_share=0.05)
    assert "images have not changed for" in log.cause
    assert "are they frozen?" in log.cause
    assert "(allowed are 24 px and 50 %)" in log.cause
    assert_stopped(log)
    image = log.column("innovation")[~log.braking, 0]
    # the first ones were right, and the one that ended the run is not in the log
    assert image[:50].max() < 1e-6
    assert 20.0 < image.max() <= 24.0
    assert log.bounds["image_share"] == 0.05
    patient = shown(eye, setup=replace(SETUP, duration=0.3), image_share=10.0, shape_share=10.0)
    assert patient.ended == "done"


def test_images_that_are_too_old_are_not_used() -> None:
    """Newer ones come in between, so that there is always one that is new enough."""

    def eye(t: float, q: Array) -> Measurement:
        old = round(t / Ts) % 2 == 1 and t > 0.1
        return Measurement(SETUP.scene.glance(SETUP.q0 if old else q)[0], None, 0.0 if old else t)

    log = on("simulated://", images=eye, supervision=Supervision(image_s=0.09))
    assert log.cause.startswith("t = 0.102 s: ")
    assert "the image is 0.102 s old (allowed are 0.09 s)" in log.cause
    assert_stopped(log)


def test_depths_in_millimetres_move_nothing() -> None:
    def eye(t: float, q: Array, unit: float = 1000.0) -> Measurement:
        scene = SETUP.scene
        return Measurement(scene.glance(q)[0], unit * scene.depth(scene.camera_pose(q)), t)

    log = on("simulated://", images=eye)
    assert log.ended == "failed"
    assert "are depths in millimetres, not metres?" in log.cause
    assert not log.column("sent_qd").any()
    right = on(
        "simulated://", setup=replace(SETUP, duration=0.1), images=lambda t, q: eye(t, q, 1.0)
    )
    assert right.ended == "done"
    assert right.column("innovation").shape[1:] == (len(INNOVATIONS),)


def test_a_pose_that_cannot_be_right_brakes() -> None:
    camera_pose = SETUP.scene.camera_pose
    by = Pose(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))
    log = on("simulated://", images=lambda t, q: Measurement(camera=camera_pose(q, t) @ by))
    assert " m and 3.14 rad from where the joints have it" in log.cause
    far = Pose(np.eye(3), np.array([0.0, 0.25, 0.0]))
    log = on("simulated://", images=lambda t, q: Measurement(camera=far @ camera_pose(q, t)))
    assert "the camera is measured 0.25 m and " in log.cause


@pytest.mark.parametrize(
    "wrong", [lambda qd: qd + 100.0, lambda qd: 57.3 * qd, lambda qd: 0.0 * qd]
)
def test_a_joint_speed_that_cannot_be_right_brakes(wrong: Any) -> None:
    driver = driver_for("simulated://", SETUP)
    read = driver.read
    begun = []

    def mistaken() -> Joints:
        state = read()
        begun.append(state.t)
        return state._replace(qd=wrong(state.qd)) if 0.05 < state.t < 0.2 else state

    driver.read = mistaken  # type: ignore[method-assign]
    log = run_on_arm(
        Job(SETUP, HierarchicalQP(), driver, supervision=replace(FAST, speed_rad_s=0.2))
    )[1]
    assert "rad/s from the change of its measured positions (allowed are 0.2)" in log.cause
    assert_stopped(log)


@pytest.mark.parametrize(
    ("fault", "told", "streamed"),
    [
        ("stall", "the arm has not answered within 300 ms", False),
        ("drop", "the arm closed the connection", False),
        ("jump", "deviates by 0.5 from its setpoint", True),
        ("refuse", "the arm stopped by itself: protective stop", False),
        (
            "freeze",
            "the arm's clock has stopped at 0.12 s: the same state was read for 10 periods",
            False,
        ),
    ],
)
def test_an_arm_that_fails_is_stopped(fault: Fault, told: str, streamed: bool) -> None:
    driver = driver_for(f"loopback://?time=simulated&fault={fault}&at=0.12&patience=0.3", SETUP)
    assert isinstance(driver, LoopbackArm)
    log = run_on_arm(Job(SETUP, HierarchicalQP(), driver, supervision=FAST))[1]
    assert log.ended == "failed"
    assert told in log.cause
    assert log.at_rest == streamed
    # 0.12 s are 60 periods
    assert len(log.periods) <= 60 + 10 or streamed
    assert ("braked to rest" if streamed else "stop command sent") in log.stop
    arm = driver.arm
    before = arm.state()[1]
    assert streamed or np.abs(before).max() > 0.01
    # braked by its own limit, and at rest
    arm.advance(WATCHDOG_S + np.abs(before).max() / 40.0 + Ts)
    assert np.abs(arm.state()[1]).max() < 1e-12


def test_an_arm_that_cannot_be_told_is_said_loudly(monkeypatch: pytest.MonkeyPatch) -> None:
    def lost(self: Any, deceleration: float) -> None:
        raise ArmError("no route to the arm")

    monkeypatch.setattr("vsconstraints.arms.drivers.loopback.LoopbackArm.halt", lost)
    log = on("loopback://?time=simulated&patience=5&fault=drop&at=0.1")
    assert "THE STOP COMMAND COULD NOT BE SENT (no route to the arm)" in log.stop
    assert not log.at_rest


def test_what_slips_through_the_first_check_is_not_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    def careless(self: stream.Stream, qdd: Array) -> tuple[Array, bool]:
        return (qdd if (qdd == 41.0).all() else np.clip(qdd, -40.0, 40.0)), False

    monkeypatch.setattr(stream.Stream, "within_limits", careless)
    log = on(
        "simulated://",
        Own(lambda command: replace(command, qdd=np.full(6, 41.0))),
        setup=without_limits(),
    )
    assert "not sent, joint 1 exceeds its acceleration: 41" in log.cause
    assert_stopped(log)


def without_limits() -> Setup:
    return replace(SETUP, limits=ActuatorLimits())


def test_a_switch_that_would_exceed_a_speed_by_a_period_is_kept_from_it() -> None:
    log = on("simulated://", SlidingMode())
    assert log.column("guarded").any()
    assert simulate(SETUP, SlidingMode()).qd.min() < -SETUP.scene.robot.qd_max[5] - 1e-4
    assert log.column("sent_qd").min() >= -SETUP.scene.robot.qd_max[5] - 1e-9


def test_commands_beyond_the_arm_are_brought_to_its_limits() -> None:
    log = on(
        "simulated://",
        Own(lambda command: replace(command, qdd=np.full(6, 45.0))),
        setup=without_limits(),
    )
    assert "commands were clipped to the arm's limits" in log.remarks[0]
    assert_stopped(log)


def test_a_law_that_returns_after_the_watchdog_has_taken_over_moves_no_setpoint(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    prepared: list[str] = []
    prepare = Stream.prepare
    job = Job(SETUP, Own(lambda command: late(command), at=20), driver_for("simulated://", SETUP))
    run = ArmRun(job, Envelope.of(SETUP.scene.robot, SETUP.limits, Ts))

    def late(command: Command) -> Command:
        run.take_over()
        return command

    def noted(stream: Stream, qdd: Array) -> Any:
        prepared.append(run.takeover)
        return prepare(stream, qdd)

    monkeypatch.setattr(Stream, "prepare", noted)
    log = run.all_periods()
    assert_told(log, "the loop was blocked")
    assert prepared
    assert not any(prepared)


@pytest.mark.parametrize(
    "interrupt", [signal.default_int_handler, signal.SIG_IGN], ids=["heard", "ignored"]
)
def test_a_loop_that_hangs_is_braked_by_the_watchdog(
    interrupt: Any, request: pytest.FixtureRequest
) -> None:
    """Also where a shell has started it in the background, which ignores Ctrl-C."""
    before = signal.signal(signal.SIGINT, interrupt)
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, before))

    def hang(command: Command) -> Command:
        while True:  # until the watchdog ends it
            time.sleep(0.005)

    address, end = fake_arm_server()
    patient = Supervision(late_s=10.0, hang_s=0.1, following_rad=10.0, speed_rad_s=100.0)
    log = on(f"{address}?patience=20", Own(hang, at=10), supervision=patient)
    end()
    assert_told(log, "was blocked for 100 ms")
    assert "braked to rest" in log.stop


def test_an_arm_brakes_by_itself_where_python_is_held() -> None:
    def hold(command: Command) -> Command:
        if law._left == -10:
            ctypes.PyDLL(None).usleep(400_000)  # in C, without letting go of the interpreter
        # on a slow machine setpoints come late, and motion would be refused
        return replace(command, qdd=np.zeros(6))

    law = Own(hold, at=0)
    patient = Supervision(late_s=10.0, hang_s=10.0)
    log = on("loopback://?patience=20", law, supervision=patient)
    assert log.ended == "failed"
    assert "the arm stopped by itself: its watchdog received nothing for 100 ms" in log.cause


def test_a_stop_after_silence_begins_where_the_arm_is() -> None:
    driver = driver_for("simulated://", SETUP)
    n = np.zeros(6)
    line = stream.Stream(driver, limits(6), n, 4)
    line.clock = Late(*(0.0,) * 1000)  # type: ignore[assignment]
    line.begin()
    states: list[Joints] = []
    sent: list[Array] = []

    def send(q: Array, qd: Array) -> None:
        sent.append(q)
        states.append(Joints(line.clock.now(), q, qd))

    driver.read, driver.send = lambda: states[-1], send  # type: ignore[method-assign]
    for late in (0.003, 0.05):
        line.send(Setpoint(n, np.full(6, 0.2), n))
        sent.clear()
        line.clock.t += Ts + late  # type: ignore[union-attr]
        states.append(Joints(line.clock.now(), n + 0.01, np.full(6, 0.1)))
        line.bring_to_rest(False, lambda: None)
        # v²/2a beyond where it was sent, or beyond where it is
        far = 0.2**2 / 10.0 if late < 0.01 else 0.01 + 0.1**2 / 10.0
        np.testing.assert_allclose(sent[-1], far, atol=1e-9)
        assert line.stop[1]


def test_a_stop_that_is_held_up_makes_up_for_nothing() -> None:
    moving = Setpoint(np.zeros(6), np.full(6, 0.5), np.zeros(6))
    for held, beside in ((0.007, 0.0), (0.05, 0.003)):
        driver = driver_for("simulated://", SETUP)
        line = stream.Stream(driver, limits(6), moving.q, 4)
        sent = []
        line.clock = clock = Late(*(0.0,) * 10, held, *(0.0,) * 200)  # type: ignore[assignment]

        def send(q: Array, qd: Array, sent: list[Any] = sent, clock: Late = clock) -> None:
            sent.append((clock.t, q, qd))

        # it follows, and is held for as long as nothing is sent
        driver.read = lambda sent=sent, clock=clock: Joints(
            clock.t, sent[-1][1] + 0.003, sent[-1][2]
        )  # type: ignore[misc,method-assign]
        driver.send = send  # type: ignore[method-assign]
        line.begin()
        line.send(moving)
        line.bring_to_rest(False, lambda: None)
        assert line.stop[1]
        times = np.array([t for t, _, _ in sent])
        assert np.diff(times[1:]).min() > 0.99 * Ts
        # by as much as the arm was measured beside where it was sent
        np.testing.assert_allclose(sent[-1][1], 0.5**2 / 10.0 + beside, atol=1e-9)


def test_a_stop_that_is_held_up_again_and_again_is_the_arms_own() -> None:
    driver = driver_for("simulated://", SETUP)
    told = []
    line = stream.Stream(driver, limits(6, jerk=50.0), SETUP.q0, 4)
    line.clock = Late(*(0.02,) * 9)  # type: ignore[assignment]
    driver.read = lambda: Joints(line.clock.now(), SETUP.q0, np.full(6, 0.5))  # type: ignore[method-assign]
    driver.send, driver.halt = lambda q, qd: None, told.append  # type: ignore[method-assign]
    line.begin()
    line.bring_to_rest(False, lambda: None)
    assert line.stop[0] == "while braking, setpoints came too late 4 times; stop command sent"
    assert told


def test_a_stop_does_not_begin_at_a_state_that_is_not_finite() -> None:
    driver = driver_for("simulated://", SETUP)
    sent = []
    told = []
    line = stream.Stream(driver, limits(6), SETUP.q0, 4)
    line.clock = clock = Late(*(0.0,) * 100)  # type: ignore[assignment]
    line.begin()
    clock.t += 0.05
    driver.read = lambda: Joints(0.0, SETUP.q0, np.full(6, np.nan))  # type: ignore[method-assign]
    driver.send, driver.halt = lambda q, qd: sent.append(qd), told.append  # type: ignore[method-assign]
    line.bring_to_rest(False, lambda: None)
    assert line.stop[0] == "while braking, the arm's state is not finite; stop command sent"
    assert told
    assert not sent


def test_an_arm_that_goes_on_after_its_stop_is_told_to_stop_by_itself() -> None:
    driver = driver_for("simulated://", SETUP)
    told = []
    moving = np.array([0.0, 0.0, -0.3, 0.0, 0.0, 0.0])
    driver.read = lambda: Joints(line.clock.now(), SETUP.q0, moving)  # type: ignore[method-assign]
    driver.halt = told.append  # type: ignore[method-assign]
    line = stream.Stream(driver, limits(6, 7.0), SETUP.q0, 4)
    line.begin()
    line.bring_to_rest(False, lambda: None)
    assert line.stop == (
        "while braking, joint 3 still moves at -0.3 rad/s, 0.5 s after it was sent to rest; stop "
        "command sent",
        False,
    )
    assert told == [7.0]


def test_a_drivers_own_mistake_does_not_keep_an_arm_from_its_stop() -> None:
    driver = driver_for("simulated://", SETUP)
    line = stream.Stream(driver, limits(6), SETUP.q0, 4)
    told = []

    def mistaken() -> Joints:
        raise KeyError("joint 7")

    # type: ignore[method-assign]
    driver.read = mistaken
    driver.halt = told.append
    line.bring_to_rest(False, lambda: None)
    assert line.stop[0].startswith("while braking, KeyError: 'joint 7'")
    assert line.stop[0].endswith("stop command sent")
    assert told
    driver.halt = lambda deceleration: mistaken()  # type: ignore[method-assign,assignment,return-value]
    line.bring_to_rest(True, lambda: None)
    assert "THE STOP COMMAND COULD NOT BE SENT (KeyError: 'joint 7'" in line.stop[0]


def test_a_call_to_the_arm_that_hangs_is_answered_by_the_arms_own_stop() -> None:
    address, end = fake_arm_server(stalls=True)
    log = on(f"{address}?patience=1", supervision=Supervision(late_s=10.0, hang_s=0.05))
    end()
    assert log.ended == "failed"
    assert log.stop.endswith("stop command sent")


@pytest.mark.parametrize(("allowed", "told"), [(2.0, ""), (0.2, "the loop was blocked for 300 ms")])
def test_an_arm_may_take_its_time_to_be_ready(
    allowed: float, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Longer than the loop may later say nothing, while it stands."""
    monkeypatch.setattr(SocketArm, "begin", lambda arm: time.sleep(0.5))
    address, end = fake_arm_server()
    bounds = Supervision(late_s=10.0, begin_s=allowed, hang_s=0.1)
    log = on(f"{address}?patience=5", supervision=bounds, setup=replace(SETUP, duration=0.1))
    end()
    if told:
        assert_told(log, told)
    elif log.ended != "done":
        assert_told(log, "the arm may take its time")


def fake_arm_server(stalls: bool = False) -> tuple[str, Any]:
    own = Envelope.of(SETUP.scene.robot, SETUP.limits, Ts)
    arm = FakeArm(
        SETUP.q0, replace(own, qd_max=10.0 * own.qd_max, acceleration=100.0 * own.acceleration), 2.0
    )
    port, end = in_thread(arm, stalls)
    return f"socket://127.0.0.1:{port}", end


def test_missed_periods_of_a_real_loop_are_a_column(tmp_path: Path) -> None:
    """The law is quick: what else keeps the loop waiting counts, too."""

    def eye(t: float, q: Array) -> Measurement:
        time.sleep(0.02 if 0.02 < t < 0.04 else 0.0)
        return Measurement(SETUP.scene.glance(q)[0], None, t)

    address, end = fake_arm_server()
    setup = replace(SETUP, duration=0.08)
    log = on(
        f"{address}?patience=5",
        images=eye,
        setup=setup,
        supervision=Supervision(late_s=10.0, hang_s=10.0),
    )
    end()
    assert log.missed >= 1
    log = replace(log, missed=17)  # what the law took cannot be as many by chance
    suite = Suite.load().select(
        ["ur5-fov"], ["hierarchical-qp"], settings=["scenario.duration=0.08"]
    )
    with folder.locked(tmp_path, "a comparison"):
        record.store(tmp_path, suite, setup, log, "loopback://")
    line = next(
        line
        for line in StoredComparison.load(tmp_path).results
        if line["controller"] == "hierarchical-qp"
    )
    assert int(line["missed_periods"]) == 17
    assert log.real_time
    assert not on("simulated://", setup=setup).real_time


def test_a_period_that_is_much_too_late_ends_in_a_braked_stop() -> None:
    def slow(command: Command) -> Command:
        time.sleep(0.05)
        return command

    address, end = fake_arm_server()
    bounds = Supervision(late_s=0.03, hang_s=10.0, following_rad=10.0, speed_rad_s=100.0)
    log = on(f"{address}?patience=20", Own(slow, at=10), supervision=bounds)
    end()
    assert_told(log, "ms late")


# --- before anything moves ---


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"off": 0.1}, "does not stand at the scenario's start: joint 1 is at 0.764, not at 0.664"),
        ({"moving": 0.02}, "the arm moves: joint 3 at 0.02"),
        ({"joints": 5}, "the arm has 5 joints"),
        ({"off": np.nan}, "not finite"),
    ],
)
def test_an_arm_that_is_not_ready_does_not_start(change: dict[str, float], told: str) -> None:
    driver = driver_for("simulated://", SETUP)
    q = SETUP.q0.copy()
    qd = np.zeros(6)
    q[0] += change.get("off", 0.0)
    qd[2] = change.get("moving", 0.0)
    n = int(change.get("joints", 6))
    sent: list[Array] = []
    driver.read = lambda: SimpleNamespace(t=0.0, q=q[:n], qd=qd[:n])  # type: ignore[method-assign,assignment,return-value]
    driver.send = lambda q, qd: sent.append(q)  # type: ignore[method-assign]
    with pytest.raises(ConfigurationError, match=told):
        run_on_arm(Job(SETUP, HierarchicalQP(), driver))
    assert not sent


def test_a_run_can_start_where_the_arm_stands() -> None:
    address = "loopback://?time=simulated&patience=5&off=0.005"
    near = Supervision(start_rad=0.004)
    with pytest.raises(ConfigurationError, match="--from-arm"):
        on(address, supervision=near)
    job = Job(SETUP, HierarchicalQP(), driver_for(address, SETUP), supervision=near, from_arm=True)
    setup, log = run_on_arm(job)
    assert log.ended == "done"
    np.testing.assert_allclose(setup.q0, SETUP.q0 + 0.005)
    np.testing.assert_allclose(log.periods[0].q, SETUP.q0 + 0.005)
    with pytest.raises(ConfigurationError, match="outside the image"):
        on("loopback://?time=simulated&patience=5&off=0.05", from_arm=True)


def test_a_law_without_a_command_at_the_start_moves_nothing() -> None:
    with pytest.raises(ConfigurationError, match=r"own has no command at the start: .*not finite"):
        on("simulated://", Own(nan, at=0))


@pytest.mark.parametrize(
    ("address", "told"),
    [
        ("192.168.0.2", "is like ur-rtde://"),
        ("loopbak://", "unknown kind of arm 'loopbak'. Did you mean 'loopback'"),
        ("loopback://?fault=stal", "unknown fault of loopback 'stal'. Did you mean 'stall'"),
        (
            "loopback://?patiense=1",
            "unknown option of loopback 'patiense'. Did you mean 'patience'",
        ),
        ("loopback://?at=soon", "must be a number"),
        ("loopback://host:port", "cannot be read"),
        ("loopback://host/path", "SCHEME://HOST:PORT"),
        ("ur-rtde://", "needs the arm's address"),
        ("ur-rtde://host?gain=5", "a gain of 100 to 2000"),
        ("ur-rtde://host:30004", "ports of the arm are fixed: give ur-rtde://host, without :30004"),
        (
            "simulated://192.168.0.2",
            "runs in this process and takes no address: leave out '192.168.0.2'",
        ),
        ("loopback://:30004", "runs in this process"),
        ("loopback://?patience=0", "patience of loopback must be positive"),
    ],
)
def test_addresses_that_cannot_be_used(address: str, told: str) -> None:
    with pytest.raises(ConfigurationError) as raised:
        driver_for(address, SETUP)
    assert told in str(raised.value)


def test_nobody_listens() -> None:
    server = Server(FakeArm(np.zeros(6), Envelope(*(np.ones(6),) * 5, period=Ts)))
    server.close()
    with pytest.raises(ArmError, match=r"no arm answers at 127\.0\.0\.1"):
        on(f"socket://127.0.0.1:{server.port}")


# --- the fake arm ---


def one_joint(acceleration: float) -> FakeArm:
    one = np.ones(1)
    return FakeArm(np.zeros(1), Envelope(-one, one, one, acceleration * one, np.inf * one, Ts))


def test_the_fake_arm_follows_then_goes_on_then_brakes() -> None:
    arm = one_joint(10.0)
    arm.take(np.array([1e-5]), np.array([0.01]))
    assert arm.state()[0] == 0.0
    arm.advance(Ts)
    np.testing.assert_allclose(arm.state(), [[1e-5], [0.01]])
    arm.advance(WATCHDOG_S)
    np.testing.assert_allclose(arm.state(), [[1e-5 + WATCHDOG_S * 0.01], [0.01]])
    assert not arm.stopped
    arm.advance(1.0)
    np.testing.assert_allclose(
        arm.state(), [[1e-5 + WATCHDOG_S * 0.01 + 0.01**2 / 20.0], [0.0]], atol=1e-15
    )
    assert arm.stopped == "its watchdog received nothing for 100 ms"


def test_the_fake_arm_refuses_what_it_cannot_do() -> None:
    def sent(late: float, q: float, qd: float) -> str:
        arm = one_joint(10.0)
        arm.take(np.array([1e-5]), np.array([0.01]))
        arm.advance(Ts + late)
        arm.take(np.array([q]), np.array([qd]))
        return arm.stopped

    assert sent(0.0, 0.5, 0.0) == "protective stop: joint 1 is too fast"
    # where it was sent 50 ms ago it is no more
    assert sent(0.0, 1e-5, 0.0) == ""
    assert sent(0.05, 1e-5, 0.5) == "protective stop: joint 1 accelerates too much"
    fast = one_joint(1e4)
    fast.take(np.array([1e-3]), np.array([1.0]))
    fast.advance(Ts + 0.05)
    fast.take(np.array([2e-3]), np.array([1.0]))
    assert fast.stopped == "protective stop: joint 1 is too fast"


# --- arms of Universal Robots, by what their package is told ---


class FakeUr:
    """Notes what is called; answers like an arm that stands at the start."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, tuple[Any, ...]]] = []
        self.answers: dict[str, Any] = {
            "isConnected": True,
            "getSafetyStatusBits": 0b1,
            "getTargetSpeedFraction": 1.0,
            "getActualQ": SETUP.q0.tolist(),
            "getActualQd": [0.0] * 6,
        }
        self.t = 0.0

    def __getattr__(self, name: str) -> Any:
        def call(*arguments: Any) -> Any:
            self.calls.append((name, arguments))
            if name == "getTimestamp":
                self.t += Ts
                return self.t
            answer = self.answers.get(name, True)
            if isinstance(answer, Exception):
                raise answer
            if name == "servoJ":
                self.answers["getActualQ"] = arguments[0]
            return answer

        return call

    def names(self) -> list[str]:
        return [name for name, _ in self.calls]


@pytest.fixture
def ur(monkeypatch: pytest.MonkeyPatch) -> FakeUr:
    fake = FakeUr()
    monkeypatch.setattr(ur_rtde, "demand", lambda name: None)
    for module, name in (
        ("dashboard_client", "DashboardClient"),
        ("rtde_control", "RTDEControlInterface"),
        ("rtde_receive", "RTDEReceiveInterface"),
    ):
        monkeypatch.setitem(sys.modules, module, SimpleNamespace(**{name: lambda *arguments: fake}))  # type: ignore[arg-type]
    return fake


def test_an_arm_of_universal_robots_is_streamed_positions(
    ur: FakeUr, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ur_rtde.UrRtde, "simulated_time", True)
    log = on("ur-rtde://192.168.0.2?lookahead=0.05&gain=500", setup=replace(SETUP, duration=0.1))
    assert log.ended == "done"
    assert_stopped(log)
    sent = [arguments for name, arguments in ur.calls if name == "servoJ"]
    # the first one is to stay
    assert len(sent) == 1 + len(log.periods)
    assert sent[0][0] == SETUP.q0.tolist()
    assert sent[8] == (log.periods[7].sent_q.tolist(), 0.0, 0.0, Ts, 0.05, 500.0)
    # it overwrites the setpoint; the watchdog waits for setpoints, and not for the law to be ready
    assert "kickWatchdog" not in ur.names()
    assert ur.names().index("setWatchdog") == ur.names().index("servoJ") - 5 - 1
    assert ("setWatchdog", (10.0,)) in ur.calls
    assert ur.names()[-5:] == ["servoStop", "stopScript", "disconnect", "disconnect", "disconnect"]


def test_an_arm_of_universal_robots_is_streamed_speeds(
    ur: FakeUr, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ur_rtde.UrRtde, "simulated_time", True)
    log = on("ur-rtde://192.168.0.2?send=speed", setup=replace(SETUP, duration=0.02))
    sent = [arguments for name, arguments in ur.calls if name == "speedJ"]
    assert sent[-1] == ([0.0] * 6, 40.0, Ts)
    assert sent[4][0] == log.periods[3].sent_qd.tolist()
    assert "speedStop" in ur.names()


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        ({"servoJ": False}, "the arm rejected servoJ"),
        ({"servoJ": RuntimeError("lost")}, "servoJ: lost"),
        ({"isConnected": False}, "the connection to the arm broke"),
        (
            {"getSafetyStatusBits": 0b10000000101},
            "the arm stopped by itself: protective stop, stopped due to safety",
        ),
        (
            {"getSafetyStatusBits": 0b10000010001},
            "the arm stopped by itself: safeguard stop, stopped due to safety",
        ),
        ({"getActualQd": RuntimeError("no state")}, "getActualQd: no state"),
        ({"getTimestamp": None}, "the arm's clock has stopped at 5 s"),
    ],
)
def test_an_arm_of_universal_robots_that_fails_is_stopped(
    ur: FakeUr, answer: dict[str, Any], told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ur_rtde.UrRtde, "simulated_time", True)

    def later(command: Command) -> Command:
        ur.answers.update(answer)
        if "getTimestamp" in answer:
            ur.t = -Ts  # stands still from now on
            monkeypatch.setattr(
                FakeUr, "t", property(lambda self: 5.0, lambda self, t: None), raising=False
            )
        return command

    log = on("ur-rtde://192.168.0.2", Own(later, at=20))
    assert told in log.cause
    assert log.stop == "stop command sent"
    assert "stop" in ur.names()


def test_the_package_of_universal_robots_takes_what_is_sent() -> None:
    control = pytest.importorskip("rtde_control").RTDEControlInterface
    receive = pytest.importorskip("rtde_receive").RTDEReceiveInterface
    dashboard = pytest.importorskip("dashboard_client").DashboardClient
    assert "arg5: float) -> bool" in control.servoJ.__doc__
    assert (
        "qd: list[float], acceleration: float = 0.5, time: float = 0.0) -> bool"
        in control.speedJ.__doc__
    )
    for kind, names in (
        (control, "setWatchdog servoStop speedStop stopScript disconnect"),
        (
            receive,
            "getActualQ getActualQd getTimestamp isConnected getSafetyStatusBits "
            "getTargetSpeedFraction disconnect",
        ),
        (dashboard, "connect stop disconnect"),
    ):
        assert all(hasattr(kind, name) for name in names.split())
    with pytest.raises(ArmError, match="connect to 127"):
        on("ur-rtde://127.0.0.1")


@pytest.fixture
def ur_controller() -> Iterator[tuple[str, Any]]:
    """A stand-in for an arm's controller in a process of its own: where it is, and what asks it."""
    pytest.importorskip("rtde_control")
    words = [sys.executable, str(Path(__file__).with_name("universal_robots.py")), "127.0.0.78"]
    with subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        if process.stdout.readline() != "ready\n":
            pytest.skip("there is no such address here, or its ports are taken")

        def ask(expression: str) -> Any:
            print(expression, file=process.stdin, flush=True)
            return json.loads(process.stdout.readline())  # type: ignore[union-attr]

        yield "ur-rtde://127.0.0.78", ask
        process.kill()


def test_the_package_of_universal_robots_brings_setpoints_to_the_arm(
    ur_controller: tuple[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    address, ask = ur_controller
    # on a slow machine both wait for each other
    monkeypatch.setattr(ur_rtde, "WATCHDOG", 0.5)
    patient = Supervision(
        late_s=10.0, hang_s=10.0, following_rad=10.0, stalled_s=10.0, speed_rad_s=100.0
    )
    ask("setattr(arm, 'slider', 0.5)")
    with pytest.raises(ArmError, match="the arm's speed slider is at 50 %"):
        on(address)
    ask("setattr(arm, 'slider', 1.0)")
    ask(f"setattr(arm, 'q', {SETUP.q0.tolist()})")
    log = on(address, setup=replace(SETUP, duration=0.1), supervision=patient)
    assert (log.ended, log.at_rest) == ("done", True)
    # setWatchdog, servoJ …, servoStop, stopScript, which the arm reads after the package has gone
    until = time.monotonic() + 30.0
    while (carried_out := ask("arm.carried_out"))[-1][0] != 255 and time.monotonic() < until:
        time.sleep(0.05)
    assert [command for command, _ in carried_out[-2:]] == [16, 255]
    assert carried_out[0][0] == 35
    assert carried_out[0][1][0] == 0.5
    reached = [told for command, told in carried_out if command == 11]
    assert len(reached) > 5
    sent = log.column("sent_q").tolist()
    # what is overwritten before the arm looks is lost, the last ones by servoStop
    places = [sent.index(told[:6]) for told in reached if told[:6] in sent]
    assert len(places) >= len(reached) - 1, "one, to stay, was sent before the first period"
    assert places == sorted(places)
    assert places[-1] >= len(sent) - 10
    assert reached[-1][6:] == [0.0, 0.0, Ts, 0.03, 1000.0]
    # a gate was opened: the arm stands, and what is told to be safe is not
    ask("setattr(arm, 'safety', 0b10000010001)")
    with pytest.raises(ArmError, match="the arm stopped by itself: safeguard stop"):
        on(address)


@pytest.mark.parametrize("address", ["ur-rtde://", "ur-rtde://host?gain=5", "ur-rtde://host:30004"])
def test_an_address_that_is_wrong_is_told_before_a_package_that_is_missing(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(name: str) -> None:
        raise ConfigurationError(f"{name} is not installed")

    monkeypatch.setattr(ur_rtde, "demand", missing)
    with pytest.raises(ConfigurationError) as raised:
        driver_for(address, SETUP)
    assert "is not installed" not in str(raised.value)
    with pytest.raises(ConfigurationError, match="ur-rtde is not installed"):
        driver_for("ur-rtde://192.168.0.2", SETUP)


def test_every_driver_says_what_it_is() -> None:
    for scheme in drivers.DRIVERS:
        kind = drivers.driver_class(scheme)
        assert kind.__doc__
        assert kind.real == (scheme == "ur-rtde")
    setup = replace(SETUP, sampling_time=0.001)
    with pytest.raises(ConfigurationError, match="a setpoint every 2 ms"):
        driver_for("ur-rtde://host", setup)
    assert Address.parse("ur-rtde://host:5?a=b") == Address("ur-rtde", "host", 5, {"a": "b"})


# --- real time ---


def test_what_is_not_permitted_is_said_and_nothing_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*arguments: Any) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(realtime.os, "sched_setscheduler", refused, raising=False)
    monkeypatch.setattr(realtime, "lock_memory", lambda: "Cannot allocate memory")
    with real_time() as permitted:
        assert not gc.isenabled()
        said = permitted.sentences()
    assert gc.isenabled()
    assert "no real-time scheduling (Operation not permitted)" in said[0]
    assert "memory is not locked (Cannot allocate memory)" in said[1]


def test_memory_is_locked_where_that_cannot_fail_later(monkeypatch: pytest.MonkeyPatch) -> None:
    resource = pytest.importorskip("resource")
    monkeypatch.setattr(resource, "getrlimit", lambda what: (8 << 20, 8 << 20))
    monkeypatch.setattr(realtime, "may_lock", lambda: False)
    monkeypatch.setattr(realtime.sys, "platform", "linux")
    assert realtime.lock_memory() == "a limit of 8 MB"
    warned = realtime.Permitted("Operation not permitted", "a limit of 8 MB").warnings()
    assert "`ulimit -r 80`" in warned[0]
    assert "`ulimit -l unlimited`" in warned[1]
    assert realtime.Permitted("", "").warnings() == realtime.Permitted(None, None).warnings() == []


class Late:
    """A clock whose waits end late by these times, one after the other."""

    simulated = False

    def __init__(self, *late: float) -> None:
        self.t = 10.0
        self.late = list(late)

    def now(self) -> float:
        return self.t

    def wait(self, until: float) -> None:
        self.t = max(self.t, until) + self.late.pop(0)


def test_a_missed_period_moves_the_schedule_and_a_late_one_does_not() -> None:
    line = stream.Stream(driver_for("simulated://", SETUP), limits(6), SETUP.q0, 4)
    line.clock = Late(0.0, 0.0015, 0.0, 0.005, 0.0, 0.0)  # type: ignore[assignment]
    line.begin()
    begun = [line.wait(k) for k in range(6)]
    np.testing.assert_allclose(
        [due for due, _ in begun], [0.0, 0.002, 0.004, 0.006, 0.013, 0.015], atol=1e-12
    )
    np.testing.assert_allclose(
        [late for _, late in begun], [0.0, 0.0015, 0.0, 0.005, 0.0, 0.0], atol=1e-12
    )
    assert (line.missed, line.shift) == (1, pytest.approx(0.005))


def test_a_clock_is_not_early() -> None:
    clock = RealClock()
    until = clock.now() + 0.003
    clock.wait(until)
    assert clock.now() >= until
    clock.wait(until - 1.0)


def test_punctuality_by_hand() -> None:
    late = np.array([0.0, 2e-6, 2e-6, 4e-3])
    run = Punctuality(late, np.full(4, 1e-4), 1, Ts)
    assert run.numbers()["late_median_s"] == 2e-6
    assert run.lines()[0] == "4 periods of 2 ms, 1 missed (25 %)"


# --- on the command line ---


def say(*words: str) -> Result:
    return CliRunner().invoke(app, ["run", *words])


def test_a_real_arm_does_not_move_without_being_asked_for_twice(ur: FakeUr, tmp_path: Path) -> None:
    for words, told in (((), "give --yes"), (("--yes",), "give the source of measurements")):
        result = say(
            "ur5-fov", "--robot", "ur-rtde://192.168.0.2", "--out", str(tmp_path / "x"), *words
        )
        assert told in str(result.exception)
    assert not ur.calls
    assert not (tmp_path / "x").exists()


def test_numbers_in_another_unit_are_asked_about_before_an_arm_moves(
    ur: FakeUr, tmp_path: Path
) -> None:
    words = (
        "--set",
        "scenario.constraints.2.upper=[180, 180, 180, 180, 180, 180]",
        "--out",
        str(tmp_path / "x"),
    )
    result = say("ur5-fov", "--robot", "ur-rtde://192.168.0.2", *words)
    assert "give --yes" in str(result.exception)
    assert "are these degrees per second, not rad/s?" in " ".join(result.output.split())
    assert not ur.calls


def test_a_run_is_stored_as_any_other(tmp_path: Path) -> None:
    out = tmp_path / "out"
    short = ("--set", "scenario.duration=0.1")
    address = "loopback://?time=simulated&patience=5&fault=drop&at=0.06"
    result = say(
        "ur5-fov",
        "--controller",
        "sliding-mode",
        "--robot",
        address,
        "--no-figures",
        "--out",
        str(out),
        *short,
    )
    assert result.exit_code == 1, result.output
    assert "nothing moves" in result.output
    stored = StoredComparison.load(out)
    assert [line["controller"] for line in stored.results] == ["tracking", "sliding-mode"]
    line = stored.results[1]
    assert line["status"] == "failed"
    assert "the arm closed the connection" in line["reason"]
    kept = stored.run("ur5-fov", "sliding-mode")
    assert kept is not None
    assert len(kept.trajectory.t) == 30
    assert "on loopback" in (out / "details.md").read_text(encoding="utf-8")
    with np.load(out / "arm" / "log.npz") as log:
        assert log["sent_q"].shape == (30, 6)
    assert (out / "arm" / "lateness.png").is_file()
    # a comparison in this folder would take the runs that are there
    suite = Suite.load().select(["ur5-fov"], ["sliding-mode"], settings=["scenario.duration=0.1"])
    assert all(stored_run(run, out) is not None for run in suite.with_baseline().runs())
    require_nothing_lost(out, suite.with_baseline())
    # which goes no further than that: what an arm has done is never simulated in its place
    require_arm_kept(out, suite.with_baseline().runs())
    with pytest.raises(
        ConfigurationError, match=r"holds a run on loopback:.*, which a simulation would replace"
    ):
        compare(suite, out, workers=0, fresh=True)
    with pytest.raises(
        ConfigurationError, match=r"holds a run on loopback:.*, which a simulation would replace"
    ):
        compare(
            Suite.load().select(["example-2d-fov"], ["sliding-mode"]), out, workers=0, fresh=True
        )
    run_file(out, "ur5-fov", "sliding-mode", 0).unlink()
    with pytest.raises(
        ConfigurationError, match=r"holds a run on loopback:.*, which a simulation would replace"
    ):
        compare(suite, out, workers=0)
    with pytest.raises(ConfigurationError, match="give another folder with --out"):
        record.require_own_folder(out)


FULL = OSError(errno.ENOSPC, "No space left on device")
SHORT = ("ur5-fov", "--no-figures", "--set", "scenario.duration=0.05")


def command_line(monkeypatch: pytest.MonkeyPatch, *words: str) -> object:
    """The exit code of a whole command."""
    monkeypatch.setattr(sys, "argv", ["vsconstraints", "run", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code


def test_where_the_disk_is_full_afterwards_the_record_is_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    elsewhere = tmp_path / "elsewhere"
    write = record.write_arrays
    elsewhere.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(elsewhere))

    def full(path: Path, values: Any) -> None:
        if out in path.parents:
            raise FULL
        write(path, values)

    monkeypatch.setattr(record, "write_arrays", full)
    assert command_line(monkeypatch, *SHORT, "--out", str(out)) == 1
    (kept,) = elsewhere.rglob("log.npz")
    told = " ".join(capsys.readouterr().err.split())
    assert str(kept) in told.replace(" ", "") or f"kept in {kept}" in told
    assert "the same command" not in told
    with np.load(kept) as log:
        assert log["sent_q"].shape[0] >= 25
    # nowhere at all
    monkeypatch.setattr(record, "write_arrays", lambda path, values: (_ for _ in ()).throw(FULL))
    assert command_line(monkeypatch, *SHORT, "--out", str(tmp_path / "other")) == 1
    assert "the record of the arm's motion is lost" in " ".join(capsys.readouterr().err.split())


def test_where_the_disk_is_full_later_the_record_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*arguments: Any, **options: Any) -> None:
        with storing("results", tmp_path):
            raise FULL

    monkeypatch.setattr(record, "compare_runs", full)
    assert command_line(monkeypatch, *SHORT, "--out", str(tmp_path / "out")) == 1
    assert (tmp_path / "out" / "arm" / "log.npz").is_file()
    told = " ".join(capsys.readouterr().err.split())
    assert "No space left on device. The record of the arm's motion is kept in" in told
    assert "the same command" not in told


def test_where_the_disk_is_full_before_nothing_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(number: int) -> None:
        raise FULL

    monkeypatch.setattr(record.os, "fsync", full)
    monkeypatch.setattr("vsconstraints.arms.run_on_arm", lambda *given: pytest.fail("it moves"))
    out = tmp_path / "out"
    assert command_line(monkeypatch, *SHORT, "--out", str(out)) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "nothing has moved" in told
    # and the same folder is free for another try
    record.require_own_folder(out)
    assert [path.name for path in out.iterdir()] == [".vsconstraints-lock"]


def test_where_scoring_fails_the_place_of_the_record_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def wrong(*arguments: Any, **options: Any) -> None:
        raise ZeroDivisionError("no such score")

    monkeypatch.setattr(record, "compare_runs", wrong)
    assert command_line(monkeypatch, *SHORT, "--out", str(tmp_path / "out")) == 1
    told = " ".join(capsys.readouterr().err.split())
    assert "no such score" in told
    assert "The record of the arm's motion is kept in" in told


def test_the_record_is_saved_before_anything_is_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(text: str) -> None:
        raise BrokenPipeError

    def then_gone(*given: Any) -> Any:
        done = run_on_arm(*given)
        monkeypatch.setattr("vsconstraints.arms.commands.console.print", gone)
        return done

    monkeypatch.setattr("vsconstraints.arms.run_on_arm", then_gone)
    say(*SHORT, "--out", str(tmp_path / "out"))
    assert (tmp_path / "out" / "arm" / "log.npz").is_file()


def test_signals_do_not_interrupt_the_saving_of_the_record(tmp_path: Path) -> None:
    saved: list[Path] = []

    def keep(log: ArmLog) -> None:
        (tmp_path / record.RESERVED).touch()
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)
        saved.append(record.save_log(tmp_path, log, "simulated://"))

    setup = replace(SETUP, duration=0.05)
    job = Job(setup, HierarchicalQP(), driver_for("simulated://", setup))
    log = run_on_arm(job, keep)[1]
    assert (log.ended, log.signal) == ("done", signal.SIGINT)
    assert saved == [tmp_path / "arm" / "log.npz"]
    assert not (tmp_path / record.RESERVED).exists()  # its space is free for the record


def test_the_room_that_is_kept_is_enough(tmp_path: Path) -> None:
    setup, log = run_on_arm(Job(SETUP, HierarchicalQP(), driver_for("simulated://", SETUP)))
    with record.room_for_log(tmp_path, setup):
        kept = (tmp_path / record.RESERVED).stat().st_size
    assert not list(tmp_path.iterdir())
    path = record.save_log(tmp_path, log, "simulated://")
    assert path.stat().st_size < kept


@pytest.mark.parametrize("now", [0.0, 4.5e9], ids=["1970", "2112"])
def test_a_controller_without_the_right_time_stores_its_runs(
    now: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(time, "time", lambda: now)
    monkeypatch.setattr(time, "time_ns", lambda: int(1e9 * now))
    result = say(*SHORT, "--out", str(tmp_path / "out"))
    assert result.exit_code == 0, result.output
    with np.load(tmp_path / "out" / "arm" / "log.npz") as log:
        assert log["sent_q"].shape[0] >= 25
    assert StoredComparison.load(tmp_path / "out").run("ur5-fov", "hierarchical-qp") is not None
