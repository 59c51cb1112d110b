"""Plan of constant accelerations that tracks best among those that meet every row, compiled.

The program is that of :mod:`.plan_arrays`. :mod:`.plan_cost` turns it into a search for the point
nearest to the origin. :mod:`.plan_rows` evaluates the rows, and :mod:`.plan_search` finds the
point. If rows contradict each other, the search is repeated with slacks.
"""

from __future__ import annotations

import numpy as np

from ...compiled.codes import FAILED, INCOMPATIBLE, RANK_LOSS, RELAXED_ROWS, SOLVED
from ...compiled.compiler import in_place
from ...compiled.least_distance import NEW, POINT, clip_forces
from ...compiled.linear import QR, length
from ...rows import Array
from ...rows.tolerances import ZERO_GRADIENT
from .plan_arrays import Cost, Factor, Limits, Space
from .plan_cost import factorise
from .plan_rows import constraint_of, differentiate, excess, first_slack_row, predict
from .plan_search import (
    UNUSED_PENALTY,
    append,
    minimise,
    resume,
    search,
    turn_new,
    write_slack_normal,
)

#: π relative to the greatest distance of a row from the plan without rows. The weaker one is used
#: if the stronger one fails.
STRONG = 1e6
WEAK = 1e4
#: A row exceeded by less than this fraction of its scale counts as met: if rows are compatible, and
#: with slacks.
MET = 1e-11
MET_SOFT = 1e-6


@in_place
def measure_excess(
    cost: Cost, factor: Factor, limits: Limits, space: Space, weights: Array
) -> tuple[float, float]:
    """Return the greatest distance of a constraint row from the plan without rows, and a mean.

    The mean is the geometric mean, over the exceeded rows, of their gradients with respect to w, in
    units of their scales and multiplied by their weights. Both are 1 if no row is exceeded.
    """
    X = space.work
    m = limits.gradient.shape[1]
    greatest = 0.0
    sum_of_logarithms = 0.0
    count = 0
    for row in range((limits.instants - 1) * m):
        _, i = constraint_of(limits, row)
        over = excess(limits, space, row)
        if not over > 0.0:
            continue
        differentiate(cost, factor, limits, row, space.adjoint, X)
        norm = length(X, NEW, limits.low.size)
        scale = limits.scale[i]
        if norm > ZERO_GRADIENT * scale:
            greatest = max(greatest, over / norm)
            sum_of_logarithms += np.log(norm * weights[i] / scale)
            count += 1
    distance = greatest if greatest > 0.0 else 1.0
    return distance, np.exp(sum_of_logarithms / max(count, 1))


@in_place
def soften(
    cost: Cost, factor: Factor, limits: Limits, space: Space, weights: Array, strength: float
) -> tuple[int, float]:
    """Start with slacks of zero; return the number of active rows and the penalty π.

    The active rows are z ≥ 0 for each slack. π is ``strength`` times the greatest distance of a row
    from the plan without rows. A slack of z = 1 allows what a unit step of w changes, in the
    geometric mean over the exceeded rows; see :func:`measure_excess` for scales and weights.
    """
    m = limits.gradient.shape[1]
    X = space.work
    first_slack = limits.low.size
    X[POINT] = 0.0
    space.slack[:] = 0.0
    predict(cost, factor, limits, space)
    distance, mean_gradient = measure_excess(cost, factor, limits, space, weights)
    penalty = strength * distance
    for i in range(m):
        space.slack_unit[i] = mean_gradient * limits.scale[i] / weights[i]
        side = write_slack_normal(space, first_slack + i, penalty)
        turn_new(space, i)
        append(space, first_slack_row(limits) + i, side, i)
    minimise(space, m)
    clip_forces(X, m)
    return m, penalty


@in_place
def with_unknowns(space: Space, p: int) -> Space:
    """Return a workspace in the same arrays, of a search with p unknowns."""
    return Space(
        p,
        space.u,
        space.x,
        space.moved,
        space.work,
        space.normals,
        QR(space.qr.columns, space.qr.scalars),
        space.active,
        space.held,
        space.slack,
        space.slack_unit,
        space.adjoint,
    )


@in_place
def plan_best(
    cost: Cost, factor: Factor, limits: Limits, space: Space, weights: Array
) -> tuple[int, int]:
    """Write the best plan to ``space.u``, with slacks if rows contradict each other.

    Return the code and the number of active rows.
    """
    hard = with_unknowns(space, limits.low.size)
    if not factorise(cost, factor):
        return RANK_LOSS, 0
    hard.work[POINT] = 0.0
    hard.slack[:] = 0.0
    q = resume(cost, factor, limits, hard)
    code, q = search(cost, factor, limits, hard, q, UNUSED_PENALTY, MET)
    space.held[0] = q if code == SOLVED else 0
    # all unknowns of ``space``, but as a tuple like ``hard``: the search is then compiled only once
    soft = with_unknowns(space, space.p)
    for strength in (STRONG, WEAK):
        if code in (INCOMPATIBLE, FAILED):
            q, penalty = soften(cost, factor, limits, soft, weights, strength)
            code, q = search(cost, factor, limits, soft, q, penalty, MET_SOFT)
            code = RELAXED_ROWS if code == SOLVED else FAILED
            # the next search without slacks has fewer unknowns, beyond which normals must be zero
            space.qr.columns[:, hard.p :] = 0.0
    return code, q
