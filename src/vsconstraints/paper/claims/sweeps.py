"""Claims 7 to 10 that sweeps decide, or every scene with the paper's law, or a scene made for them."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from math import inf, isfinite, nan
from typing import Any

import numpy as np

from ...comparisons.run import Run
from ...comparisons.runs.spec import RunSpec
from ..studies import StudyResult
from ..studies.potential_fields import MAX_EXCESS, MAX_POSITIVE_SAMPLES
from ..verdicts import Finding, NotMeasured, claim, finding, worded
from .boundary import clear, ending, excess, number, with_sigma
from .experiments import FASTER
from .planar import SECOND

SCENARIOS = ("example-2d-fov", "case-study-6r")
SLIDING, FIELDS = "sliding-mode", ("potential-field", "potential-field-priority")
SLIGHT = 1.0  #: Violation that counts as slight [% of the characteristic length].
FULLY_USED = 1.0  #: Unused space up to which it counts as fully used [%].
#: The claims are about commands that are carried out, whatever they ask of actuators.
UNLIMITED: dict[str, dict[str, Any]] = {
    "ur5-fov": {"limits": {}},
    "panda-fov": {"limits": {}, "constraints.0.switching_gain": 20.0},
}
#: The paper's scenes, and others with the same law and no disturbance.
SCENES = tuple(
    RunSpec(name, overrides=UNLIMITED.get(name, {}))
    for name in (
        *("example-2d-fov", "example-2d-fast", "example-2d-fast-high-gain", "example-2d-bowl"),
        *("example-2d-heart-convex", "example-2d-heart-concave", "case-study-6r", "experiment-1-pbvs"),
        *("experiment-2-ibvs", "ur5-fov", "panda-fov", "eye-to-hand-pbvs", "free-camera"),
    )
)
#: Where φ has no derivative on its boundary (5.5), (12) says nothing: 4b is about that.
NOT_DIFFERENTIABLE = "example-2d-heart-concave"

IN_MOTION = {"qd0": [0.0, 0.0, -3.0], "constraints.0.switching_gain": 100.0, "sampling_time": 0.001, "duration": 1.0}
#: The first example, its camera turning so fast at the start that φ of the second feature is above zero.
OUTSIDE = RunSpec("example-2d-fov", overrides=IN_MOTION)


def least_unused(pareto: StudyResult, scenario: str, *laws: str) -> dict[str, float]:
    """By law, the least of the allowed space that a run left unused [%]; NaN for a law none of whose runs counts."""
    return {law: pareto.numbers.get((scenario, law, "least_unused"), nan) for law in laws}


def laws_text(left: Mapping[str, float]) -> str:
    """What :func:`least_unused` says, in words."""
    return ", ".join(f"{law} {f'leaves {v:.3g} %' if isfinite(v) else 'has no such run'}" for law, v in left.items())


@claim("7a", "pareto")
def _space_fully_used(pareto: StudyResult) -> Finding:
    """With the printed gains, beside the least of the fields."""
    texts, good, part = [], [], []
    values: dict[str, float] = {}
    for scenario in SCENARIOS:
        kept = number(pareto, scenario, "printed", "kept") == 1.0
        left = number(pareto, scenario, "printed", "unused") if kept else nan
        fields = least_unused(pareto, scenario, *FIELDS)
        part.append(left <= FULLY_USED)
        good.append(part[-1] and not any(field < left for field in fields.values()))
        printed = f"leaves {left:.3g} %" if kept else "does not keep its boundaries (5d), so that it is not compared"
        texts.append(f"{scenario}: {SLIDING} {printed}; {laws_text(fields)} at best")
        values |= {f"{scenario}/{law}": value for law, value in ({SLIDING: left} | fields).items()}
    return finding("7a", all(good), any(part), {"scenes": ". ".join(texts)}, **values)


@claim("7c", "pareto")
def _nothing_left_unused(pareto: StudyResult) -> Finding:
    """Over each law's own parameters."""
    texts, good, part = [], [], []
    values: dict[str, float] = {}
    for scenario in SCENARIOS:
        number(pareto, scenario, SLIDING, "kept")
        least = least_unused(pareto, scenario, SLIDING, *FIELDS)
        part.append(least[SLIDING] <= FULLY_USED)
        good.append(part[-1] and not any(least[law] < least[SLIDING] for law in FIELDS))
        against = "" if good[-1] else f", so that it {'holds partly' if part[-1] else 'does not hold'} there"
        broken = number(pareto, scenario, "printed", "kept") == 0.0
        breaks = " (the printed gains break (12): 5d)" if broken else ""
        texts.append(f"{scenario}{breaks}: {laws_text(least)}{against}")
        values |= {f"{scenario}/{law}": value for law, value in least.items()}
    return finding("7c", all(good), any(part), {"scenes": "; ".join(texts)}, **values)


