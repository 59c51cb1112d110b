"""Growth of the step time with the number of markers, rows and joints."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from vsconstraints import Camera, Robot
from vsconstraints.constraints import Constraint, ConstraintSet, FieldOfView, JointRange, JointSpeed
from vsconstraints.control import ControlStep
from vsconstraints.controllers import Controller, HierarchicalQP, PotentialField, SlidingMode
from vsconstraints.robots import viper_s650
from vsconstraints.robots.geometry import Pose
from vsconstraints.rows import Rows, Task
from vsconstraints.vision.features import CameraPose, Goal, ImagePoints
from vsconstraints.vision.scene import Scene
from vsconstraints.vision.tracking import TrackingGains, VisualTask

from .part import Effort, Part, Table, digits
from .timing import compare

TEXT = """
Medians in units, of everything from state to command (markers, joints) or of the command alone \
(rows). *Slope* is that
of a line through the logarithms of all sizes, *last* that between the two greatest sizes, where \
what is constant
weighs least: 1 is linear growth.
Markers: the Viper, a field-of-view row each, one of them active; a pose task, or an image task \
with two equations a
marker. Rows: six joints, three rows active and in the way, all others far from it. Joints: arms \
of alternating axes,
four markers, range and speed rows for every joint.
"""

LINEAR = 1.1
"""Slope between the two greatest sizes above which growth counts as worse than linear.

