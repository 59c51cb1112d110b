"""Accuracy of detection and of image-based loops: ``python -m checks.images [SCENE …]``.

First, tags are rendered from many poses, and the positions found by both detectors are compared
with the true ones. Then all laws of the default comparison run scenes of a UR5 with images,
position-based and image-based, and must end at the goal. It needs the extra ``images``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from vsconstraints import Camera
from vsconstraints.comparisons import Suite
from vsconstraints.images.board import Board
from vsconstraints.images.detectors import DETECTORS
from vsconstraints.images.rendering import Renderer
from vsconstraints.images.settings import ImageSettings
from vsconstraints.images.tag_pose import locate_board
from vsconstraints.robots.geometry import Pose, distance
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate
from vsconstraints.vision.features import CameraPose

SCENES = ("ur5-images", "ur5-image")
POSES = 60

MOST_OFFSET = 0.02
MOST_DEVIATION = 0.1
"""Bounds on errors of corners found by AprilTag's detector, at noise 2 [px]."""

MOST_TRANSLATION = 1e-3
MOST_ROTATION = 2e-3
MOST_PIXELS = 1.0
"""Greatest distance of a run's end from its goal.

The first two apply to position-based runs, the last to image-based ones.
"""

END = 0.5
"""Time at the end over which root mean squares are computed [s]."""

MOST_TIME = 2.0
"""Greatest processor time of a run, relative to simulated time."""


class Found(NamedTuple):
    """Results of a detector: offsets (N, 2) of corners [px], errors (P, 2) of the pose [m, rad].

    Also the number of missed tags, and times per image [s].
    """

    offsets: Array
    errors: Array
    missed: int
    rendering: float
    detecting: float


def found(detector: str, settings: ImageSettings, poses: int = POSES) -> Found:
    """Run a detector on four tags of 5 cm, 0.3 to 0.6 m away.

    The camera has 640 × 480 px and F = 600 px.
    """
    markers = 0.07 * np.array(
        [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]
    )
    camera = Camera((600.0, 600.0), (640.0, 480.0))
    find = DETECTORS[detector]()
    rng = np.random.default_rng(0)
    board = Board.of_markers(markers, np.array([0.0, 0.0, 1.0]), 0.05, None)
    renderer = Renderer(board, camera, settings)
    offsets = []
    errors = []
    missed = 0
    spent = np.zeros(2)
    for _ in range(poses):
        angles = np.pi + rng.uniform(-0.35, 0.35), rng.uniform(-0.35, 0.35), rng.uniform(-3.0, 3.0)
        R = Pose.from_xyz_rpy((0.0, 0.0, 0.0), angles).R
        there = Pose(
            R, np.append(rng.uniform(-0.02, 0.02, 2), 0.0) - rng.uniform(0.3, 0.6) * R[:, 2]
        )
        begun = time.process_time()
        image = renderer.render(lambda after, pose=there: pose, rng)
        rendered = time.process_time()
        seen = locate_board(image, find, board, camera)
        spent += rendered - begun, time.process_time() - rendered
        P = there.inverse.act(markers)
        offsets.append((seen.pixels - camera.pixels(P[:, :2] / P[:, 2:]))[seen.seen])
        missed += int((~seen.seen).sum())
        if seen.camera is not None:
            errors.append(distance(seen.camera.inverse, there.inverse))
    return Found(np.concatenate(offsets), np.array(errors), missed, *(spent / poses))


def detection(tell: Callable[[str], None], poses: int = POSES) -> bool:
    """Print results of both detectors; return True if AprilTag's is accurate enough."""
    good = True
    for detector in DETECTORS:
        one = found(detector, ImageSettings(noise=2.0), poses)
        mean = np.abs(one.offsets.mean(axis=0)).max()
        deviation = one.offsets.std(axis=0).max()
        place, turn = np.median(one.errors, axis=0)
        tell(
            f"{detector}: offset {mean:.3f} px, deviation {deviation:.3f} px, board "
            f"{1e3 * place:.3f} mm and "
            f"{1e3 * turn:.2f} mrad, {one.missed} of {4 * poses} tags missed, "
            f"{1e3 * one.rendering:.0f} + "
            f"{1e3 * one.detecting:.0f} ms an image"
        )
        if detector == "apriltag":
            good = mean < MOST_OFFSET and deviation < MOST_DEVIATION
    return good


def closed_loop(scene: str, law: Any, **overrides: object) -> tuple[bool, str]:
    """Run a loop with images; return True if it ends at its goal in time, and a description."""
    scenario = Scenario.load(scene)
    for key, value in {"sensor": "images", **overrides}.items():
        scenario = scenario.with_override(key.replace("__", "."), value)
    setup = scenario.setup()
    begun = time.process_time()
    run = simulate(setup, law)
    spent = time.process_time() - begun
    last = run.t > run.t[-1] - END
    place, turn = np.sqrt((run.camera_error[last] ** 2).mean(axis=0))
    pixels = np.sqrt((run.feature_error_px[last] ** 2).mean())
    view = [i for i, label in enumerate(run.labels) if label.startswith("fov")]
    least = float(run.clearance[:, view].min())
    by_pose = isinstance(setup.task.feature, CameraPose)
    there = place < MOST_TRANSLATION and turn < MOST_ROTATION if by_pose else pixels < MOST_PIXELS
    kept = (
        f"field of view kept by {least:.2f} px"
        if least >= 0.0
        else f"field of view left by {-least:.2f} px"
    )
    told = f"; {run.reason}" if run.reason else ""
    return bool(there) and spent < MOST_TIME * setup.duration, (
        f"{run.status}, {1e3 * place:.3f} mm, {1e3 * turn:.2f} mrad, {pixels:.3f} px from the "
        f"goal, {kept}, "
        f"{spent:.1f} s for {setup.duration:g} s{told}"
    )


def main(arguments: Sequence[str]) -> int:
    """Print the results of both parts; return 1 if any is worse than required."""
    good = detection(lambda line: print(line, flush=True))
    laws = Suite.load().controllers
    # compiling at first use does not count
    closed_loop(SCENES[0], laws[0].make(), duration=0.1)
    for scene in arguments or SCENES:
        for law in laws:
            reached, line = closed_loop(scene, law.make())
            # the unconstrained baseline does not know the field of view
            good = good and (reached or law.name == "tracking")
            print(f"{scene}: {law.name}: {line}", flush=True)
    print("as accurate as it should be" if good else "not as accurate as it should be")
    return int(not good)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
