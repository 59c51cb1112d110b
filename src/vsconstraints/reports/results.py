"""Stored comparison as reports use it: by scenario, controller and row, with best values."""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, Literal, NamedTuple

from ..comparisons import StoredComparison
from ..comparisons.metrics import Metric
from ..comparisons.runs.spec import stack_law
from ..comparisons.suite import BASELINE
from ..simulation.programs import uses_by_controller
from .groups import grouped, implementation_text
from .markdown import Table, bold
from .numbers import Format, median, number, over_trials

Line = Mapping[str, Any]
Better = Literal["less", "more"] | None
MAX_PHI = 6  #: Most rows in a figure of φ, and of activity (MAX_LANES).
MAX_LANES = 12
#: A run that does not converge and violates a row by more than this share of L has diverged.
DIVERGED = 1.0


class Results:
    """Lines of results.csv and constraints.csv of ``stored``, by scenario and controller.

    ``groups`` are controllers that a figure shows together; ``controllers`` are all, in the order
    of the groups, and ``competitors`` all but the unconstrained baseline, which is not ranked.
    """

    def __init__(self, stored: StoredComparison) -> None:
        configuration = stored.manifest["configuration"]
        entries = configuration["controllers"]
        self.stored = stored
        self.scenarios = tuple(stored.scenarios)
        self.trials = int(configuration.get("trials", 1))
        self.seed = int(configuration.get("seed", 0))
        self.groups = grouped(entries)
        controllers = dict[str, None]()  # the baseline is in several groups
        for group in self.groups:
            controllers |= dict.fromkeys(group.controllers)
        self.controllers = tuple(controllers)
        controllers.pop(BASELINE, None)
        self.competitors = tuple(controllers)
        #: Controllers that are programs in processes of their own.
        self.external = set[str]()
        for name, table in entries.items():
            if table.get("type") == stack_law():
                self.external.add(name)
        in_order = sorted(stored.results, key=lambda line: line["trial"])
        self._runs = _by_scenario_and_controller(in_order)
        self._rows = _by_scenario_and_controller(stored.constraints)
        run_count = len(self.scenarios) * len(self.controllers)
        self.planned = run_count * self.trials
        self.finished = sum(len(self.all_runs(name)) for name in self.controllers)

    def runs(self, scenario: str, controller: str) -> list[Line]:
        """Return the lines of results.csv, one for each finished trial."""
        return self._runs.get((scenario, controller), [])

    def all_runs(self, controller: str) -> list[Line]:
        """Return the lines of results.csv of a controller over all scenarios."""
        lines: list[Line] = []
        for scenario in self.scenarios:
            lines += self.runs(scenario, controller)
        return lines

    def solvers(self, scenario: str) -> list[str]:
        """Return the controllers that converged without violation in every trial."""
        solvers = []
        for name in self.competitors:
            runs = self.runs(scenario, name)
            if runs and all(map(clean, runs)):
                solvers.append(name)
        return solvers

    def ran(self, scenario: str) -> bool:
        """Return True if any run of a scenario is stored."""
        return any(self.runs(scenario, name) for name in self.controllers)

    @cached_property
    def clean(self) -> dict[str, int]:
        """Number of runs that converged without violation by the strict standard, by competitor."""
        return self._clean_counts("violated")

    @cached_property
    def clean_tolerant(self) -> dict[str, int]:
        """Number of runs that converged without violation by the tolerant standard."""
        return self._clean_counts("violated_tolerant")

    def _clean_counts(self, standard: str) -> dict[str, int]:
        counts = {}
        for name in self.competitors:
            counts[name] = sum(clean(run, standard) for run in self.all_runs(name))
        return counts

    @cached_property
    def challenged_scenarios(self) -> list[str]:
        """Names of the scenarios in which controllers are ranked."""
        return [name for name in self.scenarios if self.is_ranked(name)]

    def implementation(self, controller: str, scenario: str | None = None) -> str:
        """Return the implementation of a controller, in a scenario or in all.

        See :func:`.implementation_text`. It is empty for recorded runs, whose times are unknown.
        """
        lines = self.all_runs(controller) if scenario is None else self.runs(scenario, controller)
        were_compiled = [bool(line.get("compiled")) for line in lines if _was_timed(line)]
        if not were_compiled:
            return ""
        return implementation_text(were_compiled, controller in self.external)

    @cached_property
    def declared_by_stacks(self) -> dict[str, tuple[str, ...]]:
        """Data that each stack declared as used in its runs, by controller."""
        reasons = {}
        for name in self.competitors:
            reasons[name] = [str(line.get("reason") or "") for line in self.all_runs(name)]
        return uses_by_controller(reasons)

    @property
    def stacks(self) -> list[str]:
        """Controllers that get measurements instead of rows and a task."""
        programs = self.external | self.declared_by_stacks.keys()
        return [name for name in self.competitors if name in programs]

    def rows(self, scenario: str, controller: str, label: str | None = None) -> list[Line]:
        """Return the lines of constraints.csv, of one row or of all."""
        lines = self._rows.get((scenario, controller), [])
        if label is None:
            return lines
        return [line for line in lines if line["constraint"] == label]

    def every_row(self, scenario: str) -> list[Line]:
        """Return the lines of constraints.csv of all controllers."""
        lines: list[Line] = []
        for name in self.controllers:
            lines += self.rows(scenario, name)
        return lines

    def labels(self, scenario: str) -> tuple[str, ...]:
        """Return the labels of a scenario's rows, in their order."""
        labels = [line["constraint"] for line in self.every_row(scenario)]
        return tuple(dict.fromkeys(labels))

    def challenged(self, scenario: str) -> tuple[str, ...]:
        """Return the labels of the rows that a scenario challenges in any trial."""
        challenged = set()
        for line in self.every_row(scenario):
            if line["challenged"]:
                challenged.add(line["constraint"])
        return tuple(label for label in self.labels(scenario) if label in challenged)

    def rows_shown(self, scenario: str) -> RowsShown:
        """Return the rows that figures of a scenario show."""
        return RowsShown.of(self.every_row(scenario))

    def is_ranked(self, scenario: str) -> bool:
        """Return True unless the unconstrained baseline is known to violate no row.

        If it violates none, no controller is marked as the best.
        """
        baseline = self.runs(scenario, BASELINE)
        if not baseline or self.challenged(scenario):
            return True
        return any(violated(line) for line in baseline)


