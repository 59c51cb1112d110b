"""Replays: what is shown when, where it stands, and what is refused."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.path import Path as Outline
from PIL import Image
from typer.testing import CliRunner

from vsconstraints import Robot
from vsconstraints.cli import app
from vsconstraints.comparisons import RunRecord, Suite, compare
from vsconstraints.comparisons.record import run_file
from vsconstraints.comparisons.runs.files import SUMS
from vsconstraints.constraints.meshes import Mesh
from vsconstraints.controllers import SlidingMode, Tracking
from vsconstraints.errors import ConfigurationError
from vsconstraints.reports import write_report
from vsconstraints.reports.plots.image import Plane
from vsconstraints.reports.plots.style import rgb
from vsconstraints.robots import ready_made
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate
from vsconstraints.view.arm import JOINT, bars_of, visuals
from vsconstraints.view.replay import (
    ReplayRun,
    film,
    page,
    replay_html,
    write_film,
    write_replay,
)
from vsconstraints.view.replay.page import image_data
from vsconstraints.view.replay.runs import (
    ACTIVE,
    HIGHLIGHTS,
    INACTIVE,
    MAX_FRAMES,
    VIOLATED,
    Frames,
    highlights_of,
    select_run,
    states,
    things_of,
)
from vsconstraints.view.replay.section import replayed_runs
from vsconstraints.view.replay.space import (
    INSET,
    MAX_TRIANGLES,
    Nodes,
    coarse,
    common_viewpoint,
    frames_of,
    inset,
    scene_of,
    standpoint,
)
from vsconstraints.view.scene3d import Part

FOV = "example-2d-fov"


def made(name: str, *laws: Any, duration: float | None = None) -> list[ReplayRun]:
    scenario = Scenario.load(name)
    if duration is not None:
        scenario = scenario.with_override("duration", duration)
    setup = scenario.setup()
    return [ReplayRun(law.name, setup, simulate(setup, law), scenario.title) for law in laws]


@pytest.fixture(scope="module")
def two() -> list[ReplayRun]:
    """Tracking leaves the field of view, sliding mode does not."""
    return made(FOV, Tracking(), SlidingMode())


@cache
def short() -> ReplayRun:
    return made(FOV, SlidingMode(), duration=0.1)[0]


def stretched(run: ReplayRun, samples: int, active: list[int]) -> ReplayRun:
    """A run with more samples, in which the first row acts at some of them and nothing is
    outside.
    """
    old = run.trajectory
    at = np.linspace(0, len(run.trajectory.t) - 1, samples).astype(int)
    acts = np.zeros((samples, len(old.labels)), dtype=np.bool_)
    acts[active, 0] = True
    per_sample = {
        name: getattr(old, name)[at]
        for name in (
            "q",
            "qd",
            "feature_error_px",
            "features_px",
            "points",
            "camera_error",
            "phi",
            "sigma",
        )
    }
    inside = np.ones_like(per_sample["phi"])
    clear: dict[str, Any] = {"clearance": inside, "between_clearance": inside, "active": acts}
    return replace(run, trajectory=replace(old, t=1e-3 * np.arange(samples), **per_sample, **clear))


# --- time ---


def test_a_hundred_thousand_samples_are_thinned_and_no_lamp_is_lost(two: list[ReplayRun]) -> None:
    run = stretched(two[1], 100_000, [54_321, 99_999])
    frames = Frames.of([run])
    assert len(frames.t) == MAX_FRAMES
    assert frames.remark([run]).startswith(f"{MAX_FRAMES} of 100000 samples are shown")
    # the last frame is the end, and 54.321 s is between frames 162 and 163 of 299 in 99.999 s
    assert frames.t[-1] == pytest.approx(99.999)
    assert np.flatnonzero(frames.states(run)[:, 0]).tolist() == [162, 299]


@given(st.integers(2, 400), st.lists(st.integers(0, 399), max_size=5), st.integers(2, 60))
def test_a_lamp_is_lit_from_the_sample_that_is_shown_to_the_next(
    samples: int, active: list[int], most: int
) -> None:
    run = stretched(short(), samples, [k for k in active if k < samples])
    frames = Frames.of([run], 1e3, most)
    first = [max(k for k, t in enumerate(run.trajectory.t) if t <= at + 1e-9) for at in frames.t]
    until = [max(a + 1, b) for a, b in zip(first, [*first[1:], samples], strict=True)]
    expected = [ACTIVE * any(a <= k < b for k in active) for a, b in zip(first, until, strict=True)]
    assert first[-1] == samples - 1
    assert frames.states(run)[:, 0].tolist() == expected


def test_a_run_that_is_over_stands_still_and_lights_nothing(two: list[ReplayRun]) -> None:
    long = two[1]
    short = stretched(two[0], 100, [99])
    frames = Frames.of([short, long])
    first = int(np.flatnonzero(frames.t > 0.099)[0])
    assert (frames.samples(short)[first:] == 99).all()
    # what its last sample says is seen, and then no more
    assert frames.states(short)[first, 0] == ACTIVE
    assert frames.states(short)[first + 1 :].max() == INACTIVE
    assert frames.t[-1] >= long.trajectory.t[-1] > frames.t[-1] - frames.period


def test_highlighted_are_what_a_run_says(two: list[ReplayRun]) -> None:
    tracking, sliding = two
    of_tracking = states(tracking)
    of_sliding = states(sliding)
    deep = tracking.trajectory.clearance < -1.0  # px
    assert deep.any()
    assert (of_tracking[deep] == VIOLATED).all()
    assert (of_tracking[tracking.trajectory.clearance > 0.5] != VIOLATED).all()
    assert of_sliding.max() == ACTIVE
    assert np.array_equal(of_sliding == ACTIVE, sliding.trajectory.active)


# --- image ---


def test_the_grey_area_is_what_is_forbidden(two: list[ReplayRun]) -> None:
    data = image_data(two, Frames.of(two))
    plane = Plane.of(two[0].setup)
    rng = np.random.default_rng(0)
    points = rng.uniform(-plane.half, plane.half, (2000, 2))
    rings = [Outline(ring) for ring in data["forbidden"]]
    grey = np.sum([ring.contains_points(points) for ring in rings], axis=0) % 2 == 1
    sigma = np.max([constraint.sigma(points) for constraint in plane.constraints], axis=0)
    moved = [
        np.max([c.sigma(points + d) for c in plane.constraints], axis=0)
        for d in ((3, 0), (-3, 0), (0, 3), (0, -3))
    ]
    near = np.any([(sigma > 0.0) != (other > 0.0) for other in moved], axis=0)
    assert 0.1 < grey.mean() < 0.9
    assert np.array_equal(grey[~near], sigma[~near] > 0.0)


def test_markers_are_where_the_run_has_them(two: list[ReplayRun]) -> None:
    frames = Frames.of(two)
    data = json.loads(json.dumps(image_data(two, frames)))
    for run, told in zip(two, data["runs"], strict=True):
        at = np.array([int(np.flatnonzero(run.trajectory.t <= t + 1e-9)[-1]) for t in frames.t])
        truth = run.trajectory.features_px[at].reshape(len(at), -1)
        assert np.abs(np.array(told["pixels"]) - truth).max() < 0.051
        assert {row["label"] for row in told["rows"]} <= set(run.trajectory.labels)
        assert told["quiet"] + told["more"] + len(told["rows"]) == len(run.trajectory.labels)
    assert "2" in data["runs"][0]["markers"][1], "tracking takes marker 2 out of the image"
    assert "2" not in "".join(data["runs"][1]["markers"])


def test_rows_light_what_they_are_about() -> None:
    setup = Scenario.load("case-study-6r").setup()
    things = dict(zip(setup.constraints.labels, things_of(_still(setup)), strict=True))
    spheres = [k for k, one in enumerate(setup.constraints.constraints) if one.kind == "sphere"]
    assert things["fov[marker 3]"] == ("marker", 3)
    assert things["range[joint 6].upper"] == ("joint", 6)
    assert things["speed[joint 2].upper"] == ("joint", 2)
    assert things["sphere[tip]"] == ("obstacle", spheres[0])


def test_what_runs_share_is_lit_by_any_of_them(two: list[ReplayRun]) -> None:
    frames = Frames.of(two)
    highlighted = {key.thing: states for key, states in highlights_of(two, frames).items()}
    either = np.maximum(
        *(frames.states(run)[:, run.trajectory.labels.index("fov[marker 2]")] for run in two)
    )
    assert np.array_equal(highlighted["marker", 2], either)


# --- space ---


class Stage:
    """Takes the place of viser's scene: the nodes, with where they were put and their points."""

    def __init__(self) -> None:
        self.nodes: dict[str, Any] = {}

    def add_frame(self, name: str, **look: Any) -> Any:
        return self.add_mesh_simple(name, np.empty((0, 3)), np.empty((0, 3)), **look)

    def add_mesh_simple(self, name: str, points: Any, triangles: Any, **look: Any) -> Any:
        node = type(
            "Node",
            (),
            {"position": np.zeros(3), "wxyz": np.array([1.0, 0.0, 0.0, 0.0]), "scale": (1, 1, 1)},
        )()
        node.points = points
        self.nodes[name] = node
        return node

    def points(self, name: str) -> Any:
        """Points of a node in the base frame."""
        node = self.nodes[name]
        frame = self.nodes[name.rpartition("/")[0]]
        points = np.asarray(node.points) * np.asarray(node.scale)
        w = frame.wxyz[0]
        v = np.asarray(frame.wxyz[1:])
        # v' = v + 2 w (q × v) + 2 q × (q × v)
        turned = np.cross(v, points)
        return points + 2.0 * w * turned + 2.0 * np.cross(v, turned) + np.asarray(frame.position)


