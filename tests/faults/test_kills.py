"""Killed at random moments, a comparison goes on, and comes to what it would have come to."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from commands import Command, Table, end, suite

from processes import needs_proc, with_mark

pytestmark = [pytest.mark.faults, needs_proc]

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
#: A worker dies of SIGHUP as of SIGTERM, and a group of SIGTERM and SIGKILL as its parent does.
TARGETS = {
    "parent": SIGNALS,
    "worker": (signal.SIGKILL, signal.SIGTERM, signal.SIGINT),
    "group": (signal.SIGINT, signal.SIGHUP),
}
KILLS = [
    pytest.param(target, number, id=f"{target}-{number.name}")
    for target, numbers in TARGETS.items()
    for number in numbers
]


@pytest.fixture(scope="module")
def undisturbed(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Command, float, tuple[Table, Table]]:
    """A comparison that nothing happens to, how long it takes, and its tables."""
    folder = tmp_path_factory.mktemp("undisturbed")
    command = Command(suite(folder, trials=2), folder / "out")
    begun = time.monotonic()
    assert command.carry_out()[0] == 0
    return command, time.monotonic() - begun, command.tables()


@pytest.mark.parametrize(("target", "number"), KILLS)
def test_what_is_killed_goes_on(
    target: str,
    number: signal.Signals,
    k: int,
    undisturbed: tuple[Command, float, tuple[Table, Table]],
    tmp_path: Path,
) -> None:
    command, duration, tables = undisturbed
    command = replace(command, folder=tmp_path / "out")
    chance = random.Random(f"{target} {number} {k}")
    # drawing takes as long as all else: not every time
    figures = "--figures" if chance.random() < 0.2 else "--no-figures"
    process, mark = command.start(figures)
    # most of the time goes by before there is anything that could be lost
    if chance.random() < 0.8:
        _wait_for(command.folder / "manifest.json", process)
    time.sleep(chance.random() * 0.6 * duration)
    hit = _send(number, target, process, mark, chance)
    begun = time.monotonic()
    code, said = end(process, mark)
    took = time.monotonic() - begun
    if target == "worker" or not hit:
        assert code == 0, said
        assert command.tables() == tables
    elif code != 0:  # it may just have been finished
        # a negative code: before it had begun to listen
        assert code in (-number, 128 + number), said
        assert took < 10.0, f"it took {took:.1f} s to end"
    assert command.carry_out(figures)[0] == 0
    assert command.tables() == tables
    assert not list(command.folder.rglob("*.part"))


def _wait_for(file: Path, process: subprocess.Popen[str]) -> None:
    while not file.exists() and process.poll() is None:
        time.sleep(0.01)


def _send(
    number: signal.Signals,
    target: str,
    process: subprocess.Popen[str],
    mark: str,
    chance: random.Random,
) -> bool:
    """Whether there was something to send it to."""
    try:
        if target == "group":
            os.killpg(process.pid, number)
        else:
            os.kill(
                process.pid if target == "parent" else chance.choice(list(_workers(process, mark))),
                number,
            )
    except (ProcessLookupError, IndexError):
        return False
    return True


def _workers(process: subprocess.Popen[str], mark: str) -> Iterator[int]:
    for found in with_mark(mark):
        try:
            command = Path(f"/proc/{found}/cmdline").read_bytes()
        except OSError:
            continue
        if found != process.pid and b"spawn_main" in command:
            yield found
