"""Recorded runs are scored as simulated ones, whatever file holds them; bad files are named."""

from __future__ import annotations

import csv
import subprocess
import sys
from collections.abc import Mapping
from copy import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from vsconstraints.cli import app
from vsconstraints.comparisons import RunRecord, score
from vsconstraints.comparisons.metrics import run_metrics
from vsconstraints.controllers import Controller, SlidingMode, Tracking
from vsconstraints.errors import ConfigurationError
from vsconstraints.plugins.classes import code_named, imported_class
from vsconstraints.robots.robot import Robot
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.score import (
    NAME_OF_LAW,
    Recorded,
    Recording,
    read_recording,
    recorded_trajectory,
)
from vsconstraints.score.plausible import sustained_speeds, time_questions
from vsconstraints.score.recording import names_in_file
from vsconstraints.simulation import Setup, Trajectory, simulate

ROOT = Path(__file__).parents[1]
OTHER = {"status", "reason", "compiled", *(m.column for m in run_metrics() if m.kind == "time")}
"""Columns that a file of joint states does not determine."""


@pytest.fixture(scope="module")
def setup() -> Setup:
    return Scenario.load("ur5-fov").with_override("duration", 1.2).setup()


@pytest.fixture(scope="module")
def run(setup: Setup) -> Trajectory:
    return simulate(setup, SlidingMode())


@pytest.fixture(scope="module")
def robot(setup: Setup) -> Robot:
    return setup.scene.robot


def write(path: Path, columns: Mapping[str, Any]) -> Path:
    """Write columns to a CSV file, every number as it is."""
    with path.open("w", newline="") as file:
        lines = csv.writer(file)
        lines.writerow(columns)
        lines.writerows(
            zip(*(np.asarray(values).tolist() for values in columns.values()), strict=True)
        )
    return path


def columns_of(run: Trajectory, names: tuple[str, ...], **what: Array) -> dict[str, Array]:
    """Return time and columns NAME.WHAT of arrays (N, n)."""
    return {"t": run.t} | {
        f"{name}.{which}": values[:, i]
        for which, values in what.items()
        for i, name in enumerate(names)
    }


def scores_of(setup: Setup, run: Trajectory, baseline: Trajectory) -> tuple[Any, Any]:
    found = score(RunRecord.of(setup, run, ""), RunRecord.of(setup, baseline, ""))
    return {k: v for k, v in found.result.items() if k not in OTHER}, found.constraints


@pytest.mark.parametrize("ending", ["npz", "csv", "parquet"])
def test_an_exported_run_has_the_scores_of_the_simulation(
    setup: Setup, run: Trajectory, robot: Robot, tmp_path: Path, ending: str
) -> None:
    file = tmp_path / f"run.{ending}"
    columns = columns_of(
        run, robot.joint_names, position=run.q, velocity=run.qd, command=run.qdd_command
    )
    if ending == "npz":
        np.savez(file, t=run.t, q=run.q, qd=run.qd, qdd_command=run.qdd_command)
    elif ending == "csv":
        write(file, dict(reversed(columns.items())))
    else:
        pandas = pytest.importorskip("pandas")
        pytest.importorskip("pyarrow")
        pandas.DataFrame(columns).to_parquet(file)
    again = recorded_trajectory(setup, read_recording(file, robot), "a file")
    baseline = simulate(setup, Tracking())
    np.testing.assert_equal(scores_of(setup, again, baseline), scores_of(setup, run, baseline))
    assert again.status == run.status
    assert again.reason.startswith("recorded in a file")
    assert "baseline" not in again.reason


def test_positions_alone_at_other_times_are_interpolated(
    setup: Setup, run: Trajectory, robot: Robot, tmp_path: Path
) -> None:
    """At uneven times, up to 5 ms apart, by an arm whose acceleration changes by up to 40 rad/s².

    A curve that misses such a change is wrong by 40 × 0.005²/8 = 1.25e-4 rad at most.
    """
    rng = np.random.default_rng(1)
    t = np.cumsum(rng.uniform(0.001, 0.005, 600))
    t = np.concatenate(([0.0], t[t < 1.2]))
    smooth = simulate(setup, Tracking())
    # exact inside a period of constant acceleration
    k = np.searchsorted(smooth.t, t + 1e-12, side="right") - 1
    s = (t - smooth.t[k])[:, None]
    q = smooth.q[k] + s * smooth.qd[k] + 0.5 * s * s * smooth.qdd_command[k]
    file = write(
        tmp_path / "run.csv",
        {"timestamp_ns": 1.7e18 + np.round(1e9 * t), **{f"q{i + 1}": q[:, i] for i in range(6)}},
    )
    found = recorded_trajectory(setup, read_recording(file, robot), "it")
    N = len(found.t)
    assert int(t[-1] / setup.Ts) + 1 == N
    np.testing.assert_allclose(found.q, smooth.q[:N], atol=1.25e-4)
    np.testing.assert_allclose(found.clearance, smooth.clearance[:N], rtol=0.02, atol=0.15)
    assert "accelerations are differences" in found.reason


def test_pixels_between_two_samples_are_interpolated_if_both_have_them() -> None:
    """Two markers at 0, 10 and 20 ms; the second one is not seen at 20 ms."""
    t = np.array([0.0, 0.01, 0.02])
    u = np.array([[0.0, 5.0], [10.0, 5.0], [30.0, np.nan]])
    pixels = np.stack((u, -u), axis=2)
    found = Recording(t, np.zeros((3, 6)), pixels=pixels).on_grid(0.005)
    expected = np.array([[0.0, 5.0], [5.0, 5.0], [10.0, 5.0], [20.0, np.nan], [30.0, np.nan]])
    np.testing.assert_allclose(found.pixels, np.stack((expected, -expected), axis=2), atol=1e-12)


