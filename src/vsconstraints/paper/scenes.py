"""Runs that claims and figures of the paper need, and the labels of their rows."""

from __future__ import annotations

from typing import Any

from ..comparisons.runs.spec import BASELINE, ControllerSpec, RunSpec
from .studies.unselected_experiments import KINDS

# --- First example (section 8): a planar arm with three joints ---

FOV = RunSpec("example-2d-fov")
FAST = RunSpec("example-2d-fast")
HIGH_GAIN = RunSpec("example-2d-fast-high-gain")
SAMPLED_FASTER = RunSpec("example-2d-fast-high-gain", overrides={"sampling_time": 0.001})
HALVED = RunSpec("example-2d-fov", overrides={"sampling_time": 0.0025})
BOWL = RunSpec("example-2d-bowl")
CONVEX = RunSpec("example-2d-heart-convex")
CONCAVE = RunSpec("example-2d-heart-concave")

FIRST = "fov[marker 1]"
SECOND = "fov[marker 2]"
HEART = "occlusion[heart, marker 1]"
BOWL_ROW = "occlusion[bowl, marker 1]"
OTHER_ROW = "occlusion[bowl, marker 2]"
#: Concave corner of the heart in Fig. 8, and convex corner in Fig. 7, where the heart is turned
#: [px].
NOTCH = (-102.0, 35.0)
TIP = (-137.0, 0.0)

# --- Case study (section 9): an arm with six joints ---

CASE = RunSpec("case-study-6r")
CASE_HALVED = RunSpec("case-study-6r", overrides={"sampling_time": 0.001})

# --- Experiments (section 10) ---

PBVS, IBVS = map(RunSpec, KINDS)
#: Runs with the error (49) of the gradient.
PBVS_ERROR, IBVS_ERROR = (RunSpec(f"{scenario}-gradient-error") for scenario in KINDS)
#: Runs with ten times the gain at zero error, at the sampling time of the experiments and at a
#: tenth of it.
FASTER = tuple(
    RunSpec(
        scenario,
        overrides={"task.Kp0": 6.0, "duration": 60.0, "sampling_time": Ts},
        may_end_early=True,
    )
    for scenario in KINDS
    for Ts in (0.1, 0.01)
)

# --- Claims about every scene with the law ---

#: Actuator limits are removed, because the claims assume that commands are carried out.
UNLIMITED: dict[str, dict[str, Any]] = {
    "ur5-fov": {"limits": {}},
    "panda-fov": {"limits": {}, "constraints.0.switching_gain": 20.0},
}
#: Scenes of the paper, and others with the same law and no disturbance.
SCENES = tuple(
    RunSpec(name, overrides=UNLIMITED.get(name, {}))
    for name in (
        "example-2d-fov",
        "example-2d-fast",
        "example-2d-fast-high-gain",
        "example-2d-bowl",
        "example-2d-heart-convex",
        "example-2d-heart-concave",
        "case-study-6r",
        "experiment-1-pbvs",
        "experiment-2-ibvs",
        "ur5-fov",
        "panda-fov",
        "eye-to-hand-pbvs",
        "free-camera",
    )
)
#: Scene in which φ has no derivative on its boundary (5.5), so that (12) does not apply; see 4b.
NOT_DIFFERENTIABLE = "example-2d-heart-concave"

#: Case study from a start at which the camera turns about another axis than the one to the goal.
TRACKING = RunSpec(
    "case-study-6r", ControllerSpec(BASELINE), {"qd0": [0.2, -0.2, 0.2, 0.6, -0.6, 0.6]}
)
