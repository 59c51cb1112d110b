"""Which scenarios' figures a report shows: all of a small suite, the most telling ones of a large one."""

from __future__ import annotations

from .figures import FIGURES
from .results import Results, clean

MOST_FIGURES = 48
"""A suite is large if its scenarios had more figures: that of more than twelve, or four where laws need three each."""

TELLING = 3
"""Of how many scenarios a report of a large suite shows the figures."""


def is_large(results: Results) -> bool:
    """Whether there would be more figures than anybody looks at."""
    return len(FIGURES) * len(results.groups) * len(results.scenarios) > MOST_FIGURES


def telling(results: Results) -> tuple[str, ...]:
    """Where some laws do the task inside the limits and others do not; of these, where one is deepest outside."""

    def weight(scenario: str) -> tuple[int, float]:
        runs = [results.runs(scenario, name) for name in results.competitors]
        good = sum(bool(own) and all(map(clean, own)) for own in runs)
        depths = [line["violation_depth"] for own in runs for line in own]
        return min(good, len(runs) - good), max((x for x in depths if x == x), default=0.0)

    if not is_large(results):
        return results.scenarios
    chosen = set(sorted(results.scenarios, key=weight, reverse=True)[:TELLING])
    return tuple(name for name in results.scenarios if name in chosen)
