"""What a designer of a law sets of its rows: factors on K and u⁺, and speeds judged one period
ahead.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vsconstraints.arms import Job, driver_for, run_on_arm
from vsconstraints.comparisons import RunSpec
from vsconstraints.comparisons.run import perform
from vsconstraints.comparisons.runs.spec import ControllerSpec
from vsconstraints.constraints import ConstraintSet, FieldOfView
from vsconstraints.controllers import (
    CONTROLLERS,
    VELOCITY_LAWS,
    Barrier,
    Controller,
    HierarchicalQP,
    Law,
    Priority,
    RowFactors,
    SlidingMode,
    Switch,
    Tracking,
    make_controller,
)
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.rows import Array, Command, Rows, Task
from vsconstraints.scenarios import Scenario, shipped_scenarios
from vsconstraints.simulation import simulate
from vsconstraints.view.notebooks.inputs import spec_of

FUNNEL = "example-2d-funnel"
CASE = Scenario.load("case-study-6r").with_override("duration", 1.0)
FACTORS = RowFactors(K={"fov": 3.0, "range": 0.5}, switching_gain=2.0)


def test_a_funnel_that_would_narrow_too_fast_is_refused() -> None:
    with pytest.raises(
        ConfigurationError, match="nor narrow faster than rows approach their boundary"
    ):
        Scenario.load(FUNNEL).setup().control(RowFactors(K=20.0))


@pytest.mark.parametrize("name", [name for name in shipped_scenarios() if name != FUNNEL])
def test_rows_are_those_of_the_scene_with_other_gains(name: str) -> None:
    """φ = σ + f K σ̇, its gradient and drift by the chain rule, from σ, σ̇ and K of the rows as
    they are.
    """
    setup = Scenario.load(name).setup()
    step = setup.control(RowFactors(K=2.5, switching_gain=0.5, speed_gain=3.0))
    qd = 0.1 * np.cos(np.arange(len(setup.q0)))
    ours, theirs = (each.evaluate(0.3, setup.q0, qd).rows for each in (step, setup.control()))
    f = np.where(theirs.K > 0.0, 2.5, 1.0)
    np.testing.assert_allclose(
        ours.phi, theirs.sigma + f * (theirs.phi - theirs.sigma), rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(ours.Lg, f[:, None] * theirs.Lg, rtol=1e-9, atol=1e-12)
    drift = np.where(
        theirs.K > 0.0, theirs.sigma_dot + f * (theirs.Lf - theirs.sigma_dot), theirs.Lf
    )
    np.testing.assert_allclose(ours.Lf, drift, rtol=1e-8, atol=1e-9)
    speeds = [label.startswith("speed[") for label in theirs.labels]
    np.testing.assert_array_equal(
        ours.switching_gain, np.where(speeds, 1.5, 0.5) * theirs.switching_gain
    )
    np.testing.assert_array_equal(ours.K, f * theirs.K)
    np.testing.assert_allclose(ours.sigma, theirs.sigma, rtol=1e-12, atol=1e-15)
    assert ours.labels == theirs.labels


class Wrapped(Controller):
    """A law that is given the scene's rows, and changes them itself."""

    name = "wrapped"

    def __init__(self, law: Controller, K: dict[str, float], gain: float) -> None:
        self.law = law
        self.K = K
        self.gain = gain

    def solve(self, rows: Rows, task: Task) -> Command:
        f = np.array([self.K.get(label.partition("[")[0], 1.0) for label in rows.labels])
        f = np.where(rows.K > 0.0, f, 1.0)
        # σ̇ as the rows have it, with its error where gradients are wrong
        sigma_dot = (rows.phi - rows.sigma) / np.where(rows.K > 0.0, rows.K, 1.0)
        phi = rows.sigma + f * (rows.phi - rows.sigma)
        Lf = sigma_dot + f * (rows.Lf - sigma_dot)
        Lf = np.where(rows.K > 0.0, Lf, rows.Lf)
        own = replace(
            rows,
            phi=phi,
            Lg=f[:, None] * rows.Lg,
            Lf=Lf,
            switching_gain=self.gain * rows.switching_gain,
        )
        return self.law.command(own, task)


