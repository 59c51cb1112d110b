"""Scenario files: the shipped ones, own ones, and what is said of those that cannot be used."""

from __future__ import annotations

import copy
import re
import sys
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vsconstraints.controllers import SlidingMode, Tracking
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.robots import READY_MADE
from vsconstraints.robots.geometry import Pose, distance
from vsconstraints.scenarios import CONSTRAINTS, SHIPPED, Scenario, shipped_scenarios
from vsconstraints.scenarios.scenario import MAX_EXTENDED
from vsconstraints.simulation import simulate
from vsconstraints.vision.features import FEATURES

REFUSED = (ConfigurationError, InvalidInput)


# --- shipped scenarios ---


@pytest.mark.parametrize("name", shipped_scenarios())
def test_every_shipped_scenario_builds_and_starts(name: str) -> None:
    scenario = Scenario.load(name)
    setup = scenario.setup()
    setup.check_start()
    assert scenario.title != name, "has no title"
    assert len(scenario.description) > 20
    assert setup.constraints.labels, "constrains nothing"
    assert len(set(setup.constraints.labels)) == len(setup.constraints.labels)
    short = scenario.with_override("duration", 10 * setup.Ts).setup()
    trajectory = simulate(short, SlidingMode())
    assert trajectory.status not in ("failed", "aborted"), trajectory.reason
    assert len(trajectory.t) == 11
    for goal in setup.task.goals:
        assert setup.scene.camera.sees(goal.pixels).all(), "a goal is outside the image"


@pytest.mark.parametrize("name", shipped_scenarios())
def test_every_trial_of_a_shipped_scenario_starts(name: str) -> None:
    scenario = Scenario.load(name)
    for trial in range(4):
        scenario.setup(trial, seed=7).check_start()


def test_the_papers_scenarios_are_shipped() -> None:
    assert {
        "case-study-6r",
        "example-2d-fov",
        "example-2d-fast",
        "example-2d-fast-high-gain",
        "example-2d-bowl",
        "example-2d-heart-convex",
        "example-2d-heart-concave",
    } <= set(shipped_scenarios())


# --- a scenario to spoil ---

TABLES: dict[str, Any] = {
    "robot": "viper-s650",
    "q0": [0.3179, -1.5414, 1.2426, -1.826, 0.4289, 0.0633],
    "sampling_time": 0.005,
    "duration": 1.0,
    "camera": {"focal_px": [402.5, 402.5], "size_px": [512, 512]},
    "target": {
        "markers": [[0.564, 0.3095, 0.0108], [0.4666, 0.1403, 0.0541], [0.2919, 0.2348, 0.0302]]
    },
    "task": {
        "feature": "camera-pose",
        "Kp0": 20.0,
        "goals": [{"camera_at_q": [0.2, -1.4, 1.1, -1.7, 0.5, 0.0]}],
    },
    "constraints": [
        {"type": "field-of-view", "margin": 0.05, "K": 0.1, "switching_gain": 2.0},
        {
            "type": "occlusion",
            "curve": {"shape": "circle", "radius": 20.0, "centre_px": [200.0, 200.0]},
            "K": 0.1,
            "switching_gain": 2.0,
        },
        {
            "type": "joint-range",
            "joints": [6],
            "lower": [-1.1],
            "upper": [0.1],
            "K": 0.1,
            "switching_gain": 2.0,
        },
        {"type": "joint-speed", "joints": [2], "upper": [0.4], "switching_gain": 1.0},
        {
            "type": "forbidden-sphere",
            "centre": [0.57, 0.2, 0.405],
            "radius": 0.05,
            "K": 0.1,
            "switching_gain": 0.2,
            "points": [{"link": "link 6", "offset": [0.0, 0.0, 0.1], "name": "nose"}, {}],
        },
    ],
}


def scenario(tables: dict[str, Any] | None = None, folder: Path | None = None) -> Scenario:
    return Scenario("own", copy.deepcopy(tables or TABLES), folder or Path())


def test_the_scenario_to_spoil_is_sound() -> None:
    setup = scenario().setup()
    assert setup.check_start() == []
    assert setup.constraints.labels[-2:] == ("sphere[nose]", "sphere[tip]")
    assert {table["type"] for table in TABLES["constraints"]} <= set(CONSTRAINTS)


