"""An own controller and an own constraint, named in own-parts.toml and own-scenario.toml as cautious:…"""

import numpy as np

from vsconstraints.constraints import ImageConstraint
from vsconstraints.controllers import Controller, Tracking
from vsconstraints.rows import Command, Rows, Task


class Cautious(Controller):
    """Tracks, but slows down where a row comes close to its boundary."""

    name = "cautious"

    def __init__(self, *, distance: float = 0.3):
        self.distance = distance
        self.tracking = Tracking()

    def solve(self, rows: Rows, task: Task) -> Command:
        free = self.tracking.solve(rows, task)
        near = rows.phi > -self.distance * rows.scale
        worst = (rows.phi / rows.scale).max(initial=-np.inf)
        share = float(np.clip(-worst / self.distance, 0.0, 1.0))
        return Command(share * free.qdd, "ok", near, rows.labels)


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
