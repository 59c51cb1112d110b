"""The unit of work: a batch of scenes, each with all its conditions and controllers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from math import ceil

from ...errors import ConfigurationError
from ...scenarios.families import Family
from ..experiment import Entries
from ..runs.machine import run_limit
from .campaign import Campaign

RUNS_OF_TASK = 600
"""Maximum number of runs of a task, unless a scene has more: what an interrupt loses, and a file that is written.

At 20 ms a run they take 12 s; 10,000 scenes of each of seven families with seven laws in three conditions are 2,500
shards of some hundred kilobytes each. No result depends on it.
"""

MIN_TASKS = 16
"""Minimum number of tasks of a family, so that there is work for several processes."""


@dataclass(frozen=True)
class Single:
    """One run of a scene, apart from the others: requested when the scene as a whole could not be made."""

    condition: str
    controller: str


@dataclass(frozen=True)
class Batch:
    """All that a worker needs, so that it can be sent anywhere.

    Attributes
    ----------
    family, scenes, half, seed
        Where the scenes are drawn from, and their numbers.
    conditions, controllers
        Each scene is run in every condition with every controller, the unconstrained baseline first.
    limit
        How long one step, drawing a scene or one run, may take until the worker's process is ended [s].
    single
        The only run that is requested; None for all, and the line of each scene.
    """

    family: Family
    scenes: tuple[int, ...]
    conditions: tuple[str, ...]
    controllers: Entries
    half: str
    seed: int
    limit: float | None = None
    single: Single | None = None

    @property
    def name(self) -> str:
        """Of its shard: family, first and last scene."""
        return f"part-{self.family.name}-{self.scenes[0]:07d}-{self.scenes[-1]:07d}"

    def each(self) -> Iterator[Batch]:
        """One task for each scene."""
        for number in self.scenes:
            yield replace(self, scenes=(number,))

    def singles(self) -> Iterator[Batch]:
        """One task for each run, the last one for the lines of the scenes without any."""
        for condition in self.conditions:
            for entry in self.controllers:
                yield replace(self, single=Single(condition, entry.name))
        yield replace(self, conditions=())


@dataclass(frozen=True)
class Shard:
    """The part of a campaign's scenes that one of several machines takes: ``number`` of ``of``, from 1."""

    number: int = 1
    of: int = 1

    @classmethod
    def parsed(cls, text: str) -> Shard:
        """The shard that ``i/n`` means; raises ConfigurationError."""
        number, slash, of = text.partition("/")
        if not (slash and number.isdecimal() and of.isdecimal() and 1 <= int(number) <= int(of)):
            raise ConfigurationError(f"--shard takes i/n with i from 1 to n, such as 2/4, not {text!r}")
        return cls(int(number), int(of))

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"

    def scenes(self, count: int) -> range:
        """Consecutive numbers of its scenes, of ``count`` in all."""
        return range((self.number - 1) * count // self.of, self.number * count // self.of)


@dataclass(frozen=True)
class Work:
    """What is still to be done of a campaign.

    Attributes
    ----------
    campaign, shard
        Whose scenes, and which of them.
    limit
        See :class:`Batch`; by the number of samples of a run if None.
    there
        Numbers of the scenes that are done already, by family.
    """

    campaign: Campaign
    shard: Shard = field(default_factory=Shard)
    limit: float | None = None
    there: Mapping[str, set[int]] = field(default_factory=dict)

    def tasks(self) -> dict[str, Batch]:
        """Tasks by their names, families in turn, so that a family of slow scenes is not left for the end."""
        each = [self._of_family(family) for family in self.campaign.families]
        longest = max(map(len, each), default=0)
        in_turn = [tasks[i] for i in range(longest) for tasks in each if i < len(tasks)]
        return {task.name: task for task in in_turn}

    def task(self, family: Family, scenes: Sequence[int]) -> Batch:
        """The task of these scenes of a family, which are run in the same conditions."""
        campaign, limit = self.campaign, self.limit or run_limit(family.tables)
        conditions = campaign.conditions_of(family, scenes[0])
        return Batch(family, tuple(scenes), conditions, campaign.controllers, campaign.half, campaign.seed, limit)

    def _of_family(self, family: Family) -> list[Batch]:
        scenes = self.shard.scenes(self.campaign.scenes)
        runs = len(self.campaign.conditions_of(family)) * len(self.campaign.controllers)
        size = max(1, min(RUNS_OF_TASK // runs, ceil(len(scenes) / MIN_TASKS)))
        done = self.there.get(family.name, set())
        left = (number for number in scenes if number not in done)
        alike = groupby(left, key=lambda number: (number // size, self.campaign.conditions_of(family, number)))
        return [self.task(family, list(batch)) for _, batch in alike]
