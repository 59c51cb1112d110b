"""A scene, its constraints and its task as the arrays of the compiled step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..constraints import Constraint, ConstraintSet, RowBlock
from ..constraints.constraint_set import misshapen, shapes_of
from ..formulas.limits import JointLimits
from ..robots.geometry import Pose
from ..robots.robot import Robot
from ..rows import Array
from ..vision.camera import Camera
from ..vision.features import CameraPose, ImagePoints
from ..vision.measurement import Measurement
from ..vision.motion import Motion, TargetMotion
from ..vision.scene import Scene
from ..vision.tracking import Rest, TrackingGains, VisualTask
from .cameras import write_camera
from .constraint_parts import NotCompiled, Parts, demand, write_motion
from .structures import Size, Step, pack_struct
from .visual_task import CAMERA_POSE, IMAGE_POINTS

SHARES = {"current": 0.0, "desired": 1.0, "mean": 0.5}
"""Share of the goal's interaction matrix."""

__all__ = ["NotCompiled", "Packed"]


class Packed:
    """The compiled step of a scene, and the array that it writes to.

    Attributes
    ----------
    step, out
        The step's arrays, and all its outputs as one array.
    size, parts
        Their sizes, and where each output stands, with its shape.
    others
        Constraints without a compiled form, with their rows and their robot points: the step leaves those rows out.
    address
        Where compiled code finds the step.

    Raises
    ------
    NotCompiled
        if something in the scene or the task has no compiled form; says what.
    """

    def __init__(
        self,
        scene: Scene,
        constraints: ConstraintSet,
        task: VisualTask,
        known: bool = False,
        limits: JointLimits | None = None,
    ) -> None:
        for part, kind in ((scene, Scene), (scene.camera, Camera), (task, VisualTask), (task.gains, TrackingGains)):
            demand(part, kind)
        feature, M = task.feature, len(scene.markers)
        if type(feature) not in (CameraPose, ImagePoints):
            raise NotCompiled(f"the feature {feature.name}")
        if any(goal.reference is not None for goal in task.goals):
            raise NotCompiled("a reference trajectory")
        parts, k = Parts(constraints), 6 if isinstance(feature, CameraPose) else 2 * M
        rest = task.rest_of(scene.robot.n, k)
        self.size = Size(
            n=scene.robot.n,
            M=M,
            P=len(scene.points),
            m=len(constraints.labels),
            k=k,
            goals=len(task.goals),
            parts=len(parts.forms),
            parameters=parts.parameters,
            limited=limits is not None,
            rests=rest.any,
        )
        self.step, self.out = self.size.step()
        if limits is not None:
            self.step = self.step._replace(limits=limits)
        write_scene(self.step, scene, known)
        write_task(self.step, task, rest)
        parts.write(self.step, known)
        self.others = parts.others
        shapes = self.size.outputs
        self.parts = {name: (where, shapes[name]) for name, where in self.size.where().items()}
        self._frozen = pack_struct(self.step)
        self.address = int(self._frozen.ctypes.data)
        self.reset()

    @property
    def memory(self) -> tuple[Any, ...]:
        """What is kept from one sample to the next."""
        step = self.step
        return step.last, step.last_error, step.last_partial, step.last_J, step.correction, step.last_command

    def remembered(self) -> list[Any]:
        """A copy of that."""
        return [array.copy() for array in self.memory]

    def recall(self, remembered: Sequence[Any]) -> None:
        """Remember what was kept by :meth:`remembered`, here or by another step of the same scene."""
        for array, kept in zip(self.memory, remembered, strict=True):
            array[...] = kept

    def reset(self) -> None:
        """Forget the last sample."""
        last, *others = self.memory
        last["goal"], last["time"] = -1, 0.0
        for array in others:
            array[:] = 0.0
        self.step.slip[:] = np.nan

    def insert(self, rows: slice, constraint: Constraint, block: RowBlock) -> None:
        """Write the rows of a constraint in NumPy between the compiled ones.

        Raises
        ------
        InvalidInput
            if they are of the wrong shape; names the constraint.
        """
        now, r = self.step.rows, rows.stop - rows.start
        if [part.shape for part in block] != shapes_of(r, self.size.n):
            raise misshapen([constraint], [r], [block], self.size.n)
        now.phi[rows], now.sigma[rows], now.Lf[rows], now.Lg[rows] = block.phi, block.sigma, block.Lf, block.Lg
        now.sigma_dot[rows] = (block.phi - block.sigma) / constraint.K

    def measure(self, measured: Measurement) -> None:
        """Let the next step take what a camera has measured, which is checked."""
        pose, record = measured.camera, self.step.measurement
        record["given"], record["time"] = measured.pixels is not None, measured.taken
        if measured.pixels is not None:
            self.step.measured[:, :2], self.step.measured[:, 2] = measured.pixels, measured.depth
        record["pose_given"] = pose is not None
        if pose is not None:
            self.step.camera_R[:], self.step.camera_t[:] = pose.R, pose.t


