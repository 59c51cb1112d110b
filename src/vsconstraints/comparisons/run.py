"""One run: its rows by label, its execution, and its record if it failed."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import chdir
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..constraints import Constraint
from ..errors import described
from ..plugins.processes import INTERRUPTS
from ..rows import Array
from ..simulation import Setup, Trajectory, intervals, until_settled
from .metrics import Score, score
from .record import RunRecord
from .runs.law_process import LawFailedError, LawRun, simulate_law
from .runs.spec import RunSpec

#: Active times of a row that are closer than this are merged into one interval [s], because φ
#: crosses zero repeatedly in a sliding mode.
MERGE = 0.6


@dataclass(frozen=True)
class Run:
    """A simulation: its setup and its record."""

    setup: Setup
    record: RunRecord

    @property
    def trajectory(self) -> Trajectory:
        """Trajectory of the simulation."""
        return self.record.trajectory

    @property
    def sampling_time(self) -> float:
        """Sampling time [s]."""
        return self.record.Ts

    @property
    def t(self) -> Array:
        """(N,) time [s]."""
        return self.trajectory.t

    @cached_property
    def score(self) -> Score:
        """Scores without a baseline: no row counts as challenged, and there is no utilization."""
        return score(self.record, None)

    @property
    def settling_time(self) -> float:
        """Time from the start of each goal until it is finally reached [s], summed over goals.

        NaN if the run does not converge.
        """
        return float(self.score.result["settling_time_s"])

    def index(self, label: str) -> int:
        """Return the index of a row; raises ValueError that names an unknown label."""
        return self.trajectory.labels.index(label)

    def labels(self, name: str) -> list[str]:
        """Return the labels of the rows that belong to a kind or entry.

        ``name`` is a kind (``"fov"``) or an entry whose sides are rows (``"range[joint 6]"``).
        """
        return [label for label in self.trajectory.labels if label.startswith(name)]

    def phi(self, label: str) -> Array:
        """Return φ of a row (N,)."""
        return self.trajectory.phi[:, self.index(label)]

    def sigma(self, label: str) -> Array:
        """Return σ of a row (N,); φ for rows without a σ."""
        return self.trajectory.sigma[:, self.index(label)]

    def row(self, label: str) -> Mapping[str, Any]:
        """Return the row's line of constraints.csv."""
        return self.score.constraints[self.index(label)]

    def bound(self, label: str) -> float:
        """Return T_s u⁺ of a row, eq. (43)."""
        return self.sampling_time * float(self.record.switching_gain[self.index(label)])

    def length(self, label: str) -> float:
        """Return the characteristic length of a row in its unit."""
        return float(self.record.length[self.index(label)])

    def unit(self, label: str) -> str:
        """Return the natural unit of a row's clearance."""
        return self.record.units[self.index(label)]

    def constraint(self, label: str) -> Constraint:
        """Return the constraint that a row belongs to; raises KeyError if no such row exists."""
        for constraint in self.setup.constraints.constraints:
            if label in constraint.labels(self.setup.scene):
                return constraint
        raise KeyError(label)

    def positive_samples(self, label: str) -> int:
        """Return the length of the longest series of samples with φ ≥ 0."""
        return round(float(self.row(label)["longest_positive_run_s"]) / self.sampling_time)

    def active_intervals(self, *labels: str, gap: float = MERGE) -> list[tuple[float, float]]:
        """Return the intervals in which φ ≥ 0 for any of these rows [s], with short gaps closed.

        See :meth:`.Trajectory.active_intervals` for what distinguishes them from
        :attr:`.Trajectory.active`.
        """
        rows = [self.index(label) for label in labels]
        is_active = self.trajectory.phi[:, rows] >= 0.0
        return intervals(self.t, np.asarray(is_active.any(axis=1)), gap)

    def ever_active(self, kind: str = "") -> list[str]:
        """Return the labels of the rows of a kind with φ ≥ 0 in any sample.

        They need not have held the arm back, as :attr:`.Trajectory.active` says.
        """
        return [label for label in self.labels(kind) if (self.phi(label) >= 0.0).any()]

    def while_sliding(self, label: str, gap: float = 0.1) -> Array:
        """Return φ of a row in its active intervals, from first to last sample of each."""
        inside = np.zeros(len(self.t), dtype=np.bool_)
        for first, last in self.active_intervals(label, gap=gap):
            inside |= (self.t >= first) & (self.t <= last)
        return self.phi(label)[inside]

    def approach_speed(self, label: str) -> Array:
        """Return the speed at which a row's clearance shrinks (N,) [its unit per second].

        It is averaged over five samples.
        """
        clearance = self.trajectory.clearance[:, self.index(label)]
        rate = np.gradient(clearance, self.sampling_time)
        averaging = np.ones(5) / 5.0
        speed: Array = -np.convolve(rate, averaging, mode="same")
        return speed

    @cached_property
    def drift(self) -> Array:
        """(N, m) max(L_fφ, 0) of the rows with φ ≥ 0, 0 for others.

        These are the terms of eq. (12) along this motion.
        """
        run = self.trajectory
        world = self.setup.world()
        drift = np.zeros_like(run.phi)
        has_active_row = (run.phi >= 0.0).any(axis=1)
        for k in np.flatnonzero(has_active_row):
            rows = world.evaluate(float(run.t[k]), run.q[k], run.qd[k]).rows
            outwards = np.maximum(rows.Lf, 0.0)
            drift[k] = np.where(rows.phi >= 0.0, outwards, 0.0)
        return drift

    def needed_gain(self) -> Array:
        """Return Σ max(L_fφ, 0) over the rows with φ ≥ 0 (N,).

        It is the right-hand side of eq. (12) along this motion.
        """
        needed: Array = self.drift.sum(axis=1)
        return needed

    def needed_share(self) -> Array:
        """Return Σ max(L_fφ, 0) / u⁺ over the rows with φ ≥ 0 (N,), each with its own u⁺.

        Eq. (12) requires it to be below 1.
        """
        share: Array = (self.drift / self.record.switching_gain).sum(axis=1)
        return share


def perform(
    spec: RunSpec,
    *,
    by_public_call: bool = False,
    to_the_goal: bool = False,
    in_own_process: bool = False,
) -> Run:
    """Execute a run; raises the errors of the scenario, the controller and the simulation.

    ``by_public_call`` is passed to :func:`.simulate`. With ``to_the_goal`` the run continues, see
    :func:`.until_settled`. With ``in_own_process`` the controller runs in a separate process, see
    :func:`.simulate_law`, which also documents the errors raised.
    """
    scenario = spec.load()
    # custom parts may change the working directory, and import neighbouring modules at any time
    with chdir("."), spec.controller.importing_beside(scenario.folder):
        setup = scenario.setup(spec.trial, spec.seed)
        if to_the_goal:
            setup = until_settled(setup)
        setup = spec.controller.run.of(setup)
        law_run = LawRun(spec, setup.time_limit, by_public_call, in_own_process)
        trajectory = simulate_law(law_run, setup)
        return Run(setup, RunRecord.of(setup, trajectory, spec.fingerprint))


def failed_record(error: BaseException) -> RunRecord:
    """Return the record of a run that ended with an error; raise the error if it is an interrupt.

    The record has no fingerprint. Any other error ends its own run only, even SystemExit.
    """
    if isinstance(error, INTERRUPTS):  # it concerns this process
        raise error
    reason = str(error) if isinstance(error, LawFailedError) else described(error)
    return RunRecord.failed(reason, "")


def failed_score(reason: str) -> Score:
    """Return the score of a run that failed without a trajectory."""
    return score(RunRecord.failed(reason, ""), None)
