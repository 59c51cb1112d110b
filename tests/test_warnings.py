"""What is wrong with a scenario is said before its runs, by preview and compare alike, and stands
in the report.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from vsconstraints.cli import app
from vsconstraints.comparisons import StoredComparison, Suite, suite
from vsconstraints.comparisons.suite import DEFAULT
from vsconstraints.controllers import SlidingMode
from vsconstraints.errors import ConfigurationError
from vsconstraints.reports.summary import obstacles
from vsconstraints.robots.geometry import Pose
from vsconstraints.scenarios import Scenario, shipped_scenarios
from vsconstraints.simulation import Setup, simulate
from vsconstraints.simulation.start import UNSOLVABLE
from vsconstraints.view.notebooks import Comparison
from vsconstraints.view.preview import Preview
from vsconstraints.vision.scene import interaction_matrix

AFAR = {"camera_pose": {"xyz": [2.0, 0.0, 0.5], "rpy": [3.14, 0.0, 0.0]}}
OUT_OF_RANGE = {"camera_at_q": [0.664, -1.778, 1.729, -1.729, -1.935, 6.5]}
NO_SQUARE = {"markers_px": [[-300, -100], [-300, 100], [-100, 100], [-100, -270]]}
BY_IMAGE = {"feature": "image-points", "Kp0": 9.0, "goals": [NO_SQUARE]}
OUT_OF_REACH = (
    "goal: no configuration within the joints' ranges was found that reaches it: it "
    "may be out of reach"
)


def changed(name: str, changes: dict[str, Any]) -> Scenario:
    scenario = Scenario.load(name)
    for key, value in changes.items():
        scenario = scenario.with_override(key, value)
    return scenario


def warnings_of(*scenarios: Scenario) -> dict[str, list[str]]:
    return Suite.load(DEFAULT).changed(scenarios=scenarios).warnings()


# --- compare says what preview says ---


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"task.goals": [AFAR]}, OUT_OF_REACH),
        ({"task.goals": [AFAR]}, "goal: fov[marker 1] is violated"),
        (
            {"task.goals": [OUT_OF_RANGE]},
            "goal: joint 6 (wrist_3_joint) is at 6.5, 0.217 rad outside",
        ),
        (
            {"task": BY_IMAGE},
            "goal: no camera pose was found from which the markers appear at these pixels",
        ),
        ({"constraints.0.margin": 0.3}, "goal: fov[marker 3] is violated: "),
        ({"constraints.0.switching_gain": 5e4}, "moves φ by 100 times the whole allowed range"),
    ],
)
def test_comparisons_say_what_previews_say(changes: dict[str, Any], words: str) -> None:
    scenario = changed("ur5-fov", changes)
    own = warnings_of(scenario)["ur5-fov"]
    preview = Preview.of_scenario(scenario)
    assert any(text.startswith(words) or words in text for text in own)
    # what preview says of the start is said by the runs' own check in other words
    said = [text for text in preview.warnings if not text.startswith("start: ")]
    assert set(said) <= set(own)
    for problem in preview.moments[0].problems:
        label = problem.split(" ")[0]
        assert any(text.startswith(label) or problem in text for text in own), problem
    assert len(own) == len(set(own))


def test_shipped_scenarios_raise_no_warning() -> None:
    """But those in which the concave side of an obstacle closes off the goal, which no law can
    solve.
    """
    found = warnings_of(*map(Scenario.load, shipped_scenarios()))
    assert all(UNSOLVABLE in text for own in found.values() for text in own)
    assert set(found) <= {"example-2d-bowl", "example-2d-heart-concave"}


def test_what_cannot_start_is_said_and_raises_nothing() -> None:
    found = warnings_of(changed("ur5-fov", {"q0": [0.0, -90.0, 90.0, -90.0, -90.0, 0.0]}))
    assert len(found["ur5-fov"]) == 1
    assert found["ur5-fov"][0].startswith("no run would start: ")
    assert "are these degrees, not rad?" in found["ur5-fov"][0]


def test_warnings_of_a_start_remain_if_goals_cannot_be_checked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fails(setup: Setup) -> list[str]:
        raise ValueError("not here")

    monkeypatch.setattr(suite, "problems_at_goals", fails)
    found = warnings_of(changed("ur5-fov", {"constraints.0.switching_gain": 5e4}))["ur5-fov"]
    assert "moves φ by 100 times the whole allowed range" in found[0]
    assert re.fullmatch("goals cannot be checked: .*not here.*", found[-1])


def test_questions_about_units_make_no_scenario_impossible() -> None:
    at_goals = ["goal: fov[marker 1] is violated", "goal 2 is forbidden by fov[marker 1]"]
    others = [
        "goal 1 has 90 of joint 2: are these degrees, not rad?",
        "goal 1 has the markers 300 m from the camera: is that in mm, not m?",
        "goals cannot be checked: ValueError: not here",
    ]
    results: Any = SimpleNamespace(stored=SimpleNamespace(warnings={"one": at_goals + others}))
    assert obstacles(results, "one") == at_goals


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder of a comparison of a scenario that can be solved and of one that cannot, and what
    was printed.
    """
    folder = tmp_path_factory.mktemp("compared")
    for name, goals in {
        "afar": AFAR,
        "near": {"camera_at_q": Scenario.load("ur5-fov").tables["q0"]},
    }.items():
        tables = f"xyz = {AFAR['camera_pose']['xyz']}, rpy = {AFAR['camera_pose']['rpy']}"
        goal = (
            f"camera_pose = {{ {tables} }}"
            if goals is AFAR
            else f"camera_at_q = {goals['camera_at_q']}"
        )
        text = f'extends = "ur5-fov"\nduration = 0.5\n[[task.goals]]\n{goal}\n'
        (folder / f"{name}.toml").write_text(text)
    words = [
        "compare",
        "--controller",
        "sliding-mode",
        "--out",
        str(folder / "out"),
        "--no-figures",
        "--jobs",
        "1",
    ]
    for name in ("afar", "near"):
        words += ["--scenario", str(folder / f"{name}.toml")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    return folder / "out", done.output


def section(report: str, name: str) -> list[str]:
    """The lines of a scenario's section, without its heading and empty ones."""
    part = re.split(r"^##+ ", report, flags=re.MULTILINE)
    own = next(each for each in part if each.startswith(f'<a id="scenario-{name}"></a>'))
    return [line for line in own.splitlines()[1:] if line]


def test_what_was_warned_of_stands_in_manifest_and_report(compared: tuple[Path, str]) -> None:
    folder, printed = compared
    warnings = json.loads((folder / "manifest.json").read_text())["warnings"]
    assert set(warnings) == {"afar"}
    assert OUT_OF_REACH in warnings["afar"]
    report = (folder / "report.md").read_text()
    lines = " ".join(printed.split())
    for text in warnings["afar"]:
        assert f"afar: {text}" in lines or f"afar: {text[:60]}" in lines
        assert text.replace("[", "\\[").replace("]", "\\]") in report
    assert (
        f"**Warnings** of scenarios (listed in their sections): [afar](#scenario-afar) "
        f"({len(warnings['afar'])})." in report
    )
    near = [line for line in section(report, "near") if "Warnings" in line or "impossible" in line]
    assert near == []


def test_an_impossible_scenario_says_so_in_its_first_line(compared: tuple[Path, str]) -> None:
    report = (compared[0] / "report.md").read_text()
    first = section(report, "afar")[0]
    assert first.startswith(f"**Solved by no controller, and perhaps impossible**: {OUT_OF_REACH}")
    assert "Solved by no controller: [afar](#scenario-afar) (it may be impossible)." in report


def test_sessions_read_the_warnings_back(compared: tuple[Path, str]) -> None:
    assert f"afar: {OUT_OF_REACH}" in Comparison.load(compared[0]).notes


@pytest.mark.parametrize("wrong", [[], {"afar": "text"}, {"afar": [1]}])
def test_other_warnings_in_a_manifest_are_refused(
    compared: tuple[Path, str], tmp_path: Path, wrong: object
) -> None:
    for name in ("manifest.json", "results.csv", "constraints.csv"):
        (tmp_path / name).write_bytes((compared[0] / name).read_bytes())
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    (tmp_path / "manifest.json").write_text(json.dumps({**manifest, "warnings": wrong}))
    with pytest.raises(ConfigurationError, match="warnings"):
        StoredComparison.load(tmp_path)


def test_what_is_proved_to_be_impossible_says_so(tmp_path: Path) -> None:
    words = [
        "compare",
        "--scenario",
        "example-2d-bowl",
        "--controller",
        "sliding-mode",
        "--out",
        str(tmp_path),
    ]
    done = CliRunner().invoke(
        app, [*words, "--no-figures", "--jobs", "1", "--set", "scenario.duration=0.1"]
    )
    assert done.exit_code == 0, done.output
    first = section((tmp_path / "report.md").read_text(), "example-2d-bowl")[0]
    assert first.startswith(
        "**Solved by no controller, and impossible**: marker 1 starts in a part of the image"
    )


# --- images that do not determine the camera's pose ---

POINTS = {
    "one marker": ([[0.0, 0.0, 0.0]], 2),
    "coincident markers": ([[0.0, 0.0, 0.0]] * 4, 2),
    "two markers": ([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]], 4),
    "markers on a line": ([[0.1 * k, 0.05 * k, 0.0] for k in range(4)], 5),
    "three markers": ([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]], 6),
    "four markers": ([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.1, 0.1, 0.0]], 6),
}


