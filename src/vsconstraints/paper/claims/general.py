"""Claims 7 to 11, measured on sweeps, on scenes with the paper's law, or with moving objects."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import pairwise
from math import inf, isfinite, nan
from typing import Any

import numpy as np

from ...comparisons.run import Run
from ...comparisons.runs.spec import ControllerSpec, RunSpec
from ...controllers import Controller, SlidingMode
from ...rows import Command, Rows, Task
from ..studies import StudyResult
from ..studies.laws import MAX_EXCESS, MAX_POSITIVE_SAMPLES
from ..studies.tables import about
from ..verdicts import Finding, NotMeasured, Verdict, claim, finding, judged
from .boundary import clear, ending, excess, greatest_sigma, number, with_sigma
from .experiments import FASTER
from .simulations import CASE, FOV, SECOND

WITHOUT_DRIFT = ControllerSpec("vsconstraints.paper.claims.general:WithoutDrift")
BLIND = tuple(RunSpec(spec.name, WITHOUT_DRIFT) for spec in (FOV, CASE))
TARGET, OCCLUDER, SPHERE = (
    RunSpec(name) for name in ("moving-target", "moving-occluder", "moving-sphere")
)
#: Key by which both scenarios with obstacles state that the motion is known; if it is not, the rows
#: take the obstacles for static.
KNOWN = "constraints.0.motion.known"
ROUNDING = 1e-9  #: Differences below this are due to rounding.

SCENARIOS = ("example-2d-fov", "case-study-6r")
SLIDING = "sliding-mode"
FIELDS = ("potential-field", "potential-field-priority")
SLIGHT = 1.0  #: Greatest violation that counts as slight [% of the characteristic length].
FULLY_USED = 1.0  #: Greatest unused space that counts as fully used [%].
#: Actuator limits are removed, because the claims assume that commands are carried out.
UNLIMITED: dict[str, dict[str, Any]] = {
    "ur5-fov": {"limits": {}},
    "panda-fov": {"limits": {}, "constraints.0.switching_gain": 20.0},
}
#: Scenes of the paper, and others with the same law and no disturbance.
SCENES = tuple(
    RunSpec(name, overrides=UNLIMITED.get(name, {}))
    for name in (
        *("example-2d-fov", "example-2d-fast", "example-2d-fast-high-gain", "example-2d-bowl"),
        *(
            "example-2d-heart-convex",
            "example-2d-heart-concave",
            "case-study-6r",
            "experiment-1-pbvs",
        ),
        *("experiment-2-ibvs", "ur5-fov", "panda-fov", "eye-to-hand-pbvs", "free-camera"),
    )
)
#: Scene in which φ has no derivative on its boundary (5.5), so that (12) does not apply; see 4b.
NOT_DIFFERENTIABLE = "example-2d-heart-concave"

IN_MOTION = {
    "qd0": [0.0, 0.0, -3.0],
    "constraints.0.switching_gain": 100.0,
    "sampling_time": 0.001,
    "duration": 1.0,
}
#: First example with a camera that turns so fast at the start that φ of the second feature is
#: positive.
OUTSIDE = RunSpec("example-2d-fov", overrides=IN_MOTION)


class WithoutDrift(Controller):
    """Sliding-mode law with random numbers in place of L_fφ.

    L_fφ contains all second derivatives.
    """

    name = "sliding-mode-without-drift"

    def __init__(self) -> None:
        self.law = SlidingMode()
        self.reset()

    def reset(self, period: float | None = None) -> None:
        """Restart the random numbers."""
        self.random = np.random.default_rng(0)

    def solve(self, rows: Rows, task: Task) -> Command:
        """Return the law's command for random L_fφ."""
        return self.law.command(
            replace(rows, Lf=self.random.normal(scale=100.0, size=rows.Lf.shape)), task
        )


@claim("9a", FOV, CASE, *BLIND)
def _second_derivatives_not_needed(*runs: Run) -> Finding:
    shown = []
    same = []
    for spec, law, blind in zip(BLIND, runs[:2], runs[2:], strict=True):
        whole = len(law.t) == len(blind.t)
        difference = (
            np.abs(law.trajectory.qdd_command - blind.trajectory.qdd_command).max()
            if whole
            else None
        )
        same.append(difference == 0.0 and bool((law.trajectory.q == blind.trajectory.q).all()))
        shown.append((spec.name, difference, len(law.t)))
    return finding("9a", all(same), False, {"runs": shown})


