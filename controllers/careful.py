"""Tracking that brakes as much as needed to keep every row for one look ahead."""

from typing import Any

import numpy as np

from vsconstraints.controllers import Controller, Tracking
from vsconstraints.rows import Command, Rows, Task


class Careful(Controller):
    """Tracks, and brakes as much as needed to keep every row for one look ahead.

    Parameters
    ----------
    ahead
        Prediction horizon [s].
    """

    name = "careful"
    uses = ("model",)

    def __init__(self, *, ahead: float = 0.1):
        self.ahead = ahead
        self.tracking = Tracking()
        self.model: Any = None

    def reset(self, period: float | None = None, model: Any = None) -> None:
        self.model = model or self.model

    def solve(self, rows: Rows, task: Task) -> Command:
        command = self.tracking.solve(rows, task)
        t, q, qd = self.model.present
        after = self.ahead
        # tracking, half of it with half of braking, and braking
        share = np.array([[1.0], [0.5], [0.0]])
        qdd = share * command.qdd - (1.0 - share) * qd / after
        seen = self.model.along(
            np.full(3, t + after), q + after * qd + after**2 / 2 * qdd, qd + after * qdd
        )
        kept = np.flatnonzero((seen.phi <= 0.0).all(axis=1))
        command.qdd = qdd[kept[0] if len(kept) else 2]
        return command
