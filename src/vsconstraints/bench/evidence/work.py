"""Batches of scenes with all conditions and controllers, and the tables of their runs.

A batch is the unit of work that is sent to a worker.
"""

from __future__ import annotations

import json
import time
from collections.abc import Collection, Sequence
from contextlib import chdir, nullcontext
from dataclasses import dataclass, replace
from itertools import groupby, product, zip_longest
from math import ceil
from typing import Any, NamedTuple

from ...comparisons.experiment import Entries
from ...comparisons.metrics import score
from ...comparisons.record import RunRecord
from ...comparisons.run import failed_record, failed_score
from ...comparisons.runs.law_process import LawRun, simulate_law
from ...comparisons.runs.spec import BASELINE, ControllerSpec, RunSpec
from ...errors import ConfigurationError, described
from ...plugins.classes import beside
from ...plugins.processes import deadline
from ...plugins.provenance import Files, own_parts_noted
from ...simulation import RunWorkspace, Setup, until_settled
from ..families import Drawn, Family
from . import parquet
from .campaign import Campaign
from .own_files import has_own_parts, named, own_folders, require_unchanged_files
from .parquet import TABLES

# Maximum number of runs of a batch, unless a single scene has more. It limits what an interrupt
# loses to some 12 s, and the size of a file to a hundred kilobytes. Results do not depend on it.
RUNS_OF_TASK = 600
MIN_TASKS = 16  # minimum number of batches of a family; results do not depend on it

NO_FILES: Files = {}

Lines = dict[str, list[dict[str, Any]]]  #: Lines by table, each with its values by column.


