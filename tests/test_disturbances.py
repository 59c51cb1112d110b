"""What goes otherwise than the control assumes: the robot, what is measured, and the rows'
gradients.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from numpy_form import believed, evaluate_rows, observe
from scenes import NOW, random_scene, robot
from vsconstraints.compiled import load
from vsconstraints.compiled.memory import Workspace
from vsconstraints.controllers import HierarchicalQP, SlidingMode, Tracking
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.robots.geometry import Pose, distance
from vsconstraints.robots.order_filter import OrderFilter
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, simulate
from vsconstraints.simulation.disturbances import Disturbances
from vsconstraints.simulation.plant import Actuation, Plant
from vsconstraints.simulation.sensing import Sensor, estimated_pose
from vsconstraints.vision.motion import Motion, TargetMotion

REFUSED = (ConfigurationError, InvalidInput)


def case(duration: float = 0.4, **settings: Any) -> Setup:
    """The case study with disturbances."""
    scenario = Scenario.load("case-study-6r").with_override("duration", duration)
    for key, value in settings.items():
        name = key.replace("__", ".")
        scenario = scenario.with_override(
            name if "." in name or name == "actuation" else f"disturbances.{name}", value
        )
    return scenario.setup()


# --- the robot: eq. (6) against an ODE solver ---


@pytest.mark.parametrize("actuation", ["acceleration", "position"])
def test_the_plant_is_the_solution_of_its_differential_equation(actuation: Actuation) -> None:
    rng = np.random.default_rng(3)
    tau = 0.03
    Ts = 0.01
    n = 3
    q0, qd0, d = rng.normal(size=(3, n))
    commands = rng.normal(size=(40, n)) * 3.0
    plant = Plant(q0, qd0, Ts, actuation, Disturbances(time_constant=tau, acceleration=tuple(d)))

    def dynamics(u: Array):
        def lag(_t: float, x: Array) -> Array:
            _, qd, a = x.reshape(3, n)
            return np.concatenate((qd, a + d, (u - a) / tau))

        def loop(_t: float, x: Array) -> Array:
            q, qd, qc, qcd = x.reshape(4, n)
            return np.concatenate((qd, (qc - q) / tau**2 + 2.0 * (qcd - qd) / tau + d, qcd, u))

        return lag if actuation == "acceleration" else loop

    x = np.concatenate(
        (q0, qd0, np.zeros(n)) if actuation == "acceleration" else (q0, qd0, q0, qd0)
    )
    for u in commands:
        plant.begin(u)
        state = plant.x.T.copy()
        half = solve_ivp(dynamics(u), (0.0, 0.4 * Ts), x, rtol=1e-11, atol=1e-13).y[:, -1]
        q_in, qd_in = plant.inside(state[None], 0.4 * Ts)
        np.testing.assert_allclose(q_in[0], half[:n], atol=1e-10)
        np.testing.assert_allclose(qd_in[0], half[n : 2 * n], atol=1e-9)
        x = solve_ivp(dynamics(u), (0.0, Ts), x, rtol=1e-11, atol=1e-13).y[:, -1]
        plant.step()
        np.testing.assert_allclose(plant.q, x[:n], atol=1e-9)
        np.testing.assert_allclose(plant.qd, x[n : 2 * n], atol=1e-8)


def test_an_ideal_position_controlled_arm_is_a_double_integrator() -> None:
    ideal, position = (
        simulate(case(actuation=kind), SlidingMode()) for kind in ("acceleration", "position")
    )
    np.testing.assert_allclose(position.q, ideal.q, atol=1e-12)


def test_a_fast_low_level_loop_is_next_to_none() -> None:
    """Eq. (6) holds approximately where C is fast: the deviation shrinks with its time constant."""
    ideal = simulate(case(), SlidingMode()).q
    off = [
        np.abs(simulate(case(time_constant=tau), SlidingMode()).q - ideal).max()
        for tau in (2e-2, 2e-3, 2e-4)
    ]
    assert off[0] > 2.0 * off[1] > 4.0 * off[2] > 0.0


@given(
    st.lists(st.lists(st.floats(-50, 50), min_size=3, max_size=3), min_size=1, max_size=20),
    st.floats(1e-3, 0.2),
)
def test_the_order_filter_integrates_exactly(commands: list[list[float]], Ts: float) -> None:
    q0 = np.array([0.1, -0.2, 0.3])
    qd0 = np.array([0.5, 0.0, -0.4])
    integrator = OrderFilter(q0, qd0, Ts)
    for command in commands:
        last = integrator.step(np.array(command))
    N = len(commands)
    held = np.array(commands)
    t = N * Ts
    # each command acts for a period, and its speed for the time that is left
    left = t - Ts * np.arange(1, N + 1)
    expected = q0 + qd0 * t + (0.5 * Ts**2 + Ts * left) @ held
    np.testing.assert_allclose(last, expected, atol=1e-9)
    np.testing.assert_allclose(integrator.qd, qd0 + Ts * held.sum(axis=0), atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([0.0], [0.0, 1.0], 0.1), "qd must be 1 numbers"),
        (([np.nan], [0.0], 0.1), "q must be finite"),
        (([0.0], [0.0], 0.0), "sampling time"),
    ],
)
def test_an_order_filter_of_nonsense_is_refused(arguments: Any, words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        OrderFilter(*arguments)
    with pytest.raises(InvalidInput, match="qdd"):
        OrderFilter([0.0], [0.0], 0.1).step(np.array([np.inf]))


def test_a_constant_disturbance_enters_lf() -> None:
    """Eq. (18): φ̇ = (∂φ/∂q)ᵀ q̇ + (∂φ/∂q̇)ᵀ d_c where nothing is commanded."""
    there = case(acceleration=[0.1, -0.2, 0.1, 0.3, -0.1, 0.2])
    plant = there.plant()
    plant.begin(np.zeros(6))
    plant.step()
    np.testing.assert_allclose(
        plant.qd, there.Ts * np.array([0.1, -0.2, 0.1, 0.3, -0.1, 0.2]), rtol=1e-12
    )
    rows, _ = evaluate_rows(there.constraints, there.scene.evaluate(0.0, there.q0, there.qd0))
    after, _ = evaluate_rows(there.constraints, there.scene.evaluate(there.Ts, plant.q, plant.qd))
    np.testing.assert_allclose(
        (after.phi - rows.phi) / there.Ts,
        rows.Lf + rows.Lg @ there.disturbances.acceleration,
        rtol=1e-2,
        atol=1e-3,
    )


# --- what is measured ---


def test_nothing_disturbed_is_nothing_changed() -> None:
    there = case()
    state = there.scene.evaluate(0.0, there.q0, there.qd0)
    assert observe(there.sensor(), state) is state
    rows, _ = evaluate_rows(there.constraints, state)
    assert there.gradient_error()(rows, there.qd0) is rows


def test_a_seed_may_be_any_whole_number_from_0_on() -> None:
    scenario = Scenario.load("example-2d-fov").with_override("start_deviation", 0.01)
    starts = [scenario.setup(1, seed).q0 for seed in (0, 10**30, 10**30 + 1)]
    assert len({tuple(q0) for q0 in starts}) == 3
    for trial, seed in ((-1, 0), (0, -1), (0.5, 0), (0, 1.5)):
        with pytest.raises(ConfigurationError, match=r"a (trial|seed) is a whole number from 0 on"):
            scenario.setup(trial, seed)  # type: ignore[arg-type]


def test_every_controller_meets_the_same_disturbances() -> None:
    """Noise is drawn per image and period, whatever the controller does; another seed or trial
    draws others.
    """
    settings = {"pixel_noise": 2.0, "lost_frames": 0.3, "acceleration_noise": 0.5}

    def noise(seed: int = 0, trial: int = 0) -> tuple[Array, Array]:
        scenario = Scenario.load("case-study-6r")
        for key, value in settings.items():
            scenario = scenario.with_override(f"disturbances.{key}", value)
        there = scenario.setup(trial, seed)
        sensor = there.sensor()
        plant = there.plant()
        seen = []
        pushed = []
        for k in range(20):
            state = there.scene.evaluate(k * there.Ts, there.q0, there.qd0)
            seen.append(observe(sensor, state).pixels.position - state.pixels.position)
            plant.begin(np.zeros(6))
            pushed.append(plant.x[-1].copy())
        return np.array(seen), np.array(pushed)

    for first, again, other, elsewhere in zip(
        noise(), noise(), noise(seed=1), noise(trial=1), strict=True
    ):
        np.testing.assert_array_equal(first, again)
        assert not np.array_equal(first, other)
        assert not np.array_equal(first, elsewhere)
    runs = [
        simulate(case(**settings), law) for law in (SlidingMode(), HierarchicalQP(), SlidingMode())
    ]
    np.testing.assert_array_equal(runs[0].q, runs[2].q)
    assert not np.array_equal(runs[0].q, runs[1].q)


def test_pixel_noise_has_its_standard_deviation_and_no_mean() -> None:
    there = case(pixel_noise=1.5)
    sensor = there.sensor()
    state = there.scene.evaluate(0.0, there.q0, there.qd0)
    noise = (
        np.array([observe(sensor, state).pixels.position for _ in range(400)])
        - state.pixels.position
    )
    assert noise.std() == pytest.approx(1.5, rel=0.05)
    assert abs(noise.mean()) < 4.0 * 1.5 / np.sqrt(noise.size)


def test_images_come_late_and_are_held() -> None:
    """Image period 3 samples, two periods old: what is believed at sample k was true at 3 (k // 3 −
    2).
    """
    there = case(image_period=0.006, delay=2)
    sensor = there.sensor()
    true = []
    for k in range(20):
        state = there.scene.evaluate(k * there.Ts, there.q0 + 0.002 * k, there.qd0)
        true.append(state.pixels.position)
        seen = observe(sensor, state).pixels.position
        np.testing.assert_allclose(seen, true[max(3 * (k // 3 - 2), 0)], atol=1e-9)


def test_lost_frames_leave_the_last_image() -> None:
    there = case(lost_frames=0.4)
    sensor = there.sensor()
    lost = 0
    true: list[Array] = []
    last = 0
    for k in range(300):
        state = there.scene.evaluate(k * there.Ts, there.q0 + 1e-4 * k, there.qd0)
        true.append(state.pixels.position)
        seen = observe(sensor, state).pixels.position
        if np.abs(seen - true[k]).max() < 1e-9:
            last = k
        else:
            np.testing.assert_allclose(seen, true[last], atol=1e-9)
            lost += 1
    assert 0.3 < lost / 300 < 0.5


def named(name: str, duration: float = 0.3, **settings: Any) -> Setup:
    scenario = Scenario.load(name).with_override("duration", duration)
    for key, value in settings.items():
        scenario = scenario.with_override(f"disturbances.{key}", value)
    return scenario.setup()


@pytest.mark.parametrize(
    "name", ["ur5-fov", "ur5-image", "eye-to-hand-pbvs", "eye-to-hand-ibvs", "moving-target"]
)
def test_images_that_say_when_they_were_taken_may_be_late(name: str) -> None:
    """Where the model is right: by itself the delay moves the arm, and with the age of images it
    moves nothing.
    """
    late = {"image_period": 3 * named(name).Ts, "delay": 4}
    runs = [
        simulate(named(name, **one), HierarchicalQP())
        for one in ({}, late, {**late, "delay_known": True})
    ]
    assert np.abs(runs[1].q - runs[0].q).max() > 1e-4
    np.testing.assert_allclose(runs[2].q, runs[0].q, atol=1e-7)
    np.testing.assert_allclose(runs[2].phi, runs[0].phi, atol=1e-5 * np.abs(runs[0].phi).max())


@pytest.mark.parametrize(("name", "age"), [("moving-target", 0), ("moving-target-unknown", 5)])
def test_an_image_is_moved_on_by_no_motion_that_is_unknown(name: str, age: int) -> None:
    """As a measurement, and where compiled code writes it."""
    setup = named(name, delay=5, delay_known=True)
    sensor = setup.sensor()
    world = setup.world()
    believed_step = setup.control()
    images = setup.sensor().sensing(9)
    true, own = (step.packed for step in (world, believed_step))
    public = setup.control()
    pixels = []
    for k in range(9):
        at = k * setup.Ts
        pixels.append(world.evaluate(at, setup.q0, setup.qd0).pixels)
        seen = sensor.measured(k, setup.q0, setup.qd0, world.evaluate(at, setup.q0, setup.qd0))
        shown = public.evaluate_measured(at, setup.q0, setup.qd0, seen).pixels
        assert load("sensing").observe(Workspace(images), true.workspace, own.workspace, at, k) == 0
        found = believed_step.evaluate(at, setup.q0, setup.qd0).pixels
    assert np.abs(pixels[8] - pixels[3]).max() > 0.1
    for measured in (shown, found):
        np.testing.assert_allclose(measured, pixels[8 - age], atol=1e-6)


def test_a_lost_image_is_as_old_as_the_one_in_its_place() -> None:
    """Where the model is right nothing is lost with it."""
    lost = {"lost_frames": 0.5, "delay": 2, "delay_known": True}
    one, other = (
        simulate(named("ur5-fov", **settings), HierarchicalQP()) for settings in ({}, lost)
    )
    np.testing.assert_allclose(other.q, one.q, atol=1e-7)


@pytest.mark.parametrize(
    ("error", "estimates"),
    [
        ({}, False),
        ({"depth_factor": 1.1}, False),
        ({"pixel_noise": 0.5}, True),
        ({"focal_factor": [1.1, 1.0]}, True),
        ({"mount_translation_error": [0.01, 0.0, 0.0]}, True),
        ({"mount_rotation_error": [0.0, 0.01, 0.0]}, True),
        ({"marker_distance_factor": 1.1}, True),
    ],
)
def test_the_pose_is_estimated_if_any_error_would_change_it(
    error: Mapping[str, Any], estimates: bool
) -> None:
    assert case(**error).sensor().estimates is estimates


def test_a_wrong_depth_and_wrong_intrinsics_spoil_the_jacobian_as_they_should() -> None:
    there = case(depth_factor=1.25)
    state = there.scene.evaluate(0.0, there.q0, np.full(6, 0.1))
    believed = observe(there.sensor(), state)
    np.testing.assert_allclose(believed.depth, 1.25 * state.depth)
    np.testing.assert_allclose(believed.pixels.position, state.pixels.position, atol=1e-9)
    # only the translational columns of L depend on Z
    L = np.linalg.lstsq(state.camera_J.T, believed.normalised.J.reshape(-1, 6).T, rcond=None)[0].T
    true = np.linalg.lstsq(state.camera_J.T, state.normalised.J.reshape(-1, 6).T, rcond=None)[0].T
    np.testing.assert_allclose(L[:, :3], true[:, :3] / 1.25, atol=1e-9)
    np.testing.assert_allclose(L[:, 3:], true[:, 3:], atol=1e-9)

    there = case(focal_factor=[1.1, 0.95], principal_point_error=[4.0, -3.0])
    believed = observe(there.sensor(), state)
    np.testing.assert_allclose(believed.pixels.position, state.pixels.position, atol=1e-9)
    xy = (state.pixels.position - [4.0, -3.0]) / np.multiply(there.scene.camera.focal, [1.1, 0.95])
    np.testing.assert_allclose(believed.normalised.position, xy, atol=1e-12)


def reprojection(markers: Array, xy: Array, x: Array) -> Array:
    P = (markers - x[:3]) @ Rotation.from_rotvec(x[3:]).as_matrix()
    return (P[:, :2] / P[:, 2:] - xy).ravel()


@pytest.mark.parametrize("seed", range(5))
def test_the_pose_is_that_of_a_general_least_squares_solver(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scene, q, _ = random_scene(robot("ur5"), rng)
    true = scene.evaluate(NOW, q, np.zeros(6))
    corners = 0.1 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    markers = true.camera.act(
        np.array([0.05, 0.1, 0.9]) + corners @ Rotation.from_rotvec([0.3, -0.4, 0.5]).as_matrix()
    )
    P = (markers - true.camera.t) @ true.camera.R
    xy = P[:, :2] / P[:, 2:] + rng.normal(scale=1e-3, size=(4, 2))
    start = true.camera @ Pose(
        Rotation.from_rotvec([0.02, -0.03, 0.01]).as_matrix(), np.array([0.01, 0.02, -0.01])
    )
    found = estimated_pose(markers, xy, start)
    x0 = np.concatenate((start.t, Rotation.from_matrix(start.R).as_rotvec()))
    best = least_squares(
        lambda x: reprojection(markers, xy, x), x0, xtol=1e-15, ftol=1e-15, gtol=1e-15
    ).x
    off = distance(found, Pose(Rotation.from_rotvec(best[3:]).as_matrix(), best[:3]))
    assert off[0] < 1e-6
    assert off[1] < 1e-6


def test_what_two_markers_do_not_determine_is_left_as_the_kinematics_say() -> None:
    there = Scenario.load("example-2d-fov").with_override("disturbances.pixel_noise", 1e-9).setup()
    state = there.scene.evaluate(0.0, there.q0, there.qd0)
    believed = observe(there.sensor(), state)
    assert max(distance(believed.camera, state.camera)) < 1e-9


def test_a_known_target_is_followed_and_an_unknown_one_taken_for_static() -> None:
    scene, q, qd = random_scene(robot("ur5"), np.random.default_rng(2), world="moving-target")
    true = scene.evaluate(NOW, q, qd)
    assert believed(scene, true).camera_twist is true.camera_twist
    assert scene.motion is not None
    motion = scene.motion
    told = motion.translation
    told.known = False
    try:
        supposed = observe(Sensor(scene, Disturbances(), 0.01), true)
    finally:
        told.known = True
    np.testing.assert_allclose(supposed.camera_twist, true.camera_J @ qd, atol=1e-12)
    assert np.abs(supposed.camera_twist - true.camera_twist).max() > 0.05
    np.testing.assert_array_equal(supposed.pixels.position, true.pixels.position)


# --- eq. (49) ---


def test_the_gradient_error_is_eq_49() -> None:
    there = case(gradient_error=0.3)
    qd = np.array([0.1, -0.2, 0.3, 0.1, -0.3, 0.2])
    state = there.scene.evaluate(0.0, there.q0, qd)
    rows, sigma = evaluate_rows(there.constraints, state)
    spoilt = there.gradient_error()(rows, qd)
    signs = np.array([-1, 1, 1, 1, -1, -1])
    for i, label in enumerate(rows.labels):
        if not label.startswith("fov"):
            np.testing.assert_array_equal(spoilt.Lg[i], rows.Lg[i])
            assert (spoilt.phi[i], spoilt.Lf[i]) == (rows.phi[i], rows.Lf[i])
            continue
        K = 0.1
        gradient = rows.Lg[i] / K
        wrong = gradient + 0.3 * signs * np.abs(gradient)
        np.testing.assert_allclose(spoilt.Lg[i], K * wrong, rtol=1e-12)
        assert spoilt.phi[i] == pytest.approx(sigma[i] + K * wrong @ qd, rel=1e-12)
        assert spoilt.Lf[i] - rows.Lf[i] == pytest.approx((wrong - gradient) @ qd, rel=1e-9)


def test_the_gradient_error_may_leave_phi_as_it_is() -> None:
    """The other reading of (49): ∇σ_e in L_gφ alone."""
    both = case(gradient_error=0.3)
    alone = case(gradient_error=0.3, gradient_error_in_phi=False)
    qd = np.array([0.1, -0.2, 0.3, 0.1, -0.3, 0.2])
    rows, _ = evaluate_rows(alone.constraints, alone.scene.evaluate(0.0, alone.q0, qd))
    spoilt = alone.gradient_error()(rows, qd)
    np.testing.assert_array_equal(spoilt.Lg, both.gradient_error()(rows, qd).Lg)
    np.testing.assert_array_equal(spoilt.phi, rows.phi)
    np.testing.assert_array_equal(spoilt.Lf, rows.Lf)
    assert np.abs(spoilt.Lg - rows.Lg).max() > 0.0


def test_what_is_kept_is_true_whatever_is_believed() -> None:
    """σ and φ of a run are those of the true state with the true gradient; the rows that act are
    the believed ones.
    """
    there = case(duration=1.0, gradient_error=0.3, depth_factor=1.3, pixel_noise=0.5)
    run = simulate(there, SlidingMode())
    for k in (0, 150, 499):
        state = there.scene.evaluate(run.t[k], run.q[k], run.qd[k])
        rows, sigma = evaluate_rows(there.constraints, state)
        np.testing.assert_allclose(run.phi[k], rows.phi, atol=1e-10)
        np.testing.assert_allclose(run.sigma[k], sigma, atol=1e-10)
        np.testing.assert_allclose(run.features_px[k], state.pixels.position, atol=1e-9)


def test_the_baseline_of_a_disturbed_scenario_is_disturbed_too() -> None:
    free, pushed = (simulate(case(acceleration=value), Tracking()) for value in ([0.0], [0.3]))
    assert np.abs(free.q - pushed.q).max() > 1e-3


# --- bad input ---


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (
            {"acceleration": [0.1, 0.2]},
            "acceleration must be one number or 6, one per joint, not 2",
        ),
        ({"acceleration": "much"}, "acceleration must be a list"),
        ({"gradient_error_signs": [1, -1]}, "gradient_error_signs must be one number or 6"),
        ({"gradient_error_signs": [1, -1, 1, -1, 1, 2]}, "must be 1 or −1"),
        (
            {"gradient_error": 0.3, "gradient_error_rows": ["occlusion"]},
            "but there are no such rows.*fov",
        ),
        (
            {"gradient_error": 0.3, "gradient_error_rows": ["fov", "rnage"]},
            "'rnage'.*Did you mean 'range'",
        ),
        ({"gradient_error": 0.3, "gradient_error_rows": ["speed"]}, "a speed is not"),
        ({"gradient_error": -0.3}, "gradient_error must be zero or more"),
        ({"gradient_error_in_phi": 1}, "gradient_error_in_phi must be"),
        ({"pixel_noise": -1.0}, "pixel_noise must be zero or more"),
        ({"pixel_noise": float("nan")}, "pixel_noise must be finite"),
        ({"depth_factor": 0.0}, "depth_factor must be positive"),
        ({"focal_factor": [1.0]}, "focal_factor must be 2 numbers"),
        ({"focal_factor": [1.0, -1.0]}, "focal_factor must be positive"),
        (
            {"image_period": 0.003},
            "image_period must be a multiple of the sampling time, 0.002 s, not 0.003",
        ),
        ({"delay": 1.5}, "delay must be an integer"),
        ({"delay": -1}, "delay must be zero or more"),
        ({"lost_frames": 1.0}, "lost_frames is a probability"),
        ({"noise": 1.0}, "key in case-study-6r.disturbances 'noise'"),
        ({"actuation": "torque"}, "actuation in case-study-6r"),
        ({"actuation": "position", "acceleration": [0.1]}, "give time_constant too"),
        ({"target__motion": {"velocity": [0.1, 0.0]}}, "a target moves in space"),
        ({"target__motion": {"amplitude": [0.1, 0.0, 0.0]}}, "an amplitude needs a frequency"),
        (
            {"target__motion": {"speed": [0.1, 0.0, 0.0]}},
            "key in case-study-6r.target.motion 'speed'",
        ),
        ({"target__motion": {"known": "no"}}, "known must be true or false"),
        (
            {"constraints__0__motion": {"velocity": [1.0, 0.0, 0.0]}},
            "fov moves by 2 coordinates, not 3",
        ),
        ({"constraints__1__motion": {"velocity": [1.0, 0.0]}}, "range cannot move"),
        (
            {"camera__fixed": {"xyz": [0, 0, 1]}, "camera__mount": {"xyz": [0, 0, 1]}},
            "for the camera's pose, not mount and fixed",
        ),
    ],
)
def test_disturbances_of_the_wrong_kind_or_size_are_refused(
    settings: dict[str, Any], words: str
) -> None:
    with pytest.raises(REFUSED, match=words):
        case(**settings)


def test_a_target_on_the_robot_has_no_motion_of_its_own() -> None:
    scene, _, _ = random_scene(robot("ur5"), np.random.default_rng(0), world="eye-to-hand")
    motion = TargetMotion(Motion([0.1, 0.0, 0.0]), np.zeros(3), np.zeros(3))
    with pytest.raises(InvalidInput, match="carries before a fixed camera"):
        type(scene)(scene.robot, scene.camera, scene.markers, (), motion)


def test_an_image_that_no_pose_in_front_of_the_camera_explains_ends_the_run() -> None:
    """Noise of 2000 px: nothing is believed of it, and no depth made up."""
    run = simulate(case(duration=1.0, pixel_noise=2000.0), SlidingMode())
    assert run.status == "failed"
    assert (
        "no camera pose explains the measured image: not in front of the camera: "
        "marker" in run.reason
    )
