"""A preview: start and goals, and the distance of each row to its boundary there; nothing is simulated."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import pinocchio as pin

from ...constraints import ImageConstraint
from ...errors import ConfigurationError, SceneError, VsconstraintsError, described
from ...robots.geometry import Pose, distance
from ...rows import Array
from ...scenarios import Scenario
from ...scenarios.families.placements import inverse_kinematics, tip_of
from ...simulation import Setup
from ...simulation.occluders import LinesOfSight
from ...simulation.start import implausible
from ...vision.features import Goal
from ...vision.measurement import estimated_pose
from ...vision.scene import MINIMUM_DEPTH, Scene

ROUNDING = 1e-9  # of σ relative to the row's scale, that counts as none
NEAR = 0.9  # usage 1 − clearance/L from which a row counts as near: 1 is on its boundary
#: Configurations from which one at a goal is sought, besides those that are near; and turns of the camera about its
#: optical axis, from which the pose behind an image is sought.
TRIES, TURNS = 20, 4
#: Distance of two poses [m, rad] that counts as none; and how far markers may be from a goal given as an image, seen
#: from the pose that explains it best, relative to its width.
SAME, MAX_MISS = 1e-6, 0.1
OF_GOALS = "performance-funnel"  # constraints that are about the goals


@dataclass(frozen=True)
class Moment:
    """The ``start``, a ``goal`` or ``goal 2``, at time t [s].

    ``q`` (n,) is None if no configuration was found; ``pixels`` (M, 2) are from the image's centre, NaN for markers not
    in front of the camera; ``phi`` and ``clearance`` (m,) are those of each row, NaN where they are not known;
    ``problems`` are sentences on what is wrong.
    """

    name: str
    t: float
    q: Array | None
    pixels: Array
    phi: Array
    clearance: Array
    problems: tuple[str, ...]


def moment_at(setup: Setup, name: str, t: float, q: Array, qd: Array) -> Moment:
    """The robot at ``q`` and ``qd`` (n,) at time ``t`` [s]."""
    scene, constraints = setup.scene, setup.constraints
    robot, camera = scene.robot, scene.camera
    P = scene.camera_pose(q, t).inverse.act(scene.markers)
    seen, pixels = P[:, 2] >= MINIMUM_DEPTH, np.full((len(P), 2), np.nan)
    pixels[seen] = camera.pixels(P[seen, :2] / P[seen, 2:])
    phi = clearance = np.full(len(constraints.labels), np.nan)
    problems = robot.outside_ranges(q)
    for i, (u, v) in enumerate(pixels, 1):
        if not seen[i - 1]:
            problems.append(f"marker {i} is behind the camera (depth {P[i - 1, 2]:.3g} m)")
        elif not camera.sees(pixels[i - 1]):
            problems.append(f"marker {i} is outside the image, at ({u:.0f}, {v:.0f}) px from its centre")
    if seen.all():
        try:
            hidden = LinesOfSight(scene).hidden(q[None], [t])[0]
            problems += [f"marker {number} is hidden by the robot's own {link}" for number, link in hidden]
        except ConfigurationError as error:
            problems.append(f"lines of sight are not checked: {error}")
        try:
            now = setup.world().evaluate(t, q, qd)
            rows, sigma, places = now.rows, now.sigma, (now.pixels[None], now.points[None])
            phi, clearance = rows.phi, setup.clearance(np.array([t]), q[None], qd[None], *places)[0]
            problems += [
                f"{rows.labels[i]} is violated: {abs(clearance[i]):.4g} {constraints.units[i]} outside"
                for i in np.flatnonzero(sigma > ROUNDING * rows.scale)
            ]
        except Exception as error:  # own constraints may raise anything
            problems.append(f"its rows cannot be evaluated: {described(error)}")
    return Moment(name, t, q, pixels, phi, clearance, tuple(problems))


def nowhere(setup: Setup, name: str, t: float, pixels: Array, problem: str) -> Moment:
    """A goal of which no more is known than its image (M, 2) [px]."""
    unknown, problems = np.full(len(setup.constraints.labels), np.nan), [problem]
    for constraint in setup.constraints.constraints:
        if isinstance(constraint, ImageConstraint) and constraint.motion is None:
            outside = constraint.sigma(constraint.of_markers(pixels)) > 0.0
            labels = constraint.labels(setup.scene)
            problems += [f"{labels[i]} is violated" for i in np.flatnonzero(outside)]
    return Moment(name, t, None, pixels, unknown, unknown, tuple(problems))


@dataclass(frozen=True)
class Row:
    """How near a row, or a joint's own limit, is to its boundary in each of k moments, in its unit.

    ``phi`` (k,) is NaN of a limit that is no row; ``usage`` (k,) is 1 − clearance/L: 1 is on the boundary.
    """

    label: str
    unit: str
    phi: Array
    clearance: Array
    usage: Array

    @property
    def limit(self) -> bool:
        """Whether it is no row, but a limit of a joint."""
        return bool(np.isnan(self.phi).all() and self.label.startswith("limit["))

    @property
    def greatest(self) -> float:
        """The usage where it is greatest; minus infinity where it is not known."""
        return float(np.nan_to_num(self.usage, nan=-np.inf).max())

    def text(self, k: int) -> str:
        """The distance to the boundary in a moment, and φ in brackets."""
        if np.isnan(self.clearance[k]):
            return "not known"
        phi = "" if np.isnan(self.phi[k]) else f" ({self.phi[k]:.2g})"
        return f"{self.clearance[k]:.3g} {self.unit}{phi}".replace("-", "−")


def rows_of(setup: Setup, moments: Sequence[Moment]) -> tuple[Row, ...]:
    """All rows, and the limits of joints that no row is about; those nearest to their boundary first."""
    constraints, robot = setup.constraints, setup.scene.robot
    phi, clearance = (np.array([getattr(m, what) for m in moments]).T for what in ("phi", "clearance"))
    named = zip(constraints.labels, constraints.units, phi, clearance, constraints.characteristic_length, strict=True)
    rows = [Row(label, unit, own, away, 1.0 - away / length) for label, unit, own, away, length in named]
    unknown, half = np.full(robot.n, np.nan), 0.5 * (robot.q_max - robot.q_min)
    q = np.array([unknown if moment.q is None else moment.q for moment in moments])
    for side, limits in (("lower", q - robot.q_min), ("upper", robot.q_max - q)):
        for j in np.flatnonzero(np.isfinite(half)):
            if f"range[joint {j + 1}].{side}" not in constraints.labels:
                label, unit = f"limit[joint {j + 1}].{side}", "m" if robot.prismatic[j] else "rad"
                rows.append(Row(label, unit, np.full(len(q), np.nan), limits[:, j], 1.0 - limits[:, j] / half[j]))
    return tuple(sorted(rows, key=lambda row: -row.greatest))


def goal_configuration(scene: Scene, goal: Goal, q0: Array, t: float) -> tuple[Array, float]:
    """Where the robot is (n,) when a goal is reached at time ``t`` [s], and how far markers are off at most [px].

    Where the file says it and the camera is right there, that; else what inverse kinematics finds from there, from the
    start, and then from :data:`TRIES` others, always the same. What is given as an image counts as the pose that
    explains it best. Raises SceneError if nothing is found within the joints' ranges.
    """
    robot, missed, camera = scene.robot, 0.0, goal.camera
    if camera is None:
        camera, missed = _seen_from(scene, goal, q0)
    elif goal.q is not None and max(distance(scene.camera_pose(goal.q, t), camera)) < SAME:
        return goal.q, 0.0
    tip = tip_of(scene, camera)
    if scene.motion is not None:
        tip = scene.motion.pose(t) @ tip
    low = np.where(np.isfinite(robot.q_min), robot.q_min, q0 - np.pi)
    high = np.where(np.isfinite(robot.q_max), robot.q_max, q0 + np.pi)
    others = np.random.default_rng(0).uniform(low, high, (TRIES, robot.n))
    for near in (*(() if goal.q is None else (goal.q,)), q0, *others):
        q = inverse_kinematics(robot, tip, near)
        if q is not None:
            return q, missed
    raise SceneError("no configuration within the joints' ranges was found that reaches it: it may be out of reach")


def _seen_from(scene: Scene, goal: Goal, q0: Array) -> tuple[Pose, float]:
    """The pose that explains a goal's image best, and by how much it misses the markers at most [px]."""
    camera, poses = scene.camera, []
    start, seen = scene.camera_pose(q0), camera.normalised(goal.pixels)
    for turn in np.arange(TURNS) * (2.0 * np.pi / TURNS):
        near = start @ Pose(np.asarray(pin.utils.rotate("z", turn)), np.zeros(3))
        try:
            pose = estimated_pose(scene.markers, seen, near)
        except np.linalg.LinAlgError:  # a search that has left the range of floats
            continue
        P = pose.inverse.act(scene.markers)
        if (P[:, 2] > MINIMUM_DEPTH).all():
            poses.append((pose, float(np.abs(camera.pixels(P[:, :2] / P[:, 2:]) - goal.pixels).max())))
    best = min(poses, key=lambda pair: pair[1], default=None)
    if best is None or not best[1] < MAX_MISS * camera.size[0]:
        raise SceneError("no pose of the camera was found from which the markers look like this")
    return best


