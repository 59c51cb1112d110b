"""What is tuned on what: laws, and scenes of the training half alone."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ...controllers import Choices, Range, law_ranges
from ...controllers.ranges import default_of
from ...errors import ConfigurationError, shown
from ...scenarios.families import Drawn, Family
from ..evidence import Campaign
from ..evidence.campaign import of_code, of_controllers, of_family
from ..evidence.worker import Bench
from ..metrics import score
from ..runs.machine import module_versions, process_count, run_limit
from ..runs.pool import Failure, Pool, carry_out
from ..runs.spec import BASELINE, ControllerSpec
from .objectives import FAILED, OBJECTIVES, Judged, Outcome, Point, judged, outcome

Options = dict[str, Any]

EXCESS = "excess"
"""Attribute of a trial: by how much its constraint is exceeded; not at all if it is not positive."""


@dataclass(frozen=True)
class Searched:
    """A law as the campaign defines it; the options that it sets are not searched."""

    law: ControllerSpec

    @cached_property
    def ranges(self) -> dict[str, Range | Choices]:
        """Of its options, but for those that the campaign sets."""
        return law_ranges(self.law.law, self.law.options, self.law.folder)

    @cached_property
    def default(self) -> Options:
        """The default values of these options."""
        law = self.law.make()
        return {option: default_of(law, option) for option in self.ranges}

    def setting(self, options: Mapping[str, Any]) -> ControllerSpec:
        """The law with these options; None leaves one to the law."""
        given = {option: value for option, value in options.items() if value is not None}
        return ControllerSpec(self.law.name, self.law.law, {**self.law.options, **given}, self.law.folder)


class Search:
    """Suggests settings of a law, one after the other, the default first.

    The others are drawn by the tree-structured Parzen estimator for several objectives (Ozaki et al. 2022), with the
    constraint (Watanabe and Hutter 2023), for all options together. They depend only on the seed and on what was told.
    """

    def __init__(self, searched: Searched, seed: int) -> None:
        import optuna

        self.searched, self.seed = searched, seed
        default = {
            option: ranged.values.index(searched.default[option])
            if isinstance(ranged, Choices)
            else searched.default[option]
            for option, ranged in searched.ranges.items()
        }
        with _quiet():
            sampler = optuna.samplers.TPESampler(
                seed=seed, multivariate=True, constraints_func=lambda trial: (trial.user_attrs[EXCESS],)
            )
            self._study = optuna.create_study(directions=["minimize"] * len(OBJECTIVES), sampler=sampler)
            self._study.enqueue_trial(default)

    def ask(self) -> Options:
        """The next setting's options."""
        with _quiet():
            self._trial = self._study.ask()
            return {option: self._suggested(option, ranged) for option, ranged in self.searched.ranges.items()}

    def tell(self, point: Point, excess: float) -> None:
        """Tell the objectives of the last setting, and by how much it exceeds what the constraint allows."""
        with _quiet():
            self._trial.set_user_attr(EXCESS, excess)
            self._study.tell(self._trial, list(point))

    def _suggested(self, option: str, ranged: Range | Choices) -> Any:
        if isinstance(ranged, Choices):
            return ranged.values[self._trial.suggest_categorical(option, tuple(range(len(ranged.values))))]
        if ranged.integer:
            return self._trial.suggest_int(option, int(ranged.least), int(ranged.greatest), log=ranged.logarithmic)
        return self._trial.suggest_float(option, ranged.least, ranged.greatest, log=ranged.logarithmic)


@contextmanager
def _quiet() -> Iterator[None]:
    """Without Optuna's messages on every trial, and on what it calls experimental."""
    import optuna

    level = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    try:
        with warnings.catch_warnings(action="ignore"):
            yield
    finally:
        optuna.logging.set_verbosity(level)


