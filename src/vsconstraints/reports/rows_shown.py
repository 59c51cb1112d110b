"""Which of a scenario's rows figures show."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ..comparisons.record import RunRecord
from .results import Results

MOST_PHI = 6
MOST_LANES = 12
"""How many rows fit into a figure; those that matter most are kept."""


def phi_rows(results: Results, scenario: str) -> tuple[str, ...]:
    """Rows that are challenged, or violated by a competitor; those that acted longest if there are none of these."""
    return telling(_weights(results, scenario))


def lane_rows(results: Results, scenario: str) -> tuple[str, ...]:
    """Rows that held the arm back with a competitor."""
    return acting(_weights(results, scenario))


def acting_in(labels: Sequence[str], runs: Iterable[RunRecord]) -> tuple[str, ...]:
    """Those of these rows that act in any of these runs."""
    acted = {run.trajectory.labels[i] for run in runs for i in np.flatnonzero(run.trajectory.active.any(axis=0))}
    return tuple(label for label in labels if label in acted)


def lanes_left_out(results: Results, scenario: str) -> int:
    """How many rows acted whose activity the figure does not show."""
    return max(len(_acted(_weights(results, scenario))) - MOST_LANES, 0)


Weights = dict[str, tuple[bool, float]]
"""By label, whether a row is challenged or violated by a competitor, and how long it acted in all."""


def telling(weights: Weights) -> tuple[str, ...]:
    """Those of the first kind; those that acted longest if there are none of these."""
    return _most({label: one for label, one in weights.items() if one[0]} or _acted(weights), MOST_PHI)


def acting(weights: Weights) -> tuple[str, ...]:
    """Those that acted."""
    return _most(_acted(weights), MOST_LANES)


def _weights(results: Results, scenario: str) -> Weights:
    challenged, weights = results.challenged(scenario), {}
    for label in results.labels(scenario):
        lines = [line for name in results.competitors for line in results.rows(scenario, name, label)]
        outside = any(line["violation_depth"] > 0.0 for line in lines)
        weights[label] = (label in challenged or outside, sum(line["active_time_s"] for line in lines))
    return weights


def _acted(weights: Weights) -> Weights:
    return {label: one for label, one in weights.items() if one[1] > 0.0}


def _most(weights: Weights, most: int) -> tuple[str, ...]:
    """The labels of the greatest weights, in the order of the rows."""
    kept = set(sorted(weights, key=lambda label: weights[label], reverse=True)[:most])
    return tuple(label for label in weights if label in kept)
