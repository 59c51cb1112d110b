"""An own controller and an own constraint, named in own-parts.toml and own-scenario.toml as
cautious:…
"""

import numpy as np

from vsconstraints.constraints import ImageConstraint
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
        # several times: what one row gets may be another's
        for i in np.tile(np.flatnonzero(near), 10):
            excess = rows.Lf[i] + rows.Lg[i] @ qdd + self.rate * rows.phi[i]
            if excess > 0.0:
                qdd = qdd - excess * np.linalg.pinv(rows.Lg[[i]])[:, 0]
        return Command(qdd, "ok", near, rows.labels)


class Horizon(ImageConstraint):
    """Keeps every marker below a line in the image: σ = (line − v) / 100 ≤ 0."""

    kind = "horizon"

    def __init__(self, *, line: float, K: float, switching_gain: float):
        super().__init__(K=K, switching_gain=switching_gain, length=100.0)
        self.line = line

    def sigma(self, y):
        return (self.line - y[..., 1]) / 100.0

    def gradient(self, y):
        return np.broadcast_to([0.0, -0.01], y.shape)
