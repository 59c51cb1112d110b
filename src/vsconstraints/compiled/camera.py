"""Camera of a control step: its pose, its motion and its pose in previous samples."""

from __future__ import annotations

from typing import Any

from ..formulas.features import MINIMUM_DEPTH
from ..formulas.motion import carried, relative_twist, target_pose
from ..formulas.rotation import turn_by
from ..formulas.vectors import (
    Matrix,
    Vector,
    add_scaled,
    matrix,
    minus,
    plus,
    product,
    rotate,
    rotate_inverse,
    times,
    transposed_product,
    vector,
)
from ..rows import Array
from .compiler import in_place
from .constraint_rows import displaced
from .kinematics import point_jacobian, put, put_matrix
from .workspace import Step


@in_place
def carry(step: Step, number: int, r: Vector) -> tuple[Vector, Vector, Vector]:
    """Return position, velocity and acceleration of the point at r from a body's origin."""
    body = step.bodies[number]
    v = vector(body.velocity)
    omega = vector(body.angular_velocity)
    v_dot = vector(body.acceleration)
    omega_dot = vector(body.angular_acceleration)
    position = plus(vector(body.origin), r)
    velocity, acceleration = carried(r, v, omega, v_dot, omega_dot)
    return position, velocity, acceleration


@in_place
def put_pose(R: Matrix, origin: Vector, R_out: Array, origin_out: Array) -> None:
    """Write a pose to arrays (3, 3) and (3,)."""
    put_matrix(R, R_out)
    put(origin, origin_out)


@in_place
def from_target(step: Step, R: Matrix, origin: Vector) -> tuple[Matrix, Vector]:
    """Return the camera's pose in the frame of a target with the given pose."""
    eye = step.eye[0]
    relative_R = transposed_product(R, matrix(eye.R))
    from_origin = minus(vector(eye.origin), origin)
    return relative_R, rotate_inverse(R, from_origin)


@in_place
def target_at(step: Step, t: float) -> tuple[Matrix, Vector]:
    """Return the target's pose in the base frame at time t [s]."""
    tip = step.bodies[len(step.joints)]
    camera = step.camera[0]
    target = step.target[0]
    R = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    origin = (0.0, 0.0, 0.0)
    if camera.fixed:
        # the tip carries the target
        tip_R = matrix(tip.R)
        r = rotate(tip_R, vector(camera.tip_t))
        R = product(tip_R, matrix(camera.tip_R))
        origin = plus(vector(tip.origin), r)
    elif target.moves:
        omega = vector(target.angular_velocity)
        centre = vector(target.centre)
        moved, _, _ = displaced(target.motion, t)
        R, origin = target_pose(t, omega, centre, moved)
    return R, origin


@in_place
def place_camera(step: Step, t: float) -> None:
    """Write the poses of camera and target in the base frame, and their relative pose.

    The relative pose is left unchanged if it is measured.
    """
    tip = step.bodies[len(step.joints)]
    camera = step.camera[0]
    eye = step.eye[0]
    R = matrix(camera.R)
    origin = vector(camera.t)
    if not camera.fixed:
        tip_R = matrix(tip.R)
        R = product(tip_R, R)
        origin = plus(vector(tip.origin), rotate(tip_R, origin))
    target_R, target_t = target_at(step, t)
    put_pose(R, origin, eye.R, eye.origin)
    put_pose(target_R, target_t, step.target_R, step.target_t)
    if not step.measurement[0].pose_given:
        camera_R, camera_t = from_target(step, target_R, target_t)
        put_pose(camera_R, camera_t, step.camera_R, step.camera_t)


@in_place
def put_in_camera(R: Matrix, factor: float, x: Vector, out: Array) -> None:
    """Write a vector of the base frame, times a factor, in the axes of a camera at R."""
    in_camera = rotate_inverse(R, x)
    put(times(factor, in_camera), out)


@in_place
def move_camera(step: Step, t: float) -> None:
    """Write the camera's twist and its Jacobian relative to the target.

    The camera's pose must have been written by :func:`place_camera`.
    """
    n = len(step.joints)
    tip = step.bodies[n]
    camera = step.camera[0]
    target = step.target[0]
    eye = step.eye[0]
    R = matrix(eye.R)
    origin = vector(eye.origin)
    camera_t = vector(camera.t)
    r = rotate(matrix(tip.R), camera_t)
    if camera.fixed:
        # treated as if the tip carried it: its motion is that of the target, reversed
        r = minus(camera_t, vector(tip.origin))
    _, velocity, acceleration = carry(step, n, r)
    omega = vector(tip.angular_velocity)
    alpha = vector(tip.angular_acceleration)
    from_centre = origin
    target_omega = (0.0, 0.0, 0.0)
    if target.moves:
        known = 1.0 * target.known
        d, d_dot, d_ddot = displaced(target.motion, t)
        from_centre_at_rest = minus(origin, vector(target.centre))
        from_centre = minus(from_centre_at_rest, d)
        target_omega = times(known, vector(target.angular_velocity))
        velocity = add_scaled(velocity, -known, d_dot)
        acceleration = add_scaled(acceleration, -known, d_ddot)
    v, w, v_dot, w_dot = relative_twist(
        velocity, acceleration, omega, alpha, target_omega, from_centre
    )
    sign = -1.0 if camera.fixed else 1.0
    put_in_camera(R, sign, v, eye.velocity)
    put_in_camera(R, sign, w, eye.angular_velocity)
    put_in_camera(R, sign, v_dot, eye.acceleration)
    put_in_camera(R, sign, w_dot, eye.angular_acceleration)
    point_jacobian(step, n, origin, step.J_point)
    for j in range(n):
        turns = 0.0 if step.joints[j].prismatic else sign
        axis = vector(step.bodies[j + 1].axis)
        velocity_of_origin = vector(step.J_point[:, j])
        put_in_camera(R, sign, velocity_of_origin, step.camera_J[:3, j])
        put_in_camera(R, turns, axis, step.camera_J[3:, j])


