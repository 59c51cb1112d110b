"""One contract for every robot, feature and constraint: all derivatives are those of the values.

Values (positions, errors, σ) are differentiated numerically, along q or along motions through the
state; nothing here uses a formula of the code that is tested. What is registered is tested by being
registered.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import numpy_form
import vsconstraints.robots.robot
import vsconstraints.vision.features
import vsconstraints.vision.scene
from numpy_form import believed, evaluate_rows, feature_motion
from scenes import (
    NOW,
    SHAPE_PARAMETERS,
    WORLDS,
    build_constraint,
    constraint_tables,
    gradient,
    random_goal,
    random_scene,
    robot,
    robot_names,
    second_slope,
    slope,
    states,
)
from vsconstraints import Robot, RobotPoint
from vsconstraints.constraints import (
    Constraint,
    ConstraintSet,
    ForbiddenRegion,
    ImageConstraint,
    PointConstraint,
    SpeedConstraint,
    robot_points,
)
from vsconstraints.constraints.base import PositionConstraint
from vsconstraints.constraints.curves import SHAPES, Shape
from vsconstraints.constraints.regions import KnownRegion, RegionAroundAxis
from vsconstraints.robots.geometry import Pose
from vsconstraints.robots.kinematics import Kinematics
from vsconstraints.rows import Array
from vsconstraints.scenarios import CONSTRAINTS
from vsconstraints.vision.features import (
    FEATURES,
    AreaCentroid,
    Feature,
    Goal,
    ImagePoints,
    Polar,
    Stack,
)
from vsconstraints.vision.motion import Motion
from vsconstraints.vision.scene import PointMotion, Scene

STATES = 6

STEP = 2e-4
"""Step of first differences [s or rad].

With the exponent 16 of the hyperellipse the fifth derivative is about 32⁴ times the first, so that
the truncation h⁴/30 · 32⁴ is 6e-11; rounding is 1e-16/h = 5e-13 of the value.
"""

LONG_STEP = 2e-3
"""Step of second differences.

