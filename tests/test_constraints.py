"""Values, labels, margins and clearances of constraints, against the paper's formulas and scipy's
distances.
"""

from __future__ import annotations

import dataclasses
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.spatial import cKDTree

from numpy_form import evaluate_rows
from scenes import build_constraint, camera, constraint_tables, gradient, random_scene, robot, slope
from vsconstraints import Camera, Robot, RobotPoint
from vsconstraints.constraints import (
    Bowl,
    Circle,
    Constraint,
    ConstraintSet,
    Curve,
    FieldOfView,
    ForbiddenSphere,
    Heart,
    Hyperellipse,
    ImageConstraint,
    JointConstraint,
    JointRange,
    JointSpeed,
    Occlusion,
    PointConstraint,
    RowBlock,
    Shape,
    SpeedConstraint,
    Trace,
    image_constraint,
    robot_points,
)
from vsconstraints.control import ControlStep
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.formulas import polylines
from vsconstraints.robots.geometry import Pose
from vsconstraints.rows import Array, Rows
from vsconstraints.scenarios import CONSTRAINTS
from vsconstraints.vision.features import Goal, ImagePoints
from vsconstraints.vision.motion import Motion
from vsconstraints.vision.scene import Scene, State
from vsconstraints.vision.tracking import TrackingGains, VisualTask

SQUARE = Camera((500.0, 500.0), (512, 512))
WIDE = Camera((710.1, 709.8), (640, 480))
GAINS = {"K": 0.2, "switching_gain": 10.0}


def viper() -> Robot:
    return robot("viper-s650")


def one_scene(*constraints: Constraint, seed: int = 3) -> tuple[Scene, State]:
    scene, q, qd = random_scene(viper(), np.random.default_rng(seed), list(constraints))
    return scene, scene.evaluate(0.0, q, qd)


def trace_of_pixels(pixels: Array, image_size: tuple[float, float] = (512, 512)) -> Trace:
    """A trace in which one marker is at each of some pixels (T, 2)."""
    T = len(pixels)
    return Trace(
        np.zeros(T),
        np.zeros((T, 6)),
        np.zeros((T, 6)),
        pixels[:, None, :],
        np.empty((T, 0, 3)),
        image_size,
    )


# --- labels ---


def test_labels_are_those_that_reports_and_files_use() -> None:
    arm = viper()
    points = [RobotPoint(), RobotPoint("link 3", (0.0, 0.1, 0.0), "elbow")]
    constraints = [
        FieldOfView(SQUARE, **GAINS),
        Occlusion(Bowl(), markers=[1], **GAINS),
        Occlusion(Circle(40.0), name="cup", markers=[3, 2], **GAINS),
        JointRange(arm, joints=[6], **GAINS),
        JointSpeed(arm, joints=[2, 5], switching_gain=1.0),
        ForbiddenSphere(centre=[0.5, 0.2, 0.4], radius=0.05, points=points, **GAINS),
        ForbiddenSphere(centre=[0.5, 0.2, 0.4], radius=0.05, name="post", **GAINS),
    ]
    scene, state = one_scene(*constraints)
    rows, sigma = evaluate_rows(ConstraintSet(constraints, scene), state)
    expected = (
        "fov[marker 1]",
        "fov[marker 2]",
        "fov[marker 3]",
        "occlusion[bowl, marker 1]",
        "occlusion[cup, marker 3]",
        "occlusion[cup, marker 2]",
        "range[joint 6].upper",
        "range[joint 6].lower",
        "speed[joint 2].upper",
        "speed[joint 5].upper",
        "speed[joint 2].lower",
        "speed[joint 5].lower",
        "sphere[tip]",
        "sphere[elbow]",
        "sphere[post, tip]",
    )
    assert rows.labels == expected
    assert sigma.shape == (15,)
    assert rows.Lg.shape == (15, 6)


def test_the_set_knows_kind_unit_gain_scale_and_length_of_every_row() -> None:
    arm = viper()
    constraints = [
        FieldOfView(SQUARE, K=0.2, switching_gain=10.0, margin=0.05, markers=[2]),
        JointSpeed(arm, joints=[2], lower=[-0.5], upper=[0.4], switching_gain=1.0, margin=0.1),
        ForbiddenSphere(centre=[0.5, 0.2, 0.4], radius=0.05, K=0.1, switching_gain=0.2),
        Occlusion(Hyperellipse(100.0, 60.0), K=3.0, switching_gain=1.5, markers=[1]),
        JointRange(
            arm, joints=[6], lower=[-1.1], upper=[0.1], K=0.1, switching_gain=2.0, margin=0.5
        ),
    ]
    scene, _ = one_scene(*constraints)
    together = ConstraintSet(constraints, scene)
    assert together.kinds == ("fov", "speed", "speed", "sphere", "occlusion", "range", "range")
    assert together.units == ("px", "rad/s", "rad/s", "m", "px", "rad", "rad")
    np.testing.assert_array_equal(together.switching_gain, [10.0, 1.0, 1.0, 0.2, 1.5, 2.0, 2.0])
    np.testing.assert_array_equal(together.scale, [1.0, 1.0, 1.0, 0.05, 1.0, 1.0, 1.0])
    lengths = [256.0 * 0.95, 0.4 * 0.9, 0.5 * 0.9, 0.05, 60.0, 0.6 * 0.5, 0.6 * 0.5]
    np.testing.assert_allclose(together.characteristic_length, lengths)


def test_rows_with_the_same_label_are_refused() -> None:
    twice = [FieldOfView(SQUARE, margin=m, markers=[2], **GAINS) for m in (0.05, 0.2)]
    scene, _ = one_scene(*twice)
    with pytest.raises(ConfigurationError, match=r"fov\[marker 2\] appears more than once.*names"):
        ConstraintSet(twice, scene)
    spheres = [ForbiddenSphere(centre=[x, 0, 0], radius=0.1, **GAINS) for x in (0.0, 1.0)]
    scene, _ = one_scene(*spheres)
    with pytest.raises(ConfigurationError, match=r"sphere\[tip\]"):
        ConstraintSet(spheres, scene)


def test_a_scene_without_the_constraints_points_is_refused() -> None:
    sphere = ForbiddenSphere(centre=[0, 0, 0], radius=0.1, points=[RobotPoint("link 2")], **GAINS)
    scene, _ = one_scene()
    with pytest.raises(ConfigurationError, match="robot_points"):
        ConstraintSet([sphere], scene)


