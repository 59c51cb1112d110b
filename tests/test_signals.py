"""Commands that are asked to end do so at once, keep what was finished, and go on when they are
given again.
"""

from __future__ import annotations

import fcntl
import os
import signal
import subprocess
import termios
import time
from collections.abc import Callable
from copy import copy
from dataclasses import replace
from pathlib import Path

import pytest

from processes import MAIN, left_over, marked, needs_proc
from vsconstraints.cli.terminal import note_processes
from vsconstraints.comparisons.runs import machine as resources
from vsconstraints.comparisons.runs.files import write_arrays
from vsconstraints.comparisons.tables import read_table
from vsconstraints.paper.studies import STUDIES, RunSummary, run_studies

pytestmark = needs_proc

AT_ONCE = 60.0
"""Much more than it takes, on a machine that does other things too; less than waiting for what is
under way [s].
"""

LAWS = """
import time
from vsconstraints.controllers import Controller

class Hangs(Controller):
    name = "hangs"
    def solve(self, rows, task):
        time.sleep(1000.0)
"""

SUITE = """
scenarios = [{ scenario = "example-2d-fov", name = "short", set = { duration = 0.1 } }]
[controllers.hangs]
type = "laws:Hangs"
"""


@pytest.fixture
def hanging(tmp_path: Path) -> list[str]:
    """A comparison whose second run never ends."""
    (tmp_path / "laws.py").write_text(LAWS)
    (tmp_path / "suite.toml").write_text(SUITE)
    return ["compare", str(tmp_path / "suite.toml"), "--out", str(tmp_path / "out"), "--jobs", "2"]


def ended(
    arguments: list[str], until: Callable[[], bool], number: signal.Signals, *, group: bool = False
) -> tuple[int, str]:
    """Exit code and what was said after the signal, which is sent when it is time; it ended at once
    and whole.
    """
    environment, mark = marked()
    process = subprocess.Popen(
        [*MAIN, *arguments], env=environment, text=True, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    wait(until, process)
    (os.killpg if group else os.kill)(process.pid, number)
    begun = time.monotonic()
    try:
        said, _ = process.communicate(timeout=120.0)
    finally:
        left = left_over(mark)
    assert time.monotonic() - begun < AT_ONCE
    assert left == []
    assert "Traceback" not in said
    return process.returncode, said


def wait(until: Callable[[], bool], process: subprocess.Popen[str]) -> None:
    while not until():
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_comparison_keeps_what_was_finished(
    hanging: list[str], number: signal.Signals, tmp_path: Path
) -> None:
    results = tmp_path / "out" / "results.csv"
    code, said = ended(hanging, results.exists, number)
    assert code == 128 + number
    assert "Interrupted: 1 of 2 runs are stored" in said
    assert [line["controller"] for line in read_table(results)] == ["tracking"]


def test_a_terminal_that_closes_ends_it_as_well(hanging: list[str], tmp_path: Path) -> None:
    results = tmp_path / "out" / "results.csv"
    environment, mark = marked()
    ours, theirs = os.openpty()
    process = subprocess.Popen(
        [*MAIN, *hanging], env=environment, stdin=theirs, stdout=theirs, stderr=theirs, text=True,
        start_new_session=True, preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
    )  # fmt: skip
    os.close(theirs)
    wait(results.exists, process)
    os.close(ours)
    assert process.wait(AT_ONCE) == 128 + signal.SIGHUP
    assert left_over(mark) == []
    assert [line["controller"] for line in read_table(results)] == ["tracking"]


def test_a_run_that_hangs_is_named(hanging: list[str], tmp_path: Path) -> None:
    done = subprocess.run(
        [*MAIN, *hanging, "--controller", "hangs", "--controller", "sliding-mode", "--run-limit", "10"],
        capture_output=True, text=True, timeout=120.0,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    why = "it took longer than its limit of 10 s and was ended"
    assert f"short · hangs · trial 0: failed, {why}" in done.stderr
    lines = {line["controller"]: line for line in read_table(tmp_path / "out" / "results.csv")}
    assert (lines["hangs"]["status"], lines["hangs"]["reason"]) == ("failed", why)
    assert lines["sliding-mode"]["status"] == "unfinished"


def test_drawing_figures_ends_at_once(tmp_path: Path) -> None:
    arguments = [
        "compare",
        "--controller",
        "sliding-mode",
        "--set",
        "scenario.duration=0.02",
        "--out",
        str(tmp_path),
    ]
    for name in ("example-2d-fov", "example-2d-fast", "example-2d-bowl", "case-study-6r"):
        arguments += ["--scenario", name]
    code, said = ended(arguments, (tmp_path / "figures").exists, signal.SIGINT, group=True)
    assert code == 130
    assert f"all 8 runs are stored in {tmp_path}, the report is not" in said


@pytest.mark.parametrize("command", ["study", "reproduce"])
def test_studies_and_the_reproduction_end_at_once_and_keep_what_was_finished(
    command: str, tmp_path: Path
) -> None:
    kept = tmp_path / "unfinished"
    code, said = ended(
        [command, "--out", str(tmp_path)],
        lambda: any(kept.glob("*.npz")),
        signal.SIGINT,
        group=True,
    )
    assert code == 130
    assert f"Interrupted: finished runs are kept in {tmp_path}; the same command continues." in said
    assert list(kept.glob("*.npz"))


def test_a_study_goes_on_where_it_was_interrupted(tmp_path: Path) -> None:
    few = copy(STUDIES["shrinking-region"])
    runs = dict(list(few.runs(small=True).items())[:3])
    few.runs = lambda small=False: runs  # type: ignore[method-assign]

    def interrupt(done: int, total: int) -> None:
        if done == 3:  # the baseline and two runs
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_studies(
            folder=tmp_path, workers=1, on_progress=interrupt, studies={"shrinking-region": few}
        )
    summaries = {file: RunSummary.load(file) for file in (tmp_path / "unfinished").iterdir()}
    kept = {file: summary for file, summary in summaries.items() if summary is not None}
    assert len(kept) >= 2
    # they are taken as they are: so they can be told from new ones
    for file, summary in kept.items():
        write_arrays(file, vars(replace(summary, status="failed", reason="kept")))
    results = run_studies(folder=tmp_path, workers=1, studies={"shrinking-region": few})
    assert (
        sum(failure.endswith("failed, kept") for failure in results["shrinking-region"].failures)
        == 2
    )
    assert not (tmp_path / "unfinished").exists()


def test_a_summary_survives_storing_and_a_damaged_one_is_none(tmp_path: Path) -> None:
    file = tmp_path / "summary.npz"
    write_arrays(
        file, vars(RunSummary("failed", "why — σ ≤ 0", {"a": float("nan"), "b": "x", "c": True}))
    )
    again = RunSummary.load(file)
    assert again is not None
    assert (again.status, again.reason, again.result["b"], again.result["c"]) == (
        "failed",
        "why — σ ≤ 0",
        "x",
        True,
    )
    assert again.result["a"] != again.result["a"]
    assert again.pixels.shape == (0, 0, 2)
    file.write_bytes(file.read_bytes()[:200])
    assert RunSummary.load(file) is None
    assert RunSummary.load(tmp_path / "none.npz") is None


def test_more_processes_than_make_sense_are_not_used_and_that_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(resources, "cores", lambda: 4)
    monkeypatch.setattr(resources, "available_memory", lambda: 64e9)
    note_processes(64)
    assert capsys.readouterr().err == "warning: --jobs 64: cores and memory suffice for 4; 4 used\n"
    note_processes(4)
    note_processes(None)
    assert capsys.readouterr().err == ""
