"""The laws of eq. (15) by their compiled functions, where there are any."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ..kernels import load
from ..kernels.entry import entry
from ..rows import ARRAYS, Array, BoolArray, Command, Rows, Status, Task

BOOL, EMPTY = np.dtype(np.bool_), np.empty
"""Looked up once: that takes a third of the time of making a small array."""

NOT_FOR_COMPILED = Exception
"""Raised for arrays of other types, layouts or numbers of dimensions, some of them errors of numba's own: those are for
the definition, which answers, or says what is wrong."""


class Draft:
    """A command in the making, of the same slots: filling a frozen one takes longer than computing it.

    It becomes one by ``draft.__class__ = Command``.
    """

    __slots__ = Command.__slots__

    def __init__(
        self,
        qdd: Array,
        status: Status,
        acted: BoolArray,
        labels: tuple[str, ...],
        reason: str = "",
        slack: Array | None = None,
        solver: str = "",
        iterations: int = 0,
    ) -> None:
        self.qdd = qdd
        self.status = status
        self.acted = acted
        self.labels = labels
        self.reason = reason
        self.slack = slack
        self.solver = solver
        self.iterations = iterations
        self.fallback = self.remark = ""


def in_usual_layout(rows: object, task: object) -> tuple[Rows, Task] | None:
    """The same rows and task in plain contiguous, writable arrays; None if they are so, or if something is wrong."""
    if not (isinstance(rows, Rows) and isinstance(task, Task)):
        return None
    arrays = [rows.phi, rows.Lg, rows.Lf, rows.switching_gain, rows.scale, task.J, task.b]
    if not all(type(array) in ARRAYS and array.dtype == np.float64 for array in arrays):
        return None
    if all(type(array) is np.ndarray and array.flags.carray for array in arrays):
        return None
    phi, Lg, Lf, gain, scale, J, b = (np.array(array, order="C") for array in arrays)
    return Rows(phi, Lg, Lf, gain, rows.labels, scale), Task(J, b)


class BoundLaw:
    """A compiled law on arrays that stay where they are, for loops: every call overwrites what the one before wrote.

    Attributes
    ----------
    solve
        Writes ``acted`` (m,) and ``qdd`` (n,), and returns 0 if they hold the answer; if not, the controller's
        ``command`` has to be asked.
    """

    __slots__ = ("acted", "labels", "qdd", "solve")

    def __init__(self, solve: Callable[[], int], labels: tuple[str, ...], acted: BoolArray, qdd: Array) -> None:
        self.solve, self.labels, self.acted, self.qdd = solve, labels, acted, qdd

    def command(self) -> Command:
        """The last answer, in arrays of its own."""
        command: Any = Draft(self.qdd.copy(), "ok", self.acted.copy(), self.labels)
        command.__class__ = Command
        made: Command = command
        return made


def bound_law(
    rows: Rows,
    task: Task,
    acted: BoolArray,
    qdd: Array,
    rank_tolerance: float,
    law: int,
    region: float = 1.0,
    exponent: float = 1.0,
    strength: float = 1.0,
) -> BoundLaw | None:
    """The law on these arrays: see ``Controller._bind``."""
    kernels = load("task_priority")
    if kernels is None:
        return None
    solve = partial(
        entry(kernels.follow),
        len(rows.labels),
        rows.phi,
        rows.Lg,
        rows.Lf,
        rows.switching_gain,
        rows.scale,
        task.J,
        task.b,
        rank_tolerance,
        law,
        region,
        exponent,
        strength,
        acted,
        qdd,
    )
    return BoundLaw(solve, rows.labels, acted, qdd)


def compiled_command(
    rows: Rows,
    task: Task,
    rank_tolerance: float,
    law: int,
    region: float = 1.0,
    exponent: float = 1.0,
    strength: float = 1.0,
) -> Command | None:
    """The command, or None where the definition has to be asked: no compiler, bad input, or lost rank."""
    kernels = load("task_priority")
    if kernels is None:
        return None
    try:
        labels, J = rows.labels, task.J
        m = len(labels)
        acted, qdd = EMPTY(m, BOOL), EMPTY(J.shape[1])
        if kernels.follow(
            m,
            rows.phi,
            rows.Lg,
            rows.Lf,
            rows.switching_gain,
            rows.scale,
            J,
            task.b,
            rank_tolerance,
            law,
            region,
            exponent,
            strength,
            acted,
            qdd,
        ):
            return None
    except NOT_FOR_COMPILED:
        usual = in_usual_layout(rows, task)
        return usual and compiled_command(*usual, rank_tolerance, law, region, exponent, strength)
    command: Any = Draft(qdd, "ok", acted, labels)
    command.__class__ = Command
    return command  # type: ignore[no-any-return]
