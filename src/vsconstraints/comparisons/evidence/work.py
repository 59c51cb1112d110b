"""The unit of work: a batch of scenes with all its conditions and controllers, and the tables of
its runs.
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

from ...errors import ConfigurationError, described
from ...plugins.classes import beside
from ...plugins.processes import INTERRUPTS, deadline
from ...plugins.provenance import Files, own_parts_noted
from ...scenarios.families import Drawn, Family
from ...simulation import Prepared, Setup, simulate, until_settled
from ..experiment import Entries
from ..metrics import score
from ..record import RunRecord
from ..runs.law_process import LawFailedError, LawRun, simulate_apart
from ..runs.machine import run_limit
from ..runs.spec import BASELINE, ControllerSpec
from . import parquet
from .campaign import Campaign
from .own_files import demand_unchanged_files, has_own_parts, named, own_folders
from .parquet import TABLES

# Maximum number of runs of a task, unless a scene has more (what an interrupt loses, and a file
# that is written: some 12 s and a hundred kilobytes), and how many tasks a family is split into at
# least. No result depends on either.
RUNS_OF_TASK = 600
MIN_TASKS = 16

NO_FILES: Files = {}

Lines = dict[str, list[dict[str, Any]]]  #: Lines by table, each with its values by column.


@dataclass(frozen=True)
class Shard:
    """The part of a campaign's scenes that one of several machines takes: ``number`` of ``of``,
    from 1.
    """

    number: int = 1
    of: int = 1

    @classmethod
    def parsed(cls, text: str) -> Shard:
        """The shard that ``i/n`` means; raises ConfigurationError."""
        number, slash, of = text.partition("/")
        if not (slash and number.isdecimal() and of.isdecimal() and 1 <= int(number) <= int(of)):
            raise ConfigurationError(
                f"--shard takes i/n with i from 1 to n, such as 2/4, not {text!r}"
            )
        return cls(int(number), int(of))

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"

    def scenes(self, count: int) -> range:
        """Consecutive numbers of its scenes, of ``count`` in all."""
        return range((self.number - 1) * count // self.of, self.number * count // self.of)


@dataclass(frozen=True)
class Batch:
    """All that a worker needs, so that it can be sent anywhere.

    Each of the ``scenes`` of a family is run in every condition with every controller, the
    unconstrained baseline first. One step, drawing a scene or one run, may take ``limit`` [s] until
    the worker's process is ended. ``single`` is the only controller whose runs are requested; None
    for all, and the line of each scene. ``drawn`` is the only scene if it is there already.
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
        """Of its shard: family, first and last scene."""
        return f"part-{self.family.name}-{self.scenes[0]:07d}-{self.scenes[-1]:07d}"

    def pieces(self) -> list[Batch]:
        """One task for each run, and one for the lines of each scene without any."""
        own = [replace(self, scenes=(number,)) for number in self.scenes]
        runs = product(own, self.conditions, self.controllers)
        pieces = [replace(task, conditions=()) for task in own]
        return pieces + [
            replace(task, conditions=(name,), single=entry.name) for task, name, entry in runs
        ]


ALL = Shard()


def task_of(
    campaign: Campaign, family: Family, scenes: Sequence[int], limit: float | None = None
) -> Batch:
    """The task of scenes that are run in the same conditions; without ``limit`` by a run's
    samples.
    """
    limit = limit or run_limit(family.tables)
    conditions = campaign.conditions_of(family, scenes[0])
    return Batch(
        family, tuple(scenes), conditions, campaign.controllers, campaign.half, campaign.seed, limit
    )


