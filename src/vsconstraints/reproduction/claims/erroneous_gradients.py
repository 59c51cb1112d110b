"""Claim 6 where it speaks of errors in the gradient (49): in the scenes of the experiments and in unselected ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...studies import StudyResult
from ...studies.unselected_experiments import APPLIED, LITTLE, VERY_SIMILAR
from ..runs import Run, RunSpec
from ..verdicts import Finding, NotMeasured, Verdict, claim, judged
from .boundary import signed
from .experiments import IBVS, PBVS, sliding_row
from .studied import number

PBVS_ERROR, IBVS_ERROR = RunSpec("experiment-1-pbvs-gradient-error"), RunSpec("experiment-2-ibvs-gradient-error")
IN_ACTION_ALONE = (("disturbances.gradient_error_in_phi", False),)
PBVS_ALONE, IBVS_ALONE = (RunSpec(spec.scenario, overrides=IN_ACTION_ALONE) for spec in (PBVS_ERROR, IBVS_ERROR))


CASES = ("plus", "minus", "plus-action")
"""Of the study of unselected scenes: (49) as printed, with its signs reversed, and in L_gφ alone."""

SCENES = 100
"""Fewest unselected scenes that a share is taken of."""

NEARLY_ALL, MOST = 0.95, 0.5
"""Shares of the unselected scenes: with the former a sentence holds, with the latter partly."""

UNSELECTED = "unselected-experiments"

EVERYWHERE = (
    "here and, with the printed and the reversed signs of (49), in 95 % of at least 100 unselected scenes; partly if "
    "in half of these with both, or with ∇σ_e in L_gφ alone. Not measured if the error moves no track by more than "
    "0.01 px. ∇σ_e stands in φ, L_gφ and L_fφ"
)

SIMILAR_RULE = (
    "both reach the goal with σ ≤ 0, the same marker slides, and no marker is ever farther from where it is without "
    f"errors than 5 % of the image's width: {EVERYWHERE}"
)

LITTLE_RULE = f"no joint's speed ever differs by more than 10 % of the greatest speed without errors: {EVERYWHERE}"


def in_unselected(study: StudyResult, scenario: str, what: str, here: bool) -> tuple[Verdict, str]:
    """A verdict on this scene and the unselected ones, and the counts in words."""
    counts = {case: (_number(study, scenario, case, what), _number(study, scenario, case, "scenes")) for case in CASES}
    fewest = min(N for _, N in counts.values())
    if fewest < SCENES:
        raise NotMeasured(f"the study {UNSELECTED} has {fewest:.0f} scenes of {scenario}, fewer than {SCENES}")
    for case, (_, N) in counts.items():
        if _number(study, scenario, case, "applied") < NEARLY_ALL * N:
            raise NotMeasured(f"the error of the gradient changes nothing in {scenario} ({case}): was it applied?")
    plus, minus, alone = (x / N for x, N in counts.values())
    text = (
        "in {:.0f} of {:.0f} unselected scenes, with reversed signs in {:.0f} of {:.0f}, with ∇σ_e in L_gφ alone, the "
        "other reading of (49), in {:.0f} of {:.0f}"
    ).format(*(number for pair in counts.values() for number in pair))
    both = min(plus, minus)
    verdict = judged(here and both >= NEARLY_ALL, max(both, alone) >= MOST)
    return verdict, f"{'holds' if here else 'does not hold'} in this scene; {text}"


def _number(study: StudyResult, scenario: str, case: str, what: str) -> float:
    return number(study, f"{scenario}.{case}.{what}")


@dataclass(frozen=True)
class Difference:
    """How a run with an error in the gradient differs from the one without.

    Attributes
    ----------
    track
        Greatest distance of a marker at the same time [px].
    speed
        Greatest difference of a joint's speed [rad/s].
    fastest
        Greatest speed without the error [rad/s].
    sigma
        Greatest σ of a visibility row with the error.
    fine
        Whether both reach the goal, and the boundary is kept with the error.
    same
        Whether the same marker slides.
    """

    track: float
    speed: float
    fastest: float
    sigma: float
    fine: bool
    same: bool

    @classmethod
    def between(cls, exact: Run, erroneous: Run, kind: str) -> Difference:
        """That of two runs; raises NotMeasured if the error shows nowhere."""
        N = min(len(exact.t), len(erroneous.t))
        apart = np.linalg.norm(exact.trajectory.features_px[:N] - erroneous.trajectory.features_px[:N], axis=2)
        if not apart.max() > APPLIED:
            raise NotMeasured(f"tracks differ by {apart.max():.2g} px: was the error of the gradient applied?")
        speed = np.abs(exact.trajectory.qd[:N] - erroneous.trajectory.qd[:N])
        sigma = max(float(erroneous.sigma(label).max()) for label in erroneous.labels(kind))
        converged = all(run.trajectory.status == "converged" for run in (exact, erroneous))
        return cls(
            float(apart.max()),
            float(speed.max()),
            float(np.abs(exact.trajectory.qd).max()),
            sigma,
            converged and sigma <= 0.0,
            sliding_row(exact, kind) == sliding_row(erroneous, kind),
        )

    def similar(self, width: float) -> bool:
        """Whether the runs are very similar in an image of this width [px]."""
        return self.fine and self.same and self.track <= VERY_SIMILAR * width

    @property
    def little_speed(self) -> bool:
        """Whether joint speeds differ only a little."""
        return self.speed <= LITTLE * self.fastest


def very_similar(scenario: str, kind: str, exact: Run, erroneous: Run, alone: Run, study: StudyResult) -> Finding:
    """Differences between the runs without and with errors in the gradient, here and in unselected scenes."""
    width = float(exact.setup.scene.camera.size[0])
    here, other = (Difference.between(exact, run, kind) for run in (erroneous, alone))
    verdict, scenes = in_unselected(study, scenario, "similar", here.similar(width))
    text = (
        f"{scenes}. Here tracks differ by up to {here.track:.2f} px, with errors max σ = {signed(here.sigma)}, "
        f"{erroneous.trajectory.status}; with ∇σ_e in L_gφ alone by {other.track:.2f} px, max σ = "
        f"{signed(other.sigma)}, {alone.trajectory.status}"
    )
    return Finding(verdict, text, {"track_difference_px": here.track, "sigma_max": here.sigma})


def little_speed_difference(scenario: str, kind: str, exact: Run, erroneous: Run, study: StudyResult) -> Finding:
    """Differences of joint speeds, here and in unselected scenes."""
    here = Difference.between(exact, erroneous, kind)
    verdict, scenes = in_unselected(study, scenario, "little_speed", here.little_speed)
    share = here.speed / here.fastest
    text = (
        f"{scenes}. Here by up to {1e3 * here.speed:.2g} mrad/s, {100.0 * share:.0f} % of the fastest joint's "
        f"{1e3 * here.fastest:.3g} mrad/s"
    )
    return Finding(verdict, text, {"share": share})


@claim(
    "6d",
    "10.2.1, Fig. 16",
    "with a 30 % error in the gradient the result is very similar",
    SIMILAR_RULE,
    "fig-16.png",
    PBVS,
    PBVS_ERROR,
    PBVS_ALONE,
    UNSELECTED,
)
def pbvs_very_similar(exact: Run, erroneous: Run, alone: Run, study: StudyResult) -> Finding:
    """See :func:`very_similar`."""
    return very_similar(PBVS.scenario, "fov", exact, erroneous, alone, study)


@claim(
    "6h",
    "10.2.2, Fig. 19",
    "with a 30 % error in the gradient the result is very similar",
    SIMILAR_RULE,
    "fig-19.png",
    IBVS,
    IBVS_ERROR,
    IBVS_ALONE,
    UNSELECTED,
)
def ibvs_very_similar(exact: Run, erroneous: Run, alone: Run, study: StudyResult) -> Finding:
    """See :func:`very_similar`."""
    return very_similar(IBVS.scenario, "occlusion", exact, erroneous, alone, study)


@claim(
    "6i",
    "11",
    "despite the sampling time of 0.1 s the performance was satisfactory even for a 30 % gradient vector error",
    f"T_s = 0.1 s, both experiments with errors converge with max σ ≤ 0 and all markers in the image: {EVERYWHERE}. "
    "Of both; partly if one of them holds or holds partly",
    "study-unselected-experiments.png",
    PBVS,
    PBVS_ERROR,
    IBVS,
    IBVS_ERROR,
    UNSELECTED,
)
def satisfactory(pbvs: Run, pbvs_error: Run, ibvs: Run, ibvs_error: Run, study: StudyResult) -> Finding:
    """Both experiments with an erroneous gradient, here and in unselected scenes."""
    texts, verdicts = [], []
    pairs = ((PBVS.scenario, "fov", pbvs, pbvs_error), (IBVS.scenario, "occlusion", ibvs, ibvs_error))
    for experiment, (scenario, kind, exact, run) in enumerate(pairs, start=1):
        sigma = Difference.between(exact, run, kind).sigma
        seen = bool(run.setup.scene.camera.sees(run.trajectory.features_px).all())
        good = sigma <= 0.0 and seen and run.trajectory.status == "converged" and run.sampling_time == 0.1
        verdict, scenes = in_unselected(study, scenario, "satisfactory", good)
        verdicts.append(verdict)
        texts.append(
            f"experiment {experiment}: {scenes}; here T_s = {run.sampling_time:g} s, {run.trajectory.status}, max σ = "
            f"{signed(sigma)}"
        )
    return Finding(
        judged(all(v == "holds" for v in verdicts), any(v != "does not hold" for v in verdicts)), ". ".join(texts)
    )


@claim(
    "6j",
    "10.2.1, Fig. 16",
    "only in the image trajectories and joint speeds a little difference can be appreciated [joint speeds]",
    LITTLE_RULE,
    "fig-16.png",
    PBVS,
    PBVS_ERROR,
    UNSELECTED,
)
def pbvs_little_speed(exact: Run, erroneous: Run, study: StudyResult) -> Finding:
    """See :func:`little_speed_difference`."""
    return little_speed_difference(PBVS.scenario, "fov", exact, erroneous, study)


@claim(
    "6k",
    "10.2.2, Fig. 19",
    "only in the feature errors and joint speeds a little difference can be appreciated [joint speeds]",
    LITTLE_RULE,
    "fig-19.png",
    IBVS,
    IBVS_ERROR,
    UNSELECTED,
)
def ibvs_little_speed(exact: Run, erroneous: Run, study: StudyResult) -> Finding:
    """See :func:`little_speed_difference`."""
    return little_speed_difference(IBVS.scenario, "occlusion", exact, erroneous, study)