# --- unknown names, each with the candidates ---


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("robot", "viper", ["robot 'viper'", "viper-s650", *READY_MADE]),
        (
            "task.feature",
            "camera_pose",
            ["feature in own.task 'camera_pose'", "camera-pose", *FEATURES],
        ),
        ("task.drift", "exactly", ["drift in own.task", "exact", "differences"]),
        ("task.velocity", "numeric", ["velocity in own.task", "exact", "differences"]),
        ("constraints.0.type", "fov", ["type in own.constraints[0] 'fov'", *CONSTRAINTS]),
        (
            "constraints.1.curve.shape",
            "disc",
            ["shape in own.constraints[1].curve", "bowl", "circle", "heart"],
        ),
        ("on_rank_loss", "stop", ["on_rank_loss", "abort", "continue"]),
        (
            "sample_time",
            0.1,
            ["key in own 'sample_time'", "Did you mean 'sampling_time'", "duration"],
        ),
        ("camera.focal", [1, 1], ["key in own.camera 'focal'", "Did you mean 'focal_px'"]),
        ("camera.mount", {"xzy": [0, 0, 0]}, ["key in own.camera.mount 'xzy'", "'xyz'"]),
        ("target.marker", [[0, 0, 0]], ["key in own.target 'marker'", "Did you mean 'markers'"]),
        ("task.Kp", 1.0, ["key in own.task 'Kp'", "Kp0"]),
        ("task.goals.0.from", 1.0, ["key in own.task.goals[0] 'from'", "from_time"]),
        (
            "tolerances",
            {"translation": 1.0},
            ["key in own.tolerances 'translation'", "translation_m"],
        ),
        ("constraints.0.gain", 1.0, ["key in own.constraints[0] 'gain'", "switching_gain"]),
        ("constraints.1.curve.size", 3.0, ["own.constraints[1].curve", "size"]),
        ("constraints.2.joint", 3, ["key in own.constraints[2] 'joint'", "Did you mean 'joints'"]),
        ("constraints.3.K", 1.0, ["key in own.constraints[3] 'K'"]),
        (
            "constraints.4.points.0.links",
            "a",
            ["key in own.constraints[4].points[0] 'links'", "'link'"],
        ),
        ("constraints.4.points.0.link", "link 7", ["link of 6R", "'link 7'", "link 6"]),
    ],
)
def test_unknown_names_are_refused_with_the_candidates(
    key: str, value: object, words: list[str]
) -> None:
    with pytest.raises(ConfigurationError) as error:
        scenario().with_override(key, value).setup()
    for word in words:
        assert word in str(error.value), f"{word!r} is not in {error.value}"


