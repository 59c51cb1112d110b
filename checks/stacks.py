"""``python -m checks.stacks run ENVS [--out FOLDER]``: runs of stacks beside laws.

Draws the scenes of ``comparisons/stacks.toml``, tunes two gains of each entry on training scenes,
and runs it with the chosen gains in held-out scenes. ENVS contains the environments of the adapters
(``python -m vsconstraints.stacks.environments ENVS``) and, as ``visp_stack``, the program of
``controllers/visp``; it takes the place of ``../envs`` in the suite. One group after the other is
completed: an arm that servoes by one feature within one limit of accelerations. Finished runs are
in FOLDER, and the same command continues. ``checks.stacks_page`` makes the kept table and the page
from them.

A stack of your own is an entry of the suite. Its table ``gains`` says which of its options take the
gains, ``gains = { task = "gain", view = "view_gain" }``; without ``view`` only the task is tuned.
"""

from __future__ import annotations

import os
import re
import sys
import time
from argparse import ArgumentParser
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vsconstraints.bench.evidence import Campaign
from vsconstraints.bench.families import Drawn
from vsconstraints.bench.tuning import JournalFile, claim
from vsconstraints.comparisons.metrics import score
from vsconstraints.comparisons.record import RunRecord
from vsconstraints.comparisons.runs.files import plain
from vsconstraints.comparisons.runs.folder import locked
from vsconstraints.comparisons.runs.identity import Identity, identity, scene_identity
from vsconstraints.comparisons.runs.pool import Failure, Workers, processes
from vsconstraints.comparisons.runs.spec import BASELINE, ControllerSpec, prepare_laws
from vsconstraints.errors import (
    ConfigurationError,
    VsconstraintsError,
    described,
    format_value,
    unknown_name,
)
from vsconstraints.plugins.provenance import digest
from vsconstraints.simulation import Setup, simulate
from vsconstraints.stacks.environments import interpreter

ROOT = Path(__file__).parents[1]
SUITE = ROOT / "comparisons" / "stacks.toml"
ENVIRONMENTS = ROOT / "envs"  #: ``../envs`` in the suite, which stands for the folder of a command.
RUNS = "runs.jsonl"  #: File of the lines of finished runs.

GAINS = (0.75, 1.5, 3.0)  #: λ of the task [1/s].
VIEW_GAINS = (2.0, 8.0)  #: α of the field of view [1/s].
TRAINING = 3  #: Training scenes per family.
TEST = 20  #: Held-out scenes per family.
MOST_DRAWN = 200  #: Scenes that are drawn at most to find those that count.
TIME_LIMIT = 10.0  #: Time in which a run must settle [s].
SHORTEST = 1.0  #: Shortest duration of a run [s]; a run that has settled ends.

#: Key of an entry for the options of a stack that take its gains: ``task`` and, if it has a
#: constraint on the image, ``view``.
OWN_GAINS = "gains"
#: Options of adapters for the gain of the field of view; other stacks have none, or name it.
VIEW_OPTIONS = {
    "pink": "barrier_gain",
    "cbfpy": "barrier_gain",
    "mink": "view_gain",
    "placo": "view_gain",
    "rtb": "view_gain",
}
FEATURES = {
    "camera-pose": ("placo", "rtb", "oink", "tsid"),
    "image-points": ("mvt",),
}  #: Adapters for one feature only.
WITHOUT_VIEW = ("resolved-rate",)
SCENE_K = 0.1  #: K of the field of view in the scenes [s]; 1/K is its gain.
#: Ratio of √K_T,p to the slower of the two rates of the task's error with a damping of 3.
ROOT_OF_STIFFNESS = 0.5 * (3.0 + np.sqrt(5.0))
#: Reason of a run whose stack answered later than its protocol allows.
TOO_LATE = "it gave no answer within|the run had to wait for it"
INFLUENCE = 0.3  #: Influence distance of the velocity damper [scales].


class Gains(NamedTuple):
    """Gains of the task and of the field of view [1/s]; ``view`` is None without one."""

    task: float
    view: float | None


