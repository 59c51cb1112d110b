"""The README's law: tracking, corrected by one row after another."""

import numpy as np

from vsconstraints.controllers import Controller, Tracking
from vsconstraints.rows import Command, Rows, Task


class Cautious(Controller):
    """Tracks, but holds the rows near their boundary to φ̇ ≤ −rate φ, one after another."""

    name = "cautious"

    def __init__(self, *, distance: float = 0.3, rate: float = 10.0):
        self.distance = distance
        self.rate = rate
        self.tracking = Tracking()

    def solve(self, rows: Rows, task: Task) -> Command:
        qdd = self.tracking.solve(rows, task).qdd
        near = rows.phi > -self.distance * rows.scale
        # several times: the correction of one row may violate another one
        for i in np.tile(np.flatnonzero(near), 10):
            excess = rows.Lf[i] + rows.Lg[i] @ qdd + self.rate * rows.phi[i]
            if excess > 0.0:
                qdd = qdd - excess * np.linalg.pinv(rows.Lg[[i]])[:, 0]
        return Command(qdd, "ok", near, rows.labels)