It exceeds 1 because of noise.
"""

SUBJECTS: dict[str, Callable[[], Controller]] = {
    "sliding-mode": SlidingMode,
    "potential-field": PotentialField,
    "hierarchical-qp": HierarchicalQP,
}

Curves = dict[str, dict[int, float]]
"""Ratio by size, by name."""


def measure(effort: Effort) -> Part:
    """Measure this part; see the module."""
    part = Part("Growth", TEXT, figure="growth.png")
    turns = max(effort.turns // 2, 1)
    families: list[
        tuple[str, Sequence[int], Callable[[int], Mapping[str, Callable[[], object]]]]
    ] = [
        ("markers", effort.markers, with_markers),
        ("rows", effort.rows, with_rows),
        ("joints", effort.joints, with_joints),
    ]
    for what, sizes, make in families:
        # all sizes in turn: a slow moment of the machine affects all equally
        named = {
            f"{name}, {size}": (name, size, step)
            for size in sizes
            for name, step in make(size).items()
        }
        times = compare({key: step for key, (_, _, step) in named.items()}, turns)
        curves: Curves = {}
        for key, (name, size, _) in named.items():
            curves.setdefault(name, {})[size] = times[key].ratio
            part.keep(f"{what}, {key}", times[key])
        lines = []
        for name, curve in curves.items():
            slope, last = slopes(curve)
            part.numbers[f"{what}, {name}: slope"] = slope
            part.numbers[f"{what}, {name}: last slope"] = last
            lines.append(
                [name, *(digits(curve[size]) for size in sizes), f"{slope:.2f}", f"{last:.2f}"]
            )
            if what == "joints" and {6, 7} <= {*sizes}:
                part.numbers[f"{what}, {name}: 7 over 6"] = curve[7] / curve[6]
        part.tables.append(Table([what, *map(str, sizes), "slope", "last"], lines))
    return part


def slopes(curve: Mapping[int, float]) -> tuple[float, float]:
    """Slope of log ratio over log size: for all sizes, and between the two greatest."""
    x = np.log(list(curve))
    y = np.log(list(curve.values()))
    return float(np.polyfit(x, y, 1)[0]), float((y[-1] - y[-2]) / (x[-1] - x[-2]))


def with_markers(count: int) -> dict[str, Callable[[], object]]:
    """Return steps with this number of markers."""
    robot = viper_s650()
    camera = Camera((402.5, 402.5), (512.0, 512.0))
    q = np.array([0.1, -0.4, -0.5, -0.9, 1.3, 0.1])
    qd = np.full(6, 0.01)
    rng = np.random.default_rng(count)
    pixels = rng.uniform(-150.0, 150.0, (count, 2))
    # outside the border: its row is active
    pixels[0] = 250.0, 10.0
    constraints: list[Constraint] = [FieldOfView(camera, K=0.1, switching_gain=2.0, margin=0.05)]
    return {
        **_steps(robot, camera, pixels, constraints, CameraPose(), q, qd, "pose"),
        **_steps(robot, camera, pixels, constraints, ImagePoints(), q, qd, "image"),
    }


def with_rows(count: int) -> dict[str, Callable[[], object]]:
    """Return commands for this number of rows."""
    rng = np.random.default_rng(count)
    phi = rng.uniform(-2.0, -1.0, count)
    phi[:3] = 0.01
    Lg = rng.normal(size=(count, 6))
    Lg /= np.linalg.norm(Lg, axis=1, keepdims=True)
    J = np.eye(6) + 0.3 * rng.normal(size=(6, 6))
    b = rng.normal(size=6)
    tracking = np.linalg.solve(J, b)
    # the first three rows oppose tracking
    Lg[:3] *= np.where(Lg[:3] @ tracking < 0.0, -1.0, 1.0)[:, None]
    labels = tuple(f"row {i}" for i in range(count))
    rows = Rows(phi, Lg, np.zeros(count), np.ones(count), labels)
    task = Task(J, b)

    def subject(law: Controller) -> Callable[[], object]:
        return lambda: law.command(rows, task)

    return {name: subject(make()) for name, make in SUBJECTS.items()}


def with_joints(count: int) -> dict[str, Callable[[], object]]:
    """Return steps of an arm with this number of joints."""
    table = [[0.0, 0.05, 0.8 / count, (-1) ** i * np.pi / 2] for i in range(count)]
    limits = np.full(count, 3.0)
    robot = Robot.from_dh(table, q_min=-limits, q_max=limits, qd_max=limits)
    camera = Camera((400.0, 400.0), (512.0, 512.0))
    constraints: list[Constraint] = [
        FieldOfView(camera, K=0.1, switching_gain=2.0, margin=0.05),
        JointRange(robot, K=0.1, switching_gain=1.0),
        JointSpeed(robot, switching_gain=1.0),
    ]
    pixels = np.array([[250.0, 10.0], [100.0, -90.0], [-110.0, 95.0], [-85.0, -105.0]])
    q = np.linspace(0.1, 0.6, count)
    qd = np.full(count, 0.01)
    return _steps(robot, camera, pixels, constraints, CameraPose(), q, qd, "pose")


def _steps(
    robot: Robot,
    camera: Camera,
    pixels: np.ndarray,
    constraints: list[Constraint],
    feature: CameraPose | ImagePoints,
    q: np.ndarray,
    qd: np.ndarray,
    what: str,
) -> dict[str, Callable[[], object]]:
    """Return steps from state to command, for markers at these pixels at ``q``.

    The goal is a little away from that pose.
    """
    there = robot.pose(q)
    depth = np.linspace(0.5, 0.7, len(pixels))[:, None]
    markers = there.act(np.concatenate((camera.normalised(pixels) * depth, depth), axis=1))
    scene = Scene(robot, camera, markers)
    goal_pose = there @ Pose.from_xyz_rpy((0.02, -0.01, 0.03), (0.05, -0.04, 0.1))
    seen = scene.project(goal_pose)
    goal = Goal(0.0, seen, camera.normalised(seen), goal_pose, scene.depth(goal_pose))

    def subject(law: Controller) -> Callable[[], object]:
        task = VisualTask(feature, [goal], TrackingGains(20.0))
        to_command = ControlStep(scene, ConstraintSet(constraints, scene), task).bind(law)
        return lambda: to_command(0.0, q, qd)

    return {f"{name}, {what}": subject(make()) for name, make in SUBJECTS.items()}
