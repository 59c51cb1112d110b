"""The compiled rows of manipulability, near singular configurations and for arms of every shape."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenes import random_scene, robot
from vsconstraints import Robot
from vsconstraints.compiled import available
from vsconstraints.compiled.manipulability_rows import SINGULAR
from vsconstraints.constraints import ConstraintSet, Manipulability
from vsconstraints.control import ControlStep
from vsconstraints.errors import ConfigurationError
from vsconstraints.robots.geometry import skew
from vsconstraints.rows import Array
from vsconstraints.vision.features import Goal, ImagePoints
from vsconstraints.vision.scene import Scene
from vsconstraints.vision.tracking import TrackingGains, VisualTask

pytestmark = pytest.mark.skipif(not available(), reason="there is no compiler here")

PARTS = ("pose", "position", "orientation")
GAINS = {"K": 0.3, "switching_gain": 1.0}
WRIST = [0.3, -1.2, 1.4, -0.8, 0.0, 0.2]
"""Of a UR5, with two axes of the wrist in line."""


def world(
    arm: Robot, constraints: list[Any], seed: int = 0
) -> tuple[Scene, VisualTask, Array, Array]:
    scene, q, qd = random_scene(arm, np.random.default_rng(seed), constraints)
    pixels = scene.glance(q)[0]
    task = VisualTask(
        ImagePoints(), [Goal(0.0, pixels, scene.camera.normalised(pixels))], TrackingGains(5.0)
    )
    return scene, task, q, qd


def rows_of(arm: Robot, part: Any, q: Array, qd: Array) -> tuple[Any, Any]:
    """Of the compiled step and of an oracle, wherever the markers are."""
    one = Manipulability(arm, minimum=0.05, scale=0.2, part=part, **GAINS)
    scene, task, _, _ = world(arm, [one])
    scene.markers[:] = scene.camera_pose(q).act(
        np.array([[0.1, 0.0, 1.0], [0.0, 0.1, 1.0], [-0.1, 0.0, 1.2]])
    )
    step = ControlStep(scene, ConstraintSet([one], scene), task)
    assert step.in_numpy == ()
    return step.evaluate(0.0, q, qd), oracle(one, scene.evaluate(0.0, q, qd).robot.J, qd)


def oracle(one: Manipulability, J: Array, qd: Array) -> Any:
    """σ, φ, L_gφ and L_fφ by the singular values of LAPACK, and brackets as matrices."""
    at = {"pose": slice(0, 6), "position": slice(0, 3), "orientation": slice(3, 6)}[one.part]
    weighted = weighted_inverse(J[at])
    change = jacobian_derivatives(J)[:, at]
    slope = change.reshape(len(change), -1) @ weighted.T.ravel()
    A, B, C = J[at], *(rate[at] for rate in jacobian_rates(J, qd))
    if A.shape[0] > A.shape[1]:
        A = A.T
        B = B.T
        C = C.T
    U, s, _ = np.linalg.svd(A, full_matrices=False)
    w = s.prod()
    s = np.maximum(s, SINGULAR)
    inverse = (U / s**2) @ U.T
    X = inverse @ (B @ A.T + A @ B.T)
    second = 2.0 * np.trace(inverse @ (C @ A.T + B @ B.T))
    bent = s.prod() * ((0.5 * np.trace(X)) ** 2 + 0.5 * (second - (X * X.T).sum()))
    factor = -1.0 / one.w_scale
    block = one.block(
        np.array([(one.minimum - w) / one.w_scale]),
        factor * slope @ qd[:, None],
        factor * slope[None],
        factor * bent,
    )
    return SimpleNamespace(
        sigma=block.sigma, rows=SimpleNamespace(phi=block.phi, Lg=block.Lg, Lf=block.Lf)
    )


def weighted_inverse(J: Array) -> Array:
    """(n, r) w J⁺ with w the product of the singular values: finite also where one of them is
    zero.
    """
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    others = np.where(np.eye(len(s), dtype=np.bool_), 1.0, s).prod(axis=1)
    weighted: Array = (Vt.T * others) @ U.T
    return weighted


def _structure() -> Array:
    """(6, 36) C with (a C) as a 6 × 6 matrix times b being [a, b] = (ω_a × v_b + v_a × ω_b, ω_a ×
    ω_b).
    """
    C = np.zeros((6, 6, 6))
    turns = skew(np.eye(3))
    C[:3, :3, 3:] = turns
    C[3:, :3, :3] = C[3:, 3:, 3:] = turns
    return C.reshape(6, 36)


_STRUCTURE = _structure()


def adjoints(twists: Array) -> Array:
    """(k, 6, 6) matrices of [a, ·] for twists a = (v, ω) (k, 6)."""
    matrices: Array = (twists @ _STRUCTURE).reshape(-1, 6, 6)
    return matrices


def jacobian_derivatives(J: Array) -> Array:
    """(n, 6, n) ∂J/∂q_k of a serial arm's tip Jacobian J (6, n) in the tip's frame, k first."""
    # a joint moves the columns of those before it, as seen from the tip
    n = J.shape[1]
    before = np.arange(n) < np.arange(n)[:, None]
    change: Array = (adjoints(J.T) @ -J) * before[:, None, :]
    return change


def jacobian_rates(J: Array, qd: Array) -> tuple[Array, Array]:
    """(6, n) J̇ and J̈ when q̈ = 0, for J as in :func:`jacobian_derivatives`."""
    columns = J.T
    turning = adjoints(_sum_after(columns * qd[:, None]))
    first = -(turning @ columns[:, :, None])[..., 0]
    turning_dot = adjoints(_sum_after(first * qd[:, None]))
    second = -(turning_dot @ columns[:, :, None] + turning @ first[:, :, None])[..., 0]
    return first.T, second.T


def _sum_after(twists: Array) -> Array:
    """(n, 6) what the joints after each one add to the tip's twist."""
    after: Array = twists[::-1].cumsum(axis=0)[::-1] - twists
    return after


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
    q = rng.uniform(-2.0, 2.0, n)
    qd = rng.normal(size=n)
    J = arm.jacobian(q, axes="tip")[
        {"pose": slice(0, 6), "position": slice(0, 3), "orientation": slice(3, 6)}[part]
    ]
    gains = np.linalg.svd(J, compute_uv=False)
    if gains[-1] > 1e-2 * gains[0]:
        found, defined = rows_of(arm, part, q, qd)
        for mine, theirs in zip(numbers(found), numbers(defined), strict=True):
            np.testing.assert_allclose(
                mine, theirs, rtol=1e-9, atol=1e-9 * max(1.0, np.abs(theirs).max())
            )


def numbers(found: Any) -> tuple[Array, ...]:
    return found.sigma, found.rows.phi, found.rows.Lg, found.rows.Lf


@pytest.mark.parametrize("angle", [1e-3, -1e-3, 1e-5, 1e-7])
def test_near_a_singular_configuration(angle: float) -> None:
    """There LAPACK's decomposition loses digits of the curvature, which is continuous on each
    side.
    """
    arm = robot("ur5")
    found, defined = rows_of(arm, "pose", np.array(WRIST) + np.eye(6)[4] * angle, 0.5 * np.ones(6))
    np.testing.assert_allclose(found.sigma, defined.sigma, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.rows.phi, defined.rows.phi, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.rows.Lg, defined.rows.Lg, rtol=0.0, atol=1e-9)
    beside = rows_of(
        arm, "pose", np.array(WRIST) + np.eye(6)[4] * np.copysign(1e-3, angle), 0.5 * np.ones(6)
    )[1]
    np.testing.assert_allclose(found.rows.Lf, beside.rows.Lf, rtol=2e-3)


def test_in_a_singular_configuration_the_gradient_is_that_of_one_side() -> None:
    """As by LAPACK: which side is left to rounding."""
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
