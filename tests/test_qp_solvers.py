"""QP solvers against enumeration of active sets, and what happens when one lies, hangs, fails or is
missing.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from oracle import exact_least_violation, violation_norm
from vsconstraints.compiled import load
from vsconstraints.controllers import HierarchicalQP
from vsconstraints.errors import ConfigurationError, InvalidInput, SolverError
from vsconstraints.qp import (
    FALLBACKS,
    Answer,
    Infeasible,
    SolverChain,
    make_solver,
    optimality_errors,
    solver_names,
)
from vsconstraints.qp.backends import NATIVE, DaqpSolver, ProxqpSolver, QpsolversSolver
from vsconstraints.qp.scaling import equilibrate, scale
from vsconstraints.qp.solver import QPSolver

SOLVERS = ("daqp", "proxqp", "osqp", "quadprog", "clarabel")


def quadratic_program(seed, n=3, m=6):
    """A strictly convex program with a feasible point, well conditioned."""
    rng = np.random.default_rng(seed)
    M = rng.normal(size=(n, n))
    P = M @ M.T + 0.5 * np.eye(n)
    q = rng.normal(size=n)
    G = rng.normal(size=(m, n))
    h = G @ rng.normal(size=n) + rng.uniform(0.0, 0.5, m)
    return P, q, G, h


def enumerated_minimum(P, q, G, h):
    """The minimiser and its multipliers, by trying every active set: the first that meets all
    conditions.
    """
    m, n = G.shape
    for size in range(min(m, n) + 1):
        for active in map(list, combinations(range(m), size)):
            system = np.block([[P, G[active].T], [G[active], np.zeros((size, size))]])
            solution = np.linalg.solve(system, np.concatenate([-q, h[active]]))
            x = solution[:n]
            multipliers = np.zeros(m)
            multipliers[active] = solution[n:]
            if (G @ x <= h + 1e-10).all() and (multipliers >= -1e-10).all():
                return x, multipliers
    raise AssertionError("no active set is optimal")


def lying(answer):
    """An ``attempt`` that gives this answer, or raises it, whatever it is asked; counts its
    calls.
    """

    def attempt(self, P, q, G, h):
        attempt.calls += 1
        if isinstance(answer, BaseException):
            raise answer
        return answer(P, q, G, h)

    attempt.calls = 0
    return attempt


LIES = {
    "garbage": lambda P, q, G, h: Answer(np.full(q.size, 7.0), np.zeros(h.size), 3),
    "not finite": lambda P, q, G, h: Answer(np.full(q.size, np.nan), np.zeros(h.size), 3),
    "multipliers not finite": lambda P, q, G, h: Answer(
        np.zeros(q.size), np.full(h.size, np.inf), 3
    ),
    "negative multipliers": lambda P, q, G, h: Answer(*negative_multipliers(P, q, G, h), 3),
    "a row ignored": lambda P, q, G, h: Answer(*row_ignored(P, q, G, h), 3),
    "free minimum": lambda P, q, G, h: Answer(np.linalg.solve(P, -q), np.zeros(h.size), 3),
    "raises": RuntimeError("segmentation narrowly avoided"),
    "claims infeasible": Infeasible("the rows contradict each other, honestly"),
    "exits": SystemExit(3),
    "nothing": lambda P, q, G, h: None,
    "a tuple": lambda P, q, G, h: (*enumerated_minimum(P, q, G, h), 3),
    "x is nothing": lambda P, q, G, h: answered(P, q, G, h, x=lambda x: None),
    "x is a list": lambda P, q, G, h: answered(P, q, G, h, x=list),
    "x is a number": lambda P, q, G, h: answered(P, q, G, h, x=lambda x: float(x[0])),
    "x is 0-d": lambda P, q, G, h: answered(P, q, G, h, x=lambda x: np.array(x[0])),
    "x is empty": lambda P, q, G, h: answered(P, q, G, h, x=lambda x: x[:0]),
    "x is too short": lambda P, q, G, h: answered(P, q, G, h, x=lambda x: x[:-1]),
    "x is too long": lambda P, q, G, h: answered(P, q, G, h, x=lambda x: np.append(x, 0.0)),
    "x is a row": lambda P, q, G, h: answered(P, q, G, h, x=lambda x: x[None]),
    "x is a column": lambda P, q, G, h: answered(P, q, G, h, x=lambda x: x[:, None]),
    "x is a matrix": lambda P, q, G, h: answered(P, q, G, h, x=lambda x: x.view(np.matrix)),
    "x is masked": lambda P, q, G, h: answered(
        P, q, G, h, x=lambda x: np.ma.masked_array(x, mask=True)
    ),
    "x is complex": lambda P, q, G, h: answered(P, q, G, h, x=lambda x: x + 0j),
    "x is of objects": lambda P, q, G, h: answered(P, q, G, h, x=lambda x: x.astype(object)),
    "x is of words": lambda P, q, G, h: answered(P, q, G, h, x=lambda x: x.astype(str)),
    "x is of integers": lambda P, q, G, h: answered(
        P, q, G, h, x=lambda x: np.zeros(x.size, dtype=int)
    ),
    "x is of truths": lambda P, q, G, h: answered(P, q, G, h, x=lambda x: x > 0.0),
    "x is not finite": lambda P, q, G, h: answered(
        P, q, G, h, x=lambda x: np.append(x[:-1], -np.inf)
    ),
    "x is huge": lambda P, q, G, h: answered(P, q, G, h, x=lambda x: np.full(x.size, 1e300)),
    "x is huger": lambda P, q, G, h: answered(P, q, G, h, x=lambda x: np.full(x.size, -1.7e308)),
    "multipliers are nothing": lambda P, q, G, h: answered(P, q, G, h, multipliers=lambda y: None),
    "multipliers are too short": lambda P, q, G, h: answered(
        P, q, G, h, multipliers=lambda y: y[1:]
    ),
    "multipliers are a column": lambda P, q, G, h: answered(
        P, q, G, h, multipliers=lambda y: y[:, None]
    ),
    "multipliers are complex": lambda P, q, G, h: answered(
        P, q, G, h, multipliers=lambda y: y + 0j
    ),
    "multipliers are huge": lambda P, q, G, h: answered(
        P, q, G, h, multipliers=lambda y: y + 1e300
    ),
    "x and multipliers swapped": lambda P, q, G, h: Answer(
        *enumerated_minimum(P, q, G, h)[::-1], 3
    ),
    "iterations are nothing": lambda P, q, G, h: Answer(*enumerated_minimum(P, q, G, h), None),
    "iterations are no number": lambda P, q, G, h: Answer(*enumerated_minimum(P, q, G, h), np.nan),
    "iterations are many": lambda P, q, G, h: Answer(*enumerated_minimum(P, q, G, h), np.arange(3)),
    "iterations are negative": lambda P, q, G, h: Answer(*enumerated_minimum(P, q, G, h), -1),
    "writes into the question": lambda P, q, G, h: overwriting(P, q, G, h),
}


def answered(P, q, G, h, x=lambda x: x, multipliers=lambda y: y):
    """The right answer, but for its form."""
    found = enumerated_minimum(P, q, G, h)
    return Answer(x(found[0]), multipliers(found[1]), 3)


def overwriting(P, q, G, h):
    """Change the question so that the answer is right."""
    q[:] = 0.0
    h[:] = 1.0
    P[:] = np.eye(q.size)
    G *= -1.0
    return Answer(np.zeros(q.size), np.zeros(h.size), 3)


def negative_multipliers(P, q, G, h):
    """Stationary and feasible, but pulled back by a row: the signs are wrong."""
    row = int(np.argmax(h - G @ np.linalg.solve(P, -q)))  # the row that is met best is made active
    system = np.block([[P, G[[row]].T], [G[[row]], np.zeros((1, 1))]])
    solution = np.linalg.solve(system, np.append(-q, h[row]))
    multipliers = np.zeros(h.size)
    multipliers[row] = solution[-1]
    return solution[:-1], multipliers


def row_ignored(P, q, G, h):
    """The exact minimum of the program without the row that matters most."""
    _, multipliers = enumerated_minimum(P, q, G, h)
    kept = np.arange(h.size) != np.argmax(multipliers)
    x, others = enumerated_minimum(P, q, G[kept], h[kept])
    multipliers = np.zeros(h.size)
    multipliers[kept] = others
    return x, multipliers


# --- the answers ---


@pytest.mark.parametrize("name", SOLVERS)
def test_answers_are_those_of_enumeration(name):
    solver = make_solver(name)
    active = 0
    for seed in range(40):
        problem = quadratic_program(seed)
        x, multipliers = enumerated_minimum(*problem)
        answer = solver.solve(*problem)
        # The answer's error is that of its optimality conditions times the condition number of P,
        # below 100 here.
        np.testing.assert_allclose(answer.x, x, atol=100.0 * solver.tolerance)
        np.testing.assert_allclose(answer.multipliers, multipliers, atol=1000.0 * solver.tolerance)
        assert optimality_errors(*problem, answer.x, answer.multipliers).worst <= solver.tolerance
        active += (multipliers > 1e-3).any()
    assert active >= 20  # or the rows would hardly have been tested


@pytest.mark.parametrize("name", NATIVE)
def test_iterations_are_counted(name):
    answer = make_solver(name).solve(np.eye(2), np.zeros(2), -np.eye(2), -np.ones(2))
    np.testing.assert_allclose(answer.x, [1.0, 1.0], atol=1e-6)
    assert answer.iterations >= 1


@pytest.mark.parametrize("name", SOLVERS)
def test_without_rows_the_minimum_is_free(name):
    P, q, G, h = quadratic_program(3)
    answer = make_solver(name).solve(P, q, G[:0], h[:0])
    np.testing.assert_allclose(P @ answer.x, -q, atol=1e-12)
    assert answer.multipliers.shape == (0,)


@pytest.mark.parametrize("name", SOLVERS)
def test_contradicting_rows_have_no_answer(name):
    solver = make_solver(name)
    G = np.array([[1.0, 0.0], [-1.0, 0.0]])
    with pytest.raises(SolverError) as raised:
        solver.solve(np.eye(2), np.zeros(2), G, np.array([-1.0, -1.0]))
    assert name in str(raised.value)
    assert isinstance(raised.value, Infeasible) == solver.recognises_infeasibility


def test_infeasibility_is_recognised_by_the_exact_solvers():
    assert [name for name in SOLVERS if make_solver(name).recognises_infeasibility] == [
        "daqp",
        "quadprog",
    ]


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("entry", range(4))
def test_a_solver_never_sees_a_number_that_is_not_finite(name, number, entry, monkeypatch):
    solver = make_solver(name)
    attempt = lying(LIES["garbage"])
    monkeypatch.setattr(type(solver), "attempt", attempt)
    problem = [array.copy() for array in quadratic_program(0)]
    problem[entry].flat[-1] = number
    with pytest.raises(InvalidInput, match=rf"^{'PqGh'[entry]} .*not finite"):
        solver.solve(*problem)
    assert attempt.calls == 0


@pytest.mark.parametrize("name", SOLVERS)
def test_inputs_are_left_as_they_were(name):
    problem = quadratic_program(5)
    before = [array.copy() for array in problem]
    make_solver(name).solve(*problem)
    for array, copy in zip(problem, before, strict=True):
        np.testing.assert_array_equal(array, copy)


# --- the check ---


def test_the_optimum_has_no_errors_and_a_change_of_scale_changes_none():
    P, q, G, h = quadratic_program(1)
    x, multipliers = enumerated_minimum(P, q, G, h)
    assert optimality_errors(P, q, G, h, x, multipliers).worst < 1e-13
    x = x + 0.01
    multipliers = multipliers - 0.02
    errors = optimality_errors(P, q, G, h, x, multipliers)
    rows = np.array([1e-6, 1.0, 1e3, 1e8, 1.0, 1e-2])
    cost = 1e8
    unit = 1e-5
    scaled = optimality_errors(
        cost * P / unit**2,
        cost * q / unit,
        rows[:, None] * G / unit,
        rows * h,
        unit * x,
        cost * multipliers / rows,
    )
    for name in ("rows", "stationarity", "sign", "complementarity"):
        assert getattr(scaled, name) == pytest.approx(getattr(errors, name), rel=1e-9), name


def test_each_condition_is_checked():
    P = np.eye(2)
    q = np.array([-2.0, 0.0])
    G = np.array([[1.0, 0.0], [0.0, 1.0]])
    h = np.array([1.0, 5.0])
    x = np.array([1.0, 0.0])
    multipliers = np.array([1.0, 0.0])
    assert optimality_errors(P, q, G, h, x, multipliers).worst == 0.0
    # The size of this problem is ‖q‖ = 2.
    exceeded = optimality_errors(P, q, G, h, np.array([1.3, 0.0]), np.array([0.7, 0.0]))
    assert exceeded.rows == pytest.approx(0.3 / (2.0 + 1.0))
    assert exceeded.stationarity == pytest.approx(0.0, abs=1e-15)
    assert optimality_errors(
        P, q, G, h, np.array([0.5, 0.0]), multipliers
    ).stationarity == pytest.approx(0.25)
    backwards = optimality_errors(P, -q, G, h, x, np.array([-3.0, 0.0]))
    assert (backwards.sign, backwards.stationarity) == (pytest.approx(1.5), 0.0)
    loose = optimality_errors(P, np.array([-2.0, -1.0]), G, h, x, np.array([1.0, 1.0]))
    # λ = 1 at a distance of 5, in units of ‖q‖² = 5
    assert loose.complementarity == pytest.approx(5.0 / 5.0)


def test_a_problem_whose_data_are_all_zero_has_a_size():
    zero = np.zeros(2)
    errors = optimality_errors(np.eye(2), zero, np.eye(2), zero, zero, zero)
    assert errors.worst == 0.0
    assert (
        optimality_errors(np.eye(2), zero, np.eye(2), zero, np.array([0.1, 0.0]), zero).worst > 0.1
    )
    with_zero_row = optimality_errors(
        np.eye(2), zero, np.zeros((1, 2)), np.zeros(1), zero, np.zeros(1)
    )
    assert with_zero_row.worst == 0.0


# --- solvers that lie, fail or are missing ---


@pytest.mark.parametrize("lie", LIES)
def test_a_lie_is_found_and_another_solver_asked(lie, monkeypatch):
    problem = quadratic_program(7)
    x, multipliers = enumerated_minimum(*problem)
    assert (multipliers > 0.1).any()  # the rows matter, or the free minimum would be no lie
    monkeypatch.setattr(DaqpSolver, "attempt", lying(LIES[lie]))
    chain = SolverChain("daqp")
    verified = chain.solve(*problem)
    assert verified.solver == "proxqp"
    np.testing.assert_allclose(verified.answer.x, x, atol=1e-6)
    assert verified.fallback
    if isinstance(LIES[lie], BaseException):
        assert str(LIES[lie]) in verified.fallback
    else:
        assert "daqp" in verified.fallback
    assert chain.failures == {"daqp": 1}
    chain.reset()
    assert not chain.failures


def test_an_answer_is_kept_though_the_solver_goes_on_writing(monkeypatch):
    problem = quadratic_program(7)
    kept = np.zeros(3)

    def attempt(self, P, q, G, h):
        x, multipliers = enumerated_minimum(P, q, G, h)
        kept[:] = x
        return Answer(kept, multipliers, 1)

    monkeypatch.setattr(DaqpSolver, "attempt", attempt)
    answer = SolverChain("daqp").solve(*problem).answer
    kept[:] = 7.0
    np.testing.assert_allclose(answer.x, enumerated_minimum(*problem)[0])


def test_fallbacks_are_asked_in_the_documented_order(monkeypatch):
    problem = quadratic_program(7)
    asked = []

    def refusing(self, P, q, G, h):
        asked.append(self.name)
        raise SolverError(f"{self.name} is on strike")

    for back_end in (*NATIVE.values(), QpsolversSolver):
        monkeypatch.setattr(back_end, "attempt", refusing)
    chain = SolverChain("quadprog")
    with pytest.raises(SolverError) as raised:
        chain.solve(*problem)
    assert FALLBACKS == ("daqp", "proxqp", "osqp", "quadprog")
    assert asked == ["quadprog", *FALLBACKS[:-1]]
    for name in asked:
        assert f"{name} is on strike" in str(raised.value)
    assert chain.failures == dict.fromkeys(asked, 1)
    asked.clear()
    with pytest.raises(SolverError):
        SolverChain("osqp").solve(*problem)
    assert asked == ["osqp", "daqp", "proxqp", "quadprog"]


def test_a_fallback_that_cannot_be_imported_is_passed_over(monkeypatch):
    monkeypatch.setattr(DaqpSolver, "attempt", lying(LIES["garbage"]))
    monkeypatch.setitem(sys.modules, "proxsuite", None)
    verified = SolverChain("daqp").solve(*quadratic_program(7))
    assert verified.solver == "osqp"
    assert "proxsuite" in verified.fallback


def test_an_honest_solver_needs_no_fallback():
    chain = SolverChain("daqp")
    verified = chain.solve(*quadratic_program(7))
    assert (verified.solver, verified.fallback, dict(chain.failures)) == ("daqp", "", {})


@pytest.mark.parametrize(
    ("name", "module", "install"),
    [
        ("quadprog", "quadprog", 'pip install "vsconstraints[quadprog]"'),
        ("daqp", "daqp", "pip install daqp"),
        ("proxqp", "proxsuite", "pip install proxsuite"),
        ("osqp", "osqp", "pip install osqp"),
    ],
)
def test_a_solver_that_is_not_installed_is_told_at_construction(name, module, install, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ConfigurationError) as raised:
        HierarchicalQP(solver=name)
    assert install in str(raised.value)
    assert repr(name) in str(raised.value)


def test_a_solver_that_qpsolvers_would_reach_is_told_with_its_command(monkeypatch):
    monkeypatch.setattr("vsconstraints.qp.backends.solver_names", lambda: ("daqp",))
    with pytest.raises(
        ConfigurationError,
        match=r"'clarabel' is not installed.*pip install \"qpsolvers\[clarabel\]\"",
    ):
        HierarchicalQP(solver="clarabel")


def test_a_package_that_is_broken_is_as_good_as_missing(monkeypatch):
    def broken(name):
        raise AttributeError("_ARRAY_API not found")

    monkeypatch.setattr("vsconstraints.qp.solver.import_module", broken)
    with pytest.raises(ConfigurationError, match=r"_ARRAY_API not found.*pip install daqp"):
        HierarchicalQP(solver="daqp")


def test_an_unknown_solver_is_told_with_the_candidates():
    with pytest.raises(ConfigurationError) as raised:
        HierarchicalQP(solver="daqq")
    for expected in ("QP solver 'daqq'", "Did you mean 'daqp'?", *SOLVERS):
        assert expected in str(raised.value)


def test_names_include_what_can_be_installed_and_what_is():
    assert set(SOLVERS) <= set(solver_names())
    assert list(solver_names()) == sorted(solver_names())


def test_native_solvers_are_not_reached_through_a_layer():
    for name, back_end in NATIVE.items():
        assert type(make_solver(name)) is back_end
        assert back_end.name == name


def test_tolerances_are_stated_and_tight():
    assert {name: make_solver(name).tolerance for name in SOLVERS} == {
        "daqp": 1e-8,
        "quadprog": 1e-8,
        "proxqp": 1e-7,
        "clarabel": 1e-7,
        "osqp": 1e-6,
    }


def test_osqp_is_polished():
    for seed in range(10):
        problem = quadratic_program(seed)
        answer = make_solver("osqp").solve(*problem)
        assert optimality_errors(*problem, answer.x, answer.multipliers).worst < 1e-12


# --- repetition ---


@pytest.mark.parametrize("name", ["daqp", "quadprog", "osqp", "clarabel"])
def test_solvers_without_memory_repeat_themselves(name):
    solver = make_solver(name)
    first = [solver.solve(*quadratic_program(seed)).x for seed in range(5)]
    for seed in reversed(range(5)):
        np.testing.assert_array_equal(solver.solve(*quadratic_program(seed)).x, first[seed])


def test_proxqp_repeats_itself_to_rounding():
    # Not bit by bit: where its memory happens to lie decides the order of its sums.
    solver = ProxqpSolver()
    first = [solver.solve(*quadratic_program(seed)).x for seed in range(5)]
    for seed in reversed(range(5)):
        np.testing.assert_allclose(solver.solve(*quadratic_program(seed)).x, first[seed], atol=1e-8)


# --- statements of problems ---


def test_equilibration_changes_the_scale_and_not_the_answer():
    P, q, G, h = quadratic_program(9)
    G = G * np.array([1.0, 1e4, 1e-3])
    x, multipliers = enumerated_minimum(P, q, G, h)
    scaled = equilibrate(P, q, G, h)
    np.testing.assert_allclose(np.linalg.norm(scaled.G, axis=1), 1.0)
    z, scaled_multipliers = enumerated_minimum(scaled.P, scaled.q, scaled.G, scaled.h)
    found = scaled.original(z, scaled_multipliers)
    np.testing.assert_allclose(found[0], x, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(found[1], multipliers, rtol=1e-8, atol=1e-12)


def test_equilibration_leaves_zero_columns_and_rows_alone():
    G = np.array([[2.0, 0.0], [0.0, 0.0]])
    scaled = equilibrate(np.eye(2), np.zeros(2), G, np.ones(2))
    np.testing.assert_array_equal(scaled.columns, [0.5, 1.0])
    np.testing.assert_array_equal(scaled.rows, [1.0, 1.0])


def test_scaled_rows_have_unit_norm_and_a_unit_distance():
    rng = np.random.default_rng(0)
    G = 1e5 * rng.normal(size=(6, 3))
    h = 1e5 * rng.normal(size=6)
    scaled = scale(G, h)
    np.testing.assert_allclose(np.linalg.norm(scaled.G, axis=1), 1.0)
    assert scaled.h.min() == pytest.approx(-1.0)
    u = rng.normal(size=3)
    expected = (h - G @ (scaled.size * u)) / np.linalg.norm(G, axis=1) / scaled.size
    np.testing.assert_allclose(scaled.h - scaled.G @ u, expected, atol=1e-12)


def test_the_size_is_zero_where_no_row_excludes_the_origin():
    assert scale(np.eye(2), np.zeros(2)).size == 0.0
    assert scale(np.empty((0, 2)), np.empty(0)).size == 0.0


# --- level 1 ---

LOST = 1e-7
"""Fraction of the largest term below which a violation may be lost where rows differ most."""


def least_violation(A, c, weights, start, box=None):
    """The minimiser (n,) that the compiled descent reaches from a start."""
    box = box_of(len(start), np.inf) if box is None else box
    x = np.clip(start, *box)
    assert load("level_by_level").violate_least(A, c, weights, np.ascontiguousarray(box), x) == 0
    return x


def box_of(n, bound):
    """(2, n) least and greatest x with |x| ≤ bound."""
    return np.array([[-bound], [bound]]) * np.ones(n)


@pytest.mark.parametrize("bound", [np.inf, 0.4], ids=["free", "box"])
@pytest.mark.parametrize("kind", ["random", "feasible", "opposite", "duplicate", "scaled", "many"])
def test_the_least_violation_is_stationary_and_unique(kind, bound):
    relaxed = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(1, 9))
        m = int(rng.integers(1, 20))
        m = 80 if kind == "many" else m
        A = rng.normal(size=(m, n))
        c = rng.normal(size=m)
        weights = rng.uniform(0.5, 2.0, m)
        if kind == "feasible":
            c = A @ rng.uniform(-0.4, 0.4, n) + rng.uniform(0.0, 0.1, m)
        elif kind == "opposite":
            A = np.vstack([A, -A])
            c = np.concatenate([c, -c - 0.1])
            weights = np.ones(2 * m)
        elif kind == "duplicate":
            A = np.vstack([A, A])
            c = np.concatenate([c, c])
            weights = np.ones(2 * m)
        elif kind == "scaled":
            weights = 10.0 ** rng.uniform(-2.0, 2.0, m)
        found = []
        for start in (np.zeros(n), rng.normal(size=n), 10.0 * rng.normal(size=n)):
            x = least_violation(A, c, weights, start, box_of(n, bound))
            assert (np.abs(x) <= bound).all()
            violation = np.maximum(A @ x - c, 0.0)
            gradient = A.T @ (weights**2 * violation)
            # In the box: only what the bound holds back is left of the gradient, and it points
            # outward.
            held = np.abs(x) == bound
            # Violations below 1e-12 are the rounding of rows that are met.
            allowed = (
                np.linalg.norm(weights**2) * np.linalg.norm(A) * (1e-9 * violation.max() + 1e-12)
            )
            assert np.abs(gradient[~held]).max(initial=0.0) <= allowed
            assert (gradient[held] * np.sign(x[held])).max(initial=-1.0) <= allowed
            found.append(weights * violation)
        for other in found[1:]:
            np.testing.assert_allclose(other, found[0], atol=1e-8 * (1.0 + np.abs(found[0]).max()))
        if kind == "feasible":
            assert found[0].max() <= 1e-9
        relaxed += found[0].max() > 1e-6
    assert kind == "feasible" or relaxed >= 5


def badly_scaled(seed, decades):
    """Rows of norms up to 10^(2 decades) apart, in every third problem nearly repeated, and two
    starts.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 9))
    m = int(rng.integers(1, 30))
    A = rng.normal(size=(m, n))
    scale = 10.0 ** rng.uniform(-decades, decades, m)
    A = A * scale[:, None]
    c = rng.normal(size=m) * scale
    if seed % 3 == 0:
        A = np.vstack([A, A * (1.0 + 1e-9 * rng.normal(size=A.shape))])
        c = np.concatenate([c, c])
    return A, c, (rng.normal(size=n) * 10.0 ** rng.uniform(0.0, 4.0), np.zeros(n))