Rounding is 2e-16/h² = 5e-11 of the value, truncation h⁴/90 of the sixth derivative.
"""

RELATIVE = 1e-6
"""A slip in a formula (a sign, a factor, a missing term) is of the order of 1, differences are good
to 1e-9.
"""

ABSOLUTE = 1e-8
"""Relative to the values that are differentiated: a hundred times the rounding above."""


class Comparison:
    """Compares analytic with numerical derivatives over several states, none of them always
    zero.
    """

    def __init__(self, trivial: tuple[str, ...] = ()) -> None:
        self.trivial = trivial
        self.largest: dict[str, Array] = {}

    def agree(
        self, what: str, analytic: Array, numerical: Array, size: float | Array = 1.0
    ) -> None:
        """Equal up to rounding, row by row; ``size`` is that of the values which were
        differentiated.
        """
        assert analytic.shape == numerical.shape, what
        rows = len(analytic)
        deviation = np.abs(analytic - numerical).reshape(rows, -1).max(axis=1)
        largest = np.abs(numerical).reshape(rows, -1).max(axis=1)
        allowed = RELATIVE * largest + ABSOLUTE * np.maximum(1.0, size)
        worst = int(np.argmax(deviation / allowed))
        assert (deviation <= allowed).all(), (
            f"{what}, row {worst}: analytic {analytic[worst]}, numerical {numerical[worst]}"
        )
        seen = self.largest.get(what, np.zeros(rows))
        self.largest[what] = np.maximum(seen, largest / allowed)

    def finish(self) -> None:
        """Every quantity was a thousand tolerances somewhere: a wrong sign could not have
        passed.
        """
        assert self.largest
        for what, ratio in self.largest.items():
            if what not in self.trivial:
                assert (ratio > 1e3).any(), f"{what} was always next to zero: {ratio}"


# --- kinematics ---


def axial(S: Array) -> Array:
    """The vector w whose [w]× is the antisymmetric part of S."""
    return 0.5 * np.array([S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]])


class MovingFrame:
    """Twist, Jacobian and drift of a frame, from nothing but its pose at coordinates near q and
    times near 0.
    """

    def __init__(self, pose: Callable[[Array, float], Pose], q: Array, qd: Array) -> None:
        def along(t: float) -> Pose:
            return pose(q + t * qd, t)

        self.R = R = pose(q, 0.0).R
        self.dt = gradient(lambda x: pose(x, 0.0).t, q, STEP)
        dR = gradient(lambda x: pose(x, 0.0).R, q, STEP)
        self.turning = np.stack([axial(dR[..., i] @ R.T) for i in range(len(q))], axis=1)
        self.velocity = slope(lambda t: along(t).t, STEP)
        self.omega = axial(slope(lambda t: along(t).R, STEP) @ R.T)
        self.acceleration = second_slope(lambda t: along(t).t, LONG_STEP)
        # d/dt of Ṙ Rᵀ = [ω]× is [ω̇]×, and Ṙ Ṙᵀ is symmetric
        self.omega_dot = axial(second_slope(lambda t: along(t).R, LONG_STEP) @ R.T)

    def in_base(self) -> tuple[Array, Array]:
        """Jacobian and drift of the twist (v, ω), in the axes of the base."""
        return np.concatenate((self.dt, self.turning)), np.concatenate(
            (self.acceleration, self.omega_dot)
        )

    def in_own_axes(self) -> tuple[Array, Array]:
        """The same in the frame's own axes, which turn: d/dt (Rᵀ ṫ) = Rᵀ (ẗ − ω × ṫ)."""
        R = self.R
        linear = self.acceleration - np.cross(self.omega, self.velocity)
        return (
            np.concatenate((R.T @ self.dt, R.T @ self.turning)),
            np.concatenate((R.T @ linear, R.T @ self.omega_dot)),
        )

    def twist(self) -> Array:
        """Its twist (v, ω) in its own axes."""
        return np.concatenate((self.R.T @ self.velocity, self.R.T @ self.omega))


def compare_kinematics(comparison: Comparison, arm: Robot, rng: np.random.Generator) -> None:
    _, q, qd = random_scene(arm, rng)
    some = [
        RobotPoint(),
        RobotPoint(offset=(0.1, -0.2, 0.05)),
        *(RobotPoint(link, offset=(0.2, 0.1, -0.3)) for link in arm.links[1:]),
    ]
    now = arm.kinematics(q, qd, some)
    tip = MovingFrame(lambda x, _: arm.kinematics(x, qd).tip, q, qd)
    for frame, analytic, numerical in (
        ("tip frame", (now.J, now.drift), tip.in_own_axes()),
        ("base frame", (arm.jacobian(q), arm.drift(q, qd)), tip.in_base()),
    ):
        comparison.agree(f"tip Jacobian in the {frame}", analytic[0], numerical[0])
        comparison.agree(f"tip drift in the {frame}", analytic[1], numerical[1])

    # a link on the first joint turns about a fixed axis: its drift can vanish
    moving = [link for link in arm.links if arm.model.frames[arm.frame_id(link)].parentJoint > 1]
    for link in moving:
        body = MovingFrame(lambda x, _, link=link: arm.pose(x, link), q, qd)
        comparison.agree(f"Jacobian of {link}", arm.jacobian(q, link), body.in_base()[0])
        comparison.agree(f"drift of {link}", arm.drift(q, qd, link), body.in_base()[1])
    offset = (0.1, -0.2, 0.05)
    J = arm.jacobian(q, arm.links[-1], offset, "tip")
    drift = arm.drift(q, qd, arm.links[-1], offset, "tip")
    twist = slope(lambda t: arm.jacobian(q + t * qd, arm.links[-1], offset, "tip") @ qd, STEP)
    comparison.agree("drift in the tip's axes", drift, twist)
    in_base = arm.jacobian(q, arm.links[-1], offset).reshape(2, 3, -1)
    comparison.agree("Jacobian in the tip's axes", J, (now.tip.R.T @ in_base).reshape(6, -1))
    comparison.agree(
        "Jacobian of a point", arm.jacobian(q, arm.links[-1], (0.2, 0.1, -0.3))[:3], now.point_J[-1]
    )

    def points(x: Array) -> Array:
        return arm.kinematics(x, qd, some).points

    comparison.agree("point Jacobians", now.point_J, gradient(points, q, STEP))
    comparison.agree(
        "point drifts", now.point_drift, second_slope(lambda t: points(q + t * qd), LONG_STEP)
    )
    np.testing.assert_allclose(now.points[0], now.tip.t, atol=1e-14)


