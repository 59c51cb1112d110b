"""The barrier governor: its closed form is the solution of a QP, and its barrier is what the
prediction says.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from qpsolvers import solve_qp
from scipy.special import logsumexp, softmax

from vsconstraints.compiled import goal_governor
from vsconstraints.control import ControlStep
from vsconstraints.controllers import BarrierGovernor, make_controller
from vsconstraints.controllers.goal_governor import Governor
from vsconstraints.errors import InvalidInput
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

KAPPA = 200.0
DELTA = 0.02
ALPHA = 3.0
SPEED = 2.0


def barrier(own: Any) -> tuple[float, Array]:
    """The softmin h of a response's margins, and ∇h, in NumPy."""
    slopes = [
        np.linalg.lstsq(Jt, slope)[0] for Jt, slope in zip(own.nearest_Jt, own.slope, strict=True)
    ]
    return -logsumexp(-KAPPA * own.least) / KAPPA - DELTA, -softmax(-KAPPA * own.least) @ slopes


@pytest.mark.parametrize(
    ("name", "short"), [("example-2d-fov", 1e-3), ("case-study-6r", DELTA / 2)]
)
def test_moves_are_those_of_a_qp_and_h_stays_positive(name: str, short: float) -> None:
    """Along a run, up to what the prediction errs; a step of the reference is that of the QP or
    none.
    """
    setup = Scenario.load(name).setup()
    law = BarrierGovernor(speed=SPEED, margin=DELTA, alpha=ALPHA, sharpness=KAPPA)
    step = ControlStep(setup.scene, setup.constraints, setup.task)
    period = setup.Ts
    law.reset(period=period, model=step.model())
    q = setup.q0.copy()
    qd = setup.qd0.copy()
    binding = 0
    refused = 0
    lowest = np.inf
    before: tuple[float, Array] | None = None
    for k in range(round(1.9 / period)):
        r = law.reference
        qdd = step.command(law, k * period, q, qd)[1].qdd
        own = law.governor.own
        if before is not None and r is not None:
            h, slope = before
            nominal = -SPEED * r / max(np.linalg.norm(r), 0.1 * SPEED)
            expected = solve_qp(
                np.eye(len(r)), -nominal, -slope[None], np.array([ALPHA * h]), solver="quadprog"
            )
            moved = own.counts[goal_governor.MOVES]
            refused += not moved
            binding += bool(moved) and not np.allclose(expected, nominal)
            if moved:
                np.testing.assert_allclose((own.reference - r) / period, expected, atol=1e-5)
        before = barrier(own)
        lowest = min(lowest, before[0])
        q = q + period * (qd + 0.5 * period * qdd)
        qd = qd + period * qdd
    assert binding > 50
    assert refused < 5
    assert lowest > -short


def test_the_slope_of_the_barrier_is_that_of_what_is_predicted() -> None:
    """Against finite differences over the reference, with constant gains; of speeds, but for the
    change of J.
    """
    scenario = Scenario.load("case-study-6r").with_override("task.Kp_slope", 0.0)
    setup = scenario.setup()
    step = ControlStep(setup.scene, setup.constraints, setup.task)
    step.evaluate(0.0, setup.q0, 0.1 * np.cos(np.arange(6)))
    model = step.model()
    now = model.at(*model.present)

    def response(reference: Array) -> Any:
        governor = Governor.of(model, np.full(400, 0.004), (6, 6))
        governor.own.settings[:] = SPEED, DELTA, np.inf, ALPHA, KAPPA
        governor.own.reference[:] = reference
        governor.own.counts[goal_governor.GOAL] = model.goal
        return governor.decide(model, now.rows, now.task)

    reference = 0.6 * now.error
    own = response(reference)
    slopes = np.array(
        [
            -np.linalg.lstsq(Jt, slope)[0]
            for Jt, slope in zip(own.nearest_Jt, own.slope, strict=True)
        ]
    )
    found = np.zeros_like(slopes)
    for j, away in enumerate(1e-5 * np.eye(6)):
        found[:, j] = (response(reference + away).least - response(reference - away).least) / 2e-5
    share = np.where(model.K > 0.0, 1e-3, 0.1)
    close = np.abs(found - slopes).max(axis=1) < share * np.abs(found).max(axis=1) + 1e-5
    assert close.all(), [label for label, one in zip(model.labels, close, strict=True) if not one]
    assert (np.abs(slopes).max(axis=1) > 0.1).sum() > 4


def test_it_violates_nothing_where_the_goal_governor_does_not_and_is_faster() -> None:
    setup = Scenario.load("example-2d-fov").with_override("duration", 8.0).setup()
    run = simulate(setup, BarrierGovernor())
    slow = simulate(setup, make_controller("goal-governor"))
    assert run.compiled
    assert run.sigma.max() < 0.0
    assert np.linalg.norm(run.error[-1]) < 0.5 * np.linalg.norm(slow.error[-1])


@pytest.mark.parametrize("option", ["alpha", "sharpness"])
def test_options_that_are_none(option: str) -> None:
    for value in (0.0, -1.0, float("nan"), "1", True):
        with pytest.raises(InvalidInput, match=f"{option} of barrier-governor must be positive"):
            make_controller("barrier-governor", {option: value})
