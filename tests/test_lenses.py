"""Distortion of lenses against OpenCV, finite differences and closed forms; the field of view that
bends with it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from numpy_form import define
from vsconstraints import Camera
from vsconstraints.compiled import available, load
from vsconstraints.constraints import FieldOfView, Trace
from vsconstraints.control import ControlStep
from vsconstraints.controllers import SlidingMode, Tracking
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.formulas import lenses
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, simulate
from vsconstraints.vision.distortion import Distortion

LENSES = {
    "barrel": Distortion("brown-conrady", (-0.3, 0.1, 1e-3, -5e-4)),
    "pincushion": Distortion("brown-conrady", (0.2, -0.05, -2e-3, 1e-3, 0.03)),
    "rational": Distortion("brown-conrady", (0.5, -0.1, 1e-3, -5e-4, 0.03, 0.8, -0.05, 0.01)),
    "fisheye": Distortion("fisheye", (-0.02, 0.01, -0.005, 0.001)),
}

GAINS: dict[str, Any] = {"K": 0.2, "switching_gain": 10.0}

needs_compiler = pytest.mark.skipif(not available(), reason="there is no compiler here")


def camera(lens: Distortion | None) -> Camera:
    return Camera((600.0, 590.0), (640.0, 480.0), (322.0, 235.0), distortion=lens)


K = np.array([[600.0, 0.0, 321.5], [0.0, 590.0, 234.5], [0.0, 0.0, 1.0]])
"""Its intrinsic matrix as OpenCV writes it, which counts pixels by their centres."""


def sensor(step: float = 20.0) -> Array:
    """(m, 2) pixels all over the image, from its centre, its corners among them."""
    u, v = np.meshgrid(np.arange(-320.0, 321.0, step), np.arange(-240.0, 241.0, step))
    return np.stack((u.ravel(), v.ravel()), axis=1)


def by_opencv(lens: Distortion, normalised: Array) -> Array:
    """(m, 2) pixels from the top left corner, counted by their centres."""
    points = np.column_stack((normalised, np.ones(len(normalised))))[:, None]
    D = np.array(lens.coefficients)
    none = np.zeros((3, 1))
    project = cv2.fisheye.projectPoints if lens.model == "fisheye" else cv2.projectPoints
    pixels: Array = project(points, none, none, K, D)[0].reshape(-1, 2)
    return pixels


# --- against OpenCV ---


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_points_are_where_opencv_projects_them(lens: Distortion) -> None:
    eye = camera(lens)
    normalised = eye.normalised(1.1 * sensor())
    found = eye.to_corner(eye.distort(eye.pixels(normalised)), "centres")
    np.testing.assert_allclose(found, by_opencv(lens, normalised), atol=1e-9)


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_pixels_are_undistorted_as_opencv_does(lens: Distortion) -> None:
    eye = camera(lens)
    pixels = sensor()
    seen = eye.to_corner(pixels, "centres")[:, None]
    D = np.array(lens.coefficients)
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 300, 1e-13)
    if lens.model == "fisheye":
        theirs = cv2.fisheye.undistortPoints(seen, K, D, criteria=criteria)
    else:
        theirs = cv2.undistortPointsIter(seen, K, D, None, None, criteria)
    np.testing.assert_allclose(
        eye.normalised(eye.undistort(pixels)), theirs.reshape(-1, 2), atol=1e-8
    )


# --- there and back ---


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_undistorting_is_the_inverse_all_over_the_image(lens: Distortion) -> None:
    eye = camera(lens)
    pixels = sensor(10.0)
    ideal = eye.undistort(pixels)
    assert np.abs(ideal - pixels).max() > 5.0
    np.testing.assert_allclose(eye.distort(ideal), pixels, atol=1e-9)
    np.testing.assert_allclose(eye.undistort(eye.distort(ideal)), ideal, atol=1e-6)
    np.testing.assert_array_equal(eye.sees(eye.undistort(0.9999 * pixels)), True)
    assert not eye.sees(eye.undistort(1.001 * pixels[[0, -1]])).any()


number = st.floats(-1.0, 1.0)


@settings(max_examples=30, deadline=None)
@given(st.tuples(*[number] * 8), st.booleans())
def test_what_is_undistorted_comes_back_whatever_the_lens(
    drawn: tuple[float, ...], wide: bool
) -> None:
    """Where a lens can be inverted at all: of others the reach is small, and what lies beyond is
    refused.
    """
    size = (
        np.array([0.5, 0.3, 0.01, 0.01, 0.2, 0.5, 0.3, 0.2])
        if not wide
        else np.array([0.2, 0.1, 0.05, 0.02])
    )
    lens = Distortion(
        "fisheye" if wide else "brown-conrady",
        tuple((np.array(drawn)[: len(size)] * size).tolist()),
    )
    assume(lens.reach > 0.05)
    turn, share = np.meshgrid(np.linspace(0.0, 6.0, 12), [0.0, 0.1, 0.5, 0.9, 0.99])
    there = min(lens.reach, 3.0) * np.stack((share * np.cos(turn), share * np.sin(turn)), axis=-1)
    back, certain = lens.remove(lens.apply(there))
    assert certain.all()
    np.testing.assert_allclose(back, there, atol=1e-9)


def test_a_lens_that_folds_is_inverted_up_to_its_fold_alone() -> None:
    """r(1 − 0.4r²) has the slope 1 − 1.2r², which falls to 1/100 at r = 0.9083."""
    eye = camera(Distortion("brown-conrady", (-0.4, 0.0, 0.0, 0.0)))
    r = np.sqrt(0.99 / 1.2)
    assert eye.distortion is not None
    assert eye.distortion.reach == pytest.approx(r, abs=3e-3)
    assert eye.reach_px == pytest.approx(590.0 * r * (1.0 - 0.4 * r * r), abs=0.5)
    with pytest.raises(
        InvalidInput, match=r"a pixel at \(-320\.0, -240\.0\) .* can be inverted up to 359 px"
    ):
        eye.undistort(np.array([[0.0, 0.0], [-320.0, -240.0]]))
    # the polynomial turns back to the middle, which must not count as seen
    folded = eye.pixels(np.array([np.sqrt(1.0 / 0.4), 0.0]))
    assert np.abs(eye.distort(folded)).max() > 320.0
    assert not eye.sees(folded)


def test_beyond_its_reach_a_lens_goes_on_outwards() -> None:
    lens = Distortion("brown-conrady", (-0.4, 0.05, 1e-3, -5e-4))
    along = np.linspace(0.0, 3.0, 400)[:, None] * np.array([0.6, -0.8])
    size = np.linalg.norm(lens.apply(along), axis=1)
    assert (np.diff(size) > 0.0).all()


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_derivatives_are_those_of_finite_differences(lens: Distortion) -> None:
    h = 1e-6
    reach, *coefficients = lens.parameters
    for until in (reach, 0.3):
        for x, y in ((0.0, 0.0), (0.1, -0.2), (0.5, 0.3), (-0.4, 0.02)):
            found = np.array(
                lenses.extended(lenses.MODELS[lens.model].lens, x, y, until, coefficients)[2:]
            ).reshape(2, 2)
            ends = [
                np.array(
                    lenses.extended(
                        lenses.MODELS[lens.model].lens, x + dx, y + dy, until, coefficients
                    )[:2]
                )
                for dx, dy in ((h, 0.0), (-h, 0.0), (0.0, h), (0.0, -h))
            ]
            slopes = np.stack(((ends[0] - ends[1]), (ends[2] - ends[3])), axis=1) / (2.0 * h)
            np.testing.assert_allclose(found, slopes, atol=1e-8)


# --- conventions ---


def test_pixels_count_by_their_edges_or_by_their_centres() -> None:
    eye = Camera((600.0, 600.0), (640, 480))
    np.testing.assert_array_equal(eye.from_corner(np.array([0.5, 0.5])), [-319.5, -239.5])
    np.testing.assert_array_equal(
        eye.from_corner(np.array([0.0, 0.0]), "centres"), [-319.5, -239.5]
    )
    np.testing.assert_array_equal(eye.to_corner(np.zeros(2)), [320.0, 240.0])
    np.testing.assert_array_equal(eye.to_corner(np.zeros(2), "centres"), [319.5, 239.5])
    with pytest.raises(ConfigurationError, match=r"way to count pixels 'corners'.*centres"):
        eye.from_corner(np.zeros(2), "corners")  # type: ignore[arg-type]


def test_what_was_not_seen_stays_so() -> None:
    pixels = np.array([[10.0, 20.0], [np.nan, np.nan]])
    np.testing.assert_array_equal(
        np.isnan(camera(LENSES["barrel"]).undistort(pixels)), np.isnan(pixels)
    )


@pytest.mark.parametrize(
    ("model", "coefficients", "words"),
    [
        ("brown", (0.1,) * 4, "unknown model of distortion 'brown'"),
        ("brown-conrady", (0.1,) * 3, "has 4 or 5 or 8 finite coefficients, not 3"),
        ("fisheye", (0.1,) * 5, "has 4 finite coefficients, not 5"),
        ("fisheye", (0.1, 0.0, 0.0, np.inf), "finite"),
        ("fisheye", "none", "must be numbers"),
    ],
)
def test_a_lens_that_is_none_is_refused(model: Any, coefficients: Any, words: str) -> None:
    with pytest.raises((InvalidInput, ConfigurationError), match=words):
        Distortion(model, coefficients)


# --- compiled ---


@needs_compiler
@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_both_forms_take_pixels_through_a_lens_alike(lens: Distortion) -> None:
    eye = camera(lens)
    pixels = np.concatenate((sensor(), [[np.nan, np.nan]]))
    through = load("lenses").through(lens.model)
    out = np.empty_like(pixels)
    assert through(np.array(eye.eye), pixels, out, True) == 0
    np.testing.assert_allclose(out, eye.undistort(pixels), atol=1e-9)
    back = np.empty_like(pixels)
    through(np.array(eye.eye), out, back, False)
    np.testing.assert_allclose(back[:-1], pixels[:-1], atol=1e-9)


# --- the field of view ---


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_the_field_of_view_is_that_of_the_sensor(lens: Distortion) -> None:
    eye = camera(lens)
    rng = np.random.default_rng(0)
    plain = FieldOfView(camera(None), margin=0.05, n=8, **GAINS)
    bent = FieldOfView(eye, margin=0.05, n=8, **GAINS)
    ideal = eye.undistort(rng.uniform(-0.5, 0.5, (50, 2)) * (640, 480))
    np.testing.assert_allclose(bent.sigma(ideal), plain.sigma(eye.distort(ideal)), atol=1e-12)
    v = rng.normal(size=(50, 2))
    h = 1e-4
    ahead, behind = (bent.sigma(ideal + k * h * v) for k in (1, -1))
    slope = (bent.gradient(ideal) * v).sum(axis=1)
    np.testing.assert_allclose(slope, (ahead - behind) / (2 * h), rtol=1e-5, atol=1e-8)
    h = 1e-2
    ahead, behind = ((bent.gradient(ideal + k * h * v) * v).sum(axis=1) for k in (1, -1))
    np.testing.assert_allclose(
        bent.curvature(ideal, v), (ahead - behind) / (2 * h), rtol=1e-4, atol=1e-8
    )
    # what is drawn is the boundary
    for line in bent.boundary((640.0, 480.0)):
        np.testing.assert_allclose(plain.sigma(eye.distort(line)), 0.0, atol=1e-3)
        assert np.abs(line - eye.distort(line)).max() > 3.0


def test_clearance_is_counted_on_the_sensor() -> None:
    eye = camera(LENSES["barrel"])
    fov = FieldOfView(eye, margin_px=20.0, n=16, **GAINS)
    on_sensor = np.array([[250.0, 0.0], [-310.0, 0.0], [0.0, 215.0]])
    trace = Trace(
        *(np.zeros(1),) * 3, eye.undistort(on_sensor)[None], np.zeros((1, 0, 3)), (640.0, 480.0)
    )
    np.testing.assert_allclose(fov.clearance(trace, slice(0, 0))[0], [50.0, -10.0, 5.0], atol=1e-3)


def test_a_field_of_view_beyond_what_can_be_inverted_says_which_margin_would_do() -> None:
    eye = camera(Distortion("brown-conrady", (-0.4, 0.0, 0.0, 0.0)))
    with pytest.raises(
        ConfigurationError, match=r"only up to 359 px from the principal point: margin_px = (\d+)"
    ) as no:
        FieldOfView(eye, **GAINS)
    enough = float(str(no.value).rpartition("= ")[2].partition(" ")[0])
    FieldOfView(eye, margin_px=enough, **GAINS)
    with pytest.raises(ConfigurationError, match="cannot be inverted"):
        FieldOfView(eye, margin_px=enough - 1.0, **GAINS)


@pytest.mark.parametrize(
    ("n", "farthest"),
    [(2.0, lambda m: 320.0 - m), (1000.0, lambda m: np.hypot(320.0 - m, 240.0 - m))],
    ids=["ellipse", "rectangle"],
)
def test_the_margin_of_a_field_of_view_follows_from_its_farthest_point(
    n: float, farthest: Callable[[float], float]
) -> None:
    k1 = -0.4
    lens = Distortion("brown-conrady", (k1, 0.0, 0.0, 0.0))
    eye = Camera((400.0, 400.0), (640.0, 480.0), distortion=lens)
    with pytest.raises(ConfigurationError, match=r"margin_px = (\d+)") as no:
        FieldOfView(eye, n=n, **GAINS)
    enough = float(str(no.value).rpartition("= ")[2].partition(" ")[0])
    # the lens folds back where the derivative 1 + 3 k₁ r² of its radius is zero
    r = np.sqrt(-1.0 / (3.0 * k1))
    radius_px = 400.0 * r * (1.0 + k1 * r**2)
    # the searched margins are whole pixels, and a lens is not inverted quite up to its fold
    assert farthest(enough) <= radius_px <= farthest(enough - 2.0)


# --- in a loop ---


def distorted(scenario: str, lens: Distortion | None, duration: float = 2.0) -> Setup:
    changed = Scenario.load(scenario).with_override("duration", duration)
    if lens is not None:
        table = {"model": lens.model, "coefficients": list(lens.coefficients)}
        changed = changed.with_override("camera.distortion", table)
    return changed.setup()


@needs_compiler
@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_a_step_through_a_lens_is_compiled_as_it_is_defined(lens: Distortion) -> None:
    setup = distorted("ur5-fov", lens)
    step = setup.control()
    rng = np.random.default_rng(5)
    assert not step.in_numpy
    for _ in range(5):
        q = setup.q0 + 0.02 * rng.normal(size=6)
        qd = rng.normal(size=6)
        mine = step.evaluate(0.0, q, qd)
        theirs = define(step, setup.scene.evaluate(0.0, q, qd))
        for part in ("phi", "Lg", "Lf"):
            one = getattr(mine.rows, part)
            other = getattr(theirs.rows, part)
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


@pytest.mark.parametrize("name", ["barrel", "pincushion", "fisheye"])
def test_a_run_that_meets_the_boundary_keeps_every_marker_on_the_sensor(name: str) -> None:
    setup = distorted("ur5-fov", LENSES[name])
    eye = setup.scene.camera
    half = np.array([320.0, 240.0])
    alone = simulate(setup, Tracking())
    kept = simulate(setup, SlidingMode())
    used = [np.abs(eye.distort(run.features_px)) / half for run in (alone, kept)]
    assert used[0].max() > 1.2
    # up to the margin of 5 %, and nearly all of it
    assert 0.94 < used[1].max() < 0.9505
    rows = [i for i, label in enumerate(kept.labels) if label.startswith("fov")]
    assert kept.active[:, rows].any()
    assert 0.0 < kept.clearance[:, rows].min() < 1.0


def test_measured_pixels_are_undistorted_before_the_law() -> None:
    """Told what is on the sensor, a step does as one without distortion does that is told ideal
    pixels.
    """
    lens = LENSES["barrel"]
    one = distorted("ur5-image", lens)
    other = distorted("ur5-image", None)
    eye = one.scene.camera
    q = one.q0
    qd = one.qd0 + 0.1
    steps = [ControlStep(s.scene, s.constraints, s.task) for s in (one, other)]
    ideal = steps[1].evaluate(0.0, q, qd).pixels + np.array([3.0, -2.0])
    ideal[1] = np.nan
    for law in (SlidingMode(), None):
        found = []
        for step, pixels in zip(steps, (eye.distort(ideal), ideal), strict=True):
            step.reset()
            told: dict[str, Any] = {"pixels": pixels, "taken": -0.01}
            found.append(
                step.evaluate(0.0, q, qd, **told)
                if law is None
                else step.command(law, 0.0, q, qd, **told)[0]
            )
        np.testing.assert_allclose(found[0].pixels, found[1].pixels, atol=1e-8)
        np.testing.assert_allclose(found[0].task.b, found[1].task.b, rtol=1e-9, atol=1e-9)
        seen = found[0].pixels[[0, 2, 3]] - ideal[[0, 2, 3]]
        assert 0.0 < np.abs(seen).max() < 10.0  # moved on since


def test_a_measured_pixel_that_cannot_be_undistorted_is_refused() -> None:
    setup = distorted("ur5-image", None)
    eye = replace(setup.scene.camera, distortion=Distortion("brown-conrady", (-2.0, 0.0, 0.0, 0.0)))
    scene = type(setup.scene)(setup.scene.robot, eye, setup.scene.markers)
    step = ControlStep(scene, type(setup.constraints)([], scene), setup.task)
    pixels = np.zeros((4, 2))
    step.command(Tracking(), 0.0, setup.q0, setup.qd0, pixels=pixels)
    pixels[2] = 310.0, 230.0
    with pytest.raises(InvalidInput, match=r"\(310\.0, 230\.0\) .* cannot be undistorted"):
        step.command(Tracking(), 0.0, setup.q0, setup.qd0, pixels=pixels)


def test_a_goals_markers_are_where_the_sensor_shows_them() -> None:
    lens = LENSES["barrel"]
    there = Scenario.load("ur5-image").with_override("camera.distortion.model", lens.model)
    there = there.with_override("camera.distortion.coefficients", list(lens.coefficients))
    shown = [[-60.0, -60.0], [60.0, -60.0], [60.0, 60.0], [-60.0, 60.0]]
    goal = there.with_override("task.goals", [{"markers_px": shown}]).setup()
    np.testing.assert_allclose(
        goal.scene.camera.distort(goal.task.goals[0].pixels), shown, atol=1e-9
    )
    folds = there.with_override("camera.distortion.coefficients", [-2.0, 0.0, 0.0, 0.0])
    folds = folds.with_override("constraints", []).with_override(
        "task.goals", [{"markers_px": [[300.0, 200.0]] * 4}]
    )
    with pytest.raises(ConfigurationError, match="markers_px: a pixel at"):
        folds.setup()
