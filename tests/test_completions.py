"""What a shell is told when the user presses Tab."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from vsconstraints.cli import app
from vsconstraints.controllers import CONTROLLERS
from vsconstraints.scenarios import shipped_scenarios


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("comp", {"compare"}),
        ("compare --controller ", set(CONTROLLERS)),
        ("compare --controller sl", {"sliding-mode"}),
        ("compare --scenario ", {*shipped_scenarios(), "mine.toml"}),
        ("compare --scenario mi", {"mine.toml"}),
        ("compare --keep wo", {"worst"}),
        ("preview case", {"case-study-6r"}),
        ("study --jobs 1 pa", {"pareto"}),
        ("families planar", {"planar-arm"}),
        ("evidence --family six", {"six-axis"}),
        ("tune --controller cbf", {"cbf-filter"}),
        ("reproduce --figure 19", {"19"}),
        ("reproduce --claim 9", {"9", "9a", "9b"}),
        ("compare --controller no-such", set()),
    ],
)
def test_names_are_offered(typed: str, offered: set[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").touch()
    words = f"vsconstraints {typed}"
    asked = {"_VSCONSTRAINTS_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(words.count(" "))}
    told = CliRunner().invoke(app, [], env=asked, prog_name="vsconstraints")
    assert set(told.stdout.split()) == offered
