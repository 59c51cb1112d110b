"""From a scenario's tables to what is simulated."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast, get_args

import numpy as np

from ..camera import Camera
from ..constraints import (
    ConstraintSet,
    robot_points,
)
from ..constraints.base import demand_positive
from ..errors import ConfigurationError, SceneError
from ..features import FEATURES, Feature, Goal, ImagePoints, InteractionMatrix
from ..geometry import Pose
from ..motion import TargetMotion
from ..references import MinimumJerk
from ..robot import Robot
from ..robots import ready_made
from ..rows import Array
from ..scene import MINIMUM_DEPTH, Scene
from ..simulation import Setup, Tolerances
from ..simulation.plant import Actuation
from ..simulation.sensing import believed_camera
from ..tracking import DERIVATIVES, Derivative, TrackingGains, VisualTask
from .constraint_types import make_constraint
from .motion_tables import read_disturbances, read_target_motion
from .section import Section


def build(
    tables: dict[str, Any],
    where: str,
    folder: Path,
    deviation: np.random.Generator | None = None,
    seed: tuple[int, ...] = (0,),
) -> Setup:
    """The setup that a scenario's tables describe.

    Parameters
    ----------
    tables
        What the file says.
    where
        Name of the scenario, for messages.
    folder
        What paths in the scenario are relative to.
    deviation
        What draws the numbers in [−1, 1], one per joint, that the start deviates by, times ``start_deviation``.
    seed
        Of everything random in the disturbances.

    Raises
    ------
    ConfigurationError, InvalidInput
        for unknown keys and unusable values; the message names them.
    """
    top = Section(tables, where)
    top.take("title", str, "")
    top.take("description", str, "")
    robot = _robot(top, folder)
    camera = _camera(top.section("camera"))
    markers, motion = _target(top.section("target"))
    q0 = robot.configuration(top.array("q0"), "q0")
    qd0 = robot.configuration(top.array("qd0", [0.0] * robot.n), "qd0")
    spread = float(top.number("start_deviation", 0.0))
    if deviation is not None:
        q0 = q0 + spread * deviation.uniform(-1.0, 1.0, robot.n)
    constraints = [make_constraint(section, robot, camera, folder) for section in top.sections("constraints")]
    scene = Scene(robot, camera, markers, robot_points(constraints), motion)
    disturbances = read_disturbances(top.section("disturbances", {}), seed)
    task = _task(top.section("task"), scene, believed_camera(camera, disturbances))
    setup = Setup(
        scene,
        ConstraintSet(constraints, scene),
        task,
        q0,
        qd0,
        Ts=float(top.number("sampling_time")),
        duration=float(top.number("duration")),
        abort_on_rank_loss=top.choice("on_rank_loss", ("abort", "continue"), "abort") == "abort",
        tolerances=_tolerances(top.section("tolerances", {})),
        disturbances=disturbances,
        refuse_hidden_markers=top.choice("on_hidden_markers", ("refuse", "continue"), "refuse") == "refuse",
        actuation=cast("Actuation", top.choice("actuation", get_args(Actuation), "acceleration")),
    )
    top.finish()
    return setup


def _robot(top: Section, folder: Path) -> Robot:
    value = top.take("robot", (str, dict))
    if isinstance(value, str):
        return ready_made(value)
    section = Section(value, f"{top.where}.robot")
    name = section.take("name", str, None)
    if "urdf" in section:
        robot = Robot.from_urdf(
            folder / section.take("urdf", str),
            section.take("tip", str, None),
            locked=section.take("locked", dict, None),
            name=name,
        )
    else:
        table = section.array("dh", shape=(None, 4))
        n = len(table)
        robot = Robot.from_dh(
            table,
            prismatic=section.take("prismatic", list, []),
            q_min=section.array("q_min", None, (n,)),
            q_max=section.array("q_max", None, (n,)),
            qd_max=section.array("qd_max", None, (n,)),
            name=name or "robot",
        )
    section.finish()
    return robot


def _camera(section: Section) -> Camera:
    if "mount" in section and "fixed" in section:
        raise ConfigurationError(
            f"{section.where}: a camera is mounted on the robot or fixed in space: give mount or fixed, not both"
        )
    camera = Camera(
        tuple(section.array("focal_px", shape=(2,))),
        tuple(section.array("size_px", shape=(2,))),
        section.array("principal_point_px", None, (2,)),
        _pose(section.section("mount", {})),
        _pose(section.section("fixed")) if "fixed" in section else None,
    )
    section.finish()
    return camera


def _pose(section: Section) -> Pose:
    pose = Pose.from_xyz_rpy(section.array("xyz", np.zeros(3), (3,)), section.array("rpy", np.zeros(3), (3,)))
    section.finish()
    return pose


def _target(section: Section) -> tuple[Array, TargetMotion | None]:
    markers = _markers(section)
    motion = read_target_motion(section.section("motion"), markers) if "motion" in section else None
    section.finish()
    return markers, motion


def _markers(section: Section) -> Array:
    if "square" in section:
        square = section.section("square")
        side = square.number("side")
        demand_positive(side, f"{square.where}: side")
        half = 0.5 * side
        if "xyz" not in square:
            raise ConfigurationError(f"{square.where}: the key 'xyz' is missing")
        pose = _pose(square)
        corners = half * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
        markers = pose.act(corners)
    else:
        markers = section.array("markers", shape=(None, 3))
    return np.asarray(markers)


def _feature(section: Section) -> Feature:
    kind = FEATURES[section.choice("feature", FEATURES)]
    if issubclass(kind, ImagePoints):
        which = section.choice("interaction_matrix", get_args(InteractionMatrix), "current")
        return kind(cast("InteractionMatrix", which))
    return kind()


def _task(section: Section, scene: Scene, camera: Camera) -> VisualTask:
    feature = _feature(section)
    gains = TrackingGains(
        float(section.number("Kp0")),
        float(section.number("Kp_slope0", 0.0)),
        float(section.number("Kv_over_sqrt_Kp", 3.0)),
    )
    drift = cast("Derivative", section.choice("drift", DERIVATIVES, "exact"))
    velocity = cast("Derivative", section.choice("velocity", DERIVATIVES, "exact"))
    reference = cast("Derivative", section.choice("reference", DERIVATIVES, "exact"))
    goals = [_goal(goal, scene, camera) for goal in section.sections("goals")]
    section.finish()
    return VisualTask(feature, goals, gains, drift, velocity, reference)


def _goal(section: Section, scene: Scene, believed: Camera) -> Goal:
    """A goal as the control knows it: shown to the real camera, turned into coordinates by the believed one."""
    time = float(section.number("from_time", 0.0))
    reach_in = section.number("reach_in", None)
    reference = None if reach_in is None else MinimumJerk(float(reach_in))
    kinds = [key for key in ("camera_at_q", "camera_pose", "markers_px") if key in section]
    if len(kinds) != 1:
        raise ConfigurationError(
            f"{section.where} needs one of camera_at_q, camera_pose and markers_px; it has {kinds or 'none'}"
        )
    if kinds == ["markers_px"]:
        m = len(scene.markers)
        pixels, depth = section.array("markers_px", shape=(m, 2)), section.array("depth_m", None, (m,))
        section.finish()
        if depth is not None and (depth < MINIMUM_DEPTH).any():
            raise ConfigurationError(f"{section.where}: depth_m must be at least {MINIMUM_DEPTH} m, not {depth}")
        return Goal(time, pixels, believed.normalised(pixels), depth=depth, reference=reference)
    if kinds == ["camera_at_q"]:
        camera = scene.camera_pose(section.array("camera_at_q", shape=(scene.robot.n,)))
    else:
        pose = section.section("camera_pose")
        camera = Pose.from_xyz_rpy(pose.array("xyz", shape=(3,)), pose.array("rpy", shape=(3,)))
        pose.finish()
    section.finish()
    try:
        pixels, depth = scene.project(camera), scene.depth(camera)
    except SceneError as error:
        raise ConfigurationError(f"{section.where}: at the goal, {error}") from error
    return Goal(time, pixels, believed.normalised(pixels), camera, depth, reference)


def _tolerances(section: Section) -> Tolerances:
    defaults = Tolerances()
    tolerances = Tolerances(
        translation=float(section.number("translation_m", defaults.translation)),
        rotation=float(section.number("rotation_rad", defaults.rotation)),
        feature=float(section.number("feature_px", defaults.feature)),
        dwell=float(section.number("dwell_s", defaults.dwell)),
        rest=float(section.number("rest_s", defaults.rest)),
    )
    section.finish()
    return tolerances
