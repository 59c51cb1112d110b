"""What one control step comes to: rows, task, and what was seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from .kernels.entry import entry
from .rows import Array, Rows, Task

if TYPE_CHECKING:
    from .constraints import ConstraintSet
    from .kernels.packing import Packed


class Evaluation(Protocol):
    """What one step came to; the arrays are its own."""

    @property
    def rows(self) -> Rows:
        """The rows, as a controller takes them."""

    @property
    def task(self) -> Task:
        """The task, likewise."""

    @property
    def error(self) -> Array:
        """(k,) of the visual feature."""

    @property
    def sigma(self) -> Array:
        """(m,) of each row."""

    @property
    def pixels(self) -> Array:
        """(M, 2) markers from the image's centre [px]."""

    @property
    def points(self) -> Array:
        """(p, 3) the scene's robot points in the base frame [m]."""

    @property
    def camera_R(self) -> Array:  # noqa: N802 - the pose's R
        """(3, 3) orientation of the camera in the target's frame."""

    @property
    def camera_t(self) -> Array:
        """(3,) position of the camera in the target's frame [m]."""


@dataclass(slots=True)
class DefinedEvaluation:
    """An :class:`Evaluation` by the NumPy form."""

    rows: Rows
    task: Task
    error: Array
    sigma: Array
    pixels: Array
    points: Array
    camera_R: Array
    camera_t: Array


class CompiledEvaluation:
    """An :class:`Evaluation` as the array that the compiled step writes: its parts are views, made when asked for."""

    __slots__ = ("_constraints", "_out", "_packed")

    def __init__(self, packed: Packed, constraints: ConstraintSet, out: Array) -> None:
        self._packed, self._constraints, self._out = packed, constraints, out

    @property
    def rows(self) -> Rows:
        """See :class:`Evaluation`."""
        out, packed, constraints = self._out, self._packed, self._constraints
        rows: Any = RowsDraft(
            out[packed.phi],
            out[packed.Lg].reshape(packed.m, packed.n),
            out[packed.Lf],
            constraints.switching_gain,
            constraints.labels,
            constraints.scale,
        )
        rows.__class__ = Rows
        made: Rows = rows
        return made

    @property
    def task(self) -> Task:
        """See :class:`Evaluation`."""
        out, packed = self._out, self._packed
        return Task(out[packed.J].reshape(packed.k, packed.n), out[packed.b])

    @property
    def error(self) -> Array:
        """See :class:`Evaluation`."""
        return self._out[self._packed.error]

    @property
    def sigma(self) -> Array:
        """See :class:`Evaluation`."""
        return self._out[self._packed.sigma]

    @property
    def pixels(self) -> Array:
        """See :class:`Evaluation`."""
        return self._out[self._packed.pixels].reshape(-1, 2)

    @property
    def points(self) -> Array:
        """See :class:`Evaluation`."""
        return self._out[self._packed.robot_points].reshape(-1, 3)

    @property
    def camera_R(self) -> Array:  # noqa: N802 - the pose's R
        """See :class:`Evaluation`."""
        return self._out[self._packed.camera_R].reshape(3, 3)

    @property
    def camera_t(self) -> Array:
        """See :class:`Evaluation`."""
        return self._out[self._packed.camera_t]


class RowsDraft:
    """Rows in the making, of the same slots: see :class:`vsconstraints.controllers.compiled.Draft`."""

    __slots__ = Rows.__slots__

    def __init__(
        self, phi: Array, Lg: Array, Lf: Array, switching_gain: Array, labels: tuple[str, ...], scale: Array
    ) -> None:
        self.phi, self.Lg, self.Lf = phi, Lg, Lf
        self.switching_gain, self.labels, self.scale = switching_gain, labels, scale


class Bound:
    """The compiled step on arrays that stay where they are, for loops: every sample overwrites the one before.

    Attributes
    ----------
    evaluate
        Takes time [s], q and q̇, which must be arrays of ``float64`` with one dimension, and returns 0 if ``out`` now
        holds the step; if not, the definition says what is wrong.
    out
        Everything that a step came to, as one array.
    now
        The same, by its parts.
    """

    __slots__ = ("evaluate", "now", "out", "packed")

    def __init__(self, packed: Packed, constraints: ConstraintSet, kernels: Sequence[Any]) -> None:
        self.packed = packed
        self.out = np.zeros(packed.size)
        self.now = CompiledEvaluation(packed, constraints, self.out)
        evaluate, *after = (partial(entry(kernel), *packed.arguments, self.out) for kernel in kernels)
        self.evaluate: Callable[[float, Array, Array], int] = _in_turn(evaluate, after) if after else evaluate


def _in_turn(
    evaluate: Callable[[float, Array, Array], int], after: Sequence[Callable[[float, Array, Array], None]]
) -> Callable[[float, Array, Array], int]:
    def all_of_them(t: float, q: Array, qd: Array) -> int:
        code = evaluate(t, q, qd)
        if not code:
            for add_rows in after:
                add_rows(t, q, qd)
        return code

    return all_of_them
