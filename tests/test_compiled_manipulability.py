"""The compiled rows of manipulability, near singular configurations and for arms of every shape."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenes import random_scene, robot
from vsconstraints import Robot
from vsconstraints.compiled import available
from vsconstraints.compiled.control_step import ControlStep
from vsconstraints.constraints import ConstraintSet, Manipulability
from vsconstraints.errors import ConfigurationError
from vsconstraints.rows import Array
from vsconstraints.vision.features import Goal, ImagePoints
from vsconstraints.vision.scene import Scene
from vsconstraints.vision.tracking import TrackingGains, VisualTask

pytestmark = pytest.mark.skipif(not available(), reason="there is no compiler here")

PARTS = ("pose", "position", "orientation")
GAINS = {"K": 0.3, "switching_gain": 1.0}
WRIST = [0.3, -1.2, 1.4, -0.8, 0.0, 0.2]
"""Of a UR5, with two axes of the wrist in line."""


def world(arm: Robot, constraints: list[Any], seed: int = 0) -> tuple[Scene, VisualTask, Array, Array]:
    scene, q, qd = random_scene(arm, np.random.default_rng(seed), constraints)
    pixels = scene.glance(q)[0]
    task = VisualTask(ImagePoints(), [Goal(0.0, pixels, scene.camera.normalised(pixels))], TrackingGains(5.0))
    return scene, task, q, qd


def rows_of(arm: Robot, part: Any, q: Array, qd: Array) -> tuple[Any, Any]:
    """Of both forms, wherever the markers are."""
    one = Manipulability(arm, minimum=0.05, scale=0.2, part=part, **GAINS)
    scene, task, _, _ = world(arm, [one])
    scene.markers[:] = scene.camera_pose(q).act(np.array([[0.1, 0.0, 1.0], [0.0, 0.1, 1.0], [-0.1, 0.0, 1.2]]))
    step = ControlStep(scene, ConstraintSet([one], scene), task)
    assert step.in_numpy == ()
    return step.evaluate(0.0, q, qd), step.define(scene.evaluate(0.0, q, qd))


def random_arm(rng: np.random.Generator, n: int) -> Robot:
    table = rng.uniform(-1.0, 1.0, (n, 4)) * [1.0, 0.4, 0.4, 2.0]
    return Robot.from_dh(table, prismatic=(np.flatnonzero(rng.uniform(size=n) < 0.3) + 1).tolist())


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 9), part=st.sampled_from(PARTS))
def test_arms_of_every_shape(seed: int, n: int, part: Any) -> None:
    """Fewer joints than directions, as many, and more; with prismatic ones."""
    rng = np.random.default_rng(seed)
    arm = random_arm(rng, n)
    try:
        Manipulability(arm, minimum=0.05, part=part, **GAINS)
    except ConfigurationError:  # this arm never moves its tip so
        return
    q, qd = rng.uniform(-2.0, 2.0, n), rng.normal(size=n)
    J = arm.jacobian(q, axes="tip")[{"pose": slice(0, 6), "position": slice(0, 3), "orientation": slice(3, 6)}[part]]
    gains = np.linalg.svd(J, compute_uv=False)
    if gains[-1] > 1e-2 * gains[0]:
        found, defined = rows_of(arm, part, q, qd)
        for mine, theirs in zip(numbers(found), numbers(defined), strict=True):
            np.testing.assert_allclose(mine, theirs, rtol=1e-9, atol=1e-9 * max(1.0, np.abs(theirs).max()))


def numbers(found: Any) -> tuple[Array, ...]:
    return found.sigma, found.rows.phi, found.rows.Lg, found.rows.Lf


@pytest.mark.parametrize("angle", [1e-3, -1e-3, 1e-5, 1e-7])
def test_near_a_singular_configuration(angle: float) -> None:
    """There the definition loses digits of the curvature, which is continuous on each side."""
    arm = robot("ur5")
    found, defined = rows_of(arm, "pose", np.array(WRIST) + np.eye(6)[4] * angle, 0.5 * np.ones(6))
    np.testing.assert_allclose(found.sigma, defined.sigma, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.rows.phi, defined.rows.phi, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.rows.Lg, defined.rows.Lg, rtol=0.0, atol=1e-9)
    beside = rows_of(arm, "pose", np.array(WRIST) + np.eye(6)[4] * np.copysign(1e-3, angle), 0.5 * np.ones(6))[1]
    np.testing.assert_allclose(found.rows.Lf, beside.rows.Lf, rtol=2e-3)


def test_in_a_singular_configuration_the_gradient_is_that_of_one_side() -> None:
    """As with the definition: which side is left to rounding."""
    arm = robot("ur5")
    for q in (np.array(WRIST), np.zeros(6)):
        found, defined = rows_of(arm, "pose", q, 0.5 * np.ones(6))
        sign = np.sign(found.rows.Lg[0] @ defined.rows.Lg[0]) or 1.0
        np.testing.assert_allclose(found.rows.Lg, sign * defined.rows.Lg, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(found.sigma, defined.sigma, rtol=0.0, atol=1e-12)
        assert np.isfinite(found.rows.Lf).all()


def test_where_a_singular_value_is_exactly_zero_the_gradient_still_has_a_direction() -> None:
    """A joint that turns a slide that is not extended: the tip moves along the slide only."""
    arm = Robot.from_dh([[0.0, 0.0, 0.0, np.pi / 2], [0.0, 0.0, 0.0, 0.0]], prismatic=[2])
    found, defined = rows_of(arm, "position", np.zeros(2), np.array([0.2, 0.3]))
    assert found.sigma.tolist() == defined.sigma.tolist() == [0.25]
    np.testing.assert_allclose(np.abs(found.rows.Lg), [[0.0, 1.5]], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(np.abs(defined.rows.Lg), [[0.0, 1.5]], rtol=0.0, atol=1e-12)
