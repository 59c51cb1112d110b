"""Search for the best plan that meets its rows, compiled: a dual active-set method.

In w of :mod:`.plan_cost` the best plan is the point nearest to the origin, which the method of
Goldfarb and Idnani (1983) finds; see :func:`.least_distance.nearest`.

With slacks, each constraint i has a slack zᵢ ≥ 0, common to all instants, with the cost ½zᵢ² +
π zᵢ = ½(zᵢ + π)² − ½π². Therefore zᵢ + π is stored, as one more coordinate behind those of w: the
plan is still the point nearest to the origin, a slack is zero where its coordinate is π, and the
side of a row that it relaxes increases by π times its coefficient.
"""

from __future__ import annotations

import math

from ...compiled import least_distance
from ...compiled.codes import FAILED, INCOMPATIBLE, SOLVED
from ...compiled.compiler import in_place
from ...compiled.least_distance import FORCE, NEW, NO_POINT, NONE, POINT, advance, clip_forces
from ...compiled.linear import (
    START,
    apply_transposed,
    copy,
    dot,
    length,
    make_reflection,
    squared_length,
)
from ...rows import Array
from ...rows.tolerances import ZERO_GRADIENT
from .plan_arrays import SIDE, TURNED, Cost, Factor, Limits, Space
from .plan_rows import (
    constraint_of,
    differentiate,
    excess,
    first_slack_row,
    is_constraint,
    most_exceeded,
    predict,
)

UNUSED_PENALTY = 1.0  #: π of a search without slacks, where it has no effect.
NEGLIGIBLE = 1e-14  #: A slack below this share of π counts as zero.
#: The search starts with a row if the squared part of its unit normal outside the span of the
#: others exceeds this.
INDEPENDENT = 1e-12


@in_place
def drop(space: Space, leaving: int, q: int) -> None:
    """Remove one active row, so that q are left, and refactor the rows behind it."""
    X = space.work
    qr = space.qr
    p = space.p
    for j in range(leaving, q):
        space.active[j] = space.active[j + 1]
        X[FORCE, j] = X[FORCE, j + 1]
        X[SIDE, j] = X[SIDE, j + 1]
        copy(space.normals, j, space.normals, j + 1, p)
        copy(qr.columns, j, space.normals, j, p)
        apply_transposed(qr, j, qr.columns, j)
        make_reflection(qr, j)


@in_place
def reach(space: Space, side: float, q: int) -> int:
    """Move the point until the row with the normal X[NEW] is met.

    Active rows whose multiplier would become negative are removed. Return how many of the q active
    rows are left, or ``NO_POINT`` if no point meets the row together with them.
    """
    X = space.work
    p = space.p
    while True:
        over = dot(X, NEW, X, POINT, START, p) - side
        turn_new(space, q)
        leaving = advance(space.qr, X, TURNED, over, q, p)
        if leaving < 0:
            return q if leaving == NONE else NO_POINT
        q -= 1
        drop(space, leaving, q)


@in_place
def turn_new(space: Space, q: int) -> None:
    """Write the normal X[NEW] in the basis of the QR of the q active rows to X[TURNED]."""
    X = space.work
    copy(X, TURNED, X, NEW, space.p)
    apply_transposed(space.qr, q, X, TURNED)


@in_place
def append(space: Space, row: int, side: float, q: int) -> None:
    """Add the row with the normal X[NEW] to the q active ones.

    X[TURNED] is the normal in the basis of the QR.
    """
    X = space.work
    copy(space.normals, q, X, NEW, space.p)
    copy(space.qr.columns, q, X, TURNED, space.p)
    make_reflection(space.qr, q)
    space.active[q] = row
    X[SIDE, q] = side


@in_place
def minimise(space: Space, q: int) -> None:
    """Compute the point nearest to the origin on the q active rows, and the multipliers."""
    X = space.work
    for j in range(space.p):
        X[POINT, j] = X[SIDE, j] if j < q else 0.0
    least_distance.minimise(space.qr, X, q)


@in_place
def write_normal(
    cost: Cost, factor: Factor, limits: Limits, space: Space, row: int, penalty: float
) -> float:
    """Write the unit normal of a row of the constraints or of the box to X[NEW]; return its side.

    Return NaN if no plan has any influence on the row.
    """
    X = space.work
    first_slack = limits.low.size
    differentiate(cost, factor, limits, row, space.adjoint, X)
    side = dot(X, NEW, X, POINT, START, first_slack) - excess(limits, space, row)
    negligible = 0.0  # the gradient of a bound of the box cannot vanish
    if is_constraint(limits, row):
        _, i = constraint_of(limits, row)
        negligible = ZERO_GRADIENT * limits.scale[i]
        if space.p > first_slack:
            # the slack allows an excess of unit z = unit (z + π) − unit π; z + π is the coordinate
            unit = space.slack_unit[i]
            X[NEW, first_slack + i] = -unit
            side -= unit * penalty
    norm = length(X, NEW, space.p)
    if norm <= negligible:
        return math.nan
    for j in range(space.p):
        X[NEW, j] /= norm
    distance: float = side / norm
    return distance


