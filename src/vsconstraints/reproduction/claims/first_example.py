"""Claims 1 and 2: section 8, the planar arm with the FOV constraint."""

from __future__ import annotations

import numpy as np

from ...rows import Array
from ..runs import Run, RunSpec
from ..verdicts import Finding, claim, judged, rounds_to, shown_intervals
from .boundary import FULFILLED_RULE, VANISHED, fulfilled, fully_used, phi_never_positive, signed, smoothly

FOV = RunSpec("example-2d-fov")
FAST = RunSpec("example-2d-fast")
HIGH_GAIN = RunSpec("example-2d-fast-high-gain")
HIGH_GAIN_FASTER_SAMPLING = RunSpec("example-2d-fast-high-gain", overrides=(("sampling_time", 0.001),))

HALVED = RunSpec("example-2d-fov", overrides=(("sampling_time", 0.0025),))

FIRST, SECOND = "fov[marker 1]", "fov[marker 2]"


def position(run: Run) -> Array:
    """(N,) distance between camera and goal [m]."""
    return run.trajectory.camera_error[:, 0]


def angle(run: Run) -> Array:
    """(N,) angle between camera and goal [rad]."""
    return run.trajectory.camera_error[:, 1]


# --- claim 1: Fig. 4 ---


@claim(
    "1a", "8.2, Fig. 4", "the second feature remains in the FOV", "max σ ≤ 0, between samples too", "fig-04.png", FOV
)
def second_feature_remains(fov: Run) -> Finding:
    """σ of the second marker."""
    sigma, least = float(fov.sigma(SECOND).max()), float(fov.row(SECOND)["clearance_min"])
    text = f"max σ = {signed(sigma)}; the marker stays {least:.2f} px inside the boundary"
    return Finding(judged(sigma <= 0.0 <= least), text, {"sigma_max": sigma, "clearance_min": least})


@claim(
    "1b",
    "8.2, Fig. 4",
    "the allowed space is fully utilized",
    "unused margin of at most 1 % of half the allowed image",
    "fig-04.png",
    FOV,
)
def border_fully_used(fov: Run) -> Finding:
    """Least clearance of the second marker."""
    return fully_used(fov, SECOND)


@claim(
    "1c",
    "8.2, Fig. 4",
    "the boundary of the hyperellipse constraint is reached smoothly",
    "the speed normal to the boundary never rises once the row acts, and at most 10 % of it is left 3 K later",
    "fig-04.png",
    FOV,
)
def border_reached_smoothly(fov: Run) -> Finding:
    """Normal speed of the second marker."""
    return smoothly(fov, SECOND)


@claim(
    "1d",
    "8.2, Fig. 4",
    "the initial error for the camera orientation is made zero",
    "at the end less than 1 % of the initial error",
    "fig-04.png",
    FOV,
)
def orientation_error_vanishes(fov: Run) -> Finding:
    """Angle between camera and goal."""
    first, last = float(angle(fov)[0]), float(angle(fov)[-1])
    settled = f"settled after {fov.settling_time:.2f} s (5 mm, 5 mrad)"
    text = f"{first:.4f} rad at first, {1e3 * last:.2g} mrad at the end; {settled}"
    return Finding(judged(last < VANISHED * first), text, {"first": first, "last": last, "settling": fov.settling_time})


@claim(
    "1e",
    "8.2, Fig. 4",
    "a position error arises when the FOV constraint is activated, which subsequently is made zero",
    "below 1 % of its peak before the row first acts and at the end; the peak while the row acts or between",
    "fig-04.png",
    FOV,
)
def position_error_arises_and_vanishes(fov: Run) -> Finding:
    """Distance between camera and goal."""
    error, found = position(fov), fov.active_intervals(SECOND)
    if not found:
        return Finding("does not hold", "the constraint never becomes active")
    start, end = found[0][0], found[-1][1]
    peak, when = float(error.max()), float(fov.t[int(error.argmax())])
    before, last = float(error[fov.t < start].max(initial=0.0)), float(error[-1])
    arises, vanishes = before < VANISHED * peak and start <= when <= end, last < VANISHED * peak
    text = (
        f"{1e3 * before:.2g} mm before {start:.2f} s, peak of {1e3 * peak:.1f} mm at {when:.2f} s, "
        f"{1e3 * last:.2g} mm at the end"
    )
    values = {"before": before, "peak": peak, "peak_at": when, "last": last}
    return Finding(judged(arises and vanishes, arises or vanishes), text, values)


@claim(
    "1f",
    "8.2, Fig. 4",
    "the FOV constraint becomes active at the time intervals 3-5 s and 8-9 s for the second image feature",
    "two intervals, their ends within 0.5 s of those printed; the first feature's row never acts",
    "fig-04.png",
    FOV,
)
def border_active_twice(fov: Run) -> Finding:
    """When φ ≥ 0."""
    found, other = fov.active_intervals(SECOND), fov.active_intervals(FIRST)
    good = rounds_to(found, [(3.0, 5.0), (8.0, 9.0)])
    text = f"active at {shown_intervals(found)}; for the first feature {shown_intervals(other)}"
    values = {
        f"{side}_{k}": time for k, pair in enumerate(found) for side, time in zip(("from", "to"), pair, strict=True)
    }
    return Finding(judged(good and not other, good), text, values)


@claim(
    "1g",
    "8.2, Fig. 4",
    "the FOV constraint is fulfilled, i.e., φ_V,2 ≤ 0",
    FULFILLED_RULE,
    "fig-04.png",
    FOV,
)
def border_fulfilled(fov: Run) -> Finding:
    """φ of the second marker, whose constraint is σ ≤ 0."""
    return phi_never_positive(fov, [SECOND])