def write_scene(step: Step, scene: Scene, known: bool) -> None:
    """Write the robot, the camera, the markers, robot points and the target's motion."""
    robot, camera = scene.robot, scene.camera
    placements, axes = joints(robot)
    step.joints["R"], step.joints["t"] = [pose.R for pose in placements], [pose.t for pose in placements]
    step.joints["axis"], step.joints["prismatic"] = axes, robot.prismatic
    tip = _in_joint(robot, robot.frame_id("tip"), robot.n)
    step.camera["tip_R"], step.camera["tip_t"] = tip.R, tip.t
    write_camera(step, camera)
    step.markers[:] = scene.markers
    for record, point in zip(step.robot_points, scene.points, strict=True):
        frame = robot.model.frames[robot.frame_id(point.link)]
        placed = Pose(np.array(frame.placement.rotation), np.array(frame.placement.translation))
        record["body"] = int(frame.parentJoint)
        record["offset"] = placed.act(np.asarray(point.offset, dtype=np.float64))
    motion = scene.motion
    if motion is not None:
        demand(motion, TargetMotion)
        demand(motion.translation, Motion)
        step.target["moves"], step.target["known"] = True, known or motion.known
        write_motion(step.target[0]["motion"], motion.translation)
        step.target["angular_velocity"], step.target["centre"] = motion.angular_velocity, motion.centre


def write_task(step: Step, task: VisualTask, rest: Rest) -> None:
    """Write the feature, the goals and the gains, and what the joints do where the task leaves them free."""
    feature, gains = task.feature, task.gains
    share = SHARES[feature.interaction_matrix] if isinstance(feature, ImagePoints) else 0.0
    for name, value in (
        ("feature", CAMERA_POSE if isinstance(feature, CameraPose) else IMAGE_POINTS),
        ("share", share),
        ("drift_by_differences", task.drift == "differences"),
        ("velocity_by_differences", task.velocity == "differences"),
        ("Kp0", gains.Kp0),
        ("slope", gains.Kp_slope),
        ("damping", gains.damping),
        ("rest_damping", rest.damping),
        ("rest_stiffness", rest.stiffness),
    ):
        step.options[name] = value
    step.posture[: len(rest.posture)] = rest.posture
    for g, goal in enumerate(task.goals):
        pose = goal.camera if isinstance(feature, CameraPose) and goal.camera is not None else Pose.identity()
        step.goals[g]["from_time"], step.goals[g]["R"], step.goals[g]["t"] = goal.from_time, pose.R, pose.t
        step.goal_points[g] = goal.normalised.ravel()
        if share > 0.0:
            step.goal_interaction[g] = goal.interaction


def joints(robot: Robot) -> tuple[list[Pose], list[Array]]:
    """Placement of every joint in the frame of the one before, and its axis there.

    Raises
    ------
    NotCompiled
        if the joints are not a chain of revolute and prismatic ones.
    """
    model = robot.model
    placements, axes = [], []
    for i, joint in enumerate(model.joints[1:], start=1):
        if model.parents[i] != i - 1 or joint.nq != 1 or joint.nv != 1:
            raise NotCompiled(f"the joint {model.names[i]} ({joint.shortname()})")
        data = joint.createData()
        joint.calc(data, np.zeros(model.nq), np.zeros(model.nv))
        S = np.asarray(data.S).reshape(6)
        placement = model.jointPlacements[i]
        placements.append(Pose(np.array(placement.rotation), np.array(placement.translation)))
        axes.append(S[:3] if robot.prismatic[i - 1] else S[3:])
    return placements, axes


def _in_joint(robot: Robot, frame_id: int, joint: int) -> Pose:
    """A frame in the frame of its joint, which must be that one."""
    frame = robot.model.frames[frame_id]
    if int(frame.parentJoint) != joint:
        raise NotCompiled(f"the frame {frame.name}, which joint {joint} does not move")
    return Pose(np.array(frame.placement.rotation), np.array(frame.placement.translation))
