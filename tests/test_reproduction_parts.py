"""One figure or one claim of the paper: what is there is made, what is not is said."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib.image import imread

from vsconstraints.errors import ConfigurationError
from vsconstraints.paper import check, chosen_claims, chosen_figures, redraw, runner
from vsconstraints.paper.commands import reproduce
from vsconstraints.paper.figures import FIGURES
from vsconstraints.paper.verdicts import Claim


@pytest.mark.usefixtures("in_this_process")
def test_a_figure_and_a_claim_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    reproduce(figure=[4], controller="hierarchical-qp", out=tmp_path)
    (path,) = (tmp_path / "figures").iterdir()
    assert path.name == "fig-04--hierarchical-qp.png"
    assert str(path) in capsys.readouterr().out.replace("\n", "")
    reproduce(figure=[4], claim=["1a"], out=tmp_path)
    told = capsys.readouterr().out
    assert "1a (8.2, Fig. 4): holds\n" in told
    assert {path.name for path in tmp_path.rglob("*.*")} == {
        "fig-04.png",
        "fig-04--hierarchical-qp.png",
    }
    ours, others = (
        imread(tmp_path / "figures" / f"fig-04{law}.png") for law in ("", "--hierarchical-qp")
    )
    assert ours.shape == others.shape
    assert (ours != others).any(), "another law is not seen in the figure"


def keys(claims: list[Claim]) -> list[str]:
    return [claim.key for claim in claims]


def test_a_number_is_all_its_claims_and_each_is_there_once() -> None:
    assert keys(chosen_claims(["10", "1a", "1", "10b"])) == [
        *(f"1{x}" for x in "abcdefgh"),
        *(f"10{x}" for x in "abcdef"),
    ]
    assert keys(chosen_claims(["1b"])) == ["1b"]


NUMBERS = ("1 (First example", "12 (Computation time)")


@pytest.mark.parametrize(
    ("asked", "words"),
    [(asked, NUMBERS) for asked in ("13", "", "a", "-1", "²")]
    + [("5z", ("5z", "5a", "5j")), ("5aa", ("5aa", "5a, 5b"))],
)
def test_claims_there_are_not(asked: str, words: tuple[str, ...], tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError) as raised:
        check([asked], tmp_path)
    assert all(word in str(raised.value) for word in words)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("number", [1, 13, 20, -4])
def test_figures_there_are_not(number: int, tmp_path: Path) -> None:
    with pytest.raises(
        ConfigurationError,
        match=rf"Fig. {number}. Available: 2, 3, .*, 12, 14, .*, 19; Figs. 1 and 13",
    ):
        redraw([4, number], tmp_path)
    with pytest.raises(ConfigurationError, match=r"'sliding'.*sliding-mode"):
        redraw([4], tmp_path, controller="sliding")
    assert not list(tmp_path.iterdir())


def test_another_law_is_for_figures_that_show_runs(tmp_path: Path) -> None:
    figures = chosen_figures([2, 16], "tracking")
    assert figures[2] == FIGURES[2]
    assert [need.controller.law for need in figures[16].needs] == ["tracking"] * 2
    assert [need.overrides for need in figures[16].needs] == [
        need.overrides for need in FIGURES[16].needs
    ]
    for asked in ({}, {"claim": ["5"]}, {"claim": ["5"], "figure": [4]}):
        with pytest.raises(ConfigurationError, match="--controller is for figures"):
            reproduce(controller="tracking", out=tmp_path, **asked)
    assert not list(tmp_path.iterdir())


def test_a_figure_that_cannot_be_drawn_is_named_and_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    exploded = dict.fromkeys(FIGURES[11].needs, "it exploded")
    monkeypatch.setattr(runner, "run_specs", lambda *_: exploded)
    path = tmp_path / "figures" / "fig-11.png"
    path.parent.mkdir()
    path.write_text("an older one")
    assert "it exploded" in redraw([11], tmp_path)[path]
    assert not path.exists()