def _by_scenario_and_controller(lines: Iterable[Line]) -> dict[tuple[str, str], list[Line]]:
    groups: dict[tuple[str, str], list[Line]] = defaultdict(list)
    for line in lines:
        groups[line["scenario"], line["controller"]].append(line)
    return groups


class RowsShown(NamedTuple):
    """Labels of the rows whose φ and whose activity a figure shows.

    ``hidden`` is the number of further rows, which were active for a shorter time.
    """

    phi: tuple[str, ...] = ()
    lanes: tuple[str, ...] = ()
    hidden: int = 0

    @classmethod
    def of(cls, lines: Iterable[Line]) -> RowsShown:
        """Choose rows from lines of constraints.csv.

        φ is shown of rows that are challenged or violated by a competitor; without any of these, of
        rows that were active.
        """
        is_relevant = defaultdict[str, bool](bool)
        active_time = defaultdict[str, float](float)  # of all competitors [s]
        for line in lines:
            label = line["constraint"]
            is_relevant[label] |= bool(line["challenged"])
            if line.get("controller") != BASELINE:
                natural_depth = line["violation_depth"]
                is_relevant[label] |= natural_depth > 0.0
                active_time[label] += line["active_time_s"]
        relevant = [label for label in is_relevant if is_relevant[label]]
        active = [label for label in is_relevant if active_time[label] > 0.0]

        def importance(label: str) -> tuple[bool, float]:
            return is_relevant[label], active_time[label]

        def most_important(labels: Sequence[str], count: int) -> tuple[str, ...]:
            by_importance = sorted(labels, key=importance, reverse=True)
            chosen = by_importance[:count]
            return tuple(label for label in labels if label in chosen)

        lanes = most_important(active, MAX_LANES)
        return cls(
            phi=most_important(relevant or active, MAX_PHI),
            lanes=lanes,
            hidden=len(active) - len(lanes),
        )


def _was_timed(line: Line) -> bool:
    """Return True unless a run was recorded elsewhere, or its times are unknown."""
    duration = line["duration_s"]
    unknown = duration > 0.0 and math.isnan(line["rows_time_median_us"])
    return duration >= 0.0 and not unknown


