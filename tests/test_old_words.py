"""Old words of files and of Python arguments are still read, with a note that names the new one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vsconstraints import Camera
from vsconstraints.constraints import Curve, ForbiddenSphere, Hyperellipse, link_points
from vsconstraints.errors import ConfigurationError
from vsconstraints.robots import ur5
from vsconstraints.robots.kinematics import RobotPoint
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, Tolerances
from vsconstraints.vision.tracking import TrackingGains

CHANGED = """extends = "example-2d-fov"
[task]
Kp_slope0 = 33.0
"""


def test_old_keys_of_files_are_read_with_a_note(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(CHANGED)
    with pytest.warns(FutureWarning, match="own.toml.task: the key Kp_slope0 is now called Kp_slope"):
        scenario = Scenario.load(path)
    gains = scenario.setup().task.gains
    assert (gains.Kp_slope, gains.damping) == (33.0, 3.0)
    with pytest.warns(FutureWarning, match="Kv_over_sqrt_Kp is now called damping"):
        again = scenario.with_override("task.Kv_over_sqrt_Kp", 4.0)
    assert again.setup().task.gains.damping == 4.0
    stored = Scenario("stored", {**scenario.tables, "task": {**scenario.tables["task"], "Kp_slope0": 7.0}}, tmp_path)
    del stored.tables["task"]["Kp_slope"]
    with pytest.warns(FutureWarning, match=r"stored\.task: the key Kp_slope0"):
        assert stored.setup().task.gains.Kp_slope == 7.0


def test_old_arguments_are_taken_with_a_note() -> None:
    with pytest.warns(DeprecationWarning, match="TrackingGains: the argument slope is now called Kp_slope"):
        assert TrackingGains(3.0, slope=2.0) == TrackingGains(3.0, Kp_slope=2.0)  # type: ignore[call-arg]
    with pytest.warns(DeprecationWarning, match="Camera: the argument focal is now called focal_px"):
        assert Camera(focal=(500.0, 500.0), size_px=(640, 480)).focal_px == (500.0, 500.0)  # type: ignore[call-arg]
    with pytest.warns(DeprecationWarning, match="dwell_s"):
        assert Tolerances(dwell=0.5) == Tolerances(dwell_s=0.5)  # type: ignore[call-arg]
    points = [RobotPoint("forearm_link")]
    with pytest.warns(DeprecationWarning, match="ForbiddenSphere: the argument robot_points is now called points"):
        sphere = ForbiddenSphere(centre=[0, 0, 0], radius=0.1, K=0.1, switching_gain=1.0, robot_points=points)  # type: ignore[call-arg]
    assert sphere.points == tuple(points)
    with pytest.warns(DeprecationWarning, match="link_points: the argument radius is now called link_radius"):
        assert link_points(ur5(), radius=0.05) == link_points(ur5(), link_radius=0.05)  # type: ignore[call-arg]
    with pytest.warns(DeprecationWarning, match="Curve: the argument centre is now called centre_px"):
        Curve(Hyperellipse(3.0, 4.0), centre=(1.0, 2.0))  # type: ignore[call-arg]


def test_values_from_python_may_be_those_of_numpy() -> None:
    scenario = Scenario.load("example-2d-fov")
    changed = scenario.with_override("duration", np.float64(1.5)).with_override("q0", np.array(scenario.tables["q0"]))
    setup = changed.with_override("task.Kp0", np.float32(2.0)).setup()
    assert (setup.duration, setup.task.gains.Kp0, setup.q0.tolist()) == (1.5, 2.0, scenario.tables["q0"])
    with pytest.raises(ConfigurationError, match=r"camera must be a table, not 2\.0"):
        scenario.with_override("camera", np.float64(2.0)).setup()


def test_old_switches_of_a_setup_become_the_words_of_files() -> None:
    now = Scenario.load("example-2d-fov").setup()
    parts = now.scene, now.constraints, now.task, now.q0, now.qd0
    with pytest.warns(DeprecationWarning, match="abort_on_rank_loss is now called on_rank_loss"):
        then = Setup(*parts, 0.01, 1.0, abort_on_rank_loss=False)  # type: ignore[call-arg]
    assert (then.sampling_time, then.on_rank_loss, then.on_hidden_markers) == (0.01, "continue", "refuse")
