"""Families of scenes: what is drawn is what is stated, the same everywhere, and can be run."""

from __future__ import annotations

import json
import math
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from vsconstraints.bench.families import HALVES, Drawn, Family, Reason, families
from vsconstraints.bench.families.drawing import DISTRIBUTIONS, Streams, drawn, merged, parsed
from vsconstraints.bench.families.family import summarised
from vsconstraints.cli import app
from vsconstraints.comparisons.metrics import score
from vsconstraints.comparisons.record import RunRecord
from vsconstraints.controllers import Tracking
from vsconstraints.errors import ConfigurationError
from vsconstraints.robots import READY_MADE
from vsconstraints.scenarios.inverse_kinematics import inverse_kinematics
from vsconstraints.simulation import simulate

BY_HAND = """
title = "Two markers"
robot = "planar-3r"
q0 = { uniform = [[-0.74, -1.76, 1.06], [-0.70, -1.73, 1.09]] }
sampling_time = 0.01
duration = 0.5
attempts = 30

[camera]
focal_px = [543.7, 543.7]
size_px = [512, 512]

[target]
markers = [[-0.24613, -1.24385, -1.0], [-0.47884, -1.04071, -1.0]]

[task]
feature = "camera-pose"
Kp0 = { log-uniform = [20.0, 80.0] }

[[task.goals]]
camera_at_q = [-0.72, -1.744, 4.2]

[[constraints]]
type = "joint-speed"
upper = [0.5, 0.5, 0.5]
switching_gain = 10.0

[conditions.disturbed.disturbances]
pixel_noise = { uniform = [0.1, 1.0] }
"""


@pytest.fixture
def by_hand(tmp_path: Path) -> Callable[..., Family]:
    """A family made from the text above, with some of its words replaced."""

    def made(*changes: tuple[str, str], name: str = "own", extra: str = "") -> Family:
        text = BY_HAND
        for old, new in changes:
            assert old in text
            text = text.replace(old, new, 1)
        file = tmp_path / f"{name}.toml"
        file.write_text(text + extra)
        return Family.load(file)

    return made


def draws(table: dict[str, Any], count: int) -> np.ndarray:
    tree = parsed(table, "test")
    return np.array([drawn(tree, Streams(0, "held-out", i, 0), "key", {}) for i in range(count)])


# every distribution against scipy's


@pytest.mark.parametrize(
    ("table", "cdf"),
    [
        ({"uniform": [-2.0, 3.0]}, stats.uniform(-2.0, 5.0).cdf),
        ({"log-uniform": [0.1, 50.0]}, stats.loguniform(0.1, 50.0).cdf),
        ({"gaussian": [1.0, 0.3]}, stats.norm(1.0, 0.3).cdf),
    ],
)
def test_draws_follow_their_distribution(table: dict[str, Any], cdf: Callable[..., Any]) -> None:
    assert stats.kstest(draws(table, 3000), cdf).pvalue > 0.01
    # a law that is a little off is found by as many draws: the test can fail
    assert stats.kstest(draws(table, 3000) + 0.15, cdf).pvalue < 1e-4


@pytest.mark.parametrize(
    ("table", "values"),
    [({"integer": [-1, 4]}, range(-1, 5)), ({"choice": [3.0, 7.0, 7.5]}, [3.0, 7.0, 7.5])],
)
def test_draws_of_few_values_are_as_likely(table: dict[str, Any], values: Any) -> None:
    found = draws(table, 3000)
    counts = [int((found == value).sum()) for value in values]
    assert sum(counts) == 3000
    assert stats.chisquare(counts).pvalue > 0.01


def test_vectors_are_drawn_number_by_number() -> None:
    table = {"uniform": [[0.0, 10.0, -1.0], [1.0, 30.0, -1.0]]}
    found = draws(table, 2000)
    assert stats.kstest(found[:, 0], stats.uniform(0.0, 1.0).cdf).pvalue > 0.01
    assert stats.kstest(found[:, 1], stats.uniform(10.0, 20.0).cdf).pvalue > 0.01
    assert (found[:, 2] == -1.0).all()
    assert stats.spearmanr(found[:, 0], found[:, 1]).pvalue > 0.01


def test_every_distribution_is_tested() -> None:
    assert set(DISTRIBUTIONS) == {"uniform", "log-uniform", "gaussian", "integer", "choice"}


