"""Construction of a simulation setup from the tables of a scenario."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from ..constraints import ConstraintSet, robot_points
from ..constraints.base import require_positive
from ..errors import ConfigurationError, unknown_name
from ..plugins.registry import load, scenario_types
from ..robots.catalogue import ready_made
from ..robots.geometry import Pose, Vector3
from ..robots.limits import NO_LIMITS, ActuatorLimits
from ..robots.robot import Robot
from ..rows import Array
from ..simulation import Setup, Tolerances
from ..simulation.disturbances import Disturbances
from ..simulation.follower import ACCELERATIONS, ArmInput
from ..simulation.plant import Actuation
from ..simulation.sensing import believed_camera
from ..vision.camera import Camera
from ..vision.motion import Motion, TargetMotion
from ..vision.scene import Scene
from ..vision.tracking import TrackingGains, VisualTask
from .constraint_types import make_constraint
from .feature_types import feature_named, make_feature
from .reading import Table, checked, chosen, from_table, require_table, split
from .views import make_camera, make_goal


@dataclass(frozen=True)
class File:
    """Keys of a scenario file with types and defaults; docs/scenarios.md explains them."""

    robot: str | Table
    camera: Table
    target: Table
    task: Table
    q0: Sequence[float]
    sampling_time: float
    duration: float
    title: str = ""
    description: str = ""
    qd0: Sequence[float] | None = None
    start_deviation: float = 0.0
    constraints: Sequence[Any] = ()
    disturbances: Table = field(default_factory=dict)
    tolerances: Tolerances = field(default_factory=Tolerances)
    on_rank_loss: Literal["abort", "continue"] = "abort"
    on_hidden_markers: Literal["refuse", "continue"] = "refuse"
    actuation: Actuation = "acceleration"
    limits: str | Table | None = None
    plant: Table | None = None
    sensor: str | Table | None = None
    arm: ArmInput = ACCELERATIONS


def build(
    tables: Table,
    where: str,
    folder: Path,
    deviation: np.random.Generator | None = None,
    seed: tuple[int, ...] = (0,),
) -> Setup:
    """Build the setup that a scenario's tables describe.

    ``where`` is the scenario's name in messages. Paths are relative to ``folder``. ``deviation``
    draws one number in [−1, 1] per joint; times ``start_deviation``, it is added to the start.
    ``seed`` seeds all randomness of the disturbances. Raises ConfigurationError or InvalidInput,
    which name the key or value, for unknown keys and unusable values.
    """
    file: File = from_table(File, tables, where)
    bare = build_scene(tables, where, folder)
    robot = bare.robot
    camera = bare.camera
    q0 = robot.configuration(file.q0, "q0")
    qd0: Array = np.zeros(robot.n)
    if file.qd0 is not None:
        qd0 = robot.configuration(file.qd0, "qd0")
    if deviation is not None:
        q0 = q0 + file.start_deviation * deviation.uniform(-1.0, 1.0, robot.n)
    disturbances = _disturbances(file.disturbances, f"{where}.disturbances", seed)
    believed = believed_camera(camera, disturbances)
    task = _task(file.task, f"{where}.task", bare, believed, folder)
    constraints = [
        make_constraint(table, f"{where}.constraints[{i}]", robot, camera, folder, task.goals)
        for i, table in enumerate(file.constraints)
    ]
    scene = Scene(robot, camera, bare.markers, robot_points(constraints), bare.motion)
    sensor = {"type": file.sensor} if isinstance(file.sensor, str) else file.sensor
    return Setup(
        scene=scene,
        constraints=ConstraintSet(constraints, scene),
        task=task,
        q0=q0,
        qd0=qd0,
        sampling_time=file.sampling_time,
        duration=file.duration,
        on_rank_loss=file.on_rank_loss,
        tolerances=file.tolerances,
        disturbances=disturbances,
        actuation=file.actuation,
        on_hidden_markers=file.on_hidden_markers,
        limits=_limits(file.limits, robot, f"{where}.limits"),
        dynamics=_by_type(file.plant, "plant", where),
        images=_by_type(sensor, "sensor", where),
        arm=file.arm,
    )


def build_scene(tables: Table, where: str, folder: Path) -> Scene:
    """Build robot, camera and target from a scenario's tables, without task and constraints.

    The arguments are those of ``build``.
    """
    missing = [key for key in ("robot", "camera", "target") if key not in tables]
    if missing:
        raise ConfigurationError(f"{where}: the key {missing[0]!r} is missing")
    robot = _robot(checked(tables["robot"], str | Table, where, "robot"), f"{where}.robot", folder)
    camera = make_camera(tables["camera"], f"{where}.camera", folder)
    markers, motion = _target(tables["target"], f"{where}.target")
    return Scene(robot, camera, markers, (), motion)


def _limits(value: str | Table | None, robot: Robot, where: str) -> ActuatorLimits:
    if value is None:
        return NO_LIMITS
    if not isinstance(value, str):
        return from_table(ActuatorLimits, value, where)
    if value != "robot":
        raise unknown_name(where, value, ["robot", "a table"])
    return robot.limits


def _by_type(table: Table | None, key: str, scenario: str) -> Any:
    """Return the settings of the table ``key`` by the class that a part registers for its type."""
    if table is None:
        return None
    where = f"{scenario}.{key}"
    values = dict(table)
    kind = load(chosen(values, "type", scenario_types(key), where))
    return from_table(kind, values, where)


def _robot(value: str | Table, where: str, folder: Path) -> Robot:
    if isinstance(value, str):
        return ready_made(value)
    if "urdf" in value:
        return from_table(Robot.from_urdf, value, where, {"folder": folder})
    return from_table(Robot.from_dh, value, where)


@dataclass(frozen=True)
class Turn:
    """Rotation of a moving target, about the mean of its markers unless ``centre`` is given."""

    angular_velocity: Vector3 = (0.0, 0.0, 0.0)  #: [rad/s]
    centre: Vector3 | None = None  #: [m]


@dataclass(frozen=True)
class Square:
    """Four markers at the corners of a square."""

    side: float  #: [m]
    xyz: Vector3  #: Centre [m].
    rpy: Vector3 = (0.0, 0.0, 0.0)  #: Roll, pitch and yaw [rad].


def _target(table: object, where: str) -> tuple[Array, TargetMotion | None]:
    """Return the markers (M, 3) of a target's table [m], and how they move."""
    values = require_table(table, where)
    make = _square_target if "square" in values else _markers
    of_markers, of_motion = split(values, where, make, _moving)
    markers = from_table(make, of_markers, where)
    if not of_motion:
        return markers, None
    in_motion = f"{where}.motion"
    of_translation, of_turn = split(of_motion["motion"], in_motion, Motion, Turn)
    translation = from_table(Motion, of_translation, in_motion)
    turn = from_table(Turn, of_turn, in_motion)
    centre = markers.mean(axis=0)
    if turn.centre is not None:
        centre = np.array(turn.centre)
    return markers, TargetMotion(translation, np.array(turn.angular_velocity), centre)


