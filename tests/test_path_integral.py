"""Model predictive path integral control: what many samples come to by a program of others,
repetition, refusals.
"""

from __future__ import annotations

import pickle
from typing import Any, cast

import cvxpy
import numpy as np
import pytest

from folder_laws import PathIntegralControl, make
from scenes import Straight
from test_predictive import Linear
from vsconstraints.control import Model
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.rows import Array, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

H = 2
T = 0.1
DAMPING = 1e-3


def problem(rows: Rows | None = None, **options: Any) -> tuple[Any, Linear, Task]:
    """A law on a task of two joints that falls with the motion, as tracking makes it fall."""
    rng = np.random.default_rng(3)
    task = Task(np.eye(2) + 0.3 * rng.normal(size=(2, 2)), 0.5 * rng.normal(size=2))
    rows = Rows.none(2) if rows is None else rows
    model = Linear(rows, task, rng.normal(size=2), 0.3 * rng.normal(size=2), 0.2)
    law = PathIntegralControl(
        **{"horizon": H, "block": 10, "damping": DAMPING, "noise": 0.5, **options}
    )
    law.reset(period=0.01, model=cast(Model, model))
    return law, model, task


def best(model: Linear, task: Task, pull: float = 0.0, last: Array | float = 0.0) -> Array:
    """The plan of least c(u) + pull ‖u − last‖² without rows, by Clarabel."""
    u = cvxpy.Variable((H, 2))
    J = task.J
    q = qd = cvxpy.Constant(np.zeros(2))
    cost = pull * cvxpy.sum_squares(u - last)
    for k in range(H):
        b = task.b - 4.0 * J @ q - 3.0 * J @ qd
        cost += cvxpy.sum_squares(J @ u[k] - b) / np.sum(J**2) + DAMPING * cvxpy.sum_squares(u[k])
        q = q + T * (model.present.qd + qd) + T**2 / 2 * u[k]
        qd = qd + T * u[k]
    cvxpy.Problem(cvxpy.Minimize(cost)).solve(solver="CLARABEL")
    return np.asarray(u.value)


def test_many_samples_make_the_step_of_the_quadratic_program() -> None:
    """Errors of the first step fall as 1/√S: 0.12 noise with 300 samples on average, 0.01 with
    100,000.
    """
    errors = {}
    for samples in (300, 100_000):
        found = []
        for seed in range(1, 31 if samples == 300 else 3):
            law, model, task = problem(samples=samples, seed=seed)
            law.command(Rows.none(2), task)
            assert law.plan is not None
            found.append(
                np.sqrt(np.mean((law.plan.qdd - best(model, task, pull=1.0)) ** 2)) / law.noise
            )
        errors[samples] = float(np.mean(found))
    assert errors[300] < 0.12
    assert errors[100_000] < 0.01
    assert 10.0 < errors[300] / errors[100_000] < 40.0


def test_sample_by_sample_it_comes_to_the_linear_quadratic_optimum() -> None:
    law, model, task = problem(samples=2000)
    plans = []
    for _ in range(400):
        command = law.command(Rows.none(2), task)
        assert law.plan is not None
        np.testing.assert_array_equal(command.qdd, law.plan.qdd[0])
        plans.append(law.plan.qdd)
    np.testing.assert_allclose(
        np.mean(plans[200:], axis=0), best(model, task), atol=0.02 * law.noise
    )


def test_rows_are_kept_by_penalties_and_marked() -> None:
    """Of two joints one is at its boundary and would go on, with 0.3 rad/s²."""
    rows = Rows(
        phi=np.zeros(1), Lg=0.2 * np.eye(1, 2), Lf=np.zeros(1), switching_gain=np.ones(1), labels=("wall",),
        sigma=np.full(1, -1e-4), sigma_dot=np.zeros(1), K=np.full(1, 0.2),
    )  # fmt: skip
    task = Task(np.eye(2), np.array([0.3, 0.3]))
    first = {}
    for penalty in (1e-6, 100.0):
        model = Linear(rows, task, np.zeros(2), np.zeros(2), 0.2)
        law = PathIntegralControl(samples=1000, noise=0.1, penalty=penalty)
        law.reset(period=0.01, model=cast(Model, model))
        for _ in range(200):
            command = law.command(rows, task)
        first[penalty] = command.qdd
        assert command.active == ("wall",)
    assert first[1e-6] == pytest.approx([0.3, 0.3], abs=0.03)
    # 0.02 rad/s² take a fifth of the way to the wall in a block
    assert first[100.0][0] < 0.02
    assert first[100.0][1] == pytest.approx(0.3, abs=0.03)


