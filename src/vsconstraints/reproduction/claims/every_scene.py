"""Claims of sections 3, 5 and Appendix A, judged in every scene with the paper's law or in one made for them."""

from __future__ import annotations

from collections.abc import Iterable
from math import nan

import numpy as np

from ...studies import StudyResult
from ..runs import Run, RunSpec
from ..verdicts import Finding, NotMeasured, claim, judged
from .boundary import LONGEST_POSITIVE, MOST_EXCESS, plural
from .experiments import FASTER
from .first_example import SECOND
from .studied import ending, number

SCENES = tuple(
    RunSpec(name)
    for name in (
        "example-2d-fov",
        "example-2d-fast",
        "example-2d-fast-high-gain",
        "example-2d-bowl",
        "example-2d-heart-convex",
        "example-2d-heart-concave",
        "case-study-6r",
        "experiment-1-pbvs",
        "experiment-2-ibvs",
        "ur5-fov",
        "panda-fov",
        "eye-to-hand-pbvs",
        "free-camera",
    )
)
"""The paper's scenes, and others with the same law and no disturbance."""

NOT_DIFFERENTIABLE = "example-2d-heart-concave"
"""Where φ has no derivative on its boundary (5.5), (12) says nothing: 4b is about that."""

OUTSIDE = RunSpec(
    "example-2d-fov",
    overrides=(
        ("qd0", (0.0, 0.0, -3.0)),
        ("constraints.0.switching_gain", 100.0),
        ("sampling_time", 0.001),
        ("duration", 1.0),
    ),
)
"""The first example, its camera turning so fast at the start that φ of the second feature is above zero."""


@claim(
    "10b",
    "3",
    "a switching gain above Σ max(L_fφ, 0) (12) is sufficient for making the set invariant",
    "every run of the sweep, and every scene with the law, whose u⁺ is above the bound (12) along its own motion keeps "
    "φ within T_s u⁺; partly if σ ≤ 0 in all of them. Rows of several kinds are divided by their u⁺, so that it is "
    "one; the concave corner is left out, where φ is not differentiable",
    "study-switching-gain.png",
    "switching-gain",
    *SCENES,
)
def bound_is_sufficient(study: StudyResult, *runs: Run) -> Finding:
    """How many runs above the bound keep σ ≤ 0, and φ in its band."""
    above, kept, band = (
        int(number(study, name)) for name in ("above_bound", "above_bound_allowed", "above_bound_in_band")
    )
    broken, beyond = [], []
    for spec, run in zip(SCENES, runs, strict=True):
        if spec.scenario == NOT_DIFFERENTIABLE:
            continue
        share = float(run.needed_share().max())
        if share >= 1.0:
            broken.append(f"{spec.scenario} ({share:.3g} u⁺)")
            continue
        excess = max(float(run.phi(label).max()) / run.bound(label) for label in run.trajectory.labels)
        lines = [run.row(label) for label in run.trajectory.labels if not label.startswith("speed")]
        above, band = above + 1, band + (excess <= 1.0)
        kept += all(float(line["clearance_min"]) >= 0.0 for line in lines)
        if excess > 1.0:
            beyond.append(f"{spec.scenario} ({excess:.3g} T_s u⁺)")
    if above == 0:
        raise NotMeasured("no run is above the bound")
    text = (
        f"of {above} runs above the bound {kept} keep σ ≤ 0 and {band} keep φ ≤ T_s u⁺"
        + (f", not {', '.join(beyond)}" if beyond else "")
        + f"; (12) asks for more than the printed u⁺ in {', '.join(broken) or 'no scene'}"
    )
    if band < above:
        text += "; (12) is about continuous time, in which tracking does not move φ while the law acts"
    return Finding(judged(band == above, kept == above), text, {"above": above, "kept": kept, "band": band})


@claim(
    "10c",
    "5.3, eq. (43)",
    "the upper bound for the chattering band is T_s u⁺",
    "peak-to-peak φ from when a row first acts until it no longer does is at most T_s u⁺ at every sampling time of the "
    "sweep and in every scene with the law; partly if at most twice that everywhere, and in proportion to T_s (power "
    "0.8 to 1.2) in the sweep",
    "study-sampling-time.png",
    "sampling-time",
    *SCENES,
)
def band_is_bounded(study: StudyResult, *runs: Run) -> Finding:
    """Peak-to-peak φ while a row acts in units of T_s u⁺."""
    found = dict(ending(study, ".greatest_excess"))
    if not found:
        raise NotMeasured("the study sampling-time has no band")
    power = {name: number(study, f"{name}.exponent") for name in found}
    scenes = {
        spec.scenario: max(
            (float(np.ptp(run.while_sliding(label))) / run.bound(label), label, run.positive_samples(label))
            for label in run.ever_active()
        )
        for spec, run in zip(SCENES, runs, strict=True)
        if run.ever_active()
    }
    text = "; ".join(
        f"{name}: up to {excess:.2f} T_s u⁺, growing with T_s to the power {power[name]:.2f}"
        for name, excess in found.items()
    )
    text += ". In every scene: " + _listed(scenes.items())
    text += ". (43) is about one step of the constraint action alone, tracking moves φ as well"
    greatest = max(*found.values(), *(excess for excess, _, _ in scenes.values()))
    proportional = all(0.8 <= p <= 1.2 for p in power.values()) and greatest <= MOST_EXCESS
    values = found | {f"{name}/scene": excess for name, (excess, _, _) in scenes.items()}
    return Finding(judged(greatest <= 1.0, proportional), text, values)


