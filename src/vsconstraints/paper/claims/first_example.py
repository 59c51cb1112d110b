"""Claims 1 and 2: section 8, the planar arm with the FOV constraint."""

from __future__ import annotations

import numpy as np

from ...comparisons.run import Run
from ...comparisons.runs.spec import RunSpec
from ...rows import Array
from ...rows.readable import amount
from ..verdicts import Finding, claim, ends_of, finding, rounds_to, shown_intervals
from .boundary import VANISHED, clear, fulfilled, fully_used, greatest_sigma, phi_never_positive, smoothly

FOV = RunSpec("example-2d-fov")
FAST = RunSpec("example-2d-fast")
HIGH_GAIN = RunSpec("example-2d-fast-high-gain")
HIGH_GAIN_FASTER_SAMPLING = RunSpec("example-2d-fast-high-gain", overrides={"sampling_time": 0.001})
HALVED = RunSpec("example-2d-fov", overrides={"sampling_time": 0.0025})

FIRST, SECOND = "fov[marker 1]", "fov[marker 2]"


def position(run: Run) -> Array:
    """(N,) distance between camera and goal [m]."""
    return run.trajectory.camera_error[:, 0]


def angle(run: Run) -> Array:
    """(N,) angle between camera and goal [rad]."""
    return run.trajectory.camera_error[:, 1]


# --- claim 1: Fig. 4 ---

claim("1b", FOV)(lambda fov: fully_used(fov, SECOND))
claim("1c", FOV)(lambda fov: smoothly(fov, SECOND))
claim("1g", FOV)(lambda fov: phi_never_positive(fov, [SECOND]))


@claim("1a", FOV)
def _second_feature_remains(fov: Run) -> Finding:
    sigma, least = greatest_sigma(fov, SECOND), clear(fov, SECOND)
    text = f"max σ = {amount(sigma)}; the marker stays {least:.2f} px inside the boundary"
    return finding(text, sigma <= 0.0 <= least, sigma_max=sigma, clearance_min=least)


@claim("1d", FOV)
def _orientation_error_vanishes(fov: Run) -> Finding:
    first, last, settled = angle(fov)[0], angle(fov)[-1], fov.settling_time
    text = f"{first:.4f} rad at first, {1e3 * last:.2g} mrad at the end; settled after {settled:.2f} s (5 mm, 5 mrad)"
    return finding(text, last < VANISHED * first, first=first, last=last, settling=settled)


@claim("1e", FOV)
def _position_error_arises_and_vanishes(fov: Run) -> Finding:
    error, found = position(fov), fov.active_intervals(SECOND)
    if not found:
        return Finding("does not hold", "the constraint never becomes active")
    start, end = found[0][0], found[-1][1]
    peak, when = error.max(), float(fov.t[error.argmax()])
    before, last = error[fov.t < start].max(initial=0.0), error[-1]
    arises, vanishes = before < VANISHED * peak and start <= when <= end, last < VANISHED * peak
    text = (
        f"{1e3 * before:.2g} mm before {start:.2f} s, peak of {1e3 * peak:.1f} mm at {when:.2f} s, "
        f"{1e3 * last:.2g} mm at the end"
    )
    both, one = arises and vanishes, arises or vanishes
    return finding(text, both, one, before=before, peak=peak, peak_at=when, last=last)


@claim("1f", FOV)
def _border_active_twice(fov: Run) -> Finding:
    found, other = fov.active_intervals(SECOND), fov.active_intervals(FIRST)
    good = rounds_to(found, [(3.0, 5.0), (8.0, 9.0)])
    text = f"active at {shown_intervals(found)}; for the first feature {shown_intervals(other)}"
    return finding(text, good and not other, good, **ends_of(found))


def greatest_step(values: Array) -> float:
    """Greatest change of a column of (N, n) from one sample to the next."""
    return float(np.abs(np.diff(values, axis=0)).max())


@claim("1h", FOV, HALVED)
def _speeds_are_continuous(*runs: Run) -> Finding:
    times = [run.sampling_time for run in runs]
    speed = [greatest_step(run.trajectory.qd) for run in runs]
    jump = [greatest_step(run.trajectory.qdd_command) for run in runs]
    text = (
        f"T_s = {1e3 * times[0]:g} ms and {1e3 * times[1]:g} ms: q̇ steps by up to {1e3 * speed[0]:.3g} and "
        f"{1e3 * speed[1]:.3g} mrad/s, q̈_c by up to {jump[0]:.3g} and {jump[1]:.3g} rad/s²"
    )
    continuous, switches = speed[1] <= 0.6 * speed[0], jump[1] >= 0.8 * jump[0]
    ratios = {"speed_ratio": speed[1] / speed[0], "acceleration_ratio": jump[1] / jump[0]}
    return finding(text, continuous and switches, continuous, **ratios)


# --- claim 2: Fig. 5 ---

claim("2c", HIGH_GAIN)(lambda high: phi_never_positive(high, [SECOND]))


@claim("2a", FOV, FAST)
def _three_times_faster(fov: Run, fast: Run) -> Finding:
    ratio = fov.settling_time / fast.settling_time
    text = f"settled after {fov.settling_time:.2f} s and {fast.settling_time:.2f} s: {ratio:.2f} times faster"
    return finding(text, 2.25 <= ratio <= 3.75, ratio > 1.0, ratio=ratio)


@claim("2b", FAST)
def _small_gain_not_enough(fast: Run) -> Finding:
    """φ beyond its band: the sliding mode is lost."""
    found = fulfilled(fast, SECOND)
    beyond, lost = found.values["phi_max"] > 1.5 * found.values["bound"], found.values["positive_samples"] >= 5
    inside = "; the marker itself stays inside (σ < 0), since φ also counts its speed"
    text = found.text + (inside if found.values["sigma_max"] < 0 else "")
    return finding(text, beyond and lost, beyond or lost, **found.values)


def band(run: Run) -> float:
    """Peak-to-peak φ while the second feature's row acts."""
    return float(np.ptp(run.while_sliding(SECOND)))


@claim("2d", FOV, HIGH_GAIN)
def _chattering_grows(fov: Run, high: Run) -> Finding:
    slow, fast = band(fov), band(high)
    text = f"φ moves by {slow:.3f} (u⁺ = 10, Fig. 4) and {fast:.3f} (u⁺ = 50): {fast / slow:.1f} times as much"
    return finding(text, fast > slow, slow=slow, fast=fast)


@claim("2e", FOV, FAST)
def _bound_grows_with_speed(fov: Run, fast: Run) -> Finding:
    slow, quick = fov.needed_gain().max(), fast.needed_gain().max()
    text = f"(12) asks for u⁺ > {slow:.2f} in Fig. 4 and u⁺ > {quick:.2f} in Fig. 5"
    return finding(text, quick > slow, slow=slow, fast=quick)


@claim("2f", FOV, HIGH_GAIN_FASTER_SAMPLING)
def _faster_sampling_restores_the_band(fov: Run, high: Run) -> Finding:
    slow, fast = band(fov), band(high)
    text = f"with u⁺ = 50 and T_s = {1e3 * high.sampling_time:g} ms φ moves by {fast:.3f}, in Fig. 4 by {slow:.3f}"
    return finding(text, fast <= 1.1 * slow, slow=slow, fast=fast)
