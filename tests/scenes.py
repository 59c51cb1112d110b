"""Robots, cameras, constraints and numerical derivatives that several tests share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from vsconstraints import Camera, Robot
from vsconstraints.compiled.samples import mark_acting
from vsconstraints.compiled.workspace import RowArrays
from vsconstraints.constraints import Constraint, robot_points
from vsconstraints.constraints.curves import SHAPES
from vsconstraints.control import Prediction
from vsconstraints.control.evaluator import CurrentState
from vsconstraints.robots import READY_MADE
from vsconstraints.robots.geometry import Pose
from vsconstraints.rows import Array, Rows, Task
from vsconstraints.scenarios.constraint_types import make_constraint
from vsconstraints.vision.features import Goal
from vsconstraints.vision.motion import Motion, TargetMotion
from vsconstraints.vision.scene import Scene, State
from vsconstraints.vision.tracking import Rest, TrackingGains


def acting(
    phi: list[float], slowed: list[float], gain: list[float], scale: list[float]
) -> list[bool]:
    """Which rows act in a sample, of which the command slows φ by so much: those of a robot with
    one joint.
    """
    m = len(phi)
    none = np.empty(0)
    rows = RowArrays(
        np.array(phi),
        np.array(slowed).reshape(m, 1),
        *(none,) * 4,
        np.array(gain),
        np.array(scale),
        none,
        none,
    )
    active = np.zeros(m, dtype=np.bool_)
    mark_acting(rows, np.zeros(1), np.ones(1), active)
    found: list[bool] = active.tolist()
    return found


def arm_with_prismatic_joints() -> Robot:
    """Five joints, two of them prismatic, with a table and limits of random numbers."""
    rng = np.random.default_rng(20)
    table = np.column_stack(
        (
            rng.uniform(-1.0, 1.0, 5),
            rng.uniform(-0.4, 0.4, 5),
            rng.uniform(-0.4, 0.4, 5),
            rng.uniform(-2.0, 2.0, 5),
        )
    )
    limits = rng.uniform(0.5, 2.0, (3, 5))
    return Robot.from_dh(
        table,
        prismatic=[2, 4],
        q_min=-limits[0],
        q_max=limits[1],
        qd_max=limits[2],
        name="mixed arm",
    )


class Straight:
    """A model in which a robot stands still, and rows on φ itself and the task stay what they are
    now.
    """

    def __init__(self, rows: Rows, task: Task) -> None:
        self.rows = rows
        self.now = task
        n = task.J.shape[1]
        # no feedback
        self.task: Any = SimpleNamespace(
            gains=TrackingGains(1e-300, damping=0.0), rest_of=lambda n, k: Rest(0.0)
        )
        self.present = CurrentState(0.0, np.zeros(n), np.zeros(n))
        self.labels = rows.labels
        self.K = np.zeros(len(rows.labels))
        self.acceleration = np.full(n, np.inf)

    def along(self, t: Array, q: Array, qd: Array) -> Prediction:
        """See :class:`vsconstraints.control.Model`."""
        rows = self.rows
        task = self.now
        J, b, Lg, Lf = (np.stack([part] * len(t)) for part in (task.J, task.b, rows.Lg, rows.Lf))
        with np.errstate(over="ignore", invalid="ignore"):
            phi = rows.phi + qd @ rows.Lg.T
        none = np.empty((len(t), 0))
        zeros = np.zeros_like(b)
        return Prediction(phi, Lg, Lf, phi, Lf, J, b, zeros, zeros, none, np.empty((len(t), 0, 2)))


def robot_names() -> list[str]:
    """Every registered robot, and an arm with prismatic joints."""
    return [*READY_MADE, "mixed-arm"]


@cache
def robot(name: str) -> Robot:
    """A robot by its name, made once."""
    return arm_with_prismatic_joints() if name == "mixed-arm" else READY_MADE[name]()


def camera() -> Camera:
    """A camera in which nothing is symmetric: focal lengths, size, principal point and mount all
    differ.
    """
    mount = Pose.from_xyz_rpy((0.02, 0.07, -0.05), (0.1, -0.2, -1.5))
    return Camera((543.7, 512.3), (640.0, 480.0), (310.5, 250.25), mount)


def random_configuration(robot: Robot, rng: np.random.Generator) -> Array:
    """Coordinates (n,) inside the ranges; between −π and π where there is no range."""
    lower = np.maximum(robot.q_min, -np.pi)
    upper = np.minimum(robot.q_max, np.pi)
    return rng.uniform(lower, upper)


def markers_seen(pose: Pose, camera: Camera, rng: np.random.Generator, count: int = 3) -> Array:
    """Markers (count, 3) in the base frame that a camera at ``pose`` sees, up to its image's
    border.
    """
    pixels = rng.uniform(-0.49, 0.49, (count, 2)) * camera.size
    depth = rng.uniform(0.6, 1.6, (count, 1))
    return pose.act(np.concatenate((camera.normalised(pixels) * depth, depth), axis=1))


WORLDS = ("eye-in-hand", "eye-to-hand", "moving-target")
"""Who carries the camera, and whether the target moves."""

NOW = 0.7
"""Time at which scenes are looked at [s]."""


def random_scene(
    robot: Robot,
    rng: np.random.Generator,
    constraints: list[Constraint] | None = None,
    world: str = WORLDS[0],
) -> tuple[Scene, Array, Array]:
    """A scene with markers seen from a random configuration at :data:`NOW`, that configuration, and
    random speeds.
    """
    q = random_configuration(robot, rng)
    qd = rng.uniform(-1.0, 1.0, robot.n)
    eye = camera()
    points = robot_points(constraints or [])
    pose = robot.pose(q) @ eye.mount.inverse
    markers = markers_seen(pose, eye, rng)
    if world == "eye-to-hand":
        fixed = Camera(eye.focal, eye.size, eye.principal_point_px, fixed=pose)
        return Scene(robot, fixed, robot.pose(q).inverse.act(markers), points), q, qd
    if world == "moving-target":
        swing = Motion(
            rng.uniform(-0.3, 0.3, 3), amplitude=rng.uniform(-0.1, 0.1, 3), frequency=0.4, phase=0.3
        )
        motion = TargetMotion(swing, rng.uniform(-0.5, 0.5, 3), rng.uniform(-1.0, 1.0, 3))
        return Scene(robot, eye, motion.pose(NOW).inverse.act(markers), points, motion), q, qd
    return Scene(robot, eye, markers, points), q, qd


def random_goal(state: State, camera: Camera, rng: np.random.Generator, angle: float) -> Goal:
    """A goal whose pose is turned from the camera's by ``angle``, and whose pixels are anywhere.

    Pixels and depths are not those of the pose, but the first three markers turn as in the state.
    """
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    turn = Pose(rotation_matrix(axis * angle), rng.uniform(-0.3, 0.3, 3))
    pixels = rng.uniform(-200.0, 200.0, state.pixels.position.shape)
    depth = rng.uniform(0.5, 1.5, len(pixels))
    if side(pixels) * side(state.pixels.position) < 0.0:
        pixels = pixels * (1.0, -1.0)
    return Goal(0.0, pixels, camera.normalised(pixels), state.camera @ turn.inverse, depth)


def side(pixels: Array) -> float:
    """Twice the signed area of the triangle of three points (3, 2)."""
    a, b, c = pixels[:3]
    return float(np.linalg.det(np.stack((b - a, c - a))))


def rotation_matrix(w: Array) -> Array:
    """Rodrigues' formula, written out here so that it owes nothing to what is tested."""
    angle = float(np.linalg.norm(w))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.asarray(w) / angle
    W = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * W + (1.0 - np.cos(angle)) * (W @ W)


