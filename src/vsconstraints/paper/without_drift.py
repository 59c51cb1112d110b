"""The paper's law with L_fφ taken away: shows that it is not needed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..controllers import Controller, SlidingMode
from ..rows import Command, Rows, Task


class WithoutDrift(Controller):
    """The sliding-mode law, told random numbers instead of L_fφ, where all second derivatives are."""

    name = "sliding-mode-without-drift"

    def __init__(self) -> None:
        self.law = SlidingMode()
        self.reset()

    def reset(self, period: float | None = None) -> None:
        """Start the random numbers again."""
        self.random = np.random.default_rng(0)

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class."""
        return self.law.command(replace(rows, Lf=self.random.normal(scale=100.0, size=rows.Lf.shape)), task)
