"""What is tuned on what: laws, and scenes of the training half only; and settings evaluated on
them.
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

from ...controllers import Choices, Range, law_ranges
from ...controllers.base import innermost
from ...controllers.ranges import default_of
from ...errors import ConfigurationError, shown
from ...plugins.provenance import Files
from ...scenarios.families import Drawn, Family
from ..evidence import Batch, Campaign, scored
from ..evidence.campaign import of_controllers, of_family
from ..evidence.own_files import demand_unchanged_files
from ..evidence.runner import results
from ..runs.machine import code_identity, module_versions, run_limit
from ..runs.pool import Failure, processes, run_all
from ..runs.spec import BASELINE, ControllerSpec


class Objective(NamedTuple):
    """A quantity to be minimized; ``worst`` bounds it and is that of a run that does not
    converge.
    """

    column: str
    title: str
    worst: float
    unit: float  #: Weighs as much as one unit of another objective.


#: A tenth of the space, a decade of variation and a tenth of the settling time weigh the same.
OBJECTIVES = (
    Objective("unused", "unused space", 1.0, 0.1),
    Objective("log_variation", "log₁₀ of acceleration variation", 4.0, 1.0),
    Objective("settling", "settling time by that of tracking", 2.0, 0.1),
)

REFERENCE = tuple(objective.worst for objective in OBJECTIVES)

STILL_MOVING = ("slow", "unfinished")  #: statuses of runs that are still moving when time is up
ROUNDING = 1e-12  #: distances that differ by less, relatively, are the same

Point = tuple[float, ...]  #: a value of each objective


class Outcome(NamedTuple):
    """Status of one run, whether a constraint was violated, and the objectives; NaN where the run
    has none.
    """

    status: str
    violated: bool
    point: Point


class Judged(NamedTuple):
    """Means of a setting's objectives, share of runs with a violation, numbers of runs; successes
    violate nothing.
    """

    point: Point
    violations: float
    runs: int
    converged: int
    successes: int

    @property
    def success(self) -> str:
        """As reports show it."""
        return f"{100.0 * self.successes / self.runs:.1f} %"


def outcome(result: Mapping[str, Any], baseline: Mapping[str, Any]) -> Outcome:
    """The outcome of a run, from its line of results and that of the unconstrained baseline in the
    same scene.

    A run that does not converge has the worst value of every objective; but if it and the baseline
    are still moving when time is up, no law can reach the goal, and it counts by its variation
    alone. Of one that converges, the unused space is left out where nothing was challenged, and the
    settling time where the baseline does not settle.
    """
    status = str(result["status"])
    violated = bool(result["violated"])
    if status != "converged" and not {status, str(baseline["status"])}.issubset(STILL_MOVING):
        return Outcome(status, violated, REFERENCE)
    variation = float(result["acceleration_variation"])
    tracking = float(baseline["settling_time_s"])
    values = (
        1.0 - float(result["utilization"]),
        math.log10(variation) if variation > 0.0 else -math.inf,
        float(result["settling_time_s"]) / tracking if tracking > 0.0 else math.nan,
    )
    # log10 of a command that never changes has no lower bound
    bounded = (
        value if math.isnan(value) else min(max(value, -worst), worst)
        for value, worst in zip(values, REFERENCE, strict=True)
    )
    return Outcome(status, violated, tuple(bounded))


def judged(outcomes: Sequence[Outcome]) -> Judged:
    """All outcomes of one setting; an objective that no run has is at its worst. The order of runs
    does not matter.
    """
    point = []
    for i, worst in enumerate(REFERENCE):
        values = [each.point[i] for each in outcomes if not math.isnan(each.point[i])]
        point.append(math.fsum(values) / len(values) if values else worst)
    violated = sum(each.violated for each in outcomes)
    converged = [each for each in outcomes if each.status == "converged"]
    successes = sum(not each.violated for each in converged)
    return Judged(tuple(point), violated / len(outcomes), len(outcomes), len(converged), successes)


def loss(judged: Judged) -> float:
    """What the tuner minimizes: failed runs, and of as many the sum of the objectives in their
    units.
    """
    lengths = (
        value / objective.unit for value, objective in zip(judged.point, OBJECTIVES, strict=True)
    )
    return 100.0 * (judged.runs - judged.successes) + math.fsum(lengths)


def choose(settings: Sequence[Judged]) -> int:
    """Position of the setting with the most successes; of as many, the one nearest to their ideal
    point.

    That has the least value of each objective; distances are Euclidean, in the objectives' units
    ("compromise programming": Zeleny 1973). Of points as near, to rounding, the one with the least
    first objective is taken, etc.
    """
    most = max(each.successes for each in settings)
    best = [i for i, each in enumerate(settings) if each.successes == most]
    points = np.array([settings[i].point for i in best]) / [
        objective.unit for objective in OBJECTIVES
    ]
    distance = np.linalg.norm(points - points.min(axis=0), axis=1)
    nearest = np.flatnonzero(distance <= distance.min() * (1.0 + ROUNDING))
    return min((best[i] for i in nearest), key=lambda i: (settings[i].point, i))


Options = dict[str, Any]

ALL = ""  #: stands for all families where settings are judged by family

ByFamily = dict[str, Judged]  #: how a setting is judged on all runs, and on those of each family

#: judges settings, all on the same runs
Evaluate = Callable[[Sequence[ControllerSpec]], list[ByFamily]]

#: the only half of a family that tuning sees; the other is for judging the result
TRAINING = "training"


@dataclass(frozen=True)
class Searched:
    """A law as the campaign defines it; the options that it sets are not searched."""

    law: ControllerSpec

    @property
    def name(self) -> str:
        """As the campaign calls it."""
        return self.law.name

    @cached_property
    def ranges(self) -> dict[str, Range | Choices]:
        """Of its options, but for those that the campaign sets."""
        return law_ranges(self.law.law, self.law.options, self.law.folder)

    @cached_property
    def default(self) -> Options:
        """The default values of these options."""
        law = innermost(self.law.make())
        return {option: default_of(law, option) for option in self.ranges}

    def setting(self, options: Mapping[str, Any]) -> ControllerSpec:
        """The law with these options; None leaves one to the law."""
        chosen = {option: value for option, value in options.items() if value is not None}
        return replace(self.law, options={**self.law.options, **chosen})


@dataclass(frozen=True)
class Budget:
    """What every law gets alike: settings per tuner seed, seeds, scenes of each family."""

    evaluations: int = 40
    seeds: int = 3
    scenes: int = 10

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise ConfigurationError(f"{name} must be 1 or more, not {shown(value)}")


@dataclass(frozen=True)
class Problem:
    """What is tuned: the laws of a campaign in its families and conditions, with the same budget
    for each.
    """

    campaign: Campaign
    budget: Budget

    def __post_init__(self) -> None:
        if not self.laws:
            raise ConfigurationError(
                f"campaign {self.campaign.name}: it has no controller but {BASELINE} to be tuned"
            )

    @cached_property
    def laws(self) -> tuple[Searched, ...]:
        """All but the baseline; raises ConfigurationError for ranges that are none."""
        laws = tuple(
            Searched(entry) for entry in self.campaign.controllers if entry.name != BASELINE
        )
        for law in laws:
            _ = law.ranges, law.default
        return laws

    @property
    def baseline(self) -> ControllerSpec:
        """The campaign's entry of unconstrained tracking."""
        return next(entry for entry in self.campaign.controllers if entry.name == BASELINE)

    def configuration(self) -> dict[str, Any]:
        """What evaluations depend on, as data; not how many there are, since more can be asked
        for.
        """
        campaign = self.campaign
        return {
            **code_identity(),
            "tuner": {"name": "TPE", **module_versions(("optuna",))},
            "objectives": ["success", *(objective._asdict() for objective in OBJECTIVES)],
            "seed": campaign.seed,
            "scenes": self.budget.scenes,
            "controllers": of_controllers(campaign.controllers),
            "families": {
                each.name: {**of_family(each), "conditions": list(campaign.conditions_of(each))}
                for each in campaign.families
            },
        }

    def tasks(
        self,
        workers: int | None = None,
        on_progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> tuple[Batch, ...]:
        """Draw the training scenes: one task for each condition of each, of the baseline alone.

        Raises ConfigurationError if none is found, or drawing one raises something.
        """
        campaign = self.campaign
        each = range(self.budget.scenes)
        calls = {
            (family.name, i): (family, i, TRAINING, campaign.seed)
            for family in campaign.families
            for i in each
        }
        answers = run_all(Family.scene, calls, workers=workers, on_progress=on_progress)
        tasks: list[Batch] = []
        for family in campaign.families:
            drawn: list[Drawn] = []
            for scene in (answers[family.name, i] for i in each):
                if isinstance(scene, Failure):
                    raise ConfigurationError(
                        f"family {family.name}: a training scene cannot be drawn: {scene.reason}"
                    )
                drawn += [scene] if scene.found else []
            if not drawn:
                family.demand_scenes(TRAINING, campaign.seed, self.budget.scenes)
            for scene, name in product(drawn, campaign.conditions_of(family)):
                what = family, (scene.number,), (name,), (self.baseline,), TRAINING, campaign.seed
                tasks.append(Batch(*what, run_limit(scene.tables[name]), drawn=scene))
        return tuple(tasks)


@contextmanager
def evaluating(tasks: Sequence[Batch], workers: int | None, files: Files) -> Iterator[Evaluate]:
    """Processes that judge settings by all tasks; one that ends its process, or takes too long, is
    a failed run.

    What own laws load and read is added to ``files``; raises ConfigurationError if something else
    is there.
    """
    with processes(workers)(scored) as pool:
        families = [task.family.name for task in tasks]
        of_family = {
            name: [at for at, family in enumerate(families) if name in (ALL, family)]
            for name in (ALL, *families)
        }

        def evaluate(settings: Sequence[ControllerSpec]) -> list[ByFamily]:
            named = tuple(replace(setting, name=str(i)) for i, setting in enumerate(settings))
            calls = [
                replace(task, controllers=(*task.controllers, *named)) for task in tasks if settings
            ]
            found = {}
            for at, part in results(calls, pool):
                demand_unchanged_files(part.files, files)
                files.update(part.files)
                lines = part.runs.to_pandas().set_index("controller").to_dict("index")
                found[at] = [outcome(lines[entry.name], lines[BASELINE]) for entry in named]
            return [
                {name: judged([found[at][i] for at in own]) for name, own in of_family.items()}
                for i in range(len(settings))
            ]

        yield evaluate
