"""Claims 3 and 4: section 8, the trap and the corners."""

from __future__ import annotations

import numpy as np

from ...comparisons.run import Run
from ...comparisons.runs.spec import RunSpec
from ...rows.readable import amount
from ..verdicts import Finding, claim, finding, plural, shown_intervals
from .boundary import VANISHED, clear, excess, fulfilled, greatest_phi, phi_never_positive
from .first_example import angle, position

BOWL = RunSpec("example-2d-bowl")
CONVEX = RunSpec("example-2d-heart-convex")
CONCAVE = RunSpec("example-2d-heart-concave")

HEART, BOWL_ROW, OTHER_ROW = "occlusion[heart, marker 1]", "occlusion[bowl, marker 1]", "occlusion[bowl, marker 2]"
NOTCH, TIP = (-102.0, 35.0), (-137.0, 0.0)
"""The heart's concave corner in Fig. 8, and its convex one in Fig. 7, where the heart is turned [px]."""


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
