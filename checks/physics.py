"""Arm with mass compared with MuJoCo: ``python -m checks.physics`` prints the differences.

The closed loop runs twice with the same law, controller, friction and gears, once on the plant of
this package and once on MuJoCo's, and joint paths are compared. It needs the extra ``physics``.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np

from vsconstraints.controllers import HierarchicalQP
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

RODS = {"mass_per_length": 20.0, "radius": 0.05}
SCENES = ("case-study-6r", "ur5-fov", "panda-fov")
PLANTS = {
    "computed torque": {"controller": "computed-torque"},
    "computed torque, wrong model": {
        "mass_factor": 1.1,
        "payload": {"mass": 0.5},
        "payload_factor": 0.0,
    },
    "position loop, friction, delays": {
        "controller": "position",
        "friction": {"viscous": 0.3, "coulomb": 0.5},
        "dead_time": 0.0004,
        "lag": 0.001,
    },
}
PLANTS["the same, with Stribeck's rise"] = PLANTS["position loop, friction, delays"] | {
    "friction": {"viscous": 0.3, "coulomb": 0.5, "static": 0.8}
}
SWINGING = {("panda-fov", name) for name in PLANTS if not name.startswith("computed torque")}
"""Scenes and plants that cannot be compared.

With the gains of the scene and a loop that slow, even tracking without rows oscillates more and
more, and rounding determines the difference of two diverging paths.
"""

TOLD = {"the same, with Stribeck's rise"}
"""Plants that are printed but not judged.

With friction that falls with speed, rounding determines when slips begin. In the case study the two
are 1.5e-3 rad apart with ten substeps and 2.9e-3 with twenty, so this is no error of integration;
without the rise of friction they are 2.4e-7 apart.
"""

MOST = 1e-3
"""Greatest accepted difference of a joint's path [rad]."""


def difference(scene: str, settings: dict[str, object], duration: float | None = None) -> float:
    """Greatest difference of a joint [rad] between the two plants, over the whole run."""
    scenario = Scenario.load(scene)
    if duration is not None:
        scenario = scenario.with_override("duration", duration)
    own = {"rods": RODS} if scene == "case-study-6r" else {}
    paths = [
        simulate(
            scenario.with_override("plant", {"type": kind, **own, **settings}).setup(),
            HierarchicalQP(),
        ).q
        for kind in ("dynamics", "mujoco")
    ]
    N = min(map(len, paths))
    return (
        float(np.abs(paths[0][:N] - paths[1][:N]).max())
        if len(paths[0]) == len(paths[1])
        else np.inf
    )


def main(arguments: Sequence[str]) -> int:
    """Print one line per scene and plant; return 1 if a difference is greater than accepted."""
    worst = 0.0
    for scene in arguments or SCENES:
        for name, settings in PLANTS.items():
            if (scene, name) in SWINGING:
                print(f"{scene}: {name}: swings, left out", flush=True)
                continue
            apart = difference(scene, settings)
            worst = worst if name in TOLD else max(worst, apart)
            print(
                f"{scene}: {name}: {apart:.2g} rad{', not judged' if name in TOLD else ''}",
                flush=True,
            )
    print(f"at most {worst:.2g} rad; accepted are {MOST:g}")
    return int(worst > MOST)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
