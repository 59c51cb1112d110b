"""The report of evidence as a whole: of made-up runs of every kind, what is written holds
together.
"""

from __future__ import annotations

import json
import re
import runpy
import sys
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from documents import ROOT
from made_evidence import drawn_runs, frame, made, run
from vsconstraints.bench.evidence import Batch, Campaign, scored
from vsconstraints.bench.families import Family
from vsconstraints.bench.reports import replay
from vsconstraints.bench.reports.dataset import Dataset
from vsconstraints.bench.reports.failures import divisive_scene
from vsconstraints.bench.reports.figures import draw_tolerance
from vsconstraints.bench.reports.report import write_report_of
from vsconstraints.bench.statistics.judged import OUTCOMES, UNSUCCESSFUL, endings
from vsconstraints.cli import app
from vsconstraints.comparisons.metrics import TOLERANCES, score
from vsconstraints.comparisons.runs.spec import ControllerSpec
from vsconstraints.errors import ConfigurationError
from vsconstraints.reports.plots import looks
from vsconstraints.simulation.trajectory import Outcome
from vsconstraints.view.replay.campaigns import replayed

WIDEST = 8

RATES = {
    "nominal": {
        "sliding-mode": 0.8,
        "potential-field": 0.6,
        "hierarchical-qp": 0.95,
        "hierarchical-qp-tuned": 0.95,
    },
    "disturbed": {
        "sliding-mode": 0.8,
        "potential-field": 0.3,
        "hierarchical-qp": 0.4,
        "hierarchical-qp-tuned": 0.7,
    },
    "limited": {
        "sliding-mode": 0.5,
        "potential-field": 0.5,
        "hierarchical-qp": 0.5,
        "hierarchical-qp-tuned": 0.5,
    },
}


def written(
    runs: pd.DataFrame,
    folder: Path,
    *,
    figures: bool = False,
    tuning: Path | None = None,
    **more: Any,
) -> str:
    path = write_report_of(Dataset(made(runs, folder, **more), tuning, figures))
    return "".join(one.read_text(encoding="utf-8") for one in (path, path.with_name("details.md")))


def tables(text: str) -> list[list[list[str]]]:
    """Cells of every table of a text, its header first."""
    found: list[list[list[str]]] = [[]]
    for line in text.splitlines():
        if line.startswith("| "):
            found[-1].append([cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]])
        elif found[-1]:
            found.append([])
    return [[table[0], *table[2:]] for table in found if table]


def first_number(cell: str) -> float:
    found = re.search(r"[−-]?\d+(\.\d+)?", cell)
    return float(found[0].replace("−", "-")) if found else float("nan")


def check(text: str, folder: Path) -> None:
    """What holds of every report."""
    for table in tables(text):
        assert len(table[0]) <= WIDEST
        assert all(len(line) == len(table[0]) for line in table)
        # controllers are compared down a column, or along a line of situations
        for column in table[1:] if table[0][0] == "situation" else zip(*table, strict=True):
            better = -1.0 if column[0].startswith("violated") else 1.0
            values = [better * first_number(cell) for cell in column[1:]]
            for cell, value in zip(column[1:], values, strict=True):
                if cell.startswith("**") and "(" in cell:
                    assert value == np.nanmax(values), column
                    assert "≈" not in "".join(column)
    for link in re.findall(r"!\[[^]]*\]\(([^)]*)\)", text):
        assert (folder / link).is_file()
    headings = {
        re.sub(r"[^\w -]", "", title).lower().replace(" ", "-")
        for title in re.findall(r"^#+ (.*)", text, re.M)
    }
    assert set(re.findall(r"\]\((?:report.md|details.md)?#([^)]*)\)", text)) <= headings
    assert "nan" not in re.sub(r"[a-z]*nan[a-z]+|[a-z]+nan", "", text)
    assert "could not be drawn" not in text


def test_a_whole_report(tmp_path: Path) -> None:
    text = written(drawn_runs(RATES, ["planar-arm", "ur5"], 60, alike=0.8), tmp_path, figures=True)
    check(text, tmp_path)
    lines = text.splitlines()
    assert lines[0] == "# Made up"
    assert lines[2] == "**Which law keeps its rows?**"
    assert "120 scenes of 2 families, drawn at random" in text
    answer, headline = tables(text)[:2]
    assert [line[0] for line in answer[1:]] == [
        "Without disturbances",
        "With disturbances",
        "Under the arms' own limits",
    ]
    assert len(headline[0]) <= 7
    assert [line[0] for line in headline[1:3]] in (
        ["hierarchical-qp", "hierarchical-qp-tuned"],
        ["hierarchical-qp-tuned", "hierarchical-qp"],
    )
    assert "Rank reversal: without disturbances, hierarchical-qp succeeds" in text
    for name in ("tolerance", "profiles", "ranks"):
        assert (tmp_path / "figures" / f"{name}.png").stat().st_size > 5000
    for heading in (
        "Which controller to choose",
        "Failures",
        "Tuning",
        "Scenes",
        "Machine and versions",
    ):
        assert f"\n## {heading}\n" in text
    assert '" mrad"' not in text
    assert "runs per second | 150" in re.sub(" +", " ", text)


