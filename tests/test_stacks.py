"""Stacks: what they get, what they may answer, and what becomes of those that fail."""

import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from vsconstraints import Robot
from vsconstraints.bench.evidence.work import Batch
from vsconstraints.comparisons import Suite
from vsconstraints.comparisons.runs.spec import ControllerSpec, stack_law
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.reports.results import Results
from vsconstraints.robots.catalogue import READY_MADE
from vsconstraints.rows import Rows, Task
from vsconstraints.scenarios import Scenario, shipped_scenarios
from vsconstraints.simulation import simulate
from vsconstraints.simulation.programs import (
    Observation,
    declaration,
    declared_in,
    declared_uses,
    program_name,
)
from vsconstraints.simulation.recorded import Recorded, replay
from vsconstraints.stacks import ExternalStack, NoAnswer, Stack, StackFailedError, child, external
from vsconstraints.stacks.child import StackProcess
from vsconstraints.stacks.description import describe
from vsconstraints.stacks.protocol import USES, encode, read_reply
from vsconstraints.stacks.stack import Measured
from vsconstraints.stacks.urdf import urdf_text

EXAMPLES = Path(__file__).parents[1] / "examples" / "stacks"
DECLARATION = '{"protocol": 1, "uses": ["q"], "output": "velocity"}'
GREETS = f"import sys, time, os, json\nprint('{DECLARATION}', flush=True)\nsetup = sys.stdin.readline()\n"
ANSWERS = GREETS + "for line in sys.stdin:\n    "
STILL = "print('{\"velocity\": [0, 0, 0, 0, 0, 0]}', flush=True)\n"


@pytest.fixture(scope="module")
def setup():
    return Scenario.load("ur5-fov").with_override("duration", 0.02).setup()


def observed(setup, t=0.0):
    sensor = setup.sensor()
    state = setup.scene.evaluate(t, setup.q0, setup.qd0)
    pixels = setup.scene.camera.distort(state.pixels.position)
    return Observation(t, 0, setup.q0, setup.qd0, pixels, t, state.camera, not sensor.estimates)


def asked(setup, code, periods=1):
    """Answer of a program in the last of some periods, or the reason of its failure."""
    stack = ExternalStack([sys.executable, "-c", code])
    observations = [observed(setup, 0.002 * k) for k in range(periods)]
    try:
        stack.begin(setup)
        for now in observations:
            answer = stack.respond(now)
    finally:
        stack.end()
    return answer


FAILING = {
    "dies at once": ("raise SystemExit(3)", "exit code 3"),
    "dies with a word": ("raise SystemExit('no licence')", "no licence"),
    "dies later": (GREETS + "raise ValueError('no robot')", "ValueError: no robot"),
    "is killed": (GREETS + "os.kill(os.getpid(), 9)", "SIGKILL"),
    "greets with text": ("print('hello', flush=True)\nimport time; time.sleep(9)", "declaration"),
    "speaks version 2": (f"print('{DECLARATION.replace('1', '2')}', flush=True)", "version 2"),
    "speaks version 2 with a further field": (
        f"print('{DECLARATION.replace('1', '2')[:-1]}, \"rate\": 5}}', flush=True)",
        "it speaks version 2 of the protocol, and this package version 1",
    ),
    "uses more than it declares": (ANSWERS + "json.loads(line)['qd']", "it uses 'qd' without declaring it: add 'qd' to uses"),
    "uses a pose that it does not declare": (
        ANSWERS + "json.loads(line)['camera_in_target']",
        "uses 'camera_in_target' without declaring it: add 'pose' to uses",
    ),
    "uses what there is not": (f"print('{DECLARATION.replace('q', 'depth')}')", "unknown data in uses 'depth'"),
    "commands torques": (f"print('{DECLARATION.replace('velocity', 'torque')}')", "unknown output of a stack 'torque'"),
    "prints beside": (ANSWERS + "print('solved', flush=True); " + STILL, "'solved'"),
    "prints afterwards": (ANSWERS + STILL.replace("\n", "; print('solved', flush=True)\n"), "solved"),
    "answers 1e308": (
        ANSWERS + "print('{\"velocity\": [1e308, 0, 0, 0, 0, 0]}', flush=True)",
        r"beyond 1e\+12",
    ),
    "answers NaN": (ANSWERS + "print('{\"velocity\": [NaN, 0, 0, 0, 0, 0]}', flush=True)", "not finite"),
    "answers infinity": (ANSWERS + "print('{\"velocity\": [1e999, 0, 0, 0, 0, 0]}', flush=True)", "finite|range"),
    "answers five": (ANSWERS + "print('{\"velocity\": [0, 0, 0, 0, 0]}', flush=True)", "6 numbers, one per joint"),
    "answers a text": (ANSWERS + "print('{\"velocity\": \"fast\"}', flush=True)", "fast"),
    "answers bytes": (ANSWERS + "os.write(1, b'\\xff\\x00\\n')", "must be an answer"),
    "answers no UTF-8": (ANSWERS + "os.write(1, b'{\"no_answer\": \"\\xff\"}\\n')", "must be an answer"),
    "computes backwards": (ANSWERS + STILL.replace("}", ", \"compute_s\": -1}"), "compute_s"),
    "answers positions": (ANSWERS + "print('{\"position\": [0, 0, 0, 0, 0, 0]}', flush=True)", "output 'velocity'"),
    "answers another period": (ANSWERS + STILL.replace("}", ", \"t\": 0.5}"), "answered the period at t = 0.5 s"),
    "closes its output": (GREETS + "os.close(1); time.sleep(9)", "closed its standard output"),
    "writes without end": (GREETS + "while True: os.write(1, b'0' * 65536)", "line of more than"),
    "hangs": (GREETS + "time.sleep(99)", "no answer within"),
    "never ends its line": (GREETS + "while True: os.write(1, b' '); time.sleep(0.02)", "no answer within"),
    "is busy on standard error": (GREETS + "while True: os.write(2, b'busy\\n' * 1000)", "no answer within"),
}  # fmt: skip


