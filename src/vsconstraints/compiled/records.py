"""Records of compiled functions: small structures of numbers, stored next to each other in arrays.

Compiled code takes their fields as attributes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Records = Any  #: Array of records.
F8 = np.dtype("f8")
I8 = np.dtype("i8")
BOOL = np.dtype("?")
V3 = (3,)
M3 = (3, 3)


def record(*fields: tuple[str, Any] | str) -> np.dtype[Any]:
    """Return a type of records of floats.

    A field is a name or (name, shape). ``#name`` is an integer, (name, type) another record.
    """
    columns: list[Any] = []
    for field in fields:
        if isinstance(field, tuple):
            name, kind = field
            is_record = isinstance(kind, np.dtype)
            columns.append((name, kind) if is_record else (name, F8, kind))
        elif field.startswith("#"):
            columns.append((field[1:], I8))
        else:
            columns.append((field, F8))
    return np.dtype(columns)


POSE = ("R", M3), ("t", V3)

#: d(t) of :class:`vsconstraints.vision.motion.Motion`; the third coordinate of a motion in the
#: image is zero.
MOTION = record(("velocity", V3), ("amplitude", V3), "rate", "phase")
#: Placement on the previous body, axis there, and 1 if the joint moves along it. ``continuous``: 1
#: if the joint turns without limits, so that its angles count modulo 2π.
JOINT = record(*POSE, ("axis", V3), "#prismatic", "#continuous")
#: Pose in the last body, or in the base frame if ``fixed``; pose of the tip in the last body; focal
#: lengths and offset of pixels; factor of believed depths.
CAMERA = record(
    *POSE, ("tip_R", M3), ("tip_t", V3), ("focal", (2,)), ("offset", (2,)), "depth_factor", "#fixed"
)
#: See :class:`vsconstraints.vision.motion.TargetMotion`.
TARGET = record("#moves", "#known", ("motion", MOTION), ("angular_velocity", V3), ("centre", V3))
#: Robot point: its body (0 is the base) and its place in the frame of that body.
POINT = record("#body", ("offset", V3))
#: See :class:`vsconstraints.vision.tracking.VisualTask`; ``share`` is the share of the goal's L: 0,
#: 1 or a half.
TASK = record(
    "#feature",
    "share",
    "#drift_by_differences",
    "#velocity_by_differences",
    "#reference_by_differences",
    "Kp0",
    "slope",
    "damping",
    "rest_damping",
    "rest_stiffness",
)
#: Start time of a goal, duration in which s_ref gets there (0: at once), and the camera's pose
#: there.
GOAL = record("from_time", "reach_in", *POSE)
#: Constraint: function of its rows; first row and number of rows; K; margin; frame of its formula
#: (in the image R[:2, :2] and t[:2]); motion of the forbidden region.
PART = record(
    "#address", "#first", "#count", "K", "margin", *POSE, "#moves", "#known", ("motion", MOTION)
)
#: Body in the base frame, for q̈ = 0: orientation, origin, axis of its joint, ω, v of the origin,
#: ω̇, v̇.
BODY = record(
    ("R", M3),
    ("origin", V3),
    ("axis", V3),
    ("angular_velocity", V3),
    ("velocity", V3),
    ("angular_acceleration", V3),
    ("acceleration", V3),
)
#: Marker in the image: normalised coordinates, their first and, for q̈ = 0, second derivative, and
#: Z.
MARKER = record(("xy", (2,)), ("velocity", (2,)), ("drift", (2,)), "depth")
#: Robot point in the base frame, its velocity and, for q̈ = 0, its acceleration.
PLACE = record(("position", V3), ("velocity", V3), ("drift", V3))
#: Camera: orientation and origin in the base frame; v, ω, v̇ and ω̇ (for q̈ = 0) relative to the
#: target, in the camera's axes.
EYE = record(
    ("R", M3),
    ("origin", V3),
    ("velocity", V3),
    ("angular_velocity", V3),
    ("acceleration", V3),
    ("angular_acceleration", V3),
)
#: 1 if pixels are measured, 1 if the camera's pose is measured, and the time of the measurement.
MEASUREMENT = record("#given", "#pose_given", "time")
#: Camera's pose in the target's frame at some time, as far as the motion is known.
VIEW = record("time", ("R", M3), ("t", V3))
#: Function that applies an error to gradients, or 0; 1 if it applies to φ and L_fφ too.
GRADIENT_ERROR = record("#address", "#in_phi")
#: Previous sample; goal −1 if there is none; time of its goal's first sample; number of views so
#: far.
SAMPLE = record("time", "#goal", "began", "#views")
#: Addresses that a closed loop uses, 0 where Python does the work: function that evaluates a step;
#: step of the controller and of the simulated world; law, and law of the unconstrained baseline;
#: function that writes measurements to the controller's step, and its workspace; function that
#: moves a plant without a transition matrix, and its workspace.
LOOP_PARTS = record(
    "#evaluate",
    "#believed",
    "#true",
    "#law",
    "#baseline",
    "#observe",
    "#sensing",
    "#move",
    "#plant",
)
VIEWS = 256  #: Number of samples whose camera pose is stored.
