"""Claim 6: section 10, the experiments, simulated at the sampling time of the real ones."""

from __future__ import annotations

import numpy as np

from ...rows import BoolArray
from ...simulation import intervals
from ..runs import Run, RunSpec
from ..verdicts import Finding, NotMeasured, claim, judged, shown_intervals
from .boundary import FULLY, Margin, signed

PBVS, PBVS_ERROR = RunSpec("experiment-1-pbvs"), RunSpec("experiment-1-pbvs-gradient-error")
IBVS, IBVS_ERROR = RunSpec("experiment-2-ibvs"), RunSpec("experiment-2-ibvs-gradient-error")

VERY_SIMILAR = 0.05
"""Greatest distance between the two tracks of a marker, at the same time, as a share of the image's width."""

GAP = 30.0
"""Times at which a row acts that are closer than this are one [s].

With T_s = 0.1 s one sample of the constraint action takes φ back by 0.1, and the slow motion needs seconds to return.
"""

EXPONENTIAL = 1.1
"""Greatest speed towards the boundary relative to clearance / K, that of an exponential approach."""

SIMILAR_RULE = (
    "both reach the goal with max σ ≤ 0, the same marker slides, and no marker is ever farther from where it is "
    "without errors than 5 % of the image's width"
)


def acting_rows(run: Run, kind: str) -> list[str]:
    """Rows of a kind that ever shape the command: with a wrong gradient their true φ may stay below zero."""
    return [label for label in run.labels(kind) if acts(run, label).any()]


def acts(run: Run, label: str) -> BoolArray:
    """(N,) when a row shapes the command."""
    return run.trajectory.active[:, run.index(label)]


def sliding_row(run: Run, kind: str) -> str:
    """The row that acts longest; raises NotMeasured where none acts."""
    acting = acting_rows(run, kind)
    if not acting:
        raise NotMeasured(f"no {kind} row ever acts")
    return max(acting, key=lambda label: int(acts(run, label).sum()))


def exponentially(run: Run, label: str) -> Finding:
    """Whether the boundary is approached no faster than with the time constant K, from when the row first acts on."""
    at = np.flatnonzero(acts(run, label))
    while_acting = slice(int(at[0]), int(at[-1]) + 1)
    clearance = run.trajectory.clearance[while_acting, run.index(label)]
    speed, K = run.approach_speed(label)[while_acting], run.constraint(label).K
    fastest = int(np.argmax(speed))
    # a negative clearance is no approach at all
    share = float((speed * K / np.where(clearance > 0.0, clearance, np.nan)).max())
    unit = run.unit(label)
    text = (
        f"{label} acts from {run.t[at[0]]:.1f} to {run.t[at[-1]]:.1f} s; towards the boundary at most "
        f"{speed[fastest]:.2g} {unit}/s, {clearance[fastest]:.2g} {unit} before it: at most {share:.2g} clearance / K"
    )
    good = bool(np.isfinite(share)) and share <= EXPONENTIAL
    return Finding(judged(good), text, {"share": share, "speed": float(speed[fastest])})


def one_marker_slides(run: Run, kind: str) -> Finding:
    """Which markers' rows act, and how much of the allowed space is left."""
    acting, row = acting_rows(run, kind), sliding_row(run, kind)
    margin, sigma = Margin.of(run, row), float(run.sigma(row).max())
    found = intervals(run.t, acts(run, row), GAP)
    kept = sigma <= 0.0 and margin.least >= 0.0
    text = (
        f"{', '.join(acting)} at {shown_intervals(found)}; max σ = {signed(sigma)}, {margin.least:.2g} px from the "
        f"boundary ({100.0 * margin.share:.2g} % of L); the greatest φ is "
        f"{float(run.phi(row).max()) / run.bound(row):.2g} "
        "T_s u⁺"
    )
    good = kept and len(acting) == 1 and margin.share <= FULLY
    return Finding(judged(good, kept), text, {"margin": margin.share, "sigma_max": sigma, "rows": float(len(acting))})


def reached(run: Run) -> Finding:
    """How the run ends."""
    trajectory = run.trajectory
    distance, angle = trajectory.camera_error[-1]
    pose = f", {1e3 * distance:.2f} mm, {1e3 * angle:.2f} mrad" if np.isfinite(distance) else ""
    text = (
        f"{trajectory.status} after {run.settling_time:.0f} s; at the end {trajectory.feature_error_px[-1]:.2f} "
        f"px{pose} "
        "from the goal"
    )
    return Finding(judged(trajectory.status == "converged"), text, {"settling": run.settling_time})


