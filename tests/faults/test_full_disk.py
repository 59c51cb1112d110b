"""A disk that fills up ends a comparison with a line, and keeps what was stored; with space it goes
on.
"""

from __future__ import annotations

import resource
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from commands import Command, Table, suite

pytestmark = pytest.mark.faults


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Command, tuple[Table, Table]]:
    folder = tmp_path_factory.mktemp("undisturbed")
    command = Command(suite(folder), folder / "out")
    assert command.carry_out("--no-figures")[0] == 0
    return command, command.tables()


@pytest.fixture
def small_disk(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Path]:
    """A folder that holds so many kilobytes."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={request.param}k", "none", str(folder)],
        capture_output=True,
        text=True,
    )
    if mounted.returncode != 0:
        pytest.skip(f"a small disk needs root: {mounted.stderr.strip()}")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.mark.parametrize("small_disk", [4, 40, 200, 500], indirect=True)
def test_a_disk_that_fills_up(
    undisturbed: tuple[Command, tuple[Table, Table]], small_disk: Path
) -> None:
    command, tables = undisturbed
    command = replace(command, folder=small_disk / "out")
    code, said = command.carry_out("--no-figures")
    assert code in (1, 2), said
    assert "error: " in said
    assert "No space left" in said
    subprocess.run(["mount", "-o", "remount,size=64m", str(small_disk)], check=True)
    code, said = command.carry_out("--no-figures")
    assert code == 0, said
    assert command.tables() == tables


@pytest.mark.parametrize("most", [0, 300, 20_000])
def test_files_that_cannot_grow(
    undisturbed: tuple[Command, tuple[Table, Table]], most: int, tmp_path: Path
) -> None:
    command, tables = undisturbed
    command = replace(command, folder=tmp_path / "out")
    code, said = command.carry_out(
        "--no-figures", before=partial(resource.setrlimit, resource.RLIMIT_FSIZE, (most, most))
    )
    assert code in (1, 2), said
    assert "File too large" in said
    code, said = command.carry_out("--no-figures")
    assert code == 0, said
    assert command.tables() == tables