@given(st.floats(-1e6, 1e6), st.floats(0.0, 1e6), st.integers(0, 2**31))
def test_uniform_draws_stay_within(least: float, width: float, number: int) -> None:
    tree = parsed({"uniform": [least, least + width]}, "test")
    value = drawn(tree, Streams(0, "training", number, 0), "key", {})
    assert least <= value <= least + width


# what cannot be drawn is said when the file is read


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{ uniform = [2.0, 1.0] }", ["q0", "least ≤ greatest", "2.0"]),
        ("{ uniform = [1.0] }", ["least, greatest"]),
        ("{ uniform = [[1.0, 2.0], [1.0, 2.0, 3.0]] }", ["least, greatest"]),
        ("{ uniform = [[], []] }", ["no number"]),
        ("{ uniform = [nan, 1.0] }", ["finite"]),
        ("{ uniform = [-inf, inf] }", ["finite"]),
        ('{ uniform = ["a", "b"] }', ["least, greatest"]),
        ("{ log-uniform = [0.0, 1.0] }", ["0 < least"]),
        ("{ gaussian = [0.0, -0.1] }", ["standard deviation ≥ 0"]),
        ("{ integer = [0.5, 2] }", ["integers"]),
        ("{ integer = [3, 2] }", ["least ≤ greatest"]),
        ("{ choice = [] }", ["one or more"]),
        ("{ choice = 3 }", ["one or more"]),
        ("{ unifrom = [0.0, 1.0] }", ["unifrom", "uniform", "gaussian", "choice"]),
        ("{ log_uniform = [0.1, 1.0] }", ["log-uniform"]),
    ],
)
def test_impossible_distributions_are_refused(
    by_hand: Callable[..., Family], text: str, words: list[str]
) -> None:
    with pytest.raises(ConfigurationError) as refused:
        by_hand(("{ uniform = [[-0.74, -1.76, 1.06], [-0.70, -1.73, 1.09]] }", text))
    for word in words:
        assert word in str(refused.value)


def test_unknown_names_are_answered_with_candidates(by_hand: Callable[..., Family]) -> None:
    with pytest.raises(ConfigurationError, match="planar-arm"):
        Family.load("planer-arm")
    scene = by_hand().scene(0)
    with pytest.raises(ConfigurationError, match="disturbed, nominal"):
        scene.scenario("limited")
    with pytest.raises(ConfigurationError, match="training"):
        by_hand().scene(0, "test")
    with pytest.raises(ConfigurationError, match="zero or more"):
        by_hand().scene(-1)


@pytest.mark.parametrize("said", ["0", "-3", "1.5", "true", '"many"'])
def test_attempts_are_a_positive_integer(by_hand: Callable[..., Family], said: str) -> None:
    with pytest.raises(ConfigurationError, match="attempts"):
        by_hand(("attempts = 30", f"attempts = {said}"))


def test_a_placement_stands_in_no_condition(by_hand: Callable[..., Family]) -> None:
    with pytest.raises(ConfigurationError, match="look-at"):
        by_hand(extra="[conditions.elsewhere]\nq0 = { look-at = { distance = 1.0 } }\n")


# rejected attempts