@pytest.mark.parametrize("what", FAILING)
def test_a_stack_that_fails_is_refused_with_the_reason_and_its_last_messages(
    setup, what, monkeypatch
):
    monkeypatch.setattr(
        external, "START_LIMIT", 1.0 if "no answer within" in FAILING[what][1] else 5.0
    )
    code, reason = FAILING[what]
    with pytest.raises(StackFailedError, match=reason) as failure:
        asked(setup, code, periods=3)
    assert str(failure.value).count("its last messages") <= 1


@pytest.mark.parametrize(
    ("pause", "words"),
    [
        ("", "before it (was asked|had read what it was asked)"),
        ("time.sleep(0.5); ", "before it had read what it was asked"),
    ],
)
def test_a_second_answer_to_one_period_is_not_taken_for_that_to_the_next(setup, pause, words):
    """Also if it arrives after the next period was asked."""
    twice = ANSWERS + STILL.replace("\n", f"; {pause}") + STILL.replace("\n", f"; {pause}\n")
    with pytest.raises(StackFailedError, match=words):
        asked(setup, twice, periods=3)


def test_a_stack_that_reads_ahead_may_repeat_the_time_of_its_period(setup):
    """A thread reads, so that only the repeated time tells the second answer from that asked for."""
    ahead = GREETS + (
        "import queue, threading\nlines = queue.Queue()\n"
        "threading.Thread(target=lambda: [lines.put(line) for line in sys.stdin], daemon=True).start()\n"
        "while True:\n    answer = {'velocity': [0] * 6, 't': json.loads(lines.get())['t']}\n"
        "    print(json.dumps(answer), flush=True)\n"
    )
    assert asked(setup, ahead, periods=3).command is not None
    with pytest.raises(
        StackFailedError, match=r"answered the period at t = 0 s when .* at 0\.002 s"
    ):
        asked(setup, ahead + "    time.sleep(0.02)\n    print(json.dumps(answer), flush=True)\n", 3)


@pytest.mark.parametrize("t", [0.002, 31.998, 32.002, 600.002])
def test_a_time_repeated_in_single_precision_is_that_of_its_period(t):
    """Its resolution is 4 µs from 32 s on, and 61 µs after ten minutes."""

    def answer(time):
        return read_reply(json.dumps({"velocity": [0.5], "t": time}).encode(), "velocity", 1, t)

    assert answer(float(np.float32(t))).command == [0.5]
    for other in (t - 0.002, t + 0.002):
        with pytest.raises(StackFailedError, match="answered the period at"):
            answer(float(np.float32(other)))


def test_a_late_answer_ends_the_run_after_the_limit_of_a_reply(setup, monkeypatch):
    monkeypatch.setattr(external, "REPLY_LIMIT", 0.3)
    late = ANSWERS + "time.sleep(5 if json.loads(line)['t'] else 0); " + STILL
    begun = time.monotonic()
    with pytest.raises(StackFailedError, match=r"no answer within 0\.3 s"):
        asked(setup, late, periods=2)
    assert time.monotonic() - begun < 5.0


def test_the_total_time_of_a_run_is_limited(setup, monkeypatch):
    monkeypatch.setattr(external, "RUN_LIMIT", 0.5)
    with pytest.raises(StackFailedError, match=r"more than 0\.5 s"):
        asked(setup, GREETS + "time.sleep(99)")


def test_a_stack_may_declare_a_longer_start(setup, monkeypatch):
    """Both limits grow: that of the start, and that of the whole run. Results name it."""
    monkeypatch.setattr(external, "START_LIMIT", 0.2)
    monkeypatch.setattr(external, "RUN_LIMIT", 0.3)
    slow = "import time; time.sleep(1.0)\n" + ANSWERS + STILL
    with pytest.raises(StackFailedError, match=r"no answer within 0\.2 s"):
        asked(setup, slow)
    stack = ExternalStack([sys.executable, "-c", slow], start_time=20.0)
    try:
        stack.begin(setup)
        assert stack.respond(observed(setup)).command is not None
    finally:
        stack.end()
    assert "it was allowed 20 s to start" in stack.run_remarks()


@pytest.mark.parametrize("start_time", [0.0, -1.0, 301.0, np.nan, True, "long"])
def test_a_start_time_that_is_not_allowed_is_refused(start_time):
    with pytest.raises(ConfigurationError, match="start_time"):
        ExternalStack(["python3"], start_time=start_time)


def test_a_pool_waits_as_long_as_a_stack_may_take_to_start_and_for_it_alone():
    usual = ControllerSpec.from_table("mine", {"command": ["python3"]})
    longer = usual.changed("start_time", 300.0)
    assert longer.run_limit({}) - usual.run_limit({}) >= 2.0 * (300.0 - external.START_LIMIT)
    # of a law, an option with this name means something else
    law = ControllerSpec("law", "tracking", {"start_time": 300.0})
    assert law.run_limit({}) == usual.run_limit({})
    laws = (law, usual, longer)
    tables = {"duration": 400.0, "sampling_time": 0.01}
    scene = SimpleNamespace(tables={"nominal": tables}, number=0)
    family = SimpleNamespace(name="family", tables={})
    batches = [
        Batch(family, (0,), ("nominal",), laws, "training", 0, None),
        Batch(family, (0,), ("nominal",), laws, "training", 0, None, drawn=scene),
    ]
    for batch, described in zip(batches, ({}, tables), strict=True):
        own = [law.run_limit(described) for law in laws]
        assert own[0] == own[1] < own[2]
        assert [batch.run_limit(law) for law in laws] == own
        # the line of the scene, then the runs
        limits = [limit for _, limit in batch.pieces()]
        assert limits == [law.run_limit(described), *own]
        assert batch.drawing_limit == own[0]
    assert replace(batches[0], limit=7.0).run_limit(longer) == 7.0


