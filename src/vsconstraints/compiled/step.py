"""Control step up to the controller, in one compiled function: kinematics, image, rows, task."""

from __future__ import annotations

import math

import numpy as np

from ..formulas.features import MINIMUM_DEPTH, image_motion
from ..formulas.innovation import MEMORY, depth_innovation, image_innovation, slip
from ..formulas.limits import JointLimits, joint_box
from ..formulas.motion import pose_difference
from ..formulas.rotation import whole_turns
from ..formulas.vectors import Vector, matrix, plus, rotate, times, vector
from ..rows import Array, BoolArray
from .camera import (
    carry,
    from_target,
    in_camera,
    keep_view,
    look_back,
    move_camera,
    moved_since,
    place_camera,
)
from .codes import AGE, DEPTH, IMAGE, ORIENTATION, OWN, POSITION, SHAPE, SPEED, WORST
from .compiler import IN_PLACE, compiled, in_place
from .kinematics import camera_twist, move, place, put
from .parts import address as address_of
from .parts import call_int_pointer, call_void_pointer, checked, load_step
from .signatures import FLAGS, FLOAT, INT, MATRIX, STACK, VECTOR, VOID, signature
from .visual_task import write_task
from .workspace import Step

JUST_NOW = 1e-9  #: Tolerance [s] of the time of a measurement, for rounding.


@in_place
def see(step: Step, i: int, t: float) -> bool:
    """Write position and motion of a marker in the image.

    Return False if the marker is not in front of the camera.
    """
    camera = step.camera[0]
    marker = step.seen[i]
    P = in_camera(step, i)
    if not P[2] >= MINIMUM_DEPTH:
        return False
    if step.measurement[0].given:
        P = measured_position(step, i, t, P)
    P = times(camera.depth_factor, P)
    v, omega, v_dot, omega_dot = camera_twist(step)
    x, y, x_dot, y_dot, x_ddot, y_ddot = image_motion(P, v, omega, v_dot, omega_dot)
    marker.xy[0] = x
    marker.xy[1] = y
    marker.velocity[0] = x_dot
    marker.velocity[1] = y_dot
    marker.depth = P[2]
    marker.drift[1] = y_ddot
    marker.drift[0] = x_ddot
    for c in range(2):
        step.pixels[i, c] = camera.focal[c] * marker.xy[c] + camera.offset[c]
    return True


@in_place
def measured_position(step: Step, i: int, t: float, P: Vector) -> Vector:
    """Return the measured position of a marker in the camera's frame; P is that of the model.

    A missing pixel keeps the last measured offset from the model, and a missing depth is that of
    the model. An old measurement is moved by what the model has moved since.
    """
    camera = step.camera[0]
    correction = step.correction[i]
    model_x = P[0] / P[2]
    model_y = P[1] / P[2]
    u, v, depth = vector(step.measured[i])
    dx = dy = dz = 0.0
    if step.measurement[0].time < t - JUST_NOW:
        dx, dy, dz = moved_since(step, i)
    Z = P[2]
    ratio = depth / P[2]
    if depth >= MINIMUM_DEPTH:
        Z = max(depth + dz, MINIMUM_DEPTH)
        ratio = Z / P[2]
    step.depth_ratio[i] = ratio
    is_missing = math.isnan(u) or math.isnan(v)
    if not is_missing:
        measured_x = (u - camera.offset[0]) / camera.focal[0]
        measured_y = (v - camera.offset[1]) / camera.focal[1]
        correction[0] = measured_x + dx - model_x
        correction[1] = measured_y + dy - model_y
    x = model_x + correction[0]
    y = model_y + correction[1]
    return x * Z, y * Z, Z


