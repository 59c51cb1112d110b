"""Constraints as parts of the compiled step: each describes itself, and none is known here."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from ..constraints import Constraint, ConstraintSet
from ..constraints.by_formula import Form
from ..vision.motion import Motion
from . import constraint_rows
from .compiler import IN_PLACE, OPTIONS
from .parts import address, make_part, warn_refused
from .structures import Step

SIGNATURE = "void(int64, int64)"
"""Of a part: the address of the step, and the part's number."""


class NotCompiled(Exception):
    """Something in the scene, the constraints or the task has no compiled form; says what."""


def demand(part: object, kind: type) -> None:
    """Raise NotCompiled unless ``part`` is of exactly that class: a subclass may compute anything."""
    if type(part) is not kind:
        raise NotCompiled(f"the {kind.__name__} {type(part).__name__}")


def write_motion(record: Any, motion: Motion) -> None:
    """Write a motion of two or three coordinates to a MOTION."""
    k = motion.size
    record["velocity"][:k], record["amplitude"][:k] = motion.velocity, motion.amplitude
    record["rate"], record["phase"] = motion.rate, motion.phase


class Part(NamedTuple):
    """A constraint with a compiled form, its rows, and the function that writes them."""

    constraint: Constraint
    form: Form
    rows: slice
    function: Any


class Parts:
    """The constraints of a scene, as far as they have a compiled form.

    Attributes
    ----------
    forms
        Those that have one.
    parameters
        The greatest number of parameters of one of them.
    others
        The others, with their rows and their robot points: their rows are made in NumPy.
    """

    def __init__(self, constraints: ConstraintSet) -> None:
        self.forms: list[Part] = []
        self.others: list[tuple[Constraint, slice, slice]] = []
        self._constraints = constraints
        first = 0
        for constraint, count, points in constraints.blocks():
            rows, first = slice(first, first + count), first + count
            form = constraint.compiled_form(constraints.scene, points)
            function = None
            if form is not None and (form.motion is None or type(form.motion) is Motion):
                function = part(form.rows, form.formulas, len(form.parameters))
            if form is None or function is None:
                self.others.append((constraint, rows, points))
            else:
                self.forms.append(Part(constraint, form, rows, function))
        self.parameters = max((len(one.form.parameters) for one in self.forms), default=0)

    def write(self, step: Step, known: bool) -> None:
        """Write all that the step needs of the constraints; ``known`` tells it of every motion."""
        constraints, rows = self._constraints, step.rows
        rows.K[:], rows.switching_gain[:] = constraints.approach_time, constraints.switching_gain
        rows.scale[:] = constraints.scale
        for i, (constraint, form, at, function) in enumerate(self.forms):
            record, motion = step.parts[i], form.motion
            record["address"], record["K"], record["margin"] = address(function), constraint.K, form.margin
            record["first"], record["count"] = at.start, at.stop - at.start
            record["R"] = np.eye(3)
            if form.frame is not None:
                R, t = form.frame
                record["R"][: len(t), : len(t)], record["t"][: len(t)] = R, t
            if motion is not None:
                record["moves"], record["known"] = True, known or motion.known
                write_motion(record["motion"], motion)
            step.parameters[i, : len(form.parameters)] = form.parameters
            step.which[at] = form.which
            step.gradients[at], step.offsets[at] = form.gradients, form.offsets


@cache
def part(rows: str, formulas: tuple[Callable[..., Any] | None, ...], count: int) -> Any:
    """The compiled function of such rows, which is kept as long as the process runs; None if numba refuses a formula.

    Then a RuntimeWarning tells which, and why.
    """
    options, templates = IN_PLACE, constraint_rows
    if rows == "manipulability_rows":
        options, templates = OPTIONS, import_module(f"{__package__}.manipulability_rows")
    try:
        return make_part(getattr(templates, rows), formulas, (count,) if formulas else (), SIGNATURE, options)
    except Exception as error:  # numba raises anything for code that it does not know
        if all(formula is None for formula in formulas):
            raise
        warn_refused(formulas, error)
        return None
