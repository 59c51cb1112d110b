"""Claim 6: section 10, the experiments, simulated at the sampling time of the real ones."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from ...comparisons.run import Run
from ...comparisons.runs.spec import RunSpec
from ...robots.order_filter import OrderFilter
from ...rows import BoolArray
from ...rows.readable import amount
from ..verdicts import Finding, NotMeasured, claim, finding, plural
from .boundary import FULLY, clear, excess, greatest_sigma, unused

PBVS, IBVS = RunSpec("experiment-1-pbvs"), RunSpec("experiment-2-ibvs")


class Experiment(NamedTuple):
    """One of the two: its run without errors, and the kind of its visibility rows."""

    name: str
    exact: RunSpec
    kind: str

    @property
    def erroneous(self) -> RunSpec:
        """With the error (49) of the gradient."""
        return RunSpec(f"{self.exact.name}-gradient-error")

    @property
    def alone(self) -> RunSpec:
        """With ∇σ_e in L_gφ alone."""
        return RunSpec(self.erroneous.name, overrides={"disturbances.gradient_error_in_phi": False})


FIRST, SECOND = Experiment("experiment 1", PBVS, "fov"), Experiment("experiment 2", IBVS, "occlusion")

TEN_TIMES = {"task.Kp0": 6.0, "duration": 60.0}
FASTER_OF = tuple((experiment, Ts) for experiment in (FIRST, SECOND) for Ts in (0.1, 0.01))
FASTER = tuple(
    RunSpec(experiment.exact.name, overrides={**TEN_TIMES, "sampling_time": Ts}, may_end_early=True)
    for experiment, Ts in FASTER_OF
)

EXPONENTIAL = 1.1
"""Greatest speed towards the boundary relative to clearance / K, that of an exponential approach."""


def acting_rows(run: Run, kind: str) -> list[str]:
    """Rows of a kind that ever shape the command: with a wrong gradient their true φ may stay below zero."""
    return [label for label in run.labels(kind) if acts(run, label).any()]


def acts(run: Run, label: str) -> BoolArray:
    """(N,) when a row shapes the command."""
    return run.trajectory.active[:, run.index(label)]


def sliding_row(run: Run, kind: str) -> str:
    """The row that acts longest; raises NotMeasured where none acts."""
    acting = acting_rows(run, kind)
    if not acting:
        raise NotMeasured(f"no {kind} row ever acts")
    return max(acting, key=lambda label: int(acts(run, label).sum()))


def exponentially(run: Run, kind: str) -> Finding:
    """Whether the row that slides is approached no faster than with the time constant K, from when it acts on."""
    label = sliding_row(run, kind)
    at = np.flatnonzero(acts(run, label))
    while_acting = slice(at[0], at[-1] + 1)
    clearance = run.trajectory.clearance[while_acting, run.index(label)]
    speed, K = run.approach_speed(label)[while_acting], run.constraint(label).K
    fastest, unit = np.argmax(speed), run.unit(label)
    # a negative clearance is no approach at all: NaN, which is below nothing
    share = (speed * K / np.where(clearance > 0.0, clearance, np.nan)).max()
    text = (
        f"{label} acts from {run.t[at[0]]:.1f} to {run.t[at[-1]]:.1f} s; towards the boundary at most "
        f"{speed[fastest]:.2g} {unit}/s, {clearance[fastest]:.2g} {unit} before it: at most {share:.2g} clearance / K"
    )
    return finding(text, share <= EXPONENTIAL, share=share, speed=speed[fastest])


def one_marker_slides(run: Run, kind: str) -> Finding:
    """Which markers' rows act, and how much of the allowed space is left."""
    acting, row = acting_rows(run, kind), sliding_row(run, kind)
    least, share, sigma, times = clear(run, row), unused(run, row), greatest_sigma(run, row), run.t[acts(run, row)]
    text = (
        f"{', '.join(acting)} acts in {plural(len(times))} from {times[0]:.1f} to {times[-1]:.1f} s, at most "
        f"{np.diff(times).max(initial=0.0):.1f} s apart; max σ = {amount(sigma)}, {least:.2g} px from the boundary "
        f"({100.0 * share:.2g} % of L); the greatest φ is {excess(run, row):.2g} T_s u⁺"
    )
    kept = sigma <= 0.0 and least >= 0.0
    good = kept and len(acting) == 1 and share <= FULLY
    return finding(text, good, kept, margin=share, sigma_max=sigma, rows=len(acting))


def reached(run: Run) -> Finding:
    """How the run ends."""
    end = run.trajectory
    distance, angle = end.camera_error[-1]
    pose = f", {1e3 * distance:.2f} mm, {1e3 * angle:.2f} mrad" if np.isfinite(distance) else ""
    left = f"{end.feature_error_px[-1]:.2f} px{pose}"
    text = f"{end.status} after {run.settling_time:.0f} s; at the end {left} from the goal"
    return finding(text, end.status == "converged", settling=run.settling_time)


for experiment, slides, smooth, ends in ((FIRST, "6a", "6b", "6c"), (SECOND, "6e", "6f", "6g")):
    claim(slides, experiment.exact)(partial(one_marker_slides, kind=experiment.kind))
    claim(smooth, experiment.exact)(partial(exponentially, kind=experiment.kind))
    claim(ends, experiment.exact)(reached)


@claim("6l", *FASTER)
def _motion_must_be_slow(*runs: Run) -> Finding:
    """Ten times the gain at zero error, sampled as in the experiments and ten times as fast."""
    good, texts = [], []
    for run, (experiment, _) in zip(runs, FASTER_OF, strict=True):
        least = clear(run, *run.labels(experiment.kind))
        good.append(run.trajectory.status == "converged" and least >= 0.0)
        texts.append(
            f"{experiment.name}, T_s = {run.sampling_time:g} s: {run.trajectory.status}, {amount(least)} px clear"
        )
    slow = not good[0] and not good[2]
    return finding("; ".join(texts), slow and good[1] and good[3], slow)


@claim("6m", PBVS, IBVS)
def _integrated_twice(*runs: Run) -> Finding:
    """What is left of the changes of q and q̇ without the integrals of the commands."""
    places, speeds = [], []
    for run in runs:
        q, qd, qdd, Ts = run.trajectory.q, run.trajectory.qd, run.trajectory.qdd_command[:-1], run.sampling_time
        filtered = OrderFilter(q[0], qd[0], Ts)
        places.append(np.abs(np.diff(q, axis=0) - Ts * qd[:-1] - 0.5 * Ts**2 * qdd).max())
        places.append(np.abs([filtered.step(one) for one in qdd] - q[1:]).max())
        speeds.append(np.abs(np.diff(qd, axis=0) - Ts * qdd).max())
    most = max(places + speeds)
    return finding(f"up to {max(places):.2g} rad and {max(speeds):.2g} rad/s are left", most <= 1e-9, left=most)
