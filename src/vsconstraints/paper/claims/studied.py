"""Claims 7 to 10 that only sweeps decide: they rest on the studies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from math import inf, isfinite, nan

from ..studies import StudyResult
from ..verdicts import Finding, NotMeasured, claim, finding

SCENARIOS = ("example-2d-fov", "case-study-6r")
SLIDING, FIELDS = "sliding-mode", ("potential-field", "potential-field-priority")
SLIGHT = 1.0
"""Violation that counts as slight [% of the characteristic length]."""

FULLY_USED = 1.0
"""Unused space up to which it counts as fully used [%]."""


def number(study: StudyResult, *key: str | float) -> float:
    """A finite number of a study; raises NotMeasured where there is none."""
    value = study.numbers.get(key, nan)
    if not isfinite(value):
        why = f": {study.failures[0]}" if study.failures else ""
        raise NotMeasured(f"the study {study.study} has no {'.'.join(map(str, key))}{why}")
    return value


def ending(study: StudyResult, *last: str | float) -> Iterator[tuple[str | float, float]]:
    """What the numbers of a study are of, whose keys are it and this, and the numbers."""
    return ((first, value) for (first, *others), value in study.numbers.items() if tuple(others) == last)


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
