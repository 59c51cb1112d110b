"""Claim 6: section 10, the experiments, simulated at the sampling time of the real ones."""

from __future__ import annotations

import numpy as np

from ...order_filter import OrderFilter
from ...rows import BoolArray
from ..runs import Run, RunSpec
from ..verdicts import Finding, NotMeasured, claim, judged
from .boundary import FULLY, Margin, plural, signed

PBVS, IBVS = RunSpec("experiment-1-pbvs"), RunSpec("experiment-2-ibvs")
TEN_TIMES = (("task.Kp0", 6.0), ("duration", 60.0))
FASTER = tuple(
    RunSpec(spec.scenario, overrides=(*TEN_TIMES, ("sampling_time", Ts)), may_end_early=True)
    for spec in (PBVS, IBVS)
    for Ts in (0.1, 0.01)
)
FASTER_ROWS = (("experiment 1", "fov"),) * 2 + (("experiment 2", "occlusion"),) * 2

EXPONENTIAL = 1.1
"""Greatest speed towards the boundary relative to clearance / K, that of an exponential approach."""


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
    # a negative clearance is no approach at all: NaN, which is below nothing
    share = float((speed * K / np.where(clearance > 0.0, clearance, np.nan)).max())
    unit = run.unit(label)
    text = (
        f"{label} acts from {run.t[at[0]]:.1f} to {run.t[at[-1]]:.1f} s; towards the boundary at most "
        f"{speed[fastest]:.2g} {unit}/s, {clearance[fastest]:.2g} {unit} before it: at most {share:.2g} clearance / K"
    )
    return Finding(judged(share <= EXPONENTIAL), text, {"share": share, "speed": float(speed[fastest])})


def one_marker_slides(run: Run, kind: str) -> Finding:
    """Which markers' rows act, and how much of the allowed space is left."""
    acting, row = acting_rows(run, kind), sliding_row(run, kind)
    margin, sigma = Margin.of(run, row), float(run.sigma(row).max())
    times = run.t[acts(run, row)]
    kept = sigma <= 0.0 and margin.least >= 0.0
    apart = float(np.diff(times).max(initial=0.0))
    text = (
        f"{', '.join(acting)} acts in {plural(len(times))} from {times[0]:.1f} to {times[-1]:.1f} s, at most "
        f"{apart:.1f} s apart; max σ = {signed(sigma)}, {margin.least:.2g} px from the boundary "
        f"({100.0 * margin.share:.2g} % of L); the greatest φ is {float(run.phi(row).max()) / run.bound(row):.2g} "
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
    "6l",
    "10.2",
    "for stability reasons, the movement speed has to be relatively slow to meet the limited bandwidth given by the "
    "sampling period of 0.1 s",
    "with ten times K_T,p(0) both experiments violate their boundary or do not reach the goal at T_s = 0.1 s, and both "
    "keep and reach them at 0.01 s; partly if the former only",
    "",
    *FASTER,
)
def motion_must_be_slow(*runs: Run) -> Finding:
    """Ten times the gain at zero error, sampled as in the experiments and ten times as fast."""
    good, texts = [], []
    for run, (name, kind) in zip(runs, FASTER_ROWS, strict=True):
        least = min(float(run.row(label)["clearance_min"]) for label in run.labels(kind))
        good.append(run.trajectory.status == "converged" and least >= 0.0)
        texts.append(f"{name}, T_s = {run.sampling_time:g} s: {run.trajectory.status}, {signed(least)} px clear")
    slow = not good[0] and not good[2]
    return Finding(judged(slow and good[1] and good[3], slow), "; ".join(texts))


@claim(
    "6m",
    "5.1, 10.1",
    "the commanded joint accelerations are double integrated to obtain the commanded joint positions sent to the robot",
    "in both experiments, from sample to sample, q changes by T_s q̇ + ½ T_s² q̈_c and q̇ by T_s q̈_c, and the filter "
    "that integrates twice makes the same q of the commands, all to 1e-9",
    "",
    PBVS,
    IBVS,
)
def integrated_twice(*runs: Run) -> Finding:
    """What is left of the changes of q and q̇ without the integrals of the commands."""
    places: list[float] = []
    speeds: list[float] = []
    for run in runs:
        q, qd, qdd, Ts = run.trajectory.q, run.trajectory.qd, run.trajectory.qdd_command[:-1], run.sampling_time
        filtered = OrderFilter(q[0], qd[0], Ts)
        places.append(float(np.abs(np.diff(q, axis=0) - Ts * qd[:-1] - 0.5 * Ts**2 * qdd).max()))
        places.append(float(np.abs([filtered.step(one) for one in qdd] - q[1:]).max()))
        speeds.append(float(np.abs(np.diff(qd, axis=0) - Ts * qdd).max()))
    most = max(places + speeds)
    text = f"up to {max(places):.2g} rad and {max(speeds):.2g} rad/s are left"
    return Finding(judged(most <= 1e-9), text, {"left": most})