@in_place
def write_slack_normal(space: Space, coordinate: int, penalty: float) -> float:
    """Write the normal of z ≥ 0, i.e. −(z + π) ≤ −π, to X[NEW]; return its side.

    ``coordinate`` is that of z + π.
    """
    X = space.work
    X[NEW] = 0.0
    X[NEW, coordinate] = -1.0
    return -penalty


@in_place
def most_negative_slack(space: Space, penalty: float, first: int) -> int:
    """Write the slacks, and return the index of the most negative one, or ``NONE``.

    Negligible slacks are set to zero. ``first`` is the coordinate of the first slack.
    """
    X = space.work
    chosen = NONE
    negligible = NEGLIGIBLE * penalty
    least = -negligible
    for i in range(space.p - first):
        z = X[POINT, first + i] - penalty
        if z < least:
            chosen = i
            least = z
        space.slack[i] = space.slack_unit[i] * z if z > negligible else 0.0
    return chosen


@in_place
def cost_of(space: Space, penalty: float, first: int) -> float:
    """Return twice the cost of the point beyond that of the plan without rows.

    It increases with every added row.
    """
    X = space.work
    total = squared_length(X, POINT, START, first)
    for j in range(first, space.p):
        z = X[POINT, j] - penalty
        total += z * (z + 2.0 * penalty)
    return total


@in_place
def search(
    cost: Cost, factor: Factor, limits: Limits, space: Space, q: int, penalty: float, met: float
) -> tuple[int, int]:
    """Add rows to the q active ones until all are met.

    Return the code and the number of active rows. Every added row increases the cost. If one does
    not, rounding errors prevail, and the search fails.
    """
    first_slack = limits.low.size
    last_cost = -1.0
    now = 0.0
    for _ in range(20 * space.p):
        slack = most_negative_slack(space, penalty, first_slack)
        predict(cost, factor, limits, space)
        if slack != NONE:
            row = first_slack_row(limits) + slack
            side = write_slack_normal(space, first_slack + slack, penalty)
        else:
            row = most_exceeded(limits, space, met)
            if row == NONE:
                return SOLVED, q
            side = write_normal(cost, factor, limits, space, row, penalty)
        if math.isnan(side):
            if not is_constraint(limits, row):
                return FAILED, q
            # a row that no plan changes becomes slack, whatever the cost
            _, i = constraint_of(limits, row)
            space.slack[i] = max(space.slack[i], excess(limits, space, row))
            continue
        if not now > last_cost:
            return FAILED, q
        q = reach(space, side, q)
        if q == NO_POINT:
            return INCOMPATIBLE, 0
        append(space, row, side, q)
        q += 1
        minimise(space, q)
        clip_forces(space.work, q)
        last_cost = now
        now = cost_of(space, penalty, first_slack)
    return FAILED, q


@in_place
def is_predicted(limits: Limits, row: int) -> bool:
    """True if a row is a bound of the box, or a constraint at instants that can be predicted."""
    if is_constraint(limits, row):
        t, _ = constraint_of(limits, row)
        return bool(t < limits.instants - 1)
    return bool(row < first_slack_row(limits))


@in_place
def resume(cost: Cost, factor: Factor, limits: Limits, space: Space) -> int:
    """Start with the previously active rows that are still active, and return their number.

    Rows are removed until no multiplier is negative.
    """
    X = space.work
    q = 0
    predict(cost, factor, limits, space)
    for k in range(space.held[0]):
        row = space.active[k]
        if not is_predicted(limits, row):
            continue
        side = write_normal(cost, factor, limits, space, row, UNUSED_PENALTY)
        turn_new(space, q)
        outside = squared_length(X, TURNED, q, space.p)
        if abs(side) < math.inf and outside > INDEPENDENT:
            append(space, row, side, q)
            q += 1
    minimise(space, q)
    while q > 0:
        leaving = most_negative_force(X, q)
        if X[FORCE, leaving] >= 0.0:
            break
        q -= 1
        drop(space, leaving, q)
        minimise(space, q)
    return q


@in_place
def most_negative_force(X: Array, q: int) -> int:
    """Return the active row, of q ≥ 1, with the least multiplier."""
    least = 0
    for j in range(q):
        if X[FORCE, j] < X[FORCE, least]:
            least = j
    return least