def test_a_family_without_any_scene_says_why(by_hand: Callable[..., Family]) -> None:
    family = by_hand(("[543.7, 543.7]", "[9000.0, 9000.0]"))
    scene = family.scene(3)
    assert not scene.found
    assert scene.rejected == {Reason.START_UNSEEN.value: 30}
    assert scene.attempts == 30
    with pytest.raises(ConfigurationError, match="outside the image at the start 30"):
        scene.scenario()
    with pytest.raises(
        ConfigurationError, match=r"all of 90 attempts .* outside the image at the start 90"
    ):
        family.require_scenes()
    with pytest.raises(ConfigurationError, match="all of 90 attempts"):
        summarised(family, 1000)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ((("upper = [0.5, 0.5, 0.5]", "upper = [50.0, 50.0, 50.0]"),), Reason.NOT_CHALLENGED),
        ((("switching_gain = 10.0", "switching_gain = -1.0"),), Reason.BUILD_REFUSED),
        ((('type = "joint-speed"', 'type = "joint-spede"'),), Reason.BUILD_REFUSED),
        ((("[-0.72, -1.744, 4.2]", "[-0.0, -0.0, 4.2]"),), Reason.GOAL_UNSEEN),
        ((("1.24385, -1.0]", "1.24385, 1.0]"),), Reason.START_BEHIND),
        ((("q0 = ", "q0 = { look-at = { distance = 9.0 } } # "),), Reason.START_OUT_OF_REACH),
        (
            (("camera_at_q = [-0.72, -1.744, 4.2]", "camera_at_q.look-at = { distance = 9.0 }"),),
            Reason.GOAL_OUT_OF_REACH,
        ),
        (
            (
                (
                    "camera_at_q = [-0.72, -1.744, 4.2]",
                    "camera_pose = { xyz = [3.0, 0.0, 0.0], rpy = [0.0, 0.0, 0.0] }",
                ),
            ),
            Reason.GOAL_OUT_OF_REACH,
        ),
        ((("pixel_noise = { uniform = [0.1, 1.0] }", "pixel_noise = -1.0"),), Reason.BUILD_REFUSED),
    ],
)
def test_what_is_impossible_is_rejected_by_its_reason(
    by_hand: Callable[..., Family], changes: tuple[tuple[str, str], ...], reason: Reason
) -> None:
    scene = by_hand(*changes).scene(0)
    # a build that is refused in the same words again and again is not tried for ever
    assert scene.rejected == {reason.value: 10 if reason is Reason.BUILD_REFUSED else 30}
    assert scene.refusal.startswith(reason.value)


SPHERE = """
[[constraints]]
type = "forbidden-sphere"
centre = CENTRE
radius = 0.1
K = 0.1
switching_gain = 1.0
"""


@pytest.mark.parametrize(
    ("centre", "reason"),
    [
        ("tip-path = { share = 0.0 }", Reason.START_FORBIDDEN),
        ("tip-path = { share = 1.0 }", Reason.GOAL_FORBIDDEN),
    ],
)
def test_forbidden_ends_are_rejected(
    by_hand: Callable[..., Family], centre: str, reason: Reason
) -> None:
    sphere = SPHERE.replace("CENTRE", f"{{ {centre} }}")
    # far enough from each other that the sphere holds one of them only
    family = by_hand(
        ("[-0.72, -1.744, 4.2]", "[-1.1, -2.04, 3.11]"), ("[conditions", sphere + "\n[conditions")
    )
    assert family.scene(0).rejected == {reason.value: 30}


def test_an_arm_without_its_meshes_has_scenes_if_hidden_markers_are_no_matter(
    tmp_path: Path,
) -> None:
    """Lines of sight need the links' meshes; a family that runs on with hidden markers does not ask
    for them.
    """
    text = """
extends = "ur5-fov"
attempts = 1
on_hidden_markers = "HIDDEN"
robot = { urdf = "bare.urdf", tip = "tool" }
q0 = [0.0, 0.3, 1.4, 0.0, 1.3, 0.0]
limits = { acceleration = 40.0 }
[camera]
focal_px = [600.0, 600.0]
size_px = [640.0, 480.0]
[target.square]
side = { uniform = [0.11, 0.12] }
xyz = [0.62, 0.03, 0.0]
[[task.goals]]
camera_at_q = [0.12, 0.35, 1.5, 0.1, 1.15, 1.4]
[[constraints]]
type = "joint-speed"
upper = [0.5, 0.5, 0.5, 0.5, 0.5, 0.5]
switching_gain = 10.0
"""
    arm = (Path(__file__).parents[1] / "examples" / "six_axis.urdf").read_text()
    mesh = '<collision><geometry><mesh filename="missing.stl"/></geometry></collision>'
    (tmp_path / "bare.urdf").write_text(
        arm.replace('<link name="forearm"/>', f'<link name="forearm">{mesh}</link>')
    )
    for hidden in ("continue", "refuse"):
        (tmp_path / f"{hidden}.toml").write_text(text.replace("HIDDEN", hidden))
    scene = Family.load(tmp_path / "continue.toml").scene(0)
    assert scene.found, scene.refusal
    refused = Family.load(tmp_path / "refuse.toml").scene(0)
    assert not refused.found
    assert "missing.stl" in refused.refusal
    assert 'on_hidden_markers = "continue" draws scenes' in refused.refusal


