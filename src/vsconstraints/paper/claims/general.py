"""Claims 7 and 9 as far as a few runs decide them: section 6."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...comparisons.run import Run
from ...comparisons.runs.spec import ControllerSpec, RunSpec
from ...controllers import Controller, SlidingMode
from ...rows import Command, Rows, Task
from ...rows.readable import amount
from ..verdicts import Finding, NotMeasured, claim, finding
from .case_study import CASE
from .first_example import FOV, SECOND

PARAMETERS = (0.1, 0.2, 0.4)
APPROACHES = tuple(RunSpec("example-2d-fov", overrides={"constraints.0.K": K}) for K in PARAMETERS)
WITHOUT_DRIFT = ControllerSpec("vsconstraints.paper.claims.general:WithoutDrift")
BLIND = tuple(RunSpec(spec.name, WITHOUT_DRIFT) for spec in (FOV, CASE))


class WithoutDrift(Controller):
    """The sliding-mode law with random numbers in place of L_fφ, which contains all second derivatives."""

    name = "sliding-mode-without-drift"

    def __init__(self) -> None:
        self.law = SlidingMode()
        self.reset()

    def reset(self, period: float | None = None) -> None:
        """Restart the random numbers."""
        self.random = np.random.default_rng(0)

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class."""
        return self.law.command(replace(rows, Lf=self.random.normal(scale=100.0, size=rows.Lf.shape)), task)


@claim("7b", *APPROACHES)
def _approach_follows_the_parameter(*runs: Run) -> Finding:
    found = dict(zip(PARAMETERS, map(time_constant, runs), strict=True))
    text = "; ".join(f"K = {K:g} s: {tau:.3f} s" for K, tau in found.items())
    good = all(abs(tau / K - 1.0) <= 0.25 for K, tau in found.items())
    rising = bool((np.diff(list(found.values())) > 0.0).all())
    return finding(f"measured time constants: {text}", good, rising, **{str(K): tau for K, tau in found.items()})


def time_constant(run: Run) -> float:
    """Of the normal speed of the second marker over two K from when its row first acts."""
    acts = run.phi(SECOND) >= 0.0
    if not acts.any():
        raise NotMeasured("the row never acts")
    first, K = run.t[acts.argmax()], run.constraint(SECOND).K
    during = (run.t >= first) & (run.t <= first + 2.0 * K)
    speed = np.maximum(run.approach_speed(SECOND)[during], 1e-6)
    return -1.0 / float(np.polyfit(run.t[during], np.log(speed), 1)[0])


@claim("9a", FOV, CASE, *BLIND)
def _second_derivatives_not_needed(*runs: Run) -> Finding:
    """Difference between the law and the law without L_fφ."""
    texts, same = [], []
    for spec, law, blind in zip(BLIND, runs[:2], runs[2:], strict=True):
        if len(law.t) != len(blind.t):
            texts.append(f"{spec.name}: one run ends earlier")
            same.append(False)
            continue
        difference = np.abs(law.trajectory.qdd_command - blind.trajectory.qdd_command).max()
        same.append(difference == 0.0 and bool((law.trajectory.q == blind.trajectory.q).all()))
        texts.append(f"{spec.name}: q̈_c differs by {amount(difference)} rad/s² in {len(law.t)} samples")
    return finding("; ".join(texts), all(same))