# --- wrong values ---


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("robot", 3, "own: robot must be a string or a table, not 3"),
        ("title", 3, "own: title must be a string, not 3"),
        ("q0", "home", "own: q0 must be a list of numbers, not 'home'"),
        ("q0", [0.0, 0.0], "q0 of 6R"),
        ("q0", [0.0, 0.0, 0.0, 0.0, 0.0, float("nan")], "own: q0 must be finite"),
        (
            "q0",
            [0.0, 0.0, 0.0, 0.0, 0.0, "zero"],
            "own: q0 must be a list of numbers, not .*'zero'",
        ),
        ("q0", [[0.0] * 6], "own: q0 must be a list of numbers, not"),
        ("qd0", [0.0], "qd0 of 6R"),
        ("sampling_time", "fast", "own: sampling_time must be an integer or a number, not 'fast'"),
        ("sampling_time", True, "own: sampling_time must be an integer or a number, not True"),
        ("sampling_time", float("nan"), "own: sampling_time must be finite"),
        ("sampling_time", 0.0, "sampling_time must be a positive number"),
        ("duration", float("inf"), "own: duration must be finite"),
        ("duration", 0.001, "shorter than one sample"),
        ("start_deviation", "some", "own: start_deviation must be"),
        ("camera", 3, "own: camera must be a table, not 3"),
        ("camera.focal_px", [402.5], "own.camera: focal_px must be 2 numbers"),
        ("camera.focal_px", [402.5, 0.0], "camera focal_px must be positive"),
        ("camera.size_px", 512, "own.camera: size_px must be 2 numbers, not 512"),
        (
            "camera.principal_point_px",
            [1, 2, 3],
            "own.camera: principal_point_px must be 2 numbers",
        ),
        ("camera.mount", {"rpy": [0, 0]}, "own.camera.mount: rpy must be 3 numbers"),
        (
            "target.markers",
            [[0.0, 0.0]],
            "own.target: markers must be one or more rows of 3 numbers",
        ),
        ("target.markers", [], "own.target: markers must be one or more rows of 3 numbers"),
        (
            "target.markers",
            [[0, 0, 0], [0]],
            "own.target: markers must be one or more rows of 3 numbers",
        ),
        ("target", {"square": {"side": 0.1}}, "own.target.square: the key 'xyz' is missing"),
        ("task.Kp0", 0.0, "Kp0 must be positive"),
        ("task.Kp_slope", -1.0, "slope must be zero or more"),
        ("task.goals", [], "at least one goal"),
        ("task.goals", {}, "own.task: goals must be a list"),
        ("task.goals", [3], r"own.task.goals\[0\] must be a table, not 3"),
        ("task.goals.0.camera_at_q", [0.0], r"own.task.goals\[0\]"),
        (
            "task.goals.0",
            {"from_time": 1.0},
            "needs one of camera_at_q, camera_pose and markers_px; it has none",
        ),
        ("task.goals.0.markers_px", [[0, 0]] * 3, "needs one of .*'camera_at_q', 'markers_px'"),
        ("task.goals.0", {"markers_px": [[0, 0]] * 2}, r"markers_px must be 3 × 2 numbers"),
        (
            "task.goals.0",
            {"markers_px": [[0, 0]] * 3},
            "camera-pose task needs goals with a camera pose",
        ),
        (
            "task.goals.0",
            {"camera_pose": {"xyz": [0.5, 0.2, 0.3], "rpy": [0, 0, 0]}},
            r"own.task.goals\[0\]: at the goal, not in front of the camera: marker 1",
        ),
        ("tolerances", {"dwell_s": 0.0}, "tolerance dwell_s must be positive"),
        ("constraints", {}, "own: constraints must be a list"),
        ("constraints", ["fov"], r"own.constraints\[0\] must be a table, not 'fov'"),
        ("constraints.0", {"margin": 0.1}, r"own.constraints\[0\]: the key 'type' is missing"),
        ("constraints.0.K", 0.0, "K of fov must be a positive number"),
        ("constraints.0.K", "a", r"own.constraints\[0\]: K must be"),
        ("constraints.0.switching_gain", -1, "switching_gain of fov must be a positive number"),
        ("constraints.0.margin", 1.5, "0 ≤ margin < 1"),
        ("constraints.0.margin_px", 3, "not both"),
        ("constraints.0.markers", [4], "fov: there is no marker 4; the scene has 3"),
        ("constraints.0.markers", [0], "markers of fov are counted from 1"),
        (
            "constraints.0.markers",
            ["first"],
            r"own.constraints\[0\]: markers must be a list of integers",
        ),
        (
            "constraints.0.markers",
            [1.5],
            r"own.constraints\[0\]: markers must be a list of integers",
        ),
        (
            "constraints.0.markers",
            2,
            r"own.constraints\[0\]: markers must be a list of integers, not 2",
        ),
        ("constraints.1.curve.radius", -1.0, "radius of a shape must be a positive number"),
        ("constraints.1.curve.radius", "big", r"own.constraints\[1\].curve"),
        ("constraints.1.curve", {"shape": "circle"}, r"own.constraints\[1\].curve.*radius"),
        ("constraints.1.curve.rotation", "a", r"own.constraints\[1\].curve: rotation must be"),
        ("constraints.2.joints", [7], "joints of range are numbers from 1 to 6"),
        (
            "constraints.2.joints",
            ["wrist"],
            r"own.constraints\[2\]: joints must be a list of integers",
        ),
        ("constraints.2.lower", [1.0], "lower of range must be below upper"),
        ("constraints.2.lower", [1.0, 2.0], "lower of range must be a finite number for each"),
        ("constraints.3.upper", [-0.4], "lower < 0 < upper|below upper"),
        ("constraints.4.radius", 0, "radius of a sphere"),
        ("constraints.4.centre", [0, 0], r"own.constraints\[4\]: centre must be 3 numbers"),
        ("constraints.4.points", 3, r"own.constraints\[4\]: points must be a list"),
        ("constraints.4.points.0.offset", [0.0], r"points\[0\]: offset must be 3 numbers"),
        ("constraints.4.points.1", {"name": "nose"}, r"sphere\[nose\] appears more than once"),
        ("robot", {"dh": [[0, 0, 1]]}, "own.robot: dh must be a list of rows of 4 numbers"),
        ("robot", {"dh": [[0, 0, 1, 0]] * 6, "prismatic": [7]}, "prismatic"),
        ("robot", {"dh": [[0, 0, 1, 0]] * 6, "prismatic": ["2"]}, "prismatic"),
        ("robot", {"dh": [[0, 0, 1, 0]] * 6, "q_min": [0.0]}, "q_min must be 6 numbers"),
        (
            "robot",
            {"dh": [[0, 0, 1, 0]] * 6, "urdf": "a.urdf"},
            "no URDF file|key in own.robot 'dh'",
        ),
        ("robot", {}, "own.robot: the key 'dh' is missing"),
        ("robot", {"urdf": "nowhere.urdf"}, "no URDF file at .*nowhere.urdf"),
    ],
)
def test_wrong_values_are_refused_with_their_place(key: str, value: object, words: str) -> None:
    with pytest.raises(REFUSED, match=words) as refused:
        scenario().with_override(key, value).setup()
    assert re.search(r"\bown\b", str(refused.value)), "the scenario is not named"


@pytest.mark.parametrize(
    "key", ["robot", "q0", "sampling_time", "duration", "camera", "target", "task"]
)
def test_missing_keys_are_named(key: str) -> None:
    tables = copy.deepcopy(TABLES)
    del tables[key]
    with pytest.raises(ConfigurationError, match=f"own: the key '{key}' is missing"):
        scenario(tables).setup()


@pytest.mark.parametrize(
    ("path", "key"),
    [("camera", "focal_px"), ("camera", "size_px"), ("task", "feature"), ("task", "Kp0")],
)
def test_missing_keys_of_tables_are_named_with_their_table(path: str, key: str) -> None:
    tables = copy.deepcopy(TABLES)
    del tables[path][key]
    with pytest.raises(ConfigurationError, match=f"own.{path}: the key '{key}' is missing"):
        scenario(tables).setup()


def test_building_leaves_the_tables_alone() -> None:
    own = scenario()
    own.setup()
    assert own.tables == TABLES
    assert own.setup().constraints.labels == own.setup().constraints.labels


# --- what files mean ---