def greatest_step(values: Array) -> float:
    """Greatest change of a column of (N, n) from one sample to the next."""
    return float(np.abs(np.diff(values, axis=0)).max())


@claim(
    "1h",
    "5.1",
    "the joint velocities are continuous, i.e., the control is smoother",
    "with half the sampling time the greatest step of a joint's speed between samples is at most 60 % as large, while "
    "that of the commanded acceleration is at least 80 % as large; partly if the former only",
    "",
    FOV,
    HALVED,
)
def speeds_are_continuous(fov: Run, halved: Run) -> Finding:
    """Greatest steps of q̇ and q̈_c between samples."""
    speed = [greatest_step(run.trajectory.qd) for run in (fov, halved)]
    jump = [greatest_step(run.trajectory.qdd_command) for run in (fov, halved)]
    text = (
        f"T_s = {1e3 * fov.sampling_time:g} ms and {1e3 * halved.sampling_time:g} ms: q̇ steps by up to "
        f"{1e3 * speed[0]:.3g} and {1e3 * speed[1]:.3g} mrad/s, q̈_c by up to {jump[0]:.3g} and {jump[1]:.3g} rad/s²"
    )
    continuous, switches = speed[1] <= 0.6 * speed[0], jump[1] >= 0.8 * jump[0]
    values = {"speed_ratio": speed[1] / speed[0], "acceleration_ratio": jump[1] / jump[0]}
    return Finding(judged(continuous and switches, continuous), text, values)


# --- claim 2: Fig. 5 ---


@claim(
    "2a",
    "8.2, Fig. 5",
    "with K_T,p(0) = 50 the positioning task is performed around three times faster",
    "settling times (5 mm, 5 mrad) in a ratio of 3 ± 25 %; partly if above 1",
    "fig-05.png",
    FOV,
    FAST,
)
def three_times_faster(fov: Run, fast: Run) -> Finding:
    """Ratio of settling times."""
    ratio = fov.settling_time / fast.settling_time
    text = f"settled after {fov.settling_time:.2f} s and {fast.settling_time:.2f} s: {ratio:.2f} times faster"
    return Finding(judged(2.25 <= ratio <= 3.75, ratio > 1.0), text, {"ratio": ratio})


@claim(
    "2b",
    "8.2, Fig. 5",
    "the smaller value of the switching gain (u⁺ = 10) is not enough to fulfill the FOV constraint",
    "φ exceeds 1.5 T_s u⁺ and stays positive for five samples in a row or more",
    "fig-05.png",
    FAST,
)
def small_gain_not_enough(fast: Run) -> Finding:
    """φ beyond its band: the sliding mode is lost."""
    _, text, values = fulfilled(fast, SECOND)
    beyond = values["phi_max"] > 1.5 * values["bound"]
    lost = values["positive_samples"] >= 5
    inside = (
        "; the marker itself stays inside (σ < 0), since φ also counts its speed" if values["sigma_max"] < 0 else ""
    )
    return Finding(judged(beyond and lost, beyond or lost), text + inside, values)


@claim(
    "2c",
    "8.2, Fig. 5",
    "when the large value (u⁺ = 50) is used the FOV constraint is fulfilled",
    FULFILLED_RULE,
    "fig-05.png",
    HIGH_GAIN,
)
def large_gain_enough(high: Run) -> Finding:
    """φ of the second marker, judged as in 1g."""
    return phi_never_positive(high, [SECOND])


@claim(
    "2d",
    "8.2, Figs. 4, 5",
    "the resulting chattering amplitude is also increased",
    "peak-to-peak φ while sliding is larger with u⁺ = 50 than in Fig. 4",
    "fig-05.png",
    FOV,
    HIGH_GAIN,
)
def chattering_grows(fov: Run, high: Run) -> Finding:
    """Peak-to-peak φ while the row acts."""
    slow, fast = (float(np.ptp(run.while_sliding(SECOND))) for run in (fov, high))
    text = f"φ moves by {slow:.3f} (u⁺ = 10, Fig. 4) and {fast:.3f} (u⁺ = 50): {fast / slow:.1f} times as much"
    return Finding(judged(fast > slow), text, {"slow": slow, "fast": fast})


@claim(
    "2e",
    "8.2",
    "faster motions need a larger switching gain, since the lower bound in (12) is larger",
    "greatest Σ max(L_fφ, 0) over the active rows larger with K_T,p(0) = 50 than with 20",
    "fig-05.png",
    FOV,
    FAST,
)
def bound_grows_with_speed(fov: Run, fast: Run) -> Finding:
    """Right-hand side of eq. (12) along both motions."""
    slow, quick = (float(run.needed_gain().max()) for run in (fov, fast))
    text = f"(12) asks for u⁺ > {slow:.2f} in Fig. 4 and u⁺ > {quick:.2f} in Fig. 5"
    return Finding(judged(quick > slow), text, {"slow": slow, "fast": quick})


@claim(
    "2f",
    "8.2, eq. (43)",
    "the sampling time has to be reduced in accordance to keep the same chattering amplitude",
    "with T_s five times shorter, as u⁺ is five times larger, peak-to-peak φ is at most that of Fig. 4 plus 10 %",
    "fig-05.png",
    FOV,
    HIGH_GAIN_FASTER_SAMPLING,
)
def faster_sampling_restores_the_band(fov: Run, high: Run) -> Finding:
    """Peak-to-peak φ with u⁺ T_s as in Fig. 4."""
    slow, fast = (float(np.ptp(run.while_sliding(SECOND))) for run in (fov, high))
    text = f"with u⁺ = 50 and T_s = {1e3 * high.sampling_time:g} ms φ moves by {fast:.3f}, in Fig. 4 by {slow:.3f}"
    return Finding(judged(fast <= 1.1 * slow), text, {"slow": slow, "fast": fast})
