"""What a camera has measured goes into the step, compiled and in NumPy: see
vsconstraints.vision.measurement.
"""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from numpy_form import NumpyStep
from vsconstraints.control import ControlStep
from vsconstraints.controllers import SlidingMode
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.formulas.innovation import depth_innovation, image_innovation
from vsconstraints.robots.geometry import Pose
from vsconstraints.scenarios import Scenario
from vsconstraints.vision.measurement import (
    INNOVATIONS,
    Deviations,
    Plausible,
    describe_implausible,
)

NAMES = [
    "experiment-2-ibvs",
    "ur5-image",
    "case-study-6r",
    "eye-to-hand-ibvs",
    "moving-target-unknown",
]
PARTS = ("pixels", "error", "sigma", "camera_R", "camera_t")


def both_forms(name):
    """The setup of a scenario, and its step compiled and in NumPy."""
    setup = Scenario.load(name).setup()
    other = Scenario.load(name).setup()
    compiled = ControlStep(setup.scene, setup.constraints, setup.task)
    return setup, compiled, NumpyStep(other.scene, other.constraints, other.task)


def same(a, b):
    """Whether two evaluations say the same up to rounding."""
    for part in PARTS:
        np.testing.assert_allclose(getattr(a, part), getattr(b, part), rtol=1e-9, atol=1e-9)
    for kind, names in (("rows", ("phi", "Lg", "Lf")), ("task", ("J", "b"))):
        for name in names:
            one = getattr(getattr(a, kind), name)
            other = getattr(getattr(b, kind), name)
            np.testing.assert_allclose(
                one, other, rtol=1e-8, atol=1e-8 * (1.0 + np.abs(other).max())
            )


@pytest.mark.parametrize("name", NAMES)
def test_both_forms_take_the_same_from_a_measurement(name, monkeypatch):
    """Pixels off by some, depths off by 2 %, markers that are not seen, images that are late, a
    pose.
    """
    setup, compiled, defined = both_forms(name)
    rng = np.random.default_rng(1)
    for k in range(6):
        q = setup.q0 + 0.003 * rng.standard_normal(len(setup.q0))
        qd = 0.1 * rng.standard_normal(len(q))
        t = k * setup.Ts
        state = setup.scene.evaluate(t, q, qd)
        seen = state.pixels.position + rng.standard_normal(state.pixels.position.shape)
        seen[k % 3 % len(seen) : k % 3] = np.nan
        measured = {"pixels": seen, "depth": 1.02 * state.depth, "taken": t - 0.01 * k}
        if k % 2:
            del measured["depth"]
        if k == 4:
            measured["camera"] = Pose(state.camera.R, state.camera.t + 0.01)
        a = compiled.evaluate(t, q, qd, **measured)
        b = defined.evaluate(t, q, qd, **measured)
        same(a, b)
        found = np.isfinite(seen).all(axis=1)
        if k == 0:
            np.testing.assert_allclose(a.pixels[found], seen[found], atol=1e-9)


def test_it_is_used_once_and_what_is_not_seen_stays_as_far_from_the_model(monkeypatch):
    setup, compiled, _ = both_forms("ur5-image")
    q = setup.q0
    qd = np.zeros(6)
    model = compiled.evaluate(0.0, q, qd).pixels
    shifted = model + 7.0
    unseen = np.full_like(model, np.nan)
    np.testing.assert_array_equal(compiled.evaluate(0.1, q, qd, pixels=unseen).pixels, model)
    np.testing.assert_allclose(
        compiled.evaluate(0.2, q, qd, pixels=shifted).pixels, shifted, atol=1e-9
    )
    np.testing.assert_array_equal(compiled.evaluate(0.3, q, qd).pixels, model)
    np.testing.assert_allclose(
        compiled.evaluate(0.4, q, qd, pixels=unseen).pixels, shifted, atol=1e-9
    )
    compiled.reset()
    np.testing.assert_array_equal(compiled.evaluate(0.5, q, qd, pixels=unseen).pixels, model)


