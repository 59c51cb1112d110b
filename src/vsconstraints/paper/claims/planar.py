"""Claims 1 to 4: section 8, the planar arm with the FOV constraint, in a trap and at corners."""

from __future__ import annotations

import numpy as np

from ...comparisons.run import Run
from ...comparisons.runs.spec import RunSpec
from ...rows import Array
from ...rows.readable import amount
from ..verdicts import Finding, claim, ends_of, finding, plural, rounds_to, shown_intervals
from .boundary import (
    VANISHED,
    clear,
    excess,
    fulfilled,
    fully_used,
    greatest_phi,
    greatest_sigma,
    phi_never_positive,
    smoothly,
)

FOV = RunSpec("example-2d-fov")
FAST = RunSpec("example-2d-fast")
HIGH_GAIN = RunSpec("example-2d-fast-high-gain")
HIGH_GAIN_FASTER_SAMPLING = RunSpec("example-2d-fast-high-gain", overrides={"sampling_time": 0.001})
HALVED = RunSpec("example-2d-fov", overrides={"sampling_time": 0.0025})

FIRST, SECOND = "fov[marker 1]", "fov[marker 2]"
BOWL = RunSpec("example-2d-bowl")
CONVEX = RunSpec("example-2d-heart-convex")
CONCAVE = RunSpec("example-2d-heart-concave")

HEART, BOWL_ROW, OTHER_ROW = "occlusion[heart, marker 1]", "occlusion[bowl, marker 1]", "occlusion[bowl, marker 2]"
NOTCH, TIP = (-102.0, 35.0), (-137.0, 0.0)
"""The heart's concave corner in Fig. 8, and its convex one in Fig. 7, where the heart is turned [px]."""


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


# --- claim 3: Fig. 6 ---


@claim("3a", BOWL)
def _trapped_in_the_bowl(bowl: Run) -> Finding:
    found, end = bowl.active_intervals(BOWL_ROW), bowl.t[-1]
    until_end, trapped = bool(found) and found[-1][1] >= end - 1.0, bowl.trajectory.status == "trapped"
    text = f"status {bowl.trajectory.status}; the row acts at {shown_intervals(found)} of {end:.0f} s"
    return finding(text, trapped and until_end, trapped or until_end)


@claim("3b", BOWL)
def _trapped_with_the_right_orientation(bowl: Run) -> Finding:
    first, last = angle(bowl)[0], angle(bowl)[-1]
    text = f"{first:.4f} rad at first, {last:.4f} rad after {bowl.t[-1]:.0f} s"
    return finding(text, last < VANISHED * first, first=first, last=last)


@claim("3c", BOWL)
def _trapped_away_from_the_position(bowl: Run) -> Finding:
    last = position(bowl)[-1]
    return finding(f"{1e3 * last:.0f} mm after {bowl.t[-1]:.0f} s", last > 0.005, last=last)


@claim("3d", BOWL)
def _stable_in_the_trap(bowl: Run) -> Finding:
    end, phi, place = bowl.t[-1], bowl.phi(BOWL_ROW), bowl.trajectory.camera_position
    last, middle = bowl.t >= end - 2.0, (bowl.t >= 0.5 * end) & (bowl.t <= 0.5 * end + 2.0)
    moved = np.linalg.norm(place[last] - place[-1], axis=1).max()
    speed = np.abs(bowl.trajectory.qd[last]).max()
    before, now, depth = np.ptp(phi[middle]), np.ptp(phi[last]), -clear(bowl, BOWL_ROW)
    text = (
        f"in the last 2 s the camera moves {1e3 * moved:.2f} mm, joints move at up to {speed:.3f} rad/s, φ by "
        f"{now:.3f} ({before:.3f} in the middle of the run; T_s u⁺ = {bowl.bound(BOWL_ROW):g}); the marker is at most "
        f"{depth:.2f} px inside the bowl"
    )
    rests = moved < 0.005 and speed < 0.05
    values = {"moved": moved, "speed": speed, "phi_range": now, "phi_range_before": before, "depth": depth}
    return finding(text, rests and now <= 1.1 * before, rests, **values)


@claim("3e", BOWL)
def _both_features_stay_out(bowl: Run) -> Finding:
    rows = [BOWL_ROW, OTHER_ROW]
    found = phi_never_positive(bowl, rows)
    each = "; ".join(
        f"{label}: max φ = {greatest_phi(bowl, label):.3g} ({excess(bowl, label):.3g} T_s u⁺), φ ≥ 0 for "
        f"{plural(bowl.positive_samples(label))} in a row, least clearance {amount(clear(bowl, label))} px"
        for label in rows
    )
    needed = bowl.drift[:, bowl.index(OTHER_ROW)].max()
    return Finding(found.verdict, f"{each}; (12) asks the second's row for u⁺ > {needed:.3g}", found.values)


# --- claim 4: Figs. 7 and 8 ---


@claim("4a", CONVEX)
def _convex_corner_passed(convex: Run) -> Finding:
    found, status = fulfilled(convex, HEART), convex.trajectory.status
    near = np.linalg.norm(convex.trajectory.features_px[:, 0] - TIP, axis=1).min()
    text = f"{found.text}; passes {near:.1f} px from the corner; {status}"
    passed = status == "converged" and found.values["sigma_max"] <= 0.0
    good = found.verdict == "holds" and passed and near < 5.0
    return finding(text, good, passed, **found.values, nearest=near)


@claim("4b", CONCAVE)
def _concave_corner_violated(concave: Run) -> Finding:
    found, depth = fulfilled(concave, HEART), -clear(concave, HEART)
    worst = concave.trajectory.features_px[concave.phi(HEART).argmax(), 0]
    away = np.linalg.norm(worst - NOTCH)
    text = f"{found.text}; {depth:.1f} px inside the heart, {away:.1f} px from the corner where φ is greatest"
    beyond = found.values["phi_max"] > 5.0 * found.values["bound"]
    good = beyond and found.values["sigma_max"] > 0.0 and away < 20.0
    return finding(text, bool(good), beyond, **found.values, depth=depth, away=float(away))


@claim("4c", CONCAVE)
def _sliding_mode_temporarily_lost(concave: Run) -> Finding:
    samples, phi, trajectory = concave.positive_samples(HEART), concave.phi(HEART), concave.trajectory
    last = phi[concave.t >= concave.t[-1] - 2.0].max()
    text = (
        f"φ > 0 for {plural(samples)} in a row ({samples * concave.sampling_time:.3f} s), max φ in the last 2 s "
        f"{amount(last)}; the run ends {trajectory.status}, {1e3 * position(concave)[-1]:.1f} mm and "
        f"{1e3 * angle(concave)[-1]:.1f} mrad from the goal"
    )
    lost, back = samples > 5, last <= concave.bound(HEART)
    return finding(text, lost and back, lost, samples=samples, phi_last=last)
