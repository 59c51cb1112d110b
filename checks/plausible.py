"""``python -m checks.plausible [SCENES]``: false alarms of plausibility checks, and their delay.

Scenes of every family are run with their noise, delays and calibration errors, and their measured
images are compared with the kinematics as on an arm: see :class:`.Plausible`, whose defaults follow
from the printed numbers. Then the same images are shown mirrored, permuted, frozen and so on. The
exit code is 1 if a correct image is rejected.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

import numpy as np

from vsconstraints.bench.families import Family, families
from vsconstraints.constraints import ConstraintSet
from vsconstraints.control import ControlStep
from vsconstraints.controllers import HierarchicalQP
from vsconstraints.errors import SceneError
from vsconstraints.rows import Array
from vsconstraints.simulation import Setup, Trajectory, simulate
from vsconstraints.vision.camera import Camera
from vsconstraints.vision.measurement import INNOVATIONS, Measurement, Plausible
from vsconstraints.vision.scene import Scene

CONDITIONS = dict.fromkeys((name for name in families() if "ladder" not in name), "disturbed")
"""Families, and the condition with realistic sensor errors."""

EVERY = 10
"""Interval of examined samples."""

FAULTS: dict[str, Callable[[Array, Array, Camera], Array]] = {
    "right": lambda seen, first, camera: seen,
    "mirrored": lambda seen, first, camera: seen * (-1.0, 1.0),
    "upside down": lambda seen, first, camera: -seen,
    "from the corner": lambda seen, first, camera: seen + 0.5 * np.asarray(camera.size),
    "in metres": lambda seen, first, camera: camera.normalised(seen),
    "two markers exchanged": lambda seen, first, camera: seen[[1, 0, *range(2, len(seen))]],
    "frozen": lambda seen, first, camera: first,
    "depth in millimetres": lambda seen, first, camera: seen,
}
"""Faults of correct pixels (M, 2), given also the first pixels."""

DEPTH_FACTORS = {"depth in millimetres": 1000.0}
"""Faults of correct depths."""


def innovations(setup: Setup, run: Trajectory) -> dict[str, Array]:
    """Innovations (N, 8) of every ``EVERY``-th sample for each fault; see :func:`.innovation`."""
    sensor = setup.sensor()
    disturbances = setup.disturbances
    Ts = setup.Ts
    sensor.images(len(run.t))
    scene = sensor.believed
    every = round((disturbances.image_period or Ts) / Ts)
    camera = scene.camera
    half = 0.5 * np.asarray(scene.camera.size)
    first = None
    nothing = ConstraintSet([], Scene(scene.robot, camera, scene.markers, (), scene.motion))
    world = setup.world()
    steps = {name: ControlStep(nothing.scene, nothing, setup.task) for name in FAULTS}
    found: dict[str, list[Array]] = {name: [] for name in FAULTS}
    for k in range(len(run.t)):
        t = float(run.t[k])
        q = run.q[k]
        qd = run.qd[k]
        try:
            measured = sensor.measured(k, q, qd, world.evaluate(t, q, qd))
        except SceneError:
            break
        seen = (
            run.features_px[k] if measured is None or measured.pixels is None else measured.pixels
        )
        first = seen if first is None else first
        if k % EVERY:
            continue
        inside = (np.abs(seen) <= half).all(axis=1)
        taken = max((k // every - disturbances.delay) * every, 0) * Ts
        pose = measured.camera if measured is not None and inside.all() else None
        depth = (
            scene.depth(scene.camera_pose(q, t))
            if measured is None or measured.depth is None
            else measured.depth
        )
        for name, wrong in FAULTS.items():
            shown = wrong(np.where(inside[:, None], seen, np.nan), first, camera)
            steps[name].packed.step.slip[:] = np.nan  # speeds are correct
            try:
                given = Measurement(shown, DEPTH_FACTORS.get(name, 1.0) * depth, taken, pose)
                steps[name].evaluate_measured(t, q, qd, given.checked(len(shown), t))
            except SceneError:  # the believed camera sees less
                return {name: np.array(each) for name, each in found.items()}
            found[name].append(steps[name].innovation.copy())
    return {name: np.array(each) for name, each in found.items()}


def main(arguments: Sequence[str]) -> int:
    """Print greatest innovations of correct images, then the delay until faults are noticed."""
    scenes = int(arguments[0]) if arguments else 20
    doubted = runs = samples = 0
    print(f"family, condition: {', '.join(INNOVATIONS)}: greatest (the 99.9 % quantile)")
    delays: dict[str, list[float]] = {name: [] for name in FAULTS if name != "right"}
    for family, condition in CONDITIONS.items():
        found = []
        for number in range(scenes):
            drawn = Family.load(family).scene(number, half="training")
            if not drawn.found:
                continue
            setup = drawn.setup(condition)
            run = simulate(setup, HierarchicalQP())
            off = innovations(setup, run)
            found.append(off["right"])
            runs = runs + 1
            doubted = doubted + bool((off["right"][:, -1] > 1.0).any())
            for name, kept in delays.items():
                beyond = off[name][:, -1] > 1.0
                kept.append(setup.Ts * EVERY * float(np.argmax(beyond)) if beyond.any() else np.inf)
        all_of = np.concatenate(found)
        samples += len(all_of)
        cells = ", ".join(
            f"{most:.3g} ({usual:.3g})"
            for most, usual in zip(
                all_of[:, :-1].max(axis=0), np.quantile(all_of[:, :-1], 0.999, axis=0), strict=True
            )
        )
        print(f"{family}, {condition}: {cells}", flush=True)
    print(f"{Plausible()}")
    rare = 1.0 - 0.05 ** (1.0 / max(runs, 1))
    print(f"right images are doubted in {doubted} of {runs} runs, of {samples} samples", end="")
    print(f": with none, in less than {100.0 * rare:.2g} % (95 %)" if not doubted else "")
    for name, kept in delays.items():
        times = np.array(kept)
        at_once = int((times == 0.0).sum())
        never = int(np.isinf(times).sum())
        print(
            f"{name}: doubted before anything moves in {at_once}, never in {never} of {len(kept)} "
            f"runs; ",
            end="",
        )
        print(f"median {np.median(times):.3g} s")
    return int(doubted > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
