"""The safety filter: as near as possible to the tracking command."""

from __future__ import annotations

from typing import ClassVar

from .hierarchy import Hierarchy


class Filter(Hierarchy):
    """Of all q̈ in the box that violate the demands least, the one nearest to the command that tracks.

    One quadratic program, min ‖q̈ − q̈_track‖² subject to A q̈ ≤ c: the safety filter of control barrier functions. It is
    a :class:`Hierarchy` whose task is to stay at q̈_track, and so spreads over all joints what that would leave to
    those that the task does not need.
    """

    name = "filter"
    filters: ClassVar[bool] = True
