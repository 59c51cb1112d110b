"""Section 3, geometric invariance using sliding mode control: claim 10b."""

from __future__ import annotations

from ...comparisons.run import Run
from ..scenes import NOT_DIFFERENTIABLE, SCENES
from ..studies import StudyResult
from ..verdicts import Finding, NotMeasured, claim, finding
from .boundary import clear, excess, number, with_sigma


@claim(
    "10b",
    "switching-gain",
    *SCENES,
    where="3",
    sentence="a switching gain above Σ max(L_fφ, 0) (12) is sufficient for making the set "
    "invariant",
    rule="every run of the sweep, and every scene with the law, whose u⁺ is above the bound (12) "
    "along its own motion keeps φ within T_s u⁺; partly if σ ≤ 0 in all of them. Rows of several "
    "kinds are divided by their u⁺, so that it is one; the concave corner is left out, where φ is "
    "not differentiable",
)
def _bound_is_sufficient(study: StudyResult, *runs: Run) -> Finding:
    """Number of runs above the bound that keep σ ≤ 0, and φ in its band."""
    names = ("above_bound", "above_bound_allowed", "above_bound_in_band")
    above, kept, band = (int(number(study, name)) for name in names)
    broken: dict[str, float] = {}
    beyond: dict[str, float] = {}
    for spec, run in zip(SCENES, runs, strict=True):
        if spec.name == NOT_DIFFERENTIABLE:
            continue
        share = run.needed_share().max()
        labels = run.trajectory.labels
        if share >= 1.0:
            broken[spec.name] = share
            continue
        most = max(excess(run, label) for label in labels)
        above += 1
        band += most <= 1.0
        kept += all(clear(run, label) >= 0.0 for label in with_sigma(labels))
        if most > 1.0:
            beyond[spec.name] = most
    if above == 0:
        raise NotMeasured("no run is above the bound")
    outside = [f"{name} ({most:.3g} T_s u⁺)" for name, most in beyond.items()]
    asking = [f"{name} ({share:.3g} u⁺)" for name, share in broken.items()]
    text = f"of {above} runs above the bound {kept} keep σ ≤ 0 and {band} keep φ ≤ T_s u⁺"
    if outside:
        text += f", not {', '.join(outside)}"
    text += f"; (12) asks for more than the printed u⁺ in {', '.join(asking) or 'no scene'}"
    if band < above:
        text += (
            "; (12) is about continuous time, in which tracking does not move φ while the law acts"
        )
    values = {"above": above, "kept": kept, "band": band}
    return finding(text, holds=band == above, partly=kept == above, **values)