TRAINING = "training"
"""The only half of a family that tuning sees; the other is for judging the result."""

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
        Share of runs that may violate a constraint.
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
    """A training scene in one condition; ConfigurationError for a scene of the other half."""

    scene: Drawn
    condition: str

    def __post_init__(self) -> None:
        if self.scene.half != TRAINING:
            raise ConfigurationError(
                f"{self.scene.name} is a scene of the {self.scene.half} half: laws are tuned on training scenes alone"
            )


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
        """Draw the training scenes, each in all conditions; the same for any number of workers.

        Raises
        ------
        ConfigurationError
            if none is found, or drawing one raises something.
        """
        campaign, each = self.campaign, range(self.budget.scenes)
        calls = {(family.name, i): (family, i, TRAINING, campaign.seed) for family in campaign.families for i in each}
        answers = carry_out(Family.scene, calls, workers=workers, on_progress=on_progress)
        stages: list[Stage] = []
        for family in campaign.families:
            scenes = [answers[family.name, i] for i in each]
            for scene in scenes:
                if isinstance(scene, Failure):
                    raise ConfigurationError(f"family {family.name}: a training scene cannot be drawn: {scene.reason}")
            found = [scene for scene in scenes if isinstance(scene, Drawn) and scene.found]
            if not found:
                family.demand_scenes(TRAINING, campaign.seed, self.budget.scenes)
            stages += [Stage(scene, condition) for scene in found for condition in campaign.conditions_of(family)]
        return tuple(stages)


def outcomes(stage: Stage, baseline: ControllerSpec, settings: Sequence[ControllerSpec]) -> list[Outcome]:
    """Run each setting on one stage, with the same disturbances and noise, and compare it with the baseline."""
    bench = Bench(stage.scene, stage.condition)
    tracking = bench.run(baseline)
    reference = score(tracking, tracking).result
    return [outcome(score(bench.run(setting), tracking).result, reference) for setting in settings]


Call = tuple[int, tuple[int, ...]]
"""A task of a process: the number of a stage, and those of settings."""


class Evaluator:
    """Evaluates settings in processes of their own; :func:`evaluating` makes one."""

    def __init__(self, pool: Pool[list[Outcome]], stages: Sequence[Stage], baseline: ControllerSpec) -> None:
        self._pool, self._stages, self._baseline = pool, stages, baseline

    def evaluate(self, settings: Sequence[ControllerSpec]) -> list[Judged]:
        """Judge each setting over all stages.

        Settings on a stage on which one of them ends its process, or takes too long, are run once more, each alone;
        one that fails again counts as a failed run.
        """
        stages, every = range(len(self._stages)), tuple(range(len(settings)))
        found: dict[Call, Outcome] = {}
        again: list[Call] = []
        for (stage, numbers), answer in self._answers([(stage, every) for stage in stages if every], settings):
            alone = [(stage, (i,)) for i in numbers]
            if isinstance(answer, Failure):
                again += alone
            else:
                found |= zip(alone, answer, strict=True)
        for call, answer in self._answers(again, settings):
            found[call] = FAILED if isinstance(answer, Failure) else answer[0]
        return [judged([found[stage, (i,)] for stage in stages]) for i in every]

    def _answers(
        self, calls: Sequence[Call], settings: Sequence[ControllerSpec]
    ) -> Iterator[tuple[Call, list[Outcome] | Failure]]:
        arguments: dict[Call, tuple[Any, ...]] = {}
        limits: dict[Call, float] = {}
        for number, chosen in calls:
            stage = self._stages[number]
            tables: Mapping[str, Any] = stage.scene.tables[stage.condition]
            arguments[number, chosen] = stage, self._baseline, [settings[i] for i in chosen]
            limits[number, chosen] = (1 + len(chosen)) * run_limit(tables)
        return self._pool.run(arguments, limits)


@contextmanager
def evaluating(stages: Sequence[Stage], baseline: ControllerSpec, workers: int | None) -> Iterator[Evaluator]:
    """Processes that evaluate settings on these stages; as many as there are cores and memory for, if None."""
    with Pool(outcomes, process_count(workers)) as pool:
        yield Evaluator(pool, stages, baseline)