def _moving(motion: Table) -> None:
    """Declare the key ``motion`` of a target's table."""


def _markers(markers: Annotated[Sequence[Vector3], msgspec.Meta(min_length=1)]) -> Array:
    return np.array(markers)


def _square_target(square: Square) -> Array:
    require_positive(square.side, "side of a square target")
    half = 0.5 * square.side
    corners = np.array(
        [
            [-half, -half, 0.0],
            [half, -half, 0.0],
            [half, half, 0.0],
            [-half, half, 0.0],
        ]
    )
    return Pose.from_xyz_rpy(square.xyz, square.rpy).act(corners)


def _task(table: Table, where: str, scene: Scene, believed: Camera, folder: Path) -> VisualTask:
    """Return the task of a table; the controller knows its goals by the camera it ``believed``."""
    values = dict(table)
    feature = feature_named(values, where, folder)
    of_feature, of_gains, of_task = split(
        values, where, feature, TrackingGains, VisualTask, without=["feature", "gains"]
    )
    goals = checked(of_task.pop("goals", []), list[Any], where, "goals")
    context = {
        "feature": make_feature(feature, of_feature, where, folder),
        "goals": [
            make_goal(goal, f"{where}.goals[{i}]", scene, believed) for i, goal in enumerate(goals)
        ],
        "gains": from_table(TrackingGains, of_gains, where),
    }
    return from_table(VisualTask, of_task, where, context)


def _disturbances(table: Table, where: str, seed: tuple[int, ...]) -> Disturbances:
    """Return the disturbances of a table; a scalar stands for the same number at every joint."""
    values = require_table(table, where)
    for key in ("acceleration", "distortion_factor"):
        if isinstance(values.get(key), int | float):
            values[key] = [values[key]]
    return from_table(Disturbances, values, where, {"seed": seed})