# --- examples of every registered constraint type, as the tables of a scenario file ---

SHAPE_PARAMETERS: dict[str, dict[str, float]] = {
    "circle": {"radius": 70.0},
    "hyperellipse": {"a": 100.0, "b": 60.0, "n": 4.0},
    "bowl": {"radius": 45.0, "width": 0.7},
    "heart": {"radius": 35.0, "width": 0.8},
}
"""Parameters for every registered shape."""


def constraint_tables(type_name: str, robot: Robot) -> list[dict[str, Any]]:
    """Tables that describe constraints of this type for this robot; empty if the tests know no
    example.
    """
    n = robot.n
    middle = robot.links[len(robot.links) // 2]
    # the joints of a free camera meet in one point: it has no links, and its position is never
    # singular
    free = robot.name == "free camera"
    bodies = [
        {"link": middle, "name": "flag", "shape": "sphere", "radius": 0.1, "xyz": [0.1, -0.3, 0.2]},
        {"link": "tip", "shape": "capsule", "radius": 0.05, "length": 0.2, "xyz": [0.3, 0.1, 0.0]},
    ]
    points = [
        {"link": robot.links[-1], "offset": [0.1, -0.2, 0.3], "name": "last link"},
        {"link": middle, "offset": [-0.1, 0.0, 0.2], "name": "middle"},
    ]
    return {
        "field-of-view": [
            {"margin": 0.05, "n": 16, "K": 0.2, "switching_gain": 10.0},
            {"margin_px": 30.0, "n": 3.5, "K": 1.5, "switching_gain": 1.0, "markers": [3, 1]},
            {"n": 2, "K": 0.1, "switching_gain": 1.0},
        ],
        "occlusion": [
            {
                "curve": {
                    "shape": name,
                    "centre_px": centre,
                    "rotation": turn,
                    **SHAPE_PARAMETERS[name],
                },
                "K": 0.2,
                "switching_gain": 10.0,
                **extra,
            }
            for name in SHAPES
            if name in SHAPE_PARAMETERS
            for centre, turn, extra in (
                ([0.0, 0.0], 0.0, {}),
                ([-52.5, 31.0], 0.7, {"margin": 0.1, "name": "turned"}),
                ([17.0, -80.0], -2.2, {"markers": [2]}),
            )
        ],
        "joint-range": [
            {
                "lower": [-1.0 - 0.1 * i for i in range(n)],
                "upper": [0.5 + 0.2 * i for i in range(n)],
                "margin": 0.1,
                "K": 0.3,
                "switching_gain": 2.0,
            },
            {
                "joints": [n, 1],
                "lower": [-2.0, -0.4],
                "upper": [0.3, 2.5],
                "K": 0.1,
                "switching_gain": 2.0,
            },
        ],
        "joint-speed": [
            {"upper": [0.4 + 0.1 * i for i in range(n)], "switching_gain": 1.0},
            {
                "joints": [n, 1],
                "lower": [-2.0, -0.4],
                "upper": [0.3, 2.5],
                "margin": 0.1,
                "switching_gain": 1.0,
            },
        ],
        "forbidden-sphere": [
            {"centre": [0.57, 0.2, 0.405], "radius": 0.05, "K": 0.1, "switching_gain": 0.2},
            {
                "centre": [-0.3, 0.4, -0.2],
                "radius": 0.3,
                "margin": 0.02,
                "K": 0.5,
                "switching_gain": 0.2,
                "name": "pillar",
                "points": [
                    {"link": robot.links[-1], "offset": [0.1, -0.2, 0.3], "name": "last link"},
                    {"link": "tip"},
                    {
                        "link": middle,
                        "offset": [-0.1, 0.0, 0.2],
                        "name": "middle",
                    },
                    {
                        "link": robot.links[-1],
                        "offset": [-0.3, 0.1, 0.1],
                        "name": "last link, other end",
                    },
                ],
            },
        ],
        "forbidden-box": [
            {
                "centre": [0.3, 0.2, 0.4],
                "size": size,
                "rpy": [0.3, -0.5, 1.2],
                "margin": 0.02,
                "K": 0.2,
                "switching_gain": 0.2,
                "points": points,
            }
            for size in ([0.3, 0.2, 0.1], [3.0, 5.0, 4.0])
        ],
        "forbidden-cylinder": [
            {
                "start": start,
                "end": end,
                "radius": radius,
                "K": 0.2,
                "switching_gain": 0.2,
                "points": points,
            }
            for start, end, radius in (
                ([0.5, 0.2, 0.1], [0.3, 0.4, 0.3], 0.1),
                ([0.0, 0.1, -3.0], [0.3, 0.4, 3.0], 2.5),
                ([0.2, 0.1, -0.1], [0.21, 0.12, 0.2], 3.0),
            )
        ],
        "forbidden-capsule": [
            {
                "start": [0.5, 0.2, 0.1],
                "end": [0.3, 0.4, 0.7],
                "radius": 0.1,
                "K": 0.2,
                "switching_gain": 0.2,
            },
            {
                "start": [0.9, 0.2, -2.0],
                "end": [0.8, 0.3, 2.0],
                "radius": 1.0,
                "margin": 0.01,
                "K": 0.2,
                "switching_gain": 0.2,
                "name": "pipe",
                "points": points,
            },
        ],
        "forbidden-half-space": [
            {
                "point": [0.5, 0.0, 0.1],
                "normal": [2.0, -1.0, 0.5],
                "margin": 0.01,
                "K": 0.2,
                "switching_gain": 0.2,
                "points": points,
            },
        ],
        "manipulability": [
            {"minimum": 0.05, "K": 0.2, "switching_gain": 1.0},
            {"minimum": 0.1, "scale": 0.3, "part": "position", "K": 0.2, "switching_gain": 1.0},
        ][: 1 if robot.n == 3 or free else 2],
        "collision": [
            {
                "obstacle": {"shape": "sphere", "radius": 0.2, "xyz": [0.4, 0.3, 0.2]},
                "bodies": bodies,
                "links": ["flag", "tip"],
                "margin": 0.01,
                "K": 0.2,
                "switching_gain": 0.2,
            },
            {
                "obstacle": {
                    "shape": "half-space",
                    "xyz": [0.4, 0.3, 0.2],
                    "rpy": [0.5, -0.3, 0.2],
                },
                "link_radius": 0.05,
                "name": "wall",
                "K": 0.2,
                "switching_gain": 0.2,
            },
        ][: 1 if free else 2],
        "self-collision": [
            {"bodies": bodies, "pairs": [["tip", "flag"]], "K": 0.2, "switching_gain": 0.2},
        ],
        "performance-funnel": [
            {"feature_px": 300.0, "final": 0.05, "decay": 2.0, "K": 0.2, "switching_gain": 1.0},
            {
                "feature_px": 90.0,
                "final": 1.0,
                "decay": 0.3,
                "markers": [3, 1],
                "K": 0.2,
                "switching_gain": 1.0,
            },
            {
                "translation_m": 0.5,
                "rotation_rad": 3.0,
                "final": 0.1,
                "decay": 0.7,
                "K": 0.1,
                "switching_gain": 1.0,
            },
            {"rotation_rad": 2.0, "final": 0.1, "decay": 0.7, "K": 0.3, "switching_gain": 1.0},
        ],
    }.get(type_name, [])


def build_constraint(type_name: str, table: dict[str, Any], robot: Robot) -> Constraint:
    """The constraint that a scenario file's table describes."""
    goals = [funnel_goal(-1.0, [0.3, -0.2, 0.5], 7.0), funnel_goal(0.4, [-0.2, 0.4, 0.6], 31.0)]
    return make_constraint(
        {**table, "type": type_name}, f"example of {type_name}", robot, camera(), Path(), goals
    )


def funnel_goal(from_time: float, xyz: list[float], shift: float) -> Goal:
    """A goal that funnels are about, somewhere."""
    pixels = np.array([[-80.0, 20.0], [60.0, -90.0], [10.0, 120.0]]) + shift
    pose = Pose(rotation_matrix(np.array([0.4, -0.9, 0.7])), np.array(xyz))
    return Goal(from_time, pixels, camera().normalised(pixels), pose)


# --- numerical derivatives ---


def slope(f: Callable[[float], Array], h: float) -> Array:
    """f'(0) by central differences of fourth order."""
    return (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)


def second_slope(f: Callable[[float], Array], h: float) -> Array:
    """f''(0) by central differences of fourth order."""
    return (16.0 * (f(h) + f(-h)) - (f(2.0 * h) + f(-2.0 * h)) - 30.0 * f(0.0)) / (12.0 * h * h)


def gradient(f: Callable[[Array], Array], x: Array, h: float) -> Array:
    """∂f/∂x by :func:`slope`; the last axis is that of x."""
    return np.stack([slope(lambda s, e=e: f(x + s * e), h) for e in np.eye(len(x))], axis=-1)


def states(name: str, count: int) -> Iterator[np.random.Generator]:
    """Random generators for ``count`` states: the same on every run, others for every robot."""
    for i in range(count):
        yield np.random.default_rng([i, *name.encode()])


def of_depth(depth: float, violated: str) -> dict[str, Any]:
    """The columns of the tolerant standard, of a run that violates rows by a fraction of their
    length.
    """
    return {"violation_fraction": depth, "violated_tolerant": violated if depth > 0.01 else ""}
