"""The leaderboard: what it says follows the runs, and tables that are not what they say they are
are refused.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pyarrow as pa
import pytest
from typer.testing import CliRunner

from test_evidence import here
from test_testset import quiet
from vsconstraints.bench.evidence import Batch, Campaign, Evidence, Plan, collect
from vsconstraints.bench.families import Family
from vsconstraints.bench.families.frozen import TestSet
from vsconstraints.bench.repetition import (
    NUDGE,
    Repetition,
    drawn_lines,
    repeat,
    repeat_once,
    repeat_run,
)
from vsconstraints.bench.reports.leaderboard import leaderboard
from vsconstraints.bench.study import SHIPPED, Study
from vsconstraints.cli import app
from vsconstraints.comparisons.runs.spec import ControllerSpec
from vsconstraints.errors import ConfigurationError
from vsconstraints.simulation.programs import declaration

ROOT = Path(__file__).parents[1]
KEPT = [
    SHIPPED,
    *(ROOT / "comparisons" / f"{name}.parquet" for name in ("laws", "policy", "tuned-laws")),
]
OWN = """
from vsconstraints.controllers import HierarchicalQP

class Mine(HierarchicalQP):
    name = "mine"
"""


@pytest.fixture(scope="module")
def frozen(tmp_path_factory: pytest.TempPathFactory) -> TestSet:
    folder = tmp_path_factory.mktemp("frozen")
    counts = {"training": 1, "held-out": 3}
    return TestSet.make(folder, [Family.load("planar-arm")], "t", counts, 0, quiet)


@pytest.fixture(scope="module")
def folder(frozen: TestSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs of a law of one's own and of two that come with the package."""
    folder = tmp_path_factory.mktemp("runs") / "runs"
    code = tmp_path_factory.mktemp("code") / "mine.py"
    code.write_text(OWN)
    campaign = Campaign.load(None).changed(**frozen.chosen((), "held-out", None, None))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(code.parent)
        chosen = campaign.select(controllers=["sliding-mode", "hierarchical-qp", "mine:Mine"])
        collect(chosen, folder, Plan(workers=here))
    return folder


