"""What a replay shows: runs of one scene, each with the name of its law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import ConfigurationError
from ...simulation import Setup, Trajectory
from ..plots import Look, looks

MOST_RUNS = 4
"""Beside each other, more than so many cannot be told apart."""


@dataclass(frozen=True)
class ReplayRun:
    """A run to be seen.

    Attributes
    ----------
    law
        What results call the controller: several of a replay differ by it.
    setup, trajectory
        What was simulated, and what it left.
    title
        Of the scenario.
    """

    law: str
    setup: Setup
    trajectory: Trajectory
    title: str = ""


def demand_seen_together(runs: Sequence[ReplayRun]) -> None:
    """Raise ConfigurationError unless there is something to see in each of these runs, and all are of one scene."""
    if not 0 < len(runs) <= MOST_RUNS:
        raise ConfigurationError(f"a replay shows 1 to {MOST_RUNS} runs, not {len(runs)}")
    first = runs[0].setup.scene
    for run in runs:
        if len(run.trajectory.t) < 2:
            why = f": {run.trajectory.reason}" if run.trajectory.reason else ""
            raise ConfigurationError(f"the run of {run.law} left no trajectory that could be replayed{why}")
        scene = run.setup.scene
        alike = (
            scene.robot.n == first.robot.n
            and scene.robot.name == first.robot.name
            and scene.camera.size == first.camera.size
            and np.array_equal(scene.markers, first.markers)
            and run.setup.constraints.labels == runs[0].setup.constraints.labels
        )
        if not alike:
            raise ConfigurationError(
                f"the runs of {runs[0].law} and {run.law} are of different scenes: a replay shows one robot, camera, "
                "target and the same rows"
            )
    names = [run.law for run in runs]
    for name in names:
        if names.count(name) > 1:
            raise ConfigurationError(f"two of the runs are called {name!r}: give each its own name")


def looks_of(runs: Sequence[ReplayRun]) -> dict[str, Look]:
    """How each law is drawn, by its name."""
    return looks([run.law for run in runs])
