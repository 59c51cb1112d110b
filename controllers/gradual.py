"""Sliding mode with gradual braking inside a region before the boundary."""

import numpy as np

from vsconstraints.controllers import Controller, Tracking
from vsconstraints.controllers.task_priority import prioritise
from vsconstraints.rows import Command, Rows, Task


class Gradual(Controller):
    """Priority for the rows that tracking makes worse; the demand grows towards the boundary.

    Parameters
    ----------
    region
        Width of the braking zone, as a fraction of each row's allowed range.
    """

    name = "gradual"

    def __init__(self, *, region: float = 0.1):
        self.region = region
        self.tracking = Tracking()

    def solve(self, rows: Rows, task: Task) -> Command:
        free = rows.Lg @ self.tracking.solve(rows, task).qdd
        share = np.clip(1.0 + rows.phi / (self.region * rows.scale), 0.0, 1.0)
        acts = (share > 0.0) & (free + rows.Lf > 0.0) | (rows.phi >= 0.0)
        demand = (1.0 - share) * free - share * rows.switching_gain
        return prioritise(rows, task, acts, demand, rank_tolerance=1e-6)
