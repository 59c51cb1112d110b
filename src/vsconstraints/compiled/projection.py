"""Resolver ``projection``, compiled."""

from __future__ import annotations

import numpy as np

from ..formulas.projection import opening
from ..formulas.row import PUSH
from ..rows import Array
from .codes import NEEDS_PYTHON, SOLVED, TOLERANCE
from .compiler import compiled, in_place
from .laws import RESOLVER, fits, load_law
from .linear import ONE, START, add, constant, largest_magnitude
from .parts import call_int_pointer
from .resolving import demanded, finished, follow_alone, valid
from .scratch import blank, emptied
from .task_priority import pushed
from .workspace import Answer, RowArrays, TaskArrays

#: Options: the errors below and above which λ is 0 and 1.
CLOSED = 1
OPENED = 2
#: Rows of the workspace: the pushes, Jᵀe / ‖Jᵀe‖, and the part of the pushes in the null space of
#: J; number of rows.
Z = START
UNIT = ONE
NULL = constant(2)
ROWS_OF_X = constant(3)


@in_place
def direction(J: Array, e: Array, X: Array, along: Array) -> float:
    """Write J z to ``along`` (k,) and Jᵀe / ‖Jᵀe‖, or 0, to X[UNIT]; return ‖e‖."""
    n = J.shape[1]
    largest_entry = largest_magnitude(e)
    # e is divided by its largest entry, so that no square leaves the range of floating point
    squared_error = 0.0
    for i in range(e.size):
        share = e[i] / largest_entry if largest_entry > 0.0 else 0.0
        squared_error += share * share
        for j in range(n):
            along[i] += J[i, j] * X[Z, j]
        add(X, UNIT, share, J, i, START, n)
    squared = 0.0
    for j in range(n):
        squared += X[UNIT, j] * X[UNIT, j]
    if squared > 0.0:
        size = np.sqrt(squared)
        for j in range(n):
            X[UNIT, j] /= size
    norm: float = largest_entry * np.sqrt(squared_error)
    return norm


@compiled(RESOLVER, from_python=False)
def projection(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """Compute the command of :class:`vsconstraints.controllers.resolvers.Projection`.

    The options are the rank tolerance and the errors below and above which λ is 0 and 1. Return
    ``SOLVED``, or ``NEEDS_PYTHON`` if the input is refused, the error is not given, or numbers
    leave the range.
    """
    law = load_law(address)
    e = task.error
    J = task.J
    qdd = answer.qdd
    if not valid(law, rows, task, answer):
        return NEEDS_PYTHON
    if e.size != task.b.size or not fits(e, e.size):
        return NEEDS_PYTHON
    k, n = J.shape
    scratch = emptied(law)
    follow_alone(law, task, answer)
    if not demanded(address, law, rows, qdd, PUSH):
        return NEEDS_PYTHON
    X = blank(scratch, ROWS_OF_X, n)
    along = blank(scratch, 1, k)[0]
    options = law.options
    if pushed(law, rows, answer.acted, X[Z]):
        error = direction(J, e, X, along)
        no_rest = J[:0, 0]
        call_int_pointer(law.track, (scratch, J, along, options[TOLERANCE], no_rest, X[NULL]))
        part = opening(error, options[CLOSED], options[OPENED])
        for j in range(n):
            in_null_space = X[Z, j] - X[NULL, j]
            X[NULL, j] = (1.0 - part) * in_null_space
        # the pushes without their part along the unit vector, twice against rounding
        for _ in range(2):
            inner = 0.0
            for j in range(n):
                inner += X[UNIT, j] * X[Z, j]
            add(X, Z, -inner, X, UNIT, START, n)
        for j in range(n):
            qdd[j] += part * X[Z, j] + X[NULL, j]
    return finished(law, rows, qdd, SOLVED)