@pytest.mark.parametrize("name", ["case-study-6r", "ur5-fov", "example-2d-fov", "free-camera"])
def test_every_node_is_where_the_robot_has_it(name: str) -> None:
    setup = Scenario.load(name).setup()
    robot = setup.scene.robot
    stage = Stage()
    still: Any = ReplayRun("any", setup, None)  # type: ignore[arg-type]
    nodes = Nodes(stage)
    for part in scene_of([still], 1.0)[0].parts:
        nodes.add(part)
    axes = Mesh(
        np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]]), np.array([[0, 1, 2]])
    )
    nodes.add(Part(axes, "#000000", "0 tip"))
    tip = [*stage.nodes][-1]
    rng = np.random.default_rng(1)
    for _ in range(3):
        q = rng.uniform(-1.0, 1.0, robot.n)
        nodes.place(frames_of([still], [q], 0.0))
        assert np.abs(stage.points(tip) - robot.pose(q).act(axes.points)).max() < 1e-3
        if robot.source is None and not any(robot.prismatic):
            for i, bar in enumerate(bars_of(robot, q), start=1):
                seen = np.concatenate(
                    [stage.points(one) for one in stage.nodes if one.startswith(f"/0 joint {i}/")]
                )
                # the link covers its bar, and no more than its drum around it
                assert (bar.min(0) > seen.min(0) - 1e-3).all()
                assert (bar.max(0) < seen.max(0) + 1e-3).all()
                assert (seen.min(0) > bar.min(0) - 0.07).all()
        for i, slides in enumerate(robot.prismatic, start=1):
            if slides:
                (rail,) = (name for name in stage.nodes if name.startswith(f"/0 slide {i}/"))
                end = stage.points(rail)
                joint = frames_of([still], [q], 0.0)[f"0 joint {i}"].pose.t
                assert np.linalg.norm(end - joint, axis=1).min() < 0.005


