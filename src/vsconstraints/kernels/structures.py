"""What the compiled step and the laws work on, by name: arrays of records for what does not change, and outputs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..rows import Array, BoolArray, IntArray

Records = NDArray[np.void]

POSE = [("R", "f8", (3, 3)), ("t", "f8", (3,))]

MOTION = np.dtype([("velocity", "f8", (3,)), ("amplitude", "f8", (3,)), ("rate", "f8"), ("phase", "f8")])
"""d(t) of :class:`vsconstraints.motion.Motion`; of one in the image the third coordinate is zero."""

JOINT = np.dtype([*POSE, ("axis", "f8", (3,)), ("prismatic", "i8")])
"""A joint: its placement in the body before it, its axis there, and whether it moves along it."""

CAMERA = np.dtype(
    [
        *POSE,
        ("tip_R", "f8", (3, 3)),
        ("tip_t", "f8", (3,)),
        ("focal", "f8", (2,)),
        ("offset", "f8", (2,)),
        ("fixed", "i8"),
    ]
)
"""The camera: its pose in the last body, or in the base frame if it is ``fixed``; the tip's in the last body; focal
lengths, and what is added to pixels."""

TARGET = np.dtype(
    [("moves", "i8"), ("known", "i8"), ("motion", MOTION), ("angular_velocity", "f8", (3,)), ("centre", "f8", (3,))]
)
"""See :class:`vsconstraints.motion.TargetMotion`."""

POINT = np.dtype([("body", "i8"), ("offset", "f8", (3,))])
"""A robot point: the body (0 is the base) and where it is in its frame."""

TASK = np.dtype(
    [
        ("feature", "i8"),
        ("share", "f8"),
        ("drift_by_differences", "i8"),
        ("velocity_by_differences", "i8"),
        ("Kp0", "f8"),
        ("slope", "f8"),
        ("damping", "f8"),
    ]
)
"""See :class:`vsconstraints.tracking.VisualTask`; ``share`` is that of the goal's L: 0, 1 or a half."""

GOAL = np.dtype([("from_time", "f8"), *POSE])
"""When a goal begins, and the camera's pose there."""

PART = np.dtype(
    [
        ("address", "i8"),
        ("first", "i8"),
        ("count", "i8"),
        ("K", "f8"),
        ("margin", "f8"),
        *POSE,
        ("moves", "i8"),
        ("known", "i8"),
        ("motion", MOTION),
    ]
)
"""A constraint: where its compiled rows begin; its first row, and how many it has; K; margin; the frame in which its
formula is written (in the image R[:2, :2] and t[:2]); how what it forbids moves."""


class RowArrays(NamedTuple):
    """Rows as compiled laws take them; see :class:`vsconstraints.rows.Rows`. (m,) each, L_gφ (m, n)."""

    phi: Array
    Lg: Array
    Lf: Array
    sigma: Array
    sigma_dot: Array
    K: Array
    switching_gain: Array
    scale: Array


class TaskArrays(NamedTuple):
    """A task as compiled laws take it; see :class:`vsconstraints.rows.Task`. J (k, n), the others (k,)."""

    J: Array
    b: Array
    error: Array
    error_rate: Array


class Answer(NamedTuple):
    """What compiled laws write: q̈ (n,), which rows acted (m,), what they leave unmet (m,), and iterations (1,)."""

    qdd: Array
    acted: BoolArray
    slack: Array
    iterations: IntArray
