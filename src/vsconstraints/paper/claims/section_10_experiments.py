"""Section 10, visibility constraints in PBVS and IBVS, and section 11: claims 6a to 6l.

The experiments are simulated at their sampling time, without and with errors in the gradient.
"""

from __future__ import annotations

import numpy as np

from ...comparisons.run import Run
from ...rows import BoolArray
from ...rows.readable import amount
from ..scenes import FASTER, IBVS, PBVS
from ..studies import StudyResult
from ..verdicts import Finding, NotMeasured, claim, finding, shown_samples
from .boundary import FULLY, clear, excess, greatest_sigma, number, unused

#: Greatest speed towards the boundary relative to clearance / K; an exponential approach has 1.
EXPONENTIAL = 1.1

#: Cases of the study of unselected scenes: (49) as printed, with reversed signs, and in L_gφ alone.
CASES = ("plus", "minus", "plus-action")
SCENES = 100  #: Fewest unselected scenes for which a share is computed.
#: Shares of the unselected scenes above which a sentence holds, and above which it holds partly.
NEARLY_ALL = 0.95
MOST = 0.5

UNSELECTED = "unselected-experiments"
PBVS_SCENARIO = PBVS.name
IBVS_SCENARIO = IBVS.name

#: Parts of rules that several claims share.
EXPONENTIALLY = (
    "while the row acts, the marker approaches the boundary no faster than clearance / K, up to "
    "10 %"
)
EVERYWHERE = (
    "here and, with the printed and the reversed signs of (49), in 95 % of at least 100 unselected "
    "scenes; partly if in half of these with both, or with ∇σ_e in L_gφ alone. Not measured if the "
    "error moves no track by more than 0.01 px. ∇σ_e stands in φ, L_gφ and L_fφ"
)
SIMILAR = (
    "both reach the goal with σ ≤ 0, the same marker slides, and no marker is ever farther from "
    f"where it is without errors than 5 % of the image's width: {EVERYWHERE}"
)
LITTLE = (
    "no joint's speed ever differs by more than 10 % of the greatest speed without errors: "
    f"{EVERYWHERE}"
)

# --- Measures that both experiments share ---


def acting_rows(run: Run, kind: str) -> list[str]:
    """Rows of a kind that ever shape the command.

    With a wrong gradient their true φ may stay below zero.
    """
    return [label for label in run.labels(kind) if acts(run, label).any()]


def acts(run: Run, label: str) -> BoolArray:
    """Mask (N,) of the samples in which a row shapes the command."""
    return run.trajectory.active[:, run.index(label)]


def sliding_row(run: Run, kind: str) -> str:
    """Return the row that is active longest; raises NotMeasured if none is active."""
    acting = acting_rows(run, kind)
    if not acting:
        raise NotMeasured(f"no {kind} row ever acts")
    return max(acting, key=lambda label: int(acts(run, label).sum()))


def passes(run: Run, kind: str) -> bool:
    """True if the run reaches the goal and no row of a kind is violated."""
    return run.trajectory.status == "converged" and clear(run, *run.labels(kind)) >= 0.0


def exponentially(run: Run, kind: str) -> Finding:
    """Finding that the sliding row is approached no faster than with the time constant K.

    Only times from the row's first activity on count.
    """
    label = sliding_row(run, kind)
    acting = np.flatnonzero(acts(run, label))
    times = run.t[acting]
    while_acting = slice(acting[0], acting[-1] + 1)
    clearance = run.trajectory.clearance[while_acting, run.index(label)]
    speed = run.approach_speed(label)[while_acting]
    K = run.constraint(label).K
    # a negative clearance gives NaN, which fails every comparison
    share = (speed * K / np.where(clearance > 0.0, clearance, np.nan)).max()
    fastest = speed.argmax()
    unit = run.unit(label)
    text = (
        f"{label} acts from {times[0]:.1f} to {times[-1]:.1f} s; towards the boundary at most "
        f"{speed[fastest]:.2g} {unit}/s, {clearance[fastest]:.2g} {unit} before it: "
        f"at most {share:.2g} clearance / K"
    )
    return finding(text, holds=share <= EXPONENTIAL, share=share, speed=speed[fastest])


def one_marker_slides(run: Run, kind: str) -> Finding:
    """Finding that one marker's row is active, with the share of the allowed space that is left."""
    acting = acting_rows(run, kind)
    row = sliding_row(run, kind)
    least = clear(run, row)
    share = unused(run, row)
    sigma = greatest_sigma(run, row)
    times = run.t[acts(run, row)]
    apart = np.diff(times).max(initial=0.0)
    kept = sigma <= 0.0 and least >= 0.0
    good = kept and len(acting) == 1 and share <= FULLY
    text = (
        f"{', '.join(acting)} acts in {shown_samples(len(times))} "
        f"from {times[0]:.1f} to {times[-1]:.1f} s, at most {apart:.1f} s apart; "
        f"max σ = {amount(sigma)}, {least:.2g} px from the boundary ({100 * share:.2g} % of L); "
        f"the greatest φ is {excess(run, row):.2g} T_s u⁺"
    )
    return finding(text, holds=good, partly=kept, margin=share, sigma_max=sigma, rows=len(acting))


