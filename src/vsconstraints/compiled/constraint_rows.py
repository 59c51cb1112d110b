"""Rows of each kind of constraint, made by a template from the formulas of one constraint.

A template returns a function (address, i). It writes the rows of part ``i`` of the :class:`.Step`
at an address. Constraints name their template in :class:`.CompiledRowSpec`; they import it where
they need it, because importing this module starts the compiler.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

from ..formulas.features import image_row, interaction, pair_of_rows, pose_motion
from ..formulas.frames import (
    differences_in_image,
    differences_in_space,
    rotate_in_image,
    rotate_inverse_in_image,
)
from ..formulas.motion import displacement
from ..formulas.rotation import whole_turns
from ..formulas.row import gradient_error
from ..formulas.tracking import funnel, goal_at
from ..formulas.vectors import (
    Matrix,
    Vector,
    dot,
    matrix,
    minus,
    rotate,
    rotate_inverse,
    times,
    vector,
)
from ..rows import Array
from .compiler import IN_PLACE, OPTIONS, compiled, in_place
from .kinematics import camera_column, camera_twist, point_jacobian
from .parts import address, load_step, make_part, to_fixed_tuple, warn_refused
from .signatures import INT, VOID, signature
from .visual_task import along_column
from .workspace import Step

WriteRows = Callable[[int, int], None]


class RowTemplate(NamedTuple):
    """Template of functions that write rows, one function for the formulas of one constraint.

    ``make`` takes a formula, its curvature and their number of parameters, or nothing for rows
    without formulas. It decorates the function of that signature.
    """

    make: Callable[..., WriteRows]
    makes_arrays: bool = False  #: True if the function allocates arrays, which takes other options.


#: First parameters of a funnel: ρ∞/ρ₀, l, and the number of goals; then the goals' start times.
FINAL, DECAY, GOALS, BEGINS = range(4)
AT_REST = (0.0, 0.0, 0.0)


@in_place
def displaced(motion: Any, t: float) -> tuple[Vector, Vector, Vector]:
    """Return displacement, velocity and acceleration of a MOTION at time t [s]."""
    velocity = motion.velocity
    amplitude = motion.amplitude
    rate = motion.rate
    phase = motion.phase
    x, x_dot, x_ddot = displacement(t, velocity[0], amplitude[0], rate, phase)
    y, y_dot, y_ddot = displacement(t, velocity[1], amplitude[1], rate, phase)
    z, z_dot, z_ddot = displacement(t, velocity[2], amplitude[2], rate, phase)
    return (x, y, z), (x_dot, y_dot, z_dot), (x_ddot, y_ddot, z_ddot)


@in_place
def obstacle_motion(part: Any, t: float) -> tuple[Vector, Vector, Vector]:
    """Return displacement, velocity and acceleration of the region that a constraint forbids.

    Velocity and acceleration are zero if they are unknown to the controller.
    """
    if not part.moves:
        return AT_REST, AT_REST, AT_REST
    moved, velocity, acceleration = displaced(part.motion, t)
    if not part.known:
        return moved, AT_REST, AT_REST
    return moved, velocity, acceleration


@in_place
def write_row(step: Step, row: int, K: float, sigma: float, sigma_dot: float, drift: float) -> None:
    """Write a row except L_gφ: φ = σ + K σ̇ and L_fφ = σ̇ + K σ̈, with σ̈ for q̈ = 0."""
    rows = step.rows
    rows.sigma[row] = sigma
    rows.sigma_dot[row] = sigma_dot
    rows.phi[row] = sigma + K * sigma_dot
    rows.Lf[row] = sigma_dot + K * drift


@RowTemplate
def joint_rows() -> WriteRows:
    """Return the function that writes rows linear in the joint coordinates."""

    def rows(address: int, number: int) -> None:
        step = load_step(address)
        part = step.parts[number]
        for row in range(part.first, part.first + part.count):
            sigma = step.offsets[row]
            sigma_dot = 0.0
            gradient = step.gradients[row]
            middle = step.middles[row]
            # the middle is NaN unless the row limits a single continuous joint
            is_circular = not math.isnan(middle)
            for j in range(len(gradient)):
                q = step.q[j]
                if is_circular:
                    q -= whole_turns(q - middle)
                sigma += gradient[j] * q
                sigma_dot += gradient[j] * step.qd[j]
                step.rows.Lg[row, j] = part.K * gradient[j]
            write_row(step, row, part.K, sigma, sigma_dot, 0.0)

    return rows


@RowTemplate
def speed_rows() -> WriteRows:
    """Return the function that writes rows linear in the joint speeds.

    Their formula is φ itself, whose drift L_fφ is zero.
    """

    def rows(address: int, number: int) -> None:
        step = load_step(address)
        part = step.parts[number]
        for row in range(part.first, part.first + part.count):
            phi = step.offsets[row]
            gradient = step.gradients[row]
            for j in range(len(gradient)):
                phi += gradient[j] * step.qd[j]
                step.rows.Lg[row, j] = gradient[j]
            write_row(step, row, 0.0, phi, 0.0, 0.0)

    return rows


@RowTemplate
def point_rows(
    formula: Callable[..., Any], curvature: Callable[..., Any] | None, count: int
) -> WriteRows:
    """Return the function that writes rows on the positions of robot points.

    ``formula`` has ``count`` parameters; see :func:`image_rows`.
    """

    def rows(address: int, number: int) -> None:
        step = load_step(address)
        part = step.parts[number]
        J = step.J_point
        parameters = to_fixed_tuple(step.parameters[number], count)
        K = part.K
        R = matrix(part.R)
        origin = vector(part.t)
        moved, velocity, acceleration = obstacle_motion(part, step.time[0])
        for row in range(part.first, part.first + part.count):
            point = step.which[row]
            place = step.places[point]
            position = vector(place.position)
            # motion relative to the region
            p = minus(minus(position, moved), origin)
            p_dot = minus(vector(place.velocity), velocity)
            p_ddot = minus(vector(place.drift), acceleration)
            # coordinates in the frame of the formula
            y = rotate_inverse(R, p)
            y_dot = rotate_inverse(R, p_dot)
            arguments = y + parameters
            value, along_x, along_y, along_z = formula(*arguments)
            if curvature is None:
                bend = differences_in_space(formula, parameters, y, y_dot)
            else:
                with_velocity = arguments + y_dot
                bend = curvature(*with_velocity)
            gradient = rotate(R, (along_x, along_y, along_z))
            sigma_dot = dot(gradient, p_dot)
            drift = bend
            for i in range(3):
                drift += gradient[i] * p_ddot[i]
            write_row(step, row, K, value + part.margin, sigma_dot, drift)
            point_jacobian(step, step.robot_points[point].body, position, J)
            K_gradient = times(K, gradient)
            for j in range(len(step.qd)):
                step.rows.Lg[row, j] = dot(K_gradient, vector(J[:, j]))

    return rows


@in_place
def relative_pixel(focal: Array, normalised: Array, moved: Vector) -> tuple[float, float]:
    """Return F ∘ x − d of normalised coordinates x (2,) and a displacement d [px].

    The same holds for their derivatives.
    """
    u = focal[0] * normalised[0] - moved[0]
    v = focal[1] * normalised[1] - moved[1]
    return u, v


@RowTemplate
def image_rows(
    formula: Callable[..., Any], curvature: Callable[..., Any] | None, count: int
) -> WriteRows:
    """Return the function that writes rows on the positions of markers in the image.

    ``formula`` has ``count`` parameters; see :class:`.ByFormula`. Without ``curvature``, second
    derivatives are finite differences.
    """

    def rows(address: int, number: int) -> None:
        step = load_step(address)
        part = step.parts[number]
        focal = step.camera[0].focal
        offset = step.camera[0].offset
        parameters = to_fixed_tuple(step.parameters[number], count)
        K = part.K
        R = part.R
        moved, velocity, acceleration = obstacle_motion(part, step.time[0])
        for row in range(part.first, part.first + part.count):
            marker = step.seen[step.which[row]]
            # motion relative to the region
            relative_u, relative_v = relative_pixel(focal, marker.xy, moved)
            u_dot, v_dot = relative_pixel(focal, marker.velocity, velocity)
            u_ddot, v_ddot = relative_pixel(focal, marker.drift, acceleration)
            # coordinates in the frame of the formula
            u = relative_u + offset[0] - part.t[0]
            v = relative_v + offset[1] - part.t[1]
            y = rotate_inverse_in_image(R, (u, v))
            y_dot = rotate_inverse_in_image(R, (u_dot, v_dot))
            arguments = y + parameters
            value, along_u, along_v = formula(*arguments)
            if curvature is None:
                bend = differences_in_image(formula, parameters, y, y_dot)
            else:
                with_velocity = arguments + y_dot
                bend = curvature(*with_velocity)
            slope_u, slope_v = rotate_in_image(R, (along_u, along_v))
            sigma_dot = slope_u * u_dot + slope_v * v_dot
            drift = bend + slope_u * u_ddot
            drift += slope_v * v_ddot
            write_row(step, row, K, value + part.margin, sigma_dot, drift)
            # factors of the camera's v and ω in K ∇σ ṡ
            per_x = K * slope_u * focal[0]
            per_y = K * slope_v * focal[1]
            image_x = marker.xy[0]
            image_y = marker.xy[1]
            linear, angular = interaction(per_x, per_y, image_x, image_y, marker.depth)
            for j in range(len(step.qd)):
                camera_v, camera_omega = camera_column(step, j)
                step.rows.Lg[row, j] = pair_of_rows(linear, camera_v, angular, camera_omega)

    return rows


class CurrentFunnel(NamedTuple):
    """Width of a funnel at a time with two derivatives, and its goal's place in the parameters."""

    goal: int
    width: float
    rate: float
    bend: float


