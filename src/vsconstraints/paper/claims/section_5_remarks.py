"""Section 5, additional remarks: claims 1h, 4c, 6m, 10c, 10f, 11a and 11b.

They are about the discontinuous control action (5.1), task abort (5.2), chattering (5.3),
non-static constraints (5.4) and constraint functions that are not differentiable (5.5).
"""

from __future__ import annotations

import numpy as np

from ...comparisons.run import Run
from ...comparisons.runs.spec import RunSpec
from ...robots.order_filter import OrderFilter
from ...rows import Array
from ...rows.readable import amount
from ..scenes import CONCAVE, FASTER, FOV, HALVED, HEART, IBVS, PBVS, SCENES
from ..studies import StudyResult
from ..studies.pareto import MAX_EXCESS, MAX_POSITIVE_SAMPLES
from ..verdicts import Finding, NotMeasured, claim, finding, shown_samples
from .boundary import ending, greatest_sigma, number, with_sigma

TARGET, OCCLUDER, SPHERE = (
    RunSpec(name) for name in ("moving-target", "moving-occluder", "moving-sphere")
)
#: Key by which both scenarios with obstacles state that the motion is known; if it is not, the rows
#: take the obstacles for static.
KNOWN = "constraints.0.motion.known"
ROUNDING = 1e-9  #: Differences below this are due to rounding.


def greatest_step(values: Array) -> float:
    """Greatest change of signals (N, k) from one sample to the next."""
    return float(np.abs(np.diff(values, axis=0)).max())


# --- 5.1 ---


@claim(
    "1h",
    FOV,
    HALVED,
    where="5.1",
    sentence="the joint velocities are continuous, i.e., the control is smoother",
    rule="with half the sampling time the greatest step of a joint's speed between samples is at "
    "most 60 % as large, while that of the commanded acceleration is at least 80 % as large; "
    "partly if the former only",
)
def _speeds_are_continuous(fov: Run, halved: Run) -> Finding:
    speed, halved_speed = (greatest_step(run.trajectory.qd) for run in (fov, halved))
    jump, halved_jump = (greatest_step(run.trajectory.qdd_command) for run in (fov, halved))
    continuous = halved_speed <= 0.6 * speed
    text = (
        f"T_s = {1e3 * fov.sampling_time:g} ms and {1e3 * halved.sampling_time:g} ms: "
        f"q̇ steps by up to {1e3 * speed:.3g} and {1e3 * halved_speed:.3g} mrad/s, "
        f"q̈_c by up to {jump:.3g} and {halved_jump:.3g} rad/s²"
    )
    return finding(
        text,
        holds=continuous and halved_jump >= 0.8 * jump,
        partly=continuous,
        speed_ratio=halved_speed / speed,
        acceleration_ratio=halved_jump / jump,
    )


@claim(
    "6m",
    PBVS,
    IBVS,
    where="5.1, 10.1",
    sentence="the commanded joint accelerations are double integrated to obtain the commanded "
    "joint positions sent to the robot",
    rule="in both experiments, from sample to sample, q changes by T_s q̇ + ½ T_s² q̈_c and q̇ by "
    "T_s q̈_c, and the filter that integrates twice makes the same q of the commands, all to 1e-9",
)
def _integrated_twice(*runs: Run) -> Finding:
    """Remainder of the changes of q and q̇ after subtracting the integrals of the commands."""
    places = []
    speeds = []
    for run in runs:
        q = run.trajectory.q
        qd = run.trajectory.qd
        qdd = run.trajectory.qdd_command[:-1]
        Ts = run.sampling_time
        order_filter = OrderFilter(q[0], qd[0], Ts)
        filtered = [order_filter.step(command) for command in qdd]
        q_left = np.diff(q, axis=0) - Ts * qd[:-1] - 0.5 * Ts**2 * qdd
        qd_left = np.diff(qd, axis=0) - Ts * qdd
        places.append(np.abs(q_left).max())
        places.append(np.abs(filtered - q[1:]).max())
        speeds.append(np.abs(qd_left).max())
    most = max(places + speeds)
    text = f"up to {max(places):.2g} rad and {max(speeds):.2g} rad/s are left"
    return finding(text, holds=most <= 1e-9, left=most)


# --- 5.2 ---


