"""Preview: start and goals, and the distance of each row to its boundary, without simulation."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ...errors import VsconstraintsError
from ...rows import Array
from ...scenarios import Scenario
from ...scenarios.moments import Moment, moment_at, moment_without_q, moments_at_goals, named_goals
from ...simulation import Setup

NEAR = 0.9  # usage 1 − clearance/L from which a row counts as near; 1 is on its boundary
OF_GOALS = "performance-funnel"  # type of constraints that depend on the goals


@dataclass(frozen=True)
class Row:
    """Distance of a row, or of a joint's limit, to its boundary in each of k moments.

    ``clearance`` (k,) is in the unit of the row. ``phi`` (k,) is NaN for a limit without a row.
    ``usage`` (k,) is 1 − clearance/L: 1 is on the boundary.
    """

    label: str
    unit: str
    phi: Array
    clearance: Array
    usage: Array

    @property
    def limit(self) -> bool:
        """True for a limit of a joint without a row."""
        has_phi = not np.isnan(self.phi).all()
        return self.label.startswith("limit[") and not has_phi

    @property
    def greatest(self) -> float:
        """Greatest usage over the moments, minus infinity if unknown."""
        known = np.nan_to_num(self.usage, nan=-np.inf)
        return float(known.max())

    def text(self, k: int) -> str:
        """Format the distance to the boundary in a moment, with φ in brackets."""
        if np.isnan(self.clearance[k]):
            return "unknown"
        text = f"{self.clearance[k]:.3g} {self.unit}"
        if not np.isnan(self.phi[k]):
            text += f" ({self.phi[k]:.2g})"
        return text.replace("-", "−")


def rows_of(setup: Setup, moments: Sequence[Moment]) -> tuple[Row, ...]:
    """Return all rows and the limits of joints without a row, nearest to their boundary first."""
    constraints = setup.constraints
    lengths = constraints.characteristic_length
    rows = []
    for i, label in enumerate(constraints.labels):
        phi = np.array([moment.phi[i] for moment in moments])
        clearance = np.array([moment.clearance[i] for moment in moments])
        usage = 1.0 - clearance / lengths[i]
        unit = constraints.units[i]
        rows.append(Row(label, unit, phi, clearance, usage))
    rows += _limits_without_rows(setup, moments)
    rows.sort(key=lambda row: -row.greatest)
    return tuple(rows)


def _limits_without_rows(setup: Setup, moments: Sequence[Moment]) -> list[Row]:
    """Return the limits of joints that no row bounds.

    Joints that cannot move are left out: they are reported as a warning.
    """
    robot = setup.scene.robot
    unknown = np.full(robot.n, np.nan)
    no_phi = np.full(len(moments), np.nan)
    q = np.array([unknown if moment.q is None else moment.q for moment in moments])
    half = 0.5 * (robot.q_max - robot.q_min)
    is_limited = np.isfinite(half) & (half > 0.0)
    distances = {"lower": q - robot.q_min, "upper": robot.q_max - q}
    rows = []
    for side, to_limits in distances.items():
        for j in np.flatnonzero(is_limited):
            limit = f"[joint {j + 1}].{side}"
            if f"range{limit}" in setup.constraints.labels:
                continue
            unit = "m" if robot.prismatic[j] else "rad"
            distance = to_limits[:, j]
            usage = 1.0 - distance / half[j]
            rows.append(Row(f"limit{limit}", unit, no_phi, distance, usage))
    return rows


@dataclass(frozen=True)
class Preview:
    """Preview of a scenario's setup.

    ``moments`` are the start, then the goals: each at its end, when the next one begins or the run
    is over. ``rows`` are all rows and the joints' limits without a row, nearest to their boundary
    first. ``refusal`` states why a run would not start. ``doubts`` name numbers that suggest
    another unit, and markers that no law can bring to their goals.
    """

    name: str
    setup: Setup
    moments: tuple[Moment, ...]
    rows: tuple[Row, ...]
    refusal: str
    doubts: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, setup: Setup) -> Self:
        """Return the preview of a setup without simulating it."""
        start = moment_at(setup, "start", 0.0, setup.q0, setup.qd0)
        moments = (start, *moments_at_goals(setup))
        doubts = list(setup.doubts)
        refusal = ""
        try:
            setup.check_start()
            doubts += setup.separated
        except VsconstraintsError as error:
            refusal = _without(str(error), setup.doubts)
        return cls(name, setup, moments, rows_of(setup, moments), refusal, tuple(doubts))

    @classmethod
    def of_scenario(cls, scenario: Scenario, trial: int = 0, seed: int = 0) -> Self:
        """Return the preview of a trial; goals that cannot be built become a warning.

        Raises VsconstraintsError.
        """
        try:
            return cls.of(scenario.name, scenario.setup(trial, seed))
        except VsconstraintsError as error:
            setup = _without_goals(scenario, trial, seed)
            if setup is None:
                raise
            moments = _moments_without_goals(setup, scenario)
            rows = rows_of(setup, moments)
            refusal = _without(str(error), setup.doubts)
            return cls(scenario.name, setup, moments, rows, refusal, tuple(setup.doubts))

    @property
    def near(self) -> tuple[Row, ...]:
        """Rows that are near their boundary, or outside, at the start or a goal."""
        return tuple(row for row in self.rows if row.greatest >= NEAR)

    @property
    def warnings(self) -> tuple[str, ...]:
        """All warnings, with the moments to which they apply."""
        warnings = [*self.doubts]
        for moment in self.moments:
            warnings += [f"{moment.name}: {problem}" for problem in moment.problems]
        if self.refusal:
            warnings.append(f"no run would start: {self.refusal}")
        return tuple(warnings)


def _without(refusal: str, doubts: Sequence[str]) -> str:
    """Return why a run would not start, without the doubts that are listed separately."""
    for doubt in doubts:
        refusal = refusal.replace(f"; {doubt}", "")
    return refusal


def _without_goals(scenario: Scenario, trial: int, seed: int) -> Setup | None:
    """Return the setup with another goal and without constraints that depend on goals.

    Return None if this cannot be built either.
    """
    tables = scenario.tables
    task = tables.get("task", {})
    target = tables.get("target", {})
    constraints = tables.get("constraints", [])
    if not isinstance(task, dict) or not isinstance(target, dict):
        return None
    kept = []
    if isinstance(constraints, list):
        kept = [table for table in constraints if not _depends_on_goals(table)]
    at_start = {"camera_at_q": tables.get("q0")}
    marker_count = 4 if "square" in target else len(target.get("markers", []))
    in_centre = {"markers_px": [[0.0, 0.0]] * marker_count}
    other_tasks = [
        {**task, "goals": [at_start]},
        {"feature": "image-points", "Kp0": 1.0, "goals": [in_centre]},
    ]
    for other_task in other_tasks:
        changed = {**tables, "task": other_task, "constraints": kept}
        with suppress(VsconstraintsError):
            return replace(scenario, tables=changed).setup(trial, seed)
    return None


def _depends_on_goals(table: object) -> bool:
    """Return True if the table of a constraint is of a type that depends on the goals."""
    return isinstance(table, dict) and table.get("type") == OF_GOALS


def _moments_without_goals(setup: Setup, scenario: Scenario) -> tuple[Moment, ...]:
    """Return the start, and the goals that are given by joint coordinates, as far as possible."""
    moments = [moment_at(setup, "start", 0.0, setup.q0, setup.qd0)]
    goals = scenario.tables["task"].get("goals", [])
    if not isinstance(goals, list):
        goals = []
    scene = setup.scene
    unknown_pixels = np.full((len(scene.markers), 2), np.nan)
    for name, goal in named_goals(goals):
        try:
            q = scene.robot.configuration(goal["camera_at_q"])
            moment = moment_at(setup, name, 0.0, q, np.zeros_like(q))
        except (VsconstraintsError, KeyError, TypeError):
            problem = "the robot's configuration there is unknown"
            moment = moment_without_q(setup, name, 0.0, unknown_pixels, problem)
        moments.append(moment)
    return tuple(moments)
