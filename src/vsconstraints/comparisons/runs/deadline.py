"""A process that ends itself when something takes too long, also where compiled code keeps the interpreter busy."""

from __future__ import annotations

import faulthandler
import os
import time
from types import TracebackType

SLACK = 1.0
"""A step may take so much longer than its limit [s]: setting the clock for every short one would take a share of it."""


class Deadline:
    """Ends this process if a step takes longer than its limit; one at a time in a process.

    Parameters
    ----------
    limit
        How long a step may take [s]; for ever if None.
    """

    def __init__(self, limit: float | None) -> None:
        self._limit, self._set = limit, -float("inf")

    def __enter__(self) -> Deadline:
        if self._limit is not None:
            self._nowhere = open(os.devnull, "w")
        return self

    def step(self) -> None:
        """A step begins, and the one before has ended."""
        now = time.monotonic()
        if self._limit is not None and now - self._set > SLACK:
            self._set = now
            faulthandler.dump_traceback_later(self._limit + SLACK, exit=True, file=self._nowhere)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._limit is not None:
            faulthandler.cancel_dump_traceback_later()
            self._nowhere.close()
