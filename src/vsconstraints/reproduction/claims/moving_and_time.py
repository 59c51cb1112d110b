"""Claims 11 and 12: moving obstacles and targets, and computation time."""

from __future__ import annotations

import numpy as np

from ...control_step import ControlStep
from ..runs import Run, RunSpec
from ..verdicts import Finding, claim, judged
from .boundary import signed
from .case_study import CASE

TARGET, OCCLUDER, SPHERE = (RunSpec(name) for name in ("moving-target", "moving-occluder", "moving-sphere"))
KNOWN = "constraints.0.motion.known"
"""Where both scenarios with obstacles say that their motion is known: without it the rows take them for static."""

ROUNDING = 1e-9
"""Differences below this are none."""

PRINTED_TIME = 20e-6
"""Time of one iteration that the paper gives [s]."""


@claim(
    "11a",
    "5.4",
    "the proposed approach can also be used if there are moving obstacles or a moving target object",
    "the unchanged law converges, its rows act, and max σ ≤ 0 for rows with a σ of their own, in all three scenarios; "
    "partly if in one",
    "",
    TARGET,
    OCCLUDER,
    SPHERE,
)
def moving_objects(*runs: Run) -> Finding:
    """A moving target, a moving occluder and a moving sphere."""
    texts, good = [], []
    for spec, run in zip((TARGET, OCCLUDER, SPHERE), runs, strict=True):
        rows = [label for label in run.trajectory.labels if not label.startswith("speed")]
        sigma = max(float(run.sigma(label).max()) for label in rows)
        acting = run.ever_active()
        texts.append(
            f"{spec.scenario}: {run.trajectory.status}, max σ = {signed(sigma)}, {', '.join(acting) or 'no row'} active"
        )
        good.append(run.trajectory.status == "converged" and sigma <= 0.0 and bool(acting))
    return Finding(judged(all(good), any(good)), "; ".join(texts))


@claim(
    "11b",
    "5.4",
    "only the value of the lower bound for the switching gain u⁺ is changed; the iterative computation of the "
    "algorithm remains the same",
    "while rows act, L_gφ is the same whether they know the motion or not, and Σ max(L_fφ, 0) is not; partly if φ = σ "
    "+ K σ̇ differs as well, since σ̇ contains ∂σ/∂t",
    "",
    OCCLUDER,
    SPHERE,
)
def only_the_bound_changes(*runs: Run) -> Finding:
    """Rows along the same motion with and without knowledge of the obstacle's."""
    texts, same, bound, equal = [], [], [], []
    for spec, run in zip((OCCLUDER, SPHERE), runs, strict=True):
        untold = RunSpec(spec.scenario, overrides=((KNOWN, False),)).load().setup()
        acting = np.flatnonzero((run.trajectory.phi >= 0.0).any(axis=1))
        needed, Lg, phi = np.zeros(2), 0.0, 0.0
        for k in acting:
            t, q, qd = float(run.t[k]), run.trajectory.q[k], run.trajectory.qd[k]
            told, _ = run.setup.constraints.rows(run.setup.scene.evaluate(t, q, qd))
            # what a controller sees that is not told of the motion
            blind, _ = untold.constraints.rows(untold.scene.believed(untold.scene.evaluate(t, q, qd)))
            active = told.phi >= 0.0
            needed = np.maximum(needed, [np.maximum(rows.Lf[active], 0.0).sum() for rows in (told, blind)])
            Lg = max(Lg, float(np.abs(told.Lg - blind.Lg).max()))
            phi = max(phi, float((np.abs(told.phi - blind.phi) * active).max()))
        with_it, without = map(float, needed)
        texts.append(
            f"{spec.scenario}: L_gφ differs by {Lg:.2g}; (12) asks for u⁺ > {with_it:.3g}, without ∂φ/∂t for "
            f"{without:.3g}; φ of active rows differs by up to {phi:.3g}, as σ̇ contains ∂σ/∂t"
        )
        same.append(Lg < ROUNDING)
        bound.append(abs(with_it - without) > ROUNDING)
        equal.append(phi < ROUNDING)
    rows_same, bounds = all(same), all(bound)
    return Finding(judged(rows_same and bounds and all(equal), rows_same and bounds), "; ".join(texts))


@claim(
    "12a",
    "App. B",
    "the computation time per iteration was around 20 microseconds for the case study (compiled C-MEX)",
    "median time of rows, task and law together: at most 20 µs; partly if at most half of T_s. Depends on the machine "
    "and on whether there is a compiler; measured while other runs use the other cores",
    "",
    CASE,
)
def computation_time(case: Run) -> Finding:
    """Wall times of the case study's samples, without the first."""
    step, rows = case.trajectory.step_time[1:], case.trajectory.rows_time[1:]
    both = step + rows
    median, law = float(np.median(both)), float(np.median(step))
    missed = int((both > case.sampling_time).sum())
    why = ControlStep(case.setup.scene, case.setup.constraints, case.setup.task).not_compiled
    text = (
        f"{f'NumPy form ({why})' if why else 'compiled'}: median {1e6 * median:.0f} µs, law {1e6 * law:.0f} µs, rows "
        f"and task {1e6 * float(np.median(rows)):.0f} µs; 99 % below {1e6 * float(np.quantile(both, 0.99)):.0f} µs; "
        f"{missed} of {len(both)} samples miss T_s = {1e3 * case.sampling_time:g} ms"
    )
    return Finding(
        judged(median <= PRINTED_TIME, median <= 0.5 * case.sampling_time),
        text,
        {"median": median, "law": law, "missed": float(missed)},
    )
