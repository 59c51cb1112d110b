"""Calls in other processes: what dies, hangs or is interrupted costs only its own call, and nothing
is left.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Hashable
from itertools import pairwise
from multiprocessing import resource_tracker
from pathlib import Path

import pytest

from processes import left_over, marked, needs_proc, with_mark
from vsconstraints.comparisons.runs import machine as resources
from vsconstraints.comparisons.runs.pool import DIED, Failure, Pool, processes_kept


def do(what: str, file: str = "") -> object:
    """What a call is told to do; it notes in the file when it begins and ends, and in which
    process.
    """
    begun = time.monotonic()
    if what == "raise":
        raise ValueError("on purpose")
    if what == "exit":
        raise SystemExit(0)
    if what == "die" or (what == "die once" and not _noted(file)):
        os._exit(7)
    if what == "hang":
        time.sleep(1000.0)
    if what == "answer with what cannot be sent":
        return threading.Lock()
    time.sleep(0.3)
    return os.getpid(), begun, time.monotonic()


def _noted(file: str) -> bool:
    """Whether the file was there before; it is now."""
    try:
        Path(file).touch(exist_ok=False)
    except FileExistsError:
        return True
    return False


def answers(
    calls: dict[str, tuple[str, ...]], processes: int = 2, **limits: float
) -> dict[str, object]:
    with Pool(do, processes) as pool:
        return dict(pool.run(calls, limits))


def test_a_call_that_fails_in_any_way_is_answered_by_its_reason() -> None:
    found = answers(
        {
            "raises": ("raise",),
            "exits": ("exit",),
            "lock": ("answer with what cannot be sent",),
            "unpacked": (threading.Lock(),),  # type: ignore[dict-item]
            "fine": ("work",),
        }
    )
    assert found["raises"] == Failure("ValueError: on purpose")
    assert found["exits"] == Failure("SystemExit: 0")
    assert "cannot be sent" in str(found["lock"])
    assert "cannot be sent" in str(found["unpacked"])
    assert not isinstance(found["fine"], Failure)


def process_and(what: str) -> tuple[int, str]:
    """Another function than :func:`do`."""
    return os.getpid(), what


@pytest.mark.parametrize("key", [None, 0, "", ()])
def test_a_call_is_answered_whatever_its_key_is(key: Hashable) -> None:
    """Also if it is the last one that is answered."""
    with Pool(do, 2) as pool:
        found = dict(pool.run({key: ("wait",), "raise": ("raise",)}))
    assert set(found) == {key, "raise"}
    assert not isinstance(found[key], Failure)


@needs_proc
def test_processes_are_handed_on_only_where_they_are_kept_and_end_with_the_block(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Python's own helper process outlives all pools: it is started before the mark is set
    resource_tracker.ensure_running()
    environment, mark = marked()
    for name, value in environment.items():
        monkeypatch.setenv(name, value)

    def one_after_the_other() -> list[set[int]]:
        found = []
        for function in (do, process_and):
            # of two processes either could answer
            with Pool(function, 1) as pool:
                answered = dict(pool.run({"a": ("work",), "b": ("work",)}))
            found.append({answer[0] for answer in answered.values() if isinstance(answer, tuple)})
        return found

    first, second = one_after_the_other()
    assert not first & second
    with processes_kept():
        first, second = one_after_the_other()
        assert second == first
        with Pool(do, 1) as pool:
            assert dict(pool.run({"dies": ("die",)})) == {"dies": Failure(DIED)}
        # one that died is not handed on
        with Pool(process_and, 2) as pool:
            assert all(
                isinstance(answer, tuple) for _, answer in pool.run({"a": ("x",), "b": ("y",)})
            )
    assert with_mark(mark) == []


def test_a_process_that_dies_costs_its_call_and_the_others_go_on_in_parallel(
    tmp_path: Path,
) -> None:
    calls = {f"{k}": ("work",) for k in range(6)}
    calls = {"dies": ("die",), "once": ("die once", str(tmp_path / "died")), **calls}
    found = answers(calls)
    assert found.pop("dies") == Failure(DIED)
    once = found.pop("once")
    assert isinstance(once, tuple)
    times = sorted(answer[1:] for answer in found.values() if isinstance(answer, tuple))
    assert len(times) == 6
    overlapping = [first for first, second in pairwise(times) if second[0] < first[1]]
    assert len(overlapping) >= 3, times
    # the one that is tried again has nothing beside it
    assert all(end <= once[1] for _, end in times)


def test_a_call_beyond_its_limit_is_ended_and_the_others_are_answered() -> None:
    begun = time.monotonic()
    found = answers(
        {"hangs": ("hang",), "a": ("work",), "b": ("work",), "c": ("work",)}, hangs=1.5, a=60.0
    )
    assert time.monotonic() - begun < 60.0
    assert found["hangs"] == Failure("it took longer than its limit of 1.5 s and was ended")
    assert not [key for key in "abc" if isinstance(found[key], Failure)]


def stop_for(seconds: float, *processes: int) -> None:
    for process in processes:
        os.kill(process, signal.SIGSTOP)
    time.sleep(seconds)
    for process in processes:
        os.kill(process, signal.SIGCONT)


def wait_and_stop_me(file: str) -> str:
    Path(file).write_text(str(os.getpid()))
    time.sleep(1.0)
    return "done"


@needs_proc
def test_time_during_which_a_process_is_stopped_is_not_that_of_its_call(tmp_path: Path) -> None:
    file = tmp_path / "process"

    def stop() -> None:
        while not (file.exists() and file.read_text()):
            time.sleep(0.01)
        stop_for(6.0, int(file.read_text()))

    with Pool(wait_and_stop_me, 1) as pool:
        thread = threading.Thread(target=stop)
        thread.start()
        answered = dict(pool.run({"stopped": (str(file),)}, {"stopped": 4.0}))
        thread.join()
    assert answered == {"stopped": "done"}


POOL = """
import sys, time
from pathlib import Path
from vsconstraints.comparisons.runs.pool import Pool

