"""Claims 7 to 10 that only sweeps decide: they rest on the studies."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import isfinite, nan
from typing import TYPE_CHECKING

from ..verdicts import Finding, NotMeasured, claim, judged

if TYPE_CHECKING:
    from ...studies import StudyResult

SCENARIOS = ("example-2d-fov", "case-study-6r")
SLIDING, FIELDS = "sliding-mode", ("potential-field", "potential-field-priority")
SLIGHT = 1.0
"""Violation that counts as slight [% of the characteristic length]."""


def number(study: StudyResult, name: str) -> float:
    """A finite number of a study; raises NotMeasured where there is none."""
    value = float(study.numbers.get(name, float("nan")))
    if not isfinite(value):
        why = f": {study.failures[0]}" if study.failures else ""
        raise NotMeasured(f"the study {study.study} has no {name}{why}")
    return value


def ending(study: StudyResult, suffix: str) -> Iterator[tuple[str, float]]:
    """Names without the suffix, and values, of a study's numbers that end so."""
    for name, value in study.numbers.items():
        if name.endswith(suffix):
            yield name.removesuffix(suffix), float(value)


@claim(
    "7c",
    "6",
    "in contrast to artificial potential fields, the allowed space is fully utilized, whatever the parameters",
    "of the runs of the sweep that reach the goal and violate nothing, the best of the sliding mode leaves at most 1 % "
    "unused, and the best of neither potential field leaves less; partly if only the former, or in one scenario only",
    "study-pareto.png",
    "pareto",
)
def nothing_left_unused(pareto: StudyResult) -> Finding:
    """Least unused share of the allowed space over each controller's own parameter."""
    texts, good, part, values = [], [], [], {}
    for scenario in SCENARIOS:
        number(pareto, f"{scenario}.{SLIDING}.without_violation")
        # a law without any run that reaches the goal and violates nothing leaves no number
        least = {law: float(pareto.numbers.get(f"{scenario}.{law}.least_unused", nan)) for law in (SLIDING, *FIELDS)}
        part.append(least[SLIDING] <= 1.0)
        good.append(part[-1] and not any(least[law] < least[SLIDING] for law in FIELDS))
        shown = [f"{law} {f'leaves {v:.3g} %' if isfinite(v) else 'has no such run'}" for law, v in least.items()]
        there = "holds partly" if part[-1] else "does not hold"
        against = "" if good[-1] else f", so that it {there} there"
        texts.append(f"{scenario}: {', '.join(shown)}{against}")
        values.update({f"{scenario}/{law}": value for law, value in least.items()})
    return Finding(judged(all(good), any(part)), "; ".join(texts), values)


@claim(
    "8a",
    "1, 6",
    "in the limit case, as the repulsion region decreases, a potential field could be characterized as a discontinuous "
    "force; the proposed method can be interpreted as that limit case",
    "as the region of the priority blend shrinks its paths come nearer to the sliding mode's, in the end as near as "
    "the sliding mode's own paths with T_s and T_s/2 are, within a factor of 2; partly if they come nearer at all",
    "study-shrinking-region.png",
    "shrinking-region",
)
def potential_field_becomes_the_law(study: StudyResult) -> Finding:
    """RMS distance of the joints' paths from the sliding mode's at the largest and the smallest region."""
    texts, good, part, values = [], [], [], {}
    for scenario in SCENARIOS:
        floor = number(study, f"{scenario}.sampling_distance")
        far, near = (number(study, f"{scenario}.priority.distance_{size}_region") for size in ("largest", "smallest"))
        large, small = (number(study, f"{scenario}.priority.region_{size}") for size in ("largest", "smallest"))
        falls = number(study, f"{scenario}.priority.distance_falls") == 1.0
        good.append(falls and near <= 2.0 * floor)
        part.append(near < far)
        texts.append(
            f"{scenario}: {1e3 * far:.3g} mrad rms with a region of {large:g}, {1e3 * near:.3g} mrad with {small:g} "
            f"({'falling throughout' if falls else 'not falling throughout'}; {1e3 * floor:.3g} mrad between T_s and "
            "T_s/2)"
        )
        values.update({f"{scenario}/far": far, f"{scenario}/near": near, f"{scenario}/floor": floor})
    return Finding(judged(all(good), all(part)), "; ".join(texts), values)


@claim(
    "9b",
    "6, 10.2",
    "the first-order derivatives could be relatively inaccurate and the performance of the algorithm would still be "
    "satisfactory",
    "with a 30 % error (49) the sliding mode converges in every scenario of the sweep and violates nothing; partly if "
    "it converges in all and violates at most 1 % of the characteristic length",
    "study-gradient-error.png",
    "gradient-error",
)
def first_derivatives_may_be_off(study: StudyResult) -> Finding:
    """Violation, deviation and convergence with c_e = 0.3."""
    at = f".{SLIDING}.0.3."
    scenarios = [name for name, _ in ending(study, f"{at}converged")]
    if not scenarios:
        raise NotMeasured("the study gradient-error has no run of the sliding mode with c_e = 0.3")
    texts, depth, converged, values = [], [], [], {}
    for scenario in scenarios:
        depth.append(number(study, f"{scenario}{at}violation"))
        converged.append(number(study, f"{scenario}{at}converged") == 1.0)
        deviation = float(study.numbers.get(f"{scenario}{at}deviation_px", float("nan")))
        outside = f"violates {depth[-1]:.2g} % of L" if depth[-1] > 0.0 else "violates nothing"
        ended = "converges" if converged[-1] else "does not converge"
        texts.append(f"{scenario}: {ended}, {outside}, tracks deviate by {deviation:.2g} px")
        values[scenario] = depth[-1]
    good = all(converged) and max(depth) <= 0.0
    return Finding(judged(good, all(converged) and max(depth) <= SLIGHT), "; ".join(texts), values)


