"""Some hundred wrong scenarios, suites and tables beside those that every test run tries."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from commands import Command, suite

import mutated
from test_mutated import outcomes, start
from vsconstraints.comparisons import Suite
from vsconstraints.comparisons.runs.files import SUMS
from vsconstraints.reports import write_report

pytestmark = pytest.mark.faults

SEED = 1
"""Another one than that of the tests that always run."""

TABLES = ("results.csv", "constraints.csv", "manifest.json")


def test_scenarios_are_refused_or_fine(tmp_path: Path) -> None:
    found = outcomes(tmp_path / mutated.FILE, list(mutated.scenarios(250, seed=SEED)), start)
    assert any(found)
    assert not all(found)


def test_suites_are_refused_or_fine(tmp_path: Path) -> None:
    found = outcomes(tmp_path / mutated.FILE, list(mutated.suites(100, seed=SEED)), Suite.load)
    assert any(found)
    assert not all(found)


def test_tables_are_refused_or_shown(tmp_path: Path) -> None:
    command = Command(suite(tmp_path), tmp_path / "out")
    assert command.carry_out("--no-figures")[0] == 0
    for name in TABLES:
        folder = shutil.copytree(command.folder, tmp_path / f"copy of {name}")
        (folder / SUMS).unlink()  # which would tell that anything was changed
        files = list(mutated.edited((folder / name).read_bytes(), 50, seed=SEED))
        outcomes(folder / name, files, lambda path: write_report(path.parent, figures=False))