def check_kinematics(name: str) -> None:
    # the free camera's first links only move straight, and turn about a fixed axis
    straight = tuple(f"drift of link {i}" for i in (2, 3, 4)) if name == "free-camera" else ()
    comparison = Comparison(trivial=straight)
    for rng in states(name, STATES):
        compare_kinematics(comparison, robot(name), rng)
    comparison.finish()


def compare_image(comparison: Comparison, arm: Robot, rng: np.random.Generator, world: str) -> None:
    scene, q, qd = random_scene(arm, rng, world=world)
    now = scene.evaluate(NOW, q, qd)
    frame = MovingFrame(lambda x, t: scene.evaluate(NOW + t, x, qd).camera, q, qd)
    J, drift = frame.in_own_axes()
    comparison.agree("camera Jacobian", now.camera_J, J)
    comparison.agree("camera twist", now.camera_twist, frame.twist())
    comparison.agree("camera drift", now.camera_drift, drift)
    np.testing.assert_allclose(scene.camera_pose(q, NOW).R, now.camera.R, atol=1e-14)
    np.testing.assert_allclose(scene.markers_at(q, NOW), base_markers(scene, q), atol=1e-12)
    for what in ("pixels", "normalised"):
        motion: PointMotion = getattr(now, what)

        def position(x: Array, t: float = 0.0, what: str = what) -> Array:
            return getattr(scene.evaluate(NOW + t, x, qd), what).position

        def along(t: float, position: Callable[[Array, float], Array] = position) -> Array:
            return position(q + t * qd, t)

        size = np.abs(motion.position).max()
        comparison.agree(f"{what}: J", motion.J, gradient(position, q, STEP), size)
        comparison.agree(f"{what}: velocity", motion.velocity, slope(along, STEP), size)
        comparison.agree(f"{what}: drift", motion.drift, second_slope(along, LONG_STEP), size)


def base_markers(scene: Scene, q: Array) -> Array:
    """(m, 3) markers in the base frame, from what the camera sees of them: u, v and depth."""
    state = scene.evaluate(NOW, q, np.zeros(len(q)))
    xy = state.normalised.position
    Z = state.depth[:, None]
    camera = scene.camera.fixed or scene.robot.pose(q) @ scene.camera.mount.inverse
    return camera.act(np.concatenate((xy * Z, Z), axis=1))


def check_image(name: str, world: str = WORLDS[0]) -> None:
    comparison = Comparison()
    for rng in states(name, STATES):
        compare_image(comparison, robot(name), rng, world)
    comparison.finish()


@pytest.mark.parametrize("name", robot_names())
def test_tip_and_point_jacobians_and_drifts(name: str) -> None:
    check_kinematics(name)


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("name", robot_names())
def test_camera_twist_and_image_motion(name: str, world: str) -> None:
    check_image(name, world)


# --- features ---

ANGLES = (0.0, 1e-3, 0.7, 2.0, 3.1, np.pi)
"""By how much goals are turned away: also to where the rotation vector's axis is ambiguous."""