@given(st.booleans(), st.booleans(), st.floats(1e-4, 0.05))
def test_a_surface_is_moved_inwards(flipped: bool, split: bool, depth: float) -> None:
    """A cube of 0.2 m, with its faces turned in or out, and with points of its own for every face
    or not.
    """
    box = trimesh.creation.box((0.2, 0.2, 0.2))
    points = np.array(box.vertices)
    triangles = np.array(box.faces)
    if split:
        points = points[triangles].reshape(-1, 3)
        triangles = np.arange(36).reshape(12, 3)
    mesh = Mesh(points, triangles[:, ::-1] if flipped else triangles)
    moved = inset(mesh, depth).points
    corners = 0.1 * np.sign(moved)
    assert np.linalg.norm(moved - corners, axis=1) == pytest.approx(depth, abs=1e-9)
    assert (np.abs(moved) < 0.1).all()
    assert inset(mesh, 0.0) is mesh


def test_arms_in_one_place_have_no_surface_in_common() -> None:
    """Else they flicker into each other: every point of the second one is within the first."""
    for outer in coarse(
        [part.mesh for part in visuals(Scenario.load("ur5-fov").setup().scene.robot, 1.0)[0]]
    ):
        first = inset(outer, 1e-12)
        second = inset(outer, INSET)
        away = second.points - first.points
        # what has no inside, as two faces back to back, stays; rounded to a quarter of a millimetre
        # the others differ
        assert np.mean(np.abs(np.linalg.norm(away, axis=1) - INSET) < 1e-5) > 0.9
        assert INSET > 4.0 / 4096.0
        assert np.einsum("vi,vi->", away, first.points - first.points.mean(axis=0)) < 0.0