def is_stack(entry: ControllerSpec) -> bool:
    """True for a program, an adapter or a class outside the package."""
    return ":" in entry.law


def kind_of(entry: ControllerSpec) -> str:
    """Return the adapter of an entry, or the type of any other one."""
    return str(entry.options.get("adapter", entry.law))


def gain_options(entry: ControllerSpec) -> dict[str, str]:
    """Return the options of a stack for its gains: of the ``task`` and, if it has one, ``view``.

    Raises ConfigurationError if the entry names them in another way.
    """
    kind = kind_of(entry)
    usual = {"task": "gain"}
    if kind in VIEW_OPTIONS:
        usual["view"] = VIEW_OPTIONS[kind]
    own = entry.options.get(OWN_GAINS, usual)
    named = isinstance(own, dict) and "task" in own and set(own) <= {"task", "view"}
    if not (named and all(isinstance(option, str) and option for option in own.values())):
        raise ConfigurationError(
            f"controllers.{entry.name}.{OWN_GAINS} names the options for the gains, "
            f'{{ task = "gain", view = "view_gain" }} or without view, not {format_value(own)}'
        )
    return dict(own)


def grid(entry: ControllerSpec) -> list[Gains]:
    """Return the gains that are tried for an entry."""
    has_view = kind_of(entry) not in WITHOUT_VIEW
    if is_stack(entry):
        has_view = "view" in gain_options(entry)
    return [Gains(*pair) for pair in product(GAINS, VIEW_GAINS if has_view else (None,))]


def feature_of(family: str) -> str:
    """Return the feature by which the arm of a family servoes."""
    return "image-points" if family.endswith("-image") else "camera-pose"


def applies(entry: ControllerSpec, feature: str) -> bool:
    """True if an entry can servo by a feature."""
    return not any(kind_of(entry) in own for name, own in FEATURES.items() if name != feature)


def with_gains(entry: ControllerSpec, gains: Gains) -> tuple[ControllerSpec, dict[str, float]]:
    """Return an entry with its gains, and the keys of the scene that they change.

    A law or stack that commands accelerations has a task of second order: its stiffness and damping
    are such that the slower rate of its error is λ.
    """
    kind = kind_of(entry)
    stiffness = float(ROOT_OF_STIFFNESS * gains.task) ** 2
    own: dict[str, Any] = {}
    scene: dict[str, float] = {}
    view = np.nan if gains.view is None else gains.view
    if kind == "tsid":
        own = {"stiffness": stiffness, "damping": 3.0 * stiffness**0.5}
    elif is_stack(entry):
        values = {"task": gains.task, "view": view}
        own = {option: values[gain] for gain, option in gain_options(entry).items()}
    else:
        if kind.startswith(("velocity-", "resolved-rate")):
            own = {"gain": gains.task}
        else:
            scene = {"task.Kp0": stiffness}
        if kind == "velocity-damper":
            # ξ / d_i is the rate at which the distance falls
            own |= {"influence": INFLUENCE, "speed": INFLUENCE * view}
        elif kind == "resolved-rate-avoidance":
            # a zone in place of a rate: the slower the approach, the earlier it begins
            own["zone"] = 0.6 / view
        elif kind not in WITHOUT_VIEW:
            own["K"] = {"fov": 1.0 / (SCENE_K * view)}
    options = {**entry.options, **own}
    if is_stack(entry):
        options.pop(OWN_GAINS, None)
    return replace(entry, options=options), scene


def installed(entry: ControllerSpec, folder: Path) -> ControllerSpec:
    """Return an entry with a folder in place of ``../envs``, for environments and programs.

    An adapter without ``python`` gets its environment there. All other commands stay as they are.
    """
    own = dict(entry.options)
    if "python" in own:
        own["python"] = _moved(own["python"], folder)
    elif "adapter" in own:
        own["python"] = str(interpreter(folder, own["adapter"]))
    if isinstance(own.get("command"), list):
        own["command"] = [_moved(part, folder) for part in own["command"]]
    return replace(entry, options=own)