@pytest.mark.parametrize("error", [0.0, 0.3])
@pytest.mark.parametrize("law", [SlidingMode, HierarchicalQP])
def test_a_law_with_factors_is_that_law_on_changed_rows(law: type[Law], error: float) -> None:
    """Gradients with an error (49) too, which φ, L_gφ and L_fφ contain."""
    ours = law()
    ours.factors = FACTORS
    # long enough for the image to be a limit
    setup = (
        CASE.with_override("duration", 3.0)
        .with_override("disturbances", {"gradient_error": error})
        .setup()
    )
    runs = [
        simulate(setup, each)
        for each in (ours, Wrapped(law(), {"fov": 3.0, "range": 0.5}, 2.0), law())
    ]
    np.testing.assert_allclose(runs[0].q, runs[1].q, atol=1e-7)
    assert np.abs(runs[0].q - runs[2].q).max() > 1e-4
    # what is kept of a run are the scene's rows
    np.testing.assert_allclose(runs[0].phi, runs[1].phi, atol=1e-5)
    np.testing.assert_allclose(runs[0].sigma, runs[1].sigma, atol=1e-6)


class OwnView(FieldOfView):
    """Evaluated in NumPy, as an own constraint is."""

    def sigma(self, y: Array) -> Array:
        return super().sigma(y)


def test_rows_in_numpy_have_the_factors_and_the_errors_too() -> None:
    disturbed = (
        CASE.with_override("duration", 3.0)
        .with_override("disturbances", {"gradient_error": 0.3})
        .setup()
    )
    every = [copy(each) for each in disturbed.constraints.constraints]
    for each in every:
        each.__class__ = OwnView if type(each) is FieldOfView else type(each)
    own = replace(disturbed, constraints=ConstraintSet(every, disturbed.scene))
    assert not simulate(replace(own, duration=0.1), SlidingMode()).compiled
    law = HierarchicalQP()
    law.factors = FACTORS
    np.testing.assert_allclose(simulate(own, law).q, simulate(disturbed, law).q, atol=1e-9)


class Notes(Controller):
    """Tracks in Python, and notes the gains of its rows."""

    name = "notes"

    def solve(self, rows: Rows, task: Task) -> Command:
        self.seen = rows.switching_gain.copy(), rows.K.copy()
        return Tracking().command(rows, task)


def test_a_law_in_python_sees_its_own_gains() -> None:
    setup = replace(CASE.setup(), duration=0.1)
    law = Notes()
    law.factors = RowFactors(K=3.0, switching_gain=2.0)
    simulate(setup, law)
    np.testing.assert_array_equal(law.seen[0], 2.0 * setup.constraints.switching_gain)
    np.testing.assert_array_equal(law.seen[1], 3.0 * setup.constraints.approach_time)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_every_law_takes_factors_and_factors_of_one_change_no_bit(name: str) -> None:
    scene = Scenario.load("example-2d-fov").with_override("duration", 0.5)
    if name in [law.name for law in VELOCITY_LAWS]:
        scene = scene.with_override("arm", {"command": "velocity", "lag": 0.02})
    setup = scene.setup()
    one = make_controller(name, {"K": 1.0, "switching_gain": {"fov": 1}})
    plain = make_controller(name)
    assert one.factors.options() == {"switching_gain": {"fov": 1}}
    np.testing.assert_array_equal(simulate(setup, one).q, simulate(setup, plain).q)
    changed = make_controller(name, {"K": {"fov": 4.0}})
    assert spec_of(changed)[0].options["K"] == {"fov": 4.0}
    assert np.isfinite(simulate(setup, changed).q).all()


def test_python_and_compiled_loops_agree_with_disturbances_too() -> None:
    disturbed = CASE.with_override(
        "disturbances", {"gradient_error": 0.2, "pixel_noise": 0.3}
    ).setup(0, 3)
    law = HierarchicalQP()
    law.factors = FACTORS
    compiled = simulate(disturbed, law)
    by_call = simulate(disturbed, law, by_public_call=True)
    np.testing.assert_allclose(compiled.q, by_call.q, atol=1e-12)


def test_scores_are_the_scenes() -> None:
    """Bands and boundaries are the same for all, whatever gains a law asks for."""
    strong = ControllerSpec("strong", "sliding-mode", {"switching_gain": 3.0, "K": 0.5})
    runs = [perform(RunSpec(CASE, law)) for law in (strong, ControllerSpec("sliding-mode"))]
    np.testing.assert_array_equal(*(run.record.switching_gain for run in runs))
    np.testing.assert_array_equal(*(run.record.length for run in runs))
    first = [run.trajectory.phi[0] for run in runs]
    np.testing.assert_allclose(*first, atol=1e-12)
    assert (
        runs[0].score.result["acceleration_variation"]
        > 1.05 * runs[1].score.result["acceleration_variation"]
    )


