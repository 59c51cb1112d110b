"""Gradients of constraints against difference quotients: of every scenario at its start, and of own
ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

from vsconstraints import RobotPoint
from vsconstraints.constraints import (
    Constraint,
    ConstraintSet,
    ImageConstraint,
    JointConstraint,
    PointConstraint,
    SpeedConstraint,
    robot_points,
)
from vsconstraints.control import ControlStep
from vsconstraints.control.gradients import own_constraints, require_gradients
from vsconstraints.controllers import SlidingMode, Tracking
from vsconstraints.errors import ConfigurationError
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario, shipped_scenarios
from vsconstraints.simulation import Setup, simulate
from vsconstraints.vision.scene import Scene


@pytest.mark.parametrize("name", shipped_scenarios())
def test_every_constraint_of_every_scenario_has_the_gradient_of_its_sigma_at_the_start(
    name: str,
) -> None:
    setup = Scenario.load(name).setup()
    every = setup.constraints.constraints
    qd = np.full(setup.scene.robot.n, 0.05)
    for state in ((0.0, setup.q0, setup.qd0), (0.1, setup.q0, qd)):
        require_gradients(setup.scene, setup.constraints, setup.task, state, only=every)


class Left(ImageConstraint):
    """Markers stay left of a parabola."""

    kind = "left"
    factor = 1.0

    def sigma(self, y: Array) -> Array:
        return (y[..., 0] - 300.0 + 1e-3 * y[..., 1] ** 2) / 100.0

    def gradient(self, y: Array) -> Array:
        return np.stack((np.full(y.shape[:-1], self.factor), 2e-3 * y[..., 1]), axis=-1) / 100.0


class LeftFlipped(Left):
    """The same, with one sign wrong."""

    factor = -1.0


class LeftByFormula(ImageConstraint):
    """The same by a formula, compiled, with a wrong derivative."""

    kind = "left"

    @staticmethod
    def formula(u: Array, v: Array) -> tuple[Array, Array, Array]:
        return (u - 300.0 + 1e-3 * v * v) / 100.0, 0.0 * u + 0.02, 2e-5 * v


class Floor(PointConstraint):
    """Points stay above a paraboloid; the derivative by y is missing."""

    kind = "floor"

    def sigma(self, y: Array) -> Array:
        return 0.05 + 0.2 * y[..., 0] ** 2 + 0.1 * y[..., 1] - y[..., 2]

    def gradient(self, y: Array) -> Array:
        return np.stack((0.4 * y[..., 0], np.zeros(y.shape[:-1]), -np.ones(y.shape[:-1])), axis=-1)


class Elbow(JointConstraint):
    """Half the derivative by the third joint is given."""

    kind = "elbow"

    def labels(self, scene: Scene) -> tuple[str, ...]:
        return ("elbow",)

    def sigma(self, q: Array) -> Array:
        return np.sin(q[..., 2:3]) - 2.0

    def gradient(self, q: Array) -> Array:
        g = np.zeros((*q.shape[:-1], 1, q.shape[-1]))
        g[..., 0, 2] = 0.5 * np.cos(q[..., 2])
        return g

    def characteristic_length(self, scene: Scene) -> Array:
        return np.array([1.0])


class Energy(SpeedConstraint):
    """The norm of the speeds, with a gradient three times too large."""

    kind = "energy"

    def labels(self, scene: Scene) -> tuple[str, ...]:
        return ("energy",)

    def phi(self, qd: Array) -> Array:
        return ((qd - 0.1) ** 2).sum(axis=-1, keepdims=True) - 1.0

    def gradient(self, qd: Array) -> Array:
        return 6.0 * (qd - 0.1)[..., None, :]

    def characteristic_length(self, scene: Scene) -> Array:
        return np.array([1.0])


WRONG: dict[str, tuple[Callable[[], Constraint], str]] = {
    "a sign in the image": (
        lambda: LeftFlipped(K=0.3, switching_gain=1.0, length=80.0),
        r"^left\[marker 1\]: .* LeftFlipped is not .*: ∂σ/∂u is 0.01 .*but -0.01 as given; its sign is wrong",
    ),
    "a formula": (
        lambda: LeftByFormula(K=0.3, switching_gain=1.0, length=80.0),
        r"^left\[marker 1\]: .*LeftByFormula.*∂σ/∂u is 0.01 by differences, but 0.02 as given$",
    ),
    "a point": (
        lambda: Floor(K=0.3, switching_gain=1.0, length=0.1, points=[RobotPoint()]),
        r"^floor\[tip\]: .*Floor.*∂σ/∂y is 0.1 by differences, but 0 as given$",
    ),
    "a joint": (
        lambda: Elbow(K=0.1, switching_gain=1.0),
        r"^elbow: .*Elbow.*∂σ/∂q of joint 3 \(elbow_joint\) is",
    ),
    "a speed": (
        lambda: Energy(switching_gain=1.0),
        r"^energy: .*Energy.*∂φ/∂q̇ of joint 1 .* is -0.2 .*, but -0.6 as",
    ),
}


def with_constraint(constraint: Constraint) -> Setup:
    setup = Scenario.load("ur5-fov").setup()
    every = (*setup.constraints.constraints, constraint)
    world = setup.scene
    scene = Scene(world.robot, world.camera, world.markers, robot_points(every))
    return replace(setup, scene=scene, constraints=ConstraintSet(every, scene), duration=0.01)


@pytest.mark.parametrize(("make", "words"), WRONG.values(), ids=WRONG)
def test_a_wrong_gradient_is_an_error_at_the_start_that_names_row_coordinate_and_values(
    make: Callable[[], Constraint], words: str
) -> None:
    setup = with_constraint(make())
    with pytest.raises(ConfigurationError, match=words):
        setup.check_start()
    with pytest.raises(ConfigurationError, match=words):
        simulate(setup, Tracking())
    step = ControlStep(setup.scene, setup.constraints, setup.task)
    with pytest.raises(ConfigurationError, match=words):
        step.evaluate(0.0, setup.q0, setup.qd0)
    for use in (step.bind(SlidingMode()), lambda *state: step.command(SlidingMode(), *state)):
        with pytest.raises(ConfigurationError, match=words):
            use(0.0, setup.q0, setup.qd0)


def test_a_right_gradient_is_checked_once_and_changes_no_command() -> None:
    asked = []

    class Counted(Left):
        def gradient(self, y: Array) -> Array:
            asked.append(len(y))
            return super().gradient(y)

    setup = with_constraint(Counted(K=0.3, switching_gain=1.0, length=80.0))
    (own,) = own_constraints(setup.constraints)
    assert type(own) is Counted
    step = ControlStep(setup.scene, setup.constraints, setup.task)
    first = step.evaluate(0.0, setup.q0, setup.qd0).rows
    begun = len(asked)
    again = step.evaluate(0.0, setup.q0, setup.qd0).rows
    assert len(asked) - begun <= 4
    np.testing.assert_array_equal(first.Lg, again.Lg)
    assert setup.check_start() == Scenario.load("ur5-fov").setup().check_start()


class Kinked(ImageConstraint):
    """σ = max(|u − u₀|, |v − v₀|) with whatever slope is given at its kinks."""

    kind = "kinked"
    at: ClassVar[Array] = np.zeros(2)
    side = 1.0

    def sigma(self, y: Array) -> Array:
        return np.abs(y - self.at).max(axis=-1) / 100.0 - 5.0

    def gradient(self, y: Array) -> Array:
        away = y - self.at
        along_u = (np.abs(away[..., 0]) >= np.abs(away[..., 1])).astype(float)
        signs = np.where(away >= 0.0, self.side, -1.0)
        return np.stack((along_u, 1.0 - along_u), axis=-1) * signs / 100.0


@pytest.mark.parametrize(
    ("away", "side"),
    # beside the kink, only the slope there is right
    [
        (0.0, 1.0),
        (0.0, 0.0),
        (0.0, -1.0),
        *((away, 1.0) for away in (1e-9, -1e-9, 1e-4, -1e-4, 3e-2, -3e-2)),
    ],
)
def test_kinks_are_no_wrong_gradients(
    away: float, side: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """σ has a kink at, or near, the first marker: any slope between those of its sides is right
    there.
    """
    start = Scenario.load("ur5-fov").setup()
    monkeypatch.setattr(
        Kinked, "at", start.scene.project(start.scene.camera_pose(start.q0))[0] - away
    )
    monkeypatch.setattr(Kinked, "side", side)
    setup = with_constraint(Kinked(K=0.3, switching_gain=1.0, length=80.0, markers=[1]))
    ControlStep(setup.scene, setup.constraints, setup.task).evaluate(0.0, setup.q0, setup.qd0)


def test_a_constraint_without_a_gradient_says_so() -> None:
    class NoGradient(ImageConstraint):
        kind = "none"

        def sigma(self, y: Array) -> Array:
            return y[..., 0]

    with pytest.raises(
        ConfigurationError, match=r"NoGradient \(none\) gives sigma, but no gradient: give ∂σ/∂y"
    ):
        NoGradient(K=0.3, switching_gain=1.0, length=80.0)


def test_a_gradient_of_another_shape_says_so() -> None:
    class Flat(Left):
        def gradient(self, y: Array) -> Array:
            return super().gradient(y)[..., 0]

    with pytest.raises((ConfigurationError, ValueError)):
        with_constraint(Flat(K=0.3, switching_gain=1.0, length=80.0)).check_start()


@dataclass(init=False)
class LeftOf(Left):
    """Markers stay left of a parabola; a dataclass with an array, which == cannot compare."""

    shift: Array

    def __init__(self, marker: int) -> None:
        super().__init__(K=0.3, switching_gain=1.0, length=80.0, markers=[marker])
        self.shift = np.zeros(2)


def test_custom_dataclasses_with_arrays_are_told_apart() -> None:
    setup = Scenario.load("ur5-fov").setup()
    constraints = ConstraintSet((LeftOf(1), LeftOf(2)), setup.scene)
    require_gradients(setup.scene, constraints, setup.task, (0.0, setup.q0, setup.qd0))


class RightOf(ImageConstraint):
    """Markers stay right of a line; σ is undefined in the left of the image."""

    kind = "right-of"

    def sigma(self, y: Array) -> Array:
        return 0.01 - np.sqrt(y[..., 0] + 300.0)

    def gradient(self, y: Array) -> Array:
        slope = -0.5 / np.sqrt(y[..., 0] + 300.0)
        return np.stack((slope, np.zeros_like(slope)), axis=-1)


def test_sigma_may_be_undefined_where_no_marker_is() -> None:
    setup = with_constraint(RightOf(K=0.3, switching_gain=1.0, length=80.0))
    assert setup.check_start() == []