def test_markers_that_the_robot_hides_are_rejected(tmp_path: Path) -> None:
    # a camera behind the arm, as shipped scenarios are not
    text = """
extends = "eye-to-hand-pbvs"
attempts = 3
[camera]
fixed = { xyz = [-0.6, -0.1, 0.4], rpy = [-1.5708, 0.0, -1.5708] }
"""
    (tmp_path / "behind.toml").write_text(text)
    scene = Family.load(tmp_path / "behind.toml").scene(0)
    assert scene.rejected == {Reason.START_HIDDEN.value: 3}
    assert "marker 1 by forearm_link" in scene.refusal


def test_scenes_whose_first_image_shows_no_tag_are_rejected(tmp_path: Path) -> None:
    text = """
extends = "ur5-fov"
attempts = 2
[conditions.dark.sensor]
type = "images"
light = LIGHT
"""
    (tmp_path / "dark.toml").write_text(text.replace("LIGHT", "0.001"))
    scene = Family.load(tmp_path / "dark.toml").scene(0)
    assert scene.rejected == {Reason.START_UNDETECTED.value: 2}
    assert "none of the expected tags is seen in the first image" in scene.refusal
    (tmp_path / "bright.toml").write_text(text.replace("LIGHT", "0.9"))
    assert Family.load(tmp_path / "bright.toml").scene(0).found


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            (("q0 = ", "q0 = { look-at = { distanse = 1.0 } } # "),),
            ["distanse", "distance", "tilt"],
        ),
        ((("pixel_noise", "pixel_nois"),), ["pixel_nois", "Did you mean 'pixel_noise'"]),
        ((("duration = 0.5", 'duration = { choice = ["long"] }'),), ["duration", "'long'"]),
        (
            (("upper = [0.5, 0.5, 0.5]", "upper = { joint-path = { beyond = 0.1, goal = 2 } }"),),
            ["no goal 2"],
        ),
        (
            (("[conditions.disturbed.disturbances]", "[conditions.disturbed.constraints.7]"),),
            ["constraints", "7"],
        ),
    ],
)
def test_slips_in_a_family_are_named_before_thousands_are_drawn(
    by_hand: Callable[..., Family], changes: tuple[tuple[str, str], ...], words: list[str]
) -> None:
    with pytest.raises(ConfigurationError) as refused:
        by_hand(*changes).require_scenes()
    for word in words:
        assert word in str(refused.value)


def test_attempts_are_those_rejected_and_the_accepted_one() -> None:
    family = Family.load("planar-arm")
    summary = summarised(family, 6)
    for scene in summary.scenes:
        assert scene.attempts == sum(scene.rejected.values()) + 1
        assert set(scene.rejected) <= {reason.value for reason in Reason}
    assert sum(summary.rejected.values()) + len(summary.found) == sum(
        scene.attempts for scene in summary.scenes
    )
    assert summary.acceptance == pytest.approx(6 / sum(scene.attempts for scene in summary.scenes))


def test_the_command_says_what_scenes_are_like(by_hand: Callable[..., Family]) -> None:
    family = by_hand()
    file = str(family.folder / "own.toml")
    done = CliRunner().invoke(app, ["families", file, "--scenes", "4"])
    assert done.exit_code == 0
    for words in ("own: Two markers", "4 of 4 scenes found", "speed", "nominal, disturbed"):
        assert words in done.output
    listed = CliRunner().invoke(app, ["families"])
    assert all(name in listed.output for name in families())


# the same scene everywhere


def told(scene: Drawn) -> str:
    return json.dumps(
        [scene.tables, scene.values, scene.rejected, scene.challenged, scene.noise], sort_keys=True
    )


def test_the_same_scene_in_another_process_and_in_any_order() -> None:
    family = Family.load("planar-arm")
    here = {number: told(family.scene(number, seed=5)) for number in (2, 0, 1)}
    code = (
        "import sys; sys.path.insert(0, 'tests')\n"
        "from test_families import told\nfrom vsconstraints.bench.families import Family\n"
        "print(told(Family.load('planar-arm').scene(2, seed=5)))"
    )
    there = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.strip()
    assert there == here[2]
    assert told(Family.load("planar-arm").scene(0, seed=5)) == here[0]
    assert len(set(here.values())) == 3
    assert told(family.scene(2, seed=6)) != here[2]


def test_halves_have_nothing_in_common() -> None:
    family = Family.load("planar-arm")
    training, held_out = ([family.scene(i, half).values for i in range(5)] for half in HALVES)
    starts = [tuple(values["q0"]) for values in (*training, *held_out)]
    assert len(set(starts)) == len(starts)
    entropies = {
        Streams(0, half, i, a).entropy("q0")
        for half in HALVES
        for i in range(100)
        for a in range(10)
    }
    assert len(entropies) == 2000
    assert (
        len(
            {
                Streams(0, "training", 0, 0).entropy(key)
                for key in ("q0", "task.Kp0", "q0.look-at", "")
            }
        )
        == 4
    )


