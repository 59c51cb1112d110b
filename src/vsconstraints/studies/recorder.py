"""A controller that notes what moves φ while another one commands."""

from __future__ import annotations

import numpy as np

from ..controllers import Controller
from ..controllers.tracking import RANK_TOLERANCE, track
from ..rows import Array, Command, Rows, Task


class DriftRecorder(Controller):
    """Answers as the controller it is given, and keeps what condition (12) is about, sample by sample.

    Parameters
    ----------
    controller
        Whose commands are carried out.
    """

    name = "drift-recorder"

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self.reset()

    def reset(self) -> None:
        """Forget everything noted, and what the controller remembers."""
        self._drift: list[Array] = []
        self._push: list[Array] = []
        self.controller.reset()

    def solve(self, rows: Rows, task: Task) -> Command:
        """The controller's command."""
        self._drift.append(rows.Lf)
        self._push.append(rows.Lf + rows.Lg @ track(task, RANK_TOLERANCE))
        return self.controller.command(rows, task)

    def drift(self, samples: int) -> Array:
        """(N, m) L_fφ in the first N samples [units of φ per second]: how φ moves without any command."""
        return _stacked(self._drift, samples)

    def push(self, samples: int) -> Array:
        """(N, m) L_fφ + L_gφ q̈ with the tracking command [units of φ per second]: how φ moves while inactive."""
        return _stacked(self._push, samples)


def _stacked(parts: list[Array], samples: int) -> Array:
    return np.array(parts[:samples]) if samples else np.empty((0, 0))
