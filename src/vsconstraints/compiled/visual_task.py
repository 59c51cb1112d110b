"""Tracking task: from a visual feature to J_s q̈ = b."""

from __future__ import annotations

from typing import Any

from ..formulas.features import image_row, pose_motion
from ..formulas.rotation import whole_turns
from ..formulas.tracking import demanded, gains, goal_at, minimum_jerk, resting
from ..formulas.vectors import matrix, rotate, vector
from ..rows import Array
from .codes import CAMERA_POSE, IMAGE_POINTS
from .compiler import in_place
from .kinematics import camera_column, camera_twist, put
from .linear import constant
from .workspace import Step

#: Rows of the last reference (3, k): error at its beginning, its last value, and its last rate.
AT_BEGINNING = constant(0)
LAST = constant(1)
LAST_RATE = constant(2)


@in_place
def write_pose(step: Step, goal: int, continues: bool) -> None:
    """Write J_s, the error, ṡ and J̇_s q̇ + ∂ṡ/∂t of (t, θu).

    See :class:`vsconstraints.vision.features.CameraPose`.
    """
    task = step.task
    goal_R = matrix(step.goals[goal].R)
    goal_t = vector(step.goals[goal].t)
    R = matrix(step.camera_R)
    origin = vector(step.camera_t)
    last_theta_u = vector(step.last_error[3:])
    twist = camera_twist(step)
    motion = pose_motion(goal_R, goal_t, R, origin, last_theta_u, continues, twist)
    put(motion.t, task.error[:3])
    put(motion.theta_u, task.error[3:])
    put(motion.t_dot, task.error_rate[:3])
    put(motion.theta_u_dot, task.error_rate[3:])
    put(motion.t_ddot, step.drift[:3])
    put(motion.theta_u_ddot, step.drift[3:])
    for j in range(len(step.qd)):
        v, omega = camera_column(step, j)
        put(rotate(motion.E, v), task.J[:3, j])
        put(rotate(motion.L, omega), task.J[3:, j])


@in_place
def along_column(step: Step, L: Any, j: int) -> float:
    """Return L Jⱼ of a row of the interaction matrix (6,) and a column of the camera's Jacobian."""
    v, omega = camera_column(step, j)
    total = 0.0
    for i in range(3):
        total += L[i] * v[i] + L[3 + i] * omega[i]
    return total


@in_place
def mixed(share: float, current: float, at_goal: float) -> float:
    """Return the mean of a current value and that at the goal, which has the weight ``share``."""
    return (1.0 - share) * current + share * at_goal


@in_place
def mixed_drift(step: Step, L: Any, L_goal: Array) -> float:
    """Return the product of a row of the mixed interaction matrix and (v̇, ω̇) of the camera."""
    share = step.options[0].share
    _, _, v_dot, omega_dot = camera_twist(step)
    drift = 0.0
    for i in range(3):
        drift += mixed(share, L[i], L_goal[i]) * v_dot[i]
        drift += mixed(share, L[3 + i], L_goal[3 + i]) * omega_dot[i]
    return drift


