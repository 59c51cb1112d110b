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
        ("compare --controller sl", {"sliding-mode", "sliding-mode-ahead"}),
        ("compare --scenario ", {*shipped_scenarios(), "mine.toml"}),
        ("compare --scenario mi", {"mine.toml"}),
        ("compare --keep wo", {"worst"}),
        ("preview case", {"case-study-6r"}),
        ("run case", {"case-study-6r"}),
        ("run ur5-fov --controller pre", {"predictive"}),
        ("run ur5-fov --robot ur", {"ur-rtde://"}),
        ("run ur5-fov --images ", {"model", "simulated"}),
        ("frames ur5-images --controller pre", {"predictive"}),
        ("frames ur5-i", {"ur5-image", "ur5-images"}),
        ("replay ur5-f", {f"ur5-fov:{law}" for law in CONTROLLERS}),
        ("replay old", {"old.npz"}),
        ("replay ur5-fov:sl", {"ur5-fov:sliding-mode", "ur5-fov:sliding-mode-ahead"}),
        ("study --jobs 1 pa", {"pareto"}),
        ("families planar", {"planar-arm"}),
        ("evidence --family six", {"six-axis"}),
        ("tune --controller cbf", {"cbf-filter"}),
        ("reproduce --figure 19", {"19"}),
        ("reproduce --claim 9", {"9", "9a", "9b"}),
        ("compare --controller no-such", set()),
        ("compare --format p", {"png", "pdf"}),
        ("report first --format s", {"svg"}),
        ("replay example-2d-h", {"example-2d-heart-concave:", "example-2d-heart-convex:"}),
        ("replay mi", {f"mine.toml:{law}" for law in CONTROLLERS}),
        (
            "replay ur5-fov:tracking panda-fov:sl",
            {"panda-fov:sliding-mode", "panda-fov:sliding-mode-ahead"},
        ),
        ("replay ur5-fov : tracking panda", {f"panda-fov:{law}" for law in CONTROLLERS}),
        ("reproduce --figure 1", {"10", "11", "12", "14", "15", "16", "17", "18", "19"}),
        ("evidence --family no-such", set()),
    ],
)
def test_names_are_offered(
    typed: str, offered: set[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").touch()
    (tmp_path / "old.npz").touch()
    words = f"vsconstraints {typed}"
    asked = {
        "_VSCONSTRAINTS_COMPLETE": "complete_bash",
        "COMP_WORDS": words,
        "COMP_CWORD": str(words.count(" ")),
    }
    told = CliRunner().invoke(app, [], env=asked, prog_name="vsconstraints")
    assert set(told.stdout.split()) == offered
