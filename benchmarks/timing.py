"""Wall times of single calls, taken in turn, so that a busy machine affects all equally.

The module depends only on NumPy, so that peers can be timed in a separate environment.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter_ns
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

UNIT = "numpy.linalg.pinv of 8×6"
"""Subject that all times of the same run are divided by."""

Subject = Callable[[int], float | tuple[float, ...]]
"""Makes one call, given the number of its turn; returns its time [ns], or times of its parts."""


@dataclass(frozen=True)
class Times:
    """Times of one subject.

    Attributes
    ----------
    seconds
        Times of its calls (N,).
    unit
        Median time of :data:`UNIT`, taken in turn with them [s].
    """

    seconds: Array
    unit: float

    @property
    def median(self) -> float:
        """Median [s]."""
        return float(np.median(self.seconds))

    @property
    def p99(self) -> float:
        """99th percentile [s]."""
        return float(np.quantile(self.seconds, 0.99))

    @property
    def max(self) -> float:
        """Maximum [s]."""
        return float(self.seconds.max())

    @property
    def ratio(self) -> float:
        """Median in units."""
        return self.median / self.unit

    @property
    def spread(self) -> float:
        """p99 as a multiple of the median."""
        return self.p99 / self.median


def unit_subject() -> Subject:
    """Return the unit: the pseudoinverse of a fixed random matrix."""
    A = np.random.default_rng(86).normal(size=(8, 6))
    return each_call(lambda: np.linalg.pinv(A))


def each_call(function: Callable[[], object]) -> Subject:
    """Return a subject that calls the same function in each turn."""

    def turn(_: int) -> float:
        started = perf_counter_ns()
        function()
        return perf_counter_ns() - started

    return turn


def in_turn(subjects: Mapping[str, Subject], turns: int) -> dict[str, Array]:
    """Times [s] of each subject and of :data:`UNIT`, (turns,) or (turns, parts) each.

    Each turn calls every subject once. A call thus does not find the caches as its own last call
    left them, as it would if it were repeated at once. One unmeasured turn goes first.
    """
    everything = {UNIT: unit_subject(), **subjects}
    for subject in everything.values():
        subject(0)
    found: dict[str, list[float | tuple[float, ...]]] = {name: [] for name in everything}
    with without_old_garbage():
        for turn in range(turns):
            for name, subject in everything.items():
                found[name].append(subject(turn))
    return {name: 1e-9 * np.array(times, dtype=np.float64) for name, times in found.items()}


def compare(subjects: Mapping[str, Callable[[], object]], turns: int) -> dict[str, Times]:
    """Apply :func:`in_turn` to functions without arguments; the unit is among the results."""
    times = in_turn({name: each_call(function) for name, function in subjects.items()}, turns)
    unit = float(np.median(times[UNIT]))
    return {name: Times(seconds, unit) for name, seconds in times.items()}


@contextmanager
def without_old_garbage() -> Iterator[None]:
    """Collect garbage as usual, but do not search objects that existed before."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