@claim(
    "10a",
    "8.2",
    "in general, the switching gain has to be increased when faster robot motions are considered, since the lower "
    "bound in (12) is larger",
    "with every faster motion the bound (12) rises, and the smallest gain tried that keeps φ within T_s u⁺ never "
    "falls, and rises in all; partly if one of both",
    "study-switching-gain.png",
    "switching-gain",
)
def gain_must_rise_with_speed(study: StudyResult) -> Finding:
    """Smallest sufficient gain and bound (12) for every speed of motion."""
    speeds = sorted(float(name.removeprefix("Kp0=")) for name, _ in ending(study, ".bound_12"))
    if len(speeds) < 2:
        raise NotMeasured("the study switching-gain has fewer than two speeds")
    bounds = [number(study, f"Kp0={Kp0:g}.bound_12") for Kp0 in speeds]
    enough = [float(study.numbers.get(f"Kp0={Kp0:g}.smallest_in_band", float("nan"))) for Kp0 in speeds]
    # a speed at which no gain tried was enough needs more than all of them
    gains = [gain if isfinite(gain) else float("inf") for gain in enough]
    text = "; ".join(
        f"K_T,p(0) = {Kp0:g}: (12) asks for {bound:.3g}, "
        + (f"{gain:g} is enough" if isfinite(gain) else "no gain tried is enough")
        for Kp0, bound, gain in zip(speeds, bounds, gains, strict=True)
    )
    rises = all(a < b for a, b in pairwise(bounds))
    follows = all(a <= b for a, b in pairwise(gains)) and gains[0] < gains[-1]
    return Finding(
        judged(rises and follows, rises or follows), text, {f"{v:g}": b for v, b in zip(speeds, gains, strict=True)}
    )


@claim(
    "10b",
    "3",
    "a switching gain above Σ max(L_fφ, 0) (12) is sufficient for making the set invariant",
    "every run of the sweep whose u⁺ is above the bound (12) along its motion keeps φ within T_s u⁺; partly if σ ≤ 0 "
    "in all of them",
    "study-switching-gain.png",
    "switching-gain",
)
def bound_is_sufficient(study: StudyResult) -> Finding:
    """How many runs above the bound keep σ ≤ 0, and φ in its band."""
    above, kept, band = (
        int(number(study, name)) for name in ("above_bound", "above_bound_allowed", "above_bound_in_band")
    )
    if above == 0:
        raise NotMeasured("no run of the study switching-gain is above the bound")
    text = f"of {above} runs above the bound {kept} keep σ ≤ 0 and {band} keep φ ≤ T_s u⁺"
    if band < above:
        text += "; (12) is about continuous time, in which tracking does not move φ while the law acts"
    return Finding(judged(band == above, kept == above), text, {"above": above, "kept": kept, "band": band})


@claim(
    "10c",
    "5.3, eq. (43)",
    "the upper bound for the chattering band is T_s u⁺",
    "the measured band is at most T_s u⁺ at every sampling time; partly if it grows in proportion to T_s (power 0.8 to "
    "1.2) and is at most twice as large",
    "study-sampling-time.png",
    "sampling-time",
)
def band_is_bounded(study: StudyResult) -> Finding:
    """Peak-to-peak φ while sliding in units of T_s u⁺."""
    found = dict(ending(study, ".greatest_excess"))
    if not found:
        raise NotMeasured("the study sampling-time has no band")
    power = {name: number(study, f"{name}.exponent") for name in found}
    text = "; ".join(
        f"{name}: up to {excess:.2f} T_s u⁺, growing with T_s to the power {power[name]:.2f}"
        for name, excess in found.items()
    )
    text += "; (43) is about one step of the constraint action alone, tracking moves φ as well"
    proportional = all(0.8 <= p <= 1.2 for p in power.values()) and max(found.values()) <= 2.0
    return Finding(judged(max(found.values()) <= 1.0, proportional), text, found)


@claim(
    "10d",
    "6",
    "the chattering problem becomes negligible for reasonable fast sampling rates",
    "at the shortest sampling time of the sweep the band is below 0.02, a fiftieth of the range of σ inside the image",
    "study-sampling-time.png",
    "sampling-time",
)
def chattering_becomes_negligible(study: StudyResult) -> Finding:
    """Band of the first example at the longest and the shortest sampling time."""
    prefix = f"{SCENARIOS[0]}.band."
    bands = {
        float(name.removeprefix(prefix).removesuffix("ms")): float(value)
        for name, value in study.numbers.items()
        if name.startswith(prefix)
    }
    if not bands:
        raise NotMeasured("the study sampling-time has no band of the first example")
    text = ", ".join(f"{bands[time]:.3f} at {time:g} ms" for time in sorted(bands, reverse=True))
    return Finding(
        judged(bands[min(bands)] <= 0.02), f"band of φ: {text}", {f"{time:g}": band for time, band in bands.items()}
    )