def test_meshes_are_those_of_the_robot_made_coarser() -> None:
    parts, remark = visuals(ready_made("ur5"), 1.0)
    links = coarse([part.mesh for part in parts])
    assert remark == ""
    assert 0.3 * MAX_TRIANGLES < sum(len(mesh.triangles) for mesh in links) <= MAX_TRIANGLES
    # the upper arm of a UR5 is 0.425 m from axis to axis
    assert 0.425 < np.ptp(links[2].points, axis=0).max() < 0.6


def test_a_missing_mesh_makes_bars_and_is_named(tmp_path: Path) -> None:
    urdf = tmp_path / "arm.urdf"
    links = "".join(f'<link name="{name}">{{}}</link>' for name in "ab")
    joint = (
        '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>'
    )

    def write(geometry: str) -> tuple[list[Part], str]:
        own = f"<visual><geometry>{geometry}</geometry></visual>"
        urdf.write_text(f'<robot name="r">{links.format("", own)}{joint}</robot>')
        return visuals(Robot.from_urdf(urdf), 1.0)

    parts, remark = write('<mesh filename="gone.dae"/>')
    assert "gone.dae" in remark
    assert "Bars" in remark
    assert JOINT in {part.colour for part in parts}
    (part,), remark = write('<box size="0.2 0.4 0.6"/>')
    assert remark == ""
    assert part.frame == "joint 1"
    assert np.ptp(part.mesh.points, axis=0) == pytest.approx([0.2, 0.4, 0.6])


# --- the page ---


def test_a_page_is_one_small_file_with_all_that_was_said(
    two: list[ReplayRun], tmp_path: Path
) -> None:
    remarks = write_replay(two, tmp_path / "new" / "page.html", title="Tom & <Jerry>")
    text = (tmp_path / "new" / "page.html").read_text()
    assert len(text.encode()) < 4e6
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["page.html"]
    assert "Tom &amp; &lt;Jerry&gt;" in text
    assert all(remark in text for remark in remarks)
    assert any("no meshes" in remark for remark in remarks)
    # what it loads is in it
    own = re.sub(
        r'<script type="application/json" id="viewer">.*?</script>', "", text, flags=re.DOTALL
    )
    assert not re.search(r"""(src|href)=(?!"data:)|url\(|@import|https?://""", own)


def test_why_a_run_ended_early_is_said(tmp_path: Path) -> None:
    ended = replace(short().trajectory, status="failed", reason="t = 0.1 s: on <purpose>")
    remarks = write_replay([replace(short(), trajectory=ended)], tmp_path / "page.html")
    assert remarks[0] == "sliding-mode: failed, t = 0.1 s: on <purpose>."
    assert (
        "sliding-mode: failed, t = 0.1 s: on &lt;purpose&gt;."
        in (tmp_path / "page.html").read_text()
    )


def require_in_view(runs: list[ReplayRun]) -> None:
    """An eye of 0.7 rad that stands where the page says sees arm and target at every sample, in a
    window 0.72 wide.
    """
    view = common_viewpoint(runs)
    eye = standpoint(runs, view)
    ahead = (view.centre - eye) / np.linalg.norm(view.centre - eye)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    for run in runs:
        scene = run.setup.scene
        for t, q in zip(run.trajectory.t, run.trajectory.q, strict=True):
            there = (
                np.concatenate(
                    [[scene.robot.pose(q).t], *bars_of(scene.robot, q), scene.markers_at(q, t)]
                )
                - eye
            )
            depth = there @ ahead
            assert (depth > 0.0).all()
            assert (np.abs(there @ right) < 0.72 * np.tan(0.35) * depth).all()
            assert (np.abs(there @ np.cross(right, ahead)) < np.tan(0.35) * depth).all()


def test_the_picture_for_browsers_without_webgl_is_whole(two: list[ReplayRun]) -> None:
    """A UR5 is wider than axes in space are, and nothing of it is at the picture's edge."""
    setup = Scenario.load("ur5-fov").setup()
    q = np.stack((setup.q0, setup.q0))
    still = replace(two[0].trajectory, t=np.array([0.0, 0.1]), q=q, qd=np.zeros_like(q))
    with Image.open(BytesIO(page.picture_of([ReplayRun("any", setup, still)]))) as picture:
        drawn = (np.asarray(picture.convert("L")) < 250).any(axis=0)
    first, last = np.flatnonzero(drawn)[[0, -1]]
    width, height = picture.size
    assert 5 < first < last < width - 5
    assert last - first > height


