"""Claims 7 to 10 that only sweeps decide: they rest on the studies."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import isfinite, nan

from ...studies import StudyResult
from ..verdicts import Finding, NotMeasured, claim, judged

SCENARIOS = ("example-2d-fov", "case-study-6r")
SLIDING, FIELDS = "sliding-mode", ("potential-field", "potential-field-priority")
SLIGHT = 1.0
"""Violation that counts as slight [% of the characteristic length]."""

FULLY_USED = 1.0
"""Unused space up to which it counts as fully used [%]."""


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


KEPT = (
    "of the runs of the sweep that reach the goal and keep their boundaries: no row with a σ of its own is violated, "
    "no speed by more than 2 T_s u⁺, and φ ≥ 0 for two samples in a row at most"
)
"""Like is compared with like: a law that leaves its boundary uses more space than there is."""


@claim(
    "7a",
    "6",
    "in contrast to artificial potential fields the proposed method fully utilizes the available allowed space",
    f"{KEPT}, that of the sliding mode with the printed gains leaves at most 1 % unused, and less than those of either "
    "potential field over region and strength, in both scenarios; partly if at most 1 % in one scenario",
    "study-pareto.png",
    "pareto",
)
def space_fully_used(pareto: StudyResult) -> Finding:
    """Unused share of the allowed space with the printed gains, beside the least of the fields."""
    texts, good, part, values = [], [], [], {}
    for scenario in SCENARIOS:
        kept = number(pareto, f"{scenario}.printed.kept") == 1.0
        left = number(pareto, f"{scenario}.printed.unused") if kept else nan
        fields = {law: float(pareto.numbers.get(f"{scenario}.{law}.least_unused", nan)) for law in FIELDS}
        part.append(left <= FULLY_USED)
        good.append(part[-1] and not any(field < left for field in fields.values()))
        printed = f"leaves {left:.3g} %" if kept else "does not keep its boundaries (5d), so that it is not compared"
        shown = [f"{law} {f'leaves {v:.3g} %' if isfinite(v) else 'has no such run'}" for law, v in fields.items()]
        texts.append(f"{scenario}: {SLIDING} {printed}; {', '.join(shown)} at best")
        values.update({f"{scenario}/{law}": value for law, value in ({SLIDING: left} | fields).items()})
    return Finding(judged(all(good), any(part)), ". ".join(texts), values)


@claim(
    "7c",
    "6",
    "in contrast to artificial potential fields, the allowed space is fully utilized, whatever the parameters",
    f"{KEPT}, the best of the sliding mode over u⁺ leaves at most 1 % unused, and the best of neither potential field "
    "over region and strength leaves less; partly if only the former, or in one scenario only",
    "study-pareto.png",
    "pareto",
)
def nothing_left_unused(pareto: StudyResult) -> Finding:
    """Least unused share of the allowed space over each controller's own parameters."""
    texts, good, part, values = [], [], [], {}
    for scenario in SCENARIOS:
        number(pareto, f"{scenario}.{SLIDING}.kept")
        # a law without any run that is compared leaves no number
        least = {law: float(pareto.numbers.get(f"{scenario}.{law}.least_unused", nan)) for law in (SLIDING, *FIELDS)}
        part.append(least[SLIDING] <= FULLY_USED)
        good.append(part[-1] and not any(least[law] < least[SLIDING] for law in FIELDS))
        shown = [f"{law} {f'leaves {v:.3g} %' if isfinite(v) else 'has no such run'}" for law, v in least.items()]
        there = "holds partly" if part[-1] else "does not hold"
        against = "" if good[-1] else f", so that it {there} there"
        breaks = " (the printed gains break (12): 5d)" if number(pareto, f"{scenario}.printed.kept") == 0.0 else ""
        texts.append(f"{scenario}{breaks}: {', '.join(shown)}{against}")
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
            f"({'never rising' if falls else 'rising in between'} by more than the {1e3 * floor:.3g} mrad between T_s "
            "and T_s/2 explain)"
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