def test_no_constraint_at_all() -> None:
    scene, state = one_scene()
    nothing = ConstraintSet([], scene)
    rows, sigma = evaluate_rows(nothing, state)
    assert rows.labels == ()
    assert rows.Lg.shape == (0, 6)
    assert sigma.shape == (0,)
    trace = Trace(
        np.zeros(4),
        np.zeros((4, 6)),
        np.zeros((4, 6)),
        np.zeros((4, 3, 2)),
        np.empty((4, 0, 3)),
        (640, 480),
    )
    assert nothing.clearance(trace).shape == (4, 0)


def test_rows_of_several_constraints_are_those_of_each() -> None:
    arm = viper()
    constraints: list[Constraint] = []
    for type_name in CONSTRAINTS:
        constraints += [
            build_constraint(type_name, table, arm)
            for table in constraint_tables(type_name, arm)[-1:]
        ]
    scene, state = one_scene(*constraints)
    together, sigma = evaluate_rows(ConstraintSet(constraints, scene), state)
    at = 0
    for constraint in constraints:
        alone_scene = Scene(arm, scene.camera, scene.markers, constraint.points)
        alone = ConstraintSet([constraint], alone_scene)
        rows, alone_sigma = evaluate_rows(
            alone, alone_scene.evaluate(0.0, state.robot.q, state.robot.qd)
        )
        part = slice(at, at + len(rows.labels))
        assert together.labels[part] == rows.labels
        np.testing.assert_allclose(sigma[part], alone_sigma, rtol=1e-13)
        np.testing.assert_allclose(together.phi[part], rows.phi, rtol=1e-13)
        np.testing.assert_allclose(together.Lg[part], rows.Lg, rtol=1e-13)
        np.testing.assert_allclose(together.Lf[part], rows.Lf, rtol=1e-13)
        at = part.stop
    assert at == len(together.labels)


# --- field of view ---


@pytest.mark.parametrize(
    ("arguments", "half_size"),
    [
        ({"margin": 0.05}, (0.95 * 320, 0.95 * 240)),
        ({"margin_px": 30.0}, (290.0, 210.0)),
        ({"margin": 0.0}, (320.0, 240.0)),
        ({"margin_px": 0}, (320.0, 240.0)),
        ({}, (320.0, 240.0)),
    ],
)
def test_margins_in_fractions_and_pixels(
    arguments: dict[str, float], half_size: tuple[float, float]
) -> None:
    fov = FieldOfView(WIDE, **arguments, **GAINS)
    a, b = half_size
    np.testing.assert_allclose(fov.half_size, half_size)
    on_the_axes = np.array([[a, 0.0], [-a, 0.0], [0.0, b], [0.0, -b]])
    np.testing.assert_allclose(fov.sigma(on_the_axes), 0.0, atol=1e-14)
    # eq. (20) with n = 16, in the middle of the first quadrant
    corner = np.array([a, b]) * 0.5 ** (1.0 / 16.0)
    assert fov.sigma(corner) == pytest.approx(0.0, abs=1e-13)
    assert fov.sigma(1.001 * corner) > 0.0
    assert fov.sigma(0.999 * corner) < 0.0
    assert fov.sigma(np.zeros(2)) == -1.0


def test_field_of_view_is_eq_20() -> None:
    fov = FieldOfView(SQUARE, margin=0.05, n=16, **GAINS)
    u = 100.0
    v = -230.0
    a = 256.0 * 0.95
    assert fov.sigma(np.array([u, v])) == pytest.approx(
        (u / a) ** 16 + (v / a) ** 16 - 1.0, rel=1e-14
    )
    assert FieldOfView(SQUARE, n=3, **GAINS).sigma(np.array([-u, v])) == pytest.approx(
        (u / 256) ** 3 + (230 / 256) ** 3 - 1.0, rel=1e-14
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"margin": 0.1, "margin_px": 3.0}, "not both"),
        ({"margin": 1.0}, "0 ≤ margin < 1"),
        ({"margin": -0.1}, "0 ≤ margin < 1"),
        ({"margin": np.nan}, "0 ≤ margin < 1"),
        ({"margin_px": 240.0}, "margin_px < 240"),
        ({"margin_px": -1.0}, "margin_px < 240"),
        ({"n": 1.5}, "2 or more"),
        ({"n": np.inf}, "n of fov must be a positive number"),
        ({"K": 0.0}, "K of fov must be a positive number"),
        ({"K": np.nan}, "K of fov must be a positive number"),
        ({"K": "0.1"}, "K of fov must be a positive number"),
        ({"switching_gain": -1.0}, "switching_gain of fov must be a positive number"),
        ({"switching_gain": np.inf}, "switching_gain of fov must be a positive number"),
        ({"markers": []}, "markers of fov are counted from 1"),
        ({"markers": [0, 1]}, "markers of fov are counted from 1"),
        ({"markers": [1, 1]}, "without repetition"),
        ({"markers": [1.5]}, "markers of fov"),
        ({"markers": ["1"]}, "markers of fov"),
    ],
)
def test_a_field_of_view_that_is_none_is_refused(arguments: dict[str, object], words: str) -> None:
    with pytest.raises((ConfigurationError, InvalidInput), match=words):
        FieldOfView(WIDE, **{**GAINS, **arguments})


def test_numpy_numbers_are_numbers() -> None:
    fov = FieldOfView(
        WIDE, K=np.int64(1), switching_gain=np.float32(2.0), n=np.int32(4), markers=np.array([2, 1])
    )
    assert (fov.K, fov.switching_gain, fov.n) == (1.0, 2.0, 4.0)
    assert fov.markers == (2, 1)


def test_a_marker_that_the_scene_does_not_have_is_named() -> None:
    fov = FieldOfView(SQUARE, markers=[2, 4], **GAINS)
    scene, _ = one_scene()
    with pytest.raises(ConfigurationError, match="no marker 4; the scene has 3"):
        fov.labels(scene)


