"""The rows of a constraint on where markers are in the image, from its formula."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..formulas.frames import differences_in_image, turned_back_in_image, turned_in_image
from ..formulas.image import interaction
from .parts import load_step, to_fixed_tuple
from .row import obstacle_motion, write_row


def template(
    formula: Callable[..., Any], curvature: Callable[..., Any] | None, count: int
) -> Callable[[int, int], None]:
    """Make the function that writes the rows of a constraint, by its number among the parts of the step at an address.

    Parameters
    ----------
    formula, curvature
        See :class:`vsconstraints.constraints.by_formula.ByFormula`.
    count
        Number of parameters.
    """

    def rows(address: int, i: int) -> None:
        step = load_step(address)
        part, focal, offset = step.parts[i], step.camera[0].focal, step.camera[0].offset
        parameters, K, R, Jc = to_fixed_tuple(step.parameters[i], count), part.K, part.R, step.camera_J
        moved, velocity, acceleration = obstacle_motion(part, step.time[0])
        for row in range(part.first, part.first + part.count):
            marker = step.seen[step.which[row]]
            u = focal[0] * marker.xy[0] - moved[0] + offset[0]
            v = focal[1] * marker.xy[1] - moved[1] + offset[1]
            u_dot, v_dot = focal[0] * marker.velocity[0] - velocity[0], focal[1] * marker.velocity[1] - velocity[1]
            u_ddot, v_ddot = focal[0] * marker.drift[0] - acceleration[0], focal[1] * marker.drift[1] - acceleration[1]
            # in the frame of the formula
            y, y_dot = turned_back_in_image(R, (u - part.t[0], v - part.t[1])), turned_back_in_image(R, (u_dot, v_dot))
            value, along_u, along_v = formula(*(y + parameters))
            if curvature is None:
                bent = differences_in_image(formula, parameters, y, y_dot)
            else:
                bent = curvature(*(y + parameters + y_dot))
            g = turned_in_image(R, (along_u, along_v))
            drift = bent + g[0] * u_ddot + g[1] * v_ddot
            write_row(address, row, K, value + part.margin, g[0] * u_dot + g[1] * v_dot, drift)
            a, b = interaction(K * g[0] * focal[0], K * g[1] * focal[1], marker.xy[0], marker.xy[1], marker.depth)
            for j in range(len(step.qd)):
                first, second = a[0] * Jc[0, j] + b[0] * Jc[3, j], a[1] * Jc[1, j] + b[1] * Jc[4, j]
                step.rows.Lg[row, j] = first + second + (a[2] * Jc[2, j] + b[2] * Jc[5, j])

    return rows
