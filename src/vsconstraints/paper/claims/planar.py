"""Claims 1 to 4: section 8, the planar arm with the FOV constraint, in a trap and at corners."""

from __future__ import annotations

import numpy as np

from ...comparisons.run import Run
from ...comparisons.runs.spec import RunSpec
from ...rows import Array
from ..verdicts import Finding, claim, ends_of, finding, rounds_to
from .boundary import VANISHED, clear, excess, fulfilled, fully_used, greatest_sigma, phi_never_positive, smoothly

FOV = RunSpec("example-2d-fov")
FAST = RunSpec("example-2d-fast")
HIGH_GAIN = RunSpec("example-2d-fast-high-gain")
HIGH_GAIN_FASTER_SAMPLING = RunSpec("example-2d-fast-high-gain", overrides={"sampling_time": 0.001})
HALVED = RunSpec("example-2d-fov", overrides={"sampling_time": 0.0025})
BOWL = RunSpec("example-2d-bowl")
CONVEX = RunSpec("example-2d-heart-convex")
CONCAVE = RunSpec("example-2d-heart-concave")

FIRST, SECOND = "fov[marker 1]", "fov[marker 2]"
HEART, BOWL_ROW, OTHER_ROW = "occlusion[heart, marker 1]", "occlusion[bowl, marker 1]", "occlusion[bowl, marker 2]"
#: The heart's concave corner in Fig. 8, and its convex one in Fig. 7, where the heart is turned [px].
NOTCH, TIP = (-102.0, 35.0), (-137.0, 0.0)


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
    return finding("1a", sigma <= 0.0 <= least, sigma_max=sigma, clearance_min=least)


@claim("1d", FOV)
def _orientation_error_vanishes(fov: Run) -> Finding:
    first, last = angle(fov)[[0, -1]]
    return finding("1d", last < VANISHED * first, first=first, last=last, settling=fov.settling_time)


@claim("1e", FOV)
def _position_error_arises_and_vanishes(fov: Run) -> Finding:
    error, acts = position(fov), fov.active_intervals(SECOND)
    if not acts:
        return Finding("does not hold", "the constraint never becomes active")
    start, end = acts[0][0], acts[-1][1]
    peak, when = error.max(), float(fov.t[error.argmax()])
    before, last = error[fov.t < start].max(initial=0.0), error[-1]
    arises, vanishes = before < VANISHED * peak and start <= when <= end, last < VANISHED * peak
    values = {"before": before, "peak": peak, "peak_at": when, "last": last}
    return finding("1e", arises and vanishes, arises or vanishes, {"start": start}, **values)


@claim("1f", FOV)
def _border_active_twice(fov: Run) -> Finding:
    second, first = fov.active_intervals(SECOND), fov.active_intervals(FIRST)
    good = rounds_to(second, [(3.0, 5.0), (8.0, 9.0)])
    return finding("1f", good and not first, good, {"second": second, "first": first}, **ends_of(second))


@claim("1h", FOV, HALVED)
def _speeds_are_continuous(*runs: Run) -> Finding:
    """Greatest steps from one sample to the next, of any joint."""
    speed, jump = (
        [np.abs(np.diff(getattr(run.trajectory, name), axis=0)).max() for run in runs] for name in ("qd", "qdd_command")
    )
    continuous, switches = speed[1] <= 0.6 * speed[0], jump[1] >= 0.8 * jump[0]
    ratios = {"speed_ratio": speed[1] / speed[0], "acceleration_ratio": jump[1] / jump[0]}
    shown = {"runs": runs, "speed": speed, "jump": jump}
    return finding("1h", continuous and switches, continuous, shown, **ratios)


# --- claim 2: Fig. 5 ---


def band(run: Run) -> float:
    """Peak-to-peak φ while the second feature's row acts."""
    return float(np.ptp(run.while_sliding(SECOND)))


def grows(key: str, slow: float, fast: float) -> Finding:
    """Whether a number is greater for the fast motion."""
    return finding(key, fast > slow, slow=slow, fast=fast)


claim("2c", HIGH_GAIN)(lambda high: phi_never_positive(high, [SECOND]))
claim("2d", FOV, HIGH_GAIN)(lambda fov, high: grows("2d", band(fov), band(high)))
claim("2e", FOV, FAST)(lambda fov, fast: grows("2e", fov.needed_gain().max(), fast.needed_gain().max()))


@claim("2a", FOV, FAST)
def _three_times_faster(fov: Run, fast: Run) -> Finding:
    ratio = fov.settling_time / fast.settling_time
    return finding("2a", 2.25 <= ratio <= 3.75, ratio > 1.0, {"fov": fov, "fast": fast}, ratio=ratio)


