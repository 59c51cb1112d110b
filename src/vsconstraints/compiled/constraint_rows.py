"""Rows of each kind of constraint, made by a template from the formulas of one constraint.

A template returns a function (address, i). It writes the rows of part ``i`` of the :class:`.Step`
at an address. Constraints name their template in :class:`.CompiledRowSpec`; they import it where
they need it, because importing this module starts the compiler.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

from ..formulas.features import image_row, interaction, pose_error, pose_rates
from ..formulas.frames import (
    differences_in_image,
    differences_in_space,
    rotate_in_image,
    rotate_inverse_in_image,
)
from ..formulas.motion import displacement
from ..formulas.rotation import rotation_vector_rate, whole_turns
from ..formulas.row import gradient_error
from ..formulas.tracking import funnel, goal_at
from ..formulas.vectors import Vector, dot, matrix, minus, rotate, rotate_inverse, vector
from ..rows import Array
from .compiler import IN_PLACE, OPTIONS, compiled, in_place
from .kinematics import point_jacobian
from .parts import address, load_step, make_part, to_fixed_tuple, warn_refused
from .signatures import INT, VOID, signature
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


@in_place
def displaced(motion: Any, t: float) -> tuple[Vector, Vector, Vector]:
    """Return displacement, velocity and acceleration of a MOTION at time t [s]."""
    x = displacement(t, motion.velocity[0], motion.amplitude[0], motion.rate, motion.phase)
    y = displacement(t, motion.velocity[1], motion.amplitude[1], motion.rate, motion.phase)
    z = displacement(t, motion.velocity[2], motion.amplitude[2], motion.rate, motion.phase)
    return (x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])


@in_place
def obstacle_motion(part: Any, t: float) -> tuple[Vector, Vector, Vector]:
    """Return displacement, velocity and acceleration of the region that a constraint forbids.

    Velocity and acceleration are zero if they are unknown to the controller.
    """
    moved = (0.0, 0.0, 0.0)
    velocity = (0.0, 0.0, 0.0)
    acceleration = (0.0, 0.0, 0.0)
    if part.moves:
        moved, velocity, acceleration = displaced(part.motion, t)
        if not part.known:
            velocity = (0.0, 0.0, 0.0)
            acceleration = (0.0, 0.0, 0.0)
    return moved, velocity, acceleration


@in_place
def write_row(step: Step, row: int, K: float, sigma: float, sigma_dot: float, drift: float) -> None:
    """Write a row except L_gφ: φ = σ + K σ̇ and L_fφ = σ̇ + K σ̈, with σ̈ for q̈ = 0."""
    rows = step.rows
    rows.sigma[row] = sigma
    rows.sigma_dot[row] = sigma_dot
    rows.phi[row] = sigma + K * sigma_dot
    rows.Lf[row] = sigma_dot + K * drift


@in_place
def funnel_now(numbers: Array, t: float, size: int) -> tuple[int, float, float, float]:
    """Return where the parameters of the current goal begin, and width, rate and curvature.

    The goal is the one that holds at time t [s]. The width of the funnel comes with its first two
    derivatives. ``numbers`` are those of :data:`FINAL` to :data:`BEGINS`, then ``size`` parameters
    of each goal.
    """
    goals = int(numbers[GOALS])
    first_goal = BEGINS + goals
    begins = numbers[BEGINS:first_goal]
    goal = goal_at(begins, t)
    width, rate, bend = funnel(t - begins[goal], numbers[FINAL], numbers[DECAY])
    return first_goal + goal * size, width, rate, bend


@RowTemplate
def joint_rows() -> WriteRows:
    """Return the function that writes rows linear in the joint coordinates."""

    def rows(address: int, i: int) -> None:
        step = load_step(address)
        part = step.parts[i]
        for row in range(part.first, part.first + part.count):
            value = step.offsets[row]
            rate = 0.0
            g = step.gradients[row]
            middle = step.middles[row]
            for j in range(len(g)):
                q = step.q[j]
                # not NaN: the row limits a single continuous joint
                if middle == middle:
                    q -= whole_turns(q - middle)
                value += g[j] * q
                rate += g[j] * step.qd[j]
                step.rows.Lg[row, j] = part.K * g[j]
            write_row(step, row, part.K, value, rate, 0.0)

    return rows


@RowTemplate
def speed_rows() -> WriteRows:
    """Return the function that writes rows linear in the joint speeds.

    Their formula is φ itself, whose drift L_fφ is zero.
    """

    def rows(address: int, i: int) -> None:
        step = load_step(address)
        part = step.parts[i]
        for row in range(part.first, part.first + part.count):
            value = step.offsets[row]
            g = step.gradients[row]
            for j in range(len(g)):
                value += g[j] * step.qd[j]
                step.rows.Lg[row, j] = g[j]
            write_row(step, row, 0.0, value, 0.0, 0.0)

    return rows


@RowTemplate
def point_rows(
    formula: Callable[..., Any], curvature: Callable[..., Any] | None, count: int
) -> WriteRows:
    """Return the function that writes rows on the positions of robot points.

    ``formula`` has ``count`` parameters; see :func:`image_rows`.
    """

    def rows(address: int, i: int) -> None:
        step = load_step(address)
        part = step.parts[i]
        J = step.J_point
        parameters = to_fixed_tuple(step.parameters[i], count)
        K = part.K
        R = matrix(part.R)
        moved, velocity, acceleration = obstacle_motion(part, step.time[0])
        for row in range(part.first, part.first + part.count):
            which = step.which[row]
            place = step.places[which]
            p_dot = minus(vector(place.velocity), velocity)
            p_ddot = minus(vector(place.drift), acceleration)
            # coordinates in the frame of the formula
            y = rotate_inverse(R, minus(minus(vector(place.position), moved), vector(part.t)))
            y_dot = rotate_inverse(R, p_dot)
            value, along_x, along_y, along_z = formula(*(y + parameters))
            if curvature is None:
                bent = differences_in_space(formula, parameters, y, y_dot)
            else:
                bent = curvature(*(y + parameters + y_dot))
            g = rotate(R, (along_x, along_y, along_z))
            drift = bent + g[0] * p_ddot[0] + g[1] * p_ddot[1] + g[2] * p_ddot[2]
            write_row(step, row, K, value + part.margin, dot(g, p_dot), drift)
            point_jacobian(step, step.robot_points[which].body, vector(place.position), J)
            K_g = (K * g[0], K * g[1], K * g[2])
            for j in range(len(step.qd)):
                step.rows.Lg[row, j] = K_g[0] * J[0, j] + K_g[1] * J[1, j] + K_g[2] * J[2, j]

    return rows


@RowTemplate
def image_rows(
    formula: Callable[..., Any], curvature: Callable[..., Any] | None, count: int
) -> WriteRows:
    """Return the function that writes rows on the positions of markers in the image.

    ``formula`` has ``count`` parameters; see :class:`.ByFormula`. Without ``curvature``, second
    derivatives are finite differences.
    """

    def rows(address: int, i: int) -> None:
        step = load_step(address)
        part = step.parts[i]
        focal = step.camera[0].focal
        offset = step.camera[0].offset
        parameters = to_fixed_tuple(step.parameters[i], count)
        K = part.K
        R = part.R
        Jc = step.camera_J
        moved, velocity, acceleration = obstacle_motion(part, step.time[0])
        for row in range(part.first, part.first + part.count):
            marker = step.seen[step.which[row]]
            u = focal[0] * marker.xy[0] - moved[0] + offset[0]
            v = focal[1] * marker.xy[1] - moved[1] + offset[1]
            u_dot = focal[0] * marker.velocity[0] - velocity[0]
            v_dot = focal[1] * marker.velocity[1] - velocity[1]
            u_ddot = focal[0] * marker.drift[0] - acceleration[0]
            v_ddot = focal[1] * marker.drift[1] - acceleration[1]
            # coordinates in the frame of the formula
            y = rotate_inverse_in_image(R, (u - part.t[0], v - part.t[1]))
            y_dot = rotate_inverse_in_image(R, (u_dot, v_dot))
            value, along_u, along_v = formula(*(y + parameters))
            if curvature is None:
                bent = differences_in_image(formula, parameters, y, y_dot)
            else:
                bent = curvature(*(y + parameters + y_dot))
            g = rotate_in_image(R, (along_u, along_v))
            sigma_dot = g[0] * u_dot + g[1] * v_dot
            drift = bent + g[0] * u_ddot + g[1] * v_ddot
            write_row(step, row, K, value + part.margin, sigma_dot, drift)
            # factors of the camera's v and ω in K ∇σ ṡ
            per_x = K * g[0] * focal[0]
            per_y = K * g[1] * focal[1]
            linear, angular = interaction(per_x, per_y, marker.xy[0], marker.xy[1], marker.depth)
            for j in range(len(step.qd)):
                first = linear[0] * Jc[0, j] + angular[0] * Jc[3, j]
                second = linear[1] * Jc[1, j] + angular[1] * Jc[4, j]
                third = linear[2] * Jc[2, j] + angular[2] * Jc[5, j]
                step.rows.Lg[row, j] = first + second + third

    return rows


@RowTemplate
def image_funnel_rows() -> WriteRows:
    """Return the function that writes the rows of a funnel of markers.

    See :class:`vsconstraints.constraints.PerformanceFunnel`.
    """

    def rows(address: int, i: int) -> None:
        step = load_step(address)
        part = step.parts[i]
        J = step.camera_J
        wanted = step.parameters[i]
        at, width, rate, bend = funnel_now(wanted, step.time[0], 2 * len(step.seen))
        for row in range(part.first, part.first + part.count):
            entry = step.which[row]
            side = step.offsets[row]
            marker = step.seen[entry // 2]
            c = entry % 2
            slope = side * step.camera[0].focal[c]
            error = step.pixels[entry // 2, c] - wanted[at + entry]
            sigma = side * error - width
            sigma_dot = slope * marker.velocity[c] - rate
            drift = slope * marker.drift[c] - bend
            write_row(step, row, part.K, sigma, sigma_dot, drift)
            now = image_row(c, marker.xy[0], marker.xy[1], marker.depth)
            for j in range(J.shape[1]):
                along = 0.0
                for k in range(3):
                    along += now[k] * J[k, j] + now[3 + k] * J[3 + k, j]
                step.rows.Lg[row, j] = part.K * slope * along

    return rows


@RowTemplate
def pose_funnel_rows() -> WriteRows:
    """Return the function that writes the rows of a funnel of the camera's pose.

    See :class:`vsconstraints.constraints.PerformanceFunnel`.
    """

    def rows(address: int, i: int) -> None:
        step = load_step(address)
        part = step.parts[i]
        eye = step.eye[0]
        J = step.camera_J
        wanted = step.parameters[i]
        at, width, rate, bend = funnel_now(wanted, step.time[0], 12)
        v = vector(eye.velocity)
        omega = vector(eye.angular_velocity)
        v_dot = vector(eye.acceleration)
        omega_dot = vector(eye.angular_acceleration)
        wanted_R = vector(wanted[at:]), vector(wanted[at + 3 :]), vector(wanted[at + 6 :])
        wanted_t = vector(wanted[at + 9 :])
        R = matrix(step.camera_R)
        origin = vector(step.camera_t)
        E, t, w = pose_error(wanted_R, wanted_t, R, origin, (0.0, 0.0, 0.0), False)
        w_dot, L, L_dot = rotation_vector_rate(w, omega)
        t_dot, t_ddot, w_ddot = pose_rates(E, L, L_dot, v, omega, v_dot, omega_dot)
        for row in range(part.first, part.first + part.count):
            entry = step.which[row]
            side = step.offsets[row]
            c = entry % 3
            turns = entry >= 3
            error = t
            velocity = t_dot
            drift = t_ddot
            along = E
            if turns:
                error = w
                velocity = w_dot
                drift = w_ddot
                along = L
            sigma = side * error[c] - width
            sigma_dot = side * velocity[c] - rate
            write_row(step, row, part.K, sigma, sigma_dot, side * drift[c] - bend)
            for j in range(J.shape[1]):
                column = vector(J[3:, j]) if turns else vector(J[:3, j])
                step.rows.Lg[row, j] = part.K * side * dot(along[c], column)

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
