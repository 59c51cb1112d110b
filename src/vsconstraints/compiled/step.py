"""One control step up to the controller: kinematics, what the camera sees, rows and task, in one compiled function."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..formulas.features import MINIMUM_DEPTH, image_motion
from ..formulas.innovation import MEMORY, image_innovation, slip
from ..formulas.limits import JointLimits, joint_box
from ..formulas.motion import angle, carried, relative_twist, target_pose
from ..formulas.rotation import turn_by
from ..formulas.vectors import (
    Matrix,
    Vector,
    along_with,
    matrix,
    minus,
    plus,
    product,
    times,
    transposed_product,
    turned,
    turned_back,
    vector,
)
from ..rows import Array, BoolArray
from .compiler import IN_PLACE, compiled, in_place
from .constraint_rows import displaced
from .kinematics import move, place, point_jacobian, put, put_matrix
from .parts import address as address_of
from .parts import call_void_pointer, checked, load_step
from .visual_task import JUST_NOW, write_task
from .workspace import OWN, Step


@in_place
def carry(step: Step, number: int, r: Vector) -> tuple[Vector, Vector, Vector]:
    """Position, velocity and acceleration of the point at r from a body's origin."""
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
def target_at(step: Step, t: float) -> tuple[Matrix, Vector]:
    """Where the target is in the base frame at time t [s]."""
    tip, camera, target = step.bodies[len(step.joints)], step.camera[0], step.target[0]
    R, origin = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), (0.0, 0.0, 0.0)
    if camera.fixed:
        tip_R = matrix(tip.R)
        R = product(tip_R, matrix(camera.tip_R))
        origin = plus(vector(tip.origin), turned(tip_R, vector(camera.tip_t)))
    elif target.moves:
        moved, _, _ = displaced(target.motion, t)
        R, origin = target_pose(t, vector(target.angular_velocity), vector(target.centre), moved)
    return R, origin


@in_place
def place_camera(step: Step, t: float) -> None:
    """Write where the camera and the target are in the base frame, and the one relative to the other."""
    tip, camera = step.bodies[len(step.joints)], step.camera[0]
    R, origin = matrix(camera.R), vector(camera.t)
    if not camera.fixed:
        tip_R = matrix(tip.R)
        R, origin = product(tip_R, R), plus(vector(tip.origin), turned(tip_R, origin))
    target_R, target_t = target_at(step, t)
    put_matrix(R, step.eye[0].R)
    put(origin, step.eye[0].origin)
    put_matrix(target_R, step.target_R)
    put(target_t, step.target_t)
    if not step.measurement[0].pose_given:
        put_matrix(transposed_product(target_R, R), step.camera_R)
        put(turned_back(target_R, minus(origin, target_t)), step.camera_t)


@in_place
def newest_view(step: Step) -> int:
    """Where the camera's pose of the present sample is."""
    return (step.last[0].views - 1) % len(step.views)


@in_place
def keep_view(step: Step, t: float) -> None:
    """Keep where the camera is, as far as motion is known; in a sample of the same time in place of the one before."""
    last, eye, target, views = step.last[0], step.eye[0], step.target[0], step.views
    newest = views[newest_view(step)].time
    if last.views > 0 and t <= newest:
        last.views = last.views - 1 if t == newest else 0
    target_R, target_t = matrix(step.target_R), vector(step.target_t)
    if target.moves and not target.known:  # what moves unknown to the control stands still for it
        target_R, target_t = target_at(step, 0.0)
    view = views[last.views % len(views)]
    view.time = t
    put_matrix(transposed_product(target_R, matrix(eye.R)), view.R)
    put(turned_back(target_R, minus(vector(eye.origin), target_t)), view.t)
    last.views += 1


