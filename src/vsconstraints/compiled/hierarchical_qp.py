"""Resolvers ``hierarchy``, ``filter`` and ``scaling``, compiled.

They pass their bounds and objectives to :func:`vsconstraints.compiled.hierarchy.hierarchy`.
"""

from __future__ import annotations

import numpy as np

from ..formulas.row import BOUND, share_within
from ..rows import Array
from ..rows.tolerances import ZERO_GRADIENT
from .codes import (
    DAMPING,
    FAILED,
    LIMIT,
    NEAREST,
    NEEDS_PYTHON,
    OBJECTIVE,
    SCALED,
    SOLVED,
    STRICT,
    TOLERANCE,
)
from .compiler import compiled, in_place
from .hierarchy import Priorities, aim_at, aim_at_task, hierarchy
from .laws import RESOLVER, load_law
from .least_violation import GREATEST, LEAST
from .linear import finite
from .resolving import acceleration_box, demanded, finished, follow_alone, measurable
from .scratch import emptied, filled, flags
from .walls import Demands, Resolved, try_unconstrained
from .workspace import Answer, LawArrays, RowArrays, TaskArrays


@in_place
def scale_down(law: LawArrays, rows: RowArrays, box: Array, qdd: Array) -> float:
    """Scale the unconstrained command by κ of ``scaling``, and return κ.

    The share that each row allows is written to ``law.tracked``.
    """
    kappa = 1.0
    for j in range(qdd.size):
        kappa_up = share_within(box[GREATEST, j], qdd[j])
        kappa_down = share_within(-box[LEAST, j], -qdd[j])
        kappa = min(kappa, kappa_up, kappa_down)
    for i in range(rows.phi.size):
        norm = np.sqrt(law.squared[i])
        share = 1.0
        if norm > ZERO_GRADIENT * rows.scale[i]:
            share = share_within(law.asked[i], law.tracked[i])
        law.tracked[i] = share
        kappa = min(kappa, share)
    for j in range(qdd.size):
        qdd[j] *= kappa
    return kappa


@compiled(RESOLVER, from_python=False)
def descend(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """Compute the command of the resolvers ``Hierarchy``, ``Filter`` and ``Scaling``.

    See :class:`vsconstraints.controllers.resolvers.Hierarchy`, ``Filter`` and ``Scaling``. Their
    options are the rank tolerance, half the width of the resolver's box or infinity, the damping,
    and the objective: ``STRICT`` for the hierarchy, ``NEAREST`` or ``WEIGHED`` for the filter in
    joint or task space, or ``SCALED`` for scaling. Return the code of
    :func:`vsconstraints.compiled.hierarchy.hierarchy`, or ``NEEDS_PYTHON``.
    """
    law = load_law(address)
    if not measurable(law, rows, task, answer):
        return NEEDS_PYTHON
    tolerance = law.options[TOLERANCE]
    damping = law.options[DAMPING]
    objective = law.options[OBJECTIVE]
    m = rows.phi.size
    qdd = answer.qdd
    scratch = emptied(law)
    box = acceleration_box(rows, law.options[LIMIT], answer.qdd.size, scratch)
    follow_alone(law, task, answer)
    if not demanded(address, law, rows, qdd, BOUND):
        return NEEDS_PYTHON
    kappa = scale_down(law, rows, box, qdd) if objective == SCALED else 1.0
    weights = law.weights if law.weights.size == m else filled(scratch, m, 1.0)
    demands = Demands(rows.Lg, law.asked, rows.scale, weights)
    resolved = Resolved(qdd, answer.slack, answer.acted)
    aim = aim_at(qdd, scratch)
    code = SOLVED
    answer.iterations[0] = 0
    if not try_unconstrained(demands, box, aim.X, flags(scratch, m), resolved):
        if objective not in (NEAREST, SCALED):
            aim = aim_at_task(task.J, task.b, task.rest, tolerance, scratch)
        priorities = Priorities(box, damping, tolerance, objective == STRICT)
        code, answer.iterations[0] = hierarchy(demands, aim, priorities, resolved, scratch)
    if code == FAILED:
        return FAILED
    if not finite(answer.slack):
        return NEEDS_PYTHON
    if kappa < 1.0:
        for i in range(m):
            answer.acted[i] |= law.tracked[i] <= kappa
    return finished(law, rows, qdd, code)