def test_measured_pixels_count_instead_of_those_of_the_model(
    setup: Setup, run: Trajectory, robot: Robot, tmp_path: Path
) -> None:
    """All markers 3 px further to the right: at the right border 3 px less are left."""
    pixels = run.features_px + np.array([3.0, 0.0])
    pixels[5, 1] = np.nan
    file = tmp_path / "run.npz"
    np.savez(file, t=run.t, q=run.q, qd=run.qd, qdd_command=run.qdd_command, pixels=pixels)
    found = recorded_trajectory(setup, read_recording(file, robot, markers=4), "it")
    assert "deviate by up to 3" in found.reason
    of_image = [unit == "px" for unit in setup.constraints.units]
    expected = setup.clearance(
        run.t, run.q, run.qd, run.features_px + np.array([3.0, 0.0]), run.points
    )
    np.testing.assert_allclose(found.clearance[6:, of_image], expected[6:, of_image], atol=1e-9)
    assert np.isfinite(found.clearance).all()
    assert np.abs(found.clearance - run.clearance)[:, of_image].max() > 2.0
    assert (found.clearance == run.clearance)[:, np.invert(of_image)].all()


def test_a_marker_that_left_the_image_is_not_scored_where_it_was_last_seen(
    setup: Setup, run: Trajectory, robot: Robot, tmp_path: Path
) -> None:
    """Without pixels of a marker, its row has the clearance of the model there."""
    pixels = run.features_px.copy()
    pixels[100:, 0] = np.nan
    pixels[:, 1] = np.nan
    file = tmp_path / "run.npz"
    np.savez(file, t=run.t, q=run.q, qd=run.qd, qdd_command=run.qdd_command, pixels=pixels)
    found = recorded_trajectory(setup, read_recording(file, robot, markers=4), "it")
    np.testing.assert_allclose(found.clearance, run.clearance, atol=1e-9)
    assert f"replace {2 * len(run.t) - 100} of a marker that is not seen" in found.reason


def test_measured_pixels_are_those_of_the_lens(run: Trajectory) -> None:
    """The sensor has the pixels that OpenCV's model of the lens distorts."""
    lens = {"model": "brown-conrady", "coefficients": [-0.1, 0.02, 0.0, 0.0]}
    scenario = Scenario.load("ur5-fov").with_override("duration", 1.2)
    setup = scenario.with_override("camera.distortion", lens).setup()
    pixels = setup.scene.camera.distort(run.features_px)
    assert np.abs(pixels - run.features_px).max() > 4.0
    found = recorded_trajectory(setup, Recording(run.t, run.q, run.qd, pixels=pixels), "it")
    np.testing.assert_allclose(found.features_px, run.features_px, atol=1e-6)


def test_pixels_from_the_first_one_are_refused(setup: Setup, run: Trajectory) -> None:
    """Such pixels of OpenCV would be outside a field of view that no marker has left."""
    pixels = run.features_px + np.array([319.5, 239.5])
    with pytest.raises(ConfigurationError, match=r"it: .* subtract \(319\.5, 239\.5\) px"):
        recorded_trajectory(setup, Recording(run.t, run.q, run.qd, pixels=pixels), "it")


def test_measured_pixels_are_compared_with_the_goal_of_their_time(run: Trajectory) -> None:
    scenario = Scenario.load("ur5-image").with_override("duration", 1.2)
    first, second = ({"camera_at_q": run.q[k].tolist(), "from_time": run.t[k]} for k in (0, 300))
    scenario = scenario.with_override("sampling_time", 0.002)
    setup = scenario.with_override("task.goals", [first, second]).setup()
    recording = Recording(run.t, run.q, run.qd, pixels=run.features_px)
    found = recorded_trajectory(setup, recording, "it")
    for k, goal in ((0, 0), (299, 0), (300, 1), (600, 1)):
        wanted = setup.task.goals[goal].pixels
        expected = np.linalg.norm(run.features_px[k] - wanted, axis=1).max()
        assert found.feature_error_px[k] == pytest.approx(expected, abs=1e-9)


def test_measured_pixels_leave_the_error_of_a_feature(run: Trajectory, robot: Robot) -> None:
    """A line may be reached with its markers anywhere on it."""
    setup = Scenario.load("ur5-fov").with_override("duration", 0.02)
    setup = setup.with_override("task.feature", "line").setup()
    recording = Recording(run.t[:10], run.q[:10], run.qd[:10], pixels=run.features_px[:10])
    found = recorded_trajectory(setup, recording, "it")
    expected = max(setup.scene.camera.focal) * np.abs(found.error).max(axis=1)
    np.testing.assert_allclose(found.feature_error_px, expected)


# --- bags ---