@pytest.fixture(scope="module")
def study(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Study:
    """As it is read from a table that the command line kept, without the own law's code."""
    table = tmp_path_factory.mktemp("kept") / "table.parquet"
    assert (
        CliRunner().invoke(app, ["advise", "--study", str(folder), "--keep", str(table)]).exit_code
        == 0
    )
    return Study.load(table, custom_laws=True)


def changed(study: Study, run: Any, **values: Any) -> Study:
    runs = study.runs.copy()
    for column, value in values.items():
        runs.loc[run, column] = value
    return replace(study, runs=runs)


def only(study: Study, law: str) -> Study:
    own = study.runs[study.runs["controller"] == law].reset_index(drop=True)
    return replace(study, runs=own, laws={law: study.laws[law]})


def test_laws_stand_in_the_order_of_their_success_and_own_ones_beside_the_others(
    study: Study, frozen: TestSet
) -> None:
    lines = leaderboard({"a": study}, frozen).splitlines()[2:]
    order = [line.split("|")[1].strip() for line in lines]
    success = study.runs.groupby("controller")["success"].mean()
    assert [success[law] for law in order] == sorted(success, reverse=True)
    assert {*order} == {"sliding-mode", "hierarchical-qp", "mine"}
    assert "see its code" in lines[order.index("mine")]
    disturbed = study.runs[
        (study.runs["condition"] == "disturbed") & (study.runs["controller"] == "sliding-mode")
    ]
    hardest = f"{100 * disturbed['success'].mean():.0f} (planar-arm)"
    assert hardest in lines[order.index("sliding-mode")]
    both = leaderboard({"a": study, "b": study}, frozen)
    assert "mine (b)" in both
    assert len(both.splitlines()) == 2 + 6
    failing = study.runs.assign(success=False, status="slow", tolerant_success=False)
    runs = study.runs.where(study.runs["controller"] == "sliding-mode", failing)
    assert "| sliding-mode" in leaderboard({"a": replace(study, runs=runs)}, frozen).splitlines()[2]


def test_the_leaderboard_says_what_a_stack_declared(
    folder: Path, frozen: TestSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also from a table that was kept; the reason of a run has the declaration."""
    evidence = Evidence.load(folder, True)
    runs = evidence.runs.copy()
    said = declaration("mine 2.0", ("q", "limits"), "velocity")
    runs.loc[runs["controller"] == "mine", "reason"] = said
    vars(evidence)["runs"] = runs
    monkeypatch.setattr(Evidence, "load", lambda *_: evidence)
    Study.load(folder, custom_laws=True).keep(tmp_path / "table.parquet")
    kept = Study.load(tmp_path / "table.parquet", custom_laws=True)
    (line,) = [
        line for line in leaderboard({"a": kept}, frozen).splitlines() if line.startswith("| mine")
    ]
    assert line.split("|")[3].strip() == "q, limits"


def test_the_code_of_own_laws_is_not_imported_to_read_their_runs(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def imported(name: str, *arguments: Any) -> None:
        raise AssertionError(f"{name} is imported")

    monkeypatch.setattr("vsconstraints.controllers.imported_class", imported)
    assert Study.load(folder, trust=True, custom_laws=True).requires["mine"] is None


def test_own_laws_are_left_out_of_advice(folder: Path) -> None:
    assert (
        {*Study.load(folder).laws}
        == {"sliding-mode", "hierarchical-qp"}
        == {*Study.load(folder).runs["controller"]}
    )


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (
            lambda own: replace(own, frozen={}),
            "planar-arm.held-out.* of test set t is not the file that was run",
        ),
        (
            lambda own: replace(
                own, frozen={"planar-arm": {**own.frozen["planar-arm"], "sha256": "0"}}
            ),
            "is not the file that was run",
        ),
        (
            lambda own: replace(own, runs=own.runs[own.runs["scene"] > 0]),
            "1 held-out scenes of planar-arm, nominal",
        ),
        (
            lambda own: replace(own, runs=own.runs[own.runs["condition"] != "limited"]),
            "3 .* limited, are missing",
        ),
        (
            lambda own: changed(own, own.runs["scene"] == 2, scene=102),
            "1 .* do not exist, such as scene 102.*0 to 2",
        ),
        (
            lambda own: changed(own, own.runs["scene"] == 0, family="unknown"),
            "no held-out scenes of unknown",
        ),
        (
            lambda own: changed(own, own.runs["scene"] == 0, half="training"),
            "no training scenes of planar-arm",
        ),
        (
            lambda own: changed(own, own.runs["condition"] == "disturbed", condition="nominal-2"),
            "no held-out scenes of planar-arm, nominal-2",
        ),
        (lambda own: changed(own, 0, status="slow", success=True), "contradict each other"),
        (
            lambda own: changed(own, 0, violated="fov[marker 1]", violation_fraction=0.0),
            "contradict each other",
        ),
        (
            lambda own: changed(own, 0, violation_fraction=0.5, tolerant_success=True),
            "contradict each other",
        ),
    ],
)
def test_tables_that_cannot_be_compared_are_refused_by_name(
    change: Any, why: str, study: Study, frozen: TestSet
) -> None:
    with pytest.raises(ConfigurationError, match=f"mine: .*{why}"):
        leaderboard({"mine": change(study)}, frozen)


def made_again(study: Study, frozen: TestSet, share: float = 1.0, **options: Any) -> Repetition:
    families = {family.name: family for family in frozen.families}
    return repeat(study, families, share, 0, **{"workers": here, **options})


def test_runs_made_again_are_the_stored_ones_and_a_forged_one_is_found(
    study: Study, frozen: TestSet
) -> None:
    shipped = only(study, "hierarchical-qp")
    whole = made_again(shipped, frozen)
    assert not whole.differences
    assert whole.agreeing + len(whole.by_rounding) == whole.runs == len(shipped.runs)
    known = shipped.runs.index[shipped.runs["settling_time_s"].notna()]
    for value in (1.0 - 1e-8, 0.5):
        forged = changed(
            shipped, known[0], settling_time_s=value * shipped.runs["settling_time_s"][known[0]]
        )
        found = made_again(forged, frozen)
        (what,) = (*found.differences, *found.by_rounding)
        assert "settling_time_s" in what
    forged = changed(
        shipped, 0, status="slow" if shipped.runs["status"][0] == "converged" else "converged"
    )
    assert len(made_again(forged, frozen).differences) == 1
    with pytest.raises(ConfigurationError, match="mine:Mine"):
        made_again(only(study, "mine"), frozen)


def test_which_runs_are_repeated_follows_from_the_seed_and_not_from_the_order_of_lines(
    study: Study,
) -> None:
    shuffled = replace(
        study, runs=study.runs.sample(frac=1.0, random_state=1).reset_index(drop=True)
    )
    for seed in range(3):
        assert drawn_lines(shuffled, 0.3, seed) == drawn_lines(study, 0.3, seed)
    assert drawn_lines(study, 0.3, 0) != drawn_lines(study, 0.3, 1)


def test_a_check_says_how_many_runs_it_repeated_by_which_secret_seed(
    study: Study, frozen: TestSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(TestSet, "load", lambda: frozen)
    forged = changed(only(study, "hierarchical-qp"), 0, acceleration_variation=1e3)
    forged.keep(table := tmp_path / "forged.parquet")
    lines = len(forged.runs)
    said: list[list[str]] = []
    seeds = []
    for options in ((), (), ("--seed", "7"), ("--seed", "7")):
        done = CliRunner().invoke(
            app, ["testset", "leaderboard", str(table), "--rerun", "0.3", *options]
        )
        (summary,) = (line for line in done.stderr.splitlines() if "were repeated" in line)
        assert summary.startswith(
            f"{math.ceil(0.3 * lines)} of {lines} runs of forged were repeated: "
        )
        seeds.append(int(summary.rpartition(" ")[2]))
        said.append([line for line in done.stderr.splitlines() if "repeating runs" not in line])
    assert seeds[0] != seeds[1]
    assert seeds[2:] == [7, 7]
    assert said[2] == said[3]
    whole = CliRunner().invoke(app, ["testset", "leaderboard", str(table), "--rerun", "1"])
    assert whole.exit_code == 1
    assert f"{lines} of {lines} runs of forged were repeated: " in whole.stderr
    assert " agree, 1 differ, " in whole.stderr
    assert whole.stdout == ""


@pytest.mark.parametrize("share", [1e-4, pytest.param(2e-3, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kept", KEPT, ids=lambda path: path.stem)
def test_kept_runs_are_what_laws_do_now(
    kept: Path, share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Up to nine of them, made again; a five-hundredth in slow tests. A hundredth of the study is a
    step of the whole gate.
    """
    monkeypatch.chdir(ROOT)  # weights of a policy are found from there
    study = Study.load(kept, custom_laws=True)
    assert not made_again(study, TestSet.load(), share, trust=True).differences


def test_a_run_that_rounding_decides_is_told_from_a_forged_one(
    study: Study, frozen: TestSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a start that is moved by 1e-3 rad or m instead of rounding, every run is decided by
    that.
    """
    monkeypatch.setattr("vsconstraints.bench.repetition.NUDGE", 1e-3)
    own = only(study, "sliding-mode")
    forged = changed(own, 0, utilization=own.runs["utilization"][0] + 1e-6)
    found = made_again(forged, frozen)
    assert (len(found.by_rounding), found.differences) == (1, ())


RESULT = {
    "status": "converged",
    "violated": "",
    "violation_fraction": 0.0,
    "settling_time_s": 2.0,
    "utilization": 0.5,
    "acceleration_variation": 1.0,
}


@pytest.mark.parametrize(
    ("forged", "again", "nudged", "found", "decided_by_rounding"),
    [
        (
            "utilization",
            {},
            {"utilization": 0.51},
            "utilization is 0.9 and was made 0.5, and 0.51 from the moved start",
            True,
        ),
        ("utilization", {}, {"acceleration_variation": 1.01}, "utilization is 0.9", False),
        ("utilization", {}, {"utilization": 0.5 + 1e-11}, "utilization is 0.9", False),
        ("utilization", {"utilization": 0.51}, {"utilization": 0.52}, "not reproducible", False),
    ],
)
def test_rounding_excuses_only_numbers_that_it_changes_itself(
    forged: str,
    again: dict[str, Any],
    nudged: dict[str, Any],
    found: str,
    decided_by_rounding: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A law that adds random numbers of its own would excuse every line."""
    results = iter([RESULT, {**RESULT, **again}])

    def made(line: Any, family: Any, law: Any, seed: int, nudge: float = 0.0) -> dict[str, Any]:
        return {**RESULT, **nudged} if nudge == NUDGE else next(results)

    monkeypatch.setattr("vsconstraints.bench.repetition.repeat_once", made)
    line = {**RESULT, forged: 0.9}
    family = Family.load("planar-arm")
    (sentence,), by_rounding = repeat_run(line, family, ControllerSpec("sliding-mode"), 0)
    assert found in sentence
    assert by_rounding == decided_by_rounding


def test_small_coordinates_of_a_start_are_moved_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """By 1e-13 rad; those above 1 rad by as large a share of themselves."""
    family = Family.load("planar-arm")
    drawn = family.scene(1, "held-out", 0)
    starts: list[list[float]] = []

    def scored(batch: Batch) -> Any:
        assert batch.drawn is not None
        starts.extend(table["q0"] for table in batch.drawn.tables.values())
        return SimpleNamespace(runs=pa.Table.from_pylist([{"controller": "sliding-mode"}]))

    monkeypatch.setattr("vsconstraints.bench.repetition.scored", scored)
    line = {"scene": 1, "half": "held-out", "condition": "nominal"}
    for start, moved in (
        ([0.0, 0.0, 0.0], [1e-13, 1e-13, 1e-13]),
        ([0.3, -2.0, 1e-10], [0.3 + 1e-13, -2.0 + 2e-13, 1e-10 + 1e-13]),
    ):
        tables = {name: {**table, "q0": start} for name, table in drawn.tables.items()}
        scene = replace(drawn, tables=tables)
        monkeypatch.setattr(Family, "scene", lambda *_, scene=scene: scene)
        starts.clear()
        repeat_once(line, family, ControllerSpec("sliding-mode"), 0, NUDGE)
        assert starts == [moved] * len(tables)


def test_runs_decided_by_rounding_are_listed_with_the_rule_that_decides(
    study: Study, frozen: TestSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(TestSet, "load", lambda: frozen)
    table = tmp_path / "mine.parquet"
    only(study, "hierarchical-qp").keep(table)
    command = ["testset", "leaderboard", str(table), "--rerun", "0.3"]
    rule = (
        "if every result that differs from the stored one also changes by more than 1e-09 when the "
        f"start coordinates are changed by {NUDGE:g} rad or m, and those of a size above 1 by a relative "
        f"{NUDGE:g}"
    )
    for by_rounding in (
        (),
        ("planar-arm 3, nominal, a: utilization is 0.9", "ur5 4, limited, a: x"),
    ):
        repetition = Repetition(5, (), by_rounding)
        monkeypatch.setattr(
            "vsconstraints.bench.repetition.repeat", lambda *a, of=repetition, **options: of
        )
        done = CliRunner().invoke(app, command)
        assert done.exit_code == 0
        said = " ".join(done.stderr.split())
        for sentence in by_rounding:
            assert f"warning: mine: decided by rounding: {sentence}" in said
        assert f"{len(by_rounding)} count as decided by rounding" in said
        assert (f"{rule}." in said) == bool(by_rounding)


def test_the_page_shows_the_leaderboard_of_the_study_that_comes_with_the_package() -> None:
    page = (ROOT / "docs" / "benchmark.md").read_text()
    shown = page.partition("<!-- leaderboard -->")[2].partition("<!-- end -->")[0].strip()
    study = Study.load()
    assert shown == leaderboard({"vsconstraints": study}, TestSet.load())
    disturbed = study.runs[study.runs["condition"] == "disturbed"]
    for line in shown.splitlines()[2:]:
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        least = disturbed[disturbed["controller"] == cells[0]].groupby("family")["success"].mean()
        tolerated = disturbed[disturbed["controller"] == cells[0]]["tolerant_success"].mean()
        assert float(cells[6].strip("≈* ").partition(" ")[0]) == pytest.approx(
            100 * tolerated, abs=0.0501
        )
        assert cells[7] == f"{100 * least.min():.0f} ({least.idxmin()})"
