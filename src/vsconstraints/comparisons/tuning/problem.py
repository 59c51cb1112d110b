"""What is tuned on what: laws, and scenes of the training half only; and settings evaluated on them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

from ...controllers import Choices, Range, law_ranges
from ...controllers.observer import without_observer
from ...controllers.ranges import default_of
from ...errors import ConfigurationError, shown
from ...scenarios.families import Drawn, Family
from ..evidence import Batch, Campaign, scored
from ..evidence.campaign import of_controllers, of_family
from ..evidence.runner import results
from ..runs.machine import code_identity, module_versions, run_limit
from ..runs.pool import Failure, processes, run_all
from ..runs.spec import BASELINE, ControllerSpec
from .objectives import OBJECTIVES, Judged, judged, outcome

Options = dict[str, Any]

ALL = ""  #: stands for all families where settings are judged by family

ByFamily = dict[str, Judged]  #: how a setting is judged on all runs, and on those of each family

Evaluate = Callable[[Sequence[ControllerSpec]], list[ByFamily]]  #: judges settings, all on the same runs

TRAINING = "training"  #: the only half of a family that tuning sees; the other is for judging the result


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
        law = without_observer(self.law.make())
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
    """What is tuned: the laws of a campaign in its families and conditions, with the same budget for each."""

    campaign: Campaign
    budget: Budget

    def __post_init__(self) -> None:
        if not self.laws:
            raise ConfigurationError(f"campaign {self.campaign.name}: it has no controller but {BASELINE} to be tuned")

    @cached_property
    def laws(self) -> tuple[Searched, ...]:
        """All but the baseline; raises ConfigurationError for ranges that are none."""
        laws = tuple(Searched(entry) for entry in self.campaign.controllers if entry.name != BASELINE)
        for law in laws:
            _ = law.ranges, law.default
        return laws

    @property
    def baseline(self) -> ControllerSpec:
        """The campaign's entry of unconstrained tracking."""
        return next(entry for entry in self.campaign.controllers if entry.name == BASELINE)

    def configuration(self) -> dict[str, Any]:
        """What evaluations depend on, as data; not how many there are, since more can be asked for."""
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
        self, workers: int | None = None, on_progress: Callable[[int, int], None] = lambda done, total: None
    ) -> tuple[Batch, ...]:
        """Draw the training scenes: one task for each condition of each, of the baseline alone.

        Raises ConfigurationError if none is found, or drawing one raises something.
        """
        campaign, each = self.campaign, range(self.budget.scenes)
        calls = {(family.name, i): (family, i, TRAINING, campaign.seed) for family in campaign.families for i in each}
        answers = run_all(Family.scene, calls, workers=workers, on_progress=on_progress)
        tasks: list[Batch] = []
        for family in campaign.families:
            drawn: list[Drawn] = []
            for scene in (answers[family.name, i] for i in each):
                if isinstance(scene, Failure):
                    raise ConfigurationError(f"family {family.name}: a training scene cannot be drawn: {scene.reason}")
                drawn += [scene] if scene.found else []
            if not drawn:
                family.demand_scenes(TRAINING, campaign.seed, self.budget.scenes)
            for scene, name in product(drawn, campaign.conditions_of(family)):
                what = family, (scene.number,), (name,), (self.baseline,), TRAINING, campaign.seed
                tasks.append(Batch(*what, run_limit(scene.tables[name]), drawn=scene))
        return tuple(tasks)


@contextmanager
def evaluating(tasks: Sequence[Batch], workers: int | None) -> Iterator[Evaluate]:
    """Processes that judge settings by all tasks; one that ends its process, or takes too long, is a failed run."""
    with processes(workers)(scored) as pool:
        families = [task.family.name for task in tasks]
        of_family = {
            name: [at for at, family in enumerate(families) if name in (ALL, family)] for name in (ALL, *families)
        }

        def evaluate(settings: Sequence[ControllerSpec]) -> list[ByFamily]:
            named = tuple(replace(setting, name=str(i)) for i, setting in enumerate(settings))
            calls = [replace(task, controllers=(*task.controllers, *named)) for task in tasks if settings]
            found = {}
            for at, part in results(calls, pool):
                lines = part.runs.to_pandas().set_index("controller").to_dict("index")
                found[at] = [outcome(lines[entry.name], lines[BASELINE]) for entry in named]
            return [
                {name: judged([found[at][i] for at in own]) for name, own in of_family.items()}
                for i in range(len(settings))
            ]

        yield evaluate
