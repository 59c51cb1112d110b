"""Compiled laws against closed forms by singular values, and the hierarchy against one whose QPs
DAQP solves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import oracle
from oracle import KINDS, random_problem
from vsconstraints.controllers import HierarchicalQP, PotentialField, SlidingMode, Tracking
from vsconstraints.errors import InvalidInput
from vsconstraints.rows import Command, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

LAWS = {
    "tracking": Tracking(),
    "sliding": SlidingMode(),
    "additive": PotentialField(),
    "additive, square": PotentialField(exponent=2.0, region=0.5, strength=3.0),
    "priority": PotentialField(blend="priority"),
    "priority, square": PotentialField(blend="priority", exponent=2.0, region=0.5, strength=0.5),
}
N_JOINTS = (1, 2, 3, 6, 7, 30)


def expected(law, rows, task):
    """q̈ by singular values, and whether the rows with φ ≥ 0 have full rank."""
    free = oracle.track(task, law.rank_tolerance)
    gain = rows.switching_gain
    if isinstance(law, Tracking):
        return free, True
    if isinstance(law, SlidingMode):
        return oracle.prioritise(
            rows, task, np.where(rows.phi >= 0.0, -gain, np.inf), law.rank_tolerance
        )
    psi = np.maximum(1.0 + rows.phi / rows.scale / law.region, 0.0) ** law.exponent
    if law.blend == "additive":
        return free + oracle.pushes(
            rows, np.where(psi > 0.0, -psi * law.strength * gain, np.inf)
        ), True
    share = np.minimum(psi, 1.0)
    c = (1.0 - share) * (rows.Lg @ free) - share * law.strength * gain
    return oracle.prioritise(rows, task, np.where(psi > 0.0, c, np.inf), law.rank_tolerance)


def agree(law, rows, task, *, relative=1e-9):
    """Compare a law with its closed form; whether its rows had full rank."""
    qdd, whole = expected(law, rows, task)
    command = law.command(rows, task)
    if len(rows.qdd_max):
        qdd = np.clip(qdd, rows.qdd_min, rows.qdd_max)
    if np.abs(qdd).max() > 1e100:
        assert command.status == "failed"
        return False
    assert (command.status, command.labels) == ("ok" if whole else "rank-loss", rows.labels)
    assert ("dependent: row[" in command.reason) == (not whole)
    np.testing.assert_allclose(
        command.qdd, qdd, rtol=0.0, atol=relative * np.linalg.norm(qdd) + 1e-300
    )
    return whole


def conditioned(rng, k, n):
    """(k, n) matrix with singular values between 0.3 and 1, or none."""
    U, _, Vt = np.linalg.svd(rng.normal(size=(k, n)), full_matrices=False)
    return np.ascontiguousarray((U * rng.uniform(0.3, 1.0, min(k, n))) @ Vt)


def problem(rng, n, *, m=None, k=None, active=None):
    """Rows of which some are active, and a task."""
    m = int(rng.integers(0, 2 * n + 3)) if m is None else m
    k = int(rng.integers(0, n + 4)) if k is None else k
    active = int(rng.integers(0, min(m, n) + 1)) if active is None else active
    phi = -rng.uniform(0.0, 2.0, m)
    phi[rng.permutation(m)[:active]] *= -1.0
    rows = Rows(
        phi,
        conditioned(rng, m, n) if m else np.empty((0, n)),
        rng.normal(size=m),
        rng.uniform(0.1, 5.0, m),
        tuple(f"row[{i}]" for i in range(m)),
        rng.uniform(0.5, 2.0, m),
    )
    return rows, Task(conditioned(rng, k, n) if k else np.empty((0, n)), rng.normal(size=k))


# --- closed forms ---


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("n", N_JOINTS)
def test_random_problems(name, n):
    rng = np.random.default_rng(n)
    whole = 0
    for _ in range(60):
        rows, task = problem(rng, n)
        whole += agree(LAWS[name], rows, task, relative=1e-9)
    assert whole >= 50


@pytest.mark.parametrize("k", [6, 9])
@pytest.mark.parametrize("name", ["sliding", "priority"])
def test_tracking_corrected_for_rows_is_the_task_resolved_after_them(name, k):
    """What tracks is corrected, unless task or rows are too ill-conditioned for that."""
    rng = np.random.default_rng(k)
    law = LAWS[name]
    for worst in 10.0 ** np.arange(0.0, 5.5, 0.5):
        for _ in range(5):
            rows, task = problem(rng, 6, m=9, k=k, active=int(rng.integers(1, 5)))
            for M in (task.J, rows.Lg):
                U, s, Vt = np.linalg.svd(M, full_matrices=False)
                s[-1] = s[0] / worst
                M[:] = (U * s) @ Vt
            agree(law, rows, task, relative=1e-9)


def degenerate(kind, rng):
    """Problems at which a rank, or a gain, vanishes; those with rows that depend on each other say
    so.
    """
    rows, task = problem(rng, 6, m=9, k=6, active=3)
    Lg = rows.Lg
    phi = rows.phi
    J = task.J
    act = np.flatnonzero(phi >= 0.0)
    if kind == "a task of rank 3":
        J[3:] = rng.normal(size=(3, 3)) @ J[:3]
    if kind == "a task that is zero":
        J[:] = 0.0
    if kind == "a task next to the tolerance":
        U, s, Vt = np.linalg.svd(J)
        s[-1] = rng.choice((0.9, 1.1)) * 1e-6 * s[0]
        J[:] = (U * s) @ Vt
    if kind == "the same row twice":
        Lg[act[1]] = Lg[act[0]]
    if kind == "an active row without gradient":
        Lg[act[0]] = 0.0
    if kind == "rows that take the whole task":
        J[:3] = Lg[act]
    if kind == "as many active rows as joints":
        phi[:6] = np.abs(phi[:6])
        phi[6:] = -np.abs(phi[6:])
    if kind == "more active rows than joints":
        phi[:] = np.abs(phi)
    if kind == "active rows that depend on each other further inside":
        Lg[0], Lg[1] = Lg[2], -Lg[3]
    if kind == "rows of very different size":
        Lg *= 10.0 ** rng.uniform(-2.0, 2.0, (9, 1))
    if kind == "a tiny task":
        J *= 1e-135
    if kind == "rows that cancel most of a great task":
        Lg[:] = np.eye(9, 6)
        phi[:] = -5.0
        phi[:5] = 1.0
        task.b[:] = J @ np.array([1e9, 1e9, 1e9, 1e9, 1e9, 0.1])
    return rows, task


DEGENERATE = (
    "a task of rank 3",
    "a task that is zero",
    "a task next to the tolerance",
    "the same row twice",
    "an active row without gradient",
    "rows that take the whole task",
    "as many active rows as joints",
    "more active rows than joints",
    "active rows that depend on each other further inside",
    "rows of very different size",
    "a tiny task",
    "rows that cancel most of a great task",
)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("kind", DEGENERATE)
def test_degenerate_problems(name, kind):
    rng = np.random.default_rng(7)
    for _ in range(20):
        rows, task = degenerate(kind, rng)
        agree(LAWS[name], rows, task, relative=1e-9)


@pytest.mark.parametrize("factor", [1e-160, 1e160])
@pytest.mark.parametrize("which", ["Lg", "J"])
@pytest.mark.parametrize("law", [*LAWS.values(), HierarchicalQP()])
def test_numbers_whose_squares_leave_the_range_give_no_command(law, which, factor):
    rows, task = problem(np.random.default_rng(1), 6, m=9, k=6, active=3)
    (rows.Lg if which == "Lg" else task.J)[2] *= factor
    command = law.command(rows, task)
    assert np.isfinite(command.qdd).all()
    if not isinstance(law, HierarchicalQP):
        assert (command.status, "beyond the range" in command.reason) == ("failed", True)


@pytest.mark.parametrize("scenario", ["case-study-6r", "panda-fov"])
def test_recorded_problems(scenario):
    recorded = []

    class Recording(SlidingMode):
        def command(self, rows, task):
            recorded.append((rows, task))
            return super().command(rows, task)

    simulate(Scenario.load(scenario).with_override("duration", 1.0).setup(), Recording())
    active = 0
    for rows, task in recorded[:: max(1, len(recorded) // 100)]:
        rows = replace(rows, phi=rows.phi + 0.2)  # more rows act than in the run itself
        active += (rows.phi >= 0.0).any()
        for law in LAWS.values():
            agree(law, rows, task)
        agree_hierarchy(HierarchicalQP(), rows, task)
    assert active >= 10


def agree_hierarchy(law, rows, task):
    """Compare the compiled hierarchy with DAQP's."""
    options = {
        name: getattr(law, name) for name in ("rows", "alpha", "weights", "max_acceleration")
    }
    expected = HierarchicalQP(solver="daqp", **options).command(rows, task)
    command = law.compute(rows, task)
    assert command is not None
    assert not law.solvers.failures
    assert command.status == expected.status
    assert bool(command.solver) == (command.iterations > 0)
    # DAQP counts no iterations of hard rows that it refuses, the compiled form counts them
    counts_more = command.status == "relaxed" and bool(command.solver)
    assert bool(command.solver) == bool(expected.solver) or counts_more
    scale = 1.0 + np.linalg.norm(expected.qdd)
    np.testing.assert_allclose(command.slack, expected.slack, rtol=0.0, atol=1e-9 * scale)
    # where the task leaves directions free, each form decides by itself whether the damping has
    # cost more than 1e-6
    redundant = np.linalg.matrix_rank(task.J, tol=1e-6 * np.linalg.norm(task.J)) < task.J.shape[1]
    tolerance = (1e-6 if redundant else 1e-8) * scale
    np.testing.assert_allclose(command.qdd, expected.qdd, rtol=0.0, atol=tolerance)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("form", ["barrier", "active"])
