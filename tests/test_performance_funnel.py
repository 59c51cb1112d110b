"""Prescribed performance as rows: by hand, at changes of the goal, in the loop; derivatives are in
the contracts.
"""

from __future__ import annotations

from dataclasses import replace
from math import exp, radians

import numpy as np
import pytest

from numpy_form import define, evaluate_rows, evaluate_task
from scenes import camera, robot
from vsconstraints.constraints import ConstraintSet, PerformanceFunnel, Trace
from vsconstraints.control import ControlStep
from vsconstraints.controllers import (
    HierarchicalQP,
    PotentialField,
    SlidingMode,
    Tracking,
    make_controller,
)
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.robots.geometry import Pose
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate
from vsconstraints.vision.features import Goal
from vsconstraints.vision.scene import Scene

GAINS = {"K": 0.2, "switching_gain": 1.0, "final": 0.1, "decay": 0.5}

NOWHERE = Goal(0.0, np.zeros((1, 2)), np.zeros((1, 2)))


def planar() -> tuple[Scene, np.ndarray]:
    """The planar arm of the first example, where the camera looks down on it."""
    setup = Scenario.load("example-2d-fov").setup()
    return setup.scene, setup.q0


def test_a_turn_about_the_optical_axis_by_hand() -> None:
    """Half a radian from the goal, turning away with 0.3 rad/s, after two seconds."""
    scene, q0 = planar()
    goal = Goal(1.0, np.zeros((2, 2)), np.zeros((2, 2)), scene.camera_pose(q0))
    constraint = PerformanceFunnel([goal], rotation_rad=2.0, **GAINS)
    q = q0 + np.array([0.0, 0.0, 0.5])
    qd = np.array([0.0, 0.0, 0.3])
    rows, sigma = evaluate_rows(ConstraintSet([constraint], scene), scene.evaluate(3.0, q, qd))
    assert rows.labels[2] == "funnel[rotation z].upper"
    assert rows.labels[5] == "funnel[rotation z].lower"
    # the last joint's axis points down, as the camera does: the camera turns by as much
    turned = float(np.sign(rows.Lg[2, 2])) * 0.5
    width = 0.9 * exp(-0.5 * 2.0) + 0.1
    narrowing = -0.5 * 0.9 * exp(-0.5 * 2.0)
    np.testing.assert_allclose(
        sigma[[2, 5]], [turned / 2.0 - width, -turned / 2.0 - width], atol=1e-12
    )
    rate = np.sign(turned) * 0.3
    sigma_dot = np.array([rate / 2.0 - narrowing, -rate / 2.0 - narrowing])
    np.testing.assert_allclose(rows.phi[[2, 5]], sigma[[2, 5]] + 0.2 * sigma_dot, atol=1e-12)
    np.testing.assert_allclose(
        rows.Lf[[2, 5]], sigma_dot - 0.2 * 0.25 * 0.9 * exp(-1.0), atol=1e-12
    )
    assert abs(rows.Lg[2, 2]) == pytest.approx(0.2 / 2.0)


def test_before_its_goal_a_funnel_stands_open() -> None:
    """It narrows from when its goal begins: until then at no rate, in both forms."""
    setup = Scenario.load("example-2d-funnel").with_override("task.goals.0.from_time", 1.0).setup()
    step = ControlStep(setup.scene, setup.constraints, setup.task)
    at = np.flatnonzero([label.startswith("funnel") for label in setup.constraints.labels])
    still = np.zeros_like(setup.qd0)
    for t, narrows in ((0.5, False), (1.0, True)):
        for rows in (
            step.evaluate(t, setup.q0, still).rows,
            define(step, setup.scene.evaluate(t, setup.q0, still)).rows,
        ):
            assert (rows.sigma_dot[at] != 0.0).all() == narrows
            assert (rows.Lf[at] != 0.0).all() == narrows


