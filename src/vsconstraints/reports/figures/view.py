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

    ``setup`` is None if it cannot be built any more; ``runs``, by controller, have at least two samples and include
    those of other figures, for the same axes in all; ``controllers`` are those of the figure, in order; φ is drawn of
    ``phi_rows``, and activity of ``lane_rows``.
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
    def shown(self) -> list[str]:
        """Controllers of the figure that have a run."""
        return [name for name in self.controllers if name in self.runs]

    @property
    def competitors(self) -> list[str]:
        """The same without tracking alone."""
        return [name for name in self.shown if name != BASELINE]

    @property
    def baseline(self) -> RunRecord | None:
        """The run of tracking alone, if there is one."""
        return self.runs.get(BASELINE)

    @property
    def end(self) -> float:
        """When the longest run ends [s]."""
        return max(float(run.trajectory.t[-1]) for run in self.runs.values())

    def lines(self) -> Iterator[tuple[str, RunRecord, dict[str, Any]]]:
        """Every run and how its line looks: tracking alone thin and below, later ones thinner than earlier ones."""
        width = {BASELINE: 1.0, **widths(self.competitors)}
        for name in sorted(self.shown, key=lambda name: name != BASELINE):
            look, order = self.looks[name], 2 if name == BASELINE else 4
            style = {"color": look.colour, "linestyle": look.line, "linewidth": width[name], "zorder": order}
            yield name, self.runs[name], style

    def entries(self, names: Sequence[str] | None = None) -> list[dict[str, Any]]:
        """Legend entries of controllers, of all that are shown if None."""
        names = self.shown if names is None else names
        return [line(shortened(name), self.looks[name].colour, self.looks[name].line) for name in names]

    def time_axis(self, ax: Any) -> None:
        """From zero to the end of the longest run, with the changes of the goal."""
        begins = {float(begin) for run in self.runs.values() for begin in run.goal_begins if begin > 0.0}
        goals = () if self.setup is None else self.setup.task.goals[1:]
        time_axis(ax, self.end, [goal.from_time for goal in goals] if self.setup is not None else sorted(begins))

    def title(self, ax: Any, name: str, above: float = 4.0, **font: Any) -> None:
        """A controller's name above its panel [pt]."""
        colour = darker(self.looks[name].colour)
        ax.set_title(shortened(name, 24), loc="left", color=colour, fontweight="bold", pad=above, **font)
