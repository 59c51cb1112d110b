"""The goal governor: what it predicts, how it moves the reference, what it holds, and where it
stops.
"""

from __future__ import annotations

from copy import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from folder_laws import GoalGovernor, goal_governor, make
from numpy_form import evaluate_rows, evaluate_task, feature_motion
from vsconstraints.control import ControlStep, Model
from vsconstraints.controllers import Tracking
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.rows import Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, simulate
from vsconstraints.vision.features import CameraPose, Goal, ImagePoints
from vsconstraints.vision.tracking import VisualTask

SHORT = np.full(8, 0.02)


def scene(name: str = "example-2d-fov", **changes: Any) -> Setup:
    scenario = Scenario.load(name)
    for key, value in changes.items():
        scenario = scenario.with_override(key.replace("__", "."), value)
    return scenario.setup()


def model_of(setup: Setup, moving: float = 0.0) -> Model:
    step = ControlStep(setup.scene, setup.constraints, setup.task)
    step.evaluate(0.0, setup.q0, moving * np.cos(np.arange(len(setup.q0))))
    return step.model()


def response(model: Model, reference: Any, periods: Any) -> Any:
    """The response to a reference with accelerations of these periods; None if it is unknown."""
    governor = GoalGovernor()
    governor.reset(model=model)
    governor.periods = periods
    return governor.predict(reference)


# --- formulas ---


def test_a_retargeted_task_is_that_of_a_goal_that_is_there() -> None:
    setup = scene("ur5-image")
    r = 0.05 * np.sin(np.arange(8.0))
    state = setup.scene.evaluate(0.0, setup.q0, np.full(6, 0.1))
    goal = setup.task.goals[0]
    gains = setup.task.gains
    moved = Goal(0.0, goal.pixels, goal.normalised + r.reshape(4, 2), goal.camera, goal.depth)
    task, e = evaluate_task(setup.task, state)
    there, _ = evaluate_task(VisualTask(setup.task.feature, [moved], gains), state)
    before, after = gains.at(e), gains.at(e - r)
    b = goal_governor.retargeted(task.b, e, task.error_rate, r, before, after)
    np.testing.assert_allclose(b, there.b, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "feature"), [("case-study-6r", CameraPose()), ("ur5-image", ImagePoints())]
)
def test_a_reference_is_carried_from_goal_to_goal(name: str, feature: Any) -> None:
    """What is seen where the reference is, less the goal, before and after."""
    setup = scene(name)
    there = setup.scene.evaluate(0.0, setup.q0 + 0.1 * np.sin(np.arange(6)), setup.qd0)
    old = setup.task.goals[0]
    new = setup.task.goals[-1]
    if old is new:
        new = Goal(1.0, old.pixels, old.normalised + 0.1, old.camera)
    before = feature_motion(feature, there, old, None).error
    after = feature_motion(feature, there, new, None).error
    np.testing.assert_allclose(feature.carried(before, old, new, after), after, atol=1e-12)


# --- what is predicted ---


def test_a_response_to_the_goal_is_what_tracking_does() -> None:
    """Against the closed loop: the deepest that each row gets; and at rest the arm is where the
    goal was taken from.
    """
    setup = scene("case-study-6r", duration=3.9)
    run = simulate(setup, Tracking())
    found = response(model_of(setup), np.zeros(6), np.full(195, 0.02))
    assert found is not None
    deepest = -(run.sigma[1:] / setup.constraints.scale).max(axis=0)
    # accelerations are held ten times as long as in the loop, and the deepest is seen as seldom
    np.testing.assert_allclose(
        np.minimum(found.margins, 0.0), np.minimum(deepest, 0.0), rtol=0.05, atol=3e-3
    )
    goal = Scenario.load("case-study-6r").tables["task"]["goals"][0]["camera_at_q"]
    at_goal, sigma = evaluate_rows(
        setup.constraints, setup.scene.evaluate(0.0, np.array(goal), np.zeros(6))
    )
    # two steps of Newton leave the square of the square of what was left of the way
    np.testing.assert_allclose(found.sigma, sigma / at_goal.scale, atol=5e-5)


