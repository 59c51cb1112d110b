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

BLOCK = 25
"""Calls of one subject in a row, before it is the next one's turn: at most a few milliseconds."""

UNIT = "numpy.linalg.pinv of 8×6"
"""What every time is divided by, in the same run."""

Subject = Callable[[int], Array]
"""Given the number of its turn, makes :data:`BLOCK` calls and gives their times [ns], (calls,) or (calls, parts)."""


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

    def turn(_: int) -> Array:
        times = np.empty(BLOCK)
        for i in range(BLOCK):
            started = perf_counter_ns()
            function()
            times[i] = perf_counter_ns() - started
        return times

    return turn


def in_turn(subjects: Mapping[str, Subject], turns: int) -> dict[str, Array]:
    """Times [s] of every subject and of :data:`UNIT`, (calls, ...) each; a turn of each goes before, unmeasured.

    Subjects are called in blocks: one block of each, then the next block of each.
    """
    everything = {UNIT: unit_subject(), **subjects}
    for subject in everything.values():
        subject(0)
    found: dict[str, list[Array]] = {name: [] for name in everything}
    with without_old_garbage():
        for turn in range(turns):
            for name, subject in everything.items():
                found[name].append(subject(turn))
    return {name: 1e-9 * np.concatenate(times) for name, times in found.items()}


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
