"""What happens in the scenarios of section 5.4 and of the camera that stands in the room, with the
paper's law.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from vsconstraints.controllers import Controller, SlidingMode, Tracking
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, Trajectory, simulate

LAWS: dict[str, type[Controller]] = {"sliding-mode": SlidingMode, "tracking": Tracking}

BAND = 0.015
"""Depth, as a fraction of the limit, by which a speed may be overshot: of the order of T_s u⁺."""

CHALLENGED = {
    "moving-target": ("fov[marker 1]", "fov[marker 4]", "speed[joint 6].lower"),
    "moving-occluder": ("occlusion[circle, marker 2]", "occlusion[circle, marker 3]"),
    "moving-sphere": ("sphere[hand]",),
    "eye-to-hand-pbvs": (
        "fov[marker 3]",
        "occlusion[circle, marker 1]",
        "sphere[tip]",
        "speed[joint 6].lower",
    ),
    "eye-to-hand-ibvs": ("occlusion[hyperellipse, marker 2]", "box[tip]", "speed[joint 3].upper"),
}
"""Rows that tracking alone violates and the sliding mode slides along."""


@cache
def setup(name: str, known: bool = True) -> Setup:
    """The scenario, its obstacle's motion known or not."""
    scenario = Scenario.load(name)
    if not known:
        scenario = scenario.with_override("constraints.0.motion.known", False)
    return scenario.setup()


@cache
def run(name: str, law: str = "sliding-mode", known: bool = True) -> Trajectory:
    """Each simulated once."""
    return simulate(setup(name, known), LAWS[law]())


def clearance(trajectory: Trajectory, kind: str) -> float:
    """Least clearance of the rows of a kind, also between samples."""
    chosen = [label.startswith(kind) for label in trajectory.labels]
    least = np.minimum(trajectory.clearance, trajectory.between_clearance).min(axis=0)
    return float(least[chosen].min())


def sliding(trajectory: Trajectory, label: str) -> tuple[float, float]:
    """When a row first and last shapes the command [s]."""
    times = trajectory.t[trajectory.active[:, trajectory.labels.index(label)]]
    assert len(times), f"{label} never acts"
    return float(times[0]), float(times[-1])


def lag(trajectory: Trajectory) -> Array:
    """(N,) distance of the camera from where it should be, relative to the target [m]."""
    return trajectory.camera_error[:, 0]


@pytest.mark.parametrize("name", CHALLENGED)
def test_tracking_alone_violates_rows_along_which_the_sliding_mode_slides_to_the_goal(
    name: str,
) -> None:
    alone = run(name, "tracking")
    trajectory = run(name)
    lengths = setup(name).constraints.characteristic_length
    for label in CHALLENGED[name]:
        i = trajectory.labels.index(label)
        assert alone.clearance[:, i].min() < -0.05 * lengths[i] or label.startswith("fov[marker 4]")
        assert alone.clearance[:, i].min() < 0.0
        sliding(trajectory, label)
    assert alone.status == trajectory.status == "converged"


@pytest.mark.parametrize("name", CHALLENGED)
def test_the_sliding_mode_violates_nothing_but_speeds_within_the_band(name: str) -> None:
    trajectory = run(name)
    usage = trajectory.clearance.min(axis=0) / setup(name).constraints.characteristic_length
    for label, least in zip(trajectory.labels, usage, strict=True):
        assert least >= (-BAND if label.startswith("speed") else -1e-4), label


# --- moving targets ---


def test_a_target_of_known_velocity_is_tracked_without_lag() -> None:
    trajectory = run("moving-target")
    motion = setup("moving-target").scene.motion
    assert motion is not None
    speeds = [float(np.linalg.norm(motion.translation.rates(t)[0])) for t in trajectory.t]
    assert max(speeds) == pytest.approx(0.097, abs=0.001)
    # it moves all the time, also at the end
    assert speeds[-1] > 0.02
    assert lag(trajectory)[-1] < 2e-5
    assert sliding(trajectory, "fov[marker 1]") == pytest.approx((0.66, 1.41), abs=0.1)


