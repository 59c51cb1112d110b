"""What the compiled step knows, as records by name: arrays of them cost compiled code nothing."""

from __future__ import annotations

from typing import Any

import numpy as np

Records = Any
"""Arrays of records, whose fields compiled code takes as attributes."""

POSE = [("R", "f8", (3, 3)), ("t", "f8", (3,))]

MOTION = np.dtype([("velocity", "f8", (3,)), ("amplitude", "f8", (3,)), ("rate", "f8"), ("phase", "f8")])
"""d(t) of :class:`vsconstraints.vision.motion.Motion`; of one in the image the third coordinate is zero."""

JOINT = np.dtype([*POSE, ("axis", "f8", (3,)), ("prismatic", "i8")])
"""A joint: its placement in the body before it, its axis there, and whether it moves along it."""

CAMERA = np.dtype(
    [
        *POSE,
        ("tip_R", "f8", (3, 3)),
        ("tip_t", "f8", (3,)),
        ("focal", "f8", (2,)),
        ("offset", "f8", (2,)),
        ("depth_factor", "f8"),
        ("fixed", "i8"),
    ]
)
"""The camera: its pose in the last body, or in the base frame if it is ``fixed``; the tip's in the last body; focal
lengths, and what is added to pixels; the factor by which depths are taken for others than they are."""

TARGET = np.dtype(
    [("moves", "i8"), ("known", "i8"), ("motion", MOTION), ("angular_velocity", "f8", (3,)), ("centre", "f8", (3,))]
)
"""See :class:`vsconstraints.vision.motion.TargetMotion`."""

POINT = np.dtype([("body", "i8"), ("offset", "f8", (3,))])
"""A robot point: the body (0 is the base) and where it is in its frame."""

TASK = np.dtype(
    [
        ("feature", "i8"),
        ("share", "f8"),
        ("drift_by_differences", "i8"),
        ("velocity_by_differences", "i8"),
        ("reference_by_differences", "i8"),
        ("Kp0", "f8"),
        ("slope", "f8"),
        ("damping", "f8"),
        ("rest_damping", "f8"),
        ("rest_stiffness", "f8"),
    ]
)
"""See :class:`vsconstraints.vision.tracking.VisualTask`; ``share`` is that of the goal's L: 0, 1 or a half."""

GOAL = np.dtype([("from_time", "f8"), ("reach_in", "f8"), *POSE])
"""When a goal begins, how long s_ref takes to get there (0: it is there at once), and the camera's pose there."""

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
        ("R", "f8", (3, 3)),
        ("origin", "f8", (3,)),
        ("velocity", "f8", (3,)),
        ("angular_velocity", "f8", (3,)),
        ("acceleration", "f8", (3,)),
        ("angular_acceleration", "f8", (3,)),
    ]
)
"""The camera: orientation and origin in the base frame; v, ω, v̇ and ω̇ (q̈ = 0) relative to the target, in its axes."""

MEASUREMENT = np.dtype([("given", "i8"), ("time", "f8"), ("pose_given", "i8")])
"""What a camera has measured: whether pixels are given, and when they were taken; whether its pose is."""

GRADIENT_ERROR = np.dtype([("address", "i8"), ("in_phi", "i8")])
"""Where what spoils gradients begins, or 0; whether it spoils φ and L_fφ too."""

SAMPLE = np.dtype([("time", "f8"), ("goal", "i8"), ("began", "f8")])
"""The last sample that the task remembers, goal −1 if there is none; the time of its goal's first sample."""
