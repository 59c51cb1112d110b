"""How near rows, and the joints' own limits, are to their boundary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...rows import Array
from ...simulation import Setup
from .moments import Moment

NEAR = 0.9
"""Usage 1 − clearance/L from which a row counts as near: 1 is on its boundary."""


@dataclass(frozen=True)
class Row:
    """How near a row, or a joint's own limit, is to its boundary in each moment.

    Attributes
    ----------
    label, unit
        Its name, and that of its distances.
    phi, clearance
        (k,) in each moment; φ is NaN of a limit that is no row.
    usage
        (k,) 1 − clearance/L: 1 is on the boundary, more is outside.
    """

    label: str
    unit: str
    phi: Array
    clearance: Array
    usage: Array

    @property
    def limit(self) -> bool:
        """Whether it is no row, but a limit of a joint."""
        return bool(np.isnan(self.phi).all() and self.label.startswith("limit["))

    @property
    def greatest(self) -> float:
        """The usage where it is greatest; minus infinity where it is not known."""
        return float(np.nan_to_num(self.usage, nan=-np.inf).max())

    def said(self, k: int) -> str:
        """The distance to the boundary in a moment, and φ in brackets."""
        if np.isnan(self.clearance[k]):
            return "not known"
        phi = "" if np.isnan(self.phi[k]) else f" ({self.phi[k]:.3g})"
        return f"{self.clearance[k]:.3g} {self.unit}{phi}".replace("-", "−")


def rows_of(setup: Setup, moments: Sequence[Moment]) -> list[Row]:
    """All rows, and the limits of joints that no row is about."""
    constraints, robot = setup.constraints, setup.scene.robot
    phi, clearance = (np.array([getattr(moment, what) for moment in moments]) for what in ("phi", "clearance"))
    usage = 1.0 - clearance / constraints.characteristic_length
    found = [
        Row(label, constraints.units[i], phi[:, i], clearance[:, i], usage[:, i])
        for i, label in enumerate(constraints.labels)
    ]
    limits = np.array([moment.limits for moment in moments])
    half = 0.5 * (robot.q_max - robot.q_min)
    for i, side in enumerate(("lower", "upper")):
        for j in np.flatnonzero(np.isfinite(half)):
            if f"range[joint {j + 1}].{side}" not in constraints.labels:
                away = limits[:, i * robot.n + j]
                unit = "m" if robot.prismatic[j] else "rad"
                label = f"limit[joint {j + 1}].{side}"
                found.append(Row(label, unit, np.full(len(moments), np.nan), away, 1.0 - away / half[j]))
    return found
