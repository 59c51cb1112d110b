"""The runs of a replay: several of one scene, each with the name of its law, and how a command line names them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...comparisons import ControllerSpec, RunSpec, StoredComparison
from ...comparisons.record import run_file
from ...comparisons.run import perform
from ...controllers import CONTROLLERS
from ...errors import ConfigurationError, unknown_name
from ...scenarios import Scenario
from ...simulation import Setup, Trajectory
from ..plots import looks

MAX_RUNS = 4
"""More than so many beside each other cannot be distinguished."""

HOW = (
    "SCENARIO:CONTROLLER or SCENARIO:CONTROLLER:TRIAL, which is simulated now, or the file of a stored run, "
    "FOLDER/trajectories/SCENARIO--CONTROLLER--TRIAL.npz"
)
"""What names a run."""


@dataclass(frozen=True)
class ReplayRun:
    """A run to be seen, by the name of its law, which differs from the others', and the title of its scenario."""

    law: str
    setup: Setup
    trajectory: Trajectory
    title: str = ""


def check_same_scene(runs: Sequence[ReplayRun]) -> None:
    """Raise ConfigurationError unless there is something to see in each of these runs, and all are of one scene."""
    if not 0 < len(runs) <= MAX_RUNS:
        raise ConfigurationError(f"a replay shows 1 to {MAX_RUNS} runs, not {len(runs)}")
    first, names = runs[0].setup, [run.law for run in runs]
    for run in runs:
        if len(run.trajectory.t) < 2:
            why = f": {run.trajectory.reason}" if run.trajectory.reason else ""
            raise ConfigurationError(f"the run of {run.law} left no trajectory that could be replayed{why}")
        scene = run.setup.scene
        alike = (
            (scene.robot.n, scene.robot.name) == (first.scene.robot.n, first.scene.robot.name)
            and scene.camera.size == first.scene.camera.size
            and np.array_equal(scene.markers, first.scene.markers)
            and run.setup.constraints.labels == first.constraints.labels
        )
        if not alike:
            raise ConfigurationError(
                f"the runs of {runs[0].law} and {run.law} are of different scenes: a replay shows one robot, camera, "
                "target and the same rows"
            )
        if names.count(run.law) > 1:
            raise ConfigurationError(f"two of the runs are called {run.law!r}: give each its own name")


def colours_of(runs: Sequence[ReplayRun]) -> list[str]:
    """Those of their laws."""
    return [look.colour for look in looks([run.law for run in runs]).values()]


def select_run(
    run: str, seed: int = 0, trust: bool = False, on_remark: Callable[[str], None] = lambda remark: None
) -> ReplayRun:
    """The run that a text names, see :data:`HOW`: one that is stored, or one that is simulated now.

    ``seed`` is that of trials that are simulated; own constraints that a folder of results names run only with
    ``trust``, and without them its scenario cannot be shown; ``on_remark`` is called with what a reader should know of
    what is stored. Raises VsconstraintsError if the text names no run, or it cannot be read, built or simulated.
    """
    return stored(Path(run), trust, on_remark) if run.endswith(".npz") else simulated(run, seed)


def stored(file: Path, trust: bool = False, on_remark: Callable[[str], None] = lambda remark: None) -> ReplayRun:
    """A run of a comparison, from the file of its trajectory; raises ConfigurationError if it is none or damaged."""
    parts = file.stem.split("--")
    if file.parent.name != "trajectories" or len(parts) != 3 or not parts[2].isdecimal():
        form = "FOLDER/trajectories/SCENARIO--LAW--TRIAL.npz"
        raise ConfigurationError(f"{file} is no trajectory of a comparison: {form}")
    scenario, law, trial = parts[0], parts[1], int(parts[2])
    if not file.is_file():
        raise unknown_name("trajectory", file.name, (one.name for one in file.parent.glob("*.npz")))
    comparison = StoredComparison.load(file.parent.parent, trust)
    for remark in comparison.remarks:
        on_remark(remark)
    if scenario not in comparison.scenarios:
        raise unknown_name(f"scenario of {comparison.folder}", scenario, comparison.scenarios)
    if law not in comparison.controllers:
        raise unknown_name(f"controller of {comparison.folder}", law, comparison.controllers)
    return run_of(comparison, scenario, law, trial)


def run_of(comparison: StoredComparison, scenario: str, law: str, trial: int) -> ReplayRun:
    """A run of a comparison that has been read; raises ConfigurationError where its trajectory cannot be."""
    loaded, record = comparison.scenarios[scenario], comparison.run(scenario, law, trial)
    if record is None:
        file = run_file(comparison.folder, scenario, law, trial).name
        raise ConfigurationError(f"the trajectory {file} cannot be read: it is missing, damaged, or of another version")
    with chdir("."):  # own parts may change the working directory
        setup = loaded.setup(trial, int(comparison.manifest["configuration"].get("seed", 0)))
    if record.trajectory.labels and record.trajectory.labels != setup.constraints.labels:
        raise ConfigurationError(f"the stored run of {law} on {scenario} has other rows than its scenario")
    return ReplayRun(_named(law, trial), setup, record.trajectory, loaded.title)


def simulated(run: str, seed: int = 0) -> ReplayRun:
    """A run made now: ``SCENARIO:CONTROLLER``, with ``:TRIAL`` behind it if it is not the first."""
    scenario, separator, rest = run.partition(":")
    law, _, last = rest.rpartition(":")
    law, trial = (law, int(last)) if law and last.isdecimal() else (rest, 0)
    if not (scenario and separator and law):
        raise ConfigurationError(f"{run!r} names no run: give {HOW}")
    shipped, behind, _ = law.partition(":")
    if behind and shipped in CONTROLLERS:
        raise ConfigurationError(f"{run!r} names no run: a trial is a number from 0 on, not {last!r}")
    loaded = Scenario.load(scenario)
    done = perform(RunSpec(loaded, ControllerSpec.called(law, folder=Path()), trial=trial, seed=seed))
    return ReplayRun(_named(law, trial), done.setup, done.trajectory, loaded.title)


def name_of(run: str) -> str:
    """The name of the scenario that a text names."""
    return Path(run).stem.partition("--")[0] if run.endswith(".npz") else Path(run.partition(":")[0]).stem


def _named(law: str, trial: int) -> str:
    return law if trial == 0 else f"{law}, trial {trial}"
