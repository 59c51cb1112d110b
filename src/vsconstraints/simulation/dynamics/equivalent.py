"""What a run with a mass amounted to in eq. (6): a lag C of the command, and d_c beside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...rows import Array
from ..trajectory import Trajectory

LAGS = (0.0, *np.geomspace(1e-4, 0.3, 60))  #: Time constants that C is sought among [s].


@dataclass(frozen=True)
class Equivalent:
    """q̈ = C q̈_c + d_c (eq. 6) of a run of N samples with n joints."""

    t: Array  #: (N − 1,) beginnings of the periods [s].
    #: (n,) of the first-order lag C that leaves the least of d_c [s]; 0 where none does better.
    time_constant: Array
    disturbance: Array  #: (N − 1, n) d_c, in the mean of each period [rad/s² or m/s²].

    @classmethod
    def of(cls, run: Trajectory) -> Equivalent:
        """What a run shows by the differences of its speeds; nothing if it has fewer than two
        samples.
        """
        n = run.qd.shape[1]
        if len(run.t) < 2:
            return cls(np.empty(0), np.zeros(n), np.empty((0, n)))
        Ts = run.t[1] - run.t[0]
        applied = np.diff(run.qd, axis=0) / Ts
        command = run.qdd_command[:-1]
        best = np.full(n, np.inf)
        left = applied - command
        lags = np.zeros(n)
        for lag in LAGS:
            rest = applied - lagged(command, lag, float(Ts))
            squares = (rest**2).sum(axis=0)
            better = squares < best
            best = np.where(better, squares, best)
            left = np.where(better, rest, left)
            lags = np.where(better, lag, lags)
        return cls(run.t[:-1], lags, left)

    @property
    def rms(self) -> Array:
        """(n,) root mean square of d_c; zeros where there is none."""
        rms: Array = np.sqrt((self.disturbance**2).sum(axis=0) / max(len(self.t), 1))
        return rms


def lagged(command: Array, lag: float, Ts: float) -> Array:
    """(N, n) mean over each period of what follows a held command (N, n) with that time constant,
    at first from 0.
    """
    if lag == 0.0:
        return command
    from scipy.signal import lfilter  # takes longer to load than the rest of the package together

    stays = np.exp(-Ts / lag)
    # at the beginnings of periods; within one, the mean of u + (c − u) exp(−t/τ)
    before: Array = lfilter([0.0, 1.0 - stays], [1.0, -stays], command, axis=0)
    mean: Array = command + (before - command) * (1.0 - stays) * lag / Ts
    return mean
