"""The box of q̈ that rows may state: which laws keep it exactly, what becomes of others, and what
is refused.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from test_laws import EACH, compiled, made, problem
from vsconstraints.controllers import (
    Additive,
    Barrier,
    Controller,
    Filter,
    Hierarchy,
    Law,
    Priority,
    Saturation,
    SaturationExact,
    Scaling,
    Tracking,
)
from vsconstraints.errors import InvalidInput
from vsconstraints.rows import Command

NEVER = np.full(6, np.inf)


def boxed(seed, n=6):
    """Rows with a box, in which some joints have no bound and some must move; and the task."""
    rows, task = problem(seed, n=n)
    rng = np.random.default_rng([seed, 1])
    middle = rng.normal(scale=0.5, size=n)
    half = rng.uniform(0.0, 0.5, n)
    low = middle - half
    high = middle + half
    return replace(
        rows,
        qdd_min=np.where(rng.random(n) < 0.2, -np.inf, low),
        qdd_max=np.where(rng.random(n) < 0.2, np.inf, high),
    ), task


@pytest.mark.parametrize(("demand", "resolver"), EACH)
def test_no_law_leaves_the_box(demand, resolver):
    law = made(demand, resolver)
    saturated = 0
    for seed in range(30):
        rows, task = boxed(seed)
        for command in (law.define(rows, task), law.command(rows, task)):
            assert command.status != "failed", command.reason
            assert (rows.qdd_min <= command.qdd).all()
            assert (command.qdd <= rows.qdd_max).all()
            at_end = (command.qdd == rows.qdd_min) | (command.qdd == rows.qdd_max)
            assert command.saturated.shape == (6,)
            assert (command.saturated | ~at_end).all()
            saturated += command.saturated.any()
    assert saturated > 30


@compiled
@pytest.mark.parametrize(("demand", "resolver"), EACH)
def test_both_forms_keep_it_alike(demand, resolver):
    law = made(demand, resolver)
    other = made(demand, resolver)
    for seed in range(30):
        rows, task = boxed(seed)
        expected = other.define(rows, task)
        command = law.compute(rows, task)
        if command is None:
            assert expected.status == "rank-loss"
            continue
        np.testing.assert_allclose(
            command.qdd, expected.qdd, rtol=0.0, atol=1e-7 * (1.0 + np.abs(expected.qdd).max())
        )
        assert command.status == expected.status


@pytest.mark.parametrize(("demand", "resolver"), EACH)
def test_a_box_that_holds_nothing_back_changes_no_bit(demand, resolver):
    for seed in range(10):
        rows, task = problem(seed)
        wide = replace(rows, qdd_min=-NEVER, qdd_max=NEVER)
        for form in ("define", "command"):
            free = getattr(made(demand, resolver), form)(rows, task)
            same = None
            same = getattr(made(demand, resolver), form)(wide, task)
            np.testing.assert_array_equal(same.qdd, free.qdd)
            assert not same.saturated.any()
            assert free.saturated.shape == (0,)


@pytest.mark.parametrize(
    "resolver",
    [
        Hierarchy(),
        Filter(),
        Filter(metric="task"),
        Saturation(),
        Saturation(scales=False),
        SaturationExact(),
        Scaling(),
        Hierarchy(solver="daqp"),
        Hierarchy(max_acceleration=0.3),
    ],
)
def test_rows_are_met_within_the_box_where_that_can_be(resolver):
    """Where a linear program finds q̈ in the box that meets all demands, the command does; else it
    says which it does not.
    """
    from scipy.optimize import linprog

    law = Law(Barrier(5.0), resolver)
    met = 0
    for seed in range(60):
        rows, task = boxed(seed)
        rows = replace(rows, phi=rows.phi - 0.3)
        low, high = resolver.box(rows, 6)
        found = linprog(
            np.zeros(6),
            rows.Lg,
            -5.0 * rows.phi - rows.Lf,
            bounds=list(zip(low, high, strict=True)),
        )
        command = law.command(rows, task)
        assert (command.qdd >= low).all()
        assert (command.qdd <= high).all()
        excess = (rows.Lg @ command.qdd + rows.Lf + 5.0 * rows.phi).max()
        assert (command.status == "relaxed") == (found.status == 2), (
            seed,
            command.status,
            found.message,
        )
        if found.status == 0:
            met += 1
            assert excess <= 1e-7
        else:
            assert any(label in command.reason for label in rows.labels)
    assert 10 <= met <= 55


def test_an_option_and_the_rows_are_both_kept_or_the_rows_win():
    rows, task = problem(0, m=0)
    rows = replace(
        rows, qdd_min=np.array([-1.0, -9.0, 2.0, -9.0, -9.0, -9.0]), qdd_max=np.full(6, 5.0)
    )
    box = Hierarchy(max_acceleration=1.5).box(rows, 6)
    np.testing.assert_array_equal(
        box, [[-1.0, -1.5, 2.0, -1.5, -1.5, -1.5], [1.5, 1.5, 2.0, 1.5, 1.5, 1.5]]
    )
    command = Law(Barrier(), Hierarchy(max_acceleration=1.5)).command(
        rows, replace(task, b=100.0 * task.b)
    )
    assert command.qdd[2] == 2.0
    assert command.saturated[2]


class Own(Controller):
    """A law that knows nothing of boxes."""

    name = "own"

    def solve(self, rows, task):
        return Command(np.full(6, 3.0), "ok", np.zeros(5, dtype=bool), rows.labels)


def test_a_law_of_ones_own_is_brought_into_the_box():
    rows, task = boxed(0)
    rows.qdd_max[:] = [1.0, 2.0, 3.0, 4.0, np.inf, np.inf]
    rows.qdd_min[:] = [-np.inf, 0.0, 0.0, -1.0, 5.0, -np.inf]
    command = Own().command(rows, task)
    np.testing.assert_array_equal(command.qdd, [1.0, 2.0, 3.0, 3.0, 5.0, 3.0])
    np.testing.assert_array_equal(command.saturated, [True, True, True, False, True, False])


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (np.zeros(5), np.ones(6), "must both be"),
        (np.empty(0), np.ones(6), "must both be"),
        (np.zeros(6), np.empty(0), "must both be"),
        (
            np.zeros(6),
            np.array([1, 1, -1.0, 1, 1, 1]),
            r"leave no acceleration: joint 3: \[0, -1\]",
        ),
        (np.zeros(6), np.array([1, np.nan, 1, 1, 1, 1]), "joint 2"),
        (np.full(6, np.nan), np.ones(6), "joint 1"),
        (NEVER, NEVER, "joint 1"),
        (np.zeros(6, dtype=int), np.ones(6), "array of floats"),
    ],
)
@pytest.mark.parametrize(
    "resolver", [Priority(), Additive(), Hierarchy(), Filter()], ids=lambda r: r.name
)
def test_a_box_that_is_none_is_refused(resolver, low, high, said):
    rows, task = problem(0)
    for law in (Law(Barrier(), resolver), Tracking(), Own()):
        with pytest.raises(InvalidInput, match=said):
            law.command(replace(rows, qdd_min=low, qdd_max=high), task)


def test_strided_and_read_only_boxes_are_taken_as_they_are():
    rows, task = boxed(3)
    law = Law(Barrier(), Hierarchy())
    expected = law.command(rows, task).qdd
    wide = np.repeat(np.array([rows.qdd_min, rows.qdd_max]), 2, axis=1)[:, ::2]
    wide.setflags(write=False)
    np.testing.assert_array_equal(
        law.command(replace(rows, qdd_min=wide[0], qdd_max=wide[1]), task).qdd, expected
    )
