"""Scenarios as a session has them: by name, by path, or as they are."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from ..errors import ConfigurationError, shown
from ..scenarios import Scenario

AnyScenario = Scenario | str | Path
"""A scenario, the name of a shipped one, or the path of a file."""


def scenario_of(given: AnyScenario) -> Scenario:
    """The scenario; raises ConfigurationError, with candidates, if there is none."""
    if isinstance(given, Scenario):
        return given
    if not isinstance(given, str | Path):
        raise ConfigurationError(f"a scenario is a name, a path or a Scenario, not {shown(given)}")
    return Scenario.load(given)


def scenarios_of(given: AnyScenario | Iterable[AnyScenario]) -> tuple[Scenario, ...]:
    """One or several."""
    if isinstance(given, Scenario | str | Path) or not isinstance(given, Iterable):
        return (scenario_of(given),)
    return tuple(scenario_of(one) for one in given)
