"""Claims 11 and 12: moving obstacles and targets, and computation time."""

from __future__ import annotations

import numpy as np

from ...comparisons.run import Run
from ...comparisons.runs.spec import RunSpec
from ...compiled.control_step import ControlStep
from ...rows.readable import amount
from ..verdicts import Finding, claim, finding
from .boundary import greatest_sigma, with_sigma
from .case_study import CASE

TARGET, OCCLUDER, SPHERE = (RunSpec(name) for name in ("moving-target", "moving-occluder", "moving-sphere"))
KNOWN = "constraints.0.motion.known"
"""Where both scenarios with obstacles say that their motion is known: without it the rows take them for static."""

ROUNDING = 1e-9
"""Differences below this are none."""

PRINTED_TIME = 20e-6
"""Time of one iteration that the paper gives [s]."""


@claim("11a", TARGET, OCCLUDER, SPHERE)
def _moving_objects(*runs: Run) -> Finding:
    texts, good = [], []
    for spec, run in zip((TARGET, OCCLUDER, SPHERE), runs, strict=True):
        sigma, acting, status = (
            greatest_sigma(run, *with_sigma(run.trajectory.labels)),
            run.ever_active(),
            run.trajectory.status,
        )
        texts.append(f"{spec.name}: {status}, max σ = {amount(sigma)}, {', '.join(acting) or 'no row'} active")
        good.append(status == "converged" and sigma <= 0.0 and bool(acting))
    return finding("; ".join(texts), all(good), any(good))


@claim("11b", OCCLUDER, SPHERE)
def _only_the_bound_changes(*runs: Run) -> Finding:
    """Rows along the same motion with and without knowledge of the obstacle's."""
    texts, same, equal = [], [], []
    for spec, run in zip((OCCLUDER, SPHERE), runs, strict=True):
        untold = RunSpec(spec.name, overrides={KNOWN: False}).load().setup()
        needed, Lg, phi = np.zeros(2), 0.0, 0.0
        for k in np.flatnonzero((run.trajectory.phi >= 0.0).any(axis=1)):
            t, q, qd = float(run.t[k]), run.trajectory.q[k], run.trajectory.qd[k]
            told, _ = run.setup.constraints.rows(run.setup.scene.evaluate(t, q, qd))
            # what a controller sees that is not told of the motion
            blind, _ = untold.constraints.rows(untold.scene.believed(untold.scene.evaluate(t, q, qd)))
            active = told.phi >= 0.0
            needed = np.maximum(needed, [np.maximum(rows.Lf[active], 0.0).sum() for rows in (told, blind)])
            Lg = max(Lg, np.abs(told.Lg - blind.Lg).max())
            phi = max(phi, (np.abs(told.phi - blind.phi) * active).max())
        with_it, without = needed
        texts.append(
            f"{spec.name}: L_gφ differs by {Lg:.2g}; (12) asks for u⁺ > {with_it:.3g}, without ∂φ/∂t for "
            f"{without:.3g}; φ of active rows differs by up to {phi:.3g}, as σ̇ contains ∂σ/∂t"
        )
        same.append(Lg < ROUNDING and abs(with_it - without) > ROUNDING)
        equal.append(phi < ROUNDING)
    return finding("; ".join(texts), all(same) and all(equal), all(same))


@claim("12a", CASE)
def _computation_time(case: Run) -> Finding:
    """Wall times of the case study's samples, without the first."""
    step, rows = case.trajectory.step_time[1:], case.trajectory.rows_time[1:]
    both = step + rows
    median, law, missed = float(np.median(both)), float(np.median(step)), int((both > case.sampling_time).sum())
    why = ControlStep(case.setup.scene, case.setup.constraints, case.setup.task).not_compiled
    text = (
        f"{f'NumPy form ({why})' if why else 'compiled'}: median {1e6 * median:.0f} µs, law {1e6 * law:.0f} µs, rows "
        f"and task {1e6 * np.median(rows):.0f} µs; 99 % below {1e6 * np.quantile(both, 0.99):.0f} µs; "
        f"{missed} of {len(both)} samples miss T_s = {1e3 * case.sampling_time:g} ms"
    )
    in_time = median <= PRINTED_TIME, median <= 0.5 * case.sampling_time
    return finding(text, *in_time, median=median, law=law, missed=missed)
