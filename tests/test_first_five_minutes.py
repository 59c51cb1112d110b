"""The page on the first five minutes, carried out as a reader would: in order, in one folder, each
command for real.
"""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from documents import DOCS, blocks, reader_folder, run
from vsconstraints.cli import app
from vsconstraints.comparisons.tables import read_table

COMMANDS = {"pip", "vsconstraints"}


@pytest.mark.usefixtures("in_this_process")
def test_every_command_does_what_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(reader_folder(tmp_path))
    names = {"__name__": "__main__"}
    written = 0
    for block in blocks(DOCS / "first-five-minutes.md"):
        if block.language != "sh":
            run(block, tmp_path, names)
            continue
        for line in block.code.splitlines():
            command, *arguments = shlex.split(line, comments=True)
            assert command in COMMANDS
            if command == "pip":
                continue  # that is what the tests run in
            done = CliRunner().invoke(app, arguments, catch_exceptions=False)
            assert done.exit_code == 0, f"{block.where}: {done.output}"
            for file in re.findall(r"# writes (\S+)$", line):
                assert (tmp_path / file).stat().st_size > 500, f"{block.where}: {file}"
                written += 1
    assert written >= 4
    assert "cautious: converged" in capsys.readouterr().out
    # what the page says of the changed line
    band = {
        folder: next(
            line["phi_band"]
            for line in read_table(tmp_path / folder / "results.csv")
            if line["controller"] == "sliding-mode"
        )
        for folder in ("first", "second")
    }
    assert band["second"] / band["first"] == pytest.approx(4.0, rel=0.3)
