"""Clearance between samples: the plant's motion inside a period is known."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ..control import ControlStep
from ..rows import Array, IntArray
from .plant import Plant
from .setup import Setup

#: Into so many parts a sampling period is divided that is inspected; into halves of these where
#: that is not enough.
QUARTERS = 4
FINEST = 2.0**-8  #: No part is smaller than this share of a period.
#: Clearance, as a fraction of the characteristic length, up to which the least one of a run is
#: looked for.
NEAR = 0.05

DIP = 2.0, 0.001
"""How much less than at both its ends a clearance may be inside a period: a multiple of its
greatest change in this period and those beside it, and a fraction of the characteristic length,
below which nothing is looked for.

Half the change would do at a constant rate: what is passed at full speed was neared in the period
before.
"""

#: Way that a joint goes out and back inside a period [rad or m] from which on its turning counts
#: near a boundary, and wherever it is: what turns at every sample never changes its clearance from
#: one to the next.
BACK = 1e-5, 1e-3


def intersample_clearance(
    setup: Setup, control: ControlStep, plant: Plant, states: Array, clearance: Array
) -> Array:
    """(N, m) least clearance inside the period after each sample; infinite where none was
    inspected.

    Inspected are periods inside which a row may be outside, or have its least clearance of the run:
    those in which its clearance might come to zero at the rate at which it changes there
    (:data:`DIP`), however far from its boundary it is in the samples, or in which a joint turns
    back inside (:data:`BACK`). Parts of a period are halved as long as, at the rate seen in it, a
    row may be deeper outside within a part. Samples have states (N, s, n), clearances (N, m).
    """
    N, m = clearance.shape
    least = np.full((N, m), np.inf)
    if m == 0 or N < 2:
        return least
    periods = inspected_periods(setup, plant, states, clearance)
    length = setup.constraints.characteristic_length

    def look(at: IntArray, share: float) -> Array:
        """(P, m) clearances a share of the period after some samples, which are noted; infinite
        where unseen.
        """
        there = np.full((len(at), m), np.inf)
        q, qd = plant.within(states, at, share)
        t = (at + share) * setup.Ts
        pixels, points, seen = control.views(t, q)
        if seen.any():
            there[seen] = setup.clearance(t[seen], q[seen], qd[seen], pixels[seen], points[seen])
        least[at] = np.minimum(least[at], there)
        return there

    if not len(periods):
        return least
    width = 1.0 / QUARTERS
    inside = [look(periods, i * width) for i in range(1, QUARTERS)]
    ends = np.stack([clearance[periods], *inside, clearance[periods + 1]])
    with np.errstate(invalid="ignore"):
        change = np.abs(np.diff(ends, axis=0)).max(axis=0)
    change[~np.isfinite(change)] = 0.0  # where nothing is seen, there is nothing to be looked for
    parts = [(i * width, np.arange(len(periods)), ends[i], ends[i + 1]) for i in range(QUARTERS)]
    while parts and width > FINEST:
        deepest = np.fmin(np.fmin(clearance.min(axis=0), least.min(axis=0)), 0.0)
        halves = []
        for begin, at, first, last in parts:
            may = (np.minimum(first, last) - change[at] < deepest) & (change[at] > DIP[1] * length)
            at, first, last = (each[may.any(axis=1)] for each in (at, first, last))
            if len(at):
                middle = look(periods[at], begin + 0.5 * width)
                halves += [(begin, at, first, middle), (begin + 0.5 * width, at, middle, last)]
        parts = halves
        width = 0.5 * width
        change = 0.5 * change
    return least


def inspected_periods(setup: Setup, plant: Plant, states: Array, clearance: Array) -> IntArray:
    """Numbers of the periods that are inspected."""
    length = setup.constraints.characteristic_length
    least = clearance.min(axis=0)
    near = NEAR * length
    ends = np.minimum(clearance[:-1], clearance[1:])
    with np.errstate(invalid="ignore"):
        change = np.abs(np.diff(clearance, axis=0))
    change[~np.isfinite(change)] = np.inf
    neighbours = np.pad(change, ((1, 1), (0, 0)))
    dip = DIP[0] * np.maximum(change, np.maximum(neighbours[:-2], neighbours[2:])) + DIP[1] * length
    # what is deep outside at both ends is so inside as well
    open_ = (ends > -dip) | (ends < least + dip)
    inspected = ((ends < np.clip(least, 0.0, near) + dip) & open_).any(axis=1)
    # half of what a joint goes out and back, at a constant acceleration; at two, if the command
    # changes inside
    speeds = [states[:-1, 1], states[1:, 1]]
    if plant.switch:
        speeds.insert(1, plant.within(states, np.arange(len(states) - 1), plant.switch)[1])
    turned = [np.maximum(-a * b, 0.0).max(axis=1) for a, b in pairwise(speeds)]
    way = 0.25 * setup.Ts * np.sqrt(np.max(turned, axis=0))
    turns = (way > BACK[0]) & (ends < near).any(axis=1) | (way > BACK[1])
    return np.flatnonzero(inspected | turns)
