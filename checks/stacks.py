"""``python -m checks.stacks run ENVS [--out FOLDER]``: runs of stacks beside laws.

Draws the scenes of ``comparisons/stacks.toml``, tunes two gains of each entry on training scenes,
and runs it with the chosen gains in held-out scenes. ENVS contains the environments of the adapters
(``python -m vsconstraints.stacks.environments ENVS``) and, as ``visp_stack``, the program of
``controllers/visp``. Finished runs are in FOLDER, and the same command continues.
``checks.stacks_page`` makes the kept table and the page from them.
"""

from __future__ import annotations

import json
import re
import sys
from argparse import ArgumentParser
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vsconstraints.bench.evidence import Campaign
from vsconstraints.bench.families import Drawn
from vsconstraints.comparisons.metrics import score
from vsconstraints.comparisons.record import RunRecord
from vsconstraints.comparisons.runs.identity import (
    Identity,
    differences,
    identity,
    in_words,
    scene_identity,
)
from vsconstraints.comparisons.runs.spec import BASELINE, ControllerSpec
from vsconstraints.errors import ConfigurationError, described
from vsconstraints.simulation import Setup, simulate
from vsconstraints.stacks.environments import interpreter

ROOT = Path(__file__).parents[1]
SUITE = ROOT / "comparisons" / "stacks.toml"
IDENTITY = "identity.json"  #: File of what the runs in a folder depend on.

GAINS = (0.75, 1.5, 3.0)  #: λ of the task [1/s].
VIEW_GAINS = (2.0, 8.0)  #: α of the field of view [1/s].
TRAINING = 2  #: Training scenes per family.
TEST = 8  #: Held-out scenes per family.
TIME_LIMIT = 10.0  #: Time in which a run must settle [s].
SHORTEST = 1.0  #: Shortest duration of a run [s]; a run that has settled ends.

#: Options of adapters for the gain of the field of view; the others have none.
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
    """Gains of the task and of the field of view [1/s]; ``view`` is NaN without one."""

    task: float
    view: float


def kind_of(entry: ControllerSpec) -> str:
    """Return the adapter of an entry, ``visp`` for a program, or the type of a law."""
    if "command" in entry.options:
        return "visp"
    return str(entry.options.get("adapter", entry.law))


def grid(entry: ControllerSpec) -> list[Gains]:
    """Return the gains that are tried for an entry."""
    kind = kind_of(entry)
    stack = ":" in entry.law
    has_view = kind in VIEW_OPTIONS if stack else kind not in WITHOUT_VIEW
    return [Gains(*pair) for pair in product(GAINS, VIEW_GAINS if has_view else (np.nan,))]


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
    if kind == "tsid":
        own = {"stiffness": stiffness, "damping": 3.0 * stiffness**0.5}
    elif ":" in entry.law:
        own = {"gain": gains.task}
        if kind in VIEW_OPTIONS:
            own[VIEW_OPTIONS[kind]] = gains.view
    else:
        if kind.startswith(("velocity-", "resolved-rate")):
            own = {"gain": gains.task}
        else:
            scene = {"task.Kp0": stiffness}
        if kind == "velocity-damper":
            # ξ / d_i is the rate at which the distance falls
            own |= {"influence": INFLUENCE, "speed": INFLUENCE * gains.view}
        elif kind == "resolved-rate-avoidance":
            # a zone in place of a rate: the slower the approach, the earlier it begins
            own["zone"] = 0.6 / gains.view
        elif kind not in WITHOUT_VIEW:
            own["K"] = {"fov": 1.0 / (SCENE_K * gains.view)}
    return replace(entry, options={**entry.options, **own}), scene


def installed(entry: ControllerSpec, folder: Path) -> ControllerSpec:
    """Return an entry with its environment or program below a folder."""
    own = dict(entry.options)
    if "adapter" in own:
        own["python"] = str(interpreter(folder, own["adapter"]))
    elif "command" in own:
        own["command"] = [str(folder / Path(own["command"][0]).name)]
    return replace(entry, options=own)


# --- Runs ---