@in_place
def write_image(step: Step, goal: int) -> None:
    """Write J_s, the error, ṡ, J̇_s q̇ + ∂ṡ/∂t and ∂s/∂t of markers: see :class:`.ImagePoints`."""
    task = step.task
    share = step.options[0].share
    is_mixed = share > 0.0
    for row in range(len(task.error)):
        # x and y of the first marker, of the second one, and so on
        marker = step.seen[row // 2]
        c = row % 2
        velocity = marker.velocity[c]
        L = image_row(c, marker.xy[0], marker.xy[1], marker.depth)
        L_goal = step.goal_interaction[goal, row]
        by_joints = 0.0
        for j in range(len(step.qd)):
            entry = along_column(step, L, j)
            by_joints += entry * step.qd[j]
            if is_mixed:
                entry = mixed(share, entry, along_column(step, L_goal, j))
            task.J[row, j] = entry
        task.error[row] = marker.xy[c] - step.goal_points[goal, row]
        task.error_rate[row] = velocity
        step.partial[row] = velocity - by_joints
        step.drift[row] = mixed_drift(step, L, L_goal) if is_mixed else marker.drift[c]


@in_place
def complete_rates(step: Step, i: int, interval: float) -> None:
    """Write the parts of ṡ and of its drift that feature i leaves open.

    ``interval`` is the time [s] since the last sample, 0 if there was none for this goal.
    """
    options = step.options[0]
    task = step.task
    n = len(step.qd)
    by_joints = 0.0
    for j in range(n):
        by_joints += task.J[i, j] * step.qd[j]
    # the part of ṡ that the robot does not cause; ṡ itself if J_s is not that of the current image
    if options.feature == CAMERA_POSE:
        step.partial[i] = task.error_rate[i] - by_joints
    elif options.share > 0.0:
        task.error_rate[i] = step.partial[i] + by_joints
    if options.drift_by_differences:
        step.drift[i] = 0.0
        if interval > 0.0:
            change = step.partial[i] - step.last_partial[i]
            for j in range(n):
                J_change = task.J[i, j] - step.last_J[i, j]
                change += J_change * step.qd[j]
            step.drift[i] = change / interval
    if options.velocity_by_differences and interval > 0.0:
        task.error_rate[i] = (task.error[i] - step.last_error[i]) / interval


@in_place
def subtract_reference(
    step: Step, i: int, left: float, left_dot: float, left_ddot: float, interval: float
) -> None:
    """Subtract the reference s_ref of feature i, and its derivatives, from error, rate and drift.

    The reference is the error at the beginning times the share ``left``, whose derivatives are
    given. With ``reference_by_differences`` its derivatives are differences of samples; see
    :func:`complete_rates` for the ``interval``.
    """
    task = step.task
    reference = step.last_reference
    at_beginning = reference[AT_BEGINNING, i]
    s_ref = left * at_beginning
    rate = left_dot * at_beginning
    acceleration = left_ddot * at_beginning
    if step.options[0].reference_by_differences:
        rate = 0.0
        acceleration = 0.0
        if interval > 0.0:
            rate = (s_ref - reference[LAST, i]) / interval
            acceleration = (rate - reference[LAST_RATE, i]) / interval
    reference[LAST, i] = s_ref
    reference[LAST_RATE, i] = rate
    task.error[i] -= s_ref
    task.error_rate[i] -= rate
    step.drift[i] -= acceleration


@in_place
def write_rest(step: Step) -> None:
    """Write q̈₀, with continuous joints at the turn nearest to the posture."""
    options = step.options[0]
    damping = options.rest_damping
    stiffness = options.rest_stiffness
    rest = step.task.rest
    for j in range(rest.size):
        q = step.q[j]
        posture = step.posture[j]
        if step.joints[j].continuous != 0:
            q -= whole_turns(q - posture)
        rest[j] = resting(q, step.qd[j], posture, damping, stiffness)


@in_place
def write_task(step: Step, t: float) -> None:
    """Write J_s, b, q̈₀, the error and its rate, and store them; see :class:`.VisualTask`."""
    options = step.options[0]
    last = step.last[0]
    task = step.task
    k, n = task.J.shape
    goal = goal_at(step.goals.from_time, t)
    continues = last.goal == goal
    if options.feature == CAMERA_POSE:
        write_pose(step, goal, continues)
    elif options.feature == IMAGE_POINTS:
        write_image(step, goal)
    interval = max(t - last.time, 0.0) if continues else 0.0
    reach_in = step.goals[goal].reach_in
    left = 0.0
    left_dot = 0.0
    left_ddot = 0.0
    if reach_in > 0.0:
        if not continues:
            last.began = t
        left, left_dot, left_ddot = minimum_jerk(t - last.began, reach_in)
    squared_error = 0.0
    for i in range(k):
        complete_rates(step, i, interval)
        step.last_error[i] = task.error[i]
        if reach_in > 0.0:
            if not continues:
                step.last_reference[AT_BEGINNING, i] = task.error[i]
            subtract_reference(step, i, left, left_dot, left_ddot, interval)
        squared_error += task.error[i] * task.error[i]
    Kp, Kv = gains(squared_error, options.Kp0, options.slope, options.damping)
    for i in range(k):
        task.b[i] = demanded(task.error[i], task.error_rate[i], step.drift[i], Kp, Kv)
        step.last_partial[i] = step.partial[i]
        for j in range(n):
            step.last_J[i, j] = task.J[i, j]
    write_rest(step)
    last.time = t
    last.goal = goal
