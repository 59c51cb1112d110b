"""Mechanics of an arm by Pinocchio, where nothing is compiled.

Compiled code cannot call Pinocchio: :mod:`vsconstraints.compiled.dynamics` computes the same there, and
``test_inertia_and_bias_are_pinocchios`` in ``tests/test_dynamics.py`` holds the pair together.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ...compiled.arm import Arm, BodyArrays, Motion
from ...compiled.arm_motion import factor, substep
from ...rows import Array

if TYPE_CHECKING:
    from .plant import DynamicPlant


class PinocchioEngine:
    """Inertia and bias of a plant's bodies by Pinocchio."""

    def __init__(self, plant: DynamicPlant) -> None:
        self._believed = plant.arm.believed
        self._models = tuple((model, model.createData()) for model in (plant.model, plant.believed))

    def evaluate(self, bodies: BodyArrays, q: Array, qd: Array, motion: Motion) -> None:
        """See :class:`vsconstraints.compiled.arm.Engine`."""
        model, data = self._models[bodies is self._believed]
        motion.M[:] = np.triu(pin.crba(model, data, q)).T
        motion.bias[:] = pin.nonLinearEffects(model, data, q, qd)
        factor(motion.M, motion.L)

    def move(self, arm: Arm, q: Array, qd: Array, command: Array) -> None:
        """See :class:`vsconstraints.compiled.arm.Engine`."""
        substep(self, arm, q, qd, command)
