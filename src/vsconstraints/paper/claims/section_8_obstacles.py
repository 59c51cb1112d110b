"""Section 8, first example with a bowl and with a heart: claims 3a to 3d, 4a and 4b."""

from __future__ import annotations

import numpy as np

from ...comparisons.run import Run
from ...rows import Array
from ..scenes import BOWL, BOWL_ROW, CONCAVE, CONVEX, HEART, NOTCH, TIP
from ..verdicts import Finding, claim, finding, shown_intervals
from .boundary import ORIENTED, VANISHED, angle, clear, fulfilled, position


def first_marker(run: Run) -> Array:
    """Position (N, 2) of the first marker in the image [px]."""
    return run.trajectory.features_px[:, 0]


# --- Fig. 6: a trap ---


@claim(
    "3a",
    BOWL,
    where="8.2, Fig. 6",
    sentence="the first feature is blocked in a trap situation with the bowl-shaped constraint",
    rule="the run ends at rest away from the goal, and the first feature's bowl row acts until the "
    "end",
)
def _blocked_in_the_bowl(bowl: Run) -> Finding:
    acts = bowl.active_intervals(BOWL_ROW)
    end = bowl.t[-1]
    until_end = bool(acts) and acts[-1][1] >= end - 1
    trapped = bowl.trajectory.status == "trapped"
    return finding(
        f"status {bowl.trajectory.status}; the row acts at {shown_intervals(acts)} of {end:.0f} s",
        holds=trapped and until_end,
        partly=trapped or until_end,
    )


@claim(
    "3b",
    BOWL,
    where="8.2, Fig. 6",
    sentence="the robot reaches a local minima where the orientation error is zero",
    rule=ORIENTED,
)
def _orientation_error_vanishes_in_the_bowl(bowl: Run) -> Finding:
    first = angle(bowl)[0]
    last = angle(bowl)[-1]
    return finding(
        f"{first:.4f} rad at first, {last:.4f} rad after {bowl.t[-1]:.0f} s",
        holds=last < VANISHED * first,
        first=first,
        last=last,
    )


@claim(
    "3c",
    BOWL,
    where="8.2, Fig. 6",
    sentence="but the position error is not zero",
    rule="at the end more than 5 mm",
)
def _position_error_remains_in_the_bowl(bowl: Run) -> Finding:
    last = position(bowl)[-1]
    return finding(f"{1e3 * last:.0f} mm after {bowl.t[-1]:.0f} s", holds=last > 0.005, last=last)


@claim(
    "3d",
    BOWL,
    where="8.2, Fig. 6",
    sentence="the SMC is stable at the mentioned local minima",
    rule="in the last 2 s the camera moves less than 5 mm, joints stay below 0.05 rad/s, and "
    "peak-to-peak φ of the bowl is at most 10 % above that of 2 s in the middle of the run",
)
def _stable_in_the_bowl(bowl: Run) -> Finding:
    phi = bowl.phi(BOWL_ROW)
    place = bowl.trajectory.camera_position
    end = bowl.t[-1]
    last = bowl.t >= end - 2
    middle = (bowl.t >= 0.5 * end) & (bowl.t <= 0.5 * end + 2)
    moved = np.linalg.norm(place[last] - place[-1], axis=1).max()
    speed = np.abs(bowl.trajectory.qd[last]).max()
    phi_range = np.ptp(phi[last])
    phi_range_before = np.ptp(phi[middle])
    depth = -clear(bowl, BOWL_ROW)
    at_rest = moved < 0.005 and speed < 0.05
    return finding(
        f"in the last 2 s the camera moves {1e3 * moved:.2f} mm, "
        f"joints move at up to {speed:.3f} rad/s, "
        f"φ by {phi_range:.3f} ({phi_range_before:.3f} in the middle of the run; "
        f"T_s u⁺ = {bowl.bound(BOWL_ROW):g}); "
        f"the marker is at most {depth:.2f} px inside the bowl",
        holds=at_rest and phi_range <= 1.1 * phi_range_before,
        partly=at_rest,
        moved=moved,
        speed=speed,
        phi_range=phi_range,
        phi_range_before=phi_range_before,
        depth=depth,
    )


# --- Figs. 7 and 8: corners ---


@claim(
    "4a",
    CONVEX,
    where="8.2, Fig. 7",
    sentence="the convex non-differentiable point of the heart-shaped constraint is overcome with "
    "no problem",
    rule="the marker comes within 5 px of the corner, max σ ≤ 0, φ within T_s u⁺, and the goal is "
    "reached",
)
def _convex_corner_is_passed(convex: Run) -> Finding:
    kept = fulfilled(convex, HEART)
    nearest = np.linalg.norm(first_marker(convex) - TIP, axis=1).min()
    status = convex.trajectory.status
    reached = status == "converged" and kept.values["sigma_max"] <= 0
    return finding(
        f"{kept.text}; passes {nearest:.1f} px from the corner; {status}",
        holds=reached and kept.verdict == "holds" and nearest < 5,
        partly=reached,
        **kept.values,
        nearest=nearest,
    )


@claim(
    "4b",
    CONCAVE,
    where="8.2, Fig. 8",
    sentence="the constraint is unfulfilled (φ_V,1occ > 0) at the concave non-differentiable point",
    rule="max φ above 5 T_s u⁺ and max σ > 0, within 20 px of the corner",
)
def _concave_corner_is_entered(concave: Run) -> Finding:
    kept = fulfilled(concave, HEART)
    depth = -clear(concave, HEART)
    away = np.linalg.norm(first_marker(concave)[concave.phi(HEART).argmax()] - NOTCH)
    unfulfilled = kept.values["phi_max"] > 5 * kept.values["bound"]
    return finding(
        f"{kept.text}; {depth:.1f} px inside the heart, "
        f"{away:.1f} px from the corner where φ is greatest",
        holds=unfulfilled and kept.values["sigma_max"] > 0 and away < 20,
        partly=unfulfilled,
        **kept.values,
        depth=depth,
        away=away,
    )
