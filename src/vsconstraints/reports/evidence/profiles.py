"""How good laws are where they succeed: profiles, ranks, and paired differences to the law in front."""

from __future__ import annotations

from typing import Any

from ...comparisons.statistics import costs, profile, ranks
from ..markdown import table
from ..numbers import DASH, number
from .drawing import shown
from .figures import CRITICAL_DIFFERENCE, PROFILES, Diagram, Panel
from .material import Material
from .pairs import PairVerdict, pairwise_verdicts
from .standing import standing
from .words import where, within

METRICS: tuple[tuple[str, str], ...] = (
    ("acceleration_variation", "variation"),
    ("settling_time_s", "settling time"),
)
"""By which laws are profiled, and what that is called; all of these are positive."""


def profiles(material: Material) -> str:
    """Figures of all conditions, and one table for each."""
    if len(material.laws) < 2:
        return ""
    parts = ["## How good laws are where they succeed"]
    parts.append(shown(material, PROFILES, [_panels(material, *metric) for metric in METRICS], material.laws))
    parts.append(shown(material, CRITICAL_DIFFERENCE, _diagrams(material), material.laws))
    tables = [text for condition in material.conditions if (text := _against(material, condition))]
    if tables:
        parts.append(
            "Each law against the one that succeeds most often, on the scenes in which both succeed: median over "
            "those in which they differ of the ratio of acceleration variations, and of the differences of settling "
            "time and utilization, with 95 % intervals that are simultaneous for all pairs of laws; ≈ where such an "
            "interval includes no difference."
        )
    return "\n\n".join(part for part in (*parts, *tables) if part)


def _costs(material: Material, condition: str, metric: str) -> Any:
    table_of = costs(material.among(condition), metric).table
    return table_of[[law for law in material.laws if law in table_of.columns]]


def _panels(material: Material, metric: str, words: str) -> list[Panel]:
    """One for each condition in which there is something to compare."""
    tables = {condition: _costs(material, condition, metric) for condition in material.conditions}
    return [
        Panel(f"{words}, {condition}", tuple(found.columns), profile(found.to_numpy(float)))
        for condition, found in tables.items()
        if len(found)
    ]


def _diagrams(material: Material) -> list[Diagram]:
    diagrams = []
    for condition in material.conditions:
        found = _costs(material, condition, METRICS[0][0])
        if len(found):
            diagrams.append(Diagram(where(condition), tuple(found.columns), ranks(found.to_numpy(float))))
    return diagrams


def _against(material: Material, condition: str) -> str:
    """All other laws against the leader of a condition."""
    one = standing(material, condition)
    if len(one.laws) < 2 or one.shares[one.leader].value == 0.0:
        return ""
    runs = material.among(condition)
    found = {
        metric: pairwise_verdicts(runs, metric, ratio=metric == "acceleration_variation")
        for metric in ("acceleration_variation", "settling_time_s", "utilization")
    }
    lines = []
    for law in one.laws[1:]:
        variation, settling, space = (pairs[law, one.leader] for pairs in found.values())
        lines.append([law, str(variation.scenes), _cell(variation), _cell(settling), _cell(space, 100.0)])
    header = [f"{within(condition)}, against {one.leader}", "scenes", "variation, ×", "settling, + s", "space, + %"]
    header[0] = header[0][0].upper() + header[0][1:]
    return table(header, lines)


def _cell(pair: PairVerdict, factor: float = 1.0) -> str:
    """A median with its interval; ≈ in front where it is not distinguishable from none."""
    if not pair.scenes:
        return DASH
    middle, low, high = (factor * value for value in (pair.difference, pair.low, pair.high))
    alike = "" if pair.verdict in ("better", "worse") else "≈ "
    if not (abs(low) < float("inf") and abs(high) < float("inf")) or low == high:
        return f"{alike}{number(middle)}"
    between = " to " if low < 0.0 else "–"
    return f"{alike}{number(middle)} ({number(low)}{between}{number(high)})"