@claim("11a", TARGET, OCCLUDER, SPHERE)
def _moving_objects(*runs: Run) -> Finding:
    scenes = []
    good = []
    for spec, run in zip((TARGET, OCCLUDER, SPHERE), runs, strict=True):
        sigma = greatest_sigma(run, *with_sigma(run.trajectory.labels))
        acting = run.ever_active()
        status = run.trajectory.status
        scenes.append((spec.name, status, sigma, acting))
        good.append(status == "converged" and sigma <= 0.0 and bool(acting))
    return finding("11a", all(good), any(good), {"scenes": scenes})


@claim("11b", OCCLUDER, SPHERE)
def _only_the_bound_changes(*runs: Run) -> Finding:
    """Compare rows along the same motion with and without knowledge of the obstacle's motion."""
    scenes = []
    same = []
    equal = []
    for spec, run in zip((OCCLUDER, SPHERE), runs, strict=True):
        knowing = run.setup.world()
        unknowing = RunSpec(spec.name, overrides={KNOWN: False}).load().setup().control()
        needed = np.zeros(2)
        Lg = 0.0
        phi = 0.0
        for k in np.flatnonzero((run.trajectory.phi >= 0.0).any(axis=1)):
            state = float(run.t[k]), run.trajectory.q[k], run.trajectory.qd[k]
            informed = knowing.evaluate(*state).rows
            blind = unknowing.evaluate(*state).rows
            active = informed.phi >= 0.0
            needed = np.maximum(
                needed, [np.maximum(rows.Lf[active], 0.0).sum() for rows in (informed, blind)]
            )
            Lg = max(Lg, np.abs(informed.Lg - blind.Lg).max())
            phi = max(phi, (np.abs(informed.phi - blind.phi) * active).max())
        scenes.append((spec.name, Lg, needed, phi))
        same.append(Lg < ROUNDING and abs(needed[0] - needed[1]) > ROUNDING)
        equal.append(phi < ROUNDING)
    return finding("11b", all(same) and all(equal), all(same), {"scenes": scenes})


def beside_fields(key: str, law: str, name: str, pareto: StudyResult) -> Finding:
    """Finding that sliding mode leaves at most 1 % unused, and no potential field leaves less.

    Each scenario counts. ``name`` is the number of ``law`` for the unused space [%]. With the
    printed gains it is compared only where they keep the boundaries. The number of a field is the
    smallest of its runs.
    """
    scenes: dict[str, dict[str, float]] = {}
    verdicts: dict[str, Verdict] = {}
    broken = {
        scenario: number(pareto, scenario, "printed", "kept") == 0.0 for scenario in SCENARIOS
    }
    kept = {scenario: number(pareto, scenario, law, "kept") for scenario in SCENARIOS}
    for scenario in SCENARIOS:
        lost = law == "printed" and kept[scenario] != 1.0
        own = nan if lost else pareto.numbers.get((scenario, law, name), nan)
        fields = {
            field: pareto.numbers.get((scenario, field, "least_unused"), nan) for field in FIELDS
        }
        part = own <= FULLY_USED
        verdicts[scenario] = judged(part and not any(left < own for left in fields.values()), part)
        scenes[scenario] = {SLIDING: own} | fields
    values = {
        f"{scenario}/{law}": value
        for scenario, laws in scenes.items()
        for law, value in laws.items()
    }
    good = set(verdicts.values()) == {"holds"}
    part = set(verdicts.values()) != {"does not hold"}
    return finding(
        key, good, part, {"scenes": scenes, "verdicts": verdicts, "broken": broken}, **values
    )


claim("7a", "pareto")(partial(beside_fields, "7a", "printed", "unused"))
claim("7c", "pareto")(partial(beside_fields, "7c", SLIDING, "least_unused"))


