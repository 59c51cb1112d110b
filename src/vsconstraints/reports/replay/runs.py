"""The runs of a replay: several of one scene, each with the name of its law, and how a command line names them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...comparisons import ControllerSpec, RunRecord, RunSpec, StoredComparison
from ...comparisons.run import perform
from ...controllers import CONTROLLERS
from ...errors import ConfigurationError, unknown_name
from ...scenarios import Scenario
from ...simulation import Setup, Trajectory
from ..plots import Look, looks

MAX_RUNS = 4
"""More than so many beside each other cannot be distinguished."""


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


def check_same_scene(runs: Sequence[ReplayRun]) -> None:
    """Raise ConfigurationError unless there is something to see in each of these runs, and all are of one scene."""
    if not 0 < len(runs) <= MAX_RUNS:
        raise ConfigurationError(f"a replay shows 1 to {MAX_RUNS} runs, not {len(runs)}")
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


# --- by name ---

HOW = (
    "SCENARIO:CONTROLLER or SCENARIO:CONTROLLER:TRIAL, which is simulated now, or the file of a stored run, "
    "FOLDER/trajectories/SCENARIO--CONTROLLER--TRIAL.npz"
)
"""What names a run."""


def select_run(
    run: str, seed: int = 0, trust: bool = False, on_remark: Callable[[str], None] = lambda remark: None
) -> ReplayRun:
    """The run that a text names: one that is stored, or one that is simulated now.

    Parameters
    ----------
    run
        See :data:`HOW`.
    seed
        Of trials that are simulated.
    trust
        Whether own constraints that a folder of results names may run: without them its scenario cannot be shown.
    on_remark
        Called with what a reader should know of what is stored.

    Raises
    ------
    VsconstraintsError
        if it names none, or what is named cannot be read, built or simulated.
    """
    return stored(Path(run), trust, on_remark) if run.endswith(".npz") else simulated(run, seed)


def stored(file: Path, trust: bool = False, on_remark: Callable[[str], None] = lambda remark: None) -> ReplayRun:
    """A run of a comparison, from the file of its trajectory; raises ConfigurationError if it is none or damaged."""
    parts = file.stem.split("--")
    if file.parent.name != "trajectories" or len(parts) != 3 or not parts[2].isdecimal():
        raise ConfigurationError(
            f"{file} is no trajectory of a comparison: FOLDER/trajectories/SCENARIO--LAW--TRIAL.npz"
        )
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
    record = comparison.run(scenario, law, trial)
    if record is None:
        raise ConfigurationError(f"{file} cannot be read: it is damaged, or of another version")
    return of_record(comparison, comparison.scenarios[scenario], law, trial, record)


def of_record(comparison: StoredComparison, scenario: Scenario, law: str, trial: int, record: RunRecord) -> ReplayRun:
    """A run of a comparison that has been read."""
    seed = int(comparison.manifest["configuration"].get("seed", 0))
    with chdir("."):  # own parts may change the working directory
        setup = scenario.setup(trial, seed)
    if record.trajectory.labels and record.trajectory.labels != setup.constraints.labels:
        raise ConfigurationError(f"the stored run of {law} on {scenario.name} has other rows than its scenario")
    return ReplayRun(_named(law, trial), setup, record.trajectory, scenario.title)


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