def test_many_answers_in_time_are_too_late_together(setup, monkeypatch):
    monkeypatch.setattr(external, "RUN_LIMIT", 0.3)
    slow = ANSWERS + "time.sleep(0.04); " + STILL
    with pytest.raises(StackFailedError, match=r"more than 0\.3 s"):
        asked(setup, slow, periods=20)


class Silent:
    """Poll whose descriptors are never ready, and which moves the time instead of waiting."""

    time = 0.0

    def register(self, descriptor, events=0):
        pass

    def poll(self, milliseconds):
        Silent.time += 1e-3 * milliseconds
        return []


def test_a_silent_stack_is_waited_for_as_long_as_the_limit_says(monkeypatch):
    monkeypatch.setattr(Silent, "time", 0.0)
    monkeypatch.setattr(child.select, "poll", Silent)
    monkeypatch.setattr(child.time, "monotonic", lambda: Silent.time)
    process = StackProcess([sys.executable, "-c", "import sys; sys.stdin.read()"], 9.0)
    try:
        with pytest.raises(StackFailedError, match="no answer within 1 s"):
            process.line(1.0)
        assert Silent.time == pytest.approx(1.0, abs=2.0 * child.TICK)
    finally:
        monkeypatch.undo()
        process.end()


def test_the_time_during_which_this_process_is_stopped_does_not_count(monkeypatch):
    """The clock jumps by an hour while the process waits."""
    code = "import time; time.sleep(0.5); print('late', flush=True); time.sleep(9)"
    process = StackProcess([sys.executable, "-c", code], 9.0)
    clock = time.monotonic
    calls = iter(range(10**9))
    monkeypatch.setattr(child.time, "monotonic", lambda: clock() + 3600.0 * (next(calls) > 0))
    try:
        assert process.line(1.9) == b"late"
    finally:
        monkeypatch.undo()
        process.end()


def test_a_command_that_does_not_exist_is_named(setup):
    with pytest.raises(StackFailedError, match="no-such-program"):
        ExternalStack(["no-such-program"]).begin(setup)


def test_a_command_is_named_after_its_script_or_its_program(tmp_path):
    script = tmp_path / "stack.py"
    script.touch()
    assert program_name(["/usr/bin/python3", str(script), "fast"]) == "stack"
    assert program_name(["/usr/bin/controller", "--fast"]) == "controller"
    assert program_name(["controller"]) == "controller"


def test_the_whole_group_of_a_stack_ends_with_its_run(setup, tmp_path):
    """Neither a child that ignores the end of its input nor its own child is left."""
    pids = tmp_path / "pids"
    code = ANSWERS.replace(
        "setup =",
        "import subprocess, signal\n"
        "other = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(99)'])\n"
        f"open({str(pids)!r}, 'w').write(f'{{os.getpid()}} {{other.pid}}')\n"
        "setup =",
    ) + STILL + "time.sleep(99)\n"  # fmt: skip
    stack = ExternalStack([sys.executable, "-c", code])
    stack.begin(setup)
    stack.respond(observed(setup))
    stack.end()
    for pid in map(int, pids.read_text().split()):
        assert ended(pid)


def test_a_stack_that_writes_much_at_its_end_is_not_killed(setup, tmp_path):
    """More than a pipe holds, in parts: what nobody reads would keep it from ending."""
    over = tmp_path / "over"
    last_words = (
        "for _ in range(20):\n    sys.stdout.write('x' * 50000)\n    sys.stdout.flush()\n"
        f"open({str(over)!r}, 'w').write('over')\n"
    )
    stack = ExternalStack([sys.executable, "-c", ANSWERS + STILL + last_words])
    stack.begin(setup)
    stack.respond(observed(setup))
    stack.end()
    assert over.read_text() == "over"


@pytest.mark.skipif(sys.platform != "linux", reason="found in /proc")
def test_what_a_stack_started_in_a_session_of_its_own_ends_with_it(setup, tmp_path):
    """Also if the process between them has ended, as for a daemon."""
    pid = tmp_path / "pid"
    daemon = (
        "import os, sys, time\nif os.fork(): os._exit(0)\nos.setsid()\n"
        f"open({str(pid)!r}, 'w').write(str(os.getpid()))\ntime.sleep(99)\n"
    )
    code = ANSWERS.replace(
        "setup =",
        f"import subprocess\nsubprocess.run([sys.executable, '-c', {daemon!r}])\nsetup =",
    ) + STILL  # fmt: skip
    stack = ExternalStack([sys.executable, "-c", code])
    stack.begin(setup)
    stack.respond(observed(setup))
    while not (pid.exists() and pid.read_text()):
        time.sleep(0.01)
    assert not ended(int(pid.read_text()))
    stack.end()
    assert ended(int(pid.read_text()))
    assert len(stack.run_remarks()) == 1


