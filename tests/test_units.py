"""Numbers in another unit, or of another camera: the question that each raises, and that none is
asked in vain.
"""

from __future__ import annotations

import re
from dataclasses import replace
from importlib.metadata import distribution
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from vsconstraints.bench.families import Family, families
from vsconstraints.comparisons import Suite
from vsconstraints.comparisons.suite import DEFAULT
from vsconstraints.constraints import ConstraintSet
from vsconstraints.errors import ConfigurationError, VsconstraintsError
from vsconstraints.robots.limits import NO_LIMITS
from vsconstraints.robots.robot import Robot
from vsconstraints.scenarios import Scenario, shipped_scenarios
from vsconstraints.simulation.units import in_degrees, unit_warnings
from vsconstraints.vision.scene import Scene
from vsconstraints.vision.tracking import VisualTask

EXAMPLES = Path(__file__).parents[1] / "examples"
URDF = EXAMPLES / "six_axis.urdf"
ARM = "my-arm"
UR5 = "ur5-fov"
EYE_TO_HAND = "eye-to-hand-ibvs"
PLANAR = "example-2d-fov"


def scenario(name: str, changes: dict[str, Any]) -> Scenario:
    loaded = Scenario.load(EXAMPLES / "my-arm.toml") if name == ARM else Scenario.load(name)
    for key, value in changes.items():
        loaded = loaded.with_override(key, value)
    return loaded


def said(name: str, changes: dict[str, Any]) -> str:
    """What is said of a scenario before anything runs, be it a remark or why there is no start."""
    try:
        return "; ".join(scenario(name, changes).setup().check_start())
    except VsconstraintsError as error:
        return str(error)


