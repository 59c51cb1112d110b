"""Clearance between samples, from the known motion of the plant within a period."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ..control import ControlStep
from ..rows import Array, IntArray
from .plant import Plant
from .setup import Setup

#: Number of parts into which an inspected sampling period is divided; the parts are halved further
#: where necessary.
QUARTERS = 4
FINEST = 2.0**-8  #: Smallest part, as a share of a period.
#: Clearance below which a row is near its boundary, as a fraction of the characteristic length.
#: The smallest clearance of a run is also searched for between the samples if it may be below this;
#: if it is greater, that of the samples is precise enough.
NEAR = 0.05

DIP_FACTOR = 2.0
"""Largest decrease of a clearance within a period below both its ends, as a multiple of its change.

That is the largest change in this period and its neighbours. At a constant rate, half the change
would suffice: a boundary that is passed at full speed was approached in the period before.
"""
#: Decrease of a clearance that is ignored, as a fraction of the characteristic length.
NEGLIGIBLE_DIP = 0.001

#: Smallest distance that a joint moves out and back within a period to be inspected [rad or m]:
#: near a boundary, and anywhere. A motion that reverses at every sample does not change the sampled
#: clearances.
BACK_NEAR_A_BOUNDARY = 1e-5
BACK_ANYWHERE = 1e-3


def intersample_clearance(
    setup: Setup, control: ControlStep, plant: Plant, states: Array, clearance: Array
) -> Array:
    """Return the smallest clearance (N, m) within the period after each sample.

    It is infinite if the period was not inspected, or if the scene is seen nowhere within it.
    Samples have states (N, s, n) and clearances (N, m). A period is inspected in two cases:

    - At its rate of change (:data:`DIP_FACTOR`), the clearance of a row may fall below zero in it,
      or below the least sample of the row. The latter counts only if it may also fall below
      :data:`NEAR` × L. A row that is violated by more than it may dip, at the end where it is
      lower, only counts if it may fall below its least sample.
    - A joint moves out and back in it: by more than ``BACK_ANYWHERE``, or by more than
      ``BACK_NEAR_A_BOUNDARY`` if a row is below :data:`NEAR` × L.

    An inspected period is evaluated at its quarters. A part is halved further only if a row may be
    violated in it more deeply than anywhere else in the run: the run's greatest depth is searched
    for, and a short violation of smaller depth may lie between the quarters. A part is assumed to
    dip by no more than the largest change between two quarters of its period, halved with it.
    """
    N, m = clearance.shape
    least = np.full((N, m), np.inf)
    if m == 0 or N < 2:
        return least
    periods = inspected_periods(setup, plant, states, clearance)
    if not len(periods):
        return least

    def look_inside(samples: IntArray, share: float) -> Array:
        """Return clearances (P, m) at a share of the period after each of P samples.

        They are infinite where the scene cannot be seen. ``least`` is lowered to them.
        """
        found = np.full((len(samples), m), np.inf)
        q, qd = plant.within(states, samples, share)
        t = (samples + share) * setup.Ts
        pixels, points, seen = control.views(t, q)
        if seen.any():
            of_seen = [each[seen] for each in (t, q, qd, pixels, points)]
            found[seen] = setup.clearance(*of_seen)
        least[samples] = np.minimum(least[samples], found)
        return found

    length = setup.constraints.characteristic_length
    width = 1.0 / QUARTERS
    begins = clearance[periods]
    inside = [look_inside(periods, i * width) for i in range(1, QUARTERS)]
    ends = np.stack([begins, *inside, clearance[periods + 1]])
    with np.errstate(invalid="ignore"):
        changes = np.abs(np.diff(ends, axis=0))
    changes[~np.isfinite(changes)] = 0.0  # where nothing is seen, there is nothing to search for
    change = changes.max(axis=0)
    every_period = np.arange(len(periods))
    parts = [(i * width, every_period, ends[i], ends[i + 1]) for i in range(QUARTERS)]
    while parts and width > FINEST:
        least_of_run = np.fmin(clearance.min(axis=0), least.min(axis=0))
        deepest = np.fmin(least_of_run, 0.0)
        halves = []
        for begin, candidates, first, last in parts:
            largest_dip = change[candidates]
            lower_end = np.minimum(first, last)
            may_be_deeper = lower_end - largest_dip < deepest
            is_relevant = largest_dip > NEGLIGIBLE_DIP * length
            kept = (may_be_deeper & is_relevant).any(axis=1)
            if not kept.any():
                continue
            candidates = candidates[kept]
            first = first[kept]
            last = last[kept]
            half = begin + 0.5 * width
            middle = look_inside(periods[candidates], half)
            halves.append((begin, candidates, first, middle))
            halves.append((half, candidates, middle, last))
        parts = halves
        width = 0.5 * width
        change = 0.5 * change
    return least


def inspected_periods(setup: Setup, plant: Plant, states: Array, clearance: Array) -> IntArray:
    """Return the numbers of the periods in which a row may be lower inside than at both ends.

    The two cases are those of :func:`intersample_clearance`.
    """
    length = setup.constraints.characteristic_length
    least = clearance.min(axis=0)
    lower_end = np.minimum(clearance[:-1], clearance[1:])
    dip = _greatest_dips(clearance, length)
    # a row counts if it may fall below this value
    near_least = np.clip(least, 0.0, NEAR * length)
    may_be_least = lower_end < near_least + dip
    # a row that is violated that deeply is violated at both ends, and so inside
    is_open = (lower_end > -dip) | (lower_end < least + dip)
    dips = (may_be_least & is_open).any(axis=1)
    is_near = (lower_end < NEAR * length).any(axis=1)
    way = _ways_back(setup, plant, states)
    turns_near = (way > BACK_NEAR_A_BOUNDARY) & is_near
    turns = turns_near | (way > BACK_ANYWHERE)
    return np.flatnonzero(dips | turns)


def _greatest_dips(clearance: Array, length: Array) -> Array:
    """Return how far each row may dip below the ends of each period, (N − 1, m).

    It is assumed not to exceed a multiple of the change in this period and its neighbours.
    """
    with np.errstate(invalid="ignore"):
        change = np.abs(np.diff(clearance, axis=0))
    change[~np.isfinite(change)] = np.inf
    padded = np.pad(change, ((1, 1), (0, 0)))
    in_neighbours = np.maximum(padded[:-2], padded[2:])
    largest_change = np.maximum(change, in_neighbours)
    dip: Array = DIP_FACTOR * largest_change + NEGLIGIBLE_DIP * length
    return dip


def _ways_back(setup: Setup, plant: Plant, states: Array) -> Array:
    """Return half the distance that a joint moves out and back in each period, (N − 1,).

    The acceleration is constant in a period, or changes at the shares of it that the plant states.
    """
    periods = np.arange(len(states) - 1)
    speeds = [states[:-1, 1]]
    for share in plant.reversals:
        _, inside = plant.within(states, periods, share)
        speeds.append(inside)
    speeds.append(states[1:, 1])
    reversals = []
    for before, after in pairwise(speeds):
        reversed_product = np.maximum(-before * after, 0.0)
        reversals.append(reversed_product.max(axis=1))
    speed = np.sqrt(np.max(reversals, axis=0))
    way: Array = 0.25 * setup.Ts * speed
    return way