def test_a_stack_that_cannot_be_killed_does_not_hold_the_run(setup, monkeypatch):
    """As if it waited for a device: signals do not reach it."""
    monkeypatch.setattr(child, "KILL_LIMIT", 0.3)
    started = []
    start = subprocess.Popen

    def starting(*arguments, **options):
        started.append(start(*arguments, **options))
        return started[-1]

    monkeypatch.setattr(child.subprocess, "Popen", starting)
    stack = ExternalStack([sys.executable, "-c", ANSWERS + STILL + "time.sleep(99)\n"])
    stack.begin(setup)
    stack.respond(observed(setup))
    kill = os.kill
    monkeypatch.setattr(child.os, "kill", lambda *_: None)
    monkeypatch.setattr(child.os, "killpg", lambda *_: None)
    begun = time.monotonic()
    stack.end()
    assert time.monotonic() - begun < 5.0
    (process,) = started
    assert stack.run_remarks()[-1] == f"processes {process.pid} of the stack could not be killed"
    kill(process.pid, 9)
    process.wait()


def ended(pid):
    """True if a process is gone within a second; one that init has yet to reap counts as gone."""
    for _ in range(100):
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            return True
        if state == "Z":
            return True
        time.sleep(0.01)
    return False


def test_a_stack_gets_only_what_it_declares(setup):
    echo = ANSWERS + (
        "print(json.dumps({'no_answer': ' '.join([*json.loads(setup), *json.loads(line)])}), flush=True)"
    )
    given = asked(setup, echo).reason.split()
    assert given == ["protocol", "units", "settings", "period", "joints", "t", "q"]


def test_a_stack_without_a_name_has_that_of_its_script(setup, tmp_path):
    file = tmp_path / "my_stack.py"
    file.write_text(ANSWERS + STILL, encoding="utf-8")
    stack = ExternalStack([sys.executable, str(file), "--fast"])
    try:
        stack.begin(setup)
        assert stack.run_remarks() == ["my_stack uses q and commands velocities"]
    finally:
        stack.end()


def test_results_name_what_a_class_declares_as_they_do_for_a_program(setup):
    moment = replace(setup, duration=setup.Ts)
    of_class = simulate(moment, Posed())
    assert declared_uses(of_class.reason) == Posed.uses
    program = simulate(moment, ExternalStack([sys.executable, "-c", ANSWERS + STILL]))
    assert declared_uses(program.reason) == ("q",)
    for uses in (tuple(USES), ()):
        reason = f"converged; {declaration('mine 2.0', uses, 'position')}; no answer"
        assert declared_uses(reason) == uses
    named = declaration("one that uses q and commands positions", ("pixels",), "velocity")
    assert declared_uses(f"{named}; no answer") == ("pixels",)
    assert declared_uses("a law uses the limits and commands velocities") is None
    assert declared_in(["failed", of_class.reason, named]) == (*Posed.uses, "pixels")
    assert declared_in(["failed", ""]) is None


class Sparing(Stack):
    name = "sparing"
    uses = ("q",)

    def start(self, setup):
        self.setup = setup

    def step(self, now):
        return 0.0 * now["pixels"]


def test_names_and_reasons_of_a_stack_are_one_short_line(setup):
    code = (
        "import json\nwordy = 'it is' + 40_000 * '\\n\\x1b[31m very late'\n"
        "print(json.dumps({'protocol': 1, 'uses': [], 'output': 'velocity', 'name': wordy}), flush=True)\n"
        "input()\ninput()\nprint(json.dumps({'no_answer': wordy}), flush=True)\n"
    )
    stack = ExternalStack([sys.executable, "-c", code])
    try:
        stack.begin(setup)
        answer = stack.respond(observed(setup))
        (declared, *_) = stack.run_remarks()
    finally:
        stack.end()
    for text in (declared, answer.reason):
        assert "it is" in text
        assert text.isprintable()
        assert len(text) < 300


def test_a_class_that_uses_more_than_it_declares_fails_by_name(setup):
    run = simulate(setup, Sparing())
    assert run.status == "failed"
    assert "add 'pixels' to uses" in run.reason


def test_a_class_gets_no_default_for_what_it_does_not_declare(setup):
    class Asking(Sparing):
        def step(self, now):
            return now.get("gain", 0.0) * now.get("q") + now.get("qd")

    run = simulate(setup, Asking())
    assert run.status == "failed"
    assert "'qd' without declaring it: add 'qd' to uses" in run.reason


@pytest.mark.parametrize("reported", [1e99, 0.5])
def test_a_computing_time_longer_than_the_answer_took_is_left_out(setup, reported):
    code = ANSWERS + STILL.replace("}", f', "compute_s": {reported}}}')
    run = simulate(setup, ExternalStack([sys.executable, "-c", code]))
    assert np.isnan(run.step_time).all()
    assert "its compute_s is left out in 11 periods, in which it was longer than" in run.reason


def test_a_stack_that_fails_before_its_first_command_says_nothing_of_the_arm():
    arm = {"command": "velocity", "lag": 0.02, "acceleration": 8.0}
    setup = (
        Scenario.load("ur5-fov").with_override("duration", 0.02).with_override("arm", arm).setup()
    )

    class Unable(Posed):
        def start(self, setup):
            raise ValueError("no licence")

    failed = simulate(setup, Unable())
    assert "no licence" in failed.reason
    assert "integrated" not in failed.reason
    accelerating = Posed()
    accelerating.output = "acceleration"
    assert "q̈_c was integrated" in simulate(setup, accelerating).reason


class Posed(Stack):
    """Brings the joints to rest at given coordinates, and has no answer at first."""

    name = "posed"
    uses = ("q",)
    goal = 0.1

    def start(self, setup):
        self.asked = 0

    def step(self, now):
        self.asked += 1
        if self.asked <= 3:
            raise NoAnswer("still thinking")
        return self.goal * np.ones(6) if self.output == "velocity" else now["q"]