#: Scenario, what is given in another unit, and the words by which it is asked about.
UNITS: dict[str, tuple[str, dict[str, Any], str]] = {
    "sampling time in ms": (ARM, {"sampling_time": 2.0}, "is the sampling time 2 in ms, not s?"),
    "sampling time in ms, stable": (
        PLANAR,
        {"sampling_time": 0.2},
        "is the sampling time 0.2 in ms, not s?",
    ),
    "sampling time in ms, slow": (
        PLANAR,
        {"sampling_time": 0.2, "task.Kp0": 1.0, "duration": 20.0},
        "the sampling time 0.2 s means 5 commands a second: is it in ms, not s?",
    ),
    "sampling rate": (
        ARM,
        {"sampling_time": 500.0, "duration": 1000.0},
        "500 a rate in Hz, or in ms, not s?",
    ),
    "sampling rate, short": (
        ARM,
        {"sampling_time": 500.0},
        "is the sampling time a rate in Hz, or in ms, not s?",
    ),
    "focal length in mm": (
        ARM,
        {"camera.focal_px": [4.2, 4.2]},
        "is the focal length 4.2 in mm, not px?",
    ),
    "principal point from the centre": (
        ARM,
        {"camera.principal_point_px": [2.0, -3.0]},
        "is it counted from the image's centre, not from the top left corner?",
    ),
    "intrinsics of a larger image": (
        ARM,
        {"camera.principal_point_px": [640.0, 480.0]},
        "near the centre of an image of 1280 × 960 px: are these intrinsics of another resolution?",
    ),
    "intrinsics of a smaller image": (
        ARM,
        {"camera.principal_point_px": [160.0, 120.0], "camera.size_px": [1280, 960]},
        "near the centre of an image of 320 × 240 px: are these intrinsics of another resolution?",
    ),
    "image on its side": (
        ARM,
        {"camera.size_px": [480, 640], "camera.principal_point_px": [322, 243]},
        "are width and height swapped?",
    ),
    "mount in mm": (
        ARM,
        {"camera.mount.xyz": [0.0, 0.0, 60.0]},
        "from the arm's tip: are its coordinates in mm, not m?",
    ),
    "fixed camera in mm": (
        EYE_TO_HAND,
        {"camera.fixed.xyz": [1200.0, 0.0, 500.0]},
        "the camera is fixed 1.3e+03 m from the robot's base: are its coordinates in mm, not m?",
    ),
    "markers in mm": (
        ARM,
        {"target.square.side": 120.0},
        "markers are 120 m apart: are its coordinates in mm, not m?",
    ),
    "target in mm": (
        ARM,
        {"target.square.xyz": [620.0, 30.0, 0.0]},
        "markers are 621 m from the robot's base: are their coordinates in mm, not m?",
    ),
    "arm in mm": (
        PLANAR,
        {
            "robot": {
                "dh": [
                    [0.0, 0.0, 500.0, 0.0],
                    [0.0, 0.0, 400.0, 0.0],
                    [0.0, 0.0, 300.0, 3.141592653589793],
                ]
            },
        },
        "from its base: are the arm's dimensions in mm, not m?",
    ),
    "start in degrees": (
        UR5,
        {"q0": [0.0, -90.0, 90.0, -90.0, -90.0, 0.0]},
        "q0 has -90 of joint 2, 90 of joint 3, -90 of joint 4, -90 of joint 5: are these degrees, "
        "not rad?",
    ),
    "start in degrees, joints without ranges": (
        PLANAR,
        {"q0": [-41.0, -100.0, 61.5]},
        "q0 has -41 of joint 1, -100 of joint 2, 61.5 of joint 3: are these degrees, not rad?",
    ),
    "goal in degrees": (
        UR5,
        {"task.goals": [{"camera_at_q": [20.0, -80.0, 80.0, -90.0, -90.0, 60.0]}]},
        "camera_at_q has 20 of joint 1, -80 of joint 2, 80 of joint 3, ",
    ),
    "goal's depth in mm": (
        "ur5-image",
        {
            "task.goals": [
                {"markers_px": [[-60, -60], [60, -60], [60, 60], [-60, 60]], "depth_m": [400.0] * 4}
            ]
        },
        "goal 1 has the markers 400 m from the camera: is that in mm, not m?",
    ),
    "speeds of rows in degrees": (
        ARM,
        {"constraints.1.upper": [45.0]},
        "the speed that a row allows joint 6 is 45 rad/s, and that of six_axis is 4: are these "
        "degrees per second",
    ),
    "ranges of rows in degrees": (
        PLANAR,
        {
            "constraints": [
                {
                    "type": "joint-range",
                    "lower": [-180.0] * 3,
                    "upper": [180.0] * 3,
                    "K": 0.2,
                    "switching_gain": 1.0,
                }
            ]
        },
        "the range that a row allows joint 1 is 180 rad: are these degrees, not rad?",
    ),
    "acceleration in degrees": (
        UR5,
        {"limits": {"acceleration": 2300.0}},
        "is 2300 rad/s²: are these degrees, not rad?",
    ),
    "switching gain": (
        UR5,
        {"constraints.0.switching_gain": 50_000.0},
        "moves φ by 100 times the whole allowed range in one sampling period of 0.002 s",
    ),
}


@pytest.mark.parametrize(("name", "changes", "words"), UNITS.values(), ids=UNITS)
def test_each_unit_raises_its_question(name: str, changes: dict[str, Any], words: str) -> None:
    assert words in said(name, changes)
    assert words not in said(name, {})


@pytest.mark.parametrize(("name", "changes", "words"), UNITS.values(), ids=UNITS)
def test_comparisons_ask_it_too(name: str, changes: dict[str, Any], words: str) -> None:
    """As a warning that is printed and kept, or as the reason for which there is no comparison."""
    try:
        suite = Suite.load(DEFAULT)
        warnings = suite.changed(scenarios=(scenario(name, changes),)).warnings()
    except VsconstraintsError as error:
        warnings = {name: [str(error)]}
    assert words in "; ".join(*warnings.values())


def test_a_urdf_in_degrees(tmp_path: Path) -> None:
    """Ranges of ±175° and speeds of 180°/s, written where the format has rad."""
    root = ElementTree.parse(URDF).getroot()
    for limit in root.iter("limit"):
        for key in ("lower", "upper"):
            limit.set(key, "-175" if key == "lower" else "175")
        limit.set("velocity", "180")
    file = tmp_path / "degrees.urdf"
    ElementTree.ElementTree(root).write(file)
    words = said(ARM, {"robot": {"urdf": str(file), "tip": "tool"}})
    assert "is up to 175 rad, 27.9 turns: are these degrees, not rad?" in words
    assert "is up to 180 rad/s: are these degrees per second, not rad/s?" in words
    assert "joints 1 (" in words


