"""The rows of a constraint that is linear in the joint speeds: φ itself, which no q̈ = 0 changes."""

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
            value, g = step.offsets[row], step.gradients[row]
            for j in range(len(g)):
                value += g[j] * step.qd[j]
                step.rows.Lg[row, j] = g[j]
            write_row(address, row, 0.0, value, 0.0, 0.0)

    return rows