def test_rows_of_some_markers_are_theirs() -> None:
    every = FieldOfView(WIDE, **GAINS)
    some = FieldOfView(WIDE, markers=[3, 1], **GAINS)
    scene, state = one_scene()
    all_rows, _ = evaluate_rows(ConstraintSet([every], scene), state)
    rows, _ = evaluate_rows(ConstraintSet([some], scene), state)
    assert rows.labels == ("fov[marker 3]", "fov[marker 1]")
    for name in ("phi", "Lg", "Lf"):
        np.testing.assert_allclose(getattr(rows, name), getattr(all_rows, name)[[2, 0]], rtol=1e-14)


# --- curves ---


def bowl_as_printed(u: float, v: float) -> float:
    """Eq. (45)."""
    return 1 - 45**-2 * (0.7**2 * (u + 50) ** 2 + ((v - 20) - (u + 50) ** 2) ** 2)


def heart_as_printed(u: float, v: float) -> float:
    """Eq. (46)."""
    return 1 - 35**-2 * (0.8**2 * (u + 102) ** 2 + (v - abs(u + 102)) ** 2)


@pytest.mark.parametrize(
    "pixel", [(-50, 20), (-50, 60), (-44, 40.5), (-100, 200), (0, 0), (255, -255), (-43, 71)]
)
def test_the_bowl_is_eq_45(pixel: tuple[float, float]) -> None:
    curve = Curve(Bowl(), (-50.0, 20.0))
    assert curve.value(np.array(pixel, dtype=float)) == pytest.approx(
        bowl_as_printed(*pixel), rel=1e-13
    )


PIXELS = [(-102, 0), (-102, 35), (-120, 3), (-90, 40.5), (0, 0), (255, -255), (-130, 71)]


@pytest.mark.parametrize("pixel", PIXELS)
def test_the_heart_is_eq_46(pixel: tuple[float, float]) -> None:
    curve = Curve(Heart(), (-102.0, 0.0))
    assert curve.value(np.array(pixel, dtype=float)) == pytest.approx(
        heart_as_printed(*pixel), rel=1e-13
    )


@pytest.mark.parametrize("pixel", PIXELS)
def test_the_rotated_heart_is_evaluated_at_minus_v_and_u_plus_102(
    pixel: tuple[float, float],
) -> None:
    """Turned clockwise by 90° about its own centre with v drawn upwards: its tip then points to
    −u.
    """
    curve = Curve(Heart(), (-102.0, 0.0), rotation=-np.pi / 2)
    u, v = pixel
    assert curve.value(np.array(pixel, dtype=float)) == pytest.approx(
        heart_as_printed(-v - 102, u + 102), rel=1e-12
    )


def test_the_hearts_corners_are_where_they_are_said_to_be() -> None:
    heart = Heart()
    np.testing.assert_allclose(heart.value(np.array([[0.0, 35.0], [0.0, -35.0]])), 0.0, atol=1e-15)
    turned = Curve(heart, (-102.0, 0.0), rotation=-np.pi / 2)
    np.testing.assert_allclose(
        turned.value(np.array([[-137.0, 0.0], [-67.0, 0.0]])), 0.0, atol=1e-14
    )
    # at a corner the gradient is the mean of both sides
    for v in (35.0, -35.0):
        sides = heart.gradient(np.array([[1e-9, v], [-1e-9, v]]))
        np.testing.assert_allclose(
            heart.gradient(np.array([0.0, v])), sides.mean(axis=0), atol=1e-9
        )


def test_a_rotated_curve_is_the_curve_at_turned_points() -> None:
    """The rotation turns u towards v: a point of the shape moves by [cos −sin; sin cos]."""
    rng = np.random.default_rng(4)
    for shape in (Bowl(), Heart(), Hyperellipse(80.0, 30.0, 3.0), Circle(20.0)):
        angle = float(rng.uniform(-3, 3))
        centre = rng.uniform(-50, 50, 2)
        c = np.cos(angle)
        s = np.sin(angle)
        p = rng.uniform(-60, 60, (10, 2))
        moved = p @ np.array([[c, -s], [s, c]]).T + centre
        found = Curve(shape, tuple(centre), angle).value(moved)
        np.testing.assert_allclose(found, shape.value(p), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("shape", [Bowl(), Heart(), Hyperellipse(80.0, 30.0, 3.0), Circle(20.0)])
def test_gradients_of_curves(shape: Shape) -> None:
    curve = Curve(shape, (12.0, -7.0), 0.4)
    for y in np.random.default_rng(5).uniform(-90, 90, (10, 2)):
        numerical = gradient(curve.value, y, 1e-4)
        np.testing.assert_allclose(
            curve.gradient(y), numerical, rtol=1e-7, atol=1e-9 * np.abs(numerical).max()
        )


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Circle(0.0), "radius of a shape must be a positive number"),
        (lambda: Circle(np.nan), "radius of a shape must be a positive number"),
        (lambda: Hyperellipse(-1.0, 1.0), "a of a shape must be a positive number"),
        (lambda: Hyperellipse(1.0, np.inf), "b of a shape must be a positive number"),
        (lambda: Hyperellipse(1.0, 1.0, 1.0), "2 or more"),
        (lambda: Bowl(width=0.0), "width of a shape must be a positive number"),
        (lambda: Heart(radius=-35.0), "radius of a shape must be a positive number"),
        (lambda: Curve(Circle(1.0), (0.0,)), "centre of circle"),
        (lambda: Curve(Circle(1.0), (0.0, np.nan)), "centre of circle"),
        (lambda: Curve(Circle(1.0), rotation=np.inf), "rotation of circle"),
        (lambda: Occlusion(Circle(1.0), K=0.1, switching_gain=0.0), "switching_gain of occlusion"),
        (lambda: Occlusion(Circle(1.0), margin=np.nan, **GAINS), "margin of occlusion"),
        (lambda: Occlusion(Circle(1.0), margin=np.inf, **GAINS), "margin of occlusion"),
    ],
)
def test_a_curve_that_is_none_is_refused(make, words: str) -> None:
    with pytest.raises((ConfigurationError, InvalidInput), match=words):
        make()


def test_an_occlusions_margin_moves_its_boundary_outwards() -> None:
    plain = Occlusion(Circle(50.0), **GAINS)
    wider = Occlusion(Circle(50.0), margin=0.44, **GAINS)
    on_circle = np.array([50.0, 0.0])
    assert plain.sigma(on_circle) == pytest.approx(0.0, abs=1e-15)
    assert wider.sigma(on_circle) == pytest.approx(0.44)
    # 1 − r²/50² + 0.44 = 0 at r = 60
    assert wider.sigma(np.array([0.0, 60.0])) == pytest.approx(0.0, abs=1e-14)