@claim(
    "10f",
    *FASTER,
    where="5.2",
    sentence="if L_gφ is not full row rank the robot operation should be aborted, since the "
    "fulfillment of the constraints cannot be guaranteed",
    rule="of the runs of the experiments with fast motion, one meets active rows whose L_gφ has "
    "lost its rank: it ends there with the status aborted and names rows that are active, and no "
    "run goes on after such a sample",
)
def _aborted_without_rank(*runs: Run) -> Finding:
    """Rank of the active rows in each sample, by a separate decomposition, and end of the runs."""
    texts = []
    right = []
    for spec, run in zip(FASTER, runs, strict=True):
        lost = lost_rank(run)
        end = run.trajectory
        if lost is None:
            right.append(end.status != "aborted")
            continue
        named = any(label in end.reason for label in end.labels if run.phi(label)[lost] >= 0.0)
        right.append(lost == len(run.t) - 1 and end.status == "aborted" and named)
        texts.append(
            f"{spec.name}, T_s = {run.sampling_time:g} s: "
            f"rank lost at {run.t[lost]:.2f} s, {end.status}"
        )
    if not texts:
        raise NotMeasured("no run loses the rank of its active rows")
    return finding("; ".join(texts), holds=all(right))


def lost_rank(run: Run) -> int | None:
    """Return the first sample whose active rows are linearly dependent, None if there is none.

    Each row is divided by its length.
    """
    world = run.setup.world()
    motion = run.trajectory
    active_count = (motion.phi >= 0.0).sum(axis=1)
    for k in np.flatnonzero(active_count > 1):
        rows = world.evaluate(float(run.t[k]), motion.q[k], motion.qd[k]).rows
        A = rows.Lg[rows.phi >= 0.0]
        A = A / np.linalg.norm(A, axis=1, keepdims=True)
        row_count, n = A.shape
        if row_count > n:
            return int(k)
        singular_values = np.linalg.svd(A, compute_uv=False)
        if singular_values[-1] < 1e-6:
            return int(k)
    return None


# --- 5.3 ---


@claim(
    "10c",
    "sampling-time",
    *SCENES,
    where="5.3, eq. (43)",
    sentence="the upper bound for the chattering band is T_s u⁺",
    rule="peak-to-peak φ from when a row first acts until it no longer does is at most T_s u⁺ at "
    "every sampling time of the sweep and in every scene with the law; partly if at most twice "
    "that everywhere, and in proportion to T_s (power 0.8 to 1.2) in the sweep",
)
def _band_is_bounded(study: StudyResult, *runs: Run) -> Finding:
    """Peak-to-peak φ while a row is active, in units of T_s u⁺."""
    bands = dict(ending(study, "greatest_excess"))
    if not bands:
        raise NotMeasured("the study sampling-time has no band")
    power = {name: number(study, name, "exponent") for name in bands}
    swept = [
        f"{name}: up to {width:.2f} T_s u⁺, growing with T_s to the power {power[name]:.2f}"
        for name, width in bands.items()
    ]
    scenes = {}
    texts = []
    for spec, run in zip(SCENES, runs, strict=True):
        if not run.ever_active():
            continue
        label, scenes[spec.name] = widest_band(run)
        text = f"{spec.name} {scenes[spec.name]:.3g}"
        samples = run.positive_samples(label)
        if samples > MAX_POSITIVE_SAMPLES:
            text += f" ({label}, φ ≥ 0 for {shown_samples(samples)} in a row)"
        texts.append(text)
    greatest = max(*bands.values(), *scenes.values())
    proportional = all(0.8 <= p <= 1.2 for p in power.values()) and greatest <= MAX_EXCESS
    text = (
        f"{'; '.join(swept)}. In every scene: {', '.join(texts)}. "
        "(43) is about one step of the constraint action alone, tracking moves φ as well"
    )
    values = bands | {f"{name}/scene": width for name, width in scenes.items()}
    return finding(text, holds=greatest <= 1.0, partly=proportional, **values)


def widest_band(run: Run) -> tuple[str, float]:
    """Return the active row with the greatest peak-to-peak φ, and this φ in units of T_s u⁺."""
    width = {
        label: float(np.ptp(run.while_sliding(label))) / run.bound(label)
        for label in run.ever_active()
    }
    widest = max(width, key=lambda label: (width[label], label))
    return widest, width[widest]