def test_values_arrive_where_they_belong() -> None:
    own = (
        scenario()
        .with_override("camera.principal_point_px", [250.0, 260.0])
        .with_override("camera.mount", {"xyz": [0.0, 0.0, 0.01], "rpy": [0.0, 0.0, 0.1]})
        .with_override("task.Kp_slope", 60.0)
        .with_override("task.damping", 2.0)
        .with_override("task.drift", "differences")
        .with_override("on_rank_loss", "continue")
        .with_override("qd0", [0.1] * 6)
        .with_override("tolerances", {"translation_m": 0.01, "rest_s": 1.0})
    )
    setup = own.setup()
    assert setup.scene.camera.principal_point_px is not None
    np.testing.assert_array_equal(setup.scene.camera.principal_point_px, [250.0, 260.0])
    expected = Pose.from_xyz_rpy((0.0, 0.0, 0.01), (0.0, 0.0, 0.1))
    assert max(distance(setup.scene.camera.mount, expected)) < 1e-12
    assert (setup.task.gains.Kp0, setup.task.gains.Kp_slope, setup.task.gains.damping) == (
        20.0,
        60.0,
        2.0,
    )
    assert (setup.task.drift, setup.task.velocity) == ("differences", "exact")
    assert setup.on_rank_loss == "continue"
    np.testing.assert_array_equal(setup.qd0, [0.1] * 6)
    assert (
        setup.tolerances.translation_m,
        setup.tolerances.rest_s,
        setup.tolerances.rotation_rad,
    ) == (
        0.01,
        1.0,
        0.005,
    )
    assert (setup.Ts, setup.duration) == (0.005, 1.0)


def test_goals_of_all_three_kinds_mean_the_same() -> None:
    plain = scenario().with_override("task.feature", "image-points")
    by_q = plain.setup().task.goals[0]
    assert by_q.camera is not None
    by_pixels = (
        plain.with_override("task.goals.0", {"markers_px": by_q.pixels.tolist()})
        .setup()
        .task.goals[0]
    )
    np.testing.assert_array_equal(by_pixels.pixels, by_q.pixels)
    np.testing.assert_allclose(by_pixels.normalised, by_q.normalised, rtol=1e-14)
    assert by_pixels.camera is None
    # a pose by roll, pitch and yaw; here those of a camera that looks straight down
    down = {"xyz": [0.43, 0.27, 0.5], "rpy": [np.pi, 0.0, 0.3]}
    by_pose = plain.with_override("task.goals.0", {"camera_pose": down}).setup().task.goals[0]
    assert by_pose.camera is not None
    np.testing.assert_array_equal(by_pose.camera.t, down["xyz"])
    np.testing.assert_allclose(by_pose.camera.R[:, 2], [0.0, 0.0, -1.0], atol=1e-15)


def test_a_square_target_has_its_corners_at_half_the_side() -> None:
    square = {"side": 0.2, "xyz": [0.43, 0.27, 0.02], "rpy": [0.1, -0.2, 0.3]}
    tables = copy.deepcopy(TABLES) | {"target": {"square": square}}
    markers = scenario(tables).setup().scene.markers
    assert markers.shape == (4, 3)
    np.testing.assert_allclose(markers.mean(axis=0), square["xyz"], atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(markers - np.roll(markers, 1, axis=0), axis=1), 0.2)
    np.testing.assert_allclose(
        np.linalg.norm(markers - markers.mean(axis=0), axis=1), 0.1 * np.sqrt(2.0)
    )
    normal = np.cross(markers[1] - markers[0], markers[3] - markers[0]) / 0.04
    np.testing.assert_allclose(
        normal, Pose.from_xyz_rpy(square["xyz"], square["rpy"]).R[:, 2], atol=1e-12
    )


def test_own_dh_arms() -> None:
    table = {
        "dh": [[0, 0, 1, 0], [0, 0, 1, 0], [0, 0, 0, -np.pi]],
        "name": "mine",
        "prismatic": [2],
    }
    tables = copy.deepcopy(TABLES) | {
        "robot": table | {"q_min": [-2, 0, -3], "q_max": [2, 1, 3], "qd_max": [1, 2, 3]},
        "q0": [0.1, 0.2, 0.3],
        "target": {"markers": [[1.0, 0.3, -1.0]]},
        "constraints": [],
    }
    tables["task"]["goals"] = [{"camera_at_q": [0.0, 0.2, 0.3]}]
    arm = scenario(tables).setup().scene.robot
    assert arm.name == "mine"
    np.testing.assert_array_equal(arm.q_max, [2, 1, 3])
    np.testing.assert_array_equal(arm.qd_min, [-1, -2, -3])
    # the second joint slides along z
    assert arm.pose([0.0, 0.7, 0.0]).t[2] == pytest.approx(0.7)


# --- trials ---


def test_trials_deviate_by_their_seed_and_number_alone() -> None:
    own = scenario().with_override("start_deviation", 0.02)
    start = np.array(TABLES["q0"])
    np.testing.assert_array_equal(own.setup(0, seed=5).q0, start)
    first = own.setup(1, seed=5).q0
    np.testing.assert_array_equal(own.setup(1, seed=5).q0, first)
    assert 0.0 < np.abs(first - start).max() <= 0.02
    assert np.unique(first - start).size == 6
    for trial, seed in ((2, 5), (1, 6)):
        assert not np.array_equal(own.setup(trial, seed).q0, first)
    # without a deviation all trials are the same
    np.testing.assert_array_equal(scenario().setup(3, seed=5).q0, start)


