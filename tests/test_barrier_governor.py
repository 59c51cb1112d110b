"""The barrier governor: its closed form is the solution of a QP, and its barrier is what the
prediction says.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from qpsolvers import solve_qp
from scipy.special import logsumexp, softmax

from folder_laws import BarrierGovernor, GoalGovernor, make
from vsconstraints.control import ControlStep
from vsconstraints.errors import InvalidInput
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

KAPPA = 200.0
DELTA = 0.02
ALPHA = 3.0
SPEED = 2.0


def barrier(response: Any) -> tuple[float, Array]:
    """The softmin h of a response's margins, and ∇h, in SciPy."""
    slopes = slopes_of(response)
    h = -logsumexp(-KAPPA * response.margins) / KAPPA - DELTA
    return h, -softmax(-KAPPA * response.margins) @ slopes


def slopes_of(response: Any) -> list[Array]:
    """∂σ_i/∂s_ref of each row at the state where it is nearest."""
    return [
        np.linalg.lstsq(J.T, slope)[0]
        for J, slope in zip(response.nearest_J, response.slopes, strict=True)
    ]


@pytest.mark.parametrize(
    ("name", "short"),
    [
        ("example-2d-fov", 1e-3),
        pytest.param("case-study-6r", DELTA / 2, marks=pytest.mark.slow),
    ],
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
        if before is not None and r is not None:
            h, slope = before
            nominal = -SPEED * r / max(np.linalg.norm(r), 0.1 * SPEED)
            expected = solve_qp(
                np.eye(len(r)), -nominal, -slope[None], np.array([ALPHA * h]), solver="quadprog"
            )
            refused += not law.moved
            binding += law.moved and not np.allclose(expected, nominal)
            if law.moved:
                np.testing.assert_allclose((law.reference - r) / period, expected, atol=1e-5)
        before = barrier(law.response)
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

    law = BarrierGovernor(speed=SPEED, margin=DELTA, alpha=ALPHA, sharpness=KAPPA)
    law.reset(model=model)
    law.periods = np.full(400, 0.004)

    reference = 0.6 * now.error
    slopes = -np.array(slopes_of(law.predict(reference)))
    found = np.zeros_like(slopes)
    for j, away in enumerate(1e-5 * np.eye(6)):
        above = law.predict(reference + away).margins
        below = law.predict(reference - away).margins
        found[:, j] = (above - below) / 2e-5
    share = np.where(model.K > 0.0, 1e-3, 0.1)
    close = np.abs(found - slopes).max(axis=1) < share * np.abs(found).max(axis=1) + 1e-5
    assert close.all(), [label for label, one in zip(model.labels, close, strict=True) if not one]
    assert (np.abs(slopes).max(axis=1) > 0.1).sum() > 4


@pytest.mark.slow
def test_it_violates_nothing_where_the_goal_governor_does_not_and_is_faster() -> None:
    setup = (
        Scenario.load("example-2d-fov")
        .with_override("duration", 8.0)
        .with_override("sampling_time", 0.02)
        .setup()
    )
    run = simulate(setup, BarrierGovernor())
    slow = simulate(setup, GoalGovernor())
    assert run.sigma.max() < 0.0
    assert np.linalg.norm(run.error[-1]) < 0.5 * np.linalg.norm(slow.error[-1])


@pytest.mark.parametrize("option", ["alpha", "sharpness"])
def test_options_that_are_none(option: str) -> None:
    for value in (0.0, -1.0, float("nan"), "1", True):
        with pytest.raises(InvalidInput, match=f"{option} of barrier-governor must be positive"):
            make("barrier-governor", {option: value})
