"""Claim 6 where it speaks of errors in the gradient (49): in the scenes of the experiments and in unselected ones."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from ...comparisons.run import Run
from ...rows.readable import amount
from ..studies import StudyResult
from ..studies.unselected_experiments import APPLIED, LITTLE, VERY_SIMILAR
from ..verdicts import Finding, NotMeasured, Verdict, claim, finding, judged
from .boundary import greatest_sigma
from .experiments import FIRST, SECOND, Experiment, sliding_row
from .studied import number

PBVS_ERROR, IBVS_ERROR = FIRST.erroneous, SECOND.erroneous

CASES = ("plus", "minus", "plus-action")
"""Of the study of unselected scenes: (49) as printed, with its signs reversed, and in L_gφ alone."""

SCENES = 100
"""Fewest unselected scenes that a share is taken of."""

NEARLY_ALL, MOST = 0.95, 0.5
"""Shares of the unselected scenes: with the former a sentence holds, with the latter partly."""

UNSELECTED = "unselected-experiments"


def in_unselected(study: StudyResult, scenario: str, what: str, here: bool) -> tuple[Verdict, str]:
    """A verdict on this scene and the unselected ones, and the counts in words."""
    found, scenes = ([number(study, scenario, case, name) for case in CASES] for name in (what, "scenes"))
    if min(scenes) < SCENES:
        raise NotMeasured(f"the study {UNSELECTED} has {min(scenes):.0f} scenes of {scenario}, fewer than {SCENES}")
    for case, N in zip(CASES, scenes, strict=True):
        if number(study, scenario, case, "applied") < NEARLY_ALL * N:
            raise NotMeasured(f"the error of the gradient changes nothing in {scenario} ({case}): was it applied?")
    plus, minus, alone = (x / N for x, N in zip(found, scenes, strict=True))
    of = [f"{x:.0f} of {N:.0f}" for x, N in zip(found, scenes, strict=True)]
    text = (
        f"{'holds' if here else 'does not hold'} in this scene; in {of[0]} unselected scenes, with reversed signs in "
        f"{of[1]}, with ∇σ_e in L_gφ alone, the other reading of (49), in {of[2]}"
    )
    both = min(plus, minus)
    return judged(here and both >= NEARLY_ALL, max(both, alone) >= MOST), text


class Difference(NamedTuple):
    """How a run with an error in the gradient differs from the one without.

    ``track`` is the greatest distance of a marker at the same time [px], ``speed`` the greatest difference of a joint's
    speed, ``fastest`` the greatest speed without the error [rad/s], ``sigma`` the greatest σ of a visibility row with
    it; ``fine`` says that both reach the goal and the boundary is kept, ``same`` that the same marker slides.
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
        sigma = greatest_sigma(erroneous, *erroneous.labels(kind))
        return cls(
            float(apart.max()),
            float(np.abs(exact.trajectory.qd[:N] - erroneous.trajectory.qd[:N]).max()),
            float(np.abs(exact.trajectory.qd).max()),
            sigma,
            all(run.trajectory.status == "converged" for run in (exact, erroneous)) and sigma <= 0.0,
            sliding_row(exact, kind) == sliding_row(erroneous, kind),
        )

    def similar(self, width: float) -> bool:
        """Whether the runs are very similar in an image of this width [px]."""
        return self.fine and self.same and self.track <= VERY_SIMILAR * width

    @property
    def little_speed(self) -> bool:
        """Whether joint speeds differ only a little."""
        return self.speed <= LITTLE * self.fastest


def very_similar(exact: Run, erroneous: Run, alone: Run, study: StudyResult, *, of: Experiment) -> Finding:
    """Differences between the runs without and with errors in the gradient, here and in unselected scenes."""
    width = float(exact.setup.scene.camera.size[0])
    here, other = (Difference.between(exact, run, of.kind) for run in (erroneous, alone))
    verdict, scenes = in_unselected(study, of.exact.name, "similar", here.similar(width))
    text = (
        f"{scenes}. Here tracks differ by up to {here.track:.2f} px, with errors max σ = {amount(here.sigma)}, "
        f"{erroneous.trajectory.status}; with ∇σ_e in L_gφ alone by {other.track:.2f} px, max σ = "
        f"{amount(other.sigma)}, {alone.trajectory.status}"
    )
    return Finding(verdict, text, {"track_difference_px": here.track, "sigma_max": here.sigma})


def little_speed_difference(exact: Run, erroneous: Run, study: StudyResult, *, of: Experiment) -> Finding:
    """Differences of joint speeds, here and in unselected scenes."""
    here = Difference.between(exact, erroneous, of.kind)
    verdict, scenes = in_unselected(study, of.exact.name, "little_speed", here.little_speed)
    share = here.speed / here.fastest
    text = (
        f"{scenes}. Here by up to {1e3 * here.speed:.2g} mrad/s, {100.0 * share:.0f} % of the fastest joint's "
        f"{1e3 * here.fastest:.3g} mrad/s"
    )
    return Finding(verdict, text, {"share": share})


for experiment, similar, little in ((FIRST, "6d", "6j"), (SECOND, "6h", "6k")):
    pair = (experiment.exact, experiment.erroneous)
    claim(similar, *pair, experiment.alone, UNSELECTED)(partial(very_similar, of=experiment))
    claim(little, *pair, UNSELECTED)(partial(little_speed_difference, of=experiment))


@claim("6i", *(spec for one in (FIRST, SECOND) for spec in (one.exact, one.erroneous)), UNSELECTED)
def _satisfactory(pbvs: Run, pbvs_error: Run, ibvs: Run, ibvs_error: Run, study: StudyResult) -> Finding:
    texts, verdicts = [], []
    for experiment, exact, run in ((FIRST, pbvs, pbvs_error), (SECOND, ibvs, ibvs_error)):
        sigma = Difference.between(exact, run, experiment.kind).sigma
        seen = bool(run.setup.scene.camera.sees(run.trajectory.features_px).all())
        good = sigma <= 0.0 and seen and run.trajectory.status == "converged" and run.sampling_time == 0.1
        verdict, scenes = in_unselected(study, experiment.exact.name, "satisfactory", good)
        verdicts.append(verdict)
        texts.append(
            f"{experiment.name}: {scenes}; here T_s = {run.sampling_time:g} s, {run.trajectory.status}, max σ = "
            f"{amount(sigma)}"
        )
    return finding(". ".join(texts), {*verdicts} == {"holds"}, {*verdicts} != {"does not hold"})