def test_a_response_is_to_the_goal_of_now() -> None:
    """Also where the next one begins meanwhile."""
    setup = scene("case-study-6r")
    step = ControlStep(setup.scene, setup.constraints, setup.task)
    step.evaluate(3.99, setup.q0, setup.qd0)
    model = step.model()
    assert model.goal == 0
    assert model.until == pytest.approx(4.0)
    first = scene(
        "case-study-6r", task__goals=Scenario.load("case-study-6r").tables["task"]["goals"][:1]
    )
    alone = response(model_of(first), np.zeros(6), SHORT)
    found = response(model, np.zeros(6), SHORT)
    assert alone is not None
    assert found is not None
    np.testing.assert_allclose(found.margins, alone.margins, atol=1e-9)


def test_what_cannot_be_seen_has_no_response() -> None:
    model = model_of(scene("case-study-6r"))
    far = np.array([0.0, 0.0, 5.0, 0.0, 0.0, 0.0])
    assert response(model, far, np.full(40, 0.1)) is None


# --- what it holds ---


@pytest.mark.slow
@pytest.mark.parametrize("name", ["example-2d-fov", "case-study-6r"])
def test_tracking_with_a_governor_violates_nothing_where_tracking_alone_does(name: str) -> None:
    setup = scene(name)
    run = simulate(setup, GoalGovernor())
    alone = simulate(setup, Tracking())
    assert alone.sigma.max() > 0.1
    # the governor holds the case study's first goal back until the second one begins
    missed = "unfinished", "goal 1 was not reached before goal 2 began"
    assert (run.status, run.reason) == (missed if name == "case-study-6r" else ("converged", ""))
    assert run.sigma.max() < 0.0
    assert run.clearance.min() > 0.0


def test_a_goal_outside_is_left_at_the_margin_of_the_row_that_is_named() -> None:
    """Joints that cannot reach the goal: the reference stops between margin and influence of what
    holds it.
    """
    near = {"joints": [1, 2, 3], "lower": [-0.9, -1.9, 0.0], "upper": [-0.5, -1.5, 2.0], "K": 0.2}
    walls = {"type": "joint-range", "switching_gain": 1.0, **near}
    setup = scene(constraints=[walls], duration=20.0, sampling_time=0.05)
    governor = GoalGovernor(margin=0.02, influence=0.1)
    run = simulate(setup, governor)
    assert run.status == "trapped"
    left = -run.sigma[-1]
    assert 0.02 - 1e-3 < left.min() < 0.1
    assert run.sigma.max() < -0.01
    assert governor.reference is not None
    said = (
        f"the governor's goal is {np.linalg.norm(governor.reference):.3g} from the task's, held by"
    )
    assert f"{said} {run.labels[int(np.argmin(left))]}" in run.reason


def test_a_start_outside_stays() -> None:
    wall = {
        "type": "joint-range",
        "joints": [3],
        "lower": [-2.0],
        "upper": [1.0],
        "K": 0.2,
        "switching_gain": 1.0,
    }
    run = simulate(scene(constraints=[wall], duration=1.0, sampling_time=0.02), GoalGovernor())
    assert np.abs(run.q - run.q[0]).max() < 1e-9
    assert "held by range[joint 3].upper" in run.reason


def test_without_rows_it_goes_to_the_goal() -> None:
    setup = scene("ur5-image", constraints=[], duration=6.0, sampling_time=0.02)
    governor = GoalGovernor(speed=1.0)
    run = simulate(setup, governor)
    assert np.linalg.norm(governor.reference) < 1e-12
    assert np.linalg.norm(run.error[-1]) < 0.1 * np.linalg.norm(run.error[0])
    assert "governor" not in run.reason


def test_another_law_underneath() -> None:
    governor = GoalGovernor(demand="switch", resolver="priority", rank_tolerance=1e-5)
    assert "model" in governor.uses
    run = simulate(scene(duration=3.0, sampling_time=0.02), governor)
    assert run.sigma.max() < 0.0