def in_unselected(study: StudyResult, scenario: str, what: str) -> Finding:
    """Finding that an error of the gradient changes little in shipped and unselected scenes.

    ``what`` is the property of a run that is counted: ``similar``, ``little_speed`` or
    ``satisfactory``.
    """
    counts, scenes = (
        [number(study, scenario, case, name) for case in CASES] for name in (what, "scenes")
    )
    if min(scenes) < SCENES:
        raise NotMeasured(
            f"the study {UNSELECTED} has {min(scenes):.0f} scenes of {scenario}, fewer than "
            f"{SCENES}"
        )
    for case, N in zip(CASES, scenes, strict=True):
        in_shipped = number(study, scenario, case, "shipped", "applied")
        if number(study, scenario, case, "applied") < NEARLY_ALL * N or not in_shipped:
            raise NotMeasured(
                f"the error of the gradient changes nothing in {scenario} ({case}): was it applied?"
            )
    plus, minus, alone = (x / N for x, N in zip(counts, scenes, strict=True))
    both = min(plus, minus)
    here = number(study, scenario, CASES[0], "shipped", what) == 1.0
    names = ("track_px", "speed_share", "clearance_share")
    values = {name: number(study, scenario, CASES[0], "shipped", name) for name in names}
    tracks, speeds, clearance = values.values()
    tracks_alone, _, clearance_alone = (
        number(study, scenario, CASES[2], "shipped", name) for name in names
    )
    measured = {
        "similar": f"Here tracks differ by up to {tracks:.2f} px, {clearance:.2f} % of L from the "
        f"boundary; with ∇σ_e in L_gφ alone by {tracks_alone:.2f} px, {clearance_alone:.2f} %",
        "little_speed": f"Here by up to {speeds:.0f} % of the fastest joint's speed",
        "satisfactory": f"Here {clearance:.2f} % of L from the boundary",
    }
    of = [f"{x:.0f} of {N:.0f}" for x, N in zip(counts, scenes, strict=True)]
    text = (
        f"{'holds' if here else 'does not hold'} in this scene; "
        f"in {of[0]} unselected scenes, with reversed signs in {of[1]}, "
        f"with ∇σ_e in L_gφ alone, the other reading of (49), in {of[2]}. {measured[what]}"
    )
    good = here and both >= NEARLY_ALL
    return finding(text, holds=good, partly=max(both, alone) >= MOST, **values)


# --- 10.2.1: PBVS with constraints of the field of view ---


@claim(
    "6a",
    PBVS,
    where="10.2.1, Figs. 14, 15",
    sentence="one of the markers remains in the FOV fully utilizing the allowed space",
    rule="exactly one marker's row acts, max σ ≤ 0, unused margin of at most 1 % of half the "
    "allowed image",
)
def _one_marker_slides_at_the_border(pbvs: Run) -> Finding:
    return one_marker_slides(pbvs, "fov")


@claim(
    "6b",
    PBVS,
    where="10.2.1, Fig. 14",
    sentence="reaching smoothly the boundary of the hyperellipse constraint",
    rule=EXPONENTIALLY,
)
def _border_is_reached_smoothly(pbvs: Run) -> Finding:
    return exponentially(pbvs, "fov")


@claim(
    "6d",
    UNSELECTED,
    where="10.2.1, Fig. 16",
    sentence="with a 30 % error in the gradient the result is very similar",
    rule=SIMILAR,
)
def _result_is_similar(unselected: StudyResult) -> Finding:
    return in_unselected(unselected, PBVS_SCENARIO, "similar")


@claim(
    "6j",
    UNSELECTED,
    where="10.2.1, Fig. 16",
    sentence="only in the image trajectories and joint speeds a little difference can be "
    "appreciated [joint speeds]",
    rule=LITTLE,
)
def _speeds_differ_little(unselected: StudyResult) -> Finding:
    return in_unselected(unselected, PBVS_SCENARIO, "little_speed")


# --- 10.2.2: IBVS with an occlusion constraint ---