def write_bag(
    path: Path, run: Trajectory, names: tuple[str, ...], storage: str, stamped: int = 1
) -> None:
    """Joint states in another order and with a gripper, and messages of the gripper alone.

    The stamps of their headers are those of the run times ``stamped``.
    """
    writer = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = store.types
    kind = "sensor_msgs/msg/JointState"
    order = [3, 1, 5, 0, 2, 4]
    none = np.empty(0)
    with writer.Writer(path, version=9, storage_plugin=writer.StoragePlugin[storage]) as bag:
        connection = bag.add_connection("/joint_states", kind, typestore=store)
        for k, t in enumerate(run.t):
            at = round(1e9 * (1.7e9 + t))
            sec, nanosec = divmod(stamped * at, 10**9)
            stamp = kinds["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
            header = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="")
            arm = ["finger", *(names[i] for i in order)]
            for joints, q, qd in (
                (arm, [0.0, *run.q[k, order]], [0.0, *run.qd[k, order]]),
                (["finger"], [0.0], [0.0]),
            ):
                message = kinds[kind](header, joints, np.array(q), np.array(qd), none)
                # recorded later and later, by 1 ms at first and 10 µs more per message
                logged = at + 1_000_000 + 10_000 * k
                bag.write(connection, logged, store.serialize_cdr(message, kind))


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_joint_states_of_bags_are_matched_by_name(
    run: Trajectory, robot: Robot, tmp_path: Path, storage: str
) -> None:
    bag = tmp_path / "bag"
    write_bag(bag, run, robot.joint_names, storage)
    for path in (bag, *bag.glob("*.mcap")):
        found = read_recording(path, robot)
        np.testing.assert_allclose(found.t, run.t, atol=1e-6)
        np.testing.assert_array_equal(found.q, run.q)
        np.testing.assert_array_equal(found.qd, run.qd)
        assert found.remarks == (f"{len(run.t)} samples without all joints are left out",)
    late = read_recording(bag, robot, clock="log")
    np.testing.assert_allclose(late.t, run.t + 1e-5 * np.arange(len(run.t)), atol=1e-6)
    with pytest.raises(
        ConfigurationError, match=r"no /arm of sensor_msgs/msg/JointState; .*states"
    ):
        read_recording(bag, robot, topic="/arm")
    with pytest.raises(
        ConfigurationError,
        match=r"no positions of turn, .*spin; .*in the bag finger, .*--joint turn=NAME",
    ):
        read_recording(bag, Robot.from_urdf(ROOT / "examples" / "six_axis.urdf", tip="tool"))


def test_joints_of_a_bag_may_have_other_names(
    run: Trajectory, robot: Robot, tmp_path: Path
) -> None:
    bag = tmp_path / "bag"
    there = tuple(f"arm/{joint}" for joint in robot.joint_names)
    write_bag(bag, run, there, "MCAP")
    first = robot.joint_names[0]
    with pytest.raises(
        ConfigurationError,
        match=f"joints of .* are {first}, .*in the bag .*--joint {first}=arm/{first}",
    ):
        read_recording(bag, robot)
    names = [f"{joint}=arm/{joint}" for joint in robot.joint_names]
    found = read_recording(bag, robot, names=names_in_file(robot, names))
    np.testing.assert_array_equal(found.q, run.q)
    np.testing.assert_array_equal(found.qd, run.qd)
    names[0] = f"{first}=typo"
    with pytest.raises(
        ConfigurationError,
        match=f"no positions of {first}=typo; .*joints of .* are {first}, .*--joint {first}=arm/",
    ):
        read_recording(bag, robot, names=names_in_file(robot, names))


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (["elbow_joint"], "--joint is JOINT=NAME.*not 'elbow_joint'"),
        (
            ["elbow_joint=wrist_1_joint"],
            "two joints of .* have the same name .*, wrist_1_joint: elbow_joint and wrist_1_joint$",
        ),
        (["elbow_joint=x", "elbow_joint=y"], "gives the joint elbow_joint two names, x and y"),
        (["turn=a"], "unknown joint of .*'turn'"),
    ],
)
def test_other_names_of_joints_are_checked(robot: Robot, texts: list[str], words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        names_in_file(robot, texts)


def test_a_bag_without_stamps_names_the_clock_of_recording(
    run: Trajectory, robot: Robot, tmp_path: Path
) -> None:
    bag = tmp_path / "bag"
    write_bag(bag, run, robot.joint_names, "MCAP", stamped=0)
    with pytest.raises(ConfigurationError, match=r"the same time: .*--clock log"):
        read_recording(bag, robot)
    assert len(read_recording(bag, robot, clock="log").t) == len(run.t)


def test_another_start_than_that_of_the_baseline_is_named(setup: Setup, run: Trajectory) -> None:
    recording = Recording(run.t[:10], run.q[:10] + 0.05, run.qd[:10])
    assert (
        "starts 0.05 rad or m from that of the baseline"
        in recorded_trajectory(setup, recording, "it").reason
    )


@pytest.mark.parametrize("degrees", [False, True])
def test_only_converted_positions_may_have_been_radians(
    setup: Setup, run: Trajectory, degrees: bool
) -> None:
    q = np.deg2rad(run.q[:10])
    recording = Recording(run.t[:10], q, np.deg2rad(run.qd[:10]))
    if degrees:
        with pytest.raises(ConfigurationError, match="rad before --degrees converted them"):
            recorded_trajectory(setup, recording, "it", degrees=True)
    else:
        reason = recorded_trajectory(setup, recording, "it").reason
        assert "rad or m from that of the baseline" in reason


# --- files that cannot be meant ---


def bad(run: Trajectory, **changes: Any) -> dict[str, Array]:
    return {"t": run.t, **{f"q{i + 1}": run.q[:, i] for i in range(6)}, **changes}


def jumping(t: Array, at: int, by: float) -> Array:
    return np.concatenate((t[:at], t[at:] + by))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda run: {"t": 1e3 * run.t}, "2 s apart: are the times in milliseconds or nanoseconds"),
        (lambda run: {"t": jumping(run.t, 300, -0.25)}, "backwards by 0.248 s after sample 300.*--start"),
        (lambda run: {"t": 0.0 * run.t}, r"all samples have the same time: .*--clock log"),
        (lambda run: {f"q{i + 1}": np.rad2deg(run.q[:, i]) for i in range(6)}, "degrees, not rad.*--degrees"),
        (lambda run: {f"qd{i + 1}": np.rad2deg(run.qd[:, i]) for i in range(6)}, "speeds are 57.3 times"),
        (lambda run: {f"qd{i + 1}": 30 / np.pi * run.qd[:, i] for i in range(6)}, "9.55 times.*per minute"),
        (lambda run: {f"qd{i + 1}": (-1) ** (i == 2) * run.qd[:, i] for i in range(6)}, "speeds of elbow_joint have the opposite"),
        (lambda run: {"t": np.concatenate(([0.0], 1.7e9 + run.t[1:]))}, "jump by 1.7e[+]09 s after sample 1.*--start"),
        (lambda run: {"q3": np.full(len(run.t), np.nan)}, "less than two samples with all joints"),
        (lambda run: {"u1": run.t, "v1": run.t}, "no columns u2, v2.*all 4 markers"),
    ],
)  # fmt: skip
def test_bad_files_are_named_with_the_remedy(
    run: Trajectory, robot: Robot, tmp_path: Path, change: Any, words: str
) -> None:
    file = write(tmp_path / "run.csv", bad(run, **change(run)))
    with pytest.raises(ConfigurationError, match=words):
        read_recording(file, robot, markers=4)


