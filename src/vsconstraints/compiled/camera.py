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
    velocity, acceleration = carried(
        r,
        vector(body.velocity),
        vector(body.angular_velocity),
        vector(body.acceleration),
        vector(body.angular_acceleration),
    )
    return plus(vector(body.origin), r), velocity, acceleration


@in_place
def put_pose(pose: tuple[Matrix, Vector], R: Array, origin: Array) -> None:
    """Write a pose to arrays."""
    put_matrix(pose[0], R)
    put(pose[1], origin)


@in_place
def from_target(step: Step, R: Matrix, origin: Vector) -> tuple[Matrix, Vector]:
    """Return the camera's pose in the frame of a target with the given pose."""
    eye = step.eye[0]
    return transposed_product(R, matrix(eye.R)), rotate_inverse(
        R, minus(vector(eye.origin), origin)
    )


@in_place
def target_at(step: Step, t: float) -> tuple[Matrix, Vector]:
    """Return the target's pose in the base frame at time t [s]."""
    tip = step.bodies[len(step.joints)]
    camera = step.camera[0]
    target = step.target[0]
    R = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    origin = (0.0, 0.0, 0.0)
    if camera.fixed:
        tip_R = matrix(tip.R)
        R = product(tip_R, matrix(camera.tip_R))
        origin = plus(vector(tip.origin), rotate(tip_R, vector(camera.tip_t)))
    elif target.moves:
        moved, _, _ = displaced(target.motion, t)
        R, origin = target_pose(t, vector(target.angular_velocity), vector(target.centre), moved)
    return R, origin


@in_place
def place_camera(step: Step, t: float) -> None:
    """Write the poses of camera and target in the base frame, and their relative pose.

    The relative pose is left unchanged if it is measured.
    """
    tip = step.bodies[len(step.joints)]
    camera = step.camera[0]
    R = matrix(camera.R)
    origin = vector(camera.t)
    if not camera.fixed:
        tip_R = matrix(tip.R)
        R = product(tip_R, R)
        origin = plus(vector(tip.origin), rotate(tip_R, origin))
    target_R, target_t = target_at(step, t)
    put_pose((R, origin), step.eye[0].R, step.eye[0].origin)
    put_pose((target_R, target_t), step.target_R, step.target_t)
    if not step.measurement[0].pose_given:
        put_pose(from_target(step, target_R, target_t), step.camera_R, step.camera_t)


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
    r = rotate(matrix(tip.R), vector(camera.t))
    if camera.fixed:
        # treated as if the tip carried it: its motion is that of the target, reversed
        r = minus(vector(camera.t), vector(tip.origin))
    _, velocity, acceleration = carry(step, n, r)
    away = origin
    omega = (0.0, 0.0, 0.0)
    if target.moves:
        known = 1.0 * target.known
        d, d_dot, d_ddot = displaced(target.motion, t)
        away = minus(minus(origin, vector(target.centre)), d)
        omega = times(known, vector(target.angular_velocity))
        velocity = add_scaled(velocity, -known, d_dot)
        acceleration = add_scaled(acceleration, -known, d_ddot)
    v, w, v_dot, w_dot = relative_twist(
        velocity,
        acceleration,
        vector(tip.angular_velocity),
        vector(tip.angular_acceleration),
        omega,
        away,
    )
    sign = -1.0 if camera.fixed else 1.0
    put(times(sign, rotate_inverse(R, v)), eye.velocity)
    put(times(sign, rotate_inverse(R, w)), eye.angular_velocity)
    put(times(sign, rotate_inverse(R, v_dot)), eye.acceleration)
    put(times(sign, rotate_inverse(R, w_dot)), eye.angular_acceleration)
    point_jacobian(step, n, origin, step.J_point)
    for j in range(n):
        about = 0.0 if step.joints[j].prismatic else sign
        put(times(sign, rotate_inverse(R, vector(step.J_point[:, j]))), step.camera_J[:3, j])
        put(times(about, rotate_inverse(R, vector(step.bodies[j + 1].axis))), step.camera_J[3:, j])


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
    newest = views[newest_view(step)].time
    if last.views > 0 and t <= newest:
        last.views = last.views - 1 if t == newest else 0
    target_R = matrix(step.target_R)
    target_t = vector(step.target_t)
    # the controller assumes a target of unknown motion to be at rest
    if target.moves and not target.known:
        target_R, target_t = target_at(step, 0.0)
    view = views[last.views % len(views)]
    view.time = t
    put_pose(from_target(step, target_R, target_t), view.R, view.t)
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
    at = newest = newest_view(step)
    taken = measurement.time
    for i in range(1, min(step.last[0].views, len(views))):
        before = (newest - i) % len(views)
        if abs(views[before].time - taken) >= abs(views[at].time - taken):
            break
        at = before
    rest = taken - views[at].time
    R = matrix(views[at].R)
    origin = plus(vector(views[at].t), rotate(R, times(rest, vector(eye.velocity))))
    R = product(R, turn_by(times(rest, vector(eye.angular_velocity))))
    put_pose((R, origin), then.R, then.t)
    if measurement.pose_given:
        measured = matrix(step.camera_R)
        now_R = matrix(views[newest].R)
        now = vector(views[newest].t)
        moved = plus(vector(step.camera_t), rotate(measured, rotate_inverse(R, minus(now, origin))))
        put_pose(
            (product(measured, transposed_product(R, now_R)), moved), step.camera_R, step.camera_t
        )


@in_place
def in_view(step: Step, view: Any, i: int) -> Vector:
    """Return a marker in the frame of the camera of a view."""
    return rotate_inverse(matrix(view.R), minus(vector(step.markers[i]), vector(view.t)))


@in_place
def moved_since(step: Step, i: int) -> Vector:
    """Return the modelled motion of a marker since the image was taken.

    The motion is (Δx, Δy) in normalised coordinates and the change of depth. It is zero unless the
    marker is in front of the camera in both views.
    """
    before = in_view(step, step.then[0], i)
    now = in_view(step, step.views[newest_view(step)], i)
    if not (before[2] >= MINIMUM_DEPTH and now[2] >= MINIMUM_DEPTH):
        return 0.0, 0.0, 0.0
    x = now[0] / now[2] - before[0] / before[2]
    y = now[1] / now[2] - before[1] / before[2]
    return x, y, now[2] - before[2]


@in_place
def in_camera(step: Step, i: int) -> Vector:
    """Return a marker's position in the camera frame according to the model."""
    there = rotate(matrix(step.target_R), vector(step.markers[i]))
    away = minus(vector(step.target_t), vector(step.eye[0].origin))
    return rotate_inverse(matrix(step.eye[0].R), plus(there, away))