ONE = {"nominal": {"sliding-mode": 0.5}}
FAILING = {"reason": "the law gave nothing at 0.5 s", "status": "failed", "utilization": np.nan}


@pytest.mark.parametrize(
    ("runs", "said"),
    [
        (
            drawn_runs(ONE, ["ur5"], 20),
            "Without disturbances: **sliding-mode** succeeds in ",
        ),
        (drawn_runs(ONE, ["ur5"], 1), "1 scene of 1 family, drawn at random"),
        (
            drawn_runs({"nominal": {"a": 0.0, "b": 0.0}}, ["ur5"], 20),
            "no controller succeeds in any of 20 scenes",
        ),
        (
            drawn_runs({"nominal": {"a": 1.0, "b": 1.0}}, ["ur5"], 20),
            "no significant difference to the best (20 scenes of 1 family)",
        ),
        (
            drawn_runs({"odd": {"a": 1.0, "b": 0.1}}, ["ur5"], 20),
            "In the condition odd: most successful: **a** ",
        ),
        (drawn_runs({"nominal": {}}, ["ur5"], 3), "there is nothing to compare"),
        (
            frame(
                [
                    run(controller=law, scene=i, **(FAILING if law == "b" else {}))
                    for i in range(9)
                    for law in "ab"
                ]
            ),
            "**b** failed or was aborted in each of its 9 runs, most often: the law gave nothing "
            "at 0.5 s.",
        ),
        (
            frame([run(controller=law, scene=i) for i in range(9) for law in "ab"]),
            "No controller failed in any run.",
        ),
        (
            frame(
                [run(controller=f"a-law-with-a-rather-long-name-{i}", scene=0) for i in range(20)]
            ),
            "too few scenes to rank controllers (1 scene of 1 family)",
        ),
    ],
)
def test_whatever_there_is_a_report_is_written_that_says_so(
    runs: pd.DataFrame, said: str, tmp_path: Path
) -> None:
    text = written(runs, tmp_path)
    check(text, tmp_path)
    assert said in text


@given(
    st.lists(
        st.tuples(
            st.sampled_from([*get_args(Outcome), "another"]),
            st.sampled_from(["", "fov[marker 2]", "range[joint 6]; x"]),
        ),
        min_size=1,
    )
)
def test_every_run_ends_in_exactly_one_way(runs: list[tuple[str, str]]) -> None:
    lines = frame(
        [run(status=status, violated=rows, scene=i) for i, (status, rows) in enumerate(runs)]
    )
    ways = endings(lines)
    own = {"trapped": "stuck", "slow": "slow", "unfinished": "slow", "converged": "success"}
    assert set(ways) <= {"success", *UNSUCCESSFUL}
    for (status, rows), way in zip(runs, ways, strict=True):
        assert way == ("violated" if rows else own.get(status, "failed"))
    assert ((ways == "success") == OUTCOMES["success"].flag(lines)).all()
    assert ((ways == "violated") == OUTCOMES["violation"].flag(lines)).all()


def test_success_and_the_other_endings_are_all_runs(tmp_path: Path) -> None:
    ends = [
        "converged",
        "converged",
        "trapped",
        "slow",
        "unfinished",
        "failed",
        "aborted",
        "trapped",
    ]
    rows = ["", "fov[marker 2]", "", "", "", "", "", "fov[marker 2]"]
    lines = [
        run(scene=i, status=end, violated=row, violation_depth=0.1 * bool(row), controller=law)
        for law in "ab"
        for i, (end, row) in enumerate(zip(ends, rows, strict=True))
    ]
    (found,) = [table for table in tables(written(frame(lines), tmp_path)) if "stuck" in table[0]]
    columns = [found[0].index(name) for name in ("success", *UNSUCCESSFUL)]
    for line in found[1:]:
        assert [first_number(line[k]) for k in columns] == pytest.approx(
            [12.5, 25.0, 12.5, 25.0, 25.0], abs=0.6
        )