def test_the_two_descents_agree(kind, form):
    """The contract of a pair: ``compiled.hierarchy`` and ``controllers.cascade``."""
    for seed in range(100, 115):
        given = random_problem(kind, seed)
        m = len(given.c)
        sign = np.where(np.arange(m) % 2, 1.0, -1.0) if form == "active" else 1.0
        gain = np.abs(given.c) + 0.1
        labels = tuple(f"row[{i}]" for i in range(m))
        rows = Rows(
            -sign * np.abs(given.c) if form == "active" else -given.c,
            given.A,
            np.zeros(m),
            gain,
            labels,
        )
        if given.box is not None:
            rows.qdd_min, rows.qdd_max = np.ascontiguousarray(given.box)
        weights = dict(zip(labels, given.weights, strict=True))
        law = HierarchicalQP(alpha=1.0, rows=form, weights=weights, max_acceleration=given.bound)
        agree_hierarchy(law, rows, Task(np.ascontiguousarray(given.J), given.b))


def test_the_same_calls_give_the_same_commands_bit_by_bit():
    rng = np.random.default_rng(0)
    problems = [problem(rng, 6) for _ in range(20)]
    for law in (*LAWS.values(), HierarchicalQP(), HierarchicalQP(rows="active")):
        first = [law.command(*each).qdd for each in problems]
        law.reset()
        for each, before in zip(reversed(problems), reversed(first), strict=True):
            np.testing.assert_array_equal(law.command(*each).qdd, before)