def wait(file):
    Path(file).write_text("begun")
    time.sleep(1.0)
    return "done"

if __name__ == "__main__":
    with Pool(wait, 1) as pool:
        print(dict(pool.run({1: (sys.argv[1],)}, {1: 4.0})))
"""
STEPS = """
import sys, time
from pathlib import Path
from vsconstraints.plugins.processes import deadline

with deadline(3.0) as step:
    step()
    Path(sys.argv[1]).write_text("begun")
    time.sleep(1.0)
print("done")
"""


@needs_proc
@pytest.mark.parametrize("script", [POOL, STEPS], ids=["pool", "steps"])
def test_a_machine_or_a_batch_system_that_stops_all_processes_ends_no_call(
    script: str, tmp_path: Path
) -> None:
    (tmp_path / "script.py").write_text(script)
    file = tmp_path / "begun"
    command = [sys.executable, str(tmp_path / "script.py"), str(file)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        while not file.exists():
            assert process.poll() is None
            time.sleep(0.01)
        os.killpg(process.pid, signal.SIGSTOP)
        time.sleep(6.0)
        os.killpg(process.pid, signal.SIGCONT)
        said, _ = process.communicate()
        assert process.returncode == 0
    assert "done" in said


@pytest.mark.parametrize(
    "hang",
    [
        "time.sleep(1000.0)",
        "sum(range(10**13))",
        "threading.Thread(target=time.sleep, args=(1000,)).run()",
    ],
    ids=["waits", "computes and lets no other thread run", "waits for a thread"],
)
def test_a_step_that_never_ends_is_ended_whatever_it_does(hang: str) -> None:
    code = "import threading, time\nfrom vsconstraints.plugins.processes import deadline\n"
    code += f"with deadline(0.5) as step:\n    step()\n    {hang}\n"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=120)
    assert done.returncode not in (0, 2)


def test_steps_within_their_limit_may_together_take_longer_than_it() -> None:
    code = "import time\nfrom vsconstraints.plugins.processes import SLACK, deadline\n"
    code += (
        "with deadline(0.5) as step:\n    for _ in range(8):\n        step()\n        "
        "time.sleep(0.4)\n"
    )
    assert subprocess.run([sys.executable, "-c", code], timeout=120).returncode == 0


@needs_proc
def test_processes_end_at_once_where_the_block_is_left_by_an_exception(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    environment, mark = marked()
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(KeyboardInterrupt):
        _interrupted_at_the_first_answer()
    assert with_mark(mark) == []


def _interrupted_at_the_first_answer() -> None:
    with Pool(do, 2) as pool:
        for _ in pool.run({"a": ("work",), "b": ("hang",), "c": ("hang",)}):
            raise KeyboardInterrupt


def test_processes_that_cannot_start_are_an_error_and_no_endless_loop(tmp_path: Path) -> None:
    script = tmp_path / "unguarded.py"
    script.write_text(
        "from vsconstraints.comparisons.runs.pool import Pool\n"
        "with Pool(abs, 1) as p:\n    print(dict(p.run({1: (1,)})))"
    )
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 1
    assert "VsconstraintsError" in done.stderr
    assert "__main__" in done.stderr


STARTS_WORKERS = """
import sys, time
sys.path.insert(0, {tests!r})
from test_pool import do
from vsconstraints.comparisons.runs.pool import Pool
if __name__ == "__main__":
    with Pool(do, 2) as pool:
        for _ in pool.run({{"a": ("work",), "b": ("hang",), "c": ("hang",)}}):
            print("under way", flush=True)
"""


@needs_proc
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
def test_processes_end_with_their_parent_whatever_ends_it(tmp_path: Path, number: int) -> None:
    script = tmp_path / "parent.py"
    script.write_text(STARTS_WORKERS.format(tests=str(Path(__file__).parent)))
    environment, mark = marked()
    process = subprocess.Popen(
        [sys.executable, str(script)], env=environment, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "under way\n"
    assert len(with_mark(mark)) >= 3
    os.kill(process.pid, number)
    assert process.wait(60) == -number
    process.stdout.close()
    assert left_over(mark) == []


@pytest.mark.skipif(
    not hasattr(os, "sched_setaffinity"), reason="only Linux binds processes to cores"
)
def test_no_more_processes_than_cores_that_may_be_used() -> None:
    code = (
        "import os; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\n"
        "from vsconstraints.comparisons.runs.machine import cores, process_count\n"
        "print(cores(), process_count(), process_count(64))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "1 1 1\n"


def test_no_more_processes_than_memory_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resources, "cores", lambda: 64)
    monkeypatch.setattr(resources, "available_memory", lambda: 3.1e9)
    assert resources.process_count() == resources.process_count(64) == 10
    assert resources.process_count(3) == 3
    monkeypatch.setattr(resources, "available_memory", lambda: 1e6)
    assert resources.process_count() == 1


def test_the_limit_of_a_run_grows_with_its_samples() -> None:
    short = resources.run_limit({"duration": 1.0, "sampling_time": 0.01})
    assert resources.run_limit({"duration": 101.0, "sampling_time": 0.01}) == pytest.approx(
        short + 1000.0
    )
    assert resources.run_limit({"duration": "long"}) > 0.0
