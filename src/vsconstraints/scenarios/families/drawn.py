"""One scene of a family: what was drawn, and what is known of it before any law has run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...errors import ConfigurationError, unknown_name
from ...simulation import Setup
from .. import Scenario
from ..reading import Table


@dataclass(frozen=True)
class Drawn:
    """A scene, the same for all laws and all conditions; or the counts of why there is none.

    Attributes
    ----------
    family, number, half, seed
        Which one it is.
    folder
        What paths in its tables are relative to.
    tables
        The scenario's tables by condition; empty if no attempt was accepted.
    values
        What was drawn, by dotted keys; under ``conditions`` what a condition adds; joint coordinates that were placed.
    rejected
        How many attempts were rejected before this one, by reason.
    refusal
        What the last rejected attempt was rejected for, in words.
    challenged
        Labels of the rows that tracking alone leaves in the nominal condition.
    share_to_hold
        The greatest over rows, of tracking alone under the family's limits of actuators: above 1, no law could have
        held a row from where tracking alone first comes to its boundary. NaN without limits.
    least_time
        In which the arm can be at rest at its goal under the same limits, whatever the law [s]; NaN where that is not
        known.
    duration
        Of the longest run, under the same limits [s].
    noise
        Seed of everything random in its disturbances: another one for every scene, the same for all laws.
    trusted
        See :class:`vsconstraints.scenarios.Scenario`.
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
        """The scenario in a condition.

        Raises
        ------
        ConfigurationError
            if no attempt was accepted, or the family has no such condition.
        """
        if not self.found:
            raise ConfigurationError(f"{self.name}: no scene in {self.attempts} attempts: {reasons(self.rejected)}")
        if condition not in self.tables:
            raise unknown_name(f"condition of {self.family}", condition, self.tables)
        return Scenario(self.name, self.tables[condition], self.folder, self.trusted)

    def setup(self, condition: str = "nominal") -> Setup:
        """What is simulated in a condition, with this scene's own noise; raises as :meth:`scenario` does."""
        return self.scenario(condition).setup(seed=self.noise)


def reasons(rejected: Mapping[str, int]) -> str:
    """Counts in words, the most frequent first."""
    ordered = sorted(rejected.items(), key=lambda item: -item[1])
    return ", ".join(f"{reason} {count}" for reason, count in ordered) or "none rejected"
