"""Claims 7 and 9 as far as a few runs decide them, and 11: moving objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...comparisons.run import Run
from ...comparisons.runs.spec import ControllerSpec, RunSpec
from ...controllers import Controller, SlidingMode
from ...rows import Command, Rows, Task
from ..verdicts import Finding, NotMeasured, claim, finding
from .boundary import greatest_sigma, with_sigma
from .simulations import CASE, FOV, SECOND

PARAMETERS = (0.1, 0.2, 0.4)
APPROACHES = tuple(RunSpec("example-2d-fov", overrides={"constraints.0.K": K}) for K in PARAMETERS)
WITHOUT_DRIFT = ControllerSpec("vsconstraints.paper.claims.general:WithoutDrift")
BLIND = tuple(RunSpec(spec.name, WITHOUT_DRIFT) for spec in (FOV, CASE))
TARGET, OCCLUDER, SPHERE = (RunSpec(name) for name in ("moving-target", "moving-occluder", "moving-sphere"))
#: Where both scenarios with obstacles say that their motion is known: without it the rows take them for static.
KNOWN = "constraints.0.motion.known"
ROUNDING = 1e-9  #: Differences below this are none.


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
    constants = dict(zip(PARAMETERS, map(time_constant, runs), strict=True))
    good = all(abs(tau / K - 1.0) <= 0.25 for K, tau in constants.items())
    rising = bool((np.diff(list(constants.values())) > 0.0).all())
    return finding("7b", good, rising, {"constants": constants}, **{str(K): tau for K, tau in constants.items()})


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
    shown, same = [], []
    for spec, law, blind in zip(BLIND, runs[:2], runs[2:], strict=True):
        whole = len(law.t) == len(blind.t)
        difference = np.abs(law.trajectory.qdd_command - blind.trajectory.qdd_command).max() if whole else None
        same.append(difference == 0.0 and bool((law.trajectory.q == blind.trajectory.q).all()))
        shown.append((spec.name, difference, len(law.t)))
    return finding("9a", all(same), False, {"runs": shown})


@claim("11a", TARGET, OCCLUDER, SPHERE)
def _moving_objects(*runs: Run) -> Finding:
    scenes, good = [], []
    for spec, run in zip((TARGET, OCCLUDER, SPHERE), runs, strict=True):
        sigma, acting = greatest_sigma(run, *with_sigma(run.trajectory.labels)), run.ever_active()
        status = run.trajectory.status
        scenes.append((spec.name, status, sigma, acting))
        good.append(status == "converged" and sigma <= 0.0 and bool(acting))
    return finding("11a", all(good), any(good), {"scenes": scenes})


@claim("11b", OCCLUDER, SPHERE)
def _only_the_bound_changes(*runs: Run) -> Finding:
    """Rows along the same motion with and without knowledge of the obstacle's."""
    scenes, same, equal = [], [], []
    for spec, run in zip((OCCLUDER, SPHERE), runs, strict=True):
        knowing = run.setup.world()
        unknowing = RunSpec(spec.name, overrides={KNOWN: False}).load().setup().control()
        needed, Lg, phi = np.zeros(2), 0.0, 0.0
        for k in np.flatnonzero((run.trajectory.phi >= 0.0).any(axis=1)):
            state = float(run.t[k]), run.trajectory.q[k], run.trajectory.qd[k]
            informed, blind = knowing.evaluate(*state).rows, unknowing.evaluate(*state).rows
            active = informed.phi >= 0.0
            needed = np.maximum(needed, [np.maximum(rows.Lf[active], 0.0).sum() for rows in (informed, blind)])
            Lg = max(Lg, np.abs(informed.Lg - blind.Lg).max())
            phi = max(phi, (np.abs(informed.phi - blind.phi) * active).max())
        scenes.append((spec.name, Lg, needed, phi))
        same.append(Lg < ROUNDING and abs(needed[0] - needed[1]) > ROUNDING)
        equal.append(phi < ROUNDING)
    return finding("11b", all(same) and all(equal), all(same), {"scenes": scenes})
