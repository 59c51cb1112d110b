"""Section 6, advantages and disadvantages of the proposal: claims 7, 8, 9 and 10d.

They compare with potential fields, and tell what the law needs to know.
"""

from __future__ import annotations

from dataclasses import replace
from math import isfinite, nan

import numpy as np

from ...comparisons.run import Run
from ...comparisons.runs.spec import ControllerSpec, RunSpec
from ...controllers import Controller, SlidingMode
from ...rows import Command, Rows, Task
from ...rows.readable import amount
from ..scenes import CASE, FOV, SECOND
from ..studies import StudyResult
from ..studies.tables import about
from ..verdicts import Finding, NotMeasured, Verdict, claim, finding, judged
from .boundary import ending, number

SCENARIOS = ("example-2d-fov", "case-study-6r")
SLIDING = "sliding-mode"
FIELDS = ("potential-field", "potential-field-priority")
SLIGHT = 1.0  #: Greatest violation that counts as slight [% of the characteristic length].
FULLY_USED = 1.0  #: Greatest unused space that counts as fully used [%].
#: Which runs of the sweep are compared.
KEPT = (
    "of the runs of the sweep that reach the goal and keep their boundaries: no row with a σ of "
    "its own is violated, no speed by more than 2 T_s u⁺, and φ ≥ 0 for two samples in a row at "
    "most"
)

# --- Potential fields ---


class Comparison:
    """Unused space [%] of the sliding mode and of both potential fields, by scenario and law.

    ``law`` names the runs of the sliding mode in the study, and ``name`` the number of these runs.
    With the printed gains they are compared only where they keep the boundaries. The number of a
    field is the smallest of its runs; NaN if no run keeps its boundaries.
    """

    def __init__(self, pareto: StudyResult, law: str, name: str) -> None:
        #: True by scenario if the printed gains do not keep the boundaries.
        self.broken: dict[str, bool] = {}
        self.unused: dict[str, dict[str, float]] = {}
        self.verdicts: dict[str, Verdict] = {}
        for scenario in SCENARIOS:
            self.broken[scenario] = number(pareto, scenario, "printed", "kept") == 0.0
            lost = number(pareto, scenario, law, "kept") != 1.0 and law == "printed"
            value = nan if lost else pareto.numbers.get((scenario, law, name), nan)
            fields = {
                field: pareto.numbers.get((scenario, field, "least_unused"), nan)
                for field in FIELDS
            }
            used = value <= FULLY_USED
            beaten = any(left < value for left in fields.values())
            self.verdicts[scenario] = judged(used and not beaten, used)
            self.unused[scenario] = {SLIDING: value} | fields

    def finding(self, text: str) -> Finding:
        """Return the finding over all scenarios."""
        values = {
            f"{scenario}/{law}": left
            for scenario, laws in self.unused.items()
            for law, left in laws.items()
        }
        found = set(self.verdicts.values())
        return finding(text, holds=found == {"holds"}, partly=found != {"does not hold"}, **values)


def leaves(unused: float) -> str:
    """Words for the unused space of a law [%]; NaN if there is none."""
    return f"leaves {unused:.3g} %" if isfinite(unused) else "has no such run"


@claim(
    "7a",
    "pareto",
    where="6",
    sentence="in contrast to artificial potential fields the proposed method fully utilizes the "
    "available allowed space",
    rule=f"{KEPT}, that of the sliding mode with the printed gains leaves at most 1 % unused, and "
    "less than those of either potential field over region and strength, in both scenarios; "
    "partly if at most 1 % in one scenario",
)
def _printed_gains_use_the_space(pareto: StudyResult) -> Finding:
    compared = Comparison(pareto, "printed", "unused")
    texts = []
    for scenario, laws in compared.unused.items():
        sliding = laws[SLIDING]
        result = "does not keep its boundaries (5d), so that it is not compared"
        if isfinite(sliding):
            result = leaves(sliding)
        fields = ", ".join(f"{field} {leaves(laws[field])}" for field in FIELDS)
        texts.append(f"{scenario}: {SLIDING} {result}; {fields} at best")
    return compared.finding(". ".join(texts))


