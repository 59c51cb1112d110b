"""The rows of a constraint on where robot points are in space, from its formula."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..formulas.frames import differences_in_space
from ..formulas.vectors import dot, matrix, minus, turned, turned_back, vector
from .kinematics import point_jacobian
from .parts import load_step, to_fixed_tuple
from .row import obstacle_motion, write_row


def template(
    formula: Callable[..., Any], curvature: Callable[..., Any] | None, count: int
) -> Callable[[int, int], None]:
    """Make the function that writes the rows of a constraint; see :func:`.template`."""

    def rows(address: int, i: int) -> None:
        step = load_step(address)
        part, J = step.parts[i], step.J_point
        parameters, K, R = to_fixed_tuple(step.parameters[i], count), part.K, matrix(part.R)
        moved, velocity, acceleration = obstacle_motion(part, step.time[0])
        for row in range(part.first, part.first + part.count):
            which = step.which[row]
            place = step.places[which]
            p_dot, p_ddot = minus(vector(place.velocity), velocity), minus(vector(place.drift), acceleration)
            # in the frame of the formula
            y = turned_back(R, minus(minus(vector(place.position), moved), vector(part.t)))
            y_dot = turned_back(R, p_dot)
            value, along_x, along_y, along_z = formula(*(y + parameters))
            if curvature is None:
                bent = differences_in_space(formula, parameters, y, y_dot)
            else:
                bent = curvature(*(y + parameters + y_dot))
            g = turned(R, (along_x, along_y, along_z))
            drift = bent + g[0] * p_ddot[0] + g[1] * p_ddot[1] + g[2] * p_ddot[2]
            write_row(address, row, K, value + part.margin, dot(g, p_dot), drift)
            point_jacobian(address, step.robot_points[which].body, vector(place.position), J)
            for j in range(len(step.qd)):
                step.rows.Lg[row, j] = K * g[0] * J[0, j] + K * g[1] * J[1, j] + K * g[2] * J[2, j]

    return rows