@pytest.mark.parametrize("name", ["eye-to-hand-pbvs", "moving-sphere"])
def test_everything_in_space_can_be_lit_for_two_runs(name: str, two: list[ReplayRun]) -> None:
    """What a robot carries, and what moves: all rows of both runs act, one after the other."""
    setup = Scenario.load(name).setup()
    count = 12
    m = len(setup.constraints.labels)
    none = np.zeros(count)
    q = np.linspace(setup.q0, setup.q0 + 0.05, count)
    seen = [setup.scene.glance(each) for each in q]
    wide = np.ones((count, m))
    made_up = replace(
        two[0].trajectory,
        t=0.1 * np.arange(count),
        q=q,
        qd=np.zeros_like(q),
        features_px=np.array([pixels for pixels, _ in seen]),
        points=np.array([points for _, points in seen]),
        camera_error=np.zeros((count, 2)),
        feature_error_px=none,
        labels=setup.constraints.labels,
        phi=-wide,
        sigma=-wide,
        clearance=wide,
        between_clearance=wide,
        active=np.arange(count)[:, None] % 12 == np.arange(m) % 12,
    )
    runs = [ReplayRun(law, setup, made_up) for law in ("one", "other")]
    highlighted = highlights_of(runs, Frames.of(runs))
    require_in_view(runs)
    carried = setup.scene.camera.fixed is not None
    of_markers = {key.run for key in highlighted if key.thing.kind == "marker"}
    assert of_markers == ({0, 1} if carried else {0})
    assert {key.run for key in highlighted if key.thing.kind == "obstacle"} <= {0}
    assert any(key.thing.kind == "joint" for key in highlighted)
    assert "<html" in replay_html(runs)


# --- films ---


def test_a_film_shows_image_and_arm(
    two: list[ReplayRun], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import imageio_ffmpeg

    monkeypatch.setattr(film, "MAX_TIME", 0.4)
    write_film(two[:1], tmp_path / "film.gif")
    with Image.open(tmp_path / "film.gif") as gif:
        assert (gif.size[0], gif.n_frames) == (800, 4)
        gif.seek(3)
        last = np.asarray(gif.convert("RGB")).astype(int)
    # in the left half, the last frame has its markers at the end of the run: grey, the colour of
    # tracking
    pixels = two[0].trajectory.features_px[-1]
    plane = Plane.of(two[0].setup)
    left = 10
    width = 385
    tall = width * plane.half[1] / plane.half[0]
    for u, v in pixels:
        x = left + width * (0.5 + 0.5 * u / plane.half[0])
        y = 70 + tall * (0.5 + 0.5 * v / plane.half[1])
        around = last[int(y) - 3 : int(y) + 4, int(x) - 3 : int(x) + 4].reshape(-1, 3)
        assert np.abs(around - np.array([0x8A, 0x8A, 0x8A])).max(axis=1).min() < 16
    write_film(two, tmp_path / "film.mp4")
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "film.mp4"))
    assert count == 4 + 12
    assert seconds == pytest.approx(16 / 12, abs=0.1)


@pytest.mark.parametrize("moment", [0, 3, 9])
def test_a_gif_keeps_a_colour_that_is_seen_for_a_moment(moment: int, tmp_path: Path) -> None:
    """The colour of a violation in one of ten frames, among hundreds of other colours: no more than
    8 of 255 off.
    """
    height = 120
    width = 160
    red, green = np.meshgrid(np.linspace(0, 255, width), np.linspace(0, 255, height))
    ground = np.stack([red, green, 255 - red], axis=-1).astype(np.uint8)
    frames = [ground.copy() for _ in range(10)]
    violation = np.array(rgb(HIGHLIGHTS[VIOLATED]), dtype=np.uint8)
    frames[moment][40:50, 60:70] = violation
    for k, frame in enumerate(frames):
        frame[100, k] = 255  # frames that are alike would become one
    film.write_pictures(frames, tmp_path / "film.gif", rate=10.0)
    with Image.open(tmp_path / "film.gif") as gif:
        gif.seek(moment)
        shown = np.asarray(gif.convert("RGB")).astype(int)[41:49, 61:69]
    assert np.abs(shown - violation).max() <= 8


# --- runs by their names, and what is refused ---


