"""Which law for a scene: what advice rests on, that it follows the runs, and what it refuses."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from checks import advice as check
from typer.testing import CliRunner, Result

from campaigns import campaign
from test_evidence import here
from vsconstraints.bench.advice import ENOUGH, Judged, advise, distance, similar
from vsconstraints.bench.evidence import Evidence, Plan, collect, parquet
from vsconstraints.bench.families import Family
from vsconstraints.bench.study import COLUMNS, SHIPPED, Situation, Study
from vsconstraints.cli import app
from vsconstraints.comparisons import Suite
from vsconstraints.comparisons.runs.spec import ControllerSpec
from vsconstraints.errors import ConfigurationError
from vsconstraints.scenarios import Scenario, shipped_scenarios

LIKE = Situation(
    6, "camera-pose", False, ("joint-range",), 0.002, 0.0, 0.0, False, False, False, False, False
)


def study(success: Mapping[str, Sequence[bool]], *situations: Situation) -> Study:
    """A study of laws by whether they succeed in scene after scene; all scenes are alike, or of one
    situation each.
    """
    lines = []
    for law, flags in success.items():
        for scene, flag in enumerate(flags):
            situation = vars(situations[scene] if situations else LIKE)
            key = {
                "family": "a",
                "condition": "nominal",
                "half": "held-out",
                "scene": scene,
                "controller": law,
            }
            results = {
                "success": flag,
                "tolerant_success": True,
                "call_us": 2.0,
                "settling_time_s": 1.0,
            }
            results |= {
                "status": "converged" if flag else "slow",
                "violated": "",
                "violation_fraction": 0.0,
            }
            results |= {"utilization": 1.0, "acceleration_variation": 1.0}
            lines.append(
                {**key, **situation, "constraints": "; ".join(situation["constraints"]), **results}
            )
    return Study(
        pd.DataFrame(lines)[[column.name for column in COLUMNS]],
        {law: ControllerSpec(law) for law in success},
    )


def share(good: int, of: int = 100) -> list[bool]:
    return [scene < good for scene in range(of)]


def taken(runs: Study, situation: Situation = LIKE, **options: Any) -> str:
    return advise(runs, situation, **options).laws[0].law.name


def test_a_law_that_requires_less_may_lose_a_quarter_of_a_standard_error() -> None:
    """In 13 scenes only the one succeeds, in 12 only the other: it loses 1.2 ± √(25 − 1/100)
    scenes, with all.
    """
    near = [scene >= 13 for scene in range(100)]
    assert (sum(near), sum(share(88))) == (87, 88)
    assert taken(study({"predictive": share(88), "hierarchical-qp": near})) == "hierarchical-qp"
    assert (
        taken(study({"predictive": share(88), "hierarchical-qp": near}), margin=0.2) == "predictive"
    )
    far = study({"predictive": share(95), "hierarchical-qp": share(91), "sliding-mode": share(60)})
    found = advise(far, LIKE)
    assert [law.law.name for law in found.laws] == ["predictive", "hierarchical-qp", "sliding-mode"]
    assert [law.best for law in found.laws] == [True, True, False]
    assert [law.loss.difference for law in found.laws] == pytest.approx([0.0, 0.04, 0.35])
    # simultaneous for three pairs: wider than that of one
    alone = advise(
        replace(far, laws={name: far.laws[name] for name in ("predictive", "sliding-mode")}), LIKE
    )
    assert (
        found.laws[2].loss.low
        < alone.laws[1].loss.low
        < 0.35
        < alone.laws[1].loss.high
        < found.laws[2].loss.high
    )


def test_other_scenes_decide_between_laws_that_succeed_equally_often_in_those_alike() -> None:
    situations = [LIKE] * 20 + [replace(LIKE, mass=True)] * 20
    runs = study({"hierarchical-qp": share(20, 40), "predictive": share(40, 40)}, *situations)
    first, second = advise(runs, LIKE).laws
    assert (first.law.name, first.success.share, second.success.share) == ("predictive", 1.0, 1.0)
    assert first.success.of == 20


def test_what_may_be_used_narrows_the_choice() -> None:
    runs = study({"predictive": share(95), "hierarchical-qp": share(80), "sliding-mode": share(60)})
    assert taken(runs, may_use=["L_fφ"]) == "hierarchical-qp"
    assert taken(runs, may_use=["rows"]) == "sliding-mode"
    with pytest.raises(ConfigurationError, match="every law of the study needs more than rows"):
        advise(study({"predictive": share(95)}), LIKE, ["rows"])


def spread(laws: Sequence[Judged]) -> float:
    shares = [law.success.share for law in laws]
    return max(shares) - min(shares)


@pytest.mark.parametrize("name", ["ur5-fov", "moving-target-unknown", "example-2d-fov"])
def test_advice_falls_with_the_runs_that_it_rests_on(name: str) -> None:
    shipped = Study.load()
    situation = Situation.of(Scenario.load(name))
    best = (laws := advise(shipped, situation).laws)[0]
    own = shipped.runs["controller"] == best.law.name
    failing = replace(shipped, runs=shipped.runs.assign(success=shipped.runs["success"] & ~own))
    assert taken(failing, situation) != best.law.name
    mixed = np.random.default_rng(0).permutation(shipped.runs["success"])
    shuffled = advise(replace(shipped, runs=shipped.runs.assign(success=mixed)), situation).laws
    # nothing then tells laws apart, though scenes may be easier than those that the advice rests on
    assert spread(shuffled) < spread(laws)


def test_scenes_like_one_are_the_nearest_and_count_once() -> None:
    """Twenty that are alike suffice; of fewer the first step that gives so many is taken, and
    named.
    """
    near = replace(LIKE, sampling_time=0.007)
    noisy = replace(LIKE, noise=0.5)
    runs = study({"sliding-mode": share(60, 60)}, *[LIKE] * 20, *[near] * 20, *[noisy] * 20).scenes
    scenes, widened, unlike = similar(runs, LIKE)
    assert (list(scenes["scene"]), widened, unlike) == ([*range(20)], (), ())
    scenes, widened, unlike = similar(runs[runs["scene"] > 0], LIKE)
    assert (list(scenes["scene"]), widened, unlike) == (
        [*range(1, 40)],
        ("similar sampling time",),
        (),
    )
    scenes, widened, unlike = similar(runs[runs["scene"] > 30], LIKE)
    assert (list(scenes["scene"]), widened) == (
        [*range(31, 60)],
        ("similar sampling time", "any noise"),
    )
    assert unlike == (f"only 9 scenes are similar, fewer than {ENOUGH}",)
    # the same scenes in another condition are no more scenes: each is taken in the one that is
    # nearer
    twice = pd.concat(
        [runs[runs["scene"] < 20].assign(condition="late", delay=0.01), runs[runs["scene"] < 20]]
    )
    assert {*similar(twice, LIKE)[0]["condition"]} == {"nominal"}
    assert len(similar(twice, LIKE)[0]) == 20
    assert {*similar(twice, replace(LIKE, delay=0.02))[0]["condition"]} == {"late"}

    # what no scene has does not hide which scenes are like it otherwise
    assert list(similar(runs, replace(LIKE, mass=True))[0]["scene"]) == [*range(20)]


@pytest.mark.parametrize(
    ("name", "asked", "there", "apart"),
    [
        ("delay", 0.01, 0.02, 0),
        ("delay", 0.01, 0.04, 1),
        ("delay", 0.041, 0.01, 2),
        ("noise", 0.0, 1e-9, 2),
        ("joints", 6, 7, 1),
        ("joints", 6, 8, 2),
        ("constraints", ("a", "b"), ("a",), 1),
        ("constraints", ("a", "b"), ("b", "c"), 2),
        ("feature", "camera-pose", "image-points", 2),
    ],
)
def test_what_is_near(name: str, asked: Any, there: Any, apart: int) -> None:
    assert distance(name, asked, there) == distance(name, there, asked) == apart
    assert distance(name, asked, asked) == 0


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"joints": 9}, "joints 9: 6 to 6 in all scenes"),
        ({"delay": 0.1}, "delay 0.1: 0 to 0 in all scenes"),
        ({"constraints": ("joint-range", "occlusion")}, "no scene has occlusion"),
        ({"mass": True}, "no scene has mass: True"),
        ({"feature": "image-points"}, "no scene has feature: image-points"),
    ],
)
def test_what_is_unlike_anything_in_the_study_is_named(
    changes: dict[str, Any], reason: str
) -> None:
    runs = study({"sliding-mode": share(60)})
    assert advise(runs, LIKE).unlike == ()
    assert reason in advise(runs, replace(LIKE, **changes)).unlike
    few = study({"sliding-mode": share(5, 19)})
    assert advise(few, LIKE).unlike == ("only 19 scenes are similar, fewer than 20",)


def test_the_situation_of_scenes_and_scenarios() -> None:
    scene = Family.load("moving").scene(0)
    nominal, disturbed, limited = (
        Situation.of(scene.scenario(c)) for c in ("nominal", "disturbed", "limited")
    )
    kinds = ("field-of-view", "forbidden-sphere", "joint-speed", "occlusion")
    assert nominal == Situation(
        6, "camera-pose", False, kinds, 0.004, 0.0, 0.0, False, False, False, False, False
    )
    drawn = scene.tables["disturbed"]["disturbances"]
    late = replace(
        nominal, unknown_motion=True, delay=0.004 * drawn["delay"], noise=drawn["pixel_noise"]
    )
    assert (disturbed, limited) == (late, replace(nominal, limits=True))
    assert Situation.of(Family.load("six-axis").scene(0).scenario("disturbed")).wrong_model
    images = Situation.of(Scenario.load("ur5-images"))
    assert images.images
    assert images.delay == pytest.approx(0.03)
    fixed = Situation.of(Scenario.load("eye-to-hand-ibvs"))
    assert (fixed.fixed_camera, fixed.feature) == (True, "image-points")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("campaign")
    collect(campaign(path, scenes=2), path / "evidence", Plan(workers=here))
    return path / "evidence"


def test_a_folder_of_evidence_and_the_table_kept_of_it(folder: Path, tmp_path: Path) -> None:
    seen: list[tuple[int, int]] = []
    runs = Study.load(folder, on_scene=lambda *now: seen.append(now))
    assert seen == [(0, 2), (1, 2)]
    runs.keep(tmp_path / "kept.parquet")
    again = Study.load(tmp_path / "kept.parquet")
    pd.testing.assert_frame_equal(again.runs, runs.runs)
    assert again.laws.keys() == {"sliding-mode", "hierarchical-qp"}
    assert again.laws["hierarchical-qp"].options == {"rows": "barrier"}
    limited = again.runs[again.runs["condition"] == "limited"]
    assert limited["limits"].all()
    assert not again.runs.drop(limited.index)["limits"].any()


def test_success_is_by_the_standard_that_reports_have(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of runs that all converge: nothing violated, nothing by more than 1 % of L."""
    evidence = Evidence.load(folder)
    deep = ["", "", "fov", "fov"] * 3
    shallow = ["", "", "", "fov"] * 3
    vars(evidence)["runs"] = evidence.runs.assign(
        status="converged", violated=deep, violated_tolerant=shallow
    )
    monkeypatch.setattr(Evidence, "load", lambda *_: evidence)
    runs = Study.load(folder).runs.merge(
        evidence.runs[["condition", "scene", "controller", "violated_tolerant"]]
    )
    assert len(runs) == 8
    assert list(runs["tolerant_success"]) == list(runs["violated_tolerant"] == "")
    assert 0 < runs["success"].sum() < runs["tolerant_success"].sum() < 8


