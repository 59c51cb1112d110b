"""Observers of drift: what unknown motion adds to rows is found, by any law, and no more than
that.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from folder_laws import EVERY_LAW, make
from vsconstraints.controllers import (
    DEMANDS,
    VELOCITY_LAWS,
    Controller,
    HierarchicalQP,
    Observed,
    Tracking,
    make_controller,
)
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.rows import Command, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

PERIOD = 0.01
K = 0.2
DRIFT = 0.7
TASK = Task(np.eye(1, 2), np.zeros(1))


class Listening(Controller):
    """Keeps the rows that it is asked with."""

    name = "listening"

    def solve(self, rows: Rows, task: Task) -> Command:
        self.rows = rows
        return Command(np.zeros(2), "ok", np.zeros(len(rows.labels), dtype=np.bool_), rows.labels)


def rows_at(t: float, noise: float = 0.0) -> Rows:
    """A row with σ = −1 + 0.3 t² + DRIFT t of which the model knows all but the drift, and a
    speed.
    """
    sigma = -1.0 + 0.3 * t * t + DRIFT * t + noise
    rate = 0.6 * t
    return Rows(
        phi=np.array([sigma + K * rate, -0.5]),
        Lg=np.array([[K, 0.0], [0.0, 1.0]]),
        Lf=np.array([rate + 0.6 * K, 0.1]),
        switching_gain=np.array([5.0, 5.0]),
        labels=("moving", "speed"),
        sigma=np.array([sigma, -0.5]),
        sigma_dot=np.array([rate, 0.0]),
        K=np.array([K, 0.0]),
    )


def asked(
    observer: float, dead_time: float = 0.0, samples: int = 200, noise: float = 0.0
) -> list[Rows]:
    """Rows that a law with an observer gets."""
    law = Listening()
    rng = np.random.default_rng(1)
    rows = []
    observed = Observed(law, observer=observer, dead_time=dead_time)
    observed.reset(period=PERIOD)
    for k in range(samples):
        observed.command(rows_at(k * PERIOD, noise * rng.standard_normal()), TASK)
        rows.append(law.rows)
    return rows


@pytest.mark.parametrize("dead_time", [0.0, 0.035])
def test_a_constant_drift_is_found_and_belongs_to_every_part_of_the_row(dead_time: float) -> None:
    true = rows_at(199 * PERIOD)
    found = asked(0.05, dead_time)[-1]
    sigma = true.sigma[0] + dead_time * DRIFT
    assert found.sigma_dot[0] == pytest.approx(true.sigma_dot[0] + DRIFT, rel=1e-9)
    assert found.sigma[0] == pytest.approx(sigma, rel=1e-9)
    assert found.phi[0] == pytest.approx(sigma + K * found.sigma_dot[0], rel=1e-9)
    assert found.Lf[0] == pytest.approx(true.Lf[0] + DRIFT, rel=1e-9)
    for name in ("phi", "sigma", "sigma_dot", "Lf"):
        assert getattr(found, name)[1] == getattr(true, name)[1]


def test_it_is_approached_with_the_time_constant() -> None:
    tau = 0.2
    drift = np.array(
        [rows.sigma_dot[0] for rows in asked(tau, samples=100)]
    ) - 0.6 * PERIOD * np.arange(100)
    k = np.arange(100)
    assert drift == pytest.approx(DRIFT * (1.0 - (tau / (tau + PERIOD)) ** k), abs=1e-9)


def test_noise_passes_as_promised() -> None:
    tau = 0.2
    s = 1e-3
    drift = [
        rows.sigma_dot[0] - 0.6 * k * PERIOD
        for k, rows in enumerate(asked(tau, samples=4000, noise=s))
    ][400:]
    assert np.std(drift) == pytest.approx(s / tau, rel=0.1)


def test_a_jump_counts_as_no_more_than_the_gain() -> None:
    law = Listening()
    observed = Observed(law, observer=0.09)
    observed.reset(period=PERIOD)
    observed.command(rows_at(0.0), TASK)
    jumped = rows_at(0.0)
    observed.command(replace(jumped, sigma=jumped.sigma + 100.0), TASK)
    assert law.rows.sigma_dot[0] == pytest.approx(5.0 * PERIOD / 0.1)


@pytest.mark.parametrize("bound", [(False,), (True,), (True, False)])
def test_a_law_with_an_observer_is_that_law_told_the_drift(bound: tuple[bool, ...]) -> None:
    """Half of what is missing more in every sample, as τ = T_s: by calls, compiled on fixed arrays,
    and by turns.
    """
    dead_time = 0.1
    task = Task(np.eye(1, 2), np.array([500.0]))
    law = Observed(HierarchicalQP(), observer=PERIOD, dead_time=dead_time)
    rows = rows_at(0.0)
    qdd = np.zeros(2)
    law.reset(period=PERIOD)
    whole = law.bind(rows, task, np.zeros(2, dtype=np.bool_), qdd)
    assert whole is not None
    for k in range(20):
        true = rows_at(k * PERIOD)
        for name in ("phi", "Lf", "sigma", "sigma_dot"):
            getattr(rows, name)[:] = getattr(true, name)
        if bound[k % len(bound)]:
            assert whole.solve() == 0
        else:
            qdd[:] = law.command(rows, task).qdd
        drift = np.array([DRIFT * (1.0 - 0.5**k), 0.0])
        told = replace(true, phi=true.phi + (dead_time + K) * drift, Lf=true.Lf + drift)
        assert qdd == pytest.approx(HierarchicalQP().command(told, task).qdd, abs=1e-8)
        assert qdd[0] < 200.0  # the row holds the task back


@pytest.mark.parametrize(
    "law", ["hierarchical-qp", "sliding-mode", "potential-field", "cbf-filter"]
)
def test_compiled_and_by_calls_alike(law: str) -> None:
    """Where the sphere moves unknown to the model, so that what is observed changes the command."""
    unknown = Scenario.load("moving-sphere").with_override("constraints.0.motion.known", False)
    setup = unknown.with_override("duration", 1.0).setup()
    options = {"observer": 0.1, "dead_time": 0.01}
    whole = simulate(setup, make_controller(law, options))
    by_calls = simulate(setup, make_controller(law, options), by_public_call=True)
    assert whole.compiled
    assert whole.qdd_command == pytest.approx(by_calls.qdd_command, abs=1e-9)
    assert np.abs(whole.qdd_command - simulate(setup, make_controller(law)).qdd_command).max() > 0.1


def test_it_forgets_at_a_reset() -> None:
    law = Observed(Listening(), observer=0.05)
    law.reset(period=PERIOD)
    for k in range(50):
        law.command(rows_at(k * PERIOD), TASK)
    law.reset()
    law.command(rows_at(0.0), TASK)
    assert law.law.rows.sigma_dot[0] == 0.0  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "options", [{"observer": 0.0}, {"observer": -1.0}, {"observer": np.nan}, {"dead_time": 0.01}]
)
def test_options_that_cannot_be_used_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(ConfigurationError, match="observer"):
        make_controller("hierarchical-qp", options)
    with pytest.raises(ConfigurationError, match="dead_time"):
        make_controller("hierarchical-qp", {"observer": 0.1, "dead_time": -1.0})


def test_rows_that_do_not_say_enough_are_refused() -> None:
    law = Observed(Tracking(), observer=0.1)
    with pytest.raises(InvalidInput, match="sampling period"):
        law.command(rows_at(0.0), TASK)
    law.reset(period=PERIOD)
    with pytest.raises(InvalidInput, match=r"rows\.sigma_dot"):
        law.command(replace(rows_at(0.0), sigma_dot=np.empty(0)), TASK)
    law.command(rows_at(0.0), TASK)
    with pytest.raises(InvalidInput, match="other rows"):
        law.command(replace(rows_at(0.0), labels=("another", "speed")), TASK)


PARTS = [{"demand": demand.name, "resolver": "priority"} for demand in DEMANDS]
UNKNOWN = Scenario.load("moving-sphere").with_override("constraints.0.motion.known", False)


#: A law of a guide that uses the model alone and does not declare it, and laws of joint speeds for
#: which no row of this scene is active.
ELSEWHERE = ("careful", "velocity-qp", "velocity-hierarchical-qp", "velocity-damper")

#: Four runs of each of them take longer than those of all the others.
SLOW = ("goal-governor", "barrier-governor", "mppi")


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        *(
            pytest.param(name, {}, marks=[pytest.mark.slow] if name in SLOW else [])
            for name in EVERY_LAW
            if name not in ELSEWHERE
        ),
        *(("law", part) for part in PARTS),
        pytest.param("goal-governor", PARTS[0], marks=pytest.mark.slow),
    ],
)
def test_options_that_change_no_command_are_said_and_no_others(
    name: str, parts: dict[str, str]
) -> None:
    scenario = UNKNOWN.with_override("duration", 1.0)
    if name in [law.name for law in VELOCITY_LAWS]:
        scenario = scenario.with_override("arm", {"command": "velocity", "lag": 0.02})
    setup = scenario.setup()
    plain = simulate(setup, make(name, parts))
    for options in ({"K": 2.0}, {"observer": 0.2}, {"observer": 0.2, "dead_time": 0.05}):
        run = simulate(setup, make(name, {**parts, **options}))
        said = (
            f"{' or '.join(options)} is given, but no command of the law depends on it"
            in run.reason
        )
        assert said is np.array_equal(run.qdd_command, plain.qdd_command)


@pytest.mark.parametrize(
    ("name", "options", "names"),
    [
        ("predictive", {"K": 2.0, "observer": 0.1, "dead_time": 0.05}, "K"),
        ("mppi", {"K": 2.0, "observer": 0.1}, "K or observer"),
        ("mppi", {"K": 2.0, "observer": 0.1, "dead_time": 0.05}, "K"),
        ("goal-governor", {"observer": 0.1, "dead_time": 0.05}, "observer or dead_time"),
        ("goal-governor", {"observer": 0.1, "demand": "barrier"}, ""),
        ("tracking", {"switching_gain": 2.0}, "switching_gain"),
        ("hierarchical-qp", {"switching_gain": 2.0}, "switching_gain"),
        ("hierarchical-qp", {"K": 2.0, "observer": 0.1}, ""),
    ],
)
def test_options_that_change_no_command_by_name(
    name: str, options: dict[str, Any], names: str
) -> None:
    said = f"{names} is given, but no command of the law depends on it" if names else ""
    assert make(name, options).unused() == said


def test_a_plan_foresees_what_moves_unknown_to_the_model() -> None:
    """The hand's depth in a sphere of which no law knows that it moves [m]; where it is known,
    there is no drift.
    """
    laws = [("predictive", {}), ("predictive", {"observer": 0.1}), ("robust-predictive", {})]
    runs = [simulate(UNKNOWN.setup(), make_controller(name, options)) for name, options in laws]
    blind, observing, robust = (
        run.sigma[:, run.labels.index("sphere[hand]")].max() for run in runs
    )
    assert blind > 5e-3
    assert 0.0 < observing < 1e-4
    assert robust < -1e-3
    known = Scenario.load("moving-sphere").with_override("duration", 2.5).setup()
    plain, observed = (
        simulate(known, make_controller(name, options)) for name, options in laws[:2]
    )
    np.testing.assert_allclose(observed.q, plain.q, atol=1e-4)


def test_a_law_observes_nothing_once_it_has_been_behind_an_observer() -> None:
    """It is used by itself before and after, also on rows that give no σ̇."""
    setup = UNKNOWN.with_override("duration", 1.0).setup()
    law = make_controller("predictive")
    before = simulate(setup, law).qdd_command
    observed = Observed(law, observer=0.2)
    assert not np.array_equal(simulate(setup, observed).qdd_command, before)
    np.testing.assert_array_equal(simulate(setup, law).qdd_command, before)
    observed.observer = 0.3
    observed.law = law
    assert (observed.law.fading, law.fading) == (0.3, 0.0)  # type: ignore[attr-defined]


def test_what_the_law_behind_it_is_told_and_uses() -> None:
    told: list[dict[str, Any]] = []

    class Told(Listening):
        uses = ("K", "memory", "model", "L_fφ")  # type: ignore[assignment]

        def reset(self, period: float | None = None, model: Any = None) -> None:
            told.append({"period": period, "model": model})

    law = Observed(Told())
    law.reset()
    law.reset(period=PERIOD)
    law.reset(model="a model")
    law.reset()
    assert told == [
        {"period": p, "model": m}
        for p, m in ((None, None), (PERIOD, None), *[(PERIOD, "a model")] * 2)
    ]
    assert law.uses == ("K", "L_fφ", "σ", "σ̇", "T_s", "memory", "model")
    assert Observed(Tracking()).uses == ("σ", "σ̇", "K", "T_s", "memory")
    assert (law.observer, law.dead_time) == (0.1, 0.0)
    assert law.bind(rows_at(0.0), TASK, np.zeros(2, dtype=np.bool_), np.zeros(2)) is None
    with pytest.raises(ConfigurationError, match="dead_time"):
        law.dead_time = False
