"""``python -m checks.ranks``: effect of the rank tolerance on the paper's scenes.

Footnote 3 of the paper sets "very small" singular values to zero and gives no number. Each scene is
simulated with the default tolerance of the resolver ``priority`` and with larger ones. The exit
code is 1 if commands are not bitwise equal up to the tolerance ``UNCHANGED``. For larger tolerances
on redundant arms see ``comparisons/rank-tolerance.toml``.
"""

from __future__ import annotations

import sys

import numpy as np

from vsconstraints.controllers import SlidingMode
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Trajectory, simulate

SCENES = (
    "example-2d-fov",
    "example-2d-bowl",
    "example-2d-heart-convex",
    "example-2d-heart-concave",
    "example-2d-fast",
    "example-2d-fast-high-gain",
    "case-study-6r",
    "experiment-1-pbvs",
    "experiment-1-pbvs-gradient-error",
    "experiment-2-ibvs",
    "experiment-2-ibvs-gradient-error",
)
TOLERANCES = (1e-4, 1e-3, 1e-2, 3e-2, 1e-1)
UNCHANGED = 1e-4  #: Tolerance up to which the paper's scenes do not change.


def run(scene: str, **options: float) -> Trajectory:
    """Run the paper's law on a scene."""
    return simulate(Scenario.load(scene).setup(), SlidingMode(**options))


def main() -> int:
    """Print a line for each scene; return the exit code."""
    changed = False
    print("scene: largest command [rad/s²]; by tolerance the largest difference and how it ends")
    for scene in SCENES:
        usual = run(scene)
        cells = [f"{np.abs(usual.qdd_command).max():.3g}"]
        for tolerance in TOLERANCES:
            other = run(scene, rank_tolerance=tolerance)
            common = min(len(usual.t), len(other.t))
            difference = np.abs(usual.qdd_command[:common] - other.qdd_command[:common]).max()
            same = difference == 0.0 and len(usual.t) == len(other.t)
            changed |= not same and tolerance <= UNCHANGED
            amount = "same" if same else f"{difference:.1g}"
            cells.append(f"{tolerance:g}: {amount}, {other.status}")
        print(f"{scene}: {'; '.join(cells)}", flush=True)
    return int(changed)


if __name__ == "__main__":
    sys.exit(main())