def test_a_law_underneath_that_is_not_compiled_gets_the_same_task() -> None:
    """One that asks a QP solver by its name, in Python, and the compiled one: the same least
    squares.
    """
    setup = scene("ur5-fov", duration=0.1)
    commands = []
    for solver in ("auto", "quadprog"):
        run = simulate(setup, GoalGovernor(demand="barrier", resolver="hierarchy", solver=solver))
        assert not run.compiled
        commands.append(run.qdd_command)
    np.testing.assert_allclose(*commands, atol=1e-5)


def test_options_may_change_on_the_way() -> None:
    """Of the governor, whose reference stays, and of the law underneath."""
    setup = scene()
    governor = GoalGovernor(demand="barrier", resolver="hierarchy", speed=1.0)
    step = ControlStep(setup.scene, setup.constraints, setup.task)
    references = []
    for t, speed in ((0.0, 1.0), (0.001, 1.0), (0.002, 2.0)):
        governor.speed = speed
        step.command(governor, t, setup.q0, setup.qd0)
        references.append(governor.reference)
    slowly, fast = np.linalg.norm(np.diff(references, axis=0), axis=1)
    assert fast == pytest.approx(2.0 * slowly, rel=1e-2)
    assert np.abs(step.command(governor, 0.1, setup.q0, setup.qd0)[1].qdd).max() > 0.02
    governor.law.max_acceleration = 0.01
    assert np.abs(step.command(governor, 0.1, setup.q0, setup.qd0)[1].qdd).max() == pytest.approx(
        0.01
    )


def test_it_begins_again_after_a_reset() -> None:
    setup = scene(duration=0.5)
    governor = GoalGovernor()
    first = simulate(setup, governor)
    second = simulate(setup, governor)
    np.testing.assert_array_equal(first.qdd_command, second.qdd_command)
    governor.reset()
    assert governor.reference is None


def test_in_a_loop_of_ones_own() -> None:
    """A control step gives it the model; the same states give the same commands as in a
    simulation.
    """
    setup = scene(duration=0.2)
    governor = GoalGovernor()
    run = simulate(setup, governor)
    step = ControlStep(setup.scene, setup.constraints, setup.task)
    other = GoalGovernor()
    for k in range(len(run.t)):
        _, command = step.command(other, run.t[k], run.q[k], run.qd[k])
        np.testing.assert_allclose(command.qdd, run.qdd_command[k], rtol=1e-9, atol=1e-9)


# --- what it commands ---

RECORDED = dict(np.load(Path(__file__).parent / "data" / "goal-governor.npz"))
BARRIER = {
    "demand": "barrier",
    "resolver": "hierarchy",
    "speed": 5.0,
    "margin": 0.05,
    "influence": 0.1,
}
OPTIONS = {
    "tracking": {},
    "barrier": BARRIER,
    "switch": {"demand": "switch", "speed": 4.0, "influence": 0.05},
}