@pytest.mark.parametrize("bound", [np.inf, 0.5], ids=["free", "box"])
@pytest.mark.parametrize(("decades", "accuracy"), [(2, 1e-9), (3, 1e-8), (4, 1e-6), (5, 1e-5)])
def test_badly_scaled_rows_lose_accuracy_only_as_rounding_demands(decades, accuracy, bound):
    # Some rows are nearly equal; the last eight seeds made rounding cycle in a corner of the box.
    # With scales up to 1e8 apart, a row of large scale need be exceeded by no more than its
    # rounding to hold those of small scale.
    for seed in (*range(60), 226, 237, 253, 436, 514, 936, 1130, 2180):
        A, c, starts = badly_scaled(seed, decades)
        values = []
        for start in starts:
            x = least_violation(A, c, np.ones(len(c)), start, box_of(len(start), bound))
            values.append(np.linalg.norm(np.maximum(A @ x - c, 0.0)))
        assert values[0] == pytest.approx(values[1], rel=1e-9, abs=accuracy * np.abs(c).max()), seed


@pytest.mark.parametrize(("decades", "lost"), [(3, 1e-10), (5, LOST)])
def test_the_least_violation_is_that_of_rational_arithmetic(decades, lost):
    """Rows of norms up to 1e10 apart; 58: a large row that is just met held up every step."""
    relaxed = 0
    for seed in (*range(12), 58, 151):
        A, c, starts = badly_scaled(seed, decades)
        x, least = exact_least_violation(A, c)
        terms = np.linalg.norm(A, axis=1) * np.linalg.norm(np.array(x, dtype=float)) + np.abs(c)
        for start in starts:
            found = violation_norm(A, c, least_violation(A, c, np.ones(len(c)), start))
            assert found <= (1.0 + 1e-9) * least + lost * terms.max(), (seed, found, least)
        relaxed += least > 1e-6
    assert relaxed >= 5