def test_an_arm_runs_a_law_with_its_factors() -> None:
    setup = (
        Scenario.load("ur5-fov")
        .with_override("duration", 0.3)
        .with_override("on_hidden_markers", "continue")
        .setup()
    )
    law = HierarchicalQP()
    law.factors = RowFactors(K=3.0)
    log = run_on_arm(Job(setup, law, driver_for("simulated://", setup)))[1]
    np.testing.assert_allclose(log.column("q")[~log.braking], simulate(setup, law).q, atol=1e-7)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"K": 0.0}, "K of a law multiplies the scene's value and must be positive, not 0.0"),
        ({"K": True}, "K of a law multiplies"),
        ({"switching_gain": {"fov": -1.0}}, "switching_gain.fov of a law multiplies"),
        ({"switching_gain": "much"}, "not 'much'"),
        ({"K": {"fov": float("nan")}}, "K.fov of a law"),
        (
            {"speed_gain": {"speed": 2.0}},
            "speed_gain of a law multiplies the scene's value and must be positive, not {'speed': 2.0}",
        ),
        ({"k": 2.0}, "'k'. Available: K, command_delay, dead_time, observer, rank_tolerance"),
    ],
)
def test_factors_that_cannot_be_used_are_named(options: dict[str, Any], told: str) -> None:
    with pytest.raises(ConfigurationError) as raised:
        make_controller("sliding-mode", options)
    assert told in str(raised.value)


def test_a_kind_without_rows_is_named() -> None:
    law = make_controller("sliding-mode", {"K": {"fovv": 2.0}})
    reason = simulate(CASE.with_override("duration", 0.1).setup(), law).reason
    assert "factors of the law name fovv, but there are no such rows" in reason


# --- one period ahead ---


def rows(phi: float, v: float, K: float) -> tuple[Rows, Task]:
    """A row with L_gφ = 1 that is at φ, and a task that asks for q̈ = v."""
    one = np.ones(1)
    own = Rows(np.array([phi]), one[:, None], 0.0 * one, 2.0 * one, ("row",), sigma=np.array([phi]))
    own.sigma_dot = 0.0 * one
    own.K = K * one
    return own, Task(np.eye(1), np.array([v]))


@pytest.mark.parametrize(
    ("phi", "v", "K", "ahead", "expected"),
    [
        (-0.01, 5.0, 0.0, False, 5.0),  # the paper's law has not seen it yet
        (-0.01, 5.0, 0.0, True, -2.0),  # −0.01 + 0.004 · 5 ≥ 0
        (-0.03, 5.0, 0.0, True, 5.0),  # −0.03 + 0.004 · 5 < 0
        (-0.01, 5.0, 0.2, True, 5.0),  # φ = σ + K σ̇ is ahead by itself
        (0.01, -5.0, 0.0, True, -5.0),  # tracking takes it back within the period
    ],
)
def test_a_speed_is_judged_where_tracking_takes_it(
    phi: float, v: float, K: float, ahead: bool, expected: float
) -> None:
    law = Law(Switch(ahead=ahead), Priority())
    law.reset(period=0.004)
    command = law.command(*rows(phi, v, K))
    assert command.qdd[0] == pytest.approx(expected)
    assert law.uses == (("K", "L_gφ q̈ of tracking", "T_s") if ahead else ())


def test_a_barrier_one_period_ahead_by_hand() -> None:
    """v ≤ −α (φ + T_s v_track) = −20 · (−0.1 + 0.004 · 5) = 1.6."""
    law = HierarchicalQP()
    law.ahead = True
    law.reset(period=0.004)
    assert law.command(*rows(-0.1, 5.0, 0.0)).qdd[0] == pytest.approx(1.6)
    assert HierarchicalQP().command(*rows(-0.1, 5.0, 0.0)).qdd[0] == pytest.approx(2.0)
    law.ahead = False
    assert law.command(*rows(-0.1, 5.0, 0.0)).qdd[0] == pytest.approx(2.0)


