"""Scenarios that cannot be built because of their goals: what can be seen of them all the same."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np

from ...errors import VsconstraintsError
from ...rows import Array
from ...scenarios import Scenario
from ...simulation import Setup
from .moments import Moment, moment_at, nowhere

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
