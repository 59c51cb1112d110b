"""The command line, as a user meets it."""

from __future__ import annotations

import inspect
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from rich.cells import cell_len
from rich.console import Console
from typer.testing import CliRunner

import vsconstraints
from vsconstraints.cli import app, terminal
from vsconstraints.cli.application import commands
from vsconstraints.cli.listing import kinds, print_listing
from vsconstraints.cli.options import known_options
from vsconstraints.cli.terminal import console, errors
from vsconstraints.comparisons.tables import read_table
from vsconstraints.compiled import available
from vsconstraints.controllers import CONTROLLERS
from vsconstraints.errors import ConfigurationError, VsconstraintsError
from vsconstraints.plugins.registry import load, parts_with_packages
from vsconstraints.scenarios import shipped_scenarios

COMMANDS = commands()
MAIN = [sys.executable, "-W", "error", "-c", "from vsconstraints.cli import main; main()"]


def run(
    *arguments: str, cwd: Path | None = None, **environment: str
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*MAIN, *arguments],
        capture_output=True,
        text=True,
        errors="surrogateescape",
        cwd=cwd,
        timeout=300,
        env={**os.environ, **environment},
    )


def test_version() -> None:
    assert run("--version").stdout == f"vsconstraints {vsconstraints.__version__}\n"


def test_help_names_the_commands_by_what_they_are_for() -> None:
    shown = run("--help")
    assert shown.returncode == 0
    by_panel = dict[str, list[str]]()
    for name, command in COMMANDS.items():
        by_panel.setdefault(command.panel, []).append(name.split()[0])
    names = [*dict.fromkeys(name for panel in by_panel.values() for name in panel)]
    assert names[:4] == ["compare", "list", "report", "diff"]
    assert re.findall(r"^\W? ([a-z]+) ", shown.stdout, re.MULTILINE) == names


def test_what_is_printed_is_printed_as_it_is() -> None:
    for screen in (console, errors):
        with screen.capture() as printed:
            screen.print("error: images by my_camera:eye: [1] of C:smile:")
        assert printed.get() == "error: images by my_camera:eye: [1] of C:smile:\n"


def test_list_names_everything_on_one_screen() -> None:
    shown = run("list")
    assert shown.returncode == 0, shown.stderr
    for name in (
        *shipped_scenarios(),
        *CONTROLLERS,
        "proxqp",
        "osqp",
        "daqp",
        "quadprog",
        "ur5",
        "panda",
        "heart",
    ):
        assert name in shown.stdout
    assert shown.stdout.count("\n") < 60


def test_list_describes_kinds_and_names(capsys: pytest.CaptureFixture[str]) -> None:
    for kind in kinds():
        print_listing([kind])
        shown = capsys.readouterr().out
        assert "`" not in shown  # docstrings mark references and code
        assert len(shown.splitlines()) < 80, f"{kind} is more than a screen"
    print_listing(["controllers", "implicit-switch"])
    shown = capsys.readouterr().out
    assert "hierarchical-qp" in shown
    for part in ("(laws)", "(demands)", "solver='auto'", "options: periods=1.0", "requires: T_s"):
        assert part in shown
    with pytest.raises(ConfigurationError, match="'sliding-mode'"):
        print_listing(["sliding-mod"])


def help_pages() -> Iterator[tuple[str, str]]:
    """Each command's name and its help on a terminal of 80 columns."""
    for name in ("", "testset", *COMMANDS):
        environment = {"COLUMNS": "80", "TERMINAL_WIDTH": "80"}
        shown = CliRunner().invoke(app, [*name.split(), "--help"], env=environment)
        assert shown.exit_code == 0, shown.output
        yield name, shown.output


def test_help_fits_80_columns_and_cuts_nothing() -> None:
    """Neither an example nor a word is cut or broken in two, and no name between colons becomes a
    picture.
    """
    for name, page in help_pages():
        assert max(map(cell_len, page.splitlines())) <= 80, name
        assert not re.search("[\U0001f000-\U0001ffff\u2600-\u27bf]", page), name
        words = {word for line in page.splitlines() for word in line.strip("│ ").split()}
        if name not in COMMANDS:
            continue
        command = COMMANDS[name]
        assert f" Example: vsconstraints {name} {command.example} " in page
        (part,) = (part for _, part in parts_with_packages() if name in part.commands)
        known = known_options(name, part.options)
        for parameter in inspect.signature(load(command.function)).parameters:
            missing = {*known.get(parameter, {}).get("help", "").split()} - words
            assert not missing, f"{name}: {parameter} shows no {missing}"


