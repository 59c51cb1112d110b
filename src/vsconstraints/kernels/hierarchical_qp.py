"""The resolvers ``hierarchy`` and ``filter``, compiled: their demands, given to the descent."""

from __future__ import annotations

import numpy as np

from ..formulas.row import BOUND
from .compiler import compiled
from .hierarchy import Demands, Priorities, Resolved, hierarchy
from .laws import RESOLVER, within
from .least_violation import GREATEST, LEAST
from .linear import finite
from .parts import ask
from .scratch import matrix
from .structures import ASK, FAILED, Answer, LawArrays, RowArrays, TaskArrays
from .task_priority import checkable, rates, remember, valid


@compiled(RESOLVER)
def descend(law: LawArrays, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """See :class:`vsconstraints.controllers.resolvers.Hierarchy` and ``Filter``.

    Their options are the rank tolerance, half the width of their own box or infinity, the damping, and 1 for the
    filter, whose task is to stay at the command that tracks.

    Returns
    -------
    int
        The code of :func:`vsconstraints.kernels.hierarchy.hierarchy`, or ``ASK``.
    """
    if not valid(law, rows, task, answer) or answer.slack.size != rows.phi.size or answer.iterations.size == 0:
        return ASK
    tolerance, bound, damping, filters = law.options[0], law.options[1], law.options[2], law.options[3] != 0.0
    m, n, qdd = rows.phi.size, answer.qdd.size, answer.qdd
    law.scratch.taken[0] = 0
    box = matrix(law.scratch, 2, n)
    for j in range(n):
        box[LEAST, j], box[GREATEST, j] = within(rows, j, -bound), within(rows, j, bound)
    J, b = task.J, task.b
    if filters or law.tracks != 0:
        ask(law.track, (law.scratch, J, b, tolerance, qdd))
    c = law.asked
    if ask(law.demand, (law, rows, rates(law, rows, qdd), BOUND, law.after, c)):
        return ASK
    if filters:
        J, b = np.eye(n), qdd.copy()
    weights = law.weights if law.weights.size == m else np.ones(m)
    demands, priorities = Demands(rows.Lg, c, rows.scale, weights), Priorities(box, damping, tolerance)
    resolved = Resolved(qdd, answer.slack, answer.acted)
    code, answer.iterations[0] = hierarchy(demands, J, b, priorities, resolved, law.scratch)
    if code == FAILED:
        return FAILED
    if not (checkable(rows.Lg, rows.switching_gain, qdd) and finite(answer.slack)):
        return ASK
    remember(law, rows, qdd)
    return code