def test_a_further_key_that_is_drawn_shifts_no_other(by_hand: Callable[..., Family]) -> None:
    before = by_hand(name="before").scene(0)
    after = by_hand(("duration = 0.5", "duration = { uniform = [0.4, 0.6] }"), name="after").scene(
        0
    )
    assert "duration" in after.values
    assert {key: after.values[key] for key in before.values} == before.values


def test_a_scene_is_the_same_in_all_conditions_but_for_what_they_say(
    by_hand: Callable[..., Family],
) -> None:
    scene = by_hand().scene(0)
    nominal, disturbed = (dict(scene.tables[name]) for name in ("nominal", "disturbed"))
    noise = disturbed.pop("disturbances")
    assert nominal == disturbed
    assert noise == {"pixel_noise": scene.values["conditions.disturbed.disturbances.pixel_noise"]}
    assert scene.setup("disturbed").disturbances.seed[0] == scene.noise
    assert scene.noise != by_hand().scene(1).noise


def test_a_condition_of_several_has_their_draws_together(by_hand: Callable[..., Family]) -> None:
    more = "[conditions.slow.task]\nKp0 = { uniform = [1.0, 2.0] }\n"
    more += (
        "[conditions.both]\nconditions = ['disturbed', "
        "'slow']\n[conditions.both.task]\nKp_slope = 0.5\n"
    )
    family = by_hand(("[conditions.disturbed", more + "[conditions.disturbed"))
    assert set(family.conditions) == {"nominal", "disturbed", "slow", "both"}
    scene = family.scene(1)
    tables = family.scene(1).tables
    assert (
        tables["both"]["disturbances"]
        == tables["disturbed"]["disturbances"]
        != tables["slow"].get("disturbances")
    )
    assert (
        tables["both"]["task"]["Kp0"]
        == tables["slow"]["task"]["Kp0"]
        != tables["nominal"]["task"]["Kp0"]
    )
    assert tables["both"]["task"]["Kp_slope"] == 0.5
    # what a condition has of others is drawn once
    assert not any(key.startswith("conditions.both") for key in scene.values)
    for told, what in (
        ("['disturbd']", "Did you mean 'disturbed'"),
        ("['both']", "unknown condition"),
        ("'slow'", "must be a list"),
    ):
        with pytest.raises(ConfigurationError, match=what):
            by_hand(
                (
                    "[conditions.disturbed",
                    more.replace("['disturbed', 'slow']", told) + "[conditions.disturbed",
                )
            )


def test_scenes_and_families_can_be_sent_to_other_processes() -> None:
    family = Family.load("planar-arm")
    scene = family.scene(1)
    assert told(pickle.loads(pickle.dumps(scene))) == told(scene)
    assert told(pickle.loads(pickle.dumps(family)).scene(1)) == told(scene)


# what is drawn is where the file says


def test_values_of_a_scene_are_within_what_is_stated(by_hand: Callable[..., Family]) -> None:
    for number in range(5):
        values = by_hand().scene(number).values
        assert (np.array([-0.74, -1.76, 1.06]) <= values["q0"]).all()
        assert (values["q0"] <= np.array([-0.70, -1.73, 1.09])).all()
        assert 20.0 <= values["task.Kp0"] <= 80.0


def test_lists_and_tables_are_merged_key_by_key() -> None:
    under = {
        "a": {"b": 1, "c": 2},
        "list": [{"x": 1, "y": 2}, {"x": 3}],
        "drawn": {"uniform": [0, 1]},
    }
    over = {"a": {"c": 3}, "list": {"1": {"x": 4}}, "drawn": {"gaussian": [0, 1]}}
    assert merged(under, over, "test") == {
        "a": {"b": 1, "c": 3},
        "list": [{"x": 1, "y": 2}, {"x": 4}],
        "drawn": {"gaussian": [0, 1]},
    }
    assert under["list"][1] == {"x": 3}
    with pytest.raises(ConfigurationError, match="Available: 0, 1"):
        merged(under, {"list": {"2": {}}}, "test")


