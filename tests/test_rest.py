"""What joints do where task and rows leave them free: q̈₀, by every law, in both forms, and until
the arm is at rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import cvxpy as cp
import numpy as np
import pytest

from numpy_form import define, evaluate_task
from oracle import Problem, lexicographic_optimum
from test_laws import ASKING, EACH, SHARING, made, problem
from vsconstraints.compiled import load
from vsconstraints.control import ControlStep
from vsconstraints.controllers import (
    CONTROLLERS,
    Demand,
    HierarchicalQP,
    Law,
    Resolver,
    Saturation,
    SaturationExact,
    Scaling,
    SlidingMode,
    Tracking,
    make_controller,
)
from vsconstraints.errors import InvalidInput, VsconstraintsError
from vsconstraints.formulas import formula
from vsconstraints.formulas.row import Row
from vsconstraints.rows import UNKNOWN, Array, Command, Rows, Task
from vsconstraints.scenarios import Scenario, shipped_scenarios
from vsconstraints.simulation import Setup, score_run, simulate
from vsconstraints.vision.features import CameraPose, ImagePoints
from vsconstraints.vision.tracking import Rest, VisualTask

FORMS = ["define", *(["compute"] if load("laws") is not None else [])]


@formula
def written(row: Row) -> Any:
    """L_gφ q̈ ≤ −L_fφ, so that a test can ask for anything."""
    return -row.Lf


@dataclass(frozen=True)
class Written(Demand):
    """What L_fφ says."""

    name = "written"
    formula = written
    uses: ClassVar[tuple[str, ...]] = ("Lf",)


def redundant(seed: int, k: int = 4, m: int = 4) -> tuple[Rows, Task]:
    """Seven joints, and rows that leave some of them free."""
    rows, task = problem(seed, m=m, n=7, k=k)
    task.rest = 3.0 * np.random.default_rng(100 + seed).normal(size=7)
    return rows, task


def answered(law: Law, form: str, rows: Rows, task: Task) -> Command:
    command = getattr(law, form)(rows, task)
    assert command is not None
    return command


# --- the nearest to it, of all that do as well ---


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "law", [HierarchicalQP(rows="active"), HierarchicalQP()], ids=["active", "barrier"]
)
@pytest.mark.parametrize("boxed", [False, True])
def test_the_hierarchys_third_level_is_the_distance_to_it(
    law: HierarchicalQP, form: str, boxed: bool
) -> None:
    """Against the oracle of three levels, of what is left of q̈ less q̈₀; some rows contradict each
    other.
    """
    relaxed = held = 0
    for seed in range(12):
        rows, task = redundant(seed)
        if seed % 3 == 0:
            rows.Lg[1] = -rows.Lg[0]
        if boxed:
            rows.qdd_min, rows.qdd_max = np.full(7, -4.0), np.full(7, 4.0)
        command = answered(law, form, rows, task)
        c = np.where(rows.phi >= 0.0, -rows.switching_gain, np.inf)
        c = c if law.rows == "active" else -law.alpha * rows.phi - rows.Lf
        asks = c < np.inf
        A = rows.Lg[asks]
        q0 = task.rest
        box = np.array([rows.qdd_min, rows.qdd_max]) - q0 if boxed else None
        shifted = Problem(
            A, c[asks] - A @ q0, np.ones(len(A)), task.J, task.b - task.J @ q0, box=box
        )
        expected = q0 + lexicographic_optimum(shifted)
        np.testing.assert_allclose(
            command.qdd, expected, atol=2e-4 * (1.0 + np.linalg.norm(expected))
        )
        relaxed += command.status == "relaxed"
        held += bool(command.acted.any())
    assert relaxed > 0
    assert held > relaxed


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "resolver",
    [each for each in SHARING if each.name in ("priority", "saturation")],
    ids=lambda each: repr(each)[:30],
)
def test_of_all_that_does_as_well_for_rows_and_task_it_is_the_nearest(
    resolver: Resolver, form: str
) -> None:
    """By cvxpy: with L_gφ q̈ of the rows that act, and with J q̈, as they are, nothing is nearer to
    q̈₀.
    """
    law = Law(Written(), resolver)
    acted = 0
    for seed in range(12):
        rows, task = redundant(seed, m=2)
        command = answered(law, form, rows, task)
        x = cp.Variable(7)
        kept = np.vstack((rows.Lg[command.acted], task.J))
        cp.Problem(
            cp.Minimize(cp.sum_squares(x - task.rest)), [kept @ x == kept @ command.qdd]
        ).solve(solver="CLARABEL")
        np.testing.assert_allclose(command.qdd, x.value, atol=1e-5)
        np.testing.assert_allclose((rows.Lg @ command.qdd + rows.Lf)[command.acted], 0.0, atol=1e-9)
        acted += bool(command.acted.any())
    assert acted > 5


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("resolver", [Saturation(), SaturationExact()])
def test_what_saturation_scales_is_the_task_and_not_the_rest(form: str, resolver: Resolver) -> None:
    """Joint 1 may do 0.4 of what the task wants of it; joint 2 does what it does at rest."""
    task = Task(np.array([[1.0, 0.0]]), np.array([10.0]), rest=np.array([7.0, 3.0]))
    rows = Rows.none(2)
    rows.qdd_min, rows.qdd_max = np.full(2, -4.0), np.full(2, 4.0)
    command = answered(Law(Written(), resolver), form, rows, task)
    np.testing.assert_allclose(command.qdd, [4.0, 3.0])


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "resolver",
    [one for one in SHARING if not isinstance(one, Scaling | Saturation | SaturationExact)],
    ids=repr,
)
def test_it_moves_the_origin_of_accelerations(resolver: Resolver, form: str) -> None:
    """q̈ − q̈₀ is the answer to the demands less L_gφ q̈₀ and the task less J q̈₀.

    Not of the governor, and of what saturation scales: they scale the command that tracks, and the
    task.
    """
    law = Law(Written(), resolver)
    for seed in range(12):
        rows, task = redundant(seed, k=6 if seed % 2 else 3)
        q0 = task.rest
        found = answered(law, form, rows, task)
        moved = Rows(
            rows.phi, rows.Lg, rows.Lf + rows.Lg @ q0, rows.switching_gain, rows.labels, rows.scale, rows.sigma,
            rows.sigma_dot, rows.K,
        )  # fmt: skip
        expected = answered(law, form, moved, Task(task.J, task.b - task.J @ q0, task.error))
        assert found.status == expected.status
        # the damped hierarchy and the filter to what an active-set method leaves
        np.testing.assert_allclose(
            found.qdd, q0 + expected.qdd, atol=1e-6 * (1.0 + np.linalg.norm(expected.qdd))
        )


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("resolver", SHARING, ids=repr)
@pytest.mark.parametrize("k", [0, 3, 7, 9])
def test_where_no_row_asks_for_anything_the_task_is_tracked_by_the_nearest(
    resolver: Resolver, form: str, k: int
) -> None:
    """Against the least-squares solution of LAPACK."""
    for demand in ASKING:
        rows, task = redundant(1, k=k, m=0)
        command = answered(made(demand, resolver), form, rows, task)
        way = (
            np.linalg.lstsq(task.J, task.b - task.J @ task.rest, rcond=1e-6)[0]
            if k
            else np.zeros(7)
        )
        np.testing.assert_allclose(command.qdd, task.rest + way, atol=1e-9)


@pytest.mark.parametrize(("demand", "resolver"), EACH)
def test_a_rest_of_zero_changes_no_bit(demand: Demand, resolver: Resolver) -> None:
    for form in FORMS:
        one = made(demand, resolver)
        other = made(demand, resolver)
        for seed in range(6):
            rows, task = redundant(seed)
            task.rest = np.zeros(7)
            found = getattr(one, form)(rows, task)
            expected = getattr(other, form)(rows, Task(task.J, task.b, task.error))
            assert (found is None) == (expected is None)
            if found is not None:
                np.testing.assert_array_equal(found.qdd, expected.qdd)
                np.testing.assert_array_equal(found.acted, expected.acted)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "rest", [np.zeros(6), np.full(7, np.nan), np.zeros(7, dtype=np.float32), [0.0] * 7]
)
def test_a_rest_that_is_none_is_refused(rest: Any, form: str) -> None:
    rows, task = redundant(0)
    task.rest = rest
    with pytest.raises(InvalidInput, match=r"task\.rest"):
        SlidingMode().command(rows, task)


# --- which arms have one ---


def rest_at_start(setup: Setup, qd: Array) -> tuple[Array, Array]:
    """Q̈₀ by the compiled step and by its definition."""
    step = ControlStep(setup.scene, setup.constraints, setup.task)
    state = setup.scene.evaluate(0.0, setup.q0, qd)
    return step.evaluate(0.0, setup.q0, qd).task.rest, evaluate_task(setup.task, state)[0].rest


@pytest.mark.parametrize("name", shipped_scenarios())
def test_arms_with_more_joints_than_the_task_needs_are_damped(name: str) -> None:
    """And no other: of the paper's scenes nothing changes."""
    setup = Scenario.load(name).setup()
    n = setup.scene.robot.n
    qd = 0.1 * np.cos(np.arange(n))
    for rest in rest_at_start(setup, qd):
        np.testing.assert_allclose(rest, -5.0 * qd if n > 6 else UNKNOWN)


