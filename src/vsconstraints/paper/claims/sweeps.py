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
from ..verdicts import Finding, NotMeasured, claim, finding, plural
from .boundary import LONGEST_POSITIVE, MOST_EXCESS, clear, ending, excess, number, with_sigma
from .experiments import FASTER
from .planar import SECOND

SCENARIOS = ("example-2d-fov", "case-study-6r")
SLIDING, FIELDS = "sliding-mode", ("potential-field", "potential-field-priority")
SLIGHT = 1.0
"""Violation that counts as slight [% of the characteristic length]."""

FULLY_USED = 1.0
"""Unused space up to which it counts as fully used [%]."""

UNLIMITED: dict[str, dict[str, Any]] = {
    "ur5-fov": {"limits": {}},
    "panda-fov": {"limits": {}, "constraints.0.switching_gain": 20.0},
}
"""The claims are about commands that are carried out, whatever they ask of actuators."""

SCENES = tuple(
    RunSpec(name, overrides=UNLIMITED.get(name, {}))
    for name in (
        *("example-2d-fov", "example-2d-fast", "example-2d-fast-high-gain", "example-2d-bowl"),
        *("example-2d-heart-convex", "example-2d-heart-concave", "case-study-6r", "experiment-1-pbvs"),
        *("experiment-2-ibvs", "ur5-fov", "panda-fov", "eye-to-hand-pbvs", "free-camera"),
    )
)
"""The paper's scenes, and others with the same law and no disturbance."""

NOT_DIFFERENTIABLE = "example-2d-heart-concave"
"""Where φ has no derivative on its boundary (5.5), (12) says nothing: 4b is about that."""

IN_MOTION = {"qd0": [0.0, 0.0, -3.0], "constraints.0.switching_gain": 100.0, "sampling_time": 0.001, "duration": 1.0}
OUTSIDE = RunSpec("example-2d-fov", overrides=IN_MOTION)
"""The first example, its camera turning so fast at the start that φ of the second feature is above zero."""


def least_unused(pareto: StudyResult, scenario: str, *laws: str) -> dict[str, float]:
    """By law, the least of the allowed space that a run left unused [%]; NaN for a law none of whose runs counts."""
    return {law: pareto.numbers.get((scenario, law, "least_unused"), nan) for law in laws}


def shown(left: Mapping[str, float]) -> str:
    """What :func:`least_unused` found."""
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
        texts.append(f"{scenario}: {SLIDING} {printed}; {shown(fields)} at best")
        values |= {f"{scenario}/{law}": value for law, value in ({SLIDING: left} | fields).items()}
    return finding(". ".join(texts), all(good), any(part), **values)


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
        texts.append(f"{scenario}{breaks}: {shown(least)}{against}")
        values |= {f"{scenario}/{law}": value for law, value in least.items()}
    return finding("; ".join(texts), all(good), any(part), **values)


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
        texts.append(
            f"{scenario}: {1e3 * far:.3g} mrad rms with a region of {large:g}, {1e3 * near:.3g} mrad with {small:g} "
            f"({'never rising' if falls else 'rising in between'} by more than the {1e3 * floor:.3g} mrad between T_s "
            "and T_s/2 explain)"
        )
        values |= {f"{scenario}/far": far, f"{scenario}/near": near, f"{scenario}/floor": floor}
    return finding("; ".join(texts), all(good), all(part), **values)


@claim("9b", "gradient-error")
def _first_derivatives_may_be_off(study: StudyResult) -> Finding:
    at = (SLIDING, 0.3)
    texts, depth, converged = [], {}, []
    for scenario, _ in ending(study, *at, "converged"):
        depth[str(scenario)] = outside = number(study, scenario, *at, "violation")
        converged.append(number(study, scenario, *at, "converged") == 1.0)
        deviation = study.numbers.get((scenario, *at, "deviation_px"), nan)
        texts.append(
            f"{scenario}: {'converges' if converged[-1] else 'does not converge'}, violates "
            f"{f'{outside:.2g} % of L' if outside > 0.0 else 'nothing'}, tracks deviate by {deviation:.2g} px"
        )
    if not texts:
        raise NotMeasured("the study gradient-error has no run of the sliding mode with c_e = 0.3")
    most = max(depth.values())
    return finding("; ".join(texts), all(converged) and most <= 0.0, all(converged) and most <= SLIGHT, **depth)


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
    text = "; ".join(
        f"K_T,p(0) = {Kp0:g}: (12) asks for {bound:.3g}, {f'{gain:g}' if isfinite(gain) else 'no gain tried'} is enough"
        for Kp0, bound, gain in zip(speeds, bounds, gains, strict=True)
    )
    rises = all(a < b for a, b in pairwise(bounds))
    follows = all(a <= b for a, b in pairwise(gains)) and gains[0] < gains[-1]
    values = {f"{Kp0:g}": gain for Kp0, gain in zip(speeds, gains, strict=True)}
    return finding(text, rises and follows, rises or follows, **values)