@claim("8a", "shrinking-region")
def _potential_field_becomes_the_law(study: StudyResult) -> Finding:
    """RMS distance of joint paths from those of sliding mode, at largest and smallest region."""
    scenes = {}
    good = []
    part = []
    values: dict[str, float] = {}
    for scenario in SCENARIOS:
        scenes[scenario] = about(study.numbers, scenario, "priority")
        far, near = (
            number(study, scenario, "priority", f"distance_{which}_region")
            for which in ("largest", "smallest")
        )
        floor = number(study, scenario, "sampling_distance")
        good.append(scenes[scenario]["distance_falls"] == 1.0 and near <= 2.0 * floor)
        part.append(near < far)
        values |= {f"{scenario}/far": far, f"{scenario}/near": near, f"{scenario}/floor": floor}
    return finding("8a", all(good), all(part), {"scenes": scenes, "values": values}, **values)


@claim("9b", "gradient-error")
def _first_derivatives_may_be_off(study: StudyResult) -> Finding:
    names = ("converged", "violation", "deviation_px")
    converged, depth, deviation = (dict(ending(study, SLIDING, 0.3, name)) for name in names)
    if not depth or not all(map(isfinite, depth.values())):
        raise NotMeasured("the study gradient-error has no run of the sliding mode with c_e = 0.3")
    converged = {name: value == 1.0 for name, value in converged.items()}
    arrived = all(converged.values())
    most = max(depth.values())
    shown = {
        "converged": converged,
        "depth": depth,
        "deviation": dict.fromkeys(depth, nan) | deviation,
    }
    return finding("9b", arrived and most <= 0.0, arrived and most <= SLIGHT, shown, **depth)


@claim("10a", "switching-gain")
def _gain_must_rise_with_speed(study: StudyResult) -> Finding:
    """Smallest sufficient gain and bound (12) at each speed of motion."""
    speeds = sorted(float(Kp0) for Kp0, _ in ending(study, "bound_12"))
    if len(speeds) < 2:
        raise NotMeasured("the study switching-gain has fewer than two speeds")
    bounds = [number(study, Kp0, "bound_12") for Kp0 in speeds]
    enough = [study.numbers.get((Kp0, "smallest_in_band"), nan) for Kp0 in speeds]
    # a speed at which no tested gain sufficed needs more than all of them
    gains = [gain if isfinite(gain) else inf for gain in enough]
    rises = all(a < b for a, b in pairwise(bounds))
    follows = all(a <= b for a, b in pairwise(gains)) and gains[0] < gains[-1]
    values = {f"{Kp0:g}": gain for Kp0, gain in zip(speeds, gains, strict=True)}
    swept = list(zip(values, bounds, gains, strict=True))
    return finding("10a", rises and follows, rises or follows, {"speeds": swept}, **values)


@claim("10d", "sampling-time")
def _chattering_becomes_negligible(study: StudyResult) -> Finding:
    """Band of the first example at each sampling time, the shortest last."""
    of = (SCENARIOS[0], "band")
    bands = {float(key[2]): band for key, band in study.numbers.items() if key[:2] == of}
    if not bands:
        raise NotMeasured("the study sampling-time has no band of the first example")
    values = {f"{time:g}": bands[time] for time in sorted(bands, reverse=True)}
    return finding("10d", bands[min(bands)] <= 0.02, False, {"bands": values}, **values)


@claim("10b", "switching-gain", *SCENES)
def _bound_is_sufficient(study: StudyResult, *runs: Run) -> Finding:
    """Number of runs above the bound that keep σ ≤ 0, and φ in its band."""
    names = ("above_bound", "above_bound_allowed", "above_bound_in_band")
    above, kept, band = (int(number(study, name)) for name in names)
    broken: dict[str, float] = {}
    beyond: dict[str, float] = {}
    for spec, run in zip(SCENES, runs, strict=True):
        if spec.name == NOT_DIFFERENTIABLE:
            continue
        share = run.needed_share().max()
        labels = run.trajectory.labels
        if share >= 1.0:
            broken[spec.name] = share
            continue
        most = max(excess(run, label) for label in labels)
        above = above + 1
        band = band + (most <= 1.0)
        kept += all(clear(run, label) >= 0.0 for label in with_sigma(labels))
        if most > 1.0:
            beyond[spec.name] = most
    if above == 0:
        raise NotMeasured("no run is above the bound")
    values = {"above": above, "kept": kept, "band": band}
    return finding(
        "10b", band == above, kept == above, {"beyond": beyond, "broken": broken}, **values
    )


