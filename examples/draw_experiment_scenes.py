"""Draw scenes of the geometry of the paper's two experiments (section 10), selected by geometry
alone.

The paper does not print where robot and target were. An arm is drawn with its camera looking down;
a horizontal screen in what the camera sees from the goal; and by how much the start is off. A scene
is one of the experiment's geometry if ideal tracking would take exactly one marker across the
boundary. No simulation takes part, and no error of a gradient.

``python draw_experiment_scenes.py`` takes a minute; ``vsconstraints study unselected-experiments``
runs what it prints.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from vsconstraints.robots.geometry import Pose
from vsconstraints.robots.robot import Robot
from vsconstraints.rows import Array, BoolArray
from vsconstraints.scenarios import Scenario

SIDE = 0.17
"""Of the square that the markers make [m]: section 10.1."""

CORNERS = (
    0.5 * SIDE * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
)
NEAREST = 0.38
FARTHEST = 0.9
"""Depth of the markers at the start and the goal [m]."""

LEAST_ERROR = 0.25
"""Of the error's norm at the start: with less a motion is too short to slide."""

CROSSING = 3.0
CLEAR = 5.0
APART = 15.0
EDGE = 15.0
"""[px] How far tracking takes one marker across the boundary, at least; how far all are inside at
the start and the goal; how far the other markers stay inside; and how far all are from the image's
edge at the start and the goal.
"""

LOOKING_DOWN = -0.85
"""Greatest cosine of the camera's axis with the vertical."""

PATH = np.linspace(1.0, 0.0, 21)[:, None, None, None]
"""Shares of the error at the start that are left along a path."""


@dataclass(frozen=True)
class Drawn:
    """One of the two experiments.

    Attributes
    ----------
    scenario
        Name of the shipped scenario.
    kind
        Of its visibility rows.
    longest
        Norm of the error at the start, at most: K_p falls exponentially with it, so that larger
        ones take long.
    draws
        Screens and starts drawn for one arm.
    kept
        How many scenes are kept.
    """

    scenario: str
    kind: str
    longest: float
    draws: int
    kept: int

    def depth(self, pixels: Array) -> Array:
        """(...) how far pixels (..., 2) are beyond the boundary, along the ray from its centre
        [px].
        """
        if self.kind == "fov":
            norm = (np.abs(pixels / (_half_size() - 30.0)) ** 16).sum(axis=-1) ** (1.0 / 16.0)
            return np.asarray(210.0 * (norm - 1.0))
        return np.asarray(
            100.0 * (1.0 - (np.abs((pixels - [140.0, 135.0]) / 100.0) ** 4).sum(axis=-1) ** 0.25)
        )


SEED = 0

DRAWN = (
    Drawn("experiment-1-pbvs", "fov", 0.55, 20000, 104),
    Drawn("experiment-2-ibvs", "occlusion", 0.43, 1000, 130),
)


@cache
def _setup() -> tuple[Robot, Pose, Array, Array]:
    """Robot, camera mount, focal lengths and image size, which both experiments share."""
    scene = Scenario.load(DRAWN[0].scenario).setup().scene
    return (
        scene.robot,
        scene.camera.mount,
        np.array(scene.camera.focal),
        np.array(scene.camera.size),
    )


def _half_size() -> Array:
    return 0.5 * _setup()[3]


def project(X: Array) -> Array:
    """Pixels (..., 2) of points (..., 3) in the camera frame."""
    return np.asarray(X[..., :2] / np.maximum(X[..., 2:], 0.05) * _setup()[2])


def draw(experiment: Drawn, count: int, seed: int) -> tuple[list[dict[str, Any]], Counter[str]]:
    """Scenes of an experiment's geometry, and why other draws are none.

    Parameters
    ----------
    experiment
        Which.
    count
        How many; each has an arm of its own.
    seed
        The same seed gives the same scenes.

    Returns
    -------
    tuple
        Entries of a scenario by dotted keys, and how many draws were rejected, by reason.
    """
    rng = np.random.default_rng(seed)
    found: list[dict[str, Any]] = []
    rejected: Counter[str] = Counter()
    for q_goal, goal in _arms(rng, rejected):
        scene = _scene(experiment, rng, q_goal, goal, rejected)
        if scene is not None:
            found.append(scene)
        if len(found) == count:
            break
    return found, rejected


def _arms(rng: np.random.Generator, rejected: Counter[str]) -> Iterator[tuple[Array, Pose]]:
    """Joint positions, uniform in the middle 85 % of the ranges (the base, and joints 4 and 6,
    less), and cameras.
    """
    robot, mount, _, _ = _setup()
    middle = 0.5 * (robot.q_min + robot.q_max)
    span = 0.5 * (robot.q_max - robot.q_min)
    reach = np.minimum(0.85 * span, [1.0, 4.0, 4.0, 2.0, 4.0, 2.5])
    while True:
        q = middle + reach * rng.uniform(-1.0, 1.0, 6)
        camera = robot.pose(q) @ mount.inverse
        if camera.R[2, 2] > LOOKING_DOWN or robot.pose(q, "link 3").t[2] > -0.1:
            rejected["arm: the camera does not look down, or the elbow is at the ceiling"] += 1
        elif not _regular(robot, q):
            rejected["arm: near a singularity"] += 1
        else:
            yield q, camera


def _regular(robot: Robot, q: Array) -> bool:
    return bool(
        np.linalg.svd(robot.jacobian(q), compute_uv=False)[-1] >= 0.08 and abs(np.sin(q[4])) >= 0.35
    )