@in_place
def funnel_now(parameters: Array, t: float, size: int) -> CurrentFunnel:
    """Return the funnel of the goal that holds at time t [s].

    ``parameters`` are those of :data:`FINAL` to :data:`BEGINS`, then ``size`` numbers of each goal.
    """
    goals = int(parameters[GOALS])
    first_goal = BEGINS + goals
    begins = parameters[BEGINS:first_goal]
    goal = goal_at(begins, t)
    elapsed = t - begins[goal]
    width, rate, bend = funnel(elapsed, parameters[FINAL], parameters[DECAY])
    return CurrentFunnel(first_goal + goal * size, width, rate, bend)


@RowTemplate
def image_funnel_rows() -> WriteRows:
    """Return the function that writes the rows of a funnel of markers.

    See :class:`vsconstraints.constraints.PerformanceFunnel`.
    """

    def rows(address: int, number: int) -> None:
        step = load_step(address)
        part = step.parts[number]
        focal = step.camera[0].focal
        parameters = step.parameters[number]
        now = funnel_now(parameters, step.time[0], 2 * len(step.seen))
        for row in range(part.first, part.first + part.count):
            side = step.offsets[row]
            # pixels are numbered u, v of the first marker, u, v of the second one, and so on
            entry = step.which[row]
            m = entry // 2
            c = entry % 2
            marker = step.seen[m]
            slope = side * focal[c]
            error = step.pixels[m, c] - parameters[now.goal + entry]
            sigma = side * error - now.width
            sigma_dot = slope * marker.velocity[c] - now.rate
            drift = slope * marker.drift[c] - now.bend
            write_row(step, row, part.K, sigma, sigma_dot, drift)
            L = image_row(c, marker.xy[0], marker.xy[1], marker.depth)
            for j in range(len(step.qd)):
                by_joint = along_column(step, L, j)
                step.rows.Lg[row, j] = part.K * slope * by_joint

    return rows


