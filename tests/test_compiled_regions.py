"""The compiled rows of forbidden regions, where the definition has edges, and beside other rows."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import product

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from scenes import build_constraint, constraint_tables, random_scene, robot
from test_control_step import assert_equal, both
from vsconstraints import Camera, Robot, RobotPoint
from vsconstraints.constraints import (
    ConstraintSet,
    ForbiddenBox,
    ForbiddenCapsule,
    ForbiddenCylinder,
    ForbiddenHalfSpace,
    ForbiddenRegion,
)
from vsconstraints.control_step import ControlStep
from vsconstraints.controllers import SlidingMode
from vsconstraints.features import Goal, ImagePoints
from vsconstraints.geometry import Pose
from vsconstraints.kernels import available
from vsconstraints.motion import Motion
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.scene import Scene
from vsconstraints.simulation import simulate
from vsconstraints.tracking import TrackingGains, VisualTask

pytestmark = pytest.mark.skipif(not available(), reason="there is no compiler here")

GAINS = {"K": 0.3, "switching_gain": 0.2, "margin": 0.05}
# z leads from start to end, and lengths are sums of powers of two: what stands on an edge stands there exactly
UP, DOWN = [0.0, 0.0, 0.5], [0.0, 0.0, -0.5]
MAKE: dict[str, Callable[[], ForbiddenRegion]] = {
    "half-space": lambda: ForbiddenHalfSpace(point=[0.0] * 3, normal=[0.0, 0.0, 1.0], **GAINS),
    "box": lambda: ForbiddenBox(centre=[0.0] * 3, size=[1.0, 0.5, 1.0], **GAINS),
    "cube": lambda: ForbiddenBox(centre=[0.0] * 3, size=[1.0, 1.0, 1.0], **GAINS),
    "cylinder": lambda: ForbiddenCylinder(start=DOWN, end=UP, radius=0.25, **GAINS),
    "disc": lambda: ForbiddenCylinder(start=DOWN, end=UP, radius=2.0, **GAINS),
    "capsule": lambda: ForbiddenCapsule(start=DOWN, end=UP, radius=0.25, **GAINS),
}
SWING = Motion([0.3, -0.2, 0.1], amplitude=[0.1, 0.2, 0.3], frequency=0.5, phase=0.4)
STEPS = (0.0, -0.0, 0.25, -0.25, 0.5, -0.5, 0.75, 1e-10, -1e-12, 2.0)
"""Coordinates at middles, faces, edges and corners, within what counts as a direction, and beyond."""


@cache
def gantry() -> Robot:
    """Three prismatic joints along x, y and z: its tip is at q exactly."""
    model = pin.Model()
    joint = 0
    for name, kind in (("x", pin.JointModelPX()), ("y", pin.JointModelPY()), ("z", pin.JointModelPZ())):
        joint = model.addJoint(joint, kind, pin.SE3.Identity(), name)
    tip = model.addFrame(pin.Frame("hand", joint, pin.SE3.Identity(), pin.FrameType.BODY))
    free = np.full(3, np.inf)
    return Robot(model, tip, "gantry", -free, free, free)


def far_scene(region: ForbiddenRegion) -> tuple[Scene, VisualTask]:
    """A gantry before markers far away."""
    markers = np.array([[-1.0, -1.0, 100.0], [1.0, -1.0, 100.0], [0.0, 1.0, 101.0]])
    camera = Camera((500.0, 500.0), (640.0, 480.0), mount=Pose.identity())
    scene = Scene(gantry(), camera, markers, region.points)
    pixels = scene.glance(np.zeros(3))[0]
    return scene, VisualTask(ImagePoints(), [Goal(0.0, pixels, camera.normalised(pixels))], TrackingGains(5.0))


def same(step: ControlStep, t: float, q: Array, qd: Array) -> None:
    step.reset()
    assert_equal(step.evaluate(t, q, qd), step.define(step.scene.evaluate(t, q, qd)))


@pytest.mark.parametrize("moves", [False, True])
@pytest.mark.parametrize("name", MAKE)
def test_on_faces_edges_corners_and_axes(name: str, moves: bool) -> None:
    """At t = 0, when what moves is where it would stand otherwise."""
    region = MAKE[name]()
    if moves:
        region.moving(SWING)
    scene, task = far_scene(region)
    step = ControlStep(scene, ConstraintSet([region], scene), task)
    assert step._packed is not None
    assert step._packed.others == []
    rng = np.random.default_rng(1)
    for there in product(STEPS, repeat=3):
        q, qd = np.array(there), rng.normal(size=3)
        np.testing.assert_array_equal(scene.glance(q)[1][0], there)
        same(step, 0.0, q, qd)


coordinate = st.floats(-2.0, 2.0)
speed = st.floats(-3.0, 3.0)


@settings(max_examples=200, deadline=None)
@given(
    name=st.sampled_from(sorted(MAKE)),
    rpy=st.tuples(speed, speed, speed),
    there=st.tuples(coordinate, coordinate, coordinate),
    velocity=st.tuples(speed, speed, speed),
    t=st.sampled_from([None, 0.0, 0.7, 13.0]),
)
@example("box", (0.3, -0.5, 1.2), (0.0, 0.0, 0.0), (1.0, 2.0, 3.0), None)
@example("capsule", (0.3, -0.5, 1.2), (0.0, 0.0, 0.0), (1.0, 2.0, 3.0), 0.0)
def test_anywhere(
    name: str,
    rpy: tuple[float, float, float],
    there: tuple[float, float, float],
    velocity: tuple[float, float, float],
    t: float | None,
) -> None:
    """Turned regions, points in and around them; those so near an edge that rounding takes sides are left out."""
    region = MAKE[name]()
    region.pose = Pose(Pose.from_xyz_rpy((0.0, 0.0, 0.0), rpy).R, np.zeros(3))
    if t is not None:
        region.moving(SWING)
    scene, task = far_scene(region)
    step = ControlStep(scene, ConstraintSet([region], scene), task)
    q, qd = np.array(there), np.array(velocity)
    y = q - (SWING.displacement(t) if t is not None else 0.0)
    near = y + 1e-7 * np.array(list(product((-1.0, 1.0), repeat=3)))
    v = np.ones((8, 3))
    smooth = np.ptp(region.gradient(near), axis=0).max() < 1e-4 and np.ptp(region.curvature(near, v)) < 1e-2
    if smooth or not y.any():
        same(step, t or 0.0, q, qd)


@pytest.mark.parametrize("name", ["viper-s650", "panda", "mixed-arm"])
def test_points_on_the_base_stay_where_they_are(name: str) -> None:
    """They have no gradient in q; a region that moves still comes towards them."""
    arm = robot(name)
    base = arm.model.frames[1].name if arm.model.frames[1].parentJoint == 0 else "universe"
    points = [RobotPoint(base, (0.1, 0.2, 0.3), "foot"), RobotPoint(name="nose")]
    region = ForbiddenBox(centre=[0.0, 0.1, 0.2], size=[0.4, 0.5, 0.3], points=points, **GAINS).moving(SWING)
    scene, q, qd = random_scene(arm, np.random.default_rng(3), [region])
    pixels = scene.glance(q)[0]
    task = VisualTask(ImagePoints(), [Goal(0.0, pixels, scene.camera.normalised(pixels))], TrackingGains(5.0))
    both(scene, ConstraintSet([region], scene), task, [(0.3, q, qd)])
    found = ControlStep(scene, ConstraintSet([region], scene), task).evaluate(0.3, q, qd)
    assert not found.rows.Lg[0].any()
    assert found.rows.phi[0] != found.sigma[0]


def test_rows_of_regions_stand_between_the_others() -> None:
    """Compiled with the step, after it, and not at all, several of each, with points of their own."""
    arm = robot("ur5")
    kinds = (
        "forbidden-box", "field-of-view", "forbidden-half-space", "self-collision", "forbidden-sphere", "occlusion",
        "forbidden-cylinder", "forbidden-capsule", "joint-speed",
    )  # fmt: skip
    several = {kind: 2 if kind.startswith("forbidden") else 1 for kind in kinds}
    some = [
        build_constraint(kind, table, arm) for kind in kinds for table in constraint_tables(kind, arm)[: several[kind]]
    ]
    for i, one in enumerate(some):
        if hasattr(one, "name"):
            one.name = f"number {i}"
    scene, q, qd = random_scene(arm, np.random.default_rng(2), some)
    pixels = scene.glance(q)[0]
    task = VisualTask(ImagePoints(), [Goal(0.0, pixels, scene.camera.normalised(pixels))], TrackingGains(5.0))
    constraints = ConstraintSet(some, scene)
    both(scene, constraints, task, [(0.01 * k, q + 0.01 * k * qd, qd) for k in range(3)])
    step = ControlStep(scene, constraints, task)
    assert step._packed is not None
    assert [one.kind for one, _, _ in step._packed.others] == ["self-collision"]
    assert step.bound() is None
    law = SlidingMode()
    command, expected = step.command(law, 0.0, q, qd)[1], law.command(*constraints_and_task(step, q, qd))
    np.testing.assert_allclose(command.qdd, expected.qdd, rtol=1e-7)


def constraints_and_task(step, q, qd):
    found = step.define(step.scene.evaluate(0.0, q, qd))
    return found.rows, found.task


def test_a_scene_with_a_region_goes_through_the_fast_loop() -> None:
    """Step and command on arrays that stay are those of the definition, and so is a whole run."""
    setup = Scenario.load("ur5-image").with_override("duration", 0.2).setup()
    step, law = ControlStep(setup.scene, setup.constraints, setup.task), SlidingMode()
    assert step._packed is not None
    assert (step._packed.after, step._packed.others) == (("regions",), [])
    bound = step.bound()
    assert bound is not None
    rng = np.random.default_rng(4)
    for k in range(10):
        q, qd = setup.q0 + 0.05 * rng.normal(size=6), rng.normal(size=6)
        step.reset()
        assert bound.evaluate(0.01 * k, q, qd) == 0
        expected = step.define(setup.scene.evaluate(0.01 * k, q, qd))
        assert_equal(bound.now, expected)
        step.reset()
        found, command = step.command(law, 0.01 * k, q, qd)
        assert_equal(found, expected)
        answer = law.command(found.rows, found.task)
        np.testing.assert_array_equal(command.qdd, answer.qdd)
    fast = simulate(setup, law)
    own = type("Own", (SlidingMode,), {"command": lambda self, rows, task: SlidingMode.command(self, rows, task)})
    slow = simulate(setup, own())
    np.testing.assert_array_equal(fast.q, slow.q)


def test_a_region_that_moves_unknown_to_controllers_is_where_it_is_but_static() -> None:
    region = MAKE["box"]().moving(Motion([0.1, 0.2, 0.3], known=False))
    scene, task = far_scene(region)
    untold, told = (ControlStep(scene, ConstraintSet([region], scene), task, told=told) for told in (False, True))
    assert untold._packed is not None
    assert untold._packed.others == []
    q, qd = np.array([0.1, 0.2, 0.3]), np.ones(3)
    state = scene.evaluate(0.3, q, qd)
    assert_equal(untold.evaluate(0.3, q, qd), untold.define(scene.believed(state)))
    assert_equal(told.evaluate(0.3, q, qd), told.define(state))
    assert untold.evaluate(0.3, q, qd).sigma[0] == told.evaluate(0.3, q, qd).sigma[0]
    assert abs(untold.evaluate(0.3, q, qd).rows.phi[0] - told.evaluate(0.3, q, qd).rows.phi[0]) > 1e-3


def test_an_own_region_runs_in_numpy() -> None:
    """A subclass may compute anything."""

    class Own(ForbiddenBox):
        def distance(self, x: Array) -> Array:
            return super().distance(x) - 0.1

    region = Own(centre=[0.0] * 3, size=[1.0, 0.5, 1.0], **GAINS)
    scene, task = far_scene(region)
    step = ControlStep(scene, ConstraintSet([region], scene), task)
    assert step._packed is not None
    assert [type(one) for one, _, _ in step._packed.others] == [Own]
    same(step, 0.0, np.array([0.1, 0.2, 0.3]), np.ones(3))