def test_periods_without_an_answer_are_counted_and_stop_the_arm(setup):
    run = simulate(setup, Posed())
    assert "no answer in 3 of 11 periods" in run.reason
    assert "3 times 'still thinking'" in run.reason
    assert np.abs(run.qd[:4]).max() == 0.0
    assert np.allclose(run.qd[5:], 0.1, atol=1e-12)


def test_velocities_need_a_limit_of_accelerations(setup):
    """An arm that takes any acceleration would jump."""
    free = Scenario.load("case-study-6r").with_override("duration", 0.02).setup()
    assert not free.limits.any
    run = simulate(free, Posed())
    assert run.status == "failed"
    assert 'arm = { command = "velocity"' in run.reason


def test_a_velocity_arm_follows_the_commanded_velocities(setup):
    arm = {"command": "velocity", "lag": 0.02, "acceleration": 8.0}
    scene = Scenario.load("ur5-fov").with_override("duration", 0.1).with_override("arm", arm)
    run = simulate(scene.setup(), Posed())
    assert np.abs(np.diff(run.qd, axis=0)).max() <= 8.0 * 0.002 + 1e-12
    assert (run.qd[-1] > 0.09).all()


class Placed(Posed):
    """Moves each joint by 0.1 mrad per period."""

    output = "position"

    def step(self, now):
        self.asked += 1
        return self.initial + 1e-4 * self.asked

    def begin(self, setup):
        self.initial = setup.q0
        super().begin(setup)


@pytest.mark.parametrize("takes", ["velocity", "position"])
def test_an_arm_goes_where_positions_command_it(takes):
    """Alike if the run is repeated from its recorded commands, as for laws in their own process."""
    scene = Scenario.load("ur5-fov").with_override("duration", 0.05)
    setup = scene.with_override("arm", {"command": takes}).setup()
    run = simulate(setup, Placed())
    # 0.05 rad/s at 40 rad/s²: a velocity arm stays behind by what it needs to get there
    behind = setup.q0 + 1e-4 * (len(run.t) - 1) - run.q[-1]
    assert np.abs(behind - (0.05**2 / 80.0 if takes == "velocity" else 0.0)).max() < 1e-9
    plain = Recorded.of(setup, Placed()).plain()
    again = replay(setup, Recorded.from_plain(plain, setup.scene.robot.n))
    assert np.abs(again.q - run.q).max() < 1e-12


def test_an_arm_that_takes_accelerations_takes_no_positions(setup):
    run = simulate(setup, Placed())
    assert run.status == "failed"
    assert "commands positions" in run.reason


@pytest.mark.parametrize("answer", [[np.nan, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, -np.inf]])
def test_one_number_that_is_not_finite_ends_the_run(setup, answer):
    class Partial(Posed):
        def step(self, now):
            return answer

    run = simulate(setup, Partial())
    assert run.status == "failed"
    assert "its velocity is not finite" in run.reason


@pytest.mark.parametrize("answer", [np.zeros((6, 1)), np.zeros((2, 3)), np.zeros(7), 0.0])
def test_an_answer_has_one_number_per_joint(setup, answer):
    class Shaped(Posed):
        def step(self, now):
            return answer

    assert "its velocity must be 6 numbers, one per joint" in simulate(setup, Shaped()).reason


SERVED = f"""
import sys
sys.path.insert(0, {str(external.ADAPTERS)!r})
from stack_io import serve
class Along:
    name = "along"
    output = "velocity"
    uses = ["jacobian"]
    def start(self, setup):
        pass
    def step(self, now):
        return now["jacobian"][0]
serve(Along())
"""


@pytest.mark.parametrize("json_of", ["msgspec", "the standard library"])
def test_a_served_class_gets_and_gives_the_same_numbers_with_either_json(setup, json_of):
    hidden = "" if json_of == "msgspec" else "import sys\nsys.modules['msgspec'] = None\n"
    answer = asked(setup, hidden + SERVED, periods=2)
    J = Measured(setup, ("jacobian",))(observed(setup))["jacobian"]
    assert np.array_equal(answer.command, J[0])
    assert 0.0 < answer.compute_time < 1.0


def test_rows_and_a_task_are_refused(setup):
    with pytest.raises(InvalidInput, match="gets measurements"):
        Posed().command(Rows.none(6), Task(np.eye(6), np.zeros(6)))


IMAGE_BASED = (EXAMPLES / "image_based.py").read_text(encoding="utf-8")


class InProcess(Stack):
    """The law of examples/stacks/image_based.py, with the same code around its loop."""

    name = "image-based"
    uses = ("camera", "goals", "target", "pixels", "pose", "jacobian")

    def start(self, setup):
        self.setup = setup

    def step(self, now):
        f, c = np.reshape(self.setup["camera"]["intrinsics"], (2, 2))
        x = (now["pixels"] - c) / f
        wanted = (np.array(self.setup["goals"][now["goal"]]["pixels"]) - c) / f
        pose = now["camera_in_target"]
        Z = (np.array(self.setup["target"]["markers"]) - pose[:3, 3]) @ pose[:3, 2]
        L = [
            [[-1 / z, 0, u / z, u * v, -1 - u * u, v], [0, -1 / z, v / z, 1 + v * v, -u * v, -u]]
            for (u, v), z in zip(x, Z, strict=True)
        ]
        return -np.linalg.pinv(np.concatenate(L) @ now["jacobian"]) @ (x - wanted).ravel()