@dataclass(frozen=True)
class Task:
    """One run: a scene in a condition, an entry and its gains."""

    scene: Drawn
    condition: str
    entry: ControllerSpec
    gains: Gains

    @property
    def key(self) -> tuple[str, ...]:
        """Everything that distinguishes the run, as texts."""
        where = self.scene.family, self.condition, self.scene.half, str(self.scene.number)
        return (*where, self.entry.name, *(f"{gain:g}" for gain in self.gains))


def setup_of(scene: Drawn, condition: str, changes: Mapping[str, float]) -> Setup:
    """Set up a run of a drawn scene that ends when it has settled, at the time limit at latest."""
    scenario = scene.scenario(condition)
    for key, value in changes.items():
        scenario = scenario.with_override(key, value)
    setup = scenario.setup(seed=scene.noise)
    return replace(setup, duration=SHORTEST, time_limit=TIME_LIMIT)


def run(task: Task) -> dict[str, Any]:
    """Run a task, and return its line of the table."""
    entry, changes = with_gains(task.entry, task.gains)
    setup = setup_of(task.scene, task.condition, changes)
    try:
        record = RunRecord.of(setup, simulate(setup, entry.make()), "")
    except Exception as error:  # a run that cannot begin is a line of the table, too
        record = RunRecord.failed(described(error), "")
    return {"key": task.key, **measured(setup, record)}


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
    return identity(campaign.controllers, families=families)


class Journal:
    """Lines of finished runs in a file, by key.

    With ``made_of``, what the runs depend on, it is kept beside them. Raises ConfigurationError if
    earlier runs in the folder depend on something else.
    """

    def __init__(self, folder: Path, made_of: Identity | None = None) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        kept = folder / IDENTITY
        if made_of is not None and kept.exists():
            earlier = json.loads(kept.read_text(encoding="utf-8"))
            changes = list(differences(earlier, made_of))
            if changes:
                raise ConfigurationError(
                    f"{folder} has runs of something else: {in_words(changes)}. Give another "
                    "folder with --out"
                )
        elif made_of is not None:
            kept.write_text(json.dumps(made_of), encoding="utf-8")
        self._path = folder / "runs.jsonl"
        self.lines: dict[tuple[str, ...], dict[str, Any]] = {}
        text = self._path.read_text(encoding="utf-8") if self._path.exists() else ""
        whole, _, rest = text.rpartition("\n")
        if rest:  # the last line of an interrupted command
            self._path.write_text(f"{whole}\n" if whole else "", encoding="utf-8")
        for text in whole.splitlines():
            line = json.loads(text)
            self.lines[tuple(line["key"])] = line

    def add(self, line: dict[str, Any]) -> None:
        """Store a line."""
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
        self.lines[tuple(line["key"])] = line


def score_of(line: dict[str, Any]) -> tuple[bool, float, float]:
    """Return whether a run is a success, its settling time and its margin."""
    success = line["status"] == "converged" and line["margin_px"] >= 0.0
    return success, line["settling_time_s"], line["margin_px"]


def chosen(lines: Iterable[dict[str, Any]]) -> Gains:
    """Return the gains with the most successes, of these those that settle first.

    Without a success they are those with the largest median margin in the image.
    """
    by_gains: dict[tuple[str, str], list[tuple[bool, float, float]]] = {}
    for line in lines:
        by_gains.setdefault((line["key"][-2], line["key"][-1]), []).append(score_of(line))

    def rank(gains: tuple[str, str]) -> tuple[float, ...]:
        scores = by_gains[gains]
        times = [time for success, time, _ in scores if success]
        margins = [margin if np.isfinite(margin) else -np.inf for *_, margin in scores]
        middle = float(np.median(times)) if times else np.inf
        return -len(times), middle, -float(np.median(margins)), *map(float, gains)

    best = min(by_gains, key=rank)
    return Gains(float(best[0]), float(best[1]))


@cache
def scenes_of(family_name: str, half: str, count: int) -> list[Drawn]:
    """Return the first scenes in which tracking, on the fastest arm, takes a marker out of view."""
    campaign = Campaign.load(SUITE)
    family = next(each for each in campaign.families if each.name == family_name)
    found: list[Drawn] = []
    number = 0
    while len(found) < count:
        scene = family.scene(number, half, campaign.seed)
        if scene.found and any(label.startswith("fov") for label in scene.challenged):
            found.append(scene)
        number += 1
    return found