def test_a_target_of_unknown_velocity_is_followed_with_the_lag_of_the_gains() -> None:
    known = run("moving-target", "tracking")
    unknown = run("moving-target-unknown", "tracking")
    motion = setup("moving-target").scene.motion
    gains = setup("moving-target").task.gains
    assert motion is not None
    Kp, Kv = gains.at(np.zeros(6))
    assert 3.0 / np.sqrt(20.0) == pytest.approx(Kv / Kp)
    settled = unknown.t > 4.0
    greatest = (
        Kv / Kp * max(float(np.linalg.norm(motion.translation.rates(t)[0])) for t in unknown.t)
    )
    assert 0.5 * greatest < lag(unknown)[settled].max() < 1.05 * greatest
    assert lag(unknown)[-1] > 1000.0 * lag(known)[-1]


def test_markers_of_a_target_of_unknown_velocity_leave_the_image_by_what_phi_does_not_know() -> (
    None
):
    assert clearance(run("moving-target"), "fov") > 0.0
    assert clearance(run("moving-target-unknown"), "fov") == pytest.approx(-18.7, abs=1.0)


# --- moving obstacles ---


def test_markers_give_way_to_the_occluder_one_after_the_other() -> None:
    trajectory = run("moving-occluder")
    third = sliding(trajectory, "occlusion[circle, marker 3]")
    second = sliding(trajectory, "occlusion[circle, marker 2]")
    assert third == pytest.approx((2.41, 2.90), abs=0.1)
    assert second == pytest.approx((3.81, 4.60), abs=0.1)
    assert trajectory.feature_error_px[-1] < 0.5


def test_hand_and_wrist_slide_along_the_moving_sphere() -> None:
    trajectory = run("moving-sphere")
    hand = sliding(trajectory, "sphere[hand]")
    wrist = sliding(trajectory, "sphere[wrist]")
    assert hand == pytest.approx((0.65, 2.04), abs=0.1)
    assert hand[0] < wrist[0] < wrist[1] < hand[1]


@pytest.mark.parametrize(
    ("name", "kind"), [("moving-occluder", "occlusion"), ("moving-sphere", "sphere")]
)
def test_an_obstacle_taken_for_static_is_entered_by_less_than_its_speed_times_k(
    name: str, kind: str
) -> None:
    constraint = setup(name, False).constraints.constraints[0]
    motion = constraint.motion
    reach = constraint.K * float(np.linalg.norm(motion.rates(0.0)[0]))
    depth = -clearance(run(name, known=False), kind)
    assert clearance(run(name), kind) > 0.0
    assert 0.3 * reach < depth < reach
    assert run(name, known=False).status == "converged"


# --- a camera that stands in the room ---


def test_eye_to_hand_rows_of_four_kinds_slide_at_once() -> None:
    trajectory = run("eye-to-hand-pbvs")
    window = 25
    together = [
        {label.split("[")[0] for label, acts in zip(trajectory.labels, rows, strict=True) if acts}
        for rows in (
            trajectory.active[k : k + window].any(axis=0)
            for k in range(0, len(trajectory.t) - window, 5)
        )
    ]
    assert max(map(len, together)) >= 3
    assert set().union(*together) == {"fov", "occlusion", "sphere", "speed"}


@pytest.mark.parametrize("name", ["eye-to-hand-pbvs", "eye-to-hand-ibvs"])
def test_eye_to_hand_markers_move_with_the_tip_before_a_camera_that_stands_still(name: str) -> None:
    scene = setup(name).scene
    trajectory = run(name)
    assert scene.camera.fixed is not None
    first, last = (scene.markers_at(trajectory.q[k], trajectory.t[k]) for k in (0, -1))
    assert np.linalg.norm(last - first, axis=1).min() > 0.1
    for k in (0, 500, -1):
        at = scene.camera.fixed.inverse.act(scene.markers_at(trajectory.q[k], trajectory.t[k]))
        np.testing.assert_allclose(
            scene.camera.pixels(at[:, :2] / at[:, 2:]), trajectory.features_px[k], atol=1e-6
        )
