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

BODY = np.dtype(
    [
        ("R", "f8", (3, 3)),
        ("origin", "f8", (3,)),
        ("axis", "f8", (3,)),
        ("angular_velocity", "f8", (3,)),
        ("velocity", "f8", (3,)),
        ("angular_acceleration", "f8", (3,)),
        ("acceleration", "f8", (3,)),
    ]
)
"""A body in the base frame, when q̈ = 0: orientation, origin, axis of its joint, ω, v of the origin, ω̇, v̇."""

MARKER = np.dtype([("xy", "f8", (2,)), ("velocity", "f8", (2,)), ("drift", "f8", (2,)), ("depth", "f8")])
"""A marker in the image: normalised coordinates, their first and, with q̈ = 0, second derivative, and Z."""

PLACE = np.dtype([("position", "f8", (3,)), ("velocity", "f8", (3,)), ("drift", "f8", (3,))])
"""A robot point in the base frame, its velocity and, with q̈ = 0, its acceleration."""

CAMERA_MOTION = np.dtype(
    [
        *POSE,
        ("eye", "f8", (3,)),
        ("base_R", "f8", (3, 3)),
        ("velocity", "f8", (3,)),
        ("angular_velocity", "f8", (3,)),
        ("acceleration", "f8", (3,)),
        ("angular_acceleration", "f8", (3,)),
    ]
)
"""The camera: its pose in the target's frame, position and orientation in the base frame, and v, ω, v̇ and ω̇ (q̈ = 0)
relative to the target, in its own axes."""

SAMPLE = np.dtype([("time", "f8"), ("goal", "i8")])
"""The last sample that the task remembers; goal −1 if there is none."""


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


class Step(NamedTuple):
    """All that the compiled step knows and makes, for m rows, n joints, M markers, P robot points and k features.

    Attributes
    ----------
    joints, camera, markers, robot_points, target
        The scene: (n,) JOINT, (1,) CAMERA, (M, 3) in the target's frame, (P,) POINT, (1,) TARGET.
    options, goals, goal_points, goal_interaction
        The task: (1,) TASK, (g,) GOAL, (g, 2M) normalised markers, (g, 2M, 6) L.
    parts, parameters, which, gradients, offsets
        The constraints: (c,) PART, (c, p) parameters of their formulas; for each row (m,) the marker or robot point,
        and of linear rows (m, n) the gradient and (m,) the constant.
    time, q, qd
        (1,), (n,) and (n,): now.
    last, last_error, last_partial, last_J
        What the task remembers: (1,) SAMPLE, (k,) error, (k,) ∂s/∂t and (k, n) J_s of the sample before.
    bodies, eye, camera_J, seen, places
        (n + 1,) BODY, (1,) CAMERA_MOTION, (6, n) of its twist relative to the target, (M,) MARKER, (P,) PLACE.
    J_point
        (3, n) scratch for the Jacobian of a point.
    rows, task, pixels, points
        What comes out, with (M, 2) pixels and (P, 3) robot points.
    """

    joints: Records
    camera: Records
    markers: Array
    robot_points: Records
    target: Records
    options: Records
    goals: Records
    goal_points: Array
    goal_interaction: Array
    parts: Records
    parameters: Array
    which: IntArray
    gradients: Array
    offsets: Array
    time: Array
    q: Array
    qd: Array
    last: Records
    last_error: Array
    last_partial: Array
    last_J: Array
    bodies: Records
    eye: Records
    camera_J: Array
    seen: Records
    places: Records
    J_point: Array
    rows: RowArrays
    task: TaskArrays
    pixels: Array
    points: Array