def with_markers(markers: list[list[float]], **more: Any) -> list[str]:
    at = np.array([0.5, 0.0, 0.0])
    placed = [(at + marker).tolist() for marker in np.array(markers)]
    scenario = changed("ur5-image", {"target": {"markers": placed}, "constraints": [], **more})
    q = [0.1, -1.6, 1.5, -1.5, -1.6, 0.2]
    task = {
        "feature": "image-points",
        "Kp0": 9.0,
        "goals": [{"camera_at_q": q}],
        **more.get("task", {}),
    }
    return scenario.with_override("task", task).setup().doubts


@pytest.mark.parametrize(("markers", "rank"), POINTS.values(), ids=POINTS)
def test_what_the_image_does_not_determine_is_said(markers: list[list[float]], rank: int) -> None:
    doubts = with_markers(markers)
    # the rank by the interaction matrix alone, seen from a general pose half a metre away
    camera = Pose.from_xyz_rpy((0.03, -0.02, 0.5), (np.pi - 0.2, 0.1, 0.3))
    P = camera.inverse.act(np.array(markers, dtype=np.float64))
    L = interaction_matrix(P[:, :2] / P[:, 2:], P[:, 2]).reshape(-1, 6)
    assert np.linalg.matrix_rank(L, rtol=1e-6) == rank
    if rank < 6:
        assert len(doubts) == 1
        assert f"determines {rank} of the 6 directions in which the camera moves" in doubts[0]
        assert "at least four markers that are not on a line" in doubts[0]
    elif len(markers) == 3:
        assert "up to four poses of the camera show three markers at the same pixels" in doubts[0]
    else:
        assert doubts == []