# --- scenarios that extend others ---


def test_a_scenario_says_only_what_is_different(tmp_path: Path) -> None:
    (tmp_path / "base.toml").write_text(
        (SHIPPED / "case-study-6r.toml").read_text(encoding="utf-8"), encoding="utf-8"
    )
    (tmp_path / "middle.toml").write_text(
        'extends = "base.toml"\ntitle = "Middle"\n[task]\nKp0 = 5.0\n', encoding="utf-8"
    )
    (tmp_path / "own.toml").write_text(
        'extends = "middle.toml"\nduration = 3.0\n[camera.mount]\nxyz = [0.0, 0.0, 0.01]\n'
    )
    own = Scenario.load(tmp_path / "own.toml")
    base = Scenario.load("case-study-6r")
    assert own.title == "Middle"
    assert "extends" not in own.tables
    assert own.tables["task"] == {**base.tables["task"], "Kp0": 5.0}
    assert own.tables["camera"] == {**base.tables["camera"], "mount": {"xyz": [0.0, 0.0, 0.01]}}
    assert own.tables["constraints"] == base.tables["constraints"]
    assert own.setup().duration == 3.0
    (tmp_path / "shipped.toml").write_text('extends = "case-study-6r"\nconstraints = []\n')
    assert Scenario.load(tmp_path / "shipped.toml").tables["constraints"] == []


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ({"own": 'extends = "case-study"'}, "scenario 'case-study'.*case-study-6r"),
        ({"own": 'extends = "nowhere.toml"'}, "cannot read .*nowhere.toml"),
        ({"own": "extends = 3"}, "extends must be the name or the path of a scenario, not 3"),
        (
            {"own": 'extends = "other.toml"', "other": 'extends = "own.toml"'},
            "extend each other in a circle",
        ),
    ],
)
def test_what_cannot_be_extended_is_refused(
    files: dict[str, str], words: str, tmp_path: Path
) -> None:
    for name, text in files.items():
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError, match=words):
        Scenario.load(tmp_path / "own.toml")


def test_circles_are_found_through_folders(tmp_path: Path) -> None:
    """Ways there and back are never the same path twice."""
    for folder, other in (("a", "b"), ("b", "a")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / f"{folder}.toml").write_text(f'extends = "../{other}/{other}.toml"')
    with pytest.raises(ConfigurationError, match="extend each other in a circle"):
        Scenario.load(tmp_path / "a" / "a.toml")


def test_a_chain_of_files_has_an_end(tmp_path: Path) -> None:
    for i in range(1200):
        (tmp_path / f"{i}.toml").write_text(f'extends = "{i + 1}.toml"')
    (tmp_path / "1200.toml").write_text("duration = 3.0")
    with pytest.raises(ConfigurationError, match=rf"more than {MAX_EXTENDED} files"):
        Scenario.load(tmp_path / "0.toml")
    assert Scenario.load(tmp_path / f"{1201 - MAX_EXTENDED}.toml").tables == {"duration": 3.0}


# --- overrides ---


def test_files_in_overrides_are_where_the_user_is(tmp_path: Path) -> None:
    """Not where the scenario is, which may be among the installed packages."""
    shipped = Scenario.load("ur5-fov")
    by_key = shipped.with_override("robot", {"urdf": "arm.urdf"}, tmp_path)
    assert by_key.tables["robot"]["urdf"] == str(tmp_path / "arm.urdf")
    again = by_key.with_override("robot.urdf", "b.urdf", tmp_path)
    assert again.tables["robot"] == {"urdf": str(tmp_path / "b.urdf")}
    elsewhere = str(tmp_path / "elsewhere.urdf")
    assert (
        shipped.with_override("robot", {"urdf": elsewhere}, Path("here")).tables["robot"]["urdf"]
        == elsewhere
    )
    walls = [{"type": "collision", "obstacle": {"shape": "mesh", "file": "wall.stl"}}]
    changed = shipped.with_override("constraints", walls, tmp_path).tables["constraints"]
    assert changed[0]["obstacle"] == {"shape": "mesh", "file": str(tmp_path / "wall.stl")}
    assert shipped.with_override("title", "file.stl", tmp_path).title == "file.stl"