class Plan(NamedTuple):
    """Entries, families and conditions of the comparison, and its numbers of scenes."""

    entries: tuple[ControllerSpec, ...]
    families: tuple[str, ...]
    conditions: tuple[str, ...]
    training: int = TRAINING
    test: int = TEST

    @classmethod
    def of(cls, envs: Path, asked: Any) -> Plan:
        """Return the plan of a command line."""
        campaign = Campaign.load(SUITE)
        own = [installed(each, envs) for each in campaign.controllers if each.name != BASELINE]
        entries = tuple(each for each in own if not asked.entry or each.name in asked.entry)
        families = tuple(asked.family or (each.name for each in campaign.families))
        conditions = tuple(asked.condition or campaign.conditions)
        return cls(entries, families, conditions, asked.training, asked.test)

    def cells(self, condition: str) -> Iterator[tuple[str, ControllerSpec]]:
        """Yield families and the entries that apply to them."""
        for family, entry in product(self.families, self.entries):
            feature = "image-points" if family.endswith("-image") else "camera-pose"
            if applies(entry, feature):
                yield family, entry

    def tuning(self, condition: str) -> Iterator[Task]:
        """Yield the runs with all gains on the training scenes."""
        for family, entry in self.cells(condition):
            for scene in scenes_of(family, "training", self.training):
                for gains in grid(entry):
                    yield Task(scene, condition, entry, gains)

    def testing(self, condition: str, journal: Journal) -> Iterator[Task]:
        """Yield the runs with the chosen gains on the held-out scenes."""
        for family, entry in self.cells(condition):
            begin = family, condition, "training"
            lines = [
                line
                for key, line in journal.lines.items()
                if key[:3] == begin and key[4] == entry.name
            ]
            if not lines:
                continue
            gains = chosen(lines)
            for scene in scenes_of(family, "held-out", self.test):
                yield Task(scene, condition, entry, gains)


def make_runs(plan: Plan, folder: Path, processes: int) -> None:
    """Make the runs of a plan that are not in the folder yet."""
    journal = Journal(folder, depends_on())
    with ProcessPoolExecutor(processes, get_context("spawn")) as workers:
        for condition in plan.conditions:
            finish(plan.tuning(condition), journal, workers, condition)
            finish(plan.testing(condition, journal), journal, workers, condition)


def finish(tasks: Iterable[Task], journal: Journal, workers: Executor, name: str) -> None:
    """Make runs and store their lines; those that are too late, on a busy machine, once more."""
    missing = [task for task in tasks if task.key not in journal.lines]
    late = _store(missing, journal, workers, name, keep_late=False)
    _store(late, journal, workers, f"{name}, once more", keep_late=True)


def _store(
    tasks: Sequence[Task],
    journal: Journal,
    workers: Executor,
    name: str,
    keep_late: bool,
) -> list[Task]:
    """Store the lines of runs, and return the runs that are too late, if these are not kept."""
    calls = {workers.submit(run, task): task for task in tasks}
    late = []
    for done, call in enumerate(as_completed(calls), 1):
        line = call.result()
        if keep_late or not re.search(TOO_LATE, line["reason"]):
            journal.add(line)
        else:
            late.append(calls[call])
        print(f"\r{name}: {done} of {len(tasks)} runs", end="", file=sys.stderr, flush=True)
    if tasks:
        print(file=sys.stderr)
    return late


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command, and return its exit code."""
    parser = ArgumentParser(prog="python -m checks.stacks", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    running = commands.add_parser("run", help="tune and run")
    running.add_argument("envs", type=Path, help="folder of the environments of the adapters")
    running.add_argument("--out", type=Path, default=Path("stacks-in-view"))
    running.add_argument("--processes", type=int, default=2)
    running.add_argument("--training", type=int, default=TRAINING, help="scenes per family")
    running.add_argument("--test", type=int, default=TEST, help="scenes per family")
    for name in ("entry", "family", "condition"):
        running.add_argument(f"--{name}", action="append", help="only this one")
    asked = parser.parse_args(arguments)
    make_runs(Plan.of(asked.envs.absolute(), asked), asked.out, asked.processes)
    return 0


if __name__ == "__main__":
    sys.exit(main())