# --- 5.4 ---


@claim(
    "11a",
    TARGET,
    OCCLUDER,
    SPHERE,
    where="5.4",
    sentence="the proposed approach can also be used if there are moving obstacles or a moving "
    "target object",
    rule="the unchanged law converges, its rows act, and max σ ≤ 0 for rows with a σ of their own, "
    "in all three scenarios; partly if in one",
)
def _moving_objects(*runs: Run) -> Finding:
    texts = []
    good = []
    for spec, run in zip((TARGET, OCCLUDER, SPHERE), runs, strict=True):
        sigma = greatest_sigma(run, *with_sigma(run.trajectory.labels))
        acting = run.ever_active()
        status = run.trajectory.status
        rows = ", ".join(acting) or "no row"
        texts.append(f"{spec.name}: {status}, max σ = {amount(sigma)}, {rows} active")
        good.append(status == "converged" and sigma <= 0.0 and bool(acting))
    return finding("; ".join(texts), holds=all(good), partly=any(good))


@claim(
    "11b",
    OCCLUDER,
    SPHERE,
    where="5.4",
    sentence="only the value of the lower bound for the switching gain u⁺ is changed; the "
    "iterative computation of the algorithm remains the same",
    rule="while rows act, L_gφ is the same whether they know the motion or not, and Σ max(L_fφ, 0) "
    "is not; partly if φ = σ + K σ̇ differs as well, since σ̇ contains ∂σ/∂t",
)
def _only_the_bound_changes(*runs: Run) -> Finding:
    """Compare rows along the same motion with and without knowledge of the obstacle's motion."""
    texts = []
    same = []
    equal = []
    for spec, run in zip((OCCLUDER, SPHERE), runs, strict=True):
        knowing = run.setup.world()
        unknowing = RunSpec(spec.name, overrides={KNOWN: False}).load().setup().control()
        needed = np.zeros(2)
        Lg = 0.0
        phi = 0.0
        for k in np.flatnonzero((run.trajectory.phi >= 0.0).any(axis=1)):
            state = float(run.t[k]), run.trajectory.q[k], run.trajectory.qd[k]
            informed = knowing.evaluate(*state).rows
            blind = unknowing.evaluate(*state).rows
            active = informed.phi >= 0.0
            now = [np.maximum(rows.Lf[active], 0.0).sum() for rows in (informed, blind)]
            needed = np.maximum(needed, now)
            Lg = max(Lg, np.abs(informed.Lg - blind.Lg).max())
            phi = max(phi, (np.abs(informed.phi - blind.phi) * active).max())
        texts.append(
            f"{spec.name}: L_gφ differs by {Lg:.2g}; (12) asks for u⁺ > {needed[0]:.3g}, "
            f"without ∂φ/∂t for {needed[1]:.3g}; φ of active rows differs by up to {phi:.3g}, "
            "as σ̇ contains ∂σ/∂t"
        )
        same.append(Lg < ROUNDING and abs(needed[0] - needed[1]) > ROUNDING)
        equal.append(phi < ROUNDING)
    return finding("; ".join(texts), holds=all(same) and all(equal), partly=all(same))


# --- 5.5 ---


@claim(
    "4c",
    CONCAVE,
    where="5.5",
    sentence="at such a point the SM behavior of the proposed method is temporarily lost",
    rule="φ stays positive for more than five samples in a row, returns, and in the last 2 s stays "
    "within T_s u⁺",
    figure="fig-08.png",
)
def _sliding_mode_is_lost_for_a_time(concave: Run) -> Finding:
    samples = concave.positive_samples(HEART)
    last = concave.phi(HEART)[concave.t >= concave.t[-1] - 2].max()
    position, angle = 1e3 * concave.trajectory.camera_error[-1]
    lost = samples > 5
    text = (
        f"φ > 0 for {shown_samples(samples)} in a row ({concave.sampling_time * samples:.3f} s), "
        f"max φ in the last 2 s {amount(last)}; the run ends {concave.trajectory.status}, "
        f"{position:.1f} mm and {angle:.1f} mrad from the goal"
    )
    return finding(
        text,
        holds=lost and last <= concave.bound(HEART),
        partly=lost,
        samples=samples,
        phi_last=last,
    )
