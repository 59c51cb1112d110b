"""What the figures of one scenario are drawn from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ...comparisons import RunRecord
from ...comparisons.suite import BASELINE
from ...simulation import Setup
from ..plots import Look, darker, line, looks, shortened, time_axis, widths


@dataclass(frozen=True)
class View:
    """One trial of one scenario.

    Attributes
    ----------
    setup
        What was run; None if it cannot be built any more.
    runs
        The runs with at least two samples, by controller; also those of other figures, for the same axes in all.
    controllers
        Those of the figure, in order.
    phi_rows
        Labels of the rows whose φ is drawn.
    lane_rows
        Labels of the rows whose activity is drawn.
    """

    setup: Setup | None
    runs: Mapping[str, RunRecord]
    controllers: Sequence[str]
    phi_rows: Sequence[str] = ()
    lane_rows: Sequence[str] = ()

    @cached_property
    def looks(self) -> dict[str, Look]:
        """How each controller is drawn."""
        return looks(self.controllers)

    @property
    def compared(self) -> list[RunRecord]:
        """All runs, those of other figures too, without tracking alone."""
        return [run for name, run in self.runs.items() if name != BASELINE]

    @property
    def competitors(self) -> list[str]:
        """Controllers of the figure that have a run, without tracking alone."""
        return [name for name in self.shown if name != BASELINE]

    @property
    def shown(self) -> list[str]:
        """Controllers of the figure that have a run."""
        return [name for name in self.controllers if name in self.runs]

    @property
    def baseline(self) -> RunRecord | None:
        """The run of tracking alone, if there is one."""
        return self.runs.get(BASELINE)

    @property
    def end(self) -> float:
        """When the longest run ends [s]."""
        return max(float(run.trajectory.t[-1]) for run in self.runs.values())

    @property
    def goal_changes(self) -> list[float]:
        """When the goal changes [s]."""
        if self.setup is not None:
            return [goal.from_time for goal in self.setup.task.goals[1:]]
        return sorted({float(begin) for run in self.runs.values() for begin in run.goal_begins if begin > 0.0})

    def lines(self) -> Iterator[tuple[str, RunRecord, dict[str, Any]]]:
        """Every run and how its line looks: tracking alone thin and below, later ones thinner than earlier ones."""
        width = {BASELINE: 1.0, **widths(self.competitors)}
        for name in sorted(self.shown, key=lambda name: name != BASELINE):
            look, order = self.looks[name], 2 if name == BASELINE else 4
            style = {"color": look.colour, "linestyle": look.line, "linewidth": width[name], "zorder": order}
            yield name, self.runs[name], style

    def entries(self, *, bars_only: bool = False) -> list[dict[str, Any]]:
        """Legend entries of the controllers that have a run; of bars there are none of tracking alone."""
        names = self.competitors if bars_only else self.shown
        return [line(shortened(name), self.looks[name].colour, self.looks[name].line) for name in names]

    def time_axis(self, ax: Any) -> None:
        """From zero to the end of the longest run, with the changes of the goal."""
        time_axis(ax, self.end, self.goal_changes)

    def title(self, ax: Any, name: str, above: float = 4.0) -> None:
        """A controller's name above its panel [pt]."""
        colour = darker(self.looks[name].colour)
        ax.set_title(shortened(name, 24), loc="left", color=colour, fontweight="bold", pad=above)
