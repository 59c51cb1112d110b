"""Runs of which nothing but scores is kept: they are those of the trajectory."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from test_simulation import Fails, Meddles, Played, dependent_rows, setup
from vsconstraints.comparisons import RunRecord, score
from vsconstraints.control.packing import StepArrays
from vsconstraints.controllers import (
    Controller,
    HierarchicalQP,
    Law,
    PotentialField,
    SlidingMode,
    Tracking,
    make_controller,
)
from vsconstraints.controllers.demands import Switch
from vsconstraints.controllers.resolver import Resolver
from vsconstraints.controllers.resolvers import RESOLVERS
from vsconstraints.errors import ConfigurationError
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import RunScores, Setup, score_run, simulate, until_settled

OF_RUN = (
    "duration_s", "settling_time_s", "final_translation_error_m", "final_rotation_error_rad", "final_feature_error_px",
    "acceleration_variation", "jerk_rms", "switching_rate_hz", "saturated_time_s",
)  # fmt: skip
OF_ROWS = (
    "phi_max",
    "active_time_s",
    "first_active_s",
    "last_active_s",
    "longest_positive_run_s",
    "share_to_hold",
)


def assert_scores_are_those_of_the_trajectory(there: Setup, law: Controller) -> RunScores:
    """By the metrics that comparisons have of a trajectory, and by its columns."""
    run = simulate(there, law)
    found = score_run(there, law)
    assert found.status == run.status
    assert run.reason.startswith(found.reason.split("; ")[0])
    assert (found.labels, found.compiled) == (run.labels, run.compiled)
    theirs = score(RunRecord.of(there, run, ""), None)
    for name in OF_RUN:
        np.testing.assert_allclose(
            getattr(found, name), theirs.result[name], rtol=1e-10, atol=1e-12, err_msg=name
        )
    for name in OF_ROWS:
        expected = [row[name] for row in theirs.constraints]
        np.testing.assert_allclose(getattr(found, name), expected, rtol=1e-10, err_msg=name)
    if len(run.t):
        np.testing.assert_array_equal(found.sigma_max, run.sigma.max(axis=0))
        np.testing.assert_array_equal(found.acceleration_max, np.abs(run.qdd_command).max(axis=0))
        np.testing.assert_allclose(found.outside_time_s, (run.sigma > 0.0).sum(axis=0) * there.Ts)
    return found


LAWS = [
    SlidingMode(),
    PotentialField(),
    PotentialField(blend="priority"),
    HierarchicalQP(),
    Tracking(),
]


@pytest.mark.parametrize("law", LAWS, ids=str)
@pytest.mark.parametrize("name", ["case-study-6r", "example-2d-fast", "moving-target", "panda-fov"])
def test_scores_are_those_of_the_trajectory(name: str, law: Controller) -> None:
    there = Scenario.load(name).setup()
    found = assert_scores_are_those_of_the_trajectory(
        replace(there, duration=min(there.duration, 3.0)), law
    )
    assert found.compiled


def test_scores_of_whole_runs() -> None:
    found = assert_scores_are_those_of_the_trajectory(
        Scenario.load("case-study-6r").setup(), SlidingMode()
    )
    assert found.status == "converged"
    assert found.settling_time_s > 0.0
    assert found.active_time_s.any()
    still = assert_scores_are_those_of_the_trajectory(setup(duration=2.5), Played(np.zeros((1, 6))))
    assert (still.status, still.reason) == (
        "trapped",
        simulate(setup(duration=2.5), Played(np.zeros((1, 6)))).reason,
    )


@pytest.mark.parametrize(
    ("name", "law", "status", "end"),
    [
        ("case-study-6r", "cbf-filter", "converged", 14.0),
        ("case-study-6r", "potential-field", "trapped", 14.0),
    ],
)
def test_runs_go_on_until_they_settle(name: str, law: str, status: str, end: float) -> None:
    """Beyond the duration, until they stay where they are for the time that it takes to tell: 2
    s.
    """
    short, long = (made(Scenario.load(name).setup()) for made in (lambda one: one, until_settled))
    controller = make_controller(law)
    found = assert_scores_are_those_of_the_trajectory(long, controller)
    assert (found.status, found.duration_s) == (status, pytest.approx(end))
    assert end < long.time_limit
    cut = assert_scores_are_those_of_the_trajectory(short, controller)
    assert cut.status == "slow"
    # longer is not calmer
    assert (found.acceleration_variation, found.jerk_rms) == (
        cut.acceleration_variation,
        cut.jerk_rms,
    )


def test_who_is_there_in_time_runs_no_longer() -> None:
    long = until_settled(Scenario.load("ur5-fov").setup())
    assert long.time_limit == pytest.approx(3.0 * 3.164)
    assert score_run(long, SlidingMode()).duration_s == long.duration
    moving = Scenario.load("moving-target").setup()
    assert until_settled(moving) is moving
    brief = Scenario.load("ur5-fov").with_override("duration", 2.0).setup()
    assert until_settled(brief) is brief


@pytest.mark.parametrize(
    "disturbance",
    [
        {"pixel_noise": 0.5},
        {"gradient_error": 0.3},
        {"acceleration_noise": 0.1, "acceleration": [0.05]},
        {"time_constant": 0.02},
    ],
    ids=str,
)
def test_disturbed_runs_have_the_same_scores(disturbance: dict[str, Any]) -> None:
    scenario = Scenario.load("case-study-6r").with_override("duration", 0.5)
    for key, value in disturbance.items():
        scenario = scenario.with_override(f"disturbances.{key}", value)
    assert_scores_are_those_of_the_trajectory(scenario.setup(), SlidingMode())


def test_own_laws_have_the_same_scores() -> None:
    fov = {"type": "field-of-view", "K": 0.1, "switching_gain": 2.0}
    accelerations = np.random.default_rng(3).uniform(-1.0, 1.0, (50, 6))
    for law in (Played(accelerations), Meddles(), Fails()):
        found = assert_scores_are_those_of_the_trajectory(
            setup(constraints=[fov], duration=0.2), law
        )
        assert not found.compiled


@pytest.mark.parametrize("compiler", [True, False])
def test_what_ends_a_run_ends_it_here_too(compiler: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if not compiler:
        monkeypatch.setattr(
            "vsconstraints.control.control_step.ControlStep.bound", lambda step: None
        )
    found = assert_scores_are_those_of_the_trajectory(
        setup(constraints=dependent_rows()), SlidingMode()
    )
    assert (found.status, found.duration_s) == ("aborted", 0.0)
    spin = np.zeros((1, 6))
    spin[0, 4] = 40.0
    found = assert_scores_are_those_of_the_trajectory(setup(), Played(spin))
    assert "not in front of the camera: marker" in found.reason
    nothing = assert_scores_are_those_of_the_trajectory(setup(), Played(np.full((1, 6), np.nan)))
    assert (nothing.status, nothing.duration_s) == ("failed", 0.0)


class Raises(Played):
    """Fails at once."""

    def solve(self, rows: Any, task: Any) -> Any:
        raise KeyError("gone")


def test_a_run_without_samples_has_no_scores() -> None:
    found = score_run(setup(), Raises(np.zeros((1, 6))))
    assert found.status == "failed"
    assert "KeyError: 'gone'" in found.reason
    assert np.isnan([found.duration_s, found.jerk_rms, found.final_feature_error_px]).all()


def test_a_robot_that_cannot_start_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="outside its ranges"):
        score_run(setup(q0=[0.0, 0.0, 9.0, 0.0, 0.0, 0.0]), Tracking())


def test_samples_are_the_same_however_many_are_taken_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    there = Scenario.load("case-study-6r").with_override("duration", 0.3).setup()
    whole = score_run(there, SlidingMode())
    monkeypatch.setattr("vsconstraints.simulation.loop.CHUNK", 7)
    parts = score_run(there, SlidingMode())
    np.testing.assert_equal(vars(parts), vars(whole))


@pytest.mark.parametrize("resolver", RESOLVERS, ids=lambda resolver: resolver.name)
def test_rows_act_alike_whoever_says_what_tracking_commands(resolver: type[Resolver]) -> None:
    # laws that come by it on their way tell the compiled loop, unless their rank tolerance is
    # another one; asked by their public call, they tell nothing
    there = Scenario.load("case-study-6r").with_override("duration", 0.6).setup()
    law = Law(Switch(), resolver())
    told = simulate(there, law)
    asked = simulate(there, law, by_public_call=True)
    assert told.active.any()
    for name in ("active", "saturated", "phi", "qdd_command"):
        np.testing.assert_array_equal(getattr(told, name), getattr(asked, name), err_msg=name)


@pytest.mark.parametrize(("disturbed", "made"), [({}, 1), ({"disturbances.pixel_noise": 1.0}, 2)])
def test_a_run_makes_its_control_step_once_and_that_of_the_world_where_it_is_another(
    monkeypatch: pytest.MonkeyPatch, disturbed: dict[str, float], made: int
) -> None:
    scenario = Scenario.load("case-study-6r").with_override("duration", 0.1)
    for key, value in disturbed.items():
        scenario = scenario.with_override(key, value)
    there = scenario.setup()
    packed = StepArrays.__init__
    count = 0

    def counted(*arguments: Any, **named: Any) -> None:
        nonlocal count
        count += 1
        packed(*arguments, **named)

    monkeypatch.setattr(StepArrays, "__init__", counted)
    score_run(there, SlidingMode())
    assert count == made