def test_a_stack_moves_the_arm_alike_in_this_process_and_in_another(setup):
    apart = simulate(setup, ExternalStack([sys.executable, str(EXAMPLES / "image_based.py")]))
    here = simulate(setup, InProcess())
    assert np.abs(here.qd).max() > 0.01
    assert np.abs(apart.q - here.q).max() < 1e-12
    assert "image-based uses camera, goals" in apart.reason


def test_the_ten_lines_are_ten_lines_and_run(setup):
    file = EXAMPLES / "ten_lines.py"
    lines = [line for line in file.read_text(encoding="utf-8").splitlines() if line.strip()]
    assert len(lines) <= 10
    run = simulate(setup, ExternalStack([sys.executable, str(file)]))
    assert run.status != "failed"
    assert np.abs(run.qd).max() > 0.01


ROBOTS = {
    "ur5": lambda: READY_MADE["ur5"](),
    "panda": lambda: READY_MADE["panda"](),
    "table with a slide": lambda: Robot.from_dh(
        [[0.1, 0.2, 0.3, 0.4], [0.0, 0.1, 0.0, -1.2], [0.5, 0.3, 0.2, 0.7]], prismatic=[2]
    ),
}


@pytest.mark.parametrize("which", ROBOTS)
def test_the_urdf_has_the_kinematics_of_the_robot(which):
    robot = ROBOTS[which]()
    model = pin.buildModelFromXML(urdf_text(robot))
    data = model.createData()
    assert list(model.names)[1:] == list(robot.joint_names)
    for q in np.random.default_rng(3).uniform(-1.0, 1.0, (5, robot.n)):
        pin.framesForwardKinematics(model, data, q)
        tip = data.oMf[model.getFrameId("tip")]
        expected = robot.pose(q)
        assert np.abs(tip.rotation - expected.R).max() < 1e-12
        assert np.abs(tip.translation - expected.t).max() < 1e-12
    finite = np.isfinite(robot.q_max)
    assert np.array_equal(model.upperPositionLimit[finite], robot.q_max[finite])


@pytest.mark.parametrize("distorted", [False, True])
def test_pixels_pose_and_intrinsics_are_those_of_opencv(distorted):
    cv2 = pytest.importorskip("cv2")
    scenario = Scenario.load("ur5-fov")
    if distorted:
        lens = {"model": "brown-conrady", "coefficients": [-0.1, 0.02, 0.001, -0.002]}
        scenario = scenario.with_override("camera.distortion", lens)
        scenario = scenario.with_override("camera.principal_point_px", [331.0, 236.0])
    setup = scenario.setup()
    data = describe(setup, USES)
    now = Measured(setup, tuple(USES))(observed(setup))
    f_u, f_v, c_u, c_v = data["camera"]["intrinsics"]
    K = np.array([[f_u, 0.0, c_u], [0.0, f_v, c_v], [0.0, 0.0, 1.0]])
    target_in_camera = np.linalg.inv(now["camera_in_target"])
    turn, _ = cv2.Rodrigues(target_in_camera[:3, :3])
    lens = np.array(data["camera"]["distortion"]["coefficients"] or [0.0] * 5)
    markers = np.array(data["target"]["markers"])
    seen, _ = cv2.projectPoints(markers, turn, target_in_camera[:3, 3], K, lens)
    assert np.abs(seen[:, 0] - now["pixels"]).max() < 1e-6


def test_measurements_are_those_of_the_period(setup):
    q = setup.q0 + 0.1
    now = observed(setup)._replace(q=q, qd=-q, goal=3, t=0.4, taken=0.1)
    data = Measured(setup, ("goals", "q", "qd", "pixels"))(now)
    assert data["goal"] == 3
    assert (data["t"], data["taken"]) == (0.4, 0.1)
    assert np.array_equal(data["q"], q)
    assert np.array_equal(data["qd"], -q)


def test_a_pose_is_estimated_through_the_lens_and_once_per_image():
    scenario = Scenario.load("ur5-fov").with_override("disturbances.pixel_noise", 1e-9)
    lens = {"model": "brown-conrady", "coefficients": [-0.3, 0.1, 0.0, 0.0]}
    setup = scenario.with_override("camera.distortion", lens).setup()
    measured = Measured(setup, ("pose",))
    now = observed(setup)
    assert not now.exact
    found = measured(now)["camera_in_target"]
    true = setup.scene.camera_pose(setup.q0)
    assert np.abs(found[:3, :3] - true.R).max() < 1e-6
    assert np.abs(found[:3, 3] - true.t).max() < 1e-6
    # the image that was taken at 0 is also the newest one at 0.1 s; another one at 0.2 s is not
    moved = now._replace(pixels=now.pixels + 5.0)
    assert np.array_equal(measured(moved._replace(t=0.1))["camera_in_target"], found)
    again = measured(moved._replace(t=0.2, taken=0.15))["camera_in_target"]
    assert np.abs(again - found).max() > 1e-3


NARROW = [
    {"type": "joint-range", "K": 0.1, "switching_gain": 1.0, "margin": 0.2,
     "joints": [1], "lower": [-1.0], "upper": [2.0]},
    {"type": "joint-speed", "switching_gain": 1.0, "margin": 0.1,
     "joints": [2], "lower": [-0.5], "upper": [0.7]},
]  # fmt: skip


