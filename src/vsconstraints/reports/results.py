"""A stored comparison as reports look at it: by scenario, controller and row."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

from ..comparisons import StoredComparison
from ..comparisons.suite import BASELINE
from .groups import grouped

Line = Mapping[str, Any]

DIVERGED = 1.0
"""A run that does not converge and is outside by more than this share of L has diverged."""


class Results:
    """Lines of results.csv and constraints.csv, looked up by scenario and controller.

    Attributes
    ----------
    stored
        Where they come from.
    groups
        The controllers that a figure shows together.
    controllers
        All, in the suite's order and that of the groups, tracking alone first.
    competitors
        All but tracking alone, which is the unconstrained baseline and is not ranked.
    """

    def __init__(self, stored: StoredComparison) -> None:
        self.stored = stored
        self.groups = grouped(stored.manifest["configuration"]["controllers"])
        self.controllers = tuple(dict.fromkeys(name for group in self.groups for name in group.controllers))
        self.competitors = tuple(name for name in self.controllers if name != BASELINE)
        self._runs: dict[tuple[str, str], list[Line]] = defaultdict(list)
        self._rows: dict[tuple[str, str], list[Line]] = defaultdict(list)
        for line in stored.results:
            self._runs[line["scenario"], line["controller"]].append(line)
        for line in stored.constraints:
            self._rows[line["scenario"], line["controller"]].append(line)
        for lines in self._runs.values():
            lines.sort(key=lambda line: line["trial"])

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Names of the scenarios, in the suite's order."""
        return tuple(self.stored.scenarios)

    @cached_property
    def trials(self) -> int:
        """How many trials of each run were planned."""
        return int(self.stored.manifest["configuration"].get("trials", 1))

    @property
    def planned(self) -> int:
        """How many runs were planned."""
        return len(self.scenarios) * len(self.controllers) * self.trials

    @property
    def finished(self) -> int:
        """How many runs are stored."""
        return sum(len(self.runs(s, c)) for s in self.scenarios for c in self.controllers)

    def runs(self, scenario: str, controller: str) -> Sequence[Line]:
        """Lines of results.csv, one for each trial there is."""
        return self._runs.get((scenario, controller), [])

    def all_runs(self, controller: str) -> list[Line]:
        """Lines of results.csv of a controller, over all scenarios."""
        return [line for scenario in self.scenarios for line in self.runs(scenario, controller)]

    @cached_property
    def clean(self) -> dict[str, int]:
        """By competitor, how many runs converged and violated no row, by the strict standard."""
        return {name: sum(map(clean, self.all_runs(name))) for name in self.competitors}

    @cached_property
    def clean_tolerant(self) -> dict[str, int]:
        """The same by the tolerant standard."""
        return {
            name: sum(clean(line, "violated_tolerant") for line in self.all_runs(name)) for name in self.competitors
        }

    @property
    def challenged_scenarios(self) -> list[str]:
        """Names of the scenarios in which controllers are ranked."""
        return [name for name in self.scenarios if self.is_ranked(name)]

    def implementation(self, controller: str, scenario: str | None = None) -> str:
        """Whether compiled or NumPy code answered a controller's calls, in a scenario or in all."""
        lines = self.all_runs(controller) if scenario is None else self.runs(scenario, controller)
        flags = {bool(line.get("compiled")) for line in lines if line["duration_s"] >= 0.0}
        return " and ".join(name for compiled, name in ((True, "compiled"), (False, "NumPy")) if compiled in flags)

    def statuses(self, scenario: str) -> list[list[str]]:
        """By competitor, the status of each trial."""
        return [[line["status"] for line in self.runs(scenario, name)] for name in self.competitors]

    def rows(self, scenario: str, controller: str, label: str | None = None) -> list[Line]:
        """Lines of constraints.csv, of one row or of all."""
        lines = self._rows.get((scenario, controller), [])
        return [line for line in lines if label is None or line["constraint"] == label]

    def labels(self, scenario: str) -> tuple[str, ...]:
        """Labels of a scenario's rows, in their order."""
        names = (line["constraint"] for name in self.controllers for line in self.rows(scenario, name))
        return tuple(dict.fromkeys(names))

    def challenged(self, scenario: str) -> tuple[str, ...]:
        """Labels of the rows that a scenario challenges, in any trial."""
        hit = {
            line["constraint"] for name in self.controllers for line in self.rows(scenario, name) if line["challenged"]
        }
        return tuple(label for label in self.labels(scenario) if label in hit)

    def is_ranked(self, scenario: str) -> bool:
        """Whether unconstrained tracking violates a row, as far as is known; otherwise no controller is the best."""
        baseline = self.runs(scenario, BASELINE)
        return bool(self.challenged(scenario)) or not baseline or any(violated(line) for line in baseline)


def clean(line: Line, column: str = "violated") -> bool:
    """Whether a run converged and violated no row, by the strict standard or as another column has it."""
    return line["status"] == "converged" and not violated(line, column)


def diverged(line: Line) -> bool:
    """Whether a run did not converge and violated a row by more than L."""
    return bool(line["status"] != "converged" and line["violation_depth"] > DIVERGED)


def violated(line: Line, column: str = "violated") -> list[str]:
    """Labels of the rows that a run violated, by the strict standard or as another column has them."""
    return [label for label in str(line[column] or "").split("; ") if label]


def tolerated(line: Line) -> list[str]:
    """Labels of the rows that a run violated by the strict standard, and not by the tolerant one."""
    beyond = violated(line, "violated_tolerant")
    return [label for label in violated(line) if label not in beyond]


def reason_kind(reason: str) -> str:
    """A reason without its numbers: runs that fail in the same way at other times and places have the same."""
    return re.sub(r"\d+(\.\d+)?(e[-+]?\d+)?", "#", reason)
