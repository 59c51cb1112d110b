"""A preview: the start, the goals, and the distance of each constraint to its boundary; nothing is simulated."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ...errors import SceneError, VsconstraintsError
from ...scenarios import Scenario
from ...simulation import Setup
from ...simulation.start import implausible
from .moments import NEAR, Moment, Row, goal_configuration, moment_at, nowhere, rows_of

MAX_LISTED = 15  # rows that are listed, unless more are near
OF_GOALS = "performance-funnel"  # constraints that are about the goals


@dataclass(frozen=True)
class Preview:
    """What is to be seen of a scenario's setup before it is simulated.

    ``moments`` are the start, then the goals: each as it is at its end, when the next one begins or the run is over;
    ``rows`` all rows and the joints' own limits that no row is about, those nearest to their boundary first;
    ``refusal`` says why a run would not start; ``doubts`` name numbers that suggest another unit, and markers that no
    law can bring to their goals.
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
        return cls(name, setup, moments, rows_of(setup, moments), refusal, tuple(doubts))

    @classmethod
    def of_scenario(cls, scenario: Scenario, trial: int = 0, seed: int = 0) -> Self:
        """The preview of a scenario's trial; where nothing but its goals cannot be built, they are the warning.

        Raises VsconstraintsError if the scenario cannot be built for another reason.
        """
        try:
            built = scenario.setup(trial, seed)
        except VsconstraintsError as error:
            setup = _without_goals(scenario, trial, seed)
            if setup is None:
                raise
            moments = _moments_without(setup, scenario)
            doubts = tuple(implausible(setup.scene, setup.task, setup.Ts))
            return cls(scenario.name, setup, moments, rows_of(setup, moments), str(error), doubts)
        return cls.of(scenario.name, built)

    @property
    def near(self) -> tuple[Row, ...]:
        """Rows that are near their boundary, or outside, at the start or a goal."""
        return tuple(row for row in self.rows if row.greatest >= NEAR)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Everything that is wrong, with the moment it is wrong in."""
        problems = [f"{moment.name}: {problem}" for moment in self.moments for problem in moment.problems]
        return (*self.doubts, *problems, *([f"no run would start: {self.refusal}"] if self.refusal else []))


def lines(preview: Preview) -> Iterator[str]:
    """What a terminal shows, line by line, without the warnings."""
    setup, moments = preview.setup, preview.moments
    robot = setup.scene.robot
    yield f"{preview.name}: {robot.name}, {robot.n} joints, {len(setup.scene.markers)} markers"
    for moment in moments:
        where = "not known" if moment.q is None else " ".join(f"{x:.4g}" for x in moment.q)
        yield f"  {moment.name:8s} t = {moment.t:g} s, q = {where}"
    if not preview.rows:
        yield "  no rows, and no limits of joints"
        return
    shown = preview.rows[: max(MAX_LISTED, len(preview.near))]
    yield "  rows nearest to their boundary: distance (φ); ! outside, * near"
    table = [["", "", *(moment.name for moment in moments)]]
    for row in shown:
        mark = "!" if row.greatest > 1.0 else "*" if row.greatest >= NEAR else ""
        table.append([mark, row.label, *(row.text(k) for k in range(len(moments)))])
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for cells in table:
        first, *others = (cell.ljust(width) for cell, width in zip(cells, widths, strict=True))
        yield f"  {first} {'  '.join(others)}".rstrip()
    if len(shown) < len(preview.rows):
        yield f"  … and {len(preview.rows) - len(shown)} that are farther away"


def _goal_names(count: int) -> list[str]:
    return ["goal"] if count == 1 else [f"goal {number}" for number in range(1, count + 1)]


def _at_goals(setup: Setup) -> Iterator[Moment]:
    goals = setup.task.goals
    ends = [goal.from_time - setup.Ts for goal in goals[1:]] + [(setup.samples - 1) * setup.Ts]
    for name, goal, t in zip(_goal_names(len(goals)), goals, ends, strict=True):
        try:
            q, missed = goal_configuration(setup.scene, goal, setup.q0, t)
        except SceneError as error:
            yield nowhere(setup, name, t, goal.pixels, str(error))
            continue
        moment = moment_at(setup, name, t, q, np.zeros_like(q))
        if missed > setup.tolerances.feature_px:
            inexact = f"no pose shows the markers just so: the best found misses one by {missed:.3g} px"
            moment = replace(moment, problems=(inexact, *moment.problems))
        yield moment


# --- scenarios that cannot be built because of their goals ---


def _without_goals(scenario: Scenario, trial: int, seed: int) -> Setup | None:
    """The setup with a goal that any scene can have, without what is about goals; None if it cannot be built either.

    That is the start or, where markers are behind the camera there, the image's centre.
    """
    tables = scenario.tables
    task, constraints, target = (tables.get(key, {}) for key in ("task", "constraints", "target"))
    if not isinstance(task, dict) or not isinstance(target, dict):
        return None
    every = constraints if isinstance(constraints, list) else []
    kept = [one for one in every if not (isinstance(one, dict) and one.get("type") == OF_GOALS)]
    centre = [[0.0, 0.0]] * (4 if "square" in target else len(target.get("markers", [])))
    for other in (
        {**task, "goals": [{"camera_at_q": tables.get("q0")}]},
        {"feature": "image-points", "Kp0": 1.0, "goals": [{"markers_px": centre}]},
    ):
        with suppress(VsconstraintsError):
            return replace(scenario, tables={**tables, "task": other, "constraints": kept}).setup(trial, seed)
    return None


def _moments_without(setup: Setup, scenario: Scenario) -> tuple[Moment, ...]:
    """The start, and those goals that are given by joint coordinates, as far as they can be seen."""
    moments, goals = [moment_at(setup, "start", 0.0, setup.q0, setup.qd0)], scenario.tables["task"].get("goals", [])
    goals, nothing = goals if isinstance(goals, list) else [], np.full((len(setup.scene.markers), 2), np.nan)
    for name, goal in zip(_goal_names(len(goals)), goals, strict=True):
        try:
            q = setup.scene.robot.configuration(goal["camera_at_q"])
            moments.append(moment_at(setup, name, 0.0, q, np.zeros_like(q)))
        except (VsconstraintsError, KeyError, TypeError):
            moments.append(nowhere(setup, name, 0.0, nothing, "where the robot is there is not known"))
    return tuple(moments)
