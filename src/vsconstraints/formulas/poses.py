"""How far poses are from each other, and whether that is near enough."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import formula


@formula
def angle(squared_difference: Any) -> Any:
    """Angle between two rotations [rad], from the sum of the squared differences of their matrices."""
    return 2.0 * np.arcsin(np.minimum(1.0, np.sqrt(squared_difference / 8.0)))


@formula
def reached(distance: Any, turn: Any, away: Any, speed: Any, tolerance: Any, by_pose: bool) -> Any:
    """Whether a goal is reached: by distance [m] and angle [rad] of the camera, or by markers [px] alone; and at rest.

    At rest is the arm whose fastest joint has no more than ``speed`` [rad/s or m/s]; ``tolerance`` (4,) are those of
    all four.
    """
    there = (distance <= tolerance[0]) & (turn <= tolerance[1]) if by_pose else away <= tolerance[2]
    return there & (speed <= tolerance[3])
