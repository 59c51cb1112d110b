"""Section 8, first example with the border of the image: claims 1a to 1g, 2a to 2f and 10a."""

from __future__ import annotations

from itertools import pairwise
from math import inf, isfinite, nan

import numpy as np

from ...comparisons.run import Run
from ...rows.readable import amount
from ..scenes import FAST, FIRST, FOV, HIGH_GAIN, SAMPLED_FASTER, SECOND
from ..studies import StudyResult
from ..verdicts import Finding, NotMeasured, claim, finding, shown_intervals
from .boundary import (
    FULFILLED,
    ORIENTED,
    SMOOTHLY,
    VANISHED,
    angle,
    clear,
    ending,
    ends_of,
    fulfilled,
    fully_used,
    greatest_sigma,
    number,
    phi_never_positive,
    position,
    rounds_to,
    smoothly,
)


def band(run: Run) -> float:
    """Peak-to-peak φ while the second feature's row is active."""
    return float(np.ptp(run.while_sliding(SECOND)))


# --- Fig. 4: the border of the image ---


@claim(
    "1a",
    FOV,
    where="8.2, Fig. 4",
    sentence="the second feature remains in the FOV",
    rule="max σ ≤ 0, between samples too",
)
def _remains_in_the_image(fov: Run) -> Finding:
    sigma = greatest_sigma(fov, SECOND)
    clearance = clear(fov, SECOND)
    return finding(
        f"max σ = {amount(sigma)}; the marker stays {clearance:.2f} px inside the boundary",
        holds=sigma <= 0 and clearance >= 0,
        sigma_max=sigma,
        clearance_min=clearance,
    )


@claim(
    "1b",
    FOV,
    where="8.2, Fig. 4",
    sentence="the allowed space is fully utilized",
    rule="unused margin of at most 1 % of half the allowed image",
)
def _space_is_used(fov: Run) -> Finding:
    return fully_used(fov, SECOND)


@claim(
    "1c",
    FOV,
    where="8.2, Fig. 4",
    sentence="the boundary of the hyperellipse constraint is reached smoothly",
    rule=SMOOTHLY,
)
def _boundary_is_reached_smoothly(fov: Run) -> Finding:
    return smoothly(fov, SECOND)


@claim(
    "1d",
    FOV,
    where="8.2, Fig. 4",
    sentence="the initial error for the camera orientation is made zero",
    rule=ORIENTED,
)
def _orientation_error_vanishes(fov: Run) -> Finding:
    first = angle(fov)[0]
    last = angle(fov)[-1]
    settling = fov.settling_time
    return finding(
        f"{first:.4f} rad at first, {1e3 * last:.2g} mrad at the end; "
        f"settled after {settling:.2f} s (5 mm, 5 mrad)",
        holds=last < VANISHED * first,
        first=first,
        last=last,
        settling=settling,
    )


@claim(
    "1e",
    FOV,
    where="8.2, Fig. 4",
    sentence="a position error arises when the FOV constraint is activated, which subsequently is "
    "made zero",
    rule="below 1 % of its peak before the row first acts and at the end; the peak while the row "
    "acts or between",
)
def _position_error_arises_and_vanishes(fov: Run) -> Finding:
    error = position(fov)
    acts = fov.active_intervals(SECOND)
    if not acts:
        return finding("the constraint never becomes active", holds=False)
    start = acts[0][0]
    end = acts[-1][1]
    peak = error.max()
    when = float(fov.t[error.argmax()])
    before = error[fov.t < start].max(initial=0.0)
    last = error[-1]
    arises = before < VANISHED * peak and start <= when <= end
    vanishes = last < VANISHED * peak
    return finding(
        f"{1e3 * before:.2g} mm before {start:.2f} s, "
        f"peak of {1e3 * peak:.1f} mm at {when:.2f} s, {1e3 * last:.2g} mm at the end",
        holds=arises and vanishes,
        partly=arises or vanishes,
        before=before,
        peak=peak,
        peak_at=when,
        last=last,
    )


@claim(
    "1f",
    FOV,
    where="8.2, Fig. 4",
    sentence="the FOV constraint becomes active at the time intervals 3-5 s and 8-9 s for the "
    "second image feature",
    rule="two intervals, their ends within 0.5 s of those printed; the first feature's row never "
    "acts",
)
def _active_intervals(fov: Run) -> Finding:
    second = fov.active_intervals(SECOND)
    first = fov.active_intervals(FIRST)
    as_printed = rounds_to(second, [(3, 5), (8, 9)])
    return finding(
        f"active at {shown_intervals(second)}; for the first feature {shown_intervals(first)}",
        holds=as_printed and not first,
        partly=as_printed,
        **ends_of(second),
    )


@claim(
    "1g",
    FOV,
    where="8.2, Fig. 4",
    sentence="the FOV constraint is fulfilled, i.e., φ_V,2 ≤ 0",
    rule=FULFILLED,
)
def _image_border_is_kept(fov: Run) -> Finding:
    return phi_never_positive(fov, [SECOND])