def compare_feature(
    comparison: Comparison,
    feature: Feature,
    arm: Robot,
    rng: np.random.Generator,
    angle: float,
    world: str,
) -> None:
    scene, q, qd = random_scene(arm, rng, world=world)
    state = scene.evaluate(NOW, q, qd)
    goal = random_goal(state, scene.camera, rng, angle)
    now = feature_motion(feature, state, goal, None)

    def error(x: Array, t: float = 0.0) -> Array:
        return feature_motion(feature, scene.evaluate(NOW + t, x, qd), goal, now.error).error

    def along(t: float) -> Array:
        return error(q + t * qd, t)

    # adding whole turns to a rotation vector of length π leaves rounding
    np.testing.assert_allclose(error(q), now.error, rtol=0.0, atol=1e-14)
    comparison.agree("J_s", now.J, gradient(error, q, STEP))
    comparison.agree("velocity", now.velocity, slope(along, STEP))
    # the angle of a marker near the axis and a small area bend over short ways, for shorter steps
    curved = isinstance(feature, Polar | AreaCentroid)
    step = LONG_STEP / 4.0 if curved else LONG_STEP
    # next to a turn by π Pinocchio's logarithm is good to some 1e-14, of which second differences
    # make 1e-7
    comparison.agree("drift", now.drift, second_slope(along, step), 10.0 if angle > 3.0 else 1.0)
    if world == "moving-target":
        comparison.agree("∂s/∂t", now.partial, slope(lambda t: error(q, t), STEP))
    else:
        np.testing.assert_allclose(now.partial, 0.0, atol=1e-12)


def check_feature(name: str, feature: Feature, world: str = WORLDS[0]) -> None:
    comparison = Comparison()
    for rng, angle in zip(states(name, len(ANGLES)), ANGLES, strict=True):
        compare_feature(comparison, feature, robot(name), rng, angle, world)
    comparison.finish()


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("feature", FEATURES.values(), ids=FEATURES)
@pytest.mark.parametrize("name", robot_names())
def test_features(name: str, feature: type[Feature], world: str) -> None:
    check_feature(name, feature(), world)


@pytest.mark.parametrize(("which", "share"), [("desired", 1.0), ("mean", 0.5)])
def test_other_interaction_matrices_change_the_task_but_not_what_is_seen(
    which: str, share: float
) -> None:
    """Ĵ_s from (1 − share) of the current and share of the desired interaction matrix, and its
    drift with that held.
    """
    for rng in states("panda", STATES):
        scene, q, qd = random_scene(robot("panda"), rng)
        state = scene.evaluate(NOW, q, qd)
        there = scene.evaluate(NOW, q + rng.uniform(-0.05, 0.05, 7), qd)
        goal = Goal(
            0.0, there.pixels.position, there.normalised.position, there.camera, there.depth
        )
        seen = feature_motion(ImagePoints(), state, goal, None)
        other = feature_motion(ImagePoints(which), state, goal, None)
        np.testing.assert_array_equal(other.error, seen.error)
        np.testing.assert_allclose(other.velocity, other.J @ qd + seen.partial, atol=1e-12)
        # at the goal's depth and image, but with the arm where it is
        P = np.concatenate((goal.normalised * goal.depth[:, None], goal.depth[:, None]), axis=1)
        twin = Scene(scene.robot, scene.camera, state.camera.act(P)).evaluate(NOW, q, qd)
        desired = twin.normalised.J.reshape(-1, 7)
        np.testing.assert_allclose(other.J, (1.0 - share) * seen.J + share * desired, atol=1e-12)

        held = other.J @ np.linalg.pinv(state.camera_J)

        def task_velocity(
            t: float, q: Array = q, qd: Array = qd, scene: Scene = scene, L: Array = held
        ) -> Array:
            return L @ scene.evaluate(NOW, q + t * qd, qd).camera_J @ qd

        np.testing.assert_allclose(other.drift, slope(task_velocity, STEP), rtol=1e-6, atol=1e-7)


# --- constraints ---