# --- input ---


@pytest.mark.parametrize("law", [*LAWS.values(), HierarchicalQP()], ids=lambda law: law.name)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_bad_numbers_are_named_as_ever(law, value):
    rows, task = problem(np.random.default_rng(0), 6, m=9, k=6, active=2)
    for field in ("phi", "Lg", "Lf", "switching_gain", "scale"):
        array = getattr(rows, field).copy()
        array.flat[-1] = value
        with pytest.raises(InvalidInput, match=r"row\[8\]"):
            law.command(replace(rows, **{field: array}), task)
    for field in ("J", "b"):
        array = getattr(task, field).copy()
        array.flat[-1] = value
        with pytest.raises(InvalidInput, match=f"task.{field} is not finite in row 5"):
            law.command(rows, replace(task, **{field: array}))


@pytest.mark.parametrize("law", [*LAWS.values(), HierarchicalQP()], ids=lambda law: law.name)
def test_bad_shapes_and_signs_are_named_as_ever(law):
    rows, task = problem(np.random.default_rng(0), 6, m=9, k=6, active=2)
    for field in ("phi", "Lg", "Lf", "switching_gain", "scale"):
        for wrong in (
            getattr(rows, field)[:-1].copy(),
            getattr(rows, field).astype(np.float32),
            [1.0],
            None,
        ):
            with pytest.raises((InvalidInput, TypeError)):
                law.command(replace(rows, **{field: wrong}), task)
    for wrong in (
        Task(task.J[:, :5].copy(), task.b),
        Task(task.J, task.b[:5].copy()),
        Task(task.b, task.b),
    ):
        with pytest.raises(InvalidInput):
            law.command(rows, wrong)
    for field in ("switching_gain", "scale"):
        for value in (0.0, -1.0):
            array = getattr(rows, field).copy()
            array[3] = value
            with pytest.raises(InvalidInput, match=r"positive; they are not for row\[3\]"):
                law.command(replace(rows, **{field: array}), task)