# --- Fig. 5: fast motion and the switching gain ---


@claim(
    "2a",
    FOV,
    FAST,
    where="8.2, Fig. 5",
    sentence="with K_T,p(0) = 50 the positioning task is performed around three times faster",
    rule="settling times (5 mm, 5 mrad) in a ratio of 3 ± 25 %; partly if above 1",
)
def _three_times_faster(fov: Run, fast: Run) -> Finding:
    ratio = fov.settling_time / fast.settling_time
    return finding(
        f"settled after {fov.settling_time:.2f} s and {fast.settling_time:.2f} s: "
        f"{ratio:.2f} times faster",
        holds=2.25 <= ratio <= 3.75,
        partly=ratio > 1,
        ratio=ratio,
    )


@claim(
    "2b",
    FAST,
    where="8.2, Fig. 5",
    sentence="the smaller value of the switching gain (u⁺ = 10) is not enough to fulfill the FOV "
    "constraint",
    rule="φ exceeds 1.5 T_s u⁺ and stays positive for five samples in a row or more",
)
def _small_gain_is_not_enough(fast: Run) -> Finding:
    kept = fulfilled(fast, SECOND)
    values = kept.values
    large = values["phi_max"] > 1.5 * values["bound"]
    lasting = values["positive_samples"] >= 5
    text = kept.text
    if values["sigma_max"] < 0:
        text += "; the marker itself stays inside (σ < 0), since φ also counts its speed"
    return finding(text, holds=large and lasting, partly=large or lasting, **values)


@claim(
    "2c",
    HIGH_GAIN,
    where="8.2, Fig. 5",
    sentence="when the large value (u⁺ = 50) is used the FOV constraint is fulfilled",
    rule=FULFILLED,
)
def _large_gain_is_enough(high_gain: Run) -> Finding:
    return phi_never_positive(high_gain, [SECOND])


@claim(
    "2d",
    FOV,
    HIGH_GAIN,
    where="8.2, Figs. 4, 5",
    sentence="the resulting chattering amplitude is also increased",
    rule="peak-to-peak φ while sliding is larger with u⁺ = 50 than in Fig. 4",
)
def _chattering_grows_with_the_gain(fov: Run, high_gain: Run) -> Finding:
    slow = band(fov)
    fast = band(high_gain)
    return finding(
        f"φ moves by {slow:.3f} (u⁺ = 10, Fig. 4) and {fast:.3f} (u⁺ = 50): "
        f"{fast / slow:.1f} times as much",
        holds=fast > slow,
        slow=slow,
        fast=fast,
    )


@claim(
    "2e",
    FOV,
    FAST,
    where="8.2",
    sentence="faster motions need a larger switching gain, since the lower bound in (12) is larger",
    rule="greatest Σ max(L_fφ, 0) over the active rows larger with K_T,p(0) = 50 than with 20",
    figure="fig-05.png",
)
def _faster_motion_needs_a_larger_gain(fov: Run, fast: Run) -> Finding:
    slow_bound = fov.needed_gain().max()
    fast_bound = fast.needed_gain().max()
    return finding(
        f"(12) asks for u⁺ > {slow_bound:.2f} in Fig. 4 and u⁺ > {fast_bound:.2f} in Fig. 5",
        holds=fast_bound > slow_bound,
        slow=slow_bound,
        fast=fast_bound,
    )


@claim(
    "2f",
    FOV,
    SAMPLED_FASTER,
    where="8.2, eq. (43)",
    sentence="the sampling time has to be reduced in accordance to keep the same chattering "
    "amplitude",
    rule="with T_s five times shorter, as u⁺ is five times larger, peak-to-peak φ is at most that "
    "of Fig. 4 plus 10 %",
    figure="fig-05.png",
)
def _shorter_sampling_time_keeps_the_band(fov: Run, sampled_faster: Run) -> Finding:
    slow = band(fov)
    fast = band(sampled_faster)
    return finding(
        f"with u⁺ = 50 and T_s = {1e3 * sampled_faster.sampling_time:g} ms "
        f"φ moves by {fast:.3f}, in Fig. 4 by {slow:.3f}",
        holds=fast <= 1.1 * slow,
        slow=slow,
        fast=fast,
    )


@claim(
    "10a",
    "switching-gain",
    where="8.2",
    sentence="in general, the switching gain has to be increased when faster robot motions are "
    "considered, since the lower bound in (12) is larger",
    rule="with every faster motion the bound (12) rises, and the smallest gain tried that keeps φ "
    "within T_s u⁺ never falls, and rises in all; partly if one of both",
)
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
    texts = []
    for Kp0, bound, gain in zip(speeds, bounds, gains, strict=True):
        smallest = f"{gain:g}" if isfinite(gain) else "no gain tried"
        texts.append(f"K_T,p(0) = {Kp0:g}: (12) asks for {bound:.3g}, {smallest} is enough")
    values = {f"{Kp0:g}": gain for Kp0, gain in zip(speeds, gains, strict=True)}
    return finding("; ".join(texts), holds=rises and follows, partly=rises or follows, **values)