def compare_constraint(
    comparison: Comparison, constraint: Constraint, arm: Robot, rng: np.random.Generator, world: str
) -> None:
    scene, q, qd = random_scene(arm, rng, [constraint], world)
    constraints = ConstraintSet([constraint], scene)
    at_rest = np.zeros(arm.n)
    qdd = rng.uniform(-3.0, 3.0, arm.n)

    def sigma_and_phi(x: Array, v: Array, t: float = 0.0) -> tuple[Array, Array]:
        rows, sigma = evaluate_rows(constraints, scene.evaluate(NOW + t, x, v))
        return sigma, rows.phi

    def along(t: float, qdd: Array = at_rest) -> tuple[Array, Array]:
        return sigma_and_phi(q + t * qd + 0.5 * t * t * qdd, qd + t * qdd, t)

    rows, sigma = evaluate_rows(constraints, scene.evaluate(NOW, q, qd))
    size = np.abs(rows.phi)
    G, h = rows.velocity_form(qd)
    if isinstance(constraint, SpeedConstraint):
        np.testing.assert_array_equal(rows.phi, sigma)
        faster = 1.3 * qd + 0.1
        comparison.agree("G q̇ − h = φ(q̇)", G @ faster - h, sigma_and_phi(q, faster)[1], size)
    else:
        in_time = slope(lambda t: sigma_and_phi(q, at_rest, t)[0], STEP)
        comparison.agree("h = −σ − K ∂σ/∂t", h, -sigma - constraint.K * in_time, size)
        sigma_dot = slope(lambda t: along(t)[0], STEP)
        comparison.agree("φ − σ = K dσ/dt", rows.phi - sigma, constraint.K * sigma_dot, size)
        dsigma_dq = gradient(lambda x: sigma_and_phi(x, at_rest)[0], q, STEP)
        comparison.agree("L_gφ = K ∂σ/∂q", rows.Lg, constraint.K * dsigma_dq, size)
    comparison.agree(
        "L_gφ = ∂φ/∂q̇", rows.Lg, gradient(lambda v: sigma_and_phi(q, v)[1], qd, STEP), size
    )
    comparison.agree("L_fφ", rows.Lf, slope(lambda t: along(t)[1], STEP), size)
    phi_dot = slope(lambda t: along(t, qdd)[1], STEP)
    comparison.agree("φ̇ = L_fφ + L_gφ q̈", rows.Lf + rows.Lg @ qdd, phi_dot, size)


def check_constraint(name: str, constraint: Constraint, world: str = WORLDS[0]) -> None:
    # the φ of a speed does not change while the speed does not
    comparison = Comparison(trivial=("L_fφ",) if isinstance(constraint, SpeedConstraint) else ())
    for rng in states(name, STATES):
        compare_constraint(comparison, constraint, robot(name), rng, world)
    comparison.finish()


EXAMPLES = [
    pytest.param(name, type_name, number, id=f"{name}-{type_name}-{number}")
    for name in robot_names()
    for type_name in CONSTRAINTS
    for number in range(len(constraint_tables(type_name, robot(name))))
]


@pytest.mark.parametrize(("name", "type_name", "number"), EXAMPLES)
def test_constraints(name: str, type_name: str, number: int) -> None:
    arm = robot(name)
    check_constraint(
        name, build_constraint(type_name, constraint_tables(type_name, arm)[number], arm)
    )


@pytest.mark.parametrize("world", WORLDS[1:])
@pytest.mark.parametrize(
    ("type_name", "number"),
    [example.values[1:] for example in EXAMPLES if example.values[0] == "ur5"],
)
def test_constraints_in_other_worlds(type_name: str, number: int, world: str) -> None:
    """Before a fixed camera, and with a target that moves; obstacles that can move do so too."""
    arm = robot("ur5")
    constraint = build_constraint(type_name, constraint_tables(type_name, arm)[number], arm)
    if isinstance(constraint, PositionConstraint) and world == "moving-target":
        d = constraint.coordinates
        constraint.moving(
            Motion(
                [20.0, -9.0, 0.2][-d:], amplitude=[3.0, 0.1, -0.05][-d:], frequency=0.5, phase=0.2
            )
        )
    check_constraint("ur5", constraint, world)


