"""Scene, constraints and task in the form of the arrays of the compiled step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..compiled import load
from ..compiled.codes import CAMERA_POSE, IMAGE_POINTS, OWN
from ..compiled.memory import Workspace
from ..compiled.workspace import Size, Step
from ..constraints import Constraint, ConstraintSet, RowBlock
from ..constraints.by_formula import CompiledRowSpec
from ..errors import ConfigurationError, InvalidInput
from ..formulas.limits import JointLimits
from ..robots.geometry import Pose
from ..robots.robot import Robot
from ..vision.camera import Camera
from ..vision.features import CameraPose, Feature, FeatureMotion, ImagePoints
from ..vision.features.image_points import SHARES
from ..vision.measurement import Measurement
from ..vision.motion import Motion, TargetMotion
from ..vision.scene import Scene
from ..vision.tracking import Rest, TrackingGains, VisualTask


class CompiledRows(NamedTuple):
    """Rows of a constraint that the step computes by the function at an address."""

    constraint: Constraint
    form: CompiledRowSpec
    rows: slice
    address: int


class NumpyRows(NamedTuple):
    """Rows of a constraint without a compiled form, and the range of its robot points."""

    constraint: Constraint
    rows: slice
    points: slice


class StepArrays:
    """Arrays of the compiled ``step`` of a scene, its output array ``out`` and its ``workspace``.

    ``size`` has their sizes, ``parts`` the slice and shape of each output. The step omits the rows
    of ``others``. ``own_feature`` is true if the feature is evaluated in NumPy. Raises
    ConfigurationError if the robot is no serial chain, or if the scene or the task has parts of
    custom classes that control does not support.
    """

    def __init__(
        self,
        scene: Scene,
        constraints: ConstraintSet,
        task: VisualTask,
        known: bool = False,
        limits: JointLimits | None = None,
    ) -> None:
        _demand(scene, Scene)
        _demand(scene.camera, Camera)
        _demand(task, VisualTask)
        _demand(task.gains, TrackingGains)
        feature = task.feature
        M = len(scene.markers)
        n = scene.robot.n
        self.own_feature = _compiled_kind(feature) == OWN
        k = feature.size(M)
        rest = task.rest_of(n, k)
        self.others: list[NumpyRows] = []
        compiled = []
        first = 0
        for constraint, count, points in constraints.blocks():
            end = first + count
            rows = slice(first, end)
            first = end
            form = constraint.compiled_form(scene, points)
            address = _address_of_rows(form)
            if form is not None and address:
                compiled.append(CompiledRows(constraint, form, rows, address))
            else:
                self.others.append(NumpyRows(constraint, rows, points))
        parameter_counts = [len(block.form.parameters) for block in compiled]
        self.size = Size(
            n=n,
            M=M,
            P=len(scene.points),
            m=len(constraints.labels),
            k=k,
            goals=len(task.goals),
            parts=len(compiled),
            parameters=max(parameter_counts, default=0),
            limited=limits is not None,
            rests=rest.any,
        )
        step, self.out = self.size.step(limits)
        self.step = step = step._replace(evaluate=load("step").EVALUATE)
        _write_scene(step, scene, known)
        _write_task(step, task, rest)
        step.rows.K[:] = constraints.approach_time
        step.rows.switching_gain[:] = constraints.switching_gain
        step.rows.scale[:] = constraints.scale
        for i, block in enumerate(compiled):
            _write_constraint(step, i, block, known)
        self.parts = self.size.outputs
        self.workspace = Workspace(step)
        self.reset()

    @property
    def memory(self) -> tuple[Any, ...]:
        """Arrays that are kept between samples, except for the poses of the camera."""
        step = self.step
        return (
            step.last,
            step.last_error,
            step.last_partial,
            step.last_J,
            step.last_reference,
            step.correction,
            step.last_command,
        )

    def remembered(self) -> list[Any]:
        """Return a copy of the memory."""
        return [array.copy() for array in self.memory]

    def recall(self, remembered: Sequence[Any]) -> None:
        """Set the memory from this step or from another one of the same scene."""
        for array, kept in zip(self.memory, remembered, strict=True):
            array[...] = kept

    def reset(self) -> None:
        """Clear the memory of the last sample."""
        last, *others = self.memory
        last["goal"] = -1
        last["time"] = 0.0
        last["began"] = 0.0
        last["views"] = 0
        for array in others:
            array[...] = 0
        self.step.slip[:] = np.nan

    def insert(self, rows: slice, constraint: Constraint, block: RowBlock) -> None:
        """Write the rows of a constraint in NumPy between the compiled ones.

        Raises InvalidInput if they are of the wrong shape.
        """
        now = self.step.rows
        r = rows.stop - rows.start
        n = self.size.n
        shapes = [part.shape for part in block]
        if shapes != [(r,), (r,), (r, n), (r,)]:
            raise InvalidInput(
                f"rows (σ, φ, L_gφ, L_fφ) of the wrong shape: {constraint.kind} has {r} labels "
                f"for {n} joints, but the shapes {shapes}"
            )
        now.phi[rows] = block.phi
        now.sigma[rows] = block.sigma
        now.Lf[rows] = block.Lf
        now.Lg[rows] = block.Lg
        now.sigma_dot[rows] = (block.phi - block.sigma) / constraint.K

    def insert_feature(self, feature: Feature, motion: FeatureMotion) -> None:
        """Write a feature in NumPy; raise InvalidInput if it is of the wrong shape."""
        step = self.step
        k = self.size.k
        n = self.size.n
        shapes = [part.shape for part in motion]
        if shapes != [(k,), (k, n), (k,), (k,), (k,)]:
            raise InvalidInput(
                f"the feature {feature.name} returned the shapes {shapes} of error, J, velocity, "
                f"drift and partial, but its size is {k}: let its size be the number of components"
            )
        step.task.error[:] = motion.error
        step.task.J[:] = motion.J
        step.task.error_rate[:] = motion.velocity
        step.drift[:] = motion.drift
        step.partial[:] = motion.partial

    def measure(self, measured: Measurement) -> None:
        """Write a checked measurement of a camera for the next step."""
        pose = measured.camera
        record = self.step.measurement
        record["given"] = measured.pixels is not None
        record["time"] = measured.taken
        if measured.pixels is not None:
            self.step.measured[:, :2] = measured.pixels
            self.step.measured[:, 2] = measured.depth
        record["pose_given"] = pose is not None
        if pose is not None:
            self.step.camera_R[:] = pose.R
            self.step.camera_t[:] = pose.t


def _address_of_rows(form: CompiledRowSpec | None) -> int:
    """Return the address of the function that computes rows; 0 if they are computed in NumPy."""
    if form is None:
        return 0
    is_known_motion = form.motion is None or type(form.motion) is Motion
    if not is_known_motion:
        return 0
    kernels = load("constraint_rows")
    count = len(form.parameters)
    address: int = kernels.rows_address(form.template, form.formulas, count)
    return address


def _demand(part: object, kind: type) -> None:
    """Raise ConfigurationError unless ``part`` is of exactly that class.

    A subclass may compute anything.
    """
    if type(part) is not kind:
        raise ConfigurationError(
            f"control needs a {kind.__name__}, not the subclass {type(part).__name__}"
        )


def _compiled_kind(feature: Feature) -> int:
    """Return the compiled form of a feature; OWN if it is evaluated in NumPy."""
    if type(feature) is CameraPose:
        return CAMERA_POSE
    every_marker = type(feature) is ImagePoints and feature.markers is None
    return IMAGE_POINTS if every_marker else OWN


def _write(record: Any, **values: Any) -> None:
    for name, value in values.items():
        record[name] = value


def _write_scene(step: Step, scene: Scene, known: bool) -> None:
    _write_robot(step, scene.robot)
    write_camera(step, scene.camera)
    step.markers[:] = scene.markers
    for record, point in zip(step.robot_points, scene.points, strict=True):
        number = scene.robot.frame_id(point.link)
        frame = scene.robot.model.frames[number]
        pose = Pose.of(frame.placement)
        offset = np.asarray(point.offset, dtype=np.float64)
        _write(record, body=int(frame.parentJoint), offset=pose.act(offset))
    motion = scene.motion
    if motion is not None:
        _demand(motion, TargetMotion)
        _demand(motion.translation, Motion)
        target = step.target[0]
        _write(target, moves=True, known=known or motion.known)
        _write(target, centre=motion.centre, angular_velocity=motion.angular_velocity)
        _write_motion(target["motion"], motion.translation)


def _write_robot(step: Step, robot: Robot) -> None:
    """Write the joints, and the pose of the tip in the last body."""
    placements = list(robot.model.jointPlacements)[1:]
    R = [placement.rotation for placement in placements]
    t = [placement.translation for placement in placements]
    _write(step.joints, R=R, t=t)
    _write(step.joints, axis=robot.axes, prismatic=robot.prismatic, continuous=robot.continuous)
    tip = robot.model.frames[robot.frame_id("tip")]
    if int(tip.parentJoint) != robot.n:
        raise ConfigurationError(
            f"control needs a tip that the last joint moves, not the frame {tip.name}"
        )
    _write(step.camera[0], tip_R=tip.placement.rotation, tip_t=tip.placement.translation)


def write_camera(step: Step, camera: Camera) -> None:
    """Write the pose and the intrinsics of the camera.

    The pose of the tip in the last body must be written before.
    """
    record = step.camera[0]
    tip = Pose(record["tip_R"].copy(), record["tip_t"].copy())
    eye = camera.pose(tip)
    is_fixed = camera.fixed is not None
    _write(record, R=eye.R, t=eye.t, fixed=is_fixed, depth_factor=1.0)
    _write(record, focal=camera.focal, offset=camera.offset)


def _write_task(step: Step, task: VisualTask, rest: Rest) -> None:
    feature = task.feature
    gains = task.gains
    share = 0.0
    if isinstance(feature, ImagePoints):
        share = SHARES[feature.interaction_matrix]
    _write(
        step.options[0],
        feature=_compiled_kind(feature),
        share=share,
        drift_by_differences=task.drift == "differences",
        velocity_by_differences=task.velocity == "differences",
        reference_by_differences=task.reference == "differences",
        Kp0=gains.Kp0,
        slope=gains.Kp_slope,
        damping=gains.damping,
        rest_damping=rest.damping,
        rest_stiffness=rest.stiffness,
    )
    step.posture[: len(rest.posture)] = rest.posture
    for g, goal in enumerate(task.goals):
        pose = Pose.identity()
        if isinstance(feature, CameraPose) and goal.camera is not None:
            pose = goal.camera
        reach_in = 0.0
        if goal.reference is not None:
            reach_in = goal.reference.duration
        record = step.goals[g]
        _write(record, from_time=goal.from_time, reach_in=reach_in, R=pose.R, t=pose.t)
        step.goal_points[g] = goal.normalised.ravel()
        if share > 0.0:
            step.goal_interaction[g] = goal.interaction


def _write_constraint(step: Step, i: int, block: CompiledRows, known: bool) -> None:
    """Write part ``i``; ``known`` if the motion of the forbidden object counts as known."""
    record = step.parts[i]
    form = block.form
    rows = block.rows
    motion = form.motion
    _write(
        record,
        address=block.address,
        first=rows.start,
        count=rows.stop - rows.start,
        K=block.constraint.K,
        margin=form.margin,
    )
    record["R"] = np.eye(3)
    if form.frame is not None:
        R, t = form.frame
        record["R"][: len(t), : len(t)] = R
        record["t"][: len(t)] = t
    if motion is not None:
        _write(record, moves=True, known=known or motion.known)
        _write_motion(record["motion"], motion)
    step.parameters[i, : len(form.parameters)] = form.parameters
    step.which[rows] = form.which
    step.gradients[rows] = form.gradients
    step.offsets[rows] = form.offsets
    step.middles[rows] = form.middles


def _write_motion(record: Any, motion: Motion) -> None:
    k = motion.size
    record["velocity"][:k] = motion.velocity
    record["amplitude"][:k] = motion.amplitude
    record["rate"] = motion.rate
    record["phase"] = motion.phase