@in_place
def goal_pose(parameters: Array, start: int) -> tuple[Matrix, Vector]:
    """Return R and t of a goal, which stand in twelve parameters from ``start`` on."""
    R = (
        vector(parameters[start:]),
        vector(parameters[start + 3 :]),
        vector(parameters[start + 6 :]),
    )
    return R, vector(parameters[start + 9 :])


@RowTemplate
def pose_funnel_rows() -> WriteRows:
    """Return the function that writes the rows of a funnel of the camera's pose.

    See :class:`vsconstraints.constraints.PerformanceFunnel`.
    """

    def rows(address: int, number: int) -> None:
        step = load_step(address)
        part = step.parts[number]
        parameters = step.parameters[number]
        now = funnel_now(parameters, step.time[0], 12)
        goal_R, goal_t = goal_pose(parameters, now.goal)
        R = matrix(step.camera_R)
        origin = vector(step.camera_t)
        near = (0.0, 0.0, 0.0)
        motion = pose_motion(goal_R, goal_t, R, origin, near, False, camera_twist(step))
        for row in range(part.first, part.first + part.count):
            side = step.offsets[row]
            # entries of t, then of θu
            entry = step.which[row]
            c = entry % 3
            is_rotation = entry >= 3
            if is_rotation:
                error = motion.theta_u[c]
                velocity = motion.theta_u_dot[c]
                drift = motion.theta_u_ddot[c]
                along = motion.L[c]
            else:
                error = motion.t[c]
                velocity = motion.t_dot[c]
                drift = motion.t_ddot[c]
                along = motion.E[c]
            sigma = side * error - now.width
            sigma_dot = side * velocity - now.rate
            sigma_ddot = side * drift - now.bend
            write_row(step, row, part.K, sigma, sigma_dot, sigma_ddot)
            for j in range(len(step.qd)):
                v, omega = camera_column(step, j)
                by_joint = dot(along, omega if is_rotation else v)
                step.rows.Lg[row, j] = part.K * side * by_joint

    return rows


