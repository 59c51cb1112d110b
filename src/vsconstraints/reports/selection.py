"""What a report shows of a comparison: scenarios with figures, rows in them, and the runs that it replays."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ..comparisons.record import RunRecord
from ..comparisons.suite import BASELINE
from .figures import FIGURES
from .results import Results, clean

MAX_FIGURES = 48  #: A suite with more figures than this shows only those of ``MAX_SCENARIOS`` scenarios.

MAX_SCENARIOS = 3

MAX_PHI, MAX_LANES = 6, 12  #: How many rows fit into a figure of φ, and of activity.
TRIAL_SHOWN = 0  #: The trial that figures and replays show: the one that starts where the scenario says.
#: By label, whether a row is challenged or violated by a competitor, and how long it acted in all [s].
Weights = dict[str, tuple[bool, float]]


def shown_scenarios(results: Results) -> tuple[str, ...]:
    """All scenarios of a small suite; of a large one those on which controllers differ most, then the most violated."""

    def weight(scenario: str) -> tuple[int, float]:
        runs = [results.runs(scenario, name) for name in results.competitors]
        good = sum(bool(lines) and all(map(clean, lines)) for lines in runs)
        depths = [line["violation_depth"] for lines in runs for line in lines]
        return min(good, len(runs) - good), max((x for x in depths if x == x), default=0.0)

    if len(FIGURES) * len(results.groups) * len(results.scenarios) <= MAX_FIGURES:
        return results.scenarios
    chosen = set(sorted(results.scenarios, key=weight, reverse=True)[:MAX_SCENARIOS])
    return tuple(name for name in results.scenarios if name in chosen)


def replayed_runs(results: Results, scenario: str) -> tuple[str, ...]:
    """The controller with the deepest violation, or tracking alone; and the clean one with the greatest utilization."""
    lines = {
        name: line
        for name in results.controllers
        for line in results.runs(scenario, name)
        if line["trial"] == TRIAL_SHOWN and line["duration_s"] > 0.0
    }
    depths = {name: float(lines[name]["violation_depth"]) for name in results.competitors if name in lines}
    used = {name: float(np.nan_to_num(lines[name]["utilization"], nan=-1.0)) for name in depths if clean(lines[name])}
    worst = max((name for name in depths if depths[name] > 0.0), key=lambda name: depths[name], default=BASELINE)
    best = max(used, key=lambda name: used[name], default=worst)
    return tuple(name for name in dict.fromkeys((worst, best)) if name in lines)


def phi_rows(results: Results, scenario: str) -> tuple[str, ...]:
    """Rows that are challenged, or violated by a competitor; those that acted longest if there are none of these."""
    return relevant_rows(_weights(results, scenario))


def lane_rows(results: Results, scenario: str) -> tuple[str, ...]:
    """Rows that limited the arm with a competitor."""
    return active_rows(_weights(results, scenario))


def hidden_lanes(results: Results, scenario: str) -> int:
    """How many rows acted whose activity the figure does not show."""
    return max(len(_acted(_weights(results, scenario))) - MAX_LANES, 0)


def acting_in(labels: Sequence[str], runs: Iterable[RunRecord]) -> tuple[str, ...]:
    """Those of these rows that act in any of these runs."""
    acted = {run.trajectory.labels[i] for run in runs for i in np.flatnonzero(run.trajectory.active.any(axis=0))}
    return tuple(label for label in labels if label in acted)


def relevant_rows(weights: Weights) -> tuple[str, ...]:
    """Challenged or violated rows; those that acted longest if there are none of these."""
    return _heaviest({label: one for label, one in weights.items() if one[0]} or _acted(weights), MAX_PHI)


def active_rows(weights: Weights) -> tuple[str, ...]:
    """Rows that acted."""
    return _heaviest(_acted(weights), MAX_LANES)


def _weights(results: Results, scenario: str) -> Weights:
    challenged, weights = results.challenged(scenario), {}
    for label in results.labels(scenario):
        lines = [line for name in results.competitors for line in results.rows(scenario, name, label)]
        outside = any(line["violation_depth"] > 0.0 for line in lines)
        weights[label] = (label in challenged or outside, sum(line["active_time_s"] for line in lines))
    return weights


def _acted(weights: Weights) -> Weights:
    return {label: one for label, one in weights.items() if one[1] > 0.0}


def _heaviest(weights: Weights, count: int) -> tuple[str, ...]:
    """The labels of the greatest weights, in the order of the rows."""
    kept = set(sorted(weights, key=lambda label: weights[label], reverse=True)[:count])
    return tuple(label for label in weights if label in kept)
