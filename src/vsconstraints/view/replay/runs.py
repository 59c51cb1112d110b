"""Runs of a replay: their selection by name, shown samples and highlighted rows."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ...comparisons import ControllerSpec, RunRecord, RunSpec, StoredComparison
from ...comparisons.metric_inputs import violated_in_periods
from ...comparisons.record import run_file
from ...comparisons.run import perform
from ...controllers import registered_laws
from ...errors import ConfigurationError, unknown_name
from ...reports.plots import looks
from ...rows import Array
from ...scenarios import Scenario
from ...simulation import Setup, Trajectory

# Frames per second, unless that gives more than MAX_FRAMES frames.
RATE = 25.0
MAX_FRAMES = 300
# States of a constraint's row.
INACTIVE = 0
ACTIVE = 1
VIOLATED = 2
HIGHLIGHTS = {ACTIVE: "#F0A202", VIOLATED: "#D1102A"}
States = npt.NDArray[np.uint8]
MAX_RUNS = 4  # more runs beside each other cannot be distinguished
#: Texts that name a run.
HOW = (
    "SCENARIO:CONTROLLER or SCENARIO:CONTROLLER:TRIAL, which is simulated now, or a run of a "
    "campaign again, FOLDER:FAMILY:SCENE:CONDITION:CONTROLLER, or the file of a stored run, "
    "FOLDER/trajectories/SCENARIO--CONTROLLER--TRIAL.npz"
)


class Thing(NamedTuple):
    """Object to which rows apply: a ``marker`` or a ``joint``, counted from 1, or an ``obstacle``.

    The number of an obstacle is the index of its constraint.
    """

    kind: str
    number: int


class ThingOfRun(NamedTuple):
    """Object with the index of its run, which is 0 for objects that all runs share."""

    thing: Thing
    run: int


@dataclass(frozen=True)
class ReplayRun:
    """Run to be replayed, with the unique name of its law and the title of its scenario."""

    law: str
    setup: Setup
    trajectory: Trajectory
    title: str = ""


def check_same_scene(runs: Sequence[ReplayRun]) -> None:
    """Raise ConfigurationError unless each run has a trajectory and all are of one scene."""
    if not 0 < len(runs) <= MAX_RUNS:
        raise ConfigurationError(f"a replay shows 1 to {MAX_RUNS} runs, not {len(runs)}")

    def shown(run: ReplayRun) -> tuple[object, ...]:
        scene = run.setup.scene
        return (
            scene.robot.n,
            scene.robot.name,
            scene.camera.size,
            scene.markers.tolist(),
            run.setup.constraints.labels,
        )

    names = [run.law for run in runs]
    for run in runs:
        if len(run.trajectory.t) < 2:
            why = f": {run.trajectory.reason}" if run.trajectory.reason else ""
            raise ConfigurationError(
                f"the run of {run.law} left no trajectory that could be replayed{why}"
            )
        if shown(run) != shown(runs[0]):
            alike = "a replay shows one robot, camera, target and the same rows"
            raise ConfigurationError(
                f"the runs of {runs[0].law} and {run.law} are of different scenes: {alike}"
            )
        if names.count(run.law) > 1:
            raise ConfigurationError(
                f"two of the runs have the name {run.law!r}: rename one of them"
            )


def coloured(runs: Sequence[ReplayRun]) -> Iterator[tuple[ReplayRun, str]]:
    """Yield each run with the colour of its law."""
    shown = looks([run.law for run in runs])
    for run in runs:
        yield run, shown[run.law].colour


# --- Time ---


@dataclass(frozen=True)
class Frames:
    """Instants t (F,), ``period`` apart [s], from the start to the end of the longest run."""

    t: Array
    period: float

    @classmethod
    def of(cls, runs: Sequence[ReplayRun], rate: float = RATE, most: int = MAX_FRAMES) -> Frames:
        """Return the instants for runs: ``rate`` per second, but at most ``most``."""
        ends = [float(run.trajectory.t[-1]) for run in runs]
        end = max(ends)
        period = max(1.0 / rate, end / (most - 1))
        period_count = int(np.ceil(end / period - 1e-9))
        t = period * np.arange(period_count + 1)
        return cls(t, period)

    def samples(self, run: ReplayRun) -> npt.NDArray[np.int64]:
        """Return the sample (F,) of a run that each instant shows: the last one up to that time."""
        begun = np.searchsorted(run.trajectory.t, self.t + 1e-9, side="right")
        shown = np.maximum(begun - 1, 0)
        return shown.astype(np.int64)

    def states(self, run: ReplayRun) -> States:
        """Return the state (F, m) of each row between one instant and the next.

        A single sample is enough to show a state. After a run has ended, rows are inactive: from
        the frame after the one that first shows its last sample.
        """
        sample_states = states(run)
        first = self.samples(run)
        shown = np.maximum.reduceat(sample_states, first, axis=0)
        has_ended = first[:-1] == len(sample_states) - 1
        shown[1:][has_ended] = INACTIVE
        return shown

    def remark(self, runs: Sequence[ReplayRun]) -> str:
        """Return a sentence on the number of samples that are shown, empty if all are."""
        samples = max(len(run.trajectory.t) for run in runs)
        if samples <= len(self.t):
            return ""
        return (
            f"{len(self.t)} of {samples} samples are shown; a constraint is highlighted if it is "
            "active or violated in any sample up to the next one shown."
        )


def states(run: ReplayRun) -> States:
    """Return the state (N, m) of each row at each sample."""
    trajectory = run.trajectory
    record = RunRecord.of(run.setup, trajectory, "")
    states = np.full(trajectory.active.shape, INACTIVE, dtype=np.uint8)
    states[trajectory.active] = ACTIVE
    states[violated_in_periods(record)] = VIOLATED
    return states


def highlights_of(runs: Sequence[ReplayRun], frames: Frames) -> dict[ThingOfRun, States]:
    """Return the states (F,) of all highlighted objects in space.

    Objects that runs share are highlighted by the rows of any run: obstacles, and markers unless
    the arms carry them.
    """
    found: dict[ThingOfRun, States] = {}
    for k, run in enumerate(runs):
        shared = {"obstacle"}
        if run.setup.scene.camera.fixed is None:
            shared.add("marker")  # otherwise each arm carries markers
        states_by_row = frames.states(run).T
        for thing, row_states in zip(things_of(run), states_by_row, strict=True):
            if thing is None or not row_states.any():
                continue
            key = ThingOfRun(thing, 0 if thing.kind in shared else k)
            worst = np.maximum(found.get(key, INACTIVE), row_states)
            found[key] = worst.astype(np.uint8)
    return found


def things_of(run: ReplayRun) -> list[Thing | None]:
    """Return the object (m,) to which each row applies, None for rows on any other quantity."""
    scene = run.setup.scene
    constraints = run.setup.constraints
    counts = {"marker": len(scene.markers), "joint": scene.robot.n}
    things: list[Thing | None] = []
    for k, block in enumerate(constraints.blocks()):
        if block.constraint.meshes(0.0, 1.0):
            things += [Thing("obstacle", k)] * block.row_count
            continue
        first = len(things)
        labels = constraints.labels[first : first + block.row_count]
        things += [_thing_named(label, counts) for label in labels]
    return things


def _thing_named(label: str, counts: Mapping[str, int]) -> Thing | None:
    """Return the marker or joint that the label of a row names, if there is one of that number."""
    match = re.search(r"(marker|joint) (\d+)\]", label)
    if match is None:
        return None
    thing = Thing(match[1], int(match[2]))
    return thing if thing.number <= counts[thing.kind] else None


# --- Names ---


def select_run(
    run: str,
    seed: int = 0,
    trust: bool = False,
    on_remark: Callable[[str], None] = lambda remark: None,
) -> ReplayRun:
    """Return the run that a text names: a stored run, or a run that is simulated now.

    For the forms of the text see :data:`HOW`. ``seed`` is the seed of simulated trials. Custom
    constraints that a folder of results names run only with ``trust``; without it a scenario that
    needs them cannot be shown. ``on_remark`` is called with remarks on the stored comparison.
    Raises VsconstraintsError if the text names no run, or if the run cannot be read, built or
    simulated.
    """
    if not run.endswith(".npz"):
        return _simulated(run, seed)
    file = Path(run)
    folder = file.parent
    parts = file.stem.split("--")
    if folder.name != "trajectories" or len(parts) != 3 or not parts[2].isdecimal():
        form = "FOLDER/trajectories/SCENARIO--LAW--TRIAL.npz"
        raise ConfigurationError(f"{file} is not the trajectory of a comparison: {form}")
    if not file.is_file():
        stored = [path.name for path in folder.glob("*.npz")]
        raise unknown_name("trajectory", file.name, stored)
    comparison = StoredComparison.load(folder.parent, trust)
    for remark in comparison.remarks:
        on_remark(remark)
    scenario, law, trial = parts
    if scenario not in comparison.scenarios:
        where = f"scenario of {comparison.folder}"
        raise unknown_name(where, scenario, comparison.scenarios)
    if law not in comparison.controllers:
        where = f"controller of {comparison.folder}"
        raise unknown_name(where, law, comparison.controllers)
    return run_of(comparison, scenario, law, int(trial))


def run_of(comparison: StoredComparison, scenario: str, law: str, trial: int) -> ReplayRun:
    """Return a run of a loaded comparison.

    Raises ConfigurationError if its trajectory cannot be read, or if its rows are not those of the
    scenario.
    """
    loaded = comparison.scenarios[scenario]
    record = comparison.run(scenario, law, trial)
    if record is None:
        file = run_file(comparison.folder, scenario, law, trial).name
        raise ConfigurationError(
            f"the trajectory {file} cannot be read: it is missing, damaged, or of another version"
        )
    with chdir("."):  # custom parts may change the working directory
        setup = loaded.setup(trial, int(comparison.manifest["configuration"].get("seed", 0)))
    if record.trajectory.labels and record.trajectory.labels != setup.constraints.labels:
        raise ConfigurationError(
            f"the stored run of {law} on {scenario} has other rows than its scenario"
        )
    return ReplayRun(_shown_name(law, trial), setup, record.trajectory, loaded.title)


def _simulated(run: str, seed: int) -> ReplayRun:
    """Simulate the run ``SCENARIO:CONTROLLER`` or ``SCENARIO:CONTROLLER:TRIAL``."""
    scenario, _, law = run.partition(":")
    trial = 0
    name, _, last = law.rpartition(":")
    if name and last.isdecimal():
        law = name
        trial = int(last)
    if not (scenario and law):
        raise ConfigurationError(f"{run!r} is not a run: give {HOW}")
    shipped, colon, _ = law.partition(":")
    if colon and shipped in registered_laws():
        raise ConfigurationError(
            f"{run!r} is not a run: a trial is a number from 0 on, not {last!r}"
        )
    loaded = Scenario.load(scenario)
    controller = ControllerSpec.called(law, folder=Path())
    finished = perform(RunSpec(loaded, controller, trial=trial, seed=seed))
    return ReplayRun(_shown_name(law, trial), finished.setup, finished.trajectory, loaded.title)


def _shown_name(law: str, trial: int) -> str:
    return f"{law}, trial {trial}" if trial else law


def campaign_run(run: str) -> list[str]:
    """Return folder, family, scene, condition and controller of a run of a campaign.

    The list is empty if the text does not name such a run.
    """
    parts = run.rsplit(":", 4)
    return parts if len(parts) == 5 and parts[2].isdecimal() else []


def name_of(run: str) -> str:
    """Return the name of the scenario, or family and scene, in a text that names a run."""
    parts = campaign_run(run)
    if parts:
        return "-".join(parts[1:3])
    if run.endswith(".npz"):
        return Path(run).stem.partition("--")[0]
    return Path(run.partition(":")[0]).stem