def _moved(part: Any, folder: Path) -> Any:
    """Return a path in ``../envs`` as one in a folder, and anything else as it is."""
    if not isinstance(part, str):
        return part
    path = Path(os.path.normpath(SUITE.parent / part))
    return str(folder / path.relative_to(ENVIRONMENTS)) if ENVIRONMENTS in path.parents else part


# --- Runs ---

Line = dict[str, Any]  #: Keys, gains and results of a run.
Key = tuple[Any, ...]


@dataclass(frozen=True)
class Task:
    """One run: a scene in a condition, an entry and its gains."""

    scene: Drawn
    condition: str
    entry: ControllerSpec
    gains: Gains

    @property
    def keys(self) -> Line:
        """Everything that distinguishes the run, by column."""
        return {
            "family": self.scene.family,
            "condition": self.condition,
            "half": self.scene.half,
            "scene": self.scene.number,
            "controller": self.entry.name,
            "gain": self.gains.task,
            "view_gain": self.gains.view,
        }

    @property
    def limit(self) -> float:
        """Time after which the process of the run is ended [s]; a late run is made twice."""
        return 2.0 * self.entry.run_limit(self.scene.tables[self.condition])


KEYS = ("family", "condition", "half", "scene", "controller", "gain", "view_gain")


def key_of(line: Line) -> Key:
    """Return everything that distinguishes the run of a line."""
    return tuple(line[name] for name in KEYS)


def setup_of(scene: Drawn, condition: str, changes: Mapping[str, float]) -> Setup:
    """Set up a run of a drawn scene that ends when it has settled, at the time limit at latest."""
    scenario = scene.scenario(condition)
    for key, value in changes.items():
        scenario = scenario.with_override(key, value)
    setup = scenario.setup(seed=scene.noise)
    return replace(setup, duration=SHORTEST, time_limit=TIME_LIMIT)


def run(task: Task) -> Line:
    """Run a task, and return its line; a run whose stack is late is made once more.

    Stacks are late on a busy machine.
    """
    entry, changes = with_gains(task.entry, task.gains)
    setup = setup_of(task.scene, task.condition, changes)
    record = _run(entry, setup)
    if re.search(TOO_LATE, record.trajectory.reason):
        record = _run(entry, setup)
    return {**task.keys, **measured(setup, record)}


def _run(entry: ControllerSpec, setup: Setup) -> RunRecord:
    try:
        return RunRecord.of(setup, simulate(setup, entry.make()), "")
    except Exception as error:  # a run that cannot begin is a line of the table, too
        return RunRecord.failed(described(error), "")


def without_answer(task: Task, failure: Failure) -> Line:
    """Return the line of a run whose process died or was ended."""
    setup = setup_of(task.scene, task.condition, {})
    return {**task.keys, **measured(setup, RunRecord.failed(failure.reason, ""))}


def measured(setup: Setup, record: RunRecord) -> dict[str, Any]:
    """Return the results of a run that the table keeps."""
    trajectory = record.trajectory
    half = 0.5 * np.asarray(setup.scene.camera.size, dtype=float)
    pixels = trajectory.features_px
    margin = (half - np.abs(pixels)).min() if len(pixels) else np.nan
    others = np.array([kind != "fov" for kind in record.kinds], dtype=bool)
    least = trajectory.clearance[:, others]
    beyond = (-least / record.length[others]).max() if least.size else np.nan
    silent = re.search(r"no answer in (\d+) of (\d+) periods", trajectory.reason)
    return {
        "status": trajectory.status,
        "settling_time_s": score(record, None).result["settling_time_s"],
        "margin_px": float(margin),
        "other_rows": max(float(beyond), 0.0),
        "unanswered": int(silent[1]) / int(silent[2]) if silent else 0.0,
        "reason": trajectory.reason[:300],
    }


