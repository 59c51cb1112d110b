"""Claims 3 and 4: section 8, the trap and the corners."""

from __future__ import annotations

import numpy as np

from ..runs import Run, RunSpec
from ..verdicts import Finding, claim, judged, shown_intervals
from .boundary import FULFILLED_RULE, VANISHED, fulfilled, phi_never_positive, plural, signed
from .first_example import angle, position

BOWL = RunSpec("example-2d-bowl")
CONVEX = RunSpec("example-2d-heart-convex")
CONCAVE = RunSpec("example-2d-heart-concave")

HEART, BOWL_ROW, OTHER_ROW = "occlusion[heart, marker 1]", "occlusion[bowl, marker 1]", "occlusion[bowl, marker 2]"
NOTCH, TIP = (-102.0, 35.0), (-137.0, 0.0)
"""The heart's concave corner in Fig. 8, and its convex one in Fig. 7, where the heart is turned [px]."""


# --- claim 3: Fig. 6 ---


@claim(
    "3a",
    "8.2, Fig. 6",
    "the first feature is blocked in a trap situation with the bowl-shaped constraint",
    "the run ends at rest away from the goal, and the first feature's bowl row acts until the end",
    "fig-06.png",
    BOWL,
)
def trapped_in_the_bowl(bowl: Run) -> Finding:
    """How the run ends, and which row holds it."""
    found = bowl.active_intervals(BOWL_ROW)
    until_end = bool(found) and found[-1][1] >= bowl.t[-1] - 1.0
    trapped = bowl.trajectory.status == "trapped"
    text = f"status {bowl.trajectory.status}; the row acts at {shown_intervals(found)} of {bowl.t[-1]:.0f} s"
    return Finding(judged(trapped and until_end, trapped or until_end), text)


@claim(
    "3b",
    "8.2, Fig. 6",
    "the robot reaches a local minima where the orientation error is zero",
    "at the end less than 1 % of the initial error",
    "fig-06.png",
    BOWL,
)
def trapped_with_the_right_orientation(bowl: Run) -> Finding:
    """Angle between camera and goal."""
    first, last = float(angle(bowl)[0]), float(angle(bowl)[-1])
    text = f"{first:.4f} rad at first, {last:.4f} rad after {bowl.t[-1]:.0f} s"
    return Finding(judged(last < VANISHED * first), text, {"first": first, "last": last})


@claim("3c", "8.2, Fig. 6", "but the position error is not zero", "at the end more than 5 mm", "fig-06.png", BOWL)
def trapped_away_from_theposition(bowl: Run) -> Finding:
    """Distance between camera and goal."""
    last = float(position(bowl)[-1])
    return Finding(judged(last > 0.005), f"{1e3 * last:.0f} mm after {bowl.t[-1]:.0f} s", {"last": last})


@claim(
    "3d",
    "8.2, Fig. 6",
    "the SMC is stable at the mentioned local minima",
    "in the last 2 s the camera moves less than 5 mm, joints stay below 0.05 rad/s, and peak-to-peak φ of the bowl is "
    "at most 10 % above that of 2 s in the middle of the run",
    "fig-06.png",
    BOWL,
)
def stable_in_the_trap(bowl: Run) -> Finding:
    """Motion of the camera and φ in the last two seconds."""
    end = float(bowl.t[-1])
    last, middle = bowl.t >= end - 2.0, (bowl.t >= 0.5 * end) & (bowl.t <= 0.5 * end + 2.0)
    place = bowl.trajectory.camera_position
    moved = float(np.linalg.norm(place[last] - place[-1], axis=1).max())
    speed = float(np.abs(bowl.trajectory.qd[last]).max())
    phi = bowl.phi(BOWL_ROW)
    before, now = float(np.ptp(phi[middle])), float(np.ptp(phi[last]))
    depth = -float(bowl.row(BOWL_ROW)["clearance_min"])
    text = (
        f"in the last 2 s the camera moves {1e3 * moved:.2f} mm, joints move at up to {speed:.3f} rad/s, φ by "
        f"{now:.3f} ({before:.3f} in the middle of the run; T_s u⁺ = {bowl.bound(BOWL_ROW):g}); the marker is at most "
        f"{depth:.2f} px inside the bowl"
    )
    rests = moved < 0.005 and speed < 0.05
    values = {"moved": moved, "speed": speed, "phi_range": now, "phi_range_before": before, "depth": depth}
    return Finding(judged(rests and now <= 1.1 * before, rests), text, values)