def clean(line: Line, column: str = "violated") -> bool:
    """Return True if a run converged and violated no row.

    ``column`` selects the standard, by default the strict one.
    """
    return line["status"] == "converged" and not violated(line, column)


def violated(line: Line, column: str = "violated") -> list[str]:
    """Return the labels of the rows that a run violated, by the standard of ``column``."""
    labels = str(line[column] or "").split("; ")
    return [label for label in labels if label]


def reason_kind(reason: str) -> str:
    """Return a reason without its numbers.

    Runs that fail in the same way at other times and places then have the same reason.
    """
    return re.sub(r"\d+(\.\d+)?(e[-+]?\d+)?", "#", reason)


def shown(metric: Metric, line: Line) -> float:
    """Return a metric's value in a line of results.csv in the unit of reports, NaN if missing."""
    value = float(line[metric.column])
    if metric.over:
        divisor = float(line[metric.over])
        if not math.isfinite(divisor) or divisor <= 0.0:
            return math.nan
        value /= divisor
    return metric.factor * value


def shown_values(metric: Metric, lines: Sequence[Line]) -> list[float]:
    """Return a metric's values in several lines as :func:`shown`."""
    return [shown(metric, line) for line in lines]


class Cell(NamedTuple):
    """Table cell that can be the best of its column.

    ``text`` is bold if it is the best. Cells are compared by ``value``, NaN for a missing value;
    cells with the same digits, ``shown``, tie. ``before`` is printed in front and not compared.
    """

    text: str
    value: float = math.nan
    shown: str = ""
    before: str = ""

    @classmethod
    def of(cls, values: Sequence[float], show: Format = number) -> Cell:
        """Return a cell of one value per trial, compared by their median."""
        middle = median(values)
        return cls(over_trials(values, show), middle, show(middle))


def marked(cells: Sequence[Cell], eligible: Iterable[bool], better: Better) -> list[str]:
    """Return the cells' texts, with the best and its ties in bold.

    Cells that are not eligible stand in parentheses. Nothing is bold if one of these is better.
    """
    known = [cell for cell in cells if math.isfinite(cell.value)]
    best = ""
    if better is not None and len({cell.shown for cell in known}) > 1:
        choose = min if better == "less" else max
        best = choose(known, key=lambda cell: cell.value).shown
    compared = better is not None and len(cells) > 1
    texts = []
    for cell, is_eligible in zip(cells, eligible, strict=True):
        text = cell.text
        if is_eligible and cell.shown == best:
            text = bold(text)
        text = cell.before + text
        excluded = not is_eligible and math.isfinite(cell.value)
        if compared and excluded:
            text = f"({text})"
        texts.append(text)
    return texts


def comparable(runs: Sequence[Sequence[Line]]) -> list[bool]:
    """Return True for each controller whose trials of a scenario all converged.

    All are False if only one controller was run.
    """
    if sum(map(bool, runs)) < 2:
        return [False] * len(runs)
    flags = []
    for trials in runs:
        converged = all(run["status"] == "converged" for run in trials)
        flags.append(bool(trials) and converged)
    return flags


def judged_by(metric: Metric, lines: Sequence[Line]) -> bool:
    """Return True if runs that converged may be compared by a metric.

    Most metrics require that the runs violate no row; those judged by ``sliding`` also require that
    sliding was never lost.
    """
    if metric.judged == "any":
        return True
    if metric.judged == "sliding" and any(line["sliding_lost_s"] != 0.0 for line in lines):
        return False
    return never_outside(lines)


def never_outside(lines: Sequence[Line]) -> bool:
    """Return True if there are lines, and none has a violation."""
    return bool(lines) and all(line["violation_depth"] == 0.0 for line in lines)


def tally(texts: Sequence[str]) -> str:
    """Return a single text unchanged, several with the count of each."""
    if len(texts) < 2:
        return texts[0] if texts else "not run"
    return ", ".join(f"{count} {text}" for text, count in Counter(texts).items())


def columns_table(
    first: str, names: Sequence[str], columns: Mapping[str, Sequence[str]], text: int = 1
) -> Table:
    """Return a table given by its columns."""
    return Table([first, *columns], zip(names, *columns.values(), strict=True), text)
