"""The resolver ``projection``, compiled."""

from __future__ import annotations

import math

from ..formulas.projection import opening
from ..formulas.row import PUSH
from .compiler import compiled
from .laws import RESOLVER, fits, load_law
from .parts import call_int_pointer
from .resolving import checkable, follow_alone, rates, remember, valid
from .scratch import blank, emptied
from .structures import NEEDS_PYTHON, SOLVED, Answer, RowArrays, TaskArrays
from .task_priority import pushed


@compiled(RESOLVER, from_python=False)
def projection(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """See :class:`vsconstraints.controllers.resolvers.Projection`.

    Its options are the rank tolerance and the errors below and above which λ is 0 and 1.

    Returns
    -------
    int
        ``SOLVED``, or ``NEEDS_PYTHON`` where input is refused, the error is not given, or numbers leave the range.
    """
    law = load_law(address)
    e, J, qdd = task.error, task.J, answer.qdd
    if not valid(law, rows, task, answer) or e.size != task.b.size or not fits(e, e.size):
        return NEEDS_PYTHON
    k, n = J.shape
    scratch = emptied(law)
    follow_alone(law, task, answer)
    if call_int_pointer(law.demand, (address, rows, rates(law, rows, qdd), PUSH, law.after, law.asked)):
        return NEEDS_PYTHON
    X = blank(scratch, 3, n)
    z, unit, null, along = X[0], X[1], X[2], blank(scratch, 1, k)[0]
    if pushed(law, rows, answer.acted, z):
        largest = error = size = 0.0
        for i in range(k):
            largest = max(largest, abs(e[i]))
        for i in range(k):
            share = e[i] / largest if largest > 0.0 else 0.0
            error += share * share
            for j in range(n):
                along[i] += J[i, j] * z[j]
                unit[j] += J[i, j] * share
        for j in range(n):
            size += unit[j] * unit[j]
        size = math.sqrt(size)
        call_int_pointer(law.track, (scratch, J, along, law.options[0], J[:0, 0], null))
        part = opening(largest * math.sqrt(error), law.options[1], law.options[2])
        for j in range(n):
            null[j] = (1.0 - part) * (z[j] - null[j])
            unit[j] /= size if size > 0.0 else 1.0
        for _ in range(2):
            inner = 0.0
            for j in range(n):
                inner += unit[j] * z[j]
            for j in range(n):
                z[j] -= inner * unit[j]
        for j in range(n):
            qdd[j] += part * z[j] + null[j]
    if not checkable(law, rows, qdd):
        return NEEDS_PYTHON
    remember(law, rows, qdd)
    return SOLVED
