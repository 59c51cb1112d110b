"""What is looked at before an arm moves at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import ConfigurationError
from ..simulation import Setup
from .driver import Joints
from .supervision import Supervision


def demand_start(setup: Setup, state: Joints, supervision: Supervision, from_arm: bool) -> Setup:
    """The setup with the start that the arm has.

    Parameters
    ----------
    setup
        The scenario's.
    state
        Where the arm is.
    supervision
        How near to the scenario's start that must be, and how nearly at rest.
    from_arm
        Whether it may start elsewhere.

    Raises
    ------
    ConfigurationError
        if it is elsewhere, moves, or cannot start there (:meth:`Setup.check_start`); if the scenario spoils gradients.
    """
    n = setup.scene.robot.n
    if state.q.shape != (n,) or state.qd.shape != (n,):
        raise ConfigurationError(f"the arm has {len(state.q)} joints, the scenario's robot {n}")
    if not (np.isfinite(state.q).all() and np.isfinite(state.qd).all()):
        raise ConfigurationError("the arm's state is not finite")
    if setup.gradient_error().any:
        raise ConfigurationError("disturbances.gradient_error is for simulations: an arm's law is told what is known")
    if setup.qd0.any():
        raise ConfigurationError("the scenario starts with joint speeds; an arm starts at rest")
    fast = np.abs(state.qd)
    if fast.max() > supervision.rest_rad_s:
        j = int(np.argmax(fast))
        raise ConfigurationError(f"the arm moves: joint {j + 1} at {state.qd[j]:.3g} rad/s; it must stand still")
    off = np.abs(state.q - setup.q0)
    if not from_arm and off.max() > supervision.start_rad:
        j = int(np.argmax(off))
        raise ConfigurationError(
            f"the arm does not stand at the scenario's start: joint {j + 1} is at {state.q[j]:.4g}, not at "
            f"{setup.q0[j]:.4g}, {off[j]:.3g} away. Move it there, or let the run start where it stands (--from-arm)"
        )
    here = replace(setup, q0=state.q.copy(), qd0=np.zeros(n))
    here.check_start()
    return here