@pytest.mark.parametrize("name", ["ur5-image", "eye-to-hand-ibvs", "moving-target"])
@pytest.mark.parametrize("since", [1, 3, 255])
def test_a_late_image_is_moved_on_as_the_model_has_moved(name, since):
    """Pixels, depths and the camera's pose; between two samples to first order of the time to the
    nearest of them.
    """
    setup, compiled, _ = both_forms(name)
    scene = setup.scene
    Ts = setup.Ts
    rng = np.random.default_rng(3)
    past = []
    for k in range(since + 1):
        q = setup.q0 + 0.02 * np.sin(3.0 * k * Ts)
        qd = np.full(6, 0.06 * np.cos(3.0 * k * Ts))
        past.append(scene.evaluate(k * Ts, q, qd))
        compiled.evaluate(k * Ts, q, qd)
    then = past[0]
    now = past[-1]
    t = since * Ts
    assert np.abs(now.pixels.position - then.pixels.position).max() > 10.0 * Ts
    beside = rng.standard_normal(then.pixels.position.shape)
    late = {"pixels": then.pixels.position + beside, "depth": then.depth + 0.01, "taken": 0.0}
    wrong = then.camera @ Pose(
        np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]), np.full(3, 0.01)
    )
    found = compiled.evaluate(t, q, qd, **late, camera=wrong)
    np.testing.assert_allclose(found.pixels, now.pixels.position + beside, atol=1e-8)
    np.testing.assert_allclose(compiled.packed.step.seen["depth"], now.depth + 0.01, atol=1e-11)
    moved = wrong @ then.camera.inverse @ now.camera
    np.testing.assert_allclose(found.camera_t, moved.t, atol=1e-11)
    np.testing.assert_allclose(found.camera_R, moved.R, atol=1e-11)
    assert compiled.innovation[4] == t
    # a copy knows the past, too; a step that has taken over what tasks remember does not
    copied, other, fresh = (
        pickle.loads(pickle.dumps(compiled)),
        *(both_forms(name)[1] for _ in range(2)),
    )
    other.remember(compiled)
    np.testing.assert_array_equal(copied.evaluate(t, q, qd, **late).pixels, found.pixels)
    forgotten = (step.evaluate(t, q, qd, **late).pixels for step in (other, fresh))
    np.testing.assert_array_equal(*forgotten)
    # half a sample before the last: nothing was evaluated there
    taken = t - 0.4 * Ts
    q_then = setup.q0 + 0.02 * np.sin(3.0 * taken)
    qd_then = np.full(6, 0.06 * np.cos(3.0 * taken))
    between = scene.evaluate(taken, q_then, qd_then).pixels.position
    found = compiled.evaluate(t, q, qd, pixels=between, taken=taken).pixels
    # what is left goes with the square of the time
    velocity = np.abs(now.pixels.velocity).max()
    assert np.abs(found - now.pixels.position).max() < 0.05 * 0.4 * Ts * velocity


def test_an_image_older_than_what_is_remembered_moves_on_with_the_velocity_of_now(monkeypatch):
    """To first order: what is left of the image's motion over 20 ms goes with the square of the
    time.
    """
    setup, _, _ = both_forms("ur5-image")
    qd = np.full(6, 0.2)
    left = []
    for age in (0.02, 0.01):
        compiled = both_forms("ur5-image")[1]
        then = setup.scene.evaluate(1.0 - age, setup.q0 - age * qd, qd).pixels.position
        now = compiled.evaluate(1.0, setup.q0, qd).pixels
        found = compiled.evaluate(1.0, setup.q0, qd, pixels=then, taken=1.0 - age).pixels
        assert np.abs(then - now).max() > 1.0
        left.append(np.abs(found - now).max())
    assert left[0] < 0.2
    assert 3.0 < left[0] / left[1] < 5.0


def test_time_that_begins_anew_forgets_where_the_camera_was():
    setup, compiled, other = (
        both_forms("ur5-image")[0],
        *(both_forms("ur5-image")[1] for _ in range(2)),
    )
    still = np.zeros(6)
    for k in range(5):
        compiled.evaluate(k * setup.Ts, setup.q0 + 0.01 * k, still)
    seen = setup.scene.evaluate(0.0, setup.q0, still).pixels.position
    for step in (compiled, other):
        found = step.evaluate(0.0, setup.q0, still, pixels=seen, taken=-setup.Ts).pixels
        np.testing.assert_allclose(found, seen, atol=1e-9)


SECONDS = 14.0


def closed_loop(measured):
    """How far markers are from their goal at the end, of a target 3 cm beside where the model has
    it [px].
    """
    tables = Scenario.load("ur5-image").setup()
    scene = tables.scene
    world = Scenario.load("ur5-image").setup().scene
    world.markers = world.markers + np.array([0.03, 0.0, 0.0])
    step = ControlStep(scene, tables.constraints, tables.task)
    to_command = step.bind(SlidingMode())
    q = tables.q0.copy()
    qd = np.zeros(6)
    Ts = tables.Ts
    for k in range(int(SECONDS / Ts)):
        pose = world.camera_pose(q)
        seen = {"pixels": world.project(pose), "depth": world.depth(pose)} if measured else {}
        _, command = to_command(k * Ts, q, qd, **seen)
        q = q + Ts * qd + 0.5 * Ts**2 * command.qdd
        qd = qd + Ts * command.qdd
    goal = tables.task.goals[tables.task.goal_at(SECONDS)]
    return np.abs(world.project(world.camera_pose(q)) - goal.pixels).max()


