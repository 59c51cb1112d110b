"""Previews: where things are by hand and by other code, what is warned of, and that everything can
be drawn.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner, Result

from test_line_of_sight import swing
from vsconstraints.cli import app
from vsconstraints.control import ControlStep
from vsconstraints.reports.plots.image import Plane
from vsconstraints.robots import ready_made
from vsconstraints.robots.geometry import distance
from vsconstraints.scenarios import Scenario, shipped_scenarios
from vsconstraints.view.arm import bars_of
from vsconstraints.view.preview import FIGURE, Preview, lines
from vsconstraints.view.setup_scene import (
    IN_VIEW,
    obstacle_meshes,
    points_in_view,
    setup_frames,
    view_corners,
    viewpoint_of,
)

UR5 = "ur5-fov"


def seen(name: str, **changes: Any) -> Preview:
    scenario = Scenario.load(name)
    for key, value in changes.items():
        scenario = scenario.with_override(key.replace("__", "."), value)
    return Preview.of_scenario(scenario)


def say(*words: str) -> Result:
    return CliRunner().invoke(app, ["preview", *words])


def assert_in_picture(preview: Preview, aspect: float) -> None:
    """Everything that a view is fitted to is seen in it, from where matplotlib looks with those
    angles.
    """
    instants = [(moment.q, moment.t) for moment in preview.moments if moment.q is not None]
    view = viewpoint_of(preview.setup, instants, aspect)
    e, a = np.deg2rad([view.elevation, view.azimuth])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    up = np.array([-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)])
    away = np.concatenate([points_in_view(preview.setup, q, t) for q, t in instants]) - view.centre
    across = np.abs(away @ right).max()
    height = np.abs(away @ up).max()
    assert across < view.half * IN_VIEW * aspect
    assert height < view.half * IN_VIEW
    # and it is not lost there
    assert max(across / aspect, height) > 0.8 * view.half * IN_VIEW


# --- every scenario ---


@pytest.mark.parametrize("name", shipped_scenarios())
def test_every_scenario_can_be_previewed(name: str) -> None:
    preview = seen(name)
    setup = preview.setup
    assert (preview.warnings, preview.refusal) == (tuple(setup.separated), "")
    assert len(preview.moments) == 1 + len(setup.task.goals)
    for moment, goal in zip(preview.moments[1:], setup.task.goals, strict=True):
        assert moment.q is not None
        np.testing.assert_allclose(moment.pixels, goal.pixels, atol=1e-4)
        if goal.camera is not None:
            assert max(distance(setup.scene.camera_pose(moment.q, moment.t), goal.camera)) < 1e-6
    # the start as the control step sees it
    step = ControlStep(setup.scene, setup.constraints, setup.task, known=True)
    start = step.evaluate(0.0, setup.q0, setup.qd0)
    np.testing.assert_allclose(preview.moments[0].phi, start.rows.phi, rtol=1e-7, atol=1e-9)
    rows = {row.label: row for row in preview.rows}
    assert set(setup.constraints.labels) <= set(rows)
    assert [row.greatest for row in preview.rows] == sorted(
        (row.greatest for row in preview.rows), reverse=True
    )
    assert_in_picture(preview, 1.3)
    text = list(lines(preview))
    assert all(any(row.label in line for line in text) for row in preview.near)


# --- by hand ---

SLIDER = """
sampling_time = 0.01
duration = 1.0
q0 = [0.3, 0.2]
qd0 = [0.5, 0.0]
camera = {{ focal_px = [100, 100], size_px = [200, 160] }}
target = {{ markers = [[0.0, 0.0, 2.0], [0.5, 0.4, 2.0]] }}
task = {{ feature = "{feature}", Kp0 = 4.0, goals = [{goals}] }}
{more}
[robot]
dh = [[0.0, 0.0, 0.0, 1.5707963267948966], [0.0, 0.0, 0.0, -1.5707963267948966]]
prismatic = [1, 2]
q_min = [-1.0, -2.0]
q_max = [1.0, 0.5]
"""
"""A camera that looks along z, its first joint along z, its second along −y."""

RANGE = '[[constraints]]\ntype = "joint-range"\njoints = [1]\nK = 0.2\nswitching_gain = 1.0'


def slider(folder: Path, goals: str, more: str = "", feature: str = "camera-pose") -> Preview:
    (folder / "slider.toml").write_text(SLIDER.format(goals=goals, more=more, feature=feature))
    return Preview.of_scenario(Scenario.load(folder / "slider.toml"))


def test_pixels_and_rows_by_hand(tmp_path: Path) -> None:
    preview = slider(tmp_path, "{ camera_at_q = [0.0, -0.3] }", RANGE)
    start, goal = preview.moments
    # the camera is at (0, −q₂, q₁): u = F x / (2 − q₁), v = F (y + q₂) / (2 − q₁)
    np.testing.assert_allclose(start.pixels, np.array([[0.0, 20.0], [50.0, 60.0]]) / 1.7, atol=1e-9)
    np.testing.assert_allclose(goal.pixels, [[0.0, -15.0], [25.0, 5.0]], atol=1e-9)
    rows = {row.label: row for row in preview.rows}
    upper = rows["range[joint 1].upper"]
    lower = rows["range[joint 1].lower"]
    np.testing.assert_allclose(upper.clearance, [0.7, 1.0])
    np.testing.assert_allclose(lower.clearance, [1.3, 1.0])
    # σ = q₁ − 1, σ̇ = 0.5 at the start
    np.testing.assert_allclose(upper.phi, [-0.7 + 0.2 * 0.5, -1.0])
    np.testing.assert_allclose(upper.usage, [0.3, 0.0], atol=1e-12)
    assert upper.text(0) == "0.7 m (−0.6)"
    own = rows["limit[joint 2].upper"]
    np.testing.assert_allclose(own.clearance, [0.3, 0.8])
    np.testing.assert_allclose(own.usage, [1.0 - 0.3 / 1.25, 1.0 - 0.8 / 1.25])
    assert own.limit
    assert own.text(0) == "0.3 m"
    assert "limit[joint 1].upper" not in rows
    assert preview.rows[0].label == "limit[joint 2].upper"


def test_bars_follow_the_axes() -> None:
    """The elbow of the case study's second bar: along joint 2's axis nothing, then 0.27 m."""
    arm = ready_made("viper-s650")
    bars = bars_of(arm, np.zeros(6))
    np.testing.assert_allclose(bars[0], [[0, 0, 0], [0, 0, 0.335], [0.075, 0, 0.335]], atol=1e-12)
    np.testing.assert_allclose(bars[1], [[0.075, 0, 0.335], [0.345, 0, 0.335]], atol=1e-12)


def test_the_edge_of_a_sensor_behind_a_lens_is_bent() -> None:
    """Through the lens, the outline that is drawn is the rectangle of the image."""
    changed = Scenario.load(UR5).with_override(
        "camera.distortion", {"model": "brown-conrady", "coefficients": [-0.25, 0.08, 0.001, 0.002]}
    )
    setup = changed.setup()
    plane = Plane.of(setup)
    camera = setup.scene.camera
    assert plane.outline is not None
    np.testing.assert_array_equal(plane.outline[0], plane.outline[-1])
    edge = np.abs(camera.distort(plane.outline)) / (0.5 * np.asarray(camera.size))
    np.testing.assert_allclose(edge.max(axis=1), 1.0, atol=1e-6)
    assert np.abs(plane.outline[:, 0]).max() > 1.05 * 320.0
    assert (np.abs(plane.outline) < plane.half).all()
    # what is seen in space ends there too
    moment = Preview.of_scenario(changed).moments[0]
    assert moment.q is not None
    pose = setup_frames(setup, moment.q, moment.t)["camera"].pose
    P = pose.inverse.act(view_corners(setup, pose, moment.q, moment.t))
    corners = camera.distort(camera.pixels(P[:, :2] / P[:, 2:]))
    np.testing.assert_allclose(np.abs(corners), [[320.0, 240.0]] * 4, atol=1e-3)


# --- goals ---


@pytest.mark.parametrize(
    ("given", "missed"),
    [("camera_pose", False), ("exactly", False), ("rounded", False), ("inexact", True)],
)
def test_goals_given_by_pose_or_image_get_a_configuration(given: str, missed: bool) -> None:
    goal = Scenario.load(UR5).setup().task.goals[0]
    assert goal.camera is not None
    image = {
        "exactly": goal.pixels,
        "rounded": goal.pixels.round(),
        "inexact": goal.pixels + np.array([[25.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]),
    }
    pose = {"xyz": goal.camera.t.tolist(), "rpy": _rpy(goal.camera.R)}
    table = (
        {"camera_pose": pose} if given == "camera_pose" else {"markers_px": image[given].tolist()}
    )
    preview = seen(
        UR5,
        task={
            "feature": "camera-pose" if given == "camera_pose" else "image-points",
            "Kp0": 20.0,
            "goals": [table],
        },
    )
    moment = preview.moments[1]
    assert moment.q is not None
    away = np.abs(moment.pixels - goal.pixels).max()
    assert away < {"camera_pose": 1e-4, "exactly": 1e-3, "rounded": 1.0, "inexact": 25.0}[given]
    assert (
        any(
            "no camera pose shows the markers at exactly these pixels" in warning
            for warning in preview.warnings
        )
        == missed
    )


def _rpy(R: np.ndarray) -> list[float]:
    return [
        float(np.arctan2(R[2, 1], R[2, 2])),
        float(np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))),
        float(np.arctan2(R[1, 0], R[0, 0])),
    ]


def test_a_goal_moves_with_its_target() -> None:
    preview = seen("moving-target")
    setup = preview.setup
    goal = preview.moments[1]
    assert setup.scene.motion is not None
    assert goal.q is not None
    assert goal.t == pytest.approx(setup.duration)
    moved = setup.scene.motion.pose(goal.t)
    assert np.abs(moved.t).max() > 0.01
    # the camera stands to the moved target as it shall to the target
    camera = setup.scene.robot.pose(goal.q) @ setup.scene.camera.mount.inverse
    wanted = setup.task.goals[0].camera
    assert wanted is not None
    np.testing.assert_allclose(camera.t, moved.R @ wanted.t + moved.t, atol=1e-7)


# --- warnings ---

POSE_AFAR = {"camera_pose": {"xyz": [2.0, 0.0, 0.5], "rpy": [3.14, 0.0, 0.0]}}
BEHIND = {"camera_at_q": [0.1, -1.771, 1.732, 0.6, -1.591, -3.057]}
NO_SQUARE = {"markers_px": [[-300, -100], [-300, 100], [-100, 100], [-100, -270]]}
IMAGE_AT_EDGE = {"feature": "image-points", "Kp0": 9.0, "goals": [NO_SQUARE]}


@pytest.mark.parametrize(
    ("changes", "words", "refused"),
    [
        ({"q0": [0.664, -7.0, 1.729, -1.729, -1.935, -0.151]}, "start: joint 2 "
                                                               "(shoulder_lift_joint) is at "
                                                               "-7", True),
        ({"q0": [0.664, -1.778, 1.729, 0.6, -1.935, -0.151]}, "start: marker 1 is behind the "
                                                              "camera", True),
        ({"q0": [0.664, -1.2, 1.2, -1.729, -1.935, -0.151]}, "start: marker 1 is outside the "
                                                             "image", True),
        ({"constraints.0.margin": 0.3}, "start: fov[marker 2] is violated", False),
        ({"constraints.0.margin": 0.3}, "goal: fov[marker 3] is violated", False),
        ({"task__goals": [POSE_AFAR]}, "goal: no configuration within the joints' ranges was "
                                       "found", False),
        ({"task__goals": [POSE_AFAR]}, "goal: fov[marker 1] is violated", False),
        ({"task__goals": [BEHIND]}, "goal: marker 4 is behind the camera", True),
        ({"task__goals": [BEHIND]}, "no run would start: ur5-fov.task.goals[0]: at the goal, not "
                                    "in front", True),
        ({"task": IMAGE_AT_EDGE}, "goal: no camera pose was found", False),
        ({"task__goals": [{}]}, "goal: the robot's configuration there is unknown", True),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(changes: dict[str, Any], words: str, refused: bool) -> None:
    preview = seen(UR5, **changes)
    assert any(warning.startswith(words) for warning in preview.warnings), preview.warnings
    assert bool(preview.refusal) == refused
    assert refused == any(warning.startswith("no run would start") for warning in preview.warnings)


def test_a_link_in_the_line_of_sight_is_named(tmp_path: Path) -> None:
    preview = Preview.of_scenario(swing(tmp_path, q0=[-np.pi / 2, 0.0]))
    assert "start: marker 1 is hidden by the robot's own flag" in preview.warnings
    assert "the robot itself hides markers" in preview.refusal


def test_a_robot_without_ranges_and_a_scene_without_rows(tmp_path: Path) -> None:
    preview = seen("free-camera", constraints=[])
    assert preview.rows == ()
    assert list(lines(preview))[-1] == "  no rows and no joint limits"


OBSTACLES = {
    "forbidden-sphere": (
        {"centre": [0.5, 0.1, 0.2], "radius": 0.1},
        [[0.4, 0.0, 0.1], [0.6, 0.2, 0.3]],
    ),
    "forbidden-box": (
        {"centre": [0.5, 0.0, 0.2], "size": [0.2, 0.4, 0.6]},
        [[0.4, -0.2, -0.1], [0.6, 0.2, 0.5]],
    ),
    "forbidden-capsule": (
        {"start": [0.5, -0.3, 0.2], "end": [0.5, 0.3, 0.2], "radius": 0.1},
        [[0.4, -0.4, 0.1], [0.6, 0.4, 0.3]],
    ),
    "forbidden-cylinder": (
        {"start": [0.5, -0.3, 0.2], "end": [0.5, 0.3, 0.2], "radius": 0.1},
        [[0.4, -0.3, 0.1], [0.6, 0.3, 0.3]],
    ),
    "forbidden-half-space": (
        {"point": [0.0, 0.0, -0.5], "normal": [0.0, 0.0, 1.0]},
        [[-0.8, -0.8, -0.5], [0.8, 0.8, -0.5]],
    ),
    "box": (
        {"size": [0.2, 0.4, 0.6], "xyz": [0.5, 0.0, 0.2]},
        [[0.4, -0.2, -0.1], [0.6, 0.2, 0.5]],
    ),
    "sphere": ({"radius": 0.1, "xyz": [0.5, 0.1, 0.2]}, [[0.4, 0.0, 0.1], [0.6, 0.2, 0.3]]),
    "capsule": (
        {"radius": 0.1, "length": 0.4, "xyz": [0.5, 0.1, 0.2]},
        [[0.4, 0.0, -0.1], [0.6, 0.2, 0.5]],
    ),
    "cylinder": (
        {"radius": 0.1, "length": 0.4, "xyz": [0.5, 0.1, 0.2]},
        [[0.4, 0.0, 0.0], [0.6, 0.2, 0.4]],
    ),
    "half-space": ({"xyz": [0.0, 0.0, -0.5]}, [[-0.8, -0.8, -0.5], [0.8, 0.8, -0.5]]),
}
"""What obstacles are, and the corners of the boxes around them, where a view shows 1 m on either
side.
"""


@pytest.mark.parametrize("name", OBSTACLES)
def test_obstacles_are_drawn_where_they_are(name: str) -> None:
    table, corners = OBSTACLES[name]
    gains = {"K": 0.1, "switching_gain": 1.0}
    if name.startswith("forbidden"):
        constraint = {"type": name, **table, **gains}
    else:
        constraint = {
            "type": "collision",
            "obstacle": {"shape": name, **table},
            "link_radius": 0.02,
            **gains,
        }
    setup = Scenario.load("case-study-6r").with_override("constraints", [constraint]).setup()
    (mesh,) = obstacle_meshes(setup, 1.0).values()
    points = mesh.points
    # round things are drawn with 16 to 20 sides, and a cylinder of coal is a prism that holds it
    np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], corners, atol=0.006)


# --- the command ---


def test_a_preview_is_drawn_where_it_is_wanted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = say("case-study-6r")
    assert done.exit_code == 0, done.output
    assert "* fov[marker 3]" in done.output
    assert "188 px (−1)" in done.output
    assert "Picture: preview-case-study-6r.png" in done.output
    with Image.open("preview-case-study-6r.png") as picture:
        assert picture.width == 1200
        assert 1100 < picture.height < 1800
    done = say("eye-to-hand-pbvs", "--out", "deep/down/hand.png")
    assert done.exit_code == 0, done.output
    assert Path("deep/down/hand.png").stat().st_size > 20_000


def test_what_cannot_run_is_drawn_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    goals = "\n".join(
        f"[[task.goals]]\nfrom_time = {k}\ncamera_at_q = {q}"
        for k, q in enumerate([BEHIND["camera_at_q"]] * 3)
    )
    Path("own.toml").write_text(
        f'extends = "ur5-fov"\n[task]\nfeature = "camera-pose"\nKp0 = 20.0\n{goals}\n'
    )
    done = say("own.toml")
    assert done.exit_code == 2
    assert "warning: goal 3: marker 2 is behind the camera" in done.output
    assert Path("preview-own.png").is_file()


def test_a_scene_of_a_family() -> None:
    done = say("--family", "planar-arm", "--scene", "2", "--no-figure", "--condition", "disturbed")
    assert done.exit_code == 0, done.output
    assert "planar-arm-2: planar 3R, 3 joints, 2 markers" in done.output
    assert "Picture" not in done.output


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((), "preview needs a scenario, or --family"),
        (("ur5-fov", "--family", "panda"), "preview needs a scenario, or --family"),
        (("ur5-fof",), "Did you mean 'ur5-fov'?"),
        (("nowhere.toml",), "nowhere.toml"),
        (("ur5-fov", "--out", "ur5.jpg"), "must end in .png"),
        (("--family", "pandas"), "Did you mean 'panda'?"),
        (("--family", "planar-arm", "--half", "left"), "unknown half"),
    ],
)
def test_what_cannot_be_previewed_is_refused(given: tuple[str, ...], words: str) -> None:
    done = say(*given)
    assert done.exit_code != 0
    assert words in str(done.exception)


# --- units ---


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"camera__focal_px": [4.2, 4.2]},
            "field of view is 178°: is the focal length 4.2 in mm, not px?",
        ),
        (
            {"sampling_time": 2.0},
            "sampled tracking is unstable: is the sampling time 2 in ms, not s?",
        ),
        (
            {"camera__size_px": [480, 640], "camera__principal_point_px": [322, 243]},
            "is the centre of 640 × 480 px, not of 480 × 640 px: are width and height swapped?",
        ),
        (
            {"camera__mount__xyz": [0.0, 0.0, 60.0]},
            "the camera is mounted 60 m from the arm's tip: ",
        ),
        (
            {"target__square__side": 120.0},
            "the target's markers are 120 m apart: are its coordinates in mm, not m?",
        ),
    ],
)
def test_numbers_in_other_units_are_doubted(changes: dict[str, Any], said: str) -> None:
    preview = seen("examples/my-arm.toml", **changes)
    assert [doubt for doubt in preview.warnings if said in doubt] == list(preview.doubts)
    assert len(preview.doubts) == 1


def test_a_run_that_can_start_in_doubtful_units_says_so() -> None:
    setup = Scenario.load("examples/my-arm.toml").with_override("sampling_time", 0.25).setup()
    assert "is the sampling time 0.25 in ms" in " ".join(setup.check_start())


@pytest.mark.parametrize("height", [3.0, 60.0])
def test_what_is_behind_the_camera_at_start_and_goal_is_drawn_all_the_same(
    height: float, tmp_path: Path
) -> None:
    scenario = Scenario.load("examples/my-arm.toml").with_override(
        "target.square.xyz", [0.62, 0.03, height]
    )
    preview = Preview.of_scenario(scenario)
    assert "marker 1 is behind the camera" in " ".join(preview.warnings)
    assert "no run would start" in preview.warnings[-1]
    FIGURE.write(tmp_path / "preview.png", preview)
    with Image.open(tmp_path / "preview.png") as picture:
        assert picture.size[0] > 500
