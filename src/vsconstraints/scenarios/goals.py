"""The goals of a scenario's task."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import ConfigurationError, InvalidInput, SceneError, shown
from ..robots.geometry import Pose, Vector2
from ..rows import Array
from ..simulation.sensing import shown_to
from ..vision.camera import Camera
from ..vision.features import Goal
from ..vision.references import MinimumJerk
from ..vision.scene import MINIMUM_DEPTH, Scene
from .reading import Table, made


@dataclass(frozen=True)
class GoalTable:
    """Keys of a goal; one of the three ways to say where it is."""

    from_time: float = 0.0
    reach_in: float | None = None
    camera_at_q: Sequence[float] | None = None
    camera_pose: Table | None = None
    markers_px: Sequence[Vector2] | None = None
    depth_m: Sequence[float] | None = None
    tolerance_factor: float = 1.0


def make_goal(table: object, where: str, scene: Scene, believed: Camera) -> Goal:
    """A goal as the control knows it: shown to the real camera, turned into coordinates by the believed one."""
    goal: GoalTable = made(GoalTable, table, where)
    factor = goal.tolerance_factor
    if not (np.isfinite(factor) and factor > 0.0):
        raise ConfigurationError(f"{where}: tolerance_factor must be positive, not {factor}")
    kinds = [key for key in ("camera_at_q", "camera_pose", "markers_px") if getattr(goal, key) is not None]
    if len(kinds) != 1:
        raise ConfigurationError(
            f"{where} needs one of camera_at_q, camera_pose and markers_px; it has {kinds or 'none'}"
        )
    reference = None if goal.reach_in is None else MinimumJerk(goal.reach_in)
    if goal.markers_px is not None:
        return _image_goal(goal, goal.markers_px, where, scene, believed, reference)
    if goal.depth_m is not None:
        raise ConfigurationError(f"{where}: depth_m goes with markers_px, not with {kinds[0]}")
    q: Array | None = None
    if goal.camera_pose is not None:
        camera = made(Pose.from_xyz_rpy, goal.camera_pose, f"{where}.camera_pose")
    else:
        q = scene.robot.configuration(goal.camera_at_q, f"{where}: camera_at_q")
        camera = scene.camera_pose(q)
    try:
        pixels, depth = scene.project(camera), scene.depth(camera)
    except SceneError as error:
        raise ConfigurationError(f"{where}: at the goal, {error}") from error
    return Goal(goal.from_time, pixels, shown_to(scene.camera, believed, pixels), camera, depth, reference, q, factor)


def _image_goal(
    goal: GoalTable,
    markers_px: Sequence[Vector2],
    where: str,
    scene: Scene,
    believed: Camera,
    reference: MinimumJerk | None,
) -> Goal:
    m, depth = len(scene.markers), None if goal.depth_m is None else np.array(goal.depth_m)
    if len(markers_px) != m:
        raise ConfigurationError(f"{where}: markers_px must be {m} × 2 numbers, not {shown(markers_px)}")
    if depth is not None and len(depth) != m:
        raise ConfigurationError(f"{where}: depth_m must be {m} numbers, not {shown(goal.depth_m)}")
    if depth is not None and (depth < MINIMUM_DEPTH).any():
        raise ConfigurationError(f"{where}: depth_m must be at least {MINIMUM_DEPTH} m, not {depth}")
    try:
        pixels = scene.camera.undistort(np.array(markers_px))
    except InvalidInput as error:
        raise ConfigurationError(f"{where}: markers_px: {error}") from error
    normalised = shown_to(scene.camera, believed, pixels)
    factor = goal.tolerance_factor
    return Goal(goal.from_time, pixels, normalised, depth=depth, reference=reference, tolerance_factor=factor)
