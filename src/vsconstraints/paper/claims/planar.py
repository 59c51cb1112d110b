"""Claims 1 to 4: section 8, the planar arm with the FOV constraint, in a trap and at corners."""

from __future__ import annotations

import numpy as np

from ...comparisons.run import Run
from ...comparisons.runs.spec import RunSpec
from ...rows import Array
from ..verdicts import Finding, claim, finding, register_formulas
from . import boundary
from .boundary import VANISHED, clear, excess, phi_never_positive

FOV = RunSpec("example-2d-fov")
FAST = RunSpec("example-2d-fast")
HIGH_GAIN = RunSpec("example-2d-fast-high-gain")
SAMPLED_FASTER = RunSpec("example-2d-fast-high-gain", overrides={"sampling_time": 0.001})
HALVED = RunSpec("example-2d-fov", overrides={"sampling_time": 0.0025})
BOWL = RunSpec("example-2d-bowl")
CONVEX = RunSpec("example-2d-heart-convex")
CONCAVE = RunSpec("example-2d-heart-concave")

FIRST, SECOND = "fov[marker 1]", "fov[marker 2]"
HEART, BOWL_ROW, OTHER_ROW = "occlusion[heart, marker 1]", "occlusion[bowl, marker 1]", "occlusion[bowl, marker 2]"
#: The heart's concave corner in Fig. 8, and its convex one in Fig. 7, where the heart is turned [px].
NOTCH, TIP = (-102.0, 35.0), (-137.0, 0.0)


def position(run: Run) -> Array:
    """(N,) distance between camera and goal [m]."""
    return run.trajectory.camera_error[:, 0]


def angle(run: Run) -> Array:
    """(N,) angle between camera and goal [rad]."""
    return run.trajectory.camera_error[:, 1]


def first_marker(run: Run) -> Array:
    """(N, 2) where it is in the image [px]."""
    return run.trajectory.features_px[:, 0]


def greatest_step(values: Array) -> float:
    """Of signals (N, k), from one sample to the next."""
    return float(np.abs(np.diff(values, axis=0)).max())


def band(run: Run) -> float:
    """Peak-to-peak φ while the second feature's row acts."""
    return float(np.ptp(run.while_sliding(SECOND)))


@claim("1e", FOV)
def _position_error_arises_and_vanishes(fov: Run) -> Finding:
    error, acts = position(fov), fov.active_intervals(SECOND)
    if not acts:
        return Finding("does not hold", "the constraint never becomes active")
    start, end = acts[0][0], acts[-1][1]
    peak, when = error.max(), float(fov.t[error.argmax()])
    before, last = error[fov.t < start].max(initial=0.0), error[-1]
    arises, vanishes = before < VANISHED * peak and start <= when <= end, last < VANISHED * peak
    values = {"before": before, "peak": peak, "peak_at": when, "last": last}
    return finding("1e", arises and vanishes, arises or vanishes, {"start": start}, **values)


@claim("3e", BOWL)
def _both_features_stay_out(bowl: Run) -> Finding:
    labels = BOWL_ROW, OTHER_ROW
    both, needed = phi_never_positive(bowl, labels), bowl.drift[:, bowl.index(OTHER_ROW)].max()
    rows = [
        (row, bowl.phi(row).max(), excess(bowl, row), bowl.positive_samples(row), clear(bowl, row)) for row in labels
    ]
    shown = {"rows": rows, "needed": needed}
    return finding("3e", both.verdict == "holds", both.verdict == "holds partly", shown, **both.values)


register_formulas(vars(boundary) | globals())