def test_the_box_is_kept() -> None:
    law, _, task = problem(max_acceleration=0.1, noise=1.0)
    rows = Rows.none(2)
    rows.qdd_min, rows.qdd_max = np.array([-0.05, -1.0]), np.array([0.05, 1.0])
    for _ in range(20):
        command = law.command(rows, task)
        assert law.plan is not None
        assert (np.abs(law.plan.qdd) <= 0.1).all()
        assert abs(command.qdd[0]) <= 0.05


class Short(Straight):
    """A model that has no states beyond q₀ = 0.01, or none at all."""

    end = 0.01

    def along(self, t: Array, q: Array, qd: Array) -> Any:
        """See :class:`Straight`."""
        beyond = np.flatnonzero(q[:, 0] > self.end)
        seen = super().along(t, q, qd)
        count = int(beyond[0]) if len(beyond) else len(q)
        return type(seen)(**{name: getattr(seen, name)[:count] for name in seen.__slots__})


def test_plans_that_cannot_be_predicted_do_not_count() -> None:
    task = Task(np.eye(2), np.array([3.0, 3.0]))
    model = Short(Rows.none(2), task)
    law = PathIntegralControl(samples=100, noise=1.0)
    law.reset(period=0.01, model=cast(Model, model))
    for _ in range(100):
        command = law.command(Rows.none(2), task)
    assert law.plan is not None
    # of three blocks of 0.1 s each: where the first joint is at the end of the second and the third
    u = law.plan.qdd[:, 0]
    ends = 0.01 * np.cumsum(np.cumsum(u) - 0.5 * u)
    assert ends.max() < 0.01
    assert command.qdd[1] > 2.0
    model.present = model.present._replace(q=np.array([0.0, 0.0]), qd=np.array([50.0, -1.0]))
    command = law.command(Rows.none(2), task)
    assert command.status == "suboptimal"
    assert "braking: no plan is predicted" in command.reason
    np.testing.assert_allclose(command.qdd, [-500.0, 10.0])
    assert law.plan is None


class Curved(Straight):
    """A model whose parts all depend on the state, one row on φ itself."""

    def along(self, t: Array, q: Array, qd: Array) -> Any:
        """See :class:`Straight`."""
        seen = super().along(t, q, qd)
        parts = {name: getattr(seen, name) for name in seen.__slots__}
        parts.update(
            sigma=np.sin(q) @ [[1.0, 2.0], [-0.5, 0.3]], phi=qd @ [[0.2, 0.4], [0.3, -0.1]] + t[:, None],
            J=seen.J * np.cos(q)[:, None], b=q + qd**2, rest=-3.0 * qd,
        )  # fmt: skip
        return type(seen)(**parts)


