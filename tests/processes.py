"""Processes of a test, found by a mark in their environment: those of their children too."""

from __future__ import annotations

import os
import signal
import sys
import time
import uuid
from pathlib import Path

import pytest

MARK = "VSCONSTRAINTS_TEST_MARK"

needs_proc = pytest.mark.skipif(
    not Path("/proc/self/environ").exists(), reason="processes are looked for in /proc"
)

MAIN = [
    sys.executable,
    "-c",
    # a program started in the background of a script inherits an ignored SIGINT; at a terminal it
    # does not
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    "from vsconstraints.cli import main; main()",
]
"""The command line, as at a terminal."""


def marked() -> tuple[dict[str, str], str]:
    """An environment with a mark of its own, and the mark."""
    mark = uuid.uuid4().hex
    return {**os.environ, MARK: mark}, mark


def left_over(mark: str, patience: float = 5.0) -> list[int]:
    """Processes with this mark that are still there when they have had this time [s] to end; they
    are ended then.
    """
    deadline = time.monotonic() + patience
    while (found := with_mark(mark)) and time.monotonic() < deadline:
        time.sleep(0.02)
    for process in found:
        os.kill(process, signal.SIGKILL)
    return found


def with_mark(mark: str) -> list[int]:
    """Processes with this mark that are alive."""
    wanted = f"{MARK}={mark}".encode()
    found = []
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                if wanted in (folder / "environ").read_bytes().split(b"\0"):
                    found.append(int(folder.name))
            # it has ended, or is another user's; of one that waits to be collected nothing is read
            except OSError:
                continue
    return found
