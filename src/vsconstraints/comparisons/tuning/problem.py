"""What is tuned on what: laws, and scenes of the training half alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ...errors import ConfigurationError, shown
from ...scenarios.families import Drawn, Family
from ..evidence import Campaign
from ..evidence.identity import of_code, of_controllers, of_family
from ..runs.machine import module_versions
from ..runs.pool import Failure, carry_out
from ..runs.spec import BASELINE, ControllerSpec
from .objectives import OBJECTIVES
from .search import Searched

TRAINING = "training"
"""The only half of a family that tuning sees; the other is for judging what it found."""

TUNER = "TPE"


@dataclass(frozen=True)
class Budget:
    """What every law gets alike.

    Attributes
    ----------
    evaluations
        Settings of each law and tuner seed, the default included.
    seeds
        How often tuning is repeated, with the seeds 0, 1, ….
    scenes
        Training scenes of each family.
    violations
        Share of runs that may have a violated row.
    """

    evaluations: int = 40
    seeds: int = 3
    scenes: int = 10
    violations: float = 0.2

    def __post_init__(self) -> None:
        for name in ("evaluations", "seeds", "scenes"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise ConfigurationError(f"{name} must be 1 or more, not {shown(value)}")
        if not 0.0 <= self.violations <= 1.0:
            raise ConfigurationError(f"violations is a share of runs from 0 to 1, not {shown(self.violations)}")


@dataclass(frozen=True)
class Stage:
    """A training scene in one condition; refuses any other scene."""

    scene: Drawn
    condition: str

    def __post_init__(self) -> None:
        if self.scene.half != TRAINING:
            raise ConfigurationError(
                f"{self.scene.name} is a scene of the {self.scene.half} half: laws are tuned on training scenes alone"
            )

    @property
    def name(self) -> str:
        """For messages."""
        return f"{self.scene.name} {self.condition}"


@dataclass(frozen=True)
class Problem:
    """What is to be tuned.

    Attributes
    ----------
    campaign
        Families, conditions, controllers and the seed of scenes are its own.
    budget
        The same for every law.
    """

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

    def configuration(self) -> dict[str, Any]:
        """What evaluations depend on, as data. How many there are is no part of it: more can be asked for."""
        campaign = self.campaign
        return {
            **of_code(),
            "tuner": {"name": TUNER, **module_versions(("optuna", "moocore"))},
            "objectives": [objective._asdict() for objective in OBJECTIVES],
            "seed": campaign.seed,
            "scenes": self.budget.scenes,
            "violations": self.budget.violations,
            "controllers": of_controllers(campaign.controllers),
            "families": {
                family.name: {**of_family(family), "conditions": list(campaign.conditions_of(family))}
                for family in campaign.families
            },
        }

    def stages(
        self, workers: int | None = None, on_progress: Callable[[int, int], None] = lambda done, total: None
    ) -> tuple[Stage, ...]:
        """Draw the training scenes, each in all conditions; the same whatever draws them.

        Raises
        ------
        ConfigurationError
            if none is found, or drawing one raises something.
        """
        campaign, each = self.campaign, range(self.budget.scenes)
        calls = {(family.name, i): (family, i, TRAINING, campaign.seed) for family in campaign.families for i in each}
        answers = carry_out(Family.scene, calls, workers=workers, on_progress=on_progress)
        return tuple(self._staged({key: answers[key] for key in calls}))

    def _staged(self, scenes: dict[tuple[str, int], Drawn | Failure]) -> Iterator[Stage]:
        for family in self.campaign.families:
            own = [scenes[family.name, i] for i in range(self.budget.scenes)]
            for scene in own:
                if isinstance(scene, Failure):
                    raise ConfigurationError(f"family {family.name}: a training scene cannot be drawn: {scene.reason}")
            found = [scene for scene in own if isinstance(scene, Drawn) and scene.found]
            if not found:
                family.demand_scenes(TRAINING, self.campaign.seed, self.budget.scenes)
            for scene in found:
                yield from (Stage(scene, condition) for condition in self.campaign.conditions_of(family))


def baseline(campaign: Campaign) -> ControllerSpec:
    """The campaign's entry of tracking alone."""
    return next(entry for entry in campaign.controllers if entry.name == BASELINE)