def test_the_paper_s_law_one_period_ahead_keeps_a_speed_that_it_violates() -> None:
    setup = Scenario.load("case-study-6r").setup()
    least = {}
    for name in ("sliding-mode", "sliding-mode-ahead"):
        run = simulate(setup, make_controller(name))
        assert run.status == "converged"
        least[name] = run.clearance[:, run.labels.index("speed[joint 2].upper")].min()
    # by the strict standard, 1e-4 of L; what other rows add to tracking is not seen ahead
    strict = (
        1e-4
        * setup.constraints.characteristic_length[
            setup.constraints.labels.index("speed[joint 2].upper")
        ]
    )
    assert least["sliding-mode"] < -10.0 * strict
    assert least["sliding-mode-ahead"] > -strict


# --- a margin ---


def test_a_margin_by_hand() -> None:
    """Of a share of the scale, 2 here: v ≤ −α (φ + m s) = −20 · (−0.4 + 0.1 · 2) = 4, and of a
    switch φ ≥ −m s.
    """
    given, task = rows(-0.4, 9.0, 0.2)
    given.scale = np.array([2.0])
    assert HierarchicalQP(margin=0.1).command(given, task).qdd[0] == pytest.approx(4.0)
    assert HierarchicalQP().command(given, task).qdd[0] == pytest.approx(8.0)
    for phi, expected in ((-0.21, 9.0), (-0.19, -2.0)):
        given.phi[:] = phi
        assert Law(Switch(margin=0.1), Priority()).command(given, task).qdd[0] == pytest.approx(
            expected
        )


def test_a_margin_moves_sigma_too() -> None:
    """FIRAS pushes by s u⁺ (r − 1) r² with r = ρ₀/ρ: here ρ₀ = 0.2, and ρ = 0.15 − 0.05."""
    given, task = rows(-0.15, 0.0, 0.2)
    push = make_controller(
        "law", {"demand": "firas", "resolver": "additive", "margin": 0.05}
    ).command(given, task)
    assert push.qdd[0] == pytest.approx(-0.1 * 2.0 * (2.0 - 1.0) * 2.0**2)


def test_plans_leave_the_margin_too() -> None:
    """As shares of the scale, where the row that tracking violates comes nearest to its
    boundary.
    """
    setup = Scenario.load("example-2d-fov").with_override("duration", 6.0).setup()
    nearest = {}
    for margin in (0.0, 0.05):
        run = simulate(setup, make_controller("predictive", {"margin": margin}))
        nearest[margin] = run.sigma[:, run.labels.index("fov[marker 2]")].max()
    assert -0.02 < nearest[0.0] <= 0.0
    assert nearest[0.05] == pytest.approx(-0.05, abs=0.01)


@pytest.mark.parametrize("margin", [-0.1, 1.0, True, float("nan"), "0.1", None])
def test_margins_that_are_none_are_refused(margin: Any) -> None:
    for name in ("hierarchical-qp", "potential-field", "implicit-switch", "predictive"):
        with pytest.raises((ConfigurationError, InvalidInput), match="margin"):
            make_controller(name, {"margin": margin})


def test_the_robust_law_is_the_hierarchical_qp_with_other_settings() -> None:
    robust = make_controller("robust-hierarchical-qp")
    plain = HierarchicalQP(alpha=12.0, margin=0.06)
    assert robust.factors == RowFactors(K=3.0)
    assert make_controller("robust-hierarchical-qp", {"switching_gain": 2.0}).factors == RowFactors(
        3.0, 2.0
    )
    plain.factors = RowFactors(K=3.0)
    setup = CASE.setup()
    np.testing.assert_array_equal(simulate(setup, robust).q, simulate(setup, plain).q)
    assert spec_of(robust)[0].options == {}


def test_what_cannot_look_ahead_is_refused() -> None:
    with pytest.raises(
        InvalidInput, match="observes what moves φ itself, so ahead = true cannot be used"
    ):
        make_controller("implicit-switch-with-drift", {"ahead": True})
    with pytest.raises(ConfigurationError, match="ahead must be true or false, not 1"):
        Barrier(ahead=1)  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match="uses the sampling period"):
        make_controller("sliding-mode-ahead").command(*rows(0.0, 1.0, 0.0))
    assert make_controller("law", {"demand": "switch", "ahead": True}).demand.ahead  # type: ignore[attr-defined]
    assert not Tracking().demand.ahead