def test_a_target_that_is_not_where_the_model_has_it_is_reached_only_with_the_camera():
    assert closed_loop(measured=False) > 20.0
    assert closed_loop(measured=True) < 0.5


@pytest.mark.parametrize("name", NAMES)
def test_both_forms_doubt_alike(name, monkeypatch):
    """By how much a measurement is beside the model, in six ways, by hand: see
    vsconstraints.vision.measurement.
    """
    setup, compiled, defined = both_forms(name)
    q = setup.q0
    qd = np.zeros(len(setup.q0))
    t = 0.5
    state = setup.scene.evaluate(t, q, qd)
    turn = Pose(
        np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]), np.array([0.0, 0.3, 0.4])
    )
    seen = state.pixels.position.copy()
    seen[1] += (3.0, 4.0)
    for step in (compiled, defined):
        step.evaluate(t - 0.1, q, qd)
        evaluation = step.evaluate(t, q, qd, camera=state.camera @ turn)
        np.testing.assert_allclose(step.innovation[2:4], (0.5, np.arccos(0.8)), rtol=1e-9)
        assert "0.5 m and 0.644 rad from where the joints have it" in step.doubts(evaluation)
        step.reset()
        step.evaluate(t - 0.1, q, qd)
        evaluation = step.evaluate(
            t, q, qd + 3.0, pixels=seen, taken=t - 0.05, camera=state.camera @ turn
        )
        pixels, _, _, _, age, speed = step.innovation[:6]
        moved = 0.05 * np.abs(setup.scene.evaluate(t, q, qd + 3.0).pixels.velocity).max()
        assert abs(pixels - 5.0) < 1.5 * moved + 1e-6
        # (3 rad/s)/2 for 0.1 s, of which a third is forgotten, over 0.2 s
        np.testing.assert_allclose((age, speed), (0.05, 0.15 / 1.5 / 0.2), rtol=1e-9)
    np.testing.assert_allclose(compiled.innovation, defined.innovation, rtol=1e-7, atol=1e-9)
    for step in (compiled, defined):
        step.evaluate(t + 0.1, q, qd + 3.0)
        assert not step.innovation[:5].any()
        step.reset()
        step.evaluate(t, q, qd + 50.0)
        assert not step.innovation.any()


def test_shape_by_hand():
    """A square of side 2 seen mirrored is off by √2 of its size, one that is moved by nothing."""
    square = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    assert image_innovation(square + 5.0, np.full((4, 2), 5.0) / 10.0, 10.0, 10.0) == pytest.approx(
        (50**0.5, 0.0)
    )
    mirrored = square * (-1.0, 1.0)
    assert image_innovation(
        mirrored, (mirrored - square) / (10.0, 20.0), 10.0, 20.0
    ) == pytest.approx((2.0, 2**0.5))
    assert image_innovation(square[:1], 0.1 * square[:1], 10.0, 10.0) == pytest.approx(
        (2**0.5, 0.0)
    )


@pytest.mark.parametrize(
    ("beyond", "remark"),
    [
        (0, "marker 2 is seen 9 px from where the model predicts it"),
        (1, "marker 2 is seen 0 px from where the model predicts it, and the pattern differs"),
        (2, "the camera is measured 9 m and 0 rad from where the joints have it"),
        (3, "the camera is measured 0 m and 9 rad from where the joints have it"),
        (4, "the image is 9 s old"),
        (5, "the speed of joint 2 is 9 rad/s from the change of its measured positions"),
        (6, "the depth of marker 3 is measured 10 m, and is 1 m by the model"),
    ],
)
def test_each_implausible_part_alone_is_named(beyond: int, remark: str):
    innovation = np.zeros(len(INNOVATIONS))
    innovation[beyond] = 9.0
    camera = Scenario.load("ur5-image").setup().scene.camera
    correction = np.array([[0.0, 0.0], [0.01, 0.0], [0.0, 0.0], [0.0, 0.0]])
    depth_ratio = np.array([1.0, 1.0, 10.0, 1.0])
    beside = Deviations(correction, np.array([0.0, -1.0]), depth_ratio, depth_ratio)
    seen = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    bounds = np.ones(len(INNOVATIONS))
    found = describe_implausible(innovation, bounds, camera, seen, beside)
    assert found.startswith(remark)
    assert found.count("allowed") == 1
    assert describe_implausible(np.zeros(len(INNOVATIONS)), bounds, camera, seen, beside) == ""