@in_place
def look_back(step: Step) -> None:
    """Write where the camera was when the image was taken, and move its measured pose on from there to now.

    That is where it was in the sample that is nearest in time, moved by the present twist for the rest of the time.
    """
    eye, measurement, views, then = step.eye[0], step.measurement[0], step.views, step.then[0]
    at = newest = newest_view(step)
    taken = measurement.time
    for i in range(1, min(step.last[0].views, len(views))):
        before = (newest - i) % len(views)
        if abs(views[before].time - taken) >= abs(views[at].time - taken):
            break
        at = before
    rest, R = taken - views[at].time, matrix(views[at].R)
    origin = plus(vector(views[at].t), turned(R, times(rest, vector(eye.velocity))))
    R = product(R, turn_by(times(rest, vector(eye.angular_velocity))))
    put_matrix(R, then.R)
    put(origin, then.t)
    if not measurement.pose_given:
        return
    now_R, now = matrix(views[newest].R), vector(views[newest].t)
    moved = turned(matrix(step.camera_R), turned_back(R, minus(now, origin)))
    put(plus(vector(step.camera_t), moved), step.camera_t)
    put_matrix(product(matrix(step.camera_R), transposed_product(R, now_R)), step.camera_R)


@in_place
def move_camera(step: Step, t: float) -> None:
    """Write the camera's twist and its Jacobian relative to the target, once its place is known."""
    n = len(step.joints)
    tip, camera, target, eye = step.bodies[n], step.camera[0], step.target[0], step.eye[0]
    R, origin = matrix(eye.R), vector(eye.origin)
    r = turned(matrix(tip.R), vector(camera.t))
    if camera.fixed:
        # as if the tip carried it: its motion is that of the target, reversed
        r = minus(vector(camera.t), vector(tip.origin))
    _, velocity, acceleration = carry(step, n, r)
    away, omega = origin, (0.0, 0.0, 0.0)
    if target.moves:
        known = 1.0 * target.known
        d, d_dot, d_ddot = displaced(target.motion, t)
        away, omega = minus(minus(origin, vector(target.centre)), d), times(known, vector(target.angular_velocity))
        velocity, acceleration = along_with(velocity, -known, d_dot), along_with(acceleration, -known, d_ddot)
    v, w, v_dot, w_dot = relative_twist(
        velocity, acceleration, vector(tip.angular_velocity), vector(tip.angular_acceleration), omega, away
    )
    sign = -1.0 if camera.fixed else 1.0
    put(times(sign, turned_back(R, v)), eye.velocity)
    put(times(sign, turned_back(R, w)), eye.angular_velocity)
    put(times(sign, turned_back(R, v_dot)), eye.acceleration)
    put(times(sign, turned_back(R, w_dot)), eye.angular_acceleration)
    point_jacobian(step, n, origin, step.J_point)
    for j in range(n):
        about = 0.0 if step.joints[j].prismatic else sign
        put(times(sign, turned_back(R, vector(step.J_point[:, j]))), step.camera_J[:3, j])
        put(times(about, turned_back(R, vector(step.bodies[j + 1].axis))), step.camera_J[3:, j])


@in_place
def in_view(step: Step, view: Any, i: int) -> Vector:
    """A marker in the frame of a camera that is there."""
    return turned_back(matrix(view.R), minus(vector(step.markers[i]), vector(view.t)))


@in_place
def in_camera(step: Step, i: int) -> Vector:
    """A marker in the camera frame, where the model has it."""
    there = turned(matrix(step.target_R), vector(step.markers[i]))
    away = minus(vector(step.target_t), vector(step.eye[0].origin))
    return turned_back(matrix(step.eye[0].R), plus(there, away))


