"""Performance profiles: in how many scenes a law is how near to the best one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InvalidInput
from ...rows import Array
from .inputs import table


@dataclass(frozen=True)
class Profile:
    """Performance profile (Dolan and Moré, Mathematical Programming 91, 2002).

    Attributes
    ----------
    ratios
        (scenes, laws) each law's cost over the least of the scene; infinite where it failed.
    shift
        Added to all costs before: 0 if all are positive.
    """

    ratios: Array
    shift: float

    def share(self, tau: ArrayLike) -> Array:
        """(…, laws) ρ(τ): share of the scenes in which a law's ratio is at most τ. Zero of no scene."""
        given = np.asarray(tau, dtype=float)
        ordered = np.sort(self.ratios, axis=0)
        within = [np.searchsorted(law, given, side="right") for law in ordered.T]
        finite = np.isfinite(self.ratios).sum(axis=0)
        share: Array = np.minimum(np.stack(within, axis=-1), finite) / max(len(ordered), 1)
        return share

    @property
    def solved(self) -> Array:
        """(laws,) share of the scenes in which a law did not fail: where its curve ends."""
        return self.share(np.inf)

    @property
    def steps(self) -> Array:
        """All τ at which a curve steps, in order, beginning with 1."""
        return np.unique(np.concatenate([[1.0], self.ratios[np.isfinite(self.ratios)]]))


def profile(costs: ArrayLike, shift: float | None = None) -> Profile:
    """The profile of (scenes, laws) costs of which less is better, failures at infinity.

    Ratios need positive costs. Where one is not, or on demand, ``shift`` is added to all of them; if it is not given,
    the least cost becomes as great as the median is above it (the mean, if the median is no greater; 1, if all are
    equal), so that a ratio of 2 is a median scene against the best possible one.
    """
    given = table(costs)
    finite = given[np.isfinite(given)]
    if shift is None:
        shift = _shift(finite) if finite.min(initial=1.0) <= 0.0 else 0.0
    moved = given + shift
    if moved.min(initial=1.0) <= 0.0:
        raise InvalidInput(
            f"a profile needs positive costs: the least is {finite.min():g}, and {shift:g} is added to it"
        )
    best = moved.min(axis=1, keepdims=True)
    ratios = np.full(moved.shape, np.inf)
    np.divide(moved, best, out=ratios, where=np.isfinite(moved))
    return Profile(ratios, shift)


def _shift(finite: Array) -> float:
    least = finite.min()
    above = float(np.median(finite) - least) or float(np.mean(finite) - least) or 1.0
    return above - float(least)
