"""Measurements from the images of a run on an arm: their times, and checks that end the run."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import format_value
from ..rows import Array
from ..vision.measurement import Measurement, with_nan
from .images import ImageSource
from .stream import Stream
from .supervision import RunEnded

#: Greatest accepted lead of an image's time stamp [s]: stamps are often whole milliseconds.
MAX_LEAD = 1e-3


class Measurements:
    """Arguments of the control step from the newest image.

    The source of predicted images is None. :meth:`newest` raises RunEnded if no image has shown a
    marker for longer than ``patience`` [s].
    """

    def __init__(self, source: ImageSource | None, stream: Stream, patience: float) -> None:
        self.source = source
        self._stream = stream
        self._patience = patience
        #: Times [s]: of the newest image with a marker, and of the first image that shows the
        #: markers where the newest does.
        self._newest = 0.0
        self._same_since = 0.0

    def newest(self, t: float, q: Array) -> dict[str, Any]:
        """Return the arguments of the control step at a time t [s] and q (n,).

        They are empty if there is no image with a marker. Raises RunEnded if a measurement is not
        valid, or markers have been lost for too long.
        """
        if self.source is None:
            return {}
        seen = self.source(t, q)
        arguments: dict[str, Any] = {}
        if seen is not None:
            if not isinstance(seen, Measurement):
                raise RunEnded(
                    "failed",
                    f"the source of images returned {format_value(seen)}, not a Measurement",
                )
            arguments = self._arguments(seen, t)
        if t - self._newest > self._patience:
            raise RunEnded("failed", f"no image shows a marker since t = {self._newest:.4g} s")
        return arguments

    def _arguments(self, seen: Measurement, t: float) -> dict[str, Any]:
        """Return the arguments of a measurement; empty if it shows neither markers nor a pose."""
        taken = self._time(seen, t)
        pixels = None if seen.pixels is None else with_nan(seen.pixels)
        # hidden markers are NaN
        shows_marker = pixels is not None and not np.isnan(pixels).any(axis=1).all()
        if not shows_marker and seen.camera is None:
            return {}
        self._newest = max(self._newest, taken)
        if not self._is_repeated(pixels):
            self._same_since = taken
        return {"pixels": pixels, "taken": taken, "depth": seen.depth, "camera": seen.camera}

    def _is_repeated(self, pixels: Array | None) -> bool:
        """True if the image of the last period shows the markers at the same places."""
        if pixels is None or not self._stream.periods:
            return False
        return np.array_equal(pixels, self._stream.periods[-1].pixels, equal_nan=True)

    def _time(self, seen: Measurement, t: float) -> float:
        """Return the time of an image [s], at most that of the state; raises RunEnded."""
        if seen.taken is None:
            return t
        taken = _number(seen.taken)
        now = self._stream.now()
        if not taken <= now + MAX_LEAD:  # False also for NaN
            raise RunEnded(
                "failed",
                f"an image's time stamp, {taken:.6g} s, lies {1e3 * (taken - now):.3g} ms in "
                "the future: is it from another clock? Use that of the time with which the "
                f"source is called, which shows {now:.6g} s",
            )
        # an image that came after the state was read counts as taken with it
        return min(taken, t)

    def unchanged_for(self, arguments: dict[str, Any]) -> float:
        """Return the time for which images have shown the markers at the same places [s]."""
        taken: float = arguments.get("taken", self._same_since)
        return taken - self._same_since


def _number(taken: Any) -> float:
    """Return an image's time stamp [s] as a float, which the log can store.

    Raises RunEnded if it is not a number.
    """
    try:
        return float(np.asarray(taken, dtype=np.float64).item())
    except Exception as error:
        raise RunEnded(
            "failed", f"an image's time must be a number [s], not {format_value(taken)}"
        ) from error