def test_a_stored_run_is_found_again(tmp_path: Path) -> None:
    suite = Suite.load().select([FOV], ["sliding-mode"], settings=["scenario.duration=0.1"])
    compare(suite, tmp_path, workers=1)
    file = run_file(tmp_path, FOV, "sliding-mode", 0)
    run = select_run(str(file))
    now = select_run(f"{FOV}:sliding-mode")
    assert run.law == now.law == "sliding-mode"
    assert run.title == now.title == Scenario.load(FOV).title
    assert np.array_equal(run.trajectory.q, now.trajectory.q[: len(run.trajectory.t)])
    with pytest.raises(
        ConfigurationError, match=r"unknown trajectory .*tracking--1.*Did you mean .*tracking--0"
    ):
        select_run(str(run_file(tmp_path, FOV, "tracking", 1)))
    assert (
        CliRunner().invoke(app, ["report", str(tmp_path), "--no-figures", "--replays"]).exit_code
        == 0
    )
    text = (tmp_path / "report.md").read_text()
    assert f"[Replay in a browser](replays/{FOV}.html): `tracking`." in text
    assert "tracking</title>" in (tmp_path / "replays" / f"{FOV}.html").read_text()
    (tmp_path / SUMS).unlink()  # which would tell that anything was changed
    record = RunRecord.failed("the law divides by zero", "")
    record.save(file)
    with pytest.raises(
        ConfigurationError, match=r"sliding-mode left no trajectory .*: the law divides by zero"
    ):
        replay_html([select_run(str(file))])
    file.write_bytes(b"PK")
    with pytest.raises(ConfigurationError, match="cannot be read"):
        select_run(str(file))
    run_file(tmp_path, FOV, "tracking", 0).unlink()
    text = write_report(tmp_path, figures=False, replays=True).read_text()
    assert "Its replay could not be made" in text
    assert "tracking--0.npz cannot be read: it is missing, damaged, or of another version" in text


def test_the_most_telling_runs_are_the_deepest_outside_and_the_best_inside() -> None:
    nan = np.nan

    def chosen(*laws: tuple[str, str, float, float]) -> tuple[str, ...]:
        """Of laws with status, depth and utilization."""
        lines = {
            law: {
                "trial": 0,
                "status": status,
                "duration_s": nan if status == "failed" else 5.0,
                "violation_depth": depth,
                "violated": "fov[marker 1]" if depth > 0.0 else "",
                "utilization": utilization,
            }
            for law, status, depth, utilization in laws
        }
        names = tuple(lines)
        results: Any = type("Results", (), {"controllers": names, "competitors": names[1:]})()
        results.runs = lambda scenario, law: [lines[law]]
        return replayed_runs(results, "any")

    tracking = ("tracking", "converged", 0.5, 0.9)
    inside = ("a", "converged", 0.0, 0.8)
    better = ("b", "converged", 0.0, 0.9)
    little = ("c", "converged", 0.1, 1.0)
    much = ("d", "trapped", 0.2, nan)
    assert chosen(tracking, inside, better) == ("tracking", "b")
    assert chosen(tracking, inside, better, little, much) == ("d", "b")
    assert chosen(tracking, little, much) == ("d",)
    assert chosen(tracking, ("e", "failed", nan, nan)) == ("tracking",)
    assert chosen(("tracking", "failed", nan, nan), ("e", "failed", nan, nan)) == ()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["example-2d-fov"], "is not a run: give SCENARIO:CONTROLLER"),
        (["example-2d-fog:tracking"], "Did you mean 'example-2d-fov'"),
        (["example-2d-fov:trackin"], "Did you mean 'tracking'"),
        (["example-2d-fov:tracking:first"], "a trial is a number from 0 on, not 'first'"),
        (["some.npz"], "not the trajectory of a comparison"),
        ([f"{FOV}:tracking"] * 2, "two of the runs have the name 'tracking'"),
        ([f"{FOV}:tracking"] * 5, "1 to 4 runs, not 5"),
        ([f"{FOV}:tracking", "example-2d-bowl:sliding-mode"], "different scenes"),
        ([f"{FOV}:tracking", "--gif", "film.avi"], "ends in .gif or .mp4"),
        ([f"{FOV}:tracking", "--out", "film.gif"], "must end in .html, not be 'film.gif'"),
    ],
)
def test_what_cannot_be_shown_is_refused(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["replay", *words])
    assert result.exit_code != 0
    assert isinstance(result.exception, ConfigurationError)
    assert said in str(result.exception)
    assert list(tmp_path.iterdir()) == []


def _still(setup: Any) -> ReplayRun:
    return ReplayRun("none", setup, simulate(replace(setup, duration=2 * setup.Ts), Tracking()))
