"""Claims 7 and 9 as far as a few runs decide them: section 6."""

from __future__ import annotations

import numpy as np

from ..runs import Run, RunSpec
from ..verdicts import Finding, NotMeasured, claim, judged
from .boundary import signed
from .case_study import CASE
from .first_example import FOV, SECOND

SCENARIOS = ("example-2d-fov", "case-study-6r")
PARAMETERS = (0.1, 0.2, 0.4)
APPROACHES = tuple(RunSpec("example-2d-fov", overrides=(("constraints.0.K", K),)) for K in PARAMETERS)
BLIND = tuple(RunSpec(name, "vsconstraints.reproduction.without_drift:WithoutDrift") for name in SCENARIOS)


@claim(
    "7b",
    "6",
    "the boundary is reached smoothly depending on a free design parameter; the velocity perpendicular to it is "
    "progressively reduced to zero",
    "in the first example the normal speed decays with a time constant within 25 % of K, for K = 0.1, 0.2 and 0.4 s; "
    "partly if it grows with K",
    "fig-04.png",
    *APPROACHES,
)
def approach_follows_the_parameter(*runs: Run) -> Finding:
    """Time constant of the normal speed once the row acts, for three K."""
    found = [_time_constant(run) for run in runs]
    text = "; ".join(f"K = {K:g} s: {tau:.3f} s" for K, tau in zip(PARAMETERS, found, strict=True))
    good = all(abs(tau / K - 1.0) <= 0.25 for K, tau in zip(PARAMETERS, found, strict=True))
    rising = bool((np.diff(found) > 0.0).all())
    return Finding(
        judged(good, rising), f"measured time constants: {text}", dict(zip(map(str, PARAMETERS), found, strict=True))
    )


def _time_constant(run: Run) -> float:
    """Of the normal speed of the second marker over two K from when its row first acts."""
    acts = run.phi(SECOND) >= 0.0
    if not acts.any():
        raise NotMeasured("the row never acts")
    first, K = run.t[acts.argmax()], run.constraint(SECOND).K
    during = (run.t >= first) & (run.t <= first + 2.0 * K)
    speed = np.maximum(run.approach_speed(SECOND)[during], 1e-6)
    slope = float(np.polyfit(run.t[during], np.log(speed), 1)[0])
    return -1.0 / slope


@claim(
    "9a",
    "6",
    "the Lie derivatives L_fφ are not needed, only L_gφ; no second-order derivatives are required",
    "with random numbers instead of L_fφ, where all second derivatives are, every joint position and command is the "
    "same",
    "",
    FOV,
    CASE,
    *BLIND,
)
def second_derivatives_not_needed(*runs: Run) -> Finding:
    """Difference between the law and the law without L_fφ."""
    texts, same = [], []
    for scenario, law, blind in zip(SCENARIOS, runs[:2], runs[2:], strict=True):
        if len(law.t) != len(blind.t):
            texts.append(f"{scenario}: one run ends earlier")
            same.append(False)
            continue
        difference = float(np.abs(law.trajectory.qdd_command - blind.trajectory.qdd_command).max())
        same.append(difference == 0.0 and bool((law.trajectory.q == blind.trajectory.q).all()))
        texts.append(f"{scenario}: q̈_c differs by {signed(difference)} rad/s² in {len(law.t)} samples")
    return Finding(judged(all(same)), "; ".join(texts))