def test_look_at_puts_the_target_where_it_says() -> None:
    scene = Family.load("six-axis").scene(0)
    setup = scene.setup()
    values = scene.values
    for q, key in (
        (setup.q0, "q0.look-at"),
        (
            np.array(scene.tables["nominal"]["task"]["goals"][0]["camera_at_q"]),
            "task.goals.0.camera_at_q.look-at",
        ),
    ):
        camera = setup.scene.camera_pose(q)
        middle = camera.inverse.act(setup.scene.markers.mean(axis=0))
        assert middle[2] == pytest.approx(values[f"{key}.distance"], abs=1e-8)
        pixels = setup.scene.camera.pixels(middle[:2] / middle[2])
        assert pixels == pytest.approx(values[f"{key}.image_px"], abs=1e-5)
        # straight down and rolled, then tilted away to where the azimuth points
        tilt, azimuth, roll = (values[f"{key}.{angle}"] for angle in ("tilt", "azimuth", "roll"))
        tilting = Rotation.from_rotvec(
            tilt * np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
        )
        wanted = tilting * Rotation.from_euler("x", math.pi) * Rotation.from_euler("z", roll)
        assert np.allclose(camera.R, wanted.as_matrix(), atol=1e-7)


@pytest.mark.parametrize("name", sorted(READY_MADE))
def test_inverse_kinematics_come_back(name: str) -> None:
    robot = READY_MADE[name]()
    random = np.random.default_rng(7)
    least = np.maximum(robot.q_min, -1.5)
    greatest = np.minimum(robot.q_max, 1.5)
    found = 0
    for _ in range(20):
        q = random.uniform(least, greatest)
        near = np.clip(q + random.uniform(-0.3, 0.3, robot.n), robot.q_min, robot.q_max)
        again = inverse_kinematics(robot, robot.pose(q), near)
        if again is not None:
            found += 1
            there = robot.pose(again)
            wanted = robot.pose(q)
            assert np.allclose(there.t, wanted.t, atol=1e-8)
            assert np.allclose(there.R, wanted.R, atol=1e-8)
            assert robot.outside_ranges(again) == []
    assert found >= 18


# every family in every condition


@pytest.mark.parametrize("name", families())
def test_every_family_in_every_condition(name: str) -> None:
    family = Family.load(name)
    assert family.title
    assert family.description
    assert {"nominal", "disturbed"} <= set(family.conditions)
    scene = family.scene(0)
    assert scene.found
    for condition in family.conditions:
        setup = scene.setup(condition)
        assert setup.check_start() == []
        assert scene.scenario(condition).name == f"{name}-0"
        assert setup.limits.any == (condition == "limited")
    assert math.isnan(scene.share_to_hold) or "limited" in family.conditions


@pytest.mark.parametrize("name", families())
def test_tracking_alone_leaves_the_rows_that_are_named(name: str) -> None:
    family = Family.load(name)
    for number in (0, 1):
        scene = family.scene(number)
        setup = scene.setup()
        record = RunRecord.of(setup, simulate(setup, Tracking()), "")
        lines = score(record, record).constraints
        left = {
            line["constraint"]
            for line in lines
            if line["challenged"] and line["violation_depth"] > 0.0
        }
        assert scene.challenged
        assert set(scene.challenged) <= left
        # possible at its ends: nothing is violated at the start, every marker is in the image there
        # and at the goal
        assert (record.trajectory.clearance[0] >= 0.0).all()
        camera = setup.scene.camera
        assert camera.sees(record.trajectory.features_px[0]).all()
        assert camera.sees(setup.task.goals[-1].pixels).all()


@pytest.mark.parametrize("name", families())
def test_most_attempts_are_worth_making(name: str) -> None:
    assert summarised(Family.load(name), 8).acceptance > 0.2


@pytest.mark.parametrize("name", ["ur5", "panda", "six-axis", "eye-to-hand"])
def test_disturbed_cameras_are_mounted_a_little_elsewhere(name: str) -> None:
    """By millimetres and milliradians, another way in every scene."""
    scenes = [Family.load(name).scene(k) for k in (0, 1)]
    drawn = [scene.scenario("disturbed").tables["disturbances"] for scene in scenes]
    for key, most in (("mount_translation_error", 0.01), ("mount_rotation_error", 0.015)):
        assert all(0.0 < max(map(abs, one[key])) < most for one in drawn)
        assert drawn[0][key] != drawn[1][key]