@claim(
    "7c",
    "pareto",
    where="6",
    sentence="in contrast to artificial potential fields, the allowed space is fully utilized, "
    "whatever the parameters",
    rule=f"{KEPT}, the best of the sliding mode over u⁺ leaves at most 1 % unused, and the best of "
    "neither potential field over region and strength leaves less; partly if only the former, or "
    "in one scenario only",
)
def _best_gains_use_the_space(pareto: StudyResult) -> Finding:
    compared = Comparison(pareto, SLIDING, "least_unused")
    texts = []
    for scenario, laws in compared.unused.items():
        broken = " (the printed gains break (12): 5d)" if compared.broken[scenario] else ""
        shares = ", ".join(f"{law} {leaves(left)}" for law, left in laws.items())
        text = f"{scenario}{broken}: {shares}"
        if compared.verdicts[scenario] != "holds":
            text += f", so that it {compared.verdicts[scenario]} there"
        texts.append(text)
    return compared.finding("; ".join(texts))


@claim(
    "8a",
    "shrinking-region",
    where="1, 6",
    sentence="in the limit case, as the repulsion region decreases, a potential field could be "
    "characterized as a discontinuous force; the proposed method can be interpreted as that limit "
    "case",
    rule="as the region of the priority blend shrinks its paths come nearer to the sliding mode's, "
    "in the end as near as the sliding mode's own paths with T_s and T_s/2 are, within a factor of "
    "2; partly if they come nearer at all",
)
def _potential_field_becomes_the_law(study: StudyResult) -> Finding:
    """RMS distance of joint paths from those of sliding mode, at largest and smallest region."""
    texts = []
    good = []
    part = []
    values: dict[str, float] = {}
    for scenario in SCENARIOS:
        numbers = about(study.numbers, scenario, "priority")
        far = number(study, scenario, "priority", "distance_largest_region")
        near = number(study, scenario, "priority", "distance_smallest_region")
        floor = number(study, scenario, "sampling_distance")
        good.append(numbers["distance_falls"] == 1.0 and near <= 2.0 * floor)
        part.append(near < far)
        values |= {f"{scenario}/far": far, f"{scenario}/near": near, f"{scenario}/floor": floor}
        rising = "never rising" if numbers["distance_falls"] else "rising in between"
        texts.append(
            f"{scenario}: {1e3 * far:.3g} mrad rms with a region of {numbers['region_largest']:g}, "
            f"{1e3 * near:.3g} mrad with {numbers['region_smallest']:g} ({rising} by more than the "
            f"{1e3 * floor:.3g} mrad between T_s and T_s/2 explain)"
        )
    return finding("; ".join(texts), holds=all(good), partly=all(part), **values)


# --- Design parameter ---

PARAMETERS = (0.1, 0.2, 0.4)
APPROACHES = tuple(RunSpec("example-2d-fov", overrides={"constraints.0.K": K}) for K in PARAMETERS)


@claim(
    "7b",
    *APPROACHES,
    where="6",
    sentence="the boundary is reached smoothly depending on a free design parameter; the velocity "
    "perpendicular to it is progressively reduced to zero",
    rule="in the first example the normal speed decays with a time constant within 25 % of K, for "
    "K = 0.1, 0.2 and 0.4 s; partly if it grows with K",
    figure="fig-04.png",
)
def _approach_follows_the_parameter(*runs: Run) -> Finding:
    constants = dict(zip(PARAMETERS, map(time_constant, runs), strict=True))
    good = all(abs(tau / K - 1.0) <= 0.25 for K, tau in constants.items())
    rising = bool((np.diff(list(constants.values())) > 0.0).all())
    measured = "; ".join(f"K = {K:g} s: {tau:.3f} s" for K, tau in constants.items())
    values = {str(K): tau for K, tau in constants.items()}
    return finding(f"measured time constants: {measured}", holds=good, partly=rising, **values)


