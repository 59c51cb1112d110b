"""On platforms without some parts of POSIX: everything can be imported, and a comparison runs."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from pathlib import Path

import pytest

import vsconstraints
from vsconstraints.plugins import portable

#: Read by every process at its start, those of the pool among them.
WITHOUT = """
import os, signal, sys, time

for name in ("fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "syslog"):
    sys.modules[name] = None
for name in ("SIGHUP", "SIGUSR1", "SIGUSR2", "SIGPIPE", "SIGALRM", "SIGQUIT", "pthread_sigmask", "pthread_kill",
             "sigwait", "sigpending", "setitimer", "getitimer"):
    delattr(signal, name)
for name in ("fork", "forkpty", "getuid", "geteuid", "getgid", "sched_getaffinity", "sched_setscheduler",
             "sched_getscheduler", "sched_getparam", "sched_param", "SCHED_FIFO", "mkfifo", "nice"):
    if hasattr(os, name):
        delattr(os, name)
for name in ("clock_gettime", "CLOCK_MONOTONIC"):
    delattr(time, name)
"""

IMPORTS = """
import importlib, pkgutil, signal, sys
import vsconstraints

assert not hasattr(signal, "SIGHUP"), "nothing is missing here"
for found in pkgutil.walk_packages(vsconstraints.__path__, "vsconstraints."):
    if not found.name.endswith("__main__"):
        try:
            importlib.import_module(found.name)
        except vsconstraints.errors.ConfigurationError as error:
            assert "pip install" in str(error)  # an extra that is not installed
print("imported")
"""


def elsewhere(folder: Path, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """A process of Python on a platform without those parts."""
    (folder / "site").mkdir(exist_ok=True)
    (folder / "site" / "sitecustomize.py").write_text(WITHOUT, encoding="utf-8")
    path = os.pathsep.join([str(folder / "site"), str(Path(vsconstraints.__file__).parents[1])])
    return subprocess.run(
        [sys.executable, *arguments],
        env={**os.environ, "PYTHONPATH": path, **variables},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )


def test_everything_can_be_imported(tmp_path: Path) -> None:
    # what is compiled is what every other test compiles
    done = elsewhere(tmp_path, "-c", IMPORTS, VSCONSTRAINTS_COMPILE="0")
    assert (done.returncode, done.stdout.splitlines()[-1:]) == (0, ["imported"]), done.stderr


def test_a_comparison_of_one_scene_runs(tmp_path: Path) -> None:
    command = [
        "-m",
        "vsconstraints.cli",
        "compare",
        "--scenario",
        "example-2d-fov",
        "--controller",
        "sliding-mode",
    ]
    settings = [
        "--set",
        "scenario.duration=0.5",
        "--no-figures",
        "--jobs",
        "2",
        "--out",
        str(tmp_path / "out"),
    ]
    done = elsewhere(tmp_path, *command, *settings)
    assert done.returncode == 0, done.stderr
    with (tmp_path / "out" / "results.csv").open(newline="") as file:
        runs = list(csv.DictReader(file))
    assert [run["status"] for run in runs] == ["unfinished", "unfinished"]


def test_a_lock_that_another_process_holds_is_not_waited_for(tmp_path: Path) -> None:
    with (tmp_path / "lock").open("w") as one, (tmp_path / "lock").open("w") as other:
        portable.lock(one, wait=False)
        with pytest.raises(BlockingIOError):
            portable.lock(other, wait=False)


def test_where_files_cannot_be_locked_that_is_an_error_of_the_system(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(portable, "fcntl", None)
    with (tmp_path / "lock").open("w") as file, pytest.raises(OSError, match="no locks of files"):
        portable.lock(file, wait=True)
