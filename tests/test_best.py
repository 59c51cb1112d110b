"""What can be done at all: motions that leave a row between their nodes, scenes that are closed
off, and the table.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from checks import best

from documents import ROOT
from vsconstraints.bench.evidence import parquet
from vsconstraints.bench.families.frozen import TestSet
from vsconstraints.errors import ConfigurationError
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup


def there_and_back(upper: float) -> tuple[Setup, best.Motion]:
    """Joint 1 goes out at 0.5 rad/s for 0.1 s, returns at once as fast, and comes to rest where it
    began.

    It is 0.05 rad farther out at the two nodes between which it turns back, and 0.0625 rad between
    them.
    """
    scenario = Scenario.load("example-2d-fov")
    q0 = np.array(scenario.tables["q0"])
    limit = {
        "joints": [1],
        "lower": [q0[0] - 1.0],
        "upper": [q0[0] + upper],
        "K": 0.1,
        "switching_gain": 1.0,
    }
    scenario = scenario.with_override("constraints", [{"type": "joint-range", **limit}])
    setup = scenario.with_override("task.goals", [{"camera_at_q": q0.tolist()}]).setup()
    along = np.array([[1.0, 0.0, 0.0]])
    qdd = np.array([[5.0], [0.0], [-10.0], [0.0], [5.0]]) * along
    return setup, best.Motion(np.array([0.1, 0.05, 0.1, 0.05, 0.1]), qdd)


def test_a_motion_is_what_its_accelerations_make_of_it() -> None:
    setup, motion = there_and_back(1.0)
    t, q, qd = motion.states(setup.q0, setup.qd0, 1.0)
    assert t[-1] == pytest.approx(1.0)
    assert np.diff(t).max() <= 0.002
    assert np.gradient(q[:, 0], t)[5:-5] == pytest.approx(qd[5:-5, 0], abs=0.02)
    assert (q[:, 0].max() - setup.q0[0], qd[-1, 0]) == pytest.approx((0.0625, 0.0))
    assert np.array_equal(best.Motion.read(motion.rounded().text()).qdd, motion.qdd)


@pytest.mark.parametrize(("upper", "valid"), [(0.07, True), (0.06, False)])
def test_a_row_that_is_violated_between_nodes_is_seen(upper: float, valid: bool) -> None:
    setup, motion = there_and_back(upper)
    nodes = np.cumsum(motion.intervals)
    t, q, _ = motion.states(setup.q0, setup.qd0)
    assert np.interp(nodes, t, q[:, 0]).max() < setup.q0[0] + 0.06
    assert best.judged(setup, motion).valid == valid


def test_a_motion_that_does_not_stay_at_the_goal_has_not_settled() -> None:
    setup, motion = there_and_back(1.0)
    found = best.judged(setup, motion)
    assert 0.35 < found.settled <= 0.4
    still_moving = best.judged(setup, best.Motion(motion.intervals[:4], motion.qdd[:4]))
    assert np.isnan(still_moving.settled)
    assert not still_moving.valid


def walled(height: float, markers: list[int] | None = None, v: float = 0.0, **other: Any) -> Setup:
    """The first example, its second marker above and below a wall from one side of the image to the
    other.
    """
    scenario = Scenario.load("example-2d-fov")
    curve = {"shape": "hyperellipse", "a": 300.0, "b": height, "n": 8.0, "centre_px": [0.0, v]}
    wall = {"type": "occlusion", "K": 0.1, "switching_gain": 10.0, "curve": curve, **other}
    wall |= {} if markers is None else {"markers": markers}
    return scenario.with_override("constraints", [*scenario.tables["constraints"], wall]).setup()


def test_a_wall_across_the_image_closes_the_goal_off() -> None:
    plain = Scenario.load("example-2d-fov").setup()
    first = plain.scene.glance(plain.q0)[0]
    goal = plain.task.goals[0].pixels
    crossing = [
        i
        for i in range(2)
        if first[i, 1] * goal[i, 1] < 0.0 and min(abs(first[i, 1]), abs(goal[i, 1])) > 40.0
    ]
    assert crossing, "the markers of the first example change sides"
    number = crossing[0] + 1
    assert best.separated(plain) == ""
    assert (
        best.separated(walled(10.0)) == f"marker {number} is closed off from its goal in the image"
    )
    assert best.separated(walled(10.0, [number])).startswith(f"marker {number} ")
    # a wall that moves proves nothing, nor does one that leaves a gap
    assert best.separated(walled(10.0, motion={"velocity": [0.0, 1.0]})) == ""
    assert best.separated(walled(0.5)) == "", "as thin as a pixel: not certain"
    # the goal counts as reached from before the wall
    near = goal[crossing[0], 1] - np.sign(goal[crossing[0], 1]) * 4.0
    assert best.separated(walled(1.5, [number], near)) == ""
    strict = walled(1.5, [number], near)
    tolerances = replace(strict.tolerances, translation_m=1e-5, rotation_rad=1e-5)
    assert best.separated(replace(strict, tolerances=tolerances)) != ""


def test_the_bowl_and_the_hearts_are_as_the_package_says() -> None:
    assert best.separated(Scenario.load("example-2d-bowl").setup()).startswith("marker 1 ")
    assert best.separated(Scenario.load("example-2d-heart-concave").setup()) == ""


def test_scenes_in_the_table_are_not_done_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "best.parquet"
    command = [
        "--family",
        "planar-arm",
        "--laws",
        "hierarchical-qp",
        "--seconds",
        "0",
        "--table",
        str(path),
    ]
    assert best.main([*command, "--scenes", "1"]) == 0
    assert best.main([*command, "--scenes", "2"]) == 0
    lines = best.read(path, TestSet.load())
    assert [(line["scene"], line["outcome"], line["known_by"]) for line in lines] == [
        (0, "reachable", "law hierarchical-qp"),
        (1, "reachable", "law hierarchical-qp"),
    ]
    assert all(line["best_time_s"] == line["law_time_s"] for line in lines)
    monkeypatch.setattr(best, "line_of", lambda *_: pytest.fail("done again"))
    assert best.main([*command, "--scenes", "2"]) == 0
    parquet.write(path, parquet.table(best.COLUMNS, lines), {"sha256": "another"})
    with pytest.raises(ConfigurationError, match="is of the test set another, not of"):
        best.main([*command, "--verify"])


def test_optimal_control_is_sooner_and_a_changed_motion_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of SWIG
        pytest.importorskip("casadi")
        path = tmp_path / "best.parquet"
        command = [
            "--family",
            "planar-arm",
            "--laws",
            "hierarchical-qp",
            "--scenes",
            "1",
            "--table",
            str(path),
        ]
        assert best.main(command) == 0
    (line,) = best.read(path, TestSet.load())
    assert line["known_by"] == "optimal control"
    assert line["best_time_s"] < 0.6 * line["law_time_s"]
    assert best.main([*command, "--verify"]) == 0
    motion = best.Motion.read(line["motion"])
    # the same way, speeds 1 % higher
    faster = best.Motion(motion.intervals / 1.01, motion.qdd * 1.01**2)
    line["motion"] = faster.text()
    parquet.write(path, parquet.table(best.COLUMNS, [line]), parquet.facts_of(path))
    assert best.main([*command, "--verify"]) == 1
    said = capsys.readouterr().out
    assert "planar-arm held-out 0: settled after" in said
    assert "planar-arm held-out 0: beyond the limits of acceleration" in said


def test_the_table_that_comes_with_the_package() -> None:
    test_set = TestSet.load()
    lines = best.read(best.TABLE, test_set)
    assert len(lines) >= 500
    assert len({best.key(line) for line in lines}) == len(lines)
    assert sum(line["outcome"] == best.UNKNOWN for line in lines) <= 0.05 * len(lines)
    assert not list(best.wrong([line for line in lines if line["motion"]][::200], test_set))
    said = (ROOT / "docs" / "benchmark.md").read_text(encoding="utf-8")
    for row in best.summary(lines):
        assert row in said


def test_a_scene_is_named_by_its_family_and_number() -> None:
    test_set = TestSet.load()
    number, family = best.named_scene("eye-to-hand:88", test_set)
    assert (number, family.name) == (88, "eye-to-hand")
    for text in ("eye-to-hand", "eye-to-hand:x", "nobody:3"):
        with pytest.raises(ConfigurationError, match="FAMILY:NUMBER"):
            best.named_scene(text, test_set)
