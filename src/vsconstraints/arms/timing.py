"""How punctual a loop was: numbers, a histogram in text, and one as a figure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..reports.plots import Figure, Sheet, decades, logarithmic
from ..rows import Array

EDGES = np.concatenate([[0.0], 10.0 ** np.arange(-6.0, 0.01, 0.5)])
"""Of the classes of lateness [s]: half decades from 1 µs on."""


@dataclass(frozen=True)
class Punctuality:
    """How late periods began, and what they took.

    Attributes
    ----------
    late, busy
        (N,) [s].
    missed
        How many began a period late, or later.
    Ts
        [s].
    """

    late: Array
    busy: Array
    missed: int
    Ts: float

    @property
    def counts(self) -> list[tuple[str, int]]:
        """Classes of lateness that there are, as text, and how many periods are in each."""
        counts, _ = np.histogram(np.clip(self.late, 0.0, EDGES[-1]), EDGES)
        used = np.flatnonzero(counts)
        if not len(used):
            return []
        classes = range(int(used[0]), int(used[-1]) + 1)
        return [(f"{_time(EDGES[i])} to {_time(EDGES[i + 1])}", int(counts[i])) for i in classes]

    def numbers(self) -> dict[str, float]:
        """What is printed and stored: [s], but for counts and shares."""
        late, busy = (x if len(x) else np.zeros(1) for x in (self.late, self.busy))
        return {
            "periods": len(self.late),
            "missed": self.missed,
            "late_median_s": float(np.median(late)),
            "late_p99_s": float(np.percentile(late, 99)),
            "late_max_s": float(late.max()),
            "busy_median_s": float(np.median(busy)),
            "busy_p99_s": float(np.percentile(busy, 99)),
            "busy_max_s": float(busy.max()),
        }

    def lines(self) -> list[str]:
        """For a terminal."""
        n = self.numbers()
        share = 100.0 * n["missed"] / max(n["periods"], 1.0)
        said = [
            f"{n['periods']:.0f} periods of {1e3 * self.Ts:g} ms, {n['missed']:.0f} missed ({share:.2g} %)",
            f"begun late by: median {_time(n['late_median_s'])}, p99 {_time(n['late_p99_s'])}, "
            f"most {_time(n['late_max_s'])}",
            f"work of a period: median {_time(n['busy_median_s'])}, p99 {_time(n['busy_p99_s'])}, "
            f"most {_time(n['busy_max_s'])}",
        ]
        counts = self.counts
        most = max((count for _, count in counts), default=1)
        # on a scale on which few are seen beside many
        said += [
            f"  {name:>18} {count:8d} {'█' * round(40 * np.log1p(count) / np.log1p(most))}" for name, count in counts
        ]
        return said


def _time(seconds: float) -> str:
    if seconds >= 0.9995:
        return f"{seconds:.3g} s"
    if seconds >= 0.9995e-3:
        return f"{1e3 * seconds:.3g} ms"
    return f"{1e6 * seconds:.3g} µs"


def _draw(runs: dict[str, Punctuality]) -> Sheet | None:
    if not any(len(run.late) for run in runs.values()):
        return None
    sheet = Sheet()
    panels = sheet.panels(
        len(runs),
        height=1.5,
        above=0.3,
        labels=("delay [ms]; red: one period", "number of periods"),
    )
    least, most = 1e3 * EDGES[1], 1e3 * EDGES[-1]
    for ax, (name, run) in zip(panels, runs.items(), strict=True):
        ax.hist(np.clip(1e3 * run.late, least, most), bins=np.geomspace(least, most, 73), color="0.35")
        ax.axvline(1e3 * run.Ts, color="tab:red", linewidth=1.0)
        ax.set_xlim(least, most)
        logarithmic(ax.xaxis, decades(least, most))
        logarithmic(ax.yaxis, decades(0.0, max(len(run.late), 1)), linear_below=1.0)
        numbers = run.numbers()
        said = f"{numbers['missed']:.0f} of {numbers['periods']:.0f} missed, p99 {_time(numbers['late_p99_s'])}"
        ax.set_title(f"{name}: {said}", fontsize=8)
    return sheet


LATENESS = Figure(
    "lateness",
    "How late periods began",
    "Periods by how late they began; the line is a whole period: what is right of it was missed.",
    _draw,
)