@pytest.mark.parametrize(
    ("n", "k", "damping"),
    [(6, 6, 0.0), (7, 6, 5.0), (6, 8, 0.0), (7, 8, 5.0), (6, 4, 5.0), (3, 6, 0.0), (3, 2, 5.0)],
)
def test_no_feature_needs_more_than_six_joints(n: int, k: int, damping: float) -> None:
    task = Scenario.load("ur5-image").setup().task
    assert task.rest_of(n, k) == Rest(damping)
    given = VisualTask(task.feature, task.goals, task.gains, rest=Rest(2.0))
    assert given.rest_of(n, k) == Rest(2.0)


@pytest.mark.parametrize("feature", [CameraPose(), ImagePoints("mean")])
def test_a_posture_is_approached_with_critical_damping(feature: Any) -> None:
    setup = Scenario.load("panda-fov").setup()
    posture = np.linspace(-1.0, 1.0, 7)
    task = VisualTask(feature, setup.task.goals, setup.task.gains, rest=Rest(4.0, posture))
    step = ControlStep(setup.scene, setup.constraints, task)
    q = setup.q0
    qd = 0.2 * posture
    for found in (step.evaluate(0.0, q, qd), define(step, setup.scene.evaluate(0.0, q, qd))):
        np.testing.assert_allclose(found.task.rest, 4.0 * (posture - q) - 4.0 * qd, rtol=1e-12)


