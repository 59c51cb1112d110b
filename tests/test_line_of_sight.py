"""A camera that sees its own robot: markers that its links hide."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vsconstraints.controllers import Controller, SlidingMode
from vsconstraints.errors import ConfigurationError
from vsconstraints.rows import Command, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate
from vsconstraints.simulation.occluders import LinesOfSight
from vsconstraints.vision.motion import Motion, TargetMotion
from vsconstraints.vision.scene import Scene

ARM = """
<robot name="swing">
  <link name="base"/>
  <link name="flag"><collision>
    <origin xyz="1 0 0"/><geometry><{shape}/></geometry>
  </collision></link>
  <link name="hand"><collision><geometry><sphere radius="3"/></geometry></collision></link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="flag"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="10" effort="1"/></joint>
  <joint name="lift" type="prismatic">
    <parent link="flag"/><child link="hand"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="10" effort="1"/></joint>
</robot>
"""
"""A flag that turns about z, and a hand that lifts along it; the hand carries the markers, and a
huge sphere.
"""


def swing(folder: Path, shape: str = 'sphere radius="0.2"', **changes: Any) -> Scenario:
    """A camera at (0, −5, 0) looks along y at the hand near the origin; the flag is in between at
    q₁ = −π/2.
    """
    (folder / "arm.urdf").write_text(ARM.format(shape=shape), encoding="utf-8")
    tables: dict[str, Any] = {
        "robot": {"urdf": "arm.urdf"},
        "q0": [0.0, 0.0],
        "sampling_time": 0.01,
        "duration": 0.5,
        "camera": {
            "focal_px": [500, 500],
            "size_px": [600, 600],
            "fixed": {"xyz": [0, -5, 0], "rpy": [-np.pi / 2, 0, 0]},
        },
        "target": {"markers": [[0, 0, 0], [0, 0, 1.0]]},
        "task": {"feature": "camera-pose", "Kp0": 20.0, "goals": [{"camera_at_q": [0.1, 0.0]}]},
        **changes,
    }
    return Scenario("swing", tables, folder)


@pytest.mark.parametrize(
    ("angle", "hidden"),
    [(0.0, False), (-np.pi / 2, True), (-np.pi / 2 + 0.3, False), (np.pi / 2, False)],
)
def test_a_link_hides_what_is_behind_it_only(angle: float, hidden: bool, tmp_path: Path) -> None:
    scene = swing(tmp_path).setup().scene
    found = LinesOfSight(scene).hidden(np.array([[angle, 0.0]]), [0.0])[0]
    # the second marker is 1 m higher: the line to it passes 0.8 m above the flag
    assert found == ([(1, "flag")] if hidden else [])


@pytest.mark.parametrize(
    "shape", ['box size="0.4 0.4 0.4"', 'cylinder radius="0.2" length="0.4"', 'sphere radius="0.2"']
)
def test_hidden_is_what_a_point_on_the_line_inside_a_link_says(shape: str, tmp_path: Path) -> None:
    """Against points along the line, and the shapes' own formulas."""
    scene = swing(tmp_path, shape).setup().scene
    lines = LinesOfSight(scene)
    rng = np.random.default_rng(1)
    seen = 0
    for _ in range(200):
        q = np.array([-np.pi / 2 + rng.uniform(-0.3, 0.3), rng.uniform(-0.4, 0.4)])
        marker = scene.robot.pose(q).act(scene.markers[:1])[0]
        line = np.array([0.0, -5.0, 0.0]) + np.linspace(0.0, 1.0, 4001)[:, None] * (
            marker - [0.0, -5.0, 0.0]
        )
        c = np.cos(q[0])
        s = np.sin(q[0])
        local = line @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) - [1.0, 0.0, 0.0]
        depth = {
            "box": 0.2 - np.abs(local).max(axis=1),
            "cyl": np.minimum(0.2 - np.hypot(local[:, 0], local[:, 1]), 0.2 - np.abs(local[:, 2])),
            "sph": 0.2 - np.linalg.norm(local, axis=1),
        }[shape[:3]].max()
        # a cylinder's prism is 0.5 % wider
        if abs(depth) > 2e-3:
            assert ((1, "flag") in lines.hidden(q[None], [0.0])[0]) == (depth > 0.0)
            seen += depth > 0.0
    assert 50 < seen < 150