@claim("2b", FAST)
def _small_gain_not_enough(fast: Run) -> Finding:
    """φ beyond its band: the sliding mode is lost."""
    kept = fulfilled(fast, SECOND)
    beyond, lost = kept.values["phi_max"] > 1.5 * kept.values["bound"], kept.values["positive_samples"] >= 5
    return finding("2b", beyond and lost, beyond or lost, {"kept": kept}, **kept.values)


@claim("2f", FOV, HIGH_GAIN_FASTER_SAMPLING)
def _faster_sampling_restores_the_band(fov: Run, high: Run) -> Finding:
    slow, fast = band(fov), band(high)
    return finding("2f", fast <= 1.1 * slow, False, {"high": high}, slow=slow, fast=fast)


# --- claim 3: Fig. 6 ---


@claim("3a", BOWL)
def _trapped_in_the_bowl(bowl: Run) -> Finding:
    acts = bowl.active_intervals(BOWL_ROW)
    until_end, trapped = bool(acts) and acts[-1][1] >= bowl.t[-1] - 1.0, bowl.trajectory.status == "trapped"
    return finding("3a", trapped and until_end, trapped or until_end, {"run": bowl, "acts": acts})


@claim("3b", BOWL)
def _trapped_with_the_right_orientation(bowl: Run) -> Finding:
    first, last = angle(bowl)[[0, -1]]
    return finding("3b", last < VANISHED * first, False, {"run": bowl}, first=first, last=last)


@claim("3c", BOWL)
def _trapped_away_from_the_position(bowl: Run) -> Finding:
    last = position(bowl)[-1]
    return finding("3c", last > 0.005, False, {"run": bowl}, last=last)


@claim("3d", BOWL)
def _stable_in_the_trap(bowl: Run) -> Finding:
    end, phi, place = bowl.t[-1], bowl.phi(BOWL_ROW), bowl.trajectory.camera_position
    last, middle = bowl.t >= end - 2.0, (bowl.t >= 0.5 * end) & (bowl.t <= 0.5 * end + 2.0)
    moved = np.linalg.norm(place[last] - place[-1], axis=1).max()
    speed = np.abs(bowl.trajectory.qd[last]).max()
    before, now, depth = np.ptp(phi[middle]), np.ptp(phi[last]), -clear(bowl, BOWL_ROW)
    rests = moved < 0.005 and speed < 0.05
    values = {"moved": moved, "speed": speed, "phi_range": now, "phi_range_before": before, "depth": depth}
    return finding("3d", rests and now <= 1.1 * before, rests, {"bound": bowl.bound(BOWL_ROW)}, **values)


@claim("3e", BOWL)
def _both_features_stay_out(bowl: Run) -> Finding:
    labels = BOWL_ROW, OTHER_ROW
    both, needed = phi_never_positive(bowl, labels), bowl.drift[:, bowl.index(OTHER_ROW)].max()
    rows = [
        (row, bowl.phi(row).max(), excess(bowl, row), bowl.positive_samples(row), clear(bowl, row)) for row in labels
    ]
    shown = {"rows": rows, "needed": needed}
    return finding("3e", both.verdict == "holds", both.verdict == "holds partly", shown, **both.values)


# --- claim 4: Figs. 7 and 8 ---


@claim("4a", CONVEX)
def _convex_corner_passed(convex: Run) -> Finding:
    kept = fulfilled(convex, HEART)
    near = np.linalg.norm(convex.trajectory.features_px[:, 0] - TIP, axis=1).min()
    passed = convex.trajectory.status == "converged" and kept.values["sigma_max"] <= 0.0
    good = kept.verdict == "holds" and passed and near < 5.0
    return finding("4a", good, passed, {"kept": kept, "run": convex}, **kept.values, nearest=near)


@claim("4b", CONCAVE)
def _concave_corner_violated(concave: Run) -> Finding:
    kept, depth = fulfilled(concave, HEART), -clear(concave, HEART)
    worst = concave.trajectory.features_px[concave.phi(HEART).argmax(), 0]
    away = float(np.linalg.norm(worst - NOTCH))
    beyond = kept.values["phi_max"] > 5.0 * kept.values["bound"]
    good = beyond and kept.values["sigma_max"] > 0.0 and away < 20.0
    return finding("4b", good, beyond, {"kept": kept}, **kept.values, depth=depth, away=away)


@claim("4c", CONCAVE)
def _sliding_mode_temporarily_lost(concave: Run) -> Finding:
    samples, phi = concave.positive_samples(HEART), concave.phi(HEART)
    last = phi[concave.t >= concave.t[-1] - 2.0].max()
    lost, back = samples > 5, last <= concave.bound(HEART)
    return finding("4c", lost and back, lost, {"run": concave}, samples=samples, phi_last=last)