def test_depths_by_hand():
    """Twice and half of the model's depth are off by 1; unmeasured depths are off by nothing."""
    nan = np.nan
    assert depth_innovation(np.array([1.0, 2.0, nan])) == pytest.approx(1.0)
    assert depth_innovation(np.array([1.5, 0.5])) == pytest.approx(1.0)
    assert depth_innovation(np.array([1.0, 1.0])) == 0.0
    assert depth_innovation(np.array([nan, nan])) == 0.0


@pytest.mark.parametrize("compiled", [True, False])
def test_a_loop_of_ones_own_is_told(compiled, monkeypatch):
    setup, *steps = both_forms("ur5-image")
    step = steps[0 if compiled else 1]
    q = setup.q0
    qd = np.zeros(6)
    to_command = step.bind(SlidingMode())
    seen = setup.scene.glance(q)[0]
    right = setup.scene.glance(q)[0] + 1.0
    for call in (
        to_command,
        lambda *state, **measured: step.command(SlidingMode(), *state, **measured),
    ):
        step.reset()
        assert call(0.0, q, qd, pixels=right)[1].remark == ""
        mirrored = call(0.002, q, qd, pixels=seen * (-1.0, 1.0))[1]
        assert mirrored.status == "ok"
        assert "from where the model predicts it" in mirrored.remark
        assert "it fits a mirrored image" in mirrored.remark
        assert call(0.004, q, qd)[1].remark == ""
        assert (
            call(10.0, q, qd, pixels=right, taken=0.0)[1].remark
            == "the image is 10 s old (allowed are 0.2 s)"
        )
        assert call(10.002, q, qd, pixels=right)[1].remark == ""
        wrong = 100.0 * np.eye(6)[2]
        fast = [call(10.004 + 0.002 * k, q, wrong)[1].remark for k in range(5)]
        assert fast[-1].startswith("the speed of joint 3 is ")
    step.plausible = Plausible(image_share=10.0, shape_share=10.0)
    step.reset()
    assert step.command(SlidingMode(), 0.0, q, qd, pixels=seen * (-1.0, 1.0))[1].remark == ""
    again = pickle.loads(pickle.dumps(step))
    assert again.plausible == step.plausible
    with pytest.raises(ConfigurationError, match="image_share must be positive, not 0"):
        Plausible(image_share=0.0)


@pytest.mark.parametrize("unknown", [0.0, np.nan, np.inf])
def test_unknown_depths_of_depth_cameras_are_the_models(unknown):
    """Depth cameras give 0, NaN or infinity where they do not know: the model's depth is taken, and
    nothing doubted.
    """
    setup, compiled, defined = both_forms("ur5-image")
    q = setup.q0
    qd = np.zeros(6)
    seen = setup.scene.glance(q)[0]
    depth = setup.scene.depth(setup.scene.camera_pose(q))
    for step in (compiled, defined):
        expected = step.evaluate(0.0, q, qd, pixels=seen + 1.0).task.J
        step.reset()
        found = step.evaluate(0.0, q, qd, pixels=seen + 1.0, depth=np.full(4, unknown))
        np.testing.assert_array_equal(found.task.J, expected)
        assert step.doubts(found) == ""
        step.reset()
        some = np.array([unknown, *depth[1:]])
        for call in (
            step.evaluate,
            lambda *state, of=step, **given: of.command(SlidingMode(), *state, **given)[0],
        ):
            found = call(0.0, q, qd, pixels=seen + 1.0, depth=some)
            np.testing.assert_allclose(found.task.J, expected, rtol=1e-9)


#: Depths as they come by mistake, of those in metres, and the guess that names their unit;
#: None for the ratio.
DEPTHS = {
    "millimetres": (lambda Z: 1000.0 * Z, "are depths in millimetres, not metres?"),
    "rounded millimetres": (
        lambda Z: np.round(1000.0 * Z),
        "are depths in millimetres, not metres?",
    ),
    "centimetres": (lambda Z: 100.0 * Z, "are depths in centimetres, not metres?"),
    "inches": (lambda Z: Z / 0.0254, "are depths in inches, not metres?"),
    "feet": (lambda Z: Z / 0.3048, "are depths in feet, not metres?"),
    "background": (
        lambda Z: np.add(Z, (2.0, 0.0, 0.0, 0.0)),
        None,
    ),
    "in front": (
        lambda Z: Z * (1.0, 1.0, 1.0, 0.1),
        None,
    ),
    "kilometres": (lambda Z: Z / 1000.0, "that is 0.001 times the model's"),
    "twice as far and more": (lambda Z: 2.5 * Z, "that is 2.5 times the model's"),
}