def test_an_unknown_motion_leaves_only_sigma() -> None:
    arm = robot("ur5")
    rng = np.random.default_rng(5)
    table = constraint_tables("forbidden-sphere", arm)[0]
    told, untold, still = (build_constraint("forbidden-sphere", table, arm) for _ in range(3))
    velocity = np.array([0.3, -0.2, 0.1])
    told.moving(Motion(velocity))
    untold.moving(Motion(velocity, known=False))
    still.pose = Pose(np.eye(3), np.asarray(still.centre) + NOW * velocity)
    scene, q, qd = random_scene(arm, rng, [told])
    true = scene.evaluate(NOW, q, qd)
    supposed = believed(scene, true)
    known, unknown, static, truth = (
        evaluate_rows(ConstraintSet([constraint], scene), state)[0]
        for constraint, state in (
            (told, supposed),
            (untold, supposed),
            (still, true),
            (untold, true),
        )
    )
    for name in ("phi", "Lg", "Lf"):
        np.testing.assert_allclose(getattr(unknown, name), getattr(static, name), atol=1e-12)
        np.testing.assert_allclose(getattr(known, name), getattr(truth, name), atol=1e-12)
    assert abs(known.phi[0] - unknown.phi[0]) > 1e-3
    assert abs(known.Lf[0] - unknown.Lf[0]) > 1e-3


def concrete(base: type) -> set[type]:
    """Classes of the package that derive from ``base`` and can be made."""
    bases = ImageConstraint, PointConstraint, ForbiddenRegion, KnownRegion, RegionAroundAxis, Shape
    abstract = inspect.isabstract(base) or base in bases
    found = {base} if not abstract and base.__module__.startswith("vsconstraints.") else set()
    return found.union(*(concrete(derived) for derived in base.__subclasses__()))


@pytest.mark.parametrize("type_name", CONSTRAINTS)
def test_every_registered_constraint_type_has_an_example(type_name: str) -> None:
    assert constraint_tables(type_name, robot("planar-3r")), (
        f"the constraint type {type_name!r} is registered in CONSTRAINTS but tests/scenes.py has "
        f"no example: "
        "add one to constraint_tables, and its derivatives are tested on every robot"
    )


@pytest.mark.parametrize("name", SHAPES)
def test_every_registered_shape_has_an_example(name: str) -> None:
    assert name in SHAPE_PARAMETERS, (
        f"the shape {name!r} is registered in SHAPES but tests/scenes.py has no parameters for it: "
        "add them to SHAPE_PARAMETERS, and its derivatives are tested on every robot"
    )


def test_every_class_is_registered_and_so_tested() -> None:
    arm = robot("planar-3r")
    built = {
        type(build_constraint(type_name, table, arm))
        for type_name in CONSTRAINTS
        for table in constraint_tables(type_name, arm)
    }
    assert built == concrete(Constraint), (
        "a constraint class is in no example: its derivatives are untested"
    )
    assert set(SHAPES.values()) == concrete(Shape)
    # a stack is what the last of them is
    assert set(FEATURES.values()) == concrete(Feature) - {Stack}


# --- the contract notices slips ---


def negated(function):
    return lambda *arguments: -function(*arguments)


def evaluate_with(**factors: float):
    original = vsconstraints.robots.robot.KinematicsEvaluator.__call__

    def evaluate(self, q: Array, qd: Array) -> Kinematics:
        now = original(self, q, qd)
        return replace(now, **{key: factor * getattr(now, key) for key, factor in factors.items()})

    return evaluate