@dataclass(frozen=True)
class Shard:
    """Part of the scenes of a campaign that one of several machines runs.

    It is part ``number`` of ``of``, counted from 1.
    """

    number: int = 1
    of: int = 1

    @classmethod
    def parsed(cls, text: str) -> Shard:
        """Return the shard denoted by ``i/n``. Raises ConfigurationError for any other text."""
        number, slash, of = text.partition("/")
        if not (slash and number.isdecimal() and of.isdecimal() and 1 <= int(number) <= int(of)):
            raise ConfigurationError(
                f"--shard must be i/n with i from 1 to n, such as 2/4, not {text!r}"
            )
        return cls(int(number), int(of))

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"

    def scenes(self, count: int) -> range:
        """Return the consecutive scene numbers of this shard out of ``count`` scenes."""
        return range((self.number - 1) * count // self.of, self.number * count // self.of)


@dataclass(frozen=True)
class Batch:
    """Scenes of one family with all data that a worker needs to run them.

    Each of the ``scenes`` is run in every condition with every controller, the unconstrained
    baseline first. ``limit`` is the time limit of one step [s], where a step draws one scene or
    makes one run; the process of the worker is ended after it. ``single`` is the only controller
    whose runs are requested; None requests the runs of all controllers and the line of each scene.
    ``drawn`` is the only scene, if it is already drawn.
    """

    family: Family
    scenes: tuple[int, ...]
    conditions: tuple[str, ...]
    controllers: Entries
    half: str
    seed: int
    limit: float | None = None
    single: str | None = None
    drawn: Drawn | None = None

    @property
    def name(self) -> str:
        """Name of the shard."""
        return shard_name(self.family.name, self.scenes)

    def pieces(self) -> list[Batch]:
        """Split the batch into one batch for each run.

        For each scene, a further batch without runs returns the line of the scene.
        """
        own = [replace(self, scenes=(number,)) for number in self.scenes]
        runs = product(own, self.conditions, self.controllers)
        pieces = [replace(task, conditions=()) for task in own]
        return pieces + [
            replace(task, conditions=(name,), single=entry.name) for task, name, entry in runs
        ]


def shard_name(family: str, scenes: Sequence[int]) -> str:
    """Return the name of the shard of these scenes: family, first and last scene."""
    return f"part-{family}-{scenes[0]:07d}-{scenes[-1]:07d}"


ALL = Shard()


def make_batch(
    campaign: Campaign, family: Family, scenes: Sequence[int], limit: float | None = None
) -> Batch:
    """Return the batch of scenes that are run in the same conditions.

    Without ``limit``, the time limit follows from the number of samples of a run.
    """
    limit = limit or max(each.run_limit(family.tables) for each in campaign.controllers)
    conditions = campaign.conditions_of(family, scenes[0])
    return Batch(
        family, tuple(scenes), conditions, campaign.controllers, campaign.half, campaign.seed, limit
    )


def plan_batches(
    campaign: Campaign,
    shard: Shard = ALL,
    limit: float | None = None,
    there: Collection[tuple[str, int]] = (),
) -> list[Batch]:
    """Split the scenes of a campaign, except those already ``there``, into batches.

    Families are interleaved, so that a slow family does not end up alone in the last batches.
    """
    scenes = shard.scenes(campaign.scenes)

    def of_family(family: Family) -> list[Batch]:
        runs = len(campaign.conditions_of(family)) * len(campaign.controllers)
        size = max(1, min(RUNS_OF_TASK // runs, ceil(len(scenes) / MIN_TASKS)))
        missing = (number for number in scenes if (family.name, number) not in there)
        alike = groupby(
            missing, key=lambda number: (number // size, campaign.conditions_of(family, number))
        )
        return [make_batch(campaign, family, list(batch), limit) for _, batch in alike]

    in_turn = zip_longest(*map(of_family, campaign.families))
    return [task for tasks in in_turn for task in tasks if task is not None]


class Part(NamedTuple):
    """Result of a batch: Arrow tables, process time [s] and the files of custom parts.

    ``files`` are the :mod:`.own_files` that the results depend on.
    """

    runs: Any
    rows: Any
    scenes: Any
    seconds: float
    files: Files

    @classmethod
    def of(cls, lines: Lines, seconds: float, files: Files = NO_FILES) -> Part:
        """Return the result built from lines by table."""
        tables = (parquet.table(columns, lines[name]) for name, columns in TABLES.items())
        return cls._make((*tables, seconds, dict(files)))

    @classmethod
    def joined(cls, parts: Sequence[Part]) -> Part:
        """Join results in the given order.

        Raises ConfigurationError if a file of a custom part changed between them.
        """
        *tables, seconds, files = zip(*parts, strict=True)
        together: Files = {}
        for own in files:
            require_unchanged_files(own, together)
            together.update(own)
        return cls._make((*map(parquet.joined, tables), sum(seconds), together))


def scored(task: Batch) -> Part:
    """Draw the scenes of a batch, run every controller in every condition, and score the runs.

    All controllers see the same noise in a scene. A run that fails becomes a line with its reason.
    The caller handles failures that end the process.
    """
    begun = time.perf_counter()
    lines: Lines = {name: [] for name in TABLES}
    own_parts = has_own_parts(task.controllers, [task.family])
    with (
        own_parts_noted() if own_parts else nullcontext(NO_FILES) as files,
        deadline(task.limit) as step,
    ):
        for number in task.scenes:
            step()
            scene, there = benches(task, number)
            if task.single is None:
                lines["scenes"].append(_scene_line(task, number, scene))
            for condition, bench in there.items():
                baseline = None
                for entry in task.controllers:
                    if task.single in (None, entry.name) or entry.name == BASELINE:
                        step()
                        record = bench.run(entry)
                        baseline = record if entry.name == BASELINE else baseline
                        if task.single in (None, entry.name):
                            _add(lines, task, (number, condition, entry.name), record, baseline)
    if own_parts:
        files = named(files, own_folders(task.controllers, [task.family]))
    return Part.of(lines, time.perf_counter() - begun, files)


def failed(task: Batch, reason: str) -> Part:
    """Return the result of a batch of one scene, or of one of its runs, whose process died."""
    lines: Lines = {name: [] for name in TABLES}
    (number,) = task.scenes
    if task.single is None:
        lines["scenes"].append(_scene_line(task, number, reason))
    else:
        _add(lines, task, (number, task.conditions[0], task.single), RunRecord.failed(reason, ""))
    return Part.of(lines, 0.0)


def benches(task: Batch, number: int) -> tuple[Drawn | str, dict[str, Bench]]:
    """Return a scene and its ``Bench`` for each condition, none if no scene was found.

    If drawing the scene raises an exception, which only custom parts do, the reason replaces the
    scene.
    """
    try:
        with chdir("."), beside(task.family.folder):
            scene, setups = (
                (task.drawn, {}) if task.drawn else task.family.set_up(number, task.half, task.seed)
            )
    # custom constraints can raise anything: the scene is listed with the reason
    except Exception as error:
        return described(error), {}
    return scene, {
        name: Bench(scene, name, setups.get(name)) for name in task.conditions if scene.found
    }


def _add(
    lines: Lines,
    task: Batch,
    key: tuple[int, str, str],
    record: RunRecord,
    baseline: RunRecord | None = None,
) -> None:
    try:
        run = score(record, baseline)
    except Exception as error:  # arrays of custom parts can hold anything
        run = failed_score(f"the run cannot be scored: {described(error)}")
    names = ("family", "half", "scene", "condition", "controller")
    keys = dict(zip(names, (task.family.name, task.half, *key), strict=True))
    lines["runs"].append({**keys, **run.result})
    lines["rows"] += [
        {**keys, **row}
        for row in run.constraints
        if row["challenged"] or row["violation_depth"] > 0.0 or row["active_time_s"] > 0.0
    ]


def _scene_line(task: Batch, number: int, scene: Drawn | str) -> dict[str, Any]:
    if isinstance(scene, str):  # the scene could not be drawn: only the reason is known
        scene = Drawn(
            task.family.name, number, task.half, task.seed, task.family.folder, rejected={scene: 1}
        )
    return {
        "family": task.family.name,
        "half": task.half,
        "scene": number,
        **{name: getattr(scene, name) for name in ("found", "attempts", "share_to_hold")},
        "rejected": _json(scene.rejected),
        "challenged": "; ".join(scene.challenged),
        "values": _json(scene.values),
        "least_time_s": scene.least_time,
        "duration_s": scene.duration,
    }


def _json(data: Any) -> str:
    return json.dumps(dict(data), ensure_ascii=False, default=lambda value: value.tolist())


class Bench:
    """One scene in one condition, on which controllers are run one after the other.

    The setup is reused after runs that leave no state in it, and rebuilt after all others. Custom
    laws run in separate processes.
    """

    def __init__(self, scene: Drawn, condition: str, setup: Setup | None = None) -> None:
        self._scene = scene
        self._condition = condition
        self._setup = setup
        self._ready: tuple[RunWorkspace, list[str]] | None = None

    def run(self, entry: ControllerSpec) -> RunRecord:
        """Run one controller and return the record.

        Any exception except an interrupt gives a failed run with its reason.
        """
        scene = self._scene
        try:
            # custom parts may change the working directory, and import neighboring modules at any
            # time
            with chdir("."), entry.importing_beside(scene.folder):
                scenario = scene.scenario(self._condition)
                own_parts = bool(scenario.own_parts)
                if self._ready is None:
                    setup = self._setup
                    self._setup = None
                    setup = until_settled(
                        scene.setup(self._condition) if setup is None or own_parts else setup
                    )
                    prepared = RunWorkspace(setup)
                    self._ready = prepared, setup.check_start(prepared.world)
                prepared, remarks = self._ready
                self._ready = None
                setup = entry.run.of(prepared.setup)
                same = prepared if setup is prepared.setup else None
                spec = RunSpec(scenario, entry, seed=scene.noise)
                law_run = LawRun(spec, setup.time_limit, in_own_process=entry.in_own_process)
                trajectory = simulate_law(law_run, setup, remarks, same)
                record = RunRecord.of(setup, trajectory, "")
        except BaseException as error:
            return failed_record(error)
        left_as_it_was = entry.in_own_process or ":" not in entry.law
        if record.trajectory.status != "failed" and left_as_it_was and not own_parts:
            self._ready = prepared, remarks
        return record