@pytest.mark.parametrize(("wrong", "told"), DEPTHS.values(), ids=DEPTHS)
def test_depths_in_another_unit_are_doubted(wrong, told):
    setup, compiled, defined = both_forms("ur5-image")
    q = setup.q0
    qd = np.zeros(6)
    seen = setup.scene.glance(q)[0]
    depth = setup.scene.depth(setup.scene.camera_pose(q))
    for step in (compiled, defined):
        for right in (depth, 1.5 * depth, depth / 1.5):
            assert step.command(SlidingMode(), 0.0, q, qd, pixels=seen, depth=right)[1].remark == ""
        assert step.innovation[6] == pytest.approx(0.5)
        remark = step.command(SlidingMode(), 0.0, q, qd, pixels=seen, depth=wrong(depth))[1].remark
        assert remark.startswith("the depth of marker ")
        assert "(allowed is a factor of 2)" in remark
        ratio = wrong(depth) / depth
        worst = ratio[np.argmax(np.abs(np.log(ratio)))]
        assert remark.endswith(told or f"that is {worst:.3g} times the model's")
        assert step.innovation[6] == pytest.approx(np.maximum(ratio, 1.0 / ratio).max() - 1.0)
        # depths are those of one image
        assert step.command(SlidingMode(), 0.0, q, qd, pixels=seen)[1].remark == ""
        step.plausible = Plausible(depth_share=1e4)
        assert (
            step.command(SlidingMode(), 0.0, q, qd, pixels=seen, depth=wrong(depth))[1].remark == ""
        )


BAD = {
    "shape": {"pixels": np.zeros((3, 2))},
    "text": {"pixels": "image"},
    "infinite": {"pixels": np.full((4, 2), np.inf)},
    "depth alone": {"depth": np.ones(4)},
    "depth negative": {"pixels": np.zeros((4, 2)), "depth": np.full(4, -0.5)},
    "depth shape": {"pixels": np.zeros((4, 2)), "depth": np.ones(3)},
    "future": {"pixels": np.zeros((4, 2)), "taken": 3.0},
    "never": {"pixels": np.zeros((4, 2)), "taken": np.nan},
    "pose": {"camera": np.eye(4)},
}


@pytest.mark.parametrize("measured", BAD.values(), ids=BAD)
def test_what_does_not_fit_is_refused(measured, monkeypatch):
    setup, compiled, defined = both_forms("ur5-image")
    q = setup.q0
    qd = np.zeros(6)
    before = compiled.evaluate(0.0, q, qd).pixels
    for call in (
        compiled.evaluate,
        defined.evaluate,
        compiled.bind(SlidingMode()),
        defined.bind(SlidingMode()),
    ):
        with pytest.raises(InvalidInput, match=r"measured|image must be taken"):
            call(1.0, q, qd, **measured)
    np.testing.assert_array_equal(compiled.evaluate(1.0, q, qd).pixels, before)


def test_lists_and_other_layouts_of_pixels_are_taken(monkeypatch):
    setup, compiled, _ = both_forms("ur5-image")
    q = setup.q0
    qd = np.zeros(6)
    to_command = compiled.bind(SlidingMode())
    seen = compiled.evaluate(0.0, q, qd).pixels + 1.0
    compiled.reset()
    expected, _ = to_command(0.0, q, qd, pixels=seen)
    for other in (
        seen.tolist(),
        np.asfortranarray(seen),
        seen.astype(np.float32),
        np.ma.array(seen),
    ):
        compiled.reset()
        found, _ = to_command(0.0, q, qd, pixels=other)
        np.testing.assert_allclose(found.task.b, expected.task.b, rtol=1e-5, atol=1e-6)
    # a marker that is masked was not seen
    blind = seen.copy()
    blind[1] = np.nan
    hidden = np.ma.array(seen + 100.0 * np.isnan(blind), mask=np.isnan(blind))
    compiled.reset()
    expected, _ = to_command(0.0, q, qd, pixels=blind)
    compiled.reset()
    found, _ = to_command(0.0, q, qd, pixels=hidden)
    np.testing.assert_array_equal(found.task.b, expected.task.b)
