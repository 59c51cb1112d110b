"""Clearances between samples: the plant's motion inside a period is known."""

from __future__ import annotations

import numpy as np

from ..control_step import ControlStep
from ..rows import Array
from .plant import Plant
from .setup import Setup

BETWEEN = (0.25, 0.5, 0.75)
"""Where inside a sampling period clearances are inspected, as fractions of it."""

NEAR = 0.05
"""Clearance, as a fraction of the characteristic length, below which the inside of a period may be inspected."""

DIP = 2.0, 0.001
"""How much less than at both its ends a clearance may be inside a period: a multiple of the greatest change of the
run from one sample to the next, and a fraction of the characteristic length.

Half the change would do at a constant rate; periods whose ends are farther than that above the run's least are left
out, unless a joint turns back inside.
"""

BACK = 1e-5
"""Way that a joint goes out and back inside a period [rad or m] from which on its turning counts."""


def between_clearance(setup: Setup, control: ControlStep, plant: Plant, states: Array, clearance: Array) -> Array:
    """(N, m) least clearance inside the period after each sample; infinite where none was inspected.

    Inspected are periods inside which a row may be outside, or have its least clearance of the run: near its boundary
    (:data:`NEAR`), and not far from it or from its least in the samples (:data:`DIP`), or such that a joint turns back
    inside (:data:`BACK`).

    Parameters
    ----------
    setup, control, plant
        What was run.
    states
        (N, s, n) of the plant in the samples, at which periods begin.
    clearance
        (N, m) in the samples.
    """
    N, m = clearance.shape
    least = np.full((N, m), np.inf)
    if m == 0 or N < 2:
        return least
    near = NEAR * setup.constraints.characteristic_length
    ends = np.minimum(clearance[:-1], clearance[1:])
    with np.errstate(invalid="ignore"):
        change = np.abs(np.diff(clearance, axis=0)).max(axis=0)
    change[~np.isfinite(change)] = np.inf
    dip = DIP[0] * change + DIP[1] * setup.constraints.characteristic_length
    inspected = (ends < np.fmin(near, np.maximum(clearance.min(axis=0), 0.0) + dip)).any(axis=1)
    turn = -(states[:-1, 1] * states[1:, 1]).min(axis=1) > (4.0 * BACK / setup.Ts) ** 2
    periods = np.flatnonzero(inspected | turn & (ends < near).any(axis=1))
    for share in BETWEEN if len(periods) else ():
        q, qd = plant.within(states, periods, share)
        t = (periods + share) * setup.Ts
        pixels, points, seen = control.views(t, q)
        if not seen.any():
            continue
        at = periods[seen]
        there = setup.clearance(t[seen], q[seen], qd[seen], pixels[seen], points[seen])
        least[at] = np.minimum(least[at], there)
    return least