@claim("8a", "shrinking-region")
def _potential_field_becomes_the_law(study: StudyResult) -> Finding:
    """RMS distance of the joints' paths from the sliding mode's at the largest and the smallest region."""
    texts, good, part = [], [], []
    values: dict[str, float] = {}
    for scenario in SCENARIOS:
        floor = number(study, scenario, "sampling_distance")
        sizes = ("largest", "smallest")
        far, near = (number(study, scenario, "priority", f"distance_{size}_region") for size in sizes)
        large, small = (number(study, scenario, "priority", f"region_{size}") for size in sizes)
        falls = number(study, scenario, "priority", "distance_falls") == 1.0
        good.append(falls and near <= 2.0 * floor)
        part.append(near < far)
        how = "never rising" if falls else "rising in between"
        shown = {"far": far, "near": near, "large": large, "small": small, "floor": floor}
        texts.append(worded("shrinking", scenario=scenario, how=how, **shown))
        values |= {f"{scenario}/far": far, f"{scenario}/near": near, f"{scenario}/floor": floor}
    return finding("8a", all(good), all(part), {"scenes": "; ".join(texts)}, **values)


@claim("9b", "gradient-error")
def _first_derivatives_may_be_off(study: StudyResult) -> Finding:
    at = (SLIDING, 0.3)
    texts, depth, converged = [], {}, []
    for scenario, _ in ending(study, *at, "converged"):
        depth[str(scenario)] = outside = number(study, scenario, *at, "violation")
        converged.append(number(study, scenario, *at, "converged") == 1.0)
        deviation = study.numbers.get((scenario, *at, "deviation_px"), nan)
        status = "converges" if converged[-1] else "does not converge"
        violates = f"{outside:.2g} % of L" if outside > 0.0 else "nothing"
        texts.append(worded("off", scenario=scenario, status=status, violates=violates, deviation=deviation))
    if not texts:
        raise NotMeasured("the study gradient-error has no run of the sliding mode with c_e = 0.3")
    most = max(depth.values())
    good, part = all(converged) and most <= 0.0, all(converged) and most <= SLIGHT
    return finding("9b", good, part, {"scenes": "; ".join(texts)}, **depth)


@claim("10a", "switching-gain")
def _gain_must_rise_with_speed(study: StudyResult) -> Finding:
    """Smallest sufficient gain and bound (12) for every speed of motion."""
    speeds = sorted(float(Kp0) for Kp0, _ in ending(study, "bound_12"))
    if len(speeds) < 2:
        raise NotMeasured("the study switching-gain has fewer than two speeds")
    bounds = [number(study, Kp0, "bound_12") for Kp0 in speeds]
    enough = [study.numbers.get((Kp0, "smallest_in_band"), nan) for Kp0 in speeds]
    # a speed at which no gain tried was enough needs more than all of them
    gains = [gain if isfinite(gain) else inf for gain in enough]
    texts = [
        worded("speed", Kp0=Kp0, bound=bound, gain=f"{gain:g}" if isfinite(gain) else "no gain tried")
        for Kp0, bound, gain in zip(speeds, bounds, gains, strict=True)
    ]
    rises = all(a < b for a, b in pairwise(bounds))
    follows = all(a <= b for a, b in pairwise(gains)) and gains[0] < gains[-1]
    values = {f"{Kp0:g}": gain for Kp0, gain in zip(speeds, gains, strict=True)}
    return finding("10a", rises and follows, rises or follows, {"speeds": "; ".join(texts)}, **values)


@claim("10d", "sampling-time")
def _chattering_becomes_negligible(study: StudyResult) -> Finding:
    """Band of the first example at every sampling time, the shortest last."""
    of = (SCENARIOS[0], "band")
    bands = {float(key[2]): band for key, band in study.numbers.items() if key[:2] == of}
    if not bands:
        raise NotMeasured("the study sampling-time has no band of the first example")
    text = ", ".join(f"{bands[time]:.3f} at {time:g} ms" for time in sorted(bands, reverse=True))
    values = {f"{time:g}": band for time, band in bands.items()}
    return finding("10d", bands[min(bands)] <= 0.02, False, {"bands": text}, **values)


