"""What a policy sees of a sample: rows, task and joints as numbers between -1 and 1."""

from __future__ import annotations

import numpy as np

from ..rows import Array, Rows, Task

ACCELERATION = 10.0  #: a of a scene that states no limit [rad/s² or m/s²].


class Observer:
    """Makes observations of a scene's samples, with a (n,) the acceleration that an action of 1 stands for.

    An observation has 2 m + m n + k n + k + 2 n numbers for m rows, n joints and k features: φ/s, L_fφ/s and L_gφ a/s
    with the scale s of each row, the last row by row; J a/‖J a‖ row by row and b/‖J a‖; q from the middle of its range
    by half of it, and q̇ by the greatest speed, both as they are where there is no limit. Of each number x it holds
    x/(1 + |x|).

    Parameters
    ----------
    scale
        (m,) of the rows.
    acceleration
        (n,) limits of |q̈| that are known, infinite where there is none: there, ``otherwise`` counts.
    ranges
        See :attr:`vsconstraints.robots.Robot.ranges`.
    otherwise
        [rad/s² or m/s²].
    """

    def __init__(
        self, scale: Array, acceleration: Array, ranges: tuple[Array, Array, Array], otherwise: float = ACCELERATION
    ) -> None:
        low, high, speed = ranges
        self.action = np.where(np.isfinite(acceleration), acceleration, otherwise)
        limited = np.isfinite(low) & np.isfinite(high) & (low < high)
        self._middle = np.where(limited, 0.5 * (np.where(limited, low, 0.0) + np.where(limited, high, 0.0)), 0.0)
        half = np.where(limited, high - self._middle, 1.0)
        self._of_rows = np.concatenate((1.0 / scale, 1.0 / scale, (self.action / scale[:, None]).ravel()))
        self._of_joints = np.concatenate((1.0 / half, 1.0 / np.where(np.isfinite(speed), speed, 1.0)))

    def __call__(self, rows: Rows, task: Task, q: Array, qd: Array) -> Array:
        """The observation of rows and task at q and q̇ (n,)."""
        seen_rows = np.concatenate((rows.phi, rows.Lf, rows.Lg.ravel())) * self._of_rows
        Ja = (task.J * self.action).ravel()
        seen_task = np.concatenate((Ja, task.b)) / (float(Ja @ Ja) ** 0.5 or 1.0)
        seen_joints = np.concatenate((q - self._middle, qd)) * self._of_joints
        x = np.concatenate((seen_rows, seen_task, seen_joints))
        observation: Array = x / (1.0 + np.abs(x))
        return observation
