"""Tuning problem: laws, training scenes and the evaluation of settings.

Only scenes of the training half are used.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from ...comparisons.runs.identity import Identity, identity
from ...comparisons.runs.machine import module_versions
from ...comparisons.runs.pool import Failure, processes, run_all
from ...comparisons.runs.spec import BASELINE, ControllerSpec
from ...controllers import Choices, Range, law_ranges
from ...controllers.base import innermost
from ...controllers.ranges import default_of
from ...errors import ConfigurationError, format_value
from ...plugins.provenance import Files
from ..evidence import Batch, Campaign, scored
from ..evidence.campaign import family_identity
from ..evidence.own_files import require_unchanged_files
from ..evidence.runner import results
from ..families import Drawn, Family


class Objective(NamedTuple):
    """Quantity to be minimized.

    ``worst`` is its upper bound, and its value for a run that does not converge.
    """

    column: str
    title: str
    worst: float
    unit: float  #: Amount that weighs as much as one unit of another objective.


#: A tenth of the space, a decade of variation and a tenth of the settling time have equal weight.
OBJECTIVES = (
    Objective("unused", "unused space", 1.0, 0.1),
    Objective("log_variation", "log₁₀ of acceleration variation", 4.0, 1.0),
    Objective("settling", "settling time by that of tracking", 2.0, 0.1),
)

REFERENCE = tuple(objective.worst for objective in OBJECTIVES)

STILL_MOVING = ("slow", "unfinished")  #: statuses of runs that still move when time is up
ROUNDING = 1e-12  #: relative difference up to which distances are equal

Point = tuple[float, ...]  #: values of the objectives


class Outcome(NamedTuple):
    """Status of one run, violation flag and objectives.

    An objective that the run does not have is NaN.
    """

    status: str
    violated: bool
    point: Point


class Judged(NamedTuple):
    """Mean objectives of a setting, share of runs with a violation, and numbers of runs.

    Successes are the runs that converge without violation.
    """

    point: Point
    violations: float
    runs: int
    converged: int
    successes: int

    @property
    def success(self) -> str:
        """Success rate as shown in reports."""
        return f"{100.0 * self.successes / self.runs:.1f} %"


def outcome(result: Mapping[str, Any], baseline: Mapping[str, Any]) -> Outcome:
    """Return the outcome of a run compared with the unconstrained baseline in the same scene.

    ``result`` and ``baseline`` are their lines of results. A run that does not converge has the
    worst value of every objective. There is one exception: if both the run and the baseline are
    still moving when time is up, no law can reach the goal, and the run counts by its variation
    alone. If a run converges, its unused space is NaN if no row was challenged, and its settling
    time is NaN if the baseline does not settle.
    """
    status = str(result["status"])
    violated = bool(result["violated"])
    both_still_move = status in STILL_MOVING and str(baseline["status"]) in STILL_MOVING
    if status != "converged" and not both_still_move:
        return Outcome(status, violated, REFERENCE)
    unused = 1.0 - float(result["utilization"])
    # a command that never changes has a variation of zero
    log_variation = -math.inf
    variation = float(result["acceleration_variation"])
    if variation > 0.0:
        log_variation = math.log10(variation)
    settling = math.nan
    tracking = float(baseline["settling_time_s"])
    if tracking > 0.0:
        settling = float(result["settling_time_s"]) / tracking
    worst = np.array(REFERENCE)
    point = np.clip([unused, log_variation, settling], -worst, worst)
    return Outcome(status, violated, tuple(point.tolist()))


def judged(outcomes: Sequence[Outcome]) -> Judged:
    """Combine the outcomes of all runs of a setting.

    An objective that no run has takes its worst value. The result does not depend on the order of
    the runs.
    """
    point = []
    for i, worst in enumerate(REFERENCE):
        every_value = [each.point[i] for each in outcomes]
        values = [value for value in every_value if not math.isnan(value)]
        mean = worst
        if values:
            # exact sums do not depend on the order of the runs
            mean = math.fsum(values) / len(values)
        point.append(mean)
    converged = [each for each in outcomes if each.status == "converged"]
    violated = sum(each.violated for each in outcomes)
    runs = len(outcomes)
    return Judged(
        point=tuple(point),
        violations=violated / runs,
        runs=runs,
        converged=len(converged),
        successes=sum(not each.violated for each in converged),
    )


def loss(judged: Judged) -> float:
    """Return the loss that the tuner minimizes.

    The number of unsuccessful runs comes first. For equal numbers, the sum of the objectives in
    their units decides.
    """
    lengths = []
    for value, objective in zip(judged.point, OBJECTIVES, strict=True):
        lengths.append(value / objective.unit)
    unsuccessful = judged.runs - judged.successes
    return 100.0 * unsuccessful + math.fsum(lengths)


def choose(settings: Sequence[Judged]) -> int:
    """Return the position of the best setting.

    It has the most successes. Among settings with as many, it is the one nearest to their ideal
    point, which has the smallest value of each objective. Distances are Euclidean, in the
    objectives' units ("compromise programming": Zeleny 1973). If distances are equal up to
    rounding, the smallest first objective decides, then the second, and so on.
    """
    most = max(each.successes for each in settings)
    best = [i for i, each in enumerate(settings) if each.successes == most]
    units = [objective.unit for objective in OBJECTIVES]
    points = np.array([settings[i].point for i in best]) / units
    ideal = points.min(axis=0)
    distance = np.linalg.norm(points - ideal, axis=1)
    greatest = distance.min() * (1.0 + ROUNDING)
    is_nearest = distance <= greatest
    nearest = [best[k] for k in np.flatnonzero(is_nearest)]
    return min(nearest, key=lambda i: (settings[i].point, i))


Options = dict[str, Any]

ALL = ""  #: key of the results on the runs of all families

ByFamily = dict[str, Judged]  #: results of a setting on all runs, and on those of each family

#: function that evaluates settings, all on the same runs
Evaluate = Callable[[Sequence[ControllerSpec]], list[ByFamily]]

#: half of each family that tuning uses; the other half is for testing the result
TRAINING = "training"


@dataclass(frozen=True)
class Searched:
    """Law as the campaign defines it. Options that the campaign sets are not searched."""

    law: ControllerSpec

    @property
    def name(self) -> str:
        """Name of the law in the campaign."""
        return self.law.name

    @cached_property
    def ranges(self) -> dict[str, Range | Choices]:
        """Ranges of all options that the campaign does not set."""
        return law_ranges(self.law.law, self.law.options, self.law.folder)

    @cached_property
    def default(self) -> Options:
        """Default values of the searched options."""
        law = innermost(self.law.make())
        return {option: default_of(law, option) for option in self.ranges}

    def setting(self, options: Mapping[str, Any]) -> ControllerSpec:
        """Return the law with these options; None keeps the default of an option."""
        chosen = {option: value for option, value in options.items() if value is not None}
        return replace(self.law, options={**self.law.options, **chosen})


@dataclass(frozen=True)
class Budget:
    """Budget of every law: settings per tuner seed, tuner seeds, and scenes of each family."""

    evaluations: int = 40
    seeds: int = 3
    scenes: int = 10

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise ConfigurationError(f"{name} must be 1 or more, not {format_value(value)}")


@dataclass(frozen=True)
class Problem:
    """Tuning problem: laws of a campaign in its families and conditions, with an equal budget."""

    campaign: Campaign
    budget: Budget

    def __post_init__(self) -> None:
        if not self.laws:
            raise ConfigurationError(
                f"campaign {self.campaign.name}: it has no controller to tune, only {BASELINE}"
            )

    @cached_property
    def laws(self) -> tuple[Searched, ...]:
        """All laws except the baseline. Raises ConfigurationError if a range is invalid."""
        entries = [entry for entry in self.campaign.controllers if entry.name != BASELINE]
        laws = tuple(map(Searched, entries))
        # evaluate cached properties now, so that mistakes are reported here
        for law in laws:
            _ = law.ranges
            _ = law.default
        return laws

    @property
    def baseline(self) -> ControllerSpec:
        """The campaign's entry of the unconstrained baseline."""
        return next(entry for entry in self.campaign.controllers if entry.name == BASELINE)

    def configuration(self) -> Identity:
        """Return everything that evaluations depend on, as data.

        The number of evaluations is not included, since more can be requested later.
        """
        campaign = self.campaign
        families = {}
        for family in campaign.families:
            conditions = list(campaign.conditions_of(family))
            families[family.name] = {**family_identity(family), "conditions": conditions}
        return identity(
            campaign.controllers,
            tuner={"name": "TPE", **module_versions(("optuna",))},
            objectives=["success", *(objective._asdict() for objective in OBJECTIVES)],
            seed=campaign.seed,
            scenes=self.budget.scenes,
            families=families,
        )

    def tasks(
        self,
        workers: int | None = None,
        on_progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> tuple[Batch, ...]:
        """Draw the training scenes and return one batch per scene and condition.

        The batches contain only the baseline. Raises ConfigurationError if a family has no scene,
        or if drawing a scene raises an exception.
        """
        campaign = self.campaign
        numbers = range(self.budget.scenes)
        calls = {}
        for family, number in product(campaign.families, numbers):
            calls[family.name, number] = family, number, TRAINING, campaign.seed
        answers = run_all(Family.scene, calls, workers=workers, on_progress=on_progress)
        batches: list[Batch] = []
        for family in campaign.families:
            drawn: list[Drawn] = []
            for number in numbers:
                scene = answers[family.name, number]
                if isinstance(scene, Failure):
                    raise ConfigurationError(
                        f"family {family.name}: a training scene cannot be drawn: {scene.reason}"
                    )
                if scene.found:
                    drawn.append(scene)
            if not drawn:
                family.require_scenes(TRAINING, campaign.seed, self.budget.scenes)
            for scene, condition in product(drawn, campaign.conditions_of(family)):
                batch = Batch(
                    family,
                    scenes=(scene.number,),
                    conditions=(condition,),
                    controllers=(self.baseline,),
                    half=TRAINING,
                    seed=campaign.seed,
                    limit=None,
                    drawn=scene,
                )
                batches.append(batch)
        return tuple(batches)


@contextmanager
def evaluating(batches: Sequence[Batch], workers: int | None, files: Files) -> Iterator[Evaluate]:
    """Open processes that evaluate settings on all batches, for the duration of the ``with`` block.

    A run whose process dies or that exceeds its time limit is a failed run. Files that custom laws
    load and read are added to ``files``. Raises ConfigurationError if the content of a file
    changes.
    """
    families = dict.fromkeys(batch.family.name for batch in batches)
    with processes(workers)(scored) as pool:

        def evaluate(settings: Sequence[ControllerSpec]) -> list[ByFamily]:
            if not settings:
                return []
            named = []
            outcomes: list[dict[str, list[Outcome]]] = []
            for i, setting in enumerate(settings):
                named.append(replace(setting, name=str(i)))
                outcomes.append({name: [] for name in (ALL, *families)})
            calls = []
            for batch in batches:
                controllers = (*batch.controllers, *named)
                calls.append(replace(batch, controllers=controllers))
            for position, part in results(calls, pool):
                require_unchanged_files(part.files, files)
                files.update(part.files)
                family = batches[position].family.name
                lines = part.runs.to_pandas().set_index("controller").to_dict("index")
                for setting, by_family in zip(named, outcomes, strict=True):
                    run = outcome(lines[setting.name], lines[BASELINE])
                    by_family[ALL].append(run)
                    by_family[family].append(run)
            evaluated = []
            for by_family in outcomes:
                evaluated.append({name: judged(runs) for name, runs in by_family.items()})
            return evaluated

        yield evaluate