def test_tables_fit_80_columns_and_break_no_word(
    capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    """A table that is too wide is printed as several, each of which names its lines again."""
    screen = Console(width=80, markup=False, soft_wrap=True)
    monkeypatch.setattr(terminal, "console", screen)
    names = ["robust-hierarchical-qp-observer", "cbf-filter"]
    lines = [
        [name, "12 of 12 (75–100 %)", "(98.12)", "0.0001 [0–0.2]", "needs σ, T_s and memory"]
        for name in names
    ]
    header = ["controller", "converged inside", "median utilization [%]", "worst depth", "requires"]
    terminal.print_columns(header, lines, wrapped={4: 12})
    shown = capsys.readouterr().out
    assert max(map(cell_len, shown.splitlines())) <= 80
    assert shown.count(names[0]) == 2
    for cell in lines[0][:4]:
        assert cell in shown
    wide = Console(width=200, markup=False, soft_wrap=True)
    monkeypatch.setattr(terminal, "console", wide)
    terminal.print_columns(header, lines)
    assert capsys.readouterr().out.count(names[0]) == 1


def test_every_command_begins_its_help_with_an_example_that_can_be_typed() -> None:
    group = typer.main.get_command(app)
    below = group.commands["testset"].commands  # type: ignore[attr-defined]
    for name, command in [
        *group.commands.items(),
        *((f"testset {word}", each) for word, each in below.items()),
    ]:  # type: ignore[attr-defined]
        example = (command.help or "").partition("\n")[0]
        words = shlex.split(example.removeprefix("Example: "))
        typed = ["vsconstraints", *name.split()]
        assert words[: len(typed)] == typed
        command.make_context(name, words[len(typed) :])


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
        (("compare", "--controller", "sliding"), ("sliding", "sliding-mode")),
        (("compare", "--set", "hierarchical-qp.solver=quadprogg"), ("quadprogg", "quadprog")),
        (("compare", "--set", "scenario.robot=ur6"), ("ur6", "ur5")),
        (("compare", "--set", "scenario.durations=3"), ("durations", "duration")),
        (("compare", "missing.toml"), ("missing.toml",)),
        (("compare", "--jobs", "0"), ("jobs",)),
        (("compare", "--seed", "-1"), ("seed",)),
        (("report", "nowhere"), ("nowhere", "manifest.json")),
        (("compare", "--set", "trials=1000000000"), ("1000000000 trials", "runs", "100000")),
        (("compare", "--set", "scenario.duration=1e9"), ("samples", "GB")),
        (("compare", "--set", "scenario.q0=" + "[" * 2000 + "]" * 2000), ("levels",)),
    ],
)
def test_bad_input_is_refused_and_writes_nothing(
    tmp_path: Path,
    arguments: tuple[str, ...],
    words: tuple[str, ...],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Without the start of a process, which takes longer than all of these together."""
    monkeypatch.chdir(tmp_path)
    refused = CliRunner().invoke(app, arguments)
    assert isinstance(refused.exception, VsconstraintsError) or refused.exit_code == 2
    for word in words:
        assert word in f"{refused.exception} {refused.output}"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("compare", "--scenario", "example-2d-fow"), ("example-2d-fow", "example-2d-fov")),
        (("compair",), ("compair",)),
        (("compare", "--scenario", "aus\udcff.toml"), ("aus\\udcff.toml",)),
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
    if "error: " in done.stderr:
        assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_what_a_reader_should_know_of_a_scenario_is_noted(tmp_path: Path) -> None:
    done = run(
        "compare", "--scenario", "example-2d-fov", "--set", "scenario.constraints.0.margin=0.2",
        "--set", "scenario.duration=0.1", "--jobs", "1", "--out", str(tmp_path / "out"),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "warning: example-2d-fov: fov[marker 2] is violated at the start" in done.stderr
    assert "warning: example-2d-fov: goal: fov[marker 2] is violated" in done.stderr


def test_the_form_that_ran_is_what_the_report_says(tmp_path: Path) -> None:
    """Where nothing compiled can be kept the NumPy form runs: told once, stored, and never taken
    for the other one.
    """
    (tmp_path / "file").touch()
    command = (
        "compare", "--scenario", "example-2d-fov", "--controller", "sliding-mode", "--set", "scenario.duration=0.05",
        "--jobs", "2", "--out", str(tmp_path / "out"),
    )  # fmt: skip
    for variables, form, other in (
        ({"NUMBA_CACHE_DIR": str(tmp_path / "file")}, "NumPy", "compiled"),
        ({}, "", ""),
    ):
        done = subprocess.run(
            [sys.executable, "-c", MAIN[-1], *command],
            env={**os.environ, **variables},
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert done.returncode == 0, done.stderr
        assert "were stored in" not in done.stdout
        if not form and not available():
            return
        form = form or "compiled"
        other = other or "NumPy"
        assert done.stderr.count("runs without its compiler") == (form == "NumPy")
        assert done.stdout.count("Uncompiled, since Python") == (form == "NumPy")
        assert json.loads((tmp_path / "out" / "manifest.json").read_text())["compiled"] == {
            form: 2,
            other: 0,
        }
        flags = [line["compiled"] for line in read_table(tmp_path / "out" / "results.csv")]
        assert flags == [form == "compiled"] * 2
        shown = "uncompiled" if form == "NumPy" else form
        assert re.search(
            rf"\| control step +\| {shown} ", (tmp_path / "out" / "report.md").read_text()
        )


RAISES = """
from vsconstraints.controllers import Controller
{begin}
class Own(Controller):
    name = "own"
    def solve(self, rows, task):
        raise RuntimeError("on purpose")
"""


@pytest.mark.parametrize(
    ("begin", "code", "words"),
    [
        ("", 1, "all runs of the compared controllers failed"),
        ("import sys; sys.exit()", 2, "cannot import 'law': SystemExit"),
    ],
)
def test_exit_codes_tell_what_came_of_it(begin: str, code: int, words: str, tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text(RAISES.format(begin=begin))
    (tmp_path / "s.toml").write_text(
        'scenarios = ["example-2d-fov"]\n[controllers.own]\ntype = "law:Own"\n'
    )
    done = run(
        "compare",
        "s.toml",
        "--set",
        "scenario.duration=0.05",
        "--jobs",
        "1",
        "--out",
        "out",
        cwd=tmp_path,
    )
    assert done.returncode == code, done.stderr
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert (tmp_path / "out" / "report.md").exists() == (code == 1)


def test_an_output_folder_that_cannot_be_made_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    done = run("compare", "--scenario", "example-2d-fov", "--out", str(tmp_path / "file" / "out"))
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "file" in done.stderr


@pytest.mark.parametrize(
    "encoding", [{"PYTHONIOENCODING": "latin-1"}, {"PYTHONIOENCODING": "ascii:strict"}]
)
def test_list_is_shown_on_any_terminal(encoding: dict[str, str]) -> None:
    shown = run("list", **encoding)
    assert shown.returncode == 0, shown.stderr
    assert "hyperellipse" in shown.stdout


LAW = """from vsconstraints.controllers import Controller


class Raises(Controller):
    name = "raises"

    def solve(self, rows, task):
        raise ValueError(f"no data at {rows.phi[0]}")
"""


def test_names_with_spaces_umlauts_and_marks_and_failures_that_are_counted(tmp_path: Path) -> None:
    """Files as other people name and store them, and a folder whose name is not UTF-8."""
    mark = "\ufeff"
    (tmp_path / "law_for_test.py").write_text(LAW)
    (tmp_path / "mein Ärmchen.toml").write_text(
        f'{mark}extends = "example-2d-fov"\nduration = 0.02\nstart_deviation = 0.01\n',
        encoding="utf-8",
    )
    (tmp_path / "große Läufe.toml").write_text(
        f'{mark}scenarios = ["mein Ärmchen.toml"]\ntrials = 3\n[controllers."mein Regler"]\ntype '
        f'= "sliding-mode"\n'
        '[controllers.raises]\ntype = "law_for_test:Raises"\n',
        encoding="utf-8",
    )
    done = run(
        "compare",
        "große Läufe.toml",
        "--jobs",
        "1",
        "--no-figures",
        "--out",
        "aus\udcff",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("ValueError: no data at") == 2, (
        "the first one, and how many there were"
    )
    assert "law_for_test.py, line 8" in done.stderr
    assert "3 of 3 trials" in done.stderr
    folder = tmp_path / "aus\udcff"
    text = (folder / "report.md").read_text(encoding="utf-8")
    assert "mein Ärmchen" in text
    assert "mein Regler" in text
    details = (folder / "details.md").read_text(encoding="utf-8")
    assert re.search(
        r"\| raises +\| failed +\| t = 0 s: ValueError: no data at .*\| 3 of 3 ", details
    )
    assert not (folder / "figures").exists()
    again = run("report", "aus\udcff", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert "drawing figures" in again.stderr
    figures = sorted(path.name for path in (folder / "figures").iterdir())
    assert "mein Ärmchen--errors.png" in figures
    pages = [(folder / name).read_text(encoding="utf-8") for name in ("report.md", "details.md")]
    assert "(figures/mein%20%C3%84rmchen--errors.png)" in "".join(pages)
    # what is in the way of a report is named in one line
    (folder / "report.md").unlink()
    (folder / "report.md").mkdir()
    refused = run("report", "aus\udcff", "--no-figures", cwd=tmp_path)
    assert refused.returncode != 0
    assert refused.stderr.splitlines()[-1].startswith("error: ")
    assert "Traceback" not in refused.stderr


def test_that_nothing_is_compiled_is_told_once(tmp_path: Path) -> None:
    main = [sys.executable, *MAIN[3:]]  # warnings as they are
    done = subprocess.run(
        [*main, "compare", "--scenario", "example-2d-fov", "--controller", "sliding-mode", "--jobs", "2", "--out", "o",
         "--set", "scenario.duration=0.02"],
        capture_output=True, text=True, cwd=tmp_path, timeout=300, env={**os.environ, "NUMBA_CACHE_DIR": "/proc/none"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("RuntimeWarning") == 1
    assert done.stderr.count("cannot write /proc/none") == 1