@in_place
def write_innovation(step: Step, t: float) -> None:
    """Write the innovation, i.e. the differences of measurements from the model.

    A measured camera pose must have been written before.
    """
    innovation = step.innovation
    measurement = step.measurement[0]
    focal = step.camera[0].focal
    innovation[:] = 0.0
    if measurement.given:
        image, shape = image_innovation(step.pixels, step.correction, focal[0], focal[1])
        innovation[IMAGE] = image
        innovation[SHAPE] = shape
        innovation[AGE] = t - measurement.time
        innovation[DEPTH] = depth_innovation(step.depth_ratio)
    if measurement.pose_given:
        distance, turned = pose_innovation(step)
        innovation[POSITION] = distance
        innovation[ORIENTATION] = turned
    for j in range(len(step.slip)):
        speed = abs(step.slip[j]) / MEMORY
        innovation[SPEED] = max(innovation[SPEED], speed)
    for i in range(len(step.bounds)):
        ratio = innovation[i] / step.bounds[i]
        innovation[WORST] = max(innovation[WORST], ratio)


@in_place
def pose_innovation(step: Step) -> tuple[float, float]:
    """Return distance [m] and angle [rad] of the measured camera pose from that of the model."""
    R, origin = from_target(step, matrix(step.target_R), vector(step.target_t))
    return pose_difference(step.camera_R, step.camera_t, R, origin)


@in_place
def write_box(step: Step, j: int) -> None:
    """Write the range of acceleration that a joint's limits allow."""
    given = step.limits
    limits = JointLimits(
        given.acceleration[j],
        given.change[j],
        given.q_min[j],
        given.q_max[j],
        given.qd_max[j],
        given.ranges,
        given.period,
    )
    last = step.last_command[j]
    least, greatest = joint_box(step.q[j], step.qd[j], last, limits)
    step.rows.qdd_min[j] = least
    step.rows.qdd_max[j] = greatest


@in_place
def take_state(step: Step, t: float, q: Array, qd: Array) -> bool:
    """Store time and state of the joints, and their slip since the previous sample.

    Return False if q or q̇ has another size or stride, or if a number is not finite.
    """
    n = len(step.joints)
    fits = q.size == n and qd.size == n
    if not (fits and abs(t) < np.inf):
        return False
    # calls of the entry point skip the check of types, so that other strides are possible
    is_dense = q.strides[0] == q.itemsize and qd.strides[0] == qd.itemsize
    if n > 1 and not is_dense:
        return False
    interval = t - step.time[0]
    for i in range(n):
        is_finite = np.isfinite(q[i]) and np.isfinite(qd[i])
        if not is_finite:
            return False
        mean_speed = 0.5 * (qd[i] + step.qd[i])
        moved = q[i] - step.q[i]
        if step.joints[i].continuous != 0:
            moved -= whole_turns(moved)
        step.slip[i] = slip(step.slip[i], moved, mean_speed, interval)
        step.q[i] = q[i]
        step.qd[i] = qd[i]
    step.time[0] = t
    return True


@in_place
def point_from_body(step: Step, i: int) -> Vector:
    """Return the place of robot point i from the origin of its body, in the base frame."""
    point = step.robot_points[i]
    return rotate(matrix(step.bodies[point.body].R), vector(point.offset))


@in_place
def move_points(step: Step) -> None:
    """Write position, velocity and drift of the robot points."""
    for i in range(len(step.places)):
        spot = step.places[i]
        body = step.robot_points[i].body
        position, velocity, drift = carry(step, body, point_from_body(step, i))
        put(position, spot.position)
        put(velocity, spot.velocity)
        put(drift, spot.drift)
        put(position, step.points[i])


@in_place
def evaluate(address: int, step: Step, t: float, q: Array, qd: Array) -> bool:
    """Evaluate a step as :func:`evaluate_step` does; return False if that is impossible."""
    if not take_state(step, t, q, qd):
        return False
    move(step, q, qd)
    place_camera(step, t)
    move_camera(step, t)
    keep_view(step, t)
    measurement = step.measurement[0]
    is_measured = measurement.given or measurement.pose_given
    if is_measured and measurement.time < t - JUST_NOW:
        look_back(step)
    for i in range(len(step.seen)):
        if not see(step, i, t):
            return False
    write_innovation(step, t)
    move_points(step)
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


