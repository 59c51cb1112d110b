"""The command line, as a user meets it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import vsconstraints
from vsconstraints.controllers import CONTROLLERS
from vsconstraints.scenarios import shipped_scenarios

MAIN = [sys.executable, "-W", "error", "-c", "from vsconstraints.cli import main; main()"]


def run(*arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*MAIN, *arguments], capture_output=True, text=True, cwd=cwd, timeout=120)


def test_version() -> None:
    assert run("--version").stdout == f"vsconstraints {vsconstraints.__version__}\n"


def test_help_names_the_commands() -> None:
    shown = run("--help")
    assert shown.returncode == 0
    for command in ("compare", "list", "report"):
        assert command in shown.stdout


def test_list_names_everything() -> None:
    shown = run("list")
    assert shown.returncode == 0, shown.stderr
    for name in (*shipped_scenarios(), *CONTROLLERS, "proxqp", "osqp", "daqp", "quadprog", "ur5", "panda", "heart"):
        assert name in shown.stdout


def test_compare_writes_a_report_and_report_writes_it_again(tmp_path: Path) -> None:
    done = run(
        "compare", "--scenario", "example-2d-fov", "--controller", "sliding-mode", "--set", "scenario.duration=0.5",
        "--jobs", "1", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "vsconstraints-results"
    report = folder / "report.md"
    first = report.read_bytes()
    assert b"sliding-mode" in first
    report.unlink()
    again = run("report", str(folder))
    assert again.returncode == 0, again.stderr
    assert report.read_bytes() == first


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("compare", "--scenario", "example-2d-fow"), ("example-2d-fow", "example-2d-fov")),
        (("compare", "--controller", "sliding"), ("sliding", "sliding-mode")),
        (("compare", "--set", "hierarchical-qp.solver=quadprogg"), ("quadprogg", "quadprog")),
        (("compare", "--set", "scenario.robot=ur6"), ("ur6", "ur5")),
        (("compare", "--set", "scenario.durations=3"), ("durations", "duration")),
        (("compare", "missing.toml"), ("missing.toml",)),
        (("compare", "--jobs", "0"), ("jobs",)),
        (("compare", "--seed", "-1"), ("seed",)),
        (("report", "nowhere"), ("nowhere", "manifest.json")),
        (("compair",), ("compair",)),
    ],
)
def test_bad_input_ends_with_2_and_writes_nothing(
    tmp_path: Path, arguments: tuple[str, ...], words: tuple[str, ...]
) -> None:
    done = run(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    for word in words:
        assert word in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_what_a_reader_should_know_of_a_scenario_is_noted(tmp_path: Path) -> None:
    done = run(
        "compare", "--scenario", "example-2d-fov", "--set", "scenario.constraints.0.margin=0.2",
        "--set", "scenario.duration=0.1", "--jobs", "1", "--out", str(tmp_path / "out"),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "note: example-2d-fov: fov[marker 2] is violated at the start" in done.stderr
    assert "note: example-2d-fov: goal 1 is forbidden by fov[marker 2]" in done.stderr


def test_an_output_folder_that_cannot_be_made_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    done = run("compare", "--scenario", "example-2d-fov", "--out", str(tmp_path / "file" / "out"))
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "file" in done.stderr