@cache
def rows_function(
    template: RowTemplate, formulas: tuple[Callable[..., Any] | None, ...], count: int
) -> Any:
    """Return the compiled function of a template, or None if numba refuses a formula.

    A RuntimeWarning reports the refusal. ``count`` is the number of parameters of the formulas.
    """
    constants = (count,) if formulas else ()
    options = OPTIONS if template.makes_arrays else IN_PLACE
    try:
        return make_part(template.make, formulas, constants, signature(VOID, INT, INT), options)
    except Exception as error:  # numba raises any exception for code that it does not support
        if all(formula is None for formula in formulas):
            raise
        warn_refused(formulas, error)
        return None


def rows_address(
    template: RowTemplate, formulas: tuple[Callable[..., Any] | None, ...], count: int
) -> int:
    """Return the address of :func:`rows_function`'s result, or 0 if there is none."""
    function = rows_function(template, formulas, count)
    return 0 if function is None else address(function)


@compiled(signature(VOID, INT, INT), IN_PLACE, from_python=False)
def apply_gradient_error(step_address: int, in_phi: int) -> None:
    """Replace ∇σ by ∇σ_e in the rows of a step: in L_gφ and, if ``in_phi``, in φ and L_fφ.

    See :class:`vsconstraints.simulation.sensing.GradientError`.
    """
    step = load_step(step_address)
    rows = step.rows
    share = step.gradient_share
    for i in range(len(rows.phi)):
        change = 0.0
        for j in range(len(step.qd)):
            error = gradient_error(rows.Lg[i, j], share[i, j])
            rows.Lg[i, j] += error
            change += error * step.qd[j]
        # rows that give φ itself contain no ∇σ
        if in_phi and rows.K[i] > 0.0:
            rows.phi[i] += change
            rows.Lf[i] += change / rows.K[i]


APPLY_GRADIENT_ERROR = address(apply_gradient_error)  #: Its address.
