"""A preview: the start, the goals, and the distance of each constraint to its boundary; nothing is simulated."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Any, Self

import numpy as np

from ...errors import SceneError, VsconstraintsError
from ...rows import Array
from ...scenarios import Scenario
from ...simulation import Setup
from ...simulation.start import implausible
from .moments import NEAR, Moment, Row, goal_configuration, moment_at, nowhere, rows_of


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


# --- as text ---

MAX_LISTED = 15
"""Rows that are listed, unless more are near."""


def lines(preview: Preview) -> Iterator[str]:
    """What a terminal shows, line by line, without the warnings."""
    setup = preview.setup
    robot, moments = setup.scene.robot, preview.moments
    yield f"{preview.name}: {robot.name}, {robot.n} joints, {len(setup.scene.markers)} markers"
    for moment in moments:
        where = "not known" if moment.q is None else " ".join(f"{x:.4g}" for x in moment.q)
        yield f"  {moment.name:8s} t = {moment.t:g} s, q = {where}"
    if not preview.rows:
        yield "  no rows, and no limits of joints"
        return
    shown = preview.rows[: max(MAX_LISTED, len(preview.near))]
    yield "  rows nearest to their boundary: distance (φ); ! outside, * near"
    head = ["", "", *(moment.name for moment in moments)]
    table = [head, *(_cells(row) for row in shown)]
    widths = [max(map(len, column)) for column in zip_longest(*table, fillvalue="")]
    for cells in table:
        first, *others = (cell.ljust(width) for cell, width in zip(cells, widths, strict=True))
        yield f"  {first} {'  '.join(others)}".rstrip()
    if len(shown) < len(preview.rows):
        yield f"  … and {len(preview.rows) - len(shown)} that are farther away"


def _cells(row: Row) -> list[str]:
    mark = "!" if row.greatest > 1.0 else "*" if row.greatest >= NEAR else ""
    return [mark, row.label, *(row.text(k) for k in range(len(row.usage)))]


# --- scenarios that cannot be built because of their goals ---

OF_GOALS = "performance-funnel"
"""Constraints that are about the goals."""


def without_goals(scenario: Scenario, trial: int, seed: int) -> Setup | None:
    """The setup with a goal that any scene can have, without what is about goals; None if it cannot be built either.

    That is the start or, where markers are behind the camera there, the image's centre.
    """
    tables = scenario.tables
    task, constraints, target = (tables.get(key, {}) for key in ("task", "constraints", "target"))
    if not isinstance(task, dict) or not isinstance(target, dict):
        return None
    kept = [
        one
        for one in (constraints if isinstance(constraints, list) else [])
        if not (isinstance(one, dict) and one.get("type") == OF_GOALS)
    ]
    centre = [[0.0, 0.0]] * (4 if "square" in target else len(target.get("markers", [])))
    for replaced in (
        {**task, "goals": [{"camera_at_q": tables.get("q0")}]},
        {"feature": "image-points", "Kp0": 1.0, "goals": [{"markers_px": centre}]},
    ):
        with suppress(VsconstraintsError):
            changed = {**tables, "task": replaced, "constraints": kept}
            return Scenario(scenario.name, changed, scenario.folder).setup(trial, seed)
    return None


def moments_without(setup: Setup, scenario: Scenario) -> list[Moment]:
    """The start, and those goals that are given by joint coordinates, as far as they can be seen."""
    moments = [moment_at(setup, "start", 0.0, setup.q0, setup.qd0)]
    goals = scenario.tables["task"].get("goals", [])
    nothing = np.full((len(setup.scene.markers), 2), np.nan)
    for number, goal in enumerate(goals if isinstance(goals, list) else [], start=1):
        name = "goal" if len(goals) == 1 else f"goal {number}"
        q = _coordinates(setup, goal)
        if q is None:
            moments.append(nowhere(setup, name, 0.0, nothing, "where the robot is there is not known"))
        else:
            moments.append(moment_at(setup, name, 0.0, q, np.zeros_like(q)))
    return moments


def _coordinates(setup: Setup, goal: Any) -> Array | None:
    """(n,) what a goal gives as joint coordinates."""
    try:
        return setup.scene.robot.configuration(goal["camera_at_q"])
    except (VsconstraintsError, KeyError, TypeError):
        return None