@claim("10d", "sampling-time")
def _chattering_becomes_negligible(study: StudyResult) -> Finding:
    """Band of the first example at every sampling time, the shortest last."""
    of = (SCENARIOS[0], "band")
    bands = {float(key[2]): band for key, band in study.numbers.items() if key[:2] == of}
    if not bands:
        raise NotMeasured("the study sampling-time has no band of the first example")
    text = ", ".join(f"{bands[time]:.3f} at {time:g} ms" for time in sorted(bands, reverse=True))
    values = {f"{time:g}": band for time, band in bands.items()}
    return finding(f"band of φ: {text}", bands[min(bands)] <= 0.02, **values)


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
    text = (
        f"of {above} runs above the bound {kept} keep σ ≤ 0 and {band} keep φ ≤ T_s u⁺"
        + (f", not {', '.join(beyond)}" if beyond else "")
        + f"; (12) asks for more than the printed u⁺ in {', '.join(broken) or 'no scene'}"
    )
    if band < above:
        text += "; (12) is about continuous time, in which tracking does not move φ while the law acts"
    return finding(text, band == above, kept == above, above=above, kept=kept, band=band)


@claim("10c", "sampling-time", *SCENES)
def _band_is_bounded(study: StudyResult, *runs: Run) -> Finding:
    """Peak-to-peak φ while a row acts in units of T_s u⁺."""
    found = {str(name): value for name, value in ending(study, "greatest_excess")}
    if not found:
        raise NotMeasured("the study sampling-time has no band")
    power = {name: number(study, name, "exponent") for name in found}
    scenes = {
        spec.name: max(
            (float(np.ptp(run.while_sliding(label))) / run.bound(label), label, run.positive_samples(label))
            for label in run.ever_active()
        )
        for spec, run in zip(SCENES, runs, strict=True)
        if run.ever_active()
    }
    swept = "; ".join(
        f"{name}: up to {width:.2f} T_s u⁺, growing with T_s to the power {power[name]:.2f}"
        for name, width in found.items()
    )
    everywhere = ", ".join(
        f"{name} {width:.3g}" + (f" ({label}, φ ≥ 0 for {plural(n)} in a row)" if n > LONGEST_POSITIVE else "")
        for name, (width, label, n) in scenes.items()
    )
    text = (
        f"{swept}. In every scene: {everywhere}. (43) is about one step of the constraint action alone, tracking moves "
        "φ as well"
    )
    greatest = max(*found.values(), *(width for width, _, _ in scenes.values()))
    proportional = all(0.8 <= p <= 1.2 for p in power.values()) and greatest <= MOST_EXCESS
    values = found | {f"{name}/scene": width for name, (width, _, _) in scenes.items()}
    return finding(text, greatest <= 1.0, proportional, **values)


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
    text = (
        f"φ starts at {phi[0]:.3g}; u⁺ = {gain:g}, L_fφ up to {push:.3g}: below zero after {1e3 * after:.3g} ms, "
        f"promised {f'within {1e3 * within:.3g} ms' if gain > push else 'never'}; then at most {later:.2f} T_s u⁺"
    )
    return finding(text, after <= within + Ts and later <= MOST_EXCESS, True, after=after, within=within)


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
        texts.append(f"{spec.name}, T_s = {run.sampling_time:g} s: rank lost at {run.t[lost]:.2f} s, {end.status}")
    if not texts:
        raise NotMeasured("no run loses the rank of its active rows")
    return finding("; ".join(texts), all(right))


def lost_rank(run: Run) -> int | None:
    """The first sample whose active rows, each divided by its length, are linearly dependent; None if there is none."""
    scene, constraints = run.setup.scene, run.setup.constraints
    for k in np.flatnonzero((run.trajectory.phi >= 0.0).sum(axis=1) > 1):
        rows, _ = constraints.rows(scene.evaluate(float(run.t[k]), run.trajectory.q[k], run.trajectory.qd[k]))
        A = rows.Lg[rows.phi >= 0.0]
        A = A / np.linalg.norm(A, axis=1, keepdims=True)
        if len(A) > A.shape[1] or np.linalg.svd(A, compute_uv=False)[-1] < 1e-6:
            return int(k)
    return None