def test_a_start_with_a_hidden_marker_is_refused_unless_told_otherwise(tmp_path: Path) -> None:
    start = [-np.pi / 2, 0.0]
    with pytest.raises(
        ConfigurationError, match="the robot itself hides markers from the camera: marker 1 by flag"
    ):
        swing(tmp_path, q0=start).setup().check_start()
    told = swing(tmp_path, q0=start, on_hidden_markers="continue").setup()
    assert told.check_start() == ["at the start the robot itself hides markers: marker 1 by flag"]
    assert "at the start the robot itself hides markers" in simulate(told, SlidingMode()).reason


class Coasting(Controller):
    """Commands nothing."""

    name = "coasting"

    def solve(self, rows: Rows, task: Task) -> Command:
        return Command(np.zeros(2), "ok", np.zeros(0, dtype=np.bool_), rows.labels)


def test_a_marker_that_gets_hidden_during_a_run_is_reported(tmp_path: Path) -> None:
    there = swing(tmp_path, q0=[-np.pi / 2 + 0.6, 0.0], qd0=[-2.0, 0.0]).setup()
    assert there.check_start() == []
    run = simulate(there, Coasting())
    first = float(
        run.reason.partition("marker 1 is hidden by flag, first seen at ")[2].removesuffix(" s")
    )
    # the flag of radius 0.2 m is 1 m from the axis, which it passes at 0.3 s
    assert first == pytest.approx(0.3 - np.arcsin(0.2) / 2.0, abs=0.011)


def test_a_mesh_that_is_missing_is_said_and_nothing_else_lost(tmp_path: Path) -> None:
    there = swing(tmp_path, 'mesh filename="lost.stl"').setup()
    (remark,) = there.check_start()
    assert remark.startswith("lines of sight are not checked")
    assert "lost.stl" in remark
    assert len(simulate(there, SlidingMode()).t) == there.samples


@pytest.mark.parametrize("name", ["ur5-fov", "panda-fov"])
def test_an_arm_does_not_hide_what_the_camera_on_its_hand_sees(name: str) -> None:
    there = Scenario.load(name).setup()
    assert LinesOfSight(there.scene).bodies
    assert there.check_start() == []


@pytest.mark.parametrize("name", ["ur5-fov", "panda-fov"])
def test_nothing_is_hidden_where_no_line_is_near_a_link(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Against distances of all solids, at random configurations, before a target that moves and one
    at rest.
    """
    there = Scenario.load(name).setup().scene
    moving = TargetMotion(Motion((0.2, -0.1, 0.1)), np.zeros(3), np.zeros(3))
    for motion in (None, moving):
        scene = Scene(there.robot, there.camera, there.markers, (), motion)
        lines = LinesOfSight(scene)
        rng = np.random.default_rng(2)
        q = rng.uniform(-2.5, 2.5, (100, there.robot.n))
        t = rng.uniform(0.0, 2.0, 100)
        hidden = lines.hidden(q, t)
        assert hidden == [lines.hidden(q[[k]], t[[k]])[0] for k in range(100)]
        assert lines.hidden(q[:0], t[:0]) == []
        with monkeypatch.context() as patch:
            patch.setattr("vsconstraints.simulation.occluders.SLACK", 1e9)
            assert hidden == lines.hidden(q, t)
        assert 20 < sum(map(bool, hidden)) < 80


def test_a_dh_arm_has_no_links_to_hide_behind() -> None:
    assert LinesOfSight(Scenario.load("case-study-6r").setup().scene).bodies == ()