def test_costs_are_those_of_the_formula() -> None:
    """Plan by plan and block by block, with what rows and task say of now otherwise than the
    model.
    """
    rng = np.random.default_rng(4)
    n = 2
    H = 3
    T = 0.05
    rows = Rows(
        phi=np.array([0.3, -0.2]), Lg=np.eye(2), Lf=np.zeros(2), switching_gain=np.ones(2), labels=("place", "speed"),
        scale=np.array([0.5, 2.0]), sigma=np.array([-0.01, -0.2]), sigma_dot=np.zeros(2), K=np.array([0.2, 0.0]),
    )  # fmt: skip
    task = Task(rng.normal(size=(n, n)), rng.normal(size=n), rest=rng.normal(size=n))
    model = Curved(rows, task)
    model.K, q0, qd0 = rows.K, rng.normal(size=n), rng.normal(size=n)
    model.present = model.present._replace(t=2.0, q=q0, qd=qd0)
    law = PathIntegralControl(
        samples=6,
        block=5,
        penalty=0.7,
        damping=0.4,
        margin=0.05,
        approach=2.0,
        weights={"place": 3.0},
    )
    law.reset(period=0.01, model=cast(Model, model))
    u = 30.0 * rng.normal(size=(6, H, n))
    found, _ = law.planner((n, n)).costs(u, rows, task)

    def seen(t: float, q: Array, qd: Array) -> tuple[Array, ...]:
        one = model.along(np.array([t]), q[None], qd[None])
        return np.array([one.sigma[0, 0], one.phi[0, 1]]), one.J[0], one.b[0], one.rest[0]

    now = seen(2.0, q0, qd0)
    counted = np.zeros(2)
    given = np.array([rows.sigma[0], rows.phi[1]]), task.J, task.b, task.rest
    for plan, cost in zip(u, found, strict=True):
        expected = 0.0
        q = q0.copy()
        qd = qd0.copy()
        x, J, b, rest = given
        t = 2.0
        for block in plan:
            expected += np.sum((J @ block - b) ** 2) / np.sum(task.J**2) + 0.4 * np.sum(
                (block - rest) ** 2
            )
            before = x + 0.05 * rows.scale
            q = q + T * qd + T**2 / 2 * block
            qd = qd + T * block
            t = t + T
            x, J, b, rest = (
                is_now + (then - was)
                for is_now, then, was in zip(given, seen(t, q, qd), now, strict=True)
            )
            over = np.maximum(x + 0.05 * rows.scale - np.exp(-0.5) * before, 0.0)
            counted += over > 0.0
            expected += 0.7 * (3.0 * (over[0] / (0.5 * T**2)) ** 2 + (over[1] / (2.0 * T)) ** 2)
        assert cost == pytest.approx(expected, rel=1e-9)
    assert (counted > 0).all()
    assert (counted < 18).all()


def test_plans_move_on_in_time() -> None:
    law, _, task = problem(samples=1, horizon=3)
    planner = law.planner((2, 2))
    # the first plan is the last one, without noise
    np.testing.assert_array_equal(planner.solve(Rows.none(2), task).qdd, 0.0)
    planner.mean[:, 0] = [1.0, 3.0, 5.0]
    planner.mean[:, 1] = 0.0
    for after, means in (
        (0.0, [1.0, 3.0, 5.0]),
        (0.025, [1.5, 3.5, 5.0]),
        (0.15, [4.0, 5.0, 5.0]),
        (0.31, [0.0] * 3),
    ):
        np.testing.assert_allclose(planner.carry_on(after)[:, 0], means, atol=1e-12)


def test_runs_repeat_bit_by_bit() -> None:
    setup = Scenario.load("example-2d-fov").with_override("duration", 0.5).setup()
    law = make("mppi")
    one = simulate(setup, law)
    two = simulate(setup, law)
    other = simulate(setup, make("mppi", {"seed": 2}))
    copied = simulate(setup, pickle.loads(pickle.dumps(law)))
    for run in (two, copied):
        np.testing.assert_array_equal(one.qdd_command, run.qdd_command)
    assert not np.array_equal(one.qdd_command, other.qdd_command)


def test_it_reaches_a_goal_at_the_boundary_of_the_image() -> None:
    run = simulate(Scenario.load("example-2d-fov").setup(), make("mppi"))
    assert run.status == "converged"


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("samples", 0),
        ("samples", 2.5),
        ("seed", 0),
        ("noise", 0.0),
        ("temperature", -1.0),
        ("penalty", np.nan),
    ],
)
def test_options_that_cannot_be_used_are_refused(option: str, value: Any) -> None:
    with pytest.raises((InvalidInput, ConfigurationError), match=option):
        PathIntegralControl(**{option: value})


def test_without_a_model_it_says_what_to_do() -> None:
    law = PathIntegralControl()
    with pytest.raises(InvalidInput, match="the law 'mppi' uses a model"):
        law.command(Rows.none(2), Task(np.eye(2), np.zeros(2)))