def test_success_over_tolerated_depth_goes_through_the_table(tmp_path: Path) -> None:
    depths = {"a": [0.0, 5e-4, 0.03, 0.5], "b": [0.0, 0.0, 0.09, 0.011]}
    lines = [run(scene=i, controller=law, violation_depth=depth, violated="fov[marker 2]" * bool(depth))
             for law, own in depths.items() for i, depth in enumerate(own)]  # fmt: skip
    dataset = Dataset(
        made(frame([*lines, run(scene=9), run(scene=9, controller="b", status="slow")]), tmp_path)
    )
    sheet = draw_tolerance([("nominal", dataset.paired("nominal", "tolerance"))], ["a", "b"])
    assert sheet is not None
    (ax,) = sheet.figure.axes
    text = write_report_of(dataset).with_name("details.md").read_text(encoding="utf-8")
    (table,) = (lines for header, *lines in tables(text) if header[1] == "0.01 %")
    curves = {curve.get_color(): curve for curve in ax.lines}
    for law, *cells in table:
        x, y = curves[looks(["a", "b"])[law].colour].get_data()
        for tolerance, cell in zip(TOLERANCES, cells, strict=False):
            assert y[int(np.argmin(abs(x - 100.0 * tolerance)))] == pytest.approx(
                float(cell), abs=0.1
            )


def test_figures_are_drawn_of_little(tmp_path: Path) -> None:
    for i, rates in enumerate((ONE, {"nominal": {"a": 0.0, "b": 0.0}})):
        folder = tmp_path / str(i)
        folder.mkdir()
        check(written(drawn_runs(rates, ["ur5"], 2), folder, figures=True), folder)


def test_runs_that_cannot_be_made_again_are_named(tmp_path: Path) -> None:
    rates = {"nominal": {"sliding-mode": 0.5, "potential-field": 0.5}}
    text = written(drawn_runs(rates, ["ur5"], 20), tmp_path, figures=True)
    assert re.search(r"Scene \d+ of ur5 could not be simulated again: ", text)


def test_scenes_are_counted_with_what_was_rejected(tmp_path: Path) -> None:
    """Twenty scenes, each behind three attempts that were rejected; two of them were beyond the
    arm's limits.
    """
    text = written(drawn_runs(ONE, ["ur5"], 20), tmp_path)
    (found,) = [table for table in tables(text) if table[0][0] == "family"]
    line = found[1]
    assert line[:4] == ["ur5", "20", "80", "marker not visible at the start 75"]
    assert line[4] == "10 (1–32)"
    # of every fifth scene the least time is not known, and one of the two in which it is 1.2 of the
    # duration is such
    assert "No controller can arrive in time in 0 of 16 scenes with a known least time" in text


def test_the_worst_and_the_typical_failure_of_a_law(tmp_path: Path) -> None:
    depths = [0.0, 0.3, 0.1, 0.0, 0.2]
    lines = [
        run(
            scene=i,
            violation_depth=d,
            violated="fov[marker 2]" if d else "",
            status="trapped" if not d else "converged",
        )
        for i, d in enumerate(depths)
    ]
    text = written(frame([*lines, run(scene=9)]), tmp_path)
    (found,) = [table for table in tables(text) if "failure" in table[0]]
    assert [line[1:3] for line in found[1:]] == [
        ["typical", "planar-arm 2, nominal"],
        ["worst", "planar-arm 1, nominal"],
    ]
    assert found[2][4] == "violates `fov[marker 2]` by 30.0 px"
    (ways,) = [table for table in tables(text) if "runs without success" in table[0]]
    assert ways[1] == ["a", "5 of 6", "fov violated 60 %; stuck 40 %"]
    assert "\nvsconstraints replay .:planar-arm:1:nominal:a\n" in text


def test_a_tuning_is_shown(tmp_path: Path) -> None:
    tuning = tmp_path / "tuning"
    tuning.mkdir()
    evaluations = pd.DataFrame(
        {
            "law": np.repeat(["sliding-mode", "hierarchical-qp"], 20),
            "seed": [0] * 30 + [1] * 10,
            "number": [*range(20), *range(10), *range(10)],
            "options": '{"alpha": 5.0}',
            "runs": 50,
            "successes": [*range(10, 30), *range(30, 50)],
            "chosen": [i in (3, 39) for i in range(40)],
        }
    )
    evaluations.to_parquet(tuning / "evaluations.parquet")
    text = written(drawn_runs(RATES, ["ur5"], 20), tmp_path, figures=True, tuning=tuning)
    check(text, tmp_path)
    (found,) = [table for table in tables(text) if "chosen setting" in table[0]]
    assert found[1] == ["sliding-mode", "20", "20.0", "26.0", "alpha: 5.0"]
    assert found[2] == ["hierarchical-qp", "20", "60.0", "98.0", "alpha: 5.0"]
    assert (tmp_path / "figures" / "budgets.png").is_file()
    evaluations.drop(columns="successes").to_parquet(tuning / "evaluations.parquet")
    with pytest.raises(
        ConfigurationError, match=r"evaluations\.parquet cannot be read: it has no column successes"
    ):
        written(drawn_runs(RATES, ["ur5"], 20), tmp_path, tuning=tuning)


