"""The rows of a constraint that is linear in the joint coordinates."""

from __future__ import annotations

from collections.abc import Callable

from .parts import load_step
from .row import write_row


def template() -> Callable[[int, int], None]:
    """Make the function that writes the rows of a constraint, by its number among the parts of a step at an address."""

    def rows(address: int, i: int) -> None:
        step = load_step(address)
        part = step.parts[i]
        for row in range(part.first, part.first + part.count):
            value, rate, g = step.offsets[row], 0.0, step.gradients[row]
            for j in range(len(g)):
                value += g[j] * step.q[j]
                rate += g[j] * step.qd[j]
                step.rows.Lg[row, j] = part.K * g[j]
            write_row(address, row, part.K, value, rate, 0.0)

    return rows