def test_a_joint_without_a_range_is_named(tmp_path: Path) -> None:
    """A range [0, 0], as files have it where nobody filled it in."""
    text = URDF.read_text()
    first = re.search(r"<limit[^>]*>", text)
    assert first is not None
    empty = re.sub(r'(lower|upper)="[^"]*"', r'\1="0"', first[0])
    file = tmp_path / "empty.urdf"
    file.write_text(text.replace(first[0], empty, 1))
    joint = Robot.from_urdf(file, "tool").joint_names[0]
    arm = {"urdf": str(file), "tip": "tool"}
    with pytest.raises(
        ConfigurationError,
        match=rf"joint 1 \({joint}\) has \[0, 0\]\. Lock a joint that does not move",
    ):
        scenario(ARM, {"robot": arm}).setup()
    free = {"robot": arm, "constraints": []}
    assert (
        f"joint 1 ({joint}) of six_axis cannot move: its range is a single point, [0, 0]"
        in said(ARM, free)
    )


# --- nothing is asked in vain ---


@pytest.mark.parametrize(
    "name", [*shipped_scenarios(), "examples/my-arm.toml", "tests/data/everything.toml"]
)
def test_shipped_scenarios_raise_no_question(name: str) -> None:
    path = name if name in shipped_scenarios() else Path(__file__).parents[1] / name
    assert Scenario.load(path).setup().doubts == []


@pytest.mark.parametrize("name", families())
def test_drawn_scenes_raise_no_question(name: str) -> None:
    family = Family.load(name)
    drawn = family.scene(0)
    for condition in family.conditions:
        assert drawn.setup(condition).doubts == []


def arms_of_example_robot_data() -> list[Path]:
    package = distribution("example-robot-data")
    folder = Path(str(package.locate_file("cmeel.prefix/share/example-robot-data/robots")))
    return sorted(folder.rglob("*.urdf"))


def test_robots_of_example_robot_data_raise_no_question() -> None:
    """Every serial chain to a last link, humanoids' arms and quadrupeds' legs too; joints that
    cannot move apart.
    """
    setup = Scenario.load(UR5).setup()
    chains = 0
    for file in arms_of_example_robot_data():
        links = {link.get("name", "") for link in ElementTree.parse(file).getroot().findall("link")}
        parents = {
            joint.get("link", "") for joint in ElementTree.parse(file).getroot().iter("parent")
        }
        for tip in sorted(links - parents)[:8]:
            try:
                robot = Robot.from_urdf(file, tip)
            # a floating base, a joint that mimics another one
            except (VsconstraintsError, RuntimeError):
                continue
            chains += 1
            scene = Scene(robot, setup.scene.camera, setup.scene.markers)
            q0 = np.clip(np.zeros(robot.n), robot.q_min, robot.q_max)
            nothing = ConstraintSet([], scene)
            task = VisualTask(
                setup.task.feature,
                [replace(goal, q=None) for goal in setup.task.goals],
                setup.task.gains,
            )
            asked = unit_warnings(scene, nothing, task, NO_LIMITS, q0, setup.Ts)
            asked = [text for text in asked if "cannot move" not in text]
            assert asked == [], (file.name, tip)
    assert chains > 100


def test_coordinates_of_joints_that_turn_often_are_no_degrees() -> None:
    table = [
        [0.0, 0.1, 0.0, 1.57],
        [0.0, 0.0, 0.4, 0.0],
        [0.0, 0.0, 0.4, 0.0],
        [0.0, 0.0, 0.0, 0.0],
    ]
    robot = Robot.from_dh(
        table,
        prismatic=[4],
        q_min=[-50.0, -3.0, -np.inf, -9.0],
        q_max=[50.0, 3.0, np.inf, 9.0],
        name="turner",
    )
    q = np.array([40.0, 6.0, 12.0, 300.0])
    assert not in_degrees(robot, q).any()
    assert in_degrees(robot, np.array([60.0, 7.0, 13.0, 300.0])).tolist() == [
        True,
        True,
        True,
        False,
    ]
