"""A scene, its constraints and its task as two arrays for the compiled layout."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..constraints import (
    Bowl,
    Circle,
    Constraint,
    ConstraintSet,
    Curve,
    FieldOfView,
    ForbiddenBox,
    ForbiddenCapsule,
    ForbiddenCylinder,
    ForbiddenHalfSpace,
    ForbiddenRegion,
    ForbiddenSphere,
    Heart,
    Hyperellipse,
    JointRange,
    JointSpeed,
    Manipulability,
    Occlusion,
)
from ..constraints.manipulability import ROWS_OF
from ..features import CameraPose, ImagePoints
from ..geometry import Pose
from ..motion import Motion, TargetMotion
from ..robot import Robot
from ..rows import Array
from ..scene import Scene
from ..tracking import TrackingGains, VisualTask
from . import layout

REGIONS: dict[type, int] = {
    ForbiddenHalfSpace: layout.HALF_SPACE,
    ForbiddenBox: layout.BOX,
    ForbiddenCylinder: layout.CYLINDER,
    ForbiddenCapsule: layout.CAPSULE,
}
"""Kinds of regions in the layout."""

AFTER = {**dict.fromkeys(REGIONS, "regions"), Manipulability: "manipulability"}
"""Modules of this package that compute the rows of constraints which the step leaves out."""

LISTS = {
    "": (layout.BLOCKS, layout.AT_BLOCKS),
    "regions": (layout.REGIONS, layout.AT_REGIONS),
    "manipulability": (layout.MEASURES, layout.AT_MEASURES),
}
"""Where the blocks of these modules, and those of the step itself, stand."""


class NotCompiled(Exception):
    """Something in the scene, the constraints or the task has no compiled form; says what."""


class Packed:
    """What the compiled step needs and where it writes.

    Attributes
    ----------
    I, F
        Integers and floats that do not change.
    memory
        What the task remembers between samples; see :class:`vsconstraints.tracking.TrackingMemory`.
    after
        Modules of this package whose ``add_rows`` has to follow the step, for constraints that it leaves out.
    others
        Constraints without a compiled form, with their rows and their robot points: the step leaves those rows out.
    moving
        Scratch: R (n + 1, 3, 3) and motion (n + 1, 6, 3) of the bodies, matrices (·, 3, 3) and vectors (·, 3).
    arguments
        What :func:`vsconstraints.kernels.step.evaluate_step` takes before its output and the state: I, F, memory, those
        of ``moving``, Jacobians of the camera's twist and of a point (6 + 3, n), markers (M, 7), robot points
        (P, 3, 3), and rates of the features (3, k).
    size
        Length of the array that the step writes to.
    rows, task, ...
        Slices of that array and their shapes.
    """

    def __init__(self, scene: Scene, constraints: ConstraintSet, task: VisualTask, told: bool = False) -> None:
        robot, camera = scene.robot, scene.camera
        n, M, P, m = robot.n, len(scene.markers), len(scene.points), len(constraints.labels)
        _demand(scene, Scene)
        _demand(camera, Camera)
        _demand(task, VisualTask)
        _demand(task.gains, TrackingGains)
        feature = task.feature
        if type(feature) not in (CameraPose, ImagePoints):
            raise NotCompiled(f"the feature {feature.name}")
        if any(goal.reference is not None for goal in task.goals):
            raise NotCompiled("a reference trajectory")
        k = 6 if isinstance(feature, CameraPose) else 2 * M
        self._F: list[float] = []
        self._I: list[int] = [0] * layout.HEADER
        head = self._I
        head[layout.JOINTS], head[layout.MARKERS], head[layout.POINTS], head[layout.ROWS], head[layout.SIZE] = (
            n,
            M,
            P,
            m,
            k,
        )
        head[layout.FEATURE] = layout.CAMERA_POSE if isinstance(feature, CameraPose) else layout.IMAGE_POINTS
        if isinstance(feature, ImagePoints):
            head[layout.INTERACTION] = ("current", "desired", "mean").index(feature.interaction_matrix)
        head[layout.DRIFT_DIFFERENCES] = task.drift == "differences"
        head[layout.VELOCITY_DIFFERENCES] = task.velocity == "differences"

        placements, axes, prismatic = joints(robot)
        head[layout.AT_CHAIN] = self._floats(*(pose.R for pose in placements), *(pose.t for pose in placements), *axes)
        tip = _in_joint(robot, robot.frame_id("tip"), n)
        carried = tip @ camera.mount.inverse
        eye = camera.fixed or carried
        head[layout.FIXED_CAMERA] = camera.fixed is not None
        head[layout.AT_CAMERA] = self._floats(eye.R, eye.t, tip.R, tip.t, camera.focal, camera.offset)
        head[layout.AT_MARKERS] = self._floats(scene.markers)
        bodies, offsets = _points(scene)
        head[layout.AT_POINTS] = self._floats(offsets)
        if scene.motion is not None:
            _demand(scene.motion, TargetMotion)
            _demand(scene.motion.translation, Motion)
            head[layout.MOVING_TARGET], head[layout.TOLD_OF_TARGET] = 1, told or scene.motion.known
            head[layout.AT_TARGET] = self._motion(scene.motion.translation)
            self._floats(scene.motion.angular_velocity, scene.motion.centre)
        head[layout.GOALS] = len(task.goals)
        needs_pose, needs_depth = isinstance(feature, CameraPose), head[layout.INTERACTION] != layout.CURRENT
        for goal in task.goals:
            pose = goal.camera if needs_pose and goal.camera is not None else Pose.identity()
            L = goal.interaction if needs_depth else np.zeros((2 * M, 6))
            at = self._floats([goal.from_time], pose.R, pose.t, goal.normalised, L)
            head[layout.AT_GOALS] = head[layout.AT_GOALS] or at
        gains = task.gains
        head[layout.AT_GAINS] = self._floats([gains.Kp0, gains.Kp_slope, gains.damping])
        head[layout.AT_PRISMATIC] = self._ints(prismatic)
        head[layout.AT_BODIES] = self._ints(bodies)

        self.others: list[tuple[Constraint, slice, slice]] = []
        blocks: dict[str, list[list[int]]] = {module: [] for module in LISTS}
        first = 0
        for constraint, count, points in constraints.blocks():
            rows, first = slice(first, first + count), first + count
            try:
                kind, parameters, which = self._block(constraint, robot, M, points)
            except NotCompiled:
                self.others.append((constraint, rows, points))
                continue
            at_K = self._floats([constraint.K])
            motion = getattr(constraint, "motion", None)
            at_motion, knows = (-1, True) if motion is None else (self._motion(motion), told or motion.known)
            block = [kind, rows.start, count, parameters, at_motion, knows, self._ints(which), at_K]
            blocks[AFTER.get(type(constraint), "")].append(block)
        for module, (number, at) in LISTS.items():
            head[number] = len(blocks[module])
            head[at] = self._ints([entry for block in blocks[module] for entry in block])
        self.after = tuple(module for module in blocks if module and blocks[module])

        self.I: NDArray[np.int64] = np.array(self._I, dtype=np.int64)
        self.F: Array = np.array(self._F, dtype=np.float64)
        self.n, self.m, self.k = n, m, k
        ends = np.cumsum([m, m * n, m, m, k * n, k, k, 2 * M, 3 * P, 9, 3]).tolist()
        self.size = ends[-1]
        starts = [0, *ends[:-1]]
        (
            self.phi, self.Lg, self.Lf, self.sigma, self.J, self.b, self.error,
            self.pixels, self.robot_points, self.camera_R, self.camera_t,
        ) = (slice(a, b) for a, b in zip(starts, ends, strict=True))  # fmt: skip
        self.memory = np.empty(2 + 2 * k + k * n)
        self.reset()
        R, motion = np.zeros((n + 1, 3, 3)), np.zeros((n + 1, 6, 3))
        R[0] = np.eye(3)
        self.moving = R, motion, np.empty((layout.MATRICES, 3, 3)), np.empty((layout.VECTORS, 3))
        rest = np.empty((9, n)), np.empty((M, 7)), np.empty((P, 3, 3)), np.empty((3, k))
        self.arguments = self.I, self.F, self.memory, *self.moving, *rest

    def reset(self) -> None:
        """Forget the last sample."""
        self.memory[:] = 0.0
        self.memory[1] = -1.0

    def _floats(self, *parts: object) -> int:
        at = len(self._F)
        for part in parts:
            self._F.extend(np.asarray(part, dtype=np.float64).ravel().tolist())
        return at

    def _ints(self, values: Sequence[int]) -> int:
        at = len(self._I)
        self._I.extend(int(value) for value in values)
        return at

    def _motion(self, motion: Motion) -> int:
        return self._floats(motion.velocity, motion.amplitude, [motion.rate, motion.phase])

    def _block(self, constraint: Constraint, robot: Robot, M: int, points: slice) -> tuple[int, int, list[int]]:
        """Kind, where the parameters begin, and the markers or points concerned."""
        motion = getattr(constraint, "motion", None)
        if motion is not None:
            _demand(motion, Motion)
        # a subclass may compute anything
        if type(constraint) in (FieldOfView, Occlusion):
            assert isinstance(constraint, FieldOfView | Occlusion)
            which = [i - 1 for i in constraint.markers] if constraint.markers else list(range(M))
            if isinstance(constraint, FieldOfView):
                return layout.FIELD_OF_VIEW, self._floats(constraint.parameters), which
            shape, curve = constraint.curve.shape, constraint.curve
            _demand(curve, Curve)
            kinds = {Circle: layout.CIRCLE, Hyperellipse: layout.HYPERELLIPSE, Bowl: layout.BOWL, Heart: layout.HEART}
            if type(shape) not in kinds:
                raise NotCompiled(f"the shape {shape.name}")
            size = shape.parameters
            turn = (np.cos(curve.rotation), np.sin(curve.rotation), constraint.margin)
            return kinds[type(shape)], self._floats(curve.centre, turn, size), which
        if type(constraint) is ForbiddenSphere:
            at = self._floats(constraint.centre, [constraint.radius + constraint.margin])
            return layout.SPHERE, at, list(range(points.start, points.stop))
        if type(constraint) in REGIONS:
            assert isinstance(constraint, ForbiddenRegion)
            pose, sizes = constraint.pose, (constraint.margin, *constraint.parameters)
            at = self._floats(pose.R, pose.t, sizes)
            return REGIONS[type(constraint)], at, list(range(points.start, points.stop))
        if type(constraint) is Manipulability:
            directions = range(6)[ROWS_OF[constraint.part]]
            at = self._floats([constraint.minimum, constraint.w_scale])
            return 0, at, [directions.start, len(directions)]
        if type(constraint) in (JointRange, JointSpeed):
            assert isinstance(constraint, JointRange | JointSpeed)
            rest = np.zeros(robot.n)
            value = constraint.sigma(rest) if isinstance(constraint, JointRange) else constraint.phi(rest)
            kind = layout.JOINTS_LINEAR if isinstance(constraint, JointRange) else layout.SPEEDS_LINEAR
            return kind, self._floats(np.column_stack((constraint.gradient(rest), value))), []
        raise NotCompiled(f"the constraint {constraint.kind}")


def _demand(part: object, kind: type) -> None:
    """Raise NotCompiled unless ``part`` is of exactly that class: a subclass may compute anything."""
    if type(part) is not kind:
        raise NotCompiled(f"the {kind.__name__} {type(part).__name__}")


def joints(robot: Robot) -> tuple[list[Pose], list[Array], list[bool]]:
    """Placement of every joint in the frame of the one before, its axis there, and whether it is prismatic.

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
    return placements, axes, list(robot.prismatic)


def _in_joint(robot: Robot, frame_id: int, joint: int) -> Pose:
    """A frame in the frame of its joint, which must be that one."""
    frame = robot.model.frames[frame_id]
    if int(frame.parentJoint) != joint:
        raise NotCompiled(f"the frame {frame.name}, which joint {joint} does not move")
    return Pose(np.array(frame.placement.rotation), np.array(frame.placement.translation))


def _points(scene: Scene) -> tuple[list[int], Array]:
    """Body (counted from 0, the base) and position in its frame of every robot point."""
    bodies, offsets = [], np.zeros((len(scene.points), 3))
    for i, point in enumerate(scene.points):
        frame = scene.robot.model.frames[scene.robot.frame_id(point.link)]
        bodies.append(int(frame.parentJoint))
        offsets[i] = Pose(np.array(frame.placement.rotation), np.array(frame.placement.translation)).act(
            np.asarray(point.offset, dtype=np.float64)
        )
    return bodies, offsets
