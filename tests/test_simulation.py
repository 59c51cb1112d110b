"""The closed loop: exact integration, how runs end, where they may start, and what lies between
samples.
"""

from __future__ import annotations

import re
from dataclasses import fields, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from numpy_form import evaluate_rows
from vsconstraints.constraints import Trace
from vsconstraints.controllers import (
    Controller,
    HierarchicalQP,
    PotentialField,
    SlidingMode,
    Tracking,
)
from vsconstraints.errors import ConfigurationError, InvalidInput, SceneError
from vsconstraints.robots.geometry import distance
from vsconstraints.rows import Array, Command, Rows, Task
from vsconstraints.scenarios import Scenario, shipped_scenarios
from vsconstraints.simulation import Setup, Tolerances, Trajectory, intervals, simulate
from vsconstraints.simulation.disturbances import Disturbances
from vsconstraints.simulation.plant import Plant

START = [0.3179, -1.5414, 1.2426, -1.826, 0.4289, 0.0633]
GOAL = [0.2, -1.4, 1.1, -1.7, 0.5, 0.0]

TABLES: dict[str, Any] = {
    "robot": "viper-s650",
    "q0": START,
    "sampling_time": 0.005,
    "duration": 1.0,
    "camera": {"focal_px": [402.5, 402.5], "size_px": [512, 512]},
    "target": {
        "markers": [
            [0.564, 0.3095, 0.0108],
            [0.4666, 0.1403, 0.0541],
            [0.2919, 0.2348, 0.0302],
            [0.3894, 0.404, -0.013],
        ]
    },
    "task": {
        "feature": "camera-pose",
        "Kp0": 20.0,
        "Kp_slope": 0.0,
        "goals": [{"camera_at_q": GOAL}],
    },
}


def setup(**changes: object) -> Setup:
    scenario = Scenario("own", TABLES, Path())
    for key, value in changes.items():
        scenario = scenario.with_override(key.replace("__", "."), value)
    return scenario.setup()


class Played(Controller):
    """Gives accelerations that a test has written down: one row a sample, the last one for ever."""

    name = "played"

    def __init__(self, accelerations: Array) -> None:
        self.accelerations = accelerations
        self.at = 0

    def reset(self) -> None:
        self.at = 0

    def solve(self, rows: Rows, task: Task) -> Command:
        qdd = self.accelerations[min(self.at, len(self.accelerations) - 1)]
        self.at += 1
        return Command(qdd, "ok", np.zeros(len(rows.labels), dtype=np.bool_), rows.labels)


OTHERWISE = "between_clearance", "share_to_hold"
"""Arrays that are not by sample."""


def columns(trajectory: Trajectory) -> dict[str, Array]:
    arrays = {f.name: getattr(trajectory, f.name) for f in fields(trajectory)}
    return {name: value for name, value in arrays.items() if isinstance(value, np.ndarray)}


# --- the plant ---