@claim("10b", "switching-gain", *SCENES)
def _bound_is_sufficient(study: StudyResult, *runs: Run) -> Finding:
    """How many runs above the bound keep σ ≤ 0, and φ in its band."""
    names = ("above_bound", "above_bound_allowed", "above_bound_in_band")
    above, kept, band = (int(number(study, name)) for name in names)
    broken, beyond = [], []
    for spec, run in zip(SCENES, runs, strict=True):
        if spec.name == NOT_DIFFERENTIABLE:
            continue
        share, labels = run.needed_share().max(), run.trajectory.labels
        if share >= 1.0:
            broken.append(f"{spec.name} ({share:.3g} u⁺)")
            continue
        most = max(excess(run, label) for label in labels)
        above, band = above + 1, band + (most <= 1.0)
        kept += all(clear(run, label) >= 0.0 for label in with_sigma(labels))
        if most > 1.0:
            beyond.append(f"{spec.name} ({most:.3g} T_s u⁺)")
    if above == 0:
        raise NotMeasured("no run is above the bound")
    shown = {"beyond": f", not {', '.join(beyond)}" if beyond else "", "broken": ", ".join(broken) or "no scene"}
    shown["continuous"] = worded("continuous") if band < above else ""
    return finding("10b", band == above, kept == above, shown, above=above, kept=kept, band=band)


@claim("10c", "sampling-time", *SCENES)
def _band_is_bounded(study: StudyResult, *runs: Run) -> Finding:
    """Peak-to-peak φ while a row acts in units of T_s u⁺."""
    bands = {str(name): value for name, value in ending(study, "greatest_excess")}
    if not bands:
        raise NotMeasured("the study sampling-time has no band")
    power = {name: number(study, name, "exponent") for name in bands}
    scenes = {
        spec.name: max(
            (float(np.ptp(run.while_sliding(label))) / run.bound(label), label, run.positive_samples(label))
            for label in run.ever_active()
        )
        for spec, run in zip(SCENES, runs, strict=True)
        if run.ever_active()
    }
    swept = "; ".join(worded("band", name=name, width=w, power=power[name]) for name, w in bands.items())
    everywhere = ", ".join(
        f"{name} {width:.3g}" + (worded("row", label=label, samples=n) if n > MAX_POSITIVE_SAMPLES else "")
        for name, (width, label, n) in scenes.items()
    )
    greatest = max(*bands.values(), *(width for width, _, _ in scenes.values()))
    proportional = all(0.8 <= p <= 1.2 for p in power.values()) and greatest <= MAX_EXCESS
    values = bands | {f"{name}/scene": width for name, (width, _, _) in scenes.items()}
    return finding("10c", greatest <= 1.0, proportional, {"swept": swept, "everywhere": everywhere}, **values)


@claim("10e", OUTSIDE)
def _reached_in_finite_time(run: Run) -> Finding:
    """When φ is below zero for the first time, beside the time that (A.6) promises."""
    phi, gain, Ts = run.phi(SECOND), run.bound(SECOND) / run.sampling_time, run.sampling_time
    inside = np.flatnonzero(phi < 0.0)
    if phi[0] <= 0.0:
        raise NotMeasured(f"φ is {phi[0]:.3g} at the start, not above zero")
    if not len(inside):
        return Finding("does not hold", f"φ starts at {phi[0]:.3g} and never falls below zero")
    first = inside[0]
    after, push = float(run.t[first]), float(run.drift[:first, run.index(SECOND)].max())
    within = float(phi[0]) / (gain - push) if gain > push else nan
    later = phi[first:].max() / run.bound(SECOND)
    promised = worded("promised", within=within) if gain > push else "never"
    shown = {"phi": phi[0], "gain": gain, "push": push, "promised": promised, "later": later}
    return finding("10e", after <= within + Ts and later <= MAX_EXCESS, True, shown, after=after, within=within)


@claim("10f", *FASTER)
def _aborted_without_rank(*runs: Run) -> Finding:
    """The rank of the active rows, decomposed here, in every sample; and how the runs end."""
    texts, right = [], []
    for spec, run in zip(FASTER, runs, strict=True):
        lost, end = lost_rank(run), run.trajectory
        if lost is None:
            right.append(end.status != "aborted")
            continue
        named = any(label in end.reason for label in end.labels if run.phi(label)[lost] >= 0.0)
        right.append(lost == len(run.t) - 1 and end.status == "aborted" and named)
        texts.append(worded("rank", name=spec.name, Ts=run.sampling_time, time=run.t[lost], status=end.status))
    if not texts:
        raise NotMeasured("no run loses the rank of its active rows")
    return finding("10f", all(right), False, {"runs": "; ".join(texts)})


def lost_rank(run: Run) -> int | None:
    """The first sample whose active rows, each divided by its length, are linearly dependent; None if there is none."""
    world = run.setup.world()
    for k in np.flatnonzero((run.trajectory.phi >= 0.0).sum(axis=1) > 1):
        rows = world.evaluate(float(run.t[k]), run.trajectory.q[k], run.trajectory.qd[k]).rows
        A = rows.Lg[rows.phi >= 0.0]
        A = A / np.linalg.norm(A, axis=1, keepdims=True)
        if len(A) > A.shape[1] or np.linalg.svd(A, compute_uv=False)[-1] < 1e-6:
            return int(k)
    return None