def test_overrides_change_a_copy() -> None:
    own = scenario()
    other = own.with_override("task.Kp0", 3.0).with_override(
        "constraints.4.points.0.offset", [0.0, 0.0, 0.2]
    )
    assert own.tables == TABLES
    assert other.tables["task"]["Kp0"] == 3.0
    assert other.setup().scene.points[0].offset == (0.0, 0.0, 0.2)
    slow = other.with_override(
        "constraints.0", {"type": "joint-speed", "joints": [5], "switching_gain": 1.0}
    )
    assert slow.setup().constraints.labels[0] == "speed[joint 5].upper"


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("tasks.Kp0", "table in own 'tasks'.*Did you mean 'task'"),
        ("task.goal.0.from_time", "table in own 'goal'.*Did you mean 'goals'"),
        ("constraints.5.K", "entry of a list in own '5'.*0, 1, 2, 3, 4"),
        ("constraints.first.K", "entry of a list in own 'first'"),
        ("constraints.9", "entry of a list in own '9'"),
        ("duration.seconds", "'duration.seconds' does not lead to a table"),
        ("q0.0.0", "own"),
    ],
)
def test_overrides_that_lead_nowhere_are_refused(key: str, words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        scenario().with_override(key, 1.0)


# --- files ---


def test_scenarios_that_are_not_shipped_are_refused_with_those_that_are() -> None:
    family = r"unknown scenario 'ur5'.*'ur5' is a family.*extend it in the file of a family"
    with pytest.raises(ConfigurationError, match=family):
        Scenario.load("ur5")
    close = r"unknown scenario 'case-study'.*Did you mean 'case-study-6r'"
    with pytest.raises(ConfigurationError, match=close) as error:
        Scenario.load("case-study")
    assert all(name in str(error.value) for name in shipped_scenarios())
    assert ".toml" in str(error.value)


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"cannot read .*nowhere\.toml"):
        Scenario.load(tmp_path / "nowhere.toml")
    broken = tmp_path / "broken.toml"
    broken.write_text("robot = ")
    with pytest.raises(ConfigurationError, match=r"broken\.toml is not TOML"):
        Scenario.load(broken)
    broken.write_bytes(b"title = '\xff'")
    with pytest.raises(ConfigurationError, match=r"cannot read .*broken\.toml"):
        Scenario.load(broken)
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(ConfigurationError, match=r"cannot read .*folder\.toml"):
        Scenario.load(tmp_path / "folder.toml")


def test_what_toml_leaves_open_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    for text, words in (
        ("x = " + "[" * 2000 + "]" * 2000, "30 levels"),
        ("x = " + "[" * 40 + "]" * 40, "30 levels"),
        ("x = " + "{a = " * 40 + "1" + "}" * 40, "30 levels"),
        ("[" + ".".join("a" * 2000) + "]", "30 levels"),
        ("x = " + "9" * 5000, "limit"),
        ("x = 0x" + "f" * 5000, "64 bits"),
        ("x = [[9223372036854775808]]", "64 bits"),
    ):
        path.write_text(text)
        with pytest.raises(ConfigurationError, match=rf"own\.toml.*{words}"):
            Scenario.load(path)
    path.write_text("x = " + "[" * 30 + "]" * 30 + "\ny = -9223372036854775808")
    Scenario.load(path)
    with pytest.raises(ConfigurationError, match="cannot read"):
        Scenario.load("nul\x00.toml")


def test_a_byte_order_mark_and_any_line_ends_are_accepted(tmp_path: Path) -> None:
    path = tmp_path / "mein Ärmchen.toml"
    path.write_bytes(b"\xef\xbb\xbf" + 'title = "ä"\r\nduration = 3.0\r\n'.encode())
    assert Scenario.load(path) == Scenario(
        "mein Ärmchen", {"title": "ä", "duration": 3.0}, tmp_path
    )


def test_messages_do_not_grow_with_what_is_wrong() -> None:
    for key, value in (("q0", "x" * 100_000), ("camera", [0] * 100_000), ("robot", "x" * 100_000)):
        with pytest.raises(ConfigurationError) as error:
            scenario().with_override(key, value).setup()
        assert len(str(error.value)) < 1000


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        (
            "constraints.1.curve.radius",
            [20.0],
            r"own.constraints\[1\].curve: radius must be an integer or a number",
        ),
        ("constraints.1.curve.radius", [[1.0], []], "radius must be an integer or a number"),
        ("constraints.1.curve.radius", True, "radius must be an integer or a number"),
        ("constraints.0.K", 1e308, "the start cannot be evaluated: FloatingPointError"),
        (
            "task.goals.0",
            {"markers_px": [[1e300, 0.0]] * 3},
            "cannot be evaluated: FloatingPointError",
        ),
        ("constraints.4.centre", [1e300, 0.0, 0.0], "FloatingPointError"),
        (
            "disturbances",
            {"gradient_error_rows": [["fov"]]},
            "own.disturbances: gradient_error_rows must be a list of strings",
        ),
        (
            "constraints.4",
            {**TABLES["constraints"][4], "points": "links", "spacing": 1e-6, "link_radius": 0.1},
            "spacing of points along the links: link . is .* at most 60 times as long",
        ),
        (
            "duration",
            5e4,
            r"50000.0 s in steps of 0.005 s are 1e\+07 samples.* GB of memory; a run may have .* samples",
        ),
    ],
)
def test_what_cannot_be_computed_is_refused(key: str, value: object, words: str) -> None:
    own = scenario().with_override("task.feature", "image-points")
    with pytest.raises(REFUSED, match=words):
        own.with_override(key, value).setup().check_start()


def test_numbers_that_overflow_in_python_are_refused_too() -> None:
    own = (
        scenario()
        .with_override("actuation", "position")
        .with_override("disturbances", {"time_constant": 1e160})
    )
    with pytest.raises(
        ConfigurationError, match="own: computing with its numbers fails: OverflowError"
    ):
        own.setup()


