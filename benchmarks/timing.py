"""Wall times of single calls, taken in turn, so that a busy machine hits all subjects alike.

Needs NumPy alone, so that peers can be timed in an environment of their own.
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
"""What every time is divided by, in the same run."""

Subject = Callable[[int], float | tuple[float, ...]]
"""Given the number of its turn, makes one call and gives its time [ns], or the times of its
parts.
"""


@dataclass(frozen=True)
class Times:
    """Times of one subject.

    Attributes
    ----------
    seconds
        (N,) of its calls.
    unit
        Median time of :data:`UNIT`, taken in turn with them [s].
    """

    seconds: Array
    unit: float

    @property
    def median(self) -> float:
        """[s]."""
        return float(np.median(self.seconds))

    @property
    def p99(self) -> float:
        """[s]."""
        return float(np.quantile(self.seconds, 0.99))

    @property
    def max(self) -> float:
        """[s]."""
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
    """The unit: the pseudoinverse of a fixed random matrix."""
    A = np.random.default_rng(86).normal(size=(8, 6))
    return each_call(lambda: np.linalg.pinv(A))


def each_call(function: Callable[[], object]) -> Subject:
    """The subject whose calls are all alike."""

    def turn(_: int) -> float:
        started = perf_counter_ns()
        function()
        return perf_counter_ns() - started

    return turn


def in_turn(subjects: Mapping[str, Subject], turns: int) -> dict[str, Array]:
    """Times [s] of every subject and of :data:`UNIT`, (turns,) or (turns, parts) each.

    One call of each, then the next call of each: no call finds the caches as its own last one has
    left them, as it would where it is repeated at once. A turn of each goes before, unmeasured.
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
    """:func:`in_turn` for functions without arguments; the unit is among the answers."""
    times = in_turn({name: each_call(function) for name, function in subjects.items()}, turns)
    unit = float(np.median(times[UNIT]))
    return {name: Times(seconds, unit) for name, seconds in times.items()}


@contextmanager
def without_old_garbage() -> Iterator[None]:
    """Garbage is collected as ever, but not looked for among what was imported and made before."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