def test_limits_are_where_the_rows_with_their_margins_are_zero():
    setup = Scenario.load("ur5-fov").with_override("constraints", NARROW).setup()
    given = describe(setup, ["limits"])["limits"]
    robot = setup.scene.robot
    assert given["lower"][1:] == robot.q_min[1:].tolist()
    assert given["upper"][1:] == robot.q_max[1:].tolist()
    assert given["velocity"][2:] == robot.qd_max[2:].tolist()
    world = setup.world()
    labels = setup.constraints.labels
    for side in ("lower", "upper"):
        q = setup.q0.copy()
        q[0] = given[side][0]
        sigma = world.evaluate(0.0, q, np.zeros(6)).sigma
        assert sigma[labels.index(f"range[joint 1].{side}")] == pytest.approx(0.0, abs=1e-12)
    # a stack has one speed for both directions: the slower one, here downwards
    qd = np.zeros(6)
    qd[1] = -given["velocity"][1]
    sigma = world.evaluate(0.0, setup.q0, qd).sigma
    assert sigma[labels.index("speed[joint 2].lower")] == pytest.approx(0.0, abs=1e-12)


def test_limits_that_the_controller_does_not_know_are_not_given(setup):
    given = describe(setup, ["limits"])["limits"]
    assert given["acceleration"] == setup.limits.of_joint("acceleration", 6).tolist()
    unknown = replace(setup, limits=replace(setup.limits, known=False))
    assert describe(unknown, ["limits"])["limits"]["acceleration"] is None


def test_camera_target_and_goals_are_in_the_frames_that_are_named(setup):
    """The camera is where the tip carries it, and sees the goal's pixels at the goal's pose."""
    data = describe(setup, ["camera", "target", "goals"])
    tip = setup.scene.robot.pose(setup.q0)
    camera = setup.scene.camera_pose(setup.q0)
    in_tip = np.array(data["camera"]["camera_in_tip"])
    assert np.abs(tip.R @ in_tip[:3, :3] - camera.R).max() < 1e-12
    assert np.abs(tip.R @ in_tip[:3, 3] + tip.t - camera.t).max() < 1e-12
    assert data["target"]["frame"] == "base"
    assert data["target"]["moves"] is False
    (goal,) = data["goals"]
    pose = np.array(goal["camera_in_target"])
    in_camera = (np.array(data["target"]["markers"]) - pose[:3, 3]) @ pose[:3, :3]
    f, c = np.reshape(data["camera"]["intrinsics"], (2, 2))
    assert np.abs(f * in_camera[:, :2] / in_camera[:, 2:] + c - goal["pixels"]).max() < 1e-9


def test_a_class_that_declares_what_does_not_exist_is_refused(setup):
    stack = Posed()
    stack.uses = ("q", "depth")
    with pytest.raises(StackFailedError, match="unknown data in uses 'depth'"):
        stack.begin(setup)


def test_what_json_does_not_have_is_refused_and_not_left_out():
    assert (
        encode({"gains": np.array([1.0, np.nan]), "n": np.int64(3)})
        == b'{"gains":[1.0,null],"n":3}'
    )
    with pytest.raises(TypeError, match=r"nothing of type .*Path"):
        encode({"settings": {"model": Path("model.urdf")}})


@pytest.mark.parametrize("name", shipped_scenarios())
def test_every_scenario_can_be_described(name):
    """Parameters of regions are arrays of several shapes, and objects that JSON does not have."""
    setup = Scenario.load(name).setup()
    data = describe(setup, USES)
    assert json.loads(json.dumps(data)) == data
    constraints = setup.constraints.constraints
    assert [each["kind"] for each in data["constraints"]] == [each.kind for each in constraints]
    for given, constraint in zip(data["constraints"], constraints, strict=True):
        # those of a funnel are the task's, which the section "goals" has in pixels of OpenCV
        assert "goals" not in given
        if constraint.kind == "sphere":
            assert given["centre"] == list(constraint.centre)
            assert given["radius"] == constraint.radius
            assert [point["link"] for point in given["points"]] == [
                point.link for point in constraint.points
            ]


def test_arrays_of_objects_of_a_constraint_are_left_out():
    setup = Scenario.load("ur5-fov").setup()
    constraint = setup.constraints.constraints[0]
    constraint.parts = np.array([None, Path("x")], dtype=object)
    constraint.phases = np.array([1j])
    constraint.places = np.array(["left", "right"])
    described = describe(setup, ["constraints"])["constraints"][0]
    assert {"parts", "phases"}.isdisjoint(described)
    assert described["places"] == ["left", "right"]


def test_later_goals_a_fixed_camera_and_what_controllers_believe():
    scenario = Scenario.load("ur5-fov")
    goals = [{"camera_at_q": scenario.tables["q0"], "from_time": at} for at in (0.0, 1.5)]
    later = scenario.with_override("task.goals", goals).setup()
    assert [goal["from"] for goal in describe(later, ["goals"])["goals"]] == [0.0, 1.5]
    wrong = scenario.with_override("disturbances.focal_factor", [1.1, 0.9]).setup()
    assert describe(wrong, ["camera"])["camera"]["intrinsics"][:2] == [660.0, 540.0]
    hand = Scenario.load(
        next(name for name in shipped_scenarios() if "eye-to-hand" in name)
    ).setup()
    data = describe(hand, ["camera", "target"])
    assert data["target"]["frame"] == "tip"
    assert (
        np.abs(np.array(data["camera"]["camera_in_base"])[:3, 3] - hand.scene.camera.fixed.t).max()
        == 0.0
    )


