"""Equivalent of a run with mass in eq. (6): a lag C of the command, and the disturbance d_c."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..rows import Array
from ..simulation.trajectory import Trajectory

LAGS = (0.0, *np.geomspace(1e-4, 0.3, 60))  #: Candidate time constants of C [s].


@dataclass(frozen=True)
class Equivalent:
    """Fit of q̈ = C q̈_c + d_c (eq. 6) to a run of N samples with n joints."""

    t: Array  #: (N − 1,) beginnings of the periods [s].
    #: (n,) time constant of the first-order lag C with the smallest d_c [s]; 0 if no lag reduces
    #: it.
    time_constant: Array
    disturbance: Array  #: (N − 1, n) d_c, averaged over each period [rad/s² or m/s²].

    @classmethod
    def of(cls, run: Trajectory) -> Equivalent:
        """Fit a run by the differences of its speeds.

        The arrays are empty, and the lags zero, if the run has fewer than two samples.
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
            is_better = squares < best
            best[is_better] = squares[is_better]
            left[:, is_better] = rest[:, is_better]
            lags[is_better] = lag
        return cls(run.t[:-1], lags, left)

    @property
    def rms(self) -> Array:
        """(n,) root mean square of d_c; zero for an empty fit."""
        rms: Array = np.sqrt((self.disturbance**2).sum(axis=0) / max(len(self.t), 1))
        return rms


def lagged(command: Array, lag: float, Ts: float) -> Array:
    """Return the mean (N, n) over each period of the lagged response to a held command (N, n).

    The response is of first order with time constant ``lag`` [s] and starts from 0.
    """
    if lag == 0.0:
        return command
    # imported here, because loading it takes longer than the rest of the package
    from scipy.signal import lfilter

    stays = np.exp(-Ts / lag)
    # ``before``: response at the beginning of a period; within a period u + (c − u) exp(−t/τ) is
    # averaged
    before: Array = lfilter([0.0, 1.0 - stays], [1.0, -stays], command, axis=0)
    mean: Array = command + (before - command) * (1.0 - stays) * lag / Ts
    return mean
