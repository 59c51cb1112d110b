"""Claim 6 (section 10): the experiments, simulated at their sampling time.

They are simulated without and with errors in the gradient.
"""

from __future__ import annotations

import numpy as np

from ...comparisons.run import Run
from ...comparisons.runs.spec import RunSpec
from ...robots.order_filter import OrderFilter
from ...rows import BoolArray
from ..studies import StudyResult
from ..studies.unselected_experiments import KINDS
from ..verdicts import Finding, NotMeasured, claim, finding, judged, register_formulas, worded
from . import boundary
from .boundary import FULLY, clear, excess, greatest_sigma, number, unused

PBVS, IBVS = map(RunSpec, KINDS)
#: Runs with the error (49) of the gradient.
PBVS_ERROR, IBVS_ERROR = (RunSpec(f"{scenario}-gradient-error") for scenario in KINDS)
#: Runs with ten times the gain at zero error, at the sampling time of the experiments and at a
#: tenth of it.
FASTER = tuple(
    RunSpec(
        scenario,
        overrides={"task.Kp0": 6.0, "duration": 60.0, "sampling_time": Ts},
        may_end_early=True,
    )
    for scenario in KINDS
    for Ts in (0.1, 0.01)
)
PBVS_TEN, PBVS_TEN_FASTER, IBVS_TEN, IBVS_TEN_FASTER = FASTER

#: Greatest speed towards the boundary relative to clearance / K; an exponential approach has 1.
EXPONENTIAL = 1.1

#: Cases of the study of unselected scenes: (49) as printed, with reversed signs, and in L_gφ alone.
CASES = ("plus", "minus", "plus-action")
SCENES = 100  #: Fewest unselected scenes for which a share is computed.
#: Shares of the unselected scenes above which a sentence holds, and above which it holds partly.
NEARLY_ALL = 0.95
MOST = 0.5

UNSELECTED = "unselected-experiments"


def acting_rows(run: Run, kind: str) -> list[str]:
    """Rows of a kind that ever shape the command.

    With a wrong gradient their true φ may stay below zero.
    """
    return [label for label in run.labels(kind) if acts(run, label).any()]


def acts(run: Run, label: str) -> BoolArray:
    """Mask (N,) of the samples in which a row shapes the command."""
    return run.trajectory.active[:, run.index(label)]


def sliding_row(run: Run, kind: str) -> str:
    """Return the row that is active longest; raises NotMeasured if none is active."""
    acting = acting_rows(run, kind)
    if not acting:
        raise NotMeasured(f"no {kind} row ever acts")
    return max(acting, key=lambda label: int(acts(run, label).sum()))


def passes(run: Run, kind: str) -> bool:
    """True if the run reaches the goal and no row of a kind is violated."""
    return run.trajectory.status == "converged" and clear(run, *run.labels(kind)) >= 0.0


def exponentially(run: Run, kind: str) -> Finding:
    """Finding that the sliding row is approached no faster than with the time constant K.

    Only times from the row's first activity on count.
    """
    label = sliding_row(run, kind)
    at = np.flatnonzero(acts(run, label))
    while_acting = slice(at[0], at[-1] + 1)
    clearance = run.trajectory.clearance[while_acting, run.index(label)]
    speed = run.approach_speed(label)[while_acting]
    K = run.constraint(label).K
    # a negative clearance gives NaN, which fails every comparison
    share = (speed * K / np.where(clearance > 0.0, clearance, np.nan)).max()
    shown = {
        "label": label,
        "times": run.t[at],
        "unit": run.unit(label),
        "clearance": clearance[speed.argmax()],
    }
    return finding(
        "exponentially", share <= EXPONENTIAL, False, shown, share=share, speed=speed.max()
    )


def one_marker_slides(run: Run, kind: str) -> Finding:
    """Finding that one marker's row is active, with the share of the allowed space that is left."""
    acting = acting_rows(run, kind)
    row = sliding_row(run, kind)
    least = clear(run, row)
    share = unused(run, row)
    sigma = greatest_sigma(run, row)
    times = run.t[acts(run, row)]
    kept = sigma <= 0.0 and least >= 0.0
    good = kept and len(acting) == 1 and share <= FULLY
    apart = np.diff(times).max(initial=0.0)
    shown = {
        "acting": acting,
        "times": times,
        "apart": apart,
        "clear": least,
        "excess": excess(run, row),
    }
    return finding(
        "one_marker_slides", good, kept, shown, margin=share, sigma_max=sigma, rows=len(acting)
    )


def reached(run: Run) -> Finding:
    """Finding on how the run ends."""
    end = run.trajectory
    values = {"settling": run.settling_time}
    posed = np.isfinite(end.camera_error[-1, 0])
    return finding(
        "reached", end.status == "converged", False, {"end": end, "posed": posed}, **values
    )


@claim("6m", PBVS, IBVS)
def _integrated_twice(*runs: Run) -> Finding:
    """Remainder of the changes of q and q̇ after subtracting the integrals of the commands."""
    places = []
    speeds = []
    for run in runs:
        q = run.trajectory.q
        qd = run.trajectory.qd
        qdd = run.trajectory.qdd_command[:-1]
        Ts = run.sampling_time
        filtered = OrderFilter(q[0], qd[0], Ts)
        places.append(np.abs(np.diff(q, axis=0) - Ts * qd[:-1] - 0.5 * Ts**2 * qdd).max())
        places.append(np.abs([filtered.step(one) for one in qdd] - q[1:]).max())
        speeds.append(np.abs(np.diff(qd, axis=0) - Ts * qdd).max())
    most = max(places + speeds)
    return finding(
        "6m", most <= 1e-9, False, {"places": max(places), "speeds": max(speeds)}, left=most
    )


def in_unselected(study: StudyResult, scenario: str, what: str) -> Finding:
    """Finding that an error of the gradient changes little in shipped and unselected scenes."""
    counts, scenes = (
        [number(study, scenario, case, name) for case in CASES] for name in (what, "scenes")
    )
    if min(scenes) < SCENES:
        raise NotMeasured(
            f"the study {UNSELECTED} has {min(scenes):.0f} scenes of {scenario}, fewer than "
            f"{SCENES}"
        )
    for case, N in zip(CASES, scenes, strict=True):
        in_shipped = number(study, scenario, case, "shipped", "applied")
        if number(study, scenario, case, "applied") < NEARLY_ALL * N or not in_shipped:
            raise NotMeasured(
                f"the error of the gradient changes nothing in {scenario} ({case}): was it applied?"
            )
    plus, minus, alone = (x / N for x, N in zip(counts, scenes, strict=True))
    both = min(plus, minus)
    here = number(study, scenario, CASES[0], "shipped", what) == 1.0
    shown = {
        "here": here,
        "of": [f"{x:.0f} of {N:.0f}" for x, N in zip(counts, scenes, strict=True)],
    }
    names = ("track_px", "speed_share", "clearance_share")
    values = {name: number(study, scenario, CASES[0], "shipped", name) for name in names}
    shown["alone"] = {name: number(study, scenario, CASES[2], "shipped", name) for name in names}
    good = here and both >= NEARLY_ALL
    part = max(both, alone) >= MOST
    text = f"{worded('unselected', **shown)}. {worded(what, **shown, **values)}"
    return Finding(judged(good, part), text, values)


register_formulas(vars(boundary) | globals())
