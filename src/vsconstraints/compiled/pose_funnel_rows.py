"""Rows of a funnel of the camera's pose: see :class:`vsconstraints.constraints.PerformanceFunnel`."""

from __future__ import annotations

from collections.abc import Callable

from ..formulas.features import pose_error, pose_rates
from ..formulas.rotation import rotation_vector_rate
from ..formulas.vectors import dot, matrix, vector
from .funnel import funnel_now
from .parts import load_step
from .row import write_row


def template() -> Callable[[int, int], None]:
    """Make the function that writes the rows of a constraint, by its number among the parts of a step at an address."""

    def rows(address: int, i: int) -> None:
        step = load_step(address)
        part, eye, J, wanted = step.parts[i], step.eye[0], step.camera_J, step.parameters[i]
        at, width, rate, bend = funnel_now(wanted, step.time[0], 12)
        v, omega = vector(eye.velocity), vector(eye.angular_velocity)
        v_dot, omega_dot = vector(eye.acceleration), vector(eye.angular_acceleration)
        wanted_R = vector(wanted[at:]), vector(wanted[at + 3 :]), vector(wanted[at + 6 :])
        place = matrix(step.camera_R), vector(step.camera_t)
        E, t, w = pose_error(wanted_R, vector(wanted[at + 9 :]), place[0], place[1], (0.0, 0.0, 0.0), False)
        w_dot, L, L_dot = rotation_vector_rate(w, omega)
        t_dot, t_ddot, w_ddot = pose_rates(E, L, L_dot, v, omega, v_dot, omega_dot)
        for row in range(part.first, part.first + part.count):
            entry, side = step.which[row], step.offsets[row]
            c, turns = entry % 3, entry >= 3
            error, velocity, drift, along = t, t_dot, t_ddot, E
            if turns:
                error, velocity, drift, along = w, w_dot, w_ddot, L
            sigma, sigma_dot = side * error[c] - width, side * velocity[c] - rate
            write_row(address, row, part.K, sigma, sigma_dot, side * drift[c] - bend)
            for j in range(J.shape[1]):
                column = vector(J[3:, j]) if turns else vector(J[:3, j])
                step.rows.Lg[row, j] = part.K * side * dot(along[c], column)

    return rows