def test_the_memory_of_a_run_is_estimated_from_what_it_keeps() -> None:
    setup = scenario().with_override("duration", 20.0).setup()
    simulate(setup, Tracking())
    tracemalloc.start()
    trajectory = simulate(setup, Tracking())
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak / len(trajectory.t) == pytest.approx(setup.sample_memory, rel=0.25)


def test_arms_of_many_joints_deviate_too() -> None:
    tables = copy.deepcopy(TABLES) | {
        "robot": {"dh": [[0.0, 0.0, 0.01, 0.0]] * 69 + [[0.0, 0.0, 0.0, -np.pi]]},
        "q0": [0.0] * 70,
        "start_deviation": 0.001,
        "target": {"markers": [[0.7, 0.0, -1.0]]},
        "constraints": [],
    }
    tables["task"]["goals"] = [{"camera_at_q": [0.0] * 70}]
    assert np.unique(scenario(tables).setup(1).q0).size == 70


URDF = """<robot name="bench arm">
  <link name="base"/> <link name="a"/> <link name="b"/> <link name="c"/> <link name="eye"/>
  <joint name="j1" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="2" effort="1"/></joint>
  <joint name="j2" type="revolute"><parent link="a"/><child link="b"/>
    <origin xyz="0.5 0 0.8"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="2" effort="1"/></joint>
  <joint name="j3" type="continuous"><parent link="b"/><child link="c"/>
    <origin xyz="0.5 0 0"/><axis xyz="0 0 1"/></joint>
  <joint name="mount" type="fixed"><parent link="c"/><child link="eye"/>
    <origin rpy="3.141592653589793 0 0"/></joint>
</robot>
"""

TEN_LINES = """robot = { urdf = "arms/bench.urdf" }
q0 = [0.2, 0.9, -0.4]
sampling_time = 0.01
duration = 5.0
camera = { focal_px = [500.0, 500.0], size_px = [640, 480] }
target = { markers = [[0.7, 0.7, 0.0], [0.8, 0.5, 0.0]] }
[task]
feature = "camera-pose"
Kp0 = 16.0
goals = [{ camera_at_q = [0.3, 0.8, 0.2] }]
"""


def test_ten_lines_are_enough_for_an_own_arm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its URDF is found relative to the scenario file, wherever the program is started."""
    assert len(TEN_LINES.strip().splitlines()) == 10
    folder = tmp_path / "mine"
    (folder / "arms").mkdir(parents=True)
    (folder / "arms" / "bench.urdf").write_text(URDF)
    (folder / "bench.toml").write_text(TEN_LINES)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    own = Scenario.load(folder / "bench.toml")
    assert (own.name, own.title, own.description) == ("bench", "bench", "")
    setup = own.setup()
    assert setup.scene.robot.joint_names == ("j1", "j2", "j3")
    trajectory = simulate(setup, Tracking())
    assert trajectory.status == "converged", trajectory.reason
    np.testing.assert_allclose(trajectory.q[-1], [0.3, 0.8, 0.2], atol=5e-3)
    # relative paths of the scenario itself start from the given folder or the current one
    assert Scenario.load("mine/bench.toml", base=tmp_path).setup().samples == setup.samples
    monkeypatch.chdir(folder)
    assert Scenario.load("bench.toml").setup().samples == setup.samples
    named = own.with_override("robot.name", "bench").with_override("robot.tip", "eye")
    assert named.setup().scene.robot.name == "bench"
    locked = own.with_override("robot.locked", {"j3": 0.1}).with_override("q0", [0.2, 0.9])
    locked = locked.with_override("task.goals.0.camera_at_q", [0.2, 0.8])
    assert locked.setup().scene.robot.n == 2


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("robot.tip", "eyes", "link in bench.urdf 'eyes'.*Did you mean 'eye'"),
        ("robot.locked", {"j9": 0.0}, "joint in bench.urdf 'j9'"),
        ("robot.locked", {"j3": "open"}, "bench.robot: locked must be a table of numbers"),
        ("robot.locked", [3], "own.robot: locked must be a table|locked must be a table"),
        ("robot.urdf", 3, "urdf must be a string"),
        ("robot.prismatic", [1], "key in bench.robot 'prismatic'"),
    ],
)
def test_an_own_arm_that_is_described_wrongly_is_refused(
    tmp_path: Path, key: str, value: object, words: str
) -> None:
    (tmp_path / "arms").mkdir()
    (tmp_path / "arms" / "bench.urdf").write_text(URDF)
    (tmp_path / "bench.toml").write_text(TEN_LINES)
    with pytest.raises(REFUSED, match=words):
        Scenario.load(tmp_path / "bench.toml").with_override(key, value).setup()


def test_an_own_constraint_type_can_be_registered(monkeypatch: pytest.MonkeyPatch) -> None:
    """A type that is put into the registry at run time is one that files can use."""
    monkeypatch.setitem(CONSTRAINTS, "half-speed", make_half_speed)
    table = {"type": "half-speed", "of_joint": 3}
    labels = scenario().with_override("constraints", [table]).setup().constraints.labels
    assert labels == ("speed[joint 3].upper", "speed[joint 3].lower")
    with pytest.raises(ConfigurationError, match=r"key in .*'joint'"):
        scenario().with_override("constraints", [{**table, "joint": 3}]).setup()


def make_half_speed(robot, *, of_joint: int):
    from vsconstraints.constraints import JointSpeed

    return JointSpeed(
        robot, joints=[of_joint], upper=[0.5 * robot.qd_max[of_joint - 1]], switching_gain=1.0
    )


OWN_CONSTRAINT = """
import numpy as np
from vsconstraints.constraints import ImageConstraint


