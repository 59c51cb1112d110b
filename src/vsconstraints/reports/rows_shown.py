"""Which of a scenario's rows figures show."""

from __future__ import annotations

from .results import Results

MOST_PHI = 6
MOST_LANES = 12
"""How many rows fit into a figure; those that matter most are kept."""


def phi_rows(results: Results, scenario: str) -> tuple[str, ...]:
    """Rows that are challenged, or violated by a competitor; those that acted longest if there are none of these."""
    weight = _weights(results, scenario)
    chosen = {label for label, (important, acted) in weight.items() if important}
    if not chosen:
        chosen = {label for label, (_, acted) in weight.items() if acted > 0.0}
    return _most(results, scenario, chosen, MOST_PHI)


def lane_rows(results: Results, scenario: str) -> tuple[str, ...]:
    """Rows that held the arm back with a competitor."""
    weight = _weights(results, scenario)
    return _most(results, scenario, {label for label, (_, acted) in weight.items() if acted > 0.0}, MOST_LANES)


def lanes_left_out(results: Results, scenario: str) -> int:
    """How many rows acted whose activity the figure does not show."""
    acted = sum(acted > 0.0 for _, acted in _weights(results, scenario).values())
    return acted - len(lane_rows(results, scenario))


def _weights(results: Results, scenario: str) -> dict[str, tuple[bool, float]]:
    """Of each row, whether it is challenged or violated by a competitor, and how long it acted in all."""
    challenged = results.challenged(scenario)
    weights = {}
    for label in results.labels(scenario):
        lines = [line for name in results.competitors for line in results.rows(scenario, name, label)]
        outside = any(line["violation_depth"] > 0.0 for line in lines)
        weights[label] = (label in challenged or outside, sum(line["active_time_s"] for line in lines))
    return weights


def _most(results: Results, scenario: str, chosen: set[str], most: int) -> tuple[str, ...]:
    weight = _weights(results, scenario)
    ranked = sorted((label for label in weight if label in chosen), key=lambda label: weight[label], reverse=True)
    kept = set(ranked[:most])
    return tuple(label for label in results.labels(scenario) if label in kept)