def test_the_least_violation_of_two_opposite_rows_is_their_weighted_mean():
    # x ≤ −1 and −x ≤ −1: 2²(x + 1)² + (1 − x)² is least at x = −3/5.
    A = np.array([[1.0], [-1.0]])
    c = np.array([-1.0, -1.0])
    x = least_violation(A, c, np.array([2.0, 1.0]), np.array([4.0]))
    assert x[0] == pytest.approx(-0.6, abs=1e-14)
    assert least_violation(A, c, np.array([2.0, 1.0]), np.array([4.0]), box_of(1, 0.25))[0] == -0.25


def test_the_least_violation_releases_what_the_box_should_not_hold():
    # From the corner (1, 1) the first coordinate must come back in, the second stays.
    A = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, -1.0]])
    c = np.array([-0.5, 0.4, -3.0])
    x = least_violation(A, c, np.ones(3), np.array([9.0, 9.0]), box_of(2, 1.0))
    np.testing.assert_allclose(x, [-0.45, 1.0], atol=1e-14)


def test_a_new_solver_needs_a_name_and_an_attempt():
    class Enumerating(QPSolver):
        name = "enumerating"

        def attempt(self, P, q, G, h):
            return Answer(*enumerated_minimum(P, q, G, h), 1)

    problem = quadratic_program(4)
    answer = Enumerating().solve(*problem)
    assert optimality_errors(*problem, answer.x, answer.multipliers).worst < 1e-12
    wrong = replace(answer, x=answer.x + 1e-4)
    assert optimality_errors(*problem, wrong.x, wrong.multipliers).worst > QPSolver.tolerance
