"""The plant, the order filter, the tracking law and what they stand on.

The numbers were worked out on paper and are written out here.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vsconstraints import Camera, Robot
from vsconstraints.constraints import ConstraintSet, JointRange
from vsconstraints.control import ControlStep
from vsconstraints.errors import InvalidInput
from vsconstraints.formulas.rotation import rotation_vector_rate
from vsconstraints.robots.order_filter import OrderFilter
from vsconstraints.rows import Array
from vsconstraints.simulation.disturbances import Disturbances
from vsconstraints.simulation.plant import Plant
from vsconstraints.vision.features import Feature, FeatureMotion, Goal
from vsconstraints.vision.scene import Scene
from vsconstraints.vision.tracking import TrackingGains, VisualTask

# --- a period of 0.1 s ---


def test_order_filter() -> None:
    """From q = 1, q̇ = 2: q̈ = 10 for a period gives 1 + 0.2 + 0.05 and 3, q̈ = −30 for the next
    1.25 + 0.3 − 0.15.
    """
    integrator = OrderFilter([1.0], [2.0], 0.1)
    np.testing.assert_allclose(integrator.step(np.array([10.0])), [1.25], rtol=1e-14)
    np.testing.assert_allclose(integrator.qd, [3.0], rtol=1e-14)
    np.testing.assert_allclose(integrator.step(np.array([-30.0])), [1.4], rtol=1e-14)
    np.testing.assert_allclose(integrator.qd, [0.0], atol=1e-15)
    np.testing.assert_allclose(integrator.q, [1.4], rtol=1e-14)


@pytest.mark.parametrize("Ts", [0.0, -0.1, np.inf, np.nan])
def test_an_order_filter_needs_a_period(Ts: float) -> None:
    with pytest.raises(InvalidInput, match="sampling time"):
        OrderFilter([1.0], [2.0], Ts)


def plant(actuation: Any = "acceleration", **disturbances: Any) -> Plant:
    return Plant(np.array([1.0]), np.array([2.0]), 0.1, actuation, Disturbances(**disturbances))


def stepped(one: Plant, qdd: float) -> list[float]:
    one.begin(np.array([qdd]))
    one.step()
    return [float(one.q[0]), float(one.qd[0])]


@pytest.mark.parametrize("actuation", ["acceleration", "position"])
def test_plant(actuation: str) -> None:
    """As the order filter, under both kinds of control."""
    one = plant(actuation)
    np.testing.assert_allclose(stepped(one, 10.0), [1.25, 3.0], rtol=1e-13)
    np.testing.assert_allclose(stepped(one, -30.0), [1.4, 0.0], atol=1e-13)


def test_no_function_moves_a_plant_that_its_transition_moves() -> None:
    """Compiled loops call what stands there, unless it is 0; what does not compile never reads
    it.
    """
    assert plant().mover == (0, 0)
    assert not plant().follows


def test_plant_that_is_pushed() -> None:
    """d_c = 4 on top of q̈ = 10: 1 + 0.2 + 0.07 and 2 + 1.4."""
    np.testing.assert_allclose(stepped(plant(acceleration=(4.0,)), 10.0), [1.27, 3.4], rtol=1e-13)


def test_plant_that_lags() -> None:
    """τ = 0.1 s, one period: a = 10 (1 − 1/e), q̇ = 2 + 10 × 0.1/e, q = 1 + 0.2 + 10 × 0.01 (½ −
    1/e).
    """
    one = plant(time_constant=0.1)
    np.testing.assert_allclose(
        stepped(one, 10.0), [1.2132120558828558, 2.367879441171442], rtol=1e-12
    )
    assert one.x[2, 0] == pytest.approx(6.321205588285577, rel=1e-12)


def test_plant_behind_a_position_loop() -> None:
    """τ = 0.1 s, at rest at 1 and sent to 1 + 5t²: what is behind is e = 0.1 − (0.1 + t)
    exp(−t/0.1) with ë = 10 at 0.

    At t = 0.1 s q = 1.05 − 0.1 + 0.2/e, q̇ = 1 − 1/e.
    """
    one = Plant(np.array([1.0]), np.array([0.0]), 0.1, "position", Disturbances(time_constant=0.1))
    np.testing.assert_allclose(
        stepped(one, 10.0), [1.0235758882342885, 0.6321205588285577], rtol=1e-12
    )


def test_what_lies_inside_a_period() -> None:
    """Half a period of 0.1 s after q = 1, q̇ = 2 with q̈ = 10: 1 + 0.1 + 0.0125 and 2.5."""
    one = plant()
    one.begin(np.array([10.0]))
    q, qd = one.inside(one.x.T[None].copy(), 0.05)
    np.testing.assert_allclose([q[0, 0], qd[0, 0]], [1.1125, 2.5], rtol=1e-13)


def test_noise_has_its_size_and_is_drawn_anew_in_every_period() -> None:
    one = plant(acceleration=(4.0,), acceleration_noise=0.5)
    drawn = []
    for _ in range(4000):
        one.begin(np.array([0.0]))
        drawn.append(float(one.x[-1, 0]))
    assert np.mean(drawn) == pytest.approx(4.0, abs=0.05)
    assert np.std(drawn) == pytest.approx(0.5, abs=0.03)
    assert abs(np.corrcoef(drawn[1:], drawn[:-1])[0, 1]) < 0.1


def test_noise_is_not_that_of_images() -> None:
    """Streams of one seed: images have 1."""
    images = np.random.default_rng((0, 1)).standard_normal(3)
    one = plant(acceleration_noise=1.0)
    for drawn in images:
        one.begin(np.array([0.0]))
        assert abs(one.x[-1, 0] - drawn) > 1e-6


@pytest.mark.parametrize("settings", [{"acceleration": (0.0, 0.1)}, {"acceleration_noise": 0.1}])
def test_what_pushes_an_arm_whose_position_is_given_needs_a_loop(settings: dict[str, Any]) -> None:
    q = np.zeros(2)
    with pytest.raises(InvalidInput, match="give time_constant too"):
        Plant(q, q, 0.1, "position", Disturbances(**settings))
    Plant(q, q, 0.1, "position", Disturbances(time_constant=0.1, **settings))
    Plant(q, q, 0.1, "acceleration", Disturbances(**settings))


# --- the tracking law ---


class Told(Feature):
    """A feature that moves as it is told: J = I and errors, speeds and drifts of two numbers."""

    name = "told"

    def __init__(self, *motions: FeatureMotion) -> None:
        self.motions = list(motions)

    def size(self, markers: int) -> int:
        return 2

    def evaluate(self, state: Any, goal: Goal, previous: Array | None) -> FeatureMotion:
        return self.motions.pop(0)


def asked(law: VisualTask, *states: tuple[float, tuple[float, float]]) -> list[Any]:
    """What the control step of an arm with two joints makes of a task, at times and with joint
    speeds.
    """
    arm = Robot.from_dh([[0.0, 0.05, 0.4, np.pi / 2], [0.0, 0.05, 0.4, -np.pi / 2]])
    q = np.array([0.1, -0.2])
    camera = Camera((600.0, 600.0), (640.0, 480.0))
    marker = arm.pose(q).act(np.array([[0.0, 0.0, 1.0]]))
    scene = Scene(arm, camera, marker)
    step = ControlStep(scene, ConstraintSet([], scene), law)
    return [step.evaluate(t, q, np.array(qd)).task for t, qd in states]


def motion(
    error: Any, velocity: Any, drift: Any = (0, 0), J: Any = ((1, 0), (0, 1)), partial: Any = (0, 0)
) -> Any:
    return FeatureMotion(
        *(np.array(value, dtype=float) for value in (error, J, velocity, drift, partial))
    )


GOAL = Goal(0.0, np.zeros((1, 2)), np.zeros((1, 2)))


def test_tracking_law() -> None:
    """‖e‖ = 0.5: K_p = 20 exp(−40/20 × 0.5) = 20/e = 7.3576 and K_v = 3 √K_p = 8.1375; b = −K_p e −
    K_v ė − drift.
    """
    law = VisualTask(
        Told(motion((0.3, 0.4), (1, -2), (0.5, 0.25))), [GOAL], TrackingGains(20.0, 40.0)
    )
    (task,) = asked(law, (0.0, (0.0, 0.0)))
    np.testing.assert_allclose(task.b, [-10.844739360360101, 13.081889897291358], rtol=1e-12)
    np.testing.assert_array_equal(task.J, np.eye(2))
    np.testing.assert_array_equal(task.error, [0.3, 0.4])


def test_tracking_law_by_differences() -> None:
    """K_p = 4, K_v = 6, 0.1 s between samples, q̇ = (1, 2).

    First without differences: −4 (1, 0) − 6 (5, 5) = (−34, −30), what drifts being left out. Then ė
    = (0.2, 0.1)/0.1 and J̇ q̇ + ∂ṡ/∂t = ((0.1, 0) · q̇ + 0.03)/0.1 = 1.3 in the first line: −4
    (1.2, 0.1) − 6 (2, 1) − (1.3, 0).
    """
    feature = Told(
        motion((1.0, 0.0), (5, 5), (9, 9), partial=(0.01, 0)),
        motion((1.2, 0.1), (5, 5), (9, 9), ((1.1, 0), (0, 1)), (0.04, 0)),
    )
    law = VisualTask(
        feature, [GOAL], TrackingGains(4.0), drift="differences", velocity="differences"
    )
    first, task = asked(law, (0.0, (1.0, 2.0)), (0.1, (1.0, 2.0)))
    np.testing.assert_allclose(first.b, [-34.0, -30.0], rtol=1e-12)
    np.testing.assert_allclose(task.b, [-18.1, -6.4], rtol=1e-9)


def test_goals_hold_from_their_times() -> None:
    """A goal's time is met up to rounding: by 1e-9 s, and not by more."""
    goals = [GOAL, Goal(2.0, GOAL.pixels, GOAL.normalised)]
    law = VisualTask(Told(), goals, TrackingGains(1.0))
    times = (0.0, 2.0 - 1e-6, 2.0 - 1.1e-9, 2.0 - 0.9e-9, 2.0, 3.0)
    assert [law.goal_at(t) for t in times] == [0, 0, 0, 1, 1, 1]
    assert law.goal_at(-1.0) == 0
    # 1e-9 s itself is rounding
    goals[1] = Goal(1e-9, GOAL.pixels, GOAL.normalised)
    assert VisualTask(Told(), goals, TrackingGains(1.0)).goal_at(0.0) == 1