@dataclass(frozen=True)
class Preview:
    """What is to be seen of a scenario's setup before it is simulated.

    ``moments`` are the start, then the goals: each as it is at its end, when the next one begins or the run is over;
    ``rows`` all rows and the joints' own limits that no row is about, those nearest to their boundary first;
    ``refusal`` says why a run would not start; ``doubts`` name numbers that suggest another unit, and markers that no
    law can bring to their goals.
    """

    name: str
    setup: Setup
    moments: tuple[Moment, ...]
    rows: tuple[Row, ...]
    refusal: str
    doubts: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, setup: Setup) -> Self:
        """The preview of a setup; nothing is simulated."""
        moments = (moment_at(setup, "start", 0.0, setup.q0, setup.qd0), *_at_goals(setup))
        doubts, refusal = implausible(setup.scene, setup.task, setup.Ts), ""
        try:
            setup.check_start()
            doubts += setup.separated
        except VsconstraintsError as error:
            refusal = str(error)
        return cls(name, setup, moments, rows_of(setup, moments), refusal, tuple(doubts))

    @classmethod
    def of_scenario(cls, scenario: Scenario, trial: int = 0, seed: int = 0) -> Self:
        """The preview of a trial; what of its goals cannot be built is a warning. Raises VsconstraintsError."""
        try:
            return cls.of(scenario.name, scenario.setup(trial, seed))
        except VsconstraintsError as error:
            if (setup := _without_goals(scenario, trial, seed)) is None:
                raise
            moments = _moments_without(setup, scenario)
            doubts = tuple(implausible(setup.scene, setup.task, setup.Ts))
            return cls(scenario.name, setup, moments, rows_of(setup, moments), str(error), doubts)

    @property
    def near(self) -> tuple[Row, ...]:
        """Rows that are near their boundary, or outside, at the start or a goal."""
        return tuple(row for row in self.rows if row.greatest >= NEAR)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Everything that is wrong, with the moment it is wrong in."""
        problems = [f"{moment.name}: {problem}" for moment in self.moments for problem in moment.problems]
        return (*self.doubts, *problems, *([f"no run would start: {self.refusal}"] if self.refusal else []))


def _named(goals: Sequence[Any]) -> Iterator[tuple[str, Any]]:
    return ((f"goal {k}" if len(goals) > 1 else "goal", goal) for k, goal in enumerate(goals, 1))


def _at_goals(setup: Setup) -> Iterator[Moment]:
    goals = setup.task.goals
    ends = [goal.from_time - setup.Ts for goal in goals[1:]] + [(setup.samples - 1) * setup.Ts]
    for (name, goal), t in zip(_named(goals), ends, strict=True):
        try:
            q, missed = goal_configuration(setup.scene, goal, setup.q0, t)
        except SceneError as error:
            yield nowhere(setup, name, t, goal.pixels, str(error))
            continue
        moment = moment_at(setup, name, t, q, np.zeros_like(q))
        if missed > setup.tolerances.feature_px:
            inexact = f"no pose shows the markers just so: the best found misses one by {missed:.3g} px"
            moment = replace(moment, problems=(inexact, *moment.problems))
        yield moment


def _without_goals(scenario: Scenario, trial: int, seed: int) -> Setup | None:
    """The setup with another goal, without what is about goals; None if it cannot be built either."""
    tables = scenario.tables
    task, constraints, target = (tables.get(key, {}) for key in ("task", "constraints", "target"))
    if not isinstance(task, dict) or not isinstance(target, dict):
        return None
    every = constraints if isinstance(constraints, list) else []
    kept = [one for one in every if not (isinstance(one, dict) and one.get("type") == OF_GOALS)]
    centre = [[0.0, 0.0]] * (4 if "square" in target else len(target.get("markers", [])))
    for other in (
        {**task, "goals": [{"camera_at_q": tables.get("q0")}]},
        {"feature": "image-points", "Kp0": 1.0, "goals": [{"markers_px": centre}]},
    ):
        with suppress(VsconstraintsError):
            return replace(scenario, tables={**tables, "task": other, "constraints": kept}).setup(trial, seed)
    return None


def _moments_without(setup: Setup, scenario: Scenario) -> tuple[Moment, ...]:
    """The start, and those goals that are given by joint coordinates, as far as they can be seen."""
    moments, goals = [moment_at(setup, "start", 0.0, setup.q0, setup.qd0)], scenario.tables["task"].get("goals", [])
    nothing = np.full((len(setup.scene.markers), 2), np.nan)
    for name, goal in _named(goals if isinstance(goals, list) else []):
        try:
            q = setup.scene.robot.configuration(goal["camera_at_q"])
            moments.append(moment_at(setup, name, 0.0, q, np.zeros_like(q)))
        except (VsconstraintsError, KeyError, TypeError):
            moments.append(nowhere(setup, name, 0.0, nothing, "where the robot is there is not known"))
    return tuple(moments)