def time_constant(run: Run) -> float:
    """Time constant of the second marker's normal speed, over 2 K from its row's first activity."""
    acts = run.phi(SECOND) >= 0.0
    if not acts.any():
        raise NotMeasured("the row never acts")
    first = run.t[acts.argmax()]
    K = run.constraint(SECOND).K
    during = (run.t >= first) & (run.t <= first + 2.0 * K)
    approach_speed = run.approach_speed(SECOND)[during]
    speed = np.maximum(approach_speed, 1e-6)
    slope, _ = np.polyfit(run.t[during], np.log(speed), 1)
    return -1.0 / float(slope)


# --- Derivatives ---


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
        random = self.random.normal(scale=100.0, size=rows.Lf.shape)
        return self.law.command(replace(rows, Lf=random), task)


WITHOUT_DRIFT = ControllerSpec(f"{__name__}:{WithoutDrift.__name__}")
BLIND = tuple(RunSpec(spec.name, WITHOUT_DRIFT) for spec in (FOV, CASE))


@claim(
    "9a",
    FOV,
    CASE,
    *BLIND,
    where="6",
    sentence="the Lie derivatives L_fφ are not needed, only L_gφ; no second-order derivatives are "
    "required",
    rule="with random numbers instead of L_fφ, where all second derivatives are, every joint "
    "position and command is the same",
)
def _second_derivatives_not_needed(*runs: Run) -> Finding:
    texts = []
    same = []
    for spec, law, blind in zip(BLIND, runs[:2], runs[2:], strict=True):
        samples = len(law.t)
        if samples != len(blind.t):
            same.append(False)
            texts.append(f"{spec.name}: one run ends earlier")
            continue
        change = np.abs(law.trajectory.qdd_command - blind.trajectory.qdd_command).max()
        same.append(change == 0.0 and bool((law.trajectory.q == blind.trajectory.q).all()))
        texts.append(f"{spec.name}: q̈_c differs by {amount(change)} rad/s² in {samples} samples")
    return finding("; ".join(texts), holds=all(same))


@claim(
    "9b",
    "gradient-error",
    where="6, 10.2",
    sentence="the first-order derivatives could be relatively inaccurate and the performance of "
    "the algorithm would still be satisfactory",
    rule="with a 30 % error (49) the sliding mode converges in every scenario of the sweep and "
    "violates nothing; partly if it converges in all and violates at most 1 % of the "
    "characteristic length",
)
def _first_derivatives_may_be_off(study: StudyResult) -> Finding:
    converged, depth, deviation = (
        dict(ending(study, SLIDING, 0.3, name))
        for name in ("converged", "violation", "deviation_px")
    )
    if not depth or not all(map(isfinite, depth.values())):
        raise NotMeasured("the study gradient-error has no run of the sliding mode with c_e = 0.3")
    arrived = all(value == 1.0 for value in converged.values())
    texts = []
    for name, violation in depth.items():
        ends = "converges" if converged[name] == 1.0 else "does not converge"
        violates = f"{violation:.2g} % of L" if violation > 0 else "nothing"
        apart = deviation.get(name, nan)
        texts.append(f"{name}: {ends}, violates {violates}, tracks deviate by {apart:.2g} px")
    most = max(depth.values())
    return finding(
        "; ".join(texts),
        holds=arrived and most <= 0.0,
        partly=arrived and most <= SLIGHT,
        **depth,
    )


# --- Chattering ---


@claim(
    "10d",
    "sampling-time",
    where="6",
    sentence="the chattering problem becomes negligible for reasonable fast sampling rates",
    rule="at the shortest sampling time of the sweep the band is below 0.02, a fiftieth of the "
    "range of σ inside the image",
)
def _chattering_becomes_negligible(study: StudyResult) -> Finding:
    """Band of the first example at each sampling time, the shortest last."""
    of = (SCENARIOS[0], "band")
    bands = {}
    for key, band in study.numbers.items():
        if key[:2] == of:
            bands[float(key[2])] = band
    if not bands:
        raise NotMeasured("the study sampling-time has no band of the first example")
    values = {f"{time:g}": bands[time] for time in sorted(bands, reverse=True)}
    shown = ", ".join(f"{band:.3f} at {time} ms" for time, band in values.items())
    good = bands[min(bands)] <= 0.02
    return finding(f"band of φ: {shown}", holds=good, partly=False, **values)