def test_remedies_work(run: Trajectory, robot: Robot, tmp_path: Path) -> None:
    degrees = {f"q{i + 1}": np.rad2deg(run.q[:, i]) for i in range(6)}
    file = write(tmp_path / "degrees.csv", bad(run, **degrees))
    np.testing.assert_allclose(read_recording(file, robot, degrees=True).q, run.q, atol=1e-12)
    back = write(tmp_path / "back.csv", bad(run, t=jumping(run.t, 300, -0.25)))
    found = read_recording(back, robot, part=(0.0, run.t[299]))
    np.testing.assert_array_equal(found.q, run.q[:299])


def test_degrees_are_those_of_joints_that_turn(tmp_path: Path) -> None:
    """Positions, speeds and commands alike; a joint that slides is in metres."""
    robot = Robot.from_dh(np.full((2, 4), 0.1), prismatic=[2])
    t = 0.01 * np.arange(100)
    q = np.column_stack((0.1 * t * t, 0.2 * t * t))
    scale = np.array([180.0 / np.pi, 1.0])
    columns = {"t": t}
    given = {
        "q": scale * q,
        "qd": scale * [0.2, 0.4] * t[:, None],
        "qdd": 0.0 * q + scale * [0.2, 0.4],
    }
    for name, values in given.items():
        columns |= {f"{name}{i + 1}": values[:, i] for i in (0, 1)}
    found = read_recording(write(tmp_path / "run.csv", columns), robot, degrees=True)
    assert found.qd is not None
    assert found.qdd is not None
    np.testing.assert_allclose(found.q, q, atol=1e-12)
    np.testing.assert_allclose(found.qd, t[:, None] * [0.2, 0.4], atol=1e-12)
    np.testing.assert_allclose(found.qdd, 0.0 * q + [0.2, 0.4], atol=1e-12)


def test_a_continuous_joint_may_be_reported_within_a_turn(tmp_path: Path) -> None:
    """A joint with a range is taken as it is reported: a jump of its encoder is no turn."""
    t = 0.01 * np.arange(200)
    angle = 3.0 + t
    within = np.where(angle > np.pi, angle - 2.0 * np.pi, angle)
    file = write(tmp_path / "run.csv", {"t": t, "q1": within})
    one = np.full((1, 4), 0.1)
    np.testing.assert_allclose(read_recording(file, Robot.from_dh(one)).q[:, 0], angle, atol=1e-12)
    bounded = Robot.from_dh(one, q_min=[-4.0], q_max=[4.0])
    np.testing.assert_array_equal(read_recording(file, bounded).q[:, 0], within)


def test_samples_without_a_time_are_left_out(run: Trajectory, robot: Robot, tmp_path: Path) -> None:
    t = run.t.copy()
    t[50] = np.nan
    found = read_recording(write(tmp_path / "run.csv", bad(run, t=t)), robot)
    np.testing.assert_array_equal(found.q, np.delete(run.q, 50, axis=0))
    assert found.remarks == ("1 samples without all joints are left out",)