def _scene(
    experiment: Drawn, rng: np.random.Generator, q_goal: Array, goal: Pose, rejected: Counter[str]
) -> dict[str, Any] | None:
    """The first draw for this arm that has the experiment's geometry."""
    robot, mount, focal, _ = _setup()
    M = experiment.draws
    half = _half_size()
    rays = np.concatenate((rng.uniform(-0.8, 0.8, (M, 2)) * half / focal, np.ones((M, 1))), axis=1)
    centre = rays * rng.uniform(0.4, 0.8, (M, 1))
    yaw = rng.uniform(-np.pi, np.pi, M)
    # by how much the start is off: the goal's frame, metres and radians
    off = rng.normal(size=(M, 6)) * [0.5, 0.5, 0.5, 1.0, 1.0, 1.0]
    off *= (rng.uniform(LEAST_ERROR, DRAWN[0].longest, M) / np.linalg.norm(off, axis=1))[:, None]
    turn = Rotation.from_rotvec(yaw[:, None] * [[0.0, 0.0, 1.0]]).as_matrix()
    corners = np.einsum("sij,mj->smi", turn, CORNERS) @ goal.R + centre[:, None]
    left = np.arange(M)

    def keep(good: BoolArray, reason: str) -> BoolArray:
        nonlocal left
        rejected[reason] += int((~good).sum())
        left = left[good]
        return good

    keep(
        _allowed(experiment, corners),
        "goal: a marker is not in view, not allowed, or too near or far",
    )
    start, down = _seen_from(corners[left], off[left])
    looks = (goal.R[2] * down).sum(axis=1) <= LOOKING_DOWN
    good = keep(
        _allowed(experiment, start) & looks, "start: likewise, or the camera does not look down"
    )
    there = project(corners[left])
    path = _path(experiment, corners[left], off[left])
    error = np.sqrt((((path[0] - there) / focal) ** 2).sum(axis=(1, 2)))
    if experiment.kind == "fov":
        error = np.linalg.norm(off[left], axis=1)
    good = keep(
        (error >= LEAST_ERROR) & (error <= experiment.longest), "start: too near or too far"
    )
    deepest = np.sort(experiment.depth(path[:, good]).max(axis=0), axis=1)
    crosses = keep(deepest[:, 3] >= CROSSING, "no marker crosses the boundary by 3 px")
    keep(deepest[crosses, 2] <= -APART, "a second marker comes near the boundary")
    for i in left:
        camera = goal @ Pose(Rotation.from_rotvec(off[i, 3:]).as_matrix(), off[i, :3])
        q0 = _joints(robot, q_goal, camera @ mount)
        if q0 is None:
            rejected["start: out of reach, at a joint's limit, or near a singularity"] += 1
            continue
        rejected["a scene of the same arm is taken already"] += (
            len(left) - 1 - int(np.flatnonzero(left == i)[0])
        )
        screen = {
            "side": SIDE,
            "xyz": _rounded(goal.act(centre[i])),
            "rpy": _rounded([0.0, 0.0, yaw[i]]),
        }
        return {
            "q0": _rounded(q0),
            "target.square": screen,
            "task.goals.0.camera_at_q": _rounded(q_goal),
        }
    return None


def _rounded(values: ArrayLike) -> list[float]:
    """As a scenario file would say it."""
    return [float(value) for value in np.round(np.asarray(values), 4)]


def _allowed(experiment: Drawn, corners: Array) -> BoolArray:
    """(s,) whether all markers (s, 4, 3), given in the camera frame, may be there at the start or
    the goal.
    """
    pixels = project(corners)
    Z = corners[..., 2]
    seen = (np.abs(pixels) <= _half_size() - EDGE).all(axis=(1, 2)) & (NEAREST <= Z).all(axis=1)
    return np.asarray(
        seen & (FARTHEST >= Z).all(axis=1) & (experiment.depth(pixels) <= -CLEAR).all(axis=1)
    )


def _seen_from(corners: Array, off: Array) -> tuple[Array, Array]:
    """Markers (s, 4, 3) in cameras that are off (s, 6) from the frame they are given in, and the
    cameras' axes.
    """
    R = Rotation.from_rotvec(off[:, 3:]).as_matrix()
    return np.einsum("smi,sij->smj", corners - off[:, None, :3], R), R[:, :, 2]


def _path(experiment: Drawn, corners: Array, off: Array) -> Array:
    """(21, s, 4, 2) where markers go if tracking is ideal: the pose, or the image, moves on a
    straight line [px].
    """
    if experiment.kind == "fov":
        return np.stack(
            [project(_seen_from(corners, float(share) * off)[0]) for share in PATH.ravel()]
        )
    start = project(_seen_from(corners, off)[0])
    there = project(corners)
    return np.asarray(there + PATH * (start - there))


def _joints(robot: Robot, q: Array, wanted: Pose) -> Array | None:
    """Joint positions near q (6,) with the tip at a pose, well within the ranges; None if there are
    none.
    """
    for _ in range(20):
        pose = robot.pose(q)
        w = Rotation.from_matrix(wanted.R @ pose.R.T).as_rotvec()
        step = np.concatenate((wanted.t - pose.t, w))
        if np.abs(step).max() < 1e-10:
            margin = np.minimum(q - robot.q_min, robot.q_max - q)
            return (
                q
                if (margin >= 0.05 * (robot.q_max - robot.q_min)).all() and _regular(robot, q)
                else None
            )
        if np.linalg.cond(robot.jacobian(q)) > 1e3:
            return None
        q = q + np.linalg.solve(robot.jacobian(q), step)
    return None


if __name__ == "__main__":
    kept = {}
    for experiment in DRAWN:
        scenes, rejected = draw(experiment, experiment.kept, SEED)
        kept[experiment.scenario] = {"rejected": dict(sorted(rejected.items())), "scenes": scenes}
    # one line for each scene
    print(json.dumps(kept, ensure_ascii=False).replace('{"q0"', '\n{"q0"'))