# --- what rows and tasks stand on ---


def test_joint_range() -> None:
    """From −1 to 3: half of it is 2. σ is 0 at either end, 0.01 where it is passed by 0.02, −1 in
    the middle.
    """
    arm = Robot.from_dh([[0.0, 0.0, 1.0, 0.0]])
    allowed = JointRange(arm, K=0.1, switching_gain=1.0, lower=[-1.0], upper=[3.0])
    for q, sigma in (
        (3.0, [0.0, -2.0]),
        (3.02, [0.01, -2.01]),
        (-1.0, [-2.0, 0.0]),
        (1.0, [-1.0, -1.0]),
    ):
        np.testing.assert_allclose(allowed.sigma(np.array([q])), sigma, atol=1e-14)
    np.testing.assert_array_equal(allowed.gradient(np.array([0.0])), [[0.5], [-0.5]])
    # a tenth of margin: from −0.8 to 2.8
    less = JointRange(arm, K=0.1, switching_gain=1.0, lower=[-1.0], upper=[3.0], margin=0.1)
    np.testing.assert_allclose(less.sigma(np.array([2.8])), [0.0, -1.8], atol=1e-14)


def test_rate_of_a_rotation_vector() -> None:
    """Turned by π/2 about z: ω along x moves θu by (π/4, π/4, 0), ω along z by (0, 0, 1)."""
    L = np.array(rotation_vector_rate((0.0, 0.0, np.pi / 2), (0.0, 0.0, 0.0))[1])
    np.testing.assert_allclose(L[:, 0], [np.pi / 4, np.pi / 4, 0.0], rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(L[:, 1], [-np.pi / 4, np.pi / 4, 0.0], rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(L[:, 2], [0.0, 0.0, 1.0], rtol=1e-12, atol=1e-15)