@in_place
def see(step: Step, i: int, t: float) -> bool:
    """Write where a marker is in the image and how it moves; False if it is not in front of the camera."""
    eye, camera, marker = step.eye[0], step.camera[0], step.seen[i]
    P = in_camera(step, i)
    v, omega = vector(eye.velocity), vector(eye.angular_velocity)
    v_dot, omega_dot = vector(eye.acceleration), vector(eye.angular_acceleration)
    if not P[2] >= MINIMUM_DEPTH:
        return False
    if step.measurement[0].given:
        # what a detector says; what it says nothing of is as far from where the model has it as it was last seen
        x, y, said = P[0] / P[2], P[1] / P[2], step.measured[i]
        Z = said[2] if said[2] >= MINIMUM_DEPTH else P[2]
        dx = dy = 0.0
        if step.measurement[0].time < t - JUST_NOW:
            # what was seen some time ago has moved on since, as the model says
            before, now = in_view(step, step.then[0], i), in_view(step, step.views[newest_view(step)], i)
            if before[2] >= MINIMUM_DEPTH and now[2] >= MINIMUM_DEPTH:
                dx, dy = now[0] / now[2] - before[0] / before[2], now[1] / now[2] - before[1] / before[2]
                Z = max(Z + now[2] - before[2], MINIMUM_DEPTH) if said[2] >= MINIMUM_DEPTH else Z
        if said[0] == said[0] and said[1] == said[1]:
            u, w = (said[0] - camera.offset[0]) / camera.focal[0], (said[1] - camera.offset[1]) / camera.focal[1]
            step.correction[i, 0], step.correction[i, 1] = u + dx - x, w + dy - y
        x, y = x + step.correction[i, 0], y + step.correction[i, 1]
        P = (x * Z, y * Z, Z)
    P = times(camera.depth_factor, P)
    x, y, x_dot, y_dot, x_ddot, y_ddot = image_motion(P, v, omega, v_dot, omega_dot)
    marker.xy[0], marker.xy[1], marker.velocity[0], marker.velocity[1] = x, y, x_dot, y_dot
    marker.drift[0], marker.drift[1], marker.depth = x_ddot, y_ddot, P[2]
    step.pixels[i, 0] = camera.focal[0] * x + camera.offset[0]
    step.pixels[i, 1] = camera.focal[1] * y + camera.offset[1]
    return True


@in_place
def write_innovation(step: Step, t: float) -> None:
    """Write how far what is measured is from the model; what is measured of the camera's pose is written by then."""
    innovation, measurement, camera = step.innovation, step.measurement[0], step.camera[0]
    innovation[0] = innovation[1] = innovation[4] = innovation[5] = innovation[6] = 0.0
    if measurement.given:
        innovation[0], innovation[1] = image_innovation(step.pixels, step.correction, camera.focal[0], camera.focal[1])
        innovation[4] = t - measurement.time
    innovation[2] = innovation[3] = 0.0
    if measurement.pose_given:
        eye, target_R = step.eye[0], matrix(step.target_R)
        R = transposed_product(target_R, matrix(eye.R))
        origin = turned_back(target_R, minus(vector(eye.origin), vector(step.target_t)))
        off = difference = 0.0
        for i in range(3):
            off += (step.camera_t[i] - origin[i]) ** 2
            for j in range(3):
                difference += (step.camera_R[i, j] - R[i][j]) ** 2
        innovation[2], innovation[3] = math.sqrt(off), angle(difference)
    for j in range(len(step.slip)):
        innovation[5] = max(innovation[5], abs(step.slip[j]) / MEMORY)
    for i in range(len(step.bounds)):
        innovation[6] = max(innovation[6], innovation[i] / step.bounds[i])


@in_place
def write_box(step: Step, j: int) -> None:
    """Write what a joint's limits leave of its acceleration."""
    given = step.limits
    limits = JointLimits(
        given.acceleration[j], given.change[j], given.q_min[j], given.q_max[j], given.qd_max[j], given.ranges,
        given.period,
    )  # fmt: skip
    least, greatest = joint_box(step.q[j], step.qd[j], step.last_command[j], limits)
    step.rows.qdd_min[j], step.rows.qdd_max[j] = least, greatest


@in_place
def evaluate(address: int, step: Step, t: float, q: Array, qd: Array) -> bool:
    """As :func:`evaluate_step`; False if it cannot be done."""
    n = len(step.joints)
    if q.size != n or qd.size != n or not abs(t) < np.inf:
        return False
    # who calls the entry point without a look at the types may bring others
    if n > 1 and (q.strides[0] != q.itemsize or qd.strides[0] != qd.itemsize):
        return False
    for i in range(n):
        if not (np.isfinite(q[i]) and np.isfinite(qd[i])):
            return False
        mean_speed = 0.5 * (qd[i] + step.qd[i])
        step.slip[i] = slip(step.slip[i], q[i] - step.q[i], mean_speed, t - step.time[0])
        step.q[i], step.qd[i] = q[i], qd[i]
    step.time[0] = t
    move(step, q, qd)
    place_camera(step, t)
    move_camera(step, t)
    keep_view(step, t)
    measurement = step.measurement[0]
    if (measurement.given or measurement.pose_given) and measurement.time < t - JUST_NOW:
        look_back(step)
    for i in range(len(step.seen)):
        if not see(step, i, t):
            return False
    write_innovation(step, t)
    for i in range(len(step.places)):
        point, spot = step.robot_points[i], step.places[i]
        r = turned(matrix(step.bodies[point.body].R), vector(point.offset))
        position, velocity, drift = carry(step, point.body, r)
        put(position, spot.position)
        put(velocity, spot.velocity)
        put(drift, spot.drift)
        put(position, step.points[i])
    for i in range(len(step.parts)):
        call_void_pointer(step.parts[i].address, (address, i))
    error = step.gradient_error[0]
    if error.address != 0:
        call_void_pointer(error.address, (address, error.in_phi))
    if step.options[0].feature != OWN:
        write_task(step, t)
    for j in range(len(step.limits.acceleration)):
        write_box(step, j)
    return True