def test_studies_that_cannot_be_used_are_refused_by_name(folder: Path, tmp_path: Path) -> None:
    runs = Study.load(folder)
    path = tmp_path / "study.parquet"
    table = parquet.table(COLUMNS, runs.runs.to_dict("records"))
    laws = {name: {"type": law.law, **law.options} for name, law in runs.laws.items()}
    for lines, facts, why in (
        (table, {"study": 1, "controllers": laws}, "its format is 1, not 2"),
        (table.slice(0, 0), {"controllers": laws}, "it is empty"),
        (table, {"controllers": {**laws, "odd": {}}}, "the law odd is from another version"),
        (table, {"controllers": {**laws, "sliding-mode": {"k": 3}}}, "'k'"),
        (table.slice(1), {"controllers": laws}, "not every law has one run in each scene"),
        (table.drop_columns("feature"), {"controllers": laws}, "no column 'feature'"),
        (table, {"study": None, "controllers": laws}, "its format is None, not 2"),
        (table, {"controllers": laws, "frozen": None}, "it has no frozen"),
    ):
        parquet.write(path, lines, {"study": 2, "requires": {}, "frozen": {}, **facts})
        with pytest.raises(ConfigurationError, match=why) as refused:
            Study.load(path)
        assert str(path) in str(refused.value)
    old = Evidence(folder, {**Evidence.load(folder).manifest, "version": "0.1"})
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Evidence, "load", lambda *_: old)
        with pytest.raises(ConfigurationError, match=r"is of version 0\.1"):
            Study.load(folder)