@pytest.mark.parametrize(
    ("factors", "check"),
    [
        ({"drift": -1.0}, check_kinematics),
        ({"J": -1.0}, check_kinematics),
        ({"point_J": 1.00001}, check_kinematics),
        ({"point_drift": 0.0}, check_kinematics),
        ({"drift": 0.0}, check_image),
    ],
)
def test_a_slip_in_the_kinematics_is_noticed(factors, check, monkeypatch) -> None:
    monkeypatch.setattr(
        vsconstraints.robots.robot.KinematicsEvaluator, "__call__", evaluate_with(**factors)
    )
    with pytest.raises(AssertionError):
        check("ur5")


def test_a_slip_in_the_interaction_matrix_is_noticed(monkeypatch) -> None:
    right = vsconstraints.vision.scene.interaction_matrix
    signs = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
    monkeypatch.setattr(
        vsconstraints.vision.scene, "interaction_matrix", lambda xy, Z: right(xy, Z) * signs
    )
    with pytest.raises(AssertionError, match="pixels: J"):
        check_image("ur5")


def test_a_slip_in_the_rotation_vectors_rate_is_noticed(monkeypatch) -> None:
    # the sign of the middle term of L_θu for ω in the fixed frame: the slip that eq. (44) invites
    right = numpy_form.rotation_vector_rate
    monkeypatch.setattr(
        numpy_form,
        "rotation_vector_rate",
        lambda w, omega: tuple(np.array(part).T for part in right(w, omega)),
    )
    with pytest.raises(AssertionError, match="J_s"):
        check_feature("ur5", FEATURES["camera-pose"]())


SLIPS = [
    pytest.param(type_name, number, method, id=f"{type_name}-{number}-{method}")
    for type_name, methods in {
        "field-of-view": ("gradient", "curvature"),
        "occlusion": ("gradient", "curvature"),
        "joint-range": ("gradient",),
        "joint-speed": ("gradient",),
        "forbidden-sphere": ("gradient", "curvature"),
        "forbidden-box": ("gradient",),
        "forbidden-cylinder": ("gradient",),
        "forbidden-capsule": ("gradient", "curvature"),
        "forbidden-half-space": ("gradient",),
        "self-collision": ("curvature",),
    }.items()
    for number in range(len(constraint_tables(type_name, robot("viper-s650"))))
    for method in methods
]


@pytest.mark.parametrize(("type_name", "number", "method"), SLIPS)
def test_a_slip_in_a_constraint_is_noticed(
    type_name: str, number: int, method: str, monkeypatch
) -> None:
    arm = robot("viper-s650")
    constraint = build_constraint(type_name, constraint_tables(type_name, arm)[number], arm)
    monkeypatch.setattr(constraint, method, negated(getattr(constraint, method)))
    with pytest.raises(AssertionError, match="row"):
        check_constraint("viper-s650", constraint)


def test_a_gradient_that_forgets_the_curves_rotation_is_noticed(monkeypatch) -> None:
    table = next(
        t for t in constraint_tables("occlusion", robot("ur5")) if t["curve"]["rotation"] != 0.0
    )
    constraint = build_constraint("occlusion", table, robot("ur5"))
    curve = constraint.curve
    true = constraint.gradient
    c = np.cos(curve.rotation)
    s = np.sin(curve.rotation)
    monkeypatch.setattr(constraint, "gradient", lambda y: true(y) @ np.array([[c, -s], [s, c]]))
    with pytest.raises(AssertionError, match="row"):
        check_constraint("ur5", constraint)


def test_points_of_several_links_are_in_the_examples() -> None:
    """The contract covers offsets, several points of one link, and several links in one
    constraint.
    """
    arm = robot("ur5")
    spheres = [
        build_constraint("forbidden-sphere", t, arm)
        for t in constraint_tables("forbidden-sphere", arm)
    ]
    points = robot_points(spheres)
    assert len({point.link for point in points}) >= 3
    assert len({point.link for point in points}) < len(points)
