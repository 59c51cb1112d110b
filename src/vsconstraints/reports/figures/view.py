"""Data from which the figures of one scenario are drawn."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...comparisons import RunRecord
from ...comparisons.metrics import NEGLIGIBLE
from ...comparisons.suite import BASELINE
from ...rows import Array, BoolArray
from ...simulation import Setup, Tolerances, Trajectory
from ..plots import Look, Style, darker, folded, line, looks, mark_of, shortened, time_axis, widths

#: Ratio of the end of axes to the end of motion, and to the end of activity of shown rows.
AFTER = 1.1
AFTER_ROWS = 1.25
MARKS = 4  # number on each line
TITLE_LENGTH = 24  # of a line of a panel's title


@dataclass(frozen=True)
class View:
    """One trial of one scenario.

    ``setup`` is None if it can no longer be built. ``runs``, by controller, have at least two
    samples and include those of other figures, so that all figures have the same axes.
    ``controllers`` are those of the figure, in order. φ is drawn of ``phi_rows``, and activity of
    ``lane_rows``.
    """

    setup: Setup | None
    runs: Mapping[str, RunRecord]
    controllers: Sequence[str]
    phi_rows: Sequence[str] = ()
    lane_rows: Sequence[str] = ()

    @cached_property
    def looks(self) -> dict[str, Look]:
        """Colour, line and marker of each controller."""
        return looks(self.controllers)

    @property
    def shown(self) -> list[str]:
        """Controllers of the figure that have a run."""
        return [name for name in self.controllers if name in self.runs]

    @property
    def competitors(self) -> list[str]:
        """Controllers of the figure that have a run, without the unconstrained baseline."""
        return [name for name in self.shown if name != BASELINE]

    @property
    def baseline(self) -> RunRecord | None:
        """Run of the unconstrained baseline, None if it was not run."""
        return self.runs.get(BASELINE)

    @cached_property
    def end(self) -> float:
        """End of time axes [s]: shortly after the last run is at rest, at most its longest run.

        A run is at rest once its errors stay within a fifth of their tolerances from their final
        values.
        """
        tolerances = Tolerances() if self.setup is None else self.setup.tolerances
        longest = 0.0
        rest = 0.0
        for run in self.runs.values():
            trajectory = run.trajectory
            longest = max(longest, float(trajectory.t[-1]))
            rest = max(rest, rest_time(trajectory, tolerances))
        return min(longest, AFTER * rest) if rest > 0.0 else longest

    @cached_property
    def rows_end(self) -> float:
        """End of the axes of rows [s]: shortly after the last activity or violation of a shown row.

        It is at most ``end``.
        """
        shown_rows = {*self.phi_rows, *self.lane_rows}
        last = 0.0
        for name in self.shown:
            trajectory = self.runs[name].trajectory
            is_relevant = violated_in_samples(self.runs[name])
            if name != BASELINE:
                is_relevant |= trajectory.active
            for i, label in enumerate(trajectory.labels):
                if label in shown_rows:
                    times = trajectory.t[is_relevant[:, i]]
                    last = float(np.max(times, initial=last))
        return min(self.end, AFTER_ROWS * last) if last > 0.0 else self.end

    def lines(self) -> Iterator[tuple[str, RunRecord, Style]]:
        """Yield every run with the style of its line.

        The unconstrained baseline is thin and lies below the others; later lines are thinner than
        earlier ones.
        """
        width = widths(self.competitors)
        width[BASELINE] = 1.0
        for name in sorted(self.shown, key=lambda name: name != BASELINE):
            look = self.looks[name]
            style = {
                "color": look.colour,
                "linestyle": look.line,
                "linewidth": width[name],
                "zorder": 2 if name == BASELINE else 4,
            }
            yield name, self.runs[name], style

    def entries(self, names: Sequence[str] | None = None) -> list[Style]:
        """Return legend entries of these controllers, or of all shown ones."""
        if names is None:
            names = self.shown
        entries = []
        for name in names:
            look = self.looks[name]
            entry = line(shortened(name), look.colour, look.line)
            if name != BASELINE:
                entry |= mark_of(look)
            entries.append(entry)
        return entries

    def marks(self, name: str, t: Array, end: float) -> Style:
        """Return a few markers for a controller's line at times t (N,) [s], up to ``end``.

        Markers of different controllers stand at different times, because not every reader can
        distinguish lines by colour. The unconstrained baseline has none.
        """
        if name == BASELINE or not len(t):
            return {}
        competitors = self.competitors
        share = (competitors.index(name) + 0.5) / len(competitors)
        times = end * (np.arange(MARKS) + share) / MARKS
        shown_times = times[times <= t[-1]]
        style = mark_of(self.looks[name])
        style["markevery"] = np.searchsorted(t, shown_times).tolist()
        return style

    def time_axis(self, ax: Any, end: float = 0.0) -> None:
        """Draw the time axis up to ``end``, by default that of the view, with the goal changes."""
        changes = set[float]()
        if self.setup is not None:
            for goal in self.setup.task.goals[1:]:
                changes.add(goal.from_time)
        else:
            for run in self.runs.values():
                begins = run.goal_begins
                changes.update(begins[begins > 0.0].tolist())
        time_axis(ax, end or self.end, sorted(changes))

    def title_lines(self, names: Iterable[str]) -> int:
        """Return the greatest number of lines of :meth:`title` for these controllers."""
        titles = [folded(name, TITLE_LENGTH) for name in names]
        return max(1 + title.count("\n") for title in titles)

    def title(self, ax: Any, name: str, above: float = 4.0, **font: Any) -> None:
        """Write a controller's name above its panel, with this distance [pt]; fold a long name."""
        colour = darker(self.looks[name].colour)
        ax.set_title(
            folded(name, TITLE_LENGTH),
            loc="left",
            color=colour,
            fontweight="bold",
            pad=above,
            **font,
        )


def rest_time(trajectory: Trajectory, tolerances: Tolerances) -> float:
    """Return the time at which the errors of a run are at rest [s].

    It is the last time at which an error differs from its final value by more than a fifth of its
    tolerance.
    """
    errors = np.column_stack([trajectory.camera_error, trajectory.feature_error_px])
    deviations = np.abs(errors - errors[-1])
    accepted = [
        tolerances.translation_m,
        tolerances.rotation_rad,
        tolerances.feature_px,
    ]
    limits = 0.2 * np.array(accepted)
    is_moving = (deviations > limits).any(axis=1)
    return float(np.max(trajectory.t[is_moving], initial=0.0))


def violated_in_samples(run: RunRecord) -> BoolArray:
    """Return True (N, m) where a run violates a row in a sample."""
    violated: BoolArray = run.trajectory.clearance < -NEGLIGIBLE * run.length
    return violated
