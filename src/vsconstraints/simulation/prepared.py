"""What runs of a setup compute with, whatever controller comes: made once, for one run after the other."""

from __future__ import annotations

import numpy as np

from ..compiled.control_step import ControlStep
from ..controllers import Tracking
from ..controllers.compiled import BoundLaw
from .setup import Setup


class Prepared:
    """The control steps of a setup, and tracking alone beside them.

    Runs follow one another: each begins with :meth:`restart`, which forgets the one before. Own constraints and laws
    may leave more behind than that.

    Attributes
    ----------
    setup
        What is simulated.
    control, world
        The step that the control takes, and the one that says what is true: the same where nothing is disturbed.
    gradient_error
        What spoils the rows' gradients.
    baseline, alone
        Tracking alone and, where steps are compiled, its law on the arrays of the control's.
    bound, true
        Both steps on arrays that stay where they are; None where anything runs in NumPy.
    """

    def __init__(self, setup: Setup) -> None:
        self.setup, self.control, self.gradient_error = setup, setup.control(), setup.gradient_error()
        # what is kept is what is true; where nothing is disturbed, that is what the control believes
        self.world, sensor = self.control, setup.sensor()
        if sensor.disturbed or self.gradient_error.any:
            self.world = ControlStep(setup.scene, setup.constraints, setup.task, known=True)
        self.baseline = Tracking()
        self.bound, self.true = self.control.bound(), self.world.bound()
        self.alone: BoundLaw | None = None
        if self.bound is not None:
            size, now = self.bound.packed.size, self.bound.now
            self.alone = self.baseline.bind(now.rows, now.task, np.empty(size.m, dtype=np.bool_), np.empty(size.n))

    def restart(self) -> None:
        """Begin a new run."""
        for step in (self.control, self.world):
            step.reset()