def _listed(scenes: Iterable[tuple[str, tuple[float, str, int]]]) -> str:
    return ", ".join(
        f"{name} {excess:.3g}" + (f" ({label}, φ ≥ 0 for {plural(n)} in a row)" if n > LONGEST_POSITIVE else "")
        for name, (excess, label, n) in scenes
    )


@claim(
    "10e",
    "App. A, (A.1) to (A.6)",
    "if u⁺ fulfills (12) the Lyapunov function decays at a finite rate, and collective SM in the intersection of the "
    "constraints occurs after a finite time interval",
    "from φ > 0, with u⁺ above (12), φ < 0 is reached within φ(0) / (u⁺ − max L_fφ) and one sample, and φ ≤ 2 T_s u⁺ "
    "from then on; partly if it is reached at all",
    "",
    OUTSIDE,
)
def reached_in_finite_time(run: Run) -> Finding:
    """When φ is below zero for the first time, beside the time that (A.6) promises."""
    phi, gain = run.phi(SECOND), run.bound(SECOND) / run.sampling_time
    inside = np.flatnonzero(phi < 0.0)
    if phi[0] <= 0.0:
        raise NotMeasured(f"φ is {phi[0]:.3g} at the start, not above zero")
    if not len(inside):
        return Finding("does not hold", f"φ starts at {phi[0]:.3g} and never falls below zero")
    first = int(inside[0])
    push = float(run.drift[:first, run.index(SECOND)].max())
    within = float(phi[0]) / (gain - push) if gain > push else nan
    later = float(phi[first:].max()) / run.bound(SECOND)
    text = (
        f"φ starts at {phi[0]:.3g}; u⁺ = {gain:g}, L_fφ up to {push:.3g}: below zero after "
        f"{1e3 * run.t[first]:.3g} ms, promised {f'within {1e3 * within:.3g} ms' if gain > push else 'never'}"
        f"; then at most {later:.2f} T_s u⁺"
    )
    good = float(run.t[first]) <= within + run.sampling_time and later <= MOST_EXCESS
    return Finding(judged(good, True), text, {"after": float(run.t[first]), "within": within})


@claim(
    "10f",
    "5.2",
    "if L_gφ is not full row rank the robot operation should be aborted, since the fulfillment of the constraints "
    "cannot be guaranteed",
    "of the runs of the experiments with fast motion, one meets active rows whose L_gφ has lost its rank: it ends "
    "there with the status aborted and names rows that are active, and no run goes on after such a sample",
    "",
    *FASTER,
)
def aborted_without_rank(*runs: Run) -> Finding:
    """The rank of the active rows, decomposed here, in every sample; and how the runs end."""
    texts, right, lost_ever = [], [], False
    for spec, run in zip(FASTER, runs, strict=True):
        lost = _lost_rank(run)
        end = run.trajectory
        if lost is None:
            right.append(end.status != "aborted")
            continue
        lost_ever = True
        named = any(label in end.reason for label in end.labels if run.phi(label)[lost] >= 0.0)
        right.append(lost == len(run.t) - 1 and end.status == "aborted" and named)
        texts.append(f"{spec.scenario}, T_s = {run.sampling_time:g} s: rank lost at {run.t[lost]:.2f} s, {end.status}")
    if not lost_ever:
        raise NotMeasured("no run loses the rank of its active rows")
    return Finding(judged(all(right)), "; ".join(texts))


def _lost_rank(run: Run) -> int | None:
    """The first sample whose active rows, each divided by its length, are linearly dependent; None if there is none."""
    scene, constraints = run.setup.scene, run.setup.constraints
    for k in np.flatnonzero((run.trajectory.phi >= 0.0).sum(axis=1) > 1):
        rows, _ = constraints.rows(scene.evaluate(float(run.t[k]), run.trajectory.q[k], run.trajectory.qd[k]))
        A = rows.Lg[rows.phi >= 0.0]
        A = A / np.linalg.norm(A, axis=1, keepdims=True)
        if len(A) > A.shape[1] or np.linalg.svd(A, compute_uv=False)[-1] < 1e-6:
            return int(k)
    return None