@pytest.mark.parametrize(
    ("rest", "words"),
    [
        ({"damping": -1.0}, "damping of rest must be zero or more, not -1"),
        ({"damping": float("inf")}, "damping must be finite"),
        ({"damping": 0.0, "posture": [0.0] * 7}, "needs rest.damping above zero"),
        ({"posture": [0.0] * 6}, r"rest\.posture has 6 values; the robot has 7 joints"),
        ({"stiffness": 1.0}, "unknown key in panda-fov.task.rest 'stiffness'.*damping, posture"),
    ],
)
def test_a_rest_that_a_scenario_cannot_mean(rest: dict[str, Any], words: str) -> None:
    with pytest.raises(VsconstraintsError, match=words):
        Scenario.load("panda-fov").with_override("task.rest", rest).setup()


# --- until the arm is at rest ---


def panda(**rest: Any) -> Setup:
    return Scenario.load("panda-fov").with_override("task.rest", rest).setup()


def violated(setup: Setup, sigma: Array) -> list[str]:
    """Labels of rows that are left by more than 1e-4 of their range."""
    labels = setup.constraints.labels
    scale = setup.constraints.scale
    return [labels[i] for i in np.flatnonzero(sigma.max(axis=0) > 1e-4 * scale)]


def test_tracking_alone_comes_to_rest_and_leaves_the_image_alone() -> None:
    setup = panda()
    run = simulate(setup, Tracking())
    assert run.status == "converged"
    assert np.abs(run.qd[-1]).max() < 0.01
    assert violated(setup, run.sigma) == ["fov[marker 3]"]


