"""Why an attempt at a scene is rejected."""

from __future__ import annotations

from enum import StrEnum


class Reason(StrEnum):
    """The checks' names, in the order in which they are made: those that cost little come first."""

    START_OUT_OF_REACH = "start out of reach"
    """No joint coordinates within the ranges put the camera where it shall start."""
    GOAL_OUT_OF_REACH = "goal out of reach"
    """The same of a goal; where the target moves, of where the goal is at last."""
    START_OUT_OF_RANGE = "start out of joint range"
    GOAL_OUT_OF_RANGE = "goal out of joint range"
    START_BEHIND = "marker behind the camera at the start"
    GOAL_BEHIND = "marker behind the camera at the goal"
    START_UNSEEN = "marker outside the image at the start"
    GOAL_UNSEEN = "marker outside the image at the goal"
    BUILD_REFUSED = "build refused"
    """The scenario of one of the conditions cannot be built."""
    START_FORBIDDEN = "start forbidden"
    """A row is violated at the start: an obstacle, a collision, a range, the field of view."""
    GOAL_FORBIDDEN = "goal forbidden"
    START_HIDDEN = "marker hidden by the robot at the start"
    GOAL_HIDDEN = "marker hidden by the robot at the goal"
    START_REFUSED = "start refused"
    """Anything else for which a run cannot start."""
    NOT_CHALLENGED = "nothing challenged"
    """Tracking alone leaves no row: there is nothing to compare."""
    START_UNDETECTED = "no tag in the first image"
    """In a condition by images no law has anything to begin with."""


class Rejected(Exception):
    """An attempt is given up.

    Attributes
    ----------
    reason
        The check.
    detail
        What it found, for a reader.
    """

    def __init__(self, reason: Reason, detail: str = "") -> None:
        super().__init__(f"{reason}: {detail}" if detail else str(reason))
        self.reason, self.detail = reason, detail