def test_clearance_is_what_is_left_of_the_funnel() -> None:
    scene, q0 = planar()
    pose = scene.camera_pose(q0)
    pixels = scene.project(pose)
    first = Goal(0.0, pixels, scene.camera.normalised(pixels), pose)
    second = Goal(
        2.0,
        pixels + 30.0,
        scene.camera.normalised(pixels + 30.0),
        pose @ Pose(np.eye(3), np.ones(3)),
    )
    t = np.array([0.0, 1.0, 2.0, 3.0])
    q = np.tile(q0, (4, 1))
    trace = Trace(
        t,
        q,
        0.0 * q,
        np.tile(pixels + 5.0, (4, 1, 1)),
        np.empty((4, 0, 3)),
        scene.camera.size,
        scene,
    )
    width = 0.9 * np.exp(-0.5 * np.array([0.0, 1.0, 0.0, 1.0])) + 0.1

    of_image = PerformanceFunnel([first, second], feature_px=100.0, **GAINS)
    assert set(of_image.units(scene)) == {"px"}
    error = np.array([5.0, 5.0, -25.0, -25.0])
    found = of_image.clearance(trace, slice(0, 0))
    np.testing.assert_allclose(found[:, 0], 100.0 * width - error)
    np.testing.assert_allclose(found[:, -1], 100.0 * width + error)

    of_pose = PerformanceFunnel([first, second], translation_m=3.0, rotation_rad=1.0, **GAINS)
    found = of_pose.clearance(trace, slice(0, 0))
    away = np.array([0.0, 0.0, -1.0, -1.0])
    np.testing.assert_allclose(found[:, 1], 3.0 * width - away, atol=1e-12)
    np.testing.assert_allclose(found[:, 7], 3.0 * width + away, atol=1e-12)
    np.testing.assert_allclose(found[:, 3], width, atol=1e-12)
    assert of_pose.units(scene) == ("m", "m", "m", "rad", "rad", "rad") * 2
    with pytest.raises(ConfigurationError, match="need the trace's scene"):
        of_pose.clearance(replace(trace, scene=None), slice(0, 0))


def test_the_funnel_is_about_the_goal_whatever_reference_leads_there() -> None:
    """With reach_in, the task's error begins at zero, the funnel's with the whole way."""
    setup = Scenario.load("example-2d-funnel").with_override("task.goals.0.reach_in", 5.0).setup()
    state = setup.scene.evaluate(0.0, setup.q0, setup.qd0)
    _, error = evaluate_task(setup.task, state)
    assert np.abs(error).max() == 0.0
    rows, sigma = evaluate_rows(setup.constraints, state)
    at = rows.labels.index("funnel[rotation z].upper")
    assert max(sigma[at], sigma[at + 3]) == pytest.approx(radians(180.0) / 3.6 - 1.0, abs=1e-9)


@pytest.mark.parametrize(
    "law",
    [
        SlidingMode(),
        HierarchicalQP(rows="barrier"),
        PotentialField(blend="priority"),
        *map(make_controller, ("implicit-switch", "super-twisting", "cbf-filter")),
    ],
    ids=lambda law: law.name,
)
def test_laws_hold_what_tracking_does_not(law) -> None:
    """As deep as one period of switching makes it, K T_s u⁺ of φ at most."""
    setup = Scenario.load("example-2d-funnel").setup()
    run = simulate(setup, law)
    funnel = [label.startswith("funnel") for label in run.labels]
    assert run.status == "converged"
    assert run.compiled
    assert run.sigma.max() < setup.Ts * 10.0 / 100.0
    assert run.clearance.min() > -0.01
    alone = simulate(setup, Tracking())
    assert alone.sigma[:, funnel].max() > 0.4
    assert alone.clearance[:, funnel].min() < -0.4
    # what is scored is what the rows say: with K σ̇ = 0 both vanish together
    start = np.where(np.array(funnel), 3.6, np.nan)
    np.testing.assert_allclose(run.clearance[:, funnel], -(run.sigma * start)[:, funnel], atol=1e-9)


def test_image_funnel_of_an_image_task() -> None:
    table = {
        "type": "performance-funnel",
        "feature_px": 500.0,
        "final": 0.01,
        "decay": 1.5,
        "K": 0.1,
    }
    scenario = Scenario.load("ur5-fov")
    keep = scenario.tables["constraints"]
    setup = scenario.with_override(
        "constraints", [*keep, {**table, "switching_gain": 10.0}]
    ).setup()
    run = simulate(setup, HierarchicalQP(rows="barrier"))
    alone = simulate(setup, Tracking())
    funnel = [label.startswith("funnel") for label in run.labels]
    assert alone.sigma[:, funnel].max() > 0.0
    assert run.sigma[:, funnel].max() < 1e-3


