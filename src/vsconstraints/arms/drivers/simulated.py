"""Robot of the scenario, simulated in this process for dry runs.

It has the mass, friction and delays of the scenario, if any.
"""

from __future__ import annotations

import numpy as np

from ...errors import SceneError
from ...rows import Array
from ...simulation import Setup
from ..driver import Address, ArmError, Driver, Joints


class SimulatedArm(Driver):
    """Plant of the scenario, simulated faster than real time; no options.

    Its command is (q̇_c − q̇_c,last) / T_s.
    """

    real = False
    simulated_time = True
    watchdog = "simulated time stops without setpoints"

    def __init__(self, address: Address, setup: Setup) -> None:
        super().__init__(address, setup)
        address.require_none()
        self._plant = setup.plant()
        self._t = 0.0
        self._sent = setup.qd0.copy()

    def read(self) -> Joints:
        """Read the current joint state."""
        return Joints(self._t, self._plant.q, self._plant.qd)

    def send(self, q: Array, qd: Array) -> None:
        """Let a period pass."""
        try:
            self._plant.begin((qd - self._sent) / self.period)
            self._plant.step()
            self._plant.check()
        except SceneError as error:
            raise ArmError(str(error)) from error
        self._sent = np.array(qd)
        self._t = self._t + self.period

    def halt(self, deceleration: float) -> None:
        """Do nothing: the arm follows every setpoint and stops between setpoints."""