def test_the_study_of_the_package_answers_for_every_scenario() -> None:
    shipped = Study.load()
    assert SHIPPED.stat().st_size < 3_000_000
    for name in shipped_scenarios():
        found = advise(shipped, Situation.of(Scenario.load(name)))
        assert found.laws[0].success.of >= ENOUGH
        assert {law.law.name for law in found.laws} == shipped.laws.keys()


def say(*words: str) -> Result:
    return CliRunner().invoke(app, ["advise", *words])


def test_settings_that_are_printed_load(tmp_path: Path) -> None:
    for words in (
        ("ur5-fov",),
        ("moving-target-unknown", "--may-use", "L_fφ", "--may-use", "K"),
        ("--joints", "3"),
    ):
        done = say(*words)
        data = json.loads(say(*words, "--json").output)
        assert done.exit_code == 0, done.output
        assert done.output.count("\n") < 30, "one screen"
        settings = done.output.partition("\n\n")[2].partition("\n\n")[0]
        (tmp_path / "suite.toml").write_text(
            f'scenarios = ["ur5-fov"]\n{settings}\n', encoding="utf-8"
        )
        (entry,) = Suite.load(tmp_path / "suite.toml").controllers
        first = data["laws"][0]
        assert (entry.name, {"type": entry.law, **entry.options}) == (
            first["law"],
            first["settings"],
        )
        assert entry.make().uses == tuple(first["requires"])
        assert first["success"]["low"] <= first["success"]["share"] <= first["success"]["high"]
        assert done.output.startswith(f"{entry.name}: success in {first['success']['count']} of ")


