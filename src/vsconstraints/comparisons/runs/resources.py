"""How many processes make sense here, and how long a run may take."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

PROCESS_MEMORY = 300e6
"""What a process takes that simulates [bytes]: the interpreter, Pinocchio, the compiler and a trajectory."""

LEAST_LIMIT, LIMIT_PER_SAMPLE = 120.0, 0.1
"""A run may take this long, and in addition so long per sample [s]: shipped laws take 1e-5 to 1e-3 s per sample, and
the first run of a process may have to compile."""


def cores() -> int:
    """Cores that this process may use, which can be fewer than there are."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # only Linux says so
        return os.cpu_count() or 1


def process_count(asked: int | None = None) -> int:
    """How many processes to use: as many as asked for, but no more than there are cores and memory for.

    Parameters
    ----------
    asked
        As many as possible if None.
    """
    fitting = int(available_memory() // PROCESS_MEMORY)
    return max(1, min(asked or cores(), cores(), fitting))


def available_memory() -> float:
    """Memory that can be had without swapping [bytes]; all there is where the system does not say."""
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return 1024.0 * float(line.split()[1])
    except OSError:
        pass
    return float(os.sysconf("SC_PHYS_PAGES")) * float(os.sysconf("SC_PAGE_SIZE"))


def most_samples(tables: Mapping[str, Any]) -> float:
    """How many samples a run of a scenario may leave; without a bound where its tables hold no numbers.

    It may take three durations until it settles, and on an arm it also holds the periods of its stop.
    """
    try:
        return 1000.0 + 4.0 * float(tables["duration"]) / float(tables["sampling_time"])
    except (KeyError, TypeError, ValueError, ArithmeticError):  # a family may draw them
        return math.inf


def run_limit(tables: Mapping[str, Any]) -> float:
    """How long the run of a scenario may take [s], from its ``duration`` and ``sampling_time``."""
    try:
        return LEAST_LIMIT + LIMIT_PER_SAMPLE * float(tables["duration"]) / float(tables["sampling_time"])
    except (KeyError, TypeError, ValueError, ArithmeticError):  # it is said where the scenario is built
        return LEAST_LIMIT
