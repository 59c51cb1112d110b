"""Damaged files of a result folder cost no more than what they held."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from commands import Command, Table, report, suite

pytestmark = pytest.mark.faults


def cut(file: Path) -> None:
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2])


def corrupt(file: Path) -> None:
    content = bytearray(file.read_bytes())
    chance = random.Random(file.name)
    for _ in range(1 + len(content) // 200):
        content[chance.randrange(len(content))] = chance.randrange(256)
    file.write_bytes(content)


def delete(file: Path) -> None:
    file.unlink()


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> tuple[Command, tuple[Table, Table]]:
    """A comparison's folder, and its tables."""
    folder = tmp_path_factory.mktemp("stored")
    command = Command(suite(folder), folder / "out")
    assert command.carry_out()[0] == 0
    return command, command.tables()


DAMAGES = (cut, corrupt, delete)


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("kind", ["tables", "pages", "trajectories", "figures"])
def test_damage_costs_no_more_than_what_it_hit(
    damage: Callable[[Path], None],
    kind: str,
    stored: tuple[Command, tuple[Table, Table]],
    tmp_path: Path,
) -> None:
    """Tables are damaged in every way; of other files, which are read alike, each in one."""
    command, tables = stored
    files = [
        file.relative_to(command.folder)
        for file in sorted(command.folder.rglob("*"))
        if file.is_file()
    ]
    chosen = [file for file in files if KINDS[file.suffix] == kind]
    assert len(chosen) >= 3
    if kind != "tables":
        chosen = chosen[DAMAGES.index(damage) :: len(DAMAGES)]
    for name in chosen:
        copied = replace(command, folder=tmp_path / f"{name.name}")
        shutil.copytree(command.folder, copied.folder)
        damage(copied.folder / name)
        figures = "--no-figures" if kind in ("tables", "pages") else "--figures"
        code, said = report(copied.folder, figures)
        assert code == 0 or refused(code, said), f"{name}: {said}"
        if kind == "figures":
            continue
        code, said = copied.carry_out(figures, "--jobs", "1")
        if code != 0:
            assert refused(code, said), f"{name}: {said}"
            code, said = copied.carry_out(figures, "--fresh", "--jobs", "1")
        assert code == 0, f"{name}: {said}"
        assert copied.tables() == tables, name
        shutil.rmtree(copied.folder)


KINDS = {
    ".json": "tables",
    ".csv": "tables",
    ".sha256": "tables",
    "": "pages",
    ".md": "pages",
    ".html": "pages",
    ".npz": "trajectories",
    ".png": "figures",
}


def refused(code: int, said: str) -> bool:
    """Whether it ended with one line that says why; a progress bar may stand before it."""
    *before, last = said.splitlines()
    return (
        code == 2
        and last.startswith("error: ")
        and all(line.startswith("comparing") for line in before)
    )
