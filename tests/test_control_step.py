"""The compiled step is held to its definition, in NumPy: everywhere, to rounding."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from numpy_form import believed, block, define, feature_motion, reset
from scenes import (
    WORLDS,
    build_constraint,
    constraint_tables,
    random_configuration,
    random_scene,
    robot,
    robot_names,
)
from vsconstraints import Robot
from vsconstraints.compiled import available
from vsconstraints.constraints import (
    Collision,
    Constraint,
    ConstraintSet,
    Manipulability,
    RowBlock,
    SelfCollision,
)
from vsconstraints.control import ControlStep
from vsconstraints.control.evaluator import Evaluation
from vsconstraints.controllers import (
    Controller,
    HierarchicalQP,
    PotentialField,
    SlidingMode,
    Tracking,
)
from vsconstraints.errors import ConfigurationError, InvalidInput, SceneError
from vsconstraints.rows import Array, Command, Rows, Task
from vsconstraints.scenarios import CONSTRAINTS, Scenario, shipped_scenarios
from vsconstraints.simulation import Setup, simulate
from vsconstraints.vision.features import CameraPose, Feature, FeatureMotion, Goal, ImagePoints
from vsconstraints.vision.motion import Motion
from vsconstraints.vision.scene import Scene, State
from vsconstraints.vision.tracking import TrackingGains, VisualTask

REGIONS = tuple(
    f"forbidden-{shape}" for shape in ("sphere", "half-space", "box", "cylinder", "capsule")
)
COMPILED = ("field-of-view", "occlusion", "joint-range", "joint-speed", *REGIONS, "manipulability")
"""Types of constraints that have a compiled form."""

CLOSE = 1e-9
"""Relative to the largest entry: what rounding and differences along a velocity leave."""

FEATURES: list[Feature] = [CameraPose(), ImagePoints(), ImagePoints("desired"), ImagePoints("mean")]

pytestmark = pytest.mark.skipif(not available(), reason="there is no compiler here")


def assert_equal(found: Evaluation, defined: Evaluation) -> None:
    for name, mine, theirs in (
        ("phi", found.rows.phi, defined.rows.phi),
        ("Lg", found.rows.Lg, defined.rows.Lg),
        ("Lf", found.rows.Lf, defined.rows.Lf),
        ("J", found.task.J, defined.task.J),
        ("b", found.task.b, defined.task.b),
        *((name, getattr(found, name), getattr(defined, name)) for name in (
            "error", "sigma", "pixels", "points", "camera_R", "camera_t",
        )),
    ):  # fmt: skip
        assert mine.shape == theirs.shape, name
        scale = max(1.0, float(np.abs(theirs).max(initial=0.0)))
        np.testing.assert_allclose(mine, theirs, rtol=CLOSE, atol=CLOSE * scale, err_msg=name)
    assert found.rows.labels == defined.rows.labels


def kind_in_numpy(constraint: Constraint) -> bool:
    """Whether a constraint is of the kinds that are in NumPy only."""
    return isinstance(constraint, Collision | SelfCollision)


def both(
    scene: Scene,
    constraints: ConstraintSet,
    task: VisualTask,
    states: list[tuple[float, Array, Array]],
) -> None:
    """Walk through states with both forms, told of every motion or not: what a task remembers
    counts too.
    """
    for known in (True, False):
        step = ControlStep(scene, constraints, task, known=known)
        assert all(kind_in_numpy(one) for one in step.in_numpy)
        for _ in range(2):
            step.reset()
            reset(task)
            for t, q, qd in states:
                state = scene.evaluate(t, q, qd)
                assert_equal(
                    step.evaluate(t, q, qd),
                    define(step, state if known else believed(scene, state)),
                )
    pixels, points, seen = step.views(
        np.array([t for t, _, _ in states]), np.array([q for _, q, _ in states])
    )
    assert seen.all()
    for k, (t, q, _) in enumerate(states):
        for mine, theirs in zip((pixels[k], points[k]), scene.glance(q, t), strict=True):
            np.testing.assert_allclose(
                mine, theirs, rtol=CLOSE, atol=CLOSE * max(1.0, np.abs(theirs).max(initial=0.0))
            )


def examples(arm: Any, world: str) -> list[Constraint]:
    found = []
    for type_name in COMPILED:
        for i, table in enumerate(constraint_tables(type_name, arm)):
            constraint = build_constraint(type_name, {**table}, arm)
            if hasattr(constraint, "name"):
                constraint.name = f"{type_name} {i}"
            if world == "moving-target" and type_name in ("occlusion", *REGIONS):
                d = 2 if type_name == "occlusion" else 3
                constraint.moving(
                    Motion(
                        [9.0, -0.2, 0.1][:d],
                        amplitude=[0.1, 0.2, 0.3][:d],
                        frequency=0.5,
                        phase=0.4,
                    )
                )
                constraint.motion.known = i % 2 == 0
            found.append(constraint)
    return found


def compare_forms(arm: Any, world: str, constraint: Constraint, number: int, kind: int) -> None:
    """Walk through random states with one constraint and the feature of a kind."""
    rng = np.random.default_rng([kind, number, *arm.name.encode()])
    scene, q, qd = random_scene(arm, rng, [constraint], world)
    if scene.motion is not None:
        scene.motion.translation.known = number % 3 > 0
    state = scene.evaluate(0.7, q, qd)
    poses = [scene.camera_pose(random_configuration(arm, rng), 0.7) for _ in range(2)]
    goals = [
        Goal(
            from_time,
            state.pixels.position + 9.0,
            state.normalised.position + 0.01,
            pose,
            state.depth * 1.1,
        )
        for from_time, pose in zip((0.0, 0.705), poses, strict=True)
    ]
    choices = ("exact", "differences")
    task = VisualTask(FEATURES[kind], goals, TrackingGains(20.0, 7.0), choices[kind % 2])
    task.velocity = choices[kind // 2]
    walk = [(0.7 + 0.002 * k, q + 0.002 * k * qd, qd + 0.01 * k) for k in range(5)]
    both(scene, ConstraintSet([constraint], scene), task, walk)


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("name", robot_names())
def test_every_robot_and_constraint_in_every_world(name: str, world: str) -> None:
    """Features take turns: with the robots and worlds, each constraint meets each of them."""
    arm = robot(name)
    turn = list(robot_names()).index(name) + list(WORLDS).index(world)
    for number, constraint in enumerate(examples(arm, world)):
        compare_forms(arm, world, constraint, number, (number + turn) % len(FEATURES))


@pytest.mark.parametrize("kind", range(len(FEATURES)))
@pytest.mark.parametrize("name", robot_names())
def test_every_feature_with_every_constraint(name: str, kind: int) -> None:
    """Worlds take turns, as features do above."""
    arm = robot(name)
    world = WORLDS[(list(robot_names()).index(name) + kind) % len(WORLDS)]
    for number, constraint in enumerate(examples(arm, world)):
        compare_forms(arm, world, constraint, number, kind)


def brief(name: str) -> Setup:
    return Scenario.load(name).with_override("duration", 0.3).setup()


@pytest.mark.parametrize("name", shipped_scenarios())
def test_every_shipped_scenario(name: str) -> None:
    setup = brief(name)
    rng = np.random.default_rng(1)
    states = [
        (
            0.5 * k * setup.Ts,
            setup.q0 + 0.01 * rng.normal(size=len(setup.q0)),
            0.2 * rng.normal(size=len(setup.q0)),
        )
        for k in range(20)
    ]
    both(setup.scene, setup.constraints, setup.task, states)


@pytest.mark.parametrize("law", [SlidingMode(), HierarchicalQP()])
@pytest.mark.parametrize("name", shipped_scenarios())
def test_the_compiled_loop_runs_every_shipped_scenario_as_the_other_does(
    name: str, law: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    setup = brief(name)
    compiled = simulate(setup, law)
    assert compiled.compiled
    monkeypatch.setattr("vsconstraints.control.control_step.ControlStep.bound", lambda step: None)
    usual = simulate(brief(name), law)
    assert not usual.compiled
    assert compiled.reason == usual.reason
    for part in (
        "q",
        "qd",
        "qdd_command",
        "phi",
        "sigma",
        "error",
        "features_px",
        "points",
        "camera_position",
    ):
        mine = getattr(compiled, part)
        theirs = getattr(usual, part)
        np.testing.assert_allclose(
            mine, theirs, rtol=1e-7, atol=1e-7 * max(1.0, np.abs(theirs).max(initial=0.0))
        )
    np.testing.assert_array_equal(compiled.active, usual.active)


@pytest.mark.parametrize(
    "angle", [0.0, 1e-13, 1e-9, 1e-4, 0.0999, 0.1001, 2.0, np.pi - 1e-7, np.pi, -np.pi, 3.5, 6.2]
)
@pytest.mark.parametrize(
    "axis", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.6, -0.8, 0.0), (-0.48, 0.6, 0.64)]
)
def test_every_angle_of_rotation(angle: float, axis: tuple[float, float, float]) -> None:
    """Small ones, half a turn where the axis is ambiguous, and beyond, continuously."""
    arm = robot("free-camera")
    rng = np.random.default_rng(4)
    scene, q, qd = random_scene(arm, rng)
    import pinocchio as pin

    from vsconstraints.robots.geometry import Pose

    there = scene.camera_pose(q)
    for whole in (angle, 0.97 * angle):
        goal_pose = (
            there
            @ Pose(np.asarray(pin.exp3(np.array(axis) * whole)), np.array([0.1, 0.2, -0.1])).inverse
        )
        pixels = scene.project(there)
        goal = Goal(0.0, pixels, scene.camera.normalised(pixels), goal_pose)
        task = VisualTask(CameraPose(), [goal], TrackingGains(5.0))
        both(scene, ConstraintSet([], scene), task, [(0.01 * k, q, qd) for k in range(3)])


@pytest.mark.parametrize("type_name", [name for name in CONSTRAINTS if name not in COMPILED])
def test_what_has_no_compiled_form_runs_in_numpy_between_what_has(type_name: str) -> None:
    arm = robot("ur5")
    kinds = ("field-of-view", type_name, "joint-speed")
    some = [build_constraint(kind, constraint_tables(kind, arm)[0], arm) for kind in kinds]
    scene, q, qd = random_scene(arm, np.random.default_rng(2), some)
    pixels = scene.glance(q)[0]
    task = VisualTask(
        ImagePoints(), [Goal(0.0, pixels, scene.camera.normalised(pixels))], TrackingGains(5.0)
    )
    both(
        scene,
        ConstraintSet(some, scene),
        task,
        [(0.01 * k, q + 0.01 * k * qd, qd) for k in range(3)],
    )


class Own(Feature):
    """A feature that nobody has compiled."""

    name = "own"

    def size(self, markers: int) -> int:
        return 2 * markers

    def evaluate(self, state: State, goal: Goal, previous: Array | None) -> FeatureMotion:
        return feature_motion(ImagePoints(), state, goal, previous)


def test_an_own_feature_is_evaluated_beside_the_compiled_step() -> None:
    scene, q, qd = random_scene(robot("ur5"), np.random.default_rng(2))
    pixels = scene.glance(q)[0]
    task = VisualTask(
        Own(), [Goal(0.0, pixels, scene.camera.normalised(pixels))], TrackingGains(5.0)
    )
    for derivative in ("exact", "differences"):
        task.drift = task.velocity = derivative
        step = ControlStep(scene, ConstraintSet([], scene), task)
        assert step.bound() is None
        for k in range(3):
            state = 0.01 * k, q + 0.01 * k * qd, qd
            assert_equal(step.evaluate(*state), define(step, scene.evaluate(*state)))
        reset(task)


def test_a_marker_behind_the_camera_is_named_and_nothing_is_remembered() -> None:
    setup = Scenario.load("case-study-6r").with_override("task.velocity", "differences").setup()
    step, other = (ControlStep(setup.scene, setup.constraints, setup.task) for _ in range(2))
    for one in (step, other):
        one.evaluate(0.0, setup.q0, setup.qd0)
    away = setup.q0 + np.array([0.0, 0.0, 0.0, 0.0, np.pi, 0.0])
    with pytest.raises(SceneError, match="not in front of the camera: marker 1"):
        step.evaluate(0.002, away, setup.qd0)
    state = 0.004, setup.q0 + 0.01, setup.qd0
    np.testing.assert_array_equal(step.evaluate(*state).task.b, other.evaluate(*state).task.b)


def test_a_step_leaves_what_was_given_before_alone() -> None:
    """Rows and tasks of a step are not overwritten by the next one."""
    setup = Scenario.load("case-study-6r").setup()
    step = ControlStep(setup.scene, setup.constraints, setup.task)
    first = step.evaluate(0.0, setup.q0, setup.qd0)
    kept = first.rows.phi.copy(), first.task.J.copy()
    step.evaluate(0.002, setup.q0 + 0.1, setup.qd0 + 0.1)
    np.testing.assert_array_equal(first.rows.phi, kept[0])
    np.testing.assert_array_equal(first.task.J, kept[1])


class OwnTask(VisualTask):
    pass


class OwnGains(TrackingGains):
    pass


class OwnMotion(Motion):
    pass


def test_a_subclass_may_compute_anything_and_is_refused_or_runs_in_numpy() -> None:
    setup = Scenario.load("moving-occluder").setup()
    task = setup.task
    own_task = OwnTask(task.feature, task.goals, task.gains)
    own_gains = VisualTask(task.feature, task.goals, OwnGains(5.0))
    for other, name in (
        (own_task, "a VisualTask, not the subclass OwnTask"),
        (own_gains, "not the subclass OwnGains"),
    ):
        with pytest.raises(ConfigurationError, match=name):
            ControlStep(setup.scene, setup.constraints, other)
    for constraint in setup.constraints.constraints:
        if getattr(constraint, "motion", None) is not None:
            constraint.moving(OwnMotion([10.0, 5.0]))
    step = ControlStep(setup.scene, setup.constraints, task)
    assert [c.kind for c in step.in_numpy] == ["occlusion"]


@pytest.mark.parametrize(
    "law", [Tracking(), SlidingMode(), PotentialField(blend="priority"), HierarchicalQP()]
)
def test_state_to_command_is_step_then_law(law: Controller) -> None:
    """In one call or in two, also where the definition of the law is asked, and after an option has
    changed.
    """
    setup = Scenario.load("case-study-6r").setup()
    one, two = (ControlStep(setup.scene, setup.constraints, setup.task) for _ in range(2))
    rng = np.random.default_rng(3)
    given = []
    for k in range(30):
        q = setup.q0 + 0.02 * rng.normal(size=6)
        qd = rng.normal(size=6) * (0.1 if k % 2 else 2.0)
        found, command = one.command(law, 0.002 * k, q, qd)
        expected = two.evaluate(0.002 * k, q, qd)
        answer = law.command(expected.rows, expected.task)
        assert_equal(found, expected)
        np.testing.assert_array_equal(command.qdd, answer.qdd)
        np.testing.assert_array_equal(command.acted, answer.acted)
        assert (command.status, command.reason, command.labels) == (
            answer.status,
            answer.reason,
            answer.labels,
        )
        given.append((command, command.qdd.copy()))
        if k == 20 and isinstance(law, SlidingMode):
            law.rank_tolerance = 0.5
    for command, qdd in given:
        np.testing.assert_array_equal(command.qdd, qdd)


def test_states_of_other_kinds_are_converted_or_refused() -> None:
    setup = Scenario.load("case-study-6r").setup()
    law = SlidingMode()
    n = len(setup.q0)
    expected = ControlStep(setup.scene, setup.constraints, setup.task).command(
        law, 0.0, setup.q0, setup.qd0
    )
    apart = np.zeros((n, 3))
    apart[:, 1] = setup.q0
    for q in (
        list(setup.q0),
        apart[:, 1],
        setup.q0.astype(object),
        setup.q0.astype(">f8"),
        setup.q0[::-1].copy()[::-1],
    ):
        step = ControlStep(setup.scene, setup.constraints, setup.task)
        for _ in range(2):
            step.reset()
            found, command = step.command(law, 0, q, setup.qd0)
            assert_equal(found, expected[0])
            np.testing.assert_allclose(command.qdd, expected[1].qdd, rtol=1e-12)
            step.reset()
            assert_equal(step.evaluate(0.0, q, setup.qd0), expected[0])
    bad = setup.q0.copy()
    bad[2] = np.nan
    cases = [
        (0.0, q, setup.qd0, "q of")
        for q in (setup.q0[:5], np.append(setup.q0, 0.0), setup.q0[None], bad, 1.0)
    ]
    cases += [(0.0, setup.q0, qd, "qd of") for qd in (setup.q0[:1], bad, "fast")]
    cases += [(0.0, setup.q0, setup.qd0.reshape((n,) + (1,) * 11), "qd of")]
    cases += [(t, setup.q0, setup.qd0, "finite number of seconds") for t in (np.nan, np.inf)]
    for t, q, qd, words in cases:
        step.reset()
        for ask in (step.evaluate, lambda *state: step.command(law, *state)):
            with pytest.raises(InvalidInput, match=words):
                ask(t, q, qd)
        if t == 0.0:
            with pytest.raises(TypeError, match="real number"):
                ask("0.5", setup.q0, setup.qd0)


@pytest.mark.parametrize("n", [1, 8])
def test_states_of_other_dimensions_are_refused(n: int) -> None:
    """Rows of as many joints as a number has bytes, and single numbers, too."""
    limits = np.full(n, 3.0)
    table = [[0.0, 0.05, 0.8 / n, (-1) ** i * np.pi / 2] for i in range(n)]
    arm = Robot.from_dh(table, q_min=-limits, q_max=limits, qd_max=limits)
    scene, q, qd = random_scene(arm, np.random.default_rng(2))
    pixels = scene.glance(q)[0]
    task = VisualTask(
        ImagePoints(), [Goal(0.0, pixels, scene.camera.normalised(pixels))], TrackingGains(5.0)
    )
    to_command = ControlStep(scene, ConstraintSet([], scene), task).bind(SlidingMode())
    to_command(0.0, q, qd)
    for wrong in (q[None], q[:, None], q[0]):
        with pytest.raises(InvalidInput, match="q of"):
            to_command(0.0, wrong, qd)
        with pytest.raises(InvalidInput, match="qd of"):
            to_command(0.0, q, wrong)


class Remembering(Tracking):
    """An own law that keeps an array, another one after every sample."""

    def solve(self, rows: Rows, task: Task) -> Command:
        self.last = rows.phi.copy()
        return super().solve(rows, task)


class Limited(SlidingMode):
    """An own law that changes what another one commands."""

    def command(self, rows: Rows, task: Task) -> Command:
        command = super().command(rows, task)
        return replace(command, qdd=np.clip(command.qdd, -0.05, 0.05))


def test_own_laws_go_through_their_own_code() -> None:
    setup = Scenario.load("case-study-6r").with_override("duration", 0.1).setup()
    step = ControlStep(setup.scene, setup.constraints, setup.task)
    law = Remembering()
    for k in range(3):
        evaluation, _ = step.command(law, k * setup.Ts, setup.q0, setup.qd0)
        np.testing.assert_array_equal(law.last, evaluation.rows.phi)
    _, command = step.command(Limited(), 0.0, setup.q0, setup.qd0)
    assert np.abs(command.qdd).max() == 0.05
    assert np.abs(simulate(setup, Limited()).qdd_command).max() == 0.05


def test_what_replaces_the_command_of_a_controller_is_asked() -> None:
    setup = Scenario.load("case-study-6r").with_override("duration", 0.05).setup()
    law = SlidingMode()
    calls = list[Rows]()

    def counted(rows: Rows, task: Task) -> Command:
        calls.append(rows)
        return SlidingMode().command(rows, task)

    law.command = counted  # type: ignore[method-assign]
    ControlStep(setup.scene, setup.constraints, setup.task).command(law, 0.0, setup.q0, setup.qd0)
    simulate(setup, law)
    assert len(calls) == 1 + setup.samples


def test_a_used_step_can_be_copied_and_a_law_may_hold_arrays() -> None:
    setup = Scenario.load("case-study-6r").with_override("task.velocity", "differences").setup()
    step = ControlStep(setup.scene, setup.constraints, setup.task)
    law = SlidingMode()
    for k in range(2):
        law.last = np.full(3, float(k))
        step.command(law, 0.002 * k, setup.q0, setup.qd0)
    for copied in (copy.deepcopy(step), pickle.loads(pickle.dumps(step))):
        state = 0.004, setup.q0 + 0.01, setup.qd0
        copied.command(law, 0.004, setup.q0 - 0.01, setup.qd0)
        found, expected = (
            ControlStep.command(one, law, *state)[1].qdd for one in (step, copy.deepcopy(step))
        )
        np.testing.assert_allclose(found, expected)


def test_a_sample_whose_rows_could_not_be_made_is_not_remembered() -> None:
    class Raises(Manipulability):
        fails = False

        def rows(self, state: State, points: slice) -> RowBlock:
            if self.fails:
                self.fails = False
                raise RuntimeError("now")
            return block(self, state, points)

    setup = Scenario.load("case-study-6r").with_override("task.velocity", "differences").setup()
    scene = Scene(setup.scene.robot, setup.scene.camera, setup.scene.markers)
    raises = Raises(scene.robot, K=0.1, switching_gain=1.0, minimum=0.001)
    step = ControlStep(scene, ConstraintSet([raises], scene), setup.task)
    step.evaluate(0.0, setup.q0, setup.qd0)
    raises.fails = True
    with pytest.raises(RuntimeError, match="now"):
        step.evaluate(0.002, setup.q0 - 0.02, setup.qd0)
    other = ControlStep(scene, ConstraintSet([], scene), setup.task)
    other.evaluate(0.0, setup.q0, setup.qd0)
    state = 0.004, setup.q0 + 0.01, setup.qd0
    np.testing.assert_array_equal(step.evaluate(*state).task.b, other.evaluate(*state).task.b)


def test_options_that_change_between_samples_count() -> None:
    setup = Scenario.load("case-study-6r").setup()
    step = ControlStep(setup.scene, setup.constraints, setup.task)
    law = PotentialField(region=0.2)
    first = step.command(law, 0.0, setup.q0, setup.qd0)[1]
    law.region = 3.0
    step.reset()
    second = step.command(law, 0.0, setup.q0, setup.qd0)[1]
    assert second.acted.sum() > first.acted.sum()