@pytest.mark.parametrize("law", [*LAWS.values(), HierarchicalQP()], ids=lambda law: law.name)
def test_arrays_of_another_layout_are_welcome(law):
    rows, task = problem(np.random.default_rng(0), 6, m=9, k=6, active=2)
    expected = law.command(rows, task).qdd
    frozen = rows.Lg.copy()
    frozen.flags.writeable = False
    for other in (np.asfortranarray(rows.Lg), np.repeat(rows.Lg, 2, axis=0)[::2], frozen):
        command = law.compute(replace(rows, Lg=other), task)
        np.testing.assert_array_equal(command.qdd, expected)
    rows.scale.flags.writeable = rows.switching_gain.flags.writeable = False
    np.testing.assert_array_equal(law.compute(rows, task).qdd, expected)


def test_options_may_be_whole_numbers():
    rows, task = problem(np.random.default_rng(0), 6, m=9, k=6, active=2)
    for law in (
        PotentialField(region=1, exponent=2, strength=3),
        HierarchicalQP(alpha=3, max_acceleration=9),
    ):
        assert law.compute(rows, task) is not None


def test_a_law_with_its_own_solve_is_asked_itself():
    class Own(SlidingMode):
        def solve(self, rows, task):
            return Command(np.full(task.J.shape[1], 7.0), "ok", rows.phi >= 0.0, rows.labels)

    class Further(Own):
        pass

    class Mixin:
        def solve(self, rows, task):
            return Own().solve(rows, task)

    class Mixed(Mixin, SlidingMode):
        pass

    class Still(SlidingMode):
        """No solve of its own: stays compiled."""

    rows, task = problem(np.random.default_rng(0), 6, m=9, k=6, active=2)
    for law in (Own(), Further(), Mixed()):
        np.testing.assert_array_equal(law.command(rows, task).qdd, np.full(6, 7.0))
    assert Still().compute(rows, task) is not None


# --- what the compiled solver leaves unanswered ---


def test_an_answer_that_fails_its_check_is_replaced_counted_and_reported(monkeypatch):
    rows = Rows(np.array([0.5]), np.ones((1, 2)), np.zeros(1), np.ones(1), ("a",))
    task = Task(np.eye(2), np.ones(2))
    law = HierarchicalQP()
    honest = law.command(rows, task)
    assert (honest.solver, honest.fallback, dict(law.solvers.failures)) == ("compiled", "", {})
    monkeypatch.setattr(type(law.resolver), "answers", ())
    command = law.command(rows, task)
    np.testing.assert_allclose(command.qdd, honest.qdd, atol=1e-7)
    assert (command.solver, command.status) == ("daqp", honest.status)
    assert command.fallback == "the compiled solver has no answer that passes the check"
    assert law.solvers.failures == {"compiled": 1}
    law.reset()
    assert not law.solvers.failures


def test_a_solver_that_is_named_is_the_one_used():
    rows = Rows(np.array([0.5]), np.ones((1, 2)), np.zeros(1), np.ones(1), ("a",))
    task = Task(np.eye(2), np.ones(2))
    for name in ("daqp", "proxqp", "osqp"):
        assert HierarchicalQP(solver=name).command(rows, task).solver == name