@claim("10c", "sampling-time", *SCENES)
def _band_is_bounded(study: StudyResult, *runs: Run) -> Finding:
    """Peak-to-peak φ while a row is active, in units of T_s u⁺."""
    bands = dict(ending(study, "greatest_excess"))
    if not bands:
        raise NotMeasured("the study sampling-time has no band")
    power = {name: number(study, name, "exponent") for name in bands}
    scenes = {}
    for spec, run in zip(SCENES, runs, strict=True):
        if labels := run.ever_active():
            width = {
                label: float(np.ptp(run.while_sliding(label))) / run.bound(label)
                for label in labels
            }
            widest = max(labels, key=lambda label: (width[label], label))
            scenes[spec.name] = width[widest], widest, run.positive_samples(widest)
    greatest = max(*bands.values(), *(width for width, _, _ in scenes.values()))
    shown = {"bands": bands, "power": power, "scenes": scenes, "most": MAX_POSITIVE_SAMPLES}
    proportional = all(0.8 <= p <= 1.2 for p in power.values()) and greatest <= MAX_EXCESS
    values = bands | {f"{name}/scene": width for name, (width, _, _) in scenes.items()}
    return finding("10c", greatest <= 1.0, proportional, shown, **values)


@claim("10e", OUTSIDE)
def _reached_in_finite_time(run: Run) -> Finding:
    """Time at which φ first falls below zero, compared with the time by (A.6)."""
    phi = run.phi(SECOND)
    gain = run.bound(SECOND) / run.sampling_time
    Ts = run.sampling_time
    inside = np.flatnonzero(phi < 0.0)
    if phi[0] <= 0.0:
        raise NotMeasured(f"φ is {phi[0]:.3g} at the start, not above zero")
    if not len(inside):
        return Finding("does not hold", f"φ starts at {phi[0]:.3g} and never falls below zero")
    first = inside[0]
    after = float(run.t[first])
    push = float(run.drift[:first, run.index(SECOND)].max())
    within = float(phi[0]) / (gain - push) if gain > push else nan
    later = phi[first:].max() / run.bound(SECOND)
    shown = {"phi": phi[0], "gain": gain, "push": push, "later": later}
    return finding(
        "10e", after <= within + Ts and later <= MAX_EXCESS, True, shown, after=after, within=within
    )


@claim("10f", *FASTER)
def _aborted_without_rank(*runs: Run) -> Finding:
    """Rank of the active rows in each sample, by a separate decomposition, and end of the runs."""
    lost_by = []
    right = []
    for spec, run in zip(FASTER, runs, strict=True):
        lost = lost_rank(run)
        end = run.trajectory
        if lost is None:
            right.append(end.status != "aborted")
            continue
        named = any(label in end.reason for label in end.labels if run.phi(label)[lost] >= 0.0)
        right.append(lost == len(run.t) - 1 and end.status == "aborted" and named)
        lost_by.append((spec.name, run, run.t[lost]))
    if not lost_by:
        raise NotMeasured("no run loses the rank of its active rows")
    return finding("10f", all(right), False, {"runs": lost_by})


def lost_rank(run: Run) -> int | None:
    """Return the first sample whose active rows are linearly dependent, None if there is none.

    Each row is divided by its length.
    """
    world = run.setup.world()
    for k in np.flatnonzero((run.trajectory.phi >= 0.0).sum(axis=1) > 1):
        rows = world.evaluate(float(run.t[k]), run.trajectory.q[k], run.trajectory.qd[k]).rows
        A = rows.Lg[rows.phi >= 0.0]
        A = A / np.linalg.norm(A, axis=1, keepdims=True)
        if len(A) > A.shape[1] or np.linalg.svd(A, compute_uv=False)[-1] < 1e-6:
            return int(k)
    return None
