"""The contract of compiled rows: those of every constraint, own ones too, as in NumPy and as
differences say.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

from numpy_form import believed, define
from scenes import (
    WORLDS,
    build_constraint,
    constraint_tables,
    random_scene,
    robot,
    robot_names,
    slope,
)
from vsconstraints import RobotPoint
from vsconstraints.compiled import available
from vsconstraints.constraints import (
    Collision,
    Constraint,
    ConstraintSet,
    FieldOfView,
    ForbiddenBox,
    ImageConstraint,
    JointConstraint,
    PointConstraint,
    SelfCollision,
)
from vsconstraints.control import ControlStep
from vsconstraints.controllers import SlidingMode
from vsconstraints.errors import ConfigurationError
from vsconstraints.rows import Array
from vsconstraints.scenarios import CONSTRAINTS, Scenario
from vsconstraints.vision.features import Goal, ImagePoints
from vsconstraints.vision.motion import Motion
from vsconstraints.vision.scene import Scene
from vsconstraints.vision.tracking import TrackingGains, VisualTask

pytestmark = pytest.mark.skipif(not available(), reason="there is no compiler here")

CLOSE = 1e-9
"""Relative to the largest entry: what rounding, and decompositions of two kinds, leave."""

NAMES = ("phi", "Lg", "Lf", "sigma", "sigma_dot", "K")

GAINS = {"K": 0.3, "switching_gain": 1.0}


class Corridor(ImageConstraint):
    """Markers stay near a wavy line v = a sin(u/b), by a formula without curvature."""

    kind = "corridor"

    def __init__(self, **options: Any) -> None:
        super().__init__(length=80.0, **GAINS, **options)
        self.parameters = (40.0, 70.0, 80.0)

    @staticmethod
    def formula(u, v, a, b, half):
        off = (v - a * np.sin(u / b)) / half
        return off * off - 1.0, -2.0 * off * a / (b * half) * np.cos(u / b), 2.0 * off / half


class Cone(PointConstraint):
    """Points stay out of an upright cone z < h − s ρ, by a formula and its curvature."""

    kind = "cone"

    def __init__(self, height: float = 0.9, slope: float = 0.7) -> None:
        super().__init__(length=0.1, points=[RobotPoint("link 3"), RobotPoint()], **GAINS)
        self.parameters = (height, slope)

    @staticmethod
    def formula(x, y, z, h, s):
        rho = np.sqrt(x * x + y * y + 1e-6)
        return h - s * rho - z, -s * x / rho, -s * y / rho, -1.0

    @staticmethod
    def curvature_formula(x, y, z, h, s, x_dot, y_dot, z_dot):
        rho2 = x * x + y * y + 1e-6
        along = x * x_dot + y * y_dot
        return -s * (x_dot * x_dot + y_dot * y_dot - along * along / rho2) / np.sqrt(rho2)


class Hill(Cone):
    """The same without its curvature."""

    kind = "hill"
    curvature_formula = None


class Sum(JointConstraint):
    """The sum of all joints, which is linear."""

    kind = "sum"
    linear = True

    def labels(self, scene: Scene) -> tuple[str, ...]:
        return ("sum",)

    def sigma(self, q: Array) -> Array:
        return q.sum(axis=-1, keepdims=True) - 1.0

    def gradient(self, q: Array) -> Array:
        return np.ones((*q.shape[:-1], 1, q.shape[-1]))

    def characteristic_length(self, scene: Scene) -> Array:
        return np.ones(1)


OWN = {
    "corridor": lambda: Corridor(markers=[3, 1]),
    "cone": Cone,
    "hill": Hill,
    "sum": lambda: Sum(**GAINS),
}


def step_of(
    constraints: list[Constraint], name: str, world: str = WORLDS[0], known: bool = True
) -> tuple[Any, ...]:
    """A step, and a state of it."""
    scene, q, qd = random_scene(robot(name), np.random.default_rng(len(world)), constraints, world)
    state = scene.evaluate(0.7, q, qd)
    goal = Goal(
        0.0, state.pixels.position + 9.0, state.normalised.position + 0.01, None, state.depth
    )
    task = VisualTask(ImagePoints(), [goal], TrackingGains(5.0))
    return ControlStep(scene, ConstraintSet(constraints, scene), task, known=known), q, qd


def agree(step: ControlStep, q: Array, qd: Array, known: bool = True) -> None:
    """Compiled rows are those in NumPy, σ̇ and φ̇ those of differences."""
    state = step.scene.evaluate(0.7, q, qd)
    found = step.evaluate(0.7, q, qd)
    defined = define(step, state if known else believed(step.scene, state))
    for name, mine, theirs in (
        ("sigma", found.sigma, defined.sigma),
        *(
            (name, getattr(found.rows, name), getattr(defined.rows, name))
            for name in ("phi", "Lg", "Lf", "sigma_dot", "K")
        ),
    ):
        scale = max(1.0, float(np.abs(theirs).max()))
        np.testing.assert_allclose(mine, theirs, rtol=CLOSE, atol=CLOSE * scale, err_msg=name)
    if known:
        phi_dot = slope(lambda t: step.evaluate(0.7 + t, q + t * qd, qd).rows.phi, 1e-5)
        phi = np.abs(found.rows.phi).max()
        np.testing.assert_allclose(
            found.rows.Lf, phi_dot, rtol=1e-4, atol=1e-5 * max(1.0, phi), err_msg="L_fφ"
        )


def moved(constraint: Constraint, known: bool) -> None:
    """Let what it forbids move, if it can."""
    if hasattr(constraint, "moving"):
        d = constraint.coordinates
        constraint.moving(
            Motion([9.0, -0.2, 0.1][:d], amplitude=[0.1, 0.2, 0.3][:d], frequency=0.5, known=known)
        )


@pytest.mark.parametrize("type_name", CONSTRAINTS)
@pytest.mark.parametrize("name", robot_names())
def test_every_registered_constraint(name: str, type_name: str) -> None:
    """On every robot; all that have a compiled form are compiled."""
    arm = robot(name)
    for table in constraint_tables(type_name, arm):
        one = build_constraint(type_name, {**table}, arm)
        step, q, qd = step_of([one], name)
        assert (step.in_numpy == ()) != isinstance(one, Collision | SelfCollision)
        agree(step, q, qd)


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(
    "type_name", ["occlusion", "forbidden-sphere", "forbidden-box", "forbidden-capsule"]
)
def test_what_moves(type_name: str, known: bool) -> None:
    arm = robot("ur5")
    one = build_constraint(type_name, {**constraint_tables(type_name, arm)[0]}, arm)
    moved(one, known)
    step, q, qd = step_of([one], "ur5", "moving-target", known)
    step.scene.motion.translation.known = True
    agree(step, q, qd, known)
    assert step.in_numpy == ()


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("own", OWN)
def test_own_constraints_with_a_formula_are_compiled(own: str, world: str) -> None:
    one = OWN[own]()
    if world == "moving-target":
        moved(one, True)
    step, q, qd = step_of([one], "viper-s650", world)
    assert step.in_numpy == ()
    agree(step, q, qd)


def test_who_says_more_than_the_formula_runs_in_numpy() -> None:
    """A subclass may compute anything."""

    class Shrunk(ForbiddenBox):
        def sigma(self, y: Array) -> Array:
            return super().sigma(y) + 0.1

    class Late(Corridor):
        def relative(self, motion, state):
            return super().relative(motion, state)

    class Bent(Sum):
        def sigma(self, q: Array) -> Array:
            return super().sigma(q) ** 2

        def gradient(self, q: Array) -> Array:
            return 2.0 * super().sigma(q)[..., None] * super().gradient(q)

    some = [Shrunk(centre=[0.0] * 3, size=[1.0, 0.5, 1.0], **GAINS), Late(), Bent(**GAINS), Cone()]
    step, q, qd = step_of(some, "viper-s650")
    assert step.in_numpy == tuple(some[:3])
    agree(step, q, qd)


def test_rows_stand_in_their_order() -> None:
    """Compiled ones and those in NumPy, several of each kind, with points of their own; the command
    follows them.
    """
    arm = robot("ur5")
    kinds = (
        "forbidden-box", "field-of-view", "forbidden-half-space", "self-collision", "forbidden-sphere", "occlusion",
        "manipulability", "forbidden-cylinder", "forbidden-capsule", "joint-range", "joint-speed",
    )  # fmt: skip
    several = {kind: 2 if kind.startswith("forbidden") else 1 for kind in kinds}
    some = [
        build_constraint(kind, table, arm)
        for kind in kinds
        for table in constraint_tables(kind, arm)[: several[kind]]
    ]
    for i, one in enumerate(some):
        if hasattr(one, "name"):
            one.name = f"number {i}"
    step, q, qd = step_of(some, "ur5")
    assert [one.kind for one in step.in_numpy] == ["self-collision"]
    agree(step, q, qd)
    law = SlidingMode()
    defined = define(step, step.scene.evaluate(0.7, q, qd))
    command = step.command(law, 0.7, q, qd)[1]
    expected = law.command(defined.rows, defined.task)
    np.testing.assert_allclose(command.qdd, expected.qdd, rtol=1e-6)


@pytest.mark.parametrize("name", ["viper-s650", "panda", "mixed-arm"])
def test_points_on_the_base_stay_where_they_are(name: str) -> None:
    """They have no gradient in q; a region that moves still comes towards them."""
    arm = robot(name)
    base = arm.model.frames[1].name if arm.model.frames[1].parentJoint == 0 else "universe"
    points = [RobotPoint(base, (0.1, 0.2, 0.3), "foot"), RobotPoint(name="nose")]
    region = ForbiddenBox(centre=[0.0, 0.1, 0.2], size=[0.4, 0.5, 0.3], points=points, **GAINS)
    moved(region, True)
    step, q, qd = step_of([region], name)
    agree(step, q, qd)
    found = step.evaluate(0.7, q, qd)
    assert not found.rows.Lg[0].any()
    assert found.rows.phi[0] != found.sigma[0]


def test_a_formula_that_the_compiler_refuses_runs_in_numpy_and_is_named() -> None:
    class Refused(Hill):
        kind = "refused"

        @staticmethod
        def formula(x, y, z, h, s):
            return np.asarray(
                [h - z, *np.zeros_like([x, y]), -1.0 + 0.0 * x], dtype="object"
            ).astype(float)

    with pytest.warns(RuntimeWarning, match=r"refuses a formula.*Refused\.formula \(.*\.py, line"):
        step, q, qd = step_of([Refused()], "viper-s650")
    assert len(step.in_numpy) == 1
    agree(step, q, qd)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        step_of([FieldOfView(step.scene.camera, **GAINS)], "viper-s650")


def test_a_constraint_without_a_formula_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="empty needs a formula, or sigma and gradient"):
        type("Empty", (ImageConstraint,), {"kind": "empty"})(length=1.0, **GAINS)


@pytest.mark.skipif(not available(), reason="there is no compiler")
def test_rows_on_joints_are_compiled() -> None:
    setup = Scenario.load("ur5-fov").setup()
    assert {type(c).__name__ for c in setup.constraints.constraints} == {
        "FieldOfView",
        "JointRange",
        "JointSpeed",
    }
    assert ControlStep(setup.scene, setup.constraints, setup.task).in_numpy == ()