@pytest.mark.parametrize("Ts", [0.002, 0.05, 0.7])
def test_one_step_is_the_motion_of_constant_acceleration(Ts: float) -> None:
    q, qd, qdd = np.random.default_rng(1).normal(size=(3, 6))
    plant = Plant(q, qd, Ts, "acceleration", Disturbances())
    plant.begin(qdd)
    plant.step()
    np.testing.assert_allclose(plant.q, q + qd * Ts + qdd * Ts**2 / 2, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(plant.qd, qd + qdd * Ts, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("Ts", [0.005, 0.01, 0.05])
def test_a_double_integrator_is_exact_whatever_the_sampling_time(Ts: float) -> None:
    qdd = np.array([0.2, -0.1, 0.15, 0.1, -0.2, 0.3])
    qd0 = [0.05, 0.0, -0.05, 0.1, 0.0, -0.1]
    trajectory = simulate(setup(sampling_time=Ts, duration=0.5, qd0=qd0), Played(qdd[None]))
    t = trajectory.t[:, None]
    np.testing.assert_allclose(
        trajectory.q, np.array(START) + np.array(qd0) * t + 0.5 * qdd * t**2, atol=1e-13
    )
    np.testing.assert_allclose(trajectory.qd, np.array(qd0) + qdd * t, atol=1e-13)


def test_commands_that_change_are_held_for_one_sample_each() -> None:
    accelerations = np.random.default_rng(2).uniform(-1.0, 1.0, (101, 6))
    trajectory = simulate(setup(duration=0.5), Played(accelerations))
    Ts = 0.005
    np.testing.assert_array_equal(trajectory.qdd_command, accelerations)
    # the last command is computed but not carried out
    speed = Ts * np.vstack((np.zeros(6), np.cumsum(accelerations[:-1], axis=0)))
    np.testing.assert_allclose(trajectory.qd, speed, atol=1e-13)
    moved = Ts * speed[:-1] + 0.5 * Ts**2 * accelerations[:-1]
    np.testing.assert_allclose(trajectory.q[1:] - START, np.cumsum(moved, axis=0), atol=1e-13)


@pytest.mark.parametrize(
    ("Ts", "duration", "samples"),
    [
        (0.005, 1.0, 201),
        (0.1, 0.3, 4),
        (0.1, 0.1, 2),
        (0.002, 0.01, 6),
        (0.3, 1.0, 4),
        (0.7, 1.0, 2),
    ],
)
def test_runs_have_a_sample_at_the_start_and_at_the_end(
    Ts: float, duration: float, samples: int
) -> None:
    there = setup(sampling_time=Ts, duration=duration)
    assert there.samples == samples
    trajectory = simulate(there, Played(np.zeros((1, 6))))
    np.testing.assert_allclose(trajectory.t, Ts * np.arange(samples), atol=1e-12)
    assert abs(trajectory.t[-1] - duration) <= 0.5 * Ts
    for name, values in columns(trajectory).items():
        if name not in OTHERWISE:
            assert len(values) == samples, name


def test_what_is_logged_is_what_the_scene_says() -> None:
    there = setup(
        constraints=[{"type": "field-of-view", "K": 0.1, "switching_gain": 2.0, "margin": 0.05}]
    )
    trajectory = simulate(there, SlidingMode())
    assert trajectory.labels == there.constraints.labels
    goal = there.task.goals[0]
    assert goal.camera is not None
    for k in (0, 57, 200):
        state = there.scene.evaluate(trajectory.t[k], trajectory.q[k], trajectory.qd[k])
        rows, sigma = evaluate_rows(there.constraints, state)
        # up to rounding: the loop may run in its compiled form
        np.testing.assert_allclose(
            trajectory.features_px[k], state.pixels.position, rtol=0.0, atol=1e-10
        )
        np.testing.assert_allclose(trajectory.phi[k], rows.phi, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(trajectory.sigma[k], sigma, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(
            trajectory.camera_position[k], state.camera.t, rtol=0.0, atol=1e-14
        )
        np.testing.assert_allclose(
            trajectory.camera_error[k], distance(goal.camera, state.camera), atol=1e-14
        )
        away = np.linalg.norm(state.pixels.position - goal.pixels, axis=1).max()
        assert trajectory.feature_error_px[k] == pytest.approx(away)
        apart = np.linalg.norm(trajectory.error[k, :3])
        assert trajectory.camera_error[k, 0] == pytest.approx(apart, rel=1e-12)
    run = trajectory
    size = there.scene.camera.size
    trace = Trace(run.t, run.q, run.qd, run.features_px, run.points, size)
    np.testing.assert_array_equal(there.constraints.clearance(trace), trajectory.clearance)
    assert (trajectory.rows_time > 0.0).all()
    assert (trajectory.step_time > 0.0).all()


def test_two_runs_are_the_same_apart_from_the_clock() -> None:
    scenario = Scenario.load("case-study-6r").with_override("duration", 1.2)
    there = scenario.setup()
    for make in (SlidingMode, partial(PotentialField, blend="priority"), HierarchicalQP):
        # on the same setup and law, which keep nothing from a run, and on new ones
        law = make()
        first = simulate(there, law)
        again = simulate(there, law)
        fresh = simulate(scenario.setup(), make())
        for other in (again, fresh):
            assert (first.status, first.reason) == (other.status, other.reason)
            for name, values in columns(first).items():
                if not name.endswith("_time"):
                    np.testing.assert_array_equal(
                        values, columns(other)[name], err_msg=f"{law.name}: {name}"
                    )
        assert first.active.any()


def test_a_run_resets_its_controller() -> None:
    there = setup(duration=0.02)
    law = Played(np.arange(30.0).reshape(5, 6))
    first = simulate(there, law)
    np.testing.assert_array_equal(simulate(there, law).qdd_command, first.qdd_command)


# --- how runs end ---


def test_a_marker_that_gets_behind_the_camera_ends_the_run_and_keeps_what_was_simulated() -> None:
    spin = np.zeros((1, 6))
    spin[0, 4] = 40.0
    there = setup()
    trajectory = simulate(there, Played(spin))
    assert trajectory.status == "failed"
    assert "not in front of the camera: marker" in trajectory.reason
    samples = len(trajectory.t)
    assert 5 < samples < there.samples
    assert f"t = {samples * 0.005:.4g} s" in trajectory.reason
    for name, values in columns(trajectory).items():
        if name not in OTHERWISE:
            assert len(values) == samples, name
            assert np.isfinite(values).all(), name
    # the next state is the one that cannot be seen
    q = trajectory.q[-1] + 0.005 * trajectory.qd[-1] + 0.5 * 0.005**2 * spin[0]
    with pytest.raises(SceneError):
        there.scene.glance(q)


def test_a_law_that_fails_ends_the_run_with_its_reason() -> None:
    accelerations = np.zeros((20, 6))
    accelerations[7:, 2] = np.nan
    trajectory = simulate(setup(), Played(accelerations))
    assert trajectory.status == "failed"
    assert len(trajectory.t) == 8
    assert "t = 0.035 s" in trajectory.reason
    assert "not finite" in trajectory.reason
    np.testing.assert_array_equal(trajectory.qdd_command[-1], 0.0)


@pytest.mark.parametrize("acceleration", [1e9, 1e160, 1e300])
def test_a_law_that_explodes_ends_its_run_and_not_the_program(acceleration: float) -> None:
    fov = {"type": "field-of-view", "K": 0.1, "switching_gain": 2.0}
    accelerations = np.zeros((20, 6))
    accelerations[3:] = acceleration
    trajectory = simulate(setup(constraints=[fov]), Played(accelerations))
    assert trajectory.status == "failed"
    assert trajectory.reason.startswith("t = 0.0")
    assert len(trajectory.t) >= 4


def dependent_rows() -> list[dict[str, object]]:
    """Two spheres around one centre, the tip inside both: they demand the same of it, so that rank
    is lost.
    """
    sphere = {
        "type": "forbidden-sphere",
        "centre": [0.5, 0.2, 0.5],
        "radius": 5.0,
        "K": 0.1,
        "switching_gain": 0.2,
    }
    return [{**sphere, "name": name} for name in ("inner", "outer")]


def test_a_loss_of_rank_aborts_the_run_and_names_the_rows() -> None:
    trajectory = simulate(setup(constraints=dependent_rows()), SlidingMode())
    assert trajectory.status == "aborted"
    assert "t = 0 s: the active rows have lost full row rank" in trajectory.reason
    assert "dependent: sphere[inner, tip], sphere[outer, tip]" in trajectory.reason
    assert len(trajectory.t) == 1
    assert trajectory.clearance.shape == (1, 2)


def test_a_loss_of_rank_can_be_ignored() -> None:
    there = setup(constraints=dependent_rows(), on_rank_loss="continue")
    trajectory = simulate(there, SlidingMode())
    assert trajectory.status != "aborted"
    assert len(trajectory.t) == there.samples


@cache
def long_run() -> Trajectory:
    return simulate(setup(duration=4.0, sampling_time=0.01), Tracking())


def test_a_goal_that_is_reached_and_held_is_converged() -> None:
    trajectory = long_run()
    assert (trajectory.status, trajectory.reason) == ("converged", "")
    assert (trajectory.camera_error[-20:] < 0.005).all()


def test_a_run_that_is_too_short_is_unfinished() -> None:
    trajectory = simulate(setup(duration=0.3), Tracking())
    assert trajectory.status == "unfinished"
    assert "still moving" in trajectory.reason
    assert f"{trajectory.camera_error[-1, 0] * 1e3:.3g} mm" in trajectory.reason


def test_reaching_the_goal_at_the_very_end_is_not_yet_converged() -> None:
    reached = np.flatnonzero((long_run().camera_error < 0.005).all(axis=1))[0]
    at = float(long_run().t[reached])
    assert simulate(setup(duration=at, sampling_time=0.01), Tracking()).status == "unfinished"
    assert simulate(setup(duration=at + 0.3, sampling_time=0.01), Tracking()).status == "converged"
    within = setup(duration=at, sampling_time=0.01, tolerances={"dwell_s": 0.001})
    assert simulate(within, Tracking()).status == "converged"


def test_a_robot_at_rest_away_from_its_goal_is_trapped() -> None:
    still = Played(np.zeros((1, 6)))
    trajectory = simulate(setup(duration=2.5), still)
    assert trajectory.status == "trapped"
    assert "at rest, ends" in trajectory.reason
    # at rest must be seen for as long as the tolerance says
    assert simulate(setup(duration=1.5), still).status == "unfinished"
    assert simulate(setup(duration=1.5, tolerances={"rest_s": 1.0}), still).status == "trapped"


def test_a_robot_that_creeps_is_not_at_rest() -> None:
    """2 cm in the last 2 s: more than the 5 mm that count as rest."""
    there = setup(duration=2.5, qd0=[0.02, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert simulate(there, Played(np.zeros((1, 6)))).status == "unfinished"


@pytest.mark.parametrize(
    ("rest", "Ts"), [(1e-3, 5e-3), (4.9e-3, 5e-3), (1e-300, 0.25), (0.02, 5e-3), (2.0, 3.0)]
)
def test_a_window_of_few_samples_shows_no_rest(rest: float, Ts: float) -> None:
    """0.1 m/s up to the end; with a period of 3 s there and back, so that the last samples are near
    each other.
    """
    push = 0.4 / Ts * (np.arange(8)[:, None] % 2 - 0.5) if Ts > 2.0 else np.zeros((1, 1))
    there = setup(
        duration=min(2.5, 6 * Ts) if Ts < 2.0 else 6.0,
        sampling_time=Ts,
        qd0=[0.1, 0.0, 0.0, 0.0, 0.0, 0.0],
        tolerances={"rest_s": rest},
    )
    trajectory = simulate(there, Played(push * np.eye(6)[:1]))
    assert np.abs(trajectory.qd[-1]).max() == pytest.approx(0.1)
    assert (trajectory.status, "still moving" in trajectory.reason) == ("unfinished", True)


def test_a_turning_point_is_no_rest() -> None:
    """A swing that turns back at the end: over 10 ms the camera stays within 0.1 mm."""
    there = setup(duration=2.0, qd0=[0.2, 0.0, 0.0, 0.0, 0.0, 0.0], tolerances={"rest_s": 0.01})
    trajectory = simulate(there, Played(-0.1 * np.eye(6)[:1]))
    assert np.abs(trajectory.qd[-1]).max() < 1e-9
    assert trajectory.status == "unfinished"


@pytest.mark.parametrize("Ts", [0.005, 0.25])
def test_standing_still_for_long_enough_is_rest_at_every_sampling_time(Ts: float) -> None:
    still = setup(duration=max(1.0, 10 * Ts), sampling_time=Ts, tolerances={"rest_s": 0.001})
    assert simulate(still, Played(np.zeros((1, 6)))).status == "trapped"


def test_only_the_last_goal_counts() -> None:
    here = {"camera_at_q": START}
    still = Played(np.zeros((1, 6)))
    assert simulate(setup(task__goals=[here]), still).status == "converged"
    later = {"camera_at_q": START, "from_time": 5.0}
    assert simulate(setup(task__goals=[here, later]), still).status == "unfinished"
    # a goal that begins and ends between two samples is not missed
    away = {"camera_at_q": [START[0] + 0.5, *START[1:]]}
    between = {**away, "from_time": 0.5012}, {**here, "from_time": 0.5014}
    assert simulate(setup(task__goals=[here, *between]), still).status == "converged"


def test_another_goal_is_no_approach() -> None:
    """An arm that stands still comes no nearer where the goal that is in force does."""
    far, near = ([START[0] + by, *START[1:]] for by in (0.5, 0.01))
    goals = [{"camera_at_q": far}, {"camera_at_q": near, "from_time": 1.9}]
    trajectory = simulate(setup(duration=2.0, task__goals=goals), Played(np.zeros((1, 6))))
    assert trajectory.status == "trapped"


def test_image_tasks_are_judged_in_the_image() -> None:
    pixels = setup().scene.project(setup().scene.camera_pose(START))
    still = Played(np.zeros((1, 6)))
    for shift, status in ((1.0, "converged"), (3.0, "trapped")):
        goal = {"markers_px": (pixels + np.array([shift, 0.0])).tolist()}
        there = setup(task__feature="image-points", task__goals=[goal], duration=2.5)
        trajectory = simulate(there, still)
        assert trajectory.status == status
        assert np.isnan(trajectory.camera_error).all()
        np.testing.assert_allclose(trajectory.feature_error_px, shift, atol=1e-9)
    assert "3 px from the goal" in trajectory.reason


def test_an_option_that_concerns_no_row_is_told_of_in_the_reason() -> None:
    fov = {"type": "field-of-view", "K": 0.1, "switching_gain": 2.0}
    for solver in ("auto", "daqp"):
        law = HierarchicalQP(solver=solver, weights={"fov": 2.0, "rnage": 3.0})
        assert simulate(setup(constraints=[fov]), law).reason.endswith(
            "weights that match the beginning of no row's label: 'rnage'"
        )


# --- where runs start ---


def test_a_joint_outside_its_range_is_no_start() -> None:
    outside = [*START[:2], 2.0, *START[3:]]
    with pytest.raises(
        ConfigurationError,
        match=r"starts outside its ranges: joint 3 \(joint 3\) is at 2, 0\.[0-9]+ rad outside",
    ):
        simulate(setup(q0=outside), Tracking())


def test_a_marker_that_is_not_seen_at_the_start_is_named() -> None:
    markers = [list(marker) for marker in TABLES["target"]["markers"]]
    markers[2][0] -= 1.0
    with pytest.raises(
        ConfigurationError, match=r"at the start, outside the image of 512 × 512 px: marker 3 at \("
    ):
        simulate(setup(target__markers=markers), Tracking())
    behind = [list(marker) for marker in TABLES["target"]["markers"]]
    behind[1] = [0.5, 0.2, 3.0]
    pixels = {"markers_px": [[0.0, 0.0]] * 4}
    there = setup(target__markers=behind, task__feature="image-points", task__goals=[pixels])
    with pytest.raises(
        ConfigurationError, match=r"at the start, not in front of the camera: marker 2 \(depth"
    ):
        simulate(there, Tracking())


CONSTRAINTS_VIOLATED_AT_THE_START = {
    "field of view": {
        "type": "field-of-view",
        "margin": 0.13,
        "K": 0.1,
        "switching_gain": 10.0,
        "markers": [1],
    },
    "joint range": {
        "type": "joint-range",
        "joints": [6],
        "lower": [-0.9],
        "upper": [0.0],
        "K": 0.1,
        "switching_gain": 2.0,
    },
    "sphere": {
        "type": "forbidden-sphere",
        "centre": [0.0, 0.0, 0.0],
        "radius": 0.0,
        "K": 0.1,
        "switching_gain": 0.5,
    },
}


@pytest.mark.parametrize("kind", CONSTRAINTS_VIOLATED_AT_THE_START)
def test_a_constraint_violated_at_the_start_is_reported_and_recovered_from(kind: str) -> None:
    table = dict(CONSTRAINTS_VIOLATED_AT_THE_START[kind])
    if kind == "sphere":
        # 2 cm inside of a sphere beside the tip
        tip = setup().scene.robot.pose(START).t
        table |= {"centre": (tip + np.array([0.08, 0.0, 0.0])).tolist(), "radius": 0.1}
    there = setup(constraints=[table], duration=2.0)
    sentences = there.check_start()
    assert len(sentences) == 1
    label = sentences[0].split(" is violated at the start: σ = ")[0]
    assert label in there.constraints.labels
    trajectory = simulate(there, SlidingMode())
    at = trajectory.labels.index(label)
    sigma = trajectory.sigma[:, at]
    assert sigma[0] > 0.0
    assert trajectory.clearance[0, at] < 0.0
    inside = int(np.argmax(sigma <= 0.0))
    assert 0 < inside < len(sigma) - 1, "never comes back"
    assert (sigma[inside:] <= 1e-3).all()
    assert trajectory.active[0, at]
    assert sentences[0] in trajectory.reason
    assert trajectory.status not in ("failed", "aborted")


def test_a_start_inside_all_constraints_says_nothing() -> None:
    assert (
        setup(
            constraints=[{"type": "field-of-view", "K": 0.1, "switching_gain": 2.0}]
        ).check_start()
        == []
    )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sampling_time": 0.0}, "sampling_time must be a positive number of seconds"),
        ({"sampling_time": np.nan}, "sampling_time must be a positive number of seconds"),
        ({"duration": np.inf}, "duration must be a positive number of seconds"),
        ({"duration": -1.0}, "duration must be a positive number of seconds"),
        ({"duration": 0.001}, "shorter than one sample"),
        ({"q0": np.zeros(5)}, "q0 of 6R"),
        ({"qd0": np.full(6, np.nan)}, "qd0 of 6R"),
    ],
)
def test_setups_that_are_none_are_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises((InvalidInput, ConfigurationError), match=words):
        replace(setup(), **changes)


@pytest.mark.parametrize(
    "name", ["translation_m", "rotation_rad", "feature_px", "dwell_s", "rest_s"]
)
def test_tolerances_must_be_positive(name: str) -> None:
    for value in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InvalidInput, match=f"tolerance {name} must be positive"):
            Tolerances(**{name: value})


# --- between samples ---


def fine_clearance(there: Setup, trajectory: Trajectory, parts: int = 64) -> Array:
    """(m,) least clearance on a grid inside every period of the run, by integrating the plant
    here.
    """
    least = np.full(len(trajectory.labels), np.inf)
    for k in range(len(trajectory.t) - 1):
        tau = there.Ts * np.arange(1, parts)[:, None] / parts
        q = trajectory.q[k] + tau * trajectory.qd[k] + 0.5 * tau**2 * trajectory.qdd_command[k]
        qd = trajectory.qd[k] + tau * trajectory.qdd_command[k]
        seen = [there.scene.glance(x) for x in q]
        pixels = np.array([s[0] for s in seen])
        points = np.array([s[1] for s in seen])
        trace = Trace(trajectory.t[k] + tau[:, 0], q, qd, pixels, points, there.scene.camera.size)
        least = np.minimum(least, there.constraints.clearance(trace).min(axis=0))
    return least


@pytest.mark.parametrize("law", [SlidingMode(), Tracking()], ids=lambda law: law.name)
def test_clearance_between_samples_is_that_of_a_fine_grid(law: Controller) -> None:
    """A slow loop, so that much happens inside a period; the rows that come near are found to a
    fraction of it.
    """
    scenario = (
        Scenario.load("case-study-6r")
        .with_override("sampling_time", 0.05)
        .with_override("duration", 3.0)
    )
    there = scenario.with_override("on_rank_loss", "continue").setup()
    trajectory = simulate(there, law)
    fine = np.minimum(fine_clearance(there, trajectory), trajectory.clearance.min(axis=0))
    found = np.minimum(trajectory.between_clearance, trajectory.clearance).min(axis=0)
    length = there.constraints.characteristic_length
    near = fine < 0.05 * length
    assert near.any()
    assert (found >= fine - 1e-9 * length).all()
    missed_by_samples = trajectory.clearance.min(axis=0)[near] - fine[near]
    # of a parabola's dip between two samples, quarters of the period miss at most (1/4)²; a third
    # where it is none
    assert (found[near] - fine[near] <= missed_by_samples / 3.0 + 1e-5 * length[near]).all()
    # and looking there matters: samples alone miss some of it
    assert (missed_by_samples > 1e-4 * length[near]).any()


def test_a_joint_that_goes_out_and_back_inside_periods_is_looked_at() -> None:
    """Chatter of which samples show nothing, far out at first; then a slow drift, nearer to the
    boundary in samples.
    """
    Ts = 0.05
    N = 400
    k = np.arange(N + 1)
    speed = 6.4 * (-1.0) ** (k + 1) * 0.98**k - np.where(k > 0, 2e-3, 0.0)
    qdd = np.zeros((N, 6))
    qdd[:, 5] = np.diff(speed) / Ts
    limits = {
        "type": "joint-range",
        "joints": [6],
        "lower": [START[5] - 0.044],
        "upper": [START[5] + 1.956],
        "K": 0.1,
    }
    there = setup(
        sampling_time=Ts,
        duration=Ts * (N - 1),
        constraints=[{**limits, "switching_gain": 1.0}],
        qd0=[0.0, 0.0, 0.0, 0.0, 0.0, speed[0]],
    )
    trajectory = simulate(there, Played(qdd))
    assert trajectory.clearance.min() > 0.0
    # out by Ts v / 4 in the first period, of a margin of 0.044
    assert trajectory.between_clearance.min() == pytest.approx(0.044 - Ts * 6.4 / 4, abs=2e-3)


def test_nothing_near_a_boundary_is_not_looked_at() -> None:
    fov = {"type": "field-of-view", "K": 0.1, "switching_gain": 2.0, "markers": [1]}
    there = setup(constraints=[fov], duration=0.1)
    trajectory = simulate(there, Played(np.zeros((1, 6))))
    assert trajectory.clearance.min() > 0.05 * 256
    assert np.isposinf(trajectory.between_clearance).all()


def test_a_marker_that_is_lost_inside_a_period_does_not_stop_the_run() -> None:
    """In front of the camera at both ends of a period, behind it in the middle: it has no clearance
    there.
    """
    Ts = 0.1
    speed = 80.0
    # joint 5 moves by −v τ + v τ²/Ts: back where it was after Ts, −v Ts/4 = −2 rad in the middle
    swing = np.zeros((1, 6))
    swing[0, 4] = 2.0 * speed / Ts
    fov = {"type": "field-of-view", "K": 0.1, "switching_gain": 2.0, "margin": 0.08, "markers": [1]}
    there = setup(
        sampling_time=Ts, duration=0.4, constraints=[fov], qd0=[0.0, 0.0, 0.0, 0.0, -speed, 0.0]
    )
    with pytest.raises(SceneError):
        there.scene.glance(np.array(START) - np.array([0.0, 0.0, 0.0, 0.0, speed * Ts / 4, 0.0]))
    trajectory = simulate(there, Played(swing))
    assert trajectory.status == "failed"
    assert len(trajectory.t) >= 2
    np.testing.assert_allclose(trajectory.q[1], START, atol=1e-12)
    assert trajectory.clearance.min() < 0.05 * there.constraints.characteristic_length[0]
    assert np.isposinf(trajectory.between_clearance).all()


# --- intervals ---


def test_intervals_merge_what_is_closer_than_the_gap() -> None:
    t = np.arange(10) * 0.1
    flags = np.array([0, 1, 1, 0, 1, 0, 0, 0, 0, 1], dtype=bool)
    assert [tuple(np.round(i, 9)) for i in intervals(t, flags, 0.25)] == [(0.1, 0.4), (0.9, 0.9)]
    assert [tuple(np.round(i, 9)) for i in intervals(t, flags, 0.15)] == [
        (0.1, 0.2),
        (0.4, 0.4),
        (0.9, 0.9),
    ]
    assert [tuple(np.round(i, 9)) for i in intervals(t, flags, 0.6)] == [(0.1, 0.9)]
    assert intervals(t, np.zeros(10, dtype=bool), 0.6) == []


def test_active_intervals_are_those_of_phi() -> None:
    run = simulate(
        Scenario.load("example-2d-fast").with_override("duration", 0.6).setup(), SlidingMode()
    )
    spans = run.active_intervals("fov[marker 2]")
    assert len(spans) == 1
    inside = run.t[run.phi[:, run.labels.index("fov[marker 2]")] >= 0.0]
    assert spans[0] == (inside[0], inside[-1])
    assert run.active_intervals("fov[marker 1]") == []


def test_no_constraint_and_no_point_still_runs() -> None:
    trajectory = simulate(setup(duration=0.1), SlidingMode())
    assert trajectory.labels == ()
    assert trajectory.phi.shape == (21, 0)
    assert trajectory.between_clearance.shape == (21, 0)


class Fails(Tracking):
    """Tracks for ten samples."""

    def __init__(self) -> None:
        super().__init__()
        self.left = 10

    def reset(self) -> None:
        self.left = 10

    def solve(self, rows: Rows, task: Task) -> Command:
        self.left -= 1
        if self.left < 0:
            raise KeyError("gone")
        return super().solve(rows, task)


def test_what_was_simulated_before_an_own_law_fails_is_kept() -> None:
    trajectory = simulate(setup(), Fails())
    assert (trajectory.status, len(trajectory.t)) == ("failed", 10)
    assert "KeyError: 'gone'" in trajectory.reason
    assert np.isfinite(trajectory.camera_error).all()


class Meddles(Tracking):
    """Changes the rows it is given."""

    def solve(self, rows: Rows, task: Task) -> Command:
        rows.phi[:] = -1.0
        return super().solve(rows, task)


def test_a_law_cannot_change_what_is_logged() -> None:
    fov = {"type": "field-of-view", "K": 0.1, "switching_gain": 2.0}
    honest, meddling = (simulate(setup(constraints=[fov]), law) for law in (Tracking(), Meddles()))
    # up to rounding: an own law runs in NumPy, where the other may be compiled
    np.testing.assert_allclose(meddling.phi, honest.phi, rtol=0.0, atol=1e-12)


def test_a_run_too_long_to_keep_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="samples"):
        setup(sampling_time=1e-9)


def test_a_goal_that_no_controller_can_reach_is_remarked() -> None:
    scenario = Scenario.load("example-2d-fov")
    narrow = scenario.with_override("constraints.0.margin_px", 40.0).with_override(
        "constraints.0.markers", [2]
    )
    del narrow.tables["constraints"][0]["margin"]
    remarks = narrow.setup().check_start()
    # it starts and ends 217.5 px above or below the centre; 216 are allowed
    assert "goal 1 is forbidden by fov[marker 2]" in remarks
    assert any(remark.startswith("fov[marker 2] is violated at the start") for remark in remarks)
    reason = simulate(replace(narrow.setup(), duration=0.1), SlidingMode()).reason
    assert "goal 1 is forbidden by fov[marker 2]" in reason


# --- goals that constraints close off ---


def walled_in(gap: int | None) -> Setup:
    """The first example, its first marker walled in by twelve discs that overlap; one is missing if
    there is a gap.
    """
    scenario = Scenario.load("example-2d-fov")
    bare = scenario.setup()
    u, v = bare.scene.evaluate(0.0, bare.q0, bare.qd0).pixels.position[0]
    common = {"type": "occlusion", "K": 0.2, "switching_gain": 10.0, "markers": [1]}
    discs = [
        {
            **common,
            "name": f"disc {i}",
            "curve": {
                "shape": "circle",
                "centre_px": [u + 60.0 * np.cos(a), v + 60.0 * np.sin(a)],
                "radius": 20.0,
            },
        }
        for i, a in enumerate(np.arange(12) * np.pi / 6.0)
        if i != gap
    ]
    return scenario.with_override("constraints", [*scenario.tables["constraints"], *discs]).setup()


def test_a_marker_that_constraints_close_off_from_its_goal_is_named() -> None:
    (said,) = walled_in(gap=None).check_start()
    assert said.startswith("marker 1 starts in a part of the image of ")
    # between the circle inside the discs' near sides and that through their crossings
    area = float(re.findall(r"([0-9]+) px²", said)[0])
    crossing = 60.0 * np.cos(np.pi / 12.0) - np.sqrt(20.0**2 - (60.0 * np.sin(np.pi / 12.0)) ** 2)
    assert np.pi * 40.0**2 < area < np.pi * crossing**2
    assert said.endswith(
        "close off from goal 1: no law can bring the marker there without a violation"
    )
    # in which direction the gap is does not matter
    assert not [gap for gap in range(12) if walled_in(gap).check_start()]


def test_the_papers_trap_cannot_be_left() -> None:
    named = {name: Scenario.load(name).setup().separated for name in shipped_scenarios()}
    assert {name for name, said in named.items() if said} == {"example-2d-bowl"}
    assert "marker 1 starts in a part of the image of 31" in named["example-2d-bowl"][0]
