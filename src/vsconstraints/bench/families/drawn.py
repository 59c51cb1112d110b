"""Drawn scenes of a family, with their properties before any law has run, and their summary."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import ConfigurationError, unknown_name
from ...scenarios.reading import Table
from ...scenarios.scenario import Scenario
from ...simulation import Setup


@dataclass(frozen=True)
class Drawn:
    """A scene, the same for all laws and conditions; or the reasons why none was found.

    - ``tables``: the scenario's tables by condition, empty if no attempt was accepted.
    - ``values``: drawn values by dotted key, and placed configurations.
    - ``rejected``: number of rejected attempts by reason; ``refusal`` describes the last rejection.
    - ``challenged``: labels of the rows that the unconstrained baseline violates in the nominal
      condition.
    - ``noise``: seed of all randomness in the disturbances.
    - ``share_to_hold``: largest share of the actuators' capacity needed to satisfy a row, over the
      rows whose boundary the unconstrained baseline meets. Above 1, no law could have satisfied a
      row from the point where it first meets its boundary.
    - ``least_time``: least time [s] in which the arm can be at rest at its goal under any law.
    - ``duration``: duration [s] of the longest run.

    The least time and the share to hold assume the family's actuator limits; they are NaN where
    unknown.
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
        """Name of the family and number of the scene."""
        return f"{self.family}-{self.number}"

    @property
    def found(self) -> bool:
        """True if an attempt was accepted."""
        return bool(self.tables)

    @property
    def attempts(self) -> int:
        """Number of attempts, accepted or rejected."""
        return sum(self.rejected.values()) + self.found

    @property
    def too_far(self) -> bool:
        """True if no law can arrive in time: the least time exceeds the duration of a run."""
        return self.least_time > self.duration

    def scenario(self, condition: str = "nominal") -> Scenario:
        """Return the scenario in a condition.

        Raises ConfigurationError if no attempt was accepted or if the condition is unknown.
        """
        if not self.found:
            raise ConfigurationError(
                f"{self.name}: no scene in {self.attempts} attempts: {reasons(self.rejected)}"
            )
        if condition not in self.tables:
            raise unknown_name(f"condition of {self.family}", condition, self.tables)
        return Scenario(self.name, self.tables[condition], self.folder, self.trusted)

    def setup(self, condition: str = "nominal") -> Setup:
        """Return the simulation setup in a condition, with this scene's noise.

        Raises as :meth:`scenario` does.
        """
        return self.scenario(condition).setup(seed=self.noise)


def reasons(rejected: Mapping[str, int]) -> str:
    """Return the counts as text, most frequent reason first."""
    ordered = Counter(rejected).most_common()
    return ", ".join(f"{reason} {count}" for reason, count in ordered) or "none rejected"


@dataclass
class Summary:
    """Statistics of the first scenes of a family, which were drawn in ``seconds``.

    Scenes that were not ``found`` are included. ``rejected`` counts attempts by reason;
    ``acceptance`` is the share of accepted attempts. ``challenged`` counts the scenes in which the
    unconstrained baseline violates a row, by kind. ``beyond_limits`` is the share of scenes with
    :attr:`Drawn.share_to_hold` above 1, NaN without limits. ``timed`` are the scenes whose least
    time is known.
    """

    scenes: tuple[Drawn, ...]
    seconds: float

    def __post_init__(self) -> None:
        self.found = [scene for scene in self.scenes if scene.found]
        self.timed = [scene for scene in self.found if np.isfinite(scene.least_time)]
        self.rejected = Counter[str]()
        attempts = 0
        for scene in self.scenes:
            self.rejected.update(scene.rejected)
            attempts += scene.attempts
        self.acceptance = len(self.found) / max(attempts, 1)
        self.challenged = Counter[str]()
        for scene in self.found:
            kinds = {label.partition("[")[0] for label in scene.challenged}
            self.challenged.update(kinds)
        shares = np.array([scene.share_to_hold for scene in self.found])
        self.beyond_limits = math.nan
        if np.isfinite(shares).any():
            self.beyond_limits = float((shares > 1.0).mean())
