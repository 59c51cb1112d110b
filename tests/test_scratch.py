"""Scratch of compiled functions: matrices that do not meet, and laws that do without."""

from __future__ import annotations

import numpy as np
import pytest

from vsconstraints.compiled import load
from vsconstraints.controllers import (
    HierarchicalQP,
    PotentialField,
    SlidingMode,
    Tracking,
    compiled,
)
from vsconstraints.controllers.base import Controller
from vsconstraints.rows import Rows, Task

pytestmark = pytest.mark.skipif(load("laws") is None, reason="there is no compiler")


def taken(room: int, shapes: list[tuple[int, int]]) -> tuple[np.ndarray, int, list[np.ndarray]]:
    """The scratch after matrices of these shapes were taken and filled with 1, 2, …, what is taken,
    and copies.
    """
    scratch = load("scratch")
    structures = load("workspace")
    given = structures.Scratch(np.full(room, -1.0), np.zeros(1, dtype=np.int64))
    numba = load("compiler").numba

    @numba.njit
    def fill(scratch_of, shape, value, zero):  # type: ignore[no-untyped-def]
        part = scratch.blank(scratch_of, *shape) if zero else scratch.matrix(scratch_of, *shape)
        before = part.copy()
        part[:] = value
        return part.copy(), before

    copies = []
    for value, shape in enumerate(shapes, 1):
        part, before = fill(given, shape, float(value), value % 2 == 0)
        assert part.shape == shape
        assert (part == value).all()
        if value % 2 == 0:
            assert (before == 0.0).all()
        copies.append(part)
    return given.numbers, int(given.taken[0]), copies


def test_matrices_stand_one_behind_the_other():
    numbers, count, _ = taken(20, [(2, 3), (1, 4), (0, 5), (3, 2)])
    assert count == 16
    np.testing.assert_array_equal(numbers, [*[1.0] * 6, *[2.0] * 4, *[4.0] * 6, *[-1.0] * 4])


def test_what_has_no_room_is_made_and_leaves_the_rest_alone():
    numbers, count, _ = taken(7, [(2, 2), (2, 2), (1, 3)])
    assert count == 7
    np.testing.assert_array_equal(numbers, [*[1.0] * 4, *[3.0] * 3])
    numbers, count, _ = taken(0, [(2, 2), (2, 2)])
    assert count == 0


@pytest.mark.parametrize("room", [0, 50, 200])
@pytest.mark.parametrize("make", [SlidingMode, Tracking, PotentialField, HierarchicalQP])
def test_laws_with_little_scratch_answer_bit_by_bit_as_with_enough(make, room, monkeypatch):
    random = np.random.default_rng(7)
    problems = [
        problem(random, m, n, k)
        for m in (1, 4, 9)
        for n in (3, 6, 7)
        for k in (2, 6, 8)
        for _ in range(3)
    ]
    enough = [answers(make(), *each) for each in problems]
    monkeypatch.setattr(compiled, "SCRATCH", room)
    for (rows, task), (qdd, acted) in zip(problems, enough, strict=True):
        again, also = answers(make(), rows, task)
        np.testing.assert_array_equal(again, qdd)
        np.testing.assert_array_equal(also, acted)


def problem(random: np.random.Generator, m: int, n: int, k: int) -> tuple[Rows, Task]:
    """Random rows, half of them violated, and a task that may have lost ranks."""
    J = random.normal(size=(k, n))
    if random.random() < 0.3:
        J[-1] = J[0]
    rows = Rows(
        phi=random.normal(size=m),
        Lg=random.normal(size=(m, n)),
        Lf=random.normal(size=m),
        switching_gain=np.full(m, 2.0),
        labels=tuple(f"row {i}" for i in range(m)),
        scale=np.ones(m),
    )
    return rows, Task(J, random.normal(size=k))


def answers(law: Controller, rows: Rows, task: Task) -> tuple[np.ndarray, np.ndarray]:
    """Two commands, since the second one finds the scratch as the first one left it."""
    law.command(rows, task)
    command = law.command(rows, task)
    return command.qdd, command.acted