class Fence(ImageConstraint):
    kind = "fence"

    def __init__(self, u, **options):
        super().__init__(K=0.1, switching_gain=2.0, length=u, **options)
        self.u = u

    def sigma(self, y):
        return y[..., 0] / self.u - 1.0

    def gradient(self, y):
        return np.stack((np.full(y.shape[:-1], 1.0 / self.u), np.zeros(y.shape[:-1])), axis=-1)


class NoConstraint:
    pass
"""


def test_an_own_constraint_class_beside_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Named by module and class, it is made with the other keys of its table."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "fences_for_test.py").write_text(OWN_CONSTRAINT)
    own = scenario(folder=tmp_path)
    table = {"type": "fences_for_test:Fence", "u": 200.0, "markers": [2]}
    setup = own.with_override("constraints", [table]).setup()
    assert setup.constraints.labels == ("fence[marker 2]",)
    assert simulate(setup, SlidingMode()).sigma.max() <= 0.0
    for spoilt, words in (
        ({"type": "fences_for_test:Fense"}, "has no Constraint named 'Fense'"),
        (
            {"type": "fences_for_test:NoConstraint"},
            "has no Constraint named 'NoConstraint'",
        ),
        ({"type": "no_such_module:Fence"}, "cannot import 'no_such_module'"),
        ({"v": 3.0}, "fences_for_test:Fence cannot be made with .*'v'"),
        ({"u": -1.0}, "length of fence must be a positive number"),
    ):
        with pytest.raises(REFUSED, match=words):
            own.with_override("constraints", [table | spoilt]).setup()


FAILING = """
import numpy as np
from vsconstraints.constraints import ImageConstraint


class Late(ImageConstraint):
    kind = "late"

    def __init__(self, shape=2, calls=None):
        super().__init__(K=0.1, switching_gain=2.0, length=1.0)
        self.shape, self.calls = shape, calls

    def sigma(self, y):
        if self.calls is not None:
            self.calls -= 1
            if self.calls < 0:
                raise KeyError("no more")
        return y[..., 0] - 1e4

    def gradient(self, y):
        gradient = np.zeros((*y.shape[:-1], self.shape))
        gradient[..., 0] = 1.0
        return gradient
"""


def test_an_own_class_that_fails_is_shown_with_file_and_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "failing_for_test.py").write_text(FAILING)
    (tmp_path / "ends_for_test.py").write_text("import sys\nsys.exit()\n")
    own = scenario(folder=tmp_path)
    for table, words in (
        (
            {"type": "failing_for_test:Late", "calls": 0},
            r"the start.*KeyError: 'no more' \(failing_for_test.py, line 17\)",
        ),
        (
            {"type": "failing_for_test:Late", "shape": 3},
            "the start cannot be evaluated: ValueError",
        ),
        (
            {"type": "ends_for_test:Late"},
            r"cannot import 'ends_for_test': SystemExit: \(ends_for_test.py, line 2\)",
        ),
    ):
        with pytest.raises(ConfigurationError, match=words):
            own.with_override("constraints", [table]).setup().check_start()


def test_a_constraint_that_goes_on_raising_leaves_the_trajectory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Clearances are looked at when a run is over, and raise there again: of that row they are not
    known.
    """
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "failing_for_test.py").write_text(FAILING)
    tables = [{"type": "failing_for_test:Late", "calls": 150}, TABLES["constraints"][2]]
    trajectory = simulate(
        scenario(folder=tmp_path).with_override("constraints", tables).setup(), SlidingMode()
    )
    assert trajectory.status == "failed"
    assert "KeyError: 'no more' (failing_for_test.py, line 17)" in trajectory.reason
    assert len(trajectory.t) > 20
    late = np.array([label.startswith("late") for label in trajectory.labels])
    assert np.isnan(trajectory.clearance[:, late]).all()
    assert np.isfinite(trajectory.clearance[:, ~late]).all()
    assert np.isfinite(trajectory.phi).all()


def test_values_from_python_may_be_those_of_numpy() -> None:
    scenario = Scenario.load("example-2d-fov")
    changed = scenario.with_override("duration", np.float64(1.5)).with_override(
        "q0", np.array(scenario.tables["q0"])
    )
    setup = changed.with_override("task.Kp0", np.float32(2.0)).setup()
    assert (setup.duration, setup.task.gains.Kp0, setup.q0.tolist()) == (
        1.5,
        2.0,
        scenario.tables["q0"],
    )
    with pytest.raises(ConfigurationError, match=r"camera must be a table, not 2\.0"):
        scenario.with_override("camera", np.float64(2.0)).setup()
