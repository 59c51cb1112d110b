"""Scenes of a family: what was drawn, what is known of each before any law has run, and what many
are like.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import ConfigurationError, unknown_name
from ...simulation import Setup
from ..reading import Table
from ..scenario import Scenario


@dataclass(frozen=True)
class Drawn:
    """A scene, the same for all laws and all conditions; or the counts of why there is none.

    ``tables`` are the scenario's by condition, empty if no attempt was accepted. ``values`` is what
    was drawn, by dotted keys, and joint coordinates that were placed. ``rejected`` counts attempts
    before this one by reason; ``refusal`` says what the last of them was rejected for.
    ``challenged`` labels the rows that tracking alone violates in the nominal condition. ``noise``
    is the seed of everything random in its disturbances.

    Under the family's limits of actuators (NaN where that is not known) ``share_to_hold`` is the
    greatest over rows of tracking alone: above 1, no law could have satisfied a row from where it
    first meets its boundary. In ``least_time`` [s] the arm can be at rest at its goal, whatever the
    law; ``duration`` [s] is of the longest run.
    """

    family: str
    number: int
    half: str
    seed: int
    folder: Path
    tables: Mapping[str, Table] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    rejected: Mapping[str, int] = field(default_factory=dict)
    refusal: str = ""
    challenged: tuple[str, ...] = ()
    share_to_hold: float = math.nan
    least_time: float = math.nan
    duration: float = math.nan
    noise: int = 0
    trusted: bool = True

    @property
    def name(self) -> str:
        """Of the family and the scene."""
        return f"{self.family}-{self.number}"

    @property
    def found(self) -> bool:
        """Whether an attempt was accepted."""
        return bool(self.tables)

    @property
    def attempts(self) -> int:
        """How many there were."""
        return sum(self.rejected.values()) + self.found

    @property
    def too_far(self) -> bool:
        """Whether no law can arrive in time: the least time is longer than a run."""
        return self.least_time > self.duration

    def scenario(self, condition: str = "nominal") -> Scenario:
        """The scenario in a condition; ConfigurationError if no attempt was accepted, or there is
        no such condition.
        """
        if not self.found:
            raise ConfigurationError(
                f"{self.name}: no scene in {self.attempts} attempts: {reasons(self.rejected)}"
            )
        if condition not in self.tables:
            raise unknown_name(f"condition of {self.family}", condition, self.tables)
        return Scenario(self.name, self.tables[condition], self.folder, self.trusted)

    def setup(self, condition: str = "nominal") -> Setup:
        """What is simulated in a condition, with this scene's own noise; raises as :meth:`scenario`
        does.
        """
        return self.scenario(condition).setup(seed=self.noise)


def reasons(rejected: Mapping[str, int]) -> str:
    """Counts in words, the most frequent first."""
    ordered = sorted(rejected.items(), key=lambda item: -item[1])
    return ", ".join(f"{reason} {count}" for reason, count in ordered) or "none rejected"


@dataclass
class Summary:
    """Counts over the first scenes of a family, those that were not ``found`` too, drawn in so many
    ``seconds``.

    ``rejected`` are attempts by reason, ``acceptance`` the share of them that was not.
    ``challenged`` says in how many scenes tracking alone violates a row of each kind;
    ``beyond_limits`` is the share of them with :attr:`Drawn.share_to_hold` above 1, NaN without
    limits; of those ``timed`` the least time to arrive in is known.
    """

    scenes: tuple[Drawn, ...]
    seconds: float

    def __post_init__(self) -> None:
        self.found = [scene for scene in self.scenes if scene.found]
        self.rejected = sum((Counter(scene.rejected) for scene in self.scenes), Counter())
        self.acceptance = len(self.found) / max(sum(scene.attempts for scene in self.scenes), 1)
        kinds = ({label.partition("[")[0] for label in scene.challenged} for scene in self.found)
        self.challenged = Counter(chain.from_iterable(kinds))
        shares = np.array([scene.share_to_hold for scene in self.found])
        self.beyond_limits = float((shares > 1.0).mean()) if np.isfinite(shares).any() else np.nan
        self.timed = [scene for scene in self.found if np.isfinite(scene.least_time)]