def test_a_new_goal_opens_the_funnel_again() -> None:
    table = {
        "type": "performance-funnel",
        "translation_m": 2.0,
        "final": 0.1,
        "decay": 1.0,
        "K": 0.1,
    }
    setup = (
        Scenario.load("case-study-6r")
        .with_override("constraints", [{**table, "switching_gain": 1.0}])
        .setup()
    )
    state = {t: setup.scene.evaluate(t, setup.q0, setup.qd0) for t in (0.0, 3.99, 4.0)}
    sigma = {t: evaluate_rows(setup.constraints, one)[1] for t, one in state.items()}
    width = {t: -0.5 * (sigma[t][:3] + sigma[t][3:]) for t in sigma}
    np.testing.assert_allclose(width[0.0], 1.0)
    np.testing.assert_allclose(width[3.99], 0.9 * exp(-3.99) + 0.1)
    np.testing.assert_allclose(width[4.0], 1.0)


def test_a_start_outside_is_refused_before_anything_moves() -> None:
    scenario = Scenario.load("example-2d-funnel").with_override("constraints.1.rotation_rad", 3.0)
    message = r"outside its funnel: funnel\[rotation z\]\.\w+ with an error of 3\.14, where ρ₀ is 3"
    with pytest.raises(ConfigurationError, match=message):
        simulate(scenario.setup(), SlidingMode())
    # on the boundary is outside
    exact = Scenario.load("example-2d-funnel").with_override(
        "constraints.1.rotation_rad", float(np.pi)
    )
    with pytest.raises(ConfigurationError, match="outside its funnel"):
        exact.setup().check_start()


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({}, ConfigurationError, "give feature_px, or translation_m, rotation_rad or both"),
        ({"feature_px": 1.0, "rotation_rad": 1.0}, ConfigurationError, "give feature_px, or"),
        ({"rotation_rad": 1.0}, ConfigurationError, "needs goals with one; give feature_px"),
        (
            {"feature_px": 0.0},
            InvalidInput,
            "feature_px of funnel must be a positive number, not 0.0",
        ),
        ({"feature_px": 1.0, "final": 1.5}, ConfigurationError, "final is at most 1"),
        (
            {"feature_px": 1.0, "final": 0.0},
            InvalidInput,
            "final of funnel must be a positive number",
        ),
        ({"feature_px": 1.0, "decay": 5.0}, ConfigurationError, "decay below 1/K = 5 1/s"),
        (
            {"feature_px": 1.0, "decay": float("nan")},
            InvalidInput,
            "decay of funnel must be a positive number",
        ),
        (
            {"feature_px": 1.0, "markers": [1, 1]},
            ConfigurationError,
            "markers of funnel are counted from 1",
        ),
        ({"feature_px": 1.0, "goals": []}, ConfigurationError, "has no goal"),
    ],
)
def test_what_cannot_be_a_funnel(options, error, message: str) -> None:
    arguments = {"goals": [NOWHERE], **GAINS, **options}
    with pytest.raises(error, match=message):
        PerformanceFunnel(**arguments)


def test_markers_go_with_the_image_and_must_be_there() -> None:
    arm = robot("ur5")
    goal = Goal(0.0, np.zeros((3, 2)), np.zeros((3, 2)), Pose.identity())
    with pytest.raises(ConfigurationError, match="markers of funnel need feature_px"):
        PerformanceFunnel([goal], translation_m=1.0, markers=[1], **GAINS)
    scene = Scene(arm, camera(), np.zeros((3, 3)))
    one = PerformanceFunnel([goal], feature_px=9.0, markers=[3], **GAINS)
    sides = [f"funnel[marker 3 {c}].{side}" for side in ("upper", "lower") for c in "uv"]
    assert one.labels(scene) == tuple(sides)
    with pytest.raises(ConfigurationError, match="there is no marker 4; the scene has 3"):
        ConstraintSet([PerformanceFunnel([goal], feature_px=9.0, markers=[4], **GAINS)], scene)