def test_training_scenes_are_never_passed_off_as_held_out(tmp_path: Path) -> None:
    assert "**These are training scenes:**" in written(
        drawn_runs(RATES, ["ur5"], 10), tmp_path, half="training"
    )


def test_the_example_script_recomputes_every_claim(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On made-up runs that bring about sentences of nearly every kind."""
    runs = drawn_runs(RATES, ["planar-arm", "ur5", "panda", "six-axis"], 60, alike=0.8)
    broken = runs[runs["controller"] == "sliding-mode"].assign(controller="broken", **FAILING)
    astray = runs["controller"].eq("tracking") & runs["condition"].eq("disturbed")
    runs.loc[astray, "status"] = "unfinished"
    # of the two in front without disturbances, one is calmer
    calm = runs["controller"] == "hierarchical-qp"
    runs.loc[calm, "acceleration_variation"] *= 0.1
    every = frame(pd.concat([runs, broken]).to_dict("records"))
    written(every, tmp_path)
    (tmp_path / "runs").mkdir()
    every.to_parquet(tmp_path / "runs" / "part-1.parquet")
    monkeypatch.setattr(sys, "argv", ["recompute_claims.py", str(tmp_path)])
    names = runpy.run_path(str(ROOT / "examples" / "recompute_claims.py"))
    kinds = {claim["about"] for claim in names["claims"]["sentences"]}
    assert kinds >= {
        "best",
        "without L_fφ",
        "calmest",
        "violations",
        "turned",
        "tuned",
        "nowhere",
        "attainable",
        "across",
    }


def test_a_tuned_law_looks_like_the_law_that_it_was_tuned_from() -> None:
    look = looks(["sliding-mode", "own", "sliding-mode-tuned", "own-tuned", "other-tuned"])
    assert look["sliding-mode-tuned"].colour == look["sliding-mode"].colour
    assert look["own-tuned"].colour == look["own"].colour != look["sliding-mode"].colour
    assert look["own-tuned"].line != look["own"].line
    assert look["other-tuned"].line == look["own-tuned"].line
    assert len({look[name].colour for name in ("sliding-mode", "own", "other-tuned")}) == 3
    assert len({one.marker for one in look.values()}) == 5


def test_a_run_made_again_is_the_run_that_was_scored(tmp_path: Path) -> None:
    entries = (ControllerSpec("tracking"), ControllerSpec("qp", "hierarchical-qp", {"alpha": 5.0}))
    campaign = Campaign(
        "c", "", "", (Family.load("planar-arm"),), entries, ("disturbed",), scenes=3
    )
    task = Batch(campaign.families[0], (2,), ("disturbed",), entries, campaign.half, campaign.seed)
    lines = scored(task).runs.to_pylist()
    (tmp_path / "manifest.json").write_text(json.dumps({"configuration": campaign.resolved()}))
    record = replay(tmp_path, "planar-arm", 2, "disturbed", "qp")
    again = score(record, replay(tmp_path, "planar-arm", 2, "disturbed", "tracking")).result
    stored = next(line for line in lines if line["controller"] == "qp")
    seen = replayed(f"{tmp_path}:planar-arm:2:disturbed:qp")
    assert (seen.law, seen.title) == ("qp", "planar-arm 2, disturbed")
    np.testing.assert_array_equal(seen.trajectory.q, record.trajectory.q)
    page = tmp_path / "replay.html"
    words = ["replay", f"{tmp_path}:planar-arm:2:disturbed:qp", "--out", str(page)]
    assert CliRunner().invoke(app, words).exit_code == 0
    assert "planar-arm 2, disturbed" in page.read_text(encoding="utf-8")
    assert again["status"] == stored["status"]
    for name in (
        "duration_s",
        "acceleration_variation",
        "violation_depth",
        "final_feature_error_px",
    ):
        assert again[name] == stored[name]
    with pytest.raises(ConfigurationError, match="controller"):
        replay(tmp_path, "planar-arm", 2, "disturbed", "qq")
    with pytest.raises(ConfigurationError, match="family"):
        replay(tmp_path, "planar", 2, "disturbed", "qp")


def test_the_scene_that_divides_laws_most_is_shown() -> None:
    left = {"status": "trapped"}
    lost = {"a": (2,), "b": (1, 2, 3), "c": (1, 3), "d": (1, 3, 0)}
    lines = [
        run(controller=law, scene=i, **(left if i in own else {}))
        for law, own in lost.items()
        for i in range(5)
    ]
    assert divisive_scene(Dataset(made(frame(lines), Path())), "planar-arm") == 2
    same = [run(controller=law, scene=i) for law in "ab" for i in range(5)]
    assert divisive_scene(Dataset(made(frame(same), Path())), "planar-arm") is None