@in_place
def newest_view(step: Step) -> int:
    """Return the index of the camera view of the current sample."""
    newest: int = (step.last[0].views - 1) % len(step.views)
    return newest


@in_place
def keep_view(step: Step, t: float) -> None:
    """Store the camera's pose in the target's frame, as far as the motion is known.

    A sample of the same time as the previous one replaces it. A sample of an earlier time clears
    the stored views.
    """
    last = step.last[0]
    target = step.target[0]
    views = step.views
    last_time = views[newest_view(step)].time
    if last.views > 0 and t == last_time:
        last.views -= 1
    elif last.views > 0 and t < last_time:
        last.views = 0
    target_R = matrix(step.target_R)
    target_t = vector(step.target_t)
    # the controller assumes a target of unknown motion to be at rest
    if target.moves and not target.known:
        target_R, target_t = target_at(step, 0.0)
    view = views[last.views % len(views)]
    view.time = t
    R, origin = from_target(step, target_R, target_t)
    put_pose(R, origin, view.R, view.t)
    last.views += 1


@in_place
def look_back(step: Step) -> None:
    """Write the camera's pose at the image's time, and extrapolate its measured pose to now.

    The pose at the image's time is the stored view nearest in time, moved by the current twist for
    the remaining time.
    """
    eye = step.eye[0]
    measurement = step.measurement[0]
    views = step.views
    then = step.then[0]
    newest = newest_view(step)
    nearest = newest
    taken = measurement.time
    for i in range(1, min(step.last[0].views, len(views))):
        before = (newest - i) % len(views)
        gap_before = abs(views[before].time - taken)
        gap_of_nearest = abs(views[nearest].time - taken)
        if gap_before >= gap_of_nearest:
            break
        nearest = before
    view = views[nearest]
    rest = taken - view.time
    view_R = matrix(view.R)
    translation = times(rest, vector(eye.velocity))
    turn = times(rest, vector(eye.angular_velocity))
    origin = plus(vector(view.t), rotate(view_R, translation))
    R = product(view_R, turn_by(turn))
    put_pose(R, origin, then.R, then.t)
    if measurement.pose_given:
        # the motion since then, in the camera's axes then, continues the measured pose
        measured = matrix(step.camera_R)
        now = views[newest]
        turned = transposed_product(R, matrix(now.R))
        from_origin = minus(vector(now.t), origin)
        moved = rotate_inverse(R, from_origin)
        now_R = product(measured, turned)
        now_t = plus(vector(step.camera_t), rotate(measured, moved))
        put_pose(now_R, now_t, step.camera_R, step.camera_t)


@in_place
def in_view(step: Step, view: Any, i: int) -> Vector:
    """Return a marker in the frame of the camera of a view."""
    from_camera = minus(vector(step.markers[i]), vector(view.t))
    return rotate_inverse(matrix(view.R), from_camera)


@in_place
def moved_since(step: Step, i: int) -> Vector:
    """Return the modelled motion of a marker since the image was taken.

    The motion is (Δx, Δy) in normalised coordinates and the change of depth. It is zero unless the
    marker is in front of the camera in both views.
    """
    X_then, Y_then, Z_then = in_view(step, step.then[0], i)
    X, Y, Z = in_view(step, step.views[newest_view(step)], i)
    is_in_front = Z_then >= MINIMUM_DEPTH and Z >= MINIMUM_DEPTH
    if not is_in_front:
        return 0.0, 0.0, 0.0
    x_change = X / Z - X_then / Z_then
    y_change = Y / Z - Y_then / Z_then
    return x_change, y_change, Z - Z_then


@in_place
def in_camera(step: Step, i: int) -> Vector:
    """Return a marker's position in the camera frame according to the model."""
    eye = step.eye[0]
    r = rotate(matrix(step.target_R), vector(step.markers[i]))
    to_target = minus(vector(step.target_t), vector(eye.origin))
    return rotate_inverse(matrix(eye.R), plus(r, to_target))