def test_answers_are_in_the_units_of_the_options() -> None:
    assert (
        json.loads(say("--latency-ms", "10", "--noise-px", "0.3", "--json").output)["unlike"] == []
    )
    (reason,) = json.loads(say("--latency-ms", "300", "--json").output)["unlike"][:1]
    assert reason.startswith("delay 0.3: 0 to 0.0")


@pytest.mark.parametrize(
    ("words", "what"),
    [
        ((), "needs a scenario, or options"),
        (("ur5-fow",), "unknown scenario 'ur5-fow'. Did you mean 'ur5-fov'"),
        (("ur5-fov", "--joints", "7"), "ur5-fov already states joints"),
        (
            ("ur5-fov", "--known-motion", "--noise-px", "1"),
            "ur5-fov already states noise, unknown_motion",
        ),
        (
            ("--rows", "joint-ranges"),
            "unknown type of constraints 'joint-ranges'. Did you mean 'joint-range'",
        ),
        (
            ("--joints", "6", "--may-use", "modle"),
            "unknown information 'modle'. Did you mean 'model'",
        ),
        (("--joints", "6", "--study", "nowhere.parquet"), "nowhere.parquet cannot be read"),
        (("--joints", "6", "--study", "."), "holds no evidence"),
    ],
)
def test_questions_that_cannot_be_answered(
    words: tuple[str, ...], what: str, tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    refused = say(*words).exception
    assert isinstance(refused, ConfigurationError)
    assert what in str(refused)


def test_the_check_leaves_a_family_out(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where families say the contrary of each other, what follows from one loses everything in the
    other.
    """
    contrary = {"hierarchical-qp": share(0, 40), "sliding-mode": share(40, 40)}
    runs = study(contrary)
    other = study(dict(zip(contrary, reversed(contrary.values()), strict=True)))
    for second, regret in ((other, "100.0"), (runs, "0.0")):
        both = replace(runs, runs=pd.concat([runs.runs, second.runs.assign(family="b")]))
        monkeypatch.setattr(Study, "load", lambda *_, both=both: both)
        # so few scenes do not show that it loses less than half a point
        assert check.main(["made up"]) == 1
        printed = capsys.readouterr().out
        assert f"best law 100.0; advice {regret}; most success {regret}" in printed
        assert "any law 50.0" in printed
