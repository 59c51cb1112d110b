"""What one control step comes to: rows, task, and what was seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from ..rows import UNKNOWN, Array, Rows, Task
from . import entry

if TYPE_CHECKING:
    from ..constraints import ConstraintSet
    from .packing import Packed


@dataclass(slots=True)
class DefinedEvaluation:
    """What one step came to, by the NumPy form; the arrays are its own.

    Attributes
    ----------
    rows, task
        As a controller takes them.
    error
        (k,) of the visual feature.
    sigma
        (m,) of each row.
    pixels
        (M, 2) markers from the image's centre [px].
    points
        (p, 3) the scene's robot points in the base frame [m].
    camera_R, camera_t
        (3, 3) orientation and (3,) position [m] of the camera in the target's frame.
    """

    rows: Rows
    task: Task
    error: Array
    sigma: Array
    pixels: Array
    points: Array
    camera_R: Array
    camera_t: Array


def _view(name: str) -> property:
    """A part of the array that the compiled step writes."""
    return property(lambda evaluation: evaluation._part(name))


class CompiledEvaluation:
    """The same as the array that the compiled step writes: its parts are views, made when asked for."""

    __slots__ = ("_constraints", "_out", "_packed")

    def __init__(self, packed: Packed, constraints: ConstraintSet, out: Array) -> None:
        self._packed, self._constraints, self._out = packed, constraints, out

    def _part(self, name: str) -> Array:
        where, shape = self._packed.parts[name]
        return self._out[where].reshape(shape)

    @property
    def rows(self) -> Rows:
        """The rows, as a controller takes them."""
        constraints = self._constraints
        return Rows(
            self._part("phi"),
            self._part("Lg"),
            self._part("Lf"),
            constraints.switching_gain,
            constraints.labels,
            constraints.scale,
            self._part("sigma"),
            self._part("sigma_dot"),
            constraints.approach_time,
            *((self._part("qdd_min"), self._part("qdd_max")) if self._packed.size.limited else (UNKNOWN, UNKNOWN)),
        )

    @property
    def task(self) -> Task:
        """The task, likewise."""
        part = self._part
        rest = part("rest") if self._packed.size.rests else UNKNOWN
        return Task(part("J"), part("b"), part("error"), part("error_rate"), rest)

    error, sigma, pixels, points = _view("error"), _view("sigma"), _view("pixels"), _view("points")
    camera_R, camera_t = _view("camera_R"), _view("camera_t")


Evaluation = DefinedEvaluation | CompiledEvaluation
"""What one step came to."""


class Bound:
    """The compiled step on arrays that stay where they are, for loops: every sample overwrites the one before.

    Attributes
    ----------
    evaluate
        Takes time [s], q and q̇, which must be arrays of ``float64`` with one dimension, and returns 0 if ``out`` now
        holds the step; if not, the definition says what is wrong.
    measure
        Takes pixels (M, 2), depths (M,), the time of their image and now, for the next step; returns 0 if they fit.
    out
        Everything that a step came to, as one array.
    now
        The same, by its parts.
    packed
        The step, and where compiled code finds it.
    """

    __slots__ = ("evaluate", "measure", "now", "out", "packed")

    def __init__(self, packed: Packed, constraints: ConstraintSet, kernels: Any) -> None:
        self.packed, self.out = packed, packed.out
        self.now = CompiledEvaluation(packed, constraints, self.out)
        self.evaluate: Callable[[float, Array, Array], int] = partial(entry(kernels.evaluate_step), packed.address)
        self.measure: Callable[[Array, Array, float, float], int] = partial(entry(kernels.measure), packed.address)