@checked(Step)
@compiled("int64(int64, float64, float64[::1], float64[::1])", IN_PLACE)
def evaluate_step(address: int, t: float, q: Array, qd: Array) -> int:
    """Compute everything that a controller needs at time t [s], q and q̇ (n,), on the arrays of a :class:`.Step`.

    Returns 0, or 1 if q or q̇ has another size, a number is not finite, or a marker is not in front of the camera: then
    nothing in the outputs counts, and what the task remembers is as it was. What was measured is used up.
    """
    step = load_step(address)
    done, measurement = evaluate(address, step, t, q, qd), step.measurement[0]
    measurement.given = measurement.pose_given = 0
    return 0 if done else 1


EVALUATE = address_of(evaluate_step)  #: Where it begins.


@checked(Step)
@compiled("void(int64, float64)", IN_PLACE)
def follow(address: int, t: float) -> None:
    """Make a task of an own feature, whose error, J_s, ṡ, drift and ∂s/∂t are written, at time t [s]."""
    write_task(load_step(address), t)


@checked(Step)
@compiled("int64(int64, float64[:, ::1], float64[::1], float64, float64)", IN_PLACE)
def measure(address: int, pixels: Array, depth: Array, taken: float, t: float) -> int:
    """Let the next step take these pixels (M, 2) and depths (M,), NaN where there are none, of an image of that time.

    Returns 0, or 1 if the sizes are others, a number is infinite, a depth not positive or the time not before t [s].
    """
    step = load_step(address)
    M = len(step.seen)
    if pixels.shape[0] != M or pixels.shape[1] != 2 or depth.size != M or not -np.inf < taken <= t + JUST_NOW:
        return 1
    # who calls the entry point without a look at the types may bring others
    if M > 0 and (pixels.strides[1] != 8 or pixels.strides[0] != 16 or depth.strides[0] != 8):
        return 1
    for i in range(M):
        if abs(pixels[i, 0]) == np.inf or abs(pixels[i, 1]) == np.inf or depth[i] <= 0.0 or depth[i] == np.inf:
            return 1
        step.measured[i, 0], step.measured[i, 1], step.measured[i, 2] = pixels[i, 0], pixels[i, 1], depth[i]
    step.measurement[0].given, step.measurement[0].time = 1, taken
    return 0


@checked(Step)
@compiled("void(int64, float64[::1], float64[:, ::1], float64[:, :, ::1], float64[:, :, ::1], boolean[::1])", IN_PLACE)
def views(address: int, t: Array, q: Array, pixels: Array, points: Array, seen: BoolArray) -> None:
    """Write pixels (N, M, 2) and robot points (N, P, 3) at times t (N,) and coordinates q (N, n), without their motion.

    ``seen`` (N,) says whether all markers are in front of the camera; where they are not, the pixels do not count.
    """
    step = load_step(address)
    camera = step.camera[0]
    for k in range(len(t)):
        place(step, q[k])
        place_camera(step, t[k])
        seen[k] = True
        for i in range(len(step.markers)):
            P = in_camera(step, i)
            if not P[2] >= MINIMUM_DEPTH:
                seen[k] = False
            pixels[k, i, 0] = camera.focal[0] * P[0] / P[2] + camera.offset[0]
            pixels[k, i, 1] = camera.focal[1] * P[1] / P[2] + camera.offset[1]
        for i in range(len(step.robot_points)):
            point = step.robot_points[i]
            body = step.bodies[point.body]
            put(plus(vector(body.origin), turned(matrix(body.R), vector(point.offset))), points[k, i])