@pytest.mark.parametrize("key", sorted(name for name in RECORDED if name.count("--") == 1))
def test_commands_are_those_of_the_decision_in_numpy(key: str) -> None:
    """Samples of a run, so far apart that many steps are refused; with goals that change, and
    unknown motion.
    """
    name, kind = key.split("--")
    setup = scene(name)
    law = GoalGovernor(**OPTIONS[kind])
    step = ControlStep(setup.scene, setup.constraints, setup.task)
    n = len(setup.q0)
    law.reset(period=setup.Ts, model=step.model())
    for sample in RECORDED[key]:
        q, qd, qdd = (part.copy() for part in sample[1 : 1 + 3 * n].reshape(3, n))
        command = step.command(law, sample[0], q, qd)[1]
        np.testing.assert_allclose(command.qdd, qdd, atol=1e-9 * max(1.0, np.abs(qdd).max()))
        assert law.reference is not None
        np.testing.assert_allclose(law.reference, sample[1 + 3 * n :], atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("key", sorted(name for name in RECORDED if name.endswith("--run")))
def test_runs_are_those_of_the_decision_in_numpy(key: str) -> None:
    name, kind, _ = key.split("--")
    duration = 6.0 if name == "case-study-6r" else 4.0
    setup = scene(name, duration=duration)
    run = simulate(setup, GoalGovernor(**OPTIONS[kind]))
    n = len(setup.q0)
    places = RECORDED[key][:, 0].astype(int)
    np.testing.assert_allclose(run.q[places], RECORDED[key][:, 1 : 1 + n], atol=1e-9)
    np.testing.assert_allclose(run.qdd_command[places], RECORDED[key][:, 1 + n :], atol=1e-8)


# --- what it refuses ---


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        *(
            ({name: value}, InvalidInput, f"{name} of goal-governor must be positive")
            for name in ("speed", "margin", "influence", "horizon")
            for value in (0.0, -1.0, float("nan"), float("inf"), "1", True)
        ),
        (
            {"margin": 0.5},
            ConfigurationError,
            r"influence of goal-governor must be above its margin 0\.5, not 0\.3",
        ),
        ({"demand": "none"}, ConfigurationError, "unknown demand 'none'.*nothing"),
        ({"speeed": 1.0}, ConfigurationError, "'speeed'"),
    ],
)
def test_options_that_are_none(
    options: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        make("goal-governor", options)
    for name, value in (
        options.items() if "speeed" not in options and "demand" not in options else ()
    ):
        governor = GoalGovernor()
        kept = getattr(governor, name)
        with pytest.raises(error, match=message):
            setattr(governor, name, value)
        assert getattr(governor, name) == kept


def test_what_it_needs_is_asked_for() -> None:
    rows = Rows.none(2)
    task = Task(np.eye(2), np.ones(2), np.ones(2), np.ones(2))
    with pytest.raises(InvalidInput, match=r"goal-governor uses a model: .*reset\(model="):
        GoalGovernor().command(rows, task)
    governor = GoalGovernor()
    governor.reset(model=model_of(scene()))
    with pytest.raises(InvalidInput, match=r"uses task\.error and task\.error_rate"):
        governor.command(rows, Task(np.eye(2), np.ones(2)))
    with pytest.raises(InvalidInput, match=r"uses task\.error and task\.error_rate"):
        governor.command(rows, Task(np.eye(2), np.ones(2), np.ones(2)))
    with pytest.raises(
        InvalidInput, match="goal-governor has the model of other rows or of another robot"
    ):
        governor.command(rows, task)
    # a task of another size, at first and later, which moves nothing
    seen = governor.model.at(*governor.model.present)
    fewer = Task(
        seen.task.J[:2],
        *(part[:2] for part in (seen.task.b, seen.task.error, seen.task.error_rate)),
    )
    with pytest.raises(InvalidInput, match="predicts other rows and another task than these"):
        governor.command(seen.rows, fewer)
    governor.reset()
    governor.command(seen.rows, seen.task)
    before = governor.reference
    with pytest.raises(InvalidInput, match="goal-governor has remembered another task"):
        governor.command(seen.rows, fewer)
    np.testing.assert_array_equal(governor.reference, before)


def test_references_of_their_own_and_motions_without_end_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="moves the reference itself: leave reach_in out"):
        simulate(scene(task__goals__0__reach_in=1.0), GoalGovernor())
    with pytest.raises(
        ConfigurationError, match="without damping tracking never comes to rest: give goal-governor"
    ):
        simulate(scene(task__damping=0.0), GoalGovernor())
    setup = scene()
    setup.task.feature = copy(setup.task.feature)
    setup.task.feature.name = "own"
    with pytest.raises(ConfigurationError, match="the feature own does not say where a reference"):
        super(CameraPose, setup.task.feature).carried(
            np.zeros(6), *setup.task.goals, *setup.task.goals, np.zeros(6)
        )