@pytest.mark.parametrize(
    "law", [name for name in CONTROLLERS if name not in ("tracking", "law", "predictive")]
)
def test_every_law_that_converges_leaves_the_arm_at_rest(law: str) -> None:
    run = simulate(panda(), make_controller(law))
    assert run.status in ("converged", "slow", "unfinished")
    assert np.abs(run.qd[-1]).max() < 0.01 or run.status != "converged"
    if law in (
        "sliding-mode",
        "hierarchical-qp",
        "cbf-filter",
        "boundary-layer",
        "implicit-switch",
        "super-twisting",
    ):
        assert run.status == "converged"


def test_a_running_elbow_is_not_converged() -> None:
    """Without damping the camera stands at its goal and the arm goes on turning: nor is that arm
    trapped.
    """
    setup = (
        Scenario.load("panda-fov")
        .with_override("task.rest", {"damping": 0.0})
        .with_override("duration", 8.0)
        .setup()
    )
    run = simulate(setup, Tracking())
    scores = score_run(setup, Tracking())
    assert np.abs(run.qd[-1]).max() > 0.5
    assert max(run.camera_error[-1]) < 0.005
    assert run.status == scores.status == "unfinished"
    assert "still moving, the fastest joint at" in run.reason
    assert not setup.reached(run.t, run.camera_error, run.feature_error_px, run.qd)[-100:].any()


def test_where_the_target_moves_so_do_the_joints() -> None:
    setup = Scenario.load("moving-target").setup()
    run = simulate(setup, Tracking())
    assert np.abs(run.qd[-1]).max() > 0.2
    assert run.status == "converged"


def test_a_posture_is_where_the_free_motion_ends() -> None:
    """The arm turns its elbow, without the camera, to where that is nearest."""
    posture = Scenario.load("panda-fov").setup().q0 + np.array([0.3, 0.0, -0.3, 0.0, 0.3, 0.0, 0.0])
    scenario = (
        Scenario.load("panda-fov").with_override("duration", 8.0).with_override("constraints", [])
    )
    ends = {}
    for name, rest in (("damped", {}), ("posture", {"posture": posture.tolist()})):
        setup = scenario.with_override("task.rest", rest).setup()
        run = simulate(setup, Tracking())
        assert run.status == "converged"
        J = evaluate_task(setup.task, setup.scene.evaluate(run.t[-1], run.q[-1], run.qd[-1]))[0].J
        free = np.linalg.svd(J)[2][-1]
        ends[name] = abs(free @ (posture - run.q[-1]))
    assert ends["posture"] < 1e-3
    assert ends["damped"] > 0.05


def test_a_law_of_ones_own_need_not_know_of_it() -> None:
    class Own(Tracking):
        """Takes no notice."""

        def solve(self, rows: Rows, task: Task) -> Command:
            """J†b."""
            qdd = np.linalg.pinv(task.J) @ task.b
            return Command(qdd, "ok", np.zeros(len(rows.labels), dtype=np.bool_), rows.labels)

    rows, task = redundant(0)
    np.testing.assert_array_equal(Own().command(rows, task).qdd, np.linalg.pinv(task.J) @ task.b)