@compiled(signature(INT, INT, FLOAT, VECTOR, VECTOR), IN_PLACE, from_python=False)
def evaluate_at(address: int, t: float, q: Array, qd: Array) -> int:
    """Compute all inputs of a controller at time t [s], q and q̇ (n,), in a :class:`.Step`.

    Return 0, or 1 if q or q̇ has another size, a number is not finite, or a marker is not in front
    of the camera. The outputs are then invalid, and the memory of the task is unchanged. A
    measurement is used only once.
    """
    step = load_step(address)
    done = evaluate(address, step, t, q, qd)
    measurement = step.measurement[0]
    measurement.given = measurement.pose_given = 0
    return 0 if done else 1


EVALUATE = address_of(evaluate_at)  #: Its address.


@checked(Step, calls=EVALUATE)
@compiled(signature(INT, INT, INT, FLOAT, VECTOR, VECTOR), IN_PLACE)
def evaluate_step(function: int, address: int, t: float, q: Array, qd: Array) -> int:
    """Call :func:`evaluate_at` from Python."""
    code: int = call_int_pointer(function, (address, t, q, qd))
    return code


@checked(Step)
@compiled(signature(VOID, INT, FLOAT), IN_PLACE)
def follow(address: int, t: float) -> None:
    """Write the task of a custom feature at time t [s].

    Its error, J_s, ṡ, drift and ∂s/∂t must have been written.
    """
    write_task(load_step(address), t)


@checked(Step)
@compiled(signature(INT, INT, MATRIX, VECTOR, FLOAT, FLOAT), IN_PLACE)
def measure(address: int, pixels: Array, depth: Array, taken: float, t: float) -> int:
    """Give the next step pixels (M, 2) and depths (M,) of an image, NaN where they are missing.

    ``taken`` is the time of the image. A depth of 0 or infinity is missing as well: depth cameras
    report unknown depths in this way. Return 0, or 1 if the sizes differ, a pixel is infinite, a
    depth is negative, or the time of the image is after t [s].
    """
    step = load_step(address)
    M = len(step.seen)
    rows, columns = pixels.shape
    fits = rows == M and columns == 2 and depth.size == M
    is_past = -np.inf < taken <= t + JUST_NOW
    if not (fits and is_past):
        return 1
    # calls of the entry point skip the check of types, so that other strides are possible
    row_stride, column_stride = pixels.strides
    is_dense = row_stride == 16 and column_stride == 8 and depth.strides[0] == 8
    if M > 0 and not is_dense:
        return 1
    for i in range(M):
        u = pixels[i, 0]
        v = pixels[i, 1]
        Z = depth[i]
        is_infinite = abs(u) == np.inf or abs(v) == np.inf
        if is_infinite or Z < 0.0:
            return 1
        is_known = 0.0 < Z < np.inf
        measured = step.measured[i]
        measured[0] = u
        measured[1] = v
        measured[2] = Z if is_known else np.nan
    step.measurement[0].given = 1
    step.measurement[0].time = taken
    return 0


@checked(Step)
@compiled(signature(VOID, INT, VECTOR, MATRIX, STACK, STACK, FLAGS), IN_PLACE)
def views(address: int, t: Array, q: Array, pixels: Array, points: Array, seen: BoolArray) -> None:
    """Write pixels (N, M, 2) and robot points (N, P, 3) at times t (N,) and coordinates q (N, n).

    Their motion is not computed. ``seen`` (N,) is True if all markers are in front of the camera;
    otherwise the pixels are invalid.
    """
    step = load_step(address)
    focal = step.camera[0].focal
    offset = step.camera[0].offset
    for k in range(len(t)):
        place(step, q[k])
        place_camera(step, t[k])
        seen[k] = True
        for i in range(len(step.markers)):
            X, Y, Z = in_camera(step, i)
            if not Z >= MINIMUM_DEPTH:
                seen[k] = False
            pixels[k, i, 0] = focal[0] * X / Z + offset[0]
            pixels[k, i, 1] = focal[1] * Y / Z + offset[1]
        for i in range(len(step.robot_points)):
            body = step.bodies[step.robot_points[i].body]
            position = plus(vector(body.origin), point_from_body(step, i))
            put(position, points[k, i])
