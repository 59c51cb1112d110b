"""Scenarios as a session has them: by name, by path, or as they are."""

from __future__ import annotations

import re
import uuid
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ...errors import ConfigurationError, shown
from ...scenarios import Scenario
from ...simulation import Setup

AnyScenario = Scenario | Setup | str | Path
"""A scenario, a setup made in Python, the name of a shipped scenario, or the path of a file."""


@dataclass(frozen=True)
class SetupScenario(Scenario):
    """A setup made in Python, where a scenario is asked for; it has no trials, and no other process can make it."""

    made: Setup | None = None

    @classmethod
    def of(cls, setup: Setup) -> SetupScenario:
        """A setup under the name of its robot."""
        name = re.sub(r"[^\w]+", "-", setup.scene.robot.name).strip("-") or "setup"
        # a number of its own keeps the stored runs of two setups apart
        times = {"sampling_time": setup.Ts, "duration": setup.duration}
        return cls(name, {"title": setup.scene.robot.name, **times, "setup": uuid.uuid4().hex}, made=setup)

    why_here = "it is a Setup, which is made in this session"
    in_session = True

    def setup(self, trial: int = 0, seed: int = 0) -> Setup:
        """The setup; raises ConfigurationError for other trials than the first."""
        assert self.made is not None
        if trial:
            raise ConfigurationError(f"{self.name} is a Setup, which has one trial: a Scenario can have several")
        return self.made


def scenario_of(given: AnyScenario) -> Scenario:
    """The scenario; raises ConfigurationError, with candidates, if there is none."""
    if isinstance(given, Scenario):
        return given
    if isinstance(given, Setup):
        return SetupScenario.of(given)
    if not isinstance(given, str | Path):
        raise ConfigurationError(f"a scenario is a name, a path, a Scenario or a Setup, not {shown(given)}")
    return Scenario.load(given)


def scenarios_of(given: AnyScenario | Iterable[AnyScenario]) -> tuple[Scenario, ...]:
    """One or several."""
    if isinstance(given, Scenario | Setup | str | Path) or not isinstance(given, Iterable):
        return (scenario_of(given),)
    return tuple(scenario_of(one) for one in given)