def test_tasks_of_the_pose_are_concerned_if_it_is_estimated_from_images() -> None:
    pose = {"task": {"feature": "camera-pose"}}
    one = POINTS["one marker"][0]
    assert with_markers(one, **pose) == []
    noisy = with_markers(one, **pose, disturbances={"pixel_noise": 0.1})
    assert "the image of one marker determines 2 of the 6 directions" in noisy[0]


def test_arms_that_move_less_need_fewer_markers() -> None:
    """Two markers determine where a camera in a plane is, as in the first example."""
    task = {
        "feature": "image-points",
        "Kp0": 20.0,
        "goals": [{"camera_at_q": [-0.72, -1.744, 4.2]}],
    }
    scenario = changed("example-2d-fov", {"task": task})
    assert scenario.setup().doubts == []
    one = scenario.with_override("target.markers", [[-0.24613, -1.24385, -1.0]]).setup().doubts
    assert "the image of one marker determines 2 of the 3 directions" in one[0]


# --- what a description says ---


def test_the_fast_example_leaves_its_band_and_stays_inside() -> None:
    """The numbers of its description, by the motion."""
    scenario = Scenario.load("example-2d-fast")
    run = simulate(scenario.setup(), SlidingMode())
    positive = "".join("+" if phi >= 0.0 else "-" for phi in run.phi[:, 1])
    assert max(map(len, positive.split("-"))) == 14
    assert run.sigma.max() < 0.0
    least = np.minimum(run.clearance, run.between_clearance).min()
    assert round(float(least), 1) == 1.1
    weak = simulate(
        scenario.with_override("constraints.0.switching_gain", 5.0).setup(), SlidingMode()
    )
    assert round(float(-weak.clearance.min()), 1) == 2.9
    for words in ("14 samples", "1.1 px", "gain of 5", "2.9 px"):
        assert words in " ".join(scenario.description.split())
