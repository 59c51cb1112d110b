"""Rows of a funnel of markers in the image: see :class:`vsconstraints.constraints.PerformanceFunnel`."""

from __future__ import annotations

from collections.abc import Callable

from ..formulas.features import image_row
from .funnel import funnel_now
from .parts import load_step
from .row import write_row


def template() -> Callable[[int, int], None]:
    """Make the function that writes the rows of a constraint, by its number among the parts of a step at an address."""

    def rows(address: int, i: int) -> None:
        step = load_step(address)
        part, J, wanted = step.parts[i], step.camera_J, step.parameters[i]
        at, width, rate, bend = funnel_now(wanted, step.time[0], 2 * len(step.seen))
        for row in range(part.first, part.first + part.count):
            entry, side = step.which[row], step.offsets[row]
            marker, c = step.seen[entry // 2], entry % 2
            slope = side * step.camera[0].focal[c]
            write_row(
                address,
                row,
                part.K,
                side * (step.pixels[entry // 2, c] - wanted[at + entry]) - width,
                slope * marker.velocity[c] - rate,
                slope * marker.drift[c] - bend,
            )
            now = image_row(c, marker.xy[0], marker.xy[1], marker.depth)
            for j in range(J.shape[1]):
                along = 0.0
                for k in range(3):
                    along += now[k] * J[k, j] + now[3 + k] * J[3 + k, j]
                step.rows.Lg[row, j] = part.K * slope * along

    return rows