@claim(
    "3e",
    "4.3.3, 8.2",
    "a constraint can be used to guarantee that all image features do not enter the area",
    f"of both features, {FULFILLED_RULE}",
    "fig-06.png",
    BOWL,
)
def both_features_stay_out(bowl: Run) -> Finding:
    """φ and σ of both features' rows."""
    rows = [BOWL_ROW, OTHER_ROW]
    found = phi_never_positive(bowl, rows)
    each = "; ".join(
        f"{label}: max φ = {float(bowl.phi(label).max()):.3g} ({float(bowl.phi(label).max()) / bowl.bound(label):.3g} "
        f"T_s u⁺), φ ≥ 0 for {plural(bowl.positive_samples(label))} in a row, least clearance "
        f"{signed(float(bowl.row(label)['clearance_min']))} px"
        for label in rows
    )
    needed = float(bowl.drift[:, bowl.index(OTHER_ROW)].max())
    text = f"{each}; (12) asks the second's row for u⁺ > {needed:.3g}"
    return Finding(found.verdict, text, found.values)


# --- claim 4: Figs. 7 and 8 ---


@claim(
    "4a",
    "8.2, Fig. 7",
    "the convex non-differentiable point of the heart-shaped constraint is overcome with no problem",
    "the marker comes within 5 px of the corner, max σ ≤ 0, φ within T_s u⁺, and the goal is reached",
    "fig-07.png",
    CONVEX,
)
def convex_corner_passed(convex: Run) -> Finding:
    """Σ at the corner, and the end of the run."""
    good, text, values = fulfilled(convex, HEART)
    near = float(np.linalg.norm(convex.trajectory.features_px[:, 0] - TIP, axis=1).min())
    converged = convex.trajectory.status == "converged"
    text = f"{text}; passes {near:.1f} px from the corner; {convex.trajectory.status}"
    passed = converged and values["sigma_max"] <= 0.0
    return Finding(judged(good and passed and near < 5.0, passed), text, {**values, "nearest": near})


@claim(
    "4b",
    "8.2, Fig. 8",
    "the constraint is unfulfilled (φ_V,1occ > 0) at the concave non-differentiable point",
    "max φ above 5 T_s u⁺ and max σ > 0, within 20 px of the corner",
    "fig-08.png",
    CONCAVE,
)
def concave_corner_violated(concave: Run) -> Finding:
    """Where and by how much φ is positive."""
    _, text, values = fulfilled(concave, HEART)
    worst = concave.trajectory.features_px[int(concave.phi(HEART).argmax()), 0]
    away = float(np.linalg.norm(worst - NOTCH))
    depth = -float(concave.row(HEART)["clearance_min"])
    text = f"{text}; {depth:.1f} px inside the heart, {away:.1f} px from the corner where φ is greatest"
    beyond = values["phi_max"] > 5.0 * values["bound"]
    good = beyond and values["sigma_max"] > 0.0 and away < 20.0
    return Finding(judged(good, beyond), text, {**values, "depth": depth, "away": away})


@claim(
    "4c",
    "5.5",
    "at such a point the SM behavior of the proposed method is temporarily lost",
    "φ stays positive for more than five samples in a row, returns, and in the last 2 s stays within T_s u⁺",
    "fig-08.png",
    CONCAVE,
)
def sliding_mode_temporarily_lost(concave: Run) -> Finding:
    """How long φ stays positive, and where it is at the end."""
    samples, phi = concave.positive_samples(HEART), concave.phi(HEART)
    last = float(phi[concave.t >= concave.t[-1] - 2.0].max())
    trajectory = concave.trajectory
    distance, angle = trajectory.camera_error[-1]
    text = (
        f"φ > 0 for {plural(samples)} in a row ({samples * concave.sampling_time:.3f} s), max φ in the last 2 s "
        f"{signed(last)}; the run ends {trajectory.status}, {1e3 * distance:.1f} mm and {1e3 * angle:.1f} mrad from "
        "the goal"
    )
    lost, back = samples > 5, last <= concave.bound(HEART)
    return Finding(judged(lost and back, lost), text, {"samples": float(samples), "phi_last": last})