# --- clearance in the image ---


def test_clearance_of_a_circle_is_the_distance_to_it() -> None:
    """Far away, near, inside and at the centre; for an off-centre circle."""
    centre = np.array([30.0, -20.0])
    radius = 70.0
    occlusion = Occlusion(Curve(Circle(radius), tuple(centre)), **GAINS)
    rng = np.random.default_rng(6)
    pixels = np.vstack((rng.uniform(-256, 256, (200, 2)), [centre], [[2000.0, -3000.0]]))
    expected = np.linalg.norm(pixels - centre, axis=1) - radius
    found = occlusion.clearance(trace_of_pixels(pixels), slice(0, 0))[:, 0]
    # vertices stand up to 1.5 px apart: the arc's height above the chord is 1.5²/(8 r) = 0.004 px
    np.testing.assert_allclose(found, expected, atol=0.005)
    assert (np.sign(found) == np.sign(expected)).all()


def distance_to_hyperellipse(p: Array, a: float, b: float, n: float) -> float:
    """Least distance to |u/a|ⁿ + |v/b|ⁿ = 1, by scipy over u and over v as the curve's
    parameter.
    """
    nearest = np.inf
    # by symmetry the nearest point is in the point's own quadrant
    u, v = np.abs(p)
    for long, short, x, y in ((a, b, u, v), (b, a, v, u)):
        end = long * 0.5 ** (1.0 / n)

        def away(s: float, long=long, short=short, x=x, y=y) -> float:
            return float(np.hypot(s - x, short * (1.0 - (s / long) ** n) ** (1.0 / n) - y))

        grid = np.linspace(0.0, end, 200)
        best = grid[int(np.argmin([away(s) for s in grid]))]
        bounds = (max(0.0, best - grid[1]), min(end, best + grid[1]))
        found = minimize_scalar(away, bounds=bounds, method="bounded", options={"xatol": 1e-10})
        nearest = min(nearest, found.fun, away(0.0), away(end))
    return nearest


@pytest.mark.parametrize(("a", "b", "n"), [(120.0, 40.0, 2.0), (100.0, 60.0, 4.0)])
def test_clearance_of_hyperellipses_is_scipys_distance(a: float, b: float, n: float) -> None:
    occlusion = Occlusion(Hyperellipse(a, b, n), **GAINS)
    rng = np.random.default_rng(7)
    pixels = np.vstack((rng.uniform(-250, 250, (40, 2)), rng.uniform(-60, 60, (40, 2))))
    inside = (np.abs(pixels / [a, b]) ** n).sum(axis=1) < 1.0
    assert 10 < inside.sum() < 70
    distances = np.array([distance_to_hyperellipse(p, a, b, n) for p in pixels])
    expected = distances * np.where(inside, -1.0, 1.0)
    found = occlusion.clearance(trace_of_pixels(pixels), slice(0, 0))[:, 0]
    np.testing.assert_allclose(found, expected, atol=0.01)


def test_clearance_of_the_field_of_view_is_positive_inside() -> None:
    fov = FieldOfView(WIDE, margin_px=30.0, **GAINS)
    pixels = np.array(
        [[0.0, 0.0], [289.0, 0.0], [0.0, -209.5], [300.0, 0.0], [0.0, 230.0], [-290.0, 0.0]]
    )
    found = fov.clearance(trace_of_pixels(pixels, (640, 480)), slice(0, 0))[:, 0]
    # the sides of a hyperellipse with n = 16 are all but straight lines at u = ±290, v = ±210
    np.testing.assert_allclose(found, [210.0, 1.0, 0.5, -10.0, -20.0, 0.0], atol=0.01)
    expected = [distance_to_hyperellipse(p, 290.0, 210.0, 16.0) for p in pixels]
    np.testing.assert_allclose(np.abs(found), expected, atol=0.01)


def nearest_crossing(curve: Curve, p: Array) -> float:
    """How far the curve is from p, looked for along 360 rays in steps of a quarter of a pixel."""
    angles = np.deg2rad(np.arange(360.0))
    along = np.arange(0.0, 120.0, 0.25)
    rays = p + along[:, None, None] * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    inside = curve.value(rays) > 0.0
    crossed = (inside != inside[0]).any(axis=1)
    return float(along[np.argmax(crossed)] - 0.125)


@pytest.mark.parametrize("shape", [Bowl(), Heart()])
def test_clearance_of_bowl_and_heart(shape: Shape) -> None:
    """The sign of the curve's value, and the distance to where that changes its sign."""
    curve = Curve(shape, (-50.0, 20.0), 0.6)
    occlusion = Occlusion(curve, **GAINS)
    pixels = curve.centre + np.random.default_rng(8).uniform(-40, 40, (40, 2))
    found = occlusion.clearance(trace_of_pixels(pixels), slice(0, 0))[:, 0]
    inside = curve.value(pixels) > 0.0
    assert 3 < inside.sum() < 37
    np.testing.assert_array_equal(found < 0.0, inside)
    expected = [nearest_crossing(curve, p) for p in pixels]
    # half a step, and next to a corner that falls between two rays sin(0.5°) of 60 px
    np.testing.assert_allclose(np.abs(found), expected, atol=0.65)