def very_similar(exact: Run, erroneous: Run, kind: str) -> Finding:
    """Differences between the runs without and with errors in the gradient."""
    N = min(len(exact.t), len(erroneous.t))
    apart = np.linalg.norm(exact.trajectory.features_px[:N] - erroneous.trajectory.features_px[:N], axis=2)
    most = float(apart.max())
    width = exact.setup.scene.camera.size[0]
    speed = np.abs(exact.trajectory.qd[:N] - erroneous.trajectory.qd[:N])
    fastest = float(np.abs(exact.trajectory.qd).max())
    error = np.abs(exact.trajectory.error[:N] - erroneous.trajectory.error[:N])
    sigma = max(float(erroneous.sigma(label).max()) for label in erroneous.labels(kind))
    same = sliding_row(exact, kind) == sliding_row(erroneous, kind)
    fine = all(run.trajectory.status == "converged" for run in (exact, erroneous)) and sigma <= 0.0
    text = (
        f"marker tracks differ by up to {most:.2f} px, joint speeds by {1e3 * float(np.sqrt((speed**2).mean())):.2g} "
        f"mrad/s rms and {1e3 * float(speed.max()):.2g} mrad/s at most (fastest joint {1e3 * fastest:.3g} mrad/s), "
        f"errors by {100.0 * float(error.max() / np.abs(exact.trajectory.error).max()):.2g} % of the greatest; with "
        f"errors max σ = {signed(sigma)}, {erroneous.trajectory.status}"
    )
    values = {"track_difference_px": most, "speed_difference": float(speed.max()), "sigma_max": sigma}
    return Finding(judged(fine and same and most <= VERY_SIMILAR * width, fine), text, values)


@claim(
    "6a",
    "10.2.1, Figs. 14, 15",
    "one of the markers remains in the FOV fully utilizing the allowed space",
    "exactly one marker's row acts, max σ ≤ 0, unused margin of at most 1 % of half the allowed image",
    "fig-15.png",
    PBVS,
)
def pbvs_one_marker_slides(run: Run) -> Finding:
    """See :func:`one_marker_slides`."""
    return one_marker_slides(run, "fov")


@claim(
    "6b",
    "10.2.1, Fig. 14",
    "reaching smoothly the boundary of the hyperellipse constraint",
    "while the row acts, the marker approaches the boundary no faster than clearance / K, up to 10 %",
    "fig-14.png",
    PBVS,
)
def pbvs_smooth(run: Run) -> Finding:
    """Normal speed of the marker that slides."""
    return exponentially(run, sliding_row(run, "fov"))


@claim("6c", "10.2.1, Figs. 14, 15", "the robot is positioned at the desired pose", "converged", "fig-15.png", PBVS)
def pbvs_reached(run: Run) -> Finding:
    """See :func:`reached`."""
    return reached(run)


@claim(
    "6d",
    "10.2.1, Fig. 16",
    "with a 30 % error in the gradient the result is very similar; only in the image trajectories and joint speeds a "
    "little difference can be appreciated",
    SIMILAR_RULE,
    "fig-16.png",
    PBVS,
    PBVS_ERROR,
)
def pbvs_very_similar(exact: Run, erroneous: Run) -> Finding:
    """See :func:`very_similar`."""
    return very_similar(exact, erroneous, "fov")


@claim(
    "6e",
    "10.2.2, Figs. 17, 18",
    "one of the markers remains visible, outside the forbidden area, fully utilizing the allowed space",
    "exactly one marker's row acts, max σ ≤ 0, unused margin of at most 1 % of the area's radius",
    "fig-18.png",
    IBVS,
)
def ibvs_one_marker_slides(run: Run) -> Finding:
    """See :func:`one_marker_slides`."""
    return one_marker_slides(run, "occlusion")


@claim(
    "6f",
    "10.2.2, Fig. 17",
    "reaching smoothly the boundary of the hyperellipse constraint",
    "while the row acts, the marker approaches the boundary no faster than clearance / K, up to 10 %",
    "fig-17.png",
    IBVS,
)
def ibvs_smooth(run: Run) -> Finding:
    """Normal speed of the marker that slides."""
    return exponentially(run, sliding_row(run, "occlusion"))


@claim("6g", "10.2.2, Figs. 17, 18", "the robot is positioned at the desired pose", "converged", "fig-18.png", IBVS)
def ibvs_reached(run: Run) -> Finding:
    """See :func:`reached`."""
    return reached(run)


@claim(
    "6h",
    "10.2.2, Fig. 19",
    "with a 30 % error in the gradient the result is very similar; only in the feature errors and joint speeds a "
    "little difference can be appreciated",
    SIMILAR_RULE,
    "fig-19.png",
    IBVS,
    IBVS_ERROR,
)
def ibvs_very_similar(exact: Run, erroneous: Run) -> Finding:
    """See :func:`very_similar`."""
    return very_similar(exact, erroneous, "occlusion")


@claim(
    "6i",
    "11",
    "despite the sampling time of 0.1 s the performance was satisfactory even for a 30 % gradient vector error",
    "T_s = 0.1 s, both experiments with errors converge with max σ ≤ 0 and all markers in the image",
    "fig-16.png",
    PBVS_ERROR,
    IBVS_ERROR,
)
def satisfactory(*runs: Run) -> Finding:
    """Both experiments with an erroneous gradient."""
    texts, good = [], []
    for name, run in zip(("experiment 1", "experiment 2"), runs, strict=True):
        sigma = max(float(run.sigma(label).max()) for kind in ("fov", "occlusion") for label in run.labels(kind))
        seen = bool(run.setup.scene.camera.sees(run.trajectory.features_px).all())
        good.append(
            sigma <= 0.0 and seen and run.trajectory.status == "converged" and abs(run.sampling_time - 0.1) < 1e-9
        )
        texts.append(f"{name}: T_s = {run.sampling_time:g} s, {run.trajectory.status}, max σ = {signed(sigma)}")
    return Finding(judged(all(good), any(good)), "; ".join(texts))
