"""Appendices: claims 10e (proof, A) and 12a (computation time, B)."""

from __future__ import annotations

from math import isfinite, nan

import numpy as np

from ...comparisons.run import Run
from ...comparisons.runs.spec import RunSpec
from ..scenes import CASE, SECOND
from ..studies.pareto import MAX_EXCESS
from ..verdicts import Finding, NotMeasured, claim, finding

IN_MOTION = {
    "qd0": [0.0, 0.0, -3.0],
    "constraints.0.switching_gain": 100.0,
    "sampling_time": 0.001,
    "duration": 1.0,
}
#: First example with a camera that turns so fast at the start that φ of the second feature is
#: positive.
OUTSIDE = RunSpec("example-2d-fov", overrides=IN_MOTION)

PRINTED_TIME = 20e-6  #: Time of one iteration according to the paper [s].


@claim(
    "10e",
    OUTSIDE,
    where="App. A, (A.1) to (A.6)",
    sentence="if u⁺ fulfills (12) the Lyapunov function decays at a finite rate, and collective SM "
    "in the intersection of the constraints occurs after a finite time interval",
    rule="from φ > 0, with u⁺ above (12), φ < 0 is reached within φ(0) / (u⁺ − max L_fφ) and one "
    "sample, and φ ≤ 2 T_s u⁺ from then on; partly if it is reached at all",
)
def _reached_in_finite_time(run: Run) -> Finding:
    """Time at which φ first falls below zero, compared with the time by (A.6)."""
    phi = run.phi(SECOND)
    gain = run.bound(SECOND) / run.sampling_time
    Ts = run.sampling_time
    inside = np.flatnonzero(phi < 0.0)
    if phi[0] <= 0.0:
        raise NotMeasured(f"φ is {phi[0]:.3g} at the start, not above zero")
    if not len(inside):
        return finding(f"φ starts at {phi[0]:.3g} and never falls below zero", holds=False)
    first = inside[0]
    after = float(run.t[first])
    push = float(run.drift[:first, run.index(SECOND)].max())
    within = float(phi[0]) / (gain - push) if gain > push else nan
    later = phi[first:].max() / run.bound(SECOND)
    promised = f"within {1e3 * within:.3g} ms" if isfinite(within) else "never"
    text = (
        f"φ starts at {phi[0]:.3g}; u⁺ = {gain:g}, L_fφ up to {push:.3g}: "
        f"below zero after {1e3 * after:.3g} ms, promised {promised}; "
        f"then at most {later:.2f} T_s u⁺"
    )
    good = after <= within + Ts and later <= MAX_EXCESS
    return finding(text, holds=good, partly=True, after=after, within=within)


@claim(
    "12a",
    CASE,
    where="App. B",
    sentence="the computation time per iteration was around 20 microseconds for the case study "
    "(compiled C-MEX)",
    rule="median time of rows, task and law together: at most 20 µs; partly if at most half of "
    "T_s. Depends on the machine and on whether there is a compiler; measured while other runs use "
    "the other cores",
)
def _computation_time(case: Run) -> Finding:
    law = case.trajectory.step_time[1:]
    rows = case.trajectory.rows_time[1:]
    both = law + rows
    Ts = case.sampling_time
    median = np.median(both)
    missed = (both > Ts).sum()
    compiled = "compiled" if case.trajectory.compiled else "not compiled"
    text = (
        f"{compiled}: median {1e6 * median:.0f} µs, "
        f"law {1e6 * np.median(law):.0f} µs, rows and task {1e6 * np.median(rows):.0f} µs; "
        f"99 % below {1e6 * np.quantile(both, 0.99):.0f} µs; "
        f"{missed} of {len(both)} samples miss T_s = {1e3 * Ts:g} ms"
    )
    return finding(
        text,
        holds=median <= PRINTED_TIME,
        partly=median <= 0.5 * Ts,
        median=median,
        law=np.median(law),
        missed=missed,
    )