@pytest.mark.parametrize("compiled", [True, False])
def test_clearance_at_a_concave_corner_is_that_of_the_nearest_side(
    compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A heart's two sides, w u = r cos a and v = r sin a + |u|, meet in a corner at (0, r)."""
    if not compiled:
        monkeypatch.setattr(image_constraint, "load", lambda name: polylines)
    heart = Occlusion(Curve(Heart(35.0, 0.8)), K=0.1, switching_gain=1.0)
    rng = np.random.default_rng(3)
    pixels = np.array([0.0, 35.0]) + rng.uniform(-6.0, 6.0, size=(800, 2))
    angle = np.linspace(0.0, 2.0 * np.pi, 2_000_001)
    u = 35.0 / 0.8 * np.cos(angle)
    true = cKDTree(np.stack((u, 35.0 * np.sin(angle) + np.abs(u)), axis=1)).query(pixels)[0]
    found = np.abs(heart.clearance(trace_of_pixels(pixels), slice(0, 0))[:, 0])
    np.testing.assert_allclose(found, true, atol=1.5e-3)
    # a wedge of two long segments and a short one that ends between them: every segment counts, by
    # brute force
    wedge = [
        np.array([[-50.0, 40.0], [0.0, 0.0], [50.0, 40.0]]),
        np.array([[0.0, 30.0], [0.0, 30.2]]),
    ]
    points = rng.uniform(-40.0, 60.0, size=(300, 2))
    expected = np.full(len(points), np.inf)
    for line in wedge:
        share = np.linspace(0.0, 1.0, 20_001)[:, None]
        dense = np.concatenate([a + share * (b - a) for a, b in pairwise(line)])
        expected = np.minimum(expected, cKDTree(dense).query(points)[0])
    np.testing.assert_allclose(
        image_constraint.Polylines(wedge).distance(points), expected, atol=3e-3
    )


def test_a_curve_is_found_once_for_all_that_have_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of another setting have another one, and where the formula is not all that counts it is
    found each time.
    """
    found = []
    real = image_constraint.zero_lines

    def counted(*arguments: Any) -> Any:
        found.append(arguments)
        return real(*arguments)

    monkeypatch.setattr(image_constraint, "zero_lines", counted)
    pixels = np.random.default_rng(1).uniform(-200.0, 200.0, (5, 2))

    def clearance(radius: float, centre: float = 41.37) -> Array:
        one = Occlusion(Curve(Circle(radius), (centre, 0.0)), **GAINS)
        return one.clearance(trace_of_pixels(pixels), slice(0, 0))

    for radius, centre in (
        (31.7, 41.37),
        (31.7, 41.37),
        (31.8, 41.37),
        (31.7, 41.38),
        (31.8, 41.37),
    ):
        away = np.hypot(pixels[:, 0] - centre, pixels[:, 1]) - radius
        np.testing.assert_allclose(clearance(radius, centre)[:, 0], away, atol=2e-3)
    assert len(found) == 3

    class Own(Occlusion):
        def sigma(self, pixels: Array) -> Array:
            return super().sigma(pixels)

    own = Own(Curve(Circle(31.7), (41.37, 0.0)), **GAINS)
    for _ in range(2):
        np.testing.assert_array_equal(
            own.clearance(trace_of_pixels(pixels), slice(0, 0)), clearance(31.7)
        )
    assert len(found) == 5


def test_a_moving_curve_is_found_once_for_times_that_are_nearly_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = []
    real = image_constraint.zero_lines

    def counted(*arguments: Any) -> Any:
        found.append(arguments)
        return real(*arguments)

    monkeypatch.setattr(image_constraint, "zero_lines", counted)
    velocity = np.array([-310.0, 140.0])
    one = Occlusion(Curve(Circle(31.9), (41.37, 0.0)), **GAINS)
    one.moving(Motion(velocity.tolist()))
    pixels = np.random.default_rng(1).uniform(-200.0, 200.0, (60, 2))
    for first, last in ((0.0, 2.0), (0.1, 1.95), (0.0, 2.2)):
        t = np.linspace(first, last, 60)
        trace = dataclasses.replace(trace_of_pixels(pixels), t=t)
        away = np.linalg.norm(pixels - [41.37, 0.0] - t[:, None] * velocity, axis=1) - 31.9
        np.testing.assert_allclose(one.clearance(trace, slice(0, 0))[:, 0], away, atol=2e-3)
    assert len(found) == 1
    trace = dataclasses.replace(trace_of_pixels(pixels), t=np.linspace(2.0, 3.0, 60))
    one.clearance(trace, slice(0, 0))
    assert len(found) == 2


def test_clearance_of_a_curve_outside_the_image_is_infinite() -> None:
    occlusion = Occlusion(Curve(Circle(10.0), (5000.0, 0.0)), **GAINS)
    found = occlusion.clearance(trace_of_pixels(np.zeros((1, 2))), slice(0, 0))
    assert np.isposinf(found).all()


# --- joints ---


def test_ranges_and_their_gradient_are_the_true_derivative() -> None:
    """Eq. (25): σ = |q̃| − 1 with q̃ = (q − mid)/(Δq/2), whose derivative is ±2/Δq (eq. 27 has lost
    the factor).
    """
    row = JointRange(
        viper(), joints=[6], lower=[-1.1], upper=[0.1], margin=0.1, K=0.1, switching_gain=2.0
    )
    q = np.array([0, 0, 0, 0, 0, -0.35])
    np.testing.assert_allclose(row.sigma(q), [0.15 / 0.6 - 0.9, -0.15 / 0.6 - 0.9])
    np.testing.assert_allclose(row.gradient(q)[:, 5], [2 / 1.2, -2 / 1.2])
    assert np.abs(row.gradient(q)[:, :5]).max() == 0.0
    for edge, side in ((0.1, 0), (-1.1, 1)):
        q[5] = edge
        assert row.sigma(q)[side] == pytest.approx(0.1)
    # clearance in rad, from the range less its margin
    trace = Trace(
        np.zeros(1),
        np.zeros((1, 6)),
        np.zeros((1, 6)),
        np.empty((1, 0, 2)),
        np.empty((1, 0, 3)),
        (1, 1),
    )
    np.testing.assert_allclose(row.clearance(trace, slice(0, 0)), [[0.04 - 0.0, 0.04 + 1.0]])


def test_speeds_have_their_own_limit_on_each_side() -> None:
    row = JointSpeed(viper(), joints=[2], lower=[-0.5], upper=[0.4], switching_gain=1.0, margin=0.1)
    qd = np.array([0, 0.2, 0, 0, 0, 0])
    np.testing.assert_allclose(row.phi(qd), [0.2 / 0.4 - 0.9, -0.2 / 0.5 - 0.9])
    np.testing.assert_allclose(row.gradient(qd)[:, 1], [1 / 0.4, -1 / 0.5])
    trace = Trace(
        np.zeros(1), np.zeros((1, 6)), qd[None], np.empty((1, 0, 2)), np.empty((1, 0, 3)), (1, 1)
    )
    np.testing.assert_allclose(row.clearance(trace, slice(0, 0)), [[0.36 - 0.2, 0.45 + 0.2]])
    symmetric = JointSpeed(viper(), joints=[2], upper=[0.4], switching_gain=1.0)
    np.testing.assert_array_equal(symmetric.lower, [-0.4])


def test_limits_that_are_not_given_are_the_robots() -> None:
    arm = viper()
    every = JointRange(arm, **GAINS)
    assert every.joints == (1, 2, 3, 4, 5, 6)
    np.testing.assert_allclose(every.upper, arm.q_max)
    np.testing.assert_allclose(every.lower, arm.q_min)
    speed = JointSpeed(arm, joints=[3], switching_gain=1.0)
    assert speed.upper[0] == arm.qd_max[2]
    partly = Robot.from_dh(np.ones((3, 4)), q_min=[-np.inf, -1, -2], q_max=[np.inf, 1, np.inf])
    assert JointRange(partly, **GAINS).joints == (2,)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: JointRange(robot("planar-3r"), **GAINS), "planar 3R has no limits for range"),
        (
            lambda: JointSpeed(robot("planar-3r"), switching_gain=1.0),
            "planar 3R has no limits for speed",
        ),
        (
            lambda: JointRange(robot("planar-3r"), joints=[1], **GAINS),
            "lower of range must be a finite number",
        ),
        (lambda: JointRange(viper(), joints=[0], **GAINS), "counted from 1"),
        (lambda: JointRange(viper(), joints=[7], **GAINS), "from 1 to 6"),
        (lambda: JointRange(viper(), joints=[], **GAINS), "counted from 1"),
        (lambda: JointRange(viper(), joints=[2, 2], **GAINS), "without repetition"),
        (lambda: JointRange(viper(), joints=["2"], **GAINS), "joints of range"),
        (lambda: JointRange(viper(), joints=[1.5], **GAINS), "joints of range"),
        (
            lambda: JointRange(viper(), joints=[1], lower=[1.0], upper=[0.0], **GAINS),
            "lower of range must be below",
        ),
        (lambda: JointRange(viper(), joints=[1], upper=[0.0, 1.0], **GAINS), "upper of range"),
        (lambda: JointRange(viper(), joints=[1], upper=[np.nan], **GAINS), "upper of range"),
        (lambda: JointRange(viper(), joints=[1], upper=["a"], **GAINS), "upper of range"),
        (lambda: JointRange(viper(), margin=1.0, **GAINS), r"margin of range must be in \[0, 1\)"),
        (lambda: JointRange(viper(), margin=-0.1, **GAINS), r"margin of range must be in \[0, 1\)"),
        (
            lambda: JointSpeed(viper(), margin=np.nan, switching_gain=1.0),
            r"margin of speed must be in \[0, 1\)",
        ),
        (
            lambda: JointSpeed(viper(), joints=[1], lower=[0.1], switching_gain=1.0),
            "lower < 0 < upper",
        ),
        (
            lambda: JointSpeed(viper(), joints=[1], upper=["a"], switching_gain=1.0),
            "upper of speed",
        ),
        (lambda: JointSpeed(viper(), switching_gain=0.0), "switching_gain of speed"),
        (lambda: JointRange(viper(), K=-0.1, switching_gain=1.0), "K of range"),
    ],
)
def test_joint_limits_that_are_none_are_refused(make, words: str) -> None:
    with pytest.raises((ConfigurationError, InvalidInput), match=words):
        make()


# --- workspace ---


def test_a_sphere_is_eq_47() -> None:
    sphere = ForbiddenSphere(
        centre=[0.57, 0.2, 0.405], radius=0.05, margin=0.01, K=0.1, switching_gain=0.2
    )
    p = np.array([[0.57, 0.2, 0.505], [0.57, 0.14, 0.405], [0.57, 0.2, 0.405]])
    np.testing.assert_allclose(sphere.sigma(p), [0.06 - 0.1, 0.0, 0.06], atol=1e-16)
    np.testing.assert_allclose(sphere.gradient(p)[:2], [[0, 0, -1], [0, 1, 0]], atol=1e-15)
    trace = Trace(
        np.zeros(3), np.zeros((3, 6)), np.zeros((3, 6)), np.empty((3, 0, 2)), p[:, None], (1, 1)
    )
    np.testing.assert_allclose(
        sphere.clearance(trace, slice(0, 1))[:, 0], [0.04, 0.0, -0.06], atol=1e-16
    )


def test_a_sphere_is_finite_at_its_centre_and_leads_out() -> None:
    arm = viper()
    q = np.array([0.3, -1.0, 0.5, 0.2, 0.4, 0.1])
    tip = arm.pose(q).t
    sphere = ForbiddenSphere(centre=tip, radius=0.05, K=0.1, switching_gain=0.2)
    scene = Scene(arm, SQUARE, arm.pose(q).act(np.array([[0.0, 0.0, 1.0]])), sphere.points)
    constraints = ConstraintSet([sphere], scene)
    for qd in (np.zeros(6), np.full(6, 0.3)):
        rows, sigma = evaluate_rows(constraints, scene.evaluate(0.0, q, qd))
        assert sigma[0] == pytest.approx(0.05, abs=1e-12)
        for array in (rows.phi, rows.Lg, rows.Lf):
            assert np.isfinite(array).all()
        assert np.linalg.norm(rows.Lg) > 1e-3
    np.testing.assert_array_equal(sphere.gradient(np.array([tip])), [[0.0, 0.0, -1.0]])
    assert np.isfinite(sphere.curvature(np.array([tip]), np.array([[0.3, 0.2, 0.1]]))).all()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"radius": 0.0}, "radius of a sphere"),
        ({"radius": np.nan}, "radius of a sphere"),
        ({"centre": [0.0, 0.0]}, "centre of a sphere"),
        ({"centre": [0.0, np.inf, 0.0]}, "centre of a sphere"),
        ({"margin": -0.01}, "margin of a sphere"),
        ({"margin": np.nan}, "margin of a sphere"),
        ({"points": []}, "at least one robot point"),
        ({"K": 0.0}, "K of sphere"),
    ],
)
def test_a_sphere_that_is_none_is_refused(arguments: dict[str, object], words: str) -> None:
    with pytest.raises((ConfigurationError, InvalidInput), match=words):
        ForbiddenSphere(**{"centre": [0, 0, 0], "radius": 0.1, **GAINS, **arguments})


# --- own constraints ---


class Wall(ImageConstraint):
    """Markers stay left of a parabola: an own class without curvature."""

    kind = "wall"

    def sigma(self, y: Array) -> Array:
        return (y[..., 0] - 80.0 + 1e-3 * y[..., 1] ** 2) / 100.0

    def gradient(self, y: Array) -> Array:
        return np.stack((np.ones(y.shape[:-1]), 2e-3 * y[..., 1]), axis=-1) / 100.0


class WallWithCurvature(Wall):
    """The same, knowing its second derivative."""

    kind = "curved wall"

    def curvature(self, y: Array, velocity: Array) -> Array:
        return 2e-3 * velocity[..., 1] ** 2 / 100.0


class Floor(PointConstraint):
    """Points stay above a paraboloid: an own class without curvature."""

    kind = "floor"

    def sigma(self, y: Array) -> Array:
        return 0.1 + y[..., 0] ** 2 - y[..., 1] * y[..., 0] - y[..., 2]

    def gradient(self, y: Array) -> Array:
        x = y[..., 0]
        y_ = y[..., 1]
        one = np.ones(y.shape[:-1])
        return np.stack((2.0 * x - y_, -x, -one), axis=-1)


class FloorWithCurvature(Floor):
    kind = "curved floor"

    def curvature(self, y: Array, velocity: Array) -> Array:
        return 2.0 * velocity[..., 0] ** 2 - 2.0 * velocity[..., 0] * velocity[..., 1]


class Elbow(JointConstraint):
    """Two values of the joints: an own class without curvature."""

    kind = "elbow"
    names: ClassVar[tuple[str, ...]] = ("elbow[bent]", "elbow[folded]")

    def labels(self, scene: Scene) -> tuple[str, ...]:
        return self.names

    def sigma(self, q: Array) -> Array:
        return np.stack((np.sin(q[..., 1]) * q[..., 2] - 0.5, q[..., 3] ** 2 - 1.0), axis=-1)

    def gradient(self, q: Array) -> Array:
        g = np.zeros((*q.shape[:-1], 2, q.shape[-1]))
        g[..., 0, 1], g[..., 0, 2] = np.cos(q[..., 1]) * q[..., 2], np.sin(q[..., 1])
        g[..., 1, 3] = 2.0 * q[..., 3]
        return g

    def characteristic_length(self, scene: Scene) -> Array:
        return np.array([0.5, 1.0])


class ElbowWithCurvature(Elbow):
    kind = "curved elbow"
    names = ("curved elbow[bent]", "curved elbow[folded]")

    def curvature(self, q: Array, qd: Array) -> Array:
        bent = -np.sin(q[1]) * q[2] * qd[1] ** 2 + 2.0 * np.cos(q[1]) * qd[1] * qd[2]
        return np.array([bent, 2.0 * qd[3] ** 2])


class Energy(SpeedConstraint):
    """The norm of the speeds."""

    kind = "energy"

    def labels(self, scene: Scene) -> tuple[str, ...]:
        return ("energy",)

    def phi(self, qd: Array) -> Array:
        return (qd * qd).sum(axis=-1, keepdims=True) - 1.0

    def gradient(self, qd: Array) -> Array:
        return 2.0 * qd[..., None, :]

    def characteristic_length(self, scene: Scene) -> Array:
        return np.array([1.0])


OWN = {
    "image": lambda: Wall(K=0.3, switching_gain=1.0, length=80.0, markers=[3, 1]),
    "image with curvature": lambda: WallWithCurvature(K=0.3, switching_gain=1.0, length=80.0),
    "point": lambda: Floor(
        K=0.2, switching_gain=1.0, length=0.1, points=[RobotPoint("link 3"), RobotPoint()]
    ),
    "point with curvature": lambda: FloorWithCurvature(
        K=0.2, switching_gain=1.0, length=0.1, name="hill"
    ),
    "joint": lambda: Elbow(K=0.1, switching_gain=1.0),
    "joint with curvature": lambda: ElbowWithCurvature(K=0.1, switching_gain=1.0),
    "speed": lambda: Energy(switching_gain=1.0),
}


@pytest.mark.parametrize("make", OWN.values(), ids=OWN)
def test_own_constraints_work_through_a_constraint_set(make) -> None:
    constraint = make()
    scene, q, qd = random_scene(viper(), np.random.default_rng(9), [constraint])
    constraints = ConstraintSet([constraint], scene)
    rows, sigma = evaluate_rows(constraints, scene.evaluate(0.0, q, qd))

    def along(t: float) -> tuple[Array, Array]:
        moved, moved_sigma = evaluate_rows(constraints, scene.evaluate(0.0, q + t * qd, qd))
        return moved_sigma, moved.phi

    if not isinstance(constraint, SpeedConstraint):
        expected = sigma + constraint.K * slope(lambda t: along(t)[0], 2e-4)
        np.testing.assert_allclose(rows.phi, expected, rtol=1e-8, atol=1e-8)
        assert np.abs(rows.phi - sigma).max() > 1e-3
    numerical = gradient(
        lambda v: evaluate_rows(constraints, scene.evaluate(0.0, q, v))[0].phi, qd, 2e-4
    )
    np.testing.assert_allclose(rows.Lg, numerical, rtol=1e-7, atol=1e-9)
    # default curvatures are differences themselves: 1e-16 over their steps of 1e-6
    np.testing.assert_allclose(rows.Lf, slope(lambda t: along(t)[1], 2e-4), rtol=1e-6, atol=1e-7)
    assert rows.labels == constraint.labels(scene)
    trace = Trace(
        np.zeros(3),
        np.tile(q, (3, 1)),
        np.tile(qd, (3, 1)),
        np.tile(scene.glance(q)[0], (3, 1, 1)),
        np.tile(scene.glance(q)[1], (3, 1, 1)),
        scene.camera.size,
    )
    clearance = constraints.clearance(trace)
    assert clearance.shape == (3, len(rows.labels))
    assert ((clearance[0] < 0.0) == (sigma > 0.0)).all()
    assert constraints.characteristic_length.shape == (len(rows.labels),)


@pytest.mark.parametrize("kind", ["image", "point", "joint"])
def test_default_curvatures_are_the_known_ones(kind: str) -> None:
    plain = OWN[kind]()
    known = OWN[f"{kind} with curvature"]()
    rng = np.random.default_rng(10)
    size, shape = {"image": (200.0, (4, 2)), "point": (1.0, (4, 3)), "joint": (1.0, (6,))}[kind]
    y = rng.uniform(-size, size, shape)
    velocity = rng.uniform(-2, 2, y.shape)
    np.testing.assert_allclose(
        plain.curvature(y, velocity), known.curvature(y, velocity), rtol=1e-6, atol=1e-9
    )
    # at rest nothing curves, and nothing is divided by zero
    np.testing.assert_array_equal(plain.curvature(y, np.zeros_like(y)), 0.0)


def test_default_clearances_of_own_constraints() -> None:
    """A wall's distance in pixels is found on its boundary; a floor's to first order is exact for a
    plane.
    """
    wall = Wall(length=80.0, **GAINS)
    found = wall.clearance(
        trace_of_pixels(np.array([[80.0, 0.0], [70.0, 0.0], [95.0, 0.0]])), slice(0, 0)
    )[:, 0]
    np.testing.assert_allclose(found, [0.0, 10.0, -15.0], atol=0.01)
    elbow = Elbow(**GAINS)
    q = np.zeros((1, 6))
    q[0, 3] = 0.99
    trace = Trace(np.zeros(1), q, q, np.empty((1, 0, 2)), np.empty((1, 0, 3)), (1, 1))
    with np.errstate(divide="ignore"):  # at q = 0 the first row has no gradient
        clearance = elbow.clearance(trace, slice(0, 0))
    assert clearance[0, 1] == pytest.approx(0.01, rel=0.01)


def asked(constraints: list[Constraint], scene: Scene, state: State) -> Rows:
    """The rows as a control step gives them."""
    goal = Goal(0.0, state.pixels.position, state.normalised.position)
    step = ControlStep(
        scene,
        ConstraintSet(constraints, scene),
        VisualTask(ImagePoints(), [goal], TrackingGains(1.0)),
    )
    return step.evaluate(0.0, state.robot.q, state.robot.qd).rows


def test_an_own_constraint_with_rows_of_the_wrong_shape_is_named() -> None:
    class Broken(Energy):
        kind = "broken"

        def rows(self, state: State, points: slice) -> RowBlock:
            block = super().rows(state, points)
            return RowBlock(block.sigma, block.phi, block.Lg[:, :-1], block.Lf)

    constraint = Broken(switching_gain=1.0)
    scene, state = one_scene()
    with pytest.raises(InvalidInput, match="broken"):
        asked([constraint], scene, state)
    # also beside others, whose blocks are right
    with pytest.raises(InvalidInput, match="broken"):
        asked([FieldOfView(camera(), **GAINS), constraint], scene, state)


def test_an_own_point_constraint_keeps_to_its_points() -> None:
    """Each constraint sees its own slice of the scene's points."""
    floor = Floor(length=0.1, points=[RobotPoint("link 2"), RobotPoint("link 4")], **GAINS)
    sphere = ForbiddenSphere(
        centre=[0.1, 0.2, 0.3], radius=0.1, points=[RobotPoint("link 6")], **GAINS
    )
    scene, state = one_scene(sphere, floor)
    assert scene.points == robot_points([sphere, floor])
    _, sigma = evaluate_rows(ConstraintSet([sphere, floor], scene), state)
    arm = viper()
    q = state.robot.q
    where = arm.kinematics(
        q, np.zeros(6), [RobotPoint("link 6"), RobotPoint("link 2"), RobotPoint("link 4")]
    ).points
    np.testing.assert_allclose(
        sigma, [sphere.sigma(where[0]), floor.sigma(where[1]), floor.sigma(where[2])]
    )


def test_a_pose_that_is_not_the_identity_moves_the_points() -> None:
    """Offsets are in the link's own frame."""
    arm = viper()
    q = np.array([0.3, -1.0, 0.5, 0.2, 0.4, 0.1])
    tip: Pose = arm.pose(q)
    offset = (0.1, -0.2, 0.3)
    found = arm.kinematics(q, np.zeros(6), [RobotPoint("tip", offset)]).points[0]
    np.testing.assert_allclose(found, tip.act(np.array(offset)), atol=1e-14)


def test_the_clearance_to_a_sharp_bend_is_that_of_the_curve() -> None:
    """The bowl's outline bends with a radius of half a pixel; its true points come from solving
    (45) for v.
    """
    bowl = Occlusion(Curve(Bowl(), (-50.0, 20.0)), K=0.2, switching_gain=10.0)
    u = np.linspace(-64.0, 64.0, 2_000_001)
    half = np.sqrt(np.maximum(45.0**2 - (0.7 * u) ** 2, 0.0))
    outline = np.concatenate(
        [np.stack((u - 50.0, u**2 + side * half + 20.0), axis=1) for side in (1.0, -1.0)]
    )
    outline = outline[np.abs(outline[:, 1]) < 300.0]
    rng = np.random.default_rng(3)
    pixels = np.stack((rng.uniform(-60.0, -40.0, 60), rng.uniform(-40.0, 90.0, 60)), axis=1)
    nearest = np.array([np.sqrt(((outline - p) ** 2).sum(axis=1)).min() for p in pixels])
    true = np.where(bowl.sigma(pixels) > 0.0, -nearest, nearest)
    trace = Trace(
        np.zeros(60),
        np.zeros((60, 3)),
        np.zeros((60, 3)),
        pixels[:, None],
        np.empty((60, 0, 3)),
        (512.0, 512.0),
    )
    np.testing.assert_allclose(bowl.clearance(trace, slice(0))[:, 0], true, atol=3e-3)


def test_a_curve_that_comes_from_outside_the_image_is_found_when_it_is_there() -> None:
    """A circle of 40 px that starts 900 px beside the image and crosses it: its clearance is the
    distance to it.
    """
    circle = Occlusion(Curve(Circle(40.0), (-1200.0, 30.0)), K=0.1, switching_gain=1.0).moving(
        Motion([300.0, -20.0])
    )
    t = np.linspace(0.0, 8.0, 50)
    pixels = np.random.default_rng(3).uniform(-300.0, 300.0, (50, 1, 2))
    trace = Trace(
        t, np.zeros((50, 6)), np.zeros((50, 6)), pixels, np.empty((50, 0, 3)), (640.0, 480.0)
    )
    centre = np.array([-1200.0, 30.0]) + t[:, None] * [300.0, -20.0]
    expected = np.linalg.norm(pixels[:, 0] - centre, axis=1) - 40.0
    np.testing.assert_allclose(circle.clearance(trace, slice(0))[:, 0], expected, atol=2e-3)