def depends_on() -> Identity:
    """Return what the runs depend on: code, packages, entries and families."""
    campaign = Campaign.load(SUITE)
    families = {family.name: scene_identity(family.tables) for family in campaign.families}
    made_of: Identity = plain(
        identity(campaign.controllers, families=families, check=digest(Path(__file__)))
    )
    return made_of


class Journal(dict[Key, Line]):
    """Lines of finished runs in a folder, by key; each is stored as soon as it is known."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self._file = JournalFile(folder / RUNS, "runs", self._take)

    def _take(self, line: Line) -> None:
        self[key_of(line)] = line

    def add(self, line: Line) -> None:
        """Store a line. Raises StorageError if it cannot be written."""
        self._file.add(line)
        self._take(line)


def score_of(line: Line) -> tuple[bool, float, float]:
    """Return whether a run is a success, its settling time and its margin."""
    success = line["status"] == "converged" and line["margin_px"] >= 0.0
    return success, line["settling_time_s"], line["margin_px"]


def chosen(lines: Iterable[Line]) -> Gains:
    """Return the gains with the most successes, of these those that settle first.

    Without a success they are those with the largest median margin in the image.
    """
    by_gains: dict[Gains, list[tuple[bool, float, float]]] = {}
    for line in lines:
        gains = Gains(line["gain"], line["view_gain"])
        by_gains.setdefault(gains, []).append(score_of(line))

    def rank(gains: Gains) -> tuple[float, ...]:
        scores = by_gains[gains]
        times = [time for success, time, _ in scores if success]
        margins = [margin if np.isfinite(margin) else -np.inf for *_, margin in scores]
        middle = float(np.median(times)) if times else np.inf
        return -len(times), middle, -float(np.median(margins)), gains.task, gains.view or 0.0

    return min(by_gains, key=rank)


@cache
def scenes_of(family_name: str, half: str, count: int) -> list[Drawn]:
    """Return the first scenes in which tracking, on the fastest arm, takes a marker out of view.

    Raises ConfigurationError if there are too few among the first scenes.
    """
    campaign = Campaign.load(SUITE)
    family = next(each for each in campaign.families if each.name == family_name)
    found: list[Drawn] = []
    for number in range(MOST_DRAWN):
        scene = family.scene(number, half, campaign.seed)
        if scene.found and any(label.startswith("fov") for label in scene.challenged):
            found.append(scene)
        if len(found) >= count:
            return found
    raise ConfigurationError(
        f"family {family_name}: tracking takes a marker out of view in only {len(found)} of its "
        f"first {MOST_DRAWN} {half} scenes, and {count} are asked for: ask for fewer, or let the "
        f"family draw larger motions"
    )


class Group(NamedTuple):
    """An arm that servoes by one feature, and its limit of accelerations."""

    family: str
    condition: str

    def __str__(self) -> str:
        return f"{self.family}, {self.condition}"

    def includes(self, line: Line) -> bool:
        """True if a line is of this group."""
        return self == (line["family"], line["condition"])


class Plan(NamedTuple):
    """Entries and groups of the comparison, and its numbers of scenes."""

    entries: tuple[ControllerSpec, ...]
    groups: tuple[Group, ...]
    training: int = TRAINING
    test: int = TEST

    @classmethod
    def of(cls, asked: Any) -> Plan:
        """Return the plan of a command line.

        Raises ConfigurationError if an entry, family or condition is unknown.
        """
        campaign = Campaign.load(SUITE)
        envs = asked.envs.absolute()
        known = {each.name: each for each in campaign.controllers if each.name != BASELINE}
        names = _selected("entry", asked.entry, known)
        entries = tuple(installed(known[name], envs) for name in names)
        families = _selected("family", asked.family, [each.name for each in campaign.families])
        conditions = _selected("condition", asked.condition, campaign.conditions)
        groups = tuple(
            Group(family, condition) for condition, family in product(conditions, families)
        )
        return cls(entries, groups, asked.training, asked.test)

    def stages(self, group: Group, journal: Mapping[Key, Line]) -> Iterator[list[Task]]:
        """Yield the runs of the tuning, and when they are in the journal, the held-out runs.

        Scenes come one after the other.
        """
        entries = [entry for entry in self.entries if applies(entry, feature_of(group.family))]
        tuning = [
            Task(scene, group.condition, entry, gains)
            for scene in scenes_of(group.family, "training", self.training)
            for entry in entries
            for gains in grid(entry)
        ]
        yield tuning
        training = [journal[key_of(task.keys)] for task in tuning]
        tuned = {
            entry.name: chosen(line for line in training if line["controller"] == entry.name)
            for entry in entries
        }
        yield [
            Task(scene, group.condition, entry, tuned[entry.name])
            for scene in scenes_of(group.family, "held-out", self.test)
            for entry in entries
        ]


def _selected(what: str, asked: Sequence[str] | None, known: Iterable[str]) -> list[str]:
    """Return the names that are asked for, all if none is; raise ConfigurationError if unknown."""
    for name in asked or ():
        if name not in known:
            raise unknown_name(what, name, known)
    return list(asked or known)


def make_runs(plan: Plan, folder: Path, workers: int | None, minutes: float) -> bool:
    """Make the runs of a plan that are not in the folder yet, and return True if there are all.

    After ``minutes``, runs that are not finished are given up. Raises ConfigurationError if the
    folder has runs of other code or scenes, StorageError if a run cannot be stored.
    """
    deadline = time.monotonic() + 60.0 * minutes
    with locked(folder, "a tuning"):
        claim(folder, depends_on(), {"scenes": {"training": plan.training, "test": plan.test}})
        prepare_laws(plan.entries)
        journal = Journal(folder)
        with processes(workers)(run) as pool:
            for group in plan.groups:
                for tasks in plan.stages(group, journal):
                    if not finish(tasks, journal, pool, deadline, str(group)):
                        return False
    return True


def finish(
    tasks: Iterable[Task],
    journal: Journal,
    workers: Workers,
    deadline: float = np.inf,
    name: str = "runs",
) -> bool:
    """Make those of some runs that are not in the journal; return False if there was no time."""
    missing = {key_of(task.keys): task for task in tasks}
    missing = {key: task for key, task in missing.items() if key not in journal}
    calls = {key: (task,) for key, task in missing.items()}
    limits = {key: task.limit for key, task in missing.items()}
    if not missing:
        return True
    if time.monotonic() > deadline:
        return False
    for done, (key, answer) in enumerate(workers.run(calls, limits), 1):
        line = without_answer(missing[key], answer) if isinstance(answer, Failure) else answer
        journal.add(line)
        print(f"\r{name}: {done} of {len(missing)} runs", end="", file=sys.stderr, flush=True)
        if time.monotonic() > deadline and done < len(missing):
            print("; the time is up", file=sys.stderr)
            return False
    print(file=sys.stderr)
    return True


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command, and return its exit code."""
    parser = ArgumentParser(prog="python -m checks.stacks", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    running = commands.add_parser("run", help="tune and run")
    running.add_argument("envs", type=Path, help="folder of the environments of the adapters")
    running.add_argument("--out", type=Path, default=Path("stacks-in-view"))
    running.add_argument("--workers", type=int, help="processes; all cores by default")
    running.add_argument("--minutes", type=float, default=np.inf, help="time for this command")
    running.add_argument("--training", type=int, default=TRAINING, help="scenes per family")
    running.add_argument("--test", type=int, default=TEST, help="scenes per family")
    for name in ("entry", "family", "condition"):
        running.add_argument(f"--{name}", action="append", help="only this one")
    asked = parser.parse_args(arguments)
    if min(asked.training, asked.test) < 1 or not asked.minutes > 0.0:
        parser.error("--training and --test must be 1 or more, and --minutes positive")
    try:
        complete = make_runs(Plan.of(asked), asked.out, asked.workers, asked.minutes)
    except VsconstraintsError as error:
        parser.exit(2, f"{error}\n")
    print("all runs are made" if complete else "the same command continues", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