def test_gaps_and_repeated_times_are_named(run: Trajectory, robot: Robot, tmp_path: Path) -> None:
    t = jumping(run.t, 200, 0.4)
    t[101] = t[100]
    found = read_recording(write(tmp_path / "run.csv", bad(run, t=t)), robot)
    assert found.remarks[0] == "1 samples repeat a time and are left out"
    assert "no sample for 0.402 s from t = 0.398 s on, a gap or a jump" in found.remarks[1]
    assert len(found.remarks) == 2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t,q1\n0.0,a\n", "line 2: 'a' is no number"),
        ("t,q1\n0.0\n", "line 2: 1 values for 2 columns"),
        ("q1,q2\n0.0,1.0\n", "no column of times.*q1, q2"),
        ("t,q1\n", "has no samples"),
        ("t,q1\n\n", "has no samples"),
        ("t;q1\n0,0;1,0\n", "semicolons between its columns"),
        ("t,q1,q1\n0.0,1.0,2.0\n", "columns 2 and 3 have the same name, q1"),
        ("t,t,q1\n0.0,1.0,2.0\n", "columns 1 and 2 have the same name, t: rename"),
        ("t,q1,,\n0.0,1.0,,,7.0\n", "line 2: 5 values for 4 columns"),
        ("", "no column of times.*none"),
    ],
)
def test_damaged_tables(text: str, words: str, robot: Robot, tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text(text)
    with pytest.raises(ConfigurationError, match=words):
        read_recording(tmp_path / "run.csv", robot)


def test_files_of_other_kinds(robot: Robot, tmp_path: Path) -> None:
    for name, words in (
        ("run.txt", r"ends in \.csv"),
        ("run.npz", "cannot read"),
        ("no.csv", "cannot"),
    ):
        (tmp_path / "run.npz").write_bytes(b"PK\x03\x04 damaged")
        with pytest.raises(ConfigurationError, match=words):
            read_recording(tmp_path / name, robot)


def test_columns_of_texts_are_ignored_unless_they_are_needed(
    run: Trajectory, robot: Robot, tmp_path: Path
) -> None:
    file = write(tmp_path / "run.csv", bad(run, mode=np.full(len(run.t), "servo"), finger=run.t))
    np.testing.assert_array_equal(read_recording(file, robot).q, run.q)
    for name in ("qd2", "v1", "q4"):
        texts = np.where(run.t < 0.5, "0.5", "off")
        given = {f"u{i}": run.t for i in range(1, 5)} | {f"v{i}": run.t for i in range(1, 5)}
        file = write(tmp_path / "run.csv", bad(run, **{**given, name: texts}))
        with pytest.raises(ConfigurationError, match=f"line 252: 'off' is no number.*{name}"):
            read_recording(file, robot, markers=4)


@pytest.mark.parametrize("end", [("", ""), (",,", ",,"), (",,", ""), ("", ",,"), (",", ",7")])
def test_columns_that_are_not_used_need_no_name_of_their_own(
    end: tuple[str, str], robot: Robot, tmp_path: Path
) -> None:
    """A spreadsheet ends lines with commas, and a table of pandas begins with an index."""
    motion = swaying(0.1)
    file = write(tmp_path / "run.csv", {**motion, "mode": motion["t"]})
    header, *lines = file.read_text().splitlines()
    text = [f",mode,{header}{end[0]}", *(f"{k},8,{line}{end[1]}" for k, line in enumerate(lines))]
    file.write_text("\n".join(text))
    np.testing.assert_array_equal(read_recording(file, robot).q[:, 5], motion["q6"])


def test_two_columns_of_the_same_name_in_parquet(robot: Robot, tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    file = tmp_path / "run.parquet"
    motion = swaying(0.1)
    arrays = [*motion.values(), motion["t"], motion["t"]]
    parquet.write_table(pyarrow.table(arrays, names=[*motion, "mode", "mode"]), file)
    np.testing.assert_array_equal(read_recording(file, robot).q[:, 5], motion["q6"])
    parquet.write_table(pyarrow.table(arrays, names=[*motion, "mode", "q2"]), file)
    with pytest.raises(ConfigurationError, match="columns 3 and 9 have the same name, q2"):
        read_recording(file, robot)


def test_texts_in_parquet_are_ignored_unless_they_are_needed(
    run: Trajectory, robot: Robot, tmp_path: Path
) -> None:
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    file = tmp_path / "run.parquet"
    table = pandas.DataFrame(bad(run))
    table.assign(mode="servo").to_parquet(file)
    np.testing.assert_array_equal(read_recording(file, robot).q, run.q)
    table.assign(q2="servo").to_parquet(file)
    with pytest.raises(ConfigurationError, match=r"values of type .*string.* in column q2"):
        read_recording(file, robot)


def test_speeds_of_some_joints_are_left_out_by_name(
    run: Trajectory, robot: Robot, tmp_path: Path
) -> None:
    speeds = {f"qd{i + 1}": run.qd[:, i] for i in range(6) if i != 2}
    found = read_recording(write(tmp_path / "run.csv", bad(run, **speeds)), robot)
    assert found.qd is None
    assert found.remarks == (
        "speeds of elbow_joint are missing: those of the other joints are left out",
    )


@pytest.mark.parametrize("unit", ["", "_ms", "_us", "_ns"])
def test_arrays_have_the_times_of_columns(
    run: Trajectory, robot: Robot, tmp_path: Path, unit: str
) -> None:
    scale = {"": 1.0, "_ms": 1e3, "_us": 1e6, "_ns": 1e9}[unit]
    np.savez(tmp_path / "run.npz", **{f"time{unit}": scale * run.t, "q": run.q})
    np.testing.assert_allclose(read_recording(tmp_path / "run.npz", robot).t, run.t, atol=1e-9)


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"q": np.zeros((3, 6))}, "no array of times: one of t, time"),
        ({"t": np.arange(3.0)}, "no array 'q'"),
        ({"t": np.float64(0.0), "q": np.zeros((3, 6))}, "t has the shape"),
        ({"t": np.arange(3.0), "q": np.zeros((3, 6)), "names": ["a", "b"]}, "6 columns for 2 joints"),
        ({"t": np.arange(3.0), "q": np.zeros((3, 6)), "qd": np.zeros((3, 5))}, "qd has 5 columns for 6"),
    ],
)  # fmt: skip
def test_arrays_that_do_not_fit_are_refused(
    arrays: Mapping[str, Any], words: str, robot: Robot, tmp_path: Path
) -> None:
    np.savez(tmp_path / "run.npz", **arrays)
    with pytest.raises(ConfigurationError, match=words):
        read_recording(tmp_path / "run.npz", robot)


# --- numbers in another unit that are within all limits ---


