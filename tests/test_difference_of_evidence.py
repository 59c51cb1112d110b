"""Two folders of drawn scenes held together."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaigns import campaign
from made_evidence import frame, made, run
from test_evidence import HERE
from vsconstraints.bench.difference import difference
from vsconstraints.bench.evidence import Campaign, collect, parquet
from vsconstraints.bench.reports.difference import page, verdict
from vsconstraints.comparisons.metrics import constraint_columns, result_columns
from vsconstraints.comparisons.tables import write_table
from vsconstraints.errors import ConfigurationError

SCENES = 60
Line = dict[str, Any]


def lines() -> list[Line]:
    """Two laws and tracking in two conditions, with numbers that are spread as those of scenes
    are.
    """
    settling = np.random.default_rng(3).lognormal(size=SCENES)
    return [
        run(condition, law, scene, settling_time_s=float(settling[scene]), sliding_lost_s=0.0)
        for condition in ("nominal", "disturbed")
        for law in ("tracking", "one", "two")
        for scene in range(SCENES)
    ]


def stored(
    folder: Path, runs: list[Line], values: dict[int, float] | None = None, **configuration: Any
) -> Path:
    """A folder of evidence of these runs; ``values`` says what was drawn for some scenes."""
    evidence = made(frame(runs), folder, **configuration)
    folder.mkdir()
    count = configuration.get("scenes", SCENES)
    (folder / "manifest.json").write_text(
        json.dumps({**evidence.manifest, "scenes": count, "finished": SCENES})
    )
    drawn = [{"Kp0": (values or {}).get(i, 0.0)} for i in evidence.scenes["scene"]]
    scenes = evidence.scenes.assign(values=[json.dumps(one) for one in drawn])
    for name, table in (("runs", evidence.runs), ("rows", evidence.rows), ("scenes", scenes)):
        (folder / name).mkdir()
        facts = {
            "family": "planar-arm",
            "scenes": scenes["scene"].tolist(),
            "identity": {
                "controllers": evidence.manifest["configuration"]["controllers"],
                "family": {"tables": {}},
            },
            "machine": {},
            "runs": len(runs),
            "seconds": 1.0,
        }
        part = parquet.table(parquet.tables()[name], table.to_dict("records"))
        parquet.write(folder / name / "part-planar-arm.parquet", part, facts)
    return folder


def changed(law: str, condition: str, scenes: Any, **cells: Any) -> list[Line]:
    return [
        {**line, **cells}
        if (line["controller"], line["condition"]) == (law, condition) and line["scene"] in scenes
        else line
        for line in lines()
    ]


def test_the_same_is_not_different(tmp_path: Path) -> None:
    found = difference(stored(tmp_path / "a", lines()), stored(tmp_path / "b", lines()))
    assert len(found.pairs.differ) == 6 * SCENES
    assert not found.found
    assert not found.worse
    assert not found.changes
    assert "are identical" in page(found)


def test_a_law_that_is_slower_in_one_condition_is_found_there(tmp_path: Path) -> None:
    slower = [
        {**line, "settling_time_s": 1.01 * line["settling_time_s"]}
        if (line["controller"], line["condition"]) == ("two", "disturbed")
        else line
        for line in lines()
    ]
    a = stored(tmp_path / "a", lines())
    b = stored(tmp_path / "b", slower)
    (one,) = difference(a, b).worse
    assert (one.group.law, one.group.place) == ("two", ("planar-arm", "disturbed"))
    assert "Worse: **two**, planar-arm, disturbed: settling time [s] by 0.0" in verdict(
        difference(a, b)
    )
    assert not difference(b, a).worse
    assert not difference(a, b, tolerance=0.02).worse


def test_of_drawn_scenes_rates_count_and_not_runs(tmp_path: Path) -> None:
    a = stored(tmp_path / "a", lines())
    few = stored(tmp_path / "few", changed("one", "nominal", range(5), status="trapped"))
    assert not difference(a, few).worse
    (lost,) = difference(a, few, strict=True).worse
    assert list(lost.lost) == [1 + 3 * i for i in range(5)]  # type: ignore[union-attr]
    assert "planar-arm, nominal, held-out, 4, one no longer converges: trapped" in page(
        difference(a, few)
    )
    many = stored(tmp_path / "many", changed("one", "nominal", range(6), status="trapped"))
    ((one, p),) = difference(a, many).found
    assert (one.before, one.after, p) == (SCENES, SCENES - 6, pytest.approx(2 / 2**6))  # type: ignore[union-attr]
    assert difference(a, many).worse


def test_scenes_that_were_drawn_otherwise_are_no_pairs(tmp_path: Path) -> None:
    a = stored(tmp_path / "a", lines())
    b = stored(
        tmp_path / "b",
        changed("one", "nominal", range(3), violated="fov[marker 1]"),
        {0: 1.0, 1: 1.0, 7: 1.0},
    )
    found = difference(a, b)
    assert found.pairs.drawn_otherwise == 3
    assert len(found.pairs.differ) == 6 * (SCENES - 3)
    assert found.pairs.differ.sum() == 1
    assert "3 scenes differ between the two and are left out." in page(found)
    other = stored(tmp_path / "other", lines(), dict.fromkeys(range(SCENES), 1.0))
    with pytest.raises(
        ConfigurationError,
        match=f"cannot be compared: all {SCENES} scenes were drawn differently: Kp0",
    ):
        difference(a, other)


def test_gains_of_a_family_that_are_others_are_a_change_and_those_that_are_drawn_another_scene(
    tmp_path: Path,
) -> None:
    def ran(name: str, constraint: str) -> Path:
        campaign(tmp_path)
        file = tmp_path / "quick.toml"
        file.write_text(f"{file.read_text()}[constraints.0]\n{constraint}\n")
        collect(Campaign.load(tmp_path / "small.toml").select(scenes=3), tmp_path / name, HERE)
        return tmp_path / name

    before = ran("before", "K = 0.2")
    stronger = ran("stronger", "K = 0.3\nswitching_gain = 30.0")
    found = difference(before, stronger)
    (name,) = found.changes[0].names
    told = [(change.what, change.before, change.after) for change in found.changes]
    assert (name, told) == (
        "quick",
        [
            ("families.constraints.0.K", 0.2, 0.3),
            ("families.constraints.0.switching_gain", 10.0, 30.0),
        ],
    )
    assert len(found.pairs.differ) == 18
    assert found.pairs.drawn_otherwise == 0
    # sliding modes follow their gains, and so does the bound of their band
    own = found.pairs.differ.xs("sliding-mode", level="controller")
    assert own.all()
    bounds = (side["phi_band_bound"].dropna() for side in (found.pairs.a, found.pairs.b))
    assert [float(side.max()) for side in bounds] == pytest.approx([0.05, 0.15])
    drawn = ran("drawn", "switching_gain = { uniform = [20.0, 30.0] }")
    with pytest.raises(
        ConfigurationError,
        match=r"all 3 scenes were drawn differently: constraints\.0\.switching_gain$",
    ):
        difference(before, drawn)


def test_fewer_scenes_and_other_settings_are_said(tmp_path: Path) -> None:
    a = stored(tmp_path / "a", lines())
    half = [line for line in lines() if line["scene"] < 30]
    laws = {
        "tracking": {"type": "tracking"},
        "one": {"type": "one", "alpha": 2.0},
        "two": {"type": "two"},
    }
    b = stored(tmp_path / "b", half, scenes=SCENES + 1, controllers=laws)
    text = page(difference(a, b))
    assert f"B is not finished: {SCENES} of {SCENES + 1} scenes." in text
    assert "180 only in A: planar-arm, nominal, held-out, 30, tracking; " in text
    assert "controllers.alpha" in text


def test_drawn_scenes_are_not_held_against_chosen_ones(tmp_path: Path) -> None:
    a = stored(tmp_path / "a", lines())
    b = tmp_path / "b"
    b.mkdir()
    configuration = {
        "scenarios": {"s": {"folder": "", "tables": {}}},
        "controllers": {"one": {"type": "tracking"}},
    }
    (b / "manifest.json").write_text(json.dumps({"configuration": configuration}))
    write_table(b / "results.csv", result_columns(), [])
    write_table(b / "constraints.csv", constraint_columns(), [])
    for one, other in ((a, b), (b, a)):
        with pytest.raises(ConfigurationError, match="only one of them has drawn scenes"):
            difference(one, other)
