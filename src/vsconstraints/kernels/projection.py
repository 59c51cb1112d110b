"""The resolver ``projection``, compiled."""

from __future__ import annotations

import math

from ..formulas.projection import opening
from ..formulas.row import PUSH
from .compiler import compiled
from .laws import RESOLVER, fits
from .parts import ask
from .scratch import blank
from .structures import ASK, DONE, Answer, LawArrays, RowArrays, TaskArrays
from .task_priority import checkable, pushed, rates, remember, valid


@compiled(RESOLVER)
def projection(law: LawArrays, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """See :class:`vsconstraints.controllers.resolvers.Projection`.

    Its options are the rank tolerance and the errors below and above which λ is 0 and 1.

    Returns
    -------
    int
        ``DONE``, or ``ASK`` where input is refused, the error is not given, and where numbers leave the range.
    """
    e, J, qdd = task.error, task.J, answer.qdd
    if not valid(law, rows, task, answer) or e.size != task.b.size or not fits(e, e.size):
        return ASK
    k, n = J.shape
    law.scratch.taken[0] = 0
    ask(law.track, (law.scratch, J, task.b, law.options[0], qdd))
    push = law.asked
    if ask(law.demand, (law, rows, rates(law, rows, qdd), PUSH, law.after, push)):
        return ASK
    X = blank(law.scratch, 3, n)
    z, unit, null, along = X[0], X[1], X[2], blank(law.scratch, 1, k)[0]
    if pushed(rows, push, answer.acted, z):
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
        ask(law.track, (law.scratch, J, along, law.options[0], null))
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
    if not checkable(rows.Lg, rows.switching_gain, qdd):
        return ASK
    remember(law, rows, qdd)
    return DONE
