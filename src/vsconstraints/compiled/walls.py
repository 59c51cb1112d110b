"""Inequalities of the compiled hierarchy: selection, projection and report."""

from __future__ import annotations

import math
from typing import NamedTuple

from ..rows import Array, BoolArray, IntArray
from ..rows.tolerances import DEPENDENT, MET, PULLING, ZERO_GRADIENT
from .compiler import in_place, inner
from .least_distance import KINDS, MULTIPLIER, SIDE
from .least_violation import GREATEST, LEAST
from .levels import CENTER, ORIGIN
from .linear import START, copy, copy_vector, dot, length, squared_length
from .scratch import blank, flags, integers, matrix, vector
from .workspace import Scratch


class Demands(NamedTuple):
    """Inequalities A q̈ ≤ c imposed by the rows, A (m, n) and c (m,); ∞ for inactive rows.

    ``scale`` (m,) is the positive ‖Aᵢ‖ that counts as usual: no acceleration influences a row far
    below it. ``weights`` (m,) are those of level 1, positive.
    """

    A: Array
    c: Array
    scale: Array
    weights: Array


class Resolved(NamedTuple):
    """Outputs: q̈ (n,), excess over each bound (m,), and active rows (m,)."""

    qdd: Array
    slack: Array
    acted: BoolArray


class Inequalities(NamedTuple):
    """Inequalities N x ≤ sides (w,): f demands that accelerations influence, then the box.

    ``limits`` (w,) are sides that a point is known to meet, ∞ for rows that are settled. ``held``
    (w,) marks the active rows. ``rows`` (4, w) are those that :func:`nearest` takes. Three fields
    (f,) belong to the demands: ``weights`` of level 1, ``which`` row each one is, and
    ``violation``, its excess if that is inevitable.
    """

    normals: Array
    sides: Array
    limits: Array
    held: BoolArray
    rows: Array
    weights: Array
    which: IntArray
    violation: Array


@in_place
def try_unconstrained(
    demands: Demands, box: Array, X: Array, fixed: BoolArray, resolved: Resolved
) -> bool:
    """Write the unconstrained command to q̈. Return True if it meets all demands, in the box.

    No row is active then. Otherwise rows with a finite bound are marked in ``acted``, and rows
    among them that no acceleration influences in ``fixed`` (m,). The command X[CENTER] also becomes
    the origin of x, and every slack zero.
    """
    A, c, scale, _ = demands
    qdd, slack, acted = resolved
    n = qdd.size
    within = True  # in the box
    below = True  # all bounds are met exactly
    tracks = True  # all bounds are met up to rounding
    for j in range(n):
        X[ORIGIN, j] = X[CENTER, j]
        qdd[j] = X[CENTER, j]
        within = within and box[LEAST, j] <= qdd[j] <= box[GREATEST, j]
    distance = length(X, CENTER, n)
    for i in range(c.size):
        acted[i] = c[i] != math.inf
        slack[i] = 0.0
        if acted[i]:
            size = length(A, i, n)
            excess = dot(A, i, X, CENTER, START, n) - c[i]
            fixed[i] = size <= ZERO_GRADIENT * scale[i]
            below = below and excess <= 0.0
            rounding = MET * (size * distance + abs(c[i]))
            is_met = c[i] >= 0.0 if fixed[i] else excess <= rounding
            tracks = tracks and is_met and excess < math.inf
    if not (within and (below or tracks)):
        return False
    for i in range(c.size):
        acted[i] = False
    return True


@in_place
def count_influenced(acted: BoolArray, fixed: BoolArray) -> int:
    """Count the rows of :func:`try_unconstrained` with a bound that accelerations influence."""
    count = 0
    for i in range(acted.size):
        if acted[i] and not fixed[i]:
            count += 1
    return count


@inner
def gather_walls(
    demands: Demands, box: Array, fixed: BoolArray, resolved: Resolved, scratch: Scratch
) -> Inequalities:
    """Return the demands and the box as inequalities.

    A violated demand that no acceleration influences becomes slack. ``fixed`` and ``acted`` are
    those of :func:`try_unconstrained`; all rows become inactive.
    """
    A, c, _, weights = demands
    slack = resolved.slack
    acted = resolved.acted
    n = box.shape[1]
    free = count_influenced(acted, fixed)
    w = free
    at = START
    for j in range(n):
        if box[GREATEST, j] < math.inf:
            w += 1
        if box[LEAST, j] > -math.inf:
            w += 1
    normals = blank(scratch, w, n)
    sides = vector(scratch, w)
    of_demands = vector(scratch, free)
    which = integers(scratch, free)
    violation = vector(scratch, free)
    rows = matrix(scratch, KINDS, w)
    for i in range(c.size):
        if acted[i]:
            acted[i] = False
            if fixed[i]:
                slack[i] = max(0.0, -c[i])
            else:
                sides[at] = c[i]
                of_demands[at] = weights[i]
                which[at] = i
                violation[at] = 0.0
                copy(normals, at, A, i, n)
                at += 1
    # x ≤ greatest, then −x ≤ −least
    for end, sign in ((GREATEST, 1.0), (LEAST, -1.0)):
        for j in range(n):
            side = sign * box[end, j]
            if side < math.inf:
                sides[at] = side
                normals[at, j] = sign
                at += 1
    limits = vector(scratch, w)
    held = flags(scratch, w)
    copy_vector(limits, sides)
    return Inequalities(normals, sides, limits, held, rows, of_demands, which, violation)


@in_place
def restate(walls: Inequalities, Z: Array, X: Array, H: Array) -> bool:
    """Express the rows in y of x = origin + Z y: H (p, w), and their sides.

    Return False if a side is not a number.
    """
    p = H.shape[0]
    n = X.shape[1]
    free = walls.violation.size
    normals = walls.normals
    for i in range(walls.sides.size):
        squared_in_basis = 0.0
        for d in range(p):
            entry = normals[i, d]
            # an empty Z stands for the identity
            if p < n:
                entry = dot(normals, i, Z, d, START, n)
            H[d, i] = entry
            squared_in_basis += entry * entry
        if p < n:
            squared = squared_length(normals, i, START, n)
            # rows within the span of the violated ones are settled
            is_settled = squared_in_basis <= DEPENDENT * DEPENDENT * squared
            is_violated = i < free and walls.violation[i] > 0.0
            if is_settled or is_violated:
                walls.limits[i] = math.inf
        side = walls.limits[i] - dot(normals, i, X, ORIGIN, START, n)
        walls.rows[SIDE, i] = side
        if not side > -math.inf:
            return False
    return True


@in_place
def hold(walls: Inequalities) -> None:
    """Mark the rows that pull on the answer as active."""
    strongest = 0.0
    for i in range(walls.held.size):
        strongest = max(strongest, walls.rows[MULTIPLIER, i])
    for i in range(walls.held.size):
        pulls = walls.rows[MULTIPLIER, i] > PULLING * strongest
        walls.held[i] = walls.held[i] or pulls


@in_place
def report(walls: Inequalities, resolved: Resolved) -> bool:
    """Write slack and active rows. Return True if any demand is violated."""
    qdd, slack, acted = resolved
    violation = walls.violation
    unmet = False
    for i in range(violation.size):
        if violation[i] > 0.0:
            excess = -walls.sides[i]
            for j in range(qdd.size):
                excess += walls.normals[i, j] * qdd[j]
            violation[i] = max(0.0, excess)
        row = walls.which[i]
        slack[row] = violation[i]
        acted[row] = violation[i] > 0.0 or walls.held[i]
    for i in range(slack.size):
        unmet = unmet or slack[i] > 0.0
    return unmet