def swaying(amplitude: float, period: float = 0.01) -> dict[str, Array]:
    """Return 400 samples of six joints that sway about zero."""
    t = period * np.arange(400)
    q = amplitude * np.sin(2.0 * t)
    return {"t": t, **{f"q{i + 1}": (0.5 + 0.1 * i) * q for i in range(6)}}


def test_small_angles_in_degrees_are_named_by_their_speed(robot: Robot, tmp_path: Path) -> None:
    """A sway of 0.1 rad at 0.2 rad/s is 5.7° at 11.5°/s: within 2π, but not within 3.14 rad/s."""
    inside = read_recording(write(tmp_path / "run.csv", swaying(0.1)), robot)
    assert inside.remarks == ()
    degrees = write(tmp_path / "run.csv", swaying(np.rad2deg(0.1)))
    (remark,) = read_recording(degrees, robot).remarks
    assert "wrist_3_joint moves at 11." in remark
    assert "in degrees, which --degrees converts" in remark
    assert read_recording(degrees, robot, degrees=True).remarks == ()
    # one wrong sample of an encoder is not a wrong unit
    glitch = swaying(0.1)
    glitch["q2"][200] += 5.0
    assert read_recording(write(tmp_path / "run.csv", glitch), robot).remarks == ()


def test_small_angles_in_degrees_are_named_by_the_range(robot: Robot, tmp_path: Path) -> None:
    narrow = Robot.from_dh(
        np.full((3, 4), 0.1),
        q_min=[-1.0] * 3, q_max=[1.0] * 3,
    )  # fmt: skip
    still = {"t": swaying(0.0)["t"]} | {f"q{i}": np.full(400, 5.0) for i in (1, 2, 3)}
    (remark,) = read_recording(write(tmp_path / "run.csv", still), narrow).remarks
    assert "far beyond its range, at 5: are positions in degrees" in remark
    # a joint without ends has no middle
    open_ended = copy(narrow)
    open_ended.q_min = np.full(3, -np.inf)
    open_ended.q_max = np.full(3, np.inf)
    assert read_recording(write(tmp_path / "run.csv", still), open_ended).remarks == ()


def test_the_start_of_the_scenario_in_another_unit_is_refused(
    setup: Setup, run: Trajectory
) -> None:
    degrees = Recording(run.t, np.rad2deg(run.q), np.rad2deg(run.qd))
    with pytest.raises(
        ConfigurationError, match=r"rad from q0, .*degrees, not rad.* --degrees converts them"
    ):
        recorded_trajectory(setup, degrees, "it")
    twice = Recording(run.t, np.deg2rad(run.q), np.deg2rad(run.qd))
    with pytest.raises(ConfigurationError, match="before --degrees converted them"):
        recorded_trajectory(setup, twice, "it", degrees=True)


def test_milliseconds_of_a_fast_recording_are_named(robot: Robot, tmp_path: Path) -> None:
    """At 5 kHz, samples are 0.2 ms apart, which would be a period of 0.2 s."""
    motion = swaying(0.1, period=2e-4)
    as_seconds = {**motion, "t": 1e3 * motion["t"]}
    with pytest.raises(ConfigurationError, match=r"0\.2 s apart, and no joint .*milliseconds\?"):
        read_recording(write(tmp_path / "run.csv", as_seconds), robot)
    del as_seconds["t"]
    as_named = {**as_seconds, "t_ms": 1e3 * motion["t"]}
    found = read_recording(write(tmp_path / "run.csv", as_named), robot)
    np.testing.assert_allclose(found.t, motion["t"], atol=1e-12)
    assert found.remarks == ()


@pytest.mark.parametrize("period", [0.1, 0.5])
def test_a_slow_log_of_an_arm_at_rest_is_read(period: float, robot: Robot, tmp_path: Path) -> None:
    """Noise of 0.1 mrad at 10 Hz looks like 2 mrad/s, as a swift motion of 5 kHz in ms would."""
    t = period * np.arange(200)
    q = np.random.default_rng(2).normal(0.0, 1e-4, (200, 6))
    columns = {"t": t, **{f"q{i + 1}": q[:, i] for i in range(6)}}
    found = read_recording(write(tmp_path / "run.csv", columns), robot)
    np.testing.assert_array_equal(found.q, q)
    (remark,) = found.remarks
    assert "are the times in milliseconds? A column t_s" in remark


def test_a_slow_log_without_noise_of_an_arm_at_rest_is_not_questioned(
    robot: Robot, tmp_path: Path
) -> None:
    columns = {"t": 0.1 * np.arange(50), **{f"q{i + 1}": np.full(50, 0.3) for i in range(6)}}
    assert read_recording(write(tmp_path / "run.csv", columns), robot).remarks == ()


def test_milliseconds_are_only_likely_if_the_robot_can_be_that_fast(robot: Robot) -> None:
    """Joints of at most 1 rad/s: 2.9 mrad/s may be 2.9 rad/s in error, 3.1 mrad/s may not."""
    slow = copy(robot)
    slow.qd_max = np.ones(6)
    t = 0.1 * np.arange(400)
    for speed, is_likely in ((2.9e-3, True), (3.1e-3, False)):
        q = speed * t[:, None] * np.ones(6)
        speeds = sustained_speeds(t, q)
        np.testing.assert_allclose(speeds, speed, rtol=1e-9)
        questions = time_questions(Path("run.csv"), slow, t, q, speeds)
        if is_likely:
            with pytest.raises(ConfigurationError, match="milliseconds"):
                list(questions)
        else:
            (question,) = questions
            assert "milliseconds" in question


