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
#: Clearance, as a fraction of the characteristic length, up to which the smallest one of a run is
#: searched for.
NEAR = 0.05

DIP = 2.0, 0.001
"""Largest decrease of a clearance within a period below both its ends.

It is a multiple of the largest change of the clearance in this period and its neighbours, and a
fraction of the characteristic length, below which decreases are ignored. At a constant rate, half
the change would suffice: a boundary that is passed at full speed was approached in the period
before.
"""

#: Smallest distance that a joint moves out and back within a period to be inspected [rad or m]:
#: near a boundary, and anywhere. A motion that reverses at every sample does not change the sampled
#: clearances.
BACK = 1e-5, 1e-3


def intersample_clearance(
    setup: Setup, control: ControlStep, plant: Plant, states: Array, clearance: Array
) -> Array:
    """Return the smallest clearance (N, m) within the period after each sample.

    It is infinite if no period was inspected. A period is inspected if a row may be violated in it
    or may have its smallest clearance of the run there. This is the case if the clearance might
    reach zero at its rate of change there (:data:`DIP`), however far the samples are from the
    boundary, or if a joint reverses within the period (:data:`BACK`). Parts of a period are halved
    as long as a row may be violated more deeply within a part, at the rate observed in it. Samples
    have states (N, s, n) and clearances (N, m).
    """
    N, m = clearance.shape
    least = np.full((N, m), np.inf)
    if m == 0 or N < 2:
        return least
    periods = inspected_periods(setup, plant, states, clearance)
    length = setup.constraints.characteristic_length

    def look(samples: IntArray, share: float) -> Array:
        """Record and return clearances (P, m) at a share of the period after some samples.

        They are infinite where the scene cannot be seen.
        """
        clearance = np.full((len(samples), m), np.inf)
        q, qd = plant.within(states, samples, share)
        t = (samples + share) * setup.Ts
        pixels, points, seen = control.views(t, q)
        if seen.any():
            clearance[seen] = setup.clearance(
                t[seen], q[seen], qd[seen], pixels[seen], points[seen]
            )
        least[samples] = np.minimum(least[samples], clearance)
        return clearance

    if not len(periods):
        return least
    width = 1.0 / QUARTERS
    inside = [look(periods, i * width) for i in range(1, QUARTERS)]
    ends = np.stack([clearance[periods], *inside, clearance[periods + 1]])
    with np.errstate(invalid="ignore"):
        change = np.abs(np.diff(ends, axis=0)).max(axis=0)
    change[~np.isfinite(change)] = 0.0  # where nothing is seen, there is nothing to search for
    parts = [(i * width, np.arange(len(periods)), ends[i], ends[i + 1]) for i in range(QUARTERS)]
    while parts and width > FINEST:
        deepest = np.fmin(np.fmin(clearance.min(axis=0), least.min(axis=0)), 0.0)
        halves = []
        for begin, candidates, first, last in parts:
            may = (np.minimum(first, last) - change[candidates] < deepest) & (
                change[candidates] > DIP[1] * length
            )
            candidates, first, last = (each[may.any(axis=1)] for each in (candidates, first, last))
            if len(candidates):
                middle = look(periods[candidates], begin + 0.5 * width)
                halves += [
                    (begin, candidates, first, middle),
                    (begin + 0.5 * width, candidates, middle, last),
                ]
        parts = halves
        width = 0.5 * width
        change = 0.5 * change
    return least


def inspected_periods(setup: Setup, plant: Plant, states: Array, clearance: Array) -> IntArray:
    """Return the numbers of the periods to be inspected."""
    length = setup.constraints.characteristic_length
    least = clearance.min(axis=0)
    near = NEAR * length
    ends = np.minimum(clearance[:-1], clearance[1:])
    with np.errstate(invalid="ignore"):
        change = np.abs(np.diff(clearance, axis=0))
    change[~np.isfinite(change)] = np.inf
    neighbours = np.pad(change, ((1, 1), (0, 0)))
    dip = DIP[0] * np.maximum(change, np.maximum(neighbours[:-2], neighbours[2:])) + DIP[1] * length
    # a row that is deeply violated at both ends is also violated inside
    open_ = (ends > -dip) | (ends < least + dip)
    inspected = ((ends < np.clip(least, 0.0, near) + dip) & open_).any(axis=1)
    # half the distance that a joint moves out and back at a constant acceleration; with two
    # accelerations, if the command changes inside
    speeds = [states[:-1, 1], states[1:, 1]]
    if plant.switch:
        speeds.insert(1, plant.within(states, np.arange(len(states) - 1), plant.switch)[1])
    turned = [np.maximum(-a * b, 0.0).max(axis=1) for a, b in pairwise(speeds)]
    way = 0.25 * setup.Ts * np.sqrt(np.max(turned, axis=0))
    turns = (way > BACK[0]) & (ends < near).any(axis=1) | (way > BACK[1])
    return np.flatnonzero(inspected | turns)
