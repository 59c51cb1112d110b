"""What the figures of one scenario are drawn from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...comparisons import RunRecord
from ...comparisons.suite import BASELINE
from ...simulation import Setup
from ..style import Look


@dataclass(frozen=True)
class View:
    """One trial of one scenario.

    Attributes
    ----------
    setup
        What was run; None if it cannot be built any more.
    runs
        The runs with at least two samples, by controller.
    controllers
        All controllers, in order.
    looks
        How each is drawn.
    phi_rows
        Labels of the rows whose φ is drawn.
    lane_rows
        Labels of the rows whose activity is drawn.
    """

    setup: Setup | None
    runs: dict[str, RunRecord]
    controllers: Sequence[str]
    looks: dict[str, Look]
    phi_rows: Sequence[str]
    lane_rows: Sequence[str]

    @property
    def competitors(self) -> list[str]:
        """Controllers that have a run, without tracking alone."""
        return [name for name in self.controllers if name in self.runs and name != BASELINE]

    @property
    def shown(self) -> list[str]:
        """Controllers that have a run."""
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
        last = max(run.last_goal_time for run in self.runs.values())
        return [last] if last > 0.0 else []