@pytest.mark.parametrize("name", ["t_s", "time_s", "timestamp_s"])
@pytest.mark.parametrize("period", [0.1, 2.0])
def test_times_in_a_stated_unit_are_not_questioned(
    name: str, period: float, robot: Robot, tmp_path: Path
) -> None:
    """An arm that creeps at 4 mrad/s: without the unit, the times are questioned."""
    motion = swaying(2e-3, period=period)
    with pytest.raises(ConfigurationError, match="are the times in milliseconds"):
        read_recording(write(tmp_path / "run.csv", motion), robot)
    motion[name] = motion.pop("t")
    assert read_recording(write(tmp_path / "run.csv", motion), robot).remarks == ()


# --- time of the scenario ---


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("target.motion", {"velocity": [0.05, 0.0, 0.0]}, "target has moved"),
        ("task.goals.0.reach_in", 1.0, "goal has changed"),
    ],
)
def test_a_part_of_a_recording_is_not_scored_at_another_time_of_the_scenario(
    run: Trajectory, robot: Robot, tmp_path: Path, key: str, value: Any, words: str
) -> None:
    """At --start 0.4 the target would be where the scenario has it at t = 0."""
    file = write(tmp_path / "run.csv", bad(run))
    scenario = Scenario.load("ur5-fov").with_override("duration", 1.2)
    moving = scenario.with_override(key, value).setup()
    late = read_recording(file, robot, part=(0.4, np.inf))
    assert late.begin == pytest.approx(0.4)
    with pytest.raises(
        ConfigurationError, match=rf"0\.4 s after t = 0 .*{words}.* add 0\.4 to --zero"
    ):
        recorded_trajectory(moving, late, "it")
    # nothing depends on time without a motion
    assert len(recorded_trajectory(scenario.setup(), late, "it").t) == 401
    found = recorded_trajectory(moving, late, "it", zero=0.4)
    np.testing.assert_allclose(found.q, run.q[200:], atol=1e-12)
    if key == "target.motion":
        # 0.02 m in the base frame since t = 0 of the scenario, which is at 0.4 s of the recording
        expected = moving.scene.evaluate(0.4, run.q[400], run.qd[400]).pixels.position
        np.testing.assert_allclose(found.features_px[200], expected, atol=1e-9)


CUSTOM = """
import numpy as np
from vsconstraints.constraints import ImageConstraint

class Band(ImageConstraint):
    kind = "band"

    def __init__(self, **settings):
        super().__init__(K=0.1, switching_gain=2.0, length=100.0)

    def sigma(self, y):
        return y[..., 0] / 400.0 - 1.0

    def gradient(self, y):
        return np.stack((np.full(y.shape[:-1], 1.0 / 400.0), np.zeros(y.shape[:-1])), axis=-1)

    def clearance(self, trace, points):
        return 400.0 - trace.pixels[..., 0]

class Closing(Band):
    \"\"\"The band narrows from 0.6 s on.\"\"\"

    kind = "closing"

    def rows(self, state, points):
        found = super().rows(state, points)
        narrower = 0.1 * max(0.0, state.t - 0.6)
        return found._replace(sigma=found.sigma + narrower, phi=found.phi + narrower)

class Reported(Band):
    \"\"\"Only its clearance depends on time.\"\"\"

    kind = "reported"

    def clearance(self, trace, points):
        return super().clearance(trace, points) - trace.t[:, None]

class Broken(Band):
    \"\"\"Its rows cannot be evaluated.\"\"\"

    kind = "broken"

    def rows(self, state, points):
        raise ValueError("no rows")

class Breaking(Band):
    \"\"\"Its rows cannot be evaluated from the eleventh sample on.\"\"\"

    kind = "breaking"

    def rows(self, state, points):
        if state.t % 0.8 > 0.019:
            raise ValueError("no rows")
        return super().rows(state, points)
"""


def resting(setup: Setup, **settings: Any) -> Recording:
    """Return 20 samples at the start of a scenario."""
    q = np.tile(setup.q0, (20, 1))
    return Recording(setup.Ts * np.arange(20), q, np.zeros_like(q), **settings)


def with_custom_constraint(name: str, folder: Path) -> Setup:
    (folder / "band.py").write_text(CUSTOM)
    tables = dict(Scenario.load("ur5-fov").tables)
    tables["constraints"] = [*tables["constraints"], {"type": f"band:{name}"}]
    return Scenario("own", tables, folder, trusted=True).setup()


@pytest.mark.parametrize(("name", "evaluated"), [("Broken", 0), ("Breaking", 10)])
def test_rows_that_cannot_be_evaluated_are_not_said_to_be_independent_of_time(
    name: str, evaluated: int, tmp_path: Path
) -> None:
    setup = with_custom_constraint(name, tmp_path)
    found = recorded_trajectory(setup, resting(setup, begin=0.8), "it")
    assert f"could be evaluated at {evaluated} of 20 samples" in found.reason
    assert "found not to depend on time" not in found.reason


@pytest.mark.parametrize("name", ["Band", "Closing", "Reported"])
def test_a_custom_constraint_that_depends_on_time_is_noticed_by_its_values(
    name: str, tmp_path: Path
) -> None:
    setup = with_custom_constraint(name, tmp_path)
    late = resting(setup, begin=0.8)
    if name == "Band":
        found = recorded_trajectory(setup, late, "it")
        assert "band, were found not to depend on time" in found.reason
    else:
        words = rf"0\.8 s after t = 0 .*rows {name.lower()}.marker 1., .* have changed"
        with pytest.raises(ConfigurationError, match=words):
            recorded_trajectory(setup, late, "it")
    assert len(recorded_trajectory(setup, late, "it", zero=0.8).t) == 20