@pytest.mark.parametrize("scenario", ["ur5-fov", "eye-to-hand-ibvs"])
def test_the_jacobian_is_that_of_the_camera_in_its_own_frame(scenario):
    setup = Scenario.load(scenario).setup()
    q = setup.q0
    step = 1e-6
    J = Measured(setup, ("jacobian",))(observed(setup))["jacobian"]
    for i in range(6):
        ends = [setup.scene.camera_pose(q + sign * step * np.eye(6)[i]) for sign in (-1, 1)]
        moved = ends[0].inverse @ ends[1]
        twist = pin.log6(pin.SE3(moved.R, moved.t)).vector / (2.0 * step)
        assert np.abs(twist - J[:, i]).max() < 1e-7


def test_images_have_the_time_at_which_they_were_taken():
    late = {"image_period": 0.01, "delay": 1, "delay_known": True, "pixel_noise": 0.3}
    scene = (
        Scenario.load("ur5-fov").with_override("duration", 0.1).with_override("disturbances", late)
    )
    seen = []

    class Watching(Stack):
        name = "watching"
        uses = ("pixels", "pose")

        def start(self, setup):
            pass

        def step(self, now):
            seen.append((now["t"], now["taken"], now["pixels"][0, 0], now["camera_in_target"]))
            return np.zeros(6)

    simulate(scene.setup(), Watching())
    t, taken, _, _ = map(np.array, zip(*seen, strict=True))
    assert (t - taken).max() == pytest.approx(0.018)
    assert (t[10:] - taken[10:]).min() == pytest.approx(0.01)
    # one image has one noise and one pose until the next one arrives
    assert len({pixel for _, _, pixel, _ in seen}) == len(set(taken.tolist()))
    assert np.abs(seen[-1][3] - seen[0][3]).max() > 1e-9


def test_a_table_with_a_command_or_an_adapter_is_a_stack(tmp_path):
    (tmp_path / "mine.py").write_text("", encoding="utf-8")
    spec = ControllerSpec.from_table(
        "mine", {"command": ["python3", "mine.py"], "gain": 2.0}, folder=tmp_path
    )
    assert spec.law == stack_law()
    assert not spec.in_own_process
    assert spec.options["command"] == ["python3", str(tmp_path / "mine.py")]
    assert tmp_path / "mine.py" in spec.files
    assert spec.make().settings == {"gain": 2.0}
    again = ControllerSpec.from_table("mine", json.loads(json.dumps(spec.table)))
    assert again.table == spec.table


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({}, "either a command"),
        ({"command": ["a"], "adapter": "pink"}, "either a command"),
        ({"adapter": "pinc"}, "Did you mean 'pink'"),
        ({"command": ["a"], "python": "python3"}, "a command names its own"),
        ({"command": [1]}, "must be a list of texts"),
        ({"command": ["a"], "gain": float("inf")}, r"settings\.gain of a stack must be finite, not inf"),
        ({"command": ["a"], "K": {"p": [1.0, float("nan")]}}, r"settings\.K\.p\[1\] .*not nan"),
        ({"command": ["a"], "K": np.array([1.0, np.nan])}, r"settings\.K\[1\] .*not nan"),
        ({"command": ["a"], "K": {"a": Path("x")}}, r"settings\.K\.a of .* nothing of type .*Path"),
        ({"command": ["a"], "K": {(1, 2): 3}}, r"settings\.K of a stack cannot be sent"),
        ({"command": "python3 'mine.py"}, "No closing quotation"),
    ],
)  # fmt: skip
def test_a_wrong_stack_is_refused_before_it_runs(options, reason):
    with pytest.raises(ConfigurationError, match=reason):
        ExternalStack(**options)


def test_a_command_line_names_its_stack(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_stack.py").write_text("", encoding="utf-8")
    spec = ControllerSpec.of_stack("python3 -u my_stack.py --fast")
    assert spec.name == "my_stack"
    assert spec.options["command"][2] == str(tmp_path / "my_stack.py")
    (tmp_path / "arm.yaml").write_text("", encoding="utf-8")
    assert ControllerSpec.of_stack("python3 my_stack.py arm.yaml").name == "my_stack"
    assert ControllerSpec.of_stack("/usr/bin/servo").name == "servo"
    # a program on the command line is too long for a path
    assert len(ControllerSpec.of_stack(f"python3 -c '{5000 * 'x'}'").files) == 1
    suite = Suite("one", "one", (Scenario.load("ur5-fov"),), (spec,))
    with pytest.raises(ConfigurationError, match="my_stack"):
        suite.with_stacks(["python3 -O my_stack.py"])
    with pytest.raises(ConfigurationError, match="takes a command"):
        ControllerSpec.of_stack("")


def test_a_process_that_is_stopped_with_its_parent_is_gone(setup):
    """The system ends a stack whose parent dies without ending it."""
    if sys.platform != "linux":
        pytest.skip("only Linux ends a process with its parent")
    code = (
        "import sys, os\nfrom vsconstraints.stacks.child import StackProcess\n"
        "p = StackProcess([sys.executable, '-c', 'import time; print(1, flush=True); time.sleep(99)'], 9)\n"
        "p.line(9)\nprint(p._process.pid, flush=True)\nos.kill(os.getpid(), 9)\n"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
    assert ended(int(said.stdout))


def test_reports_do_not_call_a_stack_numpy_code():
    laws = {"tracking": {"type": "tracking"}, "mine": {"type": stack_law(), "command": ["mine"]}}
    line = {"scenario": "a", "trial": 0, "compiled": False, "duration_s": 1.0}
    lines = [{**line, "controller": name, "rows_time_median_us": 2.0} for name in laws]
    manifest = {"configuration": {"controllers": laws}}
    stored = SimpleNamespace(manifest=manifest, scenarios=["a"], results=lines, constraints=[])
    results = Results(stored)
    assert [results.implementation(name) for name in laws] == ["uncompiled", "external"]
