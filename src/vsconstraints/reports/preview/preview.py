"""A preview: the start, the goals, and which rows are near at each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ...errors import SceneError, VsconstraintsError
from ...scenarios import Scenario
from ...simulation import Setup
from ...simulation.start import implausible
from .goals import goal_configuration
from .misplaced import moments_without, without_goals
from .moments import Moment, moment_at, nowhere
from .nearness import NEAR, Row, rows_of


@dataclass(frozen=True)
class Preview:
    """What is to be seen of a setup before it is simulated.

    Attributes
    ----------
    name
        Of the scenario.
    setup
        What would be simulated.
    moments
        The start, then the goals: each as it is at its end, when the next one begins or the run is over.
    rows
        All rows and the joints' own limits that no row is about, those nearest to their boundary first.
    refusal
        Why a run would not start; empty if it would.
    doubts
        Numbers of the setup that suggest another unit, and markers that no law can bring to their goals.
    """

    name: str
    setup: Setup
    moments: tuple[Moment, ...]
    rows: tuple[Row, ...]
    refusal: str
    doubts: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, setup: Setup) -> Self:
        """The preview of a setup; nothing is simulated."""
        moments = (moment_at(setup, "start", 0.0, setup.q0, setup.qd0), *_at_goals(setup))
        doubts, refusal = implausible(setup.scene, setup.task, setup.Ts), ""
        try:
            setup.check_start()
            doubts += setup.separated
        except VsconstraintsError as error:
            refusal = str(error)
        rows = sorted(rows_of(setup, moments), key=lambda row: -row.greatest)
        return cls(name, setup, moments, tuple(rows), refusal, tuple(doubts))

    @classmethod
    def of_scenario(cls, scenario: Scenario, trial: int = 0, seed: int = 0) -> Self:
        """The preview of a scenario's trial; where nothing but its goals cannot be built, they are the warning.

        Raises
        ------
        VsconstraintsError
            if the scenario cannot be built for another reason.
        """
        try:
            setup = scenario.setup(trial, seed)
        except VsconstraintsError as error:
            without = without_goals(scenario, trial, seed)
            if without is None:
                raise
            start, *goals = moments_without(without, scenario)
            rows = sorted(rows_of(without, (start, *goals)), key=lambda row: -row.greatest)
            moments, doubts = (start, *goals), tuple(implausible(without.scene, without.task, without.Ts))
            return cls(scenario.name, without, moments, tuple(rows), str(error), doubts)
        return cls.of(scenario.name, setup)

    @property
    def near(self) -> tuple[Row, ...]:
        """Rows that are near their boundary, or outside, at the start or a goal."""
        return tuple(row for row in self.rows if row.greatest >= NEAR)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Everything that is wrong, with the moment it is wrong in."""
        found = [*self.doubts]
        found += [f"{moment.name}: {problem}" for moment in self.moments for problem in moment.problems]
        return (*found, f"no run would start: {self.refusal}") if self.refusal else tuple(found)


def _at_goals(setup: Setup) -> list[Moment]:
    goals, scene = setup.task.goals, setup.scene
    ends = [goal.from_time - setup.Ts for goal in goals[1:]] + [(setup.samples - 1) * setup.Ts]
    found = []
    for number, (goal, t) in enumerate(zip(goals, ends, strict=True), start=1):
        name = "goal" if len(goals) == 1 else f"goal {number}"
        try:
            q, missed = goal_configuration(scene, goal, setup.q0, t)
        except SceneError as error:
            found.append(nowhere(setup, name, t, goal.pixels, str(error)))
        else:
            moment = moment_at(setup, name, t, q, np.zeros_like(q))
            if missed > setup.tolerances.feature_px:
                inexact = f"no pose shows the markers just so: the best found misses one by {missed:.3g} px"
                moment = replace(moment, problems=(inexact, *moment.problems))
            found.append(moment)
    return found