def tasks_of(
    campaign: Campaign,
    shard: Shard = ALL,
    limit: float | None = None,
    there: Collection[tuple[str, int]] = (),
) -> list[Batch]:
    """A campaign's tasks, but for scenes that are ``there``: of all families in turn, so that no
    slow one is left.
    """
    scenes = shard.scenes(campaign.scenes)

    def of_family(family: Family) -> list[Batch]:
        runs = len(campaign.conditions_of(family)) * len(campaign.controllers)
        size = max(1, min(RUNS_OF_TASK // runs, ceil(len(scenes) / MIN_TASKS)))
        missing = (number for number in scenes if (family.name, number) not in there)
        alike = groupby(
            missing, key=lambda number: (number // size, campaign.conditions_of(family, number))
        )
        return [task_of(campaign, family, list(batch), limit) for _, batch in alike]

    in_turn = zip_longest(*map(of_family, campaign.families))
    return [task for tasks in in_turn for task in tasks if task is not None]


class Part(NamedTuple):
    """The result of a task: Arrow tables, how long it took [s], and the :mod:`.own_files` that it
    depends on.
    """

    runs: Any
    rows: Any
    scenes: Any
    seconds: float
    files: Files

    @classmethod
    def of(cls, lines: Lines, seconds: float, files: Files = NO_FILES) -> Part:
        """From lines by table."""
        tables = (parquet.table(columns, lines[name]) for name, columns in TABLES.items())
        return cls._make((*tables, seconds, dict(files)))

    @classmethod
    def joined(cls, parts: Sequence[Part]) -> Part:
        """All of them as one, in their order; raises ConfigurationError if own files changed
        meanwhile.
        """
        *tables, seconds, files = zip(*parts, strict=True)
        together: Files = {}
        for own in files:
            demand_unchanged_files(own, together)
            together.update(own)
        return cls._make((*map(parquet.joined, tables), sum(seconds), together))


def scored(task: Batch) -> Part:
    """Draw the scenes of a task, run every controller on each in every condition with the same
    noise, and score that.

    A run that fails in any way becomes a line with its reason; what ends the process is left to the
    caller.
    """
    begun = time.perf_counter()
    lines: Lines = {name: [] for name in TABLES}
    nothing: Files = {}
    own_parts = has_own_parts(task.controllers, [task.family])
    with (
        own_parts_noted() if own_parts else nullcontext(nothing) as files,
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
    """The result of a task of one scene, or of one run of it, that no process survives."""
    lines: Lines = {name: [] for name in TABLES}
    (number,) = task.scenes
    if task.single is None:
        lines["scenes"].append(_scene_line(task, number, reason))
    else:
        _add(lines, task, (number, task.conditions[0], task.single), RunRecord.failed(reason, ""))
    return Part.of(lines, 0.0)


def benches(task: Batch, number: int) -> tuple[Drawn | str, dict[str, Bench]]:
    """A scene, and what its runs are made on by condition: nothing if none is found.

    Instead of the scene the reason if drawing it raised something, which only own parts do.
    """
    try:
        with chdir("."), beside(task.family.folder):
            scene, setups = (
                (task.drawn, {}) if task.drawn else task.family.set_up(number, task.half, task.seed)
            )
    # own constraints can raise anything: the scene is listed with the reason
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
    except Exception as error:  # arrays of own parts can be anything
        run = score(RunRecord.failed(f"the run cannot be scored: {described(error)}", ""), None)
    names = ("family", "half", "scene", "condition", "controller")
    keys = dict(zip(names, (task.family.name, task.half, *key), strict=True))
    lines["runs"].append({**keys, **run.result})
    lines["rows"] += [
        {**keys, **row}
        for row in run.constraints
        if row["challenged"] or row["violation_depth"] > 0.0 or row["active_time_s"] > 0.0
    ]


def _scene_line(task: Batch, number: int, scene: Drawn | str) -> dict[str, Any]:
    if isinstance(scene, str):  # could not be drawn, and nothing else is known of it
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

    The setup is used again after runs that leave nothing in it, and made anew after others. Custom
    laws run in processes of their own.
    """

    def __init__(self, scene: Drawn, condition: str, setup: Setup | None = None) -> None:
        self._scene = scene
        self._condition = condition
        self._setup = setup
        self._ready: tuple[Prepared, list[str]] | None = None

    def run(self, entry: ControllerSpec) -> RunRecord:
        """A run; whatever goes wrong becomes a failed one with its reason."""
        scene = self._scene
        try:
            # own parts may change the working directory, and import what lies beside them whenever
            # they like
            with chdir("."), beside(scene.folder, entry.folder):
                own_parts = bool(scene.scenario(self._condition).own_parts)
                if self._ready is None:
                    setup = self._setup
                    self._setup = None
                    setup = until_settled(
                        scene.setup(self._condition) if setup is None or own_parts else setup
                    )
                    prepared = Prepared(setup)
                    self._ready = prepared, setup.check_start(prepared.world)
                prepared, remarks = self._ready
                self._ready = None
                setup = entry.run.of(prepared.setup)
                same = prepared if setup is prepared.setup else None
                if entry.apart:
                    scenario = scene.scenario(self._condition)
                    law_run = LawRun(
                        scenario, entry, seed=scene.noise, time_limit=prepared.setup.time_limit
                    )
                    trajectory = simulate_apart(law_run, setup, remarks, same)
                else:
                    trajectory = simulate(setup, entry.make(), remarks=remarks, prepared=same)
                record = RunRecord.of(setup, trajectory, "")
        except LawFailedError as failure:
            return RunRecord.failed(str(failure), "")
        except INTERRUPTS:
            raise
        # even SystemExit: this is where one run ends and the others begin
        except BaseException as error:
            return RunRecord.failed(described(error), "")
        left_as_it_was = entry.apart or ":" not in entry.law
        if record.trajectory.status != "failed" and left_as_it_was and not own_parts:
            self._ready = prepared, remarks
        return record