def test_a_recording_that_begins_before_a_scenario_that_depends_on_time_is_refused() -> None:
    motion = {"velocity": [0.05, 0.0, 0.0]}
    moving = Scenario.load("ur5-fov").with_override("target.motion", motion).setup()
    with pytest.raises(ConfigurationError, match=r"0\.4 s before t = 0 .* with --start"):
        recorded_trajectory(moving, resting(moving), "it", zero=0.4)


@pytest.mark.parametrize(
    "change", [{"q": np.zeros((6, 3))}, {"qd": np.zeros((2, 6))}, {"pixels": np.zeros((3, 8))}]
)
def test_arrays_of_other_shapes(change: Mapping[str, Array], robot: Robot, tmp_path: Path) -> None:
    arrays: dict[str, Any] = {"t": np.arange(3.0), "q": np.zeros((3, 6)), **change}
    np.savez(tmp_path / "run.npz", **arrays)
    with pytest.raises(ConfigurationError, match=r"has the shape .* for 3 times"):
        read_recording(tmp_path / "run.npz", robot, markers=4)


# --- the command ---


def test_the_command_stores_scores_of_a_recording(
    run: Trajectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are those of the simulation that was recorded, beside those of the baseline.

    Files have nine digits.
    """
    np.savez(tmp_path / "run.npz", t=run.t, q=run.q, qd=run.qd, qdd_command=run.qdd_command)
    monkeypatch.chdir(tmp_path)
    chosen = ["--scenario", "ur5-fov", "--set", "ur5-fov.duration=1.2", "--no-figures"]
    done = CliRunner().invoke(app, ["score", "run.npz", *chosen, "--out", "new/scored"])
    assert done.exit_code == 0, done.output
    with open("new/scored/results.csv", newline="") as file:
        results = {line["controller"]: line for line in csv.DictReader(file)}
    assert results.keys() == {"tracking", "run"}
    setup = Scenario.load("ur5-fov").with_override("duration", 1.2).setup()
    expected, rows = scores_of(setup, run, simulate(setup, Tracking()))
    for column in ("final_translation_error_m", "acceleration_variation", "saturated_time_s"):
        assert float(results["run"][column]) == pytest.approx(expected[column], rel=1e-8)
    with open("new/scored/constraints.csv", newline="") as file:
        lines = [line for line in csv.DictReader(file) if line["controller"] == "run"]
    largest = [float(line["phi_max"]) for line in lines]
    np.testing.assert_allclose(largest, [row["phi_max"] for row in rows], rtol=1e-8)


def test_a_mujoco_run_is_scored_by_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last joint exceeds its 0.8 rad/s; depth and time are those of the file's own column."""
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    command = [sys.executable, str(ROOT / "examples" / "mujoco_run.py"), "run.csv"]
    subprocess.run(command, check=True, timeout=120)
    with open("run.csv", newline="") as file:
        speed = np.array([float(line["spin.velocity"]) for line in csv.DictReader(file)])
    arguments = ["score", "run.csv", "--scenario", str(ROOT / "examples" / "my-arm.toml")]
    done = CliRunner().invoke(app, [*arguments, "--out", "scored"])
    assert done.exit_code == 0, done.output
    with open("scored/constraints.csv", newline="") as file:
        lines = {
            line["constraint"]: line for line in csv.DictReader(file) if line["controller"] == "run"
        }
    upper = lines["speed[joint 6].upper"]
    assert float(upper["violation_depth"]) == pytest.approx(speed.max() - 0.8, rel=1e-3)
    outside = 0.002 * np.count_nonzero(speed > 0.8 * (1 + 1e-4))
    assert float(upper["violation_time_s"]) == pytest.approx(outside, abs=0.005)
    assert not float(lines["speed[joint 6].lower"]["violation_depth"])
    assert list(Path("scored/figures").iterdir())
    # nothing is lost: another recording needs another folder
    (tmp_path / "other.csv").write_bytes((tmp_path / "run.csv").read_bytes())
    refused = CliRunner().invoke(app, ["score", "other.csv", *arguments[2:], "--out", "scored"])
    assert isinstance(refused.exception, ConfigurationError)
    assert "would be lost" in str(refused.exception)
    assert RunRecord.load(Path("scored/trajectories/my-arm--run--0.npz")) is not None


def test_results_of_recorded_runs_need_no_trust_and_no_file_takes_the_place_of_their_law(
    tmp_path: Path,
) -> None:
    assert not list(code_named({"type": NAME_OF_LAW}))
    for other in ("vsconstraints.score.py:Recorded", "own.vsconstraints.score:Recorded"):
        assert list(code_named({"type": other})) == [other]
    (tmp_path / "vsconstraints" / "score").mkdir(parents=True)
    (tmp_path / "vsconstraints" / "score" / "scored.py").write_text("raise SystemExit")
    assert imported_class(NAME_OF_LAW, Controller, tmp_path) is Recorded


def test_what_an_arm_takes_is_no_matter_for_its_recorded_motion(
    setup: Setup, run: Trajectory, robot: Robot, tmp_path: Path
) -> None:
    arm = {"command": "velocity", "lag": 0.05, "acceleration": 8.0}
    of_velocities = Scenario.load("ur5-fov").with_override("arm", arm).setup()
    file = write(tmp_path / "run.csv", bad(run))
    found = [
        recorded_trajectory(one, read_recording(file, robot), "it")
        for one in (setup, of_velocities)
    ]
    np.testing.assert_array_equal(found[0].q, found[1].q)
    np.testing.assert_array_equal(found[0].clearance, found[1].clearance)