@claim(
    "6e",
    IBVS,
    where="10.2.2, Figs. 17, 18",
    sentence="one of the markers remains visible, outside the forbidden area, fully utilizing the "
    "allowed space",
    rule="exactly one marker's row acts, max σ ≤ 0, unused margin of at most 1 % of the area's "
    "radius",
)
def _one_marker_slides_at_the_area(ibvs: Run) -> Finding:
    return one_marker_slides(ibvs, "occlusion")


@claim(
    "6f",
    IBVS,
    where="10.2.2, Fig. 17",
    sentence="reaching smoothly the boundary of the hyperellipse constraint",
    rule=EXPONENTIALLY,
)
def _area_is_reached_smoothly(ibvs: Run) -> Finding:
    return exponentially(ibvs, "occlusion")


@claim(
    "6h",
    UNSELECTED,
    where="10.2.2, Fig. 19",
    sentence="with a 30 % error in the gradient the result is very similar",
    rule=SIMILAR,
)
def _result_of_ibvs_is_similar(unselected: StudyResult) -> Finding:
    return in_unselected(unselected, IBVS_SCENARIO, "similar")


@claim(
    "6k",
    UNSELECTED,
    where="10.2.2, Fig. 19",
    sentence="only in the feature errors and joint speeds a little difference can be appreciated "
    "[joint speeds]",
    rule=LITTLE,
)
def _speeds_of_ibvs_differ_little(unselected: StudyResult) -> Finding:
    return in_unselected(unselected, IBVS_SCENARIO, "little_speed")


# --- 10.2 and 11: both experiments ---


@claim(
    "6c",
    PBVS,
    where="10.2.1, Figs. 14, 15",
    sentence="the robot is positioned at the desired pose",
    rule="converged",
)
@claim(
    "6g",
    IBVS,
    where="10.2.2, Figs. 17, 18",
    sentence="the robot is positioned at the desired pose",
    rule="converged",
)
def _goal_is_reached(run: Run) -> Finding:
    """Status, settling time and remaining errors at the end of the run."""
    end = run.trajectory
    text = (
        f"{end.status} after {run.settling_time:.0f} s; "
        f"at the end {end.feature_error_px[-1]:.2f} px"
    )
    position, angle = 1e3 * end.camera_error[-1]
    if np.isfinite(position):
        text += f", {position:.2f} mm, {angle:.2f} mrad"
    return finding(
        f"{text} from the goal", holds=end.status == "converged", settling=run.settling_time
    )


@claim(
    "6l",
    *FASTER,
    where="10.2",
    sentence="for stability reasons, the movement speed has to be relatively slow to meet the "
    "limited bandwidth given by the sampling period of 0.1 s",
    rule="with ten times K_T,p(0) both experiments violate their boundary or do not reach the goal "
    "at T_s = 0.1 s, and both keep and reach them at 0.01 s; partly if the former only",
)
def _fast_motion_needs_fast_sampling(
    pbvs: Run, pbvs_sampled_faster: Run, ibvs: Run, ibvs_sampled_faster: Run
) -> Finding:
    shown = (
        ("experiment 1", "fov", pbvs),
        ("experiment 1", "fov", pbvs_sampled_faster),
        ("experiment 2", "occlusion", ibvs),
        ("experiment 2", "occlusion", ibvs_sampled_faster),
    )
    texts = [
        f"{name}, T_s = {run.sampling_time:g} s: {run.trajectory.status}, "
        f"{amount(clear(run, *run.labels(kind)))} px clear"
        for name, kind, run in shown
    ]
    fails = not passes(pbvs, "fov") and not passes(ibvs, "occlusion")
    works = passes(pbvs_sampled_faster, "fov") and passes(ibvs_sampled_faster, "occlusion")
    return finding("; ".join(texts), holds=fails and works, partly=fails)


@claim(
    "6i",
    PBVS,
    IBVS,
    UNSELECTED,
    where="11",
    sentence="despite the sampling time of 0.1 s the performance was satisfactory even for a 30 % "
    "gradient vector error",
    rule="T_s = 0.1 s, both experiments with errors converge with max σ ≤ 0 and all markers in the "
    f"image: {EVERYWHERE}. Of both; partly if one of them holds or holds partly",
)
def _performance_is_satisfactory(pbvs: Run, ibvs: Run, unselected: StudyResult) -> Finding:
    findings = [
        in_unselected(unselected, scenario, "satisfactory")
        for scenario in (PBVS_SCENARIO, IBVS_SCENARIO)
    ]
    slow = pbvs.sampling_time == 0.1 and ibvs.sampling_time == 0.1
    first, second = findings
    return finding(
        f"T_s = {pbvs.sampling_time:g} s. Experiment 1: {first.text}. Experiment 2: {second.text}",
        holds=slow and all(each.verdict == "holds" for each in findings),
        partly=any(each.verdict != "does not hold" for each in findings),
        **{**first.values, **second.values},
    )
